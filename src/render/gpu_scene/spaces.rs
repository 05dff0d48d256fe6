//! Where the anchors are: in the camera, in the world, and in the space that light from afar is known in.

use super::GpuScene;
use crate::light::Light;
use glam::DAffine3;

/// Where an anchor is in the world. What stands in that, as a layer may on a node of its own, does so to the last bit: no camera comes
/// between.
pub(in super::super) fn world_from(
    camera_from_world: &DAffine3,
    camera_from_anchor: &DAffine3,
) -> DAffine3 {
    match camera_from_anchor == camera_from_world {
        true => DAffine3::IDENTITY,
        false => camera_from_world.inverse() * *camera_from_anchor,
    }
}

impl GpuScene {
    /// Where the anchors are.
    pub fn camera_from_anchor(&self) -> &[Option<DAffine3>] {
        &self.camera_from_anchor
    }

    /// Where the anchors are in the world, which stands still to itself; `None` where the world has no pose.
    pub fn world_from_anchor(&self) -> Option<Vec<Option<DAffine3>>> {
        let camera_from_world = (*self.camera_from_anchor.first()?)?;
        let anchors = self.camera_from_anchor.iter();
        let in_world = anchors.map(|pose| Some(world_from(&camera_from_world, &(*pose)?)));
        Some(in_world.collect())
    }

    /// The turn of the space that light from afar is known in, from the world; `None` where what it turns with is not there.
    fn light_from_world(&self) -> Option<DAffine3> {
        let world_from_light = self.world_from_anchor()?[self.light_anchor]?;
        Some(DAffine3::from_mat3(world_from_light.matrix3.transpose()))
    }

    /// Where the anchors are in the space that light from afar is known in; `None` where that or the world has no pose.
    pub fn light_from_anchor(&self) -> Option<Vec<Option<DAffine3>>> {
        let light_from_world = self.light_from_world()?;
        let anchors = self.world_from_anchor()?.into_iter();
        Some(match self.light_anchor {
            0 => anchors.collect(),
            _ => anchors
                .map(|pose| pose.map(|world_from_anchor| light_from_world * world_from_anchor))
                .collect(),
        })
    }

    /// The camera in that space.
    pub fn camera_from_light(&self) -> Option<DAffine3> {
        let camera_from_world = (*self.camera_from_anchor.first()?)?;
        match self.light_anchor {
            0 => Some(camera_from_world),
            _ => Some(camera_from_world * self.light_from_world()?.inverse()),
        }
    }

    /// The lights that cast shadow volumes and shine, in world space.
    pub fn shining(&self) -> Vec<Light> {
        self.lights.shining()
    }

    /// They in the camera's space; none where the world has no pose.
    pub fn shining_in_camera(&self) -> Vec<Light> {
        let camera_from_world = self.camera_from_anchor.first().copied().flatten();
        let shining = self.lights.shining().into_iter();
        camera_from_world.map_or(Vec::new(), |pose| {
            shining.map(|light| light.moved(&pose)).collect()
        })
    }

    /// They in the space that light from afar is known in.
    pub fn shining_in_light(&self) -> Vec<Light> {
        let shining = self.lights.shining();
        match self.light_from_world() {
            Some(light_from_world) if self.light_anchor != 0 => {
                let lights = shining.iter();
                lights.map(|light| light.moved(&light_from_world)).collect()
            }
            _ => shining,
        }
    }
}
