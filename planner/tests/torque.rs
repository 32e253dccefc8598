//! Motions that drives can bear, and those that they cannot; and which of the plans by time and by energy is better.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use std::path::Path;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::torque::{TorqueLimits, Unchecked};
use taustream_planner::{Objective, Plan, PlanOptions, Violation, plan, verify};

/// One joint that swings a point of 2 kg at 0.5 m in a vertical plane: 0.5 kg m^2, and 9.80665 Nm where it is level.
const PENDULUM: &str = r#"
name = "pendulum"
[[joint]]
name = "swing"
dh = { a_m = 0.5, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }
link_radius_m = 0.01
link_mass_kg = 2.0
link_center_m = [0.0, 0.0, 0.0]
position_rad = [-3.0, 3.0]
motion = { velocity_rad_s = 5.0, acceleration_rad_s2 = 60.0, jerk_rad_s3 = 3000.0 }
TORQUE
gravity_m_s2 = [0.0, -9.80665, 0.0]
"#;
const HOLDING_NM: f64 = 9.806_65;

fn pendulum(torque: &str) -> Robot {
    let (head, gravity) = PENDULUM.split_once("gravity_m_s2").expect("gravity");
    let text = format!("gravity_m_s2{gravity}{}", head.replace("TORQUE", torque));
    Robot::from_toml(Path::new("pendulum.toml"), &text).expect("a robot")
}

fn empty() -> Scene {
    Scene::from_toml(Path::new("empty.toml"), "margin_m = 0.01").expect("a scene")
}

fn pose(rad: f64) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose[0] = rad;
    pose
}

fn swing(robot: &Robot) -> Plan {
    plan(robot, &empty(), &pose(-1.0), &pose(1.0), &PlanOptions::default()).expect("a motion")
}

/// Goal: a motion that its drive cannot bear is named, with joint, instant, torque and limit, and a plan is timed so that it
/// can; without stated torques nothing changes.
#[test]
fn motion_beyond_a_torque_is_named_by_verify_and_timed_slower_by_plan() {
    let free = pendulum("");
    let fast = swing(&free);
    let needs =
        TorqueLimits::of(&pendulum("torque_nm_max = 1000.0")).expect("limits").prove(&fast.trajectory);
    let needs_nm = needs.expect("a thousand are enough")[0].torque_nm;
    assert!(needs_nm > 20.0, "the plan by the motion limits needs {needs_nm} Nm");

    let weak = pendulum("torque_nm_max = 15.0");
    let refused = verify(&weak, &empty(), &fast.trajectory).expect_err("15 Nm are too little");
    let Violation::Torque(overload) = &refused else { panic!("{refused}") };
    assert_eq!((overload.joint, overload.name.as_str(), overload.limit_nm), (0, "swing", 15.0));
    assert!((overload.torque_nm - needs_nm).abs() < 1e-9, "{} and {needs_nm}", overload.torque_nm);
    assert!(refused.to_string().contains("move slower"), "{refused}");

    let slow = swing(&weak);
    assert!(slow.proof.duration_s > 1.05 * fast.proof.duration_s, "{} s", slow.proof.duration_s);
    verify(&weak, &empty(), &slow.trajectory).expect("what plan made is borne");
    // Not slower than it must: within a few percent of what the drive can.
    let used = TorqueLimits::of(&weak).expect("limits").prove(&slow.trajectory).expect("borne")[0].torque_nm;
    assert!(used > 0.93 * 15.0, "{used} of 15 Nm");
    assert_eq!(swing(&pendulum("torque_nm_max = 1000.0")).trajectory, fast.trajectory);
}

#[test]
fn motion_that_no_speed_makes_bearable_is_refused_with_what_to_do() {
    let weak = pendulum("torque_nm_max = 9.0");
    let options = PlanOptions { deadline: Duration::from_millis(200), ..PlanOptions::default() };
    let error = plan(&weak, &empty(), &pose(-1.0), &pose(1.0), &options).expect_err("gravity");
    let error = error.to_string();
    for part in ["joint 1 (swing)", "no speed helps", "its 9.0 Nm"] {
        assert!(error.contains(part), "{part}: {error}");
    }
    // Where gravity asks for less, the same arm moves.
    plan(&weak, &empty(), &pose(-1.4), &pose(-1.0), &PlanOptions::default()).expect("less than 9 Nm there");
    assert!(HOLDING_NM > 9.0 && HOLDING_NM * 1.0_f64.cos() < 9.0);
}

#[test]
fn torques_are_not_checked_without_limits_or_with_masses_that_cannot_be_right() {
    assert_eq!(TorqueLimits::of(&pendulum("")).err(), Some(Unchecked::NoLimits));
    let light = pendulum("torque_nm_max = 1.0");
    let text = PENDULUM
        .replace("link_mass_kg = 2.0", "link_mass_kg = 0.001")
        .replace("TORQUE", "torque_nm_max = 1.0");
    let (head, gravity) = text.split_once("gravity_m_s2").expect("gravity");
    let feather =
        Robot::from_toml(Path::new("p.toml"), &format!("gravity_m_s2{gravity}{head}")).expect("a robot");
    let doubt = TorqueLimits::of(&feather).expect_err("a gram").to_string();
    assert!(doubt.contains("TOO SMALL") && doubt.contains("0.001 kg"), "{doubt}");
    assert!(TorqueLimits::of(&light).is_ok());
    // Then a motion is verified as before.
    let motion = swing(&pendulum("")).trajectory;
    verify(&feather, &empty(), &motion).expect("not checked");
}

/// Goal: torques between the instants that a plan looks at stay inside: 0.99 of the torque at 200 Hz is all of it at 1 kHz.
#[test]
fn planned_motions_keep_the_torque_between_the_instants_too() {
    for torque_nm in [10.5, 12.0, 20.0, 27.0] {
        let robot = pendulum(&format!("torque_nm_max = {torque_nm}"));
        let motion = swing(&robot).trajectory;
        verify(&robot, &empty(), &motion).unwrap_or_else(|violation| panic!("{torque_nm} Nm: {violation}"));
    }
}

#[test]
fn a_stroke_of_a_known_inertia_needs_the_torque_of_its_closed_form() {
    let level = PENDULUM.replace("-9.80665, 0.0]", "0.0, 0.0]").replace("TORQUE", "torque_nm_max = 1000.0");
    let (head, gravity) = level.split_once("gravity_m_s2").expect("gravity");
    let robot =
        Robot::from_toml(Path::new("p.toml"), &format!("gravity_m_s2{gravity}{head}")).expect("a robot");
    let stroke = Stroke { start_s: 0.0, duration_s: 1.0, n: 10, delta_rad: pose(1.0) };
    let motion = Trajectory::new(1, pose(0.0), &[stroke]).expect("a motion");
    let peaks = TorqueLimits::of(&robot).expect("limits").prove(&motion).expect("borne");
    // The peak of the acceleration of Tau-J* with n = 10 is 14.43764 of distance over time squared.
    assert!((peaks[0].torque_nm - 0.5 * 14.437_64).abs() < 1e-3, "{} Nm", peaks[0].torque_nm);
    assert!((peaks[0].at_s - 0.674_662).abs() < 2e-3, "{} s", peaks[0].at_s);
}

/// Goal: with the same options a plan by energy takes no more work than the plan by time, and the plan by time no more time
/// than the plan by energy: with and without a deadline, with the improvement and with a method.
#[test]
fn plan_by_energy_takes_no_more_work_and_plan_by_time_no_more_time() {
    let ur5 = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
    let robot = Robot::load(&ur5).expect("the shipped robot");
    let pillars = "margin_m = 0.02\n[[box]]\nname = \"wall\"\ncenter_m = [0.45, 0.0, 0.3]\nsize_m = [0.1, 0.1, 0.6]\nrpy_rad = [0.0, 0.0, 0.0]\n";
    let scene = Scene::from_toml(Path::new("wall.toml"), pillars).expect("a scene");
    let [start, goal] =
        [[-0.8, -0.9, 1.2, -1.8, -1.57, 0.0], [0.8, -0.9, 1.2, -1.8, -1.57, 0.0]].map(|q: [f64; 6]| {
            let mut pose = [0.0; MAX_JOINTS];
            pose[..6].copy_from_slice(&q);
            pose
        });
    for (seed, spends_deadline, [from, to]) in
        [(0, false, [start, goal]), (1, true, [start, goal]), (2, true, [goal, start])]
    {
        let of = |objective| {
            let deadline = Duration::from_millis(400);
            let options = PlanOptions {
                seed,
                deadline,
                objective,
                spends_deadline,
                keeps_deadline: false,
                ..PlanOptions::default()
            };
            plan(&robot, &scene, &from, &to, &options).expect("a motion")
        };
        let [by_time, by_energy] = [Objective::Time, Objective::Energy].map(of);
        let [time_j, energy_j] = [&by_time, &by_energy].map(|plan| plan.energy_j.expect("masses"));
        assert!(energy_j <= time_j, "seed {seed}: {energy_j} J by energy, {time_j} J by time");
        let [time_s, energy_s] = [&by_time, &by_energy].map(|plan| plan.proof.duration_s);
        assert!(time_s <= energy_s * (1.0 + 1e-9), "seed {seed}: {time_s} s by time, {energy_s} s by energy");
    }
}
