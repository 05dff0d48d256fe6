//! Reads the picture of a light probe.

use std::path::Path;

use glam::Vec3;

use crate::light::probe::Probe;

/// How a probe's picture holds directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProbeKind {
    /// Columns are longitudes, rows latitudes.
    LatitudeLongitude,
    /// Debevec's angular map.
    Angular,
    /// A mirror ball from afar.
    Ball,
}

/// Reads a probe.
pub fn read(path: &Path, _kind: ProbeKind) -> Result<Probe, String> {
    let picture = image::open(path).map_err(|e| e.to_string())?.into_rgb32f();
    let size = [picture.width() as usize, picture.height() as usize];
    let pixels = picture.pixels().map(|p| Vec3::from_array(p.0)).collect();
    Probe::new(size, pixels).ok_or_else(|| "no pixels".into())
}
