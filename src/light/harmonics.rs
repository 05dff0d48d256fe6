//! Real spherical harmonics of any degree, and functions over all directions as sums of them (Sloan et al. 2002).

use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

use glam::DVec3;

/// How many harmonics there are up to and with a degree.
pub const fn count(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// The harmonics up to a degree in a unit direction, `l² + l + m` the number of that of degree `l` and order `m`.
///
/// Orthonormal over the sphere, without Condon and Shortley's phase; the pole is +z.
pub fn basis(direction: DVec3, degree: usize) -> Vec<f64> {
    let mut values = vec![0.0; count(degree)];
    write_basis(direction, degree, &mut values);
    values
}

/// Writes [`basis`] into the first of `values`.
pub fn write_basis(direction: DVec3, degree: usize, values: &mut [f64]) {
    let DVec3 { x, y, z } = direction;
    let norms = &*NORMS;
    // Of sinᵐθ cos mφ and sinᵐθ sin mφ, and of Legendre's functions over sinᵐθ on the diagonal.
    let (mut cosine, mut sine, mut diagonal) = (1.0, 0.0, 1.0);
    for m in 0..=degree {
        let (mut before, mut legendre) = (0.0, diagonal);
        for l in m..=degree {
            let part = norms.get(l * l + m).copied().unwrap_or_else(|| norm(l, m)) * legendre;
            let middle = l * l + l;
            match m {
                0 => values[middle] = part,
                _ => {
                    values[middle + m] = std::f64::consts::SQRT_2 * part * cosine;
                    values[middle - m] = std::f64::consts::SQRT_2 * part * sine;
                }
            }
            let (l, m) = (l as f64, m as f64);
            let next = ((2.0 * l + 1.0) * z * legendre - (l + m) * before) / (l + 1.0 - m);
            (before, legendre) = (legendre, next);
        }
        (cosine, sine) = (x * cosine - y * sine, x * sine + y * cosine);
        diagonal *= (2 * m + 1) as f64;
    }
}

/// What a cosine lobe leaves of harmonics of degree `l`: radiance's coefficients times it are irradiance's (Ramamoorthi &
/// Hanrahan 2001, equation 8).
pub fn cosine_lobe(l: usize) -> f64 {
    match l {
        1 => TAU / 3.0,
        _ if l % 2 == 1 => 0.0,
        _ => {
            let half: f64 = (1..=l / 2).map(|k| k as f64).product();
            let whole: f64 = (1..=l).map(|k| k as f64).product();
            let sign = if l.is_multiple_of(4) { -1.0 } else { 1.0 };
            let degree = l as f64;
            sign * TAU / ((degree + 2.0) * (degree - 1.0)) * whole
                / (2.0_f64.powi(l as i32) * half * half)
        }
    }
}

/// [`norm`] of the degrees that are asked for in each ray, at `l² + m`.
static NORMS: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let degrees = 0..=5;
    let of_degree = |l| (0..=2 * l).map(move |m| if m <= l { norm(l, m) } else { 0.0 });
    degrees.flat_map(of_degree).collect()
});

/// What makes a harmonic's square integrate to one.
fn norm(l: usize, m: usize) -> f64 {
    let falling: f64 = (l - m + 1..=l + m).map(|factor| factor as f64).product();
    ((2 * l + 1) as f64 / (4.0 * PI) / falling).sqrt()
}

/// Unit directions spread evenly over the sphere (a golden-angle spiral): the same each time.
pub fn sphere(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |index| {
        let z = 1.0 - (2 * index + 1) as f64 / count as f64;
        let (sine, cosine) = (index as f64 * TAU * 0.618_033_988_749_895).sin_cos();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(radius * cosine, radius * sine, z)
    })
}

/// How coefficients turn with what they are of, degree by degree.
///
/// Each degree's harmonics turn among themselves (Sloan et al. 2002, section 2.3). The matrices come from what the harmonics
/// are in directions before and after the turn, so no convention but that of [`basis`] is in them.
pub struct Turn {
    /// For each degree rows of `2 l + 1`.
    degrees: Vec<Vec<f64>>,
}

impl Turn {
    /// Of coefficients up to a degree; `there_from_here` is a rotation.
    pub fn new(there_from_here: glam::DMat3, degree: usize) -> Self {
        // A quadrature of products of two harmonics: exact up to rounding with Gauss' places in z and even ones around.
        let quadrature = quadrature(degree);
        let mut degrees: Vec<Vec<f64>> = (0..=degree)
            .map(|l| vec![0.0; (2 * l + 1).pow(2)])
            .collect();
        for (direction, weight) in quadrature {
            let here = basis(direction, degree);
            let there = basis(there_from_here * direction, degree);
            for (l, matrix) in degrees.iter_mut().enumerate() {
                let band = l * l..(l + 1) * (l + 1);
                for (row, value) in matrix.chunks_mut(2 * l + 1).zip(&there[band.clone()]) {
                    for (entry, before) in row.iter_mut().zip(&here[band.clone()]) {
                        *entry += weight * value * before;
                    }
                }
            }
        }
        Self { degrees }
    }

    /// Coefficients of a function as it is after the turn; those of higher degrees become 0.
    pub fn turned<const N: usize>(&self, coefficients: &[DVec3; N]) -> [DVec3; N] {
        let mut turned = [DVec3::ZERO; N];
        for (l, matrix) in self.degrees.iter().enumerate() {
            let band = l * l..(l + 1) * (l + 1);
            let rows = matrix.chunks(2 * l + 1);
            for (after, row) in turned[band.clone()].iter_mut().zip(rows) {
                let parts = row.iter().zip(&coefficients[band.clone()]);
                *after = parts.map(|(&entry, &before)| before * entry).sum();
            }
        }
        turned
    }
}

/// Directions and weights that integrate products of two harmonics up to a degree.
fn quadrature(degree: usize) -> Vec<(DVec3, f64)> {
    let rings = degree + 1;
    let around = 2 * degree + 1;
    let mut places = Vec::with_capacity(rings * around);
    for ring in 0..rings {
        // Newton's steps to the root of Legendre's polynomial (Abramowitz & Stegun 25.4.29).
        let mut z = (PI * (ring as f64 + 0.75) / (rings as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..64 {
            let (mut before, mut value) = (1.0, z);
            for l in 1..rings {
                let l = l as f64;
                (before, value) = (
                    value,
                    ((2.0 * l + 1.0) * z * value - l * before) / (l + 1.0),
                );
            }
            slope = rings as f64 * (z * value - before) / (z * z - 1.0);
            let step = value / slope;
            z -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        let weight = 2.0 / ((1.0 - z * z) * slope * slope) * TAU / around as f64;
        let radius = (1.0 - z * z).sqrt();
        for place in 0..around {
            let (sine, cosine) = (TAU * place as f64 / around as f64).sin_cos();
            places.push((DVec3::new(radius * cosine, radius * sine, z), weight));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    const DEGREE: usize = 5;

    fn turn() -> DMat3 {
        DMat3::from_euler(glam::EulerRot::ZYX, 0.7, -1.9, 0.4)
    }

    #[test]
    fn the_first_harmonics_are_their_closed_forms() {
        let direction = DVec3::new(0.3, -0.8, 0.5).normalize();
        let values = basis(direction, 2);
        let DVec3 { x, y, z } = direction;
        let one = 0.5 / PI.sqrt();
        let two = (3.0 / (4.0 * PI)).sqrt();
        let three = 0.5 * (15.0 / PI).sqrt();
        let expected = [
            one,
            two * y,
            two * z,
            two * x,
            three * x * y,
            three * y * z,
            0.25 * (5.0 / PI).sqrt() * (3.0 * z * z - 1.0),
            three * x * z,
            0.5 * three * (x * x - y * y),
        ];
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-14, "{value} {expected}");
        }
    }

    #[test]
    fn they_are_orthonormal() {
        let mut products = vec![0.0; count(DEGREE) * count(DEGREE)];
        for (direction, weight) in quadrature(DEGREE) {
            let values = basis(direction, DEGREE);
            for (row, one) in values.iter().enumerate() {
                for (column, other) in values.iter().enumerate() {
                    products[row * count(DEGREE) + column] += weight * one * other;
                }
            }
        }
        for (index, product) in products.iter().enumerate() {
            let expected = f64::from(u8::from(index % (count(DEGREE) + 1) == 0));
            assert!((product - expected).abs() < 1e-12, "{index}: {product}");
        }
    }

    #[test]
    fn a_turn_turns_the_function_and_keeps_its_power() {
        let coefficients: [DVec3; count(DEGREE)] = std::array::from_fn(|index| {
            DVec3::new(1.0, (index as f64).sin(), (2.0 * index as f64).cos())
        });
        let at = |coefficients: &[DVec3], direction| -> DVec3 {
            let values = basis(direction, DEGREE);
            let parts = coefficients.iter().zip(values);
            parts.map(|(&part, value)| part * value).sum()
        };
        let turned = Turn::new(turn(), DEGREE).turned(&coefficients);
        for direction in sphere(50) {
            let (before, after) = (
                at(&coefficients, direction),
                at(&turned, turn() * direction),
            );
            assert!(before.distance(after) < 1e-10, "{before} {after}");
        }
        for degree in 0..=DEGREE {
            let band = degree * degree..(degree + 1) * (degree + 1);
            let power = |all: &[DVec3]| -> f64 {
                all[band.clone()]
                    .iter()
                    .map(|part| part.length_squared())
                    .sum()
            };
            assert!((power(&turned) / power(&coefficients) - 1.0).abs() < 1e-10);
        }
    }

    #[test]
    fn a_cosine_lobe_has_its_closed_form() {
        let lobes = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0];
        for (l, lobe) in lobes.into_iter().enumerate() {
            assert!((cosine_lobe(l) - lobe).abs() < 1e-14, "{l}");
        }
        let samples = 200_000;
        let mut sums = vec![0.0; count(DEGREE)];
        for direction in sphere(samples) {
            let part = direction.z.max(0.0) * 4.0 * PI / samples as f64;
            for (sum, value) in sums.iter_mut().zip(basis(direction, DEGREE)) {
                *sum += part * value;
            }
        }
        for (l, lobe) in lobes.into_iter().enumerate() {
            for m in 0..2 * l + 1 {
                let expected = if m == l {
                    lobe * ((2 * l + 1) as f64 / (4.0 * PI)).sqrt()
                } else {
                    0.0
                };
                let found = sums[l * l + m];
                assert!(
                    (found - expected).abs() < 1e-4,
                    "{l} {m}: {found} {expected}"
                );
            }
        }
    }
}
