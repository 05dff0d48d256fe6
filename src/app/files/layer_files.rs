//! Layers as files beside the pictures, named as DESIGN's contract says.

use std::collections::BTreeSet;

use crate::render::Layers;

use super::frame_folder::FrameFolder;
use super::output_error::OutputError;
use super::picture_files::{float_exr, grey_png, rgb16_png};

/// A layer that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Layer {
    /// 0 none, 100 real, 200 virtual.
    Role,
    /// For each light: bit 0 in a real thing's shadow, bit 1 in a virtual thing's.
    Shadow,
    /// Factor on the video in linear light: 16-bit RGB, 32768 = 1.
    Gain,
    /// Metres along the camera's axis, as EXR.
    Depth,
}

/// Writes the wanted layers of a frame into `folder`.
///
/// # Errors
/// What keeps a file from being written.
pub fn write_layers(
    folder: &mut FrameFolder,
    index: u32,
    size_px: [u32; 2],
    layers: &Layers,
    wanted: &BTreeSet<Layer>,
) -> Result<(), OutputError> {
    let name = |suffix: &str| format!("{index:06}_{suffix}");
    for layer in wanted {
        match layer {
            Layer::Role => folder.put(&name("role.png"), |path| {
                grey_png(path, size_px, &layers.role)
            })?,
            Layer::Shadow => {
                for (light, bits) in layers.shadow.iter().enumerate() {
                    let name = name(&format!("shadow_{light}.png"));
                    folder.put(&name, |path| grey_png(path, size_px, bits))?;
                }
            }
            Layer::Gain => {
                let fixed_point = |gain: &f32| (gain * 32768.0).round().clamp(0.0, 65535.0) as u16;
                let gain: Vec<u16> = layers.gain.iter().flatten().map(fixed_point).collect();
                folder.put(&name("gain.png"), |path| rgb16_png(path, size_px, &gain))?;
            }
            Layer::Depth => folder.put(&name("depth.exr"), |path| {
                float_exr(path, size_px, &layers.depth_m)
            })?,
        }
    }
    Ok(())
}
