//! Things that change their shape, on the GPU: each has a node, and with it a batch, to itself.

use super::super::anchor_geometry::{OcclusionCorners, Role, corners};
use super::super::deforming::DeformingThing;
use super::super::gpu::Gpu;
use super::GpuScene;

impl GpuScene {
    /// Gives a thing the shape that it has now: its surface, what it casts, and what others get past it.
    pub fn deform(&mut self, gpu: &Gpu, deforming: &DeformingThing) {
        let DeformingThing {
            role,
            object,
            first_material,
            ..
        } = deforming;
        let kind = (*role, object.anchor);
        let mut things = self.things.iter_mut().enumerate();
        let thing = things.find(|(_, thing)| (thing.role, thing.anchor) == kind);
        let mut batches = self.batches.iter_mut();
        let batch = batches.find(|batch| (batch.role, batch.anchor) == kind);
        // (What is hidden is not there.)
        let (Some((number, thing)), Some(batch)) = (thing, batch) else {
            return;
        };
        let deformed = corners(object, &object.mesh);
        thing.deform(&gpu.queue, (object, &deformed));
        batch.deform(&gpu.queue, (object, &deformed), *first_material);
        self.casters.forget(number);
        if let Some(indirect) = &mut self.indirect {
            indirect.deform(object);
        }
    }

    /// Gives the batch of a role and anchor another self-occlusion (see [`GpuScene::set_occlusion`]).
    pub fn set_occlusion_of(&mut self, (role, anchor): (Role, usize), occlusion: OcclusionCorners) {
        let mut batches = self.batches.iter_mut();
        if let Some(batch) = batches.find(|batch| (batch.role, batch.anchor) == (role, anchor)) {
            batch.occlusion = Some(occlusion);
        }
    }
}
