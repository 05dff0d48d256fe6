//! Views of buffers that meshoptimizer has compressed, as gltfpack and glTF-Transform write them.
//! <https://github.com/KhronosGroup/glTF/blob/main/extensions/2.0/Vendor/EXT_meshopt_compression/README.md>; decoded by the
//! library itself, which never reads or writes beyond what it is given, whatever the bytes are.

use serde::Deserialize;
use serde_json::Value;

/// Both have the same form; Khronos's has a newer version of the bytes, and a filter more.
pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// The first version packs 256 bytes into 4 at best, the second 256 into a quarter of one.
const MOST_BYTES_PER_BYTE: usize = 1024;

/// What the extension says of a view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct CompressedView {
    /// Where the compressed bytes are.
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: usize,
    pub byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default)]
    filter: Option<String>,
}

impl CompressedView {
    /// What the extension's value says.
    ///
    /// # Errors
    /// What is missing or of the wrong kind.
    pub fn of(value: &Value) -> Result<Self, String> {
        Self::deserialize(value).map_err(|error| error.to_string())
    }

    /// Bytes of the view as it was.
    ///
    /// # Errors
    /// More than so few bytes can hold.
    pub fn length(&self) -> Result<usize, String> {
        let length = self.count.checked_mul(self.byte_stride);
        let most = self.byte_length.saturating_mul(MOST_BYTES_PER_BYTE);
        length.filter(|length| *length <= most).ok_or_else(|| {
            format!(
                "{} elements of {} bytes are too many for {} bytes",
                self.count, self.byte_stride, self.byte_length
            )
        })
    }

    /// The view's bytes as they were before they were compressed.
    ///
    /// # Errors
    /// What the extension has wrong; bytes that are broken.
    pub fn decoded(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        self.length()?;
        let (count, stride) = (self.count, self.byte_stride);
        let broken = |_| format!("{} of {count} elements are broken", self.mode);
        let unexpected = || format!("{}: byteStride {stride} is not allowed", self.mode);
        let mut decoded = match (self.mode.as_str(), stride) {
            ("ATTRIBUTES", _) => vertices(bytes, count, stride)
                .ok_or_else(unexpected)?
                .map_err(broken)?,
            // (Three indices a triangle; the library would stop the program at any other number.)
            ("TRIANGLES", 2 | 4) if !count.is_multiple_of(3) => {
                return Err(format!("TRIANGLES: {count} indices are no triangles"));
            }
            ("TRIANGLES", 2) => {
                in_bytes::<u16>(meshopt::decode_index_buffer(bytes, count)).map_err(broken)?
            }
            ("TRIANGLES", 4) => {
                in_bytes::<u32>(meshopt::decode_index_buffer(bytes, count)).map_err(broken)?
            }
            ("INDICES", 2) => {
                in_bytes::<u16>(meshopt::decode_index_sequence(bytes, count)).map_err(broken)?
            }
            ("INDICES", 4) => {
                in_bytes::<u32>(meshopt::decode_index_sequence(bytes, count)).map_err(broken)?
            }
            ("TRIANGLES" | "INDICES", _) => return Err(unexpected()),
            (mode, _) => return Err(format!("the mode {mode} is not known")),
        };
        self.unfilter(&mut decoded)?;
        Ok(decoded)
    }

    fn unfilter(&self, decoded: &mut [u8]) -> Result<(), String> {
        use meshopt::{
            decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
        };
        match (self.filter.as_deref().unwrap_or("NONE"), self.byte_stride) {
            ("NONE", _) => {}
            ("OCTAHEDRAL", 4) => changed(decoded, decode_filter_oct::<i8>),
            ("OCTAHEDRAL", 8) => changed(decoded, decode_filter_oct::<i16>),
            ("QUATERNION", 8) => changed(decoded, decode_filter_quat),
            ("EXPONENTIAL", stride) if stride.is_multiple_of(4) => {
                changed(decoded, decode_filter_exp::<1>);
            }
            ("COLOR", 4) => changed(decoded, decode_filter_color::<u8>),
            ("COLOR", 8) => changed(decoded, decode_filter_color::<u16>),
            (filter, stride) => {
                return Err(format!(
                    "the filter {filter} of elements of {stride} bytes is not known"
                ));
            }
        }
        Ok(())
    }
}

/// Changes bytes as elements that they need not be aligned for.
fn changed<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
    bytes: &mut [u8],
    change: impl FnOnce(&mut [T]),
) {
    let mut elements: Vec<T> = bytemuck::pod_collect_to_vec(bytes);
    change(&mut elements);
    bytes.copy_from_slice(bytemuck::cast_slice(&elements));
}

fn in_bytes<T: bytemuck::NoUninit>(elements: meshopt::Result<Vec<T>>) -> meshopt::Result<Vec<u8>> {
    Ok(bytemuck::cast_slice(&elements?).to_vec())
}

/// Vertices of so many bytes, which the library wants to know as a type; `None` where a view's elements cannot have so many.
fn vertices(bytes: &[u8], count: usize, stride: usize) -> Option<meshopt::Result<Vec<u8>>> {
    macro_rules! of_words {
        ($($words:literal)*) => {
            match stride {
                $(stride if stride == 4 * $words => {
                    Some(in_bytes::<[u32; $words]>(meshopt::decode_vertex_buffer(bytes, count)))
                })*
                _ => None,
            }
        };
    }
    of_words!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32)
}
