//! The knobs of the technique.

use eframe::egui::{ComboBox, Ui};

use super::editing::{Editing, number, whole};
use crate::app::authoring::Edit;
use crate::app::live::command::Commands;
use crate::scene::format::{AnyKey, DIFFERENCE, SHADOWS, SHAFTS};
use crate::scene::{
    Difference, Quality, Scene, ShadowChange, ShaftSettings, Technique, VolumeCounting,
};

/// What a frame may take when a limit is first asked for, milliseconds.
const FIRST_BUDGET_MS: f64 = 16.0;

/// Shows them.
pub fn show(ui: &mut Ui, scene: &Scene, editing: &mut Editing, commands: &mut Commands) {
    let mut shadows = scene.shadows;
    ui.horizontal(|ui| {
        for (name, quality) in Quality::BY_NAME {
            let is_chosen = shadows.quality == Some(quality);
            if ui.selectable_label(is_chosen, name).clicked() && !is_chosen {
                shadows = shadows.with_quality(quality);
            }
        }
        ui.label("quality").on_hover_text(SHADOWS.quality.says());
    });
    let techniques: Vec<(&str, Technique)> = Technique::BY_NAME
        .into_iter()
        .filter(|(_, technique)| scene.probe.is_some() || !technique.needs_probe())
        .collect();
    choice(
        ui,
        ("technique", &SHADOWS.technique),
        &mut shadows.technique,
        &techniques,
    );
    let (technique, why) = scene.chosen_technique();
    ui.weak(format!("{}: {why}", technique.name()));
    ui.horizontal(|ui| {
        for &samples in SHADOWS.samples.takes.steps {
            ui.selectable_value(&mut shadows.samples, samples, samples.to_string());
        }
        ui.label("samples per pixel");
    });
    choice(
        ui,
        ("counting", &SHADOWS.counting),
        &mut shadows.counting,
        &VolumeCounting::BY_NAME,
    );
    let key = &SHADOWS.max_silhouette_error_px;
    let error_px = &mut shadows.max_silhouette_error_px;
    number(ui, "outlines may be off by", error_px, 0.02, &key.takes).on_hover_text(key.says());
    ui.horizontal(|ui| {
        let key = &SHADOWS.frame_budget_ms;
        let mut limited = shadows.frame_budget_ms.is_some();
        let mut budget_ms = shadows.frame_budget_ms.unwrap_or(FIRST_BUDGET_MS);
        ui.checkbox(&mut limited, "frame limit");
        if limited {
            number(ui, "of drawing", &mut budget_ms, 0.1, &key.takes).on_hover_text(key.says());
        }
        shadows.frame_budget_ms = limited.then_some(budget_ms);
    });
    if technique.has_shafts() {
        shaft_knobs(ui, &mut shadows.shafts);
    }
    if shadows != scene.shadows {
        let change = ShadowChange {
            from: scene.shadows,
            to: shadows,
        };
        editing.changed(ui, Edit::Shadows(change), commands);
    }
}

fn shaft_knobs(ui: &mut Ui, shafts: &mut ShaftSettings) {
    ui.horizontal(|ui| {
        let key = &SHAFTS.sources;
        let mut limited = shafts.sources.is_some();
        let mut sources = shafts.sources.or(*key.default()).unwrap_or(key.takes.most);
        ui.checkbox(&mut limited, "limit of sources");
        if limited {
            whole(ui, "with a shadow each", &mut sources, &key.takes).on_hover_text(key.says());
        }
        shafts.sources = limited.then_some(sources);
    });
    let key = &SHAFTS.patches;
    whole(ui, "patches of the room", &mut shafts.patches, &key.takes).on_hover_text(key.says());
    let map_name = shafts.map_px.to_string();
    ComboBox::from_label("pixels of a shadow map")
        .selected_text(map_name)
        .show_ui(ui, |ui| {
            for &side_px in SHAFTS.map_px.takes.steps {
                ui.selectable_value(&mut shafts.map_px, side_px, side_px.to_string());
            }
        });
    choice(
        ui,
        ("how light is taken away", &DIFFERENCE.difference),
        &mut shafts.difference,
        &[
            ("as a part of the light", Difference::Ratio),
            ("as radiance", Difference::Subtract),
            ("from encoded levels", Difference::Encoded),
        ],
    );
}

fn choice<T: PartialEq + Copy>(
    ui: &mut Ui,
    (name, key): (&str, &dyn AnyKey),
    value: &mut T,
    all: &[(&str, T)],
) {
    let shown = all.iter().find(|(_, named)| named == value);
    ComboBox::from_label(name)
        .selected_text(shown.map_or("", |(word, _)| word))
        .show_ui(ui, |ui| {
            for (word, choice) in all {
                ui.selectable_value(value, *choice, *word);
            }
        })
        .response
        .on_hover_text(key.says());
}
