//! Where triangles are sampled.

use glam::Vec3;

/// Points spread over a triangle.
pub fn points_on(corners: [Vec3; 3], count: usize) -> impl Iterator<Item = Vec3> {
    let [a, b, c] = corners;
    (0..count).map(move |index| {
        // The R2 sequence (Roberts 2018), folded over the diagonal.
        let number = index as f32 + 0.5;
        let (mut u, mut v) = (
            (0.5 + number * 0.754_877_7).fract(),
            (0.5 + number * 0.569_840_3).fract(),
        );
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        a + (b - a) * u + (c - a) * v
    })
}
