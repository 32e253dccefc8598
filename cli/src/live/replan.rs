//! `taustream replan`: asks the running planner for a motion to a new goal.
use super::client::{Client, PLANNER};
use super::follow::{Executed, follow, say_pauses};
use crate::args::{Goal, ReplanArgs};
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::interrupt;
use crate::offline::verify::{Unmodelled, clearance_words};
use crate::output::Form;
use crate::progress::Waiting;
use crate::started_ns;
use crate::words::receipt_sentence;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::Settings;
use taustream_arm::text::counted;
use taustream_messages::clock::now_ns;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome, PlanStages, When};
use taustream_messages::plan_detail::{PlanDetail, PlanStep};
use taustream_messages::tip_goal::{TipGoal, TipLine, TipOrientation};
use taustream_messages::{Outcome, Phase, PlanRequest, Receipt, Report};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::explain::Stage;
use taustream_planner::goals::TipSpeed;
use taustream_planner::{PlanOptions, TipTarget};

/// What a planner may take beyond its deadline: verification, sending, and the streamer's receipt.
const ANSWER_S: f64 = 5.0;

/// A motion that planner and streamer agreed on.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Planned {
    pub(crate) trajectory_id: u64,
    pub(crate) generation: u64,
    pub(crate) planner: String,
    pub(crate) planning_s: f64,
    pub(crate) duration_s: f64,
    pub(crate) clearance_m: f64,
    /// Where the motion is nearest to something, in trajectory time; null when nothing can collide.
    clearance_at_s: Option<f64>,
    clearance_between: Option<[String; 2]>,
    clearance_required_m: Option<f64>,
    /// Of the path in joint space that is still to go.
    path_length_rad: f64,
    /// What was tried, in its order.
    steps: Vec<StepLine>,
    pub(crate) strokes: u32,
    pub(crate) accepted: bool,
    pub(crate) from_s: f64,
    pub(crate) tick: u64,
    /// True when people shall see the steps, too.
    #[serde(skip)]
    explain: bool,
    #[serde(skip)]
    asked_ns: u64,
    #[serde(skip)]
    planner_stages: PlanStages,
}

/// One step of planning.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StepLine {
    what: String,
    took_s: f64,
    /// Duration of the best verified motion after it.
    motion_s: Option<f64>,
}

impl From<PlanStep> for StepLine {
    fn from(PlanStep { what, took_s, motion_s }: PlanStep) -> Self {
        Self { what, took_s, motion_s }
    }
}

impl fmt::Display for StepLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stage = Stage { what: self.what.clone(), took_s: self.took_s, motion_s: self.motion_s };
        write!(f, "  {stage}")
    }
}

/// When what was done, s after the request was sent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Stages {
    /// From the start of this process to the request.
    command_s: f64,
    received_s: f64,
    planned_s: f64,
    proven_s: f64,
    sent_s: f64,
    accepted_s: f64,
    answered_s: f64,
    /// The first cycle that sampled the new motion; null without `--wait`.
    first_setpoint_s: Option<f64>,
}

impl Stages {
    fn of(planned: &Planned, answered_ns: u64, first_setpoint_ns: Option<u64>) -> Self {
        let PlanStages { received_ns, planned_ns, proven_ns, sent_ns, receipt_ns } = planned.planner_stages;
        let after_s = |ns: u64| Duration::from_nanos(ns.saturating_sub(planned.asked_ns)).as_secs_f64();
        Self {
            command_s: Duration::from_nanos(planned.asked_ns.saturating_sub(started_ns())).as_secs_f64(),
            received_s: after_s(received_ns),
            planned_s: after_s(planned_ns),
            proven_s: after_s(proven_ns),
            sent_s: after_s(sent_ns),
            accepted_s: after_s(receipt_ns),
            answered_s: after_s(answered_ns),
            first_setpoint_s: first_setpoint_ns.map(after_s),
        }
    }
}

/// The whole answer.
#[derive(Debug, Serialize)]
struct Answer {
    arm: String,
    #[serde(flatten)]
    planned: Planned,
    unmodelled_links: Vec<String>,
    stages: Stages,
    #[serde(flatten)]
    executed: Option<Executed>,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", Unmodelled(&self.unmodelled_links), self.planned)?;
        if let Some(e) = &self.executed {
            write!(f, "\n{e}")?;
        }
        Ok(())
    }
}

impl Planned {
    /// The same plan, of which another trajectory has taken the rest.
    pub(crate) fn rerouted(self, trajectory_id: u64) -> Self {
        let planner = format!("{}; rerouted when the scene changed", self.planner);
        Self { trajectory_id, planner, ..self }
    }
}

impl fmt::Display for Planned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "planned by    {} in {:.3} s", self.planner, self.planning_s)?;
        if self.explain {
            self.steps.iter().try_for_each(|step| writeln!(f, "{step}"))?;
        }
        writeln!(
            f,
            "duration      {:.3} s at full speed, {}, {:.3} rad long",
            self.duration_s,
            counted(self.strokes, "stroke"),
            self.path_length_rad
        )?;
        let [a, b] = self.clearance_between.clone().unwrap_or_default();
        let (at_s, required_m) = (self.clearance_at_s, self.clearance_required_m);
        let (at_s, required_m) = (at_s.unwrap_or_default(), required_m.unwrap_or_default());
        writeln!(f, "clearance     {}", clearance_words((self.clearance_m, required_m), at_s, (&a, &b)))?;
        let (id, generation) = (self.trajectory_id, self.generation);
        write!(
            f,
            "receipt       accepted: trajectory {id} (generation {generation}) {}",
            from_words(self.from_s, self.tick)
        )
    }
}

/// From when an accepted trajectory runs: one that waits for its cut has no cycle yet.
pub(crate) fn from_words(from_s: f64, tick: u64) -> String {
    match tick {
        0 => format!("from {from_s:.3} s of the running motion on"),
        _ => format!("from {from_s:.3} s on, at cycle {tick}"),
    }
}

/// Asks, prints the receipt, and waits for the end of the motion if requested.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &ReplanArgs) -> Result<(), Failure> {
    let settings = arm::settings_to_talk(settings)?;
    let client = Client::join(&settings.name)?;
    let goal_rad = |start_rad: &JointArray| -> Result<(JointArray, Option<TipGoal>), Failure> {
        match args.goal.of(&settings.robot, start_rad)? {
            Goal::Poses(poses) if poses.len() > 1 => {
                Err(Failure::Usage("replan takes one goal; `taustream plan` compares several".to_owned()))
            }
            Goal::Poses(poses) => Ok((poses.first().copied().unwrap_or_default(), None)),
            Goal::Tip(target) => Ok((
                [0.0; MAX_JOINTS],
                Some(tip_goal(&target, args.goal.linear.then(|| args.goal.tip_speed()))),
            )),
        }
    };
    let (robot, group) = (&settings.robot, args.goal.group_of(&settings.robot)?);
    // The planner knows best where the joints of other groups are.
    let others_rad = if args.goal.needs_start() { start_rad(&client)? } else { [0.0; MAX_JOINTS] };
    let (goal_rad, tip) = goal_rad(&others_rad)?;
    if args.goal.linear
        && let Some(option) = args.via.given()
    {
        let why = format!("{option}: a straight line of the tip has no corners and passes no poses");
        return Err(Failure::Usage(why));
    }
    let request = CheckedPlanRequest {
        tip,
        via_rad: args.via.poses_of((robot, group), &others_rad)?,
        held_joints: group.map_or(0, |group| group.others(robot.joints.len())),
        blend: args.via.blend(),
        constraints: args.goal.constraints(robot)?,
        when: args.when(),
        deadline_ms: args.deadline_ms.unwrap_or(0),
        seed: args.seed,
        planner: args.planner.name().to_owned(),
        ..CheckedPlanRequest::to_pose(robot.joints.len(), goal_rad)
    };
    go(form, (&client, &settings), &request, (args.wait, args.explain, args.wait_s)).map_err(|failure| {
        let hint = args.goal.angles().find_map(|(goal, _)| goal.degrees_hint(robot, group));
        match hint {
            Some(hint) if matches!(failure, Failure::Refused(_)) => {
                Failure::Refused(format!("{failure} ({hint})"))
            }
            _ => failure,
        }
    })
}

/// Where the arm is commanded to be at rest: now, or at the end of what runs.
fn start_rad(client: &Client) -> Result<JointArray, Failure> {
    let (report, phase) = client.report()?;
    let runs = matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused);
    Ok(if runs { report.end_rad } else { report.command_rad })
}

/// A target of the tip as the planner takes it.
fn tip_goal(target: &TipTarget, speed: Option<TipSpeed>) -> TipGoal {
    let orientation = target.orientation.map(|o| TipOrientation {
        quaternion_xyzw: o.rotation.coords.into(),
        tolerance_rad: o.tolerance_rad,
    });
    let line = speed.map(|TipSpeed { linear_m_s, angular_rad_s, off_m_max }| TipLine {
        linear_m_s,
        angular_rad_s,
        off_m_max,
    });
    TipGoal {
        tip: u32::try_from(target.tip).unwrap_or(u32::MAX),
        position_m: target.position_m,
        tolerance_m: target.tolerance_m,
        orientation,
        line,
    }
}

/// Asks the planner, prints the receipt, and waits for the end of the motion if requested.
pub(crate) fn go(
    form: Form,
    (client, settings): (&Client, &Settings),
    request: &CheckedPlanRequest,
    (wait, explain, wait_s): (bool, bool, f64),
) -> Result<(), Failure> {
    let request = (request, Duration::from_secs_f64(wait_s));
    let arm = ArmName::of(settings);
    let words = if wait_s > 0.0 {
        format!("planning; for a neighbour's motion {wait_s:.1} s are waited")
    } else {
        format!("planning, {:.1} s at most", deadline_s(request.0))
    };
    let mut waiting = Waiting::begin();
    let mut say = || {
        waiting.say(form, &words);
        Ok(())
    };
    let mut tell = |steps: &[StepLine]| {
        if explain {
            steps.iter().for_each(|step| form.progress(step));
        }
    };
    let planned = Planned { explain, ..ask_within(client, &arm, request, &mut say, &mut tell)? };
    let answered_ns = now_ns();
    let mut first_setpoint_ns = None;
    let executed = if wait {
        form.progress(format_args!("accepted; moving, {:.1} s at full speed ..", planned.duration_s));
        let (id, mut say) = (planned.trajectory_id, say_pauses(form));
        Some(follow(client, &arm, id, |report, phase| {
            // The cycle in which a motion begins or takes over reports at once.
            if report.trajectory_id == id {
                first_setpoint_ns.get_or_insert(report.time_ns);
            }
            say(report, phase)
        })?)
    } else {
        None
    };
    let unmodelled_links = settings.robot.unmodelled_links.clone();
    let stages = Stages::of(&planned, answered_ns, first_setpoint_ns);
    form.print(&Answer { arm: arm.name, planned, unmodelled_links, stages, executed })
}

/// How long the planner may take at most.
fn deadline_s(request: &CheckedPlanRequest) -> f64 {
    let default_s = PlanOptions::default().deadline.as_secs_f64();
    if request.deadline_ms == 0 { default_s } else { f64::from(request.deadline_ms) * 1e-3 }
}

/// How often a planner is asked again while a neighbour is in the way.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// [`ask_within`] at once.
pub(crate) fn ask_while(
    client: &Client,
    arm: &ArmName,
    request: &CheckedPlanRequest,
    meanwhile: &mut dyn FnMut() -> Result<(), Failure>,
    said: &mut dyn FnMut(&[StepLine]),
) -> Result<Planned, Failure> {
    ask_within(client, arm, (request, Duration::ZERO), meanwhile, said)
}

/// Sends a request, again until `wait` has passed while a neighbour is in the way, and reads the answer; an answer without an accepting receipt is a failure. `meanwhile` runs while the
/// planner plans; `said` is given what was tried in vain.
fn ask_within(
    client: &Client,
    arm: &ArmName,
    (request, wait): (&CheckedPlanRequest, Duration),
    meanwhile: &mut dyn FnMut() -> Result<(), Failure>,
    said: &mut dyn FnMut(&[StepLine]),
) -> Result<Planned, Failure> {
    let remaining_s = match request.when {
        // The planner looks at the streamer by itself, and at once.
        When::AtOnce | When::Cancel => 0.0,
        When::AfterCurrent | When::Queue => remaining_s(&client.report()?.0),
    };
    let limit_s = deadline_s(request) + ANSWER_S + remaining_s;
    let since = Instant::now();
    let (reply, asked_ns) = loop {
        let asked_ns = now_ns();
        let reply = client.plan(PlanRequest::from(request), limit_s, meanwhile)?;
        if !reply.is_for_now() || since.elapsed() >= wait {
            break (reply, asked_ns);
        }
        meanwhile()?;
        interrupt::check()?;
        thread::sleep(AGAIN_AFTER);
    };
    let PlanDetail { path_length_rad, nearest, steps } = reply.detail();
    let steps: Vec<StepLine> = steps.into_iter().map(StepLine::from).collect();
    match reply.outcome() {
        PlanOutcome::Failed { reason } => {
            said(&steps);
            // A planner without a streamer has no pose to start from.
            client.report()?;
            Err(Failure::Refused(format!("no plan: {reason}")))
        }
        PlanOutcome::Planned { receipt: None, trajectory_id, .. } => Err(Failure::Failed(format!(
            "{PLANNER} sent trajectory {trajectory_id}, but the streamer gave no receipt; `taustream status` shows whether it runs"
        ))),
        PlanOutcome::Planned {
            trajectory_id,
            planning_s,
            duration_s,
            clearance_m,
            strokes,
            how,
            receipt: Some(receipt),
            stages,
        } => {
            let (from_s, tick) = accepted(&receipt, arm)?;
            Ok(Planned {
                trajectory_id,
                generation: receipt.generation(),
                planner: how,
                planning_s,
                duration_s,
                clearance_m,
                clearance_at_s: nearest.as_ref().map(|n| n.at_s),
                clearance_required_m: nearest.as_ref().map(|n| n.required_m),
                clearance_between: nearest.map(|n| n.between),
                path_length_rad,
                steps,
                strokes,
                accepted: true,
                from_s,
                tick,
                explain: false,
                asked_ns,
                planner_stages: stages,
            })
        }
    }
}

/// Trajectory time and cycle from which an accepted motion runs.
///
/// # Errors
/// The streamer's reason when it was rejected.
pub(crate) fn accepted(receipt: &Receipt, arm: &ArmName) -> Result<(f64, u64), Failure> {
    match receipt.outcome() {
        Some(Outcome::Accepted { from_s, tick }) => Ok((from_s, tick)),
        outcome @ (Some(Outcome::Rejected(_)) | None) => {
            Err(Failure::Refused(receipt_sentence(outcome.as_ref(), arm)))
        }
    }
}

/// How long a motion that must end first may still take.
fn remaining_s(report: &Report) -> f64 {
    let left_s = (report.trajectory_duration_s - report.trajectory_s).max(0.0);
    left_s * 100.0 / report.speed_percent.clamp(1.0, 100.0)
}
