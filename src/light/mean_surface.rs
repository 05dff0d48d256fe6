//! What stands for a surface, with all that its pictures show, where others get light from it.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::layer_albedo::mean_reflectance;
use super::material::{Material, Shading};
use super::reflectance;

/// α of a layer at least: the few rays that look for what it mirrors would meet a sharper image once, or never.
const LEAST_ROUGHNESS: f64 = 0.2;

/// Means over a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanSurface {
    /// The part of light from everywhere that it reflects, all around.
    pub albedo: DVec3,
    /// What it is made of, without pictures.
    material: Material,
}

/// Sums up places of a surface.
#[derive(Debug, Clone, Copy, Default)]
pub struct PlacesOfSurface {
    sum: Option<MeanSurface>,
    weights: f64,
}

impl PlacesOfSurface {
    /// Adds one, with what its pictures show there.
    pub fn add(&mut self, material: &Material, weight: f64) {
        let place = MeanSurface::plain(material).scaled(weight);
        self.sum = Some(self.sum.map_or(place, |sum| sum.with(&place)));
        self.weights += weight;
    }

    /// `None` where nothing has a weight.
    pub fn mean(&self) -> Option<MeanSurface> {
        let sum = self.sum.filter(|_| self.weights > 0.0)?;
        Some(sum.scaled(1.0 / self.weights))
    }
}

impl MeanSurface {
    /// All of one material, whose pictures are passed over.
    pub fn plain(material: &Material) -> Self {
        Self {
            albedo: mean_reflectance(material),
            material: *material,
        }
    }

    /// The part of light from one direction that goes in another, in parts of what a white matt surface sends there; all unit
    /// lengths, in one space.
    pub fn reflected(&self, normal: Vec3, to_light: Vec3, to_viewer: Vec3) -> Vec3 {
        let material = &self.material;
        let Some(alpha) = material
            .layer_roughness()
            .filter(|_| material.shading != Shading::Unlit)
        else {
            return self.albedo.as_vec3();
        };
        let blurred = Material {
            roughness: Some(alpha.max(LEAST_ROUGHNESS)),
            ..*material
        };
        let [normal, to_light, to_viewer] = [normal, to_light, to_viewer].map(Vec3::as_dvec3);
        (reflectance(&blurred, normal, to_light, to_viewer) * PI).as_vec3()
    }

    fn scaled(&self, factor: f64) -> Self {
        let material = &self.material;
        Self {
            albedo: self.albedo * factor,
            material: Material {
                albedo: material.albedo * factor,
                roughness: material.roughness.map(|alpha| alpha * factor),
                metallic: material.metallic * factor,
                ..*material
            },
        }
    }

    /// Their sum, but for what is not summed.
    fn with(&self, other: &Self) -> Self {
        let [one, two] = [&self.material, &other.material];
        let roughness = one.roughness.zip(two.roughness);
        Self {
            albedo: self.albedo + other.albedo,
            material: Material {
                albedo: one.albedo + two.albedo,
                roughness: roughness.map(|(one, two)| one + two),
                metallic: one.metallic + two.metallic,
                ..*one
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A surface of two halves, half of one each.
    #[test]
    fn a_mean_is_what_both_halves_reflect() {
        let [dark, light] = [0.1, 0.7].map(|albedo| Material::matt(DVec3::splat(albedo)));
        let mut places = PlacesOfSurface::default();
        assert_eq!(places.mean(), None);
        places.add(&dark, 1.0);
        places.add(&light, 3.0);
        let mean = places.mean().expect("places");
        assert!((mean.albedo - DVec3::splat(0.55)).length() < 1e-12);
        let [up, aslant] = [Vec3::Z, Vec3::new(0.6, 0.0, 0.8)];
        assert_eq!(mean.reflected(up, aslant, up), mean.albedo.as_vec3());
    }

    /// What goes in all directions is together the part that is reflected of light from everywhere.
    #[test]
    fn all_directions_together_make_the_albedo() {
        for (alpha, metallic) in [(0.3, 0.0), (0.3, 1.0), (0.8, 0.5)] {
            let surface = MeanSurface::plain(&Material {
                roughness: Some(alpha),
                metallic,
                shading: Shading::Principled,
                ..Material::matt(DVec3::splat(0.5))
            });
            // Directions of one part each of cosine-weighted light.
            let rings = 24;
            let directions: Vec<Vec3> = (0..rings * rings)
                .map(|index| {
                    let [down, around] =
                        [index / rings, index % rings].map(|at| (at as f32 + 0.5) / rings as f32);
                    let (sine, cosine) = (around * std::f32::consts::TAU).sin_cos();
                    let radius = down.sqrt();
                    Vec3::new(radius * cosine, radius * sine, (1.0 - down).sqrt())
                })
                .collect();
            let ways = directions.iter().flat_map(|from| {
                let to = directions.iter();
                to.map(|to| surface.reflected(Vec3::Z, *from, *to).as_dvec3())
            });
            let mean = ways.sum::<DVec3>() / directions.len().pow(2) as f64;
            let off = (mean - surface.albedo).abs().max_element();
            assert!(off < 0.012, "{alpha} {metallic}: {mean} {}", surface.albedo);
        }
    }
}
