//! What the tip must keep along a whole motion, by an independent forward kinematics and dense samples: upright, inside a box, slow.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
mod common;

use common::{config, random_spheres, scene, sphere, ur5};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::chain::{Chain, ChainJoint};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS, Trajectory};
use taustream_planner::constraints::TipFault;
use taustream_planner::goals::{Inverse, LineError, Orientation, TipSpeed, plan_line_keeping};
use taustream_planner::in_motion::{CutPoint, NoReplacement, Surroundings};
use taustream_planner::rng::SeededRng;
use taustream_planner::{
    Finder, GoalError, Plan, PlanError, PlanOptions, PlannerKind, PoseOf, Situation, StartMargin, TipBox,
    TipConstraints, TipTarget, Upright, Violation, plan, plan_through, plan_to_tip, verify, verify_keeping,
};

/// Instants at which a motion is looked at.
const INSTANTS: u32 = 6_000;

/// Rotation and position of the first tip: Rodrigues' formula and plain matrices, joint by joint.
fn tip(robot: &Robot, pose_rad: &JointArray) -> (Matrix3<f64>, Vector3<f64>) {
    let (mut rotation, mut at) = (Matrix3::identity(), Vector3::zeros());
    for joint in robot.chain.movers(robot.chain.tip_frame()) {
        let described = robot.chain.joint(joint).expect("a joint");
        let (u, by) = (described.axis.into_inner(), pose_rad[joint] + described.offset);
        at += rotation * described.pre.translation.vector;
        rotation *= described.pre.rotation.to_rotation_matrix().matrix();
        if described.kind.is_prismatic() {
            at += rotation * u * by;
        } else {
            let cross = Matrix3::new(0.0, -u.z, u.y, u.z, 0.0, -u.x, -u.y, u.x, 0.0);
            rotation *= Matrix3::identity() + cross * by.sin() + cross * cross * (1.0 - by.cos());
        }
        at += rotation * described.post.translation.vector;
        rotation *= described.post.rotation.to_rotation_matrix().matrix();
    }
    (rotation, at)
}

/// The largest excess over each constraint: angle (rad), place (m), share of the speed limit.
fn excess(robot: &Robot, asked: &TipConstraints, motion: &Trajectory, from_s: f64) -> [f64; 3] {
    let (mut most, step_s) = ([f64::NEG_INFINITY; 3], (motion.duration_s() - from_s) / f64::from(INSTANTS));
    let mut last = None::<Vector3<f64>>;
    for i in 0..=INSTANTS {
        let (rotation, at) = tip(robot, &motion.sample(from_s + step_s * f64::from(i)).position_rad);
        if let Some(upright) = asked.upright {
            let cosine = (rotation * Vector3::from(upright.tip_axis)).dot(&Vector3::from(upright.direction));
            most[0] = most[0].max(cosine.clamp(-1.0, 1.0).acos() - upright.tolerance_rad);
        }
        if let Some(inside) = asked.inside {
            for axis in 0..3 {
                most[1] = most[1].max(inside.low_m[axis] - at[axis]).max(at[axis] - inside.high_m[axis]);
            }
        }
        if let (Some(limit_m_s), Some(last)) = (asked.speed_m_s, last) {
            most[2] = most[2].max((at - last).norm() / step_s / limit_m_s - 1.0);
        }
        last = Some(at);
    }
    most
}

fn seven_joints() -> Robot {
    let quarter = FRAC_PI_2;
    let mut text = String::from("name = \"seven\"\n");
    for (i, d) in [0.34, 0.0, 0.4, 0.0, 0.4, 0.0, 0.126].into_iter().enumerate() {
        let alpha = [-quarter, quarter, quarter, -quarter, -quarter, quarter, 0.0][i];
        write!(
            text,
            "[[joint]]\nname = \"j{i}\"\nlink_radius_m = 0.0\nposition_rad = [-2.6, 2.6]\n\
             dh = {{ a_m = 0, alpha_rad = {alpha}, d_m = {d}, theta_offset_rad = 0.0 }}\n\
             motion = {{ velocity_rad_s = 2, acceleration_rad_s2 = 10, jerk_rad_s3 = 100 }}\n"
        )
        .expect("a string");
    }
    Robot::from_toml(Path::new("seven.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"))
}

/// The same arm on a rail along y instead of its first joint, which turns.
fn on_a_rail() -> Robot {
    let mut robot = seven_joints();
    let mut joints: Vec<ChainJoint> = (0..7).filter_map(|i| robot.chain.joint(i).copied()).collect();
    joints[0] = ChainJoint { kind: JointKind::Prismatic, axis: Vector3::y_axis(), offset: 0.0, ..joints[0] };
    robot.chain = Chain::new(&joints).expect("a chain");
    robot
}

fn piper() -> Robot {
    Robot::load(&config("robots/piper.toml")).expect("shipped")
}

fn free() -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() }
}

/// The tip's z axis within an angle of straight down.
fn down(deg: f64) -> TipConstraints {
    let upright =
        Upright { tip_axis: [0.0, 0.0, 1.0], direction: [0.0, 0.0, -1.0], tolerance_rad: deg.to_radians() };
    TipConstraints { upright: Some(upright), ..TipConstraints::default() }
}

/// The tip's y axis within an angle of straight up: a glass that is held from the side.
fn up(deg: f64) -> TipConstraints {
    let upright =
        Upright { tip_axis: [0.0, 1.0, 0.0], direction: [0.0, 0.0, 1.0], tolerance_rad: deg.to_radians() };
    TipConstraints { upright: Some(upright), ..TipConstraints::default() }
}

/// A random pose whose tip is upright, or nearly: turned about x by `lean_rad` from where its z axis points up; beside another one on the same branch of poses, where there is one:
/// while the tip is upright, elbow and wrist of an arm with six joints cannot go to the other side.
fn upright_pose(
    robot: &Robot,
    rng: &mut SeededRng,
    ([near_m, far_m], lean_rad, beside): ([f64; 2], f64, Option<&JointArray>),
) -> Option<JointArray> {
    let (angle, far) = (rng.within(-3.0, 3.0), rng.within(near_m, far_m));
    let position_m = [far * angle.cos(), far * angle.sin(), rng.within(0.1, 0.4)];
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rng.within(-3.0, 3.0))
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lean_rad + rng.within(-0.05, 0.05));
    let orientation = Some(Orientation { rotation, tolerance_rad: [0.0; 3] });
    let target = TipTarget { orientation, ..TipTarget::position(position_m) };
    let mut guess = [0.0; MAX_JOINTS];
    for (q, joint) in guess.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *q = rng.within(low.max(-2.5), high.min(2.5));
    }
    if let Some(beside) = beside {
        guess = std::array::from_fn(|j| beside[j] + 0.2 * guess[j]);
        guess[0] = rng.within(-2.5, 2.5);
    }
    let pose = Inverse::new(robot, &target, far_m).polish(&guess);
    let is_near = beside.is_none_or(|beside| {
        let sides = [2, 4].iter().all(|j| beside[*j] * pose[*j] > 0.0 && pose[*j].abs() > 0.2);
        sides && beside.iter().zip(&pose).all(|(a, b)| (a - b).abs() < 3.0)
    });
    (is_near && target.is_reached(&target.error(robot, &pose))).then_some(pose)
}

fn options(seed: u64, constraints: TipConstraints) -> PlanOptions {
    PlanOptions { seed, constraints, deadline: Duration::from_secs(4), ..PlanOptions::default() }
}

/// Goal: whatever the arm, the scene and the seed, a motion that is planned keeps its constraints at each of thousands of instants,
/// and nearly every problem is solved. Most straight lines do not keep them.
#[test]
fn motions_keep_tip_upright_above_and_slow_at_every_instant() {
    let arms = [
        ("ur5", ur5(), [0.35, 0.7], (FRAC_PI_2, up(4.0)), true),
        ("piper", piper(), [0.2, 0.4], (PI, down(15.0)), false),
        ("seven", seven_joints(), [0.35, 0.6], (PI, down(6.0)), false),
        ("rail", on_a_rail(), [0.35, 0.6], (PI, down(8.0)), false),
    ];
    let mut all_bent = 0;
    for (name, robot, reach_m, (lean_rad, upright), spheres) in arms {
        let mut rng = SeededRng::new(11, 5);
        let (mut asked, mut solved, mut bent, mut seed) = (0, 0, 0, 0);
        while asked < 14 && seed < 3_000 {
            seed += 1;
            let scene = if spheres { random_spheres(&mut rng) } else { free() };
            let Some(start) = upright_pose(&robot, &mut rng, (reach_m, lean_rad, None)) else { continue };
            let beside = (reach_m, lean_rad, Some(&start));
            let Some(goal) = upright_pose(&robot, &mut rng, beside) else { continue };
            let inside =
                TipBox { low_m: [f64::NEG_INFINITY, f64::NEG_INFINITY, 0.05], high_m: [f64::INFINITY; 3] };
            let constraints =
                TipConstraints { inside: Some(inside), speed_m_s: (seed % 2 == 0).then_some(0.3), ..upright };
            let found = plan(&robot, &scene, &start, &goal, &options(seed, constraints));
            let found = match found {
                Ok(found) => found,
                Err(
                    PlanError::InCollision { .. }
                    | PlanError::InsideMargin { .. }
                    | PlanError::Constraint { .. }
                    | PlanError::OutsideLimits { .. },
                ) => continue,
                Err(error) => {
                    asked += 1;
                    println!("{name} {seed}: {error}");
                    continue;
                }
            };
            asked += 1;
            solved += 1;
            bent += u32::from(!found.how.starts_with("straight line"));
            let over = excess(&robot, &constraints, &found.trajectory, 0.0);
            assert!(over.iter().all(|over| *over <= 1e-9), "{name} {seed}: {over:?} over, {}", found.how);
            let used = found.tip_use.expect("constraints have a use");
            let allowed_rad = upright.upright.map_or(0.0, |upright| upright.tolerance_rad);
            assert!(used.tilt_rad.is_some_and(|tilt| tilt <= allowed_rad), "{used:?}");
            assert!(
                verify_keeping(&robot, &scene, (&found.trajectory, &constraints)).is_ok(),
                "{name} {seed}"
            );
        }
        println!("{name}: {solved} of {asked} solved, {bent} of them not straight");
        assert!(asked == 14 && solved >= 12, "{name}: {solved} of {asked}");
        all_bent += bent;
    }
    assert!(all_bent >= 4, "only {all_bent} motions had to leave the straight line");
}

/// Poses of a UR5 that both point down, between which the straight line tilts the tip by far more than a few degrees.
fn ends() -> [JointArray; 2] {
    let pose = |values: [f64; 6]| common::pose(values);
    [pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]), pose([1.2, -0.8, 1.9, -2.67, -1.57, 0.9])]
}

/// Goal: a start, goal or way point that violates is refused with place, value and limit; so is what makes no sense.
#[test]
fn what_violates_or_makes_no_sense_is_refused_with_place_value_and_limit() {
    let (robot, scene, [start, goal]) = (ur5(), free(), ends());
    let refusal = |start: &JointArray, goal: &JointArray, asked: TipConstraints| {
        plan(&robot, &scene, start, goal, &options(1, asked))
            .map(|plan| plan.how)
            .expect_err("must be refused")
    };
    let mut tilted = goal;
    tilted[3] += 0.5;
    for (a, b, which) in [(&tilted, &goal, PoseOf::Start), (&start, &tilted, PoseOf::Goal)] {
        let error = refusal(a, b, down(10.0));
        let PlanError::Constraint { which: found, fault: TipFault::Tilted { angle_rad, .. } } = &error else {
            panic!("{error}")
        };
        assert_eq!(*found, which);
        assert!((angle_rad.to_degrees() - 28.6).abs() < 2.0, "{error}");
        assert!(error.to_string().contains("10.000 deg allowed"), "{error}");
    }
    let through = plan_through(&robot, &scene, &[start, tilted, goal], &options(1, down(10.0)));
    assert!(matches!(through, Err(PlanError::Constraint { which: PoseOf::Via(0), .. })), "{through:?}");
    let above = |z: f64| TipConstraints {
        inside: Some(TipBox { low_m: [f64::NEG_INFINITY, f64::NEG_INFINITY, z], high_m: [f64::INFINITY; 3] }),
        ..TipConstraints::default()
    };
    let error = refusal(&start, &goal, above(0.7)).to_string();
    assert!(error.contains("start") && error.contains("tip's z is") && error.contains("0.7 m"), "{error}");
    let bad = [
        TipConstraints { tip: 1, ..down(10.0) },
        down(f64::NAN),
        down(0.0),
        above(f64::NAN),
        TipConstraints { speed_m_s: Some(-1.0), ..TipConstraints::default() },
        TipConstraints { speed_m_s: Some(f64::NAN), ..TipConstraints::default() },
    ];
    for asked in bad {
        assert!(matches!(refusal(&start, &goal, asked), PlanError::Constraints(_)), "{asked:?}");
    }
    for name in ["rrt", "rbf", "bfo", "iwo"] {
        let planner = PlannerKind::from_name(name).expect("known");
        let named = PlanOptions { planner, ..options(1, down(10.0)) };
        let error = plan(&robot, &scene, &start, &goal, &named).expect_err("must be refused").to_string();
        assert!(error.contains(name) && error.contains("rrt-connect"), "{error}");
    }
}

/// Goal: what the way points keep is kept between them, too: the straight line that violates is not taken, and not proven.
#[test]
fn straight_line_that_violates_between_its_ends_is_not_taken() {
    let (robot, scene) = (ur5(), free());
    let (start, mut goal) = (ends()[0], ends()[0]);
    // The same tip, another branch: elbow and wrist go the other way.
    goal[0] += 1.0;
    goal[4] += PI - 1e-3;
    goal[3] += PI - 1e-3;
    goal[5] += 1.5;
    let asked = down(15.0);
    let plain = plan(&robot, &scene, &start, &goal, &options(1, TipConstraints::default())).expect("free");
    let over = excess(&robot, &asked, &plain.trajectory, 0.0);
    assert!(over[0] > 0.2, "{over:?}");
    let violation = verify_keeping(&robot, &scene, (&plain.trajectory, &asked)).expect_err("it violates");
    assert!(violation.to_string().contains("at t ="), "{violation}");
    let straight = PlanOptions { planner: PlannerKind::Straight, ..options(1, asked) };
    let error = plan(&robot, &scene, &start, &goal, &straight).expect_err("no straight line").to_string();
    assert!(error.contains("deg from its direction"), "{error}");
    // Near its end a motion may violate for some milliseconds only.
    let slightly = down((over[0] + 15.0_f64.to_radians()).to_degrees() - 1e-4);
    assert!(
        verify_keeping(&robot, &scene, (&plain.trajectory, &slightly)).is_err(),
        "missed a short violation"
    );
}

/// Goal: the tip keeps the speed limit of the whole motion, rounded corners included, and the limit is made use of.
#[test]
fn speed_limit_of_tip_is_kept_and_used() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let (start, goal) = (ends()[0], common::pose([1.2, -1.3, 1.4, -1.6, -1.57, 0.0]));
    for limit_m_s in [0.05, 0.25, 1.0] {
        let asked = TipConstraints { speed_m_s: Some(limit_m_s), ..TipConstraints::default() };
        let found = plan(&robot, &scene, &start, &goal, &options(3, asked)).expect("a motion");
        let over = excess(&robot, &asked, &found.trajectory, 0.0);
        assert!((-0.1..=1e-6).contains(&over[2]), "{limit_m_s}: {over:?}");
    }
}

/// Goal: inside a zone the tip is slow; without constraints of its own a motion keeps the zones of its scene, and `verify` knows them.
#[test]
fn zones_of_the_scene_are_kept_by_every_motion() {
    let (robot, [start, goal]) = (ur5(), ends());
    let open = PlanOptions::default();
    let fast = plan(&robot, &free(), &start, &goal, &open).expect("free");
    let centre = tip(&robot, &fast.trajectory.sample(0.5 * fast.trajectory.duration_s()).position_rad).1;
    let text = format!(
        "[[zone]]\nname = \"bench\"\ncenter_m = [{}, {}, {}]\nsize_m = [0.3, 0.4, 0.8]\nspeed_m_s = 0.1\n",
        centre.x, centre.y, centre.z
    );
    let zoned = Scene::from_toml(Path::new("zoned.toml"), &text).expect("a scene");
    let violation = verify(&robot, &zoned, &fast.trajectory).expect_err("too fast in the zone").to_string();
    assert!(violation.contains("of zone bench"), "{violation}");
    let slow = plan(&robot, &zoned, &start, &goal, &open).expect("slower");
    verify(&robot, &zoned, &slow.trajectory).expect("it keeps the zone");
    let (mut inside, mut outside, step_s) =
        (0.0_f64, 0.0_f64, slow.trajectory.duration_s() / f64::from(INSTANTS));
    let at = |i: u32| tip(&robot, &slow.trajectory.sample(step_s * f64::from(i)).position_rad).1;
    for i in 0..INSTANTS {
        let (a, b) = (at(i), at(i + 1));
        let is_in = |p: &Vector3<f64>| {
            let off = (p - centre).abs();
            off.x <= 0.15 && off.y <= 0.2 && off.z <= 0.4
        };
        let speed = (b - a).norm() / step_s;
        if is_in(&a) && is_in(&b) {
            inside = inside.max(speed);
        } else if !is_in(&a) && !is_in(&b) {
            outside = outside.max(speed);
        }
    }
    assert!(inside > 0.08 && inside <= 0.1 + 1e-6, "inside {inside} m/s, outside {outside} m/s");
}

/// Goal: a goal of the tip ends upright where only that is asked for; one that cannot is refused with the constraint.
#[test]
fn goals_of_the_tip_are_reached_as_the_tip_must_be() {
    let (robot, scene) = (ur5(), free());
    let situation =
        Situation { robot: &robot, scene: &scene, start_rad: ends()[0], margin: StartMargin::Scene };
    for (i, at) in [[0.4, -0.3, 0.35], [-0.4, 0.3, 0.2], [0.2, 0.5, 0.5]].into_iter().enumerate() {
        let asked = down(5.0);
        let target = TipTarget::position(at);
        let found = plan_to_tip(&situation, (&target, Finder::Inverse), &options(i as u64, asked), None)
            .unwrap_or_else(|error| panic!("{at:?}: {error}"));
        assert!(excess(&robot, &asked, &found.plan.trajectory, 0.0)[0] <= 1e-9, "{at:?}");
        assert!(found.error.position_m <= 1e-5, "{at:?}: {:?}", found.error);
    }
    let low = TipTarget::position([0.4, -0.3, 0.1]);
    let above = TipConstraints {
        inside: Some(TipBox { low_m: [-2.0, -2.0, 0.2], high_m: [2.0; 3] }),
        ..TipConstraints::default()
    };
    let refused = plan_to_tip(&situation, (&low, Finder::Inverse), &options(1, above), None);
    assert!(matches!(refused, Err(GoalError::NoKeptPose { .. })), "{refused:?}");
    // A straight line keeps them, or is refused.
    let line = |to: [f64; 3], asked: TipConstraints| {
        let budget = taustream_planner::budget::Budget::unbounded();
        plan_line_keeping(&situation, &TipTarget::position(to), (&TipSpeed::default(), &asked), &budget)
            .map_err(Box::new)
    };
    let slow = TipConstraints { speed_m_s: Some(0.1), ..down(5.0) };
    let found = line([0.45, -0.3, 0.35], slow).expect("a line");
    let over = excess(&robot, &slow, &found.imported.trajectory, 0.0);
    assert!(over[0] <= 1e-9 && over[2] <= 1e-6, "{over:?}");
    let refused = line([0.4, -0.3, 0.15], above).map(|_| ()).map_err(|error| *error);
    assert!(matches!(refused, Err(LineError::Constraint(_))), "{refused:?}");
}

/// Goal: a motion that replaces a running one keeps its constraints from the cut on, or begins where that one ends.
#[test]
fn replacement_keeps_constraints_from_the_cut_or_from_the_end_on() {
    let (robot, scene, [start, goal]) = (ur5(), free(), ends());
    let running = plan(&robot, &scene, &start, &goal, &PlanOptions::default()).expect("free").trajectory;
    let (cancel, asked) = (AtomicBool::new(false), TipConstraints { speed_m_s: Some(0.2), ..down(10.0) });
    let surroundings = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let cut = |at_s: f64| CutPoint {
        trajectory_id: 1,
        trajectory: Some(running.clone()),
        at_s,
        from_s: at_s,
        end_s: running.duration_s(),
        end_rad: running.end_rad(),
    };
    let options = options(1, asked);
    let direct = surroundings.direct((&cut(0.3), &[start]), &options);
    assert!(
        matches!(direct, Err(NoReplacement::Unproven(Violation::Constraint(_)))),
        "the arm is too fast at the cut: {direct:?}"
    );
    let after =
        surroundings.after_end((&cut(running.duration_s()), &[start]), &options).expect("after the end");
    let over = excess(&robot, &asked, &after.trajectory, running.duration_s());
    assert!(over[0] <= 1e-9 && over[2] <= 1e-6, "{over:?}");
}

/// Goal: in a scene with an obstacle in between, too, searches keep the box.
#[test]
fn box_is_kept_round_an_obstacle() {
    let (robot, [start, goal]) = (ur5(), ends());
    let straight = plan(&robot, &free(), &start, &goal, &PlanOptions::default()).expect("free").trajectory;
    let middle = tip(&robot, &straight.sample(0.5 * straight.duration_s()).position_rad).1;
    let scene = Scene { obstacles: vec![sphere("ball", middle.into(), 0.06)], ..free() };
    let inside = TipBox { low_m: [-0.9, -0.9, -0.1], high_m: [0.9, 0.9, 0.55] };
    let asked = TipConstraints { inside: Some(inside), ..down(20.0) };
    let mut solved = 0;
    for seed in 0..6 {
        let found: Result<Plan, PlanError> = plan(&robot, &scene, &start, &goal, &options(seed, asked));
        let found = match found {
            Ok(found) => found,
            Err(error) => {
                println!("{seed}: {error}");
                continue;
            }
        };
        solved += 1;
        let over = excess(&robot, &asked, &found.trajectory, 0.0);
        assert!(over.iter().take(2).all(|over| *over <= 1e-9), "{seed}: {over:?}");
    }
    assert!(solved >= 5, "{solved} of 6");
}
