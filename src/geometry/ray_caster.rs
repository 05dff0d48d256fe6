//! Rays against triangles, by a bounding-volume hierarchy (obvhs).

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

use super::triangle_tree::triangle_tree;

/// Triangles ready to be hit.
pub struct RayCaster {
    triangles: Vec<Triangle>,
    /// `None` without triangles.
    hierarchy: Option<Bvh2>,
}

/// A box of the hierarchy, for those who follow rays elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeBox {
    /// Its lowest corner.
    pub low: Vec3,
    /// Its highest.
    pub high: Vec3,
    /// What is in it.
    pub content: BoxContent,
}

/// What a box of the hierarchy has in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoxContent {
    /// Two boxes: that of this number and the next.
    Boxes(usize),
    /// So many triangles, from a place in [`RayCaster::triangle_order`] on.
    Triangles {
        /// The place.
        first: usize,
        /// How many.
        count: usize,
    },
}

/// Where a ray first meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Index of the triangle.
    pub triangle: usize,
    /// In units of the ray's direction.
    pub distance: f32,
}

impl RayCaster {
    /// Prepares triangles, three corners each.
    pub fn new(corners: &[[Vec3; 3]]) -> Self {
        let triangles: Vec<Triangle> = corners
            .iter()
            .map(|&[v0, v1, v2]| Triangle {
                v0: v0.into(),
                v1: v1.into(),
                v2: v2.into(),
            })
            .collect();
        let hierarchy = (!triangles.is_empty())
            .then(|| triangle_tree(&triangles, BvhBuildParams::medium_build()));
        Self {
            triangles,
            hierarchy,
        }
    }

    /// The boxes of the hierarchy, of which the first has all others in it; none without triangles.
    pub fn boxes(&self) -> impl ExactSizeIterator<Item = TreeBox> {
        let nodes = self.hierarchy.as_ref().map_or(&[][..], |tree| &tree.nodes);
        nodes.iter().map(|node| {
            let (first, count) = (node.first_index as usize, node.prim_count as usize);
            TreeBox {
                low: node.aabb().min.into(),
                high: node.aabb().max.into(),
                content: match count {
                    0 => BoxContent::Boxes(first),
                    _ => BoxContent::Triangles { first, count },
                },
            }
        })
    }

    /// The triangles' indices in the order in which the boxes have them.
    pub fn triangle_order(&self) -> impl ExactSizeIterator<Item = usize> {
        let tree = self.hierarchy.as_ref();
        let order = tree.map_or(&[][..], |tree| &tree.primitive_indices);
        order.iter().map(|&index| index as usize)
    }

    /// The first triangle within `reach` along a ray, if any; both sides of a triangle are hit.
    pub fn first_hit(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<Hit> {
        let hierarchy = self.hierarchy.as_ref()?;
        let ray = Ray::new(Vec3A::from(origin), Vec3A::from(direction), 0.0, reach);
        let mut hit = RayHit::none();
        let found = hierarchy.ray_traverse(ray, &mut hit, |ray, id| {
            self.triangles[hierarchy.primitive_indices[id] as usize].intersect(ray)
        });
        found.then(|| Hit {
            triangle: hierarchy.primitive_indices[hit.primitive_id as usize] as usize,
            distance: hit.t,
        })
    }

    /// Whether the first triangle along a ray is met on its outer side, from which it is wound counter-clockwise; `None` where none
    /// is met.
    pub fn side_met(&self, origin: Vec3, direction: Vec3) -> Option<bool> {
        let hit = self.first_hit(origin, direction, f32::INFINITY)?;
        let Triangle { v0, v1, v2 } = self.triangles[hit.triangle];
        let outward = (v1 - v0).cross(v2 - v0);
        Some(outward.dot(direction.into()) < 0.0)
    }

    /// Whether anything lies within `reach` along a ray.
    pub fn is_hidden(&self, origin: Vec3, direction: Vec3, reach: f32) -> bool {
        let Some(hierarchy) = &self.hierarchy else {
            return false;
        };
        let ray = Ray::new(Vec3A::from(origin), Vec3A::from(direction), 0.0, reach);
        !hierarchy.ray_traverse_miss(ray, |ray, id| {
            self.triangles[hierarchy.primitive_indices[id] as usize].intersect(ray)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_ray_hits_the_nearer_of_two_squares_and_no_farther_than_it_reaches() {
        let square = |z: f32| {
            let corner = |x: f32, y: f32| Vec3::new(x, y, z);
            [
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
                [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            ]
        };
        let caster = RayCaster::new(&[square(-3.0), square(-1.0)].concat());
        let (origin, down) = (Vec3::new(0.25, 0.5, 1.0), Vec3::NEG_Z);
        let hit = caster
            .first_hit(origin, down, f32::INFINITY)
            .expect("a hit");
        assert!(
            hit.triangle == 3 && (hit.distance - 2.0).abs() < 1e-6,
            "{hit:?}"
        );
        assert_eq!(caster.first_hit(origin, down, 1.9), None);
        assert!(caster.is_hidden(origin, down, 2.1) && !caster.is_hidden(origin, down, 1.9));
        assert_eq!(caster.first_hit(origin, Vec3::Z, f32::INFINITY), None);
        assert!(!RayCaster::new(&[]).is_hidden(origin, down, 9.0));
    }
}
