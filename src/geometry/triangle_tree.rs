//! A hierarchy of boxes about triangles, whatever they are like (obvhs).

use std::time::Duration;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::triangle::Triangle;
use obvhs::{Boundable, BvhBuildParams};

/// By how much boxes are too large at most, as a part of their longest side.
const LOOSE: f32 = 1e-3;
/// The same as a part of the largest coordinate, where that is more: in single precision less of it may be nothing.
const LOOSE_OF_ALL: f32 = 1e-5;

/// A triangle's box, a little too large.
struct LooseBox(Aabb);

impl Boundable for LooseBox {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// The hierarchy of triangles, of which there is one at least.
///
/// Locally ordered clustering (Meister & Bittner 2018) joins boxes that are each other's nearest. Among many that are alike, as in
/// a grid of squares, each takes the last of the nearest, so that of a chain one pair is joined in each pass, and the time grows
/// with the square of their number. Boxes that are too large by different parts are not alike.
pub(super) fn triangle_tree(triangles: &[Triangle], params: BvhBuildParams) -> Bvh2 {
    let corners = triangles.iter().flat_map(|it| [it.v0, it.v1, it.v2]);
    let largest = corners.fold(0.0, |largest: f32, corner| {
        largest.max(corner.abs().max_element())
    });
    // All in the origin.
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let boxes = triangles.iter().zip(0_u32..).map(|(triangle, index)| {
        let Aabb { min, max } = triangle.aabb();
        let side = (max - min).max_element();
        // Knuth's multiplicative hash.
        let part = index.wrapping_mul(2_654_435_769) as f32 / u32::MAX as f32;
        let more = Vec3A::splat(part * (LOOSE * side).max(LOOSE_OF_ALL * largest));
        LooseBox(Aabb {
            min: min - more,
            max: max + more,
        })
    });
    let boxes: Vec<LooseBox> = boxes.collect();
    build_bvh2(&boxes, params, &mut Duration::default())
}
