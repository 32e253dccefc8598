//! Integrals of smooth functions.

/// Places in -1..1 and weights of Gauss and Legendre's rule of five points: exact up to degree nine.
const GAUSS: [[f64; 2]; 5] = [
    [-0.906_179_845_938_664, 0.236_926_885_056_189_08],
    [-0.538_469_310_105_683_1, 0.478_628_670_499_366_47],
    [0.0, 0.568_888_888_888_888_9],
    [0.538_469_310_105_683_1, 0.478_628_670_499_366_47],
    [0.906_179_845_938_664, 0.236_926_885_056_189_08],
];

/// The integral of `f` from `a` to `b`.
#[must_use]
pub fn gauss(a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (half, middle) = (0.5 * (b - a), 0.5 * (a + b));
    GAUSS.iter().map(|[x, w]| half * w * f(middle + half * x)).sum()
}

#[cfg(test)]
mod tests {
    use super::gauss;

    #[test]
    fn gauss_is_exact_up_to_degree_nine_and_not_beyond() {
        let power = |n: i32| {
            gauss(-0.5, 2.0, |x| x.powi(n))
                - (2.0_f64.powi(n + 1) - (-0.5_f64).powi(n + 1)) / f64::from(n + 1)
        };
        for n in 0..10 {
            assert!(power(n).abs() < 1e-11, "x^{n}: off by {:e}", power(n));
        }
        assert!(power(10).abs() > 1e-3, "x^10: off by {:e} only", power(10));
    }
}
