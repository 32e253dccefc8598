//! Planned motions among random obstacles, for `tests/peers/clearance.py`, which measures their distances with an independent library.
//!
//! The first line of the output describes the arm: the links and frames of its shapes, and which links may touch. Then one line a motion:
//! obstacles, strokes, the least clearance that was proven, and the pose of the tip where one was asked for. Lengths in m, angles in rad.
use anyhow::{Context, Result, anyhow};
use serde_json::{Value, json};
use std::io::{BufWriter, Write, stdout};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::rng::SeededRng;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::goals::Orientation;
use taustream_planner::{Finder, Plan, PlanOptions, Situation, StartMargin, TipTarget, plan, plan_to_tip};

const MARGIN_M: f64 = 0.02;
/// Obstacles and goals that are tried for one motion.
const TRIES: u64 = 400;

fn main() -> Result<()> {
    let mut words = std::env::args_os().skip(1);
    let mut next = || words.next().context("usage: motions ROBOT.toml COUNT SEED");
    let robot = Robot::load(&PathBuf::from(next()?))?;
    let mut number = || -> Result<u64> {
        next()?
            .into_string()
            .map_err(|word| anyhow!("{}: not a number", word.display()))?
            .parse()
            .context("not a number")
    };
    let (count, seed) = (number()?, number()?);
    let mut out = BufWriter::new(stdout().lock());
    writeln!(out, "{}", arm(&robot))?;
    for index in 0..count {
        let motion = (0..TRIES).find_map(|attempt| motion(&robot, seed + index, attempt));
        writeln!(out, "{}", motion.with_context(|| format!("no motion {index} of seed {seed}"))?)?;
    }
    Ok(())
}

fn arm(robot: &Robot) -> Value {
    let name = |link: usize| robot.links.get(link).cloned().unwrap_or_default();
    let links = 0..robot.links.len();
    let touching: Vec<[String; 2]> = links
        .clone()
        .flat_map(|a| links.clone().map(move |b| (a, b)))
        .filter(|(a, b)| a < b && robot.may_touch(*a, *b))
        .map(|(a, b)| [name(a), name(b)])
        .collect();
    let shapes: Vec<(String, usize)> =
        robot.shapes.iter().map(|shape| (name(shape.link), shape.frame)).collect();
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    json!({ "joints": joints, "shapes": shapes, "may_touch": touching })
}

/// One motion, unless start or goal are not free or nothing was found.
fn motion(robot: &Robot, seed: u64, attempt: u64) -> Option<Value> {
    let mut rng = SeededRng::new(seed, attempt);
    let text = obstacles(&mut rng);
    let scene = Scene::from_toml(std::path::Path::new("random.toml"), &text).ok()?;
    let mut pose_rad = || random_pose(robot, &mut rng);
    let (start_rad, goal_rad) = (pose_rad(), pose_rad());
    let options = PlanOptions { seed, deadline: Duration::from_millis(500), ..PlanOptions::default() };
    // Every fourth one is a goal of the tip: that of a pose, so that there is a solution.
    let (found, tip) = if seed.is_multiple_of(4) {
        let [.., tip] = robot.chain.frames(&goal_rad);
        let orientation = Some(Orientation { rotation: tip.rotation, tolerance_rad: [0.0; 3] });
        let position_m = tip.translation.vector.into();
        let target = TipTarget { orientation, ..TipTarget::position(position_m) };
        let situation = Situation { robot, scene: &scene, start_rad, margin: StartMargin::Scene };
        let reached = plan_to_tip(&situation, (&target, Finder::Inverse), &options, None).ok()?;
        let quaternion_xyzw: [f64; 4] = tip.rotation.coords.into();
        (reached.plan, Some(json!({ "position_m": position_m, "quaternion_xyzw": quaternion_xyzw })))
    } else {
        (plan(robot, &scene, &start_rad, &goal_rad, &options).ok()?, None)
    };
    Some(line(&text, &found, tip.as_ref()))
}

fn line(scene: &str, found: &Plan, tip: Option<&Value>) -> Value {
    let motion = &found.trajectory;
    let strokes: Vec<Value> =
        motion.strokes().iter().map(|s| json!([s.start_s, s.duration_s, s.n, s.delta_rad])).collect();
    json!({
        "scene": scene,
        "base_rad": motion.base_rad(),
        "strokes": strokes,
        "duration_s": motion.duration_s(),
        "clearance_m": found.proof.clearance_m,
        "clearance_between": found.proof.clearance_between,
        "clearance_at_s": found.proof.clearance_at_s,
        "tip": tip,
    })
}

fn random_pose(robot: &Robot, rng: &mut SeededRng) -> JointArray {
    let mut pose_rad = [0.0; MAX_JOINTS];
    for (q, joint) in pose_rad.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *q = rng.within(low.max(-2.5), high.min(2.5));
    }
    pose_rad
}

/// A scene file: a sphere, a box, a cylinder and a capsule around the arm.
fn obstacles(rng: &mut SeededRng) -> String {
    let mut text = format!("margin_m = {MARGIN_M}\n");
    for kind in ["sphere", "box", "cylinder", "capsule"] {
        let (away_m, around_rad) = (rng.within(0.3, 0.8), rng.within(-3.1, 3.1));
        let (x, y, z) = (away_m * around_rad.cos(), away_m * around_rad.sin(), rng.within(0.0, 1.2));
        let rpy = [rng.within(-3.0, 3.0), rng.within(-3.0, 3.0), rng.within(-3.0, 3.0)];
        let (a, b, c) = (rng.within(0.03, 0.12), rng.within(0.05, 0.4), rng.within(0.05, 0.3));
        let sizes = match kind {
            "sphere" => format!("radius_m = {a}"),
            "box" => format!("size_m = [{a}, {b}, {c}]\nrpy_rad = {rpy:?}"),
            _ => format!("radius_m = {}\nlength_m = {b}\nrpy_rad = {rpy:?}", 0.5 * a),
        };
        text += &format!("[[{kind}]]\nname = \"{kind}\"\ncenter_m = [{x}, {y}, {z}]\n{sizes}\n");
    }
    text
}
