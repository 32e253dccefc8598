//! How far the kernel's f32 distances can be from the exact ones.
//!
//! With u = 2^-24, to first order and generous. An angle is reduced to one revolution in f64 and rounded once: pi u. Sine and cosine add 12 u
//! each ([`super::arithmetic`]). A joint multiplies the directions by a fixed rotation (three products a column, 4 u each, constants
//! 2 u) and by its own, in Frobenius' norm of at most 40 u more. So it turns what lies beyond it wrongly by less than 64 u, and the sums of
//! positions round 4 times a joint. A prismatic joint rounds its extension once and adds it in one rounding, both at most u rho, and turns
//! nothing but by the fixed rotation. Every point is wrong by at most e = rho (64 n + 6 (n + 1)) u, with rho the arm's
//! reach. Seen from an obstacle, coordinates grow by its distance, which rounds 8 times more; the distance of two points
//! rounds 8 times, as does its square, which is compared with the square of what is to be kept. Both spheres of a pair of links may be wrong.
const U: f64 = 1.0 / 16_777_216.0;
/// What counts beside: constants that are rounded on their own, and the exact model's own rounding (m).
const REST_M: f64 = 1e-8;

/// The tolerance of distances between points at most `reach_m` from the base's origin, for an arm of so many joints.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "rounded up")]
pub(super) fn tolerance_m(joints: usize, reach_m: f64) -> f32 {
    let n = joints as f64;
    let units = 2.0 * (64.0 * n + 6.0 * (n + 1.0)) + 32.0;
    ((units * U * reach_m + REST_M) * (1.0 + 4.0 * U)) as f32
}

/// The next larger f32, for a number that only grows by rounding up.
#[must_use]
pub(super) fn up(value: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounded up below")]
    let near = value as f32;
    if f64::from(near) < value { near.next_up() } else { near }
}

/// The next smaller f32.
#[must_use]
pub(super) fn down(value: f64) -> f32 {
    -up(-value)
}
