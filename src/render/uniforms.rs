//! Uniform structs, each the twin of a WGSL struct; a test holds them against it offset by offset.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, Mat4, Vec4};

use crate::geometry::bounds::HalfSpace;
use crate::geometry::camera::Intrinsics;
use crate::geometry::shadow_volume::LightPlace;
use crate::light::Light;

use super::pipelines::{GroupLayout, uniform};

/// Nearest depth that is drawn, metres. Reversed floating depth keeps its precision however near this is.
pub(super) const NEAR_M: f32 = 1e-3;

/// The camera as what stands on an anchor meets it: the twin of `AnchorView` in common.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct AnchorView {
    pub clip_from_anchor: Mat4,
    pub camera_from_anchor: Mat4,
}

impl AnchorView {
    pub fn new(intrinsics: &Intrinsics, camera_from_anchor: &DAffine3) -> Self {
        let camera_from_anchor = glam::DMat4::from(*camera_from_anchor).as_mat4();
        let clip_from_camera = intrinsics.clip_from_camera(NEAR_M);
        Self {
            clip_from_anchor: clip_from_camera * camera_from_anchor,
            camera_from_anchor,
        }
    }

    /// The same with all depths a little nearer, so that what is drawn through it wins where it lies exactly in a real
    /// surface, or in that of a virtual thing of a smaller number. Its shadow volumes move along with it, so that it does
    /// not shade itself. At one metre it is 15 µm, and 4 µm for each number: more than depths differ by rounding, and less
    /// than anybody can model or see. (A quarter of it lost ties with the eye a millimetre above the surface.)
    pub fn winning_ties(mut self, number: usize) -> Self {
        let nearer = 1.0 + TIE * (1.0 + 0.25 * number.min(MOST_TIES) as f32);
        // Depth is near / z, and this row alone makes the near.
        for column in 0..4 {
            self.clip_from_anchor.col_mut(column).z *= nearer;
        }
        self
    }
}

/// The part by which a virtual thing's depths are nearer.
const TIE: f32 = 1.0 / 65_536.0;
/// Numbers beyond this win no ties among themselves.
const MOST_TIES: usize = 63;

/// A light in the camera's space: the twin of `CameraLight` in common.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct CameraLight {
    pub place_in_camera: Vec4,
    pub power: Vec4,
}

impl CameraLight {
    pub fn new(light: &Light, camera_from_world: &DAffine3) -> Self {
        let (place, weight, power) = match *light {
            Light::Point {
                position_m,
                intensity,
            } => (
                camera_from_world.transform_point3(position_m),
                1.0,
                intensity,
            ),
            Light::Directional {
                direction,
                irradiance,
            } => (
                -camera_from_world.transform_vector3(direction),
                0.0,
                irradiance,
            ),
        };
        Self {
            place_in_camera: place.as_vec3().extend(weight),
            power: power.as_vec3().extend(0.0),
        }
    }
}

/// A light in a caster's space: the twin of `CastingLight` in volumes.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct CastingLight {
    pub place_in_anchor: Vec4,
    pub end_in_anchor: Vec4,
}

impl CastingLight {
    pub fn new(light: LightPlace, end: Option<HalfSpace>) -> Self {
        let (place, weight) = light.homogeneous();
        Self {
            place_in_anchor: place.as_vec3().extend(weight as f32),
            end_in_anchor: end.map_or(Vec4::ZERO, |end| {
                end.inward.as_vec3().extend(end.offset_m as f32)
            }),
        }
    }
}

/// The camera's lens: the twin of `Lens` in video.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Lens {
    pub focal_px: [f32; 2],
    pub center_px: [f32; 2],
    pub distortion: [f32; 4],
    pub size_px: [u32; 2],
    pub k3: f32,
    pub padding: u32,
}

impl Lens {
    pub fn new(intrinsics: &Intrinsics) -> Self {
        let [k1, k2, p1, p2, k3] = intrinsics.distortion.map(|coefficient| coefficient as f32);
        Self {
            focal_px: intrinsics.focal_px.as_vec2().to_array(),
            center_px: intrinsics.center_px.as_vec2().to_array(),
            distortion: [k1, k2, p1, p2],
            size_px: intrinsics.size_px,
            k3,
            padding: 0,
        }
    }
}

/// Group 0 where geometry is drawn: an [`AnchorView`].
pub(super) const VIEW_GROUP: GroupLayout = GroupLayout {
    label: "view",
    entries: &[uniform(0, wgpu::ShaderStages::VERTEX_FRAGMENT, true)],
};

/// Group 1 where geometry is drawn: a [`CameraLight`], or a [`CastingLight`] for volumes.
pub(super) const LIGHT_GROUP: GroupLayout = GroupLayout {
    label: "light",
    entries: &[uniform(0, wgpu::ShaderStages::VERTEX_FRAGMENT, true)],
};

/// Groups 0 and 1 of every shader that draws geometry: the anchor's view, and a light.
pub(super) const GEOMETRY_GROUPS: [GroupLayout; 2] = [VIEW_GROUP, LIGHT_GROUP];

/// Several uniforms of one kind in one buffer, picked by a dynamic offset.
pub(super) struct UniformRow {
    pub buffer: wgpu::Buffer,
    stride: u64,
    size: u64,
}

impl UniformRow {
    pub fn new<T: Pod>(device: &wgpu::Device, label: &str, count: usize) -> Self {
        let size = size_of::<T>() as u64;
        let stride = size.next_multiple_of(u64::from(
            device.limits().min_uniform_buffer_offset_alignment,
        ));
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: stride * count.max(1) as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self {
            buffer,
            stride,
            size,
        }
    }

    pub fn write<T: Pod>(&self, queue: &wgpu::Queue, index: usize, value: &T) {
        queue.write_buffer(
            &self.buffer,
            self.stride * index as u64,
            bytemuck::bytes_of(value),
        );
    }

    pub fn offset(&self, index: usize) -> u32 {
        (self.stride * index as u64) as u32
    }

    /// One element, to be moved about by the dynamic offset.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.buffer,
            offset: 0,
            size: wgpu::BufferSize::new(self.size),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::shader;
    use crate::render::shafts::data::ShaftFrame;
    use crate::shafts::shadow_atlas::MappedSource;
    use std::mem::offset_of;

    /// Members of a WGSL struct as (name, offset), and the struct's size.
    fn wgsl_struct(source: &str, name: &str) -> (Vec<(String, u32)>, u32) {
        let module = naga::front::wgsl::parse_str(source).expect("WGSL");
        let found = module
            .types
            .iter()
            .find(|(_, kind)| kind.name.as_deref() == Some(name));
        let Some((
            _,
            naga::Type {
                inner: naga::TypeInner::Struct { members, span },
                ..
            },
        )) = found
        else {
            panic!("no struct {name}");
        };
        let named =
            |member: &naga::StructMember| (member.name.clone().expect("a name"), member.offset);
        (members.iter().map(named).collect(), *span)
    }

    macro_rules! assert_twins {
        ($source:expr, $twin:ty, $($member:ident),+) => {
            let ours = vec![$((stringify!($member).to_owned(), offset_of!($twin, $member) as u32)),+];
            let (theirs, size) = wgsl_struct($source, stringify!($twin));
            assert_eq!((ours, size_of::<$twin>() as u32), (theirs, size), stringify!($twin));
        };
    }

    #[test]
    fn every_uniform_has_the_layout_of_its_wgsl_twin() {
        let common = shader::source("common.wgsl", &[]).unwrap();
        assert_twins!(&common, AnchorView, clip_from_anchor, camera_from_anchor);
        assert_twins!(&common, CameraLight, place_in_camera, power);
        let volumes = shader::source("volumes.wgsl", &[]).unwrap();
        assert_twins!(&volumes, CastingLight, place_in_anchor, end_in_anchor);
        let source = shader::source("mapped_source.wgsl", &[]).unwrap();
        assert_twins!(
            &source,
            MappedSource,
            map_from_world,
            position,
            spread_m,
            intensity,
            focal_texels,
            tile_corner,
            tile_side,
            near_m,
            range_m,
            tile_px,
            padding
        );
        let shafts = shader::source("shafts.wgsl", &[]).unwrap();
        assert_twins!(
            &shafts,
            ShaftFrame,
            world_from_camera,
            moving_irradiance,
            source_count
        );
        let video = shader::source("video.wgsl", &[]).unwrap();
        assert_twins!(
            &video, Lens, focal_px, center_px, distortion, size_px, k3, padding
        );
    }
}
