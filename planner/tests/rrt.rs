//! The plain RRT that Wang et al. (2022) compare with, against a program written from its original report (`LaValle` 1998).
use std::cell::Cell;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::{Field, Search, rrt};

/// The square of `oracles/rrt.py`.
struct Square {
    discs: Vec<([f64; 2], f64)>,
    checks: Cell<usize>,
    checks_until_over: usize,
}

impl Square {
    fn new() -> Self {
        let discs = vec![([0.0, 0.0], 1.2), ([0.5, -2.0], 0.7)];
        Self { discs, checks: Cell::new(0), checks_until_over: usize::MAX }
    }
}

fn meets(a: &JointArray, b: &JointArray, centre: [f64; 2], radius: f64) -> bool {
    let (d, to) = ([b[0] - a[0], b[1] - a[1]], [centre[0] - a[0], centre[1] - a[1]]);
    let length2 = d[0] * d[0] + d[1] * d[1];
    let t = if length2 > 0.0 { ((to[0] * d[0] + to[1] * d[1]) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (a[0] + t * d[0] - centre[0]).hypot(a[1] + t * d[1] - centre[1]) < radius
}

impl Field for Square {
    fn step(&self) -> f64 {
        0.5
    }
    fn distance(&self, a: &JointArray, b: &JointArray) -> f64 {
        (a[0] - b[0]).hypot(a[1] - b[1])
    }
    fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool {
        self.checks.set(self.checks.get() + 1);
        self.discs.iter().all(|(centre, radius)| !meets(a, b, *centre, *radius))
    }
    fn checks(&self) -> usize {
        self.checks.get()
    }
    fn is_over(&self) -> bool {
        self.checks.get() >= self.checks_until_over
    }
    fn random_pose(&self, rng: &mut SeededRng) -> JointArray {
        let mut pose = [0.0; MAX_JOINTS];
        pose[..2].fill_with(|| rng.within(-3.0, 3.0));
        pose
    }
}

fn pose(x: f64, y: f64) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose[..2].copy_from_slice(&[x, y]);
    pose
}

fn grow(square: &Square, seed: u64, checks_max: usize) -> Search {
    rrt(square, &pose(-2.0, -0.5), &pose(2.0, -0.4), checks_max, &mut SeededRng::new(seed, 0))
}

#[test]
fn rrt_grows_as_the_program_written_from_the_report() {
    let mut seed = 0;
    for line in include_str!("oracles/rrt.txt").lines() {
        seed += 1;
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().expect("a number")).collect();
        let search = grow(&Square::new(), seed, 100_000);
        let path = search.path.expect("there is a way");
        assert_eq!((search.nodes as f64).to_bits(), numbers[0].to_bits(), "seed {seed}: nodes");
        assert_eq!(path.len() * 2, numbers.len() - 1, "seed {seed}: length of the path");
        for (ours, theirs) in path.iter().zip(numbers[1..].chunks(2)) {
            let away = (ours[0] - theirs[0]).hypot(ours[1] - theirs[1]);
            assert!(away < 1e-9, "seed {seed}: {ours:?}, Python has {theirs:?}");
        }
    }
    assert_eq!(seed, 6);
}

#[test]
fn rrt_path_joins_its_ends_by_free_edges_no_longer_than_a_step() {
    for seed in 10..60 {
        let square = Square::new();
        let path = grow(&square, seed, 100_000).path.expect("there is a way");
        assert_eq!((path[0], path[path.len() - 1]), (pose(-2.0, -0.5), pose(2.0, -0.4)), "seed {seed}");
        for pair in path.windows(2) {
            assert!(square.distance(&pair[0], &pair[1]) <= 0.5 + 1e-12, "seed {seed}");
            assert!(square.is_edge_free(&pair[0], &pair[1]), "seed {seed}");
        }
    }
}

/// Goal: a search that cannot succeed ends, by its budget to the check, or when cancelled.
#[test]
fn rrt_to_a_walled_goal_ends_with_its_budget_or_its_cancellation() {
    let mut walled = Square::new();
    walled.discs.extend((0..12).map(|i| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 12.0).sin_cos();
        ([2.0 + 0.4 * cos, -0.4 + 0.4 * sin], 0.15)
    }));
    for checks_max in [0, 1, 777] {
        walled.checks.set(5);
        let search = grow(&walled, 1, checks_max);
        assert_eq!((search.path, walled.checks.get()), (None, 5 + checks_max));
    }
    walled.checks.set(0);
    walled.checks_until_over = 40;
    let search = grow(&walled, 1, usize::MAX);
    assert_eq!((search.path, walled.checks.get()), (None, 40));
}

/// Everything is free and nothing is ever near.
struct Endless;

impl Field for Endless {
    fn step(&self) -> f64 {
        0.5
    }
    fn distance(&self, _a: &JointArray, _b: &JointArray) -> f64 {
        1.0
    }
    fn is_edge_free(&self, _a: &JointArray, _b: &JointArray) -> bool {
        true
    }
    fn checks(&self) -> usize {
        0
    }
    fn is_over(&self) -> bool {
        false
    }
    fn random_pose(&self, _rng: &mut SeededRng) -> JointArray {
        pose(1.0, 1.0)
    }
}

#[test]
fn rrt_in_a_field_without_end_ends_with_its_nodes() {
    let search = rrt(&Endless, &pose(0.0, 0.0), &pose(f64::NAN, 0.0), usize::MAX, &mut SeededRng::new(1, 0));
    assert!(search.path.is_none() && search.nodes == 20_000, "{} nodes", search.nodes);
}
