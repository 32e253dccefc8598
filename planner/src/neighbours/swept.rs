//! What another arm may occupy from now on, as obstacles in the frame of this arm's base.
//!
//! A rest of a committed motion is halved until no point of a link moves farther than a step from where it is in the middle of an
//! interval; the link there, grown by what it moves at most, covers the whole interval. The bound is that of the
//! continuous proof ([`World::moves_m`]), so nothing is missed between samples.
use super::grown::grown;
use crate::collide::{Course, Motion};
use crate::world::{Snapshot, World};
use std::sync::Arc;
use taustream_arm::{Neighbour, Obstacle, Robot, Scene};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};

/// How far a link moves at most from the middle of an interval, if the count of obstacles allows it.
const STEP_M: f64 = 0.01;
/// A coarser step makes no sense.
const STEP_M_MAX: f64 = 100.0;
/// Most obstacles of one arm; coarser steps make fewer.
const OBSTACLES_MAX: usize = 300;
/// Intervals are not halved more often.
const DEPTH_MAX: u32 = 24;
/// For the base of a motion, which may differ from the commanded pose by an encoder's resolution.
const BASE_M: f64 = 1e-5;
/// By how much an arm that rests may move before its obstacles are made anew.
pub(crate) const SLACK_M: f64 = 2e-3;

/// A part of a committed motion, and when it runs, in trajectory time.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its strokes.
    pub trajectory: Trajectory,
    /// From when to when.
    pub span_s: [f64; 2],
}

/// Where an arm is, or may come to.
#[derive(Clone, Debug, PartialEq)]
pub enum Occupancy {
    /// It rests.
    Rests {
        /// The commanded pose; the measured one of an arm that is not energised.
        pose_rad: JointArray,
    },
    /// It moves, and comes to rest on these parts at the latest.
    Moves {
        /// In their order.
        parts: Vec<Part>,
    },
}

/// The bodies of another arm.
pub struct Bodies {
    name: String,
    base: Pose,
    world: World<'static>,
}

/// A link in an interval.
struct Piece {
    body: usize,
    pose_rad: JointArray,
    moves_m: f64,
    at_s: f64,
}

impl Bodies {
    /// The bodies of a neighbour, with what its tip holds (`robot`).
    ///
    /// # Errors
    /// The name of a link whose shape cannot be built.
    pub fn new(neighbour: &Neighbour, robot: Arc<Robot>) -> Result<Self, String> {
        let world = World::shared(robot, &Scene::default())?;
        Ok(Self { name: neighbour.name.clone(), base: neighbour.base, world })
    }

    /// The robot.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        self.world.robot()
    }

    /// Obstacles that cover the arm from now on, with `extra_m` around it. `off_rad` is how far the joints are from where they are
    /// commanded to be.
    #[must_use]
    pub fn obstacles(&self, occupancy: &Occupancy, off_rad: &JointArray, extra_m: f64) -> Vec<Obstacle> {
        match occupancy {
            Occupancy::Rests { pose_rad } => {
                let moves_m = self.moves_m(pose_rad, off_rad);
                let piece = |(body, moves_m)| Piece { body, pose_rad: *pose_rad, moves_m, at_s: f64::NAN };
                let pieces = moves_m.into_iter().enumerate().map(piece);
                pieces.filter_map(|piece| self.obstacle(&piece, extra_m + SLACK_M)).collect()
            }
            Occupancy::Moves { parts } => {
                let mut step_m = STEP_M;
                let pieces = loop {
                    match self.pieces(parts, off_rad, step_m) {
                        Some(pieces) => break pieces,
                        None => step_m *= 2.0,
                    }
                };
                pieces.iter().filter_map(|piece| self.obstacle(piece, extra_m + BASE_M)).collect()
            }
        }
    }

    /// How far points of the arm are at most from where they are in a pose, when joints differ from it by at most `turn_rad`.
    #[must_use]
    pub fn farthest_move_m(&self, pose_rad: &JointArray, turn_rad: &JointArray) -> f64 {
        self.moves_m(pose_rad, turn_rad).into_iter().fold(0.0, f64::max)
    }

    /// The same, link body by link body.
    fn moves_m(&self, pose_rad: &JointArray, turn_rad: &JointArray) -> Vec<f64> {
        let (mut snapshot, mut moves_m) = (Snapshot::default(), Vec::new());
        self.world.place(pose_rad, &mut snapshot);
        self.world.moves_m((&snapshot, &self.world.every_body()), turn_rad, &mut moves_m);
        moves_m.iter().map(|against| against[0]).collect()
    }

    /// The pieces of a motion; `None` when they are too many at this step.
    fn pieces(&self, parts: &[Part], off_rad: &JointArray, step_m: f64) -> Option<Vec<Piece>> {
        // What moves farther than any arm is one interval a part.
        let (most, depth_max) =
            if step_m > STEP_M_MAX { (usize::MAX, 0) } else { (OBSTACLES_MAX, DEPTH_MAX) };
        let mut pieces = Vec::new();
        for part in parts {
            let course = Course::new(&part.trajectory);
            let bodies: Vec<usize> = (0..self.robot().shapes.len()).collect();
            let halving = Halving { bodies: self, course: &course, off_rad, step_m, most, depth_max };
            halving.visit(part.span_s, &bodies, 0, &mut pieces)?;
        }
        Some(pieces)
    }

    fn obstacle(&self, piece: &Piece, extra_m: f64) -> Option<Obstacle> {
        let robot = self.robot();
        let shape = robot.shapes.get(piece.body)?;
        let frame = *robot.chain.frames(&piece.pose_rad).get(shape.frame)?;
        let (local, grown) = grown(&shape.shape, extra_m + piece.moves_m);
        let link = robot.links.get(shape.link).map_or("", String::as_str);
        let name = if piece.at_s.is_nan() || shape.frame == 0 {
            format!("{}/{link}", self.name)
        } else {
            format!("{}/{link} at {:.3} s of its motion", self.name, piece.at_s)
        };
        Some(Obstacle { name, pose: self.base * frame * shape.pose * local, shape: grown })
    }
}

struct Halving<'a> {
    bodies: &'a Bodies,
    course: &'a Course<'a>,
    off_rad: &'a JointArray,
    step_m: f64,
    most: usize,
    depth_max: u32,
}

impl Halving<'_> {
    fn visit(
        &self,
        [from_s, to_s]: [f64; 2],
        open: &[usize],
        depth: u32,
        pieces: &mut Vec<Piece>,
    ) -> Option<()> {
        let middle_s = 0.5 * (from_s + to_s);
        let (before, after) =
            (self.course.travel_rad(from_s, middle_s), self.course.travel_rad(middle_s, to_s));
        let turn_rad: JointArray = std::array::from_fn(|j| before[j].max(after[j]));
        let with_off_rad: JointArray = std::array::from_fn(|j| turn_rad[j] + self.off_rad[j]);
        let pose_rad = self.course.at(middle_s);
        let own_m = self.bodies.moves_m(&pose_rad, &turn_rad);
        let all_m = self.bodies.moves_m(&pose_rad, &with_off_rad);
        let mut next = Vec::new();
        for body in open {
            let at = |moves_m: &[f64]| moves_m.get(*body).copied().unwrap_or(f64::INFINITY);
            if at(&own_m) <= self.step_m || depth >= self.depth_max {
                pieces.push(Piece { body: *body, pose_rad, moves_m: at(&all_m), at_s: middle_s });
            } else {
                next.push(*body);
            }
        }
        if pieces.len() > self.most {
            return None;
        }
        if next.is_empty() {
            return Some(());
        }
        self.visit([from_s, middle_s], &next, depth + 1, pieces)?;
        self.visit([middle_s, to_s], &next, depth + 1, pieces)
    }
}

/// The joints of an arm that are used, of a report's.
#[must_use]
pub(crate) fn joints_of(values: &[f64; MAX_JOINTS], joints: usize) -> JointArray {
    std::array::from_fn(|joint| if joint < joints { values[joint] } else { 0.0 })
}
