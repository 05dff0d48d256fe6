//! Colours that stand beside vertices in OBJ, PLY and STL files.

use glam::Vec3;

use crate::light::srgb::linear_from_srgb;

/// What is said of colours that turn out to be of bytes.
pub const ABOVE_ONE: &str = "vertex colours above 1 are taken for 0 to 255";

/// Colours as files have them, encoded as sRGB has it (as most that read such files take them), made linear; and whether
/// they are of bytes, since one is above 1.
pub fn linear_colors(colors: Vec<[f32; 3]>) -> (Vec<Vec3>, bool) {
    let is_of_bytes = colors.iter().flatten().any(|part| *part > 1.0);
    let white = if is_of_bytes { 255.0 } else { 1.0 };
    let linear = colors.into_iter().map(|color| {
        Vec3::from_array(color.map(|part| {
            let encoded = (f64::from(part) / white).clamp(0.0, 1.0);
            linear_from_srgb(encoded) as f32
        }))
    });
    (linear.collect(), is_of_bytes)
}
