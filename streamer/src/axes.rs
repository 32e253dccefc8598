//! The axes beside the path: grippers and lifts, commanded in the same cycle as the joints, through the same drivers and buses.
//!
//! Their slots lie behind those of the joints. The path's stages (track, guard, ledger) know nothing of them: an axis has its own
//! motion (`taustream_motion::axis`), its own last check before the bus, and remembers what the kernel took of it. What moves it
//! is counted from the last setpoint that left, so a skipped cycle is a longer step. After a gap that the servos do not bridge they
//! stand; the axis then goes on from rest as the path does, and after a stall of more than `stall_resume_ms` not by itself.
use crate::cycle_state::{CycleState, LostSetpoints, Trip, TripKind};
use crate::guard::GuardedCommand;
use crate::watch::Watch;
use taustream_arm::{Axis, AxisUnit, OnFault, Settings};
use taustream_drivers::{DriveState, ServoStatus};
use taustream_messages::{AxisReport, AxisState, Phase};
use taustream_motion::axis::{AXES_MAX, AxisFeedback, AxisMotion, AxisSetpoint, ContactRule};
use taustream_motion::brake::{Brake, JointState};
use taustream_motion::limits::Quantity;
use taustream_motion::range::PermittedRange;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Relative excess over a limit that is taken for rounding, as in the guard of the joints.
const SLACK: f64 = 1e-3;
/// Excess of a position or a rate that is taken for rounding, in SI units.
const ROUNDING: f64 = 1e-6;

/// What is asked of one axis, in angles and torques of its servo's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisRequest {
    /// To an angle; contact at this torque ends it, infinite for none.
    GoTo {
        /// Where.
        target_rad: f64,
        /// The torque.
        torque_nm: f64,
    },
    /// To rest.
    Stop,
}

/// What is asked of all axes in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisRequests {
    /// By axis.
    pub each: [Option<AxisRequest>; AXES_MAX],
    /// All of them come to rest, whatever else is asked.
    pub stop_all: bool,
}

/// One axis.
#[derive(Debug)]
struct AxisSlot {
    axis: Axis,
    /// Its motion at the last setpoint that left, and the one that is being sent.
    motion: AxisMotion,
    next: AxisMotion,
    permitted: PermittedRange,
    /// The last setpoint that left.
    sent: JointState,
    tick: u64,
    /// Setpoints lost in a row.
    lost: u32,
    /// The last check has refused a setpoint: the axis brakes from the last one that left, which was sent in this cycle.
    brake: Option<(Brake, u64)>,
    commands: u32,
    /// Its servo stands: the next setpoint is the last one again.
    restarts: bool,
    /// Where the newest command led it.
    goal_rad: f64,
}

/// All axes of the arm.
#[derive(Debug)]
pub struct Axes {
    joints: usize,
    period_s: f64,
    /// Longest gap over which a motion goes on in time, in periods.
    bridged: u64,
    /// Longest gap after which it goes on from rest.
    resumed: u64,
    in_fault: bool,
    all: Vec<AxisSlot>,
}

impl Axes {
    /// The axes of `settings`; an arm may have none.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            joints: settings.robot.joints.len(),
            period_s: f64::from(settings.cycle.period_us.max(1)) * 1e-6,
            bridged: u64::from(settings.bridged_gap_periods()).max(1),
            resumed: u64::from(settings.cycle.stall_resume_ms) * 1_000
                / u64::from(settings.cycle.period_us.max(1)),
            in_fault: false,
            all: settings.axes.iter().map(AxisSlot::new).collect(),
        }
    }

    /// Adds the axes' setpoints of this tick to a command that has passed the guard of the joints.
    ///
    /// Real time: closed forms, no allocation.
    #[must_use]
    pub fn add(&mut self, mut command: GuardedCommand, cycle_state: &mut CycleState) -> GuardedCommand {
        let (tick, live) = (cycle_state.tick.number, cycle_state.live);
        for (index, slot) in self.all.iter_mut().enumerate() {
            let periods = tick.saturating_sub(slot.tick).max(1);
            let seconds = self.period_s * count(periods);
            if live && periods > self.bridged && slot.motion.is_moving() {
                // Its servo stands at the last setpoint that it got.
                slot.stand(periods <= self.resumed, tick);
            }
            let trip = slot.prepare(live, if slot.restarts { 0.0 } else { seconds });
            if let Some((kind, value, limit)) = trip.filter(|_| cycle_state.axis_trip.is_none()) {
                cycle_state.axis_trip = Some(Trip { joint: self.joints + index, kind, value, limit });
            }
            command = command.with_slot(self.joints + index, &slot.setpoint(tick, self.period_s));
        }
        command
    }

    /// Notes which setpoints left, and what the axes are commanded now.
    ///
    /// Real time: no allocation.
    pub fn record(&mut self, command: &GuardedCommand, cycle_state: &mut CycleState) {
        let tick = cycle_state.tick.number;
        for (index, slot) in self.all.iter_mut().enumerate() {
            let at = self.joints + index;
            let unreachable = cycle_state.unreachable.get(at).copied().unwrap_or(true);
            let (due, taken) = (cycle_state.due.contains(at), cycle_state.taken.contains(at));
            if !cycle_state.live || unreachable {
                slot.rest_at(slot.sent.position_rad, tick);
            } else if taken {
                slot.take(command, at, tick);
            } else if due {
                slot.lost = slot.lost.saturating_add(1);
                let stood = slot.motion.is_moving() && tick.saturating_sub(slot.tick) > self.bridged;
                if stood && cycle_state.lost.is_none() {
                    cycle_state.lost = Some(LostSetpoints { joint: at, count: slot.lost, tolerated: None });
                }
            } else if !slot.motion.is_moving() {
                slot.tick = tick;
            }
            if let Some(commanded) = cycle_state.commanded_rad.get_mut(at) {
                *commanded = slot.sent.position_rad;
            }
            if let Some(moving) = cycle_state.axes_moving.get_mut(index) {
                *moving = cycle_state.live && slot.motion.is_moving();
            }
        }
    }

    /// Looks for contact, follows the arm's faults, and writes what the axes do into the state of the cycle.
    ///
    /// Real time: closed forms, no allocation.
    pub fn observe(&mut self, watch: &Watch, phase: Phase, cycle_state: &mut CycleState) {
        let in_fault = matches!(phase, Phase::FastStopping | Phase::Braking | Phase::Fault);
        let stops = in_fault && !self.in_fault;
        self.in_fault = in_fault;
        for (index, slot) in self.all.iter_mut().enumerate() {
            let at = self.joints + index;
            let servo = cycle_state.servos.get(at).copied().unwrap_or(ServoStatus::UNKNOWN);
            let follows = cycle_state.live && servo.state == DriveState::Enabled;
            if stops && follows {
                slot.stop_by_fault(servo.position_rad);
            } else if follows && !in_fault {
                let lag_rad = watch.lag_rad(at);
                let seen =
                    AxisFeedback { position_rad: servo.position_rad, lag_rad, torque_nm: servo.torque_nm };
                slot.motion.observe(&seen, self.period_s);
            }
            if let Some(report) = cycle_state.axes.get_mut(index) {
                *report = slot.report(&servo, follows);
            }
        }
    }

    /// Does what was asked.
    ///
    /// Real time: closed forms, no allocation.
    pub fn apply(&mut self, requests: &AxisRequests) {
        for (slot, request) in self.all.iter_mut().zip(&requests.each) {
            match request {
                Some(AxisRequest::GoTo { target_rad, torque_nm }) => {
                    slot.motion.go_to(*target_rad, *torque_nm);
                    (slot.commands, slot.goal_rad) = (slot.commands.wrapping_add(1), *target_rad);
                }
                Some(AxisRequest::Stop) => slot.motion.stop(),
                None => {}
            }
            if requests.stop_all {
                slot.motion.stop();
            }
        }
    }

    /// The servos stand at this pose.
    ///
    /// Real time: copies.
    pub fn set_pose(&mut self, pose_rad: &JointArray, tick: u64) {
        for (slot, position_rad) in self.all.iter_mut().zip(pose_rad.iter().skip(self.joints)) {
            slot.rest_at(*position_rad, tick);
            slot.permitted = PermittedRange::around(slot.motion.limits(), *position_rad);
        }
    }
}

impl AxisSlot {
    fn new(axis: &Axis) -> Self {
        let rule = axis.contact.map(|contact| ContactRule {
            lag_rad: contact.lag_rad,
            torque_nm: contact.torque_nm.unwrap_or(f64::INFINITY),
            time_s: contact.time_s,
            squeeze_rad: contact.squeeze_rad,
        });
        let motion = AxisMotion::new(axis.output.limits, rule);
        Self {
            axis: axis.clone(),
            motion,
            next: motion,
            permitted: PermittedRange::new(&axis.output.limits),
            sent: JointState::default(),
            tick: 0,
            lost: 0,
            brake: None,
            commands: 0,
            restarts: false,
            goal_rad: f64::NAN,
        }
    }

    fn rest_at(&mut self, position_rad: f64, tick: u64) {
        self.motion.rest_at(position_rad);
        (self.next, self.brake, self.lost, self.tick) = (self.motion, None, 0, tick);
        self.restarts = false;
        self.sent = JointState { position_rad, ..JointState::default() };
    }

    /// Its servo has stopped at the last setpoint that it got; `goes_on` from there, or stays.
    fn stand(&mut self, goes_on: bool, tick: u64) {
        let (position_rad, mut motion) = (self.sent.position_rad, self.motion);
        self.rest_at(position_rad, tick.saturating_sub(1));
        if goes_on {
            motion.resume_at(position_rad);
            self.motion = motion;
        }
        self.restarts = true;
    }

    /// Moves the motion on, and checks what it says; a setpoint that fails begins a brake.
    fn prepare(&mut self, live: bool, seconds: f64) -> Option<(TripKind, f64, f64)> {
        self.next = self.motion;
        self.next.advance(seconds);
        self.permitted = self.permitted.narrowed_to(self.sent.position_rad);
        if !live || self.brake.is_some() {
            return None;
        }
        let refusal = self.refuse(&self.next.setpoint().state, seconds)?;
        let stop = self.motion.limits().stop;
        let brake = Brake::from_state(self.sent, stop.acceleration_rad_s2, stop.jerk_rad_s3);
        self.brake = Some((brake, self.tick));
        Some(refusal)
    }

    /// The first thing that is wrong with a setpoint, against the one that left before it.
    fn refuse(&self, state: &JointState, seconds: f64) -> Option<(TripKind, f64, f64)> {
        let (q, v, a) = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2);
        if let Some(value) = [q, v, a].into_iter().find(|x| !x.is_finite()) {
            return Some((TripKind::NotFinite, value, 0.0));
        }
        let [low_rad, high_rad] = self.permitted.ends_rad();
        if q < low_rad - ROUNDING || q > high_rad + ROUNDING {
            let limit = if q < low_rad { low_rad } else { high_rad };
            return Some((TripKind::Limit(Quantity::Position), q, limit));
        }
        let stop = &self.motion.limits().stop;
        // The setpoint that repeats the last one is no step.
        let seconds = seconds.max(f64::MIN_POSITIVE);
        let seen_rad_s = (q - self.sent.position_rad) / seconds;
        let seen_rad_s2 = (v - self.sent.velocity_rad_s) / seconds;
        let checks = [
            (Quantity::Velocity, v, stop.velocity_rad_s),
            (Quantity::Velocity, seen_rad_s, stop.velocity_rad_s),
            (Quantity::Acceleration, a, stop.acceleration_rad_s2),
            (Quantity::Acceleration, seen_rad_s2, stop.acceleration_rad_s2),
        ];
        let beyond = |value: f64, limit: f64| value.abs() > limit * (1.0 + SLACK) + ROUNDING;
        let found = checks.into_iter().find(|(_, value, limit)| beyond(*value, *limit));
        found.map(|(quantity, value, limit)| (TripKind::Limit(quantity), value, limit))
    }

    /// The setpoint of cycle `tick`.
    fn setpoint(&self, tick: u64, period_s: f64) -> AxisSetpoint {
        let Some((brake, begun)) = &self.brake else { return *self.next.setpoint() };
        let (state, jerk_rad_s3) = brake.sample(period_s * count(tick.saturating_sub(*begun)));
        AxisSetpoint { state, jerk_rad_s3 }
    }

    /// A setpoint of it has left.
    fn take(&mut self, command: &GuardedCommand, at: usize, tick: u64) {
        let Some(joint) = command.joints().get(at) else { return };
        self.sent = JointState {
            position_rad: joint.position_rad,
            velocity_rad_s: joint.velocity_rad_s,
            acceleration_rad_s2: joint.acceleration_rad_s2,
        };
        (self.lost, self.tick, self.restarts) = (0, tick, false);
        match &self.brake {
            None => self.motion = self.next,
            // The brake has ended: the axis stands, and its motion begins anew from there.
            Some(_) if joint.velocity_rad_s == 0.0 && joint.acceleration_rad_s2 == 0.0 => {
                self.rest_at(joint.position_rad, tick);
            }
            Some(_) => {}
        }
    }

    fn stop_by_fault(&mut self, measured_rad: f64) {
        match self.axis.on_fault {
            OnFault::Hold => self.motion.stop(),
            OnFault::Relax => self.motion.relax(measured_rad),
        }
    }

    fn report(&self, servo: &ServoStatus, follows: bool) -> AxisReport {
        let axis = &self.axis;
        let state = if matches!(servo.state, DriveState::Fault | DriveState::Refused) {
            AxisState::Fault
        } else if follows {
            AxisState::from(self.motion.activity())
        } else {
            AxisState::Off
        };
        AxisReport {
            state: state.code(),
            metres: u32::from(axis.unit == AxisUnit::Metre),
            commands: self.commands,
            reserved: 0,
            command: axis.in_unit(self.sent.position_rad),
            command_velocity: axis.in_unit(self.sent.velocity_rad_s),
            goal: axis.in_unit(self.goal_rad),
            target: axis.in_unit(self.motion.target_rad()),
            measured: axis.in_unit(servo.position_rad),
            force: axis.force_of(servo.torque_nm),
            force_max: axis.force_of(self.motion.torque_nm()),
        }
    }
}

fn count(periods: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "periods between two setpoints")]
    let count = periods as f64;
    count
}

const _: () = assert!(AXES_MAX < MAX_JOINTS);
