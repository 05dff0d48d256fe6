//! What a rough layer mirrors of light that is the same from everywhere (Karis 2013, the second of his two sums), as a table.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use glam::DVec3;
use rayon::prelude::*;

use super::material::{Material, Shading};
use super::{HEAD_ON, grazing, layer_visibility, mean_burley};

/// Entries along a side of the table.
const SIDE: usize = 32;
/// Halfway vectors of an entry: so many angles, and half as many azimuths.
const SAMPLES: usize = 128;

/// For cosines to the camera (the square of what rises from entry to entry, from 0 to 1) and GGX α (likewise, row by row) factor and
/// summand that make the part that is mirrored of what the layer mirrors head-on; then, for the whole row, the part that a
/// dielectric's layer mirrors of light from everywhere towards everywhere.
pub static LAYER_ALBEDO: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
    let along = |index: usize| (index as f64 / (SIDE - 1) as f64).powi(2);
    let rows = (0..SIDE).into_par_iter().flat_map_iter(|row| {
        let alpha = along(row);
        let entries = (0..SIDE).map(|column| entry(along(column), alpha));
        let entries: Vec<[f32; 2]> = entries.collect();
        let dielectric =
            |[factor, summand]: &[f32; 2]| HEAD_ON * f64::from(*factor) + f64::from(*summand);
        let mean = mean_over_cosines(&entries, dielectric) as f32;
        let entries = entries.into_iter();
        entries.map(move |[factor, summand]| [factor, summand, mean])
    });
    rows.collect()
});

/// What a dielectric's layer leaves of light that comes from a cosine or goes to it; of light from everywhere with `None`.
pub(super) fn let_through(alpha: f64, cosine: Option<f64>) -> f64 {
    let [factor, summand, mean] = between(cosine.unwrap_or(1.0), alpha);
    match cosine {
        Some(_) => 1.0 - (HEAD_ON * factor + summand),
        None => 1.0 - mean,
    }
}

/// For each row of [`LAYER_ALBEDO`] factor and summand that make the part that is mirrored of light from everywhere towards
/// everywhere.
static MEANS: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| {
    let rows = LAYER_ALBEDO.chunks(SIDE);
    let mean = |row: &[[f32; 3]]| {
        [0, 1].map(|part| mean_over_cosines(row, |entry| f64::from(entry[part])))
    };
    rows.map(mean).collect()
});

/// The part of light from everywhere that a material reflects, all around: the albedo that stands for it where others get light
/// from it. Its pictures are left out.
pub fn mean_reflectance(material: &Material) -> DVec3 {
    let Some(alpha) = material
        .layer_roughness()
        .filter(|_| material.shading != Shading::Unlit)
    else {
        return material.albedo;
    };
    let place = alpha.clamp(0.0, 1.0).sqrt() * (SIDE - 1) as f64;
    let low = (place as usize).min(SIDE - 2);
    let [factor, summand] = [0, 1].map(|part| {
        let [before, after] = [MEANS[low][part], MEANS[low + 1][part]];
        before + (after - before) * (place - low as f64)
    });
    let mirrored = HEAD_ON * factor + summand;
    let below = match material.shading {
        Shading::Principled => mean_burley(alpha),
        Shading::Lit | Shading::Unlit => 1.0 - mirrored,
    };
    let dielectric = material.albedo * below + mirrored;
    let metal = material.albedo * factor + summand;
    dielectric.lerp(metal, material.metallic)
}

/// The cosine-weighted mean over a row: ∫ E 2μ dμ, where μ = t² has 2μ dμ = 4t³ dt.
fn mean_over_cosines<Entry>(row: &[Entry], value: impl Fn(&Entry) -> f64) -> f64 {
    let last = (SIDE - 1) as f64;
    let at = |index: usize| value(&row[index]);
    // (Exact for what is straight between entries: ∫ t³ and ∫ t⁴ over each piece.)
    let pieces = (0..SIDE - 1).map(|index| {
        let (from, to) = (index as f64 / last, (index + 1) as f64 / last);
        let slope = (at(index + 1) - at(index)) * last;
        let base = at(index) - slope * from;
        base * (to.powi(4) - from.powi(4)) + slope * 0.8 * (to.powi(5) - from.powi(5))
    });
    pieces.sum()
}

/// The table between its entries, as the graphics card reads it.
pub fn between(cosine: f64, alpha: f64) -> [f64; 3] {
    let at = |value: f64| {
        let place = value.clamp(0.0, 1.0).sqrt() * (SIDE - 1) as f64;
        let low = (place as usize).min(SIDE - 2);
        (low, place - low as f64)
    };
    let ((column, right), (row, down)) = (at(cosine), at(alpha));
    [0, 1, 2].map(|part| {
        let entry = |across: usize, below: usize| {
            f64::from(LAYER_ALBEDO[(row + below) * SIDE + column + across][part])
        };
        let upper = entry(0, 0) * (1.0 - right) + entry(1, 0) * right;
        let lower = entry(0, 1) * (1.0 - right) + entry(1, 1) * right;
        upper * (1.0 - down) + lower * down
    })
}

/// By halfway vectors as the distribution has them.
fn entry(cos_camera: f64, alpha: f64) -> [f32; 2] {
    let (cos_camera, alpha) = (cos_camera.max(1e-3), alpha.max(1e-4));
    let to_camera = DVec3::new((1.0 - cos_camera * cos_camera).sqrt(), 0.0, cos_camera);
    let [mut factor, mut summand] = [0.0; 2];
    for index in 0..SAMPLES * SAMPLES / 2 {
        let [part, around] = [index % SAMPLES, index / SAMPLES].map(|index| index as f64 + 0.5);
        let part = part / SAMPLES as f64;
        let cos_squared = (1.0 - part) / (1.0 + (alpha * alpha - 1.0) * part);
        let (sine, cosine) = (around / SAMPLES as f64 * 2.0 * TAU).sin_cos();
        let radius = (1.0 - cos_squared).sqrt();
        let halfway = DVec3::new(radius * cosine, radius * sine, cos_squared.sqrt());
        let way = halfway.dot(to_camera);
        let cos_light = (halfway * (2.0 * way) - to_camera).z;
        if way <= 0.0 || cos_light <= 0.0 {
            continue;
        }
        let mirrored = 4.0 * layer_visibility(alpha, cos_light, cos_camera) * cos_light * way
            / halfway.z.max(1e-9);
        factor += mirrored * (1.0 - grazing(way));
        summand += mirrored * grazing(way);
    }
    [factor, summand].map(|sum| (sum / (SAMPLES * SAMPLES / 2) as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::reflectance;

    #[test]
    fn the_table_is_what_the_brdf_reflects_of_light_from_everywhere() {
        for alpha in [0.2, 0.3, 0.55, 1.0] {
            for cos_camera in [1.0, 0.8, 0.5, 0.25] {
                let color = DVec3::new(0.04, 0.5, 1.0);
                let metal = Material {
                    roughness: Some(alpha),
                    metallic: 1.0,
                    ..Material::matt(color)
                };
                let expected = of_light_from_everywhere(&metal, cos_camera);
                let [factor, summand, _] = between(cos_camera, alpha);
                let found = color * factor + summand;
                assert!(
                    (found - expected).abs().max_element() < 0.005,
                    "{alpha} {cos_camera}: {found} {expected}"
                );
            }
        }
    }
    /// What the layer does not mirror comes out below it: all of it, of a white body.
    #[test]
    fn a_white_dielectric_reflects_all_light_however_rough_its_layer_is() {
        for alpha in [0.2, 0.3, 1.0] {
            let white = Material {
                roughness: Some(alpha),
                ..Material::matt(DVec3::ONE)
            };
            for cos_camera in [0.9, 0.5, 0.25] {
                let reflected = of_light_from_everywhere(&white, cos_camera).x;
                assert!(
                    (reflected - 1.0).abs() < 0.005,
                    "{alpha} {cos_camera}: {reflected}"
                );
            }
        }
    }

    #[test]
    fn the_mean_reflectance_is_that_of_all_ways_of_light() {
        let color = DVec3::new(0.1, 0.5, 0.9);
        for (alpha, metallic, shading) in [
            (0.09, 0.0, Shading::Lit),
            (0.36, 0.0, Shading::Principled),
            (1.0, 0.0, Shading::Principled),
            (0.3, 1.0, Shading::Lit),
            (0.5, 0.4, Shading::Principled),
        ] {
            let material = Material {
                roughness: Some(alpha),
                metallic,
                shading,
                ..Material::matt(color)
            };
            // Middles of rings that get like parts of light from everywhere.
            let rings = 12;
            let cosines =
                (0..rings).map(|ring| ((f64::from(ring) + 0.5) / f64::from(rings)).sqrt());
            let of_rings = cosines.map(|cosine| of_light_from_everywhere(&material, cosine));
            let expected = of_rings.sum::<DVec3>() / f64::from(rings);
            let found = mean_reflectance(&material);
            let off = (found - expected).abs().max_element();
            assert!(off < 0.012, "{material:?}: {found}, {expected}");
        }
        assert_eq!(mean_reflectance(&Material::matt(color)), color);
    }

    /// The part of light from everywhere that a material reflects towards a cosine.
    fn of_light_from_everywhere(material: &Material, cos_camera: f64) -> DVec3 {
        let to_camera = DVec3::new((1.0_f64 - cos_camera * cos_camera).sqrt(), 0.0, cos_camera);
        let steps = 500;
        let mut sum = DVec3::ZERO;
        for index in 0..steps * steps {
            let [down, around] =
                [index / steps, index % steps].map(|at| (at as f64 + 0.5) / steps as f64);
            // Even in the square of the sine: the cosine is in it.
            let (sine, cosine) = (TAU * around).sin_cos();
            let radius = down.sqrt();
            let to_light = DVec3::new(radius * cosine, radius * sine, (1.0 - down).sqrt());
            sum += reflectance(material, DVec3::Z, to_light, to_camera);
        }
        sum * std::f64::consts::PI / (steps * steps) as f64
    }
}
