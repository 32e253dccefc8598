//! What no arm may do, checked on the setpoints that reached its drives and on its phases.
//!
//! Every rule is stated by the limits of the robot and by the settings; tolerances are those of the encoding
//! ([`SetpointReader::rounding_rad`]) and of finite differences (`rates.rs`).
use super::path::Path;
use super::phase_rules::{ArmView, PhaseRules, moves};
use super::rates::Rates;
use super::setpoint_reader::{ReadSetpoint, SetpointReader};
use std::collections::BTreeMap;
use std::fmt;
use taustream_arm::Settings;
use taustream_messages::{Command, Phase};
use taustream_motion::{JointLimits, Trajectory};
use taustream_streamer::report::CycleRecord;

/// The first setpoint after a drive was energised is where its joint stands, up to what it sags in a few cycles, rad.
const STANDS_RAD: f64 = 5e-3;
/// After so many cycles it may have sagged further.
const STANDS_CYCLES: u64 = 5;
/// Relative and absolute excess of a velocity that is taken for rounding.
const SLACK: f64 = 1e-3;
/// Excess of a position over its limit that is taken for rounding, rad.
const POSITION_SLACK_RAD: f64 = 1e-6;
/// Cycles whose records are kept: frames may wait in a queue.
const RECORDS: usize = 2_000;
/// Violations of one rule that are kept; more repeat them.
const VIOLATIONS_MAX: usize = 5;

/// The rule that was broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// A setpoint is further from the one before than the joint may move in the time between.
    Continuity,
    /// Velocity, acceleration or jerk are beyond their limits.
    Rate,
    /// A setpoint is outside the position limits.
    Range,
    /// A setpoint is not on the path, or not the one that the log claims.
    OnPath,
    /// A setpoint changes while the arm is to stand.
    Standing,
    /// A phase lasts too long, a drive is energised without `enable`, a joint moves that should rest.
    Phase,
    /// The arm cannot be moved to a goal after everything is whole again.
    Recovery,
}

/// Something that no arm may do.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// The cycle.
    pub tick: u64,
    /// The rule.
    pub rule: Rule,
    /// What happened.
    pub text: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tick {}: {:?}: {}", self.tick, self.rule, self.text)
    }
}

/// What is known of one joint.
#[derive(Clone, Debug)]
struct Joint {
    limits: JointLimits,
    rounding_rad: f64,
    every: u64,
    rates: Rates,
    /// Newest setpoint that reached the drive while it was enabled.
    last: Option<(u64, f64)>,
    /// When its drive came on, and where the joint was.
    came_on: Option<(u64, f64)>,
    enabled: bool,
}

/// Reads everything that happens to an arm.
#[derive(Clone, Debug)]
pub struct Checker {
    reader: SetpointReader,
    joints: Vec<Joint>,
    path: Path,
    phases: PhaseRules,
    period_s: f64,
    base_tolerance_rad: f64,
    records: BTreeMap<u64, (CycleRecord, bool)>,
    newest: Option<CycleRecord>,
    violations: Vec<Violation>,
    compared: u64,
}

impl Checker {
    /// A checker of an arm that stands still.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let reader = SetpointReader::new(settings);
        let period_s = f64::from(settings.cycle.period_us) * 1e-6;
        let limits = settings.robot.limits();
        let joint = |(joint, limits): (usize, &JointLimits)| {
            let (rounding_rad, every) = (reader.rounding_rad(joint), reader.every(joint));
            #[expect(clippy::cast_precision_loss, reason = "at most 10")]
            let step_s = every as f64 * period_s;
            let rates = Rates::new([limits.motion, limits.stop], rounding_rad, step_s);
            Joint { limits: *limits, rounding_rad, every, rates, last: None, came_on: None, enabled: false }
        };
        let joints = limits.iter().take(settings.robot.joints.len()).enumerate().map(joint).collect();
        Self {
            joints,
            reader,
            path: Path::default(),
            phases: PhaseRules::new(settings),
            period_s,
            base_tolerance_rad: settings.supervision.base_tolerance_rad,
            records: BTreeMap::new(),
            newest: None,
            violations: Vec::new(),
            compared: 0,
        }
    }

    /// Decodes frames as the drives do.
    #[must_use]
    pub fn reader(&self) -> &SetpointReader {
        &self.reader
    }

    /// What was found.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// Setpoints of moving joints that were compared with a path.
    #[must_use]
    pub fn compared(&self) -> u64 {
        self.compared
    }

    /// Notes a violation.
    pub fn report(&mut self, tick: u64, rule: Rule, text: String) {
        let before = self.violations.iter().filter(|violation| violation.rule == rule).count();
        if before < VIOLATIONS_MAX {
            self.violations.push(Violation { tick, rule, text });
        }
    }

    /// A trajectory was offered under this id: from rest, or as the successor of what runs from its cut on.
    pub fn offered(&mut self, id: u64, trajectory: &Trajectory, from_s: Option<[f64; 2]>) {
        self.path.offer(id, trajectory.clone(), from_s);
    }

    /// A command was accepted.
    pub fn accepted(&mut self, command: Command) {
        self.phases.accepted(command);
        if command == Command::TorqueOff {
            // The frame that de-energises a drive carries where its joint was measured, behind what it was commanded in motion.
            for joint in &mut self.joints {
                joint.rates.restart();
                joint.last = None;
            }
        }
    }

    /// The loop stood still before this cycle.
    pub fn stalled(&mut self) {
        self.path.part();
    }

    /// What the streamer claims of a cycle.
    pub fn cycle(&mut self, cycle: &CycleRecord) {
        if cycle.lost.iter().any(|lost| *lost > 0) {
            self.path.part();
        }
        let on_path = cycle.trajectory_id != 0
            && matches!(
                cycle.phase,
                Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping | Phase::FastStopping
            );
        if on_path {
            let limits = [self.period_s, self.base_tolerance_rad];
            if let Some(text) = self.path.check(cycle, self.joints.len(), limits) {
                self.report(cycle.tick, Rule::OnPath, text);
            }
        }
        let goes_on = self.path.goes_on(cycle.trajectory_id);
        let before = self.newest.replace(*cycle);
        let constant = before.is_some_and(|before| {
            before.phase == Phase::Moving
                && (before.sigma - cycle.sigma).abs() < 1e-12
                && (before.trajectory_id == cycle.trajectory_id || before.trajectory_id != 0 && goes_on)
        });
        let beside = cycle.off_path_rad.iter().any(|off| off.abs() > self.base_tolerance_rad);
        let steady = constant && cycle.phase == Phase::Moving && !beside;
        self.records.insert(cycle.tick, (*cycle, steady));
        if self.records.len() > RECORDS {
            self.records.pop_first();
        }
    }

    /// A setpoint has reached the drive of its joint, which stands at `at_rad`; `tick` is the cycle that handed it over.
    pub fn reached(&mut self, setpoint: ReadSetpoint, tick: u64, (enabled, at_rad): (bool, f64)) {
        let Some(joint) = self.joints.get_mut(setpoint.joint) else { return };
        if !enabled {
            joint.rates.restart();
            (joint.last, joint.came_on, joint.enabled) = (None, None, false);
            return;
        }
        if !joint.enabled {
            (joint.enabled, joint.came_on) = (true, Some((tick, at_rad)));
        }
        let record = self.records.get(&tick).copied();
        let before = self.records.range(..tick).next_back().map(|(_, (record, _))| *record);
        let stands = |cycle: CycleRecord| !moves(cycle.phase) && !is_fading(&cycle);
        let stands = record.is_some_and(|(record, _)| stands(record)) && before.is_some_and(stands);
        let mut found = joint.check(setpoint.position_rad, tick, stands);
        if let Some((record, steady)) = record {
            let follows = matches!(record.phase, Phase::Holding | Phase::Paused) || moves(record.phase);
            self.compared += u64::from(moves(record.phase));
            found.extend(joint.compare(&setpoint, record.position_rad[setpoint.joint], follows));
            found.extend(joint.rate(setpoint.position_rad, tick, steady));
        } else {
            joint.rates.restart();
        }
        joint.last = Some((tick, setpoint.position_rad));
        for (rule, text) in found {
            self.report(tick, rule, format!("joint {}: {text}", setpoint.joint + 1));
        }
    }

    /// The arm after a cycle.
    pub fn observe(&mut self, view: &ArmView) {
        for text in self.phases.check(view) {
            self.report(view.tick, Rule::Phase, text);
        }
        for (joint, enabled) in self.joints.iter_mut().zip(view.enabled) {
            if !enabled {
                joint.rates.restart();
                (joint.last, joint.came_on, joint.enabled) = (None, None, false);
            }
        }
    }
}

/// Joints that a stall has parted are being brought together: an arm that it has paused still moves by that.
fn is_fading(cycle: &CycleRecord) -> bool {
    cycle.off_path_rad.iter().any(|off_rad| off_rad.abs() > 0.0)
}

impl Joint {
    /// Continuity, range, and standing still.
    fn check(&mut self, position_rad: f64, tick: u64, stands: bool) -> Vec<(Rule, String)> {
        let mut found = Vec::new();
        let [low, high] = self.limits.position_rad;
        let slack_rad = POSITION_SLACK_RAD + self.rounding_rad;
        if position_rad < low - slack_rad || position_rad > high + slack_rad {
            found.push((Rule::Range, format!("commanded {position_rad} rad, outside {low} to {high}")));
        }
        match self.last {
            Some((before, last_rad)) => {
                let step_rad = (position_rad - last_rad).abs();
                let periods = tick.saturating_sub(before);
                #[expect(clippy::cast_precision_loss, reason = "periods of one run")]
                let elapsed_s = periods as f64 * self.rates.step_s() / self.every as f64;
                let most_rad = self.limits.stop.velocity_rad_s * (1.0 + SLACK) * elapsed_s;
                if step_rad > most_rad + 2.0 * self.rounding_rad {
                    let text = format!("a step of {step_rad:e} rad in {elapsed_s} s, at most {most_rad:e}");
                    found.push((Rule::Continuity, text));
                }
                // From one code to its neighbour a constant angle never goes.
                if stands && step_rad > self.rounding_rad {
                    found.push((
                        Rule::Standing,
                        format!("the setpoint of a standing arm moves {step_rad:e} rad"),
                    ));
                }
            }
            None => {
                if let Some((since, at_rad)) = self.came_on
                    && tick.saturating_sub(since) <= STANDS_CYCLES
                {
                    let off_rad = (position_rad - at_rad).abs();
                    if off_rad > STANDS_RAD + 2.0 * self.rounding_rad {
                        let text = format!("energised at {at_rad} rad and commanded {position_rad} rad");
                        found.push((Rule::Continuity, text));
                    }
                }
            }
        }
        found
    }

    /// The frame against the log.
    fn compare(&self, setpoint: &ReadSetpoint, claimed_rad: f64, follows: bool) -> Option<(Rule, String)> {
        let off_rad = (setpoint.position_rad - claimed_rad).abs();
        let most_rad = self.rounding_rad * (1.0 + 1e-6) + 1e-9;
        let wrong = follows && off_rad > most_rad;
        wrong.then(|| (Rule::OnPath, format!("the frame is {off_rad:e} rad beside the logged setpoint")))
    }

    /// Velocity, acceleration and jerk over setpoints without a gap.
    fn rate(&mut self, position_rad: f64, tick: u64, steady: bool) -> Option<(Rule, String)> {
        let adjacent = self.last.is_some_and(|(before, _)| tick == before + self.every);
        if !adjacent {
            self.rates.restart();
        }
        let excess = self.rates.push(position_rad, steady)?;
        let limits = if excess.of_motion { "motion" } else { "stop" };
        let super::rates::Excess { quantity, value, limit, step_s, .. } = excess;
        Some((Rule::Rate, format!("{quantity} {value} over {step_s} s, {limits} limit {limit}")))
    }
}
