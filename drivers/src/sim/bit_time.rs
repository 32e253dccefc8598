//! How many bits a frame has on the wire: counted, not bounded, since its content is known.
//!
//! Source: ISO 11898-1 (frame formats; a bit is stuffed after five equal ones; in FD frames the checksum has stuff bits
//! at fixed places).
use crate::frame::CanFrame;
use taustream_arm::bus_load::frame::{BitRates, Bits, fd_bytes};

/// Delimiter of the checksum, acknowledgement and its delimiter, end of frame, pause: never stuffed.
const TAIL_BITS: u32 = 1 + 1 + 1 + 7 + 3;
/// The same without the delimiter of the checksum, which an FD frame still sends at the data rate.
const FD_TAIL_BITS: u32 = TAIL_BITS - 1;
/// Generator polynomial of the checksum of classic frames, without its highest term.
const CRC15: u16 = 0x4599;
const EXTENDED: u32 = 0x8000_0000;

/// Bits of a frame in each phase, stuff bits and the pause behind it counted.
#[must_use]
pub fn bits(frame: &CanFrame) -> Bits {
    if frame.is_fd() { fd(frame) } else { classic(frame) }
}

/// Time of a frame on the wire, ns.
#[must_use]
pub fn nanoseconds(frame: &CanFrame, rates: BitRates) -> u64 {
    let time_ns = |bits: u32, bit_s: u32| u64::from(bits) * 1_000_000_000 / u64::from(bit_s.max(1));
    let bits = bits(frame);
    time_ns(bits.nominal, rates.nominal_bit_s) + time_ns(bits.data, rates.data_bit_s)
}

/// What wins when two nodes begin at once: the lower value. Bits in the order in which they are sent.
#[must_use]
pub fn arbitration(frame: &CanFrame) -> u64 {
    let raw = u64::from(frame.id().raw());
    let remote = u64::from(frame.id().is_remote());
    if frame.id().raw() & EXTENDED == 0 {
        return (raw & 0x7FF) << 21 | remote << 20;
    }
    let (base, rest) = ((raw >> 18) & 0x7FF, raw & 0x3_FFFF);
    base << 21 | 0b11 << 19 | rest << 1 | remote
}

/// Counts stuff bits while bits go by.
#[derive(Default)]
struct Stuffing {
    last: Option<bool>,
    run: u32,
    stuffed: u32,
    sent: u32,
    crc: u16,
}

impl Stuffing {
    fn put(&mut self, bit: bool) {
        let next = bit != (self.crc & 0x4000 != 0);
        self.crc = (self.crc << 1) & 0x7FFF;
        if next {
            self.crc ^= CRC15;
        }
        self.send(bit);
    }

    fn put_all(&mut self, value: u32, bits: u32) {
        (0..bits).rev().for_each(|at| self.put(value >> at & 1 != 0));
    }

    fn send(&mut self, bit: bool) {
        self.sent += 1;
        self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
        self.last = Some(bit);
        if self.run == 5 {
            self.stuffed += 1;
            (self.last, self.run) = (Some(!bit), 1);
        }
    }

    fn total(&self) -> u32 {
        self.sent + self.stuffed
    }

    /// Start of frame and identifier.
    fn put_id(&mut self, frame: &CanFrame) {
        let raw = frame.id().raw();
        self.put(false);
        if raw & EXTENDED == 0 {
            self.put_all(raw & 0x7FF, 11);
        } else {
            self.put_all(raw >> 18 & 0x7FF, 11);
            self.put_all(0b11, 2);
            self.put_all(raw & 0x3_FFFF, 18);
        }
    }
}

fn classic(frame: &CanFrame) -> Bits {
    let mut wire = Stuffing::default();
    let remote = frame.id().is_remote();
    wire.put_id(frame);
    wire.put(remote);
    // Identifier extension and one reserved bit, or two reserved bits.
    wire.put_all(0, 2);
    let bytes = frame.data();
    wire.put_all(u32::try_from(bytes.len()).unwrap_or(8), 4);
    if !remote {
        bytes.iter().for_each(|byte| wire.put_all(u32::from(*byte), 8));
    }
    let crc = wire.crc;
    (0..15).rev().for_each(|at| wire.send(crc >> at & 1 != 0));
    Bits { nominal: wire.total() + TAIL_BITS, data: 0 }
}

fn fd(frame: &CanFrame) -> Bits {
    let mut wire = Stuffing::default();
    let extended = frame.id().raw() & EXTENDED != 0;
    wire.put_id(frame);
    // Remote request substitution and, behind an 11-bit identifier, identifier extension.
    wire.put_all(0, if extended { 1 } else { 2 });
    // FD format, reserved, bit rate switch.
    let switches = frame.switches_bit_rate();
    wire.put_all(if switches { 0b101 } else { 0b100 }, 3);
    let arbitration = wire.total();
    let length = u32::try_from(frame.data().len()).unwrap_or(64);
    let sent = fd_bytes(length);
    wire.put(false);
    wire.put_all(fd_length_code(sent), 4);
    frame.data().iter().for_each(|byte| wire.put_all(u32::from(*byte), 8));
    (length..sent).for_each(|_| wire.put_all(0, 8));
    let (checksum, fixed_stuff) = if sent <= 16 { (17, 6) } else { (21, 7) };
    let data = wire.total() - arbitration + 4 + checksum + fixed_stuff + 1;
    if switches {
        Bits { nominal: arbitration + FD_TAIL_BITS, data }
    } else {
        Bits { nominal: arbitration + data + FD_TAIL_BITS, data: 0 }
    }
}

/// The data length code of an FD frame.
fn fd_length_code(bytes: u32) -> u32 {
    match bytes {
        0..=8 => bytes,
        12 => 9,
        16 => 10,
        20 => 11,
        24 => 12,
        32 => 13,
        48 => 14,
        _ => 15,
    }
}
