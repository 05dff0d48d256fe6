//! Dictionaries of markers that OpenCV does not have, from files as its `writeDictionary` writes them.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{LazyLock, Mutex};

use super::error::SceneError;
use super::mip_36h12::CODES;
use super::plain_file;

/// Markers of one size, each told from all others and from their turns.
#[derive(Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Dictionary {
    name: String,
    cells: u32,
    /// White cells, row by row; the first one is the highest of the `cells`² bits.
    codes: Vec<u64>,
    least_distance: u32,
}

/// Cells a side, without the border: more do not fit into a code's bits.
const CELLS: [u32; 2] = [3, 8];
const MOST_MARKERS: usize = 4096;

/// All that were read: a marker's family is copied freely, so what it names stays. One that is read again is not kept
/// again.
static READ: Mutex<Vec<&'static Dictionary>> = Mutex::new(Vec::new());

impl Dictionary {
    /// ArUco's MIP 36h12, which not every OpenCV has.
    pub fn mip_36h12() -> &'static Self {
        static MIP_36H12: LazyLock<Dictionary> = LazyLock::new(|| Dictionary {
            name: "DICT_ARUCO_MIP_36h12".to_owned(),
            cells: 6,
            codes: CODES.to_vec(),
            least_distance: 12,
        });
        &MIP_36H12
    }

    /// Reads a file in YAML: `nmarkers`, `markersize`, and `marker_0`, `marker_1` … with a 1 for each white cell.
    ///
    /// # Errors
    /// A file that cannot be read; a mistake in it, with its line.
    pub(super) fn read(path: &Path) -> Result<&'static Self, SceneError> {
        let text = plain_file::read_text(path).map_err(|error| {
            SceneError::of_file(path, format!("the dictionary cannot be read: {error}"))
        })?;
        let dictionary = Self::parse(path, &text)?;
        let mut read = READ
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(known) = read.iter().find(|known| ***known == dictionary) {
            return Ok(known);
        }
        let kept: &'static Self = Box::leak(Box::new(dictionary));
        read.push(kept);
        Ok(kept)
    }

    fn parse(path: &Path, text: &str) -> Result<Self, SceneError> {
        let mut entries: HashMap<&str, (&str, std::ops::Range<usize>)> = HashMap::new();
        let mut start = 0;
        for line in text.split_inclusive('\n') {
            let span = start..start + line.trim_end().len();
            start += line.len();
            let line = line.trim();
            if line.is_empty() || line.starts_with(['%', '#']) || line == "---" || line == "..." {
                continue;
            }
            let Some((key, value)) = line.split_once(':') else {
                let expected = "a key and its value are expected, like markersize: 6";
                return Err(SceneError::at(path, text, span, expected));
            };
            let entry = (value.trim().trim_matches(['"', '\'']), span.clone());
            if entries.insert(key.trim(), entry).is_some() {
                return Err(SceneError::at(path, text, span, "it is there twice"));
            }
        }
        let number = |key: &str, least: usize, most: usize| {
            let (value, span) = entries.get(key).ok_or_else(|| {
                SceneError::of_file(path, format!("no dictionary of OpenCV's: {key} is missing"))
            })?;
            let number = value.parse().ok();
            number
                .filter(|number| (least..=most).contains(number))
                .ok_or_else(|| {
                    let message = format!("{key}: a number from {least} to {most} is expected");
                    SceneError::at(path, text, span.clone(), message)
                })
        };
        let count = number("nmarkers", 1, MOST_MARKERS)?;
        let cells = number("markersize", CELLS[0] as usize, CELLS[1] as usize)?;
        let codes = (0..count).map(|id| {
            let key = format!("marker_{id}");
            let (value, span) = entries.get(key.as_str()).ok_or_else(|| {
                SceneError::of_file(path, format!("{key} of {count} markers is missing"))
            })?;
            let is_code = value.len() == cells * cells;
            let code = u64::from_str_radix(value, 2).ok().filter(|_| is_code);
            code.ok_or_else(|| {
                let message = format!("{key}: {} digits, each 0 or 1, are expected", cells * cells);
                SceneError::at(path, text, span.clone(), message)
            })
        });
        let codes = codes.collect::<Result<Vec<u64>, SceneError>>()?;
        let cells = cells as u32;
        let least_distance = least_distance(&codes, cells);
        if least_distance == 0 {
            let message = "two of its markers look alike, or one looks like itself when turned";
            return Err(SceneError::of_file(path, message));
        }
        Ok(Self {
            name: path.display().to_string(),
            cells,
            codes,
            least_distance,
        })
    }

    /// The path that it was read from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Cells a side, without the black border.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// Number of markers.
    pub fn id_count(&self) -> u32 {
        self.codes.len() as u32
    }

    /// In how many cells two markers differ at least, however they are turned.
    pub(super) fn least_distance(&self) -> u32 {
        self.least_distance
    }

    /// Per marker its cells, row by row, true for white; without the black border.
    pub fn markers(&self) -> impl Iterator<Item = Vec<bool>> {
        let bits = self.cells * self.cells;
        let cells = move |code: &u64| (0..bits).rev().map(|bit| code >> bit & 1 == 1).collect();
        self.codes.iter().map(cells)
    }
}

/// The fewest cells in which two codes differ, or one and its own turns.
fn least_distance(codes: &[u64], cells: u32) -> u32 {
    let mut least = cells * cells;
    for (k, &code) in codes.iter().enumerate() {
        let mut turned = code;
        for turns in 0..4 {
            // A code does not differ from itself unless it is turned.
            let others = if turns == 0 {
                &codes[..k]
            } else {
                &codes[..=k]
            };
            let distances = others.iter().map(|other| (turned ^ other).count_ones());
            least = least.min(distances.min().unwrap_or(least));
            turned = quarter_turn(turned, cells);
        }
    }
    least
}

fn quarter_turn(code: u64, cells: u32) -> u64 {
    let bit_of = |row: u32, column: u32| cells * cells - 1 - (row * cells + column);
    let mut turned = 0;
    for (row, column) in (0..cells).flat_map(|row| (0..cells).map(move |column| (row, column))) {
        let is_white = code >> bit_of(row, column) & 1;
        turned |= is_white << bit_of(column, cells - 1 - row);
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mip_36h12_is_as_far_apart_as_its_name_says() {
        assert_eq!(least_distance(&CODES, 6), 12);
    }

    const THREE: &str = "%YAML:1.0\n---\nnmarkers: 2\nmarkersize: 3\nmarker_0: \"110100000\"\nmarker_1: \"111001011\"\n";

    #[test]
    fn what_is_written_is_read() {
        let read = Dictionary::parse(Path::new("own.yml"), THREE).unwrap();
        assert_eq!((read.id_count(), read.cells()), (2, 3));
        let cells: Vec<String> = read
            .markers()
            .map(|cells| {
                cells
                    .iter()
                    .map(|&white| if white { '#' } else { '.' })
                    .collect()
            })
            .collect();
        assert_eq!(cells, ["##.#.....", "###..#.##"]);
        // Turned by hand: 110/100/000 is 011/001/000, 000/001/011, 000/100/110; 111/001/011 is 001/101/111 and so on.
        let first = ["110100000", "011001000", "000001011", "000100110"];
        let second = ["111001011", "001101111", "110100111", "111101100"];
        let differ = |a: &str, b: &str| a.bytes().zip(b.bytes()).filter(|(a, b)| a != b).count();
        let pairs = first
            .iter()
            .flat_map(|a| second.iter().map(|b| differ(a, b)));
        let turns = [first, second]
            .into_iter()
            .flat_map(|of| [1, 2, 3].map(|k| differ(of[0], of[k])));
        let least = pairs.chain(turns).min().unwrap();
        assert_eq!(read.least_distance() as usize, least);
    }

    #[test]
    fn mistakes_tell_their_line() {
        for (from, to, message) in [
            ("nmarkers: 2\n", "", "nmarkers is missing"),
            (
                "nmarkers: 2",
                "nmarkers: 0",
                "own.yml:3:1: nmarkers: a number from 1 to 4096",
            ),
            (
                "markersize: 3",
                "markersize: 9",
                "own.yml:4:1: markersize: a number from 3 to 8",
            ),
            (
                "nmarkers: 2",
                "nmarkers: 3",
                "marker_2 of 3 markers is missing",
            ),
            ("110100000", "11010000", "own.yml:5:1: marker_0: 9 digits"),
            ("110100000", "110100002", "9 digits"),
            ("marker_1", "marker_0", "own.yml:6:1: it is there twice"),
            ("111001011", "011001000", "look alike"),
            ("111001011", "101000101", "itself when turned"),
            ("---", "a list", "a key and its value"),
        ] {
            let text = THREE.replace(from, to);
            let error = Dictionary::parse(Path::new("own.yml"), &text).unwrap_err();
            assert!(error.to_string().contains(message), "{message}: {error}");
        }
    }
}
