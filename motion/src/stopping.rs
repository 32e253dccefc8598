//! How long a change of the time scale takes: as short as what runs permits, checked before it begins.
//!
//! A joint that runs at scale sigma has velocity v sigma, acceleration a sigma^2 + v sigma' and jerk
//! j sigma^3 + 3 a sigma sigma' + v sigma''. A stop is chosen when it begins, from the state of that moment: candidate
//! durations and shapes are followed through the table of the motion ahead (`peaks_ahead`), and the shortest that keeps
//! every joint inside its limits is taken. The work is bounded, and no candidate is ever taken unchecked.
//!
//! | rule | limits | so that |
//! |---|---|---|
//! | fast stop | the stop limits | it is as short as they permit |
//! | stop, pause | half of what the stop limits leave above the motion limits | it is gentler |
//! | change of speed, resume | a quarter, with all terms by magnitude, for everything between here and where the change can lead | a stop on top of it has room |
//!
//! If no candidate is found, a duration in closed form serves. It holds for every motion inside the motion limits, with a
//! change of speed running or not (docs/adr): hence a stop always exists.
use crate::peaks_ahead::{AT_REST, JointRanges, PeaksAhead, Stretch, join};
use crate::ramp::{RampShape, SHAPES};
use crate::time_scale::{RAMP_S_MAX, Ramp, Scale, TimeScale};
use crate::{JointLimits, MAX_JOINTS};

/// Shortest change, s: two setpoints at 1 kHz.
const RAMP_S_MIN: f64 = 2e-3;
/// Instants at which a candidate is checked.
const STEPS: u32 = 48;
/// Part of the limits that a candidate may use: between the instants lies the rest.
const USE: f64 = 0.99;
/// A longer candidate is this many times as long.
const LONGER: f64 = 1.2;
/// A shorter candidate is this part as long.
const SHORTER: f64 = 0.97;
/// How often a candidate is shortened.
const SHORTENED_MAX: u32 = 8;
/// What a change of speed may use of what the stop limits leave above the motion limits.
const CHANGE_SHARE: f64 = 0.25;
/// What a stop or pause may use of it.
const STOP_SHARE: f64 = 0.5;
/// What is kept of it for the approach to the base of a motion.
pub const APPROACH_SHARE: f64 = 0.1;

/// What is asked of the time scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpeedRequest {
    /// To 0 as fast as the stop limits permit.
    FastStop,
    /// To 0, gentler.
    Stop,
    /// To another speed.
    Change(f64),
}

/// The state in which something is asked.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Now, on the axis of the scale.
    pub now_s: f64,
    /// Trajectory time.
    pub s: f64,
    /// What the motion does from there on.
    pub ahead: PeaksAhead<'a>,
    /// An approach to the base of the motion is still added to it.
    pub approaching: bool,
    /// A change of speed begins only so much later: trajectory time stands until then.
    pub waits_s: f64,
}

/// Largest acceleration and jerk of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct JointBounds {
    acceleration_rad_s2: f64,
    jerk_rad_s3: f64,
}

/// The limits of a candidate.
#[derive(Clone, Copy, Debug)]
struct Rule {
    bounds: [JointBounds; MAX_JOINTS],
    /// All terms count by magnitude, and all that lies between the start and an instant counts at the instant: what holds then
    /// holds however far the motion lags behind.
    by_magnitude: bool,
}

/// What an arm's limits say about changes of the time scale.
#[derive(Clone, Copy, Debug)]
pub struct StopRules {
    joints: usize,
    fast: Rule,
    gentle: Rule,
    change: Rule,
    /// What an approach may add.
    approach: [JointBounds; MAX_JOINTS],
    stop_s: f64,
    longest_stop: (f64, &'static RampShape),
    longest_change: (f64, &'static RampShape),
}

impl StopRules {
    /// The rules of an arm.
    #[must_use]
    pub fn new(limits: &[JointLimits; MAX_JOINTS], joints: usize) -> Self {
        let rule = |share: f64, by_magnitude| Rule {
            bounds: limits.map(|limits| between(&limits, share)),
            by_magnitude,
        };
        let arm = limits.get(..joints).unwrap_or(limits);
        Self {
            joints,
            fast: rule(1.0, false),
            gentle: rule(STOP_SHARE, false),
            change: rule(CHANGE_SHARE, true),
            approach: limits.map(|limits| {
                let (all, none) = (between(&limits, APPROACH_SHARE), between(&limits, 0.0));
                JointBounds {
                    acceleration_rad_s2: all.acceleration_rad_s2 - none.acceleration_rad_s2,
                    jerk_rad_s3: all.jerk_rad_s3 - none.jerk_rad_s3,
                }
            }),
            stop_s: stop_duration_s(limits, joints),
            longest_stop: closed_form(arm, 1.0 - CHANGE_SHARE - APPROACH_SHARE, CHANGE_SHARE),
            longest_change: closed_form(arm, CHANGE_SHARE, 0.0),
        }
    }

    /// No stop from a settled speed takes longer, s.
    #[must_use]
    pub fn stop_s(&self) -> f64 {
        self.stop_s
    }

    /// No stop takes longer, s, with a change of speed running or not.
    #[must_use]
    pub fn longest_stop_s(&self) -> f64 {
        self.longest_stop.0
    }

    /// Carries a request out on a scale. A stop is never refused; nothing is changed when the scale leads to rest already,
    /// and no faster. A change of speed is refused only when [`TimeScale::can_change`] is false.
    ///
    /// Real time: at most 60 candidates of 48 instants; no allocation.
    pub fn apply(&self, request: SpeedRequest, scale: &mut TimeScale, situation: &Situation<'_>) {
        match request {
            SpeedRequest::FastStop => self.stop(scale, situation, &[&self.fast]),
            SpeedRequest::Stop => self.stop(scale, situation, &[&self.gentle, &self.fast]),
            SpeedRequest::Change(target) => self.change_speed(target, scale, situation),
        }
    }

    /// True when a scale keeps its limits with another motion ahead.
    ///
    /// Real time: one candidate.
    #[must_use]
    pub fn holds(&self, scale: &TimeScale, situation: &Situation<'_>) -> bool {
        let rule = if scale.requested() > 0.0 { &self.change } else { &self.fast };
        let rest_s = scale.settles_s() - situation.now_s;
        rest_s.is_nan() || rest_s <= 0.0 || self.follow(rule, situation, rest_s, |now_s| scale.sample(now_s))
    }

    fn stop(&self, scale: &mut TimeScale, situation: &Situation<'_>, rules: &[&Rule]) {
        scale.drop_pending(situation.now_s);
        let stops = scale.requested() <= 0.0;
        if stops && scale.is_settled(situation.now_s) {
            return;
        }
        // A stop that runs was checked: only a shorter one takes its place.
        let limit_s = if stops { scale.settles_s() - situation.now_s } else { f64::INFINITY };
        let found = rules.iter().find_map(|rule| self.find(rule, 0.0, scale, situation));
        let ramp = match found {
            Some(ramp) if ramp.duration_s >= limit_s => return,
            Some(ramp) => ramp,
            None if limit_s <= self.longest_stop.0 => return,
            None => {
                let (duration_s, shape) = self.longest_stop;
                Ramp { start_s: situation.now_s, duration_s, shape }
            }
        };
        let _slots_are_kept_back = scale.change(0.0, ramp, situation.now_s);
    }

    fn change_speed(&self, target: f64, scale: &mut TimeScale, situation: &Situation<'_>) {
        if !scale.can_change(situation.now_s) {
            return;
        }
        scale.drop_pending(situation.now_s);
        let mut ramp = self.find(&self.change, target, scale, situation).unwrap_or_else(|| {
            let (duration_s, shape) = self.longest_change;
            let start_s = scale.settles_s().max(situation.now_s);
            Ramp { start_s, duration_s, shape }
        });
        // Nothing passes until then, so what was found holds later, too.
        ramp.start_s += situation.waits_s;
        let _was_possible = scale.change(target, ramp, situation.now_s);
    }

    /// The shortest ramp to `target` that is found to keep a rule.
    fn find(&self, rule: &Rule, target: f64, scale: &TimeScale, situation: &Situation<'_>) -> Option<Ramp> {
        let longest_s = if rule.by_magnitude { self.longest_change.0 } else { self.longest_stop.0 };
        let start_s = situation.now_s;
        let passes = |duration_s: f64, shape: &'static RampShape| {
            let ramp = Ramp { start_s, duration_s, shape };
            let at = |now_s: f64| ramp.blend(scale.sample(now_s), target, now_s);
            self.follow(rule, situation, duration_s, at).then_some(ramp)
        };
        let mut duration_s = self.lower_bound_s(rule, scale.sample(start_s).sigma - target, situation);
        let [first, ..] = &SHAPES;
        let mut best = loop {
            if duration_s > longest_s {
                return None;
            }
            if let Some(ramp) = passes(duration_s, first) {
                break ramp;
            }
            duration_s *= LONGER;
        };
        let mut left = SHORTENED_MAX;
        for shape in &SHAPES {
            while left > 0
                && best.duration_s > RAMP_S_MIN
                && let Some(ramp) = passes((best.duration_s * SHORTER).max(RAMP_S_MIN), shape)
            {
                best = ramp;
                left -= 1;
            }
        }
        Some(best)
    }

    /// What no change of sigma by `rise` can be shorter than, roughly, at the velocity of now.
    fn lower_bound_s(&self, rule: &Rule, rise: f64, situation: &Situation<'_>) -> f64 {
        let mut here = AT_REST;
        situation.ahead.between([situation.s; 2], self.joints, &mut here);
        let joints = here.iter().zip(&rule.bounds).take(self.joints);
        joints.fold(RAMP_S_MIN, |longest_s, (JointRanges { velocity_rad_s: [low, high], .. }, bounds)| {
            let change_rad_s = low.abs().max(high.abs()) * rise.abs();
            let acceleration_s = change_rad_s / bounds.acceleration_rad_s2;
            let jerk_s = 2.0 * libm::sqrt(change_rad_s / bounds.jerk_rad_s3);
            longest_s.max(0.8 * acceleration_s.max(jerk_s))
        })
    }

    /// Follows a course of sigma for `duration_s` and compares with a rule.
    fn follow(
        &self,
        rule: &Rule,
        situation: &Situation<'_>,
        duration_s: f64,
        at: impl Fn(f64) -> Scale,
    ) -> bool {
        let step_s = duration_s / f64::from(STEPS);
        let mut s = situation.s;
        let mut from = at(situation.now_s);
        let mut stretch = AT_REST;
        let mut passed = stretch;
        for step in 1..=STEPS {
            let to = at(situation.now_s + f64::from(step) * step_s);
            let reached = s + 0.5 * (from.sigma + to.sigma) * step_s;
            situation.ahead.between([s, reached], self.joints, &mut stretch);
            if rule.by_magnitude {
                if step > 1 {
                    join(&mut stretch, &passed, self.joints);
                }
                passed = stretch;
            }
            if !self.keeps(rule, &stretch, &[from, to], situation.approaching) {
                return false;
            }
            (s, from) = (reached, to);
        }
        true
    }

    /// True when every joint keeps its bounds at each of the scales, whatever it does in the stretch.
    fn keeps(&self, rule: &Rule, stretch: &Stretch, scales: &[Scale], approaching: bool) -> bool {
        let bounds = rule.bounds.iter().zip(&self.approach);
        stretch.iter().zip(bounds).take(self.joints).all(|(ranges, (bounds, approach))| {
            let JointRanges { velocity_rad_s: v, acceleration_rad_s2: a, jerk_rad_s3: j } = ranges;
            let kept = if approaching { *approach } else { JointBounds::default() };
            let acceleration_max = (bounds.acceleration_rad_s2 - kept.acceleration_rad_s2) * USE;
            let jerk_max = (bounds.jerk_rad_s3 - kept.jerk_rad_s3) * USE;
            scales.iter().all(|scale| {
                let Scale { sigma, sigma_d1_s: d1, sigma_d2_s2: d2 } = *scale;
                let (square, cross) = (sigma * sigma, 3.0 * sigma * d1);
                if rule.by_magnitude {
                    let (v, a, j) = (magnitude(v), magnitude(a), magnitude(j));
                    let jerk = j * square * sigma + a * cross.abs() + v * d2.abs();
                    a * square + v * d1.abs() <= acceleration_max && jerk <= jerk_max
                } else {
                    magnitude(&sum([times(a, square), times(v, d1), [0.0; 2]])) <= acceleration_max
                        && magnitude(&sum([times(j, square * sigma), times(a, cross), times(v, d2)]))
                            <= jerk_max
                }
            })
        })
    }
}

/// The longest stop of an arm from a settled speed, s, whatever motion inside the motion limits runs: in closed form. Infinite
/// when the stop limits of a joint leave no room above its motion limits, or a limit is no number.
#[must_use]
pub fn stop_duration_s(limits: &[JointLimits; MAX_JOINTS], joints: usize) -> f64 {
    let arm = limits.get(..joints).unwrap_or(limits);
    let durations_s = SHAPES.iter().map(|shape| duration_s(arm, 1.0 - APPROACH_SHARE, 0.0, shape));
    durations_s.fold(f64::INFINITY, f64::min)
}

/// The joint's motion limits, and a share of what its stop limits leave above them.
fn between(limits: &JointLimits, share: f64) -> JointBounds {
    let JointLimits { motion, stop, .. } = limits;
    let part = |low: f64, high: f64| low + share * (high - low);
    JointBounds {
        acceleration_rad_s2: part(motion.acceleration_rad_s2, stop.acceleration_rad_s2),
        jerk_rad_s3: part(motion.jerk_rad_s3, stop.jerk_rad_s3),
    }
}

/// The shortest change in closed form; [`RAMP_S_MAX`] for an arm whose limits leave no room, which is refused when its files
/// are read.
fn closed_form(limits: &[JointLimits], share: f64, taken: f64) -> (f64, &'static RampShape) {
    let [first, ..] = &SHAPES;
    let mut best = (RAMP_S_MAX, first);
    for shape in &SHAPES {
        let duration_s = duration_s(limits, share, taken, shape);
        if duration_s < best.0 {
            best = (duration_s, shape);
        }
    }
    best
}

/// The shortest change of sigma by 1 that uses no more than a share of what each joint's stop limits leave above its motion
/// limits, when another change has taken a share.
///
/// With m the factor that the change puts on sigma, and a, j what the other change may reach together with the motion
/// (by magnitude):
///
/// ```text
/// v |m'| <= share of the acceleration      (3 a_m + 2 a) |m'| + v |m''| <= share of the jerk
/// ```
fn duration_s(limits: &[JointLimits], share: f64, taken: f64, shape: &RampShape) -> f64 {
    let mut longest_s = RAMP_S_MIN;
    for joint in limits {
        let JointLimits { motion, stop, .. } = joint;
        let acceleration = share * (stop.acceleration_rad_s2 - motion.acceleration_rad_s2);
        let jerk = share * (stop.jerk_rad_s3 - motion.jerk_rad_s3);
        let v = motion.velocity_rad_s;
        let other = if taken > 0.0 { 2.0 * between(joint, taken).acceleration_rad_s2 } else { 0.0 };
        let linear = (3.0 * motion.acceleration_rad_s2 + other) * shape.c_v;
        let constant = v * shape.c_a;
        let acceleration_s = v * shape.c_v / acceleration;
        let jerk_s = (linear + libm::sqrt(linear * linear + 4.0 * jerk * constant)) / (2.0 * jerk);
        if !(acceleration > 0.0 && jerk > 0.0 && acceleration_s.is_finite() && jerk_s.is_finite()) {
            return f64::INFINITY;
        }
        longest_s = longest_s.max(acceleration_s).max(jerk_s);
    }
    longest_s
}

/// A range times a number.
fn times([low, high]: &[f64; 2], factor: f64) -> [f64; 2] {
    if factor < 0.0 { [high * factor, low * factor] } else { [low * factor, high * factor] }
}

fn sum(ranges: [[f64; 2]; 3]) -> [f64; 2] {
    let [[low1, high1], [low2, high2], [low3, high3]] = ranges;
    [low1 + low2 + low3, high1 + high2 + high3]
}

fn magnitude([low, high]: &[f64; 2]) -> f64 {
    low.abs().max(high.abs())
}
