//! The picture's size that a camera's entries tell, however they name it.

use std::borrow::Borrow;

use serde_json::{Map, Value};

use super::entries::{Entry, entries, entry};
use super::lens::contradiction;
use super::values::{bad_side, number};
use crate::geometry::camera::MOST_SIDE_PX;

const SIDES: [&[&str]; 2] = [&["imagewidth", "width"], &["imageheight", "height"]];
/// Beside letters; elsewhere they may be a matrix's or a board's.
const SIDES_OF_LETTERS: [&[&str]; 2] = [
    &["width", "imagewidth", "w", "cols"],
    &["height", "imageheight", "h", "rows"],
];
const PAIRS: [&str; 5] = [
    "resolution",
    "imagesize",
    "imgsize",
    "imageresolution",
    "imagersize",
];

/// The size in a table, without the tables in it.
///
/// # Errors
/// Sides that no picture has, and two sizes that contradict each other.
pub(super) fn size_of(tree: &Map<String, Value>) -> Result<Option<[u32; 2]>, String> {
    let entries = entries(tree, 0);
    let found = size_among(&entries, SIDES)?;
    let side = |name: &str| entry(&entries, &[name]).and_then(|entry| side_px(entry.value));
    let short = || {
        side("w")
            .zip(side("h"))
            .map(|(width, height)| [width, height])
    };
    Ok(found.or_else(short))
}

/// The size of a camera by letters: that in the table of its focal length, or in the outermost, or the only one there is.
///
/// # Errors
/// As [`size_of`].
pub(super) fn size_beside(letters: &[Entry<'_>], table: usize) -> Result<Option<[u32; 2]>, String> {
    let within = |table: usize| {
        let entries: Vec<_> = letters
            .iter()
            .filter(|entry| entry.table == table)
            .collect();
        size_among(&entries, SIDES_OF_LETTERS)
    };
    for table in [table, 0] {
        if let Some(size_px) = within(table)? {
            return Ok(Some(size_px));
        }
    }
    let tables = letters.iter().map(|entry| entry.table).max().unwrap_or(0);
    let mut found: Option<[u32; 2]> = None;
    for table in 1..=tables {
        match (found, within(table)?) {
            (Some(before), Some(now)) if before != now => {
                return Err(format!(
                    "it has the picture sizes {} x {} and {} x {}, neither beside the focal length; keep the one that is meant",
                    before[0], before[1], now[0], now[1]
                ));
            }
            (_, now) => found = found.or(now),
        }
    }
    Ok(found)
}

/// The size of the entries of one table.
fn size_among<'a>(
    entries: &[impl Borrow<Entry<'a>>],
    sides: [&[&str]; 2],
) -> Result<Option<[u32; 2]>, String> {
    let find = |names: &[&str]| {
        let of = |name: &&str| {
            let mut entries = entries.iter().map(|entry| entry.borrow());
            entries.find(|entry| entry.name == **name)
        };
        names.iter().find_map(of)
    };
    let side = |names: &[&str]| {
        let side = find(names).map(|entry| {
            let side = side_px(entry.value).ok_or_else(|| bad_side(entry.key));
            side.map(|side| (entry.key, side))
        });
        side.transpose()
    };
    let pair = find(&PAIRS);
    let Some(((key, width), (_, height))) = side(sides[0])?.zip(side(sides[1])?) else {
        return pair.map(|pair| size(pair.value)).transpose();
    };
    match pair {
        Some(pair) if size(pair.value).is_ok_and(|other| other != [width, height]) => {
            Err(contradiction(key, pair.key))
        }
        _ => Ok(Some([width, height])),
    }
}

/// `[width, height]` or `{width, height}`.
pub(super) fn size(value: &Value) -> Result<[u32; 2], String> {
    let sides = match value.get("data").unwrap_or(value) {
        Value::Array(sides) if sides.len() == 2 => Some((&sides[0], &sides[1])),
        Value::Object(sides) => sides.get("width").zip(sides.get("height")),
        _ => None,
    };
    let sides = sides.and_then(|(width, height)| Some([side_px(width)?, side_px(height)?]));
    sides.ok_or_else(|| bad_side("the picture size [width, height]"))
}

/// The size of the camera of a number in a table of several: its own of a list of sizes (Basalt's), or that of all.
pub(super) fn size_of_one(
    tree: &Map<String, Value>,
    number: usize,
) -> Result<Option<[u32; 2]>, String> {
    let sizes = tree.get("resolution").and_then(Value::as_array);
    match sizes.filter(|sizes| sizes.first().is_some_and(Value::is_array)) {
        Some(sizes) => sizes.get(number).map(size).transpose(),
        None => size_of(tree),
    }
}

fn side_px(value: &Value) -> Option<u32> {
    let side = number(value)?;
    (side.fract() == 0.0 && (1.0..=f64::from(MOST_SIDE_PX)).contains(&side)).then_some(side as u32)
}
