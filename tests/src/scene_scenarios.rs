//! A scene that changes while the arm moves, over the real processes. The recording is checked to the bit, as for every scenario.
use crate::scenarios::{CheckMode, Goals, Scenario, enable, end_at, set_off};
use crate::test_bench::TestBench;
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use taustream_messages::Phase;

/// The last goal of the demo, on the other side of all pillars, and how far from its tip the ball appears.
const GOAL: usize = 2;
const BALL_RADIUS_M: f64 = 0.06;

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[Scenario {
    name: "scene_change_mid_motion_at_the_goal_stops_the_arm_on_its_path",
    run: obstacle_at_the_goal,
    check_mode: CheckMode::Exactly,
    settings: None,
}];

/// Adds or moves something, and reads the answer.
fn change(bench: &TestBench, words: &[&str]) -> Result<Value> {
    let answer = bench.cli_done(&[&["scene"], words, &["--json"]].concat())?;
    serde_json::from_str(&answer.stdout).with_context(|| format!("no JSON in {answer:?}"))
}

/// Goal: what is far from the motion leaves it alone, what appears at its goal stops it before the contact, and what has gone again
/// lets the arm go there.
fn obstacle_at_the_goal(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let robot = bench.settings.robot.clone();
    let mut goal_rad = [0.0; taustream_motion::MAX_JOINTS];
    goal_rad.iter_mut().zip(goals.rad(GOAL)?).for_each(|(slot, q)| *slot = *q);
    let [.., tip] = robot.chain.frames(&goal_rad);
    let [x, y, z]: [f64; 3] = tip.translation.vector.into();
    let (at, radius) = (format!("{x},{y},{z}"), BALL_RADIUS_M.to_string());

    let motion = set_off(bench, goals, GOAL, 0.05)?;
    let aside = change(bench, &["add", "aside", "--sphere", &radius, "--at", "0,0,3"])?;
    ensure!(aside["effect"] == "free", "a ball above everything: {aside}");
    let in_the_way = change(bench, &["add", "ball", "--sphere", &radius, "--at", &at])?;
    let (effect, note) = (&in_the_way["effect"], in_the_way["note"].as_str().unwrap_or_default());
    ensure!(effect == "stopped", "a ball at the goal: {in_the_way}");
    ensure!(note.contains("ball") && note.contains("link"), "no link and no object in: {note}");
    let held = bench.await_phase(Phase::Holding)?;
    ensure!(held.trajectory_s < held.trajectory_duration_s, "the motion went on to its end");
    let off_rad = held.command_rad.iter().zip(&goal_rad).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    ensure!(off_rad > 0.05, "stopped only {off_rad} rad from the goal");
    let checked_ms = in_the_way["checked_s"].as_f64().unwrap_or(f64::NAN) * 1e3;
    let acted_ms = in_the_way["acted_s"].as_f64().unwrap_or(f64::NAN) * 1e3;
    println!("       checked after {checked_ms:.2} ms, stopped after {acted_ms:.2} ms; {motion:?}");

    let goal = goals.text(GOAL)?;
    bench.cli_refused(&["replan", "--goal", &goal], "ball")?;
    bench.cli_refused(&["scene", "remove", "nobody"], "ball")?;
    change(bench, &["remove", "ball"])?;
    bench.replan(&goal)?;
    end_at(bench, goals.rad(GOAL)?)
}
