//! Abdi et al. (2020): foraging robots, their traps and their escape, and the potential field.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use taustream_optimizers::Reading;
use taustream_optimizers::papers::planar::{
    Journey, Numbers, Obstacle, PlanarDrive, PlanarScene, Rule, distance_cm, drive, force, potential,
};

fn go(scene: &str, rule: Rule, seed: u64) -> Journey {
    // A robot without an escape that has not arrived by then stands.
    let steps_max = if rule == Rule::RobustBacteria { 4_000 } else { 800 };
    let how = PlanarDrive { rule, numbers: Numbers { steps_max, ..Numbers::OURS }, shared: true, seed };
    drive(&PlanarScene::by_name(scene).expect("a scene"), &how).expect("sane")
}

fn arrived(scene: &str, rule: Rule) -> Vec<Journey> {
    let journeys = (0..10).map(|seed| go(scene, rule, seed));
    journeys.filter(|j| j.arrived.iter().all(|a| *a)).collect()
}

/// Goal: the method is the paper's, step by step: candidates, cost, trap, retreat, virtual obstacle.
/// Method: the same robot before the same U with the same random numbers, in plain Python (`oracles/paper_002.py`).
#[test]
fn planar_robust_bacteria_walk_as_the_program_written_from_the_paper() {
    let numbers =
        |line: &str| -> Vec<f64> { line.split(' ').map(|word| word.parse().expect("a number")).collect() };
    let lines: Vec<Vec<f64>> = include_str!("oracles/planar_walk.txt").lines().map(numbers).collect();
    let walls = Obstacle::walls(&[[-15.0, -20.0], [-15.0, 0.0], [15.0, 0.0], [15.0, -20.0]]);
    let scene =
        PlanarScene { name: "oracle", robots: vec![[[3.0, -60.0], [0.0, 60.0]]], obstacles: vec![walls] };
    let how = PlanarDrive { rule: Rule::RobustBacteria, numbers: Numbers::OURS, shared: true, seed: 1 };
    let journey = drive(&scene, &how).expect("sane");
    let path = &journey.paths_cm[0];
    let counts = [path.len() as f64, journey.virtuals.len() as f64];
    assert!((0..2).all(|i| (counts[i] - lines[0][i]).abs() < 0.5), "{counts:?}, Python has {:?}", lines[0]);
    let places = path.iter().step_by(20).copied().chain(journey.virtuals.iter().map(|v| v.centre_cm));
    assert_eq!(places.clone().count(), lines.len() - 1);
    for (i, (ours, theirs)) in places.zip(&lines[1..]).enumerate() {
        assert!(
            distance_cm(ours, [theirs[0], theirs[1]]) < 1e-6,
            "place {i}: {ours:?}, Python has {theirs:?}"
        );
    }
}

#[test]
fn planar_force_is_the_downward_slope_of_the_potential() {
    let numbers = Numbers::OURS;
    for place in [[3.0, 4.0], [-8.0, 2.5], [10.0, -1.0]] {
        let sensed = [[0.0, 0.0], [5.0, -6.0], [40.0, 40.0]];
        let goal = [-20.0, 90.0];
        let ours = force(&numbers, place, goal, &sensed);
        for (i, ours) in ours.into_iter().enumerate() {
            let at = |d: f64| {
                let mut moved = place;
                moved[i] += d;
                potential(&numbers, moved, goal, &sensed)
            };
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((ours + slope).abs() < 1e-4 * slope.abs().max(1.0), "{ours} against {slope}");
        }
    }
}

#[test]
fn planar_nearest_points_are_those_of_geometry() {
    let disc = Obstacle { velocity_cm_s: [1.0, -2.0], ..Obstacle::disc([3.0, 4.0], 2.0) };
    // After 2 s the disc's centre is (5, 0); from (5, 10) its nearest point is (5, 2).
    let (point, away) = disc.nearest([5.0, 10.0], 2.0);
    assert!(distance_cm(point, [5.0, 2.0]) < 1e-12 && (away - 8.0).abs() < 1e-12, "{point:?} {away}");
    assert!(disc.nearest([5.5, 0.0], 2.0).1.abs() < 1e-12, "inside there is no distance");
    let walls = Obstacle::walls(&[[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]]);
    for (from, to, away) in [
        ([4.0, 3.0], [4.0, 0.0], 3.0),
        ([-3.0, -4.0], [0.0, 0.0], 5.0),
        ([12.0, 4.0], [10.0, 4.0], 2.0),
        ([13.0, 9.0], [10.0, 5.0], 5.0),
    ] {
        let (point, seen) = walls.nearest(from, 7.0);
        assert!(distance_cm(point, to) < 1e-12 && (seen - away).abs() < 1e-12, "{from:?}: {point:?} {seen}");
    }
    assert!(Obstacle::walls(&[]).nearest([0.0; 2], 0.0).1.is_infinite());
}

/// Goal: as an independent implementation showed, single and paired discs are passed without virtual obstacles. Three
/// in a row are a trap for plain bacteria when they stand square to the way, as ours do.
#[test]
fn planar_discs_are_passed_by_bacteria_without_an_escape() {
    for scene in ["static", "moving", "two-discs"] {
        for rule in [Rule::Bacteria, Rule::RobustBacteria] {
            let done = arrived(scene, rule);
            assert_eq!(done.len(), 10, "{scene}, {rule:?}");
            assert!(done.iter().all(|j| j.virtuals.is_empty()), "{scene}, {rule:?}");
        }
    }
    assert_eq!(arrived("three", Rule::RobustBacteria).len(), 10);
    let steps: Vec<usize> = arrived("static", Rule::Bacteria).iter().map(|j| j.steps).collect();
    // The way is 193 cm, 95 steps of 2 cm to 3 cm before the goal.
    assert!(steps.iter().all(|s| (95..130).contains(s)), "{steps:?}");
}

/// Goal: the claim of the paper holds: L and U trap plain bacteria and the potential field; the
/// robust ones get out.
#[test]
fn planar_traps_hold_plain_bacteria_and_the_field_and_not_the_robust_ones() {
    for scene in ["l", "u", "wide-u"] {
        for rule in [Rule::Bacteria, Rule::Potential] {
            assert_eq!(arrived(scene, rule).len(), 0, "{scene}, {rule:?}");
        }
        let done = arrived(scene, Rule::RobustBacteria);
        assert_eq!(done.len(), 10, "{scene}");
        assert!(done.iter().all(|j| !j.virtuals.is_empty()), "{scene}");
    }
}

/// Goal: eq. 15 to the letter, with the virtual obstacle where the robot returns to, is worse.
#[test]
fn planar_virtual_obstacles_belong_where_the_trap_is() {
    let median = |reading| {
        let numbers = Numbers { reading, ..Numbers::OURS };
        let scene = PlanarScene::by_name("wide-u").expect("a scene");
        let steps = (0..5).map(|seed| {
            drive(&scene, &PlanarDrive { rule: Rule::RobustBacteria, numbers, shared: true, seed })
                .expect("sane")
                .steps
        });
        let mut steps: Vec<usize> = steps.collect();
        steps.sort_unstable();
        steps[2]
    };
    let (corrected, printed) = (median(Reading::Corrected), median(Reading::Printed));
    assert!(printed > 2 * corrected, "steps: printed {printed}, corrected {corrected}");
}

#[test]
fn planar_robots_keep_clear_of_what_stands_and_move_a_step_at_a_time() {
    for scene in PlanarScene::paper_002().into_iter().filter(|s| s.name != "moving") {
        for rule in [Rule::Potential, Rule::Bacteria, Rule::RobustBacteria] {
            let journey = go(scene.name, rule, 3);
            assert!(journey.nearest_cm >= 3.0 - 1e-9, "{} {rule:?}: {}", scene.name, journey.nearest_cm);
            let longest = journey.paths_cm.iter().flat_map(|p| p.windows(2)).map(|w| distance_cm(w[0], w[1]));
            assert!(longest.fold(0.0, f64::max) <= 2.0 + 1e-9, "{} {rule:?}", scene.name);
            assert_eq!(go(scene.name, rule, 3), journey, "one seed, two journeys");
        }
    }
}

/// Goal: four robots: plain bacteria leave some behind, robust ones all arrive, sharing or not.
#[test]
fn planar_four_robots_all_arrive_with_the_escape_only() {
    let plain = go("four-robots", Rule::Bacteria, 1);
    let stuck = plain.arrived.iter().filter(|a| !**a).count();
    assert!((1..=3).contains(&stuck), "{:?}", plain.arrived);
    let scene = PlanarScene::by_name("four-robots").expect("a scene");
    for shared in [true, false] {
        for seed in 0..5 {
            let how = PlanarDrive { rule: Rule::RobustBacteria, numbers: Numbers::OURS, shared, seed };
            let journey = drive(&scene, &how).expect("sane");
            assert!(
                journey.arrived.iter().all(|a| *a),
                "seed {seed}, shared {shared}: {:?}",
                journey.arrived
            );
        }
    }
}

/// Goal: what the paper names as hopeless ends: a closed room makes virtual obstacles until there are enough.
#[test]
fn planar_closed_room_ends_with_its_caps() {
    let room = Obstacle::walls(&[[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0], [-20.0, -20.0]]);
    let scene = PlanarScene { name: "room", robots: vec![[[0.0, 0.0], [0.0, 90.0]]], obstacles: vec![room] };
    let numbers = Numbers { steps_max: 1_000, virtual_max: 12, ..Numbers::OURS };
    let how = PlanarDrive { rule: Rule::RobustBacteria, numbers, shared: true, seed: 1 };
    let journey = drive(&scene, &how).expect("sane");
    assert_eq!((journey.arrived, journey.virtuals.len(), journey.steps), (vec![false], 12, 1_000));
    assert!(journey.nearest_cm >= 3.0 - 1e-9);
}

#[test]
fn planar_numbers_that_make_no_sense_are_refused_and_odd_scenes_end() {
    let good = Numbers { steps_max: 50, ..Numbers::OURS };
    let refused = [
        Numbers { bacteria: 0, ..good },
        Numbers { observed: 0, ..good },
        Numbers { step_cm: f64::NAN, ..good },
        Numbers { range_cm: 0.0, ..good },
        Numbers { clearance_cm: f64::INFINITY, ..good },
        Numbers { goal: [20.0, f64::NAN], ..good },
    ];
    let scene = PlanarScene::by_name("static").expect("a scene");
    for numbers in refused {
        let how = PlanarDrive { rule: Rule::Bacteria, numbers, shared: true, seed: 0 };
        assert!(drive(&scene, &how).is_err(), "{numbers:?}");
    }
    let odd = [
        PlanarScene { name: "nobody", robots: vec![], obstacles: vec![] },
        PlanarScene { name: "there", robots: vec![[[0.0; 2], [0.0; 2]]], obstacles: vec![] },
        PlanarScene {
            name: "on it",
            robots: vec![[[0.0; 2], [50.0, 0.0]]],
            obstacles: vec![Obstacle::disc([0.0; 2], 5.0)],
        },
        PlanarScene { name: "no number", robots: vec![[[f64::NAN; 2], [1.0, 0.0]]], obstacles: vec![] },
        PlanarScene {
            name: "no number",
            robots: vec![[[0.0; 2], [9.0, 0.0]]],
            obstacles: vec![Obstacle::disc([f64::NAN; 2], 5.0)],
        },
    ];
    for scene in odd {
        for rule in [Rule::Potential, Rule::Bacteria, Rule::RobustBacteria] {
            let journey =
                drive(&scene, &PlanarDrive { rule, numbers: good, shared: true, seed: 0 }).expect("ends");
            assert!(journey.steps <= 50, "{}", scene.name);
        }
    }
}
