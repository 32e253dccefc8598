//! The lanes answer as the exact model does.
#![expect(clippy::expect_used, reason = "helpers of tests fail by panicking")]
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use taustream_arm::cloud::Cloud;
use taustream_arm::{Obstacle, Robot, Scene, Shape};
use taustream_motion::chain::{Chain, ChainJoint, Pose};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS};
use taustream_planner::budget::Budget;
use taustream_planner::collide::{Motion, StraightEdge, SweepRules, sweep, sweep_in_parts};
use taustream_planner::lanes::{Kept, Lanes};
use taustream_planner::rng::SeededRng;
use taustream_planner::world::{Snapshot, World};

/// Poses of each arm; a million are asked for by `TAUSTREAM_POSES=1000000`.
const POSES: u64 = 12_000;
/// Poses of one scene.
const POSES_PER_SCENE: u64 = 400;

fn poses() -> u64 {
    std::env::var("TAUSTREAM_POSES").ok().and_then(|text| text.parse().ok()).unwrap_or(POSES)
}

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots").join(name)
}

fn shape(rng: &mut SeededRng) -> Shape {
    let mut size = || rng.within(0.02, 0.3);
    let sizes = [size(), size(), size()];
    match rng.index(7) {
        0 => Shape::Sphere { radius_m: sizes[0] },
        1 => Shape::Capsule { radius_m: 0.5 * sizes[0], length_m: 2.0 * sizes[1] },
        2 => Shape::Cylinder { radius_m: 0.5 * sizes[0], length_m: 2.0 * sizes[1] },
        3 => {
            let corner = |i: u32| {
                let sign = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
                Point3::new(sign(1) * sizes[0], sign(2) * sizes[1], sign(4) * sizes[2] * 0.5)
            };
            let triangles = [
                [0, 2, 1],
                [1, 2, 3],
                [4, 5, 6],
                [5, 7, 6],
                [0, 1, 4],
                [1, 5, 4],
                [2, 6, 3],
                [3, 6, 7],
                [0, 4, 2],
                [2, 4, 6],
                [1, 3, 5],
                [3, 7, 5],
            ];
            Shape::Mesh { vertices_m: (0..8).map(corner).collect(), triangles: triangles.to_vec() }
        }
        4 => {
            // A bent sheet, as cameras see surfaces.
            let mut point = || [rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(-0.02, 0.02)];
            let scaled = |[x, y, z]: [f64; 3]| [x * sizes[0], y * sizes[1], z + x * y * sizes[2]];
            let points_m = (0..300).map(|_| scaled(point())).collect();
            Shape::Cloud(Arc::new(Cloud::new(points_m, 0.1 * sizes[2]).expect("finite")))
        }
        _ => Shape::Box { size_m: sizes.map(|s| 2.0 * s) },
    }
}

/// Obstacles up to `far_m` away from the base.
fn scene(rng: &mut SeededRng, obstacles: usize, far_m: f64) -> Scene {
    let mut obstacle = |i: usize| {
        let shape = shape(rng);
        let mut v =
            |far: f64| Vector3::new(rng.within(-far, far), rng.within(-far, far), rng.within(-far, far));
        let at = Translation3::from(v(far_m));
        // Half of them along the axes of space.
        let turn = if i.is_multiple_of(2) {
            UnitQuaternion::identity()
        } else {
            UnitQuaternion::from_scaled_axis(v(3.0))
        };
        Obstacle { name: format!("thing {i}"), pose: Pose::from_parts(at, turn), shape }
    };
    let obstacles = (0..obstacles).map(&mut obstacle).collect();
    Scene { file: PathBuf::new(), margin_m: rng.within(0.0, 0.02), obstacles, zones: Vec::new() }
}

/// The three upper joints of an arm with what they carry, moved from its forearm to the base beside it.
fn two_arms(mut robot: Robot) -> Robot {
    let mut joints: Vec<ChainJoint> = (0..6).filter_map(|i| robot.chain.joint(i).copied()).collect();
    joints[3].pre = Pose::translation(0.3, 0.3, 0.4) * joints[3].pre;
    robot.chain = Chain::tree(&joints, &[0, 1, 2, 0, 4, 5], &[3, 6]).expect("a tree");
    robot.allowed_by_rule.retain(|pair| *pair != (3, 4));
    robot
}

/// An arm whose first and fourth joints slide instead of turning.
fn with_slides(mut robot: Robot) -> Robot {
    let mut joints: Vec<ChainJoint> = (0..6).filter_map(|i| robot.chain.joint(i).copied()).collect();
    for (index, stroke) in [(0, [-0.6, 0.6]), (3, [-0.1, 0.5])] {
        joints[index].kind = JointKind::Prismatic;
        let joint = &mut robot.joints[index];
        (joint.kind, joint.limits.position_rad, joint.stroke) = (JointKind::Prismatic, stroke, stroke);
    }
    robot.chain = Chain::new(&joints).expect("six joints");
    robot
}

fn pose(rng: &mut SeededRng, robot: &Robot) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    for (q, joint) in pose.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *q = rng.within(low, high);
    }
    pose
}

/// Arms of every kind of chain, each with how far from its base obstacles stand (m).
fn robots() -> [(&'static str, Robot, f64); 4] {
    let shipped = |name: &str| Robot::load(&file(name)).expect("shipped");
    [
        ("ur5.toml", shipped("ur5.toml"), 1.1),
        ("piper.toml", shipped("piper.toml"), 0.5),
        ("two arms", two_arms(shipped("ur5.toml")), 0.7),
        ("ur5 with slides", with_slides(shipped("ur5.toml")), 1.1),
    ]
}

/// Goal: for every pose the lanes say what the exact model says, whatever the machine's instructions.
/// Method: random scenes of every kind of shape, few obstacles and many; at least three poses in ten in contact, as many free.
#[test]
fn lanes_answer_as_the_exact_model_for_random_poses() {
    for (arm, (name, robot, far_m)) in robots().into_iter().enumerate() {
        let (mut free, mut all) = (0_u64, 0_u64);
        for number in 0..poses().div_ceil(POSES_PER_SCENE) {
            let mut rng = SeededRng::new(number, 60 + arm as u64);
            let few = 1 + rng.index(5);
            let scene = scene(&mut rng, if number % 8 == 0 { 40 } else { few }, far_m);
            let world = World::new(&robot, &scene).expect("builds");
            let world =
                if number % 5 == 1 { world.relaxed(&pose(&mut rng, &robot), 0.0, 1e-4) } else { world };
            let lanes = [Lanes::new(&world), Lanes::new(&world).scalar()];
            let extra_m = if number % 3 == 0 { 0.0 } else { 2e-4 };
            let mut snapshot = Snapshot::default();
            let drawn: Vec<JointArray> = (0..POSES_PER_SCENE).map(|_| pose(&mut rng, &robot)).collect();
            let mut kept = Vec::new();
            for pose in &drawn {
                let exact = world.is_free(pose, extra_m, &mut snapshot);
                let said = lanes.each_ref().map(|l| l.are_free(std::slice::from_ref(pose), extra_m));
                assert_eq!(said, [exact; 2], "{name}, scene {number}: {pose:?}");
                (free, all) = (free + u64::from(exact), all + 1);
                if exact {
                    kept.push(*pose);
                }
            }
            // Together they are free, with any one that is not they are not.
            assert!(lanes.iter().all(|l| l.are_free(&kept, extra_m)), "{name}, scene {number}");
            if let Some(blocked) = drawn.iter().find(|pose| !kept.contains(pose)) {
                kept.insert(kept.len() / 3, *blocked);
                assert!(!lanes.iter().any(|l| l.are_free(&kept, extra_m)), "{name}, scene {number}");
            }
        }
        let contact = 1.0 - free as f64 / all as f64;
        assert!((0.3..0.9).contains(&contact), "{name}: {contact} of the poses in contact");
    }
}

/// Goal: next to the limit, where f32 cannot decide, the exact model does.
/// Method: bisection along random edges to the last free pose; poses within a micrometre on either side of it.
#[test]
fn lanes_answer_as_the_exact_model_next_to_contact() {
    let robot = Robot::load(&file("ur5.toml")).expect("shipped");
    let mut found = 0;
    for number in 0..150 {
        let mut rng = SeededRng::new(number, 70);
        let scene = scene(&mut rng, 3, 1.1);
        let world = World::new(&robot, &scene).expect("builds");
        let (lanes, mut snapshot) = (Lanes::new(&world), Snapshot::default());
        let (mut free, mut blocked) = (pose(&mut rng, &robot), pose(&mut rng, &robot));
        let mut is_free = |pose: &JointArray| world.is_free(pose, 0.0, &mut snapshot);
        if !is_free(&free) || is_free(&blocked) {
            continue;
        }
        for _ in 0..60 {
            let middle: JointArray = std::array::from_fn(|j| 0.5 * (free[j] + blocked[j]));
            if is_free(&middle) {
                free = middle;
            } else {
                blocked = middle;
            }
            assert_eq!(lanes.are_free(&[middle], 0.0), is_free(&middle), "scene {number}: {middle:?}");
        }
        found += 1;
    }
    assert!(found > 15, "{found} edges with one end in contact");
}

/// Goal: no pose of an interval keeps less than the lanes say of it, or nothing where they say so, whatever the machine's instructions; what moves within it is needed for that.
/// Method: random scenes of every kind of shape, turns of every size; the exact model at random poses within each interval.
#[test]
fn no_pose_of_an_interval_keeps_less_than_its_bound() {
    for (arm, (name, robot, far_m)) in robots().into_iter().enumerate() {
        let (mut all, mut moved, mut tight) = (0, 0, 0);
        for number in 0..poses().div_ceil(POSES_PER_SCENE) {
            let mut rng = SeededRng::new(number, 80 + arm as u64);
            let few = 1 + rng.index(5);
            let scene = scene(&mut rng, if number % 8 == 0 { 40 } else { few }, far_m);
            let world = World::new(&robot, &scene).expect("builds");
            let drawn: Vec<JointArray> = (0..60).map(|_| pose(&mut rng, &robot)).collect();
            let turns: Vec<JointArray> = drawn
                .iter()
                .map(|_| {
                    let most = 10.0_f64.powf(rng.within(-4.0, -0.5));
                    let joints = robot.joints.len();
                    std::array::from_fn(|j| {
                        if j < joints && rng.unit() < 0.6 { rng.within(0.0, most) } else { 0.0 }
                    })
                })
                .collect();
            let enough_m = if number % 2 == 0 { f64::INFINITY } else { 0.02 };
            let of = |lanes: &Lanes, turns: &[JointArray]| {
                let mut kept = Vec::<Kept>::new();
                lanes.keep((&drawn, turns), enough_m, &mut kept);
                assert_eq!(kept.len(), drawn.len());
                kept
            };
            let still = of(&Lanes::new(&world), &vec![[0.0; MAX_JOINTS]; drawn.len()]);
            for lanes in [Lanes::new(&world), Lanes::new(&world).scalar()] {
                let kept = of(&lanes, &turns);
                for (((pose, turn), kept), still) in drawn.iter().zip(&turns).zip(&kept).zip(&still) {
                    for _ in 0..3 {
                        let side = if rng.unit() < 0.5 { 1.0 } else { -1.0 };
                        let share = if rng.unit() < 0.5 { side } else { rng.within(-1.0, 1.0) };
                        let there: JointArray = std::array::from_fn(|j| pose[j] + share * turn[j]);
                        let nearest_m =
                            world.nearest(&there).map_or(f64::INFINITY, |(_, distance_m)| distance_m);
                        let spare =
                            world.closest(&there).map(|(pair, distance_m)| distance_m - pair.required_m);
                        let spare_m = spare.unwrap_or(f64::INFINITY);
                        let (least, spare) = (f64::from(kept.least_m), f64::from(kept.spare_m));
                        assert!(
                            least <= nearest_m.max(0.0),
                            "{name}, scene {number}, {there:?}: {least} above {nearest_m}"
                        );
                        assert!(
                            spare <= spare_m.max(0.0),
                            "{name}, scene {number}, {there:?}: {spare} above {spare_m}"
                        );
                        all += 1;
                        moved += i32::from(f64::from(still.least_m) > nearest_m);
                        tight += i32::from(least > nearest_m - 0.02 || least >= enough_m);
                    }
                }
            }
        }
        assert!(moved > all / 50, "{name}: nothing moves in {} of {all} poses", all - moved);
        assert!(tight > all / 20, "{name}: the bound is near in {tight} of {all} poses only");
    }
}

/// Goal: a sweep in parts proves what the exact sweep proves, finds the same contact, and its least distance is as sharp.
/// Method: random edges in random scenes, short and long; dense poses for the least distance.
#[test]
fn a_sweep_in_parts_answers_as_the_exact_sweep() {
    let robot = Robot::load(&file("ur5.toml")).expect("shipped");
    let (mut proven, mut refused) = (0, 0);
    for number in 0..240 {
        let mut rng = SeededRng::new(number, 90);
        let obstacles = if number % 8 == 0 { 40 } else { 3 };
        let scene = scene(&mut rng, obstacles, 1.1);
        let world = World::new(&robot, &scene).expect("builds");
        let (from_rad, far_rad) = (pose(&mut rng, &robot), pose(&mut rng, &robot));
        let share = 10.0_f64.powf(rng.within(-3.0, 0.0));
        let to_rad = std::array::from_fn(|j| from_rad[j] + share * (far_rad[j] - from_rad[j]));
        let edge = StraightEdge { from_rad: &from_rad, to_rad: &to_rad };
        let budget = Budget::unbounded();
        let exact = sweep(&world, &edge, [0.0, 1.0], &SweepRules::PROOF, &budget);
        let found = sweep_in_parts(&world, &edge, [0.0, 1.0], &SweepRules::PROOF, &budget);
        match (exact, found) {
            (Ok(_), Ok(_)) => {
                proven += 1;
                let least = sweep_in_parts(&world, &edge, [0.0, 1.0], &SweepRules::LEAST_DISTANCE, &budget);
                let least = least.expect("proven");
                let at =
                    |i: u32| world.nearest(&edge.at(f64::from(i) / 500.0)).map_or(f64::INFINITY, |(_, d)| d);
                let dense_m = (0..=500).map(at).fold(f64::INFINITY, f64::min);
                assert!(least.proven_m <= dense_m, "scene {number}: {least:?} above {dense_m}");
                assert!(least.proven_m >= least.sampled_m - 1.001e-3, "scene {number}: {least:?}");
                assert!(least.sampled_m >= least.proven_m, "scene {number}: {least:?}");
            }
            (Err(exact), Err(found)) => {
                refused += 1;
                assert!(exact.pair.is_some() && found.pair.is_some(), "scene {number}: {exact:?}, {found:?}");
                assert!((exact.at - found.at).abs() < 1e-4, "scene {number}: {exact:?}, {found:?}");
            }
            (exact, found) => panic!("scene {number}: {exact:?}, in parts {found:?}"),
        }
    }
    assert!(proven > 40 && refused > 40, "{proven} proven, {refused} refused");
}
