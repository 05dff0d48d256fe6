//! The renderer's picture in the window, on the same device: nothing is read back on the way.

use anyhow::{Context as _, Result};
use eframe::CreationContext;
use eframe::egui::TextureId;
use eframe::egui_wgpu::{
    RenderState, SurfaceConfig, WgpuConfiguration, WgpuSetup, WgpuSetupExisting,
};

use crate::render::{Gpu, Renderer, SharedDevice};

/// How the window draws on the device that the pictures are drawn on.
pub fn on_device(gpu: &Gpu) -> WgpuConfiguration {
    let SharedDevice {
        instance,
        adapter,
        device,
        queue,
    } = gpu.shared();
    WgpuConfiguration {
        // A frame that waits for the one after the next is old when it is seen.
        surface: SurfaceConfig::LOW_LATENCY,
        wgpu_setup: WgpuSetup::Existing(WgpuSetupExisting {
            instance,
            adapter,
            device,
            queue,
        }),
        ..WgpuConfiguration::default()
    }
}

/// The picture as the window's texture.
pub struct Screen {
    state: RenderState,
    shown: Option<(TextureId, u64)>,
}

impl Screen {
    /// In a window that draws on the device of the pictures.
    ///
    /// # Errors
    /// It draws with something else.
    pub fn new(creation: &CreationContext<'_>) -> Result<Self> {
        let state = creation.wgpu_render_state.clone();
        Ok(Self {
            state: state.context("the window does not draw with wgpu")?,
            shown: None,
        })
    }

    /// The texture of a renderer's picture; `number` changes with the renderer.
    pub fn texture(&mut self, renderer: &Renderer, number: u64) -> TextureId {
        if let Some((texture, shown)) = self.shown
            && shown == number
        {
            return texture;
        }
        let view = renderer.picture().create_view(&Default::default());
        let filter = wgpu::FilterMode::Linear;
        let device = &self.state.device;
        let mut egui_renderer = self.state.renderer.write();
        let texture = match self.shown {
            Some((texture, _)) => {
                egui_renderer.update_egui_texture_from_wgpu_texture(device, &view, filter, texture);
                texture
            }
            None => egui_renderer.register_native_texture(device, &view, filter),
        };
        self.shown = Some((texture, number));
        texture
    }
}
