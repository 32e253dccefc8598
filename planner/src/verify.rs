//! The proof that a trajectory keeps the limits and the distance to everything, along its whole length.
//!
//! Limits are proven by the motion crate from closed-form peaks; distances by bisection with a proven step
//! ([`crate::collide::sweep()`]). A motion that cannot be proven within bounded work is refused, and said to be so.
use crate::budget::Budget;
use crate::collide::{Blocked, Course, SweepRules, sweep, sweep_in_parts};
use crate::constraints::{ConstraintViolation, TipConstraints, TipUse, prove_constraints};
use crate::torque::{Overload, TorqueLimits};
use crate::world::World;
use taustream_arm::{Robot, Scene};
use taustream_motion::Trajectory;
use taustream_motion::digits::{Amount, Decimals};
use taustream_motion::limits::{LimitViolation, Peaks, check_motion_from};

/// What was proven about a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// How long it takes at full speed.
    pub duration_s: f64,
    /// Least distance to any obstacle, or between links that may not touch: a proven lower bound, at most 1 mm
    /// below the truth unless a deadline, or the work that is granted, ended the search for it. Infinite when nothing can collide.
    pub clearance_m: f64,
    /// Where along the motion the arm is closest, to the resolution of the proof.
    pub clearance_at_s: f64,
    /// What is closest there: a link, and an obstacle or another link. Empty when nothing can collide.
    pub clearance_between: (String, String),
    /// What these two must keep; 0 when nothing can collide.
    pub clearance_required_m: f64,
    /// Proven upper bounds of velocity, acceleration and jerk.
    pub peaks: Peaks,
}

/// The least distance of a motion, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct LeastDistance {
    /// See [`Proof::clearance_m`].
    pub clearance_m: f64,
    /// When, in trajectory time.
    pub at_s: f64,
    /// Between what. Empty when nothing can collide.
    pub between: (String, String),
    /// What these two must keep.
    pub required_m: f64,
}

impl LeastDistance {
    /// The one of a motion that begins at `from_s` of another.
    #[must_use]
    pub fn of(proof: &Proof, from_s: f64) -> Self {
        Self {
            clearance_m: proof.clearance_m,
            at_s: proof.clearance_at_s + from_s,
            between: proof.clearance_between.clone(),
            required_m: proof.clearance_required_m,
        }
    }

    /// The lesser of two.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        if other.clearance_m < self.clearance_m { other } else { self }
    }
}

/// Two things that are closer than they may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// A link, and an obstacle or another link.
    pub between: (String, String),
    /// Their distance; negative when they overlap and the depth is known.
    pub distance_m: f64,
    /// The distance that they must keep: the scene's margin for obstacles, the robot's between links.
    pub required_m: f64,
    /// Both are links of the arm.
    pub of_links: bool,
}

impl Contact {
    /// True when the two touch; false when they are only nearer than they may be.
    #[must_use]
    pub fn touches(&self) -> bool {
        self.distance_m <= 0.0
    }

    /// Which file says otherwise when the two do not touch in truth, to follow a remedy.
    pub(crate) fn correction(&self) -> String {
        let (a, b) = &self.between;
        if self.of_links {
            format!(
                "; if the real links do not touch there, their shapes are too large: list the pair in the robot file, \
                 allowed_contacts = [[{a:?}, {b:?}]], and it is checked no more"
            )
        } else {
            " or correct the scene".to_owned()
        }
    }
}

impl std::fmt::Display for Contact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { between: (a, b), distance_m, required_m, .. } = self;
        if self.touches() {
            return write!(f, "{a} touches {b}");
        }
        let decimals = Decimals::apart(&[*distance_m, *required_m], 4);
        let (distance, required) = (decimals.show(*distance_m), decimals.show(*required_m));
        let by_m = required_m - distance_m;
        if by_m > 0.0 {
            write!(f, "{a} is {distance} m from {b}, {} m less than the {required} m required", Amount(by_m))
        } else {
            write!(
                f,
                "{a} is {distance} m from {b}, only {} m more than the {required} m required",
                Amount(-by_m)
            )
        }
    }
}

/// The first reason why a trajectory is not proven safe.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Violation {
    /// Made for an arm with another number of joints.
    #[error("the trajectory moves {got} joints, the robot has {expected}")]
    Joints {
        /// Of the trajectory.
        got: usize,
        /// Of the robot.
        expected: usize,
    },
    /// A shape of the robot or the scene cannot be built.
    #[error("{name}: its mesh has no usable triangles; correct the file")]
    Shape {
        /// The link or obstacle.
        name: String,
    },
    /// A limit is exceeded.
    #[error("joint {} ({name}): {violation}", violation.joint + 1)]
    Limit {
        /// The joint's name.
        name: String,
        /// The joint, quantity, time, value and limit.
        violation: LimitViolation,
    },
    /// Two things touch, or come nearer than they may.
    #[error("{} from t = {from_s:.3} s: {contact} at t = {at_s:.3} s",
        if contact.touches() { "collision" } else { "nearer than the margin" })]
    Collision {
        /// First instant at which the distance is not proven to be enough.
        from_s: f64,
        /// Instant of the contact that is stated: the deepest of a sampling.
        at_s: f64,
        /// What touches what, and by how much.
        contact: Contact,
    },
    /// The tip does not keep a constraint, or a zone's speed limit.
    #[error("constraint of the tip: {0}")]
    Constraint(#[from] ConstraintViolation),
    /// A drive cannot bear it.
    #[error(transparent)]
    Torque(#[from] Overload),
    /// The proof ran out of work; nothing is known to be wrong.
    #[error("not proven: {checks} checks did not settle t = {at_s:.3} s; keep more distance there")]
    Unresolved {
        /// How many poses were checked.
        checks: usize,
        /// The instant that the proof had reached.
        at_s: f64,
    },
}

/// Proves that a trajectory keeps the motion limits, the position ranges and the distance to everything, and, where masses and
/// torques are known, that the drives can bear it.
///
/// # Errors
/// The first violation, with joint or pair, time and amount.
pub fn verify(robot: &Robot, scene: &Scene, trajectory: &Trajectory) -> Result<Proof, Violation> {
    Ok(verify_keeping(robot, scene, (trajectory, &TipConstraints::default()))?.0)
}

/// The same with what the tip must keep, and what the motion uses of that.
///
/// # Errors
/// The first violation, with joint or pair, time and amount.
pub fn verify_keeping(
    robot: &Robot,
    scene: &Scene,
    (trajectory, asked): (&Trajectory, &TipConstraints),
) -> Result<(Proof, Option<TipUse>), Violation> {
    let world = World::new(robot, scene).map_err(|name| Violation::Shape { name })?;
    let budget = Budget::unbounded();
    let proof = verify_in(&world, trajectory, &budget)?;
    let used = prove_constraints((&world, asked), (trajectory, &proof, 0.0), &budget)?;
    if let Ok(limits) = TorqueLimits::of(robot) {
        limits.prove(trajectory)?;
    }
    Ok((proof, used))
}

/// Like [`verify`], in a world that exists already and with a clock that may cut the proof short.
///
/// # Errors
/// The first violation; `Unresolved` when the clock cut in.
pub fn verify_in(world: &World, trajectory: &Trajectory, budget: &Budget) -> Result<Proof, Violation> {
    let whole = Stretch { world, span_s: [0.0, trajectory.duration_s()] };
    let proof = verify_stretches(&[whole], trajectory, budget)?;
    prove_constraints((world, &TipConstraints::default()), (trajectory, &proof, 0.0), budget)?;
    Ok(proof)
}

/// A part of a motion, and the world whose distances it must keep.
#[derive(Clone, Copy)]
pub struct Stretch<'a> {
    /// The world.
    pub world: &'a World<'a>,
    /// From when to when.
    pub span_s: [f64; 2],
}

/// Like [`verify_in`], for a motion whose stretches, which must follow each other, keep different distances. Limits, too, are
/// proven from the begin of the first stretch on: a replacement runs from its cut.
///
/// # Errors
/// The first violation; `Unresolved` when the clock cut in, or when there is no stretch.
pub fn verify_stretches(
    stretches: &[Stretch],
    trajectory: &Trajectory,
    budget: &Budget,
) -> Result<Proof, Violation> {
    let proof = prove_stretches(stretches, trajectory, (budget, DEEPEST_SAMPLES))?;
    Ok(measured(stretches, trajectory, &proof, budget))
}

/// Like [`verify_stretches`], for candidates: a contact is stated as it is met, and the least distance is a lower bound of any quality
/// until [`measured`].
///
/// # Errors
/// The first violation; `Unresolved` when the clock cut in, or when there is no stretch.
pub(crate) fn prove_candidate(
    stretches: &[Stretch],
    trajectory: &Trajectory,
    budget: &Budget,
) -> Result<Proof, Violation> {
    prove_stretches(stretches, trajectory, (budget, 0))
}

/// The proof of a candidate with its least distance, or as it was where the clock cut in.
pub(crate) fn measured(
    stretches: &[Stretch],
    trajectory: &Trajectory,
    proof: &Proof,
    budget: &Budget,
) -> Proof {
    let mut measured = proof.clone();
    match measure(&mut measured, stretches, trajectory, (&SweepRules::LEAST_DISTANCE, budget)) {
        Ok(()) => measured,
        Err(_) => proof.clone(),
    }
}

/// Proves the distances of all stretches and takes down the least of them.
fn measure<'s>(
    proof: &mut Proof,
    stretches: &'s [Stretch<'s>],
    trajectory: &Trajectory,
    (rules, budget): (&SweepRules, &Budget),
) -> Result<(), (&'s Stretch<'s>, Blocked)> {
    let course = Course::new(trajectory);
    proof.clearance_m = f64::INFINITY;
    for stretch in stretches {
        let clearance = sweep_in_parts(stretch.world, &course, stretch.span_s, rules, budget)
            .map_err(|blocked| (stretch, blocked))?;
        if clearance.proven_m < proof.clearance_m {
            let between = clearance.pair.map(|pair| stretch.world.names(&pair)).unwrap_or_default();
            proof.clearance_required_m = clearance.pair.map_or(0.0, |pair| pair.required_m);
            proof.clearance_m = clearance.proven_m;
            (proof.clearance_at_s, proof.clearance_between) = (clearance.at, between);
        }
    }
    Ok(())
}

/// Samples at which the deepest contact is looked for, to be stated.
const DEEPEST_SAMPLES: u32 = 2_000;

fn prove_stretches(
    stretches: &[Stretch],
    trajectory: &Trajectory,
    (budget, samples): (&Budget, u32),
) -> Result<Proof, Violation> {
    let Some(first) = stretches.first() else { return Err(Violation::Unresolved { checks: 0, at_s: 0.0 }) };
    // Limits first: beyond them angles may be so large that geometry means nothing.
    let [begin_s, _] = first.span_s;
    let peaks = check_limits(first.world, trajectory, begin_s)?;
    // Once a motion, with bodies inside of meshes: nothing gets in later without crossing a surface.
    if let Some(contact) = first.world.contact(&trajectory.sample(begin_s).position_rad) {
        return Err(Violation::Collision { from_s: begin_s, at_s: begin_s, contact });
    }
    let mut proof = Proof {
        duration_s: trajectory.duration_s(),
        clearance_m: f64::INFINITY,
        clearance_at_s: 0.0,
        clearance_between: Default::default(),
        clearance_required_m: 0.0,
        peaks,
    };
    measure(&mut proof, stretches, trajectory, (&SweepRules::PROOF, budget))
        .map_err(|(stretch, blocked)| explain(stretch, trajectory, &blocked, (budget, samples)))?;
    Ok(proof)
}

/// The same proof for a motion that is soon replaced, without its least distance: a small part of the work.
///
/// # Errors
/// The first violation that was met, not the deepest; `Unresolved` when the clock cut in.
pub fn verify_free(stretch: &Stretch, trajectory: &Trajectory, budget: &Budget) -> Result<(), Violation> {
    let (world, [begin_s, _]) = (stretch.world, stretch.span_s);
    check_limits(world, trajectory, begin_s)?;
    let found = met(stretch, trajectory, (&SweepRules::MARGIN_EXIT, budget));
    found.map_or(Ok(()), |(_, violation)| Err(violation))
}

/// When a stretch of a motion, whose limits are proven, comes too near to something first, and to what. A sweep that the
/// clock cuts short counts as one that has met something.
#[must_use]
pub fn first_contact(
    stretch: &Stretch,
    trajectory: &Trajectory,
    budget: &Budget,
) -> Option<(f64, Violation)> {
    met(stretch, trajectory, (&SweepRules::SCENE_CHANGE, budget))
}

fn met(
    stretch: &Stretch,
    trajectory: &Trajectory,
    (rules, budget): (&SweepRules, &Budget),
) -> Option<(f64, Violation)> {
    let (world, [begin_s, _]) = (stretch.world, stretch.span_s);
    if let Some(contact) = world.contact(&trajectory.sample(begin_s).position_rad) {
        return Some((begin_s, Violation::Collision { from_s: begin_s, at_s: begin_s, contact }));
    }
    let blocked = sweep(world, &Course::new(trajectory), stretch.span_s, rules, budget).err()?;
    let (checks, at_s) = (blocked.checks, blocked.at);
    let violation = match blocked.pair {
        None => Violation::Unresolved { checks, at_s },
        Some((pair, distance_m)) => {
            Violation::Collision { from_s: at_s, at_s, contact: world.contact_of(&pair, distance_m) }
        }
    };
    Some((at_s, violation))
}

/// Joints and limits, from an instant on.
fn check_limits(world: &World, trajectory: &Trajectory, begin_s: f64) -> Result<Peaks, Violation> {
    let robot = world.robot();
    let (got, expected) = (trajectory.joints(), robot.joints.len());
    if got != expected {
        return Err(Violation::Joints { got, expected });
    }
    check_motion_from(trajectory, &robot.limits(), begin_s).map_err(|violation| {
        let name = robot.joints.get(violation.joint).map(|j| j.name.clone()).unwrap_or_default();
        Violation::Limit { name, violation }
    })
}

/// States the contact where it is deepest, which tells more than the instant at which it begins.
fn explain(
    stretch: &Stretch,
    trajectory: &Trajectory,
    blocked: &Blocked,
    (budget, samples): (&Budget, u32),
) -> Violation {
    let Some((mut pair, mut distance_m)) = blocked.pair else {
        return Violation::Unresolved { checks: blocked.checks, at_s: blocked.at };
    };
    let (world, [begin_s, end_s]) = (stretch.world, stretch.span_s);
    let (from_s, mut at_s) = (blocked.at, blocked.at);
    for i in 1..=samples {
        if budget.is_over_after(world.pairs().len()) {
            break;
        }
        let t_s = begin_s + (end_s - begin_s) * f64::from(i) / f64::from(samples);
        if let Some((p, d)) = world.closest(&trajectory.sample(t_s).position_rad)
            && d - p.required_m < distance_m - pair.required_m
        {
            (pair, distance_m, at_s) = (p, d, t_s);
        }
    }
    Violation::Collision { from_s, at_s, contact: world.contact_of(&pair, distance_m) }
}
