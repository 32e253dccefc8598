//! Straight lines of the tip: from where it is to a target, position straight and orientation by one turn.
//!
//! Inverse kinematics follow the line from the start, pose by pose, on one branch. A jerk-limited profile along it keeps
//! the speeds of the tip and every joint's limits; the motion is then made of strokes and verified like one that is imported,
//! and its distance from the line is measured.
use super::error::GoalError;
use super::inverse::Inverse;
use super::target::{Orientation, TipTarget};
use super::{Situation, check_reach, check_target};
use crate::budget::Budget;
use crate::constraints::{ConstraintViolation, TipConstraints, TipUse, prove_constraints};
use crate::explain::Stage;
use crate::import::{ImportError, Imported, Reference, import_within};
use crate::plan::{Plan, PlanError, PoseOf, check_pose};
use crate::timing::line::LineLimits;
use crate::world::World;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use taustream_arm::{MotionTable, Robot, Scene, Zone};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Spacing of the poses that are solved.
const STEP_M: f64 = 1e-3;
const STEP_RAD: f64 = 5e-3;
const STEPS: [f64; 2] = [64.0, 4000.0];
/// More of a joint between two of them is a jump: the line passes a singularity there.
const JUMP_RAD: f64 = 0.1;
/// How far the strokes may be from the profile at first, as tip way (m); halved until the line is kept.
const OFF_M: f64 = 5e-4;
const HALVINGS: i32 = 3;
/// Share of a speed limit that is used: strokes are not exactly the profile.
const SPEED_SHARE: f64 = 0.99;
/// Places at which zones on the line are looked for, and how near they count (m).
const ZONE_SAMPLES: u32 = 1_000;
const ZONE_NEAR_M: f64 = 2e-3;
/// Rows of the table that becomes strokes.
const ROW_S: f64 = 5e-3;
const ROWS: [f64; 2] = [200.0, 20_000.0];

/// How fast the tip may go along its line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipSpeed {
    /// Of the position.
    pub linear_m_s: f64,
    /// Of the orientation.
    pub angular_rad_s: f64,
    /// How far the tip may be from the line.
    pub off_m_max: f64,
}

impl Default for TipSpeed {
    /// As people set robots beside people: 250 mm/s.
    fn default() -> Self {
        Self { linear_m_s: 0.25, angular_rad_s: 1.0, off_m_max: 1e-3 }
    }
}

/// A verified motion along a straight line of the tip.
#[derive(Clone, Debug)]
pub struct Line {
    /// The motion and its proof.
    pub imported: Imported,
    /// Length of the line.
    pub length_m: f64,
    /// Angle between the orientations at its ends.
    pub angle_rad: f64,
    /// How far the tip is from the line at most.
    pub off_m: f64,
    /// What the motion uses of its constraints; `None` without any.
    pub tip_use: Option<TipUse>,
}

impl Line {
    /// The motion as a plan, which took so long to find.
    #[must_use]
    pub fn into_plan(self, how: String, planning_s: f64) -> Plan {
        let Imported { trajectory, proof, .. } = self.imported;
        let score = proof.duration_s;
        let stages = vec![Stage { what: how.clone(), took_s: planning_s, motion_s: Some(proof.duration_s) }];
        Plan {
            trajectory,
            how,
            proof,
            score,
            energy_j: None,
            planning_s,
            first_s: planning_s,
            checks: 0,
            tip_use: self.tip_use,
            stages,
        }
    }
}

/// Why there is no such motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LineError {
    /// A speed or tolerance that is none.
    #[error("the {what} is {value}; it must be above 0 ({unit})")]
    BadSpeed {
        /// Which one.
        what: &'static str,
        /// The value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// The target or the start is at fault.
    #[error(transparent)]
    Goal(#[from] GoalError),
    /// The clock, or a request that was withdrawn.
    #[error(
        "the straight line was not worked out within {after_s:.2} s; give it a longer deadline, or a shorter line"
    )]
    NoTime {
        /// How long was tried.
        after_s: f64,
    },
    /// Nothing to do.
    #[error("the tip is at the target already")]
    Still,
    /// The line leaves what the arm can reach.
    #[error(
        "the straight line is left after {at_m:.4} m of {length_m:.4} m: {why}; choose a nearer target, another start, or plan \
         without a straight line"
    )]
    Left {
        /// How far along.
        at_m: f64,
        /// Of how much.
        length_m: f64,
        /// A joint at its limit, a singularity, or how far off the nearest pose is.
        why: String,
    },
    /// The motion exists but is not safe, or no strokes keep to it.
    #[error("along the straight line: {0}")]
    Import(#[from] ImportError),
    /// The tip does not keep a constraint on the line.
    #[error("along the straight line: {0}; choose another line, or a wider constraint")]
    Constraint(#[from] ConstraintViolation),
    /// The strokes are too far from the line.
    #[error("the motion would be {off_m:.5} m off the straight line; at most {off_m_max} m were asked for")]
    Off {
        /// How far.
        off_m: f64,
        /// What was asked for.
        off_m_max: f64,
    },
}

/// Plans a verified straight line of the tip, while the budget lasts. A target without orientation keeps the one of the start.
///
/// # Errors
/// Where along the line the arm cannot follow and why, or what is in the way.
pub fn plan_line(
    situation: &Situation,
    target: &TipTarget,
    speed: &TipSpeed,
    budget: &Budget,
) -> Result<Line, LineError> {
    plan_line_keeping(situation, target, (speed, &TipConstraints::default()), budget)
}

/// The same with what the tip must keep on the way.
///
/// # Errors
/// As for [`plan_line`], and which constraint is not kept.
pub fn plan_line_keeping(
    situation: &Situation,
    target: &TipTarget,
    (speed, asked): (&TipSpeed, &TipConstraints),
    budget: &Budget,
) -> Result<Line, LineError> {
    let Situation { robot, scene, start_rad, .. } = *situation;
    for (what, value, unit) in [
        ("speed of the tip", speed.linear_m_s, "m/s"),
        ("turning speed of the tip", speed.angular_rad_s, "rad/s"),
        ("largest distance from the line", speed.off_m_max, "m"),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(LineError::BadSpeed { what, value, unit });
        }
    }
    check_target(target)?;
    check_pose(robot, PoseOf::Start, &start_rad).map_err(GoalError::from)?;
    let reach_m = check_reach(robot, target)?;
    let tip = robot.chain.frame(target.frame(robot), &start_rad);
    let line = Segment::new(&tip, target);
    if line.length_m < STEP_M * 1e-3 && line.angle_rad < STEP_RAD * 1e-3 {
        return Err(LineError::Still);
    }
    let out_of_time = || LineError::NoTime { after_s: budget.elapsed_s() };
    let track = JointTrack::follow((robot, &start_rad), &line, reach_m, budget)?;
    let speed = &slower(speed, asked, (&line, scene));
    let profile = track.limits(robot, &line, speed).optimum();
    let shares = |t_s: f64| profile.position(t_s);
    let table = track.table(robot, (&line, reach_m), (&shares, profile.duration_s()), budget);
    let table = table.ok_or_else(out_of_time)?;
    let reference = Reference::of_table(table, &robot.limits())?;
    let mut refusal = None;
    for halving in 0..=HALVINGS {
        let tolerance_rad = OFF_M.min(0.5 * speed.off_m_max) * 0.5_f64.powi(halving) / reach_m;
        let imported = match import_within(robot, scene, &reference, tolerance_rad, budget) {
            Ok(imported) => imported,
            Err(_) if budget.was_cut() => return Err(out_of_time()),
            Err(why) => return Err(refusal.unwrap_or(LineError::Import(why))),
        };
        let off_m = line.off_m(robot, &imported);
        let (length_m, angle_rad) = (line.length_m, line.angle_rad);
        if off_m <= speed.off_m_max {
            let world =
                World::new(robot, scene).map_err(|name| GoalError::Plan(PlanError::Shape { name }))?;
            let motion = (&imported.trajectory, &imported.proof, 0.0);
            let tip_use = prove_constraints((&world, asked), motion, budget)?;
            return Ok(Line { imported, length_m, angle_rad, off_m, tip_use });
        }
        refusal = Some(LineError::Off { off_m, off_m_max: speed.off_m_max });
    }
    Err(refusal.unwrap_or(LineError::Still))
}

/// The speed of a line whose tip has a speed limit, or that passes zones with one.
fn slower(speed: &TipSpeed, asked: &TipConstraints, (line, scene): (&Segment, &Scene)) -> TipSpeed {
    let passes = |zone: &&Zone| {
        let mut shares = (0..=ZONE_SAMPLES).map(|i| f64::from(i) / f64::from(ZONE_SAMPLES));
        let near_m = ZONE_NEAR_M + line.length_m / f64::from(ZONE_SAMPLES);
        shares.any(|share| zone.distance_m(&line.at(share).translation.vector) <= near_m)
    };
    let zones = scene.zones.iter().filter(passes).map(|zone| zone.speed_m_s);
    let limit_m_s = zones.chain(asked.speed_m_s).fold(f64::INFINITY, f64::min);
    TipSpeed { linear_m_s: speed.linear_m_s.min(SPEED_SHARE * limit_m_s), ..*speed }
}

/// The line itself, by the share of it that is behind.
struct Segment {
    /// Which tip goes along it.
    tip: usize,
    from: Pose,
    towards_m: Vector3<f64>,
    /// From the first orientation to the last, in the first one's axes.
    turn: UnitQuaternion<f64>,
    length_m: f64,
    angle_rad: f64,
}

impl Segment {
    fn new(from: &Pose, target: &TipTarget) -> Self {
        let towards_m = Vector3::from(target.position_m) - from.translation.vector;
        let rotation = target.orientation.map_or(from.rotation, |o| o.rotation);
        let turn = from.rotation.inverse() * rotation;
        Self {
            tip: target.tip,
            from: *from,
            towards_m,
            turn,
            length_m: towards_m.norm(),
            angle_rad: turn.angle(),
        }
    }

    fn at(&self, share: f64) -> Pose {
        let translation = Translation3::from(self.from.translation.vector + self.towards_m * share);
        Pose::from_parts(translation, self.from.rotation * self.turn.powf(share))
    }

    fn target(&self, share: f64) -> TipTarget {
        let pose = self.at(share);
        let orientation = Some(Orientation { rotation: pose.rotation, tolerance_rad: [0.0; 3] });
        TipTarget { tip: self.tip, orientation, ..TipTarget::position(pose.translation.vector.into()) }
    }

    /// Distance of the tip to the line, at most, by dense samples.
    fn off_m(&self, robot: &Robot, imported: &Imported) -> f64 {
        let motion = &imported.trajectory;
        let samples = (motion.duration_s() / 1e-3).ceil().clamp(100.0, 1e5);
        let square = self.towards_m.norm_squared().max(f64::MIN_POSITIVE);
        let mut most_m: f64 = 0.0;
        let mut k = 0.0;
        while k <= samples {
            let pose_rad = motion.sample(motion.duration_s() * k / samples).position_rad;
            let tip = robot.chain.frame(self.target(0.0).frame(robot), &pose_rad);
            let way = tip.translation.vector - self.from.translation.vector;
            let share = (way.dot(&self.towards_m) / square).clamp(0.0, 1.0);
            most_m = most_m.max((way - self.towards_m * share).norm());
            k += 1.0;
        }
        most_m
    }
}

/// Poses of the joints at equal shares of the line.
struct JointTrack {
    poses_rad: Vec<JointArray>,
}

impl JointTrack {
    fn follow(
        (robot, start_rad): (&Robot, &JointArray),
        line: &Segment,
        reach_m: f64,
        budget: &Budget,
    ) -> Result<Self, LineError> {
        let steps = (line.length_m / STEP_M).max(line.angle_rad / STEP_RAD).ceil().clamp(STEPS[0], STEPS[1]);
        let mut poses_rad = vec![*start_rad];
        let mut last_rad = *start_rad;
        let mut k = 1.0;
        while k <= steps {
            if budget.is_over() {
                return Err(LineError::NoTime { after_s: budget.elapsed_s() });
            }
            let target = line.target(k / steps);
            let next_rad = Inverse::new(robot, &target, reach_m).polish(&last_rad);
            let error = target.error(robot, &next_rad);
            let jumps = robot.joints.iter().zip(last_rad.iter().zip(&next_rad));
            let jump = jumps.map(|(joint, (a, b))| (joint, (a - b).abs())).max_by(|a, b| a.1.total_cmp(&b.1));
            let why = if !target.is_reached(&error) {
                Some(at_limit(robot, &next_rad).unwrap_or_else(|| {
                    format!("the arm is stretched out or singular there, {:.4} m are left", error.position_m)
                }))
            } else if let Some((joint, by_rad)) = jump.filter(|(_, by_rad)| *by_rad > JUMP_RAD) {
                Some(format!(
                    "joint {} would move by {by_rad:.3} {} within {:.1} mm: the line passes a singularity",
                    joint.name,
                    joint.kind.unit(),
                    1e3 * line.length_m / steps
                ))
            } else {
                None
            };
            if let Some(why) = why {
                let at_m = line.length_m * (k - 1.0) / steps;
                return Err(LineError::Left { at_m, length_m: line.length_m, why });
            }
            poses_rad.push(next_rad);
            last_rad = next_rad;
            k += 1.0;
        }
        Ok(Self { poses_rad })
    }

    /// What the share of the line may do (1/s, 1/s^2, 1/s^3) so that every joint keeps its limits at every place.
    ///
    /// With q(u): v = q' u', a = q'' u'^2 + q' u'', j = q''' u'^3 + 3 q'' u' u'' + q' u'''. Speed is kept low enough for the curved
    /// terms to leave two thirds of the acceleration and of the jerk to the others.
    fn limits(&self, robot: &Robot, line: &Segment, speed: &TipSpeed) -> LineLimits {
        let bends = self.derivatives();
        let each = |rule: &dyn Fn([f64; 3], &taustream_motion::LimitSet) -> f64| {
            let joints = robot.joints.iter().enumerate();
            joints
                .flat_map(|(j, joint)| bends.iter().map(move |d| (d[j], &joint.limits.motion)))
                .map(|(d, limits)| rule(d, limits))
                .fold(f64::INFINITY, f64::min)
        };
        let over = |limit: f64, by: f64| if by > 0.0 { limit / by } else { f64::INFINITY };
        let tip = over(speed.linear_m_s, line.length_m).min(over(speed.angular_rad_s, line.angle_rad));
        let velocity = tip.min(each(&|[first, second, third], limits| {
            over(limits.velocity_rad_s, first)
                .min(over(limits.acceleration_rad_s2 / 3.0, second).sqrt())
                .min(over(limits.jerk_rad_s3 / 6.0, third).cbrt())
        }));
        let acceleration = each(&|[first, second, _], limits| {
            over(limits.acceleration_rad_s2 - second * velocity * velocity, first)
                .min(over(limits.jerk_rad_s3 / 6.0, 3.0 * second * velocity))
        });
        let jerk = each(&|[first, second, third], limits| {
            let curved = third * velocity.powi(3) + 3.0 * second * velocity * acceleration;
            over(limits.jerk_rad_s3 - curved, first)
        });
        LineLimits { velocity, acceleration, jerk }
    }

    /// Sizes of the first three derivatives of each joint by the share of the line, place by place.
    fn derivatives(&self) -> Vec<[[f64; 3]; MAX_JOINTS]> {
        let steps = self.poses_rad.len().saturating_sub(1) as f64;
        let at = |window: &[JointArray], j: usize| {
            let [a, b, c, d, e] = window else { return [0.0; 3] };
            let (a, b, c, d, e) = (a[j], b[j], c[j], d[j], e[j]);
            let first = (8.0 * (d - b) - (e - a)) / 12.0 * steps;
            let second = (d - 2.0 * c + b) * steps.powi(2);
            let third = 0.5 * (e - 2.0 * d + 2.0 * b - a) * steps.powi(3);
            [first.abs(), second.abs(), third.abs()]
        };
        self.poses_rad.windows(5).map(|window| std::array::from_fn(|j| at(window, j))).collect()
    }

    /// The motion as rows; each is solved again, so that it is on the line to the last digits. `None` when the budget ends.
    fn table(
        &self,
        robot: &Robot,
        (line, reach_m): (&Segment, f64),
        (share_at, duration_s): (&dyn Fn(f64) -> f64, f64),
        budget: &Budget,
    ) -> Option<MotionTable> {
        let rows = (duration_s / ROW_S).ceil().clamp(ROWS[0], ROWS[1]);
        let last = self.poses_rad.len().saturating_sub(1) as f64;
        let (mut t_s, mut position_rad) = (Vec::new(), Vec::new());
        let mut known = self.poses_rad.iter();
        let mut near_rad = known.next().copied().unwrap_or_default();
        let (mut passed, mut k) = (0.0, 0.0);
        while k <= rows {
            if budget.is_over() {
                return None;
            }
            let at_s = duration_s * k / rows;
            let share = share_at(at_s).clamp(0.0, 1.0);
            // Shares only grow, so the pose before is the nearest known one.
            while passed + 1.0 <= share * last {
                passed += 1.0;
                near_rad = known.next().copied().unwrap_or(near_rad);
            }
            t_s.push(at_s);
            position_rad.push(if k == 0.0 {
                near_rad
            } else {
                Inverse::new(robot, &line.target(share), reach_m).polish(&near_rad)
            });
            k += 1.0;
        }
        let (joints, ignored) = (robot.joints.len(), Vec::new());
        Some(MotionTable {
            joints,
            t_s,
            position_rad,
            velocity_rad_s: None,
            acceleration_rad_s2: None,
            began_s: 0.0,
            ignored,
        })
    }
}

fn at_limit(robot: &Robot, pose_rad: &JointArray) -> Option<String> {
    let mut joints = robot.joints.iter().zip(pose_rad);
    let (joint, q) = joints.find(|(joint, q)| {
        let [low, high] = joint.limits.position_rad;
        **q <= low || **q >= high
    })?;
    Some(format!("joint {} is at its limit of {q:.4} {}", joint.name, joint.kind.unit()))
}
