//! The closed-form jerk-limited brake of one joint: from any velocity and acceleration to rest, off the path.
//!
//! It is the last resort when samples cannot be trusted, so it depends on nothing: no solver, no trajectory, no
//! clock. The time-optimal way to (velocity 0, acceleration 0) under |acceleration| and |jerk| limits has one side:
//! acceleration to a peak against the motion, level, and back to zero.
//!
//! Source: Berscheid and Kroeger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target States",
//! RSS 2021 (its velocity control, first step); the oracle of our tests.

/// How one joint moves at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Link angle.
    pub position_rad: f64,
    /// Its first derivative.
    pub velocity_rad_s: f64,
    /// Its second derivative.
    pub acceleration_rad_s2: f64,
}

/// Most pieces of a brake: one back inside the acceleration limit, then down, level, up.
const PIECES: usize = 4;

/// At most four pieces of constant jerk that bring a joint to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Brake {
    start: JointState,
    jerk_rad_s3: [f64; PIECES],
    duration_s: [f64; PIECES],
}

impl Brake {
    /// The time-optimal brake inside `acceleration_rad_s2` and `jerk_rad_s3`; a start acceleration beyond the limit is
    /// first brought back inside it. Values that are not
    /// finite, limits that are not positive, or a way that overflows give a brake of zero length.
    ///
    /// Real time: closed form, no loop, no allocation.
    #[must_use]
    pub fn from_state(start: JointState, acceleration_rad_s2: f64, jerk_rad_s3: f64) -> Self {
        let held = Self { start, ..Self::default() };
        let (limit, jerk) = (acceleration_rad_s2, jerk_rad_s3);
        let (v, a) = (start.velocity_rad_s, start.acceleration_rad_s2);
        let usable = [v, a, limit, jerk, start.position_rad].iter().all(|x| x.is_finite());
        if !usable || limit <= 0.0 || jerk <= 0.0 {
            return held;
        }

        // Back inside the limit first, if need be.
        let excess = (a.abs() - limit).max(0.0);
        let back_s = excess / jerk;
        let back_jerk = -libm::copysign(jerk, a);
        let v = v + back_s * (a + 0.5 * back_jerk * back_s);
        let a = a.clamp(-limit, limit);

        // Where the velocity would end if the acceleration went straight to zero; its sign says which way to brake.
        let coast = v + a * a.abs() / (2.0 * jerk);
        let side = libm::copysign(1.0, coast);
        let (v, a) = (side * v, side * a);
        // From here the brake goes down to acceleration -peak, stays, and comes up to zero:
        // v + (a^2 - peak^2)/(2j) - peak^2/(2j) = 0.
        let peak = libm::sqrt((jerk * v + 0.5 * a * a).max(0.0)).min(limit);
        let down_s = ((a + peak) / jerk).max(0.0);
        let level_s =
            if peak < limit { 0.0 } else { ((v + (0.5 * a * a - peak * peak) / jerk) / peak).max(0.0) };
        let up_s = peak / jerk;

        let brake = Self {
            start,
            jerk_rad_s3: [back_jerk, -side * jerk, 0.0, side * jerk],
            duration_s: [back_s, down_s, level_s, up_s],
        };
        // Finite numbers may still overflow on the way.
        let finite = brake.duration_s().is_finite() && brake.sweep_rad().iter().all(|x| x.is_finite());
        if finite && brake.rest_rad().is_finite() { brake } else { held }
    }

    /// How long it takes.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s.iter().sum()
    }

    /// State and jerk (rad/s^3) after `t_s`; at rest after the end, and the start for a `t_s` that is negative or NaN.
    ///
    /// Real time: four pieces at most, no allocation.
    #[must_use]
    pub fn sample(&self, t_s: f64) -> (JointState, f64) {
        let mut left_s = t_s.max(0.0); // NaN gives 0.
        let mut state = self.start;
        for (&jerk_rad_s3, &duration_s) in self.jerk_rad_s3.iter().zip(&self.duration_s) {
            if left_s < duration_s {
                return (state.after(jerk_rad_s3, left_s), jerk_rad_s3);
            }
            left_s -= duration_s;
            state = state.after(jerk_rad_s3, duration_s);
        }
        // Rounding leaves some 1e-16 of speed; at rest means at rest.
        (JointState { position_rad: state.position_rad, ..JointState::default() }, 0.0)
    }

    /// Where the joint comes to rest.
    ///
    /// Real time: four pieces, no allocation.
    #[must_use]
    pub fn rest_rad(&self) -> f64 {
        self.sample(f64::INFINITY).0.position_rad
    }

    /// Lowest and highest angle on the way.
    ///
    /// Real time: four pieces, no allocation.
    #[must_use]
    pub fn sweep_rad(&self) -> [f64; 2] {
        let mut state = self.start;
        let [mut low_rad, mut high_rad] = [state.position_rad; 2];
        for (&jerk_rad_s3, &duration_s) in self.jerk_rad_s3.iter().zip(&self.duration_s) {
            let [turn1_s, turn2_s] = state.turning_s(jerk_rad_s3);
            // A turn outside the piece is moved to its end, which counts anyway.
            for t_s in [turn1_s, turn2_s, duration_s] {
                let inside = t_s > 0.0 && t_s < duration_s;
                let at_rad = state.after(jerk_rad_s3, if inside { t_s } else { duration_s }).position_rad;
                low_rad = low_rad.min(at_rad);
                high_rad = high_rad.max(at_rad);
            }
            state = state.after(jerk_rad_s3, duration_s);
        }
        [low_rad, high_rad]
    }
}

impl JointState {
    /// The state `t_s` later under constant jerk.
    ///
    /// Real time: closed form.
    #[must_use]
    pub fn after(&self, jerk_rad_s3: f64, t_s: f64) -> Self {
        let Self { position_rad, velocity_rad_s: v, acceleration_rad_s2: a } = *self;
        let (j, t) = (jerk_rad_s3, t_s);
        Self {
            position_rad: position_rad + t * (v + t * (0.5 * a + t * j / 6.0)),
            velocity_rad_s: v + t * (a + t * 0.5 * j),
            acceleration_rad_s2: a + t * j,
        }
    }

    /// Both instants at which the velocity is zero under constant jerk; NaN or infinite where there is none.
    fn turning_s(&self, jerk_rad_s3: f64) -> [f64; 2] {
        let (v, a, half_j) = (self.velocity_rad_s, self.acceleration_rad_s2, 0.5 * jerk_rad_s3);
        let q = -0.5 * (a + libm::copysign(libm::sqrt(a * a - 4.0 * half_j * v), a));
        [q / half_j, v / q]
    }
}
