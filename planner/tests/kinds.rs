//! Planners by name: every word of the list plans, and every optimiser of the registry is such a word.
mod common;

use common::{assert_safe, pose, sphere, ur5};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::Scene;
use taustream_planner::optimize::{METHODS, Reading};
use taustream_planner::{PlanError, PlanOptions, PlannerKind, plan, verify};

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

/// Goal: whatever the word, what comes back is a proven motion round the balls, or a refusal that says what to try;
/// a second run gives the same bits.
#[test]
fn every_optimiser_plans_a_proven_motion_or_says_what_to_try() {
    let balls = [0.1, 0.3, 0.5].map(|z| sphere(&format!("ball {z}"), [-0.68, 0.0, z], 0.07));
    let scene = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: balls.to_vec() };
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
