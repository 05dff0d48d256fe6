//! Layers as files beside the pictures, named as DESIGN's contract says.

use std::collections::BTreeSet;
use std::path::Path;

use crate::render::Layers;

use super::output::OutputError;
use super::picture_files::{write_float_exr, write_grey_png, write_rgb16_png};

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
    folder: &Path,
    index: u32,
    size_px: [u32; 2],
    layers: &Layers,
    wanted: &BTreeSet<Layer>,
) -> Result<(), OutputError> {
    let file = |suffix: &str| folder.join(format!("{index:06}_{suffix}"));
    for layer in wanted {
        match layer {
            Layer::Role => write_grey_png(&file("role.png"), size_px, &layers.role)?,
            Layer::Shadow => {
                for (light, bits) in layers.shadow.iter().enumerate() {
                    write_grey_png(&file(&format!("shadow_{light}.png")), size_px, bits)?;
                }
            }
            Layer::Gain => {
                let fixed_point = |gain: &f32| (gain * 32768.0).round().clamp(0.0, 65535.0) as u16;
                let gain: Vec<u16> = layers.gain.iter().flatten().map(fixed_point).collect();
                write_rgb16_png(&file("gain.png"), size_px, &gain)?;
            }
            Layer::Depth => write_float_exr(&file("depth.exr"), size_px, &layers.depth_m)?,
        }
    }
    Ok(())
}
