//! The rules that every history keeps, and how a log is checked for them.
//!
//! Rates are finite differences of the setpoints that reached a drive, over steps of 1, 3 and 10 cycles. A difference is an average of
//! the derivative, so that a motion inside its limits cannot exceed them but by rounding.
use super::log::{Cycle, Log};
use crate::harness::JOINTS;
use std::fmt;
use taustream_messages::Phase;
use taustream_motion::LimitSet;
use taustream_motion::range::POSITION_TOLERANCE_RAD;

/// Cycles that the steps of differences span.
const WIDTHS: [usize; 3] = [1, 3, 10];
/// Rounding of positions of some rad, over the cube of a period of 1 ms.
const SLACK: f64 = 1e-5;
/// Relative excess that is rounding of a proof or a ramp.
const RELATIVE: f64 = 1e-4;
/// A setpoint is its trajectory at its time to the rounding of one sum.
const PATH_RAD: f64 = 1e-12;
/// Without setpoints for longer than this a drive may have been de-energised, cycles.
const GAP_MAX: u64 = 60;

/// What may not happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// A setpoint is at most the velocity limit times the elapsed time from the one before.
    Continuity,
    /// Differences keep the stop limits.
    StopRate,
    /// At constant speed on the path, the motion limits.
    MotionRate,
    /// Setpoints are inside the position limits.
    Range,
    /// A logged setpoint is its trajectory at its time, and the drive got it.
    OnPath,
    /// Trajectory time goes on, and never faster than real time.
    Time,
    /// A replacement makes every setpoint from its cut on, and none before.
    Takeover,
    /// An arm that rests does not move.
    Standing,
    /// A stop ends in time.
    Stop,
    /// Spoiled and late messages are refused.
    Hostile,
    /// The guard never trips.
    Guard,
    /// The history ends at rest.
    End,
}

#[derive(Debug)]
pub struct Violation {
    pub rule: Rule,
    text: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.rule, self.text)
    }
}

/// Everything that is wrong with a history.
pub fn violations(log: &Log) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut report = |rule: Rule, text: String| found.push(Violation { rule, text });
    for joint in 0..JOINTS {
        check_drive(log, joint, &mut report);
    }
    check_cycles(log, &mut report);
    check_stops(log, &mut report);
    for text in &log.swallowed {
        report(Rule::Hostile, text.clone());
    }
    if log.guard_trips > 0 {
        report(Rule::Guard, format!("{} trips", log.guard_trips));
    }
    if !matches!(log.end, Phase::Holding | Phase::Paused | Phase::Fault | Phase::Disabled | Phase::Locked) {
        report(Rule::End, format!("{:?}", log.end));
    }
    found
}

type Report<'a> = dyn FnMut(Rule, String) + 'a;

/// The arm runs at constant speed on its path.
fn is_steady(pair: &[Cycle]) -> bool {
    let [before, now] = pair else { return false };
    let beside = now.off_path_rad.iter().chain(&before.off_path_rad).any(|off_rad| *off_rad != 0.0);
    now.phase == Phase::Moving && before.phase == Phase::Moving && before.sigma == now.sigma && !beside
}

/// The cycles after which a difference over `span` cycles is one of constant speed.
fn steady_since(log: &Log) -> Vec<(u64, u64)> {
    let mut since = Vec::new();
    let mut from = None;
    for pair in log.cycles.windows(2) {
        let goes_on = is_steady(pair) && pair[1].tick == pair[0].tick + 1;
        let begin = if goes_on { *from.get_or_insert(pair[0].tick) } else { pair[1].tick };
        from = goes_on.then_some(begin);
        since.push((pair[1].tick, begin));
    }
    since
}

fn check_drive(log: &Log, joint: usize, report: &mut Report<'_>) {
    let (setpoints, limits) = (&log.drives[joint], &log.limits[joint]);
    let [low, high] = limits.position_rad;
    let steady = steady_since(log);
    let mut run = 0;
    for (index, &(tick, position_rad)) in setpoints.iter().enumerate() {
        let inside = low - POSITION_TOLERANCE_RAD..=high + POSITION_TOLERANCE_RAD;
        if !inside.contains(&position_rad) {
            report(Rule::Range, format!("joint {joint} at {position_rad} rad, tick {tick}"));
        }
        let Some(&(before, last_rad)) = index.checked_sub(1).map(|before| &setpoints[before]) else {
            continue;
        };
        let gap = tick - before;
        let step_rad = (position_rad - last_rad).abs();
        let most_rad = limits.stop.velocity_rad_s * (1.0 + RELATIVE) * gap as f64 * log.period_s;
        if gap <= GAP_MAX && step_rad > most_rad {
            report(Rule::Continuity, format!("joint {joint} steps {step_rad:e} rad, tick {tick}"));
        }
        if gap != 1 {
            run = index;
        }
        let since = steady.binary_search_by_key(&tick, |(tick, _)| *tick).map_or(tick, |at| steady[at].1);
        for width in WIDTHS {
            let at = |steps: usize| {
                index.checked_sub(steps * width).filter(|at| *at >= run).map(|at| setpoints[at].1)
            };
            let step_s = width as f64 * log.period_s;
            let [Some(p), Some(q)] = [at(0), at(1)] else { break };
            let mut rates = vec![(1, (p - q) / step_s)];
            rates.extend(at(2).map(|r| (2, (p - 2.0 * q + r) / (step_s * step_s))));
            if let [Some(r), Some(t)] = [at(2), at(3)] {
                rates.push((3, (p - 3.0 * q + 3.0 * r - t) / (step_s * step_s * step_s)));
            }
            for (order, rate) in rates {
                let of = |set: &LimitSet| {
                    [set.velocity_rad_s, set.acceleration_rad_s2, set.jerk_rad_s3][order - 1]
                };
                let beyond = |limit: f64| rate.abs() > limit * (1.0 + RELATIVE) + SLACK;
                let span = (order * width) as u64;
                let (rule, limit) = if beyond(of(&limits.stop)) {
                    (Rule::StopRate, of(&limits.stop))
                } else if since + span <= tick && beyond(of(&limits.motion)) {
                    (Rule::MotionRate, of(&limits.motion))
                } else {
                    continue;
                };
                report(
                    rule,
                    format!("joint {joint}, order {order}: {rate} of {limit}, tick {tick}, over {width}"),
                );
            }
        }
    }
}

fn check_cycles(log: &Log, report: &mut Report<'_>) {
    let mut got = [0; JOINTS];
    for (index, cycle) in log.cycles.iter().enumerate() {
        if let Some(motion) = log.motion(cycle.id).filter(|_| cycle.phase != Phase::Braking) {
            let on_path_rad = motion.trajectory.sample(cycle.s).position_rad;
            let off = (0..JOINTS).find(|joint| {
                let beside_rad =
                    cycle.position_rad[*joint] - cycle.off_path_rad[*joint] - on_path_rad[*joint];
                beside_rad.abs() > PATH_RAD
            });
            if let Some(joint) = off.filter(|_| cycle.sigma > 0.0) {
                report(
                    Rule::OnPath,
                    format!("joint {joint} is beside its trajectory at tick {}", cycle.tick),
                );
            }
        } else if cycle.id != 0 && cycle.phase != Phase::Braking {
            report(Rule::OnPath, format!("trajectory {} was never accepted", cycle.id));
        }
        for (joint, got) in got.iter_mut().enumerate() {
            let drive = &log.drives[joint];
            *got += drive[*got..].iter().take_while(|(tick, _)| *tick < cycle.tick).count();
            let differs = drive.get(*got).is_some_and(|(tick, position_rad)| {
                *tick == cycle.tick && *position_rad != cycle.position_rad[joint]
            });
            if differs {
                report(
                    Rule::OnPath,
                    format!("joint {joint} got another setpoint than logged, tick {}", cycle.tick),
                );
            }
        }
        let Some(before) = index.checked_sub(1).map(|before| &log.cycles[before]) else { continue };
        check_pair(log, [before, cycle], report);
    }
}

fn check_pair(log: &Log, [before, now]: [&Cycle; 2], report: &mut Report<'_>) {
    let tick = now.tick;
    if before.id != 0 && now.id != 0 {
        let elapsed_s = (tick - before.tick) as f64 * log.period_s;
        let goes_on = now.id == before.id || log.motion(now.id).is_some_and(|motion| motion.cut_s.is_some());
        let step_s = now.s - before.s;
        // What was not sent is sampled again.
        let back = before.sent && step_s < 0.0;
        if goes_on && (back || step_s > elapsed_s + 1e-9) {
            report(Rule::Time, format!("{step_s} s in {elapsed_s} s, tick {tick}"));
        }
    }
    if let Some(motion) = log.motion(now.id).filter(|motion| motion.cut_s.is_some() && now.id != before.id) {
        let from_s = motion.from_s;
        if before.id != 0 && (before.sent && before.s > from_s || now.s < from_s) {
            report(
                Rule::Takeover,
                format!("cut at {from_s}, between {} and {}, tick {tick}", before.s, now.s),
            );
        }
    }
    // One that waits makes every setpoint from its cut on.
    let late = log.motions.iter().any(|motion| {
        motion.cut_s.is_some()
            && motion.cuts == now.id
            && now.s > motion.from_s
            && before.s > motion.from_s
            && before.id == now.id
            // What was not sent is sampled again, and a takeover is not one.
            && before.sent
            && now.sent
            && log.cycles.iter().any(|cycle| cycle.id == motion.id)
            && now.id != 0
    });
    if late {
        report(Rule::Takeover, format!("the cut has passed, and the old motion runs on, tick {tick}"));
    }
    let stands = |cycle: &Cycle| {
        let beside = cycle.off_path_rad.iter().any(|off_rad| *off_rad != 0.0);
        matches!(cycle.phase, Phase::Holding | Phase::Paused | Phase::Fault) && !beside
    };
    if stands(before) && stands(now) && before.tick + 1 == tick && before.position_rad != now.position_rad {
        report(Rule::Standing, format!("the setpoint moves in {:?}, tick {tick}", now.phase));
    }
}

/// A stop that nothing disturbs ends within the longest one of the arm.
fn check_stops(log: &Log, report: &mut Report<'_>) {
    let mut since = None;
    for pair in log.cycles.windows(2) {
        let [before, now] = pair else { continue };
        let stops = matches!(now.phase, Phase::Pausing | Phase::Stopping | Phase::FastStopping);
        let goes_on = stops && now.phase == before.phase && now.tick == before.tick + 1 && now.sent;
        since = if goes_on { since.or(Some(before.tick)) } else { None };
        if let Some(since) = since.filter(|since| now.tick - since > log.stop_cycles) {
            report(
                Rule::Stop,
                format!("{:?} since tick {since}, at most {} cycles", now.phase, log.stop_cycles),
            );
            return;
        }
    }
}
