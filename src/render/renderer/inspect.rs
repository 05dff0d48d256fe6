//! What a frame that was drawn is made of, read back for tests, charts and views: layers, counts, gain.

use std::sync::Arc;

use super::super::accumulation::Accumulation;
use super::super::anchor_geometry::Role;
use super::super::attachments::loaded;
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
        let gain = match &self.touched {
            Some(touched) => self.read_gain(touched.pixels)?,
            None => vec![[1.0; 3]; (self.size_px[0] * self.size_px[1]) as usize],
        };
        // The other layers cover the whole picture, not only what virtual things touch.
        self.stage.cast_everywhere(&self.gpu);
        let (gpu, stage, size_px) = (&self.gpu, &self.stage, self.size_px);
        let passes = self
            .layer_passes
            .get_or_insert_with(|| LayerPasses::new(gpu, &self.geometry_layout, self.size_px));
        let shown = |role: Role| role == Role::Real || self.shown == Shown::Composite;
        let (role, depth_m) = passes.role_and_depth(gpu, &|pass, pipeline, role| {
            if shown(role) {
                stage.draw_surfaces(pass, pipeline, role, 0, PixelRect::whole(size_px));
            }
        })?;
        let mut shadow = Vec::new();
        for light in 0..stage.light_count() {
            let mut bits = passes.shadow(gpu, &|pass, volumes, role| {
                if shown(role) {
                    let whole = PixelRect::whole(size_px);
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
        self.stage.cast_everywhere(&self.gpu);
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

    /// The factor that the picture's own samples put on the video.
    fn read_gain(&mut self, touched: PixelRect) -> Result<Vec<[f32; 3]>, RenderError> {
        let gpu = Arc::clone(&self.gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        if self.shafts.is_none() && self.accumulation.is_none() {
            self.accumulation = Some(Accumulation::new(
                &gpu,
                &self.geometry_layout,
                &self.background,
                self.samples,
                self.glossy,
            ));
        }
        // Shafts leave the targets as they were drawn; the direct pass has none.
        let targets = match (&self.shafts, &self.accumulation) {
            (Some((_, targets)), _) => targets,
            (None, Some(accumulation)) => {
                if self.direct.is_some() {
                    self.accumulate(&mut encoder, accumulation, touched);
                }
                &accumulation.targets
            }
            (None, None) => {
                return Ok(vec![[1.0; 3]; (self.size_px[0] * self.size_px[1]) as usize]);
            }
        };
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
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("gain"),
            color_attachments: &[Some(loaded(&view, wgpu::LoadOp::Clear(wgpu::Color::WHITE)))],
            ..Default::default()
        });
        set_scissor(&mut pass, touched);
        pass.set_pipeline(&targets.composite.gain);
        pass.set_bind_group(0, &targets.composite.group, &[]);
        pass.set_bind_group(2, &self.background.group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        let readback = Readback::new(&gpu.device, self.size_px, 16);
        readback.copy_from(&mut encoder, &texture);
        gpu.queue.submit([encoder.finish()]);
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&readback.read(&gpu)?);
        Ok(texels.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    }
}
