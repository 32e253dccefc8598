//! Seeded problems: where an arm shall go, among what.
//!
//! A start is uniform in the joints' ranges; its goal is where a random walk from it ends, so that every problem has a
//! solution (of two uniform poses most lie in parts that do not hang together). The straight line between them is
//! blocked: where it is free, every planner of the product answers with it, and a comparison would compare nothing. How
//! many pairs were left out for that is counted.
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use taustream_arm::{Obstacle, Robot, Scene, Shape};
use taustream_motion::JointArray;
use taustream_motion::chain::Pose;
use taustream_planner::budget::Budget;
use taustream_planner::margin_exit::is_clear;
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::Space;
use taustream_planner::world::{Snapshot, World};

/// Pairs of poses that are drawn for one problem before it is given up.
const RETRIES_MAX: usize = 2_000;
/// Legs of the walk from a start to its goal.
const LEGS: usize = 8;
/// Steps of the walk, in metres of weighted distance: it turns this far before what blocks it, at most.
const LEG_STEP_M: f64 = 0.2;
/// Obstacles of a cluttered scene.
const CLUTTER: usize = 14;
/// What an arm can work in, as a share of the furthest that its tip can be from its first axis.
const WORKING_SHARE: f64 = 0.75;

/// Where obstacles come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Surroundings {
    /// A scene file.
    Given(Box<Scene>),
    /// Balls, boxes and posts at random places, others for every problem.
    Clutter,
    /// A cup of three walls between start and goal, its mouth to the one or to the other: the trap of Abdi et al. (2020).
    Cup,
}

/// One problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Its number in its set.
    pub id: usize,
    /// The obstacles.
    pub scene: Scene,
    /// Where the motion begins.
    pub start_rad: JointArray,
    /// Where it shall end.
    pub goal_rad: JointArray,
}

/// Problems of one kind for one arm.
#[derive(Clone, Debug)]
pub struct ProblemSet {
    /// Its name.
    pub name: String,
    /// The arm.
    pub robot: Robot,
    /// The problems.
    pub problems: Vec<Problem>,
    /// Pairs of clear poses that were left out because the straight line between them is free.
    pub free_lines: usize,
    /// What else was left out, as text; empty when nothing was.
    pub left_out: String,
}

impl ProblemSet {
    /// Draws problems; fewer when the arm hardly finds room.
    ///
    /// # Errors
    /// The name of a shape of the robot that cannot be built.
    pub fn random(
        name: &str,
        robot: &Robot,
        surroundings: &Surroundings,
        count: usize,
        seed: u64,
    ) -> Result<Self, String> {
        let mut set = Self {
            name: name.to_owned(),
            robot: robot.clone(),
            problems: Vec::new(),
            free_lines: 0,
            left_out: String::new(),
        };
        for id in 0..count {
            let mut rng = SeededRng::new(seed, id as u64);
            let mut drawn = None;
            for _ in 0..RETRIES_MAX {
                match random_one(robot, surroundings, &mut rng)? {
                    One::Blocked(blocked) => {
                        let (scene, [start_rad, goal_rad]) = *blocked;
                        drawn = Some(Problem { id, scene, start_rad, goal_rad });
                        break;
                    }
                    One::FreeLine => set.free_lines += 1,
                    One::Unclear => {}
                }
            }
            set.problems.extend(drawn);
        }
        let missing = count - set.problems.len();
        if missing > 0 {
            set.left_out = format!("{missing} problems: no two clear poses in {RETRIES_MAX} draws");
        }
        Ok(set)
    }
}

/// What one pair of poses is.
enum One {
    Unclear,
    FreeLine,
    Blocked(Box<(Scene, [JointArray; 2])>),
}

fn random_one(robot: &Robot, surroundings: &Surroundings, rng: &mut SeededRng) -> Result<One, String> {
    let empty = Scene { margin_m: taustream_arm::scene::MARGIN_M_DEFAULT, ..Scene::default() };
    let size_m = WORKING_SHARE * World::new(robot, &empty)?.reach_m()[0];
    let mut scene = match surroundings {
        Surroundings::Given(scene) => (**scene).clone(),
        Surroundings::Clutter => Scene { obstacles: clutter(size_m, rng), ..empty },
        Surroundings::Cup => empty,
    };
    let (world, budget) = (World::new(robot, &scene)?, Budget::unbounded());
    let space = Space::new(&world, &budget);
    let start_rad = space.random_pose(rng);
    if !is_clear(&world, &start_rad) {
        return Ok(One::Unclear);
    }
    let walk = walk(&space, start_rad, rng);
    let [start_rad, goal_rad] = [start_rad, walk.last().copied().unwrap_or(start_rad)];
    if *surroundings == Surroundings::Cup {
        let tips = [tip(&world, &start_rad), tip(&world, &goal_rad)];
        scene.obstacles = cup(tips, size_m, rng);
    }
    let world = World::new(robot, &scene)?;
    let space = Space::new(&world, &budget);
    let is_free = |legs: &[JointArray]| if let [a, b] = legs { space.is_edge_free(a, b) } else { true };
    if !(is_clear(&world, &start_rad) && is_clear(&world, &goal_rad) && walk.windows(2).all(is_free)) {
        return Ok(One::Unclear);
    }
    let is_line_free = space.is_edge_free(&start_rad, &goal_rad);
    Ok(if is_line_free { One::FreeLine } else { One::Blocked(Box::new((scene, [start_rad, goal_rad]))) })
}

/// Goes straight towards random poses, a step at a time, and turns where it is blocked; the poses in order.
fn walk(space: &Space, start_rad: JointArray, rng: &mut SeededRng) -> Vec<JointArray> {
    let mut poses = vec![start_rad];
    for _ in 0..LEGS {
        let (mut here, target) = (poses.last().copied().unwrap_or(start_rad), space.random_pose(rng));
        let steps = (space.distance_m(&here, &target) / LEG_STEP_M).ceil().max(1.0);
        let mut step = 1.0;
        let from = here;
        while step <= steps {
            let next = Space::between(&from, &target, step / steps);
            if !space.is_edge_free(&here, &next) {
                break;
            }
            here = next;
            step += 1.0;
        }
        poses.push(here);
    }
    poses
}

/// Where the tip is in a pose, m.
fn tip(world: &World, pose_rad: &JointArray) -> [f64; 3] {
    let mut snapshot = Snapshot::default();
    world.place(pose_rad, &mut snapshot);
    snapshot.origin(world.robot().chain.tip_frame()).to_array()
}

/// Balls, boxes and posts around the arm, none where its first links stand.
fn clutter(size_m: f64, rng: &mut SeededRng) -> Vec<Obstacle> {
    let mut obstacles = Vec::new();
    for i in 0..CLUTTER {
        let (turn_rad, away_m) = (rng.within(0.0, std::f64::consts::TAU), size_m * rng.within(0.3, 1.0));
        let center_m = [away_m * turn_rad.cos(), away_m * turn_rad.sin(), size_m * rng.within(-0.2, 1.0)];
        let mut length_m = || size_m * rng.within(0.08, 0.25);
        let shape = match i % 3 {
            0 => Shape::Sphere { radius_m: 0.5 * length_m() },
            1 => Shape::Box { size_m: std::array::from_fn(|_| length_m()) },
            _ => Shape::Cylinder { radius_m: 0.3 * length_m(), length_m: 2.0 * length_m() },
        };
        obstacles.push(obstacle(format!("clutter{i}"), center_m, 0.0, shape));
    }
    obstacles
}

/// A bottom across the way of the tip and two walls along it. Its mouth is turned to the start, so that a greedy search
/// runs into it, or away from it, so that the goal may lie inside.
fn cup([from_m, to_m]: [[f64; 3]; 2], size_m: f64, rng: &mut SeededRng) -> Vec<Obstacle> {
    let distance_m = [from_m[0] - to_m[0], from_m[1] - to_m[1]];
    let heading_rad = distance_m[1].atan2(distance_m[0]);
    let (ahead, aside) = ([heading_rad.cos(), heading_rad.sin()], [-heading_rad.sin(), heading_rad.cos()]);
    let (half_width_m, depth_m) = (size_m * rng.within(0.15, 0.3), size_m * rng.within(0.15, 0.35));
    let (height_m, away_m) = (size_m * rng.within(0.4, 0.8), size_m * rng.within(0.12, 0.3));
    let mouth = if rng.unit() < 0.5 { 1.0 } else { -1.0 };
    let thick_m = 0.02 * size_m;
    let wall = |name: &str, along_m: f64, side_m: f64, size_m: [f64; 3]| {
        let at = |k: usize| to_m[k] + along_m * ahead[k] + side_m * aside[k];
        obstacle(name.to_owned(), [at(0), at(1), to_m[2]], heading_rad, Shape::Box { size_m })
    };
    let side_m = [depth_m, thick_m, height_m];
    let middle_m = away_m + 0.5 * mouth * depth_m;
    vec![
        wall("bottom", away_m, 0.0, [thick_m, 2.0 * half_width_m, height_m]),
        wall("left", middle_m, half_width_m, side_m),
        wall("right", middle_m, -half_width_m, side_m),
    ]
}

fn obstacle(name: String, center_m: [f64; 3], yaw_rad: f64, shape: Shape) -> Obstacle {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    Obstacle { name, pose: Pose::from_parts(Translation3::from(center_m), turn), shape }
}
