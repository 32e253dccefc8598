//! Numbered random choices.
//!
//! `ChaCha8` words are turned into numbers here and not by a library's distributions, whose output may change with
//! its version: a seed in a bug report stays good.
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of random choices.
#[derive(Clone, Debug)]
pub struct SeededRng(ChaCha8Rng);

impl SeededRng {
    /// The stream of a seed; different `stream` numbers of one seed are independent.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self(rng)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        // 53 bits: every step of the result is one unit in the last place of numbers near 1.
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0..count; 0 when there is nothing to choose from.
    pub fn index(&mut self, count: usize) -> usize {
        // The modulo's bias is below 2^-40 for every count that fits in memory here.
        usize::try_from(self.0.next_u64() % (count.max(1) as u64)).unwrap_or(0)
    }

    /// Uniform in 0..count without the given ones, which are sorted; 0 when nothing is left.
    pub fn index_except(&mut self, count: usize, taken: &[usize]) -> usize {
        let free = self.index(count.saturating_sub(taken.len()));
        // Every taken number that is not above moves the answer up by one.
        let moved = taken.iter().fold(free, |i, t| if *t <= i { i + 1 } else { i });
        if moved < count { moved } else { 0 }
    }

    /// Normal with mean 0 and deviation 1: the first of the two numbers of Box and Muller's method.
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.unit(), self.unit());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rng_of_one_seed_repeats_and_other_streams_differ() {
        let take = |seed, stream| {
            let mut rng = SeededRng::new(seed, stream);
            std::array::from_fn::<u64, 8, _>(|_| rng.unit().to_bits())
        };
        assert_eq!(take(7, 0), take(7, 0));
        assert_ne!(take(7, 0), take(7, 1));
        assert_ne!(take(7, 0), take(8, 0));
    }

    #[test]
    fn random_index_without_the_excluded_ones_reaches_all_others_equally_often() {
        let mut rng = SeededRng::new(1, 0);
        let mut times = [0_u32; 6];
        for _ in 0..30_000 {
            times[rng.index_except(6, &[0, 3, 4])] += 1;
        }
        assert_eq!([times[0], times[3], times[4]], [0; 3], "taken ones were drawn: {times:?}");
        // 10000 each, deviation 82.
        assert!([1, 2, 5].iter().all(|i: &usize| times[*i].abs_diff(10_000) < 500), "{times:?}");
        assert_eq!((rng.index_except(2, &[0, 1]), rng.index_except(0, &[])), (0, 0));
    }

    #[test]
    fn normal_random_numbers_have_the_moments_of_the_normal_distribution() {
        let mut rng = SeededRng::new(2, 0);
        let n = 100_000;
        let sums = (0..n).fold([0.0; 4], |s, _| {
            let x = rng.normal();
            [s[0] + x, s[1] + x * x, s[2] + x * x * x, s[3] + x * x * x * x]
        });
        let moments = sums.map(|s| s / f64::from(n));
        let theirs = [0.0, 1.0, 0.0, 3.0];
        // Deviations of the means: 0.003, 0.0045, 0.012, 0.031.
        let bands = [0.015, 0.02, 0.06, 0.15];
        for (i, (m, t)) in moments.iter().zip(theirs).enumerate() {
            assert!((m - t).abs() < bands[i], "moment {}: {m}, not {t}", i + 1);
        }
    }

    #[test]
    fn random_number_stays_in_its_range() {
        for seed in 0..1_000 {
            let mut rng = SeededRng::new(seed, 3);
            let (x, i) = (rng.within(-2.0, 3.0), rng.index(5));
            assert!((-2.0..3.0).contains(&x) && i < 5, "seed {seed}: {x}, {i}");
        }
    }
}
