//! The scene of a running planner: objects come, go and move, and the tip takes and leaves them.
//!
//! Every accepted set of changes makes a new revision: a robot, a scene and their world, which never change again. A plan and
//! its proof hold on to one revision, whatever comes meanwhile; what has changed since is checked before it is sent.
//! An object that is fixed to the tip is a link of the robot of that revision, so that every search and every proof
//! counts it, and its mass is one of the robot's masses. The digest stays that of the settings' robot: what a setpoint means is
//! the same.
use crate::verify::Contact;
use crate::world::World;
use nalgebra::{Matrix3, Point3, Quaternion, Translation3, UnitQuaternion};
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use taustream_arm::cloud::Cloud;
use taustream_arm::mass::LinkMass;
use taustream_arm::scene::OBSTACLES_MAX;
use taustream_arm::{LinkShape, Obstacle, Robot, Scene, Shape};
use taustream_messages::cloud::CheckedCloud;
use taustream_messages::scene::{FixedTo, ObjectPose, ObjectShape, SceneChange};
use taustream_messages::scene_reply::ListedObject;
use taustream_motion::JointArray;
use taustream_motion::chain::Pose;

/// Sets of changes that are remembered, for motions that were planned before them.
const HISTORY: usize = 256;
/// Names that an error lists.
const NAMED_MAX: usize = 12;

/// One state of the scene, which stays as it is.
#[derive(Clone)]
pub struct SceneRevision {
    /// Counts from 1 at the start of the planner.
    pub number: u64,
    /// The settings' robot, with what its tip holds.
    pub robot: Arc<Robot>,
    /// The obstacles.
    pub scene: Arc<Scene>,
    /// Both.
    pub world: Arc<World<'static>>,
}

/// What changes have put in another place.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changed {
    /// Obstacles that are new, elsewhere or of another shape.
    pub obstacles: BTreeSet<String>,
    /// The same of objects that are fixed to the tip.
    pub links: BTreeSet<String>,
}

impl Changed {
    /// True when nothing came nearer to anything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.obstacles.is_empty() && self.links.is_empty()
    }

    /// Adds what others have changed.
    pub fn join(&mut self, other: &Self) {
        self.obstacles.extend(other.obstacles.iter().cloned());
        self.links.extend(other.links.iter().cloned());
    }

    fn forget(&mut self, name: &str) {
        self.obstacles.remove(name);
        self.links.remove(name);
    }
}

/// An object that is fixed to the tip, with its pose in the tip's frame.
#[derive(Clone, Debug, PartialEq)]
struct Attached {
    object: Obstacle,
    mass_kg: f64,
}

/// Why changes do not count.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneChangeError {
    /// Nothing has this name.
    #[error("there is no object {name:?}; the scene has {exists}")]
    Unknown {
        /// The name.
        name: String,
        /// The names that exist.
        exists: String,
    },
    /// The name is taken.
    #[error("the scene has an object {name:?} already; move it, remove it first, or replace it")]
    Exists {
        /// The name.
        name: String,
    },
    /// The name is that of a link, so that no message could tell the two apart.
    #[error("{name:?} is the name of a link of {robot}; choose another one")]
    Link {
        /// The name.
        name: String,
        /// The robot.
        robot: String,
    },
    /// The tip holds it.
    #[error("{name:?} is fixed to the tip already")]
    Attached {
        /// The name.
        name: String,
    },
    /// The tip does not hold it.
    #[error("{name:?} is not fixed to the tip; it holds {held}")]
    NotAttached {
        /// The name.
        name: String,
        /// What it holds.
        held: String,
    },
    /// Triangles and point clouds are no part of an arm.
    #[error(
        "{name:?} is a mesh or a point cloud, and none can be fixed to the tip; replace it by boxes, balls and capsules that cover it"
    )]
    Mesh {
        /// The name.
        name: String,
    },
    /// It is not said which tip is meant.
    #[error(
        "{name:?} cannot be fixed to the tip: the robot has {tips} tips, and objects are fixed to the tip of robots with one only"
    )]
    SeveralTips {
        /// The name.
        name: String,
        /// How many.
        tips: usize,
    },
    /// Points that make no cloud.
    #[error("the cloud {name:?} {value}; {expected}")]
    Points {
        /// The name.
        name: String,
        /// What is wrong with it.
        value: String,
        /// What was expected.
        expected: String,
    },
    /// Nobody knows where the tip is.
    #[error(
        "where the tip is must be known, and the arm at rest, to attach or detach {name:?}: wait until it rests, or pause it"
    )]
    NoTip {
        /// The name.
        name: String,
    },
    /// What the tip takes touches something.
    #[error(
        "{name:?} cannot be fixed to the tip: {contact}, and no motion could begin there; make its shape smaller by some millimetres"
    )]
    Touches {
        /// The name.
        name: String,
        /// What touches what.
        contact: Contact,
    },
    /// Too many.
    #[error(
        "the scene would have {count} objects; at most {OBSTACLES_MAX} are possible: remove others first"
    )]
    Full {
        /// How many.
        count: usize,
    },
    /// A shape cannot be built.
    #[error("{name}: its mesh has no usable triangles; correct the file")]
    Shape {
        /// The link or object.
        name: String,
    },
}

/// The scene as it is now.
pub struct LiveScene {
    settings_robot: Arc<Robot>,
    attached: Vec<Attached>,
    /// Obstacles of the scene behind its own, in which other arms are, or come to.
    occupied: Vec<Obstacle>,
    current: SceneRevision,
    history: VecDeque<(u64, Changed)>,
}

/// Changes that are tried.
struct Draft<'a> {
    robot: &'a Robot,
    at_rest: Option<&'a JointArray>,
    obstacles: Vec<Obstacle>,
    attached: Vec<Attached>,
    changed: Changed,
    /// Obstacles whose shapes are to be built.
    reshaped: BTreeSet<String>,
    tip_changed: bool,
}

impl LiveScene {
    /// The scene of the settings.
    ///
    /// # Errors
    /// When a shape cannot be built.
    pub fn new(robot: &Robot, scene: &Scene) -> Result<Self, SceneChangeError> {
        let (robot, scene) = (Arc::new(robot.clone()), Arc::new(scene.clone()));
        let world = World::shared(robot.clone(), &scene).map_err(|name| SceneChangeError::Shape { name })?;
        let current = SceneRevision { number: 1, robot: robot.clone(), scene, world: Arc::new(world) };
        let (attached, occupied, history) = (Vec::new(), Vec::new(), VecDeque::new());
        Ok(Self { settings_robot: robot, attached, occupied, current, history })
    }

    /// The newest revision.
    #[must_use]
    pub fn current(&self) -> &SceneRevision {
        &self.current
    }

    /// What has changed since a revision; `None` when that is too long ago.
    #[must_use]
    pub fn changed_since(&self, number: u64) -> Option<Changed> {
        let behind = self.current.number.saturating_sub(number);
        if usize::try_from(behind).ok()? > self.history.len() {
            return None;
        }
        let mut all = Changed::default();
        self.history.iter().filter(|(of, _)| *of > number).for_each(|(_, changed)| all.join(changed));
        Some(all)
    }

    /// Every object, obstacles first.
    #[must_use]
    pub fn objects(&self) -> Vec<ListedObject> {
        let obstacles = self.own_obstacles().iter().map(|object| (object, FixedTo::Base, 0.0));
        let attached = self.attached.iter().map(|held| (&held.object, FixedTo::Tip, held.mass_kg));
        let listed = |(object, fixed_to, mass_kg): (&Obstacle, FixedTo, f64)| ListedObject {
            name: object.name.clone(),
            shape: shape_of(&object.shape),
            pose: ObjectPose {
                position_m: object.pose.translation.vector.into(),
                quaternion_xyzw: object.pose.rotation.coords.into(),
            },
            fixed_to,
            mass_kg,
        };
        obstacles.chain(attached).map(listed).collect()
    }

    /// The obstacles without those of other arms.
    fn own_obstacles(&self) -> &[Obstacle] {
        let all = &self.current.scene.obstacles;
        all.get(..all.len() - self.occupied.len()).unwrap_or(all)
    }

    /// Puts other arms where they are, or may come to: obstacles that nobody lists or moves.
    ///
    /// # Errors
    /// When a shape cannot be built.
    pub fn occupy(&mut self, obstacles: Vec<Obstacle>) -> Result<Changed, SceneChangeError> {
        let before = std::mem::replace(&mut self.occupied, obstacles);
        let scene = &self.current.scene;
        let own = scene.obstacles.len() - before.len();
        let names: BTreeSet<String> = self.occupied.iter().map(|obstacle| obstacle.name.clone()).collect();
        let scene = Arc::new(Scene {
            obstacles: scene.obstacles.iter().take(own).chain(&self.occupied).cloned().collect(),
            file: scene.file.clone(),
            margin_m: scene.margin_m,
            zones: scene.zones.clone(),
        });
        let world = match self.current.world.in_scene(&scene, &names) {
            Ok(world) => Arc::new(world),
            Err(name) => {
                self.occupied = before;
                return Err(SceneChangeError::Shape { name });
            }
        };
        let changed = Changed { obstacles: names, links: BTreeSet::new() };
        let number = self.current.number + 1;
        self.current = SceneRevision { number, robot: self.current.robot.clone(), scene, world };
        self.remember(number, changed.clone());
        Ok(changed)
    }

    /// The names of the obstacles of other arms.
    pub fn occupied_names(&self) -> impl Iterator<Item = &str> {
        self.occupied.iter().map(|obstacle| obstacle.name.as_str())
    }

    fn remember(&mut self, number: u64, changed: Changed) {
        if self.history.len() == HISTORY {
            self.history.pop_front();
        }
        self.history.push_back((number, changed));
    }

    /// Makes changes, all or none. `at_rest` is the pose in which the arm rests, where it is known to.
    ///
    /// # Errors
    /// The first change that cannot be made.
    pub fn apply(
        &mut self,
        changes: &[SceneChange],
        at_rest: Option<&JointArray>,
    ) -> Result<Changed, SceneChangeError> {
        self.revise(at_rest, |draft| changes.iter().try_for_each(|change| draft.make(change)))
    }

    /// Puts a point cloud into the scene.
    ///
    /// # Errors
    /// When its points make no sense, or its name is taken.
    pub fn put_cloud(&mut self, cloud: &CheckedCloud) -> Result<Changed, SceneChangeError> {
        let name = || cloud.name.clone();
        let points = Cloud::new(cloud.points_m.clone(), cloud.point_radius_m)
            .map_err(|(value, expected)| SceneChangeError::Points { name: name(), value, expected })?;
        self.revise(None, |draft| {
            draft.clear_for(&cloud.name, cloud.replaces)?;
            let shape = Shape::Cloud(Arc::new(points));
            draft.put(Obstacle { name: name(), pose: pose_to(&cloud.pose), shape }, FixedTo::Base, 0.0);
            Ok(())
        })
    }

    fn revise(
        &mut self,
        at_rest: Option<&JointArray>,
        make: impl FnOnce(&mut Draft) -> Result<(), SceneChangeError>,
    ) -> Result<Changed, SceneChangeError> {
        let SceneRevision { number, robot, scene, world } = &self.current;
        let mut draft = Draft {
            robot: &self.settings_robot,
            at_rest,
            obstacles: self.own_obstacles().to_vec(),
            attached: self.attached.clone(),
            changed: Changed::default(),
            reshaped: BTreeSet::new(),
            tip_changed: false,
        };
        make(&mut draft)?;
        let count = draft.obstacles.len() + draft.attached.len();
        if count > OBSTACLES_MAX && count > self.own_obstacles().len() + self.attached.len() {
            return Err(SceneChangeError::Full { count });
        }
        // Several bodies of another arm may have one name.
        draft.reshaped.extend(self.occupied.iter().map(|obstacle| obstacle.name.clone()));
        let scene = Arc::new(Scene {
            obstacles: draft.obstacles.iter().chain(&self.occupied).cloned().collect(),
            file: scene.file.clone(),
            margin_m: scene.margin_m,
            zones: scene.zones.clone(),
        });
        let shape = |name| SceneChangeError::Shape { name };
        let (robot, world) = if draft.tip_changed {
            let robot = Arc::new(carrying(&self.settings_robot, &draft.attached));
            let world = World::shared(robot.clone(), &scene).map_err(shape)?;
            check_held(&world, &draft.changed, at_rest)?;
            (robot, world)
        } else {
            (robot.clone(), world.in_scene(&scene, &draft.reshaped).map_err(shape)?)
        };
        let number = number + 1;
        self.current = SceneRevision { number, robot, scene, world: Arc::new(world) };
        let Draft { attached, changed, .. } = draft;
        self.attached = attached;
        self.remember(number, changed.clone());
        Ok(changed)
    }
}

impl Draft<'_> {
    fn make(&mut self, change: &SceneChange) -> Result<(), SceneChangeError> {
        match change {
            SceneChange::Add { name, shape, pose, fixed_to, mass_kg, replaces } => {
                self.clear_for(name, *replaces)?;
                let shape = shape_to(shape).ok_or_else(|| SceneChangeError::Mesh { name: name.clone() })?;
                if *fixed_to == FixedTo::Tip {
                    self.check_tip(name)?;
                }
                let object = Obstacle { name: name.clone(), pose: pose_to(pose), shape };
                self.put(object, *fixed_to, *mass_kg);
            }
            SceneChange::Remove { name } => {
                self.take(name).ok_or_else(|| self.unknown(name))?;
            }
            SceneChange::Move { name, pose } => self.relocate(name, pose_to(pose))?,
            SceneChange::Attach { name, mass_kg } => self.attach(name, *mass_kg)?,
            SceneChange::Detach { name } => self.detach(name)?,
        }
        Ok(())
    }

    /// Makes way for a new object of a name.
    fn clear_for(&mut self, name: &str, replaces: bool) -> Result<(), SceneChangeError> {
        let name = name.to_owned();
        if self.robot.links.contains(&name) {
            return Err(SceneChangeError::Link { name, robot: self.robot.name.clone() });
        }
        let was_there = self.take(&name).is_some();
        if was_there && !replaces { Err(SceneChangeError::Exists { name }) } else { Ok(()) }
    }

    fn relocate(&mut self, name: &str, pose: Pose) -> Result<(), SceneChangeError> {
        if let Some(object) = self.obstacles.iter_mut().find(|object| object.name == name) {
            object.pose = pose;
            self.changed.obstacles.insert(name.to_owned());
        } else if let Some(held) = self.attached.iter_mut().find(|held| held.object.name == name) {
            held.object.pose = pose;
            self.changed.links.insert(name.to_owned());
            self.tip_changed = true;
        } else {
            return Err(self.unknown(name));
        }
        Ok(())
    }

    fn attach(&mut self, name: &str, mass_kg: f64) -> Result<(), SceneChangeError> {
        let (mut object, fixed_to, _) = self.take(name).ok_or_else(|| self.unknown(name))?;
        if fixed_to == FixedTo::Tip {
            return Err(SceneChangeError::Attached { name: name.to_owned() });
        }
        self.check_tip(name)?;
        if matches!(object.shape, Shape::Mesh { .. } | Shape::Hull { .. } | Shape::Cloud(_)) {
            return Err(SceneChangeError::Mesh { name: name.to_owned() });
        }
        object.pose = self.tip(name)?.inverse() * object.pose;
        self.put(object, FixedTo::Tip, mass_kg);
        Ok(())
    }

    fn detach(&mut self, name: &str) -> Result<(), SceneChangeError> {
        let held = self.held();
        let (mut object, fixed_to, _) = self.take(name).ok_or_else(|| self.unknown(name))?;
        if fixed_to == FixedTo::Base {
            return Err(SceneChangeError::NotAttached { name: name.to_owned(), held });
        }
        object.pose = self.tip(name)? * object.pose;
        self.put(object, FixedTo::Base, 0.0);
        Ok(())
    }

    /// Refuses to fix anything where there are several tips.
    fn check_tip(&self, name: &str) -> Result<(), SceneChangeError> {
        match self.robot.tips.len() {
            1 => Ok(()),
            tips => Err(SceneChangeError::SeveralTips { name: name.to_owned(), tips }),
        }
    }

    /// The tip in the base's frame.
    fn tip(&self, name: &str) -> Result<Pose, SceneChangeError> {
        let no_tip = || SceneChangeError::NoTip { name: name.to_owned() };
        let frames = self.robot.chain.frames(self.at_rest.ok_or_else(no_tip)?);
        frames.get(self.robot.chain.tip_frame()).copied().ok_or_else(no_tip)
    }

    /// Takes an object out; what was said of it counts no more.
    fn take(&mut self, name: &str) -> Option<(Obstacle, FixedTo, f64)> {
        if let Some(index) = self.obstacles.iter().position(|object| object.name == name) {
            self.changed.forget(name);
            return Some((self.obstacles.remove(index), FixedTo::Base, 0.0));
        }
        let index = self.attached.iter().position(|held| held.object.name == name)?;
        self.changed.forget(name);
        self.tip_changed = true;
        let Attached { object, mass_kg } = self.attached.remove(index);
        Some((object, FixedTo::Tip, mass_kg))
    }

    fn put(&mut self, object: Obstacle, fixed_to: FixedTo, mass_kg: f64) {
        let name = object.name.clone();
        match fixed_to {
            FixedTo::Base => {
                self.reshaped.insert(name.clone());
                self.changed.obstacles.insert(name);
                self.obstacles.push(object);
            }
            FixedTo::Tip => {
                self.changed.links.insert(name);
                self.tip_changed = true;
                self.attached.push(Attached { object, mass_kg });
            }
        }
    }

    fn held(&self) -> String {
        listed(self.attached.iter().map(|held| held.object.name.as_str()))
    }

    fn unknown(&self, name: &str) -> SceneChangeError {
        let attached = self.attached.iter().map(|held| &held.object);
        let exists = listed(self.obstacles.iter().chain(attached).map(|object| object.name.as_str()));
        SceneChangeError::Unknown { name: name.to_owned(), exists }
    }
}

/// Names as a sentence has them.
fn listed<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let all: Vec<&str> = names.collect();
    match all.get(..NAMED_MAX) {
        _ if all.is_empty() => "none".to_owned(),
        Some(first) if all.len() > NAMED_MAX => {
            format!("{} and {} more", first.join(", "), all.len() - NAMED_MAX)
        }
        Some(_) | None => all.join(", "),
    }
}

/// Refuses what the tip takes while it touches something.
fn check_held(
    world: &World,
    changed: &Changed,
    at_rest: Option<&JointArray>,
) -> Result<(), SceneChangeError> {
    let Some(pose_rad) = at_rest else { return Ok(()) };
    if changed.links.is_empty() {
        return Ok(());
    }
    match world.only(&BTreeSet::new(), &changed.links).contact(pose_rad) {
        Some(contact) if contact.touches() => {
            let (link, other) = &contact.between;
            let name = if changed.links.contains(link) { link } else { other };
            Err(SceneChangeError::Touches { name: name.clone(), contact })
        }
        Some(_) | None => Ok(()),
    }
}

/// The robot with what its tip holds: each object is a link, and its mass is that of a point in its origin.
fn carrying(robot: &Robot, attached: &[Attached]) -> Robot {
    let mut robot = robot.clone();
    let frame = robot.chain.tip_frame();
    for Attached { object: Obstacle { name, pose, shape }, mass_kg } in attached {
        let link = robot.links.len();
        robot.links.push(name.clone());
        robot.shapes.push(LinkShape { link, frame, pose: *pose, shape: shape.clone() });
        if *mass_kg > 0.0 {
            robot.masses.push(LinkMass {
                link,
                frame,
                mass_kg: *mass_kg,
                center_m: Point3::from(pose.translation.vector),
                inertia_kg_m2: Matrix3::zeros(),
            });
        }
    }
    robot
}

fn pose_to(pose: &ObjectPose) -> Pose {
    let [x, y, z, w] = pose.quaternion_xyzw;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Pose::from_parts(Translation3::from(pose.position_m), rotation)
}

fn shape_to(shape: &ObjectShape) -> Option<Shape> {
    Some(match *shape {
        ObjectShape::Sphere { radius_m } => Shape::Sphere { radius_m },
        ObjectShape::Box { size_m } => Shape::Box { size_m },
        ObjectShape::Cylinder { radius_m, length_m } => Shape::Cylinder { radius_m, length_m },
        ObjectShape::Capsule { radius_m, length_m } => Shape::Capsule { radius_m, length_m },
        ObjectShape::Mesh | ObjectShape::Cloud => return None,
    })
}

fn shape_of(shape: &Shape) -> ObjectShape {
    match *shape {
        Shape::Sphere { radius_m } => ObjectShape::Sphere { radius_m },
        Shape::Box { size_m } => ObjectShape::Box { size_m },
        Shape::Cylinder { radius_m, length_m } => ObjectShape::Cylinder { radius_m, length_m },
        Shape::Capsule { radius_m, length_m } => ObjectShape::Capsule { radius_m, length_m },
        Shape::Mesh { .. } | Shape::Hull { .. } => ObjectShape::Mesh,
        Shape::Cloud(_) => ObjectShape::Cloud,
    }
}
