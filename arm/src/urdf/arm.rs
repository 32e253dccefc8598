//! The arm in a URDF: the chain from base to tip, or the tree to several tips, and the geometry that hangs on it.
//!
//! Links are gathered by the frame that they are rigid with: frame 0 is the base link, frame i the link behind the i-th
//! joint of the arm, or the tip link that is rigid with it. Joints that lead to no tip do not move.
use super::mesh_part::MeshPart;
use super::model::{Inertial, Joint, Kind, Link, Model, Origin, Solid, StatedLimits};
use super::tree::Tree;
use super::xml::{self, Context, Element};
use super::{package, srdf};
use crate::document::{self, shown};
use crate::mass::{LinkMass, Weight};
use crate::mesh;
use crate::modelled::Listed;
use crate::named_pose::GroupState;
use crate::reader::{FaultList, Table};
use crate::robot::LinkShape;
use crate::scene::{self, Shape};
use nalgebra::{Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::PathBuf;
use taustream_motion::chain::{ChainJoint, Pose};
use taustream_motion::{JointKind, MAX_JOINTS};

/// Keys of a robot file that say where a URDF is and which part of it is the arm.
pub(crate) const KEYS: [&str; 6] = ["urdf", "srdf", "tip_link", "tip_links", "base_link", "package_dirs"];

/// What a URDF says about a joint of the arm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointInfo {
    pub(crate) name: String,
    pub(crate) kind: JointKind,
    /// Range (rad, or m); none for continuous joints, and where the file states none.
    pub(crate) position_rad: Option<[f64; 2]>,
    /// In rad, or m, and s.
    pub(crate) limits: StatedLimits,
}

/// A solid part with its mesh read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SolidPart {
    pub(crate) link: usize,
    pub(crate) origin: Origin,
    /// One; of a mesh, one or more hulls.
    pub(crate) shapes: Vec<Shape>,
    /// Of a mesh: the hash of its file, and its scale.
    pub(crate) mesh: Option<([u8; 32], [f64; 3])>,
}

/// A joint that is held still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FixedJoint {
    pub(crate) joint: usize,
    /// rad or m.
    pub(crate) position: f64,
}

/// A checked arm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UrdfArm {
    pub(crate) model: Model,
    pub(crate) tree: Tree,
    /// Index of the base link.
    pub(crate) base: usize,
    /// Indices of the tip links.
    pub(crate) tips: Vec<usize>,
    /// The joints from the base to the tips that move, each after those that carry it.
    pub(crate) moving: Vec<usize>,
    pub(crate) fixed_joints: Vec<FixedJoint>,
    pub(crate) parts: Vec<SolidPart>,
    /// Links that are acknowledged to have no shape, some of whose meshes could not be read.
    pub(crate) skipped: Vec<usize>,
    /// Pairs that may touch by the SRDF, lower index first, in rising order.
    pub(crate) allowed: Vec<(usize, usize)>,
    /// Group states of the SRDF.
    pub(crate) states: Vec<GroupState>,
    /// What was left out, as text.
    pub(crate) notices: Vec<String>,
}

/// The keys of the robot file, read.
struct Keys {
    urdf: PathBuf,
    srdf: Option<PathBuf>,
    /// `tip_link` or `tip_links`, and what it says.
    tips: Option<(&'static str, Vec<String>)>,
    base_link: Option<String>,
    package_dirs: Vec<PathBuf>,
}

impl UrdfArm {
    /// Takes its keys from a robot file and reads what they name; faults go into the table's book.
    pub(crate) fn read(top: &mut Table<'_>, listed: &[Listed]) -> Option<Self> {
        let keys = read_keys(top)?;
        let own = FaultList::new(&keys.urdf);
        let model = read_model(&own);
        let tree = model.as_ref().and_then(|model| Tree::of(&own, model));
        let (model, tree) = match own.close(model.zip(tree)) {
            Ok(both) => both,
            Err(faults) => {
                top.fault_list().merge(faults);
                return None;
            }
        };
        let own = FaultList::new(&keys.urdf);
        let parts = read_parts(&own, &model, (&keys, listed));
        let faults = own.close(Some(())).err();
        faults.into_iter().for_each(|faults| top.fault_list().merge(faults));
        let semantics =
            keys.srdf.as_ref().map(|file| srdf::load(top.fault_list(), file, &model)).unwrap_or_default();
        let (allowed, states) = (semantics.allowed, semantics.states);
        let (tip_key, tip_names) = keys.tips.clone().unwrap_or(("tip_link", Vec::new()));
        let tips: Vec<Option<usize>> =
            tip_names.iter().map(|name| named_link(top, &model, &tree, tip_key, Some(name))).collect();
        let base = match &keys.base_link {
            Some(name) => named_link(top, &model, &tree, "base_link", Some(name)),
            None => tree.order.first().copied(),
        };
        let base = base?;
        let tips = tips.into_iter().collect::<Option<Vec<usize>>>().filter(|tips| !tips.is_empty())?;
        let mut paths: Vec<Vec<usize>> = Vec::new();
        for tip in &tips {
            paths.push(path(top, &model, &tree, (base, *tip), tip_key)?);
        }
        let moving = moving(top, &model, (tip_key, &paths))?;
        check_tips(top, (tip_key, &tip_names), &paths, &moving)?;
        let (parts, skipped, mut notices) = parts?;
        let fixed_joints = fixed_joints(&model, &moving, &mut notices);
        say_bare_links(&model, &mut notices);
        say_odd_moments(&model, &mut notices);
        let arm =
            Self { model, tree, base, tips, moving, fixed_joints, parts, skipped, allowed, states, notices };
        top.fault_list().is_clean().then_some(arm)
    }
    /// What the file says about the arm's joints, base to tip.
    pub(crate) fn joints(&self) -> Vec<JointInfo> {
        let joint_info = |joint: &Joint| JointInfo {
            name: joint.name.clone(),
            kind: moving_kind(joint),
            position_rad: if joint.kind == Kind::Continuous { None } else { joint.position },
            limits: joint.limits,
        };
        self.moving.iter().filter_map(|joint| self.model.joints.get(*joint)).map(joint_info).collect()
    }
    /// The links' names, in the order of the file.
    pub(crate) fn links(&self) -> Vec<String> {
        self.model.links.iter().map(|link| link.name.clone()).collect()
    }
    /// Names of the base link and the first tip link.
    pub(crate) fn ends(&self) -> Option<[String; 2]> {
        let name = |link: usize| self.model.links.get(link).map(|link| link.name.clone());
        Some([name(self.base)?, name(*self.tips.first()?)?])
    }
    /// The tips, each with the joints of the arm that move it, base first.
    pub(crate) fn tips(&self) -> Vec<(String, Vec<usize>)> {
        let name = |link: usize| self.model.links.get(link).map_or(String::new(), |link| link.name.clone());
        let tip = |link: &usize| (name(*link), self.movers(*link));
        self.tips.iter().map(tip).collect()
    }
    /// The joints of the arm that move a link, base first, counted in the order of the arm.
    fn movers(&self, link: usize) -> Vec<usize> {
        let path = self.tree.path(&self.model, self.base, link).unwrap_or_default();
        path.iter().filter_map(|joint| self.moving.iter().position(|moving| moving == joint)).collect()
    }
    /// The tip link that is rigid with a frame, if there is one.
    fn tip_of(&self, frame: usize) -> Option<usize> {
        self.tips.iter().copied().find(|tip| self.movers(*tip).last().map_or(0, |joint| joint + 1) == frame)
    }
    /// Names of the links that have no collision geometry.
    pub(crate) fn bare_links(&self) -> Vec<String> {
        self.model.links.iter().filter(|link| link.parts.is_empty()).map(|link| link.name.clone()).collect()
    }
    /// Names of the links that move and have no shape: those that can be seen or have a mass, and the first link behind each
    /// joint of the arm when nothing that is rigid with it has one.
    pub(crate) fn moving_bare_links(&self) -> Vec<String> {
        let placed = self.placed();
        let frame = |link: usize| placed.get(link).map_or(0, |(frame, _)| *frame);
        let is_bare = |link: usize| self.parts.iter().all(|part| part.link != link);
        let is_frame_bare = |of: usize| self.parts.iter().all(|part| frame(part.link) != of);
        let is_first = |link: usize| {
            self.tree
                .joint_before
                .get(link)
                .copied()
                .flatten()
                .is_some_and(|joint| self.moving.contains(&joint))
        };
        let links = self.model.links.iter().enumerate();
        let unmodelled = links.filter(|(index, link)| {
            let is_body = link.is_visible || link.inertial.is_some_and(|inertial| inertial.mass_kg > 0.0);
            let alone = is_first(*index) && is_frame_bare(frame(*index));
            let skipped = self.skipped.contains(index);
            frame(*index) > 0 && (skipped || (is_bare(*index) && (is_body || alone)))
        });
        unmodelled.map(|(_, link)| link.name.clone()).collect()
    }
    /// The joints, each with the frame that it stands in; fixed joints are part of what stands before the next joint that moves, or
    /// between the last one and a tip.
    pub(crate) fn chain(&self) -> Vec<(ChainJoint, usize)> {
        let origins = |mut before: Pose, path: &[usize]| {
            path.iter()
                .filter_map(|joint| self.model.joints.get(*joint))
                .for_each(|joint| before *= pose(&joint.origin));
            before
        };
        // From the link behind a joint to the tip that is rigid with it.
        let to_tip = |index: usize| -> Option<Pose> {
            let joint = self.model.joints.get(*self.moving.get(index)?)?;
            let path = self.tree.path(&self.model, joint.child, self.tip_of(index + 1)?)?;
            Some(origins(Pose::identity(), &path))
        };
        let posts: Vec<Option<Pose>> = (0..self.moving.len()).map(to_tip).collect();
        let chain_joint = |(index, joint): (usize, &usize)| {
            let of = self.model.joints.get(*joint)?;
            let parent = self.movers(of.parent).last().copied();
            let from = match parent {
                Some(parent) => self.model.joints.get(*self.moving.get(parent)?)?.child,
                None => self.base,
            };
            let path = self.tree.path(&self.model, from, of.child)?;
            // A frame that a tip stands in is that tip's.
            let tip = parent.and_then(|parent| posts.get(parent).copied().flatten());
            let pre = origins(tip.map_or(Pose::identity(), |tip| tip.inverse()), &path);
            let axis = Unit::new_normalize(Vector3::from(of.axis));
            let post = posts.get(index).copied().flatten().unwrap_or_default();
            let kind = moving_kind(of);
            Some((ChainJoint { kind, pre, axis, offset: 0.0, post }, parent.map_or(0, |parent| parent + 1)))
        };
        self.moving.iter().enumerate().filter_map(chain_joint).collect()
    }
    /// The pose of each link: the frame that it is rigid with, and its pose there.
    pub(crate) fn placed(&self) -> Vec<(usize, Pose)> {
        let mut placed = vec![(0, Pose::identity()); self.model.links.len()];
        for &link in &self.tree.order {
            let joint = self.tree.joint_before.get(link).copied().flatten();
            let Some((index, joint)) = joint.and_then(|index| Some((index, self.model.joints.get(index)?)))
            else {
                continue;
            };
            let before = placed.get(joint.parent).copied().unwrap_or_default();
            let here = match self.moving.iter().position(|moving| *moving == index) {
                Some(moving) => (moving + 1, Pose::identity()),
                None => (before.0, before.1 * pose(&joint.origin) * self.motion(index, joint)),
            };
            if let Some(slot) = placed.get_mut(link) {
                *slot = here;
            }
        }
        // Frame 0 is the base link and not the root, the frame of a tip that tip and not the link behind its joint.
        let inside = |link: usize| placed.get(link).map_or(Pose::identity(), |(_, pose)| pose.inverse());
        let from: Vec<Option<Pose>> = (0..=self.moving.len())
            .map(|frame| if frame == 0 { Some(self.base) } else { self.tip_of(frame) }.map(inside))
            .collect();
        for (frame, pose) in &mut placed {
            if let Some(from) = from.get(*frame).copied().flatten() {
                *pose = from * *pose;
            }
        }
        placed
    }
    /// The motion of a joint that is held; none for the others.
    fn motion(&self, index: usize, joint: &Joint) -> Pose {
        let Some(fixed_joints) = self.fixed_joints.iter().find(|fixed_joints| fixed_joints.joint == index)
        else {
            return Pose::identity();
        };
        let axis = Unit::new_normalize(Vector3::from(joint.axis));
        match joint.kind {
            Kind::Revolute | Kind::Continuous => Pose::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&axis, fixed_joints.position),
            ),
            Kind::Prismatic => Pose::from_parts(
                (axis.into_inner() * fixed_joints.position).into(),
                UnitQuaternion::identity(),
            ),
            // At 0 these two change nothing.
            Kind::Fixed | Kind::Planar | Kind::Floating => Pose::identity(),
        }
    }
    /// The solid parts in their frames.
    pub(crate) fn shapes(&self) -> Vec<LinkShape> {
        let placed = self.placed();
        let mut shapes = Vec::new();
        for part in &self.parts {
            let (frame, link_pose) = placed.get(part.link).copied().unwrap_or_default();
            let pose = link_pose * pose(&part.origin);
            let shape = |shape: &Shape| LinkShape { link: part.link, frame, pose, shape: shape.clone() };
            shapes.extend(part.shapes.iter().map(shape));
        }
        shapes
    }
    /// The links' masses in their frames.
    pub(crate) fn masses(&self) -> Vec<LinkMass> {
        let placed = self.placed();
        let links = self.model.links.iter().zip(placed).enumerate();
        let mass = |(index, (link, (frame, link_pose))): (usize, (&Link, (usize, Pose)))| {
            let inertial = link.inertial?;
            let own = weight(&inertial);
            let moments = if own.is_possible() { own } else { Weight { inertia_kg_m2: [0.0; 6], ..own } };
            Some(LinkMass::placed(&moments, index, (frame, link_pose * pose(&inertial.origin))))
        };
        links.filter_map(mass).collect()
    }
    /// Links with geometry that meet at a joint; links without any between them do not count, as in set-up assistants.
    pub(crate) fn neighbours(&self) -> Vec<(usize, usize)> {
        let is_solid = |link: usize| self.model.links.get(link).is_some_and(|link| !link.parts.is_empty());
        let before = |link: usize| {
            self.model.joints.get((*self.tree.joint_before.get(link)?)?).map(|joint| joint.parent)
        };
        let mut pairs = Vec::new();
        for link in (0..self.model.links.len()).filter(|link| is_solid(*link)) {
            let mut other = before(link);
            while let Some(bare) = other.filter(|link| !is_solid(*link)) {
                other = before(bare);
            }
            pairs.extend(other.map(|other| (link.min(other), link.max(other))));
        }
        pairs.sort_unstable();
        pairs
    }
}

/// The weight of a link in the frame of its origin.
fn weight(inertial: &Inertial) -> Weight {
    let Inertial { mass_kg, origin: _, inertia_kg_m2 } = *inertial;
    Weight { mass_kg, center_m: [0.0; 3], inertia_kg_m2 }
}

/// Moments that no body has: files that are not used for simulation often have them, and no setpoint depends on them.
fn say_odd_moments(model: &Model, notices: &mut Vec<String>) {
    let is_odd = |link: &&Link| link.inertial.is_some_and(|inertial| !weight(&inertial).is_possible());
    for link in model.links.iter().filter(is_odd) {
        let name = shown(&link.name);
        notices.push(format!(
            "link {name}: its moments of inertia belong to no body; its mass counts as a point for energies"
        ));
    }
}

/// The pose of an origin.
fn pose(origin: &Origin) -> Pose {
    scene::pose(origin.xyz_m, origin.rpy_rad)
}

fn read_keys(top: &mut Table<'_>) -> Option<Keys> {
    let robot_file = top.fault_list().file().to_owned();
    let beside = |named: &str| document::beside(&robot_file, named);
    let urdf = top.text("urdf", "the path of a URDF file, relative to this file");
    let srdf = top.text_if_there("srdf", "the path of an SRDF file, relative to this file");
    let tips = read_tips(top);
    let base_link =
        top.text_if_there("base_link", "the name of the link whose frame is the base (default: the root)");
    let package_dirs = read_package_dirs(top);
    Some(Keys {
        urdf: beside(&urdf?),
        srdf: srdf.map(|named| beside(&named)),
        tips,
        base_link,
        package_dirs: package_dirs.iter().map(|named| beside(named)).collect(),
    })
}

/// The tip link, or several.
fn read_tips(top: &mut Table<'_>) -> Option<(&'static str, Vec<String>)> {
    const ONE: &str = "tip_link";
    const SEVERAL: &str = "tip_links";
    const EXPECTED: &str = "a list of links, each once, whose frames are tips";
    if !top.has(SEVERAL) {
        top.take(SEVERAL);
        return Some((ONE, vec![top.text(ONE, "the name of the link whose frame is the tip")?]));
    }
    let names = read_texts(top, SEVERAL, EXPECTED);
    if top.take(ONE).is_some() {
        top.fault(ONE, "given beside tip_links", "one of the two");
        return None;
    }
    let is_repeated = |(i, name): (usize, &String)| names.iter().take(i).any(|other| other == name);
    if let Some(name) = names.iter().enumerate().find(|named| is_repeated(*named)).map(|(_, name)| name) {
        top.fault(SEVERAL, &shown(name), "each tip once");
        return None;
    }
    if names.is_empty() && top.fault_list().is_clean() {
        top.fault(SEVERAL, "[]", EXPECTED);
    }
    (!names.is_empty()).then_some((SEVERAL, names))
}

fn read_package_dirs(top: &mut Table<'_>) -> Vec<String> {
    read_texts(top, "package_dirs", "a list of folders that packages are looked for in")
}

/// A list of texts; none when the key is not there.
fn read_texts(top: &mut Table<'_>, key: &'static str, expected: &str) -> Vec<String> {
    let Some(node) = top.take(key) else { return Vec::new() };
    let texts = node.value.texts();
    if texts.is_none() {
        top.fault(key, &node.to_string(), expected);
    }
    texts.unwrap_or_default()
}

fn read_model(fault_list: &FaultList) -> Option<Model> {
    let text = xml::read(fault_list.file(), "a URDF file").map_err(|faults| fault_list.merge(faults)).ok()?;
    let document = xml::parse(fault_list.file(), &text).map_err(|faults| fault_list.merge(faults)).ok()?;
    let context = Context::new(fault_list, &text);
    Model::read(&context, &Element::robot(&context, &document)?)
}

/// The parts with their meshes, the links that are acknowledged to lack some, and what is to be said about them.
fn read_parts(
    fault_list: &FaultList,
    model: &Model,
    (keys, listed): (&Keys, &[Listed]),
) -> Option<(Vec<SolidPart>, Vec<usize>, Vec<String>)> {
    let mut read: BTreeMap<(PathBuf, [u64; 3]), Result<MeshPart, mesh::Refusal>> = BTreeMap::new();
    let (mut parts, mut skipped, mut notices) = (Vec::new(), Vec::new(), Vec::new());
    let all =
        model.links.iter().enumerate().flat_map(|(i, link)| link.parts.iter().map(move |p| (i, link, p)));
    for (link, of, part) in all {
        let (shapes, mesh) = match &part.solid {
            Solid::Primitive(shape) => (vec![shape.clone()], None),
            Solid::Mesh { named, scale } => {
                let file = package::find(&keys.urdf, &keys.package_dirs, named);
                let made = file.map_err(|expected| (shown(named), expected)).and_then(|file| {
                    let key = (file.clone(), scale.map(f64::to_bits));
                    read.entry(key).or_insert_with(|| MeshPart::load(&file, *scale)).clone()
                });
                match made {
                    Ok(made) => {
                        notices.push(format!("{}: {}", part.path, made.words));
                        (made.shapes, Some((made.digest, *scale)))
                    }
                    Err((value, expected)) if listed.iter().any(|listed| listed.name == of.name) => {
                        notices.push(format!("{}: not read ({value}: expected {expected})", part.path));
                        skipped.push(link);
                        continue;
                    }
                    Err((value, expected)) => {
                        let expected =
                            format!("{expected}; or unmodelled_links = [{:?}] in the robot file", of.name);
                        let key = format!("{}.geometry.mesh.filename", part.path);
                        fault_list.add(part.line, &key, &value, &expected);
                        continue;
                    }
                }
            }
        };
        parts.push(SolidPart { link, origin: part.origin, shapes, mesh });
    }
    fault_list.is_clean().then_some((parts, skipped, notices))
}

fn named_link(
    top: &Table<'_>,
    model: &Model,
    tree: &Tree,
    key: &'static str,
    name: Option<&str>,
) -> Option<usize> {
    let name = name?;
    let link = model.link(name);
    if link.is_none() {
        // Most often the tip is one of the ends.
        let is_end = |link: &usize| model.joints.iter().all(|joint| joint.parent != *link);
        let ends = tree.order.iter().filter(|link| is_end(link)).filter_map(|link| model.links.get(*link));
        let ends: Vec<&str> = ends.take(12).map(|link| link.name.as_str()).collect();
        let root =
            tree.order.first().and_then(|link| model.links.get(*link)).map_or("", |link| link.name.as_str());
        let expected = format!(
            "a link of robot {}; its root is {root}, its ends are {}",
            shown(&model.name),
            ends.join(", ")
        );
        top.fault(key, &shown(name), &expected);
    }
    link
}

fn path(
    top: &Table<'_>,
    model: &Model,
    tree: &Tree,
    (base, tip): (usize, usize),
    key: &'static str,
) -> Option<Vec<usize>> {
    let path = tree.path(model, base, tip);
    if path.is_none() {
        let name = |link: usize| model.links.get(link).map_or(String::new(), |link| shown(&link.name));
        top.fault(key, &name(tip), &format!("a link that hangs on the base link {}", name(base)));
    }
    path
}

/// How a joint of the arm moves.
fn moving_kind(joint: &Joint) -> JointKind {
    match joint.kind {
        Kind::Prismatic => JointKind::Prismatic,
        Kind::Fixed | Kind::Revolute | Kind::Continuous | Kind::Planar | Kind::Floating => {
            JointKind::Revolute
        }
    }
}

/// The joints of the arm, revolute, continuous or prismatic ones, each free, in the order of the paths to the tips.
fn moving(top: &Table<'_>, model: &Model, (key, paths): (&'static str, &[Vec<usize>])) -> Option<Vec<usize>> {
    let (mut moving, mut seen) = (Vec::new(), Vec::new());
    for (index, joint) in paths.iter().flatten().filter_map(|index| Some((*index, model.joints.get(*index)?)))
    {
        // Two paths begin alike where their tips share a torso.
        if seen.contains(&index) {
            continue;
        }
        seen.push(index);
        let value = format!("joint {} ({}) between base and tip", shown(&joint.name), joint.kind.word());
        match (joint.kind, &joint.mimic) {
            (Kind::Fixed, _) => {}
            (Kind::Revolute | Kind::Continuous | Kind::Prismatic, None) => moving.push(index),
            (Kind::Revolute | Kind::Continuous | Kind::Prismatic, Some(mimic)) => {
                let expected = "joints that each have a servo of their own; linkages are not supported";
                top.fault(key, &format!("{value}, which follows joint {}", shown(&mimic.joint)), expected);
            }
            (Kind::Planar | Kind::Floating, _) => {
                let expected = "revolute, continuous, prismatic and fixed joints only: each has one servo";
                top.fault(key, &value, expected);
            }
        }
    }
    if (1..=MAX_JOINTS).contains(&moving.len()) {
        return Some(moving);
    }
    let where_from = if paths.len() > 1 { "the tips together" } else { "tip" };
    let expected = format!("1 to {MAX_JOINTS} joints between base and {where_from}");
    top.fault(key, &format!("{} joints that move", moving.len()), &expected);
    None
}

/// Every tip is moved, and each by a joint of its own: a frame is one tip's.
fn check_tips(
    top: &Table<'_>,
    (key, names): (&'static str, &[String]),
    paths: &[Vec<usize>],
    moving: &[usize],
) -> Option<()> {
    let last = |path: &Vec<usize>| path.iter().rev().find(|joint| moving.contains(joint)).copied();
    let mut others: Vec<(usize, &String)> = Vec::new();
    for (name, path) in names.iter().zip(paths) {
        let Some(joint) = last(path) else {
            top.fault(key, &shown(name), "a link that a joint moves against the base");
            return None;
        };
        if let Some((_, other)) = others.iter().find(|(known, _)| *known == joint) {
            let value = format!("{} and {}", shown(other), shown(name));
            top.fault(
                key,
                &value,
                "tips that each hang on a joint of their own: these two are rigid with each other",
            );
            return None;
        }
        others.push((joint, name));
    }
    Some(())
}

/// Joints off the chain stay where they are; at 0, or as near to it as their range goes.
fn fixed_joints(model: &Model, moving: &[usize], notices: &mut Vec<String>) -> Vec<FixedJoint> {
    let mut fixed_joints = Vec::new();
    for (index, joint) in model.joints.iter().enumerate() {
        if joint.kind == Kind::Fixed || moving.contains(&index) {
            continue;
        }
        let free = joint.mimic.as_ref().map_or(0.0, |mimic| mimic.offset);
        let position = match (joint.kind, joint.position) {
            (Kind::Revolute | Kind::Prismatic, Some([low, high])) => free.clamp(low, high),
            (Kind::Planar | Kind::Floating, _) => 0.0,
            (Kind::Fixed | Kind::Continuous, _) | (Kind::Revolute | Kind::Prismatic, None) => free,
        };
        let unit = if joint.kind == Kind::Prismatic { "m" } else { "rad" };
        let why = match &joint.mimic {
            Some(mimic) => format!("is to follow joint {}, which is ignored", shown(&mimic.joint)),
            None => "is not between base and tip".to_owned(),
        };
        notices.push(format!(
            "joint {} ({}) {why}: held at {position} {unit}",
            shown(&joint.name),
            joint.kind.word()
        ));
        fixed_joints.push(FixedJoint { joint: index, position });
    }
    fixed_joints
}

/// A link that can be seen but not touched is most often an oversight.
fn say_bare_links(model: &Model, notices: &mut Vec<String>) {
    for link in model.links.iter().filter(|link| link.parts.is_empty() && link.is_visible) {
        notices.push(format!(
            "link {} has visual but no collision geometry: NOTHING keeps it from being hit",
            shown(&link.name)
        ));
    }
}
