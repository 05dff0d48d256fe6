//! A probe's light carried outward on to what it came from (Gibson et al. 2003, section 3), so that none is lost and none is
//! made: each pixel's radiance times its solid angle goes to the patches that its rays meet.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::ray_caster::RayCaster;
use crate::light::probe::Probe;

use super::luminance;
use super::patches::RoomPatches;
use super::placed_probe::PlacedProbe;

/// Side of what one ray stands for at most, radians.
const LARGEST_RAY: f64 = 0.006;
/// Part of all power that one ray carries at most, ...
const MOST_CARRIED: f64 = 1e-5;
/// ... unless a pixel would be cut finer than this along each side.
const FINEST: usize = 32;

/// The light that came to the probe from a patch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Carried {
    /// Radiance times solid angle, summed over its rays.
    pub radiance_solid_angle: DVec3,
    /// Solid angle of its rays, steradians.
    pub solid_angle_sr: f64,
    /// Number of its rays.
    pub rays: u32,
}

/// A ray and what it carries.
#[derive(Clone, Copy)]
struct Parcel {
    /// Of the probe, the block's first one where it is for several.
    pixel: usize,
    direction: Vec3,
    radiance_solid_angle: DVec3,
    solid_angle_sr: f64,
}

/// What comes from each patch; `caster` holds the patches' triangles in their order. Light from the back of a patch, or from
/// where there is none, is nobody's.
pub fn carried_light(
    patches: &RoomPatches,
    caster: &RayCaster,
    placed: &PlacedProbe<'_>,
) -> Vec<Carried> {
    let probe = placed.probe.as_ref();
    let [_, height] = probe.size_px();
    let most = MOST_CARRIED * whole_power(probe);
    let block = block_px(probe);
    let met = |parcel: Parcel| {
        let start = placed.start(parcel.direction);
        let hit = caster.first_hit(start, parcel.direction, f32::INFINITY)?;
        let patch = &patches.patches[hit.triangle];
        (patches.normal(patch).dot(parcel.direction) < 0.0).then_some((hit.triangle, parcel))
    };
    // Row by row, and then in their order: sums of floating-point numbers depend on it.
    let rows: Vec<usize> = (0..height).step_by(block).collect();
    let hits: Vec<Vec<(usize, Parcel)>> = rows
        .into_par_iter()
        .map(|row| {
            let parcels = row_of_parcels(probe, row, block, most);
            parcels.into_iter().filter_map(met).collect()
        })
        .collect();
    let pixels: Vec<&[(usize, Parcel)]> = hits
        .iter()
        .flat_map(|row| row.chunk_by(|(_, one), (_, next)| one.pixel == next.pixel))
        .collect();
    let unmixed = unmixed(&pixels, patches);
    let mut carried = vec![Carried::default(); patches.patches.len()];
    for (&(patch, parcel), part) in pixels.into_iter().flatten().zip(unmixed) {
        let light = parcel.radiance_solid_angle * part * f64::from(placed.exposure);
        carried[patch].add(light, parcel.solid_angle_sr);
    }
    carried
}

/// For each ray how much of what its pixel gives to each of its rays is its own, 1 on the average of a pixel's. A pixel on the
/// edge of a lamp is a mean of lamp and wall: it is parted as the pixels beside it, which show only the one or the other, say.
/// (Else the lamp was dimmer than it is, and the wall around it shone.)
fn unmixed(pixels: &[&[(usize, Parcel)]], patches: &RoomPatches) -> Vec<f64> {
    let piece = |patch: usize| patches.patches[patch].piece as usize;
    let shows_one = |rays: &[(usize, Parcel)]| {
        let first = piece(rays[0].0);
        rays.iter().all(|&(patch, _)| piece(patch) == first)
    };
    let piece_count = patches.patches.iter().map(|patch| patch.piece as usize + 1);
    let mut of_pieces = vec![Carried::default(); piece_count.max().unwrap_or(0)];
    let mut of_patches = vec![Carried::default(); patches.patches.len()];
    for &(patch, parcel) in pixels
        .iter()
        .filter(|rays| shows_one(rays))
        .copied()
        .flatten()
    {
        for of in [&mut of_pieces[piece(patch)], &mut of_patches[patch]] {
            of.add(parcel.radiance_solid_angle, parcel.solid_angle_sr);
        }
    }
    // Nothing is known of what no pixel shows alone.
    let radiance = |patch: usize| {
        let known = [&of_patches[patch], &of_pieces[piece(patch)]];
        let of = known.into_iter().find(|of| of.rays > 0)?;
        Some(f64::from(luminance(of.radiance_solid_angle.as_vec3())) / of.solid_angle_sr)
    };
    let parts = |rays: &&[(usize, Parcel)]| -> Vec<f64> {
        let expected = rays.iter().map(|&(patch, _)| radiance(patch));
        let expected: Option<Vec<f64>> = expected.collect();
        match expected.filter(|_| !shows_one(rays)) {
            Some(expected) if expected.iter().sum::<f64>() > 0.0 => {
                let mean = expected.iter().sum::<f64>() / rays.len() as f64;
                expected.into_iter().map(|of| of / mean).collect()
            }
            _ => vec![1.0; rays.len()],
        }
    };
    pixels.iter().flat_map(parts).collect()
}

impl Carried {
    fn add(&mut self, radiance_solid_angle: DVec3, solid_angle_sr: f64) {
        self.radiance_solid_angle += radiance_solid_angle;
        self.solid_angle_sr += solid_angle_sr;
        self.rays += 1;
    }
}

fn whole_power(probe: &Probe) -> f64 {
    let [width, _] = probe.size_px();
    let pixels = probe.pixels().iter().enumerate();
    let power =
        |(index, &pixel)| f64::from(luminance(pixel)) * probe.pixel_solid_angle(index / width);
    pixels.map(power).sum()
}

/// Pixels along a side of the blocks that one ray may stand for.
fn block_px(probe: &Probe) -> usize {
    let [width, height] = probe.size_px();
    let pixel = TAU / width.max(2 * height) as f64;
    ((LARGEST_RAY / pixel) as usize).max(1)
}

/// The rays of a row of blocks.
fn row_of_parcels(probe: &Probe, row: usize, block: usize, most: f64) -> Vec<Parcel> {
    let [width, height] = probe.size_px();
    let rows = row..(row + block).min(height);
    let mut parcels = Vec::new();
    for column in (0..width).step_by(block) {
        let columns = column..(column + block).min(width);
        let pixels = || {
            let columns = columns.clone();
            rows.clone()
                .flat_map(move |row| columns.clone().map(move |column| [column, row]))
        };
        let (mut radiance_solid_angle, mut solid_angle_sr) = (DVec3::ZERO, 0.0);
        for [column, row] in pixels() {
            let solid_angle = probe.pixel_solid_angle(row);
            radiance_solid_angle += probe.pixels()[row * width + column].as_dvec3() * solid_angle;
            solid_angle_sr += solid_angle;
        }
        // (A coarse probe's pixels are cut as well.)
        let side = PI / height as f64 * rows.len() as f64;
        if luminance(radiance_solid_angle.as_vec3()) <= most as f32 && side <= 2.0 * LARGEST_RAY {
            let middle = [
                (columns.start + columns.end) as f64 / 2.0,
                (rows.start + rows.end) as f64 / 2.0,
            ];
            parcels.push(Parcel {
                pixel: rows.start * width + columns.start,
                direction: probe.direction(middle[0], middle[1]).as_vec3(),
                radiance_solid_angle,
                solid_angle_sr,
            });
            continue;
        }
        for pixel in pixels() {
            cut_pixel(probe, pixel, most, &mut parcels);
        }
    }
    parcels
}

/// The rays of one pixel: as many as its power and its size call for.
fn cut_pixel(probe: &Probe, [column, row]: [usize; 2], most: f64, parcels: &mut Vec<Parcel>) {
    let [width, height] = probe.size_px();
    let radiance = probe.pixels()[row * width + column].as_dvec3();
    let power = f64::from(luminance(radiance.as_vec3())) * probe.pixel_solid_angle(row);
    let by_power = (power / most.max(1e-300)).sqrt().ceil();
    let by_size = (PI / height as f64 / LARGEST_RAY).round();
    let count = (by_power.max(by_size) as usize).clamp(1, FINEST);
    let cosine = |part: f64| (part / height as f64 * PI).cos();
    for down in 0..count {
        let place = |part: f64| row as f64 + (down as f64 + part) / count as f64;
        let height_of_band = cosine(place(0.0)) - cosine(place(1.0));
        let solid_angle_sr = TAU / width as f64 / count as f64 * height_of_band;
        for across in 0..count {
            let pixel_column = column;
            let column = column as f64 + (across as f64 + 0.5) / count as f64;
            parcels.push(Parcel {
                pixel: row * width + pixel_column,
                direction: probe.direction(column, place(0.5)).as_vec3(),
                radiance_solid_angle: radiance * solid_angle_sr,
                solid_angle_sr,
            });
        }
    }
}
