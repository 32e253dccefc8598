//! Torques and energies against closed forms, an independent program, and the balance of energy; and energy as objective.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
mod common;

use common::{config, pose, scene, ur5};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::time::Duration;
use taustream_arm::{LinkMass, Robot, Scene};
use taustream_motion::chain::{Chain, ChainJoint};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS, Stroke, Trajectory, joint_array};
use taustream_optimizers::papers::two_link::{Moving, TwoLink};
use taustream_planner::energy::Energy;
use taustream_planner::margin_exit::is_clear;
use taustream_planner::objective::Evaluator;
use taustream_planner::rng::SeededRng;
use taustream_planner::world::World;
use taustream_planner::{Objective, Plan, PlanError, PlanOptions, plan};

fn close(what: &str, ours: f64, theirs: f64, relative: f64) {
    assert!((ours - theirs).abs() <= relative * theirs.abs().max(1.0), "{what}: {ours} against {theirs}");
}

/// A robot of as many joints as rows, whose chain and masses tests replace.
fn robot(joints: usize) -> Robot {
    let joint = |i: usize| {
        format!(
            "[[joint]]\nname = \"j{i}\"\nlink_radius_m = 0.0\nposition_rad = [-20, 20]\n\
             dh = {{ a_m = 1.0, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }}\n\
             motion = {{ velocity_rad_s = 3, acceleration_rad_s2 = 10, jerk_rad_s3 = 100 }}\n"
        )
    };
    let text = format!("name = \"r\"\n{}", (0..joints).map(joint).collect::<String>());
    Robot::from_toml(Path::new("r.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"))
}

/// An even rod along an axis of its frame, ending in the frame's origin.
fn rod(frame: usize, mass_kg: f64, length_m: f64, along: Vector3<f64>) -> LinkMass {
    let across = Matrix3::identity() - along * along.transpose();
    LinkMass {
        link: frame,
        frame,
        mass_kg,
        center_m: Point3::from(along * (-0.5 * length_m)),
        inertia_kg_m2: across * (mass_kg * length_m * length_m / 12.0),
    }
}

/// The arm of Sengupta et al. (2011) as a chain: its second link keeps its level by a joint without mass that turns back.
fn two_link(arm: &TwoLink) -> Robot {
    let [first_m, second_m] = arm.lengths;
    let joint = |axis, post: Vector3<f64>| ChainJoint {
        kind: JointKind::Revolute,
        pre: Isometry3::identity(),
        axis,
        offset: 0.0,
        post: Isometry3::translation(post.x, post.y, post.z),
    };
    let mut robot = robot(3);
    // θ swings from z towards y, that is about -x.
    robot.chain = Chain::new(&[
        joint(-Vector3::x_axis(), Vector3::z() * first_m),
        joint(Vector3::x_axis(), Vector3::zeros()),
        joint(Vector3::z_axis(), Vector3::x() * second_m),
    ])
    .expect("three joints");
    let [first_kg, second_kg] = arm.masses;
    robot.masses = vec![rod(1, first_kg, first_m, Vector3::z()), rod(3, second_kg, second_m, Vector3::x())];
    robot.gravity_m_s2 = Vector3::new(0.0, 0.0, -arm.gravity);
    robot
}

#[test]
fn torques_and_energy_of_the_papers_two_link_arm_are_its_closed_forms() {
    let arm = TwoLink { masses: [1.3, 0.7], lengths: [5.0, 4.0], ..TwoLink::PAPER_004 };
    let robot = two_link(&arm);
    let dynamics = robot.dynamics().expect("masses");
    let base_j = arm.gravity * arm.height * (arm.masses[0] + arm.masses[1]);
    for seed in 0..200 {
        let mut rng = SeededRng::new(seed, 70);
        let mut two = |size: f64| [rng.within(-size, size), rng.within(-size, size)];
        let moving = Moving { angle_rad: two(1.5), speed_rad_s: two(2.0), acceleration_rad_s2: two(5.0) };
        let joints = |[theta, phi]: [f64; 2]| joint_array([theta, theta, phi, 0.0, 0.0, 0.0]);
        let (q, v, a) =
            (joints(moving.angle_rad), joints(moving.speed_rad_s), joints(moving.acceleration_rad_s2));
        let (ours, theirs) = (dynamics.torques_nm(&q, &v, &a), arm.torques(&moving));
        // Both joints that θ moves work along it.
        close("torque of θ", ours[0] + ours[1], theirs[0], 1e-12);
        close("torque of φ", ours[2], theirs[1], 1e-12);
        let ([kinetic, potential], [paper_kinetic, paper_potential]) =
            (dynamics.energy_j(&q, &v), arm.energy(&moving));
        close("kinetic energy", kinetic, paper_kinetic, 1e-12);
        close("potential energy", potential, paper_potential - base_j, 1e-12);
    }
}

/// A UR5 with the moments of inertia of `tests/oracles/dynamics.py`.
fn heavy_ur5() -> Robot {
    const MOMENTS: [[f64; 6]; 6] = [
        [0.02, 0.018, 0.011, 0.001, -0.002, 0.0015],
        [0.03, 0.25, 0.24, 0.0, 0.01, 0.0],
        [0.01, 0.06, 0.058, 0.002, 0.0, -0.003],
        [0.002, 0.0022, 0.0018, 0.0, 0.0, 0.0002],
        [0.002, 0.0022, 0.0018, 0.0001, 0.0, -0.0002],
        [0.0001, 0.0001, 0.000_15, 0.0, 0.0, 0.0],
    ];
    let file = config("robots/ur5.toml");
    let shipped = std::fs::read_to_string(&file).expect("shipped");
    let mut parts = shipped.split("link_mass_kg");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for (part, moments) in parts.zip(MOMENTS) {
        text.push_str(&format!("link_inertia_kg_m2 = {moments:?}\nlink_mass_kg{part}"));
    }
    Robot::from_toml(&file, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

#[test]
fn torques_and_energies_of_a_ur5_agree_with_the_python_program_by_lagrange() {
    let mut robot = heavy_ur5();
    let lines = include_str!("oracles/dynamics.txt").lines();
    let mut compared = 0;
    for line in lines {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().expect("a number")).collect();
        let (gravity, rest) = numbers.split_at(3);
        robot.gravity_m_s2 = Vector3::from_column_slice(gravity);
        let of = |i: usize| pose(rest[6 * i..6 * i + 6].try_into().expect("six"));
        let dynamics = robot.dynamics().expect("masses");
        let torques = dynamics.torques_nm(&of(0), &of(1), &of(2));
        for (ours, theirs) in torques.iter().zip(of(3)) {
            close("torque", *ours, theirs, 1e-11);
        }
        let energy = dynamics.energy_j(&of(0), &of(1));
        close("kinetic energy", energy[0], rest[24], 1e-12);
        close("potential energy", energy[1], rest[25], 1e-12);
        compared += 1;
    }
    assert_eq!(compared, 12);
}

/// Goal: a fault in the moments, the masses or gravity shows in the comparison above.
#[test]
fn torques_change_with_every_part_of_the_description() {
    let (right, q, v) =
        (heavy_ur5(), pose([0.1, -0.7, 1.1, 0.3, -0.4, 0.2]), pose([1.0, -2.0, 0.5, 1.5, 0.7, -3.0]));
    let torques = |robot: &Robot| robot.dynamics().expect("masses").torques_nm(&q, &v, &v);
    let change = |doctor: &dyn Fn(&mut Robot)| {
        let mut robot = right.clone();
        doctor(&mut robot);
        let pairs = torques(&right).into_iter().zip(torques(&robot));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(change(&|_| ()) == 0.0);
    for (i, _) in right.masses.iter().enumerate() {
        assert!(change(&|r| r.masses[i].mass_kg *= 1.01) > 1e-8, "mass {i}");
        assert!(change(&|r| r.masses[i].center_m.x += 0.001) > 1e-8, "centre {i}");
        assert!(change(&|r| r.masses[i].inertia_kg_m2 *= 1.1) > 1e-6, "moments {i}");
    }
    assert!(change(&|r| r.gravity_m_s2.x += 0.1) > 1e-3);
    let carry = LinkMass {
        link: 6,
        frame: 6,
        mass_kg: 1.0,
        center_m: Point3::origin(),
        inertia_kg_m2: Matrix3::zeros(),
    };
    assert!(change(&|r| r.masses.push(carry)) > 1e-2, "a payload");
}

/// Instants of the sums that the planner's integrals are compared with.
const STEPS: u32 = 4_000;

fn one_stroke(base_rad: JointArray, delta_rad: JointArray, joints: usize, duration_s: f64) -> Trajectory {
    Trajectory::new(joints, base_rad, &[Stroke { start_s: 0.0, duration_s, n: 6, delta_rad }]).expect("sound")
}

/// Goal: what the joints give, signs counted, is what the arm has more of, at every instant of a motion.
#[test]
fn work_of_the_joints_is_the_change_of_kinetic_and_potential_energy() {
    let robot = heavy_ur5();
    let (dynamics, spent) = (robot.dynamics().expect("masses"), Energy::of(&robot).expect("masses"));
    let motion =
        one_stroke(pose([0.3, -1.2, 0.8, -0.4, 0.9, 0.1]), pose([2.0, 1.5, -1.8, 0.7, -2.0, 1.0]), 6, 1.7);
    let energy = |t_s: f64| -> f64 {
        let at = motion.sample(t_s);
        dynamics.energy_j(&at.position_rad, &at.velocity_rad_s).iter().sum()
    };
    let step_s = motion.duration_s() / f64::from(STEPS);
    let (mut given, mut size) = (0.0, 0.0);
    for i in 0..STEPS {
        let at = motion.sample((f64::from(i) + 0.5) * step_s);
        let torques = dynamics.torques_nm(&at.position_rad, &at.velocity_rad_s, &at.acceleration_rad_s2);
        let power: f64 = torques.iter().zip(&at.velocity_rad_s).map(|(t, v)| t * v).sum();
        given += power * step_s;
        size += spent.power_w(&at.position_rad, &at.velocity_rad_s, &at.acceleration_rad_s2) * step_s;
        if i % 400 == 399 {
            close("given", given, energy(f64::from(i + 1) * step_s) - energy(0.0), 1e-5);
        }
    }
    close("spent", spent.spent_j(&motion), size, 1e-4);
    assert!(size > 2.0 * given.abs(), "the motion must brake and lift to show anything: {size} and {given}");
}

#[test]
fn spent_energy_of_one_joint_is_its_closed_form() {
    let (mass_kg, length_m, turn_rad, duration_s) = (2.0, 1.0, 1.9, 1.3);
    let mut robot = robot(1);
    robot.masses = vec![rod(1, mass_kg, length_m, Vector3::x())];
    // Without gravity all energy is that of the fastest instant: given once, and braked away once.
    robot.gravity_m_s2 = Vector3::zeros();
    let mut distance = [0.0; MAX_JOINTS];
    distance[0] = turn_rad;
    let motion = one_stroke([0.0; MAX_JOINTS], distance, 1, duration_s);
    // c_v of n = 6: s^4 = 3 / 23.
    let s = (3.0_f64 / 23.0).powf(0.25);
    let fastest_rad_s = 24.0 * s.powi(3) * (1.0 - s.powi(4)).powi(5) * turn_rad / duration_s;
    let kinetic_j = 0.5 * mass_kg * length_m * length_m / 3.0 * fastest_rad_s * fastest_rad_s;
    let spent_j = Energy::of(&robot).expect("masses").spent_j(&motion);
    close("kinetic energy twice", spent_j, 2.0 * kinetic_j, 1e-5);
    // So slowly that only the weight counts: lifted from hanging to upright, and past it down again.
    robot.gravity_m_s2 = Vector3::new(0.0, -9.806_65, 0.0);
    let mut base = [0.0; MAX_JOINTS];
    (base[0], distance[0]) = (-FRAC_PI_2, 3.0 * FRAC_PI_2);
    let spent_j = Energy::of(&robot).expect("masses").spent_j(&one_stroke(base, distance, 1, 400.0));
    // Centre from -0.5 m to 0.5 m, and back to 0 m.
    close("weight", spent_j, mass_kg * 9.806_65 * (1.0 + 0.5), 1e-4);
}

fn chosen(robot: &Robot, scene: &Scene, ends: [JointArray; 2], objective: Objective, seed: u64) -> Plan {
    let deadline = Duration::from_secs(1);
    let options = PlanOptions { seed, deadline, objective, keeps_deadline: false, ..PlanOptions::default() };
    plan(robot, scene, &ends[0], &ends[1], &options)
        .unwrap_or_else(|e| panic!("{objective:?}, seed {seed}: {e}"))
}

/// Two random clear poses among obstacles.
fn ends(world: &World, seed: u64) -> [JointArray; 2] {
    let mut rng = SeededRng::new(seed, 90);
    let mut clear = || loop {
        let q: JointArray =
            std::array::from_fn(|j| if j < 6 { rng.within(-FRAC_PI_2, FRAC_PI_2) } else { 0.0 });
        if is_clear(world, &q) {
            return q;
        }
    };
    [clear(), clear()]
}

/// Goal: asked for less energy or less cost, plans have less of it than plans by time: together, and alone wherever the
/// straight line is free, which is a candidate by every measure.
#[test]
fn plans_by_energy_and_by_cost_have_less_of_it_than_plans_by_time() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let world = World::new(&robot, &scene).expect("builds");
    let (mut by_time_sum, mut by_measure_sum, mut lighter, mut slower) = ([0.0; 2], [0.0; 2], 0, 0);
    for seed in 0..16 {
        let ends = ends(&world, seed);
        let by_time = chosen(&robot, &scene, ends, Objective::Time, seed);
        for (i, objective) in [Objective::Energy, Objective::Cost].into_iter().enumerate() {
            let better = chosen(&robot, &scene, ends, objective, seed);
            let evaluator = Evaluator::new(objective, &robot).expect("masses");
            let of_time = evaluator.score(&by_time.trajectory, &by_time.proof);
            assert_eq!(better.score.to_bits(), evaluator.score(&better.trajectory, &better.proof).to_bits());
            if by_time.how.starts_with("straight line") {
                let who = format!("seed {seed}, {objective:?}");
                assert!(better.score <= of_time * (1.0 + 1e-12), "{who}: {} against {of_time}", better.score);
                assert!(by_time.proof.duration_s <= better.proof.duration_s, "{who}");
            }
            by_time_sum[i] += of_time;
            by_measure_sum[i] += better.score;
            lighter += u32::from(objective == Objective::Energy && better.score < 0.99 * of_time);
            slower += u32::from(by_time.proof.duration_s < better.proof.duration_s);
        }
    }
    for (measure, time) in by_measure_sum.iter().zip(by_time_sum) {
        assert!(*measure <= time, "{measure} against {time}");
    }
    assert!(lighter > 0 && slower > 0, "{lighter} plans of less energy, {slower} slower ones");
}

#[test]
fn energy_of_an_arm_without_masses_is_refused_with_what_to_do() {
    let piper = Robot::load(&config("robots/piper.toml")).expect("shipped");
    let empty = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() };
    let options = PlanOptions { objective: Objective::Energy, ..PlanOptions::default() };
    let ends = [pose([0.0, 0.5, -0.5, 0.0, 0.0, 0.0]), pose([0.0, 1.0, -1.0, 0.0, 0.0, 0.0])];
    let error = plan(&piper, &empty, &ends[0], &ends[1], &options).expect_err("no masses");
    assert!(matches!(error, PlanError::NoMasses(_)), "{error}");
    let words = error.to_string();
    assert!(
        words.contains("piper") && words.contains("link_mass_kg") && words.contains("by time"),
        "{words}"
    );
    assert!(piper.dynamics().is_err());
    let by_time = plan(&piper, &empty, &ends[0], &ends[1], &PlanOptions::default()).expect("a plan");
    assert_eq!(by_time.energy_j, None);
    for objective in Objective::ALL {
        assert_eq!(Objective::from_name(objective.name()), Some(objective));
    }
    assert_eq!(Objective::from_name("beauty"), None);
}
