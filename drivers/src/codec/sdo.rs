//! SDO frames: expedited and segmented transfers, in both directions.
//!
//! Requests come from the client (the master), responses from the server (the drive). An abort may come from either
//! side and stands in both enums. Block transfer is not spoken.
//! Source: CiA 301 section 7.2.4.3.
use crate::codec::canopen::{COB_SDO_REPLY, COB_SDO_REQUEST, cob, node_of};
use crate::codec::object::Address;
use crate::frame::CanFrame;

/// One to four bytes of an expedited transfer, least significant first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoBytes {
    bytes: [u8; 4],
    len: u8,
    sized: bool,
}

impl SdoBytes {
    /// One byte.
    #[must_use]
    pub const fn from_u8(value: u8) -> Self {
        Self { bytes: [value, 0, 0, 0], len: 1, sized: true }
    }
    /// One signed byte.
    #[must_use]
    pub const fn from_i8(value: i8) -> Self {
        Self::from_u8(value.cast_unsigned())
    }
    /// Two bytes.
    #[must_use]
    pub const fn from_u16(value: u16) -> Self {
        let [a, b] = value.to_le_bytes();
        Self { bytes: [a, b, 0, 0], len: 2, sized: true }
    }
    /// Two bytes, signed.
    #[must_use]
    pub const fn from_i16(value: i16) -> Self {
        Self::from_u16(value.cast_unsigned())
    }
    /// Four bytes.
    #[must_use]
    pub const fn from_u32(value: u32) -> Self {
        Self { bytes: value.to_le_bytes(), len: 4, sized: true }
    }
    /// Four bytes, signed.
    #[must_use]
    pub const fn from_i32(value: i32) -> Self {
        Self::from_u32(value.cast_unsigned())
    }
    /// From a slice of one to four bytes; `None` for any other length.
    #[must_use]
    pub fn from_slice(slice: &[u8]) -> Option<Self> {
        let bytes = match *slice {
            [a] => [a, 0, 0, 0],
            [a, b] => [a, b, 0, 0],
            [a, b, c] => [a, b, c, 0],
            [a, b, c, d] => [a, b, c, d],
            _ => return None,
        };
        Some(Self { bytes, len: u8::try_from(slice.len()).ok()?, sized: true })
    }
    /// The bytes that count: four when the sender did not state the size.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&self.bytes)
    }
    /// True when the sender stated the size.
    #[must_use]
    pub const fn is_sized(&self) -> bool {
        self.sized
    }
    /// As an unsigned number, missing bytes 0.
    #[must_use]
    pub const fn as_u32(&self) -> u32 {
        u32::from_le_bytes(self.bytes)
    }

    /// Low nibble of the command byte: `n << 2 | expedited | size stated`.
    fn flags(self) -> u8 {
        if self.sized { (4 - self.len.min(4)) << 2 | 0b11 } else { 0b10 }
    }
    fn decode(command: u8, bytes: [u8; 4]) -> Self {
        let sized = command & 1 != 0;
        let len = if sized { 4 - (command >> 2 & 3) } else { 4 };
        let mut kept = bytes;
        // Unused bytes are reserved; a drive that leaves old data in them must not change the value.
        for slot in kept.iter_mut().skip(usize::from(len)) {
            *slot = 0;
        }
        Self { bytes: kept, len, sized }
    }
}

/// Up to seven bytes of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SegmentBytes {
    bytes: [u8; 7],
    len: u8,
}

impl SegmentBytes {
    /// The first seven bytes of `slice`.
    #[must_use]
    pub fn from_slice(slice: &[u8]) -> Self {
        let mut segment = Self { bytes: [0; 7], len: 0 };
        for (slot, byte) in segment.bytes.iter_mut().zip(slice) {
            *slot = *byte;
            segment.len += 1;
        }
        segment
    }
    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&self.bytes)
    }
}

/// What a client asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoRequest {
    /// Start reading an object.
    Read(Address),
    /// Write up to four bytes at once.
    Write(Address, SdoBytes),
    /// Start writing by segments; the size when stated.
    WriteSegmented(Address, Option<u32>),
    /// The next segment of a read, with the client's toggle.
    ReadSegment {
        /// Alternates, beginning with false.
        toggle: bool,
    },
    /// The next segment of a write.
    WriteSegment {
        /// Alternates, beginning with false.
        toggle: bool,
        /// Its bytes.
        bytes: SegmentBytes,
        /// No segment follows.
        last: bool,
    },
    /// The client gives up.
    Abort(Address, u32),
}

/// What a server answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoResponse {
    /// The value that was read.
    Value(Address, SdoBytes),
    /// The value is longer than four bytes and must be fetched by segments; its size when stated.
    ValueSegmented(Address, Option<u32>),
    /// A segment of a read.
    Segment {
        /// As in the request.
        toggle: bool,
        /// Its bytes.
        bytes: SegmentBytes,
        /// No segment follows.
        last: bool,
    },
    /// The write (or the start of a segmented one) is taken.
    Written(Address),
    /// The segment of a write is taken.
    SegmentWritten {
        /// As in the request.
        toggle: bool,
    },
    /// Refused; [`crate::codec::error_text::sdo_abort`] has the sentence.
    Abort(Address, u32),
}

const TOGGLE: u8 = 0x10;
const ABORT: u8 = 0x80;

impl SdoRequest {
    /// The request to `node`.
    #[must_use]
    pub fn encode(self, node: u8) -> CanFrame {
        let bytes = match self {
            Self::Read(address) => initiate(0x40, address, 0),
            Self::Write(address, value) => initiate(0x20 | value.flags(), address, value.as_u32()),
            Self::WriteSegmented(address, Some(size)) => initiate(0x21, address, size),
            Self::WriteSegmented(address, None) => initiate(0x20, address, 0),
            Self::ReadSegment { toggle } => [0x60 | toggle_bit(toggle), 0, 0, 0, 0, 0, 0, 0],
            Self::WriteSegment { toggle, bytes, last } => segment(toggle, bytes, last),
            Self::Abort(address, code) => initiate(ABORT, address, code),
        };
        CanFrame::classic(cob(COB_SDO_REQUEST, node), &bytes)
    }
    /// Node and request; `None` for other frames, wrong lengths and unknown commands.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<(u8, Self)> {
        let (node, command, address, rest) = parts(frame, COB_SDO_REQUEST)?;
        let number = u32::from_le_bytes(rest);
        let request = match command >> 5 {
            0 => {
                let (toggle, bytes, last) = segment_parts(frame)?;
                Self::WriteSegment { toggle, bytes, last }
            }
            1 if command & 2 != 0 => Self::Write(address, SdoBytes::decode(command, rest)),
            1 => Self::WriteSegmented(address, (command & 1 != 0).then_some(number)),
            2 => Self::Read(address),
            3 => Self::ReadSegment { toggle: command & TOGGLE != 0 },
            4 => Self::Abort(address, number),
            _ => return None,
        };
        Some((node, request))
    }
}

impl SdoResponse {
    /// The object that it names; none for the answer to a segment.
    #[must_use]
    pub const fn address(&self) -> Option<Address> {
        match *self {
            Self::Value(address, _)
            | Self::ValueSegmented(address, _)
            | Self::Written(address)
            | Self::Abort(address, _) => Some(address),
            Self::Segment { .. } | Self::SegmentWritten { .. } => None,
        }
    }
    /// The response of `node`.
    #[must_use]
    pub fn encode(self, node: u8) -> CanFrame {
        let bytes = match self {
            Self::Value(address, value) => initiate(0x40 | value.flags(), address, value.as_u32()),
            Self::ValueSegmented(address, Some(size)) => initiate(0x41, address, size),
            Self::ValueSegmented(address, None) => initiate(0x40, address, 0),
            Self::Segment { toggle, bytes, last } => segment(toggle, bytes, last),
            Self::Written(address) => initiate(0x60, address, 0),
            Self::SegmentWritten { toggle } => [0x20 | toggle_bit(toggle), 0, 0, 0, 0, 0, 0, 0],
            Self::Abort(address, code) => initiate(ABORT, address, code),
        };
        CanFrame::classic(cob(COB_SDO_REPLY, node), &bytes)
    }
    /// Node and response; `None` for other frames, wrong lengths and unknown commands.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<(u8, Self)> {
        let (node, command, address, rest) = parts(frame, COB_SDO_REPLY)?;
        let number = u32::from_le_bytes(rest);
        let response = match command >> 5 {
            0 => {
                let (toggle, bytes, last) = segment_parts(frame)?;
                Self::Segment { toggle, bytes, last }
            }
            1 => Self::SegmentWritten { toggle: command & TOGGLE != 0 },
            2 if command & 2 != 0 => Self::Value(address, SdoBytes::decode(command, rest)),
            2 => Self::ValueSegmented(address, (command & 1 != 0).then_some(number)),
            3 => Self::Written(address),
            4 => Self::Abort(address, number),
            _ => return None,
        };
        Some((node, response))
    }
}

fn toggle_bit(toggle: bool) -> u8 {
    if toggle { TOGGLE } else { 0 }
}

fn initiate(command: u8, address: Address, number: u32) -> [u8; 8] {
    let [low, high] = address.index.to_le_bytes();
    let [a, b, c, d] = number.to_le_bytes();
    [command, low, high, address.sub, a, b, c, d]
}

fn segment(toggle: bool, segment: SegmentBytes, last: bool) -> [u8; 8] {
    let command = toggle_bit(toggle) | (7 - segment.len.min(7)) << 1 | u8::from(last);
    let [a, b, c, d, e, f, g] = segment.bytes;
    [command, a, b, c, d, e, f, g]
}

fn segment_parts(frame: &CanFrame) -> Option<(bool, SegmentBytes, bool)> {
    let (command, bytes) = frame.data().split_first()?;
    let len = 7 - usize::from(command >> 1 & 7);
    Some((command & TOGGLE != 0, SegmentBytes::from_slice(bytes.get(..len)?), command & 1 != 0))
}

fn parts(frame: &CanFrame, base: u16) -> Option<(u8, u8, Address, [u8; 4])> {
    let node = node_of(frame, base)?;
    let [command, low, high, sub, a, b, c, d] = *frame.data() else { return None };
    Some((node, command, Address::new(u16::from_le_bytes([low, high]), sub), [a, b, c, d]))
}
