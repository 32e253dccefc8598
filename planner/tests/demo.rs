//! The demo's moves: each needs a way round, and each is found.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{config, pose, vcan6};
use std::time::{Duration, Instant};
use taustream_planner::{PlanOptions, PlannerKind, plan, verify};

/// Poses of `config/demo.toml`, read line by line: the cli has the real reader.
fn demo_poses() -> Vec<[f64; 6]> {
    let text = std::fs::read_to_string(config("demo.toml")).expect("shipped");
    let lines = text.lines().map(str::trim).filter(|l| !l.starts_with('#'));
    lines
        .filter_map(|line| {
            let inner = line.split_once('[')?.1.split_once(']')?.0;
            let values: Option<Vec<f64>> = inner.split(',').map(|v| v.trim().parse().ok()).collect();
            values?.try_into().ok()
        })
        .take(4)
        .collect()
}

#[test]
fn demo_every_move_goes_round_an_obstacle_and_is_found_in_time() {
    let settings = vcan6();
    let poses = demo_poses();
    assert_eq!(poses.len(), 4, "start and three goals");
    let mut blocked = 0;
    for (i, leg) in poses.windows(2).enumerate() {
        let (start, goal) = (pose(leg[0]), pose(leg[1]));
        let options = |planner, seed| PlanOptions {
            planner,
            seed,
            deadline: Duration::from_secs(20),
            ..PlanOptions::default()
        };
        let line = plan(&settings.robot, &settings.scene, &start, &goal, &options(PlannerKind::Straight, 0));
        blocked += usize::from(line.is_err());
        for seed in 0..2 {
            let began = Instant::now();
            let options =
                PlanOptions { deadline: Duration::from_secs(2), ..options(PlannerKind::Auto, seed) };
            let found = plan(&settings.robot, &settings.scene, &start, &goal, &options)
                .unwrap_or_else(|e| panic!("move {i}, seed {seed}: {e}"));
            println!(
                "move {i}, seed {seed}: {:?}, {:.2} s, {}",
                began.elapsed(),
                found.proof.duration_s,
                found.how
            );
            verify(&settings.robot, &settings.scene, &found.trajectory).expect("proven");
        }
    }
    assert_eq!(blocked, 3, "straight lines that hit something");
}
