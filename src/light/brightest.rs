//! The lights that stand out of a probe.

use std::f64::consts::PI;

use glam::DVec3;

use super::REC_709;
use super::probe::Probe;

/// A light is this many times as bright as the median direction.
const STANDS_OUT: f32 = 8.0;
/// The part of a light's peak at which its edge is.
const EDGE: f32 = 0.1;
/// Weaker ones are not told, part of the power of all directions.
const LEAST_SHARE: f64 = 0.003;

/// A bright part of a probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrightLight {
    /// Unit direction of its middle (by power), from where the probe was taken.
    pub direction: DVec3,
    /// Irradiance on a surface across the direction, linear RGB.
    pub irradiance: DVec3,
    /// Solid angle, steradians.
    pub solid_angle_sr: f64,
    /// Part of the (luminous) power from all directions.
    pub share: f64,
    /// Part of the (luminous) irradiance on a surface that faces upward (+z).
    pub horizontal_share: f64,
}

/// A bright part of a probe, and the pixels that it has.
#[derive(Debug, Clone, PartialEq)]
pub struct BrightRegion {
    /// What they add up to.
    pub light: BrightLight,
    /// Their indices among the probe's pixels.
    pub pixels: Vec<usize>,
}

/// The brightest lights, the one with the most power first; empty where the light is even.
pub fn brightest(probe: &Probe, most: usize) -> Vec<BrightLight> {
    let regions = bright_regions(probe, most).into_iter();
    regions.map(|region| region.light).collect()
}

/// The same with their pixels.
pub fn bright_regions(probe: &Probe, most: usize) -> Vec<BrightRegion> {
    let luminance: Vec<f32> = probe
        .pixels()
        .iter()
        .map(|pixel| pixel.dot(REC_709.as_vec3()))
        .collect();
    let [width, _] = probe.size_px();
    let direction =
        |index: usize| probe.direction((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
    let (mut power, mut horizontal) = (0.0, 0.0);
    for (index, luminance) in luminance.iter().enumerate() {
        let part = f64::from(*luminance) * probe.pixel_solid_angle(index / width);
        power += part;
        horizontal += part * direction(index).z.max(0.0);
    }
    let least = STANDS_OUT * median(probe, &luminance);
    let mut bright: Vec<usize> = (0..luminance.len())
        .filter(|&index| luminance[index] > least)
        .collect();
    bright.sort_by(|&a, &b| luminance[b].total_cmp(&luminance[a]));
    let mut taken = vec![false; luminance.len()];
    let mut found = Vec::new();
    for peak in bright {
        if taken[peak] {
            continue;
        }
        let edge = (EDGE * luminance[peak]).max(least);
        let mut light = BrightLight {
            direction: DVec3::ZERO,
            irradiance: DVec3::ZERO,
            solid_angle_sr: 0.0,
            share: 0.0,
            horizontal_share: 0.0,
        };
        let (mut open, mut pixels) = (vec![peak], Vec::new());
        taken[peak] = true;
        while let Some(index) = open.pop() {
            if luminance[index] >= edge {
                pixels.push(index);
                let solid_angle = probe.pixel_solid_angle(index / width);
                let part = f64::from(luminance[index]) * solid_angle;
                light.direction += part * direction(index);
                light.irradiance += solid_angle * probe.pixels()[index].as_dvec3();
                light.solid_angle_sr += solid_angle;
                light.share += part / power;
                light.horizontal_share +=
                    part * direction(index).z.max(0.0) / horizontal.max(1e-30);
            }
            for next in neighbours(probe.size_px(), index) {
                // Its halo, downhill, belongs to it without being counted; where it rises again another light begins.
                let inside = luminance[next] >= edge;
                let halo = luminance[next] >= least && luminance[next] <= luminance[index];
                if !taken[next] && (inside || halo) {
                    taken[next] = true;
                    open.push(next);
                }
            }
        }
        light.direction = light.direction.normalize_or_zero();
        if light.share >= LEAST_SHARE {
            found.push(BrightRegion { light, pixels });
        }
    }
    found.sort_by(|a, b| b.light.share.total_cmp(&a.light.share));
    found.truncate(most);
    found
}

/// Beside, above and below; above the uppermost row lies what is across the pole.
pub(super) fn neighbours([width, height]: [usize; 2], index: usize) -> [usize; 4] {
    let (column, row) = (index % width, index / width);
    let across = row * width + (column + width / 2) % width;
    [
        row * width + (column + 1) % width,
        row * width + (column + width - 1) % width,
        if row > 0 { index - width } else { across },
        if row + 1 < height {
            index + width
        } else {
            across
        },
    ]
}

/// Half of the sphere is darker.
fn median(probe: &Probe, luminance: &[f32]) -> f32 {
    let width = probe.size_px()[0];
    let mut order: Vec<usize> = (0..luminance.len()).collect();
    order.sort_by(|&a, &b| luminance[a].total_cmp(&luminance[b]));
    let mut below = 0.0;
    order
        .into_iter()
        .find(|index| {
            below += probe.pixel_solid_angle(index / width);
            below >= 2.0 * PI
        })
        .map_or(0.0, |index| luminance[index])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Round lights (direction, half angle, radiance) in a surrounding of radiance 1.
    fn environment(lights: &[(DVec3, f64, f32)]) -> Probe {
        let size_px = [360, 180];
        let grid = Probe::new(size_px, vec![Vec3::ONE; 360 * 180]).unwrap();
        let pixels = (0..360 * 180)
            .map(|index| {
                let direction =
                    grid.direction((index % 360) as f64 + 0.5, (index / 360) as f64 + 0.5);
                let lit = lights
                    .iter()
                    .find(|(toward, half, _)| direction.angle_between(*toward) < *half);
                Vec3::splat(lit.map_or(1.0, |(_, _, radiance)| *radiance))
            })
            .collect();
        Probe::new(size_px, pixels).unwrap()
    }

    #[test]
    fn round_lights_have_their_directions_and_powers() {
        let half = 0.15_f64;
        let lights = [
            (DVec3::new(-1.0, 0.02, 0.4).normalize(), half, 200.0),
            (DVec3::new(0.3, 0.8, -0.4).normalize(), half, 120.0),
            (DVec3::new(0.01, -0.02, 1.0).normalize(), half, 60.0),
        ];
        let found = brightest(&environment(&lights), 8);
        assert_eq!(found.len(), 3);
        let solid_angle = 2.0 * PI * (1.0 - half.cos());
        let radiance: f64 = lights.iter().map(|light| f64::from(light.2) - 1.0).sum();
        let power = 4.0 * PI + solid_angle * radiance;
        // A disc of half angle h gives a surface L π sin² h cos θ.
        let disc = |light: &(DVec3, f64, f32)| {
            PI * half.sin().powi(2) * light.0.z.max(0.0) * f64::from(light.2)
        };
        let unit = PI * half.sin().powi(2);
        let horizontal =
            PI - unit * (lights[0].0.z + lights[2].0.z) + disc(&lights[0]) + disc(&lights[2]);
        for (found, light) in found.iter().zip(&lights) {
            assert!(found.direction.angle_between(light.0).to_degrees() < 0.2);
            assert!((found.solid_angle_sr / solid_angle - 1.0).abs() < 0.03);
            let share = solid_angle * f64::from(light.2) / power;
            assert!((found.share / share - 1.0).abs() < 0.03);
            let expected = disc(light) / horizontal;
            assert!(
                (found.horizontal_share - expected).abs() < 0.01,
                "{expected} {found:?}"
            );
        }
        assert_eq!(brightest(&environment(&lights), 2), found[..2]);
    }

    #[test]
    fn even_light_has_no_lights() {
        assert!(brightest(&environment(&[]), 8).is_empty());
        assert!(brightest(&environment(&[(DVec3::X, 0.2, 6.0)]), 8).is_empty());
    }
}
