//! What the environment's shaders read.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, Mat4, Vec3};

use crate::environment::distant_light::DistantLight;
use crate::environment::reflected::DiscNode;
use crate::environment::self_occlusion::{VISIBILITIES, VISIBILITY_DEGREE};
use crate::environment::thing::Thing;
use crate::light::harmonics::basis;
use crate::light::regions::Region;

/// A frame's part of group 2: the twin of `EnvironmentFrame` in environment.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct EnvironmentFrame {
    pub world_from_camera: Mat4,
    pub region_count: u32,
    pub caster_count: u32,
    pub real_caster_count: u32,
    pub disc_count: u32,
}

/// The twin of `Region`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuRegion {
    toward: Vec3,
    width: f32,
    irradiance: Vec3,
    spread: f32,
}

impl GpuRegion {
    pub fn new(region: &Region) -> Self {
        Self {
            toward: region.toward.as_vec3(),
            width: region.width() as f32,
            irradiance: region.irradiance.as_vec3(),
            spread: region.spread as f32,
        }
    }
}

/// The twin of `Receiver`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuReceiver {
    center: Vec3,
    first_harmonics: u32,
}

impl GpuReceiver {
    /// Of a thing that may not be there.
    pub fn new(
        thing: Option<&Thing>,
        world_from_anchor: &[Option<DAffine3>],
        distant: &DistantLight,
    ) -> Self {
        let rows = (VISIBILITIES / 4 * distant.regions.len()) as u32;
        let placed = thing.and_then(|thing| Some((thing, world_from_anchor[thing.anchor]?)));
        let center = placed.map(|(thing, pose)| {
            let center = thing.ball.center.as_dvec3();
            pose.transform_point3(center).as_vec3()
        });
        Self {
            center: center.unwrap_or_default(),
            first_harmonics: thing.map_or(0, |thing| thing.anchor as u32 * rows),
        }
    }
}

/// The twin of `Disc`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuDisc {
    position: Vec3,
    area: f32,
    normal: Vec3,
    open_low: u32,
    without: Vec3,
    open_high: u32,
    lost: Vec3,
    radius: f32,
    next: u32,
    padding: [u32; 3],
}

impl GpuDisc {
    /// Of a node of the tree of discs.
    pub fn new(node: &DiscNode) -> Self {
        let disc = &node.whole;
        Self {
            position: disc.surfel.position,
            area: disc.surfel.area,
            normal: disc.surfel.normal,
            open_low: disc.open as u32,
            without: disc.without,
            open_high: (disc.open >> 32) as u32,
            lost: disc.without - disc.with,
            radius: node.radius,
            next: node.next,
            padding: [0; 3],
        }
    }
}

/// For each anchor and region the harmonics in the region's direction, as the anchor sees it: turning a thing turns them.
pub(super) fn harmonics_of_regions(
    regions: &[Region],
    world_from_anchor: &[Option<DAffine3>],
) -> Vec<f32> {
    let mut values = Vec::new();
    for pose in world_from_anchor {
        let turn = pose.map(|pose| pose.matrix3.transpose());
        for region in regions {
            let toward = turn.map_or(region.toward, |turn| (turn * region.toward).normalize());
            let basis = basis(toward, VISIBILITY_DEGREE);
            values.extend(basis.into_iter().map(|value| value as f32));
        }
    }
    values
}

/// The contents of a batch's buffer of self-occlusion.
pub(super) fn occlusion_corners(
    thing_of: &[u32],
    visibility: impl Fn(usize) -> [f32; VISIBILITIES],
) -> Vec<u8> {
    let mut contents = Vec::new();
    for (corner, thing) in thing_of.iter().enumerate() {
        contents.extend_from_slice(bytemuck::bytes_of(&visibility(corner)));
        contents.extend_from_slice(bytemuck::bytes_of(thing));
    }
    contents
}
