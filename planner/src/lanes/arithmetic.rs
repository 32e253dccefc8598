//! Arithmetic of f32 lanes: the few operations that the kernel needs.
//!
//! Everything here must be inlined into the function that the instructions are switched on for, or each becomes a call.
use pulp::Simd;

/// One f32 a lane.
pub(super) type Vector<S> = <S as Simd>::f32s;
/// A point or a direction a lane.
pub(super) type Vector3<S> = [Vector<S>; 3];

/// sin(pi r) / r for r in [-1/2, 1/2] as a polynomial in r^2, by Remez' algorithm: the error of the sine is below 3.4e-9.
const SIN: [f32; 5] = [3.141_592_5, -5.167_707, 2.550_031_4, -0.598_045_2, 0.077_220_13];
/// (cos(pi r) - 1) / r^2 likewise: the error of the cosine is below 2.5e-10.
const COS: [f32; 5] = [-4.934_802, 4.058_709_6, -1.335_216, 0.234_953_93, -0.024_420_7];
/// Adding it moves a number's whole part into the last bits: 1.5 * 2^23.
const WHOLE: f32 = 12_582_912.0;

/// The operations of one set of instructions.
#[derive(Clone, Copy)]
pub(super) struct Ops<S>(pub(super) S);

impl<S: Simd> Ops<S> {
    #[inline(always)]
    pub(super) fn all(self, value: f32) -> Vector<S> {
        self.0.splat_f32s(value)
    }

    #[inline(always)]
    pub(super) fn all3(self, value: [f32; 3]) -> Vector3<S> {
        [self.all(value[0]), self.all(value[1]), self.all(value[2])]
    }

    #[inline(always)]
    pub(super) fn sub3(self, a: Vector3<S>, b: Vector3<S>) -> Vector3<S> {
        [self.0.sub_f32s(a[0], b[0]), self.0.sub_f32s(a[1], b[1]), self.0.sub_f32s(a[2], b[2])]
    }

    /// a b + c.
    #[inline(always)]
    pub(super) fn mul_add(self, a: Vector<S>, b: Vector<S>, c: Vector<S>) -> Vector<S> {
        self.0.mul_add_e_f32s(a, b, c)
    }

    /// c - a b.
    #[inline(always)]
    pub(super) fn sub_mul(self, a: Vector<S>, b: Vector<S>, c: Vector<S>) -> Vector<S> {
        self.0.negate_mul_add_e_f32s(a, b, c)
    }

    /// The magnitude, without a mask: pulp's is a call where there are 16 lanes.
    #[inline(always)]
    pub(super) fn abs(self, a: Vector<S>) -> Vector<S> {
        self.max(a, self.0.sub_f32s(self.all(0.0), a))
    }

    #[inline(always)]
    pub(super) fn min(self, a: Vector<S>, b: Vector<S>) -> Vector<S> {
        self.0.min_f32s(a, b)
    }

    #[inline(always)]
    pub(super) fn max(self, a: Vector<S>, b: Vector<S>) -> Vector<S> {
        self.0.max_f32s(a, b)
    }

    #[inline(always)]
    pub(super) fn dot(self, a: Vector3<S>, b: Vector3<S>) -> Vector<S> {
        self.mul_add(a[2], b[2], self.mul_add(a[1], b[1], self.0.mul_f32s(a[0], b[0])))
    }

    #[inline(always)]
    pub(super) fn length(self, a: Vector3<S>) -> Vector<S> {
        self.0.sqrt_f32s(self.dot(a, a))
    }

    /// at + columns * by, for constants `by`.
    #[inline(always)]
    pub(super) fn moved(self, at: Vector3<S>, columns: &[Vector3<S>; 3], by: [f32; 3]) -> Vector3<S> {
        self.along(self.along(self.along(at, columns[0], by[0]), columns[1], by[1]), columns[2], by[2])
    }

    /// at + direction * by.
    #[inline(always)]
    pub(super) fn along(self, at: Vector3<S>, direction: Vector3<S>, by: f32) -> Vector3<S> {
        // Every other entry of most chains.
        if by.to_bits() == 0 {
            return at;
        }
        let by = self.all(by);
        [
            self.mul_add(direction[0], by, at[0]),
            self.mul_add(direction[1], by, at[1]),
            self.mul_add(direction[2], by, at[2]),
        ]
    }

    #[inline(always)]
    fn horner(self, c: [f32; 5], z: Vector<S>) -> Vector<S> {
        let high = self.mul_add(self.mul_add(self.all(c[4]), z, self.all(c[3])), z, self.all(c[2]));
        self.mul_add(self.mul_add(high, z, self.all(c[1])), z, self.all(c[0]))
    }

    /// Sine and cosine of pi t, for |t| below 2^21; the error of either is below 12 units of 2^-24.
    ///
    /// The whole part of t goes off exactly, its parity is the sign, and what is left is in [-1/2, 1/2].
    #[inline(always)]
    pub(super) fn sin_cos_pi(self, t: Vector<S>) -> [Vector<S>; 2] {
        let simd = self.0;
        let shifted = simd.add_f32s(t, self.all(WHOLE));
        let r = simd.sub_f32s(t, simd.sub_f32s(shifted, self.all(WHOLE)));
        let z = simd.mul_f32s(r, r);
        // Twice what is left of half of it is 0 or 1 in magnitude: all of it exact.
        let half = simd.mul_f32s(simd.sub_f32s(shifted, self.all(WHOLE)), self.all(0.5));
        let odd = simd.sub_f32s(half, simd.sub_f32s(simd.add_f32s(half, self.all(WHOLE)), self.all(WHOLE)));
        let sign = self.sub_mul(simd.mul_f32s(odd, odd), self.all(8.0), self.all(1.0));
        let (sin, cos) =
            (simd.mul_f32s(self.horner(SIN, z), r), self.mul_add(self.horner(COS, z), z, self.all(1.0)));
        [simd.mul_f32s(sin, sign), simd.mul_f32s(cos, sign)]
    }
}
