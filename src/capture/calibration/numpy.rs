//! Matrices as NumPy writes them: `savez` (.npz, as OpenCV's tutorial does), `save` (.npy) and `savetxt`, and KITTI's lists of
//! projections, which are text of the same kind.

use std::io::{Cursor, Read as _};

use half::f16;
use npyz::{DType, Endianness, NpyFile, TypeChar, TypeStr};
use serde_json::{Map, Value};
use zip::ZipArchive;

/// Bytes of the largest array that is read: a calibration's views may lie beside its matrices.
const MOST_BYTES: u64 = 1 << 20;
/// Numbers of the largest array that is looked at.
const MOST_NUMBERS: u64 = 64;
const MOST_ARRAYS: usize = 1000;
/// Bytes of the longest header that is looked into; NumPy's have 128 where an array has numbers.
const MOST_HEADER: usize = 512;
const MOST_BRACKETS: usize = 4;

/// Whether these are the bytes of an array or an archive of arrays.
pub(super) fn is_numpy(extension: &str, bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY") || extension == "npz" && bytes.starts_with(b"PK\x03\x04")
}

/// The arrays of an archive by their names; that of a file alone is a camera's matrix.
pub(super) fn tree(bytes: &[u8]) -> Result<Map<String, Value>, String> {
    let mut tree = Map::new();
    if bytes.starts_with(b"\x93NUMPY") {
        let matrix = numbers(bytes)?.ok_or("it is no matrix of 3 x 3 numbers")?;
        tree.insert("camera_matrix".to_owned(), matrix);
        return Ok(tree);
    }
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    if archive.len() > MOST_ARRAYS {
        return Err(format!("more than {MOST_ARRAYS} arrays"));
    }
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(|error| error.to_string())?;
        let name = entry.name().map_err(|error| error.to_string())?;
        let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else {
            continue;
        };
        let mut array = Vec::new();
        let read = entry.take(MOST_BYTES + 1).read_to_end(&mut array);
        read.map_err(|error| format!("{name}: {error}"))?;
        if array.len() as u64 > MOST_BYTES {
            continue;
        }
        if let Some(numbers) = numbers(&array).map_err(|why| format!("{name}: {why}"))? {
            tree.insert(name, numbers);
        }
    }
    Ok(tree)
}

/// The numbers of an array in rows, or its truth or text where it has one; `None` where they are so many that it is no camera's.
fn numbers(bytes: &[u8]) -> Result<Option<Value>, String> {
    // The header's length is trusted by whoever reads it: it must lie within the file.
    let length = match bytes.get(6..12) {
        Some(&[1, _, a, b, ..]) => usize::from(u16::from_le_bytes([a, b])) + 10,
        Some(&[_, _, a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as usize + 12,
        _ => usize::MAX,
    };
    if length > bytes.len() {
        return Err("the array is cut off".to_owned());
    }
    // (Of numbers alone it is short and has two brackets; its parser takes twice as long for each one more within another.)
    let brackets = bytes[..length]
        .iter()
        .filter(|byte| b"([{".contains(byte))
        .count();
    if length > MOST_HEADER || brackets > MOST_BRACKETS {
        return Ok(None);
    }
    let file = NpyFile::new(bytes).map_err(|error| error.to_string())?;
    let count = file
        .shape()
        .iter()
        .try_fold(1_u64, |count, side| count.checked_mul(*side));
    if count.is_none_or(|count| count > MOST_NUMBERS) {
        return Ok(None);
    }
    let in_columns = file.order() == npyz::Order::Fortran;
    let shape = file.shape().to_vec();
    let kind = match file.dtype() {
        DType::Plain(kind) => kind,
        other => return Ok(Some(unread(&other.descr()))),
    };
    let data = &bytes[length..];
    if let ([] | [1], Some(value)) = (shape.as_slice(), word(&kind, data)) {
        return Ok(Some(value));
    }
    let numbers: Result<Vec<f64>, _> = match (kind.type_char(), kind.num_bytes()) {
        (TypeChar::Float, Some(8)) => file.into_vec::<f64>(),
        (TypeChar::Float, Some(4)) => {
            (file.into_vec::<f32>()).map(|all| all.into_iter().map(f64::from).collect())
        }
        (TypeChar::Float, Some(2)) if kind.endianness() != Endianness::Big => {
            let count = shape.iter().product::<u64>() as usize;
            let halves = data.get(..2 * count).ok_or("the array is cut off")?;
            let number = |half: &[u8]| f16::from_le_bytes([half[0], half[1]]).to_f64();
            Ok(halves.chunks_exact(2).map(number).collect())
        }
        (TypeChar::Int, Some(4)) => {
            (file.into_vec::<i32>()).map(|all| all.into_iter().map(f64::from).collect())
        }
        (TypeChar::Int, Some(8)) => (file.into_vec::<i64>())
            .map(|all| all.into_iter().map(|number| number as f64).collect()),
        _ => return Ok(Some(unread(&file.dtype().descr()))),
    };
    let mut numbers = numbers.map_err(|error| error.to_string())?;
    if let (true, &[rows, columns]) = (in_columns, shape.as_slice()) {
        let place = |at: u64| (at % columns * rows + at / columns) as usize;
        numbers = (0..rows * columns).map(|at| numbers[place(at)]).collect();
    }
    Ok(Some(match (shape.as_slice(), numbers.as_slice()) {
        ([], &[number]) => Value::from(number),
        _ => numbers.into_iter().map(Value::from).collect(),
    }))
}

/// What stands for an array of a type that is not read: a word, which is refused by name where numbers are wanted.
fn unread(kind: &str) -> Value {
    Value::from(format!(
        "an array of NumPy's type {kind}, which is not read"
    ))
}

/// The truth or the text that an array of one is; `None` for one of another type.
fn word(kind: &TypeStr, data: &[u8]) -> Option<Value> {
    match (kind.type_char(), kind.num_bytes()?) {
        (TypeChar::Bool, 1) => Some((*data.first()? != 0).into()),
        (TypeChar::ByteStr, length) => {
            let text = String::from_utf8_lossy(data.get(..length)?).into_owned();
            Some(text.trim_end_matches('\0').into())
        }
        (TypeChar::UnicodeStr, length) if kind.endianness() != Endianness::Big => {
            let letters = data.get(..length)?.chunks_exact(4);
            let letters = letters.map_while(|letter| match letter {
                &[a, b, c, d] => char::from_u32(u32::from_le_bytes([a, b, c, d])),
                _ => None,
            });
            Some(
                letters
                    .take_while(|letter| *letter != '\0')
                    .collect::<String>()
                    .into(),
            )
        }
        _ => None,
    }
}

/// The tree of a text that is nothing but a matrix of 3 x 3 numbers, or KITTI's lines of a name and 3 x 4 numbers each.
pub(super) fn tree_of_text(text: &str) -> Option<Map<String, Value>> {
    let numbers = |text: &str| {
        let words = text.split(|c: char| c.is_whitespace() || ",;".contains(c));
        let words = words.filter(|word| !word.is_empty());
        words
            .map(|word| word.parse().ok())
            .collect::<Option<Vec<f64>>>()
    };
    let camera = |matrix: [f64; 9]| {
        let is_camera = matrix[3] == 0.0 && matrix[6..] == [0.0, 0.0, 1.0];
        let matrix: Value = matrix.into_iter().map(Value::from).collect();
        is_camera.then(|| Map::from_iter([("camera_matrix".to_owned(), matrix)]))
    };
    // What `savetxt` is told to write above begins so.
    let lines = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    let lines: Vec<&str> = lines.collect();
    if let Some(matrix) = numbers(&lines.join(" ")) {
        return camera(matrix.try_into().ok()?);
    }
    let mut tree = Map::new();
    for line in lines {
        let (name, rest) = line.split_once(':')?;
        // P0, P_rect_00: the others are turns, places, times, and the cameras before their pictures were rectified.
        if name.trim_start().starts_with('P')
            && let Some(&[fx, skew, cx, _, zero, fy, cy, _, a, b, c, _]) = numbers(rest).as_deref()
            && let Some(camera) = camera([fx, skew, cx, zero, fy, cy, a, b, c])
        {
            tree.insert(name.trim().to_owned(), Value::Object(camera));
        }
    }
    (!tree.is_empty()).then_some(tree)
}
