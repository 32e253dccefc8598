//! Motion of one axis that is no joint of the path: a gripper, a lift.
//!
//! A target is answered by one Tau-J* stroke from rest to rest inside the motion limits. A target that arrives in motion is
//! answered by the closed-form brake first, then by the stroke: the acceleration is continuous and every limit holds. What the
//! axis touches is seen by its distance behind the command, or by its torque; it then holds with its command close to where
//! it is measured. Nothing here allocates or reads a clock.
use crate::JointLimits;
use crate::brake::{Brake, JointState};
use crate::duration::stroke_duration_s;
use crate::range::PermittedRange;
use crate::stroke::{N_MAX, N_MIN, Phi};

/// Most axes of one arm; joints and axes together are at most [`crate::MAX_JOINTS`].
pub const AXES_MAX: usize = 4;
/// Share of the distance by which it holds, below which an axis in contact has lost what it held.
const LOST_SHARE: f64 = 0.25;
/// A stroke shorter than this moves nothing, rad.
const STILL_RAD: f64 = 1e-12;
/// Longest stroke, s: a command that takes longer is refused.
pub const STROKE_S_MAX: f64 = 600.0;

/// How contact is noticed, at the servo's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRule {
    /// Distance of the measured angle behind the command.
    pub lag_rad: f64,
    /// Torque towards the command; infinite for none.
    pub torque_nm: f64,
    /// Either must last this long.
    pub time_s: f64,
    /// In contact, the command is this far ahead of the measured angle at most.
    pub squeeze_rad: f64,
}

/// What an axis does while its servo follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Its command stands.
    Holding,
    /// Its command moves.
    Moving,
    /// It touches something and holds against it.
    InContact,
}

/// What an axis is measured to do, in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisFeedback {
    /// Measured angle.
    pub position_rad: f64,
    /// The command that belongs to the measured angle less that angle; positive: it lags in the positive direction.
    pub lag_rad: f64,
    /// Measured torque; NaN where the servo does not say.
    pub torque_nm: f64,
}

/// A command as it is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisSetpoint {
    /// Angle, velocity and acceleration.
    pub state: JointState,
    /// Third derivative of the angle.
    pub jerk_rad_s3: f64,
}

/// What moves the command.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    Rest,
    Stroke { base_rad: f64, delta_rad: f64, duration_s: f64 },
    Brake(Brake),
}

/// How far contact has come.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Contact {
    None,
    /// The command comes to rest; then distance and torque say how far ahead it stays.
    Settling,
    /// Held with the command this far ahead.
    Held(f64),
}

/// The motion of one axis. Plain data: a copy that is moved on and thrown away is how a cycle that sends nothing is undone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMotion {
    limits: JointLimits,
    contact: Option<ContactRule>,
    /// The exponent with which a stroke over the whole range is shortest.
    n: u32,
    motion: Motion,
    /// Time since the motion began.
    t_s: f64,
    setpoint: AxisSetpoint,
    /// Where it is going.
    target_rad: f64,
    /// Begun when the brake has ended.
    next_rad: Option<f64>,
    /// Torque that is contact, of the command that runs.
    torque_nm: f64,
    contact_state: Contact,
    /// How long the sign of what is looked for has lasted: of contact, of rest in it, or of its loss.
    sign_s: f64,
}

impl AxisMotion {
    /// At rest at the zero angle.
    #[must_use]
    pub fn new(limits: JointLimits, contact: Option<ContactRule>) -> Self {
        let [low_rad, high_rad] = limits.position_rad;
        let way_rad = high_rad - low_rad;
        let mut n = N_MIN;
        for other in N_MIN..=N_MAX {
            if stroke_duration_s(way_rad, &limits.motion, other)
                < stroke_duration_s(way_rad, &limits.motion, n)
            {
                n = other;
            }
        }
        Self {
            limits,
            contact,
            n,
            motion: Motion::Rest,
            t_s: 0.0,
            setpoint: AxisSetpoint::default(),
            target_rad: 0.0,
            next_rad: None,
            torque_nm: f64::INFINITY,
            contact_state: Contact::None,
            sign_s: 0.0,
        }
    }

    /// Stands at this angle, whatever went on before.
    ///
    /// Real time: stores.
    pub fn rest_at(&mut self, position_rad: f64) {
        self.motion = Motion::Rest;
        self.setpoint =
            AxisSetpoint { state: JointState { position_rad, ..JointState::default() }, jerk_rad_s3: 0.0 };
        (self.target_rad, self.next_rad) = (position_rad, None);
        self.forget_contact();
    }

    /// Stands at this angle, where its servo has stopped for want of setpoints, and goes on from rest to where it was going.
    ///
    /// Real time: closed form, no allocation.
    pub fn resume_at(&mut self, position_rad: f64) {
        let goal_rad = match self.motion {
            Motion::Rest => None,
            Motion::Stroke { .. } => Some(self.next_rad.unwrap_or(self.target_rad)),
            Motion::Brake(_) => self.next_rad,
        };
        self.rest(position_rad);
        (self.target_rad, self.next_rad) = (position_rad, None);
        if let Some(goal_rad) = goal_rad {
            self.begin(goal_rad);
        }
    }

    /// Goes to an angle; contact at `torque_nm` or by the rule's distance ends it. An angle that is no number, or too far for
    /// [`STROKE_S_MAX`], changes nothing.
    ///
    /// Real time: closed form, no allocation.
    pub fn go_to(&mut self, target_rad: f64, torque_nm: f64) {
        let way_rad = target_rad - self.setpoint.state.position_rad;
        let duration_s = stroke_duration_s(way_rad, &self.limits.motion, self.n);
        // An angle that is no number has no duration.
        if !target_rad.is_finite() || torque_nm.is_nan() || duration_s > STROKE_S_MAX {
            return;
        }
        self.torque_nm = torque_nm;
        self.forget_contact();
        self.lead_to(target_rad);
    }

    /// Comes to rest by the closed form and stays there.
    ///
    /// Real time: closed form, no allocation.
    pub fn stop(&mut self) {
        if self.contact_state == Contact::Settling {
            // How far ahead it was to stay is not known any more: it stays where it comes to rest.
            self.contact_state = Contact::Held(0.0);
        }
        self.next_rad = None;
        self.brake();
    }

    /// Comes to rest and moves its command to where it is measured, inside the limits: it presses no longer.
    ///
    /// Real time: closed form, no allocation.
    pub fn relax(&mut self, measured_rad: f64) {
        if measured_rad.is_finite() {
            let at_rad = self.inside(measured_rad);
            self.forget_contact();
            self.lead_to(at_rad);
        }
    }

    fn lead_to(&mut self, target_rad: f64) {
        if self.motion == Motion::Rest {
            self.begin(target_rad);
        } else {
            self.next_rad = Some(target_rad);
            self.brake();
        }
    }

    fn begin(&mut self, target_rad: f64) {
        let base_rad = self.setpoint.state.position_rad;
        let delta_rad = target_rad - base_rad;
        let duration_s = stroke_duration_s(delta_rad, &self.limits.motion, self.n);
        (self.target_rad, self.t_s) = (target_rad, 0.0);
        if delta_rad.abs() > STILL_RAD && duration_s <= STROKE_S_MAX {
            self.motion = Motion::Stroke { base_rad, delta_rad, duration_s };
        }
    }

    /// A brake that would swing out of the range is left out: the stroke that runs ends inside it.
    fn brake(&mut self) {
        let Motion::Stroke { base_rad, delta_rad, .. } = self.motion else { return };
        let stop = &self.limits.stop;
        let brake = Brake::from_state(self.setpoint.state, stop.acceleration_rad_s2, stop.jerk_rad_s3);
        let [low_rad, high_rad] = self.limits.position_rad;
        let ends = [base_rad, base_rad + delta_rad];
        let [from_rad, to_rad] = brake.sweep_rad();
        let fits = from_rad >= ends.into_iter().fold(low_rad, f64::min)
            && to_rad <= ends.into_iter().fold(high_rad, f64::max);
        if fits {
            (self.motion, self.t_s, self.target_rad) = (Motion::Brake(brake), 0.0, brake.rest_rad());
        }
    }

    /// Moves the command on by `dt_s`.
    ///
    /// Real time: closed forms, no allocation.
    pub fn advance(&mut self, dt_s: f64) {
        let t_s = self.t_s + dt_s;
        match self.motion {
            Motion::Rest => {}
            Motion::Stroke { base_rad, delta_rad, duration_s } => {
                if t_s >= duration_s {
                    self.rest(self.target_rad);
                } else {
                    let (rate, phi) = (1.0 / duration_s, Phi::at(self.n, t_s / duration_s));
                    self.setpoint = AxisSetpoint {
                        state: JointState {
                            position_rad: base_rad + delta_rad * phi.value,
                            velocity_rad_s: delta_rad * phi.d1 * rate,
                            acceleration_rad_s2: delta_rad * phi.d2 * rate * rate,
                        },
                        jerk_rad_s3: delta_rad * phi.d3 * rate * rate * rate,
                    };
                }
            }
            Motion::Brake(brake) => {
                if t_s >= brake.duration_s() {
                    self.rest(brake.rest_rad());
                } else {
                    let (state, jerk_rad_s3) = brake.sample(t_s);
                    self.setpoint = AxisSetpoint { state, jerk_rad_s3 };
                }
            }
        }
        self.t_s = t_s;
        if self.motion == Motion::Rest
            && let Some(next_rad) = self.next_rad.take()
        {
            self.begin(next_rad);
        }
    }

    fn rest(&mut self, position_rad: f64) {
        self.motion = Motion::Rest;
        self.setpoint =
            AxisSetpoint { state: JointState { position_rad, ..JointState::default() }, jerk_rad_s3: 0.0 };
    }

    /// Looks for contact in what was measured, and answers it.
    ///
    /// Real time: closed forms, no allocation.
    pub fn observe(&mut self, feedback: &AxisFeedback, dt_s: f64) {
        let Some(rule) = self.contact else { return };
        let lag_rad = feedback.lag_rad;
        if !lag_rad.is_finite() || !feedback.position_rad.is_finite() {
            return;
        }
        let towards_nm = feedback.torque_nm * 1.0_f64.copysign(lag_rad);
        let at_rest = self.motion == Motion::Rest;
        let sign = match self.contact_state {
            // A torque counts where it drives the axis towards its command. Not-a-number is no torque.
            Contact::None => lag_rad.abs() >= rule.lag_rad || towards_nm >= self.torque_nm,
            Contact::Settling => at_rest,
            Contact::Held(ahead_rad) => at_rest && lag_rad.abs() < LOST_SHARE * ahead_rad.abs(),
        };
        self.sign_s = if sign { self.sign_s + dt_s } else { 0.0 };
        if self.sign_s < rule.time_s {
            return;
        }
        self.sign_s = 0.0;
        match self.contact_state {
            Contact::None => {
                self.contact_state = Contact::Settling;
                self.next_rad = None;
                self.brake();
            }
            Contact::Settling => self.hold_against(feedback.position_rad, [lag_rad, towards_nm], &rule),
            Contact::Held(_) => self.contact_state = Contact::None,
        }
    }

    /// The command stays as far ahead of the measured angle as gives the torque that was asked for, the servo being a spring;
    /// the squeeze at most.
    fn hold_against(&mut self, measured_rad: f64, [lag_rad, towards_nm]: [f64; 2], rule: &ContactRule) {
        let share = self.torque_nm / towards_nm;
        let wanted_rad = if share.is_finite() && share > 0.0 { lag_rad * share } else { lag_rad };
        let hold_rad = self.inside(measured_rad + wanted_rad.clamp(-rule.squeeze_rad, rule.squeeze_rad));
        self.contact_state = Contact::Held(hold_rad - measured_rad);
        self.lead_to(hold_rad);
    }

    fn forget_contact(&mut self) {
        (self.contact_state, self.sign_s) = (Contact::None, 0.0);
    }

    /// The nearest angle that the limits permit, outside them the command itself.
    fn inside(&self, position_rad: f64) -> f64 {
        let permitted = PermittedRange::around(&self.limits, self.setpoint.state.position_rad);
        let [low_rad, high_rad] = permitted.ends_rad();
        position_rad.max(low_rad).min(high_rad)
    }

    /// What it does.
    #[must_use]
    pub fn activity(&self) -> Activity {
        if matches!(self.contact_state, Contact::Held(_)) {
            Activity::InContact
        } else if self.is_moving() {
            Activity::Moving
        } else {
            Activity::Holding
        }
    }
    /// Its command moves, or is about to.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.motion != Motion::Rest || self.next_rad.is_some() || self.contact_state == Contact::Settling
    }
    /// The command now.
    #[must_use]
    pub fn setpoint(&self) -> &AxisSetpoint {
        &self.setpoint
    }
    /// Where it is going, or where it stands.
    #[must_use]
    pub fn target_rad(&self) -> f64 {
        self.next_rad.unwrap_or(self.target_rad)
    }
    /// Torque that is contact, of the newest command; infinite for none.
    #[must_use]
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm
    }
    /// The duration of a stroke from here, s; infinite where there is none.
    #[must_use]
    pub fn stroke_s(&self, target_rad: f64) -> f64 {
        stroke_duration_s(target_rad - self.setpoint.state.position_rad, &self.limits.motion, self.n)
    }
    /// Its limits.
    #[must_use]
    pub fn limits(&self) -> &JointLimits {
        &self.limits
    }
}
