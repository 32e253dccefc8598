//! What must hold over the real processes, one function a promise. Names say area, event, condition.
use crate::stage::{Motion, PATIENCE, Stage};
use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use std::time::{Duration, Instant};
use taustream_messages::service::{ReceiptSubscriber, TrajectoryPublisher, Wire};
use taustream_messages::trajectory::Doctored;
use taustream_messages::{
    CheckedTrajectory, FaultReason, Outcome, Phase, Receipt, Rejection, Replaces, Report, TrajectoryMessage,
};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};

/// How far a servo may be from the goal when the arm holds: the simulated servos' sag and quantisation.
const AT_GOAL_RAD: f64 = 5e-3;

/// The three goals of the demo, as the command line takes them.
#[derive(Clone, Debug)]
pub struct Goals(pub Vec<Vec<f64>>);

impl Goals {
    pub(crate) fn text(&self, index: usize) -> Result<String> {
        let goal = self.0.get(index).context("the demo has too few goals")?;
        Ok(goal.iter().map(ToString::to_string).collect::<Vec<_>>().join(","))
    }
    pub(crate) fn rad(&self, index: usize) -> Result<&[f64]> {
        self.0.get(index).map(Vec::as_slice).context("the demo has too few goals")
    }
}

/// One scenario.
#[derive(Clone, Copy, Debug)]
pub struct Scenario {
    /// Area, event, condition.
    pub name: &'static str,
    /// What it does; it fails by an error.
    pub run: fn(&mut Stage, &Goals) -> Result<()>,
    /// How its recording is judged.
    pub judged: Judged,
    /// Settings, beside those of the run, that it needs instead.
    pub settings: Option<&'static str>,
}

/// How a recording is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// Every cycle's frames are on the bus, whole.
    Exactly,
    /// Cycles may be lost, whole or in part, but the log says so, and nothing is on the bus that it does not claim.
    WithLosses,
}

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[
    Scenario {
        name: "three_goals_round_obstacles_reached",
        run: three_goals,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "pause_mid_motion_then_resume_reaches_goal",
        run: pause_and_resume,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "speed_and_stop_mid_motion_hold_on_path",
        run: speed_and_stop,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "planner_killed_mid_motion_motion_finishes",
        run: planner_killed,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "servo_silent_mid_motion_fast_stop_names_joint",
        run: servo_silent,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "servo_fault_mid_motion_fast_stop_names_joint",
        run: servo_fault,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "message_hostile_mid_motion_changes_nothing",
        run: hostile_messages,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "streamer_started_twice_second_is_refused",
        run: started_twice,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "interface_missing_or_down_streamer_says_so",
        run: interface_missing_or_down,
        judged: Judged::Exactly,
        settings: None,
    },
    Scenario {
        name: "commands_out_of_place_are_refused_with_reason",
        run: commands_out_of_place,
        judged: Judged::Exactly,
        settings: None,
    },
];

pub(crate) fn enable(stage: &mut Stage) -> Result<()> {
    stage.cli_done(&["enable"])?;
    stage.await_phase(Phase::Holding)?;
    stage.cli_done(&["speed", "100"])?;
    Ok(())
}

/// Waits until a motion has brought the arm to its goal.
fn arrive(stage: &mut Stage, motion: Motion, goal_rad: &[f64]) -> Result<Report> {
    arrive_within(stage, motion, goal_rad, AT_GOAL_RAD)
}

/// Like [`arrive`], for joints that rest within `off_rad` of where they are told to be.
pub(crate) fn arrive_within(
    stage: &mut Stage,
    motion: Motion,
    goal_rad: &[f64],
    off_rad: f64,
) -> Result<Report> {
    let report = stage.await_end_of(motion)?;
    for (joint, (goal, commanded)) in goal_rad.iter().zip(report.command_rad).enumerate() {
        let joint = joint + 1;
        ensure!((commanded - goal).abs() < 1e-9, "joint {joint}: commanded {commanded}, goal {goal} rad");
    }
    stage.await_report("the joints to settle at the goal", |report, _| {
        goal_rad.iter().zip(report.measured_rad).all(|(goal, got)| (goal - got).abs() < off_rad)
    })
}

/// Sends the arm to a goal and waits until it is under way: past `share` of the motion.
pub(crate) fn set_off(stage: &mut Stage, goals: &Goals, index: usize, share: f64) -> Result<Motion> {
    let motion = stage.replan(&goals.text(index)?)?;
    stage.await_under_way(motion, share)?;
    Ok(motion)
}

/// Sends the arm to a goal and waits until it stands there.
pub(crate) fn go(stage: &mut Stage, goals: &Goals, index: usize) -> Result<Report> {
    let motion = stage.replan(&goals.text(index)?)?;
    arrive(stage, motion, goals.rad(index)?)
}

fn three_goals(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    for index in 0..goals.0.len() {
        let report = go(stage, goals, index)?;
        ensure!(report.accepted == index as u64 + 1, "{} trajectories accepted", report.accepted);
        ensure!(report.guard_trips == 0, "the guard tripped in a verified motion");
        ensure!(report.frames_lost == 0, "{} frames lost", report.frames_lost);
    }
    stage.cli_done(&["disable"])?;
    stage.await_phase(Phase::Disabled)?;
    Ok(())
}

fn pause_and_resume(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    let motion = set_off(stage, goals, 0, 0.2)?;
    stage.cli_done(&["pause"])?;
    let paused = stage.await_phase(Phase::Paused)?;
    ensure!(paused.sigma == 0.0, "paused at sigma = {}", paused.sigma);
    ensure!(paused.trajectory_s < paused.trajectory_duration_s, "the motion had ended before the pause");
    stage.cli_refused(&["replan", "--goal", &goals.text(1)?], "paused")?;
    let still = stage.report()?.0;
    let bits = |report: &Report| report.command_rad.map(f64::to_bits);
    ensure!(bits(&still) == bits(&paused), "the command moved while paused");
    stage.cli_done(&["resume"])?;
    arrive(stage, motion, goals.rad(0)?)?;
    Ok(())
}

fn speed_and_stop(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    set_off(stage, goals, 0, 0.1)?;
    stage.cli_done(&["speed", "30"])?;
    stage.await_through_stalls("30 % speed", |report, _| (report.sigma - 0.3).abs() < 1e-12)?;
    stage.cli_done(&["stop"])?;
    let held = stage.await_phase(Phase::Holding)?;
    ensure!(held.command_velocity_rad_s.iter().all(|v| *v == 0.0), "holds with a velocity");
    let goal = goals.rad(0)?;
    let short = goal.iter().zip(held.command_rad).any(|(goal, at)| (goal - at).abs() > 1e-3);
    ensure!(short, "the stop came after the motion had ended");
    stage.cli_done(&["speed", "100"])?;
    go(stage, goals, 0)?;
    Ok(())
}

fn planner_killed(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    let motion = set_off(stage, goals, 0, 0.2)?;
    stage.planner.signal(Signal::KILL)?;
    stage.planner.await_end()?;
    let (_, phase) = stage.report()?;
    ensure!(phase == Phase::Moving, "the arm is {} right after the planner died", phase.word());
    arrive(stage, motion, goals.rad(0)?)?;
    stage.cli_refused(&["replan", "--goal", &goals.text(1)?], "taustream-planner")?;
    stage.restart_planner()?;
    go(stage, goals, 1)?;
    Ok(())
}

/// A servo fault ends in `Fault` with the joint named; after the cause is gone the arm is brought back by command only.
fn fault_and_back(stage: &mut Stage, goals: &Goals, fault: &str, reasons: &[FaultReason]) -> Result<()> {
    enable(stage)?;
    // A joint that loses its drive at full speed coasts before its brake holds it, here into a pillar.
    stage.cli_done(&["speed", "20"])?;
    set_off(stage, goals, 0, 0.1)?;
    stage.simulator.tell(fault)?;
    let report = stage.await_phase(Phase::Fault)?;
    ensure!(report.fault_joint == 2, "joint 3 is to blame, the report names index {}", report.fault_joint);
    let reason = report.fault().context("a fault without a reason")?;
    ensure!(reasons.contains(&reason), "reason {reason:?}, expected one of {reasons:?}");
    ensure!(report.trajectory_s < report.trajectory_duration_s, "the motion had ended before the fault");
    stage.cli_refused(&["replan", "--goal", &goals.text(1)?], "fault")?;
    stage.cli_refused(&["enable"], "clear-fault")?;
    stage.simulator.tell("clear")?;
    // A drive that dropped out while others hold the arm: nothing is cleared before all are off.
    stage.cli_refused(&["clear-fault"], "disable")?;
    stage.cli_done(&["disable"])?;
    stage.await_report("all drives off", |report, _| report.energised == 0)?;
    // A drive that comes back with a fault of its own, as one that was silent does, is cleared once more.
    let since = Instant::now();
    while !is_ready_to_enable(stage)? {
        ensure!(since.elapsed() < PATIENCE, "the fault cannot be cleared: {}", stage.streamer.said());
        stage.cli(&["clear-fault"])?;
    }
    enable(stage)?;
    go(stage, goals, 1)?;
    Ok(())
}

/// Disabled, and still so half a second later.
pub(crate) fn is_ready_to_enable(stage: &mut Stage) -> Result<bool> {
    for _ in 0..10 {
        let (report, phase) = stage.report()?;
        ensure!(phase != Phase::Moving && report.sigma == 0.0, "the arm goes on by itself: {}", phase.word());
        if phase != Phase::Disabled {
            return Ok(false);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(true)
}

fn servo_silent(stage: &mut Stage, goals: &Goals) -> Result<()> {
    let reasons = [FaultReason::FeedbackLate, FaultReason::DriveFault];
    fault_and_back(stage, goals, "fault joint=3,kind=silence", &reasons)
}

fn servo_fault(stage: &mut Stage, goals: &Goals) -> Result<()> {
    let reasons = [FaultReason::DriveFault, FaultReason::DriveDropped];
    fault_and_back(stage, goals, "fault joint=3,kind=fault,value=0x2310", &reasons)
}

/// A small motion of joint 1 from the commanded pose, as a hostile or careless sender would make it.
fn message(report: &Report, delta_rad: f64, base_shift_rad: f64) -> Result<CheckedTrajectory> {
    let mut base: JointArray = report.command_rad;
    base[0] += base_shift_rad;
    let mut delta = [0.0; MAX_JOINTS];
    delta[0] = delta_rad;
    let strokes = [Stroke { start_s: 0.0, duration_s: 4.0, n: 6, delta_rad: delta }];
    Ok(CheckedTrajectory {
        trajectory_id: 1_000 + report.sequence,
        generation: report.generation + 1,
        robot_digest: report.robot_digest,
        replaces: Replaces::Rest,
        trajectory: Trajectory::new(report.joints(), base, &strokes)?,
    })
}

/// A sender of trajectories beside the planner. It stays connected: a message dies with its sender.
struct Sender {
    trajectories: TrajectoryPublisher,
    receipts: ReceiptSubscriber,
    _wire: Wire,
}

impl Sender {
    fn join(arm: &str) -> Result<Self> {
        let wire = Wire::join(arm, "hostile", &taustream_arm::runtime::directory()?)?;
        let (trajectories, receipts) = (wire.trajectory_publisher()?, wire.receipt_subscriber()?);
        Ok(Self { trajectories, receipts, _wire: wire })
    }

    fn receipt_of(&self, sent: &TrajectoryMessage) -> Result<Receipt> {
        self.trajectories.send_copy(*sent)?;
        let since = Instant::now();
        loop {
            while let Some(receipt) = self.receipts.receive()? {
                if receipt.trajectory_id() == sent.claimed_id() {
                    return Ok(*receipt);
                }
            }
            ensure!(since.elapsed() < Duration::from_secs(20), "no receipt of message {}", sent.claimed_id());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn rejection(&self, sent: &TrajectoryMessage) -> Result<Rejection> {
        match self.receipt_of(sent)?.outcome().context("an unreadable receipt")? {
            Outcome::Rejected(rejection) => Ok(rejection),
            Outcome::Accepted { .. } => anyhow::bail!("accepted what had to be refused"),
        }
    }
}

fn hostile_messages(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    let sender = Sender::join(&stage.settings.name)?;
    let (at_rest, _) = stage.report()?;
    let good = message(&at_rest, 0.05, 0.0)?;
    let wrong_robot = TrajectoryMessage::new(&good).doctored(Doctored::Digest(0x55));
    ensure!(sender.rejection(&wrong_robot)? == Rejection::WrongRobot, "another robot's digest");
    let mut stale = good.clone();
    stale.generation = at_rest.generation;
    let stale = sender.rejection(&TrajectoryMessage::new(&stale))?;
    ensure!(matches!(stale, Rejection::StaleGeneration { .. }), "{stale}");
    let away = sender.rejection(&TrajectoryMessage::new(&message(&at_rest, 0.05, 0.02)?))?;
    ensure!(matches!(away, Rejection::NotAtBase { joint: 0, .. }), "{away}");
    let mut fast = good.clone();
    let strokes = [Stroke {
        start_s: 0.0,
        duration_s: 0.01,
        n: 6,
        delta_rad: [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    }];
    fast.trajectory = Trajectory::new(good.trajectory.joints(), *good.trajectory.base_rad(), &strokes)?;
    let fast = sender.rejection(&TrajectoryMessage::new(&fast))?;
    ensure!(matches!(fast, Rejection::Limit { joint: 0, .. }), "{fast}");

    let motion = set_off(stage, goals, 0, 0.1)?;
    for doctored in [
        Doctored::Delta(f64::NAN),
        Doctored::Base(f64::NAN),
        Doctored::Duration(f64::NAN),
        Doctored::StrokeCount(600),
        Doctored::Joints(7),
        Doctored::Exponent(3),
        Doctored::Layout(99),
    ] {
        let refused = sender.rejection(&TrajectoryMessage::new(&good).doctored(doctored))?;
        let known = matches!(refused, Rejection::Malformed(_) | Rejection::JointCount { .. });
        ensure!(known, "{doctored:?}: {refused}");
    }
    let (running, _) = stage.report()?;
    let mut cut = message(&running, 0.05, 0.0)?;
    cut.replaces = Replaces::Cut { trajectory_id: running.trajectory_id, at_s: running.trajectory_s + 0.5 };
    let cut = sender.rejection(&TrajectoryMessage::new(&cut))?;
    ensure!(matches!(cut, Rejection::CutUnsupported { .. } | Rejection::NotReady { .. }), "{cut}");
    let report = arrive(stage, motion, goals.rad(0)?)?;
    ensure!(report.accepted == 1, "{} trajectories accepted", report.accepted);
    ensure!(report.rejected >= 12, "only {} rejections counted", report.rejected);
    Ok(())
}

fn started_twice(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    let motion = stage.replan(&goals.text(0)?)?;
    let (status, said) = stage.second_streamer()?;
    ensure!(status.code() == Some(1), "the second streamer ended with {status}: {said}");
    ensure!(said.contains("vcan0") || said.contains("command"), "it does not say what is taken: {said}");
    arrive(stage, motion, goals.rad(0)?)?;
    Ok(())
}

/// A streamer whose bus is not there ends with the cure in its message, and disturbs nobody.
fn interface_missing_or_down(stage: &mut Stage, goals: &Goals) -> Result<()> {
    enable(stage)?;
    let motion = stage.replan(&goals.text(0)?)?;
    let (status, said) = stage.streamer_on("vcan9")?;
    ensure!(status.code() == Some(1), "a missing interface ended the streamer with {status}: {said}");
    ensure!(said.contains("vcan9") && said.contains("ip link"), "no cure in: {said}");
    stage.run("ip", "link set vcan1 down")?;
    let (status, said) = stage.streamer_on("vcan1")?;
    stage.run("ip", "link set vcan1 up")?;
    ensure!(status.code() == Some(1), "an interface that is down ended the streamer with {status}: {said}");
    ensure!(said.contains("vcan1") && said.contains("up"), "no cure in: {said}");
    arrive(stage, motion, goals.rad(0)?)?;
    Ok(())
}

fn commands_out_of_place(stage: &mut Stage, goals: &Goals) -> Result<()> {
    stage.cli_refused(&["replan", "--goal", &goals.text(0)?], "enable")?;
    stage.cli_refused(&["resume"], "disabled")?;
    enable(stage)?;
    stage.cli_refused(&["resume"], "holding")?;
    let outside = "9,0,0,0,0,0";
    stage.cli_refused(&["replan", "--goal", outside], "joint")?;
    ensure!(stage.cli(&["replan", "--goal", "0,0,0,0,0,0,0"])?.code != 0, "seven values for six joints");
    ensure!(stage.cli(&["speed", "101"])?.code == 2, "101 %");
    set_off(stage, goals, 0, 0.1)?;
    stage.cli_refused(&["disable"], "moving")?;
    stage.cli_refused(&["replan", "--at-once", "--goal", &goals.text(1)?], "rest")?;
    stage.cli_done(&["torque-off"])?;
    let report = stage.await_phase(Phase::Fault)?;
    ensure!(report.fault() == Some(FaultReason::TorqueOff), "{:?}", report.fault());
    stage.await_report("no drive energised", |report, _| report.energised == 0)?;
    Ok(())
}
