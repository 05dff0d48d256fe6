//! What a frame that was drawn is made of, read back for tests, charts and views: layers, counts, gain. The gain is the
//! picture's own; the rest comes from the same surfaces and shadow volumes, as far as they reach in the picture, asked once
//! more at the pixels' centres.

use std::sync::Arc;

use super::super::anchor_geometry::Role;
use super::super::attachments::{kept, loaded};
use super::super::composite::GAIN_FORMAT;
use super::super::gpu::RenderError;
use super::super::layers::{LayerPasses, Layers};
use super::super::readback::Readback;
use super::super::volumes::{Among, set_scissor};
use super::Renderer;
use super::Shown;
use crate::geometry::reach::PixelRect;

impl Renderer {
    /// Role, depth, shadow bits and gain of the frame that was drawn last.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn layers(&mut self) -> Result<Layers, RenderError> {
        let gain = self.read_gain()?;
        self.cast_on_all_pixels();
        let (gpu, stage, size_px) = (&self.gpu, &self.stage, self.size_px);
        let passes = self
            .layer_passes
            .get_or_insert_with(|| LayerPasses::new(gpu, &self.geometry_layout, size_px));
        let whole = PixelRect::whole(size_px);
        let shown = |role: Role| role == Role::Real || self.shown == Shown::Composite;
        let (role, depth_m) = passes.role_and_depth(gpu, &|pass, pipeline, role| {
            if shown(role) {
                stage.draw_surfaces(pass, pipeline, role, 0, whole);
            }
        })?;
        let mut shadow = Vec::new();
        for light in 0..stage.light_count() {
            let mut bits = passes.shadow(gpu, &|pass, volumes, role| {
                if shown(role) {
                    stage.count_volumes(pass, volumes, Among::All, role, light, whole);
                }
            })?;
            // Where nothing is modelled nothing can be shadowed.
            for (bits, &role) in bits.iter_mut().zip(&role) {
                *bits = if role == 0 { 0 } else { *bits };
            }
            shadow.push(bits);
        }
        Ok(Layers {
            role,
            depth_m,
            shadow,
            gain,
        })
    }

    /// How many shadow volumes, of all lights together, the surface at each pixel's centre lies in, in the frame that was
    /// drawn last. Volumes that are counted apart from the rest are one.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn stencil_counts(&mut self) -> Result<Vec<u8>, RenderError> {
        self.cast_on_all_pixels();
        let (gpu, stage, size_px) = (&self.gpu, &self.stage, self.size_px);
        let passes = self
            .layer_passes
            .get_or_insert_with(|| LayerPasses::new(gpu, &self.geometry_layout, size_px));
        let whole = PixelRect::whole(size_px);
        let (roles, _) = passes.role_and_depth(gpu, &|pass, pipeline, role| {
            stage.draw_surfaces(pass, pipeline, role, 0, whole);
        })?;
        let mut sums = vec![0_u8; roles.len()];
        for light in 0..stage.light_count() {
            let counts = passes.counts(gpu, &|pass, volumes, role| {
                stage.count_volumes(pass, volumes, Among::All, role, light, whole);
            })?;
            // Where nothing is modelled nothing lies in a shadow.
            for ((sum, count), &role) in sums.iter_mut().zip(counts).zip(&roles) {
                *sum = sum.saturating_add(if role == 0 { 0 } else { count });
            }
        }
        Ok(sums)
    }

    /// The picture needs real shadows only where virtual things touch it; the layers tell of all.
    fn cast_on_all_pixels(&mut self) {
        if let (Some(touched), None) = (&self.touched, &self.shafts) {
            let whole = PixelRect::whole(self.size_px);
            self.stage.cast(&self.gpu, touched, whole);
        }
    }

    /// The factor that the picture's own samples put on the video.
    fn read_gain(&self) -> Result<Vec<[f32; 3]>, RenderError> {
        let nothing = || vec![[1.0; 3]; (self.size_px[0] * self.size_px[1]) as usize];
        let within = match (&self.touched, self.shown) {
            (Some(touched), Shown::Composite) if !touched.pixels.is_empty() => touched.pixels,
            _ => return Ok(nothing()),
        };
        let gpu = Arc::clone(&self.gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("gain layer"),
            size: self.picture.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: GAIN_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        // What the picture was made of lies where it was drawn: sums in the targets, or the stencil.
        let targets = match (&self.shafts, &self.accumulation) {
            (Some((_, targets)), _) => Some(targets),
            (None, Some(accumulation)) => Some(&accumulation.targets),
            (None, None) => None,
        };
        let stencil = targets.is_none().then_some(self.direct.as_ref()).flatten();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("gain"),
            color_attachments: &[Some(loaded(&view, wgpu::LoadOp::Clear(wgpu::Color::WHITE)))],
            depth_stencil_attachment: stencil.map(|direct| kept(&direct.depth_stencil)),
            ..Default::default()
        });
        set_scissor(&mut pass, within);
        pass.set_bind_group(2, &self.background.group, &[]);
        if let Some(targets) = targets {
            pass.set_pipeline(&targets.composite.gain);
            pass.set_bind_group(0, &targets.composite.group, &[]);
            pass.draw(0..3, 0..1);
        } else if let Some(direct) = stencil {
            let stage = &self.stage;
            stage.draw_surfaces(&mut pass, &direct.gain_on_real, Role::Real, 0, within);
        }
        drop(pass);
        let readback = Readback::new(&gpu.device, self.size_px, 16);
        readback.copy_from(&mut encoder, &texture);
        gpu.queue.submit([encoder.finish()]);
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&readback.read(&gpu)?);
        Ok(texels.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    }
}
