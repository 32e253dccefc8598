//! Every entrant on every problem.
use super::{Entrant, Problem, ProblemSet};
use crate::run_context::{RunContext, Stop};
use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;
use taustream_arm::Robot;
use taustream_motion::Trajectory;
use taustream_planner::{PlanError, PlanOptions, plan};

/// Instants of a motion at which its path is measured.
const INSTANTS: u32 = 1_000;

/// What is compared.
#[derive(Clone, Debug)]
pub struct Contest {
    /// The problems, the sets that are empty included.
    pub sets: Vec<ProblemSet>,
    /// The planners; the first one is what the others are measured by.
    pub entrants: Vec<Entrant>,
    /// What grants work to a plan.
    pub deadline: Duration,
    /// What else is to be said about the sets.
    pub remarks: Vec<String>,
}

/// One verified motion.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Run {
    /// Processor time of planning, s; the one figure that is not the same on every machine.
    pub planning_s: f64,
    /// How long the motion takes, s.
    pub duration_s: f64,
    /// Path length of the tip, m.
    pub tip_m: f64,
    /// Travel of all joints, rad.
    pub travel_rad: f64,
    /// Poses that planning checked.
    pub checks: usize,
}

/// What the entrants made of one problem: for each in its order a motion, or none; and its processor time.
pub(super) struct Outcome {
    /// Which set.
    pub(super) set: usize,
    pub(super) runs: Vec<Option<Run>>,
}

impl Contest {
    /// Runs everybody on everything.
    pub(super) fn run(&self, run_context: &RunContext) -> Result<Vec<Outcome>, Stop> {
        let all = self.problems();
        run_context.say(&format!("{} planners on {} problems ..", self.entrants.len(), all.len()));
        run_context.each(all.len(), |i| {
            let Some((set, robot, problem)) = all.get(i) else { return Err(Stop::Interrupted) };
            if i % 10 == 0 {
                run_context.say(&format!("problem {} of {}", i + 1, all.len()));
            }
            let mut runs = Vec::with_capacity(self.entrants.len());
            for entrant in &self.entrants {
                if run_context.is_over() {
                    return Err(Stop::Interrupted);
                }
                runs.push(self.attempt(robot, problem, entrant, run_context.seed(problem.id))?);
            }
            Ok(Outcome { set: *set, runs })
        })
    }

    /// Every problem with the index of its set and its robot.
    pub(super) fn problems(&self) -> Vec<(usize, &Robot, &Problem)> {
        let sets = self.sets.iter().enumerate();
        sets.flat_map(|(i, set)| set.problems.iter().map(move |p| (i, &set.robot, p))).collect()
    }

    fn attempt(
        &self,
        robot: &Robot,
        problem: &Problem,
        entrant: &Entrant,
        seed: u64,
    ) -> Result<Option<Run>, Stop> {
        let options = PlanOptions {
            seed,
            deadline: self.deadline,
            planner: entrant.planner,
            improvement: entrant.improvement,
            keeps_deadline: false,
            spends_deadline: true,
            ..PlanOptions::default()
        };
        let began_s = processor_s();
        let planned = plan(robot, &problem.scene, &problem.start_rad, &problem.goal_rad, &options);
        let planning_s = processor_s() - began_s;
        match planned {
            Ok(found) => {
                let [tip_m, travel_rad] = distances(robot, &found.trajectory);
                let (duration_s, checks) = (found.proof.duration_s, found.checks);
                Ok(Some(Run { planning_s, duration_s, tip_m, travel_rad, checks }))
            }
            Err(PlanError::NotFound { .. } | PlanError::Unproven { .. } | PlanError::Untimed { .. }) => {
                Ok(None)
            }
            Err(
                error @ (PlanError::BadPose { .. }
                | PlanError::OutsideLimits { .. }
                | PlanError::InCollision { .. }
                | PlanError::InsideMargin { .. }
                | PlanError::Shape { .. }
                | PlanError::TooSlow { .. }
                | PlanError::Constraint { .. }
                | PlanError::Constraints(_)
                | PlanError::Unconstrained { .. }
                | PlanError::NoMasses(_)),
            ) => Err(Stop::Refused(format!("problem {}: {error}", problem.id))),
        }
    }

    /// What was left out, set by set.
    pub(super) fn notes(&self) -> Vec<String> {
        let one = |set: &ProblemSet| {
            let ProblemSet { name, problems, free_lines, left_out, .. } = set;
            let more = if left_out.is_empty() { String::new() } else { format!("; {left_out}") };
            format!(
                "{name}: {} problems; {free_lines} more were left out because the straight line is free{more}",
                problems.len()
            )
        };
        self.sets.iter().map(one).chain(self.remarks.iter().cloned()).collect()
    }
}

/// Path length of the tip (m) and travel of all joints (rad) of a motion.
fn distances(robot: &Robot, trajectory: &Trajectory) -> [f64; 2] {
    let duration_s = trajectory.duration_s();
    let pose = |i: u32| trajectory.sample(duration_s * f64::from(i) / f64::from(INSTANTS)).position_rad;
    let tip = |i: u32| robot.chain.frames(&pose(i))[robot.joints.len()].translation.vector;
    let (mut tip_m, mut travel_rad) = (0.0, 0.0);
    for i in 1..=INSTANTS {
        tip_m += (tip(i) - tip(i - 1)).norm();
        travel_rad += pose(i).iter().zip(&pose(i - 1)).map(|(a, b)| (a - b).abs()).sum::<f64>();
    }
    [tip_m, travel_rad]
}

/// Processor time of this thread so far, s.
pub(super) fn processor_s() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}
