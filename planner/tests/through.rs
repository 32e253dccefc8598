//! Motions through given poses, and deadlines: what more time may do.
mod common;

use common::{pose, scene, ur5};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::Scene;
use taustream_motion::MAX_JOINTS;
use taustream_planner::{Blend, PlanOptions, plan, plan_through, verify};

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Goal: poses on the way are passed within the blend, without a stop; with a blend of 0 the arm stops at each.
#[test]
fn poses_on_the_way_are_passed_within_the_blend() {
    let robot = ur5();
    let empty = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() };
    let poses = [
        pose([-0.5, -0.9, 0.9, -1.57, -1.57, 0.0]),
        pose([0.0, -1.3, 1.2, -1.57, -1.2, 0.3]),
        pose([0.4, -1.0, 0.9, -1.3, -1.57, 0.8]),
        pose([0.9, -0.9, 0.8, -1.57, -1.57, 0.0]),
    ];
    let mut durations_s = Vec::new();
    for blend in [Blend::Radians(0.0), Blend::Radians(0.05), Blend::Metres(0.1), Blend::Clearance] {
        let options = PlanOptions { blend, ..PlanOptions::default() };
        let plan =
            plan_through(&robot, &empty, &poses, &options).unwrap_or_else(|e| panic!("{blend:?}: {e}"));
        verify(&robot, &empty, &plan.trajectory).unwrap_or_else(|e| panic!("{blend:?}: {e}"));
        assert!(distance(&plan.trajectory.end_rad(), &poses[3]) < 1e-9);
        let samples: Vec<_> =
            (0..=4_000).map(|i| plan.trajectory.sample(plan.proof.duration_s * f64::from(i) / 4e3)).collect();
        for via in &poses[1..3] {
            let nearest = samples
                .iter()
                .min_by(|a, b| distance(&a.position_rad, via).total_cmp(&distance(&b.position_rad, via)))
                .expect("samples");
            let (off_rad, speed_rad_s) =
                (distance(&nearest.position_rad, via), distance(&nearest.velocity_rad_s, &[0.0; MAX_JOINTS]));
            match blend {
                Blend::Radians(most_rad) if most_rad > 0.0 => {
                    // The lines are kept within the blend; the corner itself may be cut by more.
                    assert!(off_rad <= 2.0 * most_rad, "{off_rad} of {most_rad} rad");
                    assert!(speed_rad_s > 0.05, "stops at {speed_rad_s} rad/s");
                }
                Blend::Radians(_) => {
                    assert!(off_rad < 1e-3 && speed_rad_s < 0.05, "{off_rad}, {speed_rad_s}");
                }
                Blend::Metres(_) | Blend::Clearance => {
                    assert!(speed_rad_s > 0.05, "stops at {speed_rad_s} rad/s");
                }
            }
        }
        durations_s.push(plan.proof.duration_s);
    }
    assert!(durations_s[1] < 0.9 * durations_s[0], "{durations_s:?}");
    assert!(durations_s[3] < 0.75 * durations_s[0], "{durations_s:?}");
}

/// Goal: a longer deadline never gives a longer motion. Method: budgets without a clock, so that each does all of its work.
#[test]
fn more_time_never_makes_a_motion_longer() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    for seed in 0..4 {
        let mut before_s = f64::INFINITY;
        for deadline_ms in [100, 200, 500, 1_000, 2_000] {
            let deadline = Duration::from_millis(deadline_ms);
            let options = PlanOptions {
                spends_deadline: true,
                keeps_deadline: false,
                seed,
                deadline,
                ..PlanOptions::default()
            };
            let plan = plan(&robot, &scene, &start, &goal, &options).expect("a motion");
            let duration_s = plan.proof.duration_s;
            println!(
                "seed {seed}, {deadline_ms} ms: {duration_s:.3} s in {:.3} s, {}",
                plan.planning_s, plan.how
            );
            assert!(
                duration_s <= before_s,
                "seed {seed}, {deadline_ms} ms: {duration_s} s after {before_s} s"
            );
            before_s = duration_s;
        }
    }
}
