//! The CAN identifiers with which the servos of a bus send and receive.
//!
//! Two servos that send under one identifier destroy each other's frames, and one that receives what another sends takes
//! feedback for commands. Neither shows on a desk with one motor, so it is refused in the settings.
//!
//! Source: CiA 301 (predefined connection set); Damiao's manual (commands at `ESC_ID` plus 0x100 for each mode, feedback
//! at `MST_ID`, registers at 0x7FF).
use crate::protocol::Protocol;

/// Identifiers with which a CANopen node sends and receives, each plus its node id.
const CANOPEN_NODE: [(u16, &str); 12] = [
    (0x080, "the emergency message"),
    (0x180, "TPDO 1"),
    (0x200, "RPDO 1"),
    (0x280, "TPDO 2"),
    (0x300, "RPDO 2"),
    (0x380, "TPDO 3"),
    (0x400, "RPDO 3"),
    (0x480, "TPDO 4"),
    (0x500, "RPDO 4"),
    (0x580, "the SDO reply"),
    (0x600, "the SDO request"),
    (0x700, "the heartbeat"),
];
/// What all CANopen nodes of a bus share.
const CANOPEN_BUS: [(u16, &str); 3] = [(0x000, "NMT"), (0x080, "SYNC"), (0x77F, "the master's heartbeat")];
/// Identifiers that a Damiao motor receives, each plus `ESC_ID`: it answers in its present mode, but receives all of them.
const DAMIAO_MOTOR: [(u16, &str); 4] = [
    (0x000, "MIT commands"),
    (0x100, "POS_VEL commands"),
    (0x200, "VEL commands"),
    (0x300, "FORCE_POS commands"),
];
/// What all Damiao motors of a bus share.
const DAMIAO_BUS: [(u16, &str); 1] = [(0x7FF, "register requests")];

/// One identifier that a servo needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Use {
    pub(crate) id: u16,
    /// What for.
    pub(crate) what: &'static str,
    /// The key that decides it.
    pub(crate) key: &'static str,
    /// Every servo of the protocol uses it in common.
    shared: bool,
}

impl Use {
    /// True when both cannot be on one bus.
    pub(crate) fn clashes(&self, other: &Self) -> bool {
        self.id == other.id && !(self.shared && other.shared && self.what == other.what)
    }
}

/// Every identifier of a servo; its own feedback comes last.
pub(crate) fn of(node_id: u8, protocol: &Protocol) -> Vec<Use> {
    let own = |(base, what): (u16, &'static str)| Use {
        id: base + u16::from(node_id),
        what,
        key: "node_id",
        shared: false,
    };
    let common = |(id, what): (u16, &'static str)| Use { id, what, key: "node_id", shared: true };
    match protocol {
        Protocol::Cia402(_) => CANOPEN_BUS.map(common).into_iter().chain(CANOPEN_NODE.map(own)).collect(),
        Protocol::Damiao(damiao) => {
            let feedback =
                Use { id: damiao.feedback_id, what: "feedback", key: "feedback_id", shared: false };
            DAMIAO_BUS.map(common).into_iter().chain(DAMIAO_MOTOR.map(own)).chain([feedback]).collect()
        }
    }
}
