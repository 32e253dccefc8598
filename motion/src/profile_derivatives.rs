//! High derivatives of the profile phi(s) = 1 - (1 - s^4)^n, and bounds of them.
//!
//! With u = 1 - s^4, the k-th derivative of u^n is the sum over j of (-1)^j n!/(n-j)! b(k, j) s^(4j-k) u^(n-j), where
//! b(k+1, j) = (4j - k) b(k, j) + 4 b(k, j-1) and b(0, 0) = 1. No b is negative, and b(k, j) is 0 where 4j is below k.
use crate::stroke::power;

/// Highest derivative that is evaluated; the next one is bounded.
pub(crate) const ORDER: usize = 8;
/// The values 0 to [`ORDER`] of something.
pub(crate) const ORDERS: usize = ORDER + 1;

/// b(k, j) for k and j up to [`ORDER`] + 1.
#[rustfmt::skip]
const ROWS: [[f64; ORDER + 2]; ORDER + 2] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 12.0, 16.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 24.0, 144.0, 64.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 24.0, 816.0, 1_152.0, 256.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 3_360.0, 12_480.0, 7_680.0, 1_024.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 10_080.0, 100_800.0, 134_400.0, 46_080.0, 4_096.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 20_160.0, 645_120.0, 1_747_200.0, 1_182_720.0, 258_048.0, 16_384.0, 0.0, 0.0],
    [0.0, 0.0, 20_160.0, 3_306_240.0, 18_305_280.0, 22_364_160.0, 9_117_696.0, 1_376_256.0, 65_536.0, 0.0],
    [0.0, 0.0, 0.0, 13_305_600.0, 159_667_200.0, 341_591_040.0, 235_339_776.0, 63_995_904.0, 7_077_888.0, 262_144.0],
];

/// b(k, j) by j from 1: for k from 1 to 4, and from 5 to 8.
const COLUMNS: [[[f64; 4]; 2]; ORDER] = columns();

const fn columns() -> [[[f64; 4]; 2]; ORDER] {
    let mut columns = [[[0.0; 4]; 2]; ORDER];
    let mut j = 0;
    while j < ORDER {
        let mut k = 0;
        while k < ORDER {
            columns[j][k / 4][k % 4] = ROWS[k + 1][j + 1];
            k += 1;
        }
        j += 1;
    }
    columns
}

/// phi and its first [`ORDER`] derivatives by s, for s in [0, 1] and n of at least 4.
pub(crate) fn derivatives(n: u32, s: f64) -> [f64; ORDERS] {
    let (m, s2) = (f64::from(n), s * s);
    let x = s2 * s2;
    let u = 1.0 - x;
    let highest = n.min(8);
    // A term is -(-1)^j n!/(n-j)! u^(n-j) x^(j-1), and over x for the derivatives above the fourth; times a power of s in the end.
    let mut powers = [0.0; ORDERS];
    let mut power_of_u = power(u, n - highest);
    for slot in powers.iter_mut().take(highest as usize + 1).rev() {
        *slot = power_of_u;
        power_of_u *= u;
    }
    let (mut low_sums, mut high_sums) = ([0.0; 4], [0.0; 4]);
    let (mut falling, mut power_of_x, mut j) = (-1.0, 1.0, 0.0);
    for ([low_column, high_column], power_of_u) in COLUMNS.iter().zip(powers.iter().skip(1)) {
        falling *= j - m;
        j += 1.0;
        let high = falling * power_of_u * power_of_x;
        // No derivative above the fourth has a first term.
        let low = if j < 1.5 { high } else { high * x };
        power_of_x = if j < 1.5 { 1.0 } else { power_of_x * x };
        for (sum, b) in low_sums.iter_mut().zip(low_column) {
            *sum += b * low;
        }
        for (sum, b) in high_sums.iter_mut().zip(high_column) {
            *sum += b * high;
        }
    }
    let powers_of_s = [s2 * s, s2, s, 1.0];
    let mut values = [1.0 - powers[0]; ORDERS];
    let sums = low_sums.iter().chain(&high_sums).zip(powers_of_s.iter().chain(&powers_of_s));
    for (value, (sum, power_of_s)) in values.iter_mut().skip(1).zip(sums) {
        *value = sum * power_of_s;
    }
    values
}

/// Bounds of |phi^(k)| on [0, 1] for k from 0 to [`ORDER`] + 1: the sums of the peaks of their terms.
///
/// s^a (1 - s^4)^b peaks at s^4 = a/(a + 4b).
pub(crate) fn bounds(n: u32) -> [f64; ORDERS + 1] {
    let n = f64::from(n);
    let mut bounds = [1.0; ORDERS + 1];
    for ((order, bound), row) in (0_u32..).zip(&mut bounds).zip(&ROWS).skip(1) {
        let (mut sum, mut falling, mut j) = (0.0, 1.0, 0.0);
        for coefficient in row.iter().skip(1) {
            falling *= n - j;
            j += 1.0;
            let (a, b) = (4.0 * j - f64::from(order), n - j);
            if *coefficient == 0.0 || falling <= 0.0 {
                continue;
            }
            let x = a / (a + 4.0 * b);
            sum += coefficient * falling * libm::pow(x, 0.25 * a) * libm::pow(1.0 - x, b);
        }
        *bound = sum;
    }
    bounds
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "small whole numbers")]
mod tests {
    use super::*;
    use crate::stroke::{N_MAX, N_MIN, Phi};

    #[test]
    fn rows_follow_their_recurrence() {
        for (k, pair) in (0_u32..).zip(ROWS.windows(2)) {
            for j in 1..ORDER + 2 {
                let factor = 4.0 * f64::from(u32::try_from(j).unwrap()) - f64::from(k);
                assert_eq!(pair[1][j], factor * pair[0][j] + 4.0 * pair[0][j - 1], "b({}, {j})", k + 1);
            }
        }
    }

    /// Goal: each derivative is that of the one below it. Method: central differences beside the exact values, for every n and over the whole
    /// profile; the first three agree with the sampler's.
    #[test]
    fn derivatives_are_those_of_the_profile_and_keep_their_bounds() {
        let step = 1e-5;
        for n in N_MIN..=N_MAX {
            let bounds = bounds(n);
            for place in 0..=400 {
                let s = f64::from(place) / 400.0;
                let values = derivatives(n, s);
                let phi = Phi::at(n, s);
                for (mine, sampled) in values.iter().zip([phi.value, phi.d1, phi.d2, phi.d3]) {
                    assert!((mine - sampled).abs() <= 1e-12 * (1.0 + sampled.abs()), "n {n}, s {s}");
                }
                for (k, value) in values.iter().enumerate() {
                    assert!(value.abs() <= bounds[k] * (1.0 + 1e-12), "n {n}, s {s}, k {k}: {value}");
                }
                if place == 0 || place == 400 {
                    continue;
                }
                let [before, after] = [s - step, s + step].map(|s| derivatives(n, s));
                for k in 0..ORDER {
                    let rate = (after[k] - before[k]) / (2.0 * step);
                    // What the third derivative above hides, and the rounding of the difference.
                    let room = bounds.get(k + 3).map_or(0.02 * bounds[k + 1], |b| b * step * step)
                        + 1e-9 * bounds[k];
                    assert!(
                        (rate - values[k + 1]).abs() <= room,
                        "n {n}, s {s}, k {k}: {rate}, {}",
                        values[k + 1]
                    );
                }
            }
        }
    }
}
