//! The knobs of the technique.

use eframe::egui::{ComboBox, DragValue, Ui};

use super::editing::{Editing, number};
use crate::app::authoring::Edit;
use crate::app::live::command::Commands;
use crate::geometry::outline_scale::LARGEST_MOVE_PX;
use crate::scene::{
    Counting, Difference, Quality, Scene, ShadowSettings, ShadowTechnique, ShaftSettings, Technique,
};

/// Samples per pixel that there are.
const SAMPLES: [u32; 2] = [1, 4];
/// What a frame may take when a limit is first asked for, milliseconds.
const FIRST_BUDGET_MS: f64 = 16.0;

/// Sources when a limit is first asked for.
const FIRST_SOURCES: u32 = 50;
/// Sides that a source's shadow map may have.
const MAP_SIDES_PX: [u32; 5] = [64, 128, 256, 512, 1024];

/// Shows them.
pub fn show(ui: &mut Ui, scene: &Scene, editing: &mut Editing, commands: &mut Commands) {
    let mut shadows = scene.shadows;
    ui.horizontal(|ui| {
        for (name, quality) in Quality::BY_NAME {
            let is_chosen = shadows.quality == Some(quality);
            if ui.selectable_label(is_chosen, name).clicked() && !is_chosen {
                shadows = ShadowSettings {
                    technique: shadows.technique,
                    frame_budget_ms: shadows.frame_budget_ms,
                    ..quality.shadows()
                };
            }
        }
        ui.label("quality");
    });
    choice(ui, "technique", &mut shadows.technique, &Technique::BY_NAME);
    let (technique, why) = scene.chosen_technique();
    ui.weak(format!("{}: {why}", technique.name()));
    ui.horizontal(|ui| {
        for samples in SAMPLES {
            ui.selectable_value(&mut shadows.samples, samples, samples.to_string());
        }
        ui.label("samples per pixel");
    });
    choice(ui, "counting", &mut shadows.counting, &Counting::BY_NAME);
    let error_px = &mut shadows.max_silhouette_error_px;
    number(ui, "outlines may be off by", error_px, 0.02, " px");
    shadows.max_silhouette_error_px = shadows.max_silhouette_error_px.clamp(0.0, LARGEST_MOVE_PX);
    ui.horizontal(|ui| {
        let mut limited = shadows.frame_budget_ms.is_some();
        let mut budget_ms = shadows.frame_budget_ms.unwrap_or(FIRST_BUDGET_MS);
        ui.checkbox(&mut limited, "frame limit");
        if limited {
            number(ui, "of drawing", &mut budget_ms, 0.1, " ms");
        }
        shadows.frame_budget_ms = limited.then_some(budget_ms.clamp(0.1, 1e6));
    });
    if technique == ShadowTechnique::Shafts {
        shaft_knobs(ui, &mut shadows.shafts);
    }
    if shadows != scene.shadows {
        editing.changed(ui, Edit::Shadows(shadows), commands);
    }
}

fn shaft_knobs(ui: &mut Ui, shafts: &mut ShaftSettings) {
    ui.horizontal(|ui| {
        let mut limited = shafts.sources.is_some();
        let mut sources = shafts.sources.unwrap_or(FIRST_SOURCES);
        ui.checkbox(&mut limited, "limit of sources");
        if limited {
            whole(ui, "with a shadow each", &mut sources, 1..=4096);
        }
        shafts.sources = limited.then_some(sources);
    });
    whole(ui, "patches of the room", &mut shafts.patches, 100..=20_000);
    let map_name = shafts.map_px.to_string();
    ComboBox::from_label("pixels of a shadow map")
        .selected_text(map_name)
        .show_ui(ui, |ui| {
            for side_px in MAP_SIDES_PX {
                ui.selectable_value(&mut shafts.map_px, side_px, side_px.to_string());
            }
        });
    choice(
        ui,
        "how light is taken away",
        &mut shafts.difference,
        &[
            ("as a part of the light", Difference::Ratio),
            ("as radiance", Difference::Subtract),
            ("from encoded levels", Difference::Encoded),
        ],
    );
}

fn whole(ui: &mut Ui, name: &str, value: &mut u32, range: std::ops::RangeInclusive<u32>) {
    ui.horizontal(|ui| {
        let field = DragValue::new(value)
            .range(range)
            .update_while_editing(false);
        let field = ui.add(field);
        let label = ui.label(name);
        field.labelled_by(label.id);
    });
}

fn choice<T: PartialEq + Copy>(ui: &mut Ui, name: &str, value: &mut T, all: &[(&str, T)]) {
    let shown = all.iter().find(|(_, named)| named == value);
    ComboBox::from_label(name)
        .selected_text(shown.map_or("", |(word, _)| word))
        .show_ui(ui, |ui| {
            for (word, choice) in all {
                ui.selectable_value(value, *choice, *word);
            }
        });
}
