//! What a servo speaks, with the numbers that only its protocol needs, and whether they can hold the joint.
//!
//! A number of one protocol means nothing to another, so the keys of a protocol are unknown keys beside the name of
//! another. Everything here moves the arm or says how it falls: no key that does has a default.
//!
//! A protocol is one file here (its keys, its checks, what it puts on a bus) and one line in `REGISTRY`; its frames,
//! bring-up and simulated servo are a folder of `drivers`.
pub mod cia402;
pub mod cubemars;
pub mod damiao;
pub(crate) mod identifiers;
pub(crate) mod motors;
pub mod myactuator;
pub mod odrive;
pub mod piper;
pub mod robstride;

use crate::bus_load::flow::Flow;
use crate::bus_load::frame::Format;
use crate::document::shown;
use crate::reader::{FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, BusKind, Servo, Settings};
use crate::stall::AfterStall;
use crate::trust::Reaction;
use identifiers::Use;
use serde_json::Value;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// Every protocol.
const REGISTRY: [Registration; 7] = [
    cia402::REGISTRATION,
    damiao::REGISTRATION,
    odrive::REGISTRATION,
    piper::REGISTRATION,
    robstride::REGISTRATION,
    cubemars::REGISTRATION,
    myactuator::REGISTRATION,
];

/// How a protocol is found in settings files.
pub(crate) struct Registration {
    /// Its name.
    name: &'static str,
    /// What it is, behind the name: "(CANopen CiA 402, cyclic synchronous position)".
    words: &'static str,
    /// Its keys of a servo.
    keys: &'static [&'static str],
    /// The least and the greatest node id.
    node_id: [i64; 2],
    /// Reads its keys.
    read: fn(&mut Table<'_>) -> Option<Protocol>,
}

/// What a protocol makes of its settings.
pub(crate) trait ServoProtocol: Any + fmt::Debug + Send + Sync {
    /// The name in settings files.
    fn name(&self) -> &'static str;
    /// Motor revolutions a link revolution, where the servo states angles of its motor; 1 where it states those of its
    /// output.
    fn gear_ratio(&self) -> f64 {
        1.0
    }
    /// What its servos can do when commands stop coming.
    fn reactions(&self) -> &'static [Reaction] {
        &[Reaction::Limp]
    }
    /// The gentler continuation after a stall of the streamer (docs/adr, "What follows a stall").
    fn after_stall(&self) -> AfterStall {
        AfterStall::Freeze
    }
    /// Its commands carry a torque beside the position.
    fn carries_torque(&self) -> bool {
        false
    }
    /// Its answers carry the torque that the servo measures.
    fn measures_torque(&self) -> bool {
        false
    }
    /// `setpoint_every`, `stagger`, `feedback_every` and `packed` mean something to it.
    fn shapes_traffic(&self) -> bool {
        false
    }
    /// Every identifier that a servo uses; its own feedback comes last.
    fn identifiers(&self, node_id: u8) -> Vec<Use>;
    /// Every angle and speed that the joint may be commanded must be one that the servo can represent.
    fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, sign_and_zero_rad: [f64; 2]);
    /// Against the cycle, the supervision and the traffic that the servo `at` is driven with.
    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings);
    /// What `servos`, which all speak it, and their master put on a bus.
    fn flows(&self, servos: &[Protocol], bus: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow>;
    /// What CAN FD means to it.
    fn fd(&self) -> FdUse {
        FdUse::None
    }
    /// Its keys and values, for `check --json`. Two settings with the same entries are the same.
    fn entries(&self) -> Vec<(&'static str, Value)>;
    /// The same on the screen.
    fn sentence(&self) -> String;
}

/// What CAN FD means to a protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FdUse {
    /// Its servos have classic frames only.
    None,
    /// On an FD bus its frames are FD frames.
    Spoken,
    /// There are servos with it, which this software does not drive yet: a figure for planning.
    Planned,
}

/// Which protocol a servo speaks, with what is the protocol's own.
#[derive(Clone)]
pub struct Protocol(Arc<dyn ServoProtocol>);

impl Protocol {
    /// Its settings, if it is the protocol with settings of this type: `protocol.get::<Damiao>()`.
    #[must_use]
    pub fn get<T: 'static>(&self) -> Option<&T> {
        let any: &dyn Any = &*self.0;
        any.downcast_ref()
    }
    /// The name in settings files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.0.name()
    }
    /// Motor revolutions a link revolution, where the servo states angles of its motor; 1 where it states those of its
    /// output.
    #[must_use]
    pub fn gear_ratio(&self) -> f64 {
        self.0.gear_ratio()
    }
    /// What its servos can do when commands stop coming.
    #[must_use]
    pub fn reactions(&self) -> &'static [Reaction] {
        self.0.reactions()
    }
    /// Its commands carry a torque beside the position.
    #[must_use]
    pub fn carries_torque(&self) -> bool {
        self.0.carries_torque()
    }
    /// Its answers carry the torque that the servo measures.
    #[must_use]
    pub fn measures_torque(&self) -> bool {
        self.0.measures_torque()
    }
    /// Its keys and values as settings files have them.
    #[must_use]
    pub fn entries(&self) -> Vec<(&'static str, Value)> {
        self.0.entries()
    }
    /// Its settings as a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        self.0.sentence()
    }
    pub(crate) fn after_stall(&self) -> AfterStall {
        self.0.after_stall()
    }
    pub(crate) fn shapes_traffic(&self) -> bool {
        self.0.shapes_traffic()
    }
    pub(crate) fn identifiers(&self, node_id: u8) -> Vec<Use> {
        self.0.identifiers(node_id)
    }
    pub(crate) fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, sign_and_zero_rad: [f64; 2]) {
        self.0.check_joint(table, joint, sign_and_zero_rad);
    }
    pub(crate) fn fd(&self) -> FdUse {
        self.0.fd()
    }
}

impl<T: ServoProtocol> From<T> for Protocol {
    fn from(settings: T) -> Self {
        Self(Arc::new(settings))
    }
}

impl fmt::Debug for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl PartialEq for Protocol {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.entries() == other.entries()
    }
}

/// What may stand behind `protocol =`.
fn expected() -> String {
    let words: Vec<String> =
        REGISTRY.iter().map(|known| format!("{:?} ({})", known.name, known.words)).collect();
    let (last, others) =
        words.split_last().map_or((String::new(), &[][..]), |(last, rest)| (last.clone(), rest));
    format!("{} or {last}", others.join(", "))
}

/// Reads node id and protocol of a servo.
pub(crate) fn read(table: &mut Table<'_>) -> (Option<u8>, Option<Protocol>) {
    let expected = expected();
    let name = table.text("protocol", &expected);
    let known = name.as_deref().and_then(|name| REGISTRY.iter().find(|known| known.name == name));
    if let Some(known) = known {
        return (read_id(table, known.node_id), (known.read)(table));
    }
    if let Some(name) = name {
        table.fault("protocol", &shown(&name), &expected);
    }
    // Their protocol is unknown, so none of them is called unknown.
    for key in REGISTRY.iter().flat_map(|known| known.keys) {
        table.take(key);
    }
    (read_id(table, [0, 127]), None)
}

fn read_id(table: &mut Table<'_>, [low, high]: [i64; 2]) -> Option<u8> {
    u8::try_from(table.integer("node_id", low, high)?).ok()
}

/// Each servo against the cycle, the supervision and the traffic that it is driven with.
pub(crate) fn check_settings(fault_list: &FaultList, settings: &Settings) {
    for (at, servo) in settings.servos.iter().enumerate() {
        servo.protocol.0.check_settings(fault_list, at, servo, settings);
    }
}

/// What the servos of a bus and their master send.
pub(crate) fn flows(bus: &Bus, servos: &[Protocol], cycle_hz: f64) -> Vec<Flow> {
    flows_with(bus, servos, cycle_hz, |protocol| match (protocol.fd(), bus.kind) {
        (FdUse::Spoken, BusKind::Fd { .. }) => Format::Fd,
        _ => Format::Classic,
    })
}

/// The same with the frames' format of each protocol.
pub(crate) fn flows_with(
    bus: &Bus,
    servos: &[Protocol],
    cycle_hz: f64,
    format: impl Fn(&Protocol) -> Format,
) -> Vec<Flow> {
    let mut flows = Vec::new();
    for known in &REGISTRY {
        let of_kind: Vec<Protocol> =
            servos.iter().filter(|protocol| protocol.name() == known.name).cloned().collect();
        if let Some(first) = of_kind.first() {
            flows.extend(first.0.flows(&of_kind, bus, cycle_hz, format(first)));
        }
    }
    flows
}
