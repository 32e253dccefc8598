//! The position-velocity-torque cascade of a simulated drive, and where its setpoint comes from.
//!
//! Between two setpoints the reference runs along a straight line over the interpolation period (0x60C2), its slope
//! fed forward to the velocity loop. A step of the setpoint is thus at most a fast reference, and speed and torque
//! limits and the inertia stand between it and the joint. Link side, SI units; nothing here knows counts or frames.
use super::plant::PlantParameters;
use crate::servo::Nanos;

/// How the loops are tuned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopParameters {
    /// Gain of the position loop.
    pub position_gain_1_s: f64,
    /// Bandwidth of the velocity loop; its gain is this times the inertia.
    pub velocity_bandwidth_rad_s: f64,
    /// Integral time of the velocity loop.
    pub integral_time_s: f64,
    /// First-order lag of the torque (current loop).
    pub torque_lag_s: f64,
    /// For how long after a setpoint's period the reference continues at its speed when no setpoint follows; 0: it stops.
    pub extrapolation_s: f64,
}

/// Lag of the velocity that is fed forward: late SYNCs make the reference a staircase, which this smooths.
const FEED_FORWARD_LAG_S: f64 = 1e-3;

/// What the motor is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// Not energised.
    Released,
    /// Following the line to the newest setpoint.
    Following,
    /// Coming to rest with this deceleration, then holding.
    Slowing(f64),
    /// Moving by a trapezoidal profile of the drive's own.
    Profiled(Goal, ProfileLimits),
}

/// Where a profile of the drive's own leads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Goal {
    /// To rest at an angle.
    Position(f64),
    /// To a velocity, until another goal is set.
    Velocity(f64),
}

/// Limits of such a profile, all positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ProfileLimits {
    pub(crate) speed_rad_s: f64,
    pub(crate) acceleration_rad_s2: f64,
    pub(crate) deceleration_rad_s2: f64,
}

/// A straight line in time.
#[derive(Clone, Copy, Debug)]
struct Line {
    from_rad: f64,
    to_rad: f64,
    begins: Nanos,
    duration_s: f64,
}

impl Line {
    const fn resting(at_rad: f64) -> Self {
        Self { from_rad: at_rad, to_rad: at_rad, begins: Nanos(0), duration_s: 1.0 }
    }
    /// The angle; `beyond_s` after its end it rests.
    fn at(&self, now: Nanos, beyond_s: f64) -> f64 {
        let time_s = now.since_s(self.begins).min(self.duration_s + beyond_s);
        let share = time_s / self.duration_s;
        self.from_rad + share * (self.to_rad - self.from_rad)
    }
}

/// What drives may add to the setpoint (0x60B1, 0x60B2).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Offsets {
    pub(crate) velocity_rad_s: f64,
    pub(crate) torque_nm: f64,
}

/// The cascade of one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Controller {
    loops: LoopParameters,
    mode: Mode,
    line: Line,
    reference_rad: f64,
    reference_rad_s: f64,
    feed_forward_rad_s: f64,
    integral_nm: f64,
    torque_nm: f64,
    pub(crate) offsets: Offsets,
}

impl Controller {
    /// Released.
    pub(crate) fn new(loops: LoopParameters) -> Self {
        Self {
            loops,
            mode: Mode::Released,
            line: Line::resting(0.0),
            reference_rad: 0.0,
            reference_rad_s: 0.0,
            feed_forward_rad_s: 0.0,
            integral_nm: 0.0,
            torque_nm: 0.0,
            offsets: Offsets::default(),
        }
    }

    /// Starts to hold the angle where the joint is.
    pub(crate) fn energise(&mut self, position_rad: f64) {
        *self = Self { mode: Mode::Following, offsets: self.offsets, ..Self::new(self.loops) };
        self.reference_rad = position_rad;
        self.line = Line::resting(position_rad);
    }

    /// Follows setpoints again after a stop, from where the reference came to rest.
    pub(crate) fn follow(&mut self) {
        if self.mode != Mode::Released {
            self.mode = Mode::Following;
            self.line = Line::resting(self.reference_rad);
        }
    }

    /// The newest setpoint, or where it stood when it began to follow.
    pub(crate) const fn target_rad(&self) -> f64 {
        self.line.to_rad
    }

    /// No torque any more.
    pub(crate) fn release(&mut self) {
        self.mode = Mode::Released;
        self.torque_nm = 0.0;
    }

    /// Brings the joint to rest, from how it moves now: the reference may be anywhere after a step of the setpoint.
    pub(crate) fn slow_down(&mut self, deceleration_rad_s2: f64, measured: (f64, f64)) {
        if self.mode == Mode::Following {
            (self.reference_rad, self.reference_rad_s) = measured;
        } else if matches!(self.mode, Mode::Profiled(..)) {
            self.reference_rad = measured.0;
        }
        if self.mode != Mode::Released {
            self.mode = Mode::Slowing(deceleration_rad_s2);
        }
    }

    /// A setpoint to be reached one interpolation period from now.
    pub(crate) fn set_target(&mut self, now: Nanos, to_rad: f64, period_s: f64) {
        if self.mode == Mode::Following {
            self.line = Line { from_rad: self.reference_rad, to_rad, begins: now, duration_s: period_s };
        }
    }

    /// Moves by a profile from where the reference is, unless the motor is being stopped.
    pub(crate) fn go(&mut self, goal: Goal, limits: ProfileLimits) {
        if matches!(self.mode, Mode::Following | Mode::Profiled(..)) {
            self.mode = Mode::Profiled(goal, limits);
        }
    }

    /// Holds the reference where it is.
    pub(crate) fn hold(&mut self) {
        if matches!(self.mode, Mode::Profiled(..)) {
            self.follow();
        }
    }

    /// True when setpoints are followed.
    pub(crate) fn is_following(&self) -> bool {
        self.mode == Mode::Following
    }

    /// True when a ramp has brought the reference to rest.
    pub(crate) fn has_stopped(&self) -> bool {
        matches!(self.mode, Mode::Slowing(_)) && self.reference_rad_s == 0.0
    }

    /// The reference angle.
    pub(crate) const fn reference_rad(&self) -> f64 {
        self.reference_rad
    }
    /// The torque that the motor is given.
    pub(crate) const fn torque_nm(&self) -> f64 {
        self.torque_nm
    }

    /// The torque for the next `dt_s`, from the angle as the encoder sees it and the velocity.
    pub(crate) fn step(
        &mut self,
        now: Nanos,
        dt_s: f64,
        measured: (f64, f64),
        plant: &PlantParameters,
    ) -> f64 {
        if self.mode == Mode::Released {
            return 0.0;
        }
        self.move_reference(now, dt_s);
        let (position_rad, velocity_rad_s) = measured;
        let loops = self.loops;
        let smooth = dt_s / (FEED_FORWARD_LAG_S + dt_s);
        self.feed_forward_rad_s += smooth * (self.reference_rad_s - self.feed_forward_rad_s);

        let wanted_rad_s = loops.position_gain_1_s * (self.reference_rad - position_rad)
            + self.feed_forward_rad_s
            + self.offsets.velocity_rad_s;
        let wanted_rad_s = wanted_rad_s.clamp(-plant.speed_rad_s_max, plant.speed_rad_s_max);

        let gain_nm_s = plant.inertia_kg_m2 * loops.velocity_bandwidth_rad_s;
        let error_nm = gain_nm_s * (wanted_rad_s - velocity_rad_s);
        let requested_nm = error_nm + self.integral_nm + self.offsets.torque_nm;
        let limited_nm = requested_nm.clamp(-plant.torque_nm_max, plant.torque_nm_max);
        // A saturated integrator stands still unless the error unwinds it.
        let over_nm = requested_nm - limited_nm;
        if over_nm * error_nm <= 0.0 {
            self.integral_nm += error_nm * dt_s / loops.integral_time_s;
        }
        self.torque_nm += dt_s / (loops.torque_lag_s + dt_s) * (limited_nm - self.torque_nm);
        self.torque_nm
    }

    fn move_reference(&mut self, now: Nanos, dt_s: f64) {
        match self.mode {
            Mode::Released => {}
            Mode::Following => {
                let next_rad = self.line.at(now, self.loops.extrapolation_s);
                // The slope of the step that ends now: the line's own, also where one line meets the next.
                self.reference_rad_s = (next_rad - self.reference_rad) / dt_s;
                self.reference_rad = next_rad;
            }
            Mode::Slowing(deceleration_rad_s2) => {
                let less_rad_s = deceleration_rad_s2 * dt_s;
                let speed_rad_s = (self.reference_rad_s.abs() - less_rad_s).max(0.0);
                self.reference_rad_s =
                    if speed_rad_s > 0.0 { speed_rad_s.copysign(self.reference_rad_s) } else { 0.0 };
                self.reference_rad += dt_s * self.reference_rad_s;
            }
            Mode::Profiled(goal, limits) => self.move_by_profile(goal, limits, dt_s),
        }
    }

    /// One step of a trapezoidal profile.
    fn move_by_profile(&mut self, goal: Goal, limits: ProfileLimits, dt_s: f64) {
        let speed_rad_s = self.reference_rad_s;
        let wanted_rad_s = match goal {
            Goal::Velocity(wanted_rad_s) => wanted_rad_s.clamp(-limits.speed_rad_s, limits.speed_rad_s),
            Goal::Position(to_rad) => {
                let left_rad = to_rad - self.reference_rad;
                // The speed from which the rest of the way suffices to stop, one step ahead.
                let step_rad_s = limits.deceleration_rad_s2 * dt_s;
                let braked_rad_s =
                    (step_rad_s * step_rad_s + 2.0 * limits.deceleration_rad_s2 * left_rad.abs()).sqrt()
                        - step_rad_s;
                let wanted_rad_s = braked_rad_s.min(limits.speed_rad_s).copysign(left_rad);
                if left_rad.abs() <= wanted_rad_s.abs() * dt_s || left_rad.abs() <= step_rad_s * dt_s {
                    (self.reference_rad, self.reference_rad_s) = (to_rad, 0.0);
                    return;
                }
                wanted_rad_s
            }
        };
        let speeds_up = wanted_rad_s * speed_rad_s >= 0.0 && wanted_rad_s.abs() > speed_rad_s.abs();
        let most = dt_s * if speeds_up { limits.acceleration_rad_s2 } else { limits.deceleration_rad_s2 };
        self.reference_rad_s = speed_rad_s + (wanted_rad_s - speed_rad_s).clamp(-most, most);
        self.reference_rad += dt_s * self.reference_rad_s;
    }
}
