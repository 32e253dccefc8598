//! What must hold when a drive homes itself, over the real processes on a real vcan0.
use crate::scenarios::{CheckMode, Goals, Scenario};
use crate::test_bench::TestBench;
use anyhow::{Result, ensure};
use taustream_messages::{Phase, ReferenceState};

/// The joint that homes itself.
const JOINT: (usize, &str) = (5, "wrist_3");
/// Its switch, 0.02 rad beyond its range.
const SWITCH_RAD: f64 = 3.1616;
/// How far it may rest from its goal: the simulated servos' sag and quantisation.
const AT_GOAL_RAD: f64 = 5e-3;

/// Every scenario.
pub const ALL: &[Scenario] = &[Scenario {
    name: "joint_homes_is_stopped_homes_again_and_moves",
    run: home_stop_home_and_move,
    check_mode: CheckMode::Exactly,
    settings: Some("vcan6-homing.toml"),
}];

fn home_stop_home_and_move(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    let (joint, name) = JOINT;
    bench.cli_refused(&["enable"], "not referenced")?;
    bench.cli_refused(&["home", "elbow"], "[servo.homing]")?;
    bench.cli_done(&["home", name, "--wait-s", "0"])?;
    bench.await_phase(Phase::Homing)?;
    let first_rad = bench.report()?.0.measured_rad[joint];
    bench.await_report("the joint moves", |report, _| report.measured_rad[joint] > first_rad + 0.2)?;
    let status = bench.cli_done(&["status"])?;
    ensure!(status.stdout.contains("homing"), "status does not say it: {}", status.stdout);
    bench.cli_refused(&["replan", "--goal", &goals.text(0)?], "homing")?;
    bench.cli_done(&["stop"])?;
    let stopped = bench.await_phase(Phase::Locked)?;
    let known = ReferenceState::from_code(stopped.reference_state[joint]);
    ensure!(known == ReferenceState::Homing, "{known:?} after a homing that was stopped");
    bench.cli_refused(&["enable"], "taustream home")?;

    let done = bench.cli_done(&["home", name])?;
    ensure!(done.stdout.contains("homed"), "{}", done.stdout);
    let (report, phase) = bench.report()?;
    ensure!(phase == Phase::Locked, "{phase:?} after the homing");
    let at_rad = report.measured_rad[joint];
    ensure!((at_rad - SWITCH_RAD).abs() < 0.05, "homed at {at_rad} rad, the switch is at {SWITCH_RAD}");
    ensure!((report.command_rad[joint] - at_rad).abs() < AT_GOAL_RAD, "the commanded pose does not follow");
    bench.cli_done(&["enable"])?;
    // The switch is beyond the range, and the joint comes inwards first.
    bench.cli_done(&["recover", "--wait"])?;
    let motion = bench.replan(&goals.text(0)?)?;
    crate::scenarios::arrive_within(bench, motion, goals.rad(0)?, AT_GOAL_RAD)?;
    bench.cli_done(&["disable"])?;
    bench.await_phase(Phase::Disabled)?;
    Ok(())
}
