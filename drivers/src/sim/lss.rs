//! Layer setting services of a simulated drive: asked for its identity and node id, and given another node id.
//!
//! Source: CiA 305. The drive has a node id always, so it takes no part in the search for nodes without one; its bit rate
//! is the bus's, and cannot be set.
use crate::frame::{CanFrame, CanId};

/// Identifier of the master's requests.
const REQUEST: u16 = 0x7E5;
/// Identifier of the answers.
const ANSWER: u16 = 0x7E4;

/// State of the services.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lss {
    /// Otherwise it waits.
    configuring: bool,
    /// Parts of the identity that a selective switch has matched.
    selected: u8,
    /// Parts of the identity that an identification has matched.
    identified: u8,
    /// Node id from the next reset of communication on.
    pub(super) node_id: Option<u8>,
}

impl Lss {
    /// Answers a request. `identity` is vendor, product, revision and serial number.
    pub(super) fn answer(&mut self, identity: [u32; 4], node: u8, frame: &CanFrame) -> Option<CanFrame> {
        if frame.is_fd() || frame.id().as_standard_data() != Some(REQUEST) {
            return None;
        }
        let data: [u8; 8] = frame.data().try_into().ok()?;
        let [command, a, b, c, d, ..] = data;
        let number = u32::from_le_bytes([a, b, c, d]);
        let part = |first: u8| identity.get(usize::from(command.wrapping_sub(first))).copied();
        match command {
            0x04 => {
                (self.configuring, self.selected) = (a == 1, 0);
                None
            }
            0x40..=0x43 => {
                let at = command - 0x40;
                let matches = part(0x40) == Some(number) && (at == 0 || self.selected == at);
                self.selected = if matches { at + 1 } else { 0 };
                if self.selected < 4 {
                    return None;
                }
                (self.configuring, self.selected) = (true, 0);
                answer([0x44, 0, 0, 0, 0])
            }
            0x46..=0x4B => self.identify(identity, command - 0x46, number),
            0x5A..=0x5D if self.configuring => {
                let [a, b, c, d] = part(0x5A)?.to_le_bytes();
                answer([command, a, b, c, d])
            }
            0x5E if self.configuring => answer([command, node, 0, 0, 0]),
            0x11 if self.configuring => {
                let fits = (1..=127).contains(&a);
                self.node_id = if fits { Some(a) } else { self.node_id };
                answer([command, u8::from(!fits), 0, 0, 0])
            }
            // Bit timing is not supported.
            0x13 if self.configuring => answer([command, 1, 0, 0, 0]),
            0x17 if self.configuring => answer([command, 0, 0, 0, 0]),
            _ => None,
        }
    }

    /// Six requests in a row: vendor and product, then a range of revisions and one of serial numbers.
    fn identify(&mut self, identity: [u32; 4], at: u8, number: u32) -> Option<CanFrame> {
        let [vendor, product, revision, serial] = identity;
        let matches = match at {
            0 => vendor == number,
            1 => product == number,
            2 => revision >= number,
            3 => revision <= number,
            4 => serial >= number,
            _ => serial <= number,
        };
        self.identified = if matches && (at == 0 || self.identified == at) { at + 1 } else { 0 };
        if self.identified < 6 {
            return None;
        }
        self.identified = 0;
        answer([0x4F, 0, 0, 0, 0])
    }
}

fn answer([a, b, c, d, e]: [u8; 5]) -> Option<CanFrame> {
    Some(CanFrame::classic(CanId::standard(ANSWER), &[a, b, c, d, e, 0, 0, 0]))
}
