//! Planners by name: every word of the list plans, and every optimiser of the registry is such a word.
mod common;

use common::{assert_safe, pose, sphere, ur5};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::Scene;
use taustream_optimizers::{METHODS, Reading};
use taustream_planner::{Improvement, PlanError, PlanOptions, PlannerKind, plan, verify};

const DEADLINE_MS: u64 = 1_000;

fn options(planner: PlannerKind, reading: Reading) -> PlanOptions {
    PlanOptions {
        seed: 3,
        deadline: Duration::from_millis(DEADLINE_MS),
        planner,
        reading,
        keeps_deadline: false,
        ..PlanOptions::default()
    }
}

#[test]
fn every_registered_method_is_a_planner_and_words_are_unique() {
    let mut names: Vec<&str> = PlannerKind::all().map(PlannerKind::name).collect();
    for method in METHODS {
        assert_eq!(PlannerKind::from_name(method.name), Some(PlannerKind::Optimiser(method)));
    }
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!((names.len(), count), (count, METHODS.len() + 6));
    for reading in Reading::ALL {
        assert_eq!(Reading::from_name(reading.name()), Some(reading));
    }
    assert_eq!(Reading::from_name("literal"), None);
}

/// Goal: what the default does with a path that it has found can only shorten the motion, whichever improvement it is;
/// and where the clock does not cut, one seed gives one motion on any machine.
#[test]
fn improvements_never_lengthen_a_motion_and_repeat_without_the_clock() {
    let (robot, scene) = (ur5(), common::scene("pillars"));
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    let found = |improvement, seed| {
        let deadline = Duration::from_millis(200);
        let options = PlanOptions {
            spends_deadline: true,
            keeps_deadline: false,
            seed,
            deadline,
            improvement,
            ..PlanOptions::default()
        };
        let plan = plan(&robot, &scene, &start, &goal, &options).expect("found");
        assert!(!plan.how.contains("cut short"), "{}", plan.how);
        plan
    };
    let read = |name: &str| Improvement::from_name(name).expect("known");
    assert!(matches!(Improvement::default(), Improvement::Method(_)), "the default improves by a method");
    assert_eq!(Improvement::from_name("teleport"), None);
    let mut shortened = 0;
    for seed in 0..8 {
        let plain = found(read("none"), seed);
        for name in ["searches", "ibfoa", "greedy-bfoa", "iwo"] {
            let better = found(read(name), seed);
            let (with_s, without_s) = (better.proof.duration_s, plain.proof.duration_s);
            assert!(with_s <= without_s, "{name}, seed {seed}: {with_s} s against {without_s} s");
            assert!(better.checks > plain.checks, "{name}, seed {seed}: no work was done");
            shortened += u32::from(with_s < without_s);
            if seed == 0 {
                let again = found(read(name), seed);
                assert_eq!((again.trajectory, again.checks), (better.trajectory, better.checks), "{name}");
            }
        }
    }
    assert!(shortened > 0, "no improvement improved anything");
}

/// Goal: whatever the word, what comes back is a proven motion round the balls, or a refusal that says what to try;
/// a second run gives the same bits.
#[test]
fn every_optimiser_plans_a_proven_motion_or_says_what_to_try() {
    let balls = [0.1, 0.3, 0.5].map(|z| sphere(&format!("ball {z}"), [-0.68, 0.0, z], 0.07));
    let scene = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: balls.to_vec(), zones: Vec::new() };
    let robot = ur5();
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    let mut found = Vec::new();
    for reading in Reading::ALL {
        for method in METHODS {
            let options = options(PlannerKind::Optimiser(method), reading);
            match plan(&robot, &scene, &start, &goal, &options) {
                Ok(once) => {
                    assert!(once.how.starts_with(&method.name.to_uppercase()), "{}", once.how);
                    assert_safe(&robot, &scene, &once.trajectory, &goal, &once.how);
                    let proof = verify(&robot, &scene, &once.trajectory).expect("proven");
                    assert_eq!(proof, once.proof, "{}", method.name);
                    found.push((options, once));
                }
                Err(error) => {
                    assert!(matches!(error, PlanError::NotFound { .. }), "{}: {error}", method.name);
                    let words = error.to_string();
                    assert!(words.contains(&method.name.to_uppercase()), "{words}");
                    assert!(words.contains("another seed, planner or goal"), "{words}");
                }
            }
        }
    }
    assert!(found.len() >= METHODS.len(), "only {} of {}", found.len(), 2 * METHODS.len());
    for (options, once) in found.into_iter().step_by(4) {
        let again = plan(&robot, &scene, &start, &goal, &options).expect("found before");
        assert!(again.trajectory == once.trajectory, "{}: one seed, two motions", once.how);
    }
}
