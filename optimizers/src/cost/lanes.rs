//! Arithmetic of f32 lanes: the few operations that the kernel needs, and sine and cosine.
use pulp::Simd;

/// One f32 a lane.
pub(super) type Vector<S> = <S as Simd>::f32s;
/// A point or a direction a lane.
pub(super) type Vector3<S> = [Vector<S>; 3];

/// sin(pi r) / r for r in [-1/2, 1/2] as a polynomial in r^2, by Remez' algorithm: the error of the sine is below 3.4e-9.
const SIN: [f32; 5] = [3.141_592_5, -5.167_707, 2.550_031_4, -0.598_045_2, 0.077_220_13];
/// (cos(pi r) - 1) / r^2 likewise: the error of the cosine is below 2.5e-10.
const COS: [f32; 5] = [-4.934_802, 4.058_709_6, -1.335_216, 0.234_953_93, -0.024_420_7];
/// Adding it moves a number's whole part into the last bits: 1.5 * 2^23. Good for magnitudes below 2^22.
const WHOLE: f32 = 12_582_912.0;

/// The operations of one level.
///
/// Everything that is built on them must be inlined into the function that the level's instructions are switched on
/// for, or each becomes a call. Closures are not forced to be: so the kernel has none.
#[derive(Clone, Copy)]
pub(super) struct Lanes<S>(pub(super) S);

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    pub(super) fn all(self, value: f32) -> Vector<S> {
        self.0.splat_f32s(value)
    }

    #[inline(always)]
    pub(super) fn all3(self, value: [f32; 3]) -> Vector3<S> {
        [self.all(value[0]), self.all(value[1]), self.all(value[2])]
    }

    #[inline(always)]
    pub(super) fn add(self, a: Vector<S>, b: Vector<S>) -> Vector<S> {
        self.0.add_f32s(a, b)
    }

    #[inline(always)]
    pub(super) fn sub(self, a: Vector<S>, b: Vector<S>) -> Vector<S> {
        self.0.sub_f32s(a, b)
    }

    #[inline(always)]
    pub(super) fn sub3(self, a: Vector3<S>, b: Vector3<S>) -> Vector3<S> {
        [self.sub(a[0], b[0]), self.sub(a[1], b[1]), self.sub(a[2], b[2])]
    }

    #[inline(always)]
    pub(super) fn mul(self, a: Vector<S>, b: Vector<S>) -> Vector<S> {
        self.0.mul_f32s(a, b)
    }

    #[inline(always)]
    pub(super) fn div(self, a: Vector<S>, b: Vector<S>) -> Vector<S> {
        self.0.div_f32s(a, b)
    }

    #[inline(always)]
    pub(super) fn sqrt(self, a: Vector<S>) -> Vector<S> {
        self.0.sqrt_f32s(a)
    }

    /// a b + c, fused where that is one instruction: elsewhere it would be a call of a library.
    #[inline(always)]
    pub(super) fn mul_add(self, a: Vector<S>, b: Vector<S>, c: Vector<S>) -> Vector<S> {
        self.0.mul_add_e_f32s(a, b, c)
    }

    /// c - a b.
    #[inline(always)]
    pub(super) fn sub_mul(self, a: Vector<S>, b: Vector<S>, c: Vector<S>) -> Vector<S> {
        self.0.negate_mul_add_e_f32s(a, b, c)
    }

    /// a + b s for a number s a lane.
    #[inline(always)]
    pub(super) fn along(self, a: Vector3<S>, b: Vector3<S>, s: Vector<S>) -> Vector3<S> {
        [self.mul_add(b[0], s, a[0]), self.mul_add(b[1], s, a[1]), self.mul_add(b[2], s, a[2])]
    }

    /// a - b s for a number s a lane.
    #[inline(always)]
    pub(super) fn against(self, a: Vector3<S>, b: Vector3<S>, s: Vector<S>) -> Vector3<S> {
        [self.sub_mul(b[0], s, a[0]), self.sub_mul(b[1], s, a[1]), self.sub_mul(b[2], s, a[2])]
    }

    #[inline(always)]
    pub(super) fn dot(self, a: Vector3<S>, b: Vector3<S>) -> Vector<S> {
        self.mul_add(a[2], b[2], self.mul_add(a[1], b[1], self.mul(a[0], b[0])))
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
    pub(super) fn clamp_to_unit(self, a: Vector<S>) -> Vector<S> {
        self.min(self.max(a, self.all(0.0)), self.all(1.0))
    }

    /// (a x - b y, b x + a y): the plane's rotation by an angle with the cosine a and the sine b.
    #[inline(always)]
    pub(super) fn rotate(
        self,
        [sin, cos]: [Vector<S>; 2],
        x: Vector<S>,
        y: Vector<S>,
    ) -> (Vector<S>, Vector<S>) {
        (self.sub_mul(sin, y, self.mul(cos, x)), self.mul_add(sin, x, self.mul(cos, y)))
    }

    #[inline(always)]
    fn horner(self, [c0, c1, c2, c3, c4]: [f32; 5], z: Vector<S>) -> Vector<S> {
        let high = self.mul_add(self.mul_add(self.all(c4), z, self.all(c3)), z, self.all(c2));
        self.mul_add(self.mul_add(high, z, self.all(c1)), z, self.all(c0))
    }

    /// Sine and cosine of pi t, for |t| below 2^21.
    ///
    /// The whole part k of t goes off exactly, its parity is the sign, and what is left is in [-1/2, 1/2]. Error of
    /// either: below 12 units of 2^-24. With p = s0 + z q of the sine, z = r^2 <= 1/4: a Horner step adds at most
    /// 2 u |p| (two roundings where nothing is fused) and hands on a quarter of the error of q, a coefficient u |c|,
    /// the rounding of z 1.3 u; with |p| <= pi, |q| <= 5.2 that is below 19 u, times |r| <= 1/2, and u of the product
    /// and 0.1 u of the polynomial. The cosine's sum is smaller. The test below finds 3.3 u.
    #[inline(always)]
    pub(super) fn sin_cos_pi(self, t: Vector<S>) -> [Vector<S>; 2] {
        let shifted = self.add(t, self.all(WHOLE));
        let r = self.sub(t, self.sub(shifted, self.all(WHOLE)));
        let z = self.mul(r, r);
        let simd = self.0;
        let parity = simd.transmute_u32s_f32s(shifted);
        let sign = simd.transmute_f32s_u32s(simd.wrapping_dyn_shl_u32s(parity, simd.splat_u32s(31)));
        let (sin, cos) =
            (self.mul(self.horner(SIN, z), r), self.mul_add(self.horner(COS, z), z, self.all(1.0)));
        [simd.xor_f32s(sin, sign), simd.xor_f32s(cos, sign)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::level::Level;
    use pulp::WithSimd;
    use taustream_arm::rng::SeededRng;

    /// Sine and cosine of pi t for a slice.
    struct All<'a>(&'a [f32], &'a mut [f32], &'a mut [f32]);

    impl WithSimd for All<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let (t, _) = S::as_simd_f32s(self.0);
            let (sin, _) = S::as_mut_simd_f32s(self.1);
            let (cos, _) = S::as_mut_simd_f32s(self.2);
            for ((t, sin), cos) in t.iter().zip(sin).zip(cos) {
                [*sin, *cos] = Lanes(simd).sin_cos_pi(*t);
            }
        }
    }

    #[test]
    fn sine_and_cosine_of_every_level_are_within_their_bound() {
        let mut rng = SeededRng::new(1, 0);
        #[expect(clippy::cast_possible_truncation, reason = "any f32 will do")]
        let t: Vec<f32> = (0..400_000)
            .map(|i| if i % 2 == 0 { rng.within(-1.0, 1.0) } else { rng.within(-130.0, 130.0) } as f32)
            .collect();
        for level in Level::available() {
            let (mut sin, mut cos) = (vec![9.0; t.len()], vec![9.0; t.len()]);
            level.run(All(&t, &mut sin, &mut cos));
            let mut worst: f64 = 0.0;
            for ((t, sin), cos) in t.iter().zip(&sin).zip(&cos) {
                let (s, c) = (std::f64::consts::PI * f64::from(*t)).sin_cos();
                worst = worst.max((f64::from(*sin) - s).abs()).max((f64::from(*cos) - c).abs());
            }
            let units = worst * f64::from(1 << 24);
            assert!(units < 4.0, "{}: {units} units of 2^-24", level.name());
        }
    }
}
