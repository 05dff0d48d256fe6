//! What a frame that was drawn is made of, read back for tests, charts and views: layers, counts, gain. The gain is the
//! picture's own; the rest comes from the same surfaces and shadow volumes, as far as they reach in the picture, asked once
//! more at the pixels' centres.

use super::super::anchor_geometry::Role;
use super::super::attachments::{loaded, texture};
use super::super::error::RenderError;
use super::super::gpu_scene::DrawnLight;
use super::super::layers::{LayerPasses, Layers};
use super::super::light_sums::GAIN_FORMAT;
use super::super::passes::Passes;
use super::super::readback::Readback;
use super::super::shown::Shown;
use super::super::technique::FrameContext;
use super::super::volumes::Among;
use super::Renderer;
use crate::geometry::reach::PixelRect;

impl Renderer {
    /// Role, depth, shadow bits and gain of the frame that was drawn last.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn layers(&mut self) -> Result<Layers, RenderError> {
        self.redraw_opaque();
        let gain = self.read_gain()?;
        self.cast_on_all_pixels();
        let (gpu, gpu_scene, size_px) = (&self.gpu, &self.gpu_scene, self.size_px);
        let passes = self
            .layer_passes
            .get_or_insert_with(|| LayerPasses::new(gpu, size_px));
        let whole = PixelRect::whole(size_px);
        let shown = |role: Role| role == Role::Real || self.shown == Shown::Composite;
        let (role, depth_m) = passes.role_and_depth(gpu, &|pass, pipeline, role| {
            if shown(role) {
                gpu_scene.draw_surfaces(pass, pipeline, role, DrawnLight::Whole(0), whole);
            }
        })?;
        let mut shadow = Vec::new();
        for light in 0..gpu_scene.light_count() {
            let mut bits = vec![0; role.len()];
            for piece in gpu_scene.pieces_of(light) {
                let of_piece = passes.shadow(gpu, &|pass, volumes, role| {
                    if shown(role) {
                        gpu_scene.count_volumes(pass, volumes, Among::All, role, piece, whole);
                    }
                })?;
                for (bits, of_piece) in bits.iter_mut().zip(of_piece) {
                    *bits |= of_piece;
                }
            }
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
        self.redraw_opaque();
        self.cast_on_all_pixels();
        let (gpu, gpu_scene, size_px) = (&self.gpu, &self.gpu_scene, self.size_px);
        let passes = self
            .layer_passes
            .get_or_insert_with(|| LayerPasses::new(gpu, size_px));
        let whole = PixelRect::whole(size_px);
        let (roles, _) = passes.role_and_depth(gpu, &|pass, pipeline, role| {
            gpu_scene.draw_surfaces(pass, pipeline, role, DrawnLight::Whole(0), whole);
        })?;
        let mut sums = vec![0_u8; roles.len()];
        let lights = 0..gpu_scene.light_count();
        for piece in lights.flat_map(|light| gpu_scene.pieces_of(light)) {
            let counts = passes.counts(gpu, &|pass, volumes, role| {
                gpu_scene.count_volumes(pass, volumes, Among::All, role, piece, whole);
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
        if let Some(bounds) = &self.bounds {
            let whole = PixelRect::whole(self.size_px);
            self.gpu_scene.cast(&self.gpu, bounds, whole);
        }
    }

    /// The factor that the picture's own samples put on the video: what the picture was made of lies where it was drawn.
    fn read_gain(&mut self) -> Result<Vec<[f32; 3]>, RenderError> {
        let bounds = self
            .bounds
            .as_ref()
            .filter(|_| self.shown == Shown::Composite);
        let Some(bounds) = bounds.filter(|bounds| !bounds.pixels.is_empty()) else {
            return Ok(vec![[1.0; 3]; (self.size_px[0] * self.size_px[1]) as usize]);
        };
        let gpu = &self.gpu;
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        let texture = texture(
            &gpu.device,
            "gain layer",
            self.size_px,
            GAIN_FORMAT,
            1,
            usage,
        );
        let gain = texture.create_view(&Default::default());
        let picture = self.picture.create_view(&Default::default());
        let frame = FrameContext {
            gpu,
            gpu_scene: &self.gpu_scene,
            background: &self.background,
            picture: &picture,
            bounds,
        };
        let mut passes = Passes::new(gpu, None);
        if self.reflections.is_some() {
            // What was drawn last is what mirrors, alone.
            self.technique.passes_mut().draw(&mut passes, &frame);
        }
        let gain = loaded(&gain, wgpu::LoadOp::Clear(wgpu::Color::WHITE));
        self.technique.passes().draw_gain(&mut passes, &frame, gain);
        let readback = Readback::new(&gpu.device, self.size_px, 16);
        readback.copy_from(&mut passes.encoder, &texture);
        gpu.queue.submit([passes.encoder.finish()]);
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&readback.read(gpu)?);
        Ok(texels.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    }
}
