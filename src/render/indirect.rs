//! Light that virtual things in the world get from their surroundings (light::bounce), corner by corner.
//! Reads the poses of what moves. Writes the `indirect` vertices of the world's virtual batch.
//!
//! Virtual things on moving anchors keep the plain ambient light: their surroundings change in every frame.

use glam::{DAffine3, Vec3};

use crate::geometry::corner_points::corner_points;
use crate::light::bounce::{Gathering, Mover, Surroundings};
use crate::light::irradiance_records::IrradianceRecords;
use crate::scene::{Object, Scene};

use super::anchor_geometry::Corners;
use super::known_states::KnownStates;

/// Rays for a scene in which nothing moves: gathered once, in a second or so.
const STANDING: Budget = Budget {
    rays: 1_000_000,
    rays_per_record: 256,
};
/// Rays where things move: held against them in every frame, in some milliseconds.
const MOVING: Budget = Budget {
    rays: 75_000,
    rays_per_record: 64,
};

/// How many rays there are, and from how many of them on more places tell less than more rays.
struct Budget {
    rays: usize,
    rays_per_record: usize,
}

/// Things whose light is gathered corner by corner, where ambient light is light (`ambient_samples`).
pub(super) fn lit_by_surroundings(scene: &Scene) -> impl Iterator<Item = &Object> {
    let is_gathered = scene.shadows.ambient_samples > 0;
    let virtuals = scene.virtuals.iter();
    virtuals.filter(move |object| is_gathered && object.visible && object.anchor == 0)
}

/// The gathered light of the world's virtual things.
pub(super) struct Indirect {
    gathering: Gathering,
    /// Where it was gathered, and what of it each point has.
    records: IrradianceRecords,
    /// What stands on each moving anchor.
    movers: Vec<(usize, Mover)>,
    /// For each corner of the batch its point.
    point_of_corner: Vec<usize>,
    /// The light of the batch's corners, by where the movers are; that of the present state first.
    known: KnownStates<Vec<Option<DAffine3>>, Vec<Vec3>>,
    /// Whether the batch has that.
    is_written: bool,
}

impl Indirect {
    /// Sends the rays; `None` where nothing virtual stands in the world.
    pub fn new(scene: &Scene, (corners, triangles): &Corners) -> Option<Self> {
        if corners.is_empty() {
            return None;
        }
        let on_anchor = |anchor: usize| {
            let all = scene.phantoms.iter().chain(&scene.virtuals);
            all.filter(move |object| object.visible && object.anchor == anchor)
                .flat_map(Object::reflectors)
                .collect::<Vec<_>>()
        };
        let movers: Vec<(usize, Mover)> = (1..scene.node_count())
            .filter_map(|anchor| Some((anchor, Mover::new(&on_anchor(anchor))?)))
            .collect();
        let surroundings = Surroundings::new(
            on_anchor(0),
            scene.world_lights(),
            scene.ambient_radiance,
            scene.further_light(),
        );
        let (points, point_of_corner) = corner_points(corners, triangles, surroundings.caster());
        let Budget {
            rays,
            rays_per_record,
        } = if scene.moves() { MOVING } else { STANDING };
        let records = IrradianceRecords::new(&points, rays / rays_per_record);
        Some(Self {
            gathering: surroundings.gather(&records.places, rays),
            records,
            movers,
            point_of_corner,
            known: KnownStates::new(scene.moves()),
            is_written: false,
        })
    }

    /// The same light for things that stand elsewhere; `None` where those are not the same things.
    pub fn for_corners(self, (corners, _): &Corners) -> Option<Self> {
        (self.point_of_corner.len() == corners.len()).then_some(Self {
            is_written: false,
            ..self
        })
    }

    /// Takes the shape that something which moves has now.
    pub fn deform(&mut self, object: &Object) {
        let mut movers = self.movers.iter_mut();
        if let Some((_, mover)) = movers.find(|(anchor, _)| *anchor == object.anchor) {
            let positions = object.positions_in_anchor(&object.mesh);
            let triangles = object.mesh.triangles.iter();
            let corners = triangles.map(|triangle| triangle.map(|it| positions[it as usize]));
            mover.deform(&corners.collect::<Vec<_>>());
            self.known.clear();
        }
    }

    /// Brings the batch's light up to what moves in this frame.
    pub fn update(
        &mut self,
        queue: &wgpu::Queue,
        batch: &wgpu::Buffer,
        world_from_anchor: &[Option<DAffine3>],
    ) {
        let movers = self.movers.iter();
        let poses = movers.map(|(anchor, _)| world_from_anchor[*anchor]);
        let poses: Vec<Option<DAffine3>> = poses.collect();
        let is_as_before = self
            .known
            .last()
            .is_some_and(|(before, _)| *before == poses);
        if is_as_before && self.is_written {
            return;
        }
        let corners = self.known.take(&poses).unwrap_or_else(|| {
            let movers = self.movers.iter().zip(&poses);
            let placed = movers.filter_map(|((_, mover), pose)| Some((mover, (*pose)?)));
            let irradiances = self.gathering.irradiances(&placed.collect::<Vec<_>>());
            let irradiances = self.records.at_points(&irradiances);
            let points = self.point_of_corner.iter();
            points.map(|&point| irradiances[point]).collect()
        });
        queue.write_buffer(batch, 0, bytemuck::cast_slice(&corners));
        self.known.keep(poses, corners);
        self.is_written = true;
    }
}
