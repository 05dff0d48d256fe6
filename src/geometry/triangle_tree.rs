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

#[cfg(test)]
mod tests {
    use crate::geometry::ray_caster::RayCaster;
    use glam::Vec3;

    /// Each of these took minutes to hours.
    #[test]
    fn what_is_all_alike_becomes_a_tree_too() {
        const SIDE: u32 = 500;
        let square = |number: u32| {
            let place = |at: u32| at as f32 / SIDE as f32;
            let [x, y] = [number % SIDE, number / SIDE].map(place);
            let step = 1.0 / SIDE as f32;
            let corner = |right: f32, up: f32| Vec3::new(x + right * step, y + up * step, 0.0);
            [
                [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)],
                [corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
            ]
        };
        let grid: Vec<[Vec3; 3]> = (0..SIDE * SIDE).flat_map(square).collect();
        let caster = RayCaster::new(&grid);
        let down = |x: f32, y: f32| caster.first_hit(Vec3::new(x, y, 1.0), Vec3::NEG_Z, 2.0);
        for number in [0, 777, SIDE * SIDE / 2 + 13, SIDE * SIDE - 1] {
            let middle = (square(number)[0][0] + square(number)[0][1] + square(number)[0][2]) / 3.0;
            let hit = down(middle.x, middle.y).expect("a hit");
            assert_eq!(hit.triangle, 2 * number as usize);
        }
        assert_eq!(down(1.5, 0.5), None);
        for alike in [
            [Vec3::ZERO, Vec3::X, Vec3::Y],
            [Vec3::ONE; 3],
            [Vec3::ZERO; 3],
        ] {
            let boxes = RayCaster::new(&vec![alike; 200_000]);
            assert!(boxes.boxes().len() > 10_000);
        }
    }
}
