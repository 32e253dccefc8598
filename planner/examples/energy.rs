//! How much energy plans by energy save against plans by time, on seeded problems of the shipped UR5.
//!
//! cargo run --release -p taustream-planner --example energy [problems [milliseconds [method ..]]]
//!
//! Start and goal are random clear poses among the shipped pillars. Per method that looks for less energy: energies and
//! times of both plans, summed over the problems that both solve, and in how many the plan by energy takes less.
use std::path::Path;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::rng::SeededRng;
use taustream_planner::world::World;
use taustream_planner::{Improvement, Objective, Plan, PlanOptions, plan};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| words.get(i).map_or(Ok(default), |w| w.parse());
    let (problems, deadline) = (number(0, 30)?, Duration::from_millis(number(1, 2_000)?));
    let methods: Vec<&str> = words.iter().skip(2).map(String::as_str).collect();
    let methods = if methods.is_empty() { vec!["ibfoa", "de", "spso", "iepso", "iwo"] } else { methods };
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
    let robot = Robot::load(&config.join("robots/ur5.toml"))?;
    let scene = Scene::load(&config.join("scenes/pillars.toml"))?;
    let world = World::new(&robot, &scene)?;
    println!("{problems} problems, {} ms each", deadline.as_millis());
    println!("method      both  less  by time (J)  by energy (J)  ratio  by time (s)  by energy (s)");
    let ends: Vec<[JointArray; 2]> = (0..problems).map(|seed| ends(&world, seed)).collect();
    for name in methods {
        let improvement = Improvement::from_name(name).ok_or("no such method")?;
        let solve = |objective, seed: u64, [start, goal]: &[JointArray; 2]| -> Option<Plan> {
            let options = PlanOptions {
                seed,
                deadline,
                objective,
                improvement,
                keeps_deadline: false,
                ..PlanOptions::default()
            };
            plan(&robot, &scene, start, goal, &options).ok()
        };
        let (mut both, mut less, mut joules, mut seconds) = (0, 0, [0.0; 2], [0.0; 2]);
        for (seed, ends) in (0..problems).zip(&ends) {
            let plans = [Objective::Time, Objective::Energy].map(|objective| solve(objective, seed, ends));
            let [Some(by_time), Some(by_energy)] = plans else { continue };
            let [Some(a), Some(b)] = [by_time.energy_j, by_energy.energy_j] else { continue };
            both += 1;
            less += u32::from(b < 0.999 * a);
            joules = [joules[0] + a, joules[1] + b];
            seconds = [seconds[0] + by_time.proof.duration_s, seconds[1] + by_energy.proof.duration_s];
        }
        let ([a, b], [s, t]) = (joules, seconds);
        println!("{name:<10} {both:>5} {less:>5} {a:>12.1} {b:>14.1} {:>6.3} {s:>12.2} {t:>14.2}", b / a);
    }
    Ok(())
}

/// Two random clear poses.
fn ends(world: &World, seed: u64) -> [JointArray; 2] {
    let mut rng = SeededRng::new(seed, 90);
    let mut clear = || loop {
        let mut q = [0.0; MAX_JOINTS];
        for (q, joint) in q.iter_mut().zip(&world.robot().joints) {
            let [low, high] = joint.limits.position_rad;
            *q = rng.within(0.5 * low, 0.5 * high);
        }
        if taustream_planner::margin_exit::is_clear(world, &q) {
            return q;
        }
    };
    [clear(), clear()]
}
