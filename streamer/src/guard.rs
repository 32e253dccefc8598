//! The last check before the bus: what passes it is finite, inside the position and stop limits against the
//! commands before it, and slow enough to stop before the position limit.
//!
//! Differences are divided differences over the commands that left, on their true times. Each of them is an average
//! of the derivative over the time it spans (its Peano kernel is positive and of unit mass), so a motion inside
//! its limits cannot exceed them by discretisation, skipped cycles included; what is left is rounding, for which
//! `SLACK` is plenty. Hence the guard never trips in a verified motion.
//!
//! Each joint is checked against the setpoint that it was last sent: with decimated setpoints, its last command is older than the
//! cycle before. A command that is not sent is checked too, since the average holds for any step.
//!
//! A joint outside its range may stay or move inwards. What it is permitted narrows with every command that was sent to
//! it, so that no sum of small steps leads outwards again.
//!
//! A setpoint that fails starts a brake: each joint to rest by its own closed-form law, from the last good state.
use crate::cycle_state::{Braking, CycleState, Trip, TripKind};
use crate::last_sent::{LastSent, Ledger};
use crate::track::RequestedSetpoint;
use taustream_drivers::JointCommand;
use taustream_motion::axis::AxisSetpoint;
use taustream_motion::brake::{Brake, JointState};
use taustream_motion::limits::Quantity;
use taustream_motion::range::PermittedRange;
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Setpoint};

/// Relative excess over a limit that is taken for rounding.
const SLACK: f64 = 1e-3;
/// Excess of a position over its limit that is taken for rounding, rad.
const POSITION_SLACK_RAD: f64 = 1e-6;
/// Excess of a velocity, acceleration or jerk that is taken for rounding, in their SI units.
const RATE_SLACK: f64 = 1e-3;

/// A command that has passed the guard. Only [`Guard`] makes one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardedCommand {
    setpoint: Setpoint,
    joints: [JointCommand; MAX_JOINTS],
}

impl GuardedCommand {
    fn new(setpoint: Setpoint) -> Self {
        let mut joints = [JointCommand::default(); MAX_JOINTS];
        let rates = setpoint.velocity_rad_s.iter().zip(&setpoint.acceleration_rad_s2);
        for (joint, (position, (velocity, acceleration))) in
            joints.iter_mut().zip(setpoint.position_rad.iter().zip(rates))
        {
            *joint = JointCommand {
                position_rad: *position,
                velocity_rad_s: *velocity,
                acceleration_rad_s2: *acceleration,
                torque_nm: 0.0,
            };
        }
        Self { setpoint, joints }
    }
    /// The same with torques that have passed the torque guard.
    pub(crate) fn with_torque(mut self, passed_nm: &JointArray) -> Self {
        self.joints.iter_mut().zip(passed_nm).for_each(|(joint, passed_nm)| joint.torque_nm = *passed_nm);
        self
    }
    /// The same with the setpoint of an axis, which has passed the axes' own check.
    pub(crate) fn with_slot(mut self, slot: usize, at: &AxisSetpoint) -> Self {
        let AxisSetpoint { state, jerk_rad_s3 } = *at;
        if let Some(joint) = self.joints.get_mut(slot) {
            *joint = JointCommand {
                position_rad: state.position_rad,
                velocity_rad_s: state.velocity_rad_s,
                acceleration_rad_s2: state.acceleration_rad_s2,
                torque_nm: 0.0,
            };
        }
        let setpoint = &mut self.setpoint;
        for (values, value) in [
            (&mut setpoint.position_rad, state.position_rad),
            (&mut setpoint.velocity_rad_s, state.velocity_rad_s),
            (&mut setpoint.acceleration_rad_s2, state.acceleration_rad_s2),
            (&mut setpoint.jerk_rad_s3, jerk_rad_s3),
        ] {
            if let Some(slot) = values.get_mut(slot) {
                *slot = value;
            }
        }
        self
    }
    /// As drivers take it.
    #[must_use]
    pub fn joints(&self) -> &[JointCommand; MAX_JOINTS] {
        &self.joints
    }
    /// Position and derivatives.
    #[must_use]
    pub fn setpoint(&self) -> &Setpoint {
        &self.setpoint
    }
}

/// A joint's derivatives as the commands themselves show them.
#[derive(Clone, Copy, Debug)]
struct Differences {
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
    jerk_rad_s3: f64,
    /// Time that the first difference spans.
    step_s: f64,
    /// Time that the second difference spans.
    span_s: f64,
}

/// The derivatives that a new position shows against the last three that were sent, `period_s` apart or more.
fn differences(last: &LastSent, position_rad: f64, tick: u64, period_s: f64) -> Differences {
    let seconds = |from: u64, to: u64| {
        #[expect(clippy::cast_precision_loss, reason = "periods between two commands")]
        let periods = to.saturating_sub(from).max(1) as f64;
        periods * period_s
    };
    let [q1, q2, q3] = last.position_rad;
    let [t1, t2, t3] = last.tick;
    let (h1, h2, h3) = (seconds(t1, tick), seconds(t2, t1), seconds(t3, t2));
    let (v1, v2, v3) = ((position_rad - q1) / h1, (q1 - q2) / h2, (q2 - q3) / h3);
    let (a1, a2) = (2.0 * (v1 - v2) / (h1 + h2), 2.0 * (v2 - v3) / (h2 + h3));
    Differences {
        velocity_rad_s: v1,
        acceleration_rad_s2: a1,
        jerk_rad_s3: 3.0 * (a1 - a2) / (h1 + h2 + h3),
        step_s: h1,
        span_s: h1 + h2,
    }
}

/// A brake that runs.
#[derive(Clone, Copy, Debug)]
struct Running {
    brakes: [Brake; MAX_JOINTS],
    /// The cycle in which each joint was commanded the state that its brake begins with.
    begun: [u64; MAX_JOINTS],
}

/// The guard.
#[derive(Debug)]
pub struct Guard {
    limits: [JointLimits; MAX_JOINTS],
    joints: usize,
    period_s: f64,
    permitted: [PermittedRange; MAX_JOINTS],
    /// The drives were energised in the cycle before.
    was_live: bool,
    /// A brake has ended: it may have left the range.
    released: bool,
    brake: Option<Running>,
}

impl Guard {
    /// A guard of an arm with these limits.
    #[must_use]
    pub fn new(limits: [JointLimits; MAX_JOINTS], joints: usize, period_us: u32) -> Self {
        let period_s = f64::from(period_us.max(1)) * 1e-6;
        let permitted = limits.map(|limits| PermittedRange::new(&limits));
        Self { limits, joints, period_s, permitted, was_live: false, released: false, brake: None }
    }

    /// Lets a setpoint pass, or replaces it by a braking command and says why.
    ///
    /// Real time: closed forms, no allocation.
    pub fn limit(
        &mut self,
        requested: &RequestedSetpoint,
        ledger: &Ledger,
        cycle_state: &mut CycleState,
    ) -> GuardedCommand {
        let tick = cycle_state.tick.number;
        self.permit(requested, ledger.joints());
        if requested.live && self.brake.is_none() {
            let restarted = requested.restart.then(|| at_rest(ledger.joints(), requested, tick));
            let past = restarted.as_ref().unwrap_or(ledger.joints());
            if let Some(trip) = self.find_trip(requested, past, tick) {
                cycle_state.trip = Some(trip);
                self.brake = Some(self.begin_brake(past));
            }
        }
        GuardedCommand::new(match self.brake {
            None => requested.setpoint,
            Some(running) => self.braking_command(&running, ledger, cycle_state),
        })
    }

    /// Clears a brake that has ended.
    ///
    /// Real time: a store.
    pub fn release(&mut self) {
        self.released |= self.brake.is_some();
        self.brake = None;
    }

    /// The commanded pose was set from outside: each joint is permitted from there as when it was energised.
    ///
    /// Real time: stores a flag.
    pub fn permit_anew(&mut self) {
        self.released = true;
    }

    /// What each joint is permitted: up to where it was energised, or where a brake has left it, outside its range; from
    /// there on no further outside than it was commanded last.
    fn permit(&mut self, requested: &RequestedSetpoint, past: &[LastSent; MAX_JOINTS]) {
        let energised_now = !(requested.live && self.was_live);
        let joints = self.permitted.iter_mut().zip(&self.limits).zip(past);
        let joints = joints.zip(&requested.setpoint.position_rad).take(self.joints);
        for (((permitted, limits), last), requested_rad) in joints {
            *permitted = if energised_now {
                PermittedRange::around(limits, *requested_rad)
            } else if self.released {
                PermittedRange::around(limits, last.position_rad[0])
            } else {
                permitted.narrowed_to(last.position_rad[0])
            };
        }
        (self.was_live, self.released) = (requested.live, false);
    }

    fn find_trip(
        &self,
        requested: &RequestedSetpoint,
        past: &[LastSent; MAX_JOINTS],
        tick: u64,
    ) -> Option<Trip> {
        let w = &requested.setpoint;
        let values = w.position_rad.iter().zip(&w.velocity_rad_s).zip(&w.acceleration_rad_s2);
        let states = values.map(|((position, velocity), acceleration)| JointState {
            position_rad: *position,
            velocity_rad_s: *velocity,
            acceleration_rad_s2: *acceleration,
        });
        let joints = states.zip(past).zip(self.limits.iter().zip(&self.permitted)).take(self.joints);
        joints.enumerate().find_map(|(joint, ((state, last), (limits, permitted)))| {
            let seen = differences(last, state.position_rad, tick, self.period_s);
            let (kind, value, limit) = refuse(&state, permitted.ends_rad(), &limits.stop, &seen)?;
            Some(Trip { joint, kind, value, limit })
        })
    }

    /// Each joint brakes from the state that it was commanded last itself.
    fn begin_brake(&self, past: &[LastSent; MAX_JOINTS]) -> Running {
        let mut brakes = [Brake::default(); MAX_JOINTS];
        for ((brake, last), limits) in brakes.iter_mut().zip(past).zip(&self.limits) {
            let start = JointState {
                position_rad: last.position_rad[0],
                velocity_rad_s: last.velocity_rad_s,
                acceleration_rad_s2: last.acceleration_rad_s2,
            };
            *brake = Brake::from_state(start, limits.stop.acceleration_rad_s2, limits.stop.jerk_rad_s3);
        }
        Running { brakes, begun: past.map(|last| last.tick[0]) }
    }

    fn braking_command(&self, running: &Running, ledger: &Ledger, cycle_state: &mut CycleState) -> Setpoint {
        let mut setpoint = Setpoint { position_rad: ledger.position_rad(), ..Setpoint::default() };
        // After a stall the drives are at rest at the last command: the brake has ended.
        if cycle_state.frozen {
            cycle_state.braking = Braking::Rested;
            return setpoint;
        }
        let tick = cycle_state.tick.number;
        let mut rested = true;
        let brakes = running.brakes.iter().zip(&running.begun).zip(ledger.joints());
        for (joint, ((brake, begun), last)) in brakes.enumerate().take(self.joints) {
            cycle_state.sweep_rad[joint] = brake.sweep_rad();
            // A drive that has stopped for want of setpoints stands already.
            if last.stopped {
                continue;
            }
            #[expect(clippy::cast_precision_loss, reason = "periods of a brake")]
            let now_s = tick.saturating_sub(*begun) as f64 * self.period_s;
            let (state, jerk_rad_s3) = brake.sample(now_s);
            rested &= now_s >= brake.duration_s();
            setpoint.position_rad[joint] = state.position_rad;
            setpoint.velocity_rad_s[joint] = state.velocity_rad_s;
            setpoint.acceleration_rad_s2[joint] = state.acceleration_rad_s2;
            setpoint.jerk_rad_s3[joint] = jerk_rad_s3;
        }
        cycle_state.braking = if rested { Braking::Rested } else { Braking::Running };
        cycle_state.trajectory_id = 0;
        setpoint
    }
}

/// The joints as if each had stood where it is requested since before a cycle.
fn at_rest(
    past: &[LastSent; MAX_JOINTS],
    requested: &RequestedSetpoint,
    tick: u64,
) -> [LastSent; MAX_JOINTS] {
    let mut past = *past;
    for (last, position_rad) in past.iter_mut().zip(&requested.setpoint.position_rad) {
        // A pose that is not finite is none; the check of the setpoint itself will refuse it.
        let at_rad = if position_rad.is_finite() { *position_rad } else { last.position_rad[0] };
        *last = last.at_rest(at_rad, tick.saturating_sub(1));
    }
    past
}

type Refusal = (TripKind, f64, f64);

/// The first thing that is wrong with one joint's setpoint.
fn refuse(
    state: &JointState,
    [lowest, highest]: [f64; 2],
    stop: &LimitSet,
    seen: &Differences,
) -> Option<Refusal> {
    let (q, v, a) = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2);
    if let Some(value) = [q, v, a].into_iter().find(|x| !x.is_finite()) {
        return Some((TripKind::NotFinite, value, 0.0));
    }
    if q < lowest - POSITION_SLACK_RAD {
        return Some((TripKind::Limit(Quantity::Position), q, lowest));
    }
    if q > highest + POSITION_SLACK_RAD {
        return Some((TripKind::Limit(Quantity::Position), q, highest));
    }
    let beyond = |value: f64, limit: f64| value.abs() > limit * (1.0 + SLACK) + RATE_SLACK;
    for (quantity, value, limit) in [
        (Quantity::Velocity, v, stop.velocity_rad_s),
        (Quantity::Acceleration, a, stop.acceleration_rad_s2),
        (Quantity::Velocity, seen.velocity_rad_s, stop.velocity_rad_s),
        (Quantity::Acceleration, seen.acceleration_rad_s2, stop.acceleration_rad_s2),
        (Quantity::Jerk, seen.jerk_rad_s3, stop.jerk_rad_s3),
    ] {
        if beyond(value, limit) {
            return Some((TripKind::Limit(quantity), value, limit));
        }
    }
    // The state from which a brake would start must be the one that the commands show.
    let lag_rad_s = stop.acceleration_rad_s2 * seen.step_s;
    if beyond(v - seen.velocity_rad_s, lag_rad_s) {
        return Some((TripKind::Inconsistent(Quantity::Velocity), v, seen.velocity_rad_s));
    }
    let lag_rad_s2 = stop.jerk_rad_s3 * seen.span_s;
    if beyond(a - seen.acceleration_rad_s2, lag_rad_s2) {
        return Some((TripKind::Inconsistent(Quantity::Acceleration), a, seen.acceleration_rad_s2));
    }
    let up = q + reach_rad(v, a, stop.acceleration_rad_s2, stop.jerk_rad_s3);
    if up > highest + POSITION_SLACK_RAD {
        return Some((TripKind::CannotStop, up, highest));
    }
    let down = q - reach_rad(-v, -a, stop.acceleration_rad_s2, stop.jerk_rad_s3);
    (down < lowest - POSITION_SLACK_RAD).then_some((TripKind::CannotStop, down, lowest))
}

/// How far a joint still goes in the positive direction under the hardest braking: jerk -j down to acceleration
/// `-a_max`, then constant. No motion inside the limits turns round earlier, so no verified motion fails this check
/// (a brake, which must also end without acceleration, swings out by up to `a_max^3 / (24 j^2)` farther: 3 mrad for a
/// joint of 30 rad/s^2 and 600 rad/s^3).
fn reach_rad(v: f64, a: f64, a_max: f64, j: f64) -> f64 {
    let square = a * a + 2.0 * j * v;
    if square <= 0.0 || j <= 0.0 || a_max <= 0.0 {
        return 0.0;
    }
    let after = |t: f64| v * t + a * t * t / 2.0 - j * t * t * t / 6.0;
    let root = square.sqrt();
    let distance = if root <= a_max {
        after(((a + root) / j).max(0.0))
    } else {
        let t = ((a + a_max) / j).max(0.0);
        let v_then = v + a * t - j * t * t / 2.0;
        after(t) + v_then * v_then / (2.0 * a_max)
    };
    distance.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tick::Tick;
    use taustream_drivers::JointSet;
    use taustream_motion::LimitSet;

    const PERIOD_S: f64 = 1e-3;

    type Spoil = fn(JointState) -> JointState;
    type Expected = fn(TripKind) -> bool;

    fn limits() -> [JointLimits; MAX_JOINTS] {
        let motion = LimitSet { velocity_rad_s: 3.2, acceleration_rad_s2: 15.0, jerk_rad_s3: 150.0 };
        let stop = LimitSet { velocity_rad_s: 3.2, acceleration_rad_s2: 30.0, jerk_rad_s3: 600.0 };
        [JointLimits { position_rad: [-3.0, 3.0], motion, stop }; MAX_JOINTS]
    }

    /// Feeds one joint's positions with rates that belong to them, and returns the first trip.
    fn first_trip(motion: impl Fn(f64) -> JointState, ticks: u32) -> Option<(u32, Trip)> {
        first_trip_sent_every(1, motion, ticks)
    }

    /// A sine from rest: position 1 - cos, so velocity and acceleration begin at 0 and at its peak.
    fn wave(amplitude_rad: f64, rate: f64) -> impl Fn(f64) -> JointState {
        // A cubic start hides the step of the acceleration: amplitude grows with (1 - e^-t)^4.
        move |t| {
            let ease = |t: f64| {
                let g = 1.0 - (-t * 2.0).exp();
                amplitude_rad * g * g * g * g * (rate * t).sin()
            };
            let h = 1e-4;
            JointState {
                position_rad: ease(t),
                velocity_rad_s: (ease(t + h) - ease(t - h)) / (2.0 * h),
                acceleration_rad_s2: (ease(t + h) - 2.0 * ease(t) + ease(t - h)) / (h * h),
            }
        }
    }

    #[test]
    fn guard_on_a_smooth_motion_inside_the_limits_never_trips() {
        assert_eq!(first_trip(wave(0.5, 4.0), 5_000), None);
    }

    /// Feeds positions of which every `every`-th is sent, and returns the first trip.
    fn first_trip_sent_every(
        every: u32,
        motion: impl Fn(f64) -> JointState,
        ticks: u32,
    ) -> Option<(u32, Trip)> {
        let (mut guard, mut ledger) = (Guard::new(limits(), 6, 1_000), Ledger::of_joints(6));
        (0..ticks).find_map(|tick| {
            let state = motion(f64::from(tick) * PERIOD_S);
            let mut cycle_state = CycleState::begin(Tick { number: u64::from(tick) + 10, ..Tick::default() });
            let joints = if tick.is_multiple_of(every) { JointSet::of(2) } else { JointSet::EMPTY };
            (cycle_state.due, cycle_state.taken) = (joints, joints);
            let mut setpoint = Setpoint::default();
            setpoint.position_rad[2] = state.position_rad;
            setpoint.velocity_rad_s[2] = state.velocity_rad_s;
            setpoint.acceleration_rad_s2[2] = state.acceleration_rad_s2;
            let restart = tick == 0;
            let command =
                guard.limit(&RequestedSetpoint { setpoint, restart, live: true }, &ledger, &mut cycle_state);
            ledger.record(&command, restart, &mut cycle_state);
            cycle_state.trip.map(|trip| (tick, trip))
        })
    }

    #[test]
    fn guard_with_decimated_setpoints_trips_on_what_the_drive_is_sent_and_on_nothing_else() {
        let smooth = wave(0.5, 4.0);
        for every in [1, 2, 4, 10] {
            assert_eq!(first_trip_sent_every(every, &smooth, 5_000), None, "every {every}");
            // A leap of the commands is seen in the cycle in which it comes, sent or not.
            let leap = |t: f64| {
                let state = smooth(t);
                let by_rad = if t > 1.0 { 0.1 } else { 0.0 };
                JointState { position_rad: state.position_rad + by_rad, ..state }
            };
            let (tick, trip) = first_trip_sent_every(every, leap, 5_000).unwrap();
            assert_eq!((tick, trip.joint), (1_001, 2), "every {every}: {trip:?}");
        }
    }

    #[test]
    fn guard_on_each_planted_fault_names_kind_and_joint() {
        let smooth = wave(0.5, 4.0);
        let table: [(Spoil, Expected); 5] = [
            (|s| JointState { position_rad: f64::NAN, ..s }, |k| k == TripKind::NotFinite),
            (|s| JointState { acceleration_rad_s2: f64::INFINITY, ..s }, |k| k == TripKind::NotFinite),
            (
                |s| JointState { position_rad: s.position_rad + 1e-5, ..s },
                |k| k == TripKind::Limit(Quantity::Jerk),
            ),
            (
                |s| JointState { velocity_rad_s: s.velocity_rad_s + 0.1, ..s },
                |k| k == TripKind::Inconsistent(Quantity::Velocity),
            ),
            (
                |s| JointState { acceleration_rad_s2: s.acceleration_rad_s2 - 3.0, ..s },
                |k| k == TripKind::Inconsistent(Quantity::Acceleration),
            ),
        ];
        for (row, (spoil, expected)) in table.into_iter().enumerate() {
            let corrupted = |t: f64| if t > 1.0 { spoil(smooth(t)) } else { smooth(t) };
            let (tick, trip) = first_trip(corrupted, 5_000).unwrap_or_else(|| panic!("row {row} passed"));
            assert_eq!((tick, trip.joint), (1_001, 2), "row {row}: {trip:?}");
            assert!(expected(trip.kind), "row {row}: {trip:?}");
        }
    }

    #[test]
    fn guard_on_too_much_of_each_quantity_trips() {
        for (amplitude_rad, rate, what) in [(2.9, 1.6, "velocity"), (0.3, 12.0, "rates"), (4.0, 0.5, "range")]
        {
            let (_, trip) = first_trip(wave(amplitude_rad, rate), 20_000).unwrap_or_else(|| panic!("{what}"));
            let stopped_early = trip.kind == TripKind::CannotStop;
            assert!(stopped_early || matches!(trip.kind, TripKind::Limit(_)), "{what}: {trip:?}");
        }
    }

    /// Independent: small steps of the hardest braking instead of the closed form.
    #[test]
    fn guard_reach_agrees_with_stepping_through_the_hardest_braking() {
        let (a_max, j) = (30.0, 600.0);
        let mut reached = 0;
        for seed in 0..2_000_u32 {
            let part = |k: u32| f64::from(seed.wrapping_mul(2_654_435_761).rotate_left(k) >> 16) / 65_536.0;
            let (v0, a0) = (part(3) * 6.0 - 3.0, part(17) * 60.0 - 30.0);
            let (mut q, mut v, mut a, mut farthest) = (0.0_f64, v0, a0, 0.0_f64);
            let dt = 1e-6;
            for _ in 0..400_000 {
                a = (a - j * dt).max(-a_max);
                v += a * dt;
                q += v * dt;
                farthest = farthest.max(q);
                if v < 0.0 && a < 0.0 {
                    break;
                }
            }
            let closed = reach_rad(v0, a0, a_max, j);
            reached += u32::from(closed > 0.0);
            assert!(
                (closed - farthest).abs() < 1e-4,
                "seed {seed}: v {v0}, a {a0}: {closed} against {farthest}"
            );
        }
        assert!(reached > 500, "only {reached} moved on");
    }
}
