//! A thing as light from afar meets it: simplified, in its anchor's space.

use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::geometry::bounds::Bounds;
use crate::geometry::corner_points::is_buried;
use crate::geometry::ray_caster::RayCaster;
use crate::geometry::solid::holes;
use crate::light::mean_surface::MeanSurface;
use crate::shafts::bounding::Ball;
use crate::shafts::casters::Occluder;
use crate::shafts::surfels::{Surfel, surfels_of_triangles};

/// Discs that a thing's surface reflects light from.
const SURFELS: usize = 256;

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
    /// Its surface as discs of one area; none where it casts no shadow: what a table reflects is known otherwise.
    pub surfels: Vec<Surfel>,
    /// For each triangle the numbers of those on it, or nearest to it.
    surfels_on: Vec<Range<usize>>,
}

impl Thing {
    /// Simplified; `None` where nothing of it is there.
    pub fn new(thing: &Occluder<'_>, is_real: bool) -> Option<Self> {
        if !thing.visible {
            return None;
        }
        let triangles = thing.simplified_in_anchor();
        let own = Self::of_triangles(thing, is_real, &triangles)?;
        let (surfels, surfels_on) = match thing.casts {
            true => surfels_of_triangles(&thing.with_albedos(&triangles), SURFELS),
            false => Default::default(),
        };
        Some(Self {
            surfels,
            surfels_on,
            ..own
        })
    }

    /// Number of the disc of its surface that is nearest to a place on a triangle, and on the side of a normal; in the anchor's
    /// space.
    pub fn disc_at(&self, triangle: usize, place: Vec3, normal: Vec3) -> Option<usize> {
        let on = self.surfels_on.get(triangle)?.clone();
        let on = on.filter(|&number| {
            let surfel = self.surfels.get(number);
            surfel.is_some_and(|surfel| surfel.normal.dot(normal) > 0.0)
        });
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
