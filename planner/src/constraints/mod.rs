//! What the tip must keep along a whole motion: upright within an angle, inside a box, below a speed.
//!
//! Angle and place are constraints of poses: searches project their poses into what is allowed (`search.rs`), and straight edges
//! and timed motions are proven by bisection with a step that cannot miss a violation (`poses.rs`). Speeds, of the whole motion and
//! in the scene's zones, are a matter of timing (`speed.rs`). A motion without constraints, in a scene without zones, does none of
//! this.
mod fault;
mod poses;
mod project;
pub(crate) mod search;
mod speed;
mod used;

pub use fault::{ConstraintViolation, TipFault};
pub use taustream_messages::tip_constraints::{TipBox, TipConstraints, Upright};
pub use used::TipUse;

use crate::budget::Budget;
use crate::verify::Proof;
use crate::world::World;
use nalgebra::Vector3;
use taustream_arm::{Robot, Zone};
use taustream_motion::chain::{Chain, Pose};
use taustream_motion::limits::Peaks;
use taustream_motion::{JointArray, Trajectory};

/// What edges keep beyond the constraints, so that a motion along them can be proven.
const RESERVE: Spare = Spare { turn_rad: 1e-5, inside_m: 1e-6 };
/// Below these bounds of what can change, an interval of a proof is not halved any more.
const RESOLUTION: Spare = Spare { turn_rad: 1e-8, inside_m: 1e-9 };

/// The constraints of a motion, with the geometry of a robot.
#[derive(Clone, Debug)]
pub struct TipRules<'a> {
    robot: &'a Robot,
    asked: TipConstraints,
    /// The tip's frame.
    frame: usize,
    zones: &'a [Zone],
}

/// How far a pose is inside of what is allowed; infinite where nothing is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spare {
    /// Angle.
    turn_rad: f64,
    /// Distance to the nearest side of the box.
    inside_m: f64,
}

impl Spare {
    fn is_at_least(&self, other: &Self) -> bool {
        self.turn_rad >= other.turn_rad && self.inside_m >= other.inside_m
    }
}

impl<'a> TipRules<'a> {
    /// The rules of a motion; `None` when it may do anything.
    ///
    /// # Errors
    /// A tip that the robot does not have, or a number that makes no sense.
    pub fn of(
        (robot, zones): (&'a Robot, &'a [Zone]),
        asked: &TipConstraints,
    ) -> Result<Option<Self>, TipFault> {
        let tips = robot.chain.tips();
        if asked.is_none() {
            let frame = robot.chain.tip_frame();
            return Ok((!zones.is_empty()).then_some(Self { robot, asked: *asked, frame, zones }));
        }
        if let Some((what, value)) = asked.fault() {
            return Err(TipFault::Number { what, value });
        }
        let number = usize::try_from(asked.tip).unwrap_or(usize::MAX);
        let Some(&frame) = tips.get(number) else {
            return Err(TipFault::NoSuchTip { tip: asked.tip, tips: tips.len() });
        };
        Ok(Some(Self { robot, asked: *asked, frame, zones }))
    }

    /// The same in a world.
    ///
    /// # Errors
    /// As for [`Self::of`].
    pub fn in_world(world: &'a World<'a>, asked: &TipConstraints) -> Result<Option<Self>, TipFault> {
        Self::of((world.robot(), world.zones()), asked)
    }

    /// True when poses are constrained, not only speeds.
    #[must_use]
    pub fn are_of_poses(&self) -> bool {
        self.asked.upright.is_some() || self.asked.inside.is_some()
    }

    fn chain(&self) -> &Chain {
        &self.robot.chain
    }

    /// Refuses a pose that violates the constraints, or that no motion can be proven to leave.
    ///
    /// # Errors
    /// Which constraint, with value and limit.
    pub fn check_pose(&self, pose_rad: &JointArray) -> Result<(), TipFault> {
        let tip = self.chain().frame(self.frame, pose_rad);
        if self.spare(&tip).is_at_least(&RESERVE) { Ok(()) } else { Err(self.fault(&tip)) }
    }

    /// Proves that a timed motion keeps everything, over a part of it; `peaks` are proven upper bounds there.
    ///
    /// # Errors
    /// The first constraint that is not kept, at its worst instant.
    pub fn prove(
        &self,
        motion: &Trajectory,
        (span_s, peaks): ([f64; 2], &Peaks),
        budget: &Budget,
    ) -> Result<(), ConstraintViolation> {
        if self.are_of_poses() {
            self.prove_poses(motion, span_s, budget)?;
        }
        self.prove_speed(motion, (span_s, peaks), budget)
    }

    fn spare(&self, tip: &Pose) -> Spare {
        let turn_rad = self.asked.upright.map_or(f64::INFINITY, |u| u.tolerance_rad - tilt_rad(&u, tip));
        let inside_m = self.asked.inside.map_or(f64::INFINITY, |inside| {
            let at = tip.translation.vector;
            (0..3)
                .map(|i| (at[i] - inside.low_m[i]).min(inside.high_m[i] - at[i]))
                .fold(f64::INFINITY, f64::min)
        });
        Spare { turn_rad, inside_m }
    }

    /// The constraint of poses that is violated, or nearest to it.
    fn fault(&self, tip: &Pose) -> TipFault {
        let Spare { turn_rad, inside_m } = self.spare(tip);
        if let Some(upright) =
            self.asked.upright.filter(|_| turn_rad < RESERVE.turn_rad || inside_m > turn_rad)
        {
            return TipFault::Tilted {
                angle_rad: tilt_rad(&upright, tip),
                tolerance_rad: upright.tolerance_rad,
            };
        }
        let Some(inside) = self.asked.inside else { return TipFault::NONE };
        let at = tip.translation.vector;
        let sides = (0..3).flat_map(|i| {
            [
                (i, at[i] - inside.low_m[i], inside.low_m[i], true),
                (i, inside.high_m[i] - at[i], inside.high_m[i], false),
            ]
        });
        let least = sides.min_by(|a, b| a.1.total_cmp(&b.1));
        least.map_or(TipFault::NONE, |(i, _, bound_m, is_low)| TipFault::Outside {
            axis: ['x', 'y', 'z'][i],
            value_m: at[i],
            bound_m,
            is_low,
        })
    }
}

/// Proves that a motion keeps constraints, and the zones of a world, from an instant on; what it uses of them.
///
/// # Errors
/// The first that is not kept, or constraints that make no sense.
pub fn prove_constraints(
    (world, asked): (&World, &TipConstraints),
    (motion, proof, from_s): (&Trajectory, &Proof, f64),
    budget: &Budget,
) -> Result<Option<TipUse>, ConstraintViolation> {
    let Some(rules) = TipRules::in_world(world, asked)? else { return Ok(None) };
    let span_s = [from_s, motion.duration_s().max(from_s)];
    rules.prove(motion, (span_s, &proof.peaks), budget)?;
    Ok(Some(rules.used(motion)))
}

/// Angle between the tip's axis and its direction, rad.
fn tilt_rad(upright: &Upright, tip: &Pose) -> f64 {
    let axis = tip.rotation * Vector3::from(upright.tip_axis);
    let direction = Vector3::from(upright.direction);
    // Exact near 0 and pi, where the arc cosine is not.
    axis.cross(&direction).norm().atan2(axis.dot(&direction))
}
