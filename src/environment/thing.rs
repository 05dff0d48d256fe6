//! A thing as light from afar meets it: simplified, in its anchor's space.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::bounds::Bounds;
use crate::geometry::corner_points::is_buried;
use crate::geometry::ray_caster::RayCaster;
use crate::geometry::solid::holes;
use crate::light::mean_surface::MeanSurface;
use crate::shafts::bounding::Ball;
use crate::shafts::casters::Occluder;
use crate::shafts::light_of_room::hemisphere;
use crate::shafts::surfels::{Surfel, surfels_of_triangles};

/// Rays start so far off a surface, metres: past the rounding of a simplified thing.
pub const OFFSET_M: f32 = 1e-4;
/// Discs that a thing's surface reflects light from, on one side.
const SURFELS: usize = 256;
/// Rays that tell whether a disc's back can be seen, ...
const RAYS_BEHIND: usize = 16;
/// ... and how many of them are to find no inside there.
const FEWEST_OPEN: usize = 4;
/// Surfaces within some 60 degrees of each other get like light.
const LIKE_NORMALS: f32 = 0.5;

/// A phantom or a virtual thing.
pub struct Thing {
    /// Whether it is a phantom.
    pub is_real: bool,
    /// Whether it takes light away from others.
    pub casts: bool,
    /// Number of its anchor.
    pub anchor: usize,
    /// Its triangles, in the anchor's space, metres.
    pub triangles: Vec<[Vec3; 3]>,
    /// For each the number of its surface.
    surface_numbers: Vec<u32>,
    surfaces: Vec<MeanSurface>,
    /// Rays against them.
    pub caster: RayCaster,
    /// What has an inside but for holes: the same with these closed.
    solid: Option<RayCaster>,
    /// Whether its triangles are wound clockwise seen from outside.
    is_mirrored: bool,
    /// Around them.
    pub ball: Ball,
    /// Around them too.
    pub bounds: Bounds,
    /// Its surface as discs of one area, and the backs of those that are on a sheet; none where it casts no shadow: what a table
    /// reflects is known otherwise.
    pub surfels: Vec<Surfel>,
    /// For the two sides of each triangle the numbers of those on it, or of one near it.
    surfels_on: Vec<[Range<usize>; 2]>,
}

impl Thing {
    /// Simplified; `None` where nothing of it is there.
    pub fn new(thing: &Occluder<'_>, is_real: bool) -> Option<Self> {
        if !thing.visible {
            return None;
        }
        let triangles = thing.simplified_in_anchor();
        let own = Self::of_triangles(thing, is_real, &triangles)?;
        match thing.casts {
            true => Some(own.with_surfels(&thing.with_albedos(&triangles))),
            false => Some(own),
        }
    }

    /// With discs on its triangles, which come with their albedo.
    fn with_surfels(self, triangles: &[([Vec3; 3], Vec3)]) -> Self {
        let (fronts, on_triangle) = surfels_of_triangles(triangles, SURFELS);
        let is_seen_behind: Vec<bool> = fronts
            .par_iter()
            .map(|it| self.is_open_behind(it))
            .collect();
        // For each front the number of the first back that is its own or of one after it.
        let mut backs_from = vec![fronts.len()];
        backs_from.extend(is_seen_behind.iter().scan(fronts.len(), |next, &is_seen| {
            *next += usize::from(is_seen);
            Some(*next)
        }));
        let backs = fronts.iter().zip(&is_seen_behind);
        let backs = backs
            .filter(|(_, is_seen)| **is_seen)
            .map(|(front, _)| Surfel {
                normal: -front.normal,
                ..*front
            });
        let surfels: Vec<Surfel> = fronts.iter().copied().chain(backs).collect();
        let near = |corners: &[Vec3; 3]| {
            let [a, b, c] = *corners;
            let (normal, middle) = ((b - a).cross(c - a).normalize_or_zero(), (a + b + c) / 3.0);
            let like = fronts.iter().enumerate();
            let like = like.filter(|(_, surfel)| surfel.normal.dot(normal) > LIKE_NORMALS);
            let nearest = like.min_by(|(_, one), (_, other)| {
                let distance = |surfel: &Surfel| surfel.position.distance_squared(middle);
                distance(one).total_cmp(&distance(other))
            });
            nearest.map_or(0..0, |(number, _)| number..number + 1)
        };
        let sides = triangles.par_iter().zip(on_triangle);
        let sides = sides.map(|((corners, _), on)| {
            let on = match on.is_empty() {
                true => near(corners),
                false => on,
            };
            let behind = backs_from[on.start]..backs_from[on.end];
            [on, behind]
        });
        Self {
            surfels_on: sides.collect(),
            surfels,
            ..self
        }
    }

    /// Whether the back of a disc on its surface can be seen: whether the surface there is a sheet and not a solid's.
    fn is_open_behind(&self, surfel: &Surfel) -> bool {
        let start = surfel.position - surfel.normal * OFFSET_M;
        let is_open = |direction: &Vec3| {
            let Some(hit) = self.caster.first_hit(start, *direction, f32::INFINITY) else {
                return true;
            };
            let [a, b, c] = self.triangles[hit.triangle];
            (b - a).cross(c - a).dot(*direction) < 0.0
        };
        let rays = hemisphere(-surfel.normal, RAYS_BEHIND);
        rays.filter(is_open).count() >= FEWEST_OPEN
    }

    /// Number of the disc of its surface that is nearest to a place on a triangle, and on the side of a normal; in the anchor's
    /// space.
    pub fn disc_at(&self, triangle: usize, place: Vec3, normal: Vec3) -> Option<usize> {
        let [a, b, c] = self.triangles[triangle];
        let is_behind = (b - a).cross(c - a).dot(normal) < 0.0;
        let on = self.surfels_on.get(triangle)?[usize::from(is_behind)].clone();
        let distance = |&number: &usize| self.surfels[number].position.distance_squared(place);
        on.min_by(|one, other| distance(one).total_cmp(&distance(other)))
    }

    /// With all its triangles and without discs; `None` where nothing of it is there.
    pub fn whole(thing: &Occluder<'_>, is_real: bool) -> Option<Self> {
        match thing.visible {
            true => Self::of_triangles(thing, is_real, &thing.whole_in_anchor()),
            false => None,
        }
    }

    /// Whether a place with a unit normal lies inside of it, also where it is open, as many a model is below; in the anchor's space.
    pub fn surrounds(&self, place: Vec3, normal: Vec3) -> bool {
        let [place, normal] = [place, normal].map(|it| it.as_dvec3());
        let solid = self.solid.as_ref();
        solid.is_some_and(|solid| is_buried(solid, place, normal, self.is_mirrored))
    }

    /// What a triangle's surface is.
    pub fn surface(&self, triangle: usize) -> &MeanSurface {
        &self.surfaces[self.surface_numbers[triangle] as usize]
    }

    fn of_triangles(
        thing: &Occluder<'_>,
        is_real: bool,
        triangles: &[([Vec3; 3], u32)],
    ) -> Option<Self> {
        let (triangles, surface_numbers): (Vec<[Vec3; 3]>, Vec<u32>) =
            triangles.iter().copied().unzip();
        let corners = || triangles.iter().flatten();
        let bounds = Bounds::around(corners().map(|corner| corner.as_dvec3()))?;
        let solid = holes(thing.mesh).map(|holes| {
            let in_anchor =
                |corner: DVec3| thing.anchor_from_object.transform_point3(corner).as_vec3();
            let closing = holes.iter().map(|hole| hole.map(in_anchor));
            RayCaster::new(&triangles.iter().copied().chain(closing).collect::<Vec<_>>())
        });
        let center = ((bounds.low + bounds.high) / 2.0).as_vec3();
        let radius = corners()
            .map(|corner| corner.distance(center))
            .fold(0.0, f32::max);
        Some(Self {
            is_real,
            casts: thing.casts,
            anchor: thing.anchor,
            caster: RayCaster::new(&triangles),
            solid,
            is_mirrored: thing.anchor_from_object.matrix3.determinant() < 0.0,
            ball: Ball { center, radius },
            bounds,
            surfels: Vec::new(),
            surfels_on: Vec::new(),
            triangles,
            surface_numbers,
            surfaces: thing.surfaces.clone(),
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::geometry::cuboid::cuboid;
    use crate::geometry::mesh::Mesh;
    use crate::geometry::mesh::tests::welded;
    use crate::light::material::Material;

    /// Of one albedo, where its mesh is.
    pub fn thing(mesh: &Mesh, albedo: f64, deforms: bool) -> Thing {
        let occluder = Occluder {
            mesh,
            surfaces: vec![MeanSurface::plain(&Material::matt(DVec3::splat(albedo)))],
            anchor: 0,
            anchor_from_object: DAffine3::IDENTITY,
            casts: true,
            visible: true,
            deforms,
        };
        Thing::new(&occluder, false).expect("triangles")
    }

    #[test]
    fn a_sheet_has_discs_on_both_sides_and_a_solid_outside_alone() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let sheet = thing(&welded(&corners, &[[0, 1, 2], [0, 2, 3]]), 1.0, false);
        for normal in [Vec3::Z, Vec3::NEG_Z] {
            for triangle in [0, 1] {
                let disc = sheet.disc_at(triangle, Vec3::new(0.4, 0.6, 0.0), normal);
                let disc = sheet.surfels[disc.expect("a disc")];
                assert_eq!(disc.normal, normal);
                assert!(disc.position.distance(Vec3::new(0.4, 0.6, 0.0)) < 0.4);
            }
        }
        let (positions, triangles) = cuboid(Vec3::ZERO, Vec3::ONE);
        let solid = thing(&welded(&positions, &triangles), 1.0, false);
        let outwards =
            |surfel: &Surfel| surfel.normal.dot(surfel.position - solid.ball.center) > 0.0;
        assert!(!solid.surfels.is_empty() && solid.surfels.iter().all(outwards));
    }

    #[test]
    fn what_is_too_small_for_a_disc_has_that_of_what_lies_near_it_and_alike() {
        let floor = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let above = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|it| 1e-3 * it + Vec3::new(0.5, 0.5, 0.1));
        let upright = [Vec3::ZERO, Vec3::X, Vec3::Z].map(|it| 1e-3 * it + Vec3::splat(0.3));
        let corners: Vec<Vec3> = floor.into_iter().chain(above).chain(upright).collect();
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 8, 9]];
        let all = thing(&welded(&corners, &triangles), 1.0, true);
        let disc = all.disc_at(2, above[0], Vec3::Z).expect("the floor's");
        let near = all.surfels[disc];
        assert_eq!((near.normal, near.position.z), (Vec3::Z, 0.0));
        assert!(near.position.distance(above[0]) < 0.2);
        assert_eq!(all.disc_at(3, upright[0], Vec3::Y), None);
    }
}
