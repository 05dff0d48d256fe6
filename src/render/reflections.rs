//! What glossy virtual things mirror of real and virtual things around them, whatever the technique: the frame is drawn, rays are
//! followed from each glossy pixel, and what mirrors is drawn again with what they have met.
//!
//! What a ray meets is as bright as the picture has it, where the camera sees that place too. So what is mirrored has the video's own
//! colours, the shadows of virtual things in it, and needs no model but of shapes.
//! Reads the picture without and with virtual things, and the scene's triangles. Writes what layer_albedo.wgsl reads.

use glam::{DAffine3, DMat3, Mat4, Vec3};

use crate::geometry::reach::PixelRect;
use crate::light::Light;
use crate::scene::Scene;

use super::anchor_geometry::Role;
use super::attachments::{cleared, depth_stencil, kept, target, texture};
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::light_kind::LightKind;
use super::linear_picture::{LinearPicture, LinearPictures};
use super::mirrored_probe::MirroredProbe;
use super::mirroring::{REFLECTIONS_FORMAT, ROUGHEST_DIELECTRIC, are_followed};
use super::passes::Passes;
use super::pipelines::{
    GroupLayout, PipelineDescription, filtered, overwritten, sampler, storage, texels, uniform,
    words,
};
use super::ray_trees::RayTrees;
use super::surfaces::{Sided, SurfaceKinds, surface_description};
use super::technique::FrameContext;
use super::uniforms::{CameraLight, GEOMETRY_GROUPS, NEAR_M, ReflectionFrame};
use super::volumes::set_scissor;

const DEPTHS_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Float;
const REFLECTION_GROUP: GroupLayout = GroupLayout {
    label: "reflections",
    entries: &[
        uniform(0, wgpu::ShaderStages::FRAGMENT, false),
        words(1, wgpu::ShaderStages::FRAGMENT),
        storage(2, wgpu::ShaderStages::FRAGMENT),
        texels(3, false),
        filtered(4),
        filtered(5),
        sampler(6),
        filtered(7),
        sampler(8),
        filtered(9),
        storage(10, wgpu::ShaderStages::FRAGMENT),
    ],
};

/// Pipelines and pictures of the passes.
pub(super) struct Reflections {
    trees: RayTrees,
    ambient: Vec3,
    pipelines: Pipelines,
    pictures: LinearPictures,
    frame: wgpu::Buffer,
    recorded: LinearPicture,
    shown: LinearPicture,
    shown_real: LinearPicture,
    depths: wgpu::TextureView,
    depth_stencil: wgpu::TextureView,
    /// What is copied to where the surfaces' shaders read it, which cannot be drawn into meanwhile.
    mirrored: wgpu::Texture,
    sampler: wgpu::Sampler,
    /// In place of a probe, where there is none.
    no_probe: MirroredProbe,
}

/// Pipelines of surfaces.
struct Pipelines {
    depth_of_real: Sided,
    depth_of_virtual: Sided,
    mirror: Sided,
}

impl Pipelines {
    /// With so many rays from each pixel.
    fn new(gpu: &Gpu, kinds: SurfaceKinds, rays: u32) -> Self {
        let described = |fragment, groups: Vec<Option<GroupLayout>>, target| PipelineDescription {
            shader: "reflections.wgsl",
            vertex: "place",
            fragment,
            constants: vec![
                ("GLOSSY", 1.0),
                ("RAYS", f64::from(rays)),
                ("ROUGHEST_DIELECTRIC", ROUGHEST_DIELECTRIC),
            ],
            groups,
            targets: vec![target],
            ..surface_description(gpu, None)
        };
        let depth = |write_mask| wgpu::ColorTargetState {
            write_mask,
            ..DEPTHS_FORMAT.into()
        };
        let geometry = || GEOMETRY_GROUPS.map(Some).to_vec();
        let depth_of_virtual = described(
            "depth_of_surface",
            geometry(),
            depth(wgpu::ColorWrites::GREEN),
        );
        let mut mirror = described(
            "mirror",
            [geometry(), vec![Some(REFLECTION_GROUP)]].concat(),
            overwritten(REFLECTIONS_FORMAT),
        );
        if let Some(state) = &mut mirror.depth_stencil {
            state.depth_compare = Some(wgpu::CompareFunction::Equal);
            state.depth_write_enabled = Some(false);
        }
        let depth_of_real = described(
            "depth_of_surface",
            geometry(),
            depth(wgpu::ColorWrites::RED),
        );
        Self {
            depth_of_real: Sided::both(gpu, &depth_of_real),
            depth_of_virtual: Sided::both(gpu, &kinds.of_virtual(depth_of_virtual)),
            mirror: Sided::both(gpu, &kinds.of_virtual(mirror)),
        }
    }
}

impl Reflections {
    /// `None` where nothing shows what it mirrors.
    pub fn new(gpu: &Gpu, scene: &Scene, gpu_scene: &GpuScene) -> Option<Self> {
        if !are_followed(scene) {
            return None;
        }
        let device = &gpu.device;
        let size_px = gpu_scene.intrinsics().size_px;
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let none = wgpu::TextureUsages::empty();
        Some(Self {
            trees: RayTrees::new(gpu, scene),
            ambient: scene.ambient_radiance.as_vec3(),
            pipelines: Pipelines::new(gpu, gpu_scene.kinds, scene.shadows.reflection_samples),
            pictures: LinearPictures::new(gpu),
            frame: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("reflections"),
                size: size_of::<ReflectionFrame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            recorded: LinearPicture::new(device, "linear video", size_px),
            shown: LinearPicture::new(device, "linear picture", size_px),
            shown_real: LinearPicture::new(device, "real part of the picture", size_px),
            depths: target(device, "depths", size_px, DEPTHS_FORMAT, 1, read),
            depth_stencil: target(
                device,
                "reflections' depth and stencil",
                size_px,
                gpu.depth_format,
                1,
                none,
            ),
            mirrored: texture(
                device,
                "mirrored",
                size_px,
                REFLECTIONS_FORMAT,
                1,
                wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            ),
            sampler: gpu.linear_sampler("mirrored picture"),
            no_probe: MirroredProbe::new(device, &gpu.queue, None),
        })
    }

    /// Takes another state of the same scene: things elsewhere, shown or hidden.
    pub fn follow(&mut self, scene: &Scene) {
        self.trees.follow(scene);
    }

    /// Takes note of things that have another shape now.
    pub fn deform(&mut self, things: &[&DeformingThing]) {
        for thing in things {
            self.trees.deform(thing);
        }
    }

    /// Forgets what rays have met, and keeps the video, which is all that the picture shows so far, if anything that mirrors can be
    /// in it. Returns where.
    pub fn begin(&self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) -> PixelRect {
        let gpu_scene = frame.gpu_scene;
        let reflections = gpu_scene.reflections().create_view(&Default::default());
        drop(passes.begin("no reflections", None, &[cleared(&reflections)], None));
        let mirroring = self.trees.mirroring_pixels(
            gpu_scene.camera_from_anchor(),
            gpu_scene.unseen(),
            gpu_scene.intrinsics(),
        );
        let mirroring = mirroring.intersection(frame.bounds.virtuals);
        if !mirroring.is_empty() {
            self.pictures
                .take(frame.gpu, passes, frame.picture, &self.recorded);
        }
        mirroring
    }

    /// Follows rays from the glossy virtual surfaces `within` the picture, which shows them without reflections. `probe` is what is
    /// mirrored where a ray meets nothing.
    pub fn draw(
        &mut self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        within: PixelRect,
        probe: Option<&MirroredProbe>,
    ) {
        let (gpu, gpu_scene) = (frame.gpu, frame.gpu_scene);
        self.draw_depths(passes, gpu_scene);
        self.pictures.take(gpu, passes, frame.picture, &self.shown);
        let picture = [frame.picture, &self.depths];
        self.pictures
            .take_real(gpu, passes, picture, &self.shown_real);
        let trees = self.trees.table(gpu).clone();
        let group = self.group(frame, &trees, probe);
        let mirrored = self.mirrored.create_view(&Default::default());
        let mut pass = passes.begin(
            "reflections",
            None,
            &[cleared(&mirrored)],
            Some(kept(&self.depth_stencil)),
        );
        set_scissor(&mut pass, within);
        pass.set_bind_group(2, &group, &[]);
        let light = DrawnLight::Whole(0);
        gpu_scene.draw_surfaces(
            &mut pass,
            &self.pipelines.mirror,
            Role::Virtual,
            light,
            within,
        );
        drop(pass);
        let to = gpu_scene.reflections();
        passes
            .note("reflections to surfaces")
            .copy_texture_to_texture(self.mirrored.as_image_copy(), to.as_image_copy(), to.size());
    }

    /// All that the rays read.
    fn group(
        &self,
        frame: &FrameContext<'_>,
        trees: &wgpu::TextureView,
        probe: Option<&MirroredProbe>,
    ) -> wgpu::BindGroup {
        let (gpu, gpu_scene) = (frame.gpu, frame.gpu_scene);
        let intrinsics = gpu_scene.intrinsics();
        let things = self
            .trees
            .placed(gpu_scene.camera_from_anchor(), gpu_scene.unseen());
        let lamps = gpu_scene.shining_in_camera();
        let lamps: Vec<CameraLight> = lamps.iter().map(lamp).collect();
        let light_from_camera = gpu_scene
            .camera_from_light()
            .map_or(DMat3::IDENTITY, |pose| pose.matrix3.transpose());
        let uniform = ReflectionFrame {
            clip_from_camera: intrinsics.clip_from_camera(NEAR_M),
            light_from_camera: Mat4::from_mat3(light_from_camera.as_mat3()),
            ambient: self.ambient,
            thing_count: things.len() as u32,
            light_count: lamps.len() as u32,
            has_probe: u32::from(probe.is_some()),
            focal_px: intrinsics.focal_px.x as f32,
            padding: 0,
        };
        gpu.queue
            .write_buffer(&self.frame, 0, bytemuck::bytes_of(&uniform));
        let [things, lamps] = [
            ("things", bytemuck::cast_slice(&things)),
            ("lamps", bytemuck::cast_slice(&lamps)),
        ]
        .map(|(label, contents)| gpu.buffer(label, contents, wgpu::BufferUsages::STORAGE));
        let probe = probe.unwrap_or(&self.no_probe);
        let view = wgpu::BindingResource::TextureView;
        gpu.bind_group(
            &REFLECTION_GROUP,
            [
                self.frame.as_entire_binding(),
                view(trees),
                things.as_entire_binding(),
                view(&self.depths),
                view(&self.recorded.view),
                view(&self.shown.view),
                wgpu::BindingResource::Sampler(&self.sampler),
                view(&probe.view),
                wgpu::BindingResource::Sampler(&probe.sampler),
                view(&self.shown_real.view),
                lamps.as_entire_binding(),
            ],
        )
    }

    /// Draws which surfaces the camera sees how far off.
    fn draw_depths(&self, passes: &mut Passes<'_>, gpu_scene: &GpuScene) {
        let whole = PixelRect::whole(gpu_scene.intrinsics().size_px);
        let mut pass = passes.begin(
            "depths",
            None,
            &[cleared(&self.depths)],
            Some(depth_stencil(&self.depth_stencil, true, false)),
        );
        for (role, pipelines) in [
            (Role::Real, &self.pipelines.depth_of_real),
            (Role::Virtual, &self.pipelines.depth_of_virtual),
        ] {
            gpu_scene.draw_surfaces(&mut pass, pipelines, role, DrawnLight::Whole(0), whole);
        }
    }
}

/// A light of the camera's space, with what it is in the last number of its axis.
fn lamp(light: &Light) -> CameraLight {
    let mut lamp = CameraLight::new(light, &DAffine3::IDENTITY);
    lamp.axis_in_camera.w = f32::from(LightKind::of(light).number());
    lamp
}
