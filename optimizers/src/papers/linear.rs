//! Linear equations of a size that only the run knows; the workspace's nalgebra is built without an allocator, so that
//! the streamer's mathematics cannot allocate.

/// Solves a square system for several right-hand sides, each a column of `given`; `None` when it has no single solution
/// in numbers of this precision. Gauss's elimination with the largest pivot of each column.
pub(super) fn solve(mut matrix: Vec<Vec<f64>>, mut given: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let size = matrix.len();
    for column in 0..size {
        let largest = |a: &usize, b: &usize| matrix[*a][column].abs().total_cmp(&matrix[*b][column].abs());
        let pivot = (column..size).max_by(largest)?;
        matrix.swap(column, pivot);
        given.swap(column, pivot);
        let head = matrix[column][column];
        if !(head.is_finite() && head.abs() > f64::MIN_POSITIVE) {
            return None;
        }
        let (above, below) = matrix.split_at_mut(column + 1);
        let (above_given, below_given) = given.split_at_mut(column + 1);
        for (row, right) in below.iter_mut().zip(below_given) {
            let factor = row[column] / head;
            let (pivot_row, pivot_right) = (&above[column], &above_given[column]);
            row.iter_mut().zip(pivot_row).skip(column).for_each(|(x, p)| *x -= factor * p);
            right.iter_mut().zip(pivot_right).for_each(|(x, p)| *x -= factor * p);
        }
    }
    for row in (0..size).rev() {
        let (upper, solved) = given.split_at_mut(row + 1);
        for (side, value) in upper[row].iter_mut().enumerate() {
            let known: f64 = matrix[row][row + 1..].iter().zip(&*solved).map(|(m, s)| m * s[side]).sum();
            *value = (*value - known) / matrix[row][row];
        }
    }
    given.iter().flatten().all(|x| x.is_finite()).then_some(given)
}

#[cfg(test)]
mod tests {
    use super::solve;

    #[test]
    fn solve_finds_what_was_multiplied_and_refuses_what_is_singular() {
        // The first pivot is zero: rows have to change places.
        let matrix = vec![vec![0.0, 2.0, 1.0], vec![1.0, -1.0, 0.0], vec![3.0, 0.0, -2.0]];
        let wanted = [[1.0, -2.0], [0.5, 4.0], [-3.0, 0.25]];
        let times =
            |row: &Vec<f64>, side: usize| row.iter().zip(&wanted).map(|(m, w)| m * w[side]).sum::<f64>();
        let given = matrix.iter().map(|row| vec![times(row, 0), times(row, 1)]).collect();
        let solved = solve(matrix, given).expect("regular");
        for (row, wanted) in solved.iter().zip(&wanted) {
            assert!(row.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-14), "{solved:?}");
        }
        assert_eq!(solve(vec![vec![1.0, 2.0], vec![2.0, 4.0]], vec![vec![1.0], vec![1.0]]), None);
        assert_eq!(solve(vec![vec![f64::NAN]], vec![vec![1.0]]), None);
    }
}
