//! The knobs of the technique.

use eframe::egui::{ComboBox, Ui};

use super::editing::{Editing, number};
use crate::app::authoring::Edit;
use crate::app::live::wish::Wish;
use crate::geometry::outline_scale::LARGEST_MOVE_PX;
use crate::scene::{Counting, Scene, Technique};

/// Samples per pixel that there are.
const SAMPLES: [u32; 2] = [1, 4];
/// What a frame may take when a limit is first asked for, milliseconds.
const FIRST_BUDGET_MS: f64 = 16.0;

/// Shows them.
pub fn show(ui: &mut Ui, scene: &Scene, editing: &mut Editing, wishes: &mut Vec<Wish>) {
    let mut shadows = scene.shadows;
    choice(ui, "technique", &mut shadows.technique, &Technique::BY_NAME);
    let (technique, why) = scene.chosen_technique();
    let mut names = Technique::BY_NAME.iter();
    if let Some((name, _)) = names.find(|(_, named)| *named == technique) {
        ui.weak(format!("{name}: {why}"));
    }
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
    if shadows != scene.shadows {
        editing.changed(ui, Edit::Shadows(shadows), wishes);
    }
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
