//! What must hold of an arm of motors of any protocol but CiA 402 over the real processes on a real vcan0.
use crate::scenarios::{Goals, arrive_within, enable, set_off};
use crate::test_bench::{TIMEOUT, TestBench};
use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use std::time::{Duration, Instant};
use taustream_arm::{Reaction, Servo, Settings};
use taustream_messages::{FaultReason, Phase};

/// A spring under a load does not rest at its command: this far off it may rest. The shipped shoulder carries 10 Nm on
/// 400 Nm/rad.
const AT_GOAL_RAD: f64 = 0.04;

/// One scenario.
#[derive(Clone, Copy, Debug)]
pub struct Scenario {
    /// Area, event, condition.
    pub name: &'static str,
    /// What it does; it fails by an error.
    pub run: fn(&mut TestBench, &Goals) -> Result<()>,
    /// It kills the streamer, whose log then ends in the middle of something.
    pub kills: bool,
    /// Which arms it is for; others pass it over.
    pub fits: fn(&Settings) -> bool,
}

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[
    Scenario {
        name: "motor_goals_round_obstacles_with_pause_reached",
        run: goals_with_pause,
        kills: false,
        fits: any_arm,
    },
    Scenario {
        name: "motor_replanned_in_motion_new_goal_reached",
        run: replanned_in_motion,
        kills: false,
        fits: stands_in_the_open,
    },
    Scenario {
        name: "motor_silent_mid_motion_fast_stop_names_joint",
        run: motor_silent,
        kills: false,
        fits: any_arm,
    },
    Scenario {
        name: "motor_fault_mid_motion_fast_stop_names_joint",
        run: motor_fault,
        kills: false,
        fits: any_arm,
    },
    Scenario {
        name: "motor_streamer_killed_mid_motion_servos_react_by_themselves",
        run: streamer_killed,
        kills: true,
        fits: any_arm,
    },
    Scenario {
        name: "motor_streamer_restarted_after_kill_goes_on_by_command",
        run: streamer_restarted,
        kills: true,
        fits: stands_without_streamer,
    },
    Scenario {
        name: "gripper_opens_grips_an_object_and_moves_beside_the_path",
        run: gripper_at_work,
        kills: false,
        fits: has_gripper,
    },
    Scenario {
        name: "gripper_silent_mid_motion_fast_stop_names_axis",
        run: gripper_silent,
        kills: false,
        fits: has_gripper,
    },
    Scenario {
        name: "gravity_calibrated_in_four_poses_masses_are_those_of_the_file",
        run: gravity_calibrated,
        kills: false,
        fits: weighs,
    },
];

fn any_arm(_: &Settings) -> bool {
    true
}

/// It has an axis beside the path called `gripper`.
fn has_gripper(settings: &Settings) -> bool {
    settings.axes.iter().any(|axis| axis.output.name == "gripper")
}

/// Its motors carry what the masses of the robot file weigh.
fn weighs(settings: &Settings) -> bool {
    settings.feed_forward.is_some_and(|wanted| wanted.gravity)
}

/// Nothing is in the way: round obstacles the planner's answer in motion takes longer than the machine's motion.
fn stands_in_the_open(settings: &Settings) -> bool {
    settings.scene.obstacles.is_empty()
}

/// It stands where it stood when its streamer ended. A `CubeMars` motor stays in its motor mode without a command, and sags.
fn stands_without_streamer(settings: &Settings) -> bool {
    settings.servos.iter().all(|servo| servo.protocol.name() != "cubemars")
}

fn goals_with_pause(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    for index in 0..goals.0.len() {
        // Slow enough to be paused on the way, by a command line that takes its time.
        bench.cli_done(&["speed", if index == 1 { "30" } else { "100" }])?;
        let motion = set_off(bench, goals, index, 0.3)?;
        if index == 1 {
            bench.cli_done(&["pause"])?;
            let paused = bench.await_phase(Phase::Paused)?;
            ensure!(paused.sigma == 0.0, "paused at sigma = {}", paused.sigma);
            bench.cli_done(&["resume"])?;
        }
        let report = arrive_within(bench, motion, goals.rad(index)?, AT_GOAL_RAD)?;
        ensure!(report.guard_trips == 0 && report.frames_lost == 0, "{report:?}");
    }
    bench.cli_done(&["disable"])?;
    bench.await_phase(Phase::Disabled)?;
    Ok(())
}

fn replanned_in_motion(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "50"])?;
    set_off(bench, goals, 0, 0.2)?;
    let motion = bench.replan(&goals.text(1)?)?;
    let report = arrive_within(bench, motion, goals.rad(1)?, AT_GOAL_RAD)?;
    ensure!(report.guard_trips == 0 && report.frames_lost == 0, "{report:?}");
    bench.cli_done(&["disable"])?;
    bench.await_phase(Phase::Disabled)?;
    Ok(())
}

/// A fault of one motor ends in `Fault` with the joint named; after the cause is gone the arm comes back by command only.
fn fault_and_back(bench: &mut TestBench, goals: &Goals, fault: &str, reasons: &[FaultReason]) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 0, 0.1)?;
    bench.simulator.show(fault)?;
    let report = bench.await_phase(Phase::Fault)?;
    ensure!(report.fault_joint == 2, "joint 3 is to blame, the report names index {}", report.fault_joint);
    let reason = report.fault().context("a fault without a reason")?;
    ensure!(reasons.contains(&reason), "reason {reason:?}, expected one of {reasons:?}");
    bench.cli_refused(&["replan", "--goal", &goals.text(1)?], "fault")?;
    bench.simulator.show("clear")?;
    bench.cli_done(&["disable"])?;
    bench.await_report("all motors off", |report, _| report.energised == 0)?;
    bring_back(bench)?;
    enable(bench)?;
    let motion = bench.replan(&goals.text(1)?)?;
    arrive_within(bench, motion, goals.rad(1)?, AT_GOAL_RAD)?;
    Ok(())
}

/// Clears, again while motors come back with faults of their own, until the arm is ready and stays so.
fn bring_back(bench: &mut TestBench) -> Result<()> {
    let since = Instant::now();
    loop {
        let mut ready = 0;
        while bench.report()?.1 == Phase::Disabled && ready < 10 {
            ready += 1;
            std::thread::sleep(Duration::from_millis(50));
        }
        if ready == 10 {
            return Ok(());
        }
        ensure!(since.elapsed() < TIMEOUT, "the fault cannot be cleared: {}", bench.streamer.said());
        bench.cli(&["clear-fault"])?;
    }
}

fn motor_silent(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    let reasons = [FaultReason::FeedbackLate, FaultReason::DriveFault];
    fault_and_back(bench, goals, "fault joint=3,kind=silence", &reasons)
}

fn motor_fault(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    fault_and_back(bench, goals, "fault joint=3,kind=fault", &[FaultReason::DriveFault])
}

fn streamer_killed(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 0, 0.1)?;
    bench.streamer.signal(Signal::KILL)?;
    bench.streamer.await_end()?;
    let since = Instant::now();
    // Every motor has its own watchdog, and the brakes hold the arm; a servo that holds by itself keeps its torque.
    // A CubeMars motor stays in its motor mode, without a command.
    let says_so = |servo: &&Servo| servo.reaction == Reaction::Limp && servo.protocol.name() != "cubemars";
    let limp = bench.settings.servos.iter().filter(says_so).count();
    while bench.simulator.said().matches("energised=false").count() < limp {
        ensure!(since.elapsed() < TIMEOUT, "motors keep their torque: {}", bench.simulator.said());
        bench.simulator.show("status")?;
        std::thread::sleep(Duration::from_millis(100));
    }
    let at = |bench: &TestBench| -> Vec<f64> {
        let said = bench.simulator.said();
        let angles = said.lines().filter_map(|line| line.split("position_rad=").nth(1));
        let mut angles: Vec<f64> = angles.filter_map(|rest| rest.split(' ').next()?.parse().ok()).collect();
        angles.split_off(angles.len().saturating_sub(bench.settings.slots()))
    };
    bench.simulator.show("status")?;
    std::thread::sleep(Duration::from_millis(200));
    let rest_rad = at(bench);
    std::thread::sleep(Duration::from_millis(500));
    bench.simulator.show("status")?;
    std::thread::sleep(Duration::from_millis(200));
    let still = at(bench).iter().zip(&rest_rad).all(|(now, then)| (now - then).abs() < 1e-6);
    ensure!(
        still && rest_rad.len() == bench.settings.slots(),
        "brakes do not hold: {rest_rad:?}, then {:?}",
        at(bench)
    );
    Ok(())
}

fn streamer_restarted(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 0, 0.1)?;
    bench.streamer.signal(Signal::KILL)?;
    bench.streamer.await_end()?;
    // Longer than any motor's watchdog.
    std::thread::sleep(Duration::from_millis(1500));
    bench.restart_streamer()?;
    let ready = [Phase::Disabled, Phase::Fault, Phase::Locked];
    let (_, phase) = bench.report()?;
    let phase = if ready.contains(&phase) {
        phase
    } else {
        bench.await_report("the motors to be looked at", |_, phase| ready.contains(&phase))?;
        bench.report()?.1
    };
    bench.cli_refused(&["replan", "--goal", &goals.text(1)?], "")?;
    // Motors that hold by themselves are taken over by `enable`; the others come back by command only.
    if phase != Phase::Locked {
        bring_back(bench)?;
    }
    enable(bench)?;
    let motion = bench.replan(&goals.text(1)?)?;
    arrive_within(bench, motion, goals.rad(1)?, AT_GOAL_RAD)?;
    Ok(())
}

/// What `taustream axis gripper ..` answers: its state, commanded and measured position.
fn lead(bench: &TestBench, words: &[&str]) -> Result<(String, f64, f64)> {
    let answer = bench.cli_done(&[&["axis", "gripper"], words, &["--json"]].concat())?;
    let said: serde_json::Value = serde_json::from_str(&answer.stdout)?;
    let axis = said.get("axis").context("an answer without its axis")?;
    let number = |key: &str| axis.get(key).and_then(serde_json::Value::as_f64).unwrap_or(f64::NAN);
    let state = axis.get("state").and_then(serde_json::Value::as_str).unwrap_or_default();
    Ok((state.to_owned(), number("command"), number("measured")))
}

/// The object between the jaws, as an angle of the motor's output and as their distance.
const OBJECT: (&str, f64) = ("fault joint=gripper,kind=object,value=1.5", 0.03);

fn gripper_at_work(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    bench.cli_refused(&["axis", "gripper", "open"], "`enable` first")?;
    enable(bench)?;
    let (state, command_m, _) = lead(bench, &["open"])?;
    ensure!(state == "holding" && (command_m - 0.08).abs() < 1e-6, "open: {state} at {command_m} m");
    bench.cli_refused(&["axis", "gripper", "to", "0.09"], "0.010000 m outside")?;
    bench.cli_refused(&["axis", "gripper", "close", "--force", "41"], "up to 40.000 N")?;
    bench.simulator.show(OBJECT.0)?;
    let (state, command_m, measured_m) = lead(bench, &["close", "--force", "20"])?;
    ensure!(state == "in contact", "closing on an object: {state}");
    ensure!((measured_m - OBJECT.1).abs() < 1e-3, "stopped at {measured_m} m");
    ensure!(
        (0.0..=0.0031).contains(&(measured_m - command_m)),
        "{command_m} m commanded, {measured_m} m measured"
    );
    let motion = set_off(bench, goals, 0, 0.3)?;
    let (state, command_m, _) = lead(bench, &["to", "0.05"])?;
    ensure!(
        state == "holding" && (command_m - 0.05).abs() < 1e-6,
        "beside the path: {state} at {command_m} m"
    );
    let report = arrive_within(bench, motion, goals.rad(0)?, AT_GOAL_RAD)?;
    ensure!(report.guard_trips == 0 && report.frames_lost == 0, "{report:?}");
    bench.cli_done(&["disable"])?;
    bench.await_phase(Phase::Disabled)?;
    Ok(())
}

/// The simulated motors bear the masses of the file and dry friction: torques are those of the model, and the fit leaves the masses.
fn gravity_calibrated(bench: &mut TestBench, _: &Goals) -> Result<()> {
    bench.cli_refused(&["calibrate", "gravity"], "enable")?;
    let enabled = bench.cli_done(&["enable"])?;
    ensure!(!enabled.stdout.contains("NOTICE"), "the arm is as heavy as its file: {}", enabled.stdout);
    bench.cli_done(&["speed", "100"])?;
    let answer = bench.cli_done(&["calibrate", "gravity", "--poses", "4", "--json"])?;
    let said: serde_json::Value = serde_json::from_str(&answer.stdout)?;
    let list =
        |key: &str| said.get(key).and_then(serde_json::Value::as_array).context("a list of the answer");
    let number = |of: &serde_json::Value, key: &str| of.get(key).and_then(serde_json::Value::as_f64);
    for joint in list("joints")? {
        let (most_nm, apart_nm) = (number(joint, "torque_nm_max"), number(joint, "before_rms_nm"));
        let (most_nm, apart_nm) = most_nm.zip(apart_nm).context("torques of a joint")?;
        ensure!(apart_nm < 0.05 * most_nm + 0.1, "the drive's torque is not the model's: {joint}");
    }
    for body in list("bodies")? {
        let mass_kg = |key: &str| number(body.get(key)?, "mass_kg");
        let (before_kg, after_kg) = mass_kg("before").zip(mass_kg("after")).context("masses of a body")?;
        ensure!(
            (before_kg - after_kg).abs() < 0.05 * before_kg + 0.02,
            "the fit goes away from the truth: {body}"
        );
    }
    bench.cli_done(&["disable"])?;
    bench.await_phase(Phase::Disabled)?;
    Ok(())
}

fn gripper_silent(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "20"])?;
    set_off(bench, goals, 0, 0.1)?;
    bench.simulator.show("fault joint=gripper,kind=silence")?;
    let report = bench.await_phase(Phase::Fault)?;
    ensure!(
        report.fault_joint == 6,
        "the axis behind six joints is to blame, the report names {}",
        report.fault_joint
    );
    let reason = report.fault().context("a fault without a reason")?;
    ensure!(reason == FaultReason::FeedbackLate || reason == FaultReason::DriveFault, "reason {reason:?}");
    let said = bench.cli_done(&["status"])?;
    ensure!(said.stdout.contains("axis `gripper`"), "status does not name it: {}", said.stdout);
    bench.cli_refused(&["axis", "gripper", "open"], "`clear-fault` first")?;
    bench.simulator.show("clear")?;
    bench.cli_done(&["disable"])?;
    bench.await_report("all motors off", |report, _| report.energised == 0)?;
    bring_back(bench)?;
    enable(bench)?;
    lead(bench, &["open"])?;
    let motion = bench.replan(&goals.text(1)?)?;
    arrive_within(bench, motion, goals.rad(1)?, AT_GOAL_RAD)?;
    Ok(())
}
