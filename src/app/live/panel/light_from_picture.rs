//! Leads through the clicks by which a light is found in the picture.

use eframe::egui::{Button, Ui};

use crate::app::live::command::{Clicks, Commands, SceneCommand};
use crate::geometry::light_placing::LightFreedom;

/// Pairs that fix a light at any distance, and one that is infinitely far.
const POINT_PAIRS: usize = 2;
const DIRECTIONAL_PAIRS: usize = 1;

/// Shows how far it has come.
pub fn show(ui: &mut Ui, clicks: Option<(usize, bool)>, commands: &mut Commands) {
    let Some((pairs, shadow_is_next)) = clicks else {
        let button = ui.button("Find the light in the picture");
        let hover =
            "holds the picture; then click corners of real things and the tips of their shadows";
        if button.on_hover_text(hover).clicked() {
            commands.push(SceneCommand::Clicks(Clicks::Begin));
        }
        return;
    };
    ui.label(match shadow_is_next {
        true => "Now click where the shadow of that corner falls.",
        false => "Click a corner of a real thing whose shadow is seen.",
    });
    ui.weak(format!(
        "{pairs} pairs: one fixes distant light, two a lamp"
    ));
    ui.horizontal_wrapped(|ui| {
        for (text, enabled, step) in [
            (
                "Lamp",
                pairs >= POINT_PAIRS,
                Clicks::Find(LightFreedom::Point),
            ),
            (
                "Distant light",
                pairs >= DIRECTIONAL_PAIRS,
                Clicks::Find(LightFreedom::Directional),
            ),
            ("Take back", pairs > 0 || shadow_is_next, Clicks::TakeBack),
            ("Cancel", true, Clicks::Cancel),
        ] {
            if ui.add_enabled(enabled, Button::new(text)).clicked() {
                commands.push(SceneCommand::Clicks(step));
            }
        }
    });
}
