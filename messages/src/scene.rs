//! Changes of the running planner's scene (request-response); `scene_reply` has its answers.
//!
//! One request is up to [`CHANGES_MAX`] changes that count together or not at all, so that a program which tracks several
//! objects moves them in one step. Each accepted request makes the next revision of the scene. Listing takes a page at a time.
use crate::LAYOUT_VERSION;
use iceoryx2::prelude::ZeroCopySend;

/// Most changes in a request.
pub const CHANGES_MAX: usize = 16;
/// Most objects in a page of the list.
pub const PAGE: usize = 16;
/// Most bytes of an object's name: letters, digits, `_`, `-` and `.`, as in scene files.
pub const OBJECT_NAME_BYTES: usize = 64;
/// Farthest coordinate, and longest edge, of an object, m.
pub const FAR_M: f64 = 100.0;
/// Heaviest object, kg.
pub const MASS_KG_MAX: f64 = 1e5;
/// A quaternion's length may differ from 1 by so much.
const UNIT_MAX: f64 = 1e-6;

/// The name of an object on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub(crate) struct WireName {
    len: u32,
    bytes: [u8; OBJECT_NAME_BYTES],
}

impl WireName {
    /// A name that does not fit keeps its length, so that the reader refuses it.
    pub(crate) fn new(name: &str) -> Self {
        let mut bytes = [0; OBJECT_NAME_BYTES];
        bytes.iter_mut().zip(name.bytes()).for_each(|(slot, byte)| *slot = byte);
        Self { len: u32::try_from(name.len()).unwrap_or(u32::MAX), bytes }
    }

    pub(crate) fn read(&self) -> Option<String> {
        let len = usize::try_from(self.len).ok()?;
        let name = self.bytes.get(..len).and_then(|bytes| std::str::from_utf8(bytes).ok())?;
        is_object_name(name).then(|| name.to_owned())
    }
}

/// True for a name that an object can have.
#[must_use]
pub fn is_object_name(name: &str) -> bool {
    let plain = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'.');
    (1..=OBJECT_NAME_BYTES).contains(&name.len()) && name.bytes().all(plain)
}

/// The shape of an object in its own axes; cylinders and capsules lie along z, around the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectShape {
    /// A ball.
    Sphere {
        /// Radius.
        radius_m: f64,
    },
    /// A box.
    Box {
        /// Full edge lengths.
        size_m: [f64; 3],
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius_m: f64,
        /// Full length.
        length_m: f64,
    },
    /// A cylinder with half balls at its ends.
    Capsule {
        /// Radius.
        radius_m: f64,
        /// Length between the centres of the balls.
        length_m: f64,
    },
    /// Triangles of the scene file, which no message carries; in a list only.
    Mesh,
    /// Points of the scene file, which no message carries; in a list only.
    Cloud,
}

impl ObjectShape {
    fn code(&self) -> (u32, [f64; 3]) {
        match *self {
            Self::Sphere { radius_m } => (1, [radius_m, 0.0, 0.0]),
            Self::Box { size_m } => (2, size_m),
            Self::Cylinder { radius_m, length_m } => (3, [radius_m, length_m, 0.0]),
            Self::Capsule { radius_m, length_m } => (4, [radius_m, length_m, 0.0]),
            Self::Mesh => (5, [0.0; 3]),
            Self::Cloud => (6, [0.0; 3]),
        }
    }

    /// The shape, when its sizes make sense.
    pub(crate) fn read(code: u32, size_m: [f64; 3]) -> Result<Self, What> {
        let [a, b, _] = size_m;
        let (shape, sizes): (Self, &[f64]) = match code {
            1 => (Self::Sphere { radius_m: a }, &[a]),
            2 => (Self::Box { size_m }, &size_m),
            3 => (Self::Cylinder { radius_m: a, length_m: b }, &[a, b]),
            4 => (Self::Capsule { radius_m: a, length_m: b }, &[a, b]),
            5 => (Self::Mesh, &[]),
            6 => (Self::Cloud, &[]),
            got => return Err(What::Shape { got }),
        };
        match sizes.iter().find(|size| !(**size > 0.0 && **size <= FAR_M)) {
            Some(&value_m) => Err(What::Size { value_m }),
            None => Ok(shape),
        }
    }
}

/// Where an object is, in the frame that it is fixed to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPose {
    /// Its origin.
    pub position_m: [f64; 3],
    /// Its axes: a unit quaternion x, y, z, w.
    pub quaternion_xyzw: [f64; 4],
}

impl ObjectPose {
    pub(crate) fn check(self) -> Result<Self, What> {
        if let Some(&value_m) = self.position_m.iter().find(|x| !(-FAR_M..=FAR_M).contains(*x)) {
            return Err(What::Position { value_m });
        }
        let length = self.quaternion_xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (length - 1.0).abs() <= UNIT_MAX { Ok(self) } else { Err(What::Quaternion { length }) }
    }
}

/// What an object is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixedTo {
    /// The base: an obstacle.
    Base,
    /// The tip: part of the arm, and of its payload.
    Tip,
}

/// One change of the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneChange {
    /// A new object.
    Add {
        /// Its name.
        name: String,
        /// Its shape.
        shape: ObjectShape,
        /// Where it is.
        pose: ObjectPose,
        /// What it is fixed to.
        fixed_to: FixedTo,
        /// What it weighs; counts while it is fixed to the tip.
        mass_kg: f64,
        /// True to take the place of an object of this name, false to refuse if there is one.
        replaces: bool,
    },
    /// An object has gone.
    Remove {
        /// Its name.
        name: String,
    },
    /// An object is elsewhere, in the frame that it is fixed to.
    Move {
        /// Its name.
        name: String,
        /// Where it is now.
        pose: ObjectPose,
    },
    /// The tip takes an object where it is.
    Attach {
        /// Its name.
        name: String,
        /// What it weighs.
        mass_kg: f64,
    },
    /// The tip leaves an object where it is.
    Detach {
        /// Its name.
        name: String,
    },
}

impl SceneChange {
    /// The object.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Add { name, .. }
            | Self::Remove { name }
            | Self::Move { name, .. }
            | Self::Attach { name, .. }
            | Self::Detach { name } => name,
        }
    }
}

/// What a request asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum CheckedSceneRequest {
    /// Changes, all or none.
    Change(Vec<SceneChange>),
    /// A page of the list.
    List {
        /// Index of its first object.
        first: usize,
    },
}

const ADD: u32 = 1;
const PUT: u32 = 2;
const REMOVE: u32 = 3;
const MOVE: u32 = 4;
const ATTACH: u32 = 5;
const DETACH: u32 = 6;

/// A change on the wire, and an object in a list.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub(crate) struct WireChange {
    pub(crate) change: u32,
    pub(crate) shape: u32,
    pub(crate) at_tip: u32,
    pub(crate) name: WireName,
    pub(crate) reserved: [u32; 2],
    pub(crate) position_m: [f64; 3],
    pub(crate) quaternion_xyzw: [f64; 4],
    pub(crate) size_m: [f64; 3],
    pub(crate) mass_kg: f64,
}

/// A request on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct SceneRequest {
    layout_version: u32,
    /// 0 for changes, 1 for a list.
    lists: u32,
    /// Of changes; of a list its first object.
    count: u32,
    sender_pid: u32,
    changes: [WireChange; CHANGES_MAX],
}

/// What is wrong with a number or a name.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum What {
    /// The name.
    #[error("its name is none; use 1 to {OBJECT_NAME_BYTES} letters, digits, '_', '-' or '.'")]
    Name,
    /// The kind of change.
    #[error("unknown kind of change {got}")]
    Kind {
        /// The code in the message.
        got: u32,
    },
    /// The kind of shape.
    #[error("unknown kind of shape {got}")]
    Shape {
        /// The code in the message.
        got: u32,
    },
    /// Triangles do not come by message.
    #[error(
        "a mesh cannot be added to a running planner; put it into the scene file, or cover it by boxes, balls and capsules"
    )]
    Mesh,
    /// A size.
    #[error("a size is {value_m} m; it must be above 0 and at most {FAR_M} m")]
    Size {
        /// The value in the message.
        value_m: f64,
    },
    /// A coordinate.
    #[error("a coordinate is {value_m} m; it must be from -{FAR_M} to {FAR_M} m")]
    Position {
        /// The value in the message.
        value_m: f64,
    },
    /// A rotation.
    #[error("its quaternion has length {length}; it must be 1")]
    Quaternion {
        /// Of the quaternion in the message.
        length: f64,
    },
    /// A mass.
    #[error("its mass is {value_kg} kg; it must be from 0 to {MASS_KG_MAX} kg")]
    Mass {
        /// The value in the message.
        value_kg: f64,
    },
    /// What it is fixed to.
    #[error("unknown frame {got}; 0 (base) or 1 (tip)")]
    Frame {
        /// The code in the message.
        got: u32,
    },
}

/// Why a request is refused before it is looked at further.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SceneRequestError {
    /// Written by another version.
    #[error("layout version {got}, expected {LAYOUT_VERSION}; use sender and planner of one release")]
    Layout {
        /// The version in the message.
        got: u32,
    },
    /// Neither changes nor a list.
    #[error("unknown kind of request {got}; 0 (changes) or 1 (list)")]
    Request {
        /// The code in the message.
        got: u32,
    },
    /// No change, or too many.
    #[error("{got} changes; a request has 1 to {CHANGES_MAX}")]
    Count {
        /// The count in the message.
        got: u32,
    },
    /// A change that makes no sense.
    #[error("change {}: {what}", index + 1)]
    Change {
        /// Zero-based index of the change.
        index: usize,
        /// What is wrong with it.
        what: What,
    },
}

/// Nobody and nowhere.
pub(crate) const NOTHING: WireChange = WireChange {
    change: 0,
    shape: 0,
    at_tip: 0,
    name: WireName { len: 0, bytes: [0; OBJECT_NAME_BYTES] },
    reserved: [0; 2],
    position_m: [0.0; 3],
    quaternion_xyzw: [0.0, 0.0, 0.0, 1.0],
    size_m: [0.0; 3],
    mass_kg: 0.0,
};

impl WireChange {
    fn of(change: &SceneChange) -> Self {
        let named = Self { name: WireName::new(change.name()), ..NOTHING };
        match change {
            SceneChange::Add { shape, pose, fixed_to, mass_kg, replaces, .. } => Self {
                change: if *replaces { PUT } else { ADD },
                mass_kg: *mass_kg,
                ..named.object(shape, pose, *fixed_to)
            },
            SceneChange::Remove { .. } => Self { change: REMOVE, ..named },
            SceneChange::Move { pose, .. } => Self { change: MOVE, ..named.at(pose) },
            SceneChange::Attach { mass_kg, .. } => Self { change: ATTACH, mass_kg: *mass_kg, ..named },
            SceneChange::Detach { .. } => Self { change: DETACH, ..named },
        }
    }

    fn at(self, pose: &ObjectPose) -> Self {
        Self { position_m: pose.position_m, quaternion_xyzw: pose.quaternion_xyzw, ..self }
    }

    pub(crate) fn object(self, shape: &ObjectShape, pose: &ObjectPose, fixed_to: FixedTo) -> Self {
        let (shape, size_m) = shape.code();
        Self { shape, size_m, at_tip: u32::from(fixed_to == FixedTo::Tip), ..self.at(pose) }
    }

    pub(crate) fn pose(&self) -> Result<ObjectPose, What> {
        ObjectPose { position_m: self.position_m, quaternion_xyzw: self.quaternion_xyzw }.check()
    }

    pub(crate) fn fixed_to(&self) -> Result<FixedTo, What> {
        match self.at_tip {
            0 => Ok(FixedTo::Base),
            1 => Ok(FixedTo::Tip),
            got => Err(What::Frame { got }),
        }
    }

    pub(crate) fn mass_kg(&self) -> Result<f64, What> {
        let value_kg = self.mass_kg;
        if (0.0..=MASS_KG_MAX).contains(&value_kg) { Ok(value_kg) } else { Err(What::Mass { value_kg }) }
    }

    fn read(&self) -> Result<SceneChange, What> {
        let name = self.name.read().ok_or(What::Name)?;
        Ok(match self.change {
            ADD | PUT => SceneChange::Add {
                name,
                shape: Some(ObjectShape::read(self.shape, self.size_m)?)
                    .filter(|shape| !matches!(shape, ObjectShape::Mesh | ObjectShape::Cloud))
                    .ok_or(What::Mesh)?,
                pose: self.pose()?,
                fixed_to: self.fixed_to()?,
                mass_kg: self.mass_kg()?,
                replaces: self.change == PUT,
            },
            REMOVE => SceneChange::Remove { name },
            MOVE => SceneChange::Move { name, pose: self.pose()? },
            ATTACH => SceneChange::Attach { name, mass_kg: self.mass_kg()? },
            DETACH => SceneChange::Detach { name },
            got => return Err(What::Kind { got }),
        })
    }
}

impl SceneRequest {
    /// The process that asks, as it says itself: whether it lives is looked up, and nothing else hangs on it.
    #[must_use]
    pub fn sender_pid(&self) -> u32 {
        self.sender_pid
    }
}

impl From<&CheckedSceneRequest> for SceneRequest {
    /// Changes beyond [`CHANGES_MAX`] are counted and not carried, so that the reader refuses them.
    fn from(request: &CheckedSceneRequest) -> Self {
        let mut changes = [NOTHING; CHANGES_MAX];
        let (lists, count) = match request {
            CheckedSceneRequest::Change(all) => {
                changes.iter_mut().zip(all).for_each(|(slot, change)| *slot = WireChange::of(change));
                (0, all.len())
            }
            CheckedSceneRequest::List { first } => (1, *first),
        };
        Self {
            layout_version: LAYOUT_VERSION,
            lists,
            count: u32::try_from(count).unwrap_or(u32::MAX),
            sender_pid: std::process::id(),
            changes,
        }
    }
}

impl TryFrom<&SceneRequest> for CheckedSceneRequest {
    type Error = SceneRequestError;

    fn try_from(r: &SceneRequest) -> Result<Self, SceneRequestError> {
        if r.layout_version != LAYOUT_VERSION {
            return Err(SceneRequestError::Layout { got: r.layout_version });
        }
        let count = usize::try_from(r.count).unwrap_or(usize::MAX);
        match r.lists {
            0 if (1..=CHANGES_MAX).contains(&count) => {
                let all = r.changes.iter().take(count).enumerate().map(|(index, change)| {
                    change.read().map_err(|what| SceneRequestError::Change { index, what })
                });
                Ok(Self::Change(all.collect::<Result<_, _>>()?))
            }
            0 => Err(SceneRequestError::Count { got: r.count }),
            1 => Ok(Self::List { first: count }),
            got => Err(SceneRequestError::Request { got }),
        }
    }
}

const _: () = assert!(size_of::<SceneRequest>() == 16 + CHANGES_MAX * 176);
