//! The robot and its surroundings as bodies, and which pairs of them must keep apart.
//!
//! Obstacles keep the scene's margin, links the robot's from each other unless the robot file or the contact rule lets
//! them touch. The base does not move, so that it is not checked against obstacles: planning
//! could not change it.
mod changes;

use crate::collide::{Body, Posed};
use crate::lanes::Model;
use crate::verify::Contact;
use parry3d_f64::math::{Pose, Vector};
use std::ops::Deref;
use std::sync::{Arc, OnceLock};
use taustream_arm::body::to_parry;
use taustream_arm::{Obstacle, Robot, Scene, Zone};
use taustream_motion::chain::{self, ChainJoint};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS};

/// The other side of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Other {
    /// Index into the world's obstacles.
    Obstacle(usize),
    /// Index into the world's link bodies.
    Link(usize),
}

/// Two bodies that must keep apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the link body; in a pair of links, the one whose frame comes later.
    pub link: usize,
    /// What it must not touch.
    pub other: Other,
    /// The distance that they must keep, exclusive.
    pub required_m: f64,
}

/// A body of a link.
#[derive(Clone)]
struct LinkBody {
    /// Index into [`Robot::links`].
    link: usize,
    /// Index of the frame that it is rigid with.
    frame: usize,
    body: Body,
}

/// An obstacle, which stands still.
#[derive(Clone)]
struct StillBody {
    name: String,
    body: Body,
    at: Posed,
}

impl StillBody {
    fn new(obstacle: &Obstacle) -> Result<Self, String> {
        let body = Body::new(&obstacle.shape, &chain::Pose::identity());
        let body = body.ok_or_else(|| obstacle.name.clone())?;
        let at = body.placed(&to_parry(&obstacle.pose));
        Ok(Self { name: obstacle.name.clone(), body, at })
    }
}

/// The axis of a joint in the frame that it stands in: a point of it, and its direction.
#[derive(Clone, Copy, Debug)]
struct Axis {
    kind: JointKind,
    point: Vector,
    direction: Vector,
}

impl Axis {
    const NONE: Self = Self { kind: JointKind::Revolute, point: Vector::ZERO, direction: Vector::ZERO };
}

/// The frames of the chain in one pose of the arm.
#[derive(Clone, Debug)]
pub struct Frames(Vec<Pose>);

/// The robot of a world.
#[derive(Clone)]
enum RobotOf<'a> {
    Borrowed(&'a Robot),
    Shared(Arc<Robot>),
}

impl Deref for RobotOf<'_> {
    type Target = Robot;

    fn deref(&self) -> &Robot {
        match self {
            Self::Borrowed(robot) => robot,
            Self::Shared(robot) => robot,
        }
    }
}

/// What lanes see of a world, from when it is first asked for. A copy begins without, as it may be changed.
#[derive(Default)]
struct InLanes(OnceLock<Box<Model>>);

impl Clone for InLanes {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// How far outside its stroke a prismatic joint may stand in a pose that is asked for (m): an arm that stands outside is led in, and the
/// rounding of the f32 lanes is bounded by how far it extends.
const OUTSIDE_M: f64 = 1.0;

/// Everything that can collide.
#[derive(Clone)]
pub struct World<'a> {
    robot: RobotOf<'a>,
    links: Vec<LinkBody>,
    obstacles: Vec<StillBody>,
    pairs: Vec<Pair>,
    axes: Vec<Axis>,
    reach_m: JointArray,
    margin_m: f64,
    extent_m: f64,
    in_lanes: InLanes,
    zones: Vec<Zone>,
}

/// Which link bodies some pairs are about.
#[derive(Clone, Debug, Default)]
pub struct Concerned(Vec<bool>);

impl Concerned {
    fn bodies(&self) -> impl Iterator<Item = usize> {
        self.0.iter().enumerate().filter(|(_, is_concerned)| **is_concerned).map(|(body, _)| body)
    }
}

/// The bodies of the links in one pose of the arm.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    frames: Vec<Pose>,
    at: Vec<Posed>,
}

impl Snapshot {
    /// Where the origin of a frame is, m.
    #[must_use]
    pub fn origin(&self, frame: usize) -> Vector {
        self.frames.get(frame).map_or(Vector::ZERO, |f| f.translation)
    }
}

impl<'a> World<'a> {
    /// Builds the bodies. A shape that cannot be built (a mesh without triangles; files with such are refused) is
    /// an error with its name.
    ///
    /// # Errors
    /// The name of the link or obstacle whose shape cannot be built.
    pub fn new(robot: &'a Robot, scene: &Scene) -> Result<Self, String> {
        Self::of(RobotOf::Borrowed(robot), scene)
    }

    fn of(robot: RobotOf<'a>, scene: &Scene) -> Result<Self, String> {
        let mut links = Vec::new();
        for shape in &robot.shapes {
            let name = || robot.links.get(shape.link).cloned().unwrap_or_default();
            let body = Body::new(&shape.shape, &shape.pose).ok_or_else(name)?;
            links.push(LinkBody { link: shape.link, frame: shape.frame.min(robot.joints.len()), body });
        }
        let mut obstacles = Vec::new();
        for obstacle in &scene.obstacles {
            obstacles.push(StillBody::new(obstacle)?);
        }
        let axes = axes(&robot);
        let mut world = Self {
            robot,
            links,
            obstacles,
            pairs: Vec::new(),
            axes,
            reach_m: [0.0; MAX_JOINTS],
            margin_m: scene.margin_m,
            extent_m: 0.0,
            in_lanes: InLanes::default(),
            zones: scene.zones.clone(),
        };
        world.extent_m = world.farthest_m();
        world.pairs = world.pairs_to_keep(scene.margin_m);
        world.reach_m = world.joint_reach_m();
        Ok(world)
    }

    fn pairs_to_keep(&self, margin_m: f64) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for (link, a) in self.links.iter().enumerate().filter(|(_, a)| a.frame > 0) {
            let obstacles = 0..self.obstacles.len();
            pairs.extend(obstacles.map(|o| Pair { link, other: Other::Obstacle(o), required_m: margin_m }));
            for (other, b) in self.links.iter().enumerate() {
                // Rigid with one frame: their distance never changes.
                let once = b.frame < a.frame;
                if once && a.link != b.link && !self.robot.may_touch(a.link, b.link) {
                    let required_m = self.robot.margins.of(a.link, b.link);
                    pairs.push(Pair { link, other: Other::Link(other), required_m });
                }
            }
        }
        pairs
    }

    /// The same world for an arm that stands nearer to obstacles, or to itself, than it should: each pair that is nearer
    /// in this pose need only keep what it has there, less `slack_m`. Pairs with obstacles that are nearer than `floor_m`,
    /// and links that touch, keep their distance, so that the pose is still refused.
    #[must_use]
    pub fn relaxed(&self, position_rad: &JointArray, floor_m: f64, slack_m: f64) -> Self {
        let mut relaxed = self.clone();
        let mut snapshot = Snapshot::default();
        self.place(position_rad, &mut snapshot);
        for pair in &mut relaxed.pairs {
            let distance_m = self.solid_distance_m(pair, &snapshot);
            let floor_m = match pair.other {
                Other::Obstacle(_) => floor_m.min(pair.required_m),
                Other::Link(_) => 0.0,
            };
            if distance_m > floor_m {
                pair.required_m = pair.required_m.min((distance_m - slack_m).max(0.0));
            }
        }
        relaxed
    }

    /// Furthest that a point of the arm can be from the base's origin, in any pose of the ranges (m).
    fn farthest_m(&self) -> f64 {
        let mut snapshot = Snapshot::default();
        self.place(&[0.0; MAX_JOINTS], &mut snapshot);
        let step_m = |index: usize| {
            let joint = self.robot.chain.joint(index);
            let fixed = |j: &ChainJoint| j.pre.translation.vector.norm() + j.post.translation.vector.norm();
            let outside_m = if self.robot.chain.kind(index).is_prismatic() { OUTSIDE_M } else { 0.0 };
            joint.map_or(0.0, fixed) + self.robot.extension_m(index) + outside_m
        };
        let body_m = |(body, at): (&LinkBody, &Posed)| {
            let frame = snapshot.frames.get(body.frame);
            let own_m = frame.map_or(0.0, |f| (at.centre - f.translation).length());
            self.robot.chain.movers(body.frame).map(step_m).sum::<f64>() + own_m + body.body.bound_m()
        };
        self.links.iter().zip(&snapshot.at).map(body_m).fold(0.0, f64::max)
    }

    /// How far a unit of each joint moves a point of the arm at most, in any pose of the ranges: the distance from the axis of a
    /// revolute joint, 1 for a prismatic one. What stands behind a prismatic joint is as far off as its range allows.
    fn joint_reach_m(&self) -> JointArray {
        let mut snapshot = Snapshot::default();
        self.place(&[0.0; MAX_JOINTS], &mut snapshot);
        let joint = |index: usize| self.robot.chain.joint(index);
        let before_m = |index: usize| joint(index).map_or(0.0, |j| j.pre.translation.vector.norm());
        let behind_m = |index: usize| joint(index).map_or(0.0, |j| j.post.translation.vector.norm());
        let chain = &self.robot.chain;
        let mut reach_m = [0.0; MAX_JOINTS];
        for (joint, reach) in reach_m.iter_mut().enumerate().take(self.robot.joints.len()) {
            for (body, at) in self.links.iter().zip(&snapshot.at).filter(|(b, _)| chain.moves(joint, b.frame))
            {
                let own_m =
                    snapshot.frames.get(body.frame).map_or(0.0, |f| (at.centre - f.translation).length());
                let next = chain.movers(body.frame).filter(|next| *next > joint);
                let step_m = |next: usize| before_m(next) + self.robot.extension_m(next) + behind_m(next);
                let chain_m = behind_m(joint) + next.map(step_m).sum::<f64>();
                let lever = match chain.kind(joint) {
                    JointKind::Revolute => chain_m + own_m + body.body.bound_m(),
                    JointKind::Prismatic => 1.0,
                };
                *reach = f64::max(*reach, lever);
            }
        }
        reach_m
    }

    /// The robot.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }
    /// How many joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.robot.joints.len()
    }
    /// The pairs that must keep apart.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }
    /// How far a unit of each joint moves a point of the arm at most: the furthest that one can be from the axis in any pose, m/rad,
    /// and 1 m/m for prismatic joints; 0 for unused joints.
    #[must_use]
    pub fn reach_m(&self) -> &JointArray {
        &self.reach_m
    }

    /// What links keep from obstacles, unless a pair states less (m).
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        self.margin_m
    }
    /// Furthest that a point of the arm can be from the base's origin, in any pose of the ranges (m).
    #[must_use]
    pub fn extent_m(&self) -> f64 {
        self.extent_m
    }
    /// The bodies of the links, each with the index of the frame that it is rigid with.
    pub fn link_bodies(&self) -> impl Iterator<Item = (usize, &Body)> {
        self.links.iter().map(|link| (link.frame, &link.body))
    }
    /// The obstacles, with their poses.
    pub fn obstacle_bodies(&self) -> impl Iterator<Item = (&Body, &Posed)> {
        self.obstacles.iter().map(|obstacle| (&obstacle.body, &obstacle.at))
    }

    /// The world in f32.
    #[must_use]
    pub(crate) fn model(&self) -> &Model {
        self.in_lanes.0.get_or_init(|| Box::new(Model::new(self)))
    }

    /// The frames in a pose, for pairs that are asked for one by one.
    #[must_use]
    pub fn frames(&self, position_rad: &JointArray) -> Frames {
        let frames = self.robot.chain.frames(position_rad);
        Frames(frames.iter().take(self.joints() + 1).map(to_parry).collect())
    }

    /// True when a pair keeps what it must and `extra_m` more.
    #[must_use]
    pub fn keeps(&self, pair: &Pair, frames: &Frames, extra_m: f64) -> bool {
        let placed = |link: usize| {
            let LinkBody { frame, body, .. } = &self.links[link];
            (body, body.placed(&frames.0[*frame]))
        };
        let (a, a_at) = placed(pair.link);
        let distance_m = match pair.other {
            Other::Obstacle(o) => {
                let StillBody { body, at, .. } = &self.obstacles[o];
                a.distance_m(&a_at, body, at)
            }
            Other::Link(other) => {
                let (b, b_at) = placed(other);
                a.distance_m(&a_at, b, &b_at)
            }
        };
        distance_m > pair.required_m + extra_m
    }

    /// Every link body.
    #[must_use]
    pub fn every_body(&self) -> Concerned {
        Concerned(vec![true; self.links.len()])
    }

    /// The link bodies that pairs are about.
    pub fn concerned<'p>(&self, pairs: impl Iterator<Item = &'p Pair>, concerned: &mut Concerned) {
        concerned.0.clear();
        concerned.0.resize(self.links.len(), false);
        for pair in pairs {
            concerned.0[pair.link] = true;
            if let Other::Link(other) = pair.other {
                concerned.0[other] = true;
            }
        }
    }

    /// Places these bodies only: what others have in the snapshot belongs to another pose, and must not be asked for.
    pub fn place_concerned(&self, position_rad: &JointArray, concerned: &Concerned, snapshot: &mut Snapshot) {
        if snapshot.at.len() != self.links.len() {
            return self.place(position_rad, snapshot);
        }
        self.place_frames(position_rad, snapshot);
        for body in concerned.bodies() {
            let link = &self.links[body];
            snapshot.at[body] = link.body.placed(&snapshot.frames[link.frame]);
        }
    }

    fn place_frames(&self, position_rad: &JointArray, snapshot: &mut Snapshot) {
        let frames = self.robot.chain.frames(position_rad);
        snapshot.frames.clear();
        snapshot.frames.extend(frames.iter().take(self.joints() + 1).map(to_parry));
    }

    /// Places the links' bodies.
    pub fn place(&self, position_rad: &JointArray, snapshot: &mut Snapshot) {
        self.place_frames(position_rad, snapshot);
        snapshot.at.clear();
        snapshot.at.extend(self.links.iter().map(|l| l.body.placed(&snapshot.frames[l.frame])));
    }

    /// Distance of a pair; see [`Body::distance_m`].
    #[must_use]
    pub fn distance_m(&self, pair: &Pair, snapshot: &Snapshot) -> f64 {
        let (a, a_at, b, b_at) = self.sides(pair, snapshot);
        a.distance_m(a_at, b, b_at)
    }

    /// Lower bound of a pair's distance by the balls around them; cheap.
    #[must_use]
    pub fn distance_bound_m(&self, pair: &Pair, snapshot: &Snapshot) -> f64 {
        let (a, a_at, b, b_at) = self.sides(pair, snapshot);
        a.distance_bound_m(a_at, b, b_at)
    }

    /// The paper's hinge for a pair: max(1 - d / (radii + margin), 0) with d between the cores; for a sphere it is
    /// the corrected eq. 3.9 with the margin and the link's radius as its expansion.
    #[must_use]
    pub fn hinge(&self, pair: &Pair, snapshot: &Snapshot) -> f64 {
        /// A box has no radius and a margin may be 0: the hinge needs some width.
        const WIDTH_M_MIN: f64 = 0.01;
        let (a, a_at, b, b_at) = self.sides(pair, snapshot);
        let width_m = (a.radius_m() + b.radius_m() + pair.required_m).max(WIDTH_M_MIN);
        let centres_m = (a_at.centre - b_at.centre).length();
        if centres_m - a.bound_m() - b.bound_m() >= width_m {
            return 0.0;
        }
        (1.0 - a.core_distance_m(a_at, b, b_at) / width_m).max(0.0)
    }

    fn sides<'s>(
        &'s self,
        pair: &Pair,
        snapshot: &'s Snapshot,
    ) -> (&'s Body, &'s Posed, &'s Body, &'s Posed) {
        let (b, b_at) = match pair.other {
            Other::Obstacle(o) => (&self.obstacles[o].body, &self.obstacles[o].at),
            Other::Link(l) => (&self.links[l].body, &snapshot.at[l]),
        };
        (&self.links[pair.link].body, &snapshot.at[pair.link], b, b_at)
    }

    /// Distance of a pair, 0 for a body wholly inside a mesh.
    fn solid_distance_m(&self, pair: &Pair, snapshot: &Snapshot) -> f64 {
        let (a, a_at, b, b_at) = self.sides(pair, snapshot);
        let distance_m = a.distance_m(a_at, b, b_at);
        if distance_m > 0.0 && a.is_inside(a_at, b, b_at) { 0.0 } else { distance_m }
    }

    /// The pair that keeps least beyond what it must, with its distance; `None` when nothing can collide. Sees
    /// bodies wholly inside a mesh, too.
    #[must_use]
    pub fn closest(&self, position_rad: &JointArray) -> Option<(Pair, f64)> {
        let mut snapshot = Snapshot::default();
        self.place(position_rad, &mut snapshot);
        let measured = self.pairs.iter().map(|pair| (*pair, self.solid_distance_m(pair, &snapshot)));
        measured.min_by(|(p, d), (q, e)| (d - p.required_m).total_cmp(&(e - q.required_m)))
    }

    /// The pair that is nearest in a pose, with its distance; `None` when nothing can collide. Does not see bodies wholly inside a mesh.
    #[must_use]
    pub fn nearest(&self, position_rad: &JointArray) -> Option<(Pair, f64)> {
        let mut snapshot = Snapshot::default();
        self.place(position_rad, &mut snapshot);
        let mut nearest: Option<(Pair, f64)> = None;
        for pair in &self.pairs {
            let least_m = nearest.map_or(f64::INFINITY, |(_, distance_m)| distance_m);
            if self.distance_bound_m(pair, &snapshot) < least_m {
                let distance_m = self.distance_m(pair, &snapshot);
                if distance_m < least_m {
                    nearest = Some((*pair, distance_m));
                }
            }
        }
        nearest
    }

    /// What is too close in a pose, the worst first; `None` when the pose is free.
    #[must_use]
    pub fn contact(&self, position_rad: &JointArray) -> Option<Contact> {
        self.contact_within(position_rad, 0.0)
    }

    /// Like [`Self::contact`], for a pose that must keep `extra_m` more than every pair must.
    #[must_use]
    pub fn contact_within(&self, position_rad: &JointArray, extra_m: f64) -> Option<Contact> {
        let (pair, distance_m) = self.closest(position_rad)?;
        (distance_m <= pair.required_m + extra_m).then(|| self.contact_of(&pair, distance_m))
    }

    /// A contact as text.
    #[must_use]
    pub fn contact_of(&self, pair: &Pair, distance_m: f64) -> Contact {
        let of_links = matches!(pair.other, Other::Link(_));
        Contact { between: self.names(pair), distance_m, required_m: pair.required_m, of_links }
    }

    /// The names of a pair.
    #[must_use]
    pub fn names(&self, pair: &Pair) -> (String, String) {
        let link = |l: usize| self.robot.links.get(self.links[l].link).cloned().unwrap_or_default();
        let other = match pair.other {
            Other::Obstacle(o) => self.obstacles[o].name.clone(),
            Other::Link(l) => link(l),
        };
        (link(pair.link), other)
    }

    /// True when every pair keeps what it must and `extra_m` more; stops at the first that does not.
    pub fn is_free(&self, position_rad: &JointArray, extra_m: f64, snapshot: &mut Snapshot) -> bool {
        self.place(position_rad, snapshot);
        self.pairs.iter().all(|pair| {
            let keep_m = pair.required_m + extra_m;
            self.distance_bound_m(pair, snapshot) > keep_m || self.distance_m(pair, snapshot) > keep_m
        })
    }

    /// How far points of each body can move against each frame that carries it when joint j moves by at most `turn_rad[j]` (m for a
    /// prismatic one) away from the pose of the snapshot, written into `moves_m[link body][frame]`.
    ///
    /// Move the joints that move a body one after the other, base first: joint j then moves everything beyond it rigidly, in the
    /// snapshot's shape, about or along an axis that the joints before it have only carried along. So a point moves by at
    /// most the sum over j of turn j times its distance to axis j *in the snapshot*, and of what prismatic joints slide: no larger
    /// lever can occur on the way, as a prismatic joint slides after those before it have turned. Seen from a
    /// frame that carries the body, only the joints between the two count. There is no bound against other frames, nor for bodies that
    /// are not concerned.
    pub fn moves_m(
        &self,
        (snapshot, concerned): (&Snapshot, &Concerned),
        turn_rad: &JointArray,
        moves_m: &mut Vec<[f64; MAX_JOINTS + 1]>,
    ) {
        let axis = |(axis, frame): (&Axis, &Pose)| Axis {
            kind: axis.kind,
            point: frame.transform_point(axis.point),
            direction: frame.rotation * axis.direction,
        };
        let mut axes = [Axis::NONE; MAX_JOINTS];
        for (joint, (placed, own)) in axes.iter_mut().zip(&self.axes).enumerate() {
            *placed = axis((own, &snapshot.frames[self.robot.chain.parent_frame(joint)]));
        }
        moves_m.clear();
        moves_m.resize(self.links.len(), [f64::INFINITY; MAX_JOINTS + 1]);
        for index in concerned.bodies() {
            let (link, at) = (&self.links[index], &snapshot.at[index]);
            let sums = &mut moves_m[index];
            let (mut frame, mut sum_m) = (link.frame, 0.0);
            sums[frame] = sum_m;
            while let Some(joint) = frame.checked_sub(1) {
                let Axis { kind, point, direction } = axes[joint];
                let lever = match kind {
                    JointKind::Revolute if turn_rad[joint] > 0.0 => link.body.lever_m(at, point, direction),
                    JointKind::Revolute => 0.0,
                    JointKind::Prismatic => 1.0,
                };
                sum_m += turn_rad[joint] * lever;
                frame = self.robot.chain.parent_frame(joint);
                sums[frame] = sum_m;
            }
        }
    }

    /// How far the points of a pair can move against each other, by [`Self::moves_m`]. What carries both links moves them alike and
    /// drops out; on two branches both move against the frame that their branches stand in.
    #[must_use]
    pub fn pair_moves_m(&self, pair: &Pair, moves_m: &[[f64; MAX_JOINTS + 1]]) -> f64 {
        let Other::Link(other) = pair.other else { return moves_m[pair.link][0] };
        let (a, b) = (self.links[pair.link].frame, self.links[other].frame);
        let common = self.robot.chain.common_frame(a, b);
        moves_m[pair.link][common] + moves_m[other][common]
    }
}

/// The joints' axes, each in the frame that it stands in.
fn axes(robot: &Robot) -> Vec<Axis> {
    let axis = |joint: &ChainJoint| {
        let pre = to_parry(&joint.pre);
        let axis = joint.axis.into_inner();
        let direction = pre.rotation * Vector::new(axis.x, axis.y, axis.z);
        Axis { kind: joint.kind, point: pre.translation, direction }
    };
    (0..robot.joints.len()).filter_map(|joint| robot.chain.joint(joint).map(axis)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::SeededRng;
    use std::path::{Path, PathBuf};

    fn ur5() -> Robot {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        Robot::load(&file).expect("shipped")
    }

    fn ends_m(world: &World, q: &JointArray, body: usize) -> [nalgebra::Vector3<f64>; 2] {
        // Bodies come in the order of the shapes, which are capsules.
        let shape = &world.robot.shapes[body];
        let frame = world.robot.chain.frames(q)[shape.frame];
        let (ends, _) = shape.segment().expect("a capsule");
        ends.map(|end| (frame * end).coords)
    }

    /// Goal: no point of a link moves further than `moves_m` says, alone and against another link.
    /// Method: random poses and turns; the link's ends by plain kinematics. Shrunk by a tenth the bound must fail, or
    /// it would be too weak to show anything.
    #[test]
    fn moves_bound_holds_for_random_turns_and_fails_when_shrunk() {
        let robot = ur5();
        let scene = Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: Vec::new(), zones: Vec::new() };
        let world = World::new(&robot, &scene).expect("builds");
        let (mut snapshot, mut moves_m) = (Snapshot::default(), Vec::new());
        let all = world.every_body();
        let mut broken_when_shrunk = 0;
        for seed in 0..5_000 {
            let mut rng = SeededRng::new(seed, 0);
            let mut q = [0.0; MAX_JOINTS];
            let (mut turn, mut there) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
            for j in 0..6 {
                q[j] = rng.within(-3.0, 3.0);
                // Often one joint alone, by a little: there the bound is nearly exact.
                turn[j] = if rng.unit() < 0.5 { 0.0 } else { rng.within(0.0, 0.3) };
                there[j] = q[j] + turn[j] * if rng.unit() < 0.5 { 1.0 } else { rng.within(-1.0, 1.0) };
            }
            world.place(&q, &mut snapshot);
            world.moves_m((&snapshot, &all), &turn, &mut moves_m);
            let moving = |(body, _): &(usize, &[f64; MAX_JOINTS + 1])| world.links[*body].frame > 0;
            for (body, bounds_m) in moves_m.iter().enumerate().filter(moving) {
                for (before, after) in ends_m(&world, &q, body).iter().zip(ends_m(&world, &there, body)) {
                    let moved_m = (after - before).norm();
                    let bound_m = bounds_m[0];
                    assert!(
                        moved_m <= bound_m + 1e-12,
                        "seed {seed}, link {body}: {moved_m} above {bound_m}"
                    );
                    // The radius stands for points that turn about the link's own axis.
                    let radius_m: f64 = turn.iter().map(|t| t * 0.06).sum();
                    broken_when_shrunk += u32::from(moved_m > 0.9 * (bound_m - radius_m));
                }
                let relative = |q: &JointArray| {
                    let [end, _] = ends_m(&world, q, body);
                    (world.robot.chain.frames(q)[1].inverse() * nalgebra::Point3::from(end)).coords
                };
                let moved_m = (relative(&there) - relative(&q)).norm();
                let bound_m = bounds_m[1];
                assert!(moved_m <= bound_m + 1e-12, "seed {seed}, link {body} seen from link 1: {moved_m}");
            }
        }
        assert!(broken_when_shrunk > 100, "the bound is so weak that a tenth less still holds");
    }

    #[test]
    fn reach_is_an_upper_bound_of_every_lever() {
        let robot = ur5();
        let scene = Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: Vec::new(), zones: Vec::new() };
        let world = World::new(&robot, &scene).expect("builds");
        let (mut snapshot, mut moves_m) = (Snapshot::default(), Vec::new());
        let all = world.every_body();
        for seed in 0..2_000 {
            let mut rng = SeededRng::new(seed, 1);
            let q = std::array::from_fn(|j| if j < 6 { rng.within(-3.1, 3.1) } else { 0.0 });
            world.place(&q, &mut snapshot);
            for joint in 0..6 {
                let mut turn = [0.0; MAX_JOINTS];
                turn[joint] = 1.0;
                world.moves_m((&snapshot, &all), &turn, &mut moves_m);
                let lever_m = moves_m.iter().map(|m| m[0]).fold(0.0, f64::max);
                assert!(lever_m <= world.reach_m()[joint], "seed {seed}, joint {joint}: {lever_m}");
            }
        }
    }
}
