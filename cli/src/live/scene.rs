//! `taustream scene`: lists and changes the running planner's scene.
use super::client::{Client, Limit, PLANNER};
use super::run::open_neighbours;
use crate::args::{AddArgs, MoveArgs, SceneAction, SceneArgs, Triple};
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::prelude::{ZeroCopySend, ipc};
use nalgebra::UnitQuaternion;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::thread;
use std::time::Duration;
use taustream_arm::cloud::Cloud;
use taustream_arm::text::counted;
use taustream_arm::{Obstacle, Shape};
use taustream_messages::cloud::{CLOUD_POINTS_MAX, CheckedCloud, CloudRequest};
use taustream_messages::event::{Events, Topic};
use taustream_messages::scene::{CHANGES_MAX, FixedTo, ObjectPose, ObjectShape, SceneChange};
use taustream_messages::scene_reply::{ListedObject, MotionEffect, SceneOutcome};
use taustream_messages::service::SceneClient;
use taustream_messages::{CheckedSceneRequest, SceneReply, SceneRequest};
use taustream_planner::neighbours::NeighbourWords;

/// A planner that reroutes a motion answers after that.
const ANSWER_S_MAX: f64 = 3.0;
/// How long a wait for an answer relies on its event.
const LOOK_AGAIN: Duration = Duration::from_millis(5);
/// How often a list is begun again because the scene has changed between two pages.
const LISTS_MAX: u32 = 20;

/// One object.
#[derive(Debug, Serialize)]
struct Object {
    name: String,
    shape: &'static str,
    size_m: Vec<f64>,
    fixed_to: &'static str,
    position_m: [f64; 3],
    quaternion_xyzw: [f64; 4],
    mass_kg: f64,
}

/// The list.
#[derive(Debug, Serialize)]
struct Listed {
    arm: String,
    revision: u64,
    objects: Vec<Object>,
    /// Other arms in the room.
    neighbours: Vec<NeighbourStatus>,
    last_effect: Option<String>,
}

/// Another arm in the room.
#[derive(Debug, Serialize)]
struct NeighbourStatus {
    name: String,
    /// Null before its first report.
    report_age_s: Option<f64>,
    state: String,
}

impl fmt::Display for Listed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, revision {}", counted(self.objects.len(), "object"), self.revision)?;
        for object in &self.objects {
            let [x, y, z] = object.position_m;
            let sizes: Vec<String> = object.size_m.iter().map(|size| format!("{size}")).collect();
            let Object { name, shape, fixed_to, .. } = object;
            write!(
                f,
                "\n{name:<20} {shape:<8} {:<18} m  at {x:.4} {y:.4} {z:.4} m of the {fixed_to}",
                sizes.join(" x ")
            )?;
            if object.mass_kg > 0.0 {
                write!(f, ", {} kg", object.mass_kg)?;
            }
        }
        for NeighbourStatus { report_age_s, state, .. } in &self.neighbours {
            write!(f, "\n{state}")?;
            if let Some(age_s) = report_age_s {
                write!(f, "; its report is {age_s:.3} s old")?;
            }
        }
        match &self.last_effect {
            Some(effect) => write!(f, "\nlast: {effect}"),
            None => Ok(()),
        }
    }
}

/// What a change did.
#[derive(Debug, Serialize)]
pub(crate) struct Changed {
    arm: String,
    revision: u64,
    objects: usize,
    pub(crate) effect: &'static str,
    pub(crate) trajectory_id: Option<u64>,
    note: Option<String>,
    checked_s: f64,
    acted_s: f64,
}

impl fmt::Display for Changed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self.effect {
            "rests" => "nothing moves",
            "free" => "what runs stays free",
            "rerouted" => "the arm takes another way",
            "stopped" => "the arm stops on its path",
            _ => "the arm stops on its path, which may end beyond the first contact",
        };
        let (objects, revision) = (counted(self.objects, "object"), self.revision);
        write!(f, "{objects}, revision {revision}; {words}")?;
        match &self.note {
            Some(note) => write!(f, "\n{note}"),
            None => Ok(()),
        }
    }
}

/// Lists or changes the scene.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &SceneArgs) -> Result<(), Failure> {
    let arm = ArmName::read(settings)?;
    let client = Client::join(&arm.name)?;
    let mut port = ScenePort::open(&client)?;
    let changes = match &args.action {
        SceneAction::List => {
            let neighbours = neighbours(settings)?;
            return form.print(&Listed { neighbours, ..port.list(arm.name)? });
        }
        SceneAction::Add(add) => match &add.cloud {
            Some(file) => return form.print(&port.put(&arm.name, &cloud(file, add)?)?),
            None => additions(add)?,
        },
        SceneAction::Remove(of) => vec![SceneChange::Remove { name: of.name.clone() }],
        SceneAction::Move(to) => vec![port.relocation(to)?],
        SceneAction::Attach(of) => {
            vec![SceneChange::Attach { name: of.name.clone(), mass_kg: of.mass_kg }]
        }
        SceneAction::Detach(of) => vec![SceneChange::Detach { name: of.name.clone() }],
    };
    let mut changed = None;
    for some in changes.chunks(CHANGES_MAX) {
        changed = Some(port.change(&arm.name, some)?);
    }
    match changed {
        Some(changed) => form.print(&changed),
        None => Err(Failure::Usage("the file has no objects".to_owned())),
    }
}

/// How long first reports of neighbours are waited for.
const FIRST_REPORTS_S: f64 = 0.3;

/// What is known of the other arms.
fn neighbours(settings: Option<&Path>) -> Result<Vec<NeighbourStatus>, Failure> {
    let neighbours = open_neighbours(&arm::settings_to_talk(settings)?)?;
    let limit = Limit::after_s(FIRST_REPORTS_S);
    loop {
        neighbours.look();
        let words = neighbours.words();
        if words.iter().all(|words| words.report_age_s.is_some()) || limit.is_over() {
            let status = |NeighbourWords { name, report_age_s, what }| NeighbourStatus {
                name,
                report_age_s,
                state: what,
            };
            return Ok(words.into_iter().map(status).collect());
        }
        thread::sleep(LOOK_AGAIN);
    }
}

/// The way to the planner's scene.
pub(crate) struct ScenePort<'a> {
    // Ports go before their node.
    scene: SceneClient,
    events: Events,
    client: &'a Client,
}

impl<'a> ScenePort<'a> {
    pub(crate) fn open(client: &'a Client) -> Result<Self, Failure> {
        let (scene, events) = (client.wire().scene_client()?, client.wire().events(Topic::Plan));
        Ok(Self { scene, events, client })
    }

    fn ask(&mut self, request: &CheckedSceneRequest) -> Result<SceneOutcome, Failure> {
        let sent = self.scene.send_copy(SceneRequest::from(request));
        let pending = sent.map_err(|e| self.client.refused("send the change", &e))?;
        if pending.number_of_server_connections() == 0 {
            return Err(self.client.wire().not_running(PLANNER).into());
        }
        self.answer_to(&pending)
    }

    fn answer_to<P: fmt::Debug + ZeroCopySend>(
        &mut self,
        pending: &PendingResponse<ipc::Service, P, (), SceneReply, ()>,
    ) -> Result<SceneOutcome, Failure> {
        self.events.notify();
        let limit = Limit::after_s(ANSWER_S_MAX);
        loop {
            let reply = pending.receive().map_err(|e| self.client.refused("receive the answer", &e))?;
            match reply.map(|reply| SceneReply::outcome(reply.payload())) {
                Some(SceneOutcome::Refused { reason }) => return Err(Failure::Refused(reason)),
                Some(outcome) => return Ok(outcome),
                None if limit.is_over() => {
                    let arm = self.client.wire().arm().to_owned();
                    return Err(Failure::NoAnswer { who: PLANNER, arm, waited_s: ANSWER_S_MAX });
                }
                None => {
                    interrupt::check()?;
                    self.events.wait(LOOK_AGAIN);
                }
            }
        }
    }

    fn list(&mut self, arm: String) -> Result<Listed, Failure> {
        let (revision, objects, effect) = self.objects()?;
        let last_effect = Some(effect).filter(|effect| !effect.is_empty());
        let (objects, neighbours) = (objects.into_iter().map(object).collect(), Vec::new());
        Ok(Listed { arm, revision, objects, neighbours, last_effect })
    }

    /// All pages of one revision.
    fn objects(&mut self) -> Result<(u64, Vec<ListedObject>, String), Failure> {
        for _ in 0..LISTS_MAX {
            let (mut all, mut of) = (Vec::new(), None);
            loop {
                let first = all.len();
                let SceneOutcome::Listed { revision, total, objects, last_effect, .. } =
                    self.ask(&CheckedSceneRequest::List { first })?
                else {
                    return Err(no_sense());
                };
                if *of.get_or_insert(revision) != revision {
                    break;
                }
                let none = objects.is_empty();
                all.extend(objects);
                if all.len() >= total || none {
                    return Ok((revision, all, last_effect));
                }
                thread::yield_now();
            }
        }
        Err(Failure::Failed("the scene changes faster than it can be listed".to_owned()))
    }

    /// A change of place that keeps the rotation where none was given.
    fn relocation(&mut self, to: &MoveArgs) -> Result<SceneChange, Failure> {
        let (name, Triple(position_m)) = (to.name.clone(), to.at);
        let quaternion_xyzw = if to.rpy.is_some() {
            quaternion(to.rpy)
        } else {
            let (_, objects, _) = self.objects()?;
            // The planner refuses an unknown name, with those that exist.
            let known = objects.into_iter().find(|object| object.name == name);
            known.map_or(quaternion(None), |object| object.pose.quaternion_xyzw)
        };
        Ok(SceneChange::Move { name, pose: ObjectPose { position_m, quaternion_xyzw } })
    }

    /// Sends changes, up to 16 of them.
    pub(crate) fn change(&mut self, arm: &str, changes: &[SceneChange]) -> Result<Changed, Failure> {
        let outcome = self.ask(&CheckedSceneRequest::Change(changes.to_vec()))?;
        changed(arm, outcome)
    }

    /// Sends a point cloud.
    fn put(&mut self, arm: &str, cloud: &CheckedCloud) -> Result<Changed, Failure> {
        let clouds = self.client.wire().cloud_client()?;
        let sent = clouds.send_copy(*CloudRequest::new(cloud));
        let pending = sent.map_err(|e| self.client.refused("send the point cloud", &e))?;
        if pending.number_of_server_connections() == 0 {
            return Err(self.client.wire().not_running(PLANNER).into());
        }
        changed(arm, self.answer_to(&pending)?)
    }
}

/// What became of a change.
fn changed(arm: &str, outcome: SceneOutcome) -> Result<Changed, Failure> {
    let SceneOutcome::Changed { revision, total, effect, note, times_ns } = outcome else {
        return Err(no_sense());
    };
    let [received_ns, checked_ns, acted_ns] = times_ns;
    let after_s = |ns: u64| Duration::from_nanos(ns.saturating_sub(received_ns)).as_secs_f64();
    let trajectory_id = match effect {
        MotionEffect::Rerouted { trajectory_id } => Some(trajectory_id),
        MotionEffect::Rests | MotionEffect::Free | MotionEffect::Stopped | MotionEffect::StoppedLate => None,
    };
    Ok(Changed {
        arm: arm.to_owned(),
        revision,
        objects: total,
        effect: effect.word(),
        trajectory_id,
        note: Some(note).filter(|note| !note.is_empty()),
        checked_s: after_s(checked_ns),
        acted_s: after_s(acted_ns),
    })
}

/// The points of a file as a message.
fn cloud(file: &Path, add: &AddArgs) -> Result<CheckedCloud, Failure> {
    let (Some(name), Some(point_radius_m), Some(Triple(position_m))) =
        (&add.name, add.point_radius_m, add.at)
    else {
        return Err(Failure::Usage("scene add --cloud needs a name, --point-radius-m and --at".to_owned()));
    };
    let wrong = |(value, expected)| Failure::Usage(format!("{value}; expected {expected}"));
    let cloud = Cloud::load(file, 1.0, point_radius_m).map_err(wrong)?;
    let points = cloud.tree().points();
    if points.len() > CLOUD_POINTS_MAX {
        return Err(Failure::Usage(format!(
            "{} has {} points, and a message takes {CLOUD_POINTS_MAX}: thin them out, send several files, or put the file into the planner's scene",
            file.display(),
            points.len()
        )));
    }
    Ok(CheckedCloud {
        name: name.clone(),
        pose: ObjectPose { position_m, quaternion_xyzw: quaternion(add.rpy) },
        point_radius_m,
        points_m: points.iter().map(|p| [p.x, p.y, p.z]).collect(),
        replaces: add.replace,
    })
}

fn no_sense() -> Failure {
    Failure::Failed(
        "the planner's answer belongs to another question; use programs of one release".to_owned(),
    )
}

fn additions(add: &AddArgs) -> Result<Vec<SceneChange>, Failure> {
    if let Some(file) = &add.file {
        return arm::scene(file)?.obstacles.into_iter().map(|object| addition(object, add.replace)).collect();
    }
    let (Some(name), Some(shape), Some(Triple(position_m))) = (&add.name, add.shape(), add.at) else {
        return Err(Failure::Usage("scene add needs a name, a shape and --at, or --file".to_owned()));
    };
    Ok(vec![SceneChange::Add {
        name: name.clone(),
        shape,
        pose: ObjectPose { position_m, quaternion_xyzw: quaternion(add.rpy) },
        fixed_to: if add.tip { FixedTo::Tip } else { FixedTo::Base },
        mass_kg: add.mass_kg,
        replaces: add.replace,
    }])
}

fn addition(object: Obstacle, replaces: bool) -> Result<SceneChange, Failure> {
    let Obstacle { name, pose, shape } = object;
    let shape = match shape {
        Shape::Sphere { radius_m } => ObjectShape::Sphere { radius_m },
        Shape::Box { size_m } => ObjectShape::Box { size_m },
        Shape::Cylinder { radius_m, length_m } => ObjectShape::Cylinder { radius_m, length_m },
        Shape::Capsule { radius_m, length_m } => ObjectShape::Capsule { radius_m, length_m },
        Shape::Mesh { .. } | Shape::Hull { .. } | Shape::Cloud(_) => {
            return Err(Failure::Refused(format!(
                "{name}: a mesh or cloud cannot be added to a running planner; put it into the planner's scene file, or cover it by boxes, \
                 balls and capsules"
            )));
        }
    };
    let pose = ObjectPose {
        position_m: pose.translation.vector.into(),
        quaternion_xyzw: pose.rotation.coords.into(),
    };
    Ok(SceneChange::Add { name, shape, pose, fixed_to: FixedTo::Base, mass_kg: 0.0, replaces })
}

fn quaternion(rpy: Option<Triple>) -> [f64; 4] {
    let Triple([roll, pitch, yaw]) = rpy.unwrap_or(Triple([0.0; 3]));
    UnitQuaternion::from_euler_angles(roll, pitch, yaw).coords.into()
}

fn object(of: ListedObject) -> Object {
    let (shape, size_m) = match of.shape {
        ObjectShape::Sphere { radius_m } => ("sphere", vec![radius_m]),
        ObjectShape::Box { size_m } => ("box", size_m.to_vec()),
        ObjectShape::Cylinder { radius_m, length_m } => ("cylinder", vec![radius_m, length_m]),
        ObjectShape::Capsule { radius_m, length_m } => ("capsule", vec![radius_m, length_m]),
        ObjectShape::Mesh => ("mesh", Vec::new()),
        ObjectShape::Cloud => ("cloud", Vec::new()),
    };
    Object {
        name: of.name,
        shape,
        size_m,
        fixed_to: if of.fixed_to == FixedTo::Tip { "tip" } else { "base" },
        position_m: of.pose.position_m,
        quaternion_xyzw: of.pose.quaternion_xyzw,
        mass_kg: of.mass_kg,
    }
}
