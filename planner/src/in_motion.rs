//! From a motion that runs to a verified replacement of it.
//!
//! A replacement repeats the strokes that have begun before its cut and is verified from the cut on, for limits and for
//! distances: the sum of kept and new strokes is new geometry. Three ways, from the quickest: strokes that carry the arm from
//! its state at the cut to the goal; a taper to rest, and an ordinary plan from there; or the end of the motion, and an
//! ordinary plan from there. The last one always exists. Of those that are proven the shortest is taken. Way points before the
//! goal, and the end of a motion that is gone on from, are corners: they are rounded where that is proven, else the arm stops at them.
use crate::budget::Budget;
use crate::constraints::prove_constraints;
use crate::held::held;
use crate::pipeline::blends_rad;
use crate::plan::{
    Plan, PlanError, PlanOptions, PoseOf, STACK_BYTES, StartMargin, Task, check_pose, nearest_inside,
    plan_through_until, plan_until,
};
use crate::replacement::{replacement, to_rest};
use crate::timing::Path;
use crate::timing::onward::Onward;
use crate::verify::{LeastDistance, Proof, Stretch, Violation, verify_stretches};
use crate::world::World;
use std::sync::atomic::AtomicBool;
use std::thread;
use taustream_arm::{Robot, Scene};
use taustream_messages::Replaces;
use taustream_messages::clock::now_ns;
use taustream_motion::cut::kept;
use taustream_motion::{JointArray, Stroke, Trajectory, TrajectoryError};

/// What is cut, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct CutPoint {
    /// Id of the trajectory that is cut.
    pub trajectory_id: u64,
    /// Its strokes; `None` when another process has sent it.
    pub trajectory: Option<Trajectory>,
    /// Trajectory time of the cut.
    pub at_s: f64,
    /// Trajectory time from which the replacement is sampled: the cut, or earlier when it cuts one that waits.
    pub from_s: f64,
    /// Trajectory time at which the trajectory ends.
    pub end_s: f64,
    /// Where it ends.
    pub end_rad: JointArray,
}

impl CutPoint {
    pub(crate) fn replaces(&self) -> Replaces {
        Replaces::Cut { trajectory_id: self.trajectory_id, at_s: self.at_s }
    }

    /// The trajectory that is cut, with the strokes folded that have ended when the replacement takes over.
    fn folded(&self) -> Result<Trajectory, NoReplacement> {
        let trajectory = self.trajectory.as_ref().ok_or(NoReplacement::Unknown)?;
        Ok(folded(trajectory, self.at_s, self.from_s)?)
    }
}

/// A trajectory that is cut at `at_s`, with the strokes folded that have ended at `from_s`.
pub(crate) fn folded(trajectory: &Trajectory, at_s: f64, from_s: f64) -> Result<Trajectory, TrajectoryError> {
    let kept = kept(trajectory, at_s, from_s);
    let pending = trajectory.strokes().iter().filter(|stroke| stroke.start_s >= at_s);
    let strokes: Vec<Stroke> = kept.strokes.iter().chain(pending).copied().collect();
    Trajectory::new(trajectory.joints(), kept.base_rad, &strokes)
}

/// A verified replacement.
#[derive(Clone, Debug, PartialEq)]
pub struct Replacement {
    /// Kept and new strokes.
    pub trajectory: Trajectory,
    /// What was proven of it from the cut on.
    pub least: LeastDistance,
    /// What it is, in a few words.
    pub how: String,
    /// When its strokes were there and its proof began, by `CLOCK_MONOTONIC`, ns.
    pub planned_ns: u64,
    /// Which cut it is made for.
    pub replaces: Replaces,
}

/// Why there is no replacement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoReplacement {
    /// The strokes of the running motion are not known here.
    #[error("another process has sent the running motion, and its strokes are not known here")]
    Unknown,
    /// No strokes were found that carry the arm from its state at the cut.
    #[error("no strokes were found that lead on from the cut at {at_s:.3} s inside the motion limits")]
    NoStrokes {
        /// Trajectory time of the cut.
        at_s: f64,
    },
    /// Kept and new strokes are no trajectory: as a rule, they are too many.
    #[error("kept and new strokes together: {0}; wait until some of what is queued has run")]
    Strokes(#[from] TrajectoryError),
    /// Nothing could be planned from where the arm comes to rest.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Between two motions the arm has to stop.
    #[error("no strokes were found that round the corner at {at_s:.3} s within the blend")]
    NoCorner {
        /// Trajectory time of the end of the first motion.
        at_s: f64,
    },
    /// It is not proven.
    #[error("the replacement is not proven: {0}")]
    Unproven(#[from] Violation),
    /// A fault of the planner itself.
    #[error("the planner has a fault and gave up on this way; see its log")]
    Panicked,
    /// A shape of the robot or the scene cannot be built.
    #[error("{name}: its mesh has no usable triangles; correct the file")]
    Shape {
        /// The link or obstacle.
        name: String,
    },
}

/// Robot, scene and what ends the work.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Its surroundings.
    pub scene: &'a Scene,
    /// Set when nobody waits for the result any more.
    pub cancel: &'a AtomicBool,
    /// Joints that no plan from rest moves whose points leave them where they are, a bit each.
    pub held_joints: u32,
}

impl Surroundings<'_> {
    /// A taper that brings the arm to rest as soon as its limits allow.
    ///
    /// # Errors
    /// When no taper is found, or it is not proven.
    pub fn taper(&self, cut: &CutPoint, options: &PlanOptions) -> Result<Replacement, NoReplacement> {
        let tapered = self.taper_strokes(cut)?;
        let planned_ns = now_ns();
        let proof = self.prove(&tapered, cut, options)?;
        let how = "taper to rest".to_owned();
        let (trajectory, least, replaces) = (tapered, LeastDistance::of(&proof, 0.0), cut.replaces());
        Ok(Replacement { trajectory, least, how, planned_ns, replaces })
    }

    /// A taper to rest, and an ordinary plan from there to the goal.
    ///
    /// # Errors
    /// When there is no taper, no plan, or one of them is not proven.
    pub fn rest_first(
        &self,
        (cut, points_rad): (&CutPoint, &[JointArray]),
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let tapered = self.taper_strokes(cut)?;
        let proof = self.prove(&tapered, cut, options)?;
        let plan = self.plan(&tapered.end_rad(), points_rad, options)?;
        let how = format!("to rest at {:.3} s, then {}", tapered.duration_s(), plan.how);
        stopping((&tapered, &proof), &plan, (cut, how))
    }

    /// What runs goes on to its end, and an ordinary plan leads on from there.
    ///
    /// # Errors
    /// When there is no plan, or strokes that must be kept are not known.
    pub fn after_end(
        &self,
        (cut, points_rad): (&CutPoint, &[JointArray]),
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let plan = self.plan(&cut.end_rad, points_rad, options)?;
        after(cut, &plan)
    }

    /// What runs goes on past its end by an ordinary plan from there, without a stop where the corner can be rounded.
    ///
    /// # Errors
    /// When there is no plan, or strokes that must be kept are not known.
    pub fn past_end(
        &self,
        [cut, end]: [&CutPoint; 2],
        points_rad: &[JointArray],
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let plan = self.plan(&end.end_rad, points_rad, options)?;
        let rounded = cut.folded().and_then(|first| self.rounded(cut, (&first, &plan), options));
        rounded.or_else(|_| after(end, &plan))
    }

    /// Two motions without a stop between them.
    fn rounded(
        &self,
        cut: &CutPoint,
        (first, plan): (&Trajectory, &Plan),
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let (limits, world) = (self.robot.limits(), self.world()?);
        let onward = Onward { first, then: &plan.trajectory, from_s: cut.at_s, limits: &limits };
        let end_s = first.duration_s();
        let mut why = NoReplacement::NoCorner { at_s: end_s };
        for blend_rad in blends_rad(options.blend, &world) {
            // What is not found in a wide tube is not found in a narrow one.
            let Some(timed) = onward.rounded(blend_rad) else { break };
            let planned_ns = now_ns();
            match self.prove(&timed.trajectory, cut, options) {
                Ok(proof) => {
                    let (off_rad, how) = (timed.deviation_rad, &plan.how);
                    return Ok(Replacement {
                        trajectory: timed.trajectory,
                        least: LeastDistance::of(&proof, 0.0),
                        how: format!(
                            "on past {end_s:.3} s, rounded by at most {off_rad:.3} {}: {how}",
                            world.robot().travel_unit()
                        ),
                        planned_ns,
                        replaces: cut.replaces(),
                    });
                }
                Err(unproven) => why = unproven,
            }
        }
        Err(why)
    }

    /// Strokes that carry the arm from its state at the cut through the points before the goal to the goal, as soon as its limits allow.
    ///
    /// # Errors
    /// When none are found, or they are not proven.
    pub fn direct(
        &self,
        (cut, points_rad): (&CutPoint, &[JointArray]),
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let Some((first_rad, others_rad)) = points_rad.split_first() else {
            return Err(NoReplacement::NoStrokes { at_s: cut.at_s });
        };
        let which = if others_rad.is_empty() { PoseOf::Goal } else { PoseOf::Via(0) };
        check_pose(self.robot, which, first_rad)?;
        let first_rad = nearest_inside(self.robot, first_rad);
        let made = replacement(&cut.folded()?, cut.at_s, &first_rad, &self.robot.limits());
        let trajectory = made.ok_or(NoReplacement::NoStrokes { at_s: cut.at_s })?;
        let how = "straight on from the motion";
        if others_rad.is_empty() {
            let planned_ns = now_ns();
            let least = LeastDistance::of(&self.prove(&trajectory, cut, options)?, 0.0);
            let (how, replaces) = (how.to_owned(), cut.replaces());
            return Ok(Replacement { trajectory, least, how, planned_ns, replaces });
        }
        let plan = self.plan(&first_rad, others_rad, options)?;
        self.rounded(cut, (&trajectory, &plan), options).or_else(|_| {
            let proof = self.prove(&trajectory, cut, options)?;
            let how = format!("{how}, at {:.3} s at rest; {}", trajectory.duration_s(), plan.how);
            stopping((&trajectory, &proof), &plan, (cut, how))
        })
    }

    /// The shortest proven way to the goal that needs no search: straight on from the cut, or, where even straight lines from
    /// there would be over earlier, on from the end of the motion.
    ///
    /// # Errors
    /// When there are no strokes straight on, or they are not proven.
    pub fn direct_or_after_end(
        &self,
        [cut, end]: [&CutPoint; 2],
        points_rad: &[JointArray],
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let direct = self.direct((cut, points_rad), options)?;
        let limits = self.robot.limits();
        let points = points_rad.iter().map(|point_rad| nearest_inside(self.robot, point_rad));
        let corners_rad: Vec<JointArray> = std::iter::once(end.end_rad).chain(points).collect();
        let path = Path { corners_rad: &corners_rad, joints: self.robot.joints.len(), limits: &limits };
        let straight_s = path.stopping().map_or(f64::INFINITY, |timed| timed.trajectory.duration_s());
        if end.end_s + straight_s >= direct.trajectory.duration_s() {
            return Ok(direct);
        }
        shorter(Ok(direct), self.after_end((end, points_rad), options))
    }

    /// The shorter one of two ways round what is in the way: to rest and on, or on from the end of the motion.
    ///
    /// # Errors
    /// Why there is no way from rest, when there is none from the end either.
    pub fn rest_first_or_after_end(
        &self,
        [cut, end]: [&CutPoint; 2],
        points_rad: &[JointArray],
        options: &PlanOptions,
    ) -> Result<Replacement, NoReplacement> {
        let (from_rest, from_end) = thread::scope(|scope| {
            let beside = thread::Builder::new().stack_size(STACK_BYTES);
            let from_end = beside.spawn_scoped(scope, || self.after_end((end, points_rad), options));
            let from_rest = self.rest_first((cut, points_rad), options);
            let from_end = match from_end {
                Ok(from_end) => from_end.join().unwrap_or(Err(NoReplacement::Panicked)),
                // Without a thread one after the other.
                Err(_) => self.after_end((end, points_rad), options),
            };
            (from_rest, from_end)
        });
        shorter(from_rest, from_end)
    }

    fn taper_strokes(&self, cut: &CutPoint) -> Result<Trajectory, NoReplacement> {
        let tapered = to_rest(&cut.folded()?, cut.at_s, &self.robot.limits());
        tapered.ok_or(NoReplacement::NoStrokes { at_s: cut.at_s })
    }

    /// An ordinary plan from a pose at rest to the last of some points, through the others.
    fn plan(
        &self,
        start_rad: &JointArray,
        points_rad: &[JointArray],
        options: &PlanOptions,
    ) -> Result<Plan, NoReplacement> {
        let (held, points_rad) = held(self.held_joints, start_rad, points_rad);
        let holding;
        let robot = if held == 0 {
            self.robot
        } else {
            holding = self.robot.holding(held, start_rad);
            &holding
        };
        let (scene, margin) = (self.scene, StartMargin::AsItStands);
        let points_rad = points_rad.as_slice();
        if let [goal_rad] = points_rad {
            let task = Task { robot, scene, start_rad: *start_rad, goal_rad: *goal_rad, margin };
            return Ok(plan_until(&task, options, Some(self.cancel))?);
        }
        let all_rad: Vec<JointArray> = std::iter::once(start_rad).chain(points_rad).copied().collect();
        Ok(plan_through_until((robot, scene, StartMargin::AsItStands), &all_rad, options, Some(self.cancel))?)
    }

    fn world(&self) -> Result<World<'_>, NoReplacement> {
        World::new(self.robot, self.scene).map_err(|name| NoReplacement::Shape { name })
    }

    /// Proves limits, distances and constraints from the cut on.
    fn prove(
        &self,
        trajectory: &Trajectory,
        cut: &CutPoint,
        options: &PlanOptions,
    ) -> Result<Proof, NoReplacement> {
        let world = self.world()?;
        let budget = Budget::until(options.deadline, Some(self.cancel));
        let span_s = [cut.at_s, trajectory.duration_s().max(cut.at_s)];
        let proof = verify_stretches(&[Stretch { world: &world, span_s }], trajectory, &budget)?;
        let motion = (trajectory, &proof, cut.at_s);
        prove_constraints((&world, &options.constraints), motion, &budget).map_err(Violation::from)?;
        Ok(proof)
    }
}

/// Of two replacements the one that ends earlier; of two refusals the first.
fn shorter(
    a: Result<Replacement, NoReplacement>,
    b: Result<Replacement, NoReplacement>,
) -> Result<Replacement, NoReplacement> {
    match (a, b) {
        (Ok(a), Ok(b)) => Ok(if b.trajectory.duration_s() < a.trajectory.duration_s() { b } else { a }),
        (Ok(only), Err(_)) | (Err(_), Ok(only)) => Ok(only),
        (Err(why), Err(_)) => Err(why),
    }
}

/// A plan that begins when the motion that is cut has ended.
fn after(cut: &CutPoint, plan: &Plan) -> Result<Replacement, NoReplacement> {
    // At its end every stroke of a motion that runs is folded; of one that waits, all are kept.
    let trajectory = match &cut.trajectory {
        Some(trajectory) => {
            let kept = kept(trajectory, cut.at_s, cut.from_s);
            continued(&kept.base_rad, kept.strokes, (&plan.trajectory, cut.end_s))?
        }
        None if cut.from_s >= cut.end_s => continued(&cut.end_rad, &[], (&plan.trajectory, cut.end_s))?,
        None => return Err(NoReplacement::Unknown),
    };
    Ok(Replacement {
        trajectory,
        least: LeastDistance::of(&plan.proof, cut.end_s),
        how: format!("after {:.3} s: {}", cut.end_s, plan.how),
        planned_ns: now_ns(),
        replaces: cut.replaces(),
    })
}

/// A motion from the cut to rest, whose clearance is proven, and a plan that begins when it has ended.
fn stopping(
    (first, proof): (&Trajectory, &Proof),
    plan: &Plan,
    (cut, how): (&CutPoint, String),
) -> Result<Replacement, NoReplacement> {
    let trajectory = continued(first.base_rad(), first.strokes(), (&plan.trajectory, first.duration_s()))?;
    let least = LeastDistance::of(proof, 0.0).min(LeastDistance::of(&plan.proof, first.duration_s()));
    Ok(Replacement { trajectory, least, how, planned_ns: now_ns(), replaces: cut.replaces() })
}

/// Kept strokes, and a motion from rest to rest that begins at `from_s`, where they have ended.
fn continued(
    base_rad: &JointArray,
    kept: &[Stroke],
    (motion, from_s): (&Trajectory, f64),
) -> Result<Trajectory, NoReplacement> {
    let later = motion.strokes().iter().map(|stroke| Stroke { start_s: stroke.start_s + from_s, ..*stroke });
    let strokes: Vec<Stroke> = kept.iter().copied().chain(later).collect();
    Ok(Trajectory::new(motion.joints(), *base_rad, &strokes)?)
}
