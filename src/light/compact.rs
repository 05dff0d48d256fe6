//! Compact lights taken out of a probe: what is small and bright in it, so that shadows have an outline, and the rest. No light
//! is lost, and none is counted twice.

use std::collections::HashSet;

use glam::{DMat3, DVec3, Vec3};

use super::REC_709;
use super::brightest::{BrightRegion, neighbours};
use super::probe::Probe;

/// What a light gave to the probe beyond what is around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TakenLight {
    /// Unit direction towards it, of its irradiance vector.
    pub direction: DVec3,
    /// Irradiance on a plane across the direction, linear RGB in the probe's unit: a plane that sees all of it gets that
    /// times the cosine, just as from its pixels.
    pub irradiance: DVec3,
    /// Width of a disc of its solid angle, radians.
    pub width_rad: f64,
}

/// The width that a bright region would have as a disc, radians.
pub fn width_rad(region: &BrightRegion) -> f64 {
    let solid_angle = region.light.solid_angle_sr;
    2.0 * (1.0 - solid_angle / std::f64::consts::TAU)
        .clamp(-1.0, 1.0)
        .acos()
}

/// Takes a light's pixels out of a probe: as bright as their surroundings is what stays.
pub fn take(probe: &mut Probe, region: &BrightRegion) -> TakenLight {
    let inside: HashSet<usize> = region.pixels.iter().copied().collect();
    let rim: HashSet<usize> = region
        .pixels
        .iter()
        .flat_map(|&pixel| neighbours(probe.size_px(), pixel))
        .filter(|pixel| !inside.contains(pixel))
        .collect();
    // (The sum of a set would depend on its order.)
    let mut rim: Vec<usize> = rim.into_iter().collect();
    rim.sort_unstable();
    let around =
        rim.iter().map(|&pixel| probe.pixels()[pixel]).sum::<Vec3>() / (rim.len().max(1)) as f32;
    let [width, _] = probe.size_px();
    // Of each channel the irradiance vector.
    let mut vectors = DMat3::ZERO;
    for &pixel in &region.pixels {
        let (column, row) = ((pixel % width) as f64 + 0.5, pixel / width);
        let direction = probe.direction(column, row as f64 + 0.5);
        let before = probe.pixels()[pixel];
        let left = before.min(around);
        let taken = (before - left).as_dvec3() * probe.pixel_solid_angle(row);
        for (channel, part) in taken.to_array().into_iter().enumerate() {
            *vectors.col_mut(channel) += direction * part;
        }
        probe.set_pixel(pixel, left);
    }
    let direction = (vectors * REC_709).normalize_or_zero();
    TakenLight {
        direction,
        irradiance: (vectors.transpose() * direction).max(DVec3::ZERO),
        width_rad: width_rad(region),
    }
}

#[cfg(test)]
mod tests {
    use super::super::brightest::bright_regions;
    use super::*;

    #[test]
    fn what_is_taken_and_what_is_left_give_planes_what_the_probe_gave() {
        let size_px = [512, 256];
        let grid = Probe::new(size_px, vec![Vec3::ONE; 512 * 256]).unwrap();
        let lamps = [
            (
                DVec3::new(0.5, -0.3, 0.8).normalize(),
                0.03,
                Vec3::new(900.0, 700.0, 400.0),
            ),
            (
                DVec3::new(-0.9, 0.01, 0.6).normalize(),
                0.1,
                Vec3::new(50.0, 60.0, 70.0),
            ),
        ];
        let pixels = (0..512 * 256).map(|index| {
            let direction = grid.direction((index % 512) as f64 + 0.5, (index / 512) as f64 + 0.5);
            let lamp = lamps
                .iter()
                .find(|lamp| direction.angle_between(lamp.0) < lamp.1);
            lamp.map_or(Vec3::new(0.4, 0.5, 0.6), |lamp| {
                lamp.2 * (1.0 + direction.y as f32)
            })
        });
        let probe = Probe::new(size_px, pixels.collect()).unwrap();
        let on_plane = |probe: &Probe, normal: DVec3| -> DVec3 {
            let pixels = probe.pixels().iter().enumerate();
            let arriving = |(index, pixel): (usize, &Vec3)| {
                let (column, row) = ((index % 512) as f64 + 0.5, index / 512);
                let cosine = probe
                    .direction(column, row as f64 + 0.5)
                    .dot(normal)
                    .max(0.0);
                pixel.as_dvec3() * (cosine * probe.pixel_solid_angle(row))
            };
            pixels.map(arriving).sum()
        };
        let mut rest = probe.clone();
        let regions = bright_regions(&probe, 8);
        assert_eq!(regions.len(), 2);
        let taken: Vec<TakenLight> = regions
            .iter()
            .map(|region| take(&mut rest, region))
            .collect();
        for normal in [DVec3::Z, DVec3::new(0.1, -0.3, 0.9).normalize()] {
            let lights: DVec3 = taken
                .iter()
                .map(|light| light.irradiance * light.direction.dot(normal).max(0.0))
                .sum();
            let (whole, both) = (on_plane(&probe, normal), on_plane(&rest, normal) + lights);
            let error = (both / whole - 1.0).abs().max_element();
            assert!(error < 1e-3, "{normal}: {both} for {whole}");
        }
        assert!(bright_regions(&rest, 8).is_empty());
    }
}
