//! Small matrices and systems of linear equations.

/// Rows of a covariance of a pose.
pub(super) type Matrix6 = [[f64; 6]; 6];

pub(super) fn sum(a: &Matrix6, b: &Matrix6) -> Matrix6 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}

pub(super) fn times(matrix: &Matrix6, factor: f64) -> Matrix6 {
    matrix.map(|row| row.map(|entry| entry * factor))
}

pub(super) fn transposed(matrix: &Matrix6) -> Matrix6 {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[j][i]))
}

pub(super) fn product(a: &Matrix6, b: &Matrix6) -> Matrix6 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..6).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Adds one equation `row · x = value` to the normal equations.
pub(super) fn accumulate<const N: usize>(
    normal: &mut [[f64; N]; N],
    right: &mut [f64; N],
    row: &[f64; N],
    value: f64,
) {
    for i in 0..N {
        for j in 0..N {
            normal[i][j] += row[i] * row[j];
        }
        right[i] += row[i] * value;
    }
}

/// Solves by Cholesky's decomposition; `None` when the matrix is not positive definite.
pub(super) fn solve_positive_definite<const N: usize>(
    matrix: &[[f64; N]; N],
    right: &[f64; N],
) -> Option<[f64; N]> {
    let mut lower = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let known = (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            let rest = matrix[i][j] - known;
            if i != j {
                lower[i][j] = rest / lower[j][j];
            } else if rest > matrix[i][i] * 1e-14 {
                lower[i][i] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    let mut solution = *right;
    for i in 0..N {
        let known = (0..i).map(|k| lower[i][k] * solution[k]).sum::<f64>();
        solution[i] = (solution[i] - known) / lower[i][i];
    }
    for i in (0..N).rev() {
        let known = (i + 1..N).map(|k| lower[k][i] * solution[k]).sum::<f64>();
        solution[i] = (solution[i] - known) / lower[i][i];
    }
    Some(solution)
}

/// The inverse of a positive definite matrix.
pub(super) fn inverse<const N: usize>(matrix: &[[f64; N]; N]) -> Option<[[f64; N]; N]> {
    let mut columns = [[0.0; N]; N];
    for (k, column) in columns.iter_mut().enumerate() {
        let mut unit = [0.0; N];
        unit[k] = 1.0;
        *column = solve_positive_definite(matrix, &unit)?;
    }
    // Symmetric, so its columns are its rows.
    Some(columns)
}
