//! A probe as people can look at it: tone-mapped, with rings around its lights.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use crate::light::brightest::BrightLight;
use crate::light::probe::Probe;
use crate::light::srgb::srgb_level;

/// Display value of the probe's log-mean luminance, linear.
const KEY: f32 = 0.18;
/// Width of the rings, radians.
const RING: f64 = 0.02;
/// From a light's edge to its ring, radians.
const GAP: f64 = 0.03;

/// 8-bit RGBA of the probe's size, rows from the top. The first light's ring is yellow, the others' are magenta.
pub(crate) fn preview(probe: &Probe, lights: &[BrightLight]) -> Vec<u8> {
    let [width, height] = probe.size_px();
    let luminance = |pixel: &Vec3| pixel.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let (mut logs, mut weights) = (0.0, 0.0);
    for (index, pixel) in probe.pixels().iter().enumerate() {
        let weight = probe.pixel_solid_angle(index / width);
        let luminance = f64::from(luminance(pixel));
        if luminance > 0.0 {
            logs += weight * luminance.ln();
            weights += weight;
        }
    }
    let mean = if weights > 0.0 {
        (logs / weights).exp() as f32
    } else {
        1.0
    };
    let mut rgba = Vec::with_capacity(4 * width * height);
    for (index, pixel) in probe.pixels().iter().enumerate() {
        let direction = probe.direction((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
        let ring = lights.iter().position(|light| in_ring(light, direction));
        let shown = match ring {
            Some(0) => Vec3::new(1.0, 0.9, 0.0),
            Some(_) => Vec3::new(1.0, 0.0, 0.8),
            None => {
                let scaled = *pixel * (KEY / mean);
                // Reinhard's curve (2002, eq. 3).
                scaled / (1.0 + luminance(&scaled))
            }
        };
        rgba.extend(shown.to_array().map(srgb_level));
        rgba.push(255);
    }
    rgba
}

fn in_ring(light: &BrightLight, direction: DVec3) -> bool {
    let half = (1.0 - light.solid_angle_sr / (2.0 * PI))
        .clamp(-1.0, 1.0)
        .acos();
    let beyond = direction.angle_between(light.direction) - half - GAP;
    (0.0..RING).contains(&beyond)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_probe_is_middle_grey_and_lights_are_ringed() {
        let probe = Probe::new([1024, 512], vec![Vec3::splat(37.0); 1024 * 512]).unwrap();
        let light = BrightLight {
            direction: DVec3::X,
            irradiance: DVec3::ONE,
            solid_angle_sr: 2.0 * PI * (1.0 - 0.2_f64.cos()),
            share: 1.0,
            horizontal_share: 0.0,
        };
        let rgba = preview(&probe, &[light]);
        assert_eq!(rgba.len(), 4 * 1024 * 512);
        let pixel = |column: usize| &rgba[4 * (256 * 1024 + column)..][..4];
        // 0.18 / 1.18 is level 109. +x is the middle column; the ring is 0.23 to 0.25 rad away, 37.5 to 40.7 columns.
        for column in [512, 512 + 36, 512 + 42] {
            assert_eq!(pixel(column), [109, 109, 109, 255]);
        }
        for column in [512 + 39, 511 - 39] {
            assert_eq!(pixel(column), [255, 243, 0, 255]);
        }
    }
}
