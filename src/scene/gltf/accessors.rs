//! Numbers of accessors: interleaved, normalised, sparse; checked against what there is before any memory is taken.

use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, sparse::IndexType};

use super::file::GltfFile;
use crate::scene::error::SceneError;

/// Numbers without a view are zeros that no byte stands for; at most so many for each byte of the file.
const ZEROS_PER_BYTE: usize = 16;

impl GltfFile<'_> {
    /// Tuples of numbers, those that are normalised from 0 or -1 to 1; `allowed` are the dimensions that fit, the missing
    /// ones filled with `missing`.
    pub fn floats<const N: usize>(
        &self,
        place: &str,
        accessor: &Accessor<'_>,
        allowed: &[Dimensions],
        missing: f32,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let tuples = self.numbers(place, accessor, allowed, missing)?;
        match tuples.iter().position(|tuple| !is_finite(tuple)) {
            Some(index) => {
                let place = format!("{place}: accessors[{}]", accessor.index());
                Err(self.error(&place, format!("element {index} is not finite")))
            }
            None => Ok(tuples),
        }
    }

    /// The same of what a surface can do without: a tuple with a number that is none becomes `mended`, and that is told.
    pub fn mended_floats<const N: usize>(
        &mut self,
        place: &str,
        accessor: &Accessor<'_>,
        allowed: &[Dimensions],
        (missing, mended): (f32, [f32; N]),
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let mut tuples = self.numbers(place, accessor, allowed, missing)?;
        let mut count = 0;
        for tuple in tuples.iter_mut().filter(|tuple| !is_finite(*tuple)) {
            *tuple = mended;
            count += 1;
        }
        if count > 0 {
            self.note(format!(
                "{place}: {count} of {} are no finite numbers and are passed over",
                tuples.len()
            ));
        }
        Ok(tuples)
    }

    fn numbers<const N: usize>(
        &self,
        place: &str,
        accessor: &Accessor<'_>,
        allowed: &[Dimensions],
        missing: f32,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let place = &format!("{place}: accessors[{}]", accessor.index());
        if !allowed.contains(&accessor.dimensions()) {
            let message = format!("{:?}; {allowed:?} is expected", accessor.dimensions());
            return Err(self.error(place, message));
        }
        let width = accessor.dimensions().multiplicity().min(N);
        let kind = accessor.data_type();
        let scale = one(kind);
        let read = |bytes: &[u8]| {
            let mut tuple = [missing; N];
            let step = kind.size();
            for (number, value) in tuple.iter_mut().enumerate().take(width) {
                let given = number_of(kind, &bytes[number * step..(number + 1) * step]);
                // (A signed number's least is below −1; no maximum for the others, which would turn what is none into one.)
                *value = match accessor.normalized() && kind != DataType::F32 {
                    true => (given / scale).max(-1.0),
                    false => given,
                };
            }
            tuple
        };
        self.elements(place, accessor, [0.0; N], read)
    }

    /// Whole numbers.
    pub fn integers<const N: usize>(
        &self,
        place: &str,
        accessor: &Accessor<'_>,
        allowed: Dimensions,
    ) -> Result<Vec<[u32; N]>, SceneError> {
        let place = &format!("{place}: accessors[{}]", accessor.index());
        let kind = accessor.data_type();
        let is_whole = matches!(kind, DataType::U8 | DataType::U16 | DataType::U32);
        if accessor.dimensions() != allowed || !is_whole {
            let message = format!(
                "{:?} of {kind:?}; {allowed:?} of unsigned integers is expected",
                accessor.dimensions()
            );
            return Err(self.error(place, message));
        }
        self.elements(place, accessor, [0; N], |bytes| {
            std::array::from_fn(|number| {
                let step = kind.size();
                let bytes = &bytes[number * step..(number + 1) * step];
                bytes
                    .iter()
                    .rev()
                    .fold(0, |sum, &byte| sum << 8 | u32::from(byte))
            })
        })
    }

    fn elements<T: Clone>(
        &self,
        place: &str,
        accessor: &Accessor<'_>,
        zero: T,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        // (Columns of matrices of small numbers are padded; no such matrix is asked for.)
        let (count, size) = (accessor.count(), accessor.size());
        let mut elements = match accessor.view() {
            Some(view) => {
                let bytes = self.view(place, &view)?;
                let stride = view.stride().unwrap_or(size);
                let layout = [accessor.offset(), count, stride, size];
                strided(bytes, layout)
                    .map_err(|message| self.error(place, message))?
                    .map(&read)
                    .collect()
            }
            None if count > self.bytes.saturating_mul(ZEROS_PER_BYTE) => {
                let message = format!("{count} elements without a view are too many for this file");
                return Err(self.error(place, message));
            }
            None => vec![zero; count],
        };
        if let Some(sparse) = accessor.sparse() {
            let indices = sparse.indices();
            let width = match indices.index_type() {
                IndexType::U8 => 1,
                IndexType::U16 => 2,
                IndexType::U32 => 4,
            };
            let message = |message: String| self.error(place, format!("sparse: {message}"));
            let bytes = self.view(place, &indices.view())?;
            let layout = [indices.offset(), sparse.count(), width, width];
            let numbers = strided(bytes, layout).map_err(message)?;
            let bytes = self.view(place, &sparse.values().view())?;
            let layout = [sparse.values().offset(), sparse.count(), size, size];
            let values = strided(bytes, layout).map_err(message)?;
            for (number, value) in numbers.zip(values) {
                let index = number
                    .iter()
                    .rev()
                    .fold(0, |sum, &byte| sum << 8 | usize::from(byte));
                let element = elements.get_mut(index);
                *element.ok_or_else(|| message(format!("index {index} of {count} elements")))? =
                    read(value);
            }
        }
        Ok(elements)
    }
}

fn is_finite(tuple: &[f32]) -> bool {
    tuple.iter().all(|value| value.is_finite())
}

/// The bytes of elements that stand in steps, all of them there.
fn strided(
    bytes: &[u8],
    [offset, count, stride, size]: [usize; 4],
) -> Result<impl Iterator<Item = &[u8]>, String> {
    let last = count.saturating_sub(1).checked_mul(stride);
    let end = last.and_then(|last| last.checked_add(offset)?.checked_add(size));
    let fits = count == 0 || end.is_some_and(|end| end <= bytes.len());
    if !fits {
        return Err(format!(
            "{count} elements of {size} bytes, every {stride} from {offset} on, reach beyond a view of {} bytes",
            bytes.len()
        ));
    }
    Ok((0..count).map(move |index| &bytes[offset + index * stride..][..size]))
}

/// What a normalised 1 is.
fn one(kind: DataType) -> f32 {
    match kind {
        DataType::I8 => 127.0,
        DataType::U8 => 255.0,
        DataType::I16 => 32_767.0,
        DataType::U16 => 65_535.0,
        DataType::U32 => u32::MAX as f32,
        DataType::F32 => 1.0,
    }
}

fn number_of(kind: DataType, bytes: &[u8]) -> f32 {
    match (kind, bytes) {
        (DataType::I8, &[a]) => f32::from(a as i8),
        (DataType::U8, &[a]) => f32::from(a),
        (DataType::I16, &[a, b]) => f32::from(i16::from_le_bytes([a, b])),
        (DataType::U16, &[a, b]) => f32::from(u16::from_le_bytes([a, b])),
        (DataType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
        (DataType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => f32::NAN,
    }
}
