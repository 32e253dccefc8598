//! The paper's cost against an independent program (`paper_cost.py`, plain Python) and by hand.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
#[path = "../../planner/tests/common/mod.rs"]
mod common;
use common::{pose, sphere, ur5};
use std::path::PathBuf;
use taustream_arm::{Scene, Shape};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
use taustream_optimizers::Reading;
use taustream_optimizers::cost::{CostError, CostModel, PaperCost, paper_cost};

const FREE: [[f64; 6]; 5] = [
    [0.0, -1.5, 1.0, -1.0, -1.5, 0.0],
    [0.2, -1.7, 0.8, -1.2, -1.3, 0.3],
    [-0.1, -1.6, 0.9, -1.0, -1.0, 0.1],
    [0.1, -1.8, 0.6, -0.9, -1.2, -0.4],
    [0.0, -1.9, 0.4, -0.8, -1.5, 0.2],
];
const HIT: [[f64; 6]; 5] = [
    [0.5, -1.2, 1.0, -1.0, -1.5, 0.0],
    [-0.5, -0.8, 1.2, -1.2, -1.3, 0.3],
    [-1.0, -0.6, 0.9, -1.0, -1.0, 0.1],
    [-1.6, -0.9, 0.6, -0.9, -1.2, -0.4],
    [-2.4, -0.7, 0.4, -0.8, -1.5, 0.2],
];

/// The paper's motion: a stroke of 6 s with k = 0.1 between each two points.
fn paper_motion(points: &[[f64; 6]], start_step_s: f64) -> Trajectory {
    let mut start_s = 0.0;
    let mut strokes = Vec::new();
    for leg in points.windows(2) {
        let (a, b) = (pose(leg[0]), pose(leg[1]));
        let delta_rad: JointArray = std::array::from_fn(|j| b[j] - a[j]);
        strokes.push(Stroke { start_s, duration_s: 6.0, n: 10, delta_rad });
        start_s += start_step_s;
    }
    Trajectory::new(6, pose(points[0]), &strokes).expect("sorted")
}

fn spheres() -> Scene {
    let obstacles = vec![
        sphere("a", [-0.5, 0.2, 0.3], 0.18),
        sphere("b", [0.4, 0.4, 0.5], 0.18),
        sphere("c", [0.1, -0.6, 0.2], 0.18),
    ];
    Scene { file: PathBuf::new(), margin_m: 0.0, obstacles, zones: Vec::new() }
}

fn close(name: &str, ours: f64, theirs: f64) {
    assert!((ours - theirs).abs() <= 1e-9 * theirs.abs().max(1.0), "{name}: {ours}, Python has {theirs}");
}

#[test]
fn cost_of_two_motions_agrees_with_the_python_program() {
    let model = CostModel::default();
    let free = paper_cost(&ur5(), &spheres(), &paper_motion(&FREE, 6.0), &model).expect("fits");
    let hit = paper_cost(&ur5(), &spheres(), &paper_motion(&HIT, 6.0), &model).expect("fits");
    let rows = [
        ("FREE", free, [0.887_025_360_200_25, 5.4, 0.0, 1_626.209_177_521_4], false),
        ("HIT", hit, [2.293_349_720_613_12, 8.2, 130.405_325_664_361, 1_564_866_384.025_78], true),
    ];
    for (
        name,
        PaperCost { path_length_m, joint_travel_rad, penalty, collision, cost, poses },
        python,
        hits,
    ) in rows
    {
        assert_eq!((poses, collision), (481, hits), "{name}");
        for (ours, theirs) in [path_length_m, joint_travel_rad, penalty, cost].into_iter().zip(python) {
            close(name, ours, theirs);
        }
    }
}

/// Goal: show the erratum of eq. 3.9: the sum of the distances to all links is never small, so a motion straight through
/// a sphere counts as free.
#[test]
fn cost_as_printed_does_not_see_the_collision() {
    let printed = CostModel { reading: Reading::Printed, ..CostModel::default() };
    let hit = paper_cost(&ur5(), &spheres(), &paper_motion(&HIT, 6.0), &printed).expect("fits");
    assert!(!hit.collision && hit.penalty.abs() <= 0.0, "{hit:?}");
    close("cost", hit.cost, 7.0 * 2.293_349_720_613_12 + 300.0 * 8.2);
}

#[test]
fn cost_of_a_turn_about_the_base_is_as_by_hand() {
    // The arm stands straight up and turns by 1 rad: the tip goes along an arc of known radius, cut into chords.
    let up = [0.0, -std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0, 0.0];
    let mut turned = up;
    turned[0] = 1.0;
    let motion = paper_motion(&[up, turned], 6.0);
    let empty = Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: Vec::new(), zones: Vec::new() };
    let cost = paper_cost(&ur5(), &empty, &motion, &CostModel::default()).expect("fits");
    let tip = common::ur5_origins_m(&pose(up))[6];
    let arc_m = tip[0].hypot(tip[1]);
    assert!((cost.joint_travel_rad - 1.0).abs() < 1e-12 && cost.poses == 121, "{cost:?}");
    // Chords of at most 0.0237 rad are shorter than the arc by less than 0.0237^2 / 24.
    assert!(cost.path_length_m <= arc_m && cost.path_length_m > arc_m * (1.0 - 2.4e-5), "{cost:?}, {arc_m}");
    assert!((cost.cost - (7.0 * cost.path_length_m + 300.0)).abs() < 1e-9 && !cost.collision);
}

#[test]
fn cost_of_what_the_paper_does_not_know_is_refused_by_name() {
    let model = CostModel::default();
    let motion = paper_motion(&FREE, 6.0);
    let mut with_box = spheres();
    with_box.obstacles[1].shape = Shape::Box { size_m: [0.1; 3] };
    let error = paper_cost(&ur5(), &with_box, &motion, &model).unwrap_err();
    assert_eq!(error, CostError::NotSpheres { names: vec!["b".to_owned()] });
    assert!(error.to_string().ends_with("b of this scene is none"), "{error}");

    let error = paper_cost(&ur5(), &spheres(), &paper_motion(&FREE, 5.5), &model).unwrap_err();
    assert!(matches!(error, CostError::Overlap { stroke: 1, by_s } if (by_s - 0.5).abs() < 1e-12), "{error}");

    let two = Trajectory::new(2, [0.0; MAX_JOINTS], &[]).expect("empty");
    let error = paper_cost(&ur5(), &spheres(), &two, &model).unwrap_err();
    assert_eq!(error, CostError::Joints { got: 2, expected: 6 });

    for bad in [
        CostModel { waypoints_per_segment: 0, ..model },
        CostModel { waypoints_per_segment: 1_000_000, ..model },
        CostModel { expansion_m: f64::NAN, ..model },
        CostModel { expansion_m: -0.1, ..model },
        CostModel { weights: [7.0, f64::INFINITY, 1.0], ..model },
    ] {
        let error = paper_cost(&ur5(), &spheres(), &motion, &bad).unwrap_err();
        assert!(matches!(error, CostError::Model { .. }), "{bad:?}");
    }
}

#[test]
fn cost_counts_the_penalty_only_with_a_collision_and_pauses_do_not_matter() {
    let (robot, scene) = (ur5(), spheres());
    let near = CostModel { expansion_m: 0.0, ..CostModel::default() };
    let (tight, apart) = (paper_motion(&HIT, 6.0), paper_motion(&HIT, 7.0));
    let a = paper_cost(&robot, &scene, &tight, &near).expect("fits");
    let b = paper_cost(&robot, &scene, &apart, &near).expect("fits");
    assert_eq!(a.collision, a.penalty > 0.0);
    // Starts at 7, 14, .. s round differently from 6, 12, .. s.
    close("pauses", a.cost, b.cost);
}
