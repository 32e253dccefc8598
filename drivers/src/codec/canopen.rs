//! CANopen frames other than SDO: identifiers, NMT, SYNC, heartbeat, EMCY, PDO mapping entries.
//!
//! Every value can be encoded and decoded, because the master and the simulated drives share this file. Decoders
//! take any frame and answer `None` for what is not theirs.
//! Source: CiA 301 (predefined connection set, 7.2.8 NMT, 7.2.7 EMCY, 7.4 PDO mapping).
use crate::codec::object::Address;
use crate::frame::{CanFrame, CanId};

/// Identifier of NMT commands.
pub const COB_NMT: u16 = 0x000;
/// Identifier of SYNC.
pub const COB_SYNC: u16 = 0x080;
/// Base of EMCY identifiers; node 0 of this base is SYNC.
pub const COB_EMCY: u16 = 0x080;
/// Base of the identifiers of the first TPDO; each next PDO is [`COB_PDO_STEP`] higher.
pub const COB_TPDO1: u16 = 0x180;
/// Base of the identifiers of the first RPDO.
pub const COB_RPDO1: u16 = 0x200;
/// Distance between the identifiers of one PDO and the next.
pub const COB_PDO_STEP: u16 = 0x100;
/// Base of SDO replies (server to client).
pub const COB_SDO_REPLY: u16 = 0x580;
/// Base of SDO requests (client to server).
pub const COB_SDO_REQUEST: u16 = 0x600;
/// Base of heartbeats.
pub const COB_HEARTBEAT: u16 = 0x700;

/// Largest node id.
pub const NODE_MAX: u8 = 127;
/// Node id under which this master produces its heartbeat.
pub const MASTER_NODE: u8 = 127;

/// Flag of a PDO's COB-ID: the PDO does not exist.
pub const PDO_DISABLED: u32 = 0x8000_0000;
/// Flag of a PDO's COB-ID: no remote requests.
pub const PDO_NO_RTR: u32 = 0x4000_0000;

/// `base + node`, as a frame id.
#[must_use]
pub const fn cob(base: u16, node: u8) -> CanId {
    CanId::standard(base + node as u16)
}

/// The node of a classic standard data frame of `base`; `None` for any other frame and for node 0.
#[must_use]
pub fn node_of(frame: &CanFrame, base: u16) -> Option<u8> {
    if frame.is_fd() {
        return None;
    }
    let node = u8::try_from(frame.id().as_standard_data()?.checked_sub(base)?).ok()?;
    (1..=NODE_MAX).contains(&node).then_some(node)
}

/// A SYNC without counter.
#[must_use]
pub fn sync() -> CanFrame {
    CanFrame::classic(CanId::standard(COB_SYNC), &[])
}

/// The counter of a SYNC (`Some(None)` without one); `None` when the frame is no SYNC.
#[must_use]
pub fn decode_sync(frame: &CanFrame) -> Option<Option<u8>> {
    if frame.is_fd() || frame.id().as_standard_data() != Some(COB_SYNC) {
        return None;
    }
    match *frame.data() {
        [] => Some(None),
        [counter] => Some(Some(counter)),
        _ => None,
    }
}

/// What an NMT command asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtCommand {
    /// Start: go operational.
    Start,
    /// Stop: only NMT and heartbeat continue.
    Stop,
    /// Go pre-operational.
    PreOperational,
    /// Restart the whole node.
    ResetNode,
    /// Restart the communication part of the node.
    ResetCommunication,
}

/// One NMT command frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nmt {
    /// What is asked.
    pub command: NmtCommand,
    /// Of which node; 0 is every node.
    pub node: u8,
}

impl Nmt {
    /// As a frame.
    #[must_use]
    pub fn encode(self) -> CanFrame {
        let command = match self.command {
            NmtCommand::Start => 0x01,
            NmtCommand::Stop => 0x02,
            NmtCommand::PreOperational => 0x80,
            NmtCommand::ResetNode => 0x81,
            NmtCommand::ResetCommunication => 0x82,
        };
        CanFrame::classic(CanId::standard(COB_NMT), &[command, self.node])
    }
    /// From a frame; `None` when it is no well-formed NMT command.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<Self> {
        if frame.is_fd() || frame.id().as_standard_data() != Some(COB_NMT) {
            return None;
        }
        let [command, node] = *frame.data() else { return None };
        let command = match command {
            0x01 => NmtCommand::Start,
            0x02 => NmtCommand::Stop,
            0x80 => NmtCommand::PreOperational,
            0x81 => NmtCommand::ResetNode,
            0x82 => NmtCommand::ResetCommunication,
            _ => return None,
        };
        (node <= NODE_MAX).then_some(Self { command, node })
    }
}

/// The communication state that a heartbeat states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtState {
    /// Boot-up: sent once after a reset.
    BootUp,
    /// Stopped.
    Stopped,
    /// Operational: PDOs are active.
    Operational,
    /// Pre-operational: SDO only.
    PreOperational,
}

impl NmtState {
    /// The heartbeat of `node`.
    #[must_use]
    pub fn encode(self, node: u8) -> CanFrame {
        let state = match self {
            Self::BootUp => 0x00,
            Self::Stopped => 0x04,
            Self::Operational => 0x05,
            Self::PreOperational => 0x7F,
        };
        CanFrame::classic(cob(COB_HEARTBEAT, node), &[state])
    }
    /// Node and state of a heartbeat; `None` for other frames and unknown states.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<(u8, Self)> {
        let node = node_of(frame, COB_HEARTBEAT)?;
        let [state] = *frame.data() else { return None };
        let state = match state {
            0x00 => Self::BootUp,
            0x04 => Self::Stopped,
            0x05 => Self::Operational,
            0x7F => Self::PreOperational,
            _ => return None,
        };
        Some((node, state))
    }
}

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emcy {
    /// Error code; 0x0000 is "error reset". [`crate::codec::emcy::words`] has the sentence.
    pub code: u16,
    /// Object 0x1001 at that moment.
    pub error_register: u8,
    /// The vendor's five bytes.
    pub vendor: [u8; 5],
}

impl Emcy {
    /// The emergency frame of `node`.
    #[must_use]
    pub fn encode(self, node: u8) -> CanFrame {
        let [low, high] = self.code.to_le_bytes();
        let [a, b, c, d, e] = self.vendor;
        CanFrame::classic(cob(COB_EMCY, node), &[low, high, self.error_register, a, b, c, d, e])
    }
    /// Node and message; `None` for other frames (SYNC among them) and short ones.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<(u8, Self)> {
        let node = node_of(frame, COB_EMCY)?;
        let [low, high, error_register, a, b, c, d, e] = *frame.data() else { return None };
        let code = u16::from_le_bytes([low, high]);
        Some((node, Self { code, error_register, vendor: [a, b, c, d, e] }))
    }
}

/// One entry of a PDO mapping: an object and its width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoEntry {
    /// The object; indices below 0x20 are dummies (gaps) by data type.
    pub address: Address,
    /// Its width.
    pub bits: u8,
}

impl PdoEntry {
    /// An entry.
    #[must_use]
    pub const fn new(address: Address, bits: u8) -> Self {
        Self { address, bits }
    }
    /// `index << 16 | sub << 8 | bits`.
    #[must_use]
    pub const fn encode(self) -> u32 {
        (self.address.index as u32) << 16 | (self.address.sub as u32) << 8 | self.bits as u32
    }
    /// From the mapping object's value.
    #[must_use]
    pub const fn decode(value: u32) -> Self {
        let [bits, sub, low, high] = value.to_le_bytes();
        Self { address: Address::new(u16::from_le_bytes([low, high]), sub), bits }
    }
}
