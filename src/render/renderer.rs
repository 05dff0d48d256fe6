//! The frame from top to bottom: recorded picture, surfaces, shadow volumes light by light, composite.

use std::sync::Arc;

use glam::DAffine3;

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::PixelRect;
use crate::light::Light;
use crate::scene::Scene;

use super::anchor_geometry::{self, Extent, Role, SurfaceBatch};
use super::casters::Casters;
use super::composite::{Composite, GAIN_FORMAT, PICTURE_FORMAT};
use super::gpu::{Gpu, RenderError};
use super::gpu_clock::{GpuClock, GpuTimes};
use super::indirect::Indirect;
use super::layers::{LayerPasses, Layers};
use super::readback::Readback;
use super::surfaces::{LIGHT_FORMAT, Surfaces};
use super::touched::{Touched, everywhere, touched_by_virtual};
use super::uniforms::{Lens, LightSource, UniformRow, View, uniform_entry};
use super::volumes::{Among, Volumes, set_scissor};

/// What a frame shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The video with the virtual things.
    Composite,
    /// The undistorted video alone.
    Bare,
}

/// Draws the frames of one scene through one camera.
pub struct Renderer {
    gpu: Arc<Gpu>,
    intrinsics: Intrinsics,
    lights: Vec<Light>,
    surfaces: Vec<SurfaceBatch>,
    casters: Casters,
    extents: Vec<Extent>,
    indirect: Option<Indirect>,
    views: UniformRow,
    light_sources: UniformRow,
    view_group: wgpu::BindGroup,
    light_group: wgpu::BindGroup,
    geometry_layout: wgpu::PipelineLayout,
    surface_pass: Surfaces,
    volume_pass: Volumes,
    composite_pass: Composite,
    composite_group: wgpu::BindGroup,
    recorded: wgpu::Texture,
    picture: wgpu::Texture,
    reaching: wgpu::TextureView,
    change: wgpu::TextureView,
    depth_stencil: wgpu::TextureView,
    picture_readback: Readback,
    clock: Option<GpuClock>,
    layer_passes: Option<LayerPasses>,
    /// The poses of the frame that was drawn last.
    camera_from_anchor: Vec<Option<DAffine3>>,
    /// What that frame showed.
    shown: Shown,
    /// What virtual things and their shadows could reach in that frame.
    touched: Option<Touched>,
}

impl Renderer {
    /// Prepares all that does not change from frame to frame.
    ///
    /// # Errors
    /// A picture larger than the adapter can hold, or a device that failed.
    pub fn new(gpu: Arc<Gpu>, scene: &Scene, intrinsics: Intrinsics) -> Result<Self, RenderError> {
        let device = &gpu.device;
        let [width, height] = intrinsics.size_px;
        let limit = device.limits().max_texture_dimension_2d;
        if width.max(height) > limit {
            return Err(RenderError::TooLarge {
                width,
                height,
                limit,
            });
        }
        let samples = scene.shadows.samples;
        let texture = |label, format, sample_count, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width,
                    height,
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let target = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let recorded = texture(
            "recorded picture",
            PICTURE_FORMAT,
            1,
            read | wgpu::TextureUsages::COPY_DST,
        );
        let picture = texture(
            "composite",
            PICTURE_FORMAT,
            1,
            target | wgpu::TextureUsages::COPY_SRC,
        );
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let reaching = view(&texture("reaching", LIGHT_FORMAT, samples, target | read));
        let change = view(&texture("change", LIGHT_FORMAT, samples, target | read));
        let depth_stencil = view(&texture(
            "depth and stencil",
            gpu.depth_format,
            samples,
            target,
        ));

        let views = UniformRow::new::<View>(device, "views", scene.anchors.len());
        let light_sources = UniformRow::new::<LightSource>(device, "lights", scene.lights.len());
        let lens = UniformRow::new::<Lens>(device, "lens", 1);
        lens.write(&gpu.queue, 0, &Lens::new(&intrinsics));

        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries,
            })
        };
        let group = |layout: &wgpu::BindGroupLayout, resources: Vec<wgpu::BindingResource<'_>>| {
            let entries: Vec<_> = resources
                .into_iter()
                .zip(0..)
                .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries,
            })
        };
        let view_layout = layout("view", &[uniform_entry(0, true)]);
        let light_layout = layout("light", &[uniform_entry(0, true)]);
        let geometry_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("geometry"),
            bind_group_layouts: &[Some(&view_layout), Some(&light_layout)],
            immediate_size: 0,
        });
        let composite_pass = Composite::new(device, samples);
        let casters = Casters::new(
            device,
            anchor_geometry::casters(device, scene),
            scene.lights.len(),
            scene.anchors.len(),
            &light_layout,
            scene.shadows.counting,
        );
        Ok(Self {
            view_group: group(&view_layout, vec![views.binding()]),
            light_group: group(&light_layout, vec![light_sources.binding()]),
            composite_group: group(
                &composite_pass.layout,
                vec![
                    lens.binding(),
                    wgpu::BindingResource::TextureView(&view(&recorded)),
                    wgpu::BindingResource::TextureView(&reaching),
                    wgpu::BindingResource::TextureView(&change),
                ],
            ),
            surface_pass: Surfaces::new(device, &geometry_layout, gpu.depth_format, samples),
            volume_pass: Volumes::new(
                device,
                &geometry_layout,
                gpu.depth_format,
                samples,
                &[LIGHT_FORMAT, LIGHT_FORMAT],
            ),
            surfaces: anchor_geometry::surface_batches(device, scene),
            extents: anchor_geometry::extents(scene),
            indirect: Indirect::new(scene),
            picture_readback: Readback::new(device, intrinsics.size_px, 4),
            clock: gpu
                .timestamp_period_ns
                .map(|period_ns| GpuClock::new(device, period_ns)),
            layer_passes: None,
            camera_from_anchor: vec![None; scene.anchors.len()],
            shown: Shown::Bare,
            touched: None,
            lights: scene.lights.clone(),
            intrinsics,
            casters,
            views,
            light_sources,
            geometry_layout,
            composite_pass,
            recorded,
            picture,
            reaching,
            change,
            depth_stencil,
            gpu,
        })
    }

    /// Takes the recorded picture to the GPU.
    ///
    /// # Errors
    /// A frame of another size than the camera's calibration.
    pub fn upload(&mut self, frame: &Frame) -> Result<(), RenderError> {
        if frame.size_px != self.intrinsics.size_px {
            return Err(RenderError::FrameSize {
                found: frame.size_px,
                expected: self.intrinsics.size_px,
            });
        }
        self.gpu.queue.write_texture(
            self.recorded.as_image_copy(),
            &frame.rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * frame.size_px[0]),
                rows_per_image: None,
            },
            self.recorded.size(),
        );
        self.gpu.check()
    }

    /// Draws the uploaded picture with what stands on the anchors, whose poses come in the scene's order. Without
    /// the world's pose nobody knows where the light comes from, and the video is shown alone.
    pub fn draw(&mut self, camera_from_anchor: &[Option<DAffine3>], shown: Shown) {
        self.place(camera_from_anchor);
        self.shown = shown;
        self.touched = match shown {
            Shown::Composite => touched_by_virtual(
                &self.extents,
                &self.lights,
                camera_from_anchor,
                &self.intrinsics,
            ),
            Shown::Bare => None,
        };

        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        if let Some(touched) = &self.touched {
            self.casters.update(
                &self.gpu,
                &self.lights,
                camera_from_anchor,
                &self.intrinsics,
                touched,
            );
            self.draw_light(&mut encoder, touched.pixels);
        }
        self.draw_picture(
            &mut encoder,
            self.touched.as_ref().map(|touched| touched.pixels),
        );
        self.picture_readback.copy_from(&mut encoder, &self.picture);
        if let Some(clock) = &mut self.clock {
            clock.resolve(&mut encoder, self.touched.is_some());
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Waits until the picture is drawn, so that drawing and reading back can be timed apart.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn wait(&self) -> Result<(), RenderError> {
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| RenderError::Failed(error.to_string()))?;
        self.gpu.check()
    }

    /// Waits for the drawn picture: sRGB-encoded RGBA, rows from the top.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn read_picture(&self) -> Result<Vec<u8>, RenderError> {
        self.picture_readback.read(&self.gpu)
    }

    /// What the last picture cost; to be asked after it was read.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn gpu_times(&self) -> Result<GpuTimes, RenderError> {
        self.clock
            .as_ref()
            .map_or(Ok(GpuTimes::default()), |clock| clock.read(&self.gpu))
    }

    /// Role, depth, shadow bits and gain of the frame that was drawn last.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn layers(&mut self) -> Result<Layers, RenderError> {
        let passes = self.layer_passes.take().unwrap_or_else(|| {
            LayerPasses::new(&self.gpu, &self.geometry_layout, self.intrinsics.size_px)
        });
        let layers = self.layers_by(&passes);
        self.layer_passes = Some(passes);
        layers
    }

    fn layers_by(&mut self, passes: &LayerPasses) -> Result<Layers, RenderError> {
        // The whole picture is asked for, not only what the virtual things touch.
        self.casters.update(
            &self.gpu,
            &self.lights,
            &self.camera_from_anchor,
            &self.intrinsics,
            &everywhere(
                &self.extents,
                &self.lights,
                &self.camera_from_anchor,
                &self.intrinsics,
            ),
        );
        let gpu = &self.gpu;
        let shown = |role: Role| role == Role::Real || self.shown == Shown::Composite;
        let (role, depth_m) = passes.role_and_depth(gpu, &|pass, role| {
            pass.set_bind_group(1, &self.light_group, &[0]);
            for batch in self.placed(role).filter(|_| shown(role)) {
                self.draw_batch(pass, batch);
            }
        })?;
        let mut shadow = Vec::new();
        for light in 0..self.lights.len() {
            let mut bits = passes.shadow(gpu, &|pass, volumes, role| {
                let groups = [&self.view_group, self.casters.light_group()];
                let counted = self.casters.counted(role, light, &self.views);
                let counted = counted.filter(|_| shown(role));
                let whole = PixelRect::whole(self.intrinsics.size_px);
                volumes.count(pass, Among::All, role, groups, whole, counted);
            })?;
            // Where nothing is modelled nothing can be shadowed.
            for (bits, &role) in bits.iter_mut().zip(&role) {
                *bits = if role == 0 { 0 } else { *bits };
            }
            shadow.push(bits);
        }
        let gain = match self.touched {
            Some(_) => self.read_gain()?,
            None => vec![[1.0; 3]; role.len()],
        };
        Ok(Layers {
            role,
            depth_m,
            shadow,
            gain,
        })
    }

    /// Writes the frame's uniforms.
    fn place(&mut self, camera_from_anchor: &[Option<DAffine3>]) {
        let queue = &self.gpu.queue;
        self.camera_from_anchor = camera_from_anchor.to_vec();
        for (anchor, pose) in camera_from_anchor.iter().enumerate() {
            if let Some(camera_from_anchor) = pose {
                let view = View::new(&self.intrinsics, camera_from_anchor);
                self.views.write(queue, anchor, &view);
            }
        }
        let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
            return;
        };
        let world_virtuals = self
            .surfaces
            .iter()
            .find(|batch| batch.role == Role::Virtual && batch.anchor == 0);
        if let (Some(indirect), Some(batch)) = (&mut self.indirect, world_virtuals) {
            indirect.update(
                queue,
                &batch.indirect,
                camera_from_anchor,
                &camera_from_world,
            );
        }
        for (index, light) in self.lights.iter().enumerate() {
            let light = LightSource::new(light, &camera_from_world);
            self.light_sources.write(queue, index, &light);
        }
    }

    /// Haller et al. 2003, section 3.2, light by light: phantoms and virtual things into depth; *real onto real* is
    /// counted, and what is lit then is lit in the video; *virtual onto real* is counted where it is lit, and what is
    /// counted has lost its light; *all onto virtual* is what both have counted there.
    fn draw_light(&self, encoder: &mut wgpu::CommandEncoder, touched: PixelRect) {
        let passes = self.lights.len().max(1);
        for light in 0..passes {
            let mut pass = self.light_pass(encoder, light, passes);
            set_scissor(&mut pass, touched);
            pass.set_stencil_reference(0);
            pass.set_bind_group(1, &self.light_group, &[self.light_sources.offset(light)]);
            if light == 0 {
                let real = match self.lights.len() {
                    0 | 1 => &self.surface_pass.depth_of_real,
                    _ => &self.surface_pass.ambient_on_real,
                };
                self.draw_surfaces(&mut pass, real, Role::Real);
                self.draw_surfaces(
                    &mut pass,
                    &self.surface_pass.ambient_on_virtual,
                    Role::Virtual,
                );
            }
            if !self.lights.is_empty() {
                self.draw_one_light(&mut pass, light, touched);
            }
        }
    }

    fn draw_one_light(&self, pass: &mut wgpu::RenderPass<'_>, light: usize, touched: PixelRect) {
        let surfaces = &self.surface_pass;
        self.count_volumes(pass, Among::All, Role::Real, light, touched);
        if self.lights.len() > 1 {
            self.draw_surfaces(pass, &surfaces.light_reaching_real, Role::Real);
        }
        if self.count_volumes(pass, Among::LitByReal, Role::Virtual, light, touched) {
            let hidden = match self.lights.len() {
                1 => &surfaces.only_light_hidden_from_real,
                _ => &surfaces.light_hidden_from_real,
            };
            self.draw_surfaces(pass, hidden, Role::Real);
        }
        self.draw_surfaces(pass, &surfaces.light_on_virtual, Role::Virtual);
        // What one volume hides, and that its own, smooth shading lights all the same: otherwise the facets would draw
        // a jagged line where the light ends.
        pass.set_stencil_reference(1);
        for terminator in self.casters.terminators(light) {
            if let Some(batch) = self
                .placed(Role::Virtual)
                .find(|batch| batch.anchor == terminator.anchor)
            {
                self.set_batch(pass, batch);
                terminator.indices.draw(pass, terminator.indices.count);
            }
        }
    }

    /// Counts a role's volumes, and leaves the stencil's reference and the light as they were. Returns whether there
    /// were any.
    fn count_volumes(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        among: Among,
        role: Role,
        light: usize,
        touched: PixelRect,
    ) -> bool {
        let groups = [&self.view_group, self.casters.light_group()];
        let counted = self.casters.counted(role, light, &self.views);
        let any = self
            .volume_pass
            .count(pass, among, role, groups, touched, counted);
        if any && role == Role::Real {
            self.volume_pass.keep(pass, role, touched);
        }
        pass.set_stencil_reference(0);
        pass.set_bind_group(1, &self.light_group, &[self.light_sources.offset(light)]);
        any
    }

    /// The pass of one of the lights; the first clears what the others add to.
    fn light_pass<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        light: usize,
        passes: usize,
    ) -> wgpu::RenderPass<'a> {
        let first = light == 0;
        let color = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: match first {
                        true => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        false => wgpu::LoadOp::Load,
                    },
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("light"),
            color_attachments: &[color(&self.reaching), color(&self.change)],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth_stencil,
                depth_ops: Some(wgpu::Operations {
                    load: match first {
                        true => wgpu::LoadOp::Clear(0.0),
                        false => wgpu::LoadOp::Load,
                    },
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0),
                    store: wgpu::StoreOp::Discard,
                }),
            }),
            timestamp_writes: self
                .clock
                .as_ref()
                .map(|clock| clock.light(first, light + 1 == passes)),
            ..Default::default()
        })
    }

    fn draw_surfaces(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipeline: &wgpu::RenderPipeline,
        role: Role,
    ) {
        pass.set_pipeline(pipeline);
        for batch in self.placed(role) {
            self.draw_batch(pass, batch);
        }
    }

    /// The batches of a role whose anchor has a pose, in a world that has one.
    fn placed(&self, role: Role) -> impl Iterator<Item = &SurfaceBatch> {
        let has_pose = |anchor: usize| self.camera_from_anchor[anchor].is_some();
        let batches = self.surfaces.iter();
        batches.filter(move |b| b.role == role && has_pose(0) && has_pose(b.anchor))
    }

    fn set_batch(&self, pass: &mut wgpu::RenderPass<'_>, batch: &SurfaceBatch) {
        pass.set_bind_group(0, &self.view_group, &[self.views.offset(batch.anchor)]);
        pass.set_vertex_buffer(0, batch.corners.slice(..));
        pass.set_vertex_buffer(1, batch.indirect.slice(..));
    }

    fn draw_batch(&self, pass: &mut wgpu::RenderPass<'_>, batch: &SurfaceBatch) {
        self.set_batch(pass, batch);
        pass.set_index_buffer(batch.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..batch.index_count, 0, 0..1);
    }

    /// The video everywhere, and over it the composite where virtual things reach.
    fn draw_picture(&self, encoder: &mut wgpu::CommandEncoder, touched: Option<PixelRect>) {
        let view = self.picture.create_view(&Default::default());
        let timestamps = self.clock.as_ref().map(GpuClock::composite);
        let mut pass = whole_pass(encoder, &view, timestamps);
        pass.set_bind_group(0, &self.composite_group, &[]);
        pass.set_pipeline(&self.composite_pass.bare);
        pass.draw(0..3, 0..1);
        if let Some(touched) = touched {
            set_scissor(&mut pass, touched);
            pass.set_pipeline(&self.composite_pass.composite);
            pass.draw(0..3, 0..1);
        }
    }

    /// The factor that the picture's own samples put on the video.
    fn read_gain(&self) -> Result<Vec<[f32; 3]>, RenderError> {
        let device = &self.gpu.device;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("gain layer"),
            size: self.picture.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: GAIN_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let readback = Readback::new(device, self.intrinsics.size_px, 16);
        let mut encoder = device.create_command_encoder(&Default::default());
        let view = texture.create_view(&Default::default());
        let mut pass = whole_pass(&mut encoder, &view, None);
        pass.set_bind_group(0, &self.composite_group, &[]);
        pass.set_pipeline(&self.composite_pass.gain);
        pass.draw(0..3, 0..1);
        drop(pass);
        readback.copy_from(&mut encoder, &texture);
        self.gpu.queue.submit([encoder.finish()]);
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&readback.read(&self.gpu)?);
        Ok(texels.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    }
}

/// A pass over a whole texture, which is cleared.
fn whole_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    target: &wgpu::TextureView,
    timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
) -> wgpu::RenderPass<'a> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("composite"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: target,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
        })],
        timestamp_writes,
        ..Default::default()
    })
}
