//! Block upload of the SDO server: a long value in blocks of up to 127 frames, with a check sum at the end.
//!
//! Source: CiA 301 section 7.2.4.3.12 to 7.2.4.3.15. A block download is refused: nothing that can be written is long.
use super::dictionary::Bytes;
use super::sdo_server::Objects;
use crate::codec::canopen::{COB_SDO_REPLY, COB_SDO_REQUEST, cob, node_of};
use crate::codec::{Address, SdoResponse, error_text};
use crate::frame::CanFrame;
use crate::servo::Nanos;

/// SDO abort: block size not valid.
const ABORT_BLOCK_SIZE: u32 = 0x0504_0002;
/// SDO abort: sequence number not valid.
const ABORT_SEQUENCE: u32 = 0x0504_0003;
/// Client command specifier of block upload, in the upper three bits.
const CLIENT: u8 = 0xA0;
/// Server command specifier of block upload.
const SERVER: u8 = 0xC0;
/// Data bytes of a segment.
const SEGMENT: usize = 7;

/// An upload in blocks.
#[derive(Clone, Debug)]
pub(super) struct BlockUpload {
    address: Address,
    value: Bytes,
    /// Segments that the client takes in a block.
    block: u8,
    /// Bytes that the client has confirmed.
    confirmed: usize,
    /// Segments of the block that is on its way.
    sent: u8,
    pub(super) newest: Nanos,
}

impl BlockUpload {
    /// The object.
    pub(super) const fn address(&self) -> Address {
        self.address
    }

    /// Sends the next block.
    fn send(&mut self, node: u8, out: &mut Vec<CanFrame>) {
        self.sent = 0;
        let rest = self.value.as_slice().get(self.confirmed..).unwrap_or(&[]);
        for segment in rest.chunks(SEGMENT).take(usize::from(self.block)) {
            self.sent += 1;
            let ends = self.confirmed + usize::from(self.sent) * SEGMENT >= self.value.as_slice().len();
            let mut data = [0; 8];
            data[0] = self.sent | if ends { 0x80 } else { 0 };
            for (slot, byte) in data.iter_mut().skip(1).zip(segment) {
                *slot = *byte;
            }
            out.push(reply(node, data));
        }
    }

    /// Takes what the client has received; the rest is sent, or the end. An abort code when it cannot be.
    fn confirm(&mut self, node: u8, [count, block]: [u8; 2], out: &mut Vec<CanFrame>) -> Result<(), u32> {
        if count > self.sent {
            return Err(ABORT_SEQUENCE);
        }
        if !(1..=127).contains(&block) {
            return Err(ABORT_BLOCK_SIZE);
        }
        self.block = block;
        let all = self.value.as_slice().len();
        self.confirmed = (self.confirmed + usize::from(count) * SEGMENT).min(all);
        if self.confirmed < all {
            self.send(node, out);
            return Ok(());
        }
        let unused = (SEGMENT - all % SEGMENT) % SEGMENT;
        let [low, high] = check_sum(self.value.as_slice()).to_le_bytes();
        let unused = u8::try_from(unused).unwrap_or(0);
        out.push(reply(node, [SERVER | unused << 2 | 1, low, high, 0, 0, 0, 0, 0]));
        Ok(())
    }
}

/// Handles a frame when it belongs to a block upload; false for every other one.
pub(super) fn answer(
    upload: &mut Option<BlockUpload>,
    (now, node): (Nanos, u8),
    frame: &CanFrame,
    objects: &mut impl Objects,
    out: &mut Vec<CanFrame>,
) -> bool {
    let (Some(asked), Ok(data)) = (node_of(frame, COB_SDO_REQUEST), <[u8; 8]>::try_from(frame.data())) else {
        return false;
    };
    if asked != node || data[0] & 0xE0 != CLIENT {
        return false;
    }
    let [command, low, high, sub, block, ..] = data;
    let named = Address::new(u16::from_le_bytes([low, high]), sub);
    let mut abort = |address, code| out.push(SdoResponse::Abort(address, code).encode(node));
    let open = upload.take();
    match (command & 3, open) {
        (0, _) if !(1..=127).contains(&block) => abort(named, ABORT_BLOCK_SIZE),
        (0, _) => match objects.read(named) {
            Ok(value) => {
                let size = u32::try_from(value.as_slice().len()).unwrap_or(0);
                let [a, b, c, d] = size.to_le_bytes();
                // The check sum is offered, and the size is stated.
                out.push(reply(node, [SERVER | 0b110, low, high, sub, a, b, c, d]));
                *upload =
                    Some(BlockUpload { address: named, value, block, confirmed: 0, sent: 0, newest: now });
            }
            Err(code) => abort(named, code),
        },
        (3, Some(mut open)) => {
            open.newest = now;
            open.send(node, out);
            *upload = Some(open);
        }
        (2, Some(mut open)) => {
            open.newest = now;
            match open.confirm(node, [low, high], out) {
                Ok(()) => *upload = Some(open),
                Err(code) => out.push(SdoResponse::Abort(open.address, code).encode(node)),
            }
        }
        // The client has taken the end.
        (1, Some(_)) => {}
        (_, open) => {
            let address = open.map_or(Address::new(0, 0), |open| open.address);
            abort(address, error_text::ABORT_COMMAND);
        }
    }
    true
}

fn reply(node: u8, data: [u8; 8]) -> CanFrame {
    CanFrame::classic(cob(COB_SDO_REPLY, node), &data)
}

/// CRC-16 of CCITT, polynomial 0x1021, from 0.
fn check_sum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |sum, byte| {
        (0..8).fold(
            sum ^ u16::from(*byte) << 8,
            |sum: u16, _| {
                if sum & 0x8000 == 0 { sum << 1 } else { sum << 1 ^ 0x1021 }
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of CRC-16/XMODEM.
    #[test]
    fn check_sum_is_that_of_the_standard() {
        assert_eq!(check_sum(b"123456789"), 0x31C3);
    }
}
