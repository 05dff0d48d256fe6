//! Symmetric positive definite matrices of any size.

/// A square matrix, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Square {
    /// Number of rows, and of columns.
    pub side: usize,
    values: Vec<f64>,
}

/// The lower triangle L of a matrix L·Lᵀ.
pub struct Cholesky(Square);

impl Square {
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

    /// The same, to be changed.
    pub fn at_mut(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.values[row * self.side + column]
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.side..(row + 1) * self.side]
    }

    /// `None` when the matrix is not positive definite. Its upper triangle is not looked at.
    pub fn cholesky(&self) -> Option<Cholesky> {
        let mut lower = Self::zero(self.side);
        for i in 0..self.side {
            for j in 0..=i {
                let known: f64 = (lower.row(i)[..j].iter().zip(&lower.row(j)[..j]))
                    .map(|(a, b)| a * b)
                    .sum();
                let rest = self.at(i, j) - known;
                if i != j {
                    *lower.at_mut(i, j) = rest / lower.at(j, j);
                } else if rest > self.at(i, i) * 1e-14 {
                    *lower.at_mut(i, i) = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(Cholesky(lower))
    }
}

impl Cholesky {
    /// The x of `matrix · x = right`.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let lower = &self.0;
        let mut x = right.to_vec();
        for i in 0..x.len() {
            let known: f64 = (lower.row(i)[..i].iter().zip(&x[..i]))
                .map(|(a, b)| a * b)
                .sum();
            x[i] = (x[i] - known) / lower.at(i, i);
        }
        for i in (0..x.len()).rev() {
            let known: f64 = (i + 1..x.len()).map(|k| lower.at(k, i) * x[k]).sum();
            x[i] = (x[i] - known) / lower.at(i, i);
        }
        x
    }

    /// The diagonal of the matrix's inverse.
    pub fn inverse_diagonal(&self) -> Vec<f64> {
        let side = self.0.side;
        let unit = |k: usize| {
            (0..side)
                .map(|i| f64::from(u8::from(i == k)))
                .collect::<Vec<_>>()
        };
        (0..side).map(|k| self.solve(&unit(k))[k]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_system_is_solved() {
        // B·Bᵀ with B = [[2, 0, 0], [1, 3, 0], [-1, 2, 1]].
        let rows = [[4.0, 2.0, -2.0], [2.0, 10.0, 5.0], [-2.0, 5.0, 6.0]];
        let mut matrix = Square::zero(3);
        for (i, row) in rows.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                *matrix.at_mut(i, j) = *value;
            }
        }
        let cholesky = matrix.cholesky().unwrap();
        let x = cholesky.solve(&[2.0, 27.0, 26.0]);
        let back: Vec<f64> = rows
            .iter()
            .map(|row| row.iter().zip(&x).map(|(a, b)| a * b).sum())
            .collect();
        for (back, right) in back.iter().zip([2.0, 27.0, 26.0]) {
            assert!((back - right).abs() < 1e-12);
        }
        // The determinant is (2·3·1)² = 36; cofactors of the diagonal are 35, 20 and 36.
        for (found, cofactor) in cholesky.inverse_diagonal().iter().zip([35.0, 20.0, 36.0]) {
            assert!((found - cofactor / 36.0).abs() < 1e-12);
        }
        *matrix.at_mut(2, 2) = 0.0;
        assert!(matrix.cholesky().is_none());
    }
}
