//! Where the anchors are, and how well that is known.

use eframe::egui::{Color32, Grid, Ui};

use super::Facts;
use crate::tracking::{AnchorPose, Status};

/// Above this the calibration or the markers' sizes are wrong, pixels.
const MOST_REPROJECTION_PX: f64 = 1.0;

/// Shows it.
pub fn show(ui: &mut Ui, facts: &Facts<'_>) {
    let Some(picture) = facts.picture else {
        ui.weak("no picture yet");
        return;
    };
    if facts.scene.is_none() {
        let count = picture.detections.len();
        ui.label(format!("{count} markers of tag36h11 are seen"));
        return;
    }
    Grid::new("anchors")
        .num_columns(4)
        .striped(true)
        .show(ui, |ui| {
            for heading in ["anchor", "status", "markers", "error"] {
                ui.weak(heading);
            }
            ui.end_row();
            for (anchor, pose) in picture.anchors.iter().zip(&picture.poses) {
                ui.label(&anchor.name);
                let (word, colour) = status(pose);
                let told = ui.colored_label(colour, word);
                if let Some(why) = pose.why {
                    told.on_hover_text(why.to_string());
                }
                ui.label(format!("{} of {}", pose.markers, anchor.markers.len()));
                match pose.camera_from_anchor {
                    Some(_) => ui.label(format!("{:.2} px", pose.reprojection_px)),
                    None => ui.weak("–"),
                };
                ui.end_row();
            }
        });
    let worst_px = picture.poses.iter().map(|pose| pose.reprojection_px);
    if worst_px.fold(0.0, f64::max) > MOST_REPROJECTION_PX {
        ui.colored_label(
            ui.visuals().warn_fg_color,
            "Markers are more than a pixel off: calibrate the camera (gnomon calibrate), or measure them again.",
        );
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
