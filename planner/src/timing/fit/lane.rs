//! Numbers of a fit: one, or one a joint.
//!
//! The joints of an arm are fitted side by side, each in a lane of one vector. Everything here and in the loops above it is inlined
//! into the function that the instructions are switched on for ([`vectorized`]): loops, since closures in iterators become functions
//! of their own. Products and sums stay apart, so every machine computes the same bits.
use pulp::{Arch, Simd, WithSimd};
use taustream_motion::{JointArray, MAX_JOINTS, USUAL_JOINTS, joint_array};

/// A loop that is compiled for each set of instructions. Its `run` must be `inline(always)`, like all that it calls.
pub(in crate::timing) trait Vectorized {
    /// What comes out.
    type Output;

    /// Performs it.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Performs something with the widest instructions of this machine.
pub(in crate::timing) fn vectorized<V: Vectorized>(work: V) -> V::Output {
    Arch::new().dispatch(Work(work))
}

struct Work<V>(V);

impl<V: Vectorized> WithSimd for Work<V> {
    type Output = V::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> V::Output {
        self.0.run(simd)
    }
}

/// A number, or several side by side.
pub trait Lane: Copy {
    /// Nothing.
    const ZERO: Self;

    /// The sum of each two.
    #[must_use]
    fn plus<S: Simd>(self, simd: S, other: Self) -> Self;

    /// The difference of each two.
    #[must_use]
    fn minus<S: Simd>(self, simd: S, other: Self) -> Self;

    /// The product of each two.
    #[must_use]
    fn by<S: Simd>(self, simd: S, other: Self) -> Self;

    /// The product with a number that is the same for all.
    #[must_use]
    fn times<S: Simd>(self, simd: S, factor: f64) -> Self;

    /// The lesser of each two.
    #[must_use]
    fn lesser<S: Simd>(self, simd: S, other: Self) -> Self;

    /// The greater of each two.
    #[must_use]
    fn greater<S: Simd>(self, simd: S, other: Self) -> Self;

    /// A function of each.
    #[must_use]
    fn map(self, of: impl Fn(f64) -> f64) -> Self;

    /// The greatest of all.
    #[must_use]
    fn greatest(self) -> f64;

    /// Whether all are positive numbers.
    #[must_use]
    fn are_positive(self) -> bool;
}

impl Lane for f64 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn plus<S: Simd>(self, _: S, other: Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn minus<S: Simd>(self, _: S, other: Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn by<S: Simd>(self, _: S, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn times<S: Simd>(self, _: S, factor: f64) -> Self {
        self * factor
    }

    #[inline(always)]
    fn lesser<S: Simd>(self, _: S, other: Self) -> Self {
        self.min(other)
    }

    #[inline(always)]
    fn greater<S: Simd>(self, _: S, other: Self) -> Self {
        self.max(other)
    }

    #[inline(always)]
    fn map(self, of: impl Fn(f64) -> f64) -> Self {
        of(self)
    }

    #[inline(always)]
    fn greatest(self) -> f64 {
        self
    }

    #[inline(always)]
    fn are_positive(self) -> bool {
        self > 0.0 && self.is_finite()
    }
}

/// One number a joint, for arms of at most so many joints: [`USUAL_JOINTS`] or [`MAX_JOINTS`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct PerJoint<const JOINTS: usize>(pub [f64; JOINTS]);

impl<const JOINTS: usize> PerJoint<JOINTS> {
    /// The same for every joint.
    #[must_use]
    pub fn all(value: f64) -> Self {
        Self([value; JOINTS])
    }

    /// Values of an arm that has no more joints.
    #[must_use]
    #[inline(always)]
    pub fn of(values: &JointArray) -> Self {
        let mut some = [0.0; JOINTS];
        for (some, value) in some.iter_mut().zip(values) {
            *some = *value;
        }
        Self(some)
    }

    /// With zeros for the joints that the arm does not have.
    #[must_use]
    pub fn joints(self) -> JointArray {
        joint_array(self.0)
    }

    /// The sum over the joints, by halves.
    #[must_use]
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let mut sums = self.0;
        let mut half = JOINTS / 2;
        while half > 0 {
            for i in 0..half {
                sums[i] += sums[i + half];
            }
            half /= 2;
        }
        sums[0]
    }
}

const _: () = assert!(
    USUAL_JOINTS.is_multiple_of(8) && MAX_JOINTS.is_power_of_two(),
    "sums go by halves, and vectors hold no rest"
);

/// An operation on each two lanes.
macro_rules! lanewise {
    ($name:ident, $operation:ident) => {
        #[inline(always)]
        fn $name<S: Simd>(mut self, simd: S, other: Self) -> Self {
            let (all, _) = S::as_mut_simd_f64s(&mut self.0);
            let (others, _) = S::as_simd_f64s(&other.0);
            for (one, other) in all.iter_mut().zip(others) {
                *one = simd.$operation(*one, *other);
            }
            self
        }
    };
}

impl<const JOINTS: usize> Lane for PerJoint<JOINTS> {
    const ZERO: Self = Self([0.0; JOINTS]);

    lanewise!(plus, add_f64s);
    lanewise!(minus, sub_f64s);
    lanewise!(by, mul_f64s);
    lanewise!(lesser, min_f64s);
    lanewise!(greater, max_f64s);

    #[inline(always)]
    fn times<S: Simd>(mut self, simd: S, factor: f64) -> Self {
        let (all, _) = S::as_mut_simd_f64s(&mut self.0);
        let factor = simd.splat_f64s(factor);
        for one in all {
            *one = simd.mul_f64s(*one, factor);
        }
        self
    }

    #[inline(always)]
    fn map(mut self, of: impl Fn(f64) -> f64) -> Self {
        for one in &mut self.0 {
            *one = of(*one);
        }
        self
    }

    #[inline(always)]
    fn greatest(self) -> f64 {
        self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    #[inline(always)]
    fn are_positive(self) -> bool {
        self.0.iter().all(|one| one.are_positive())
    }
}
