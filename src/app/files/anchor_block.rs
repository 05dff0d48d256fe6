//! Anchors as the text that a scene file takes.

use std::fmt::Write as _;

use crate::scene::{Family, Ink, Marker};

/// What the text beside a printed sheet begins with.
pub const PRINTED: &str = "# Printed by gnomon markers";

/// A `[[board]]` of markers of one family.
pub fn board(name: &str, markers: &[Marker]) -> String {
    let name = toml::Value::from(name);
    let mut text = format!("[[board]]\nname = {name}\n");
    if let Some(first) = markers.first() {
        add_family(&mut text, first.family);
    }
    text.push_str("markers = [\n");
    let is_in_plane = markers.iter().all(Marker::is_in_plane);
    for marker in markers {
        let (id, size_m) = (marker.id, marker.size_m);
        let place = match is_in_plane {
            true => place_in_plane(marker),
            false => place_in_space(marker),
        };
        let _ = writeln!(text, "    {{ id = {id}, size_m = {size_m:.6}, {place} }},");
    }
    text.push_str("]\n");
    text
}

fn place_in_plane(marker: &Marker) -> String {
    let (center_m, rotation_rad) = (marker.center_m(), marker.rotation_rad());
    format!(
        "center_m = [{:.6}, {:.6}], rotation_deg = {:.4}",
        center_m.x,
        center_m.y,
        rotation_rad.to_degrees()
    )
}

fn place_in_space(marker: &Marker) -> String {
    let center_m = marker.center_m();
    let turns_deg = marker.rotation_deg();
    format!(
        "center_m = [{:.6}, {:.6}, {:.6}], rotation_deg = [{:.4}, {:.4}, {:.4}]",
        center_m.x, center_m.y, center_m.z, turns_deg.x, turns_deg.y, turns_deg.z
    )
}

/// A lone `[[marker]]`.
pub fn marker(name: &str, marker: &Marker) -> String {
    let name = toml::Value::from(name);
    let mut text = format!("[[marker]]\nname = {name}\n");
    add_family(&mut text, marker.family);
    let _ = writeln!(text, "id = {}\nsize_m = {:.6}", marker.id, marker.size_m);
    text
}

fn add_family(text: &mut String, family: Family) {
    let _ = writeln!(text, "family = \"{}\"", family.name());
    if family.border_cells() != 1 {
        let _ = writeln!(text, "border_cells = {}", family.border_cells());
    }
    if family.ink() == Ink::WhiteOnBlack {
        text.push_str("inverted = true\n");
    }
}
