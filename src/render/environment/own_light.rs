//! The corners of things as light from afar meets them: what each hides from itself, and the irradiance that is left.
//! Reads the batches' corners. Writes their self-occlusion and indirect light.

use std::sync::Arc;

use glam::{DAffine3, DMat3, Vec3};

use crate::environment::placed::PlacedScene;
use crate::environment::reflected::DiscTree;
use crate::environment::self_occlusion::{
    OwnSpace, OwnSurface, SelfOcclusion, TRANSFER_DEGREE, VISIBILITIES,
};
use crate::environment::surroundings::{self, Budget};
use crate::geometry::corner_points::corner_points;
use crate::geometry::ray_caster::RayCaster;
use crate::light::harmonics::Turn;
use crate::light::irradiance_records::IrradianceRecords;
use crate::scene::Object;

use super::super::anchor_geometry::{BatchCorners, CHANGING, OcclusionCorners, Role};
use super::super::gpu::Gpu;
use super::super::gpu_scene::GpuScene;
use super::super::precomputation::Precomputation;
use super::data::occlusion_corners;

/// Rays from all points of a thing that changes its shape in one frame, about, ...
const RAYS_OF_A_FRAME: usize = 150_000;
/// ... and from each of them at least, and at most.
const RAYS_OF_A_POINT: [usize; 2] = [48, 256];

/// What a thing hides from itself, wherever it stands.
struct OwnOcclusion {
    /// What it was worked out for.
    key: u64,
    /// One a point.
    occlusions: Vec<SelfOcclusion>,
    /// For each corner of each triangle, those of coarser levels too, its point.
    point_of_corner: Vec<usize>,
}

/// A thing among those whose light is worked out at corners.
struct OwnLitThing {
    own: Arc<OwnOcclusion>,
    /// Turns directions of its own space into its anchor's.
    anchor_from_own: DMat3,
    /// Where its corners are, once that is known.
    corners: Option<PlacedCorners>,
}

/// A thing's corners in their batch.
struct PlacedCorners {
    /// Number of the batch.
    batch: usize,
    anchor: usize,
    /// For each point the number of its self-occlusion.
    occlusion_of_point: Vec<usize>,
    /// For each point its unit normal, in the anchor's space.
    normals: Vec<Vec3>,
    /// The batch's corners, each with its point.
    corners: Vec<(usize, usize)>,
    /// Where it is told what the points get from what stands around, in the anchor's space.
    records: IrradianceRecords,
}

/// The things whose light is worked out at their corners.
pub(super) struct OwnLight {
    /// By their numbers in the scene, phantoms first; `None`: not there, or its light is gathered otherwise.
    things: Vec<Option<OwnLitThing>>,
    /// What is known of each, also of those that are not there now.
    known: Vec<Option<Arc<OwnOcclusion>>>,
    budget: Budget,
    is_placed: bool,
}

impl OwnLight {
    /// Of objects by their numbers; `None` where one is not there, or its light is gathered otherwise.
    pub fn new(
        (objects, budget): (&[Option<&Object>], Budget),
        gpu_scene: &GpuScene,
        precomputation: &dyn Precomputation,
    ) -> Self {
        let of_thing = |object: &Option<&Object>| {
            let object = (*object)?;
            let space = OwnSpace::new(&object.anchor_from_object);
            let drawn = gpu_scene.drawn_meshes(&object.mesh);
            let surface = OwnSurface::new(&object.mesh, drawn, &space);
            Some(OwnLitThing {
                own: Arc::new(OwnOcclusion {
                    key: surface.key,
                    occlusions: precomputation.self_occlusions(&surface),
                    point_of_corner: surface.point_of_corner,
                }),
                anchor_from_own: space.anchor_from_own,
                corners: None,
            })
        };
        let things: Vec<Option<OwnLitThing>> = objects.iter().map(of_thing).collect();
        let own = |thing: &Option<OwnLitThing>| Some(Arc::clone(&thing.as_ref()?.own));
        Self {
            known: things.iter().map(own).collect(),
            things,
            budget,
            is_placed: false,
        }
    }

    /// Takes the same objects as they are now. False where not all of what they hide from themselves is known.
    pub fn follow(&mut self, objects: &[Option<&Object>]) -> bool {
        let mut followed = Vec::new();
        for (number, object) in objects.iter().enumerate() {
            let Some(object) = object else {
                followed.push(None);
                continue;
            };
            let space = OwnSpace::new(&object.anchor_from_object);
            let known = self.known.get(number).and_then(Option::as_ref);
            // (What plays is another in each frame, and gets its own before the next: see `deform`.)
            let is_same = |known: &&Arc<OwnOcclusion>| {
                object.animation.is_some() || known.key == space.key(&object.mesh)
            };
            let Some(known) = known.filter(is_same) else {
                return false;
            };
            followed.push(Some(OwnLitThing {
                own: Arc::clone(known),
                anchor_from_own: space.anchor_from_own,
                corners: None,
            }));
        }
        self.things = followed;
        self.is_placed = false;
        true
    }

    /// How a thing's anchor is turned from its own space.
    pub fn anchor_from_own(&self, number: usize) -> DMat3 {
        let thing = self.things[number].as_ref();
        thing.map_or(DMat3::IDENTITY, |thing| thing.anchor_from_own)
    }

    /// Finds the things' corners among the scene's, and gives these their self-occlusion, where that is not done.
    pub fn place(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene) {
        if std::mem::replace(&mut self.is_placed, true) {
            return;
        }
        let batches = gpu_scene.corners().enumerate();
        let buffers: Vec<Option<OcclusionCorners>> = batches
            .map(|(batch, (_, anchor, corners))| self.place_in(gpu, (batch, anchor), corners))
            .collect();
        gpu_scene.set_occlusion(buffers.into_iter());
    }

    /// Finds the things' corners in a batch (number and anchor), which gets the self-occlusion that it returns.
    fn place_in(
        &mut self,
        gpu: &Gpu,
        (batch, anchor): (usize, usize),
        corners: &BatchCorners,
    ) -> Option<OcclusionCorners> {
        let mut visibilities = vec![[0.0; VISIBILITIES]; corners.thing_of.len()];
        let mut is_any = false;
        for (number, thing) in self.things.iter_mut().enumerate() {
            let Some(thing) = thing else {
                continue;
            };
            let Some(placed) =
                PlacedCorners::new((batch, anchor), corners, (number, &thing.own), self.budget)
            else {
                continue;
            };
            for &(corner, point) in &placed.corners {
                let occlusion = placed.occlusion_of_point[point];
                visibilities[corner] = thing.own.occlusions[occlusion].visibility;
            }
            is_any = true;
            thing.corners = Some(placed);
        }
        is_any.then(|| {
            let contents = occlusion_corners(&corners.thing_of, &visibilities);
            let nothing = vec![Vec3::ZERO; visibilities.len()];
            OcclusionCorners {
                own: gpu.buffer("self-occlusion", &contents, wgpu::BufferUsages::VERTEX),
                reflected: gpu.buffer("reflected", bytemuck::cast_slice(&nothing), CHANGING),
            }
        })
    }

    /// Takes the shape that a thing has now: what it hides from itself, by as many rays as there is time for.
    pub fn deform(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, number: usize, object: &Object) {
        let Some(thing) = self.things.get_mut(number).and_then(Option::as_mut) else {
            return;
        };
        let space = OwnSpace::new(&object.anchor_from_object);
        let surface = OwnSurface::new(&object.mesh, std::iter::once(object.mesh.as_ref()), &space);
        let [fewest, most] = RAYS_OF_A_POINT;
        let rays = (RAYS_OF_A_FRAME / surface.point_count().max(1)).clamp(fewest, most);
        thing.own = Arc::new(OwnOcclusion {
            key: surface.key,
            occlusions: surface.self_occlusions_by(rays),
            point_of_corner: surface.point_of_corner,
        });
        if !self.is_placed {
            return;
        }
        let batches = gpu_scene.corners().enumerate();
        let of_thing = |(_, (_, _, corners)): &(usize, (Role, usize, &BatchCorners))| {
            corners.thing_of.contains(&(number as u32))
        };
        let found = batches
            .filter(of_thing)
            .find_map(|(batch, (role, anchor, corners))| {
                let buffer = self.place_in(gpu, (batch, anchor), corners)?;
                Some(((role, anchor), buffer))
            });
        if let Some((batch, buffer)) = found {
            gpu_scene.set_occlusion_of(batch, buffer);
        }
    }

    /// The irradiance of the corners of each batch in which some get it so, and what of that is of what things reflect: on virtual things of
    /// all broad light that they do not hide from themselves, on real ones of what others reflect.
    pub fn irradiances(
        &self,
        gpu_scene: &GpuScene,
        scene: &PlacedScene<'_>,
        discs: &DiscTree,
    ) -> Vec<Option<[Vec<Vec3>; 2]>> {
        let world_from_anchor = gpu_scene.light_from_anchor().unwrap_or_default();
        let sizes: Vec<usize> = gpu_scene
            .corners()
            .map(|(_, _, corners)| corners.thing_of.len())
            .collect();
        let mut batches: Vec<Option<[Vec<Vec3>; 2]>> = sizes.iter().map(|_| None).collect();
        for (number, thing) in self.things.iter().enumerate() {
            let Some((thing, placed)) = thing
                .as_ref()
                .and_then(|thing| Some((thing, thing.corners.as_ref()?)))
            else {
                continue;
            };
            let of_batch = batches[placed.batch].get_or_insert_with(|| {
                let dark = vec![Vec3::ZERO; sizes[placed.batch]];
                [dark.clone(), dark]
            });
            let there = scene.position(number).zip(world_from_anchor[placed.anchor]);
            let Some((index, pose)) = there else {
                continue;
            };
            let at_points = thing.irradiances(placed, &pose, (scene, index), discs, self.budget);
            for &(corner, point) in &placed.corners {
                for (values, value) in of_batch.iter_mut().zip(at_points[point]) {
                    values[corner] = value;
                }
            }
        }
        batches
    }
}

impl OwnLitThing {
    /// Irradiance of each point, and the part of it that is of what things reflect, or on phantoms what virtual things take of it;
    /// `own` is its place among the scene's things.
    fn irradiances(
        &self,
        placed: &PlacedCorners,
        world_from_anchor: &DAffine3,
        (scene, own): (&PlacedScene<'_>, usize),
        discs: &DiscTree,
        budget: Budget,
    ) -> Vec<[Vec3; 2]> {
        let records = (&placed.records, world_from_anchor);
        let around = surroundings::around(scene, discs, own, records, budget);
        if scene.things[own].thing.is_real {
            return around.iter().map(|it| [it.reflected, it.taken]).collect();
        }
        let world_from_own = world_from_anchor.matrix3 * self.anchor_from_own;
        let turn = Turn::new(world_from_own.transpose(), TRANSFER_DEGREE);
        let from_afar = turn.turned(&scene.distant.harmonics);
        let in_world = world_from_anchor.matrix3.as_mat3();
        let points = placed.occlusion_of_point.iter().zip(&placed.normals);
        points
            .zip(&around)
            .map(|((&occlusion, &normal), around)| {
                let beyond = scene.distant.beyond_harmonics(in_world * normal);
                let from_afar = self.own.occlusions[occlusion].irradiance(&from_afar, beyond);
                let left = (from_afar - around.kept_off).max(Vec3::ZERO);
                [left + around.reflected, around.reflected]
            })
            .collect()
    }
}

impl PlacedCorners {
    /// The corners of a thing (its number) in a batch (number and anchor); `None` where none of it is in that.
    fn new(
        (batch, anchor): (usize, usize),
        BatchCorners { corners, thing_of }: &BatchCorners,
        (number, own): (usize, &OwnOcclusion),
        budget: Budget,
    ) -> Option<Self> {
        let (values, triangles) = corners;
        let is_of_thing = |triangle: &&[u32; 3]| thing_of[triangle[0] as usize] as usize == number;
        let triangles: Vec<[u32; 3]> = triangles.iter().filter(is_of_thing).copied().collect();
        if triangles.is_empty() {
            return None;
        }
        let places = |triangle: &[u32; 3]| triangle.map(|corner| values[corner as usize].0);
        let surface = RayCaster::new(&triangles.iter().map(places).collect::<Vec<_>>());
        let (points, point_of_corner) = corner_points(values, &triangles, &surface);
        let mut occlusion_of_point = vec![0; points.len()];
        let mut corners = Vec::new();
        // (Triangles come in one order wherever a thing stands.)
        for (&corner, &occlusion) in triangles.iter().flatten().zip(&own.point_of_corner) {
            let point = point_of_corner[corner as usize];
            occlusion_of_point[point] = occlusion;
            corners.push((corner as usize, point));
        }
        corners.sort_unstable();
        corners.dedup();
        Some(Self {
            batch,
            anchor,
            records: IrradianceRecords::new(&points, budget.places),
            occlusion_of_point,
            normals: points.iter().map(|(_, normal)| normal.as_vec3()).collect(),
            corners,
        })
    }
}
