//! An environment as glossy things meet it whose visibility is known in few harmonics (Tamura et al. 2005, section 5.1): the
//! light is a matrix, so that of each corner only a vector has to be kept.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::light::harmonics::{Turn, write_basis};
use crate::light::probe::Probe;

use super::self_occlusion::{VISIBILITIES, VISIBILITY_DEGREE};

/// Coefficients of the product of an environment's radiance and a function of few harmonics: rows by columns, linear radiance.
pub type ProductMatrix = [[DVec3; VISIBILITIES]; VISIBILITIES];

/// Radiance from all directions as what it makes of visibility's harmonics (L of equation 10), world space.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvironmentMatrix(ProductMatrix);

impl EnvironmentMatrix {
    /// Of a probe's radiance times `exposure`.
    pub fn new(probe: &Probe, exposure: f64) -> Self {
        let rays: Vec<_> = probe.rays().collect();
        let none = || [[DVec3::ZERO; VISIBILITIES]; VISIBILITIES];
        let sums = rays
            .par_chunks(4096)
            .map(|rays| {
                let (mut sums, mut values) = (none(), [0.0; VISIBILITIES]);
                for (direction, radiance, solid_angle) in rays {
                    let light = radiance.as_dvec3() * (exposure * solid_angle);
                    write_basis(*direction, VISIBILITY_DEGREE, &mut values);
                    for (row, value) in sums.iter_mut().zip(values) {
                        let light = light * value;
                        for (sum, value) in row.iter_mut().zip(values) {
                            *sum += light * value;
                        }
                    }
                }
                sums
            })
            // (In one order, so that a frame repeats bit for bit.)
            .collect::<Vec<_>>();
        let mut whole = none();
        for part in &sums {
            for (sum, part) in whole.iter_mut().flatten().zip(part.iter().flatten()) {
                *sum += *part;
            }
        }
        Self(whole)
    }

    /// For visibility in a thing's own orientation: rows stay those of the world, columns are the thing's.
    pub fn seen_by(&self, world_from_own: DMat3) -> ProductMatrix {
        let turn = Turn::new(world_from_own.transpose(), VISIBILITY_DEGREE);
        self.0.map(|row| turn.turned(&row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::harmonics::{basis, sphere};
    use glam::Vec3;

    /// A probe that is brighter to one side and above.
    fn probe() -> Probe {
        let [width, height] = [64, 32];
        let grid = Probe::new([width, height], vec![Vec3::ONE; width * height]).expect("pixels");
        let pixels = (0..width * height).map(|index| {
            let (column, row) = (index % width, index / width);
            let way = grid.direction(column as f64 + 0.5, row as f64 + 0.5);
            Vec3::new(1.0 + way.x as f32, 1.0, (way.z as f32).max(0.0))
        });
        Probe::new([width, height], pixels.collect()).expect("pixels")
    }

    #[test]
    fn what_nothing_hides_has_the_harmonics_of_the_light() {
        let probe = probe();
        let world_from_own = DMat3::from_euler(glam::EulerRot::ZYX, 0.7, -1.9, 0.4);
        let matrix = EnvironmentMatrix::new(&probe, 2.0).seen_by(world_from_own);
        // The harmonics of a constant 1, whichever way it is turned.
        let mut open = [0.0; VISIBILITIES];
        open[0] = (4.0 * std::f64::consts::PI).sqrt();
        for (index, row) in matrix.iter().enumerate() {
            let found: DVec3 = row
                .iter()
                .zip(open)
                .map(|(entry, part)| *entry * part)
                .sum();
            let parts = probe.rays().map(|(way, radiance, solid_angle)| {
                radiance.as_dvec3() * (2.0 * solid_angle * basis(way, VISIBILITY_DEGREE)[index])
            });
            let expected: DVec3 = parts.sum();
            assert!(
                found.distance(expected) < 1e-6,
                "{index}: {found} {expected}"
            );
        }
    }

    #[test]
    fn what_a_turned_thing_leaves_is_the_product_of_both() {
        let world_from_own = DMat3::from_euler(glam::EulerRot::ZYX, -0.3, 1.1, 2.0);
        // Few harmonics again: a visibility of degree 2 of a constant light is itself.
        let constant = Probe::new([64, 32], vec![Vec3::splat(3.0); 64 * 32]).expect("pixels");
        let matrix = EnvironmentMatrix::new(&constant, 1.0).seen_by(world_from_own);
        let visibility: [f64; VISIBILITIES] =
            std::array::from_fn(|index| if index < 9 { (index as f64).cos() } else { 0.0 });
        let at = |values: &[f64], way: DVec3| -> f64 {
            let basis = basis(way, VISIBILITY_DEGREE);
            values
                .iter()
                .zip(basis)
                .map(|(part, value)| part * value)
                .sum()
        };
        let product = matrix.map(|row| {
            let parts = row
                .iter()
                .zip(visibility)
                .map(|(entry, part)| entry.y * part);
            parts.sum::<f64>()
        });
        for way in sphere(40) {
            let (found, expected) = (
                at(&product, world_from_own * way),
                3.0 * at(&visibility, way),
            );
            // (Pixels of a probe integrate harmonics to a hundredth.)
            assert!((found - expected).abs() < 0.05, "{found} {expected}");
        }
    }
}
