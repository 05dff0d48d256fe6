//! Where the anchors are, and how well that is known.

use eframe::egui::{Color32, Grid, Response, Ui};

use super::Facts;
use super::editing::{Editing, field};
use super::names::label;
use crate::app::authoring::Edit;
use crate::app::live::command::Commands;
use crate::scene::Scene;
use crate::scene::format::MARKER;
use crate::tracking::{AnchorPose, Status};

/// Above this the calibration or the markers' sizes are wrong, pixels.
const MOST_REPROJECTION_PX: f64 = 1.0;

/// Letters of an anchor's name that its column shows at most.
const IN_COLUMN: usize = 12;

/// Millimetres per point that a size is dragged.
const SPEED_MM: f64 = 0.02;

/// Shows it.
pub fn show(ui: &mut Ui, facts: &Facts<'_>, editing: &mut Editing, commands: &mut Commands) {
    let Some(picture) = facts.picture else {
        ui.weak("no picture yet");
        return;
    };
    let Some(scene) = facts.scene else {
        let count = picture.detections.len();
        ui.label(format!("{count} markers of tag36h11 are seen"));
        return;
    };
    Grid::new("anchors")
        .num_columns(5)
        .striped(true)
        .show(ui, |ui| {
            for heading in ["anchor", "status", "markers", "error", "size"] {
                ui.weak(heading);
            }
            ui.end_row();
            for (anchor, pose) in picture.anchors.iter().zip(&picture.poses) {
                let name = label(ui, &anchor.name, IN_COLUMN);
                let (word, colour) = status(pose);
                let told = ui.colored_label(colour, word);
                if let Some(why) = pose.loss_reason {
                    told.on_hover_text(why.to_string());
                }
                ui.label(format!("{} of {}", pose.markers, anchor.markers.len()));
                match pose.camera_from_anchor {
                    Some(_) => ui.label(format!("{:.2} px", pose.reprojection_px)),
                    None => ui.weak("–"),
                };
                size(ui, scene, &name, &anchor.name, editing, commands);
                ui.end_row();
            }
        });
    if let Some(camera) = picture.learnt {
        ui.label(camera.in_words());
    }
    let worst_px = picture.poses.iter().map(|pose| pose.reprojection_px);
    if worst_px.fold(0.0, f64::max) > MOST_REPROJECTION_PX {
        ui.colored_label(
            ui.visuals().warn_fg_color,
            "Markers are more than a pixel off: calibrate the camera (gnomon calibrate), or measure them again.",
        );
    }
}

/// The side of an anchor's first marker: a print that is larger or smaller than it should be is the usual mistake.
fn size(
    ui: &mut Ui,
    scene: &Scene,
    label: &Response,
    name: &str,
    editing: &mut Editing,
    commands: &mut Commands,
) {
    let anchor = scene.anchors.iter().find(|anchor| anchor.name == name);
    let Some(marker) = anchor.and_then(|anchor| anchor.markers.first()) else {
        return;
    };
    let mut size_mm = marker.size_m * 1e3;
    let allowed = MARKER.size_m.takes.scaled(1e3, "mm");
    let field = field(ui, &mut size_mm, SPEED_MM, &allowed).labelled_by(label.id);
    if field.changed() {
        let size_m = size_mm * 1e-3;
        let anchor = name.to_owned();
        editing.changed(ui, Edit::AnchorSize { anchor, size_m }, commands);
    }
}

fn status(pose: &AnchorPose) -> (&'static str, Color32) {
    match pose.status {
        Status::Tracked => ("tracked", Color32::from_rgb(80, 200, 110)),
        Status::Predicted => ("predicted", Color32::from_rgb(230, 180, 60)),
        Status::Ambiguous => ("ambiguous", Color32::from_rgb(230, 180, 60)),
        Status::Lost => ("lost", Color32::from_rgb(230, 90, 80)),
    }
}
