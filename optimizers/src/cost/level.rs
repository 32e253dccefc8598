//! Which vector instructions the fast cost runs on, chosen at run time.
use pulp::{Arch, Simd, WithSimd};

/// A set of instructions that this machine has.
///
/// The default code generation of x86-64 has neither wide vectors nor fused multiplication: there the same source
/// would be slower than plain arithmetic. So the code exists once a level, and the level is chosen by asking the
/// processor.
#[derive(Clone, Copy, Debug)]
pub struct Level(Arch);

impl Level {
    /// The best level of this machine. The processor is asked once.
    #[must_use]
    pub fn best() -> Self {
        Self(Arch::new())
    }

    /// One configuration at a time, on any machine.
    #[must_use]
    pub fn scalar() -> Self {
        Self(Arch::Scalar)
    }

    /// Every level of this machine, the best one last.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let mut levels = vec![Self::scalar()];
        #[cfg(target_arch = "x86_64")]
        levels.extend(pulp::x86::V3::try_new().map(|v3| Self(Arch::V3(v3))));
        let best = Self::best();
        if levels.iter().all(|level| level.lanes() != best.lanes()) {
            levels.push(best);
        }
        levels
    }

    /// How many configurations at once.
    #[must_use]
    pub fn lanes(self) -> usize {
        self.run(CountLanes)
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.lanes() {
            1 => "scalar",
            4 => "4 lanes (NEON)",
            8 => "8 lanes (AVX2, FMA)",
            16 => "16 lanes (AVX-512)",
            _ => "vector",
        }
    }

    /// Runs work on this level.
    #[inline]
    pub(super) fn run<W: WithSimd>(self, budget: W) -> W::Output {
        self.0.dispatch(budget)
    }
}

struct CountLanes;

impl WithSimd for CountLanes {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> usize {
        S::F32_LANES
    }
}
