//! Where the arm should be: the trajectory that runs, its time, and the scale at which that time passes.
//!
//! Everything is counted from the last setpoint that left. A cycle that was skipped, or whose frames were
//! refused, therefore costs nothing but a longer step, up to the gap that the drives bridge. Beyond it the drives
//! have stopped by themselves: trajectory time stays where the last setpoint was, and sigma starts from 0.
//!
//! An accepted replacement waits ([`Successor`]) until trajectory time reaches its cut. Trajectory time, sigma and approach
//! go on through the cut: both trajectories give the same position, velocity, acceleration and jerk there.
use crate::approach::{Approach, ApproachLimits};
use crate::cycle_state::{CycleState, Decision, TrajectoryResult};
use crate::intake::Boxed;
use crate::last_sent::Ledger;
use crate::successor::{CutRefusal, Successor, Waiting};
use taustream_arm::Settings;
use taustream_messages::trajectory::is_newer;
use taustream_messages::{Phase, Replaces};
use taustream_motion::peaks_ahead::PeaksAhead;
use taustream_motion::stopping::{Situation, SpeedRequest, StopRules};
use taustream_motion::time_scale::{Scale, TimeScale, scaled};
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, Setpoint};

/// Settled scales are restarted after this many periods, so that their time axis stays short and exact.
const AXIS_PERIODS_MAX: u64 = 60_000;

/// What the guard is asked to let pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequestedSetpoint {
    /// The setpoint, its derivatives by real time.
    pub setpoint: Setpoint,
    /// The drives are at rest at this pose: earlier commands do not count.
    pub restart: bool,
    /// The drives follow what is commanded.
    pub live: bool,
}

/// A point of the track; `sent` is the last that left, `next` the one being sent.
#[derive(Clone, Copy, Debug, Default)]
struct TrackState {
    tick: u64,
    s: f64,
    /// Periods on the scale's time axis.
    axis: u64,
    /// Periods since the approach began.
    approach: u64,
    /// The waiting trajectory made the setpoint.
    took_over: bool,
}

/// The trajectory that runs, or the pose that is held.
#[derive(Debug)]
pub struct Track {
    joints: usize,
    period_s: f64,
    tolerated_periods: u64,
    /// Longest gap over which the motion continues; more than the tolerated one where a stall is bridged.
    bridged_periods: u64,
    base_tolerance_rad: f64,
    stop_rules: StopRules,
    approach_limits: ApproachLimits,
    scale: TimeScale,
    running: Option<Boxed>,
    cursor: Cursor,
    successor: Successor,
    approach: Approach,
    starting: bool,
    restart: bool,
    newest_generation: u64,
    sent: TrackState,
    next: TrackState,
}

impl Track {
    /// A track that holds the zero pose until [`Self::commit`].
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let (limits, joints) = (settings.robot.limits(), settings.robot.joints.len());
        let (cycle, supervision) = (&settings.cycle, &settings.supervision);
        Self {
            joints,
            period_s: f64::from(cycle.period_us) * 1e-6,
            tolerated_periods: u64::from(cycle.tolerated_gap_periods).max(1),
            bridged_periods: u64::from(settings.bridged_gap_periods()).max(1),
            base_tolerance_rad: supervision.base_tolerance_rad,
            stop_rules: StopRules::new(&limits, joints),
            approach_limits: ApproachLimits::new(&limits, joints),
            scale: TimeScale::settled(0.0),
            running: None,
            cursor: Cursor::default(),
            successor: Successor::default(),
            approach: Approach::default(),
            starting: false,
            restart: true,
            newest_generation: 0,
            sent: TrackState::default(),
            next: TrackState::default(),
        }
    }

    /// Takes an offered trajectory over, or says why not. Returns the box that is not needed.
    ///
    /// The decisions here are those that only this moment can tell; everything else was checked before.
    ///
    /// Real time: no allocation, nothing is freed.
    pub fn splice(
        &mut self,
        offer: Option<Boxed>,
        (phase, sigma): (Phase, f64),
        ledger: &Ledger,
        cycle_state: &mut CycleState,
    ) -> Option<Boxed> {
        let offer = offer?;
        let hold_position_rad = ledger.position_rad();
        let decision = self.decide(&offer, phase, &hold_position_rad, cycle_state.tick.number);
        cycle_state.trajectory_result = Some(TrajectoryResult {
            trajectory_id: offer.trajectory_id,
            generation: offer.generation,
            decision,
        });
        match decision {
            Decision::Accepted { .. } => {}
            Decision::Waits { from_s } => {
                self.newest_generation = offer.generation;
                return self.successor.put(offer, from_s);
            }
            Decision::Stale { .. }
            | Decision::NotAtBase { .. }
            | Decision::NotReady { .. }
            | Decision::Cut(_) => return Some(offer),
        }
        self.newest_generation = offer.generation;
        self.cursor = Cursor::at_start(&offer.trajectory);
        self.scale = TimeScale::settled(sigma);
        (self.sent.s, self.sent.axis) = (0.0, 0);
        let base_rad = offer.trajectory.base_rad();
        self.approach = Approach::while_moving(&hold_position_rad, base_rad, &self.approach_limits);
        self.sent.approach = 0;
        (self.starting, self.restart) = (true, true);
        self.running.replace(offer)
    }

    fn decide(&self, offer: &Boxed, phase: Phase, hold_position_rad: &JointArray, tick: u64) -> Decision {
        if !is_newer(offer.generation, self.newest_generation) {
            return Decision::Stale { newest: self.newest_generation };
        }
        if matches!(offer.replaces, Replaces::Cut { .. }) {
            let moves = matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused);
            let Some(running) = self.running.as_ref().filter(|_| moves) else {
                return Decision::Cut(CutRefusal::NothingToCut { phase });
            };
            return match self.successor.check(offer, (running, self.sent.s)) {
                Ok(from_s) => {
                    // A change of speed that runs was chosen for what ran ahead until now.
                    let situation = self.situation(running.ahead_into(from_s, offer));
                    let holds = self.stop_rules.holds(&self.scale, &situation);
                    if holds { Decision::Waits { from_s } } else { Decision::Cut(CutRefusal::SpeedChanges) }
                }
                Err(refusal) => Decision::Cut(refusal),
            };
        }
        if phase != Phase::Holding {
            return Decision::NotReady { phase };
        }
        let base = offer.trajectory.base_rad().iter().zip(hold_position_rad);
        for (joint, (base_rad, hold_position_rad)) in base.enumerate().take(self.joints) {
            let by_rad = (base_rad - hold_position_rad).abs();
            if by_rad.is_nan() || by_rad > self.base_tolerance_rad {
                return Decision::NotAtBase { joint, by_rad };
            }
        }
        Decision::Accepted { tick }
    }

    /// The setpoint of this tick.
    ///
    /// Real time: touches only the strokes that run.
    pub fn sample(&mut self, live: bool, ledger: &Ledger, cycle_state: &mut CycleState) -> RequestedSetpoint {
        let tick = cycle_state.tick.number;
        let periods = tick.saturating_sub(self.sent.tick).max(1);
        self.shorten_axis();
        cycle_state.gap_s = self.seconds(periods);
        cycle_state.live = live;
        self.next = TrackState { tick, took_over: false, ..self.sent };
        let mut setpoint = Setpoint { position_rad: ledger.position_rad(), ..Setpoint::default() };
        let mut restart = self.restart;
        if let Some(running) = &self.running {
            cycle_state.trajectory_id = running.trajectory_id;
            cycle_state.bridged =
                periods > self.tolerated_periods && periods <= self.bridged_periods && !self.starting;
            if periods > self.bridged_periods && !self.starting {
                self.scale = TimeScale::settled(0.0);
                (self.sent.axis, self.next.axis) = (0, 0);
                (cycle_state.frozen, restart) = (true, true);
                // The drives stand where each was commanded last; the approach brings the joints together again.
                let reached_rad = running.trajectory.sample(self.sent.s).position_rad;
                let (held_rad, limits) = (&setpoint.position_rad, &self.approach_limits);
                self.approach = Approach::while_standing(held_rad, &reached_rad, limits);
                (self.sent.approach, self.next.approach) = (0, 0);
            } else {
                let step = if self.starting { 0 } else { periods };
                self.next.axis = self.sent.axis + step;
                let (from_s, to_s) = (self.seconds(self.sent.axis), self.seconds(self.next.axis));
                let s = self.sent.s + self.advance_s(from_s, to_s, step);
                let waiting = self.successor.waiting().filter(|_| self.successor.takes_over_at(s));
                let active = waiting.map_or(running, |waiting| &waiting.trajectory);
                (self.next.took_over, cycle_state.trajectory_id) = (waiting.is_some(), active.trajectory_id);
                let end_s = active.trajectory.duration_s();
                self.next.s = s.min(end_s).max(self.sent.s);
                cycle_state.scale = self.scale.sample(to_s);
                self.next.approach = self.sent.approach + step;
                let approach_s = self.seconds(self.next.approach);
                let of_successor =
                    if self.next.took_over { self.successor.sample(self.next.s) } else { None };
                let sampled =
                    of_successor.unwrap_or_else(|| self.cursor.sample(&running.trajectory, self.next.s));
                setpoint = scaled(sampled, cycle_state.scale, self.joints);
                cycle_state.off_path_rad = self.approach.add_to(&mut setpoint, approach_s);
                cycle_state.end_reached = self.next.s >= end_s && self.approach.has_ended(approach_s);
                keep_stopped(ledger, &mut setpoint, &mut cycle_state.off_path_rad);
            }
            let now_s = self.seconds(self.next.axis);
            let approached = self.approach.has_ended(self.seconds(self.next.approach));
            cycle_state.at_rest = self.stands(now_s) && approached;
        }
        cycle_state.trajectory_s = self.next.s;
        RequestedSetpoint { setpoint, restart, live }
    }

    /// How far the pose that was held is from the base of the trajectory that runs, rad.
    #[must_use]
    pub fn start_offset_rad(&self) -> &JointArray {
        self.approach.offset_rad()
    }

    /// Notes what left: `position_rad` is what the guard let pass. Returns the box of a trajectory whose successor has
    /// taken over: only when a setpoint of it has left, because until then a stall may keep trajectory time before the cut.
    ///
    /// Real time: a copy; nothing is freed.
    pub fn commit(
        &mut self,
        position_rad: &JointArray,
        ledger: &Ledger,
        cycle_state: &mut CycleState,
    ) -> Option<Boxed> {
        let mut replaced = None;
        if cycle_state.setpoints_sent() {
            if let Some(Waiting { trajectory, cursor, .. }) =
                if self.next.took_over { self.successor.take() } else { None }
            {
                self.cursor = cursor;
                replaced = self.running.replace(trajectory);
                cycle_state.took_over = true;
            }
            self.sent = self.next;
            (self.starting, self.restart) = (false, false);
        }
        // Where setpoints take turns, the last ones of a motion are still to come: it ends when all are sent.
        let tick = cycle_state.tick.number;
        let joints = position_rad.iter().zip(&cycle_state.unreachable).enumerate().take(self.joints);
        let all_sent = !joints
            .filter(|(_, (_, unreachable))| !**unreachable)
            .any(|(joint, (position_rad, _))| ledger.awaits(joint, *position_rad, tick));
        cycle_state.end_reached &= all_sent;
        cycle_state.at_rest &= all_sent;
        let all_unreachable =
            cycle_state.unreachable.iter().take(self.joints).all(|unreachable| *unreachable);
        if self.running.is_some() && all_unreachable {
            // Joints that stand beside the path stay there: no setpoint can bring them back.
            let now_s = self.seconds(self.next.axis);
            cycle_state.at_rest = self.stands(now_s);
        }
        cycle_state.commanded_rad = *ledger.commanded_rad();
        cycle_state.can_ramp = self.scale.can_change(self.seconds(self.sent.axis));
        replaced
    }

    /// Changes the speed along the path from the last setpoint on.
    ///
    /// Real time: bounded work, see [`StopRules::apply`]; no allocation.
    pub fn change_speed(&mut self, request: SpeedRequest) {
        let Some(running) = &self.running else { return };
        let ahead = match self.successor.waiting() {
            Some(Waiting { trajectory, from_s, .. }) => running.ahead_into(*from_s, trajectory),
            None => running.ahead(),
        };
        let situation = self.situation(ahead);
        self.stop_rules.apply(request, &mut self.scale, &situation);
    }

    /// The state in which the speed along the path is changed.
    fn situation<'a>(&self, ahead: PeaksAhead<'a>) -> Situation<'a> {
        let (now_s, approach_s) = (self.seconds(self.sent.axis), self.seconds(self.sent.approach));
        // Where joints were parted while trajectory time stands, it waits until they are together again.
        let waits_s = if self.stands(now_s) { self.approach.rest_s(approach_s) } else { 0.0 };
        let approaching = waits_s <= 0.0 && !self.approach.has_ended(approach_s);
        Situation { now_s, s: self.sent.s, ahead, approaching, waits_s }
    }

    /// Trajectory time does not pass.
    fn stands(&self, now_s: f64) -> bool {
        self.scale.requested() <= 0.0 && self.scale.is_settled(now_s)
    }

    /// Clears the trajectory and holds the last pose that left. Returns the box.
    ///
    /// Real time: nothing is freed.
    pub fn drop_trajectory(&mut self) -> Option<Boxed> {
        (self.starting, self.restart) = (false, true);
        self.sent.s = 0.0;
        self.scale = TimeScale::settled(0.0);
        self.sent.axis = 0;
        self.running.take()
    }

    /// Clears the trajectory that waits. Returns the box.
    ///
    /// Real time: nothing is freed.
    pub fn drop_successor(&mut self) -> Option<Boxed> {
        self.successor.take().map(|waiting| waiting.trajectory)
    }

    /// The commanded pose was set from outside: earlier commands do not count.
    ///
    /// Real time: stores a flag.
    pub fn restart(&mut self) {
        self.restart = true;
    }

    /// The trajectory that runs.
    #[must_use]
    pub fn running(&self) -> Option<&Boxed> {
        self.running.as_ref()
    }

    /// The trajectory that waits.
    #[must_use]
    pub fn waiting(&self) -> Option<&Waiting> {
        self.successor.waiting()
    }

    /// The newest generation accepted.
    #[must_use]
    pub fn newest_generation(&self) -> u64 {
        self.newest_generation
    }

    /// The scale at the last setpoint that left.
    #[must_use]
    pub fn scale(&self) -> Scale {
        self.scale.sample(self.seconds(self.sent.axis))
    }

    /// A settled scale advances by a product: no rounding of long times enters.
    fn advance_s(&self, from_s: f64, to_s: f64, periods: u64) -> f64 {
        if self.scale.is_settled(from_s) {
            self.scale.requested() * self.seconds(periods)
        } else {
            self.scale.advance_s(from_s, to_s)
        }
    }

    fn shorten_axis(&mut self) {
        if self.sent.axis > AXIS_PERIODS_MAX && self.scale.is_settled(self.seconds(self.sent.axis)) {
            self.scale = TimeScale::settled(self.scale.requested());
            self.sent.axis = 0;
        }
    }

    fn seconds(&self, periods: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "2^53 periods are longer than any machine lives")]
        let count = periods as f64;
        count * self.period_s
    }
}

/// A drive that has stopped for want of setpoints gets none but that of where it stands: any other would be a step.
fn keep_stopped(ledger: &Ledger, setpoint: &mut Setpoint, off_path_rad: &mut JointArray) {
    for (joint, last) in ledger.joints().iter().enumerate().filter(|(_, last)| last.stopped) {
        off_path_rad[joint] += last.position_rad[0] - setpoint.position_rad[joint];
        setpoint.position_rad[joint] = last.position_rad[0];
        setpoint.velocity_rad_s[joint] = 0.0;
        setpoint.acceleration_rad_s2[joint] = 0.0;
        setpoint.jerk_rad_s3[joint] = 0.0;
    }
}
