//! Published problems with the default planner: how many it solves, how long that takes, and how good the motions are.
//!
//! Every problem is planned three times: as a user without a deadline has it, and with deadlines that the clock keeps. Processor time
//! is that of the planning thread; the time of a request also counts what else the computer did.
use super::Problem;
use super::contest::processor_s;
use super::problem_file::{self, ProblemFile};
use crate::run_context::{RunContext, Stop};
use crate::statistics::quantile;
use std::path::Path;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_motion::{JointArray, Trajectory};
use taustream_planner::collide::SweepRules;
use taustream_planner::world::World;
use taustream_planner::{PlanError, PlanOptions, plan};

/// Instants of a motion at which the length of its path is measured.
const INSTANTS: u32 = 1_000;

/// The deadlines, ms.
pub const DEADLINES_MS: [u64; 2] = [10, 50];

/// Problem sets and their robot.
#[derive(Clone, Debug)]
pub struct Published {
    /// The robot.
    pub robot: Robot,
    /// Its sets, by name.
    pub sets: Vec<PublishedSet>,
}

/// The problems of one set.
#[derive(Clone, Debug)]
pub struct PublishedSet {
    /// Its name.
    pub name: String,
    /// Its problems, with their numbers in the file.
    pub problems: Vec<Problem>,
}

/// What to read beside the problems.
#[derive(Clone, Copy, Debug)]
pub enum RobotSource<'a> {
    /// A robot that was read already.
    Robot(&'a Robot),
    /// A URDF file, the SRDF file with the pairs of links that may touch, and the link whose frame is the tip.
    Urdf {
        /// The geometry.
        urdf: &'a Path,
        /// The pairs.
        srdf: Option<&'a Path>,
        /// The tip; the link behind the last joint without it.
        tip_link: Option<&'a str>,
    },
}

impl Published {
    /// Reads a file of problems.
    ///
    /// # Errors
    /// What is wrong with it or with the robot's files.
    pub fn load(problems: &Path, source: RobotSource) -> Result<Self, String> {
        let fail = |why: String| format!("{}: {why}", problems.display());
        let file = ProblemFile::load(problems).map_err(fail)?;
        let robot = match source {
            RobotSource::Robot(robot) => robot.clone(),
            RobotSource::Urdf { urdf, srdf, tip_link } => {
                let found;
                let tip_link = if let Some(tip_link) = tip_link {
                    tip_link
                } else {
                    found = problem_file::link_behind_last(urdf, &file.joints)?;
                    &found
                };
                problem_file::robot(urdf, srdf, (&file.robot, &file.joints, tip_link))?
            }
        };
        let set = |(name, questions): (&String, &Vec<problem_file::Question>)| {
            let problems = questions.iter().map(|q| file.problem(&robot, q, q.id)).collect::<Result<_, _>>();
            Ok(PublishedSet {
                name: name.clone(),
                problems: problems.map_err(|e| fail(format!("{name}: {e}")))?,
            })
        };
        let sets = file.sets.iter().map(set).collect::<Result<_, String>>()?;
        Ok(Self { robot, sets })
    }

    /// Plans everything.
    ///
    /// # Errors
    /// When the user ended it, or a problem is refused for another reason than its ends.
    pub fn measure(&self, run_context: &RunContext, options: &PlanOptions) -> Result<Vec<Row>, Stop> {
        let mut rows = Vec::new();
        let mut all = Figures::default();
        for set in &self.sets {
            run_context.say(&format!("{} ({} problems) ..", set.name, set.problems.len()));
            let mut figures = Figures::default();
            for problem in &set.problems {
                if run_context.is_over() {
                    return Err(Stop::Interrupted);
                }
                figures.measure((&self.robot, problem), options).map_err(Stop::Refused)?;
            }
            rows.push(figures.row(&set.name));
            all.add(figures);
        }
        rows.push(all.row("all"));
        Ok(rows)
    }
}

/// The figures of one set; times in ms. `None` where nothing was solved.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// The set.
    pub set: String,
    /// Problems in the file.
    pub problems: usize,
    /// Problems whose start and goal are within the joints' ranges and keep the margin.
    pub valid: usize,
    /// Numbers of the others.
    pub invalid_ids: Vec<usize>,
    /// Valid problems for which there is a verified motion.
    pub solved: usize,
    /// Numbers of the valid ones without a motion.
    pub unsolved_ids: Vec<usize>,
    /// Processor time of a plan, median.
    pub planning_ms_p50: Option<f64>,
    /// 95 of 100 take less.
    pub planning_ms_p95: Option<f64>,
    /// Processor time until the first verified motion, median.
    pub first_ms_p50: Option<f64>,
    /// 95 of 100 take less.
    pub first_ms_p95: Option<f64>,
    /// Elapsed time from the request to the verified, timed motion, median.
    pub request_ms_p50: Option<f64>,
    /// 95 of 100 take less.
    pub request_ms_p95: Option<f64>,
    /// Length of the joints' path, by the norm of all joints (rad), median.
    pub length_rad_p50: Option<f64>,
    /// Sum of the lengths (rad).
    pub length_rad_sum: f64,
    /// Duration of the motion (s), median.
    pub duration_s_p50: Option<f64>,
    /// Sum of the durations (s).
    pub duration_s_sum: f64,
    /// What was solved within deadlines that the clock keeps.
    pub deadlines: Vec<WithinDeadline>,
}

/// What was solved within a deadline.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct WithinDeadline {
    /// The deadline.
    pub deadline_ms: u64,
    /// Valid problems solved.
    pub solved: usize,
    /// Elapsed time until the answer, median (ms).
    pub elapsed_ms_p50: Option<f64>,
    /// The longest (ms).
    pub elapsed_ms_max: Option<f64>,
}

/// What was measured of several problems.
#[derive(Clone, Debug, Default)]
struct Figures {
    problems: usize,
    invalid: Vec<usize>,
    unsolved: Vec<usize>,
    planning_ms: Vec<f64>,
    first_ms: Vec<f64>,
    request_ms: Vec<f64>,
    length_rad: Vec<f64>,
    duration_s: Vec<f64>,
    /// Solved, and elapsed times, for each deadline.
    deadlines: [(usize, Vec<f64>); DEADLINES_MS.len()],
}

impl Figures {
    fn measure(&mut self, (robot, problem): (&Robot, &Problem), options: &PlanOptions) -> Result<(), String> {
        self.problems += 1;
        if !are_ends_valid(robot, problem)? {
            self.invalid.push(problem.id);
            return Ok(());
        }
        let run = |options: &PlanOptions| {
            let (began, began_s) = (Instant::now(), processor_s());
            let planned = plan(robot, &problem.scene, &problem.start_rad, &problem.goal_rad, options);
            let (processor_s, elapsed_s) = (processor_s() - began_s, began.elapsed().as_secs_f64());
            match planned {
                Ok(found) => Ok((Some(found), processor_s, elapsed_s)),
                Err(PlanError::NotFound { .. } | PlanError::Unproven { .. } | PlanError::Untimed { .. }) => {
                    Ok((None, processor_s, elapsed_s))
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
                ) => Err(format!("problem {}: {error}", problem.id)),
            }
        };
        match run(options)? {
            (Some(found), processor_s, elapsed_s) => {
                self.planning_ms.push(processor_s * 1e3);
                self.first_ms.push(found.first_s * 1e3);
                self.request_ms.push(elapsed_s * 1e3);
                self.length_rad.push(length_rad(&found.trajectory));
                self.duration_s.push(found.proof.duration_s);
            }
            (None, ..) => self.unsolved.push(problem.id),
        }
        for (deadline_ms, (solved, elapsed_ms)) in DEADLINES_MS.iter().zip(&mut self.deadlines) {
            let deadline = Duration::from_millis(*deadline_ms);
            let (found, _, elapsed_s) = run(&PlanOptions { deadline, spends_deadline: true, ..*options })?;
            *solved += usize::from(found.is_some());
            elapsed_ms.push(elapsed_s * 1e3);
        }
        Ok(())
    }

    fn add(&mut self, other: Self) {
        self.problems += other.problems;
        self.invalid.extend(other.invalid);
        self.unsolved.extend(other.unsolved);
        self.planning_ms.extend(other.planning_ms);
        self.first_ms.extend(other.first_ms);
        self.request_ms.extend(other.request_ms);
        self.length_rad.extend(other.length_rad);
        self.duration_s.extend(other.duration_s);
        for ((solved, elapsed_ms), (more, more_ms)) in self.deadlines.iter_mut().zip(other.deadlines) {
            *solved += more;
            elapsed_ms.extend(more_ms);
        }
    }

    fn row(&self, set: &str) -> Row {
        let at = |values: &[f64], q: f64| Some(quantile(values, q)).filter(|v| v.is_finite());
        let deadlines = DEADLINES_MS.iter().zip(&self.deadlines);
        let within = |(deadline_ms, (solved, elapsed_ms)): (&u64, &(usize, Vec<f64>))| WithinDeadline {
            deadline_ms: *deadline_ms,
            solved: *solved,
            elapsed_ms_p50: at(elapsed_ms, 0.5),
            elapsed_ms_max: at(elapsed_ms, 1.0),
        };
        Row {
            set: set.to_owned(),
            problems: self.problems,
            valid: self.problems - self.invalid.len(),
            invalid_ids: self.invalid.clone(),
            solved: self.duration_s.len(),
            unsolved_ids: self.unsolved.clone(),
            planning_ms_p50: at(&self.planning_ms, 0.5),
            planning_ms_p95: at(&self.planning_ms, 0.95),
            first_ms_p50: at(&self.first_ms, 0.5),
            first_ms_p95: at(&self.first_ms, 0.95),
            request_ms_p50: at(&self.request_ms, 0.5),
            request_ms_p95: at(&self.request_ms, 0.95),
            length_rad_p50: at(&self.length_rad, 0.5),
            length_rad_sum: self.length_rad.iter().sum(),
            duration_s_p50: at(&self.duration_s, 0.5),
            duration_s_sum: self.duration_s.iter().sum(),
            deadlines: deadlines.map(within).collect(),
        }
    }
}

/// True when start and goal are within the joints' ranges, and keep what the planner asks of them.
fn are_ends_valid(robot: &Robot, problem: &Problem) -> Result<bool, String> {
    if ![problem.start_rad, problem.goal_rad].iter().all(|pose| problem_file::is_in_range(robot, pose)) {
        return Ok(false);
    }
    let world = World::new(robot, &problem.scene)?;
    let is_free = |pose: &JointArray, extra_m: f64| world.contact_within(pose, extra_m).is_none();
    Ok(is_free(&problem.start_rad, 0.0) && is_free(&problem.goal_rad, SweepRules::EDGE_END_M))
}

/// Length of a motion's path in joint space.
fn length_rad(motion: &Trajectory) -> f64 {
    let at = |i: u32| motion.sample(motion.duration_s() * f64::from(i) / f64::from(INSTANTS)).position_rad;
    let step = |i: u32| {
        let (from, to) = (at(i - 1), at(i));
        from.iter().zip(&to).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    };
    (1..=INSTANTS).map(step).sum()
}
