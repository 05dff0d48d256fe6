//! Measurements that survive an interrupt: each is added to a file as it is made, and not made again by the same program
//! from the same inputs.

use std::fs::{self, File, OpenOptions};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The file of one chart. A unit is what is measured in one go; its rows stand in a block that begins with its name and
/// ends with an empty line, so that one cut off in the middle is known.
pub struct Measured {
    path: PathBuf,
    units: Vec<(String, String)>,
}

impl Measured {
    /// Opens the file; one that another program or other inputs made is begun anew.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub fn open(path: &Path, made_from: u64) -> Result<Self> {
        let head = format!("# made from {made_from:016x}\n\n");
        let known = fs::read_to_string(path).unwrap_or_default();
        let units = known.strip_prefix(&head).map(blocks);
        let mut measured = Self {
            path: path.to_owned(),
            units: Vec::new(),
        };
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).with_context(|| parent.display().to_string())?;
        }
        fs::write(path, head).with_context(|| path.display().to_string())?;
        for (unit, rows) in units.unwrap_or_default() {
            measured.append(&unit, rows)?;
        }
        Ok(measured)
    }

    /// Whether a unit has been measured.
    pub fn has(&self, unit: &str) -> bool {
        self.units.iter().any(|(known, _)| known == unit)
    }

    /// Adds a unit.
    ///
    /// # Errors
    /// A full disk.
    pub fn add<R: Serialize>(&mut self, unit: &str, rows: &[R]) -> Result<()> {
        self.append(unit, to_csv(rows, false)?)
    }

    fn append(&mut self, unit: &str, rows: String) -> Result<()> {
        let mut file: File = OpenOptions::new()
            .append(true)
            .open(&self.path)
            .with_context(|| self.path.display().to_string())?;
        file.write_all(format!("# {unit}\n{rows}\n").as_bytes())
            .with_context(|| self.path.display().to_string())?;
        self.units.push((unit.to_owned(), rows));
        Ok(())
    }

    /// The rows of some units, in their order.
    ///
    /// # Errors
    /// Rows that are none of this kind.
    pub fn rows<R: DeserializeOwned>(&self, units: &[String]) -> Result<Vec<R>> {
        let of = |unit: &String| self.units.iter().find(|(known, _)| known == unit);
        let blocks = units.iter().filter_map(of);
        let text: String = blocks.map(|(_, rows)| rows.as_str()).collect();
        from_csv(&text, false).with_context(|| self.path.display().to_string())
    }
}

/// The whole blocks of a file.
fn blocks(text: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some((block, after)) = rest.split_once("\n\n") {
        if let Some((unit, rows)) = block.strip_prefix("# ").and_then(|b| b.split_once('\n')) {
            found.push((unit.to_owned(), format!("{rows}\n")));
        }
        rest = after;
    }
    found
}

/// Rows as CSV, with the names of their columns or without.
///
/// # Errors
/// A row that is no flat structure.
pub fn to_csv<R: Serialize>(rows: &[R], named: bool) -> Result<String> {
    let mut writer = csv::WriterBuilder::new()
        .has_headers(named)
        .from_writer(Vec::new());
    for row in rows {
        writer.serialize(row)?;
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}

/// The rows of a CSV.
///
/// # Errors
/// Rows of another kind.
pub fn from_csv<R: DeserializeOwned>(text: &str, named: bool) -> Result<Vec<R>> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(named)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    Ok(reader.deserialize().collect::<Result<_, _>>()?)
}

/// A number that is another as soon as the settings or any of the inputs are: files, and all that lies in folders.
///
/// # Errors
/// An input that cannot be read.
pub fn made_from(settings: &impl Hash, inputs: &[PathBuf]) -> Result<u64> {
    let mut hasher = DefaultHasher::new();
    settings.hash(&mut hasher);
    for input in inputs {
        hash_path(input, &mut hasher).with_context(|| input.display().to_string())?;
    }
    Ok(hasher.finish())
}

/// The same of this program. To be asked at its start: later another build may lie in its place.
///
/// # Errors
/// The program's file cannot be read.
pub fn program_number() -> Result<u64> {
    let program = std::env::current_exe().context("where is this program?")?;
    made_from(&(), &[program])
}

fn hash_path(path: &Path, hasher: &mut DefaultHasher) -> std::io::Result<()> {
    if !path.is_dir() {
        fs::read(path)?.hash(hasher);
        return Ok(());
    }
    let entries = fs::read_dir(path)?.map(|entry| entry.map(|entry| entry.path()));
    let mut entries = entries.collect::<Result<Vec<_>, _>>()?;
    entries.sort();
    for entry in entries {
        entry.file_name().hash(hasher);
        hash_path(&entry, hasher)?;
    }
    Ok(())
}

/// A measured value with as many digits as are worth reading.
pub fn rounded(value: f64) -> f64 {
    const DIGITS: i32 = 4;
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let places = DIGITS - 1 - value.abs().log10().floor() as i32;
    let unit = 10_f64.powi(places);
    (value * unit).round() / unit
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    struct MeasuredRow {
        name: String,
        error_px: Option<f64>,
    }

    fn row(name: &str, error_px: Option<f64>) -> MeasuredRow {
        MeasuredRow {
            name: name.to_owned(),
            error_px,
        }
    }

    #[test]
    fn what_is_measured_stays_and_what_was_cut_off_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/chart.csv");
        let units = ["lamp".to_owned(), "hand".to_owned()];
        let mut measured = Measured::open(&path, 7).unwrap();
        let lamp = [row("a, b", Some(0.25)), row("c", None)];
        measured.add("lamp", &lamp).unwrap();
        measured.add("hand", &[row("d", Some(1.0))]).unwrap();
        let whole = fs::read_to_string(&path).unwrap();

        let again = Measured::open(&path, 7).unwrap();
        assert!(again.has("lamp") && again.has("hand") && !again.has("room"));
        assert_eq!(again.rows::<MeasuredRow>(&units).unwrap().len(), 3);
        assert_eq!(again.rows::<MeasuredRow>(&units[..1]).unwrap(), lamp);

        // Wherever the second unit was cut off, the first is whole and the second is gone.
        let second = whole.find("# hand").unwrap();
        for end in second..whole.len() {
            fs::write(&path, &whole[..end]).unwrap();
            let cut = Measured::open(&path, 7).unwrap();
            assert!(cut.has("lamp") && !cut.has("hand"), "{end}");
        }
        fs::write(&path, &whole).unwrap();
        let other = Measured::open(&path, 8).unwrap();
        assert!(!other.has("lamp"));
    }

    #[test]
    fn another_input_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let inputs = [folder.path().to_owned()];
        let numbers: Vec<u64> = [("a", "1"), ("a", "2"), ("b", "2")]
            .into_iter()
            .map(|(name, text)| {
                fs::write(folder.path().join(name), text).unwrap();
                made_from(&true, &inputs).unwrap()
            })
            .collect();
        assert!(numbers[0] != numbers[1] && numbers[1] != numbers[2]);
        assert_eq!(numbers[2], made_from(&true, &inputs).unwrap());
        assert_ne!(numbers[2], made_from(&false, &inputs).unwrap());
    }

    #[test]
    fn values_keep_four_digits() {
        assert_eq!(
            [0.123456, 98765.4, 0.0, -7.54321, 2.0].map(rounded),
            [0.1235, 98770.0, 0.0, -7.543, 2.0]
        );
    }
}
