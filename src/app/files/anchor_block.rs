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
    for marker in markers {
        let _ = writeln!(
            text,
            "    {{ id = {}, size_m = {:.6}, center_m = [{:.6}, {:.6}], rotation_deg = {:.4} }},",
            marker.id,
            marker.size_m,
            marker.center_m.x,
            marker.center_m.y,
            marker.rotation_rad.to_degrees()
        );
    }
    text.push_str("]\n");
    text
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
