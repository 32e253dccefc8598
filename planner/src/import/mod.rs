//! Motions that were made elsewhere become strokes: tables of positions, and the papers' other profiles.
//!
//! A motion is smoothed by a kernel ([`taustream_motion::smoothing`]), slowed down by one factor where that does not keep the
//! motion limits, compared with the original along its whole length, and then verified like every other motion. A Tau-J*
//! whose 1/k is a whole number is written down as it is.
mod deviation;
mod fit;
mod path;
mod places;
mod profiles;
mod reference;
mod rows;

pub use deviation::Deviation;
pub use path::import_path;
pub use places::{TimedBy, optimised_durations_s, poses_of};
pub use profiles::{K_DEFAULT, ProfileError, ViaProfile};
pub use reference::{Reference, Via, fitted_durations_s};

use crate::budget::Budget;
use crate::plan::PlanError;
use crate::timing::{SLACK, scale_to_fit};
use crate::verify::{Proof, Violation, verify_in};
use crate::world::World;
use fit::{Candidate, candidates, scaled};
use taustream_arm::{Robot, Scene};
use taustream_motion::JointKind;
use taustream_motion::digits::OutsideRange;
use taustream_motion::limits::{LimitViolation, Peaks, check_motion};
use taustream_motion::profile::KError;
use taustream_motion::spline::SplineError as CubicError;
use taustream_motion::stroke::END_S_MAX;
use taustream_motion::{MAX_STROKES, Stroke, Trajectory, TrajectoryError};
use taustream_optimizers::papers::spline::SplineError as SeventhError;

/// How near the strokes shall come where nothing else is requested (rad).
pub const TOLERANCE_RAD_DEFAULT: f64 = 0.005;
/// A table in which a joint goes this many times its motion limit is torn, or of another arm.
const JUMP: f64 = 10.0;
/// A motion that has to be slowed down by more was made for another arm, or is noise.
const SLOWDOWN_MAX: f64 = 20.0;
/// Proofs that are tried; the search's coarser look may have missed a peak.
const TRIES: usize = 6;

/// An imported motion.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The motion, from rest to rest.
    pub trajectory: Trajectory,
    /// What was proven about it.
    pub proof: Proof,
    /// What smoothed it; `None` for a motion that is strokes as it stands.
    pub kernel: Option<KernelUsed>,
    /// The factor on all times that the limits asked for; 1 when they did not.
    pub time_scale: f64,
    /// How long the original takes (s).
    pub original_s: f64,
    /// How far from the original it is at most.
    pub deviation: Deviation,
    /// Speed of the original at its ends (rad/s), highest of all joints.
    pub end_speeds_rad_s: [f64; 2],
}

/// The strokes of a smoothed motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelUsed {
    /// Exponent of every stroke.
    pub n: u32,
    /// Duration of every stroke (s), scaled.
    pub width_s: f64,
    /// By how much the motion lags behind the scaled original (s).
    pub delay_s: f64,
}

/// Why a motion is not imported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// Made for an arm with another number of joints.
    #[error("the motion has {got} joints, the robot has {expected}")]
    Joints {
        /// Of the motion.
        got: usize,
        /// Of the robot.
        expected: usize,
    },
    /// Nothing moves.
    #[error("nothing moves in it; at least one joint has to go somewhere")]
    Still,
    /// A piece's duration.
    #[error("piece {} takes {duration_s} s; at least 0.001 s is needed", piece + 1)]
    Duration {
        /// Zero-based index of the piece.
        piece: usize,
        /// How long.
        duration_s: f64,
    },
    /// The number of durations.
    #[error("{got} durations for {points} points; one fewer than points is needed")]
    Durations {
        /// How many.
        got: usize,
        /// For how many points.
        points: usize,
    },
    /// A place in a path that does not say where to begin.
    #[error(
        "the path has places but no near_rad; give it a pose near which the arm shall reach the first one"
    )]
    NoNear,
    /// A place that the arm does not reach.
    #[error(
        "point {} is not reached from the pose before it: {off_m:.4} m are left; move it into reach (scale, shift_m), or begin \
         near another pose (near_rad)",
        point + 1
    )]
    NotReached {
        /// Zero-based index of the point.
        point: usize,
        /// The distance that is left.
        off_m: f64,
    },
    /// A point that the arm cannot be at.
    #[error(transparent)]
    Point(#[from] PlanError),
    /// An optimiser that does not start.
    #[error("{why}")]
    Optimiser {
        /// Its own words.
        why: String,
    },
    /// A profile's k.
    #[error(transparent)]
    K(#[from] KError),
    /// There is no cubic spline.
    #[error(transparent)]
    Cubic(#[from] CubicError),
    /// There is no spline of degree seven.
    #[error(transparent)]
    Seventh(#[from] SeventhError),
    /// A position that the joint cannot have.
    #[error(
        "at t = {at_s:.3} s joint {} ({name}) at {}; import a motion that stays inside",
        joint + 1, OutsideRange { kind: *kind, position_rad: *value_rad, range_rad: *range_rad }
    )]
    OutsideLimits {
        /// Zero-based index of the joint.
        joint: usize,
        /// The joint's name.
        name: String,
        /// Rad, or m.
        kind: JointKind,
        /// When.
        at_s: f64,
        /// Where it is.
        value_rad: f64,
        /// Lowest and highest angle.
        range_rad: [f64; 2],
    },
    /// A tear in a table.
    #[error(
        "joint {} ({name}) jumps by {by_rad:.4} {} before t = {at_s:.3} s, at {speed_rad_s:.1} {unit}, {:.0} times its limit \
         of {limit_rad_s} {unit}{}",
        joint + 1, kind.unit(), speed_rad_s / limit_rad_s,
        if !kind.is_prismatic() && is_turn(*by_rad) { "; that is a full revolution, a whole turn: unwrap the angles" }
        else { "; correct the table there, or split it" },
        unit = kind.rate_unit(1)
    )]
    Jump {
        /// Zero-based index of the joint.
        joint: usize,
        /// The joint's name.
        name: String,
        /// Rad, or m.
        kind: JointKind,
        /// The time of the row behind it.
        at_s: f64,
        /// How far.
        by_rad: f64,
        /// How fast.
        speed_rad_s: f64,
        /// How fast it may be.
        limit_rad_s: f64,
    },
    /// No strokes come near enough.
    #[error(
        "{MAX_STROKES} strokes come as near as {least_rad:.4} rad to it, not {tolerance_rad} rad; allow more, cut it into \
         shorter motions, or give it smoother corners"
    )]
    TooFar {
        /// The least deviation that was found.
        least_rad: f64,
        /// What was requested.
        tolerance_rad: f64,
    },
    /// A motion for another arm.
    #[error(
        "it would have to run {scale:.1} times slower to keep the limits ({SLOWDOWN_MAX} at most); is it noisy, or made for \
         another arm?"
    )]
    TooSlow {
        /// The factor.
        scale: f64,
    },
    /// Longer than trajectories are.
    #[error("it would take {duration_s:.0} s; a trajectory takes at most {END_S_MAX} s")]
    TooLong {
        /// How long.
        duration_s: f64,
    },
    /// More pieces than strokes.
    #[error("no strokes can be made of it: {0}")]
    NoStrokes(#[from] TrajectoryError),
    /// A limit that is not kept although the motion was scaled to it.
    #[error("its limits could not be proven: {0}")]
    Limit(LimitViolation),
    /// The strokes are not safe.
    #[error("the imported motion, within {deviation_rad:.4} rad of the original, is not safe: {violation}")]
    Unproven {
        /// How far it is from the original.
        deviation_rad: f64,
        /// What is wrong.
        violation: Violation,
    },
}

fn is_turn(by_rad: f64) -> bool {
    (by_rad.abs() - std::f64::consts::TAU).abs() < 0.5
}

/// Imports a motion: strokes within `tolerance_rad` of it at every time, inside of the limits and free of collision.
///
/// # Errors
/// The first thing that is wrong with the motion, or why no strokes serve.
pub fn import(
    robot: &Robot,
    scene: &Scene,
    reference: &Reference,
    tolerance_rad: f64,
) -> Result<Imported, ImportError> {
    import_within(robot, scene, reference, tolerance_rad, &Budget::unbounded())
}

/// As [`import`], given up when a budget ends.
///
/// # Errors
/// As [`import`]; any of them once the budget has ended.
pub(crate) fn import_within(
    robot: &Robot,
    scene: &Scene,
    reference: &Reference,
    tolerance_rad: f64,
    budget: &Budget,
) -> Result<Imported, ImportError> {
    check(robot, reference, tolerance_rad)?;
    let limits = robot.limits();
    let found = candidates(reference, &limits, tolerance_rad);
    let near = |c: &&Candidate| c.off_rad <= tolerance_rad;
    let mut chosen: Vec<&Candidate> = found.iter().filter(near).collect();
    chosen.sort_by(|a, b| a.total_s.total_cmp(&b.total_s));
    let least_rad = found.iter().map(|c| c.off_rad).fold(f64::INFINITY, f64::min);
    let mut refusal = ImportError::TooFar { least_rad, tolerance_rad };
    for candidate in chosen.into_iter().take(TRIES) {
        if budget.is_over() {
            break;
        }
        let scale = candidate.scale;
        let smoothed = candidate.smoothed(reference)?;
        let (trajectory, scale, peaks) = match within_limits(&smoothed, scale, robot) {
            Ok(fitting) => fitting,
            Err(why) => {
                refusal = why;
                continue;
            }
        };
        let kernel = &candidate.kernel;
        let delay_s = kernel.delay_s(reference.duration_s());
        let clock = (scale, delay_s, kernel.width_s);
        let deviation = Deviation::measure(reference, (&trajectory, &peaks), clock);
        if deviation.rad > tolerance_rad {
            refusal = ImportError::TooFar { least_rad: deviation.rad, tolerance_rad };
            continue;
        }
        let used = KernelUsed { n: kernel.n, width_s: kernel.width_s * scale, delay_s: delay_s * scale };
        return prove((robot, scene, budget), reference, (trajectory, scale, deviation), Some(used));
    }
    Err(refusal)
}

/// Imports a Tau-J* through way points whose 1/k is the whole number `n`: a stroke a piece, and nothing is approximated.
///
/// # Errors
/// As [`import`].
pub fn import_strokes(robot: &Robot, scene: &Scene, via: &Via, n: u32) -> Result<Imported, ImportError> {
    let reference = Reference::through(via)?;
    check(robot, &reference, f64::INFINITY)?;
    let joins_s = reference.joins_s();
    let pieces = joins_s.windows(2).zip(via.points_rad.windows(2)).zip(via.durations_s);
    let strokes = pieces.filter_map(|((t, points), duration_s)| {
        let ([start_s, _], [from, to]) = (t, points) else { return None };
        let delta_rad = std::array::from_fn(|joint| to[joint] - from[joint]);
        Some(Stroke { start_s: *start_s, duration_s: *duration_s, n, delta_rad })
    });
    let strokes: Vec<Stroke> = strokes.collect();
    let base_rad = via.points_rad.first().copied().unwrap_or_default();
    let exact = Trajectory::new(via.joints, base_rad, &strokes)?;
    let shortest_s = via.durations_s.iter().copied().fold(f64::INFINITY, f64::min);
    let needed = scale_to_fit(&strokes, via.joints, &robot.limits(), shortest_s / 256.0);
    // Durations that were fitted use their limits to the last bit: only what is truly beyond them is scaled.
    let scale = if needed <= 1.0 + 1e-9 { 1.0 } else { needed * (1.0 + SLACK) };
    let (trajectory, scale, _) = within_limits(&exact, scale, robot)?;
    prove((robot, scene, &Budget::unbounded()), &reference, (trajectory, scale, Deviation::default()), None)
}

fn check(robot: &Robot, reference: &Reference, tolerance_rad: f64) -> Result<(), ImportError> {
    let (got, expected) = (reference.joints(), robot.joints.len());
    if got != expected {
        return Err(ImportError::Joints { got, expected });
    }
    let name = |joint: usize| robot.joints.get(joint).map(|j| j.name.clone()).unwrap_or_default();
    let jump_rad = tolerance_rad.min(TOLERANCE_RAD_DEFAULT);
    if let Some((at_s, joint, by_rad, speed_rad_s)) = reference.first_jump(&robot.limits(), JUMP, jump_rad) {
        let limit_rad_s = robot.joints.get(joint).map_or(0.0, |j| j.limits.motion.velocity_rad_s);
        let kind = robot.kind(joint);
        return Err(ImportError::Jump {
            joint,
            name: name(joint),
            kind,
            at_s,
            by_rad,
            speed_rad_s,
            limit_rad_s,
        });
    }
    for at_s in reference.joins_s() {
        let position_rad = reference.at(at_s);
        for (joint, (described, value_rad)) in robot.joints.iter().zip(position_rad).enumerate() {
            let range_rad = described.limits.position_rad;
            // A NaN is inside of nothing.
            if !described.limits.is_inside(value_rad) {
                return Err(ImportError::OutsideLimits {
                    joint,
                    name: name(joint),
                    kind: described.kind,
                    at_s,
                    value_rad,
                    range_rad,
                });
            }
        }
    }
    Ok(())
}

/// The motion slowed down by a factor, or by a little more when the proof of its limits asks for it.
fn within_limits(
    motion: &Trajectory,
    scale: f64,
    robot: &Robot,
) -> Result<(Trajectory, f64, Peaks), ImportError> {
    const STEPS: [f64; 4] = [1.0, 1.002, 1.01, 1.03];
    if scale.is_nan() || scale > SLOWDOWN_MAX {
        return Err(ImportError::TooSlow { scale });
    }
    let duration_s = motion.duration_s() * scale * STEPS[3];
    if duration_s > END_S_MAX {
        return Err(ImportError::TooLong { duration_s });
    }
    let mut last = None;
    for step in STEPS {
        let trajectory = scaled(motion, scale * step)?;
        match check_motion(&trajectory, &robot.limits()) {
            Ok(peaks) => return Ok((trajectory, scale * step, peaks)),
            Err(violation) => last = Some(violation),
        }
    }
    Err(last.map_or(ImportError::Still, ImportError::Limit))
}

fn prove(
    (robot, scene, budget): (&Robot, &Scene, &Budget),
    reference: &Reference,
    (trajectory, time_scale, deviation): (Trajectory, f64, Deviation),
    kernel: Option<KernelUsed>,
) -> Result<Imported, ImportError> {
    let world = World::new(robot, scene).map_err(|name| Violation::Shape { name });
    let proof = world
        .and_then(|world| verify_in(&world, &trajectory, budget))
        .map_err(|violation| ImportError::Unproven { deviation_rad: deviation.rad, violation })?;
    let end_speeds_rad_s =
        reference.end_speeds_rad_s().map(|speeds| speeds.iter().fold(0.0, |most: f64, v| most.max(v.abs())));
    let original_s = reference.duration_s();
    Ok(Imported { trajectory, proof, kernel, time_scale, original_s, deviation, end_speeds_rad_s })
}
