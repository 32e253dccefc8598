//! What must hold over the real processes, one function a promise. Names say area, event, condition.
use crate::test_bench::{Motion, TIMEOUT, TestBench};
use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use std::time::{Duration, Instant};
use taustream_messages::service::{ReceiptSubscriber, TrajectoryPublisher, Wire};
use taustream_messages::trajectory::Corrupted;
use taustream_messages::{
    CheckedTrajectory, FaultReason, Outcome, Phase, Receipt, Rejection, Replaces, Report, TrajectoryMessage,
};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory, joint_array};

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
    pub run: fn(&mut TestBench, &Goals) -> Result<()>,
    /// How its recording is checked.
    pub check_mode: CheckMode,
    /// Settings, beside those of the run, that it needs instead.
    pub settings: Option<&'static str>,
}

/// How a recording is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CheckMode {
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
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "pause_mid_motion_then_resume_reaches_goal",
        run: pause_and_resume,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "speed_and_stop_mid_motion_hold_on_path",
        run: speed_and_stop,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "planner_killed_mid_motion_motion_finishes",
        run: planner_killed,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "servo_silent_mid_motion_fast_stop_names_joint",
        run: servo_silent,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "servo_fault_mid_motion_fast_stop_names_joint",
        run: servo_fault,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "message_hostile_mid_motion_changes_nothing",
        run: hostile_messages,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "streamer_started_twice_second_is_refused",
        run: started_twice,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "interface_missing_or_down_streamer_says_so",
        run: interface_missing_or_down,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "commands_out_of_place_are_refused_with_reason",
        run: commands_out_of_place,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
];

pub(crate) fn enable(bench: &mut TestBench) -> Result<()> {
    bench.cli_done(&["enable"])?;
    bench.await_phase(Phase::Holding)?;
    bench.cli_done(&["speed", "100"])?;
    Ok(())
}

/// Waits until a motion has brought the arm to its goal.
fn arrive(bench: &mut TestBench, motion: Motion, goal_rad: &[f64]) -> Result<Report> {
    arrive_within(bench, motion, goal_rad, AT_GOAL_RAD)
}

/// Like [`arrive`], for joints that rest within `off_rad` of their commands.
pub(crate) fn arrive_within(
    bench: &mut TestBench,
    motion: Motion,
    goal_rad: &[f64],
    off_rad: f64,
) -> Result<Report> {
    let report = bench.await_end_of(motion)?;
    for (joint, (goal, commanded)) in goal_rad.iter().zip(report.command_rad).enumerate() {
        let joint = joint + 1;
        ensure!((commanded - goal).abs() < 1e-9, "joint {joint}: commanded {commanded}, goal {goal} rad");
    }
    bench.await_report("the joints to settle at the goal", |report, _| {
        goal_rad.iter().zip(report.measured_rad).all(|(goal, got)| (goal - got).abs() < off_rad)
    })
}

/// Sends the arm to a goal and waits until it is under way: past `share` of the motion.
pub(crate) fn set_off(bench: &mut TestBench, goals: &Goals, index: usize, share: f64) -> Result<Motion> {
    let motion = bench.replan(&goals.text(index)?)?;
    bench.await_in_progress(motion, share)?;
    Ok(motion)
}

/// Sends the arm to a goal and waits until it stands there.
pub(crate) fn go(bench: &mut TestBench, goals: &Goals, index: usize) -> Result<Report> {
    let motion = bench.replan(&goals.text(index)?)?;
    arrive(bench, motion, goals.rad(index)?)
}

fn three_goals(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    for index in 0..goals.0.len() {
        let report = go(bench, goals, index)?;
        ensure!(report.accepted == index as u64 + 1, "{} trajectories accepted", report.accepted);
        ensure!(report.guard_trips == 0, "the guard tripped in a verified motion");
        ensure!(report.frames_lost == 0, "{} frames lost", report.frames_lost);
    }
    bench.cli_done(&["disable"])?;
    bench.await_phase(Phase::Disabled)?;
    Ok(())
}

fn pause_and_resume(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    set_off(bench, goals, 0, 0.2)?;
    bench.cli_done(&["pause"])?;
    let paused = bench.await_phase(Phase::Paused)?;
    ensure!(paused.sigma == 0.0, "paused at sigma = {}", paused.sigma);
    ensure!(paused.trajectory_s < paused.trajectory_duration_s, "the motion had ended before the pause");
    // A goal for afterwards is taken, and waits.
    bench.cli_done(&["replan", "--after-current", "--goal", &goals.text(1)?])?;
    let still = bench.report()?.0;
    let bits = |report: &Report| report.command_rad.map(f64::to_bits);
    ensure!(bits(&still) == bits(&paused), "the command moved while paused");
    bench.cli_done(&["resume"])?;
    end_at(bench, goals.rad(1)?)
}

/// Waits until everything that was accepted has run, and the arm holds at a goal.
pub(crate) fn end_at(bench: &mut TestBench, goal_rad: &[f64]) -> Result<()> {
    let report = bench.await_through_stalls("the last goal", |report, phase| {
        phase == Phase::Holding
            && goal_rad.iter().zip(report.command_rad).all(|(goal, at)| (goal - at).abs() < 1e-9)
    })?;
    ensure!(report.guard_trips == 0, "the guard tripped {} times", report.guard_trips);
    Ok(())
}

fn speed_and_stop(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    set_off(bench, goals, 0, 0.1)?;
    bench.cli_done(&["speed", "30"])?;
    bench.await_through_stalls("30 % speed", |report, _| (report.sigma - 0.3).abs() < 1e-12)?;
    bench.cli_done(&["stop"])?;
    let held = bench.await_phase(Phase::Holding)?;
    ensure!(held.command_velocity_rad_s.iter().all(|v| *v == 0.0), "holds with a velocity");
    let goal = goals.rad(0)?;
    let short = goal.iter().zip(held.command_rad).any(|(goal, at)| (goal - at).abs() > 1e-3);
    ensure!(short, "the stop came after the motion had ended");
    bench.cli_done(&["speed", "100"])?;
    go(bench, goals, 0)?;
    Ok(())
}

fn planner_killed(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let motion = set_off(bench, goals, 0, 0.2)?;
    bench.planner.signal(Signal::KILL)?;
    bench.planner.await_end()?;
    let (_, phase) = bench.report()?;
    ensure!(phase == Phase::Moving, "the arm is {} right after the planner died", phase.word());
    arrive(bench, motion, goals.rad(0)?)?;
    bench.cli_refused(&["replan", "--goal", &goals.text(1)?], "taustream-planner")?;
    bench.restart_planner()?;
    go(bench, goals, 1)?;
    Ok(())
}

/// A servo fault ends in `Fault` with the joint named; after the cause is gone the arm is brought back by command only.
fn fault_and_back(bench: &mut TestBench, goals: &Goals, fault: &str, reasons: &[FaultReason]) -> Result<()> {
    enable(bench)?;
    // A joint that loses its drive at full speed coasts before its brake holds it, here into a pillar.
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 0, 0.1)?;
    bench.simulator.show(fault)?;
    let report = bench.await_phase(Phase::Fault)?;
    ensure!(report.fault_joint == 2, "joint 3 is to blame, the report names index {}", report.fault_joint);
    let reason = report.fault().context("a fault without a reason")?;
    ensure!(reasons.contains(&reason), "reason {reason:?}, expected one of {reasons:?}");
    ensure!(report.trajectory_s < report.trajectory_duration_s, "the motion had ended before the fault");
    bench.cli_refused(&["replan", "--goal", &goals.text(1)?], "fault")?;
    bench.cli_refused(&["enable"], "clear-fault")?;
    bench.simulator.show("clear")?;
    // A drive that dropped out while others hold the arm: nothing is cleared before all are off.
    bench.cli_refused(&["clear-fault"], "disable")?;
    bench.cli_done(&["disable"])?;
    bench.await_report("all drives off", |report, _| report.energised == 0)?;
    // A drive that comes back with a fault of its own, as one that was silent does, is cleared once more.
    let since = Instant::now();
    while !is_ready_to_enable(bench)? {
        ensure!(since.elapsed() < TIMEOUT, "the fault cannot be cleared: {}", bench.streamer.said());
        bench.cli(&["clear-fault"])?;
    }
    enable(bench)?;
    go(bench, goals, 1)?;
    Ok(())
}

/// Disabled, and still so half a second later.
pub(crate) fn is_ready_to_enable(bench: &mut TestBench) -> Result<bool> {
    for _ in 0..10 {
        let (report, phase) = bench.report()?;
        ensure!(phase != Phase::Moving && report.sigma == 0.0, "the arm goes on by itself: {}", phase.word());
        if phase != Phase::Disabled {
            return Ok(false);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(true)
}

fn servo_silent(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    let reasons = [FaultReason::FeedbackLate, FaultReason::DriveFault];
    fault_and_back(bench, goals, "fault joint=3,kind=silence", &reasons)
}

fn servo_fault(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    let reasons = [FaultReason::DriveFault, FaultReason::DriveDropped];
    fault_and_back(bench, goals, "fault joint=3,kind=fault,value=0x2310", &reasons)
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

fn hostile_messages(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let sender = Sender::join(&bench.settings.name)?;
    let (at_rest, _) = bench.report()?;
    let good = message(&at_rest, 0.05, 0.0)?;
    let wrong_robot = TrajectoryMessage::new(&good).corrupted(Corrupted::Digest(0x55));
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
        delta_rad: joint_array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0]),
    }];
    fast.trajectory = Trajectory::new(good.trajectory.joints(), *good.trajectory.base_rad(), &strokes)?;
    let fast = sender.rejection(&TrajectoryMessage::new(&fast))?;
    ensure!(matches!(fast, Rejection::Limit { joint: 0, .. }), "{fast}");

    let motion = set_off(bench, goals, 0, 0.1)?;
    for corrupted in [
        Corrupted::Delta(f64::NAN),
        Corrupted::Base(f64::NAN),
        Corrupted::Duration(f64::NAN),
        Corrupted::StrokeCount(600),
        Corrupted::Joints(7),
        Corrupted::Exponent(3),
        Corrupted::Layout(99),
    ] {
        let refused = sender.rejection(&TrajectoryMessage::new(&good).corrupted(corrupted))?;
        let known = matches!(refused, Rejection::Malformed(_) | Rejection::JointCount { .. });
        ensure!(known, "{corrupted:?}: {refused}");
    }
    let (running, _) = bench.report()?;
    let mut cut = message(&running, 0.05, 0.0)?;
    cut.replaces = Replaces::Cut { trajectory_id: running.trajectory_id, at_s: running.trajectory_s + 0.5 };
    let cut = sender.rejection(&TrajectoryMessage::new(&cut))?;
    let known = matches!(
        cut,
        Rejection::KeptStrokesDiffer { .. } | Rejection::KeptBaseDiffers { .. } | Rejection::Malformed(_)
    );
    ensure!(known, "a replacement that repeats nothing: {cut}");
    let report = arrive(bench, motion, goals.rad(0)?)?;
    ensure!(report.accepted == 1, "{} trajectories accepted", report.accepted);
    ensure!(report.rejected >= 12, "only {} rejections counted", report.rejected);
    Ok(())
}

fn started_twice(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let motion = bench.replan(&goals.text(0)?)?;
    let (status, said) = bench.second_streamer()?;
    ensure!(status.code() == Some(1), "the second streamer ended with {status}: {said}");
    ensure!(said.contains("vcan0") || said.contains("command"), "it does not say what is taken: {said}");
    arrive(bench, motion, goals.rad(0)?)?;
    Ok(())
}

/// A streamer whose bus is not there ends with the remedy in its message, and disturbs no other process.
fn interface_missing_or_down(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let motion = bench.replan(&goals.text(0)?)?;
    let (status, said) = bench.streamer_on("vcan9")?;
    ensure!(status.code() == Some(1), "a missing interface ended the streamer with {status}: {said}");
    ensure!(said.contains("vcan9") && said.contains("ip link"), "no remedy in: {said}");
    bench.run("ip", "link set vcan1 down")?;
    let (status, said) = bench.streamer_on("vcan1")?;
    bench.run("ip", "link set vcan1 up")?;
    ensure!(status.code() == Some(1), "an interface that is down ended the streamer with {status}: {said}");
    ensure!(said.contains("vcan1") && said.contains("up"), "no remedy in: {said}");
    arrive(bench, motion, goals.rad(0)?)?;
    Ok(())
}

fn commands_out_of_place(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    bench.cli_refused(&["replan", "--goal", &goals.text(0)?], "enable")?;
    bench.cli_refused(&["resume"], "disabled")?;
    enable(bench)?;
    bench.cli_refused(&["resume"], "holding")?;
    let outside = "9,0,0,0,0,0";
    bench.cli_refused(&["replan", "--goal", outside], "joint")?;
    ensure!(bench.cli(&["replan", "--goal", "0,0,0,0,0,0,0"])?.code != 0, "seven values for six joints");
    ensure!(bench.cli(&["speed", "101"])?.code == 2, "101 %");
    set_off(bench, goals, 0, 0.1)?;
    bench.cli_refused(&["disable"], "moving")?;
    bench.cli_done(&["torque-off"])?;
    let report = bench.await_phase(Phase::Fault)?;
    ensure!(report.fault() == Some(FaultReason::TorqueOff), "{:?}", report.fault());
    bench.await_report("no drive energised", |report, _| report.energised == 0)?;
    Ok(())
}
