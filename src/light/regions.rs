//! A probe's light cut into regions, each as one light from afar (Kollig & Keller 2003): as many as are asked for, smaller
//! where more light comes from.

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::REC_709;
use super::probe::Probe;

/// Steps by which regions are evened out (Lloyd 1982) each time that some were cut, and at the end.
const STEPS_BETWEEN: usize = 3;
const STEPS_AT_LAST: usize = 24;

/// Middles are found among so many columns and rows of pixels at most, each the mean of what lies in it; what regions have is
/// summed up over all pixels then.
pub const FINEST_PX: [usize; 2] = [1024, 512];

/// A part of all directions, as one light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Unit direction towards it: of its irradiance vector.
    pub toward: DVec3,
    /// Irradiance on a plane across the direction that sees all of it, linear RGB in the probe's unit: the length of its
    /// irradiance vector, so that every plane above which it lies gets from it what its pixels give.
    pub irradiance: DVec3,
    /// Steradians.
    pub solid_angle_sr: f64,
    /// Standard deviation of its light along either axis across the direction, as a length a metre off.
    pub spread: f64,
}

impl Region {
    /// Side of the square of its solid angle, a metre off (Tamura et al. 2005, equations 5 and 6).
    pub fn width(&self) -> f64 {
        self.solid_angle_sr.sqrt()
    }
}

/// A pixel of the probe.
struct Pixel {
    direction: DVec3,
    solid_angle: f64,
    power: f64,
    radiance: DVec3,
}

/// Cuts a probe into `count` regions of pixels, fewer where fewer pixels have light; each pixel is in exactly one.
///
/// A region is all that is nearer to its middle than to any other. The one is cut next whose light lies farthest around its
/// middle, along the line on which it lies widest, and all middles move to where their light comes from, so that the same light
/// is cut alike however the probe is turned.
pub fn regions(probe: &Probe, count: usize) -> Vec<Region> {
    let coarse = probe.at_most(FINEST_PX);
    let pixels = pixels(coarse.rays());
    let whole: DVec3 = pixels.iter().map(|it| it.direction * it.power).sum();
    let mut middles = vec![whole.try_normalize().unwrap_or(DVec3::Z)];
    loop {
        let steps = match middles.len() < count {
            true => STEPS_BETWEEN,
            false => STEPS_AT_LAST,
        };
        for _ in 0..steps {
            let sums = sums(&pixels, &middles);
            for (middle, sum) in middles.iter_mut().zip(&sums) {
                *middle = sum.toward.try_normalize().unwrap_or(*middle);
            }
        }
        if middles.len() >= count {
            break;
        }
        let added = cut(&pixels, &mut middles, count);
        if added == 0 {
            break;
        }
    }
    let sums = match coarse {
        Cow::Owned(_) => sums_of_rows(probe, &middles),
        Cow::Borrowed(_) => sums(&pixels, &middles),
    };
    sums.iter().filter_map(Sum::region).collect()
}

fn pixels(rays: impl Iterator<Item = (DVec3, Vec3, f64)>) -> Vec<Pixel> {
    let pixel = |(direction, radiance, solid_angle): (DVec3, Vec3, f64)| {
        let radiance = radiance.as_dvec3();
        Pixel {
            direction,
            solid_angle,
            power: radiance.dot(REC_709) * solid_angle,
            radiance,
        }
    };
    rays.map(pixel).collect()
}

/// Sums the pixels of a fine probe up that are nearest to each middle, a row at a time: all of them at once take gigabytes.
fn sums_of_rows(probe: &Probe, middles: &[DVec3]) -> Vec<Sum> {
    let rows = 0..probe.size_px()[1];
    let of_row = |row: usize| sums(&pixels(probe.rays_of_row(row)), middles);
    let rows: Vec<Vec<Sum>> = rows.into_par_iter().map(of_row).collect();
    added_up(rows.iter(), middles.len())
}

/// Adds up what is known of each region.
fn added_up<'a>(parts: impl Iterator<Item = &'a Vec<Sum>>, count: usize) -> Vec<Sum> {
    let mut all = vec![Sum::NONE; count];
    for part in parts {
        for (sum, part) in all.iter_mut().zip(part) {
            *sum = sum.and(part);
        }
    }
    all
}

/// What is known of all pixels of a region.
#[derive(Clone, Copy)]
struct Sum {
    /// Of directions by power.
    toward: DVec3,
    power: f64,
    solid_angle: f64,
    /// Of each channel the irradiance vector.
    vectors: DMat3,
    /// Of the pixels' ways from the middle, by power.
    spread: DMat3,
    /// Of their directions, by power.
    squares: DMat3,
}

impl Sum {
    const NONE: Self = Self {
        toward: DVec3::ZERO,
        power: 0.0,
        solid_angle: 0.0,
        vectors: DMat3::ZERO,
        spread: DMat3::ZERO,
        squares: DMat3::ZERO,
    };

    fn add(&mut self, pixel: &Pixel, middle: DVec3) {
        self.toward += pixel.direction * pixel.power;
        self.power += pixel.power;
        self.solid_angle += pixel.solid_angle;
        let light = pixel.radiance * pixel.solid_angle;
        self.vectors += outer(pixel.direction, light);
        let way = pixel.direction - middle;
        self.spread += outer(way, way * pixel.power);
        self.squares += outer(pixel.direction, pixel.direction * pixel.power);
    }

    fn and(mut self, other: &Self) -> Self {
        self.toward += other.toward;
        self.power += other.power;
        self.solid_angle += other.solid_angle;
        self.vectors += other.vectors;
        self.spread += other.spread;
        self.squares += other.squares;
        self
    }

    /// Around a unit direction: of the directions' variance across it the mean of both axes.
    fn spread(&self, toward: DVec3) -> f64 {
        let along = toward.dot(self.squares * toward);
        let trace = self.squares.x_axis.x + self.squares.y_axis.y + self.squares.z_axis.z;
        ((trace - along) / (2.0 * along.max(f64::MIN_POSITIVE)))
            .max(0.0)
            .sqrt()
    }

    fn region(&self) -> Option<Region> {
        let toward = (self.vectors * REC_709).try_normalize()?;
        Some(Region {
            toward,
            irradiance: (self.vectors.transpose() * toward).max(DVec3::ZERO),
            solid_angle_sr: self.solid_angle,
            spread: self.spread(toward),
        })
    }
}

/// Columns are `one` times each part of `other`.
fn outer(one: DVec3, other: DVec3) -> DMat3 {
    DMat3::from_cols(one * other.x, one * other.y, one * other.z)
}

/// Sums the pixels up that are nearest to each middle.
fn sums(pixels: &[Pixel], middles: &[DVec3]) -> Vec<Sum> {
    /// Pixels that are looked at in one go. (Fixed, so that sums do not depend on the number of cores.)
    const CHUNK: usize = 4096;
    /// Of those, pixels beside each other, which have few middles near them.
    const BESIDE: usize = 16;
    let of_chunk = |pixels: &[Pixel]| {
        let mut sums = vec![Sum::NONE; middles.len()];
        for beside in pixels.chunks(BESIDE) {
            let near = near(middles, beside);
            for pixel in beside {
                let nearest = nearest(&near, pixel.direction);
                sums[nearest].add(pixel, middles[nearest]);
            }
        }
        sums
    };
    let chunks: Vec<Vec<Sum>> = pixels.par_chunks(CHUNK).map(of_chunk).collect();
    added_up(chunks.iter(), middles.len())
}

/// The middles, with their numbers, one of which is the nearest to any of the pixels: what is nearest to a pixel is no farther
/// from the pixels' own middle than what is nearest to that, and twice as far as the pixel lies off it.
fn near(middles: &[DVec3], pixels: &[Pixel]) -> Vec<(usize, DVec3)> {
    /// Past the rounding of angles, radians.
    const ROUNDING_RAD: f64 = 1e-6;
    let sum: DVec3 = pixels.iter().map(|pixel| pixel.direction).sum();
    let numbered = middles.iter().copied().enumerate();
    let Some(middle) = sum.try_normalize() else {
        return numbered.collect();
    };
    let angle = |cosine: f64| cosine.clamp(-1.0, 1.0).acos();
    let cosines = pixels.iter().map(|pixel| pixel.direction.dot(middle));
    let radius = angle(cosines.fold(1.0, f64::min));
    let cosines: Vec<f64> = middles.iter().map(|it| it.dot(middle)).collect();
    let nearest = angle(cosines.iter().copied().fold(-1.0, f64::max));
    let reach = (nearest + 2.0 * radius + ROUNDING_RAD).min(PI).cos();
    numbered
        .zip(&cosines)
        .filter(|(_, cosine)| **cosine >= reach)
        .map(|(numbered, _)| numbered)
        .collect()
}

/// Number of the middle that is nearest to a direction, of those with the same distance the first.
fn nearest(middles: &[(usize, DVec3)], direction: DVec3) -> usize {
    let mut best = (f64::MIN, 0);
    for &(number, middle) in middles {
        let cosine = middle.dot(direction);
        if cosine > best.0 {
            best = (cosine, number);
        }
    }
    best.1
}

/// Cuts those regions in two whose light lies farthest around their middles, up to half of them. Returns how many.
fn cut(pixels: &[Pixel], middles: &mut Vec<DVec3>, count: usize) -> usize {
    let sums = sums(pixels, middles);
    let trace = |sum: &Sum| sum.spread.x_axis.x + sum.spread.y_axis.y + sum.spread.z_axis.z;
    let mut order: Vec<usize> = (0..middles.len()).collect();
    order.sort_by(|&one, &other| trace(&sums[other]).total_cmp(&trace(&sums[one])));
    let wanted = (count - middles.len()).min(middles.len().div_ceil(2));
    let mut added = 0;
    for &index in &order[..wanted] {
        let sum = &sums[index];
        let along = widest(&sum.spread);
        let half = (along.dot(sum.spread * along) / sum.power.max(f64::MIN_POSITIVE)).sqrt();
        if half <= 0.0 || sum.power <= 0.0 {
            continue;
        }
        let middle = middles[index];
        middles[index] = (middle + along * half).normalize();
        middles.push((middle - along * half).normalize());
        added += 1;
    }
    added
}

/// The direction along which a spread is widest: what a high power of it makes of any vector, by squaring it again and again.
fn widest(spread: &DMat3) -> DVec3 {
    let mut power = *spread;
    for _ in 0..16 {
        let scale = power.x_axis.length() + power.y_axis.length() + power.z_axis.length();
        power *= 1.0 / scale.max(f64::MIN_POSITIVE);
        power = power * power;
    }
    let columns = [power.x_axis, power.y_axis, power.z_axis];
    let longest = columns
        .into_iter()
        .max_by(|one, other| one.length_squared().total_cmp(&other.length_squared()));
    longest.and_then(DVec3::try_normalize).unwrap_or(DVec3::X)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A sky with a bright side and a lamp.
    fn sky(turned_px: usize) -> Probe {
        let size_px = [128, 64];
        let grid = Probe::new(size_px, vec![Vec3::ONE; 128 * 64]).unwrap();
        let lamp = DVec3::new(0.5, -0.6, 0.7).normalize();
        let pixels = (0..128 * 64).map(|index| {
            let (column, row) = ((index + turned_px) % 128, index / 128);
            let direction = grid.direction(column as f64 + 0.5, row as f64 + 0.5);
            let lit = f64::from(u8::from(direction.dot(lamp) > 0.995)) * 40.0;
            let bright = 1.0 + direction.x + 0.5 * direction.z.max(0.0);
            (DVec3::new(1.0, 0.9, 0.7) * bright + DVec3::splat(lit)).as_vec3()
        });
        Probe::new(size_px, pixels.collect()).unwrap()
    }

    fn irradiance_vector(probe: &Probe) -> [DVec3; 3] {
        let mut vectors = DMat3::ZERO;
        for (index, pixel) in probe.pixels().iter().enumerate() {
            let (column, row) = (index % 128, index / 128);
            let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
            vectors += outer(direction, pixel.as_dvec3() * probe.pixel_solid_angle(row));
        }
        [vectors.x_axis, vectors.y_axis, vectors.z_axis]
    }

    #[test]
    fn no_light_is_lost_or_counted_twice() {
        let probe = sky(0);
        for count in [1, 16, 32, 64, 200] {
            let regions = regions(&probe, count);
            assert_eq!(regions.len(), count);
            let solid_angle: f64 = regions.iter().map(|region| region.solid_angle_sr).sum();
            assert!(
                (solid_angle / (4.0 * PI) - 1.0).abs() < 1e-9,
                "{solid_angle}"
            );
            // A colour's vector may lie a little beside that of the whole light; along it nothing is lost.
            let summed: DVec3 = regions
                .iter()
                .map(|region| region.toward * region.irradiance.dot(REC_709))
                .sum();
            let [red, green, blue] = irradiance_vector(&probe);
            let exact = DMat3::from_cols(red, green, blue) * REC_709;
            assert!(
                summed.distance(exact) < 1e-9 * exact.length(),
                "{summed} {exact}"
            );
        }
    }

    #[test]
    fn planes_get_what_the_pixels_give_the_closer_the_more_regions_there_are() {
        let probe = sky(0);
        let exact = |normal: DVec3| -> f64 {
            let pixels = probe.pixels().iter().enumerate();
            let arriving = pixels.map(|(index, pixel)| {
                let (column, row) = (index % 128, index / 128);
                let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
                let part = direction.dot(normal).max(0.0) * probe.pixel_solid_angle(row);
                pixel.as_dvec3().dot(REC_709) * part
            });
            arriving.sum()
        };
        let error = |count: usize| {
            let regions = regions(&probe, count);
            super::super::harmonics::sphere(40)
                .map(|normal| {
                    let parts = regions.iter().map(|region| {
                        region.irradiance.dot(REC_709) * region.toward.dot(normal).max(0.0)
                    });
                    (parts.sum::<f64>() / exact(normal) - 1.0).abs()
                })
                .fold(0.0, f64::max)
        };
        let [few, more, many] = [16, 64, 256].map(error);
        // (A plane's horizon cuts regions, of which all light comes from one direction here.)
        assert!(
            few < 0.2 && more < 0.06 && many < 0.015,
            "{few} {more} {many}"
        );
    }

    /// Regions of a fine probe are those of a coarser one, with all of its light.
    #[test]
    fn a_fine_probe_loses_nothing() {
        let size_px = [2048, 1024];
        let grid = Probe::new(size_px, vec![Vec3::ZERO; 2048 * 1024]).unwrap();
        let lamp = DVec3::new(0.5, -0.6, 0.7).normalize();
        let radiance = |way: DVec3| match way.dot(lamp) > 0.999_99 {
            true => 2e4,
            false => 1.0 + way.z.max(0.0),
        };
        let pixels = grid
            .rays()
            .map(|(way, ..)| Vec3::splat(radiance(way) as f32));
        let probe = Probe::new(size_px, pixels.collect()).unwrap();
        let regions = regions(&probe, 32);
        assert_eq!(regions.len(), 32);
        let found: DVec3 = regions.iter().map(|it| it.toward * it.irradiance.x).sum();
        let parts = probe.rays();
        let exact: DVec3 = parts
            .map(|(way, radiance, solid_angle)| way * f64::from(radiance.x) * solid_angle)
            .sum();
        assert!(
            found.distance(exact) < 1e-9 * exact.length(),
            "{found} {exact}"
        );
        let solid_angle: f64 = regions.iter().map(|it| it.solid_angle_sr).sum();
        assert!((solid_angle / (4.0 * PI) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_turned_probe_is_cut_alike() {
        let turned_px = 37;
        let angle = -std::f64::consts::TAU * turned_px as f64 / 128.0;
        let turn = glam::DQuat::from_rotation_z(angle);
        let (before, after) = (regions(&sky(0), 32), regions(&sky(turned_px), 32));
        for region in &before {
            let expected = turn * region.toward;
            let nearest = after
                .iter()
                .map(|other| other.toward.angle_between(expected))
                .fold(f64::MAX, f64::min);
            assert!(nearest < 1e-6, "{nearest}");
        }
    }

    #[test]
    fn a_lamp_gets_regions_and_darkness_none() {
        let size_px = [64, 32];
        let mut pixels = vec![Vec3::ZERO; 64 * 32];
        for row in 8..12 {
            for column in 20..24 {
                pixels[row * 64 + column] = Vec3::splat(5.0);
            }
        }
        let probe = Probe::new(size_px, pixels).unwrap();
        // (A region without light is none.)
        let found = regions(&probe, 8);
        assert!(!found.is_empty() && found.len() <= 8);
        let middle = probe.direction(22.0, 10.0);
        assert!(
            found
                .iter()
                .all(|region| region.toward.angle_between(middle) < 0.4)
        );
        assert!(regions(&Probe::new(size_px, vec![Vec3::ZERO; 2048]).unwrap(), 8).is_empty());
    }
}
