//! Square matrices in double precision, and Cholesky's decomposition of those that are positive definite.
//!
//! The order of all sums is fixed here, so that a replay repeats bit for bit on every processor: libraries that pick a
//! kernel by what the processor can do (fused multiply-add) do not promise that, and six unknowns are too few to gain by
//! them.

use std::ops::{Add, Mul, Sub};

/// A square matrix of a side that is known when the program is built, row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matrix<const N: usize>(pub [[f64; N]; N]);

impl<const N: usize> Matrix<N> {
    /// All zeros.
    pub const ZERO: Self = Self([[0.0; N]; N]);

    /// A matrix whose entries off the diagonal are 0.
    pub fn diagonal(entries: [f64; N]) -> Self {
        let mut matrix = Self::ZERO;
        for (k, entry) in entries.into_iter().enumerate() {
            matrix.0[k][k] = entry;
        }
        matrix
    }

    /// Rows as columns.
    pub fn transposed(&self) -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| self.0[j][i])
        }))
    }

    /// The x of `self · x = right`; `None` when the matrix is not positive definite. Its upper triangle is not looked at.
    #[inline]
    pub fn solve(&self, right: &[f64; N]) -> Option<[f64; N]> {
        let lower = self.lower()?;
        let mut x = *right;
        substitute(lower.as_flattened(), &mut x);
        Some(x)
    }

    /// The inverse; `None` when the matrix is not positive definite. Its upper triangle is not looked at.
    #[inline]
    pub fn inverse(&self) -> Option<Self> {
        let lower = self.lower()?;
        // Symmetric, so its columns are its rows.
        let mut columns = Matrix::diagonal([1.0; N]);
        for column in &mut columns.0 {
            substitute(lower.as_flattened(), column);
        }
        Some(columns)
    }

    #[inline]
    fn lower(&self) -> Option<[[f64; N]; N]> {
        let mut lower = self.0;
        factor(lower.as_flattened_mut(), N).then_some(lower)
    }
}

impl<const N: usize> Add for Matrix<N> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| self.0[i][j] + other.0[i][j])
        }))
    }
}

impl<const N: usize> Sub for Matrix<N> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| self.0[i][j] - other.0[i][j])
        }))
    }
}

impl<const N: usize> Mul for Matrix<N> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..N).map(|k| self.0[i][k] * other.0[k][j]).sum())
        }))
    }
}

impl<const N: usize> Mul<[f64; N]> for Matrix<N> {
    type Output = [f64; N];

    fn mul(self, vector: [f64; N]) -> [f64; N] {
        self.0.map(|row| dot(&row, &vector))
    }
}

impl<const N: usize> Mul<f64> for Matrix<N> {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|row| row.map(|entry| entry * factor)))
    }
}

/// A square matrix of any side, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicMatrix {
    side: usize,
    values: Vec<f64>,
}

impl DynamicMatrix {
    /// All zeros.
    pub fn zero(side: usize) -> Self {
        Self {
            side,
            values: vec![0.0; side * side],
        }
    }

    /// An entry.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.side + column]
    }

    /// An entry, to be changed.
    pub fn at_mut(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.values[row * self.side + column]
    }

    /// Its decomposition; `None` when the matrix is not positive definite. Its upper triangle is not looked at.
    pub fn cholesky(&self) -> Option<Cholesky> {
        let mut lower = self.values.clone();
        factor(&mut lower, self.side).then_some(Cholesky {
            side: self.side,
            lower,
        })
    }
}

/// A matrix L·Lᵀ, by the lower triangle L.
pub struct Cholesky {
    side: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// The x of `matrix · x = right`.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = right.to_vec();
        substitute(&self.lower, &mut x);
        x
    }

    /// The diagonal of the matrix's inverse.
    pub fn inverse_diagonal(&self) -> Vec<f64> {
        let entry = |k: usize| {
            let mut unit = vec![0.0; self.side];
            unit[k] = 1.0;
            self.solve(&unit)[k]
        };
        (0..self.side).map(entry).collect()
    }
}

/// Cholesky's decomposition in the place of a matrix's lower triangle; `false` when it is not positive definite.
#[inline(always)]
fn factor(matrix: &mut [f64], side: usize) -> bool {
    for i in 0..side {
        for j in 0..=i {
            let known = (0..j)
                .map(|k| matrix[i * side + k] * matrix[j * side + k])
                .sum::<f64>();
            let entry = matrix[i * side + j];
            let rest = entry - known;
            if i != j {
                matrix[i * side + j] = rest / matrix[j * side + j];
            } else if rest > entry * 1e-14 {
                matrix[i * side + i] = rest.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

/// Turns the right side of a system into its solution, by the triangle that `factor` left.
#[inline(always)]
fn substitute(lower: &[f64], x: &mut [f64]) {
    let side = x.len();
    for i in 0..side {
        let known = (0..i).map(|k| lower[i * side + k] * x[k]).sum::<f64>();
        x[i] = (x[i] - known) / lower[i * side + i];
    }
    for i in (0..side).rev() {
        let known = (i + 1..side)
            .map(|k| lower[k * side + i] * x[k])
            .sum::<f64>();
        x[i] = (x[i] - known) / lower[i * side + i];
    }
}

/// The scalar product of two vectors of one length.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// B·Bᵀ with B = [[2, 0, 0], [1, 3, 0], [-1, 2, 1]].
    const KNOWN: Matrix<3> = Matrix([[4.0, 2.0, -2.0], [2.0, 10.0, 5.0], [-2.0, 5.0, 6.0]]);
    const RIGHT: [f64; 3] = [2.0, 27.0, 26.0];

    fn dynamic(matrix: &Matrix<3>) -> DynamicMatrix {
        let mut same = DynamicMatrix::zero(3);
        for (i, row) in matrix.0.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                *same.at_mut(i, j) = *value;
            }
        }
        same
    }

    #[test]
    fn a_known_system_is_solved() {
        let x = KNOWN.solve(&RIGHT).unwrap();
        for (back, right) in (KNOWN * x).iter().zip(RIGHT) {
            assert!((back - right).abs() < 1e-12);
        }
        assert_eq!(dynamic(&KNOWN).cholesky().unwrap().solve(&RIGHT), x);
    }

    #[test]
    fn an_inverse_is_that_by_cofactors() {
        // The determinant is (2·3·1)² = 36.
        let cofactors = Matrix([
            [35.0, -22.0, 30.0],
            [-22.0, 20.0, -24.0],
            [30.0, -24.0, 36.0],
        ]);
        let inverse = KNOWN.inverse().unwrap();
        let diagonal = dynamic(&KNOWN).cholesky().unwrap().inverse_diagonal();
        for (i, (found, cofactors)) in inverse.0.iter().zip(cofactors.0).enumerate() {
            for (found, cofactor) in found.iter().zip(cofactors) {
                assert!((found - cofactor / 36.0).abs() < 1e-12);
            }
            assert_eq!(diagonal[i], found[i]);
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_not_solved() {
        let mut matrix = KNOWN;
        matrix.0[2][2] = 0.0;
        assert_eq!(matrix.solve(&RIGHT), None);
        assert_eq!(matrix.inverse(), None);
        assert!(dynamic(&matrix).cholesky().is_none());
        assert_eq!(Matrix([[f64::NAN]]).solve(&[1.0]), None);
    }

    #[test]
    fn sums_and_products_are_entry_by_entry_and_row_by_column() {
        let (a, b) = (
            Matrix([[1.0, 2.0], [3.0, 4.0]]),
            Matrix([[0.0, 1.0], [1.0, 0.0]]),
        );
        assert_eq!(a + b, Matrix([[1.0, 3.0], [4.0, 4.0]]));
        assert_eq!(a - b, Matrix([[1.0, 1.0], [2.0, 4.0]]));
        assert_eq!(a * b, Matrix([[2.0, 1.0], [4.0, 3.0]]));
        assert_eq!(a * 2.0, Matrix([[2.0, 4.0], [6.0, 8.0]]));
        assert_eq!(a * [1.0, -1.0], [-1.0, -1.0]);
        assert_eq!(a.transposed(), Matrix([[1.0, 3.0], [2.0, 4.0]]));
    }
}
