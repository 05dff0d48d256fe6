//! Uniform structs, each the twin of a WGSL struct; a test holds them against it offset by offset.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat3, DVec3, Mat4, Vec3, Vec4};

use crate::geometry::bounds::HalfSpace;
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::lens;
use crate::geometry::shadow_volume::LightPlace;
use crate::light::Light;

use super::pipelines::{GroupLayout, filtered, sampler, texels, uniform};

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
    /// surface, or in that of a virtual thing of a smaller number. At one metre it is 15 µm, and 4 µm for each number: more
    /// than depths differ by rounding, and less than anybody can model or see. (A quarter of it lost ties with the eye a
    /// millimetre above the surface.)
    ///
    /// The sides of shadow volumes stay where they are: a lit surface that is nearer to the camera lies the farther outside its
    /// own, and what a light grazes beside a nearer caster would be in a shadow that nothing throws.
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
    pub axis_in_camera: Vec4,
    pub half_width: Vec4,
    pub half_height: Vec4,
}

impl CameraLight {
    pub fn new(light: &Light, camera_from_world: &DAffine3) -> Self {
        match light.moved(camera_from_world) {
            Light::Point {
                position_m,
                intensity,
                shape,
            } => {
                let frame = shape.frame();
                let [half_width, half_height] = frame.half_sides_m;
                Self {
                    place_in_camera: position_m.as_vec3().extend(1.0),
                    power: intensity.as_vec3().extend(frame.radius_m as f32),
                    axis_in_camera: frame.axis.as_vec3().extend(0.0),
                    half_width: half_width.as_vec3().extend(0.0),
                    half_height: half_height.as_vec3().extend(0.0),
                }
            }
            Light::Directional {
                direction,
                irradiance,
                angle_rad,
            } => Self {
                place_in_camera: -direction.as_vec3().extend(0.0),
                power: irradiance.as_vec3().extend((0.5 * angle_rad).sin() as f32),
                axis_in_camera: Vec4::ZERO,
                half_width: Vec4::ZERO,
                half_height: Vec4::ZERO,
            },
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
    pub rational: [f32; 4],
    pub prism: [f32; 4],
    pub tilt_x: [f32; 4],
    pub tilt_y: [f32; 4],
    pub tilt_z: [f32; 4],
    pub size_px: [u32; 2],
    pub model: u32,
    pub padding: u32,
}

impl Lens {
    pub fn new(intrinsics: &Intrinsics) -> Self {
        let mut all = [0.0; 14];
        let given = intrinsics.distortion.coefficients();
        all[..given.len()].copy_from_slice(given);
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, _, _] =
            all.map(|number| number as f32);
        let (model, tilt) = match intrinsics.distortion {
            Distortion::Polynomial(_) => (0, None),
            Distortion::Rational(coefficients) => (1, lens::tilt(&coefficients)),
            Distortion::Fisheye(_) => (2, None),
        };
        let tilt = tilt.unwrap_or(DMat3::IDENTITY);
        let column = |axis: DVec3| axis.as_vec3().extend(0.0).to_array();
        Self {
            focal_px: intrinsics.focal_px.as_vec2().to_array(),
            center_px: intrinsics.center_px.as_vec2().to_array(),
            distortion: [k1, k2, p1, p2],
            rational: [k3, k4, k5, k6],
            prism: [s1, s2, s3, s4],
            tilt_x: column(tilt.x_axis),
            tilt_y: column(tilt.y_axis),
            tilt_z: column(tilt.z_axis),
            size_px: intrinsics.size_px,
            model,
            padding: 0,
        }
    }
}

/// What a layer that lets light through takes of it: the twin of `LayerOpacity` in translucent.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct LayerOpacity {
    pub map_from_camera: Mat4,
    pub mean: f32,
    pub has_map: u32,
    pub padding: [u32; 2],
}

/// What rays of reflections are followed with in a frame: the twin of `ReflectionFrame` in reflections.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct ReflectionFrame {
    pub clip_from_camera: Mat4,
    pub light_from_camera: Mat4,
    pub ambient: Vec3,
    pub thing_count: u32,
    pub light_count: u32,
    pub has_probe: u32,
    pub focal_px: f32,
    pub padding: u32,
}

/// A thing that such rays may meet, in a frame: the twin of `TracedThing` in ray_trees.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct TracedThing {
    pub own_from_camera: [Vec4; 3],
    pub low: Vec3,
    pub what: u32,
    pub high: Vec3,
    pub root: u32,
}

/// Group 0 where geometry is drawn: an [`AnchorView`], what a glossy layer mirrors of light from everywhere, and what rays have met
/// for it.
pub(super) const VIEW_GROUP: GroupLayout = GroupLayout {
    label: "view",
    entries: &[
        uniform(0, wgpu::ShaderStages::VERTEX_FRAGMENT, true),
        filtered(1),
        sampler(2),
        texels(3, false),
    ],
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
    use crate::render::materials::{MapOnGpu, MaterialOnGpu};
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
        assert_twins!(
            &common,
            CameraLight,
            place_in_camera,
            power,
            axis_in_camera,
            half_width,
            half_height
        );
        let volumes = shader::source("volumes.wgsl", &[]).unwrap();
        assert_twins!(&volumes, CastingLight, place_in_anchor, end_in_anchor);
        let materials = shader::source("materials.wgsl", &[]).unwrap();
        let look = "struct Look { albedo: vec3f, roughness: f32, metallic: f32, emission: vec3f, occlusion: f32, \
                    opacity: f32, normal: vec3f, is_principled: bool }\nfn unit(v: vec3f) -> vec3f { return v; }\n";
        let materials = format!("{look}{materials}");
        assert_twins!(&materials, MapOnGpu, linear, offset, place, size);
        assert_twins!(
            &materials,
            MaterialOnGpu,
            albedo,
            roughness,
            emission,
            metallic,
            opacity,
            cutoff,
            normal_scale,
            occlusion_strength,
            shading,
            translucent,
            padding_2,
            padding_3,
            maps
        );
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
        let reflections = shader::source("reflections.wgsl", &[]).unwrap();
        assert_twins!(
            &reflections,
            ReflectionFrame,
            clip_from_camera,
            light_from_camera,
            ambient,
            thing_count,
            light_count,
            has_probe,
            focal_px,
            padding
        );
        let translucent = shader::source("translucent.wgsl", &[]).unwrap();
        assert_twins!(
            &translucent,
            LayerOpacity,
            map_from_camera,
            mean,
            has_map,
            padding
        );
        assert_twins!(
            &reflections,
            TracedThing,
            own_from_camera,
            low,
            what,
            high,
            root
        );
        let video = shader::source("video.wgsl", &[]).unwrap();
        assert_twins!(
            &video, Lens, focal_px, center_px, distortion, rational, prism, tilt_x, tilt_y, tilt_z,
            size_px, model, padding
        );
    }
}
