//! `gnomon check`: what a scene says, for people.

use std::fmt::Write;

use glam::DVec3;

use crate::light::Light;
use crate::scene::{Anchor, DetectorKind, Object, Scene, Technique};

/// A summary of a scene: aligned plain text that ends with a line break.
pub fn summary(scene: &Scene) -> String {
    let mut text = String::new();
    line(&mut text, "source", &scene.camera.source);
    let calibration = scene
        .camera
        .calibration
        .as_ref()
        .map(|path| path.display().to_string());
    line(
        &mut text,
        "calibration",
        calibration
            .as_deref()
            .unwrap_or("what the recording carries"),
    );
    let detector = match scene.tracking.detector {
        DetectorKind::AprilTag => "libapriltag",
        DetectorKind::Aruco => "OpenCV's ArUco",
    };
    line(&mut text, "detector", detector);
    rows(
        &mut text,
        "tracked",
        scene.anchors.iter().enumerate().map(anchor_row).collect(),
    );
    rows(
        &mut text,
        "phantoms",
        scene
            .phantoms
            .iter()
            .map(|object| object_row(object, &scene.anchors))
            .collect(),
    );
    rows(
        &mut text,
        "virtuals",
        scene
            .virtuals
            .iter()
            .map(|object| object_row(object, &scene.anchors))
            .collect(),
    );
    rows(
        &mut text,
        "lights",
        scene.lights.iter().enumerate().map(light_row).collect(),
    );
    line(
        &mut text,
        "ambient",
        &format!("radiance {}", vector(scene.ambient_radiance)),
    );
    let (technique, reason) = scene.chosen_technique();
    let name = match technique {
        Technique::Volumes => "volumes",
        Technique::Auto => "auto",
    };
    line(&mut text, "technique", &format!("{name}: {reason}"));
    let budget = scene
        .shadows
        .frame_budget_ms
        .map(|budget_ms| format!(", frame budget {budget_ms} ms"));
    line(
        &mut text,
        "samples",
        &format!(
            "{} per pixel{}",
            scene.shadows.samples,
            budget.unwrap_or_default()
        ),
    );
    text
}

fn line(text: &mut String, label: &str, value: &str) {
    let padded = format!("{label:<12} {value}");
    text.push_str(padded.trim_end());
    text.push('\n');
}

/// Rows of cells in aligned columns, the label before the first.
fn rows(text: &mut String, label: &str, rows: Vec<Vec<String>>) {
    if rows.is_empty() {
        return line(text, label, "none");
    }
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        rows.iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count())
            .max()
    };
    let widths: Vec<usize> = (0..columns)
        .map(|column| width(column).unwrap_or(0))
        .collect();
    for (number, row) in rows.iter().enumerate() {
        let mut cells = String::new();
        for (cell, &width) in row.iter().zip(&widths) {
            // Writing to a text cannot fail.
            let _ = write!(cells, "{cell:<width$}  ");
        }
        line(text, if number == 0 { label } else { "" }, &cells);
    }
}

fn anchor_row((number, anchor): (usize, &Anchor)) -> Vec<String> {
    let markers = &anchor.markers;
    let family = markers
        .first()
        .map_or("no family", |marker| marker.family.name());
    let ids: Vec<u32> = markers.iter().map(|marker| marker.id).collect();
    let mut sizes_mm: Vec<String> = markers
        .iter()
        .map(|marker| short(marker.size_m * 1000.0))
        .collect();
    sizes_mm.sort();
    sizes_mm.dedup();
    vec![
        anchor.name.clone(),
        format!(
            "{} marker{}",
            markers.len(),
            if markers.len() == 1 { "" } else { "s" }
        ),
        family.to_owned(),
        format!("id {}", ranges(&ids)),
        format!("{} mm", sizes_mm.join(", ")),
        if number == 0 {
            "the world".to_owned()
        } else {
            String::new()
        },
    ]
}

fn object_row(object: &Object, anchors: &[Anchor]) -> Vec<String> {
    let report = &object.mesh_report;
    let mut notes = Vec::new();
    if report.merged_vertices > 0 {
        notes.push(format!("{} vertices merged", report.merged_vertices));
    }
    if report.dropped_triangles > 0 {
        notes.push(format!(
            "{} triangles without area dropped",
            report.dropped_triangles
        ));
    }
    if object.anchor_from_object.matrix3.determinant() < 0.0 {
        notes.push("mirrored".to_owned());
    }
    vec![
        object.name.clone(),
        format!(
            "on {}",
            anchors
                .get(object.anchor)
                .map_or("nothing", |anchor| &anchor.name)
        ),
        format!("{} triangles", object.mesh.triangles.len()),
        if report.closed {
            "closed".to_owned()
        } else {
            format!("{} open edges", report.open_edges)
        },
        if object.casts {
            "casts".to_owned()
        } else {
            "casts no shadow".to_owned()
        },
        notes.join(", "),
    ]
}

fn light_row((number, light): (usize, &Light)) -> Vec<String> {
    let (kind, place, power) = match light {
        Light::Point {
            position_m,
            intensity,
        } => (
            "point",
            format!("at {} m", vector(*position_m)),
            format!("intensity {}", vector(*intensity)),
        ),
        Light::Directional {
            direction,
            irradiance,
        } => (
            "directional",
            format!("towards {}", vector(*direction)),
            format!("irradiance {}", vector(*irradiance)),
        ),
    };
    vec![number.to_string(), kind.to_owned(), place, power]
}

fn vector(vector: DVec3) -> String {
    format!("[{}]", vector.to_array().map(short).join(", "))
}

/// A number with up to four digits after its point.
fn short(number: f64) -> String {
    let rounded = format!("{number:.4}");
    let trimmed = rounded.trim_end_matches('0').trim_end_matches('.');
    if trimmed == "-0" {
        "0".to_owned()
    } else {
        trimmed.to_owned()
    }
}

/// `0-5, 17` of 0 1 2 3 4 5 17.
fn ranges(ids: &[u32]) -> String {
    let mut ids = ids.to_vec();
    ids.sort_unstable();
    let runs = ids.chunk_by(|a, b| b.checked_sub(1) == Some(*a));
    let shown = runs.map(|run| match run {
        [only] => only.to_string(),
        [first, .., last] => format!("{first}-{last}"),
        [] => String::new(),
    });
    shown.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_ids_are_short() {
        assert_eq!(
            [1.0, -0.26, 1e-9, -1e-9, 45.0, 100.0].map(short),
            ["1", "-0.26", "0", "0", "45", "100"]
        );
        assert_eq!(ranges(&[3, 0, 1, 2, 17, 4294967295]), "0-3, 17, 4294967295");
        assert_eq!(ranges(&[]), "");
    }
}
