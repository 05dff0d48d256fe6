//! Virtual things as they hide light: simplified, in the world.

use std::f32::consts::FRAC_1_PI;

use glam::{DAffine3, Vec3};
use rayon::prelude::*;

use crate::geometry::levels::levels;
use crate::geometry::mesh::Mesh;
use crate::geometry::ray_caster::RayCaster;
use crate::light::mean_surface::MeanSurface;

use super::bounding::{Aabb, Ball};
use super::room_transport::RoomTransport;
use super::selection::Representative;
use super::surfels::{GroupedSurfels, LitSurfel, Surfel, open_directions, surfels};

/// The limit to how far outlines may move for fewer triangles, in parts of a thing's size.
pub const COARSE_PART: f64 = 0.004;
/// Surfels of all things together.
const SURFELS: usize = 512;
/// Surfels of each thing at least.
const LEAST_SURFELS: usize = 16;
/// Rays that gather the light of a surfel.
const RAYS: usize = 48;

/// Patches are cut into parts of this size by a caster, metres, and of this part of the distance farther off.
const SMALLEST_PART_M: f32 = 0.004;
const PART_OF_DISTANCE: f32 = 0.3;
const MOST_PARTS: u32 = 10;

/// A virtual thing as a scene has it.
#[derive(Debug, Clone)]
pub struct Occluder<'a> {
    /// Its triangles, in its own space.
    pub mesh: &'a Mesh,
    /// What `mesh.triangle_materials` names.
    pub surfaces: Vec<MeanSurface>,
    /// Number of its anchor.
    pub anchor: usize,
    /// Where it stands there.
    pub anchor_from_object: DAffine3,
    /// Whether it takes light away from others.
    pub casts: bool,
    /// Whether it is there at all.
    pub visible: bool,
    /// Whether it changes its shape.
    pub deforms: bool,
}

impl Occluder<'_> {
    /// Its triangles in its own space, simplified as far as nobody sees it in soft shadows, with the numbers of their surfaces. What
    /// changes its shape has all of them: each frame would take as long to simplify as it takes to draw many.
    pub fn simplified(&self) -> Vec<([Vec3; 3], u32)> {
        if self.deforms {
            return self.whole();
        }
        let size = Aabb::around(self.mesh.positions.iter().copied()).diagonal();
        let shape = self.mesh.without_looks();
        let coarser = levels(&shape);
        let coarse_enough = coarser
            .into_iter()
            .rfind(|level| level.max_error_m <= COARSE_PART * f64::from(size));
        of_mesh(&coarse_enough.map_or(shape, |level| level.mesh))
    }

    /// All its triangles in its own space, with the numbers of their surfaces.
    pub fn whole(&self) -> Vec<([Vec3; 3], u32)> {
        of_mesh(self.mesh)
    }

    /// Its simplified triangles in its anchor's space, with the numbers of their surfaces.
    pub fn simplified_in_anchor(&self) -> Vec<([Vec3; 3], u32)> {
        self.in_anchor(self.simplified())
    }

    /// All its triangles in its anchor's space, with the numbers of their surfaces.
    pub fn whole_in_anchor(&self) -> Vec<([Vec3; 3], u32)> {
        self.in_anchor(self.whole())
    }

    /// Triangles with the albedos of their surfaces.
    pub fn with_albedos(&self, triangles: &[([Vec3; 3], u32)]) -> Vec<([Vec3; 3], Vec3)> {
        let albedo = |surface: u32| self.surfaces[surface as usize].albedo.as_vec3();
        let triangles = triangles.iter();
        triangles
            .map(|&(corners, surface)| (corners, albedo(surface)))
            .collect()
    }

    fn in_anchor(&self, triangles: Vec<([Vec3; 3], u32)>) -> Vec<([Vec3; 3], u32)> {
        let triangles = triangles.into_iter();
        let placed = |corner: Vec3| self.corner_in_anchor(corner);
        let placed = triangles.map(|(corners, surface)| (corners.map(placed), surface));
        placed.collect()
    }

    fn corner_in_anchor(&self, corner: Vec3) -> Vec3 {
        let placed = self.anchor_from_object.transform_point3(corner.as_dvec3());
        placed.as_vec3()
    }
}

fn of_mesh(mesh: &Mesh) -> Vec<([Vec3; 3], u32)> {
    let triangles = mesh.triangles.iter();
    let corners = triangles.map(|triangle| triangle.map(|index| mesh.positions[index as usize]));
    corners
        .zip(mesh.triangle_materials.iter().copied())
        .collect()
}

/// A virtual thing, simplified, which hides light if it casts.
struct SimplifiedCaster {
    casts: bool,
    /// Simplified, in its own space, with the numbers of their surfaces.
    coarse: Vec<([Vec3; 3], u32)>,
    anchor: usize,
    /// In the anchor's space; none while it is not visible.
    triangles: Vec<[Vec3; 3]>,
    surfels: Vec<Surfel>,
}

/// All virtual things.
pub struct ShaftCasters {
    casters: Vec<SimplifiedCaster>,
    surfels_of_each: usize,
}

/// The casters where they are in a frame, world space.
pub struct PlacedCasters {
    /// Of all casters.
    pub triangles: Vec<[Vec3; 3]>,
    /// Around each caster.
    pub boxes: Vec<Aabb>,
    /// Around each thing that is seen, casters or not.
    pub seen: Vec<Aabb>,
    /// Around all casters.
    pub ball: Ball,
    /// Rays against all casters.
    pub caster: RayCaster,
    surfels: Vec<Surfel>,
}

impl ShaftCasters {
    /// Of a scene's virtual things.
    pub fn new(things: &[Occluder<'_>]) -> Self {
        let mut casters = Self {
            casters: things.iter().map(SimplifiedCaster::new).collect(),
            surfels_of_each: 0,
        };
        casters.follow(things);
        casters
    }

    /// Takes the places of the same things anew.
    pub fn follow(&mut self, things: &[Occluder<'_>]) {
        let casts = |thing: &&Occluder<'_>| thing.visible && thing.casts;
        let shown = things.iter().filter(casts).count();
        self.surfels_of_each = (SURFELS / shown.max(1)).max(LEAST_SURFELS);
        for (caster, thing) in self.casters.iter_mut().zip(things) {
            caster.place(thing, self.surfels_of_each);
        }
    }

    /// Takes the shape that a thing has now, by its number.
    pub fn deform(&mut self, number: usize, thing: &Occluder<'_>) {
        let surfel_count = self.surfels_of_each;
        if let Some(caster) = self.casters.get_mut(number) {
            caster.coarse = thing.simplified();
            caster.place(thing, surfel_count);
        }
    }

    /// The things whose anchors have a pose; `None` where none has.
    pub fn place(&self, world_from_anchor: &[Option<DAffine3>]) -> Option<PlacedCasters> {
        let mut placed = PlacedCasters {
            triangles: Vec::new(),
            boxes: Vec::new(),
            seen: Vec::new(),
            ball: Ball {
                center: Vec3::ZERO,
                radius: 0.0,
            },
            caster: RayCaster::new(&[]),
            surfels: Vec::new(),
        };
        for caster in &self.casters {
            let pose = world_from_anchor[caster.anchor];
            let Some(pose) = pose.filter(|_| !caster.triangles.is_empty()) else {
                continue;
            };
            let point = |point: Vec3| pose.transform_point3(point.as_dvec3()).as_vec3();
            let triangles = caster.triangles.iter().map(|corners| corners.map(point));
            let triangles: Vec<[Vec3; 3]> = triangles.collect();
            let bounds = Aabb::around(triangles.iter().flatten().copied());
            placed.seen.push(bounds);
            if !caster.casts {
                continue;
            }
            placed.triangles.extend(triangles);
            placed.boxes.push(bounds);
            placed
                .surfels
                .extend(caster.surfels.iter().map(|surfel| Surfel {
                    position: point(surfel.position),
                    normal: pose.transform_vector3(surfel.normal.as_dvec3()).as_vec3(),
                    ..*surfel
                }));
        }
        placed.caster = RayCaster::new(&placed.triangles);
        let all = Aabb::around(
            placed
                .seen
                .iter()
                .flat_map(|bounds| [bounds.min, bounds.max]),
        );
        placed.ball.center = all.min.midpoint(all.max);
        let corners = placed.triangles.iter().flatten();
        placed.ball.radius = corners
            .map(|corner| corner.distance(placed.ball.center))
            .fold(0.0, f32::max);
        (!placed.seen.is_empty()).then_some(placed)
    }
}

impl SimplifiedCaster {
    fn new(thing: &Occluder<'_>) -> Self {
        Self {
            casts: thing.casts,
            coarse: thing.simplified(),
            anchor: thing.anchor,
            triangles: Vec::new(),
            surfels: Vec::new(),
        }
    }

    fn place(&mut self, thing: &Occluder<'_>, surfel_count: usize) {
        if !thing.visible {
            self.triangles.clear();
            self.surfels.clear();
            return;
        }
        let with_albedo = thing.with_albedos(&thing.in_anchor(self.coarse.clone()));
        self.surfels = match self.casts {
            true => surfels(&with_albedo, surfel_count),
            false => Vec::new(),
        };
        self.triangles = with_albedo.iter().map(|(corners, _)| *corners).collect();
    }
}

impl PlacedCasters {
    /// The light that the casters reflect (one bounce): for each surfel what arrives past all casters, from the room as
    /// their shadows leave it.
    pub fn lit_surfels(
        &self,
        room: &RoomTransport,
        sources: &[(Representative, Vec3)],
        left: &[Option<Vec3>],
    ) -> GroupedSurfels {
        let caster = &self.caster;
        let hides = |start, direction| caster.is_hidden(start, direction, f32::INFINITY);
        let lit = |surfel: &Surfel| {
            let irradiance = room.light_on_surfel(surfel, RAYS, caster, sources, left);
            LitSurfel {
                surfel: *surfel,
                open: open_directions(surfel, hides),
                radiance: surfel.albedo * irradiance * FRAC_1_PI,
            }
        };
        GroupedSurfels::new(self.surfels.par_iter().map(lit).collect())
    }

    /// Into how many parts a patch's edges are to be cut, so that what the casters reflect on to it is smooth within each part.
    pub fn parts(&self, corners: [Vec3; 3]) -> u32 {
        let patch = Aabb::around(corners);
        let distances = self.boxes.iter().map(|bounds| bounds.distance(&patch));
        let nearest = distances.fold(f32::INFINITY, f32::min);
        let part = (PART_OF_DISTANCE * nearest).max(SMALLEST_PART_M);
        ((patch.diagonal() / part).ceil() as u32).clamp(1, MOST_PARTS)
    }
}
