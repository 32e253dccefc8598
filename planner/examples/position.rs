//! How surely and how soon inverse kinematics and each optimiser find a clear pose at a position, one try each.
//!
//! cargo run --release -p taustream-planner --example position [targets]
//!
//! Targets are where the tip of a random clear pose is, of the shipped UR5 and Piper among the shipped pillars. Per method:
//! in how many of them a swarm of 2000 evaluations, polished, gets there, in how many clear of everything, and the median
//! time at full speed of the clear poses from a common start.
use std::path::Path;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::METHODS;
use taustream_planner::goals::{Finder, TipTarget, one_try};
use taustream_planner::margin_exit::is_clear;
use taustream_planner::rng::SeededRng;
use taustream_planner::world::World;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let targets: u64 = std::env::args().nth(1).map_or(Ok(30), |word| word.parse())?;
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
    let scene = Scene::load(&config.join("scenes/pillars.toml"))?;
    println!("arm    method              there  clear  median time (s)   of {targets}");
    for arm in ["ur5", "piper"] {
        let robot = Robot::load(&config.join(format!("robots/{arm}.toml")))?;
        let world = World::new(&robot, &scene)?;
        let start_rad = clear(&world, &mut SeededRng::new(0, 91));
        let swarms = METHODS.iter().map(Finder::Swarm);
        for finder in std::iter::once(Finder::Inverse).chain(swarms) {
            let (mut there, mut times_s) = (0, Vec::new());
            for seed in 0..targets {
                let [.., tip] = robot.chain.frames(&clear(&world, &mut SeededRng::new(seed, 92)));
                let target = TipTarget::position(tip.translation.vector.into());
                let found = one_try(&world, start_rad, (&target, finder), seed)?;
                there += u32::from(found.is_some());
                times_s.extend(found.filter(|(pose, _)| is_clear(&world, pose)).map(|(_, time_s)| time_s));
            }
            times_s.sort_by(f64::total_cmp);
            let median_s = times_s.get(times_s.len() / 2).copied().unwrap_or(f64::NAN);
            println!("{arm:<6} {:<18} {there:>6} {:>6} {median_s:>16.3}", finder.name(), times_s.len());
        }
    }
    Ok(())
}

/// A random clear pose.
fn clear(world: &World, rng: &mut SeededRng) -> JointArray {
    loop {
        let mut q = [0.0; MAX_JOINTS];
        for (q, joint) in q.iter_mut().zip(&world.robot().joints) {
            let [low, high] = joint.limits.position_rad;
            *q = rng.within(low, high);
        }
        if is_clear(world, &q) {
            return q;
        }
    }
}
