//! Goes on from a running motion towards targets, at once and without a jump: what a stream of targets is made of.
//!
//! A reference r(t) chases the targets inside lowered limits: a time-optimal motion of each joint under jerk limits (Ruckig),
//! begun anew from the reference's own state whenever a target arrives. Strokes of one duration T, evenly spaced, each as far as
//! r goes in its spacing, average it over T (`taustream_motion::smoothing`). So their sum keeps what r keeps, up to the ripple of
//! the spacing, and is C3. A new target changes only the part of r whose strokes have not begun at the cut: whatever arrives,
//! and whenever, kept and new strokes are still the average of one reference that keeps the limits. Nothing has to be searched,
//! and no target can make the motion swing. The price is the mean of the kernel as delay, beside that of the reference itself.
//!
//! What is committed always ends at rest: r does. A stream that ends leaves the arm at its last target.
use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use taustream_messages::target::Target;
use taustream_motion::cut::Kept;
use taustream_motion::smoothing::moments;
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, MAX_STROKES, Stroke, Trajectory};

/// Exponent of every stroke.
const N: u32 = 8;
/// Shares of velocity, acceleration and jerk that the reference uses; the rest is for the ripple.
const SHARES: [f64; 3] = [0.985, 0.94, 0.86];
/// Share of the jerk limit that the ripple of the spacing takes at full speed, at most.
const RIPPLE: f64 = 0.08;
/// Width of the kernel over the time in which a joint gets to its speed: sqrt(v/j) by jerk, or this part of v/a.
const WIDTH: f64 = 0.55;
const BY_ACCELERATION: f64 = 0.7;
/// Narrowest and widest kernel (s): setpoints are some milliseconds apart, and nobody waits longer.
const WIDTH_S: [f64; 2] = [0.03, 0.5];
/// Least strokes a kernel.
const SPACING: f64 = 12.0;
/// Ripple in the jerk over v h^2/T^4 for n = 8 and 12 strokes a kernel or more, computed from the profile.
const RIPPLE_CONSTANT: f64 = 16.4;
/// Most new strokes: the rest of a message is left to those that run.
const STROKES_MAX: usize = 384;
/// Two targets tell a velocity if they are so far apart, s.
const SLOPE_S: [f64; 2] = [1e-3, 0.25];
/// How long a velocity is believed, over the time between two targets.
const HOLD: f64 = 1.5;
/// How often a target that is too far for them is drawn nearer.
const NEARER: u32 = 24;

/// Position, velocity and acceleration of every joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct State {
    position_rad: JointArray,
    velocity_rad_s: JointArray,
    acceleration_rad_s2: JointArray,
}

/// The reference where a stroke begins.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Knot {
    /// Trajectory time, s.
    at_s: f64,
    state: State,
}

/// The part of a reference that may still change.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// At least one; at the last it rests.
    knots: Vec<Knot>,
}

/// Where a stream seems to go: what a target is led by until the next one comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// Velocity of each joint, rad/s.
    pub velocity_rad_s: JointArray,
    /// How long to believe it, s.
    pub hold_s: f64,
}

/// The velocity of a stream of targets: in each joint the smaller of its last two slopes, and none where they differ in sign. So
/// one target that jumps is no velocity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trend {
    last: Option<(f64, JointArray)>,
    slope_rad_s: Option<JointArray>,
}

impl Trend {
    /// Takes a target that was sent at an instant (s, by any one clock), and tells where the stream goes.
    pub fn note(&mut self, at_s: f64, target: &Target) -> Option<Lead> {
        let last = self.last.replace((at_s, target.position_rad));
        let span_s = last.map(|(last_s, _)| at_s - last_s);
        let Some((_, from_rad)) =
            last.filter(|_| span_s.is_some_and(|s| (SLOPE_S[0]..=SLOPE_S[1]).contains(&s)))
        else {
            self.slope_rad_s = None;
            return None;
        };
        let span_s = span_s?;
        let slope = std::array::from_fn(|joint| (target.position_rad[joint] - from_rad[joint]) / span_s);
        let before = self.slope_rad_s.replace(slope);
        let hold_s = HOLD * span_s;
        if let Some(velocity_rad_s) = target.velocity_rad_s {
            return Some(Lead { velocity_rad_s, hold_s });
        }
        let before = before?;
        let smaller = |joint: usize| {
            let (a, b): (f64, f64) = (slope[joint], before[joint]);
            if a * b <= 0.0 { 0.0 } else { a.abs().min(b.abs()).copysign(a) }
        };
        Some(Lead { velocity_rad_s: std::array::from_fn(smaller), hold_s })
    }

    /// Forgets the stream.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

/// A motion that goes on to a target, and the reference to continue from when it is accepted.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Kept and new strokes.
    pub trajectory: Trajectory,
    /// Where the next piece continues.
    pub reference: Reference,
    /// The target is too far for one message: this much of the way is covered, and the rest is left to the next piece.
    pub share: f64,
}

/// Follows targets for an arm.
#[derive(Debug)]
pub struct Follower {
    joints: usize,
    limits: [JointLimits; MAX_JOINTS],
    lowered: [LimitSet; MAX_JOINTS],
    width_s: f64,
    step_s: f64,
}

impl Reference {
    /// A reference that rests in a pose.
    #[must_use]
    pub fn at_rest(position_rad: &JointArray) -> Self {
        Self::at_rest_from(0.0, position_rad)
    }

    /// A reference that rests in a pose from a trajectory time on; it is not continued before then.
    #[must_use]
    pub fn at_rest_from(at_s: f64, position_rad: &JointArray) -> Self {
        let state = State { position_rad: *position_rad, ..State::default() };
        Self { knots: vec![Knot { at_s, state }] }
    }

    /// Where the first stroke that is not kept by a cut begins; a reference at rest continues at the cut.
    fn from(&self, cut_s: f64) -> Option<Knot> {
        let next = self.knots.iter().find(|knot| knot.at_s >= cut_s).copied();
        next.or_else(|| self.knots.last().map(|last| Knot { at_s: cut_s, ..*last }))
    }

    /// Trajectory time before which strokes belong to what came before this reference; a cut keeps them all.
    #[must_use]
    pub fn kept_until_s(&self, cut_s: f64) -> f64 {
        self.knots.first().map_or(cut_s, |first| first.at_s.max(cut_s))
    }

    /// Where it comes to rest, rad.
    #[must_use]
    pub fn end_rad(&self) -> Option<&JointArray> {
        self.knots.last().map(|last| &last.state.position_rad)
    }
}

impl Follower {
    /// For an arm with these motion limits.
    #[must_use]
    pub fn new(joints: usize, limits: &[JointLimits; MAX_JOINTS]) -> Self {
        let own = || limits.iter().take(joints).map(|limits| limits.motion);
        let natural_s = own().map(|m| {
            let by_acceleration_s = BY_ACCELERATION * m.velocity_rad_s / m.acceleration_rad_s2;
            (m.velocity_rad_s / m.jerk_rad_s3).sqrt().max(by_acceleration_s)
        });
        let width_s = (WIDTH * natural_s.fold(0.0, f64::max)).clamp(WIDTH_S[0], WIDTH_S[1]);
        let steps_s = own().map(|m| {
            width_s.powi(2) * (RIPPLE * m.jerk_rad_s3 / (RIPPLE_CONSTANT * m.velocity_rad_s)).sqrt()
        });
        let step_s = steps_s.fold(width_s / SPACING, f64::min);
        let lowered = limits.map(|limits| LimitSet {
            velocity_rad_s: limits.motion.velocity_rad_s * SHARES[0],
            acceleration_rad_s2: limits.motion.acceleration_rad_s2 * SHARES[1],
            jerk_rad_s3: limits.motion.jerk_rad_s3 * SHARES[2],
        });
        Self { joints, limits: *limits, lowered, width_s, step_s }
    }

    /// By how much the motion lags behind its reference, s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        moments(N)[0] * self.width_s - 0.5 * self.step_s
    }

    /// The motion that keeps what a cut at `cut_s` keeps and goes on to a pose. While a lead is believed, the reference is as far
    /// ahead of the pose as the motion lags behind it; what is committed rests in the pose itself. `None` when strokes find no
    /// room or the solver fails; the motion before then goes on to its end.
    #[must_use]
    pub fn to_pose(
        &self,
        kept: &Kept,
        (reference, cut_s): (&Reference, f64),
        (pose_rad, lead): (&JointArray, Option<&Lead>),
    ) -> Option<Piece> {
        let mut knots = vec![reference.from(cut_s)?];
        if let Some(lead) = lead {
            self.chase(&mut knots, &self.led(pose_rad, lead), lead.hold_s)?;
        }
        let share = self.rest_near(&mut knots, pose_rad)?;
        Some(Piece { trajectory: self.trajectory(kept, &knots)?, reference: Reference { knots }, share })
    }

    /// The same through targets with times, as `at_s` tells them: trajectory time of an instant that is so many seconds after
    /// the request was sent. The reference chases the way between them as far ahead as motion and reference lag behind.
    #[must_use]
    pub fn through(
        &self,
        kept: &Kept,
        (reference, cut_s): (&Reference, f64),
        (targets, at_s): (&[Target], &dyn Fn(f64) -> f64),
    ) -> Option<Piece> {
        let last = targets.last()?;
        let from = reference.from(cut_s)?;
        let ahead_s = self.delay_s() + self.chase_s(targets);
        let mut knots = vec![from];
        let mut now = from;
        while knots.len() < STROKES_MAX / 2 && now.at_s + ahead_s < at_s(last.due_s) {
            let wanted_rad = between(&from, (targets, at_s), now.at_s + ahead_s);
            let motion = self.solve(&now.state, &wanted_rad)?;
            now = Knot { at_s: now.at_s + self.step_s, state: self.state_at(&motion, self.step_s) };
            knots.push(now);
        }
        let mut is_whole = now.at_s + ahead_s >= at_s(last.due_s);
        loop {
            let chased = knots.len();
            let at_rest_s = knots.last()?.at_s + ahead_s;
            let end_rad =
                if is_whole { last.position_rad } else { between(&from, (targets, at_s), at_rest_s) };
            if let Some(share) = self.rest_near(&mut knots, &end_rad) {
                let share = if is_whole { share } else { share * 0.5 };
                let trajectory = self.trajectory(kept, &knots)?;
                return Some(Piece { trajectory, reference: Reference { knots }, share });
            }
            // No room to come to rest behind that much of the chunk: less of it, and the rest with the next piece.
            (chased > 1).then_some(())?;
            knots.truncate(chased.div_ceil(2).min(chased - 1));
            is_whole = false;
        }
    }

    /// The pose ahead of one that a stream leads to, inside the position limits.
    fn led(&self, pose_rad: &JointArray, lead: &Lead) -> JointArray {
        let mut led_rad = *pose_rad;
        let joints = led_rad.iter_mut().zip(&lead.velocity_rad_s).zip(&self.limits).take(self.joints);
        for ((q, v), limits) in joints {
            let most = limits.motion.velocity_rad_s;
            let ahead_rad = *q + self.delay_s() * v.clamp(-most, most);
            *q = if limits.outside_rad(*q) == 0.0 { limits.nearest_inside(ahead_rad) } else { *q };
        }
        led_rad
    }

    /// Adds knots on the way to a pose for a while.
    fn chase(&self, knots: &mut Vec<Knot>, pose_rad: &JointArray, hold_s: f64) -> Option<()> {
        let from = *knots.last()?;
        let motion = self.solve(&from.state, pose_rad)?;
        let steps = (hold_s / self.step_s).ceil().clamp(0.0, STROKES_MAX as f64 / 4.0);
        let mut step = 1.0;
        while step <= steps {
            let state = self.state_at(&motion, step * self.step_s);
            knots.push(Knot { at_s: from.at_s + step * self.step_s, state });
            step += 1.0;
        }
        Some(())
    }

    /// Adds knots from the last one to rest in a pose, or on the straight way to it where strokes find no room for all of it.
    /// Returns the share of the way.
    fn rest_near(&self, knots: &mut Vec<Knot>, pose_rad: &JointArray) -> Option<f64> {
        let from_rad = knots.last()?.state.position_rad;
        let mut share = 1.0;
        for _ in 0..NEARER {
            let near_rad: JointArray = std::array::from_fn(|joint| {
                let (from, to) = (from_rad[joint], pose_rad[joint]);
                if share >= 1.0 { to } else { from + share * (to - from) }
            });
            if self.rest_at(knots, &near_rad)? {
                return Some(share);
            }
            share *= 0.5;
        }
        None
    }

    /// Adds knots from the last one to rest in a pose; false when there are too many.
    fn rest_at(&self, knots: &mut Vec<Knot>, pose_rad: &JointArray) -> Option<bool> {
        let from = *knots.last()?;
        let motion = self.solve(&from.state, pose_rad)?;
        let duration_s = motion.iter().map(RuckigTrajectory::get_duration).fold(0.0, f64::max);
        let steps = (duration_s / self.step_s).ceil();
        let room = STROKES_MAX.saturating_sub(knots.len()) as f64;
        if steps.is_nan() || steps > room {
            return Some(false);
        }
        let mut step = 1.0;
        while step < steps {
            let state = self.state_at(&motion, step * self.step_s);
            knots.push(Knot { at_s: from.at_s + step * self.step_s, state });
            step += 1.0;
        }
        if steps > 0.0 {
            let state = State { position_rad: *pose_rad, ..State::default() };
            knots.push(Knot { at_s: from.at_s + steps * self.step_s, state });
        }
        Some(true)
    }

    /// The strokes of the reference behind what is kept.
    fn trajectory(&self, kept: &Kept, knots: &[Knot]) -> Option<Trajectory> {
        let mut strokes = kept.strokes.to_vec();
        for pair in knots.windows(2) {
            let [from, to] = pair else { continue };
            let delta_rad: JointArray =
                std::array::from_fn(|joint| to.state.position_rad[joint] - from.state.position_rad[joint]);
            if delta_rad.iter().any(|delta| *delta != 0.0) {
                strokes.push(Stroke { start_s: from.at_s, duration_s: self.width_s, n: N, delta_rad });
            }
        }
        (strokes.len() <= MAX_STROKES).then_some(())?;
        Trajectory::new(self.joints, kept.base_rad, &strokes).ok()
    }

    /// By how much a reference that brakes for its target all the time lags behind one that moves as these targets do, s:
    /// the time to brake from their mean speed, halved.
    fn chase_s(&self, targets: &[Target]) -> f64 {
        let (Some(first), Some(last)) = (targets.first(), targets.last()) else { return 0.0 };
        let span_s = (last.due_s - first.due_s).max(self.step_s);
        let joints = self.lowered.iter().enumerate().take(self.joints);
        let each_s = joints.map(|(joint, limits)| {
            let v = ((last.position_rad[joint] - first.position_rad[joint]).abs() / span_s)
                .min(limits.velocity_rad_s);
            let (a, j) = (limits.acceleration_rad_s2, limits.jerk_rad_s3);
            if v * j <= a * a { (v / j).sqrt() } else { 0.5 * (v / a + a / j) }
        });
        each_s.fold(0.0, f64::max)
    }

    /// Time-optimal motions of all joints to rest in a pose; nothing when the solver fails.
    fn solve(&self, from: &State, pose_rad: &JointArray) -> Option<Vec<RuckigTrajectory<1>>> {
        let mut solver = Ruckig::<1, ThrowErrorHandler>::new(None, self.step_s);
        let mut input = InputParameter::<1>::new(None);
        input.synchronization = Synchronization::None;
        input.control_interface = ControlInterface::Position;
        let joints = self.lowered.iter().enumerate().take(self.joints);
        let each = joints.map(|(joint, limits)| {
            input.current_position[0] = from.position_rad[joint];
            input.current_velocity[0] = from.velocity_rad_s[joint];
            input.current_acceleration[0] = from.acceleration_rad_s2[joint];
            input.target_position[0] = pose_rad[joint];
            input.max_velocity[0] = limits.velocity_rad_s;
            input.max_acceleration[0] = limits.acceleration_rad_s2;
            input.max_jerk[0] = limits.jerk_rad_s3;
            let mut solution = RuckigTrajectory::<1>::new(None);
            solver.calculate(&input, &mut solution).ok()?;
            solution.get_duration().is_finite().then_some(solution)
        });
        each.collect()
    }

    fn state_at(&self, motion: &[RuckigTrajectory<1>], t_s: f64) -> State {
        let mut state = State::default();
        for (joint, solution) in motion.iter().enumerate() {
            let zero = || DataArrayOrVec::new(None, 0.0);
            let (mut q, mut v, mut a) = (zero(), zero(), zero());
            let (q_out, v_out, a_out) = (&mut Some(&mut q), &mut Some(&mut v), &mut Some(&mut a));
            solution.at_time(t_s, q_out, v_out, a_out, &mut None, &mut None);
            state.position_rad[joint] = q[0];
            state.velocity_rad_s[joint] = v[0];
            state.acceleration_rad_s2[joint] = a[0];
        }
        state
    }
}

/// The pose between targets at a trajectory time: on a cubic where both neighbours have a velocity, else on a straight line; before
/// the first one on the straight line to it from where the reference begins.
fn between(begin: &Knot, (targets, at_s): (&[Target], &dyn Fn(f64) -> f64), t_s: f64) -> JointArray {
    let behind = targets.iter().position(|target| at_s(target.due_s) > t_s).unwrap_or(targets.len());
    let neighbours = (behind.checked_sub(1).and_then(|before| targets.get(before)), targets.get(behind));
    let (from, to) = match neighbours {
        (Some(from), Some(to)) => (from, to),
        (Some(last), None) => return last.position_rad,
        (None, first) => {
            let Some(first) = first else { return begin.state.position_rad };
            let u = ((t_s - begin.at_s) / (at_s(first.due_s) - begin.at_s)).clamp(0.0, 1.0);
            let (a, b) = (&begin.state.position_rad, &first.position_rad);
            return std::array::from_fn(|joint| a[joint] + u * (b[joint] - a[joint]));
        }
    };
    let span_s = at_s(to.due_s) - at_s(from.due_s);
    let u = ((t_s - at_s(from.due_s)) / span_s).clamp(0.0, 1.0);
    let blend = |part: f64| -> JointArray {
        std::array::from_fn(|joint| {
            from.position_rad[joint] + part * (to.position_rad[joint] - from.position_rad[joint])
        })
    };
    let (Some(from_velocity), Some(to_velocity)) = (&from.velocity_rad_s, &to.velocity_rad_s) else {
        return blend(u);
    };
    // Cubic Hermite polynomials.
    let (rising, falling) = (u * (1.0 - u) * (1.0 - u) * span_s, u * u * (1.0 - u) * span_s);
    let mut pose_rad = blend(u * u * (3.0 - 2.0 * u));
    for (joint, q) in pose_rad.iter_mut().enumerate() {
        *q += rising * from_velocity[joint] - falling * to_velocity[joint];
    }
    pose_rad
}
