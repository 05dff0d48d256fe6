//! `gnomon check`: what a scene says, for people.

mod budget;
pub mod first_look;
mod room;

use std::fmt::Write;

use glam::{DVec3, Vec3, Vec4};

use crate::app::scene_warnings::sizes::{length, sides_m};
use crate::app::scene_warnings::warnings;
use crate::app::talk::counted;
use crate::geometry::levels::{Level, levels};
use crate::geometry::mesh::{CornerLook, HeldCorner, MeshReport};
use crate::geometry::outline_scale::largest_scale;
use crate::light::{Light, Shape};
use crate::scene::SceneLight;
use crate::scene::format::LightKind;
use crate::scene::format::{SHADOWS, SHADOWS_SECTION};
use crate::scene::{
    Anchor, ClipInfo, DetectorKind, Face, Marker, Object, Quality, Scene, ShadowSettings, ShapeKind,
};
use budget::budget_line;
use room::room_lines;

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
            .unwrap_or("what the recording carries, else what its markers tell"),
    );
    let detector = match scene.tracking.detector {
        DetectorKind::ByFamily => {
            "by family: libapriltag for AprilTag's, OpenCV's ArUco for the others"
        }
        DetectorKind::AprilTag => "libapriltag",
        DetectorKind::Aruco => "OpenCV's ArUco",
    };
    line(&mut text, "detector", detector);
    rows(
        &mut text,
        "tracked",
        scene.anchors.iter().enumerate().map(anchor_row).collect(),
    );
    let with_levels = scene.shadows.max_silhouette_error_px > 0.0;
    rows(
        &mut text,
        "phantoms",
        scene
            .phantoms
            .iter()
            .map(|object| object_row(object, &scene.anchors, with_levels))
            .collect(),
    );
    rows(
        &mut text,
        "virtuals",
        scene
            .virtuals
            .iter()
            .map(|object| object_row(object, &scene.anchors, with_levels))
            .collect(),
    );
    rows(
        &mut text,
        "lights",
        (0..scene.lights.len())
            .map(|number| light_row(scene, number))
            .collect(),
    );
    line(
        &mut text,
        "ambient",
        &format!("radiance {}", vector(scene.ambient_radiance)),
    );
    for (label, told) in scene
        .probe
        .iter()
        .flat_map(|probe| room_lines(scene, probe))
    {
        line(&mut text, label, &told);
    }
    shadow_lines(&mut text, scene);
    for warning in warnings(scene) {
        text.push_str(&warning_line(&warning));
    }
    text
}

/// How shadows are made, and by which settings.
fn shadow_lines(text: &mut String, scene: &Scene) {
    let (technique, reason) = scene.chosen_technique();
    line(
        text,
        "technique",
        &format!("{}: {reason}", technique.name()),
    );
    if let Some(quality) = scene.shadows.quality {
        line(text, "quality", &quality_row(quality, &scene.shadows));
    }
    if let Some(budget) = budget_line(scene) {
        line(text, "budget", &budget);
    }
    line(
        text,
        "samples",
        &format!("{} per pixel", scene.shadows.samples),
    );
    let detail = match scene.shadows.max_silhouette_error_px {
        0.0 => "all triangles at any distance".to_owned(),
        error_px => format!(
            "silhouettes within {} {}",
            short(error_px),
            SHADOWS.max_silhouette_error_px.takes.unit
        ),
    };
    line(text, "detail", &detail);
}

/// A quality, and what the scene sets otherwise.
fn quality_row(quality: Quality, shadows: &ShadowSettings) -> String {
    let name = quality.name();
    let others = shadows.keys_beside_quality();
    match others.is_empty() {
        true => {
            let keys = SHADOWS_SECTION.keys();
            let set: Vec<&str> = keys
                .filter(|key| key.quality_text(quality).is_some())
                .map(|key| key.name())
                .collect();
            format!("{name}: {} are what it means", set.join(", "))
        }
        false => format!("{name}, but the scene sets {}", others.join(" and ")),
    }
}

/// A line of the summary for what more there is to warn of.
pub fn warning_line(warning: &str) -> String {
    let mut text = String::new();
    line(&mut text, "warning", warning);
    text
}

fn line(text: &mut String, label: &str, value: &str) {
    let padded = format!("{label:<12} {value}");
    text.push_str(padded.trim_end());
    text.push('\n');
}

/// A row of a table, and what there is to say about it.
#[derive(Default)]
struct TableRow {
    cells: Vec<String>,
    /// Empty, or what stands on a line of its own below the row.
    note: String,
}

/// Rows of cells in aligned columns, the label before the first; notes stand under the second column.
fn rows(text: &mut String, label: &str, rows: Vec<TableRow>) {
    if rows.is_empty() {
        return line(text, label, "none");
    }
    let columns = rows.iter().map(|row| row.cells.len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns)
        .map(|column| {
            let cells = rows.iter().filter_map(|row| row.cells.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        })
        .collect();
    for (number, row) in rows.iter().enumerate() {
        let mut cells = String::new();
        for (cell, &width) in row.cells.iter().zip(&widths) {
            // Writing to a text cannot fail.
            let _ = write!(cells, "{cell:<width$}  ");
        }
        line(text, if number == 0 { label } else { "" }, &cells);
        if !row.note.is_empty() {
            let indent = widths.first().map_or(0, |width| width + 2);
            line(text, "", &format!("{:indent$}{}", "", row.note));
        }
    }
}

fn anchor_row((number, anchor): (usize, &Anchor)) -> TableRow {
    let markers = &anchor.markers;
    let family = markers
        .first()
        .map_or("no family".to_owned(), |marker| marker.family.to_string());
    let ids: Vec<u32> = markers.iter().map(|marker| marker.id).collect();
    let mut sizes_mm: Vec<String> = markers
        .iter()
        .map(|marker| short(marker.size_m * 1000.0))
        .collect();
    sizes_mm.sort();
    sizes_mm.dedup();
    let cells = vec![
        anchor.name.clone(),
        format!(
            "{} marker{}",
            markers.len(),
            if markers.len() == 1 { "" } else { "s" }
        ),
        family,
        format!("id {}", ranges(&ids)),
        format!("{} mm", sizes_mm.join(", ")),
        [planes_in_words(markers), world_in_words(number)]
            .into_iter()
            .filter(|words| !words.is_empty())
            .collect::<Vec<_>>()
            .join(", "),
    ];
    TableRow {
        cells,
        ..TableRow::default()
    }
}

/// In how many planes the markers of a board in space lie; nothing of a flat one.
fn planes_in_words(markers: &[Marker]) -> String {
    match Face::all_of(markers).len() {
        0 | 1 => String::new(),
        planes => format!("in space, {planes} planes"),
    }
}

fn world_in_words(number: usize) -> String {
    match number {
        0 => "the world".to_owned(),
        _ => String::new(),
    }
}

fn object_row(object: &Object, anchors: &[Anchor], with_levels: bool) -> TableRow {
    let anchor = anchors
        .get(object.stands_on())
        .map_or("nothing", |anchor| &anchor.name);
    let mut notes = vec![material_note(object)];
    notes.extend(mesh_notes(&object.mesh_report));
    if with_levels && object.animation.is_none() {
        notes.extend(levels_note(object));
    }
    if object.anchor_from_object.matrix3.determinant() < 0.0 {
        notes.push("mirrored".to_owned());
    }
    if object
        .motion
        .as_ref()
        .is_some_and(|motion| !motion.is_none())
    {
        notes.push("moves by itself".to_owned());
    }
    notes.extend(animations_note(object));
    if !object.visible {
        notes.push("hidden".to_owned());
    }
    let casts = if object.casts {
        "casts"
    } else {
        "casts no shadow"
    };
    TableRow {
        cells: vec![
            object.name.clone(),
            format!("on {anchor}"),
            size_cell(object),
            mesh_cell(object),
            casts.to_owned(),
        ],
        note: notes.join(", "),
    }
}

/// The sides of the smallest box around a thing where it stands.
fn size_cell(object: &Object) -> String {
    let sides = sides_m(object).to_array().map(length);
    sides.join(" x ")
}

/// What a thing is made of, each material with its name and colour, and the memory that it takes.
fn material_note(object: &Object) -> String {
    /// So many say enough.
    const SHOWN: usize = 6;
    let mut told: Vec<String> = object
        .materials
        .iter()
        .enumerate()
        .take(SHOWN)
        .map(|(index, material)| {
            let name = object.material_names.get(index).map_or("", String::as_str);
            let mut told = format!("{name} albedo {}", vector(material.albedo));
            for (what, number) in [
                ("roughness", material.layer_roughness().unwrap_or(0.0)),
                ("metal", material.metallic),
            ] {
                if number > 0.0 {
                    told += &format!(" {what} {}", short(number));
                }
            }
            if material.opacity < 1.0 {
                told += &format!(" opacity {}", short(material.opacity));
            }
            if material.emission != DVec3::ZERO {
                told += &format!(" emission {}", vector(material.emission));
            }
            told.trim().to_owned()
        })
        .collect();
    if object.mesh.looks.iter().any(|look| look.color != Vec4::ONE) {
        told.push("vertex colours".to_owned());
    }
    if object.materials.len() > SHOWN {
        told.push(format!("{} more materials", object.materials.len() - SHOWN));
    }
    for texture in object.textures.iter().take(SHOWN) {
        let [width, height] = texture.size_px;
        told.push(format!("{} {width}x{height}", texture.name));
    }
    let mesh = &object.mesh;
    let bytes = mesh.positions.len() * size_of::<Vec3>()
        + mesh.triangles.len() * size_of::<([u32; 3], [Vec3; 3], u32)>()
        + mesh.looks.len() * size_of::<CornerLook>()
        + mesh.corner_looks.len() * size_of::<[u32; 3]>()
        + mesh.held.len() * size_of::<[HeldCorner; 3]>()
        + object
            .textures
            .iter()
            .map(|texture| texture.bytes())
            .sum::<usize>();
    told.push(match bytes {
        0..1_000_000 => format!("{} kB", bytes.div_ceil(1000)),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    });
    told.join(", ")
}

/// Size and topology of a mesh, and how it casts.
fn mesh_cell(object: &Object) -> String {
    let report = &object.mesh_report;
    let (topology, method) = if report.closed {
        ("closed".to_owned(), "silhouettes of one orientation")
    } else {
        (
            counted(report.open_edges, "open edge"),
            "signed edge multiplicity",
        )
    };
    let triangles = counted(object.mesh.triangles.len(), "triangle");
    let size = match object.shape {
        ShapeKind::Mesh => triangles,
        shape => format!("{} of {triangles}", shape.name()),
    };
    if object.casts {
        format!("{size}, {topology}: {method}")
    } else {
        format!("{size}, {topology}")
    }
}

/// The coarser versions that may stand for an object where no pixel tells, and how far they are measured to be off.
fn levels_note(object: &Object) -> Option<String> {
    /// The finest say enough.
    const SHOWN: usize = 4;
    let stretch = largest_scale(&object.anchor_from_object);
    let levels = levels(&object.mesh);
    let level = |level: &Level| {
        let [most, mean] =
            [level.max_error_m, level.mean_error_m].map(|error_m| error_m * stretch * 1000.0);
        let triangles = level.mesh.triangles.len();
        format!("{triangles} at {most:.3}/{mean:.3}")
    };
    let mut shown: Vec<String> = levels.iter().take(SHOWN).map(level).collect();
    if levels.len() > SHOWN {
        shown.push(format!("{} more", levels.len() - SHOWN));
    }
    let list = shown.join(", ");
    (!levels.is_empty()).then(|| format!("from afar at largest/mean error in mm: {list}"))
}

/// The animations of a thing's file, and which of them plays.
fn animations_note(object: &Object) -> Option<String> {
    /// So many say enough.
    const SHOWN: usize = 12;
    let playing = object.animation.as_ref();
    let told = |(number, clip): (usize, &ClipInfo)| {
        let name = match &clip.name[..] {
            "" => String::new(),
            name => format!(" \"{name}\""),
        };
        let plays = playing.filter(|playing| playing.number == number);
        let plays = plays.map_or(String::new(), |playing| {
            let once = if playing.loops { "" } else { ", once" };
            format!(" (plays at {} times its speed{once})", short(playing.speed))
        });
        format!("{number}{name} {} s{plays}", short(clip.duration_s))
    };
    let clips = object.clips.iter().enumerate();
    let is_shown = |(number, _): &(usize, &ClipInfo)| {
        *number < SHOWN || playing.is_some_and(|playing| playing.number == *number)
    };
    let mut shown: Vec<String> = clips.filter(is_shown).map(told).collect();
    if object.clips.len() > shown.len() {
        shown.push(format!("{} more", object.clips.len() - shown.len()));
    }
    (!shown.is_empty()).then(|| format!("animations {}", shown.join(", ")))
}

/// What was found in a mesh and done to it.
fn mesh_notes(report: &MeshReport) -> Vec<String> {
    let turned = counted(report.turned_triangles, "triangle");
    let counts = [
        (report.components, 1, format!("{} parts", report.components)),
        (
            report.crowded_edges,
            0,
            counted(report.crowded_edges, "edge") + " of more than two triangles",
        ),
        (
            report.merged_vertices,
            0,
            format!("merged {}", counted(report.merged_vertices, "vertex")),
        ),
        (
            report.dropped_without_area,
            0,
            format!("dropped {} without area", report.dropped_without_area),
        ),
        (
            report.dropped_duplicates,
            0,
            format!(
                "dropped {}",
                counted(report.dropped_duplicates, "duplicate")
            ),
        ),
        (
            report.splits,
            0,
            counted(report.splits, "cut") + " at vertices on edges",
        ),
        (report.turned_triangles, 0, format!("turned {turned}")),
    ];
    counts
        .into_iter()
        .filter(|(count, usual, _)| count > usual)
        .map(|(_, _, note)| note)
        .collect()
}

fn light_row(scene: &Scene, number: usize) -> TableRow {
    let SceneLight { anchor, light } = scene.lights[number];
    let (place, power, size) = match light {
        Light::Point {
            position_m,
            intensity,
            shape,
        } => (
            format!("at {} m", vector(position_m)),
            format!("intensity {}", vector(intensity)),
            shape_in_words(&shape),
        ),
        Light::Directional {
            direction,
            irradiance,
            angle_rad,
        } => (
            format!("towards {}", vector(direction)),
            format!("irradiance {}", vector(irradiance)),
            match angle_rad > 0.0 {
                true => format!("{}° wide", short(angle_rad.to_degrees())),
                false => String::new(),
            },
        ),
    };
    let kind = LightKind::of(&light).name().to_owned();
    let on = match anchor {
        0 => String::new(),
        _ => format!("on \"{}\"", scene.anchors[anchor].name),
    };
    TableRow {
        cells: vec![number.to_string(), kind, place, power, size, on],
        ..TableRow::default()
    }
}

fn shape_in_words(shape: &Shape) -> String {
    match shape {
        Shape::Point => String::new(),
        Shape::Spot {
            direction,
            inner_rad,
            outer_rad,
        } => format!(
            "towards {}, {}° to {}° off its axis",
            vector(*direction),
            short(inner_rad.to_degrees()),
            short(outer_rad.to_degrees())
        ),
        Shape::Sphere { radius_m } => format!("radius {} m", short(*radius_m)),
        Shape::Rect(rect) => format!(
            "{} m by {} m, towards {}",
            short(rect.size_m.x),
            short(rect.size_m.y),
            vector(rect.facing)
        ),
    }
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
