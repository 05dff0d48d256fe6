//! A box along the axes as triangles.

use glam::Vec3;

/// The sides as quads of corners, low and high x first, then y, then z; counter-clockwise seen from outside. Bits of a corner's
/// number say for x, y and z, the lowest bit first, whether it is high.
pub const SIDES: [[u32; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

/// Eight corners, and two triangles for each of the six sides.
pub fn cuboid(low: Vec3, high: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corner = |number: u32| {
        Vec3::from_array(std::array::from_fn(|axis| match number >> axis & 1 {
            0 => low[axis],
            _ => high[axis],
        }))
    };
    let triangles = SIDES
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    ((0..8).map(corner).collect(), triangles)
}
