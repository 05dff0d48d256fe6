//! Things that change their shape in an environment's light: what each hides, from others and from itself, frame by frame.

use super::super::anchor_geometry::Role;
use super::super::deforming::DeformingThing;
use super::super::gpu::Gpu;
use super::super::gpu_scene::GpuScene;
use super::super::indirect::points;
use super::data::occlusion_corners;
use super::{Environment, START_OFFSET};
use crate::environment::self_occlusion::self_occlusions_by;
use crate::environment::thing::Thing;

/// Rays from all corners of a thing in one frame, about, ...
const RAYS_OF_A_FRAME: usize = 150_000;
/// ... and from each of them at least, and at most.
const RAYS_OF_A_CORNER: [usize; 2] = [48, 256];

impl Environment {
    /// Takes the shape that a thing has now.
    pub(super) fn deform_thing(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        deforming: &DeformingThing,
    ) {
        let DeformingThing {
            role,
            number,
            object,
            ..
        } = deforming;
        let Some(thing) = Thing::new(&object.occluder(), *role == Role::Real) else {
            return;
        };
        let caster = self.casters.iter().position(|caster| caster == number);
        if let Some(range) = caster.and_then(|caster| self.ranges.get(caster)) {
            let corners = thing.triangles.as_flattened();
            // (Always as many: nothing is left out of what changes its shape.)
            if corners.len() == range.len() {
                let offset = u64::from(range.start) * size_of::<glam::Vec3>() as u64;
                gpu.queue
                    .write_buffer(&self.triangles, offset, bytemuck::cast_slice(corners));
            }
        }
        self.occlude(gpu, gpu_scene, (*role, object.anchor), &thing);
        if let Some(known) = self.things.get_mut(*number) {
            *known = Some(thing);
        }
        self.placed_for = None;
    }

    /// Works out what the corners of a thing hide from themselves, by as many rays as there is time for.
    fn occlude(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        (role, anchor): (Role, usize),
        thing: &Thing,
    ) {
        let batches = gpu_scene.corners().zip(&mut self.occlusions);
        let of_thing = |batch: &(Role, usize)| *batch == (role, anchor);
        let found = batches
            .filter_map(|(batch, known)| Some((batch, known.as_mut()?)))
            .find(|((role, anchor, _), _)| of_thing(&(*role, *anchor)));
        let Some(((_, _, corners), known)) = found else {
            return;
        };
        let (places, triangles) = &corners.corners;
        let [fewest, most] = RAYS_OF_A_CORNER;
        let rays = (RAYS_OF_A_FRAME / places.len().max(1)).clamp(fewest, most);
        let number = known.thing_of_point.first().copied().unwrap_or(0);
        let size_m = (thing.bounds.high - thing.bounds.low).length();
        (known.points, known.point_of_corner) = points(places, triangles);
        known.thing_of_point = vec![number; known.points.len()];
        known.occlusions = self_occlusions_by(rays, &known.points, |_| {
            (&thing.caster, size_m * START_OFFSET)
        });
        let visibility = |corner: usize| known.occlusions[known.point_of_corner[corner]].visibility;
        let contents = occlusion_corners(&corners.thing_of, visibility);
        let usage = wgpu::BufferUsages::VERTEX;
        let buffer = gpu.buffer("self-occlusion", &contents, usage);
        gpu_scene.set_occlusion_of((role, anchor), buffer);
    }
}
