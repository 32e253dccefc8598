//! How far the kernel's f32 distances can be from the exact ones, and the limits that allow for it.
//!
//! With u = 2^-24, everything below to first order, and generous where that costs nothing: a wider limit only makes
//! more poses be looked at exactly.
//!
//! 1. An angle of w half turns' way, t = from + w phi, is wrong by u (1 of `from`, 2 of w phi, 1 of the product where
//!    nothing is fused, 1 + w of the sum) <= u (2 + 4 |w|) half turns: `from` is taken into [-1, 1] in f64 first, and
//!    the whole part goes off exactly.
//! 2. Sine and cosine add 12 u each ([`super::lanes`]), the products of a turn and a tilt 4 u each and the tilt's
//!    constants 2 u, in Frobenius' norm of the directions not more than 24 u + 16 u + 8 u. So joint j turns what lies
//!    beyond it wrongly by a = sqrt(2) pi u (2 + 4 |w|) + 56 u, and moves it by at most a rho, rho being the reach
//!    of the arm and the distance of the sphere together. The sums of positions round 3 times a joint and constants
//!    once: 6 (n + 1) u rho. Together every point, the turned sphere included, is wrong by at most
//!    e = rho (sum of the a + 6 (n + 1) u).
//! 3. Sphere and link are each off by e: 2 e. The arithmetic of a distance rounds by less than 16 u rho.
//! 4. The share of the link where it is nearest is wrong by less than 4 e of length (its length is taken as known,
//!    while its computed ends are 2 e off, and its products round). The point is on the link all the same, so that
//!    the distance can only come out too large, and as the true one stands upright on the link, or its end, by
//!    Pythagoras: d'^2 <= d^2 + (8 e)^2.
//!
//! A pose is surely free when d'^2 >= (limit + 2 e + 16 u rho + 1e-9)^2 + (8 e)^2. The nanometre is for constants
//! that count as nothing below 1e-12 and for the reference's own rounding. As printed, distances are summed, and first
//! order has to do in step 4: each link may add 2 e + 8 e + 16 u rho.
use super::flat::Flat;
use super::prefilter::Angles;

/// Unit of f32's rounding.
const U: f64 = 1.0 / 16_777_216.0;
/// What is not counted otherwise (m).
const REST_M: f64 = 1e-9;

/// When a sphere is surely far enough.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// From this on, as the square of the least distance (m^2) or as the sum of distances (m).
    pub(super) free_from: f32,
    /// The distance that the least one has then (m).
    pub(super) distance: f32,
    /// What the fixed links add to the sum (m).
    pub(super) still_m: f32,
}

/// The limits of one motion.
#[derive(Clone, Debug)]
pub(super) struct Limits {
    /// True when distances are summed over the links, as printed.
    pub(super) sums: bool,
    /// Each sphere's.
    pub(super) spheres: Vec<Limit>,
}

impl Limits {
    /// The limits of a motion with these angles.
    #[expect(clippy::cast_possible_truncation, reason = "rounded up, or counted")]
    pub(super) fn new(flat: &Flat, angles: &[Angles], sums: bool) -> Self {
        let turns = wrong_turns(flat, angles);
        let joints = flat.link_segments().count() as f64;
        let limit = |sphere: &super::flat::FlatSphere| {
            let rho_m = flat.reach_m + sphere.away_m;
            let e_m = rho_m * (turns + 6.0 * (joints + 1.0) * U);
            let rounds_m = 16.0 * U * rho_m + REST_M;
            let free_from = if sums {
                sphere.limit_m + (flat.links.len() as f64 + 1.0) * (10.0 * e_m + rounds_m)
            } else {
                (sphere.limit_m + 2.0 * e_m + rounds_m).powi(2) + (8.0 * e_m).powi(2)
            };
            Limit {
                distance: (free_from.sqrt() * (1.0 + 1e-6)) as f32,
                free_from: (free_from * (1.0 + 4.0 * U)) as f32,
                still_m: sphere.still_m.unwrap_or(0.0) as f32,
            }
        };
        Self { sums, spheres: flat.spheres.iter().map(limit).collect() }
    }
}

/// Sum of the a over the joints (rad).
fn wrong_turns(flat: &Flat, angles: &[Angles]) -> f64 {
    let joints = 0..flat.link_segments().count();
    let turn = |joint: usize| {
        let travels = angles.iter().map(|segment| f64::from(segment[joint][1]).abs());
        let travel = travels.fold(0.0, f64::max);
        std::f64::consts::SQRT_2 * std::f64::consts::PI * U * (2.0 + 4.0 * travel) + 56.0 * U
    };
    joints.map(turn).sum()
}
