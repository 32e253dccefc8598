//! The signed-rank test of Wilcoxon for pairs.
//!
//! Source: Wilcoxon, "Individual comparisons by ranking methods", Biometrics Bulletin 1, 1945; equal pairs are left
//! out, as he does. Exact for up to [`EXACT_MAX`] pairs without ties, otherwise normal with corrections for ties and
//! continuity, as in scipy's `wilcoxon(correction=True)`.
use super::Level;
use statrs::distribution::{ContinuousCDF, Normal};

/// Most pairs for which all sums of ranks are counted.
const EXACT_MAX: usize = 50;

/// What the test says of first minus second.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Paired {
    /// Pairs in which the first is less.
    pub less: usize,
    /// Pairs in which the second is less.
    pub more: usize,
    /// Equal pairs.
    pub equal: usize,
    /// Two-sided probability of such a difference by chance; 1 when all pairs are equal.
    pub p: f64,
}

impl Paired {
    /// True when the first is less, and not by chance.
    #[must_use]
    pub fn is_less(&self) -> bool {
        self.p < super::SIGNIFICANT && self.less > self.more
    }
}

/// Compares two samples pair by pair; a longer one's rest is not looked at, and pairs with a NaN are left out.
#[must_use]
pub fn wilcoxon(first: &[f64], second: &[f64]) -> Paired {
    let signed: Vec<f64> = first.iter().zip(second).map(|(a, b)| difference(*a, *b)).collect();
    let less = signed.iter().filter(|d| **d < 0.0).count();
    let more = signed.iter().filter(|d| **d > 0.0).count();
    let equal = signed.iter().filter(|d| **d == 0.0).count();
    let mut unequal: Vec<f64> = signed.into_iter().filter(|d| *d != 0.0 && !d.is_nan()).collect();
    unequal.sort_by(|a, b| a.abs().total_cmp(&b.abs()));

    let (ranks, ties) = ranks(&unequal);
    let positive: f64 = unequal.iter().zip(&ranks).filter(|(d, _)| **d > 0.0).map(|(_, r)| r).sum();
    let n = unequal.len();
    let p = match n {
        0 => 1.0,
        _ if n <= EXACT_MAX && ties == 0.0 => exact(n, positive),
        _ => normal(n, positive, ties),
    };
    Paired { less, more, equal, p }
}

/// Equal values differ by nothing, infinite ones too.
fn difference(a: f64, b: f64) -> f64 {
    if a.is_infinite() && a.total_cmp(&b).is_eq() { 0.0 } else { a - b }
}

/// Ranks of sorted magnitudes, the mean rank for equal ones; and the sum of t³ - t over groups of t equal ones.
fn ranks(sorted: &[f64]) -> (Vec<f64>, f64) {
    let (mut ranks, mut ties) = (Vec::with_capacity(sorted.len()), 0.0);
    for group in sorted.chunk_by(|a, b| a.abs().total_cmp(&b.abs()).is_eq()) {
        let (before, t) = (ranks.len() as f64, group.len() as f64);
        ranks.extend(std::iter::repeat_n(before + 0.5 * (t + 1.0), group.len()));
        ties += t * t * t - t;
    }
    (ranks, ties)
}

/// Share of all 2^n signs by the sum of their positive ranks.
fn shares(n: usize) -> Vec<f64> {
    let all = n * (n + 1) / 2;
    let mut shares = vec![0.0; all + 1];
    shares[0] = 1.0;
    for rank in 1..=n {
        for sum in (0..=all).rev() {
            let with = if sum >= rank { shares[sum - rank] } else { 0.0 };
            shares[sum] = 0.5 * (shares[sum] + with);
        }
    }
    shares
}

/// Share of all 2^n signs whose sum of positive ranks is as far out as this one.
fn exact(n: usize, positive: f64) -> f64 {
    let outer = positive.min((n * (n + 1) / 2) as f64 - positive);
    let tail: f64 =
        shares(n).iter().enumerate().filter(|(sum, _)| *sum as f64 <= outer).map(|(_, s)| s).sum();
    (2.0 * tail).min(1.0)
}

/// The largest sum of ranks that is still outside at a level: as many of the means of pairs lie beyond either end of the
/// interval. `None` where even the sum 0 is not: with five pairs its two-sided probability is 0.0625.
pub(super) fn ranks_outside(n: usize, level: Level) -> Option<usize> {
    if n <= EXACT_MAX {
        let mut tail = 0.0;
        let outside = shares(n).into_iter().take_while(|share| {
            tail += share;
            tail <= level.tail()
        });
        return outside.count().checked_sub(1);
    }
    let n = n as f64;
    let mean = n * (n + 1.0) / 4.0;
    let outer = mean - 0.5 - level.z() * (n * (n + 1.0) * (2.0 * n + 1.0) / 24.0).sqrt();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to the number of means"
    )]
    let outer = outer.floor().max(0.0) as usize;
    Some(outer)
}

fn normal(n: usize, positive: f64, ties: f64) -> f64 {
    let n = n as f64;
    let mean = n * (n + 1.0) / 4.0;
    let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties / 48.0;
    let away = (positive - mean).abs();
    let z = (away - 0.5).max(0.0) / variance.sqrt();
    (2.0 * Normal::standard().sf(z)).min(1.0)
}
