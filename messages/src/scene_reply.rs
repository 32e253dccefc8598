//! What the planner answers to changes of its scene.
use crate::scene::{FixedTo, NOTHING, ObjectPose, ObjectShape, PAGE, What, WireChange, WireName};
use crate::{LAYOUT_VERSION, Text};
use iceoryx2::prelude::ZeroCopySend;

/// An object of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedObject {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: ObjectShape,
    /// Where it is.
    pub pose: ObjectPose,
    /// What it is fixed to.
    pub fixed_to: FixedTo,
    /// What it weighs.
    pub mass_kg: f64,
}

/// What a change means for the motion that runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionEffect {
    /// Nothing runs.
    Rests,
    /// What runs, and what waits, stays free.
    Free,
    /// A proven replacement leads to the same goal by another way.
    Rerouted {
        /// It.
        trajectory_id: u64,
    },
    /// The arm stops on its path before the contact.
    Stopped,
    /// The arm stops on its path, and that may end beyond the first contact.
    StoppedLate,
}

impl MotionEffect {
    /// Its code, and the trajectory that belongs to it.
    fn code(self) -> (u32, u64) {
        match self {
            Self::Rests => (0, 0),
            Self::Free => (1, 0),
            Self::Rerouted { trajectory_id } => (2, trajectory_id),
            Self::Stopped => (3, 0),
            Self::StoppedLate => (4, 0),
        }
    }

    fn read(code: u32, trajectory_id: u64) -> Option<Self> {
        Some(match code {
            0 => Self::Rests,
            1 => Self::Free,
            2 => Self::Rerouted { trajectory_id },
            3 => Self::Stopped,
            4 => Self::StoppedLate,
            _ => return None,
        })
    }

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Rests => "rests",
            Self::Free => "free",
            Self::Rerouted { .. } => "rerouted",
            Self::Stopped => "stopped",
            Self::StoppedLate => "stopped-late",
        }
    }
}

/// The answer on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct SceneReply {
    layout_version: u32,
    kind: u32,
    effect: u32,
    total: u32,
    revision: u64,
    trajectory_id: u64,
    received_ns: u64,
    checked_ns: u64,
    acted_ns: u64,
    first: u32,
    count: u32,
    objects: [WireChange; PAGE],
    text: Text,
}

/// The answer, read.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneOutcome {
    /// A page of the list.
    Listed {
        /// Of the scene; pages of different ones do not belong together.
        revision: u64,
        /// How many objects the scene has.
        total: usize,
        /// Index of the first of these.
        first: usize,
        /// The objects.
        objects: Vec<ListedObject>,
        /// What became of a motion last; empty if nothing.
        last_effect: String,
    },
    /// All changes count.
    Changed {
        /// The revision that they made.
        revision: u64,
        /// How many objects the scene has now.
        total: usize,
        /// What it means for the motion that runs.
        effect: MotionEffect,
        /// Which link, which obstacle, where and when; empty if nothing is in the way.
        note: String,
        /// When the request was taken, the motion was checked, and the arm's new motion was accepted or its stop sent: by
        /// `CLOCK_MONOTONIC`, ns.
        times_ns: [u64; 3],
    },
    /// No change counts.
    Refused {
        /// Why, and what to do.
        reason: String,
    },
}

const LISTED: u32 = 0;
const CHANGED: u32 = 1;
const REFUSED: u32 = 2;

impl SceneReply {
    /// Writes an answer down; of a list at most [`PAGE`] objects.
    #[must_use]
    pub fn new(outcome: &SceneOutcome) -> Self {
        let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let mut reply = Self {
            layout_version: LAYOUT_VERSION,
            kind: REFUSED,
            effect: 0,
            total: 0,
            revision: 0,
            trajectory_id: 0,
            received_ns: 0,
            checked_ns: 0,
            acted_ns: 0,
            first: 0,
            count: 0,
            objects: [NOTHING; PAGE],
            text: Text::default(),
        };
        match outcome {
            SceneOutcome::Listed { revision, total, first, objects, last_effect } => {
                (reply.kind, reply.revision, reply.text) = (LISTED, *revision, Text::new(last_effect));
                (reply.total, reply.first) = (count(*total), count(*first));
                reply.count = count(objects.len().min(PAGE));
                for (slot, object) in reply.objects.iter_mut().zip(objects) {
                    let named = WireChange { name: WireName::new(&object.name), ..NOTHING };
                    *slot = named.object(&object.shape, &object.pose, object.fixed_to);
                    slot.mass_kg = object.mass_kg;
                }
            }
            SceneOutcome::Changed { revision, total, effect, note, times_ns } => {
                (reply.kind, reply.revision, reply.total) = (CHANGED, *revision, count(*total));
                (reply.effect, reply.trajectory_id) = effect.code();
                [reply.received_ns, reply.checked_ns, reply.acted_ns] = *times_ns;
                reply.text = Text::new(note);
            }
            SceneOutcome::Refused { reason } => reply.text = Text::new(reason),
        }
        reply
    }

    /// The typed answer.
    #[must_use]
    pub fn outcome(&self) -> SceneOutcome {
        let refused = |reason: String| SceneOutcome::Refused { reason };
        if self.layout_version != LAYOUT_VERSION {
            let got = self.layout_version;
            return refused(format!(
                "the planner answers in layout version {got}, expected {LAYOUT_VERSION}"
            ));
        }
        let number = |n: u32| usize::try_from(n).unwrap_or(usize::MAX);
        let (revision, total, text) = (self.revision, number(self.total), self.text.read());
        match self.kind {
            LISTED => {
                let page = self.objects.iter().take(number(self.count));
                match page.map(listed).collect() {
                    Ok(objects) => SceneOutcome::Listed {
                        revision,
                        total,
                        first: number(self.first),
                        objects,
                        last_effect: text,
                    },
                    Err(what) => refused(format!("the planner lists an object that makes no sense: {what}")),
                }
            }
            CHANGED => match MotionEffect::read(self.effect, self.trajectory_id) {
                Some(effect) => SceneOutcome::Changed {
                    revision,
                    total,
                    effect,
                    note: text,
                    times_ns: [self.received_ns, self.checked_ns, self.acted_ns],
                },
                None => refused(format!("the planner answers with unknown effect {}", self.effect)),
            },
            REFUSED => refused(text),
            kind => refused(format!("the planner answers with unknown code {kind}")),
        }
    }
}

fn listed(wire: &WireChange) -> Result<ListedObject, What> {
    Ok(ListedObject {
        name: wire.name.read().ok_or(What::Name)?,
        shape: ObjectShape::read(wire.shape, wire.size_m)?,
        pose: wire.pose()?,
        fixed_to: wire.fixed_to()?,
        mass_kg: wire.mass_kg()?,
    })
}

const _: () = assert!(size_of::<SceneReply>() == 64 + PAGE * 176 + 248);
