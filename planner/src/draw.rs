//! Numbered random choices.
//!
//! `ChaCha8` words are turned into numbers here and not by a library's distributions, whose output may change with
//! its version: a seed in a bug report stays good.
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of random choices.
#[derive(Clone, Debug)]
pub struct Draw(ChaCha8Rng);

impl Draw {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draw_of_one_seed_repeats_and_other_streams_differ() {
        let take = |seed, stream| {
            let mut draw = Draw::new(seed, stream);
            std::array::from_fn::<u64, 8, _>(|_| draw.unit().to_bits())
        };
        assert_eq!(take(7, 0), take(7, 0));
        assert_ne!(take(7, 0), take(7, 1));
        assert_ne!(take(7, 0), take(8, 0));
    }

    #[test]
    fn draw_stays_in_its_range() {
        for seed in 0..1_000 {
            let mut draw = Draw::new(seed, 3);
            let (x, i) = (draw.within(-2.0, 3.0), draw.index(5));
            assert!((-2.0..3.0).contains(&x) && i < 5, "seed {seed}: {x}, {i}");
        }
    }
}
