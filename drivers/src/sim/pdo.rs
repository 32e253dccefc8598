//! The PDOs of a simulated drive: parameters and mapping as the master writes them, latching, and sampling.
//!
//! Source: CiA 301 section 7.5.2.35 (RPDO parameters) to 7.5.2.38 (TPDO mapping).
use super::dictionary::{AbortCode, Dictionary, number};
use super::objects::{INVALID, Kind, MAPPED_MAX, PDOS};
use crate::codec::object::{
    PDO_COB_ID, PDO_EVENT_TIMER, PDO_INHIBIT, PDO_SYNC_START, PDO_TYPE, RPDO_COMMUNICATION, RPDO_MAPPING,
    TPDO_COMMUNICATION, TPDO_MAPPING,
};
use crate::codec::{Address, PdoEntry, error_text};
use crate::frame::{CanFrame, CanId};
use crate::servo::Nanos;

/// Bits of a classic frame's data.
const FRAME_BITS: u32 = 64;
/// Largest synchronous transmission type.
const SYNCHRONOUS_MAX: u8 = 240;

/// One object in a PDO.
#[derive(Clone, Copy, Debug)]
struct Slot {
    address: Address,
    kind: Kind,
    /// A gap in a receive PDO: skipped.
    dummy: bool,
}

/// A PDO as compiled from its parameters.
#[derive(Clone, Debug, Default)]
struct Pdo {
    /// Identifier; `None` while bit 31 says that the PDO does not exist.
    cob_id: Option<u16>,
    kind: u8,
    slots: Vec<Slot>,
    bytes: usize,
}

/// What became of a received PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Received {
    /// It is no RPDO of this drive.
    NotMine,
    /// Latched until the next SYNC.
    Latched,
    /// To be applied now (event-driven type).
    Now(usize),
    /// Shorter than its mapping: ignored. True for the first in a row.
    TooShort(bool),
}

#[derive(Clone, Debug, Default)]
struct Rpdo {
    pdo: Pdo,
    /// Data that waits for the next SYNC.
    latched: Option<[u8; 8]>,
    newest: Option<Nanos>,
    too_short: bool,
}

#[derive(Clone, Debug, Default)]
struct Tpdo {
    pdo: Pdo,
    syncs: u8,
    /// SYNC start value reached, or none is set.
    started: bool,
    sent: Option<([u8; 8], Nanos)>,
}

/// All PDOs of a drive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pdos {
    receive: [Rpdo; PDOS as usize],
    transmit: [Tpdo; PDOS as usize],
}

impl Pdos {
    /// Compiles every PDO from the dictionary; nothing is latched any more.
    pub(crate) fn compile(dictionary: &Dictionary) -> Self {
        let mut all = Self::default();
        for (n, rpdo) in (0..).zip(&mut all.receive) {
            rpdo.pdo = compile(dictionary, RPDO_COMMUNICATION + n, RPDO_MAPPING + n);
        }
        for (n, tpdo) in (0..).zip(&mut all.transmit) {
            tpdo.pdo = compile(dictionary, TPDO_COMMUNICATION + n, TPDO_MAPPING + n);
            tpdo.started = dictionary.get(TPDO_COMMUNICATION + n, PDO_SYNC_START) == 0;
        }
        all
    }

    /// Takes a frame that may be one of the RPDOs.
    pub(crate) fn receive(&mut self, now: Nanos, frame: &CanFrame) -> Received {
        let id = frame.id().as_standard_data();
        let Some((n, rpdo)) =
            self.receive.iter_mut().enumerate().find(|(_, rpdo)| id.is_some() && rpdo.pdo.cob_id == id)
        else {
            return Received::NotMine;
        };
        if frame.data().len() < rpdo.pdo.bytes {
            let first = !rpdo.too_short;
            rpdo.too_short = true;
            return Received::TooShort(first);
        }
        let mut data = [0; 8];
        for (slot, byte) in data.iter_mut().zip(frame.data()) {
            *slot = *byte;
        }
        rpdo.latched = Some(data);
        rpdo.newest = Some(now);
        rpdo.too_short = false;
        if rpdo.pdo.kind <= SYNCHRONOUS_MAX { Received::Latched } else { Received::Now(n) }
    }

    /// Hands the latched values of the synchronous RPDOs to `write`, in PDO order. Returns whether there were any.
    pub(crate) fn apply_latched(&mut self, mut write: impl FnMut(Address, i64)) -> bool {
        let mut any = false;
        for rpdo in self.receive.iter_mut().filter(|rpdo| rpdo.pdo.kind <= SYNCHRONOUS_MAX) {
            any |= apply(rpdo, &mut write);
        }
        any
    }

    /// Hands the values of event-driven RPDO `n` to `write`.
    pub(crate) fn apply_now(&mut self, n: usize, mut write: impl FnMut(Address, i64)) {
        if let Some(rpdo) = self.receive.get_mut(n) {
            apply(rpdo, &mut write);
        }
    }

    /// Clears what is latched: PDOs do not outlive the operational state.
    pub(crate) fn drop_latched(&mut self) {
        for rpdo in &mut self.receive {
            rpdo.latched = None;
            rpdo.newest = None;
        }
        for tpdo in &mut self.transmit {
            tpdo.sent = None;
            tpdo.syncs = 0;
        }
    }

    /// True when an RPDO with an event timer has not come for longer than that. Armed by the first RPDO.
    pub(crate) fn deadline_missed(&mut self, now: Nanos, dictionary: &Dictionary) -> bool {
        let mut missed = false;
        for (n, rpdo) in (0..).zip(&mut self.receive) {
            let limit_ms = dictionary.get(RPDO_COMMUNICATION + n, PDO_EVENT_TIMER);
            let late = rpdo.newest.is_some_and(|newest| now.since_s(newest) > seconds(limit_ms, 1e-3));
            if limit_ms > 0 && rpdo.pdo.cob_id.is_some() && late {
                rpdo.newest = None;
                missed = true;
            }
        }
        missed
    }

    /// Pushes the TPDOs that answer a SYNC, sampled from the dictionary now.
    pub(crate) fn on_sync(
        &mut self,
        now: Nanos,
        counter: Option<u8>,
        dictionary: &Dictionary,
        out: &mut Vec<CanFrame>,
    ) {
        for (n, tpdo) in (0..).zip(&mut self.transmit) {
            let start = dictionary.get(TPDO_COMMUNICATION + n, PDO_SYNC_START);
            if tpdo.pdo.kind > SYNCHRONOUS_MAX || tpdo.pdo.cob_id.is_none() {
                continue;
            }
            if !tpdo.started {
                // The SYNC that carries the start value is the first that counts, and is answered.
                tpdo.started = counter.is_none_or(|counter| i64::from(counter) == start);
                if !tpdo.started {
                    continue;
                }
                tpdo.syncs = tpdo.pdo.kind.saturating_sub(1);
            }
            tpdo.syncs = tpdo.syncs.saturating_add(1);
            let data = pack(&tpdo.pdo, dictionary);
            let changed = tpdo.sent.is_none_or(|(sent, _)| sent != data);
            let due = if tpdo.pdo.kind == 0 { changed } else { tpdo.syncs >= tpdo.pdo.kind };
            if due {
                tpdo.syncs = 0;
                push(tpdo, now, data, out);
            }
        }
    }

    /// Pushes event-driven TPDOs whose values changed or whose event timer ran out, inhibit time kept.
    pub(crate) fn on_event(&mut self, now: Nanos, dictionary: &Dictionary, out: &mut Vec<CanFrame>) {
        for (n, tpdo) in (0..).zip(&mut self.transmit) {
            if tpdo.pdo.kind <= SYNCHRONOUS_MAX || tpdo.pdo.cob_id.is_none() {
                continue;
            }
            let data = pack(&tpdo.pdo, dictionary);
            let inhibit_s = seconds(dictionary.get(TPDO_COMMUNICATION + n, PDO_INHIBIT), 1e-4);
            let event_s = seconds(dictionary.get(TPDO_COMMUNICATION + n, PDO_EVENT_TIMER), 1e-3);
            let due = tpdo.sent.is_none_or(|(sent, at)| {
                let age_s = now.since_s(at);
                (sent != data && age_s >= inhibit_s) || (event_s > 0.0 && age_s >= event_s)
            });
            if due {
                push(tpdo, now, data, out);
            }
        }
    }
}

/// Checks a write to a PDO parameter or mapping object; objects of others pass.
pub(crate) fn check_write(dictionary: &Dictionary, address: Address, value: i64) -> Result<(), AbortCode> {
    let (pdo, transmit, mapping) = match address.index & 0xFF00 {
        RPDO_COMMUNICATION => (address.index - RPDO_COMMUNICATION, false, false),
        RPDO_MAPPING => (address.index - RPDO_MAPPING, false, true),
        TPDO_COMMUNICATION => (address.index - TPDO_COMMUNICATION, true, false),
        TPDO_MAPPING => (address.index - TPDO_MAPPING, true, true),
        _ => return Ok(()),
    };
    let communication = if transmit { TPDO_COMMUNICATION } else { RPDO_COMMUNICATION } + pdo;
    let cob_id = dictionary.get(communication, PDO_COB_ID);
    let exists = cob_id & INVALID == 0;
    match (mapping, address.sub) {
        (false, PDO_COB_ID) => check_cob_id(cob_id, value),
        (false, PDO_TYPE) if (241..=253).contains(&value) => Err(error_text::ABORT_RANGE),
        (false, PDO_TYPE | PDO_EVENT_TIMER) => Ok(()),
        (_, _) if exists => Err(error_text::ABORT_DEVICE_STATE),
        (false, _) => Ok(()),
        (true, 0) => check_count(dictionary, address.index, transmit, value),
        (true, _) if dictionary.get(address.index, 0) != 0 => Err(error_text::ABORT_ACCESS),
        (true, _) => slot(dictionary, value, transmit).map(|_| ()),
    }
}

/// True when a write puts a dummy entry (an index below 0x20 is a data type) into a mapping.
pub(crate) fn maps_dummy(address: Address, value: i64) -> bool {
    const DATA_TYPES_END: i64 = 0x0020_0000;
    matches!(address.index & 0xFF00, RPDO_MAPPING | TPDO_MAPPING)
        && address.sub != 0
        && (1..DATA_TYPES_END).contains(&value)
}

/// A COB-ID may change only while the PDO does not exist, and never to an identifier of the protocol itself.
fn check_cob_id(old: i64, new: i64) -> Result<(), AbortCode> {
    /// Bit 30 (no remote requests) and bits 0 to 28 (identifier).
    const IDENTIFIER: i64 = 0x1FFF_FFFF;
    let id = new & IDENTIFIER;
    if old & INVALID == 0 && new & INVALID == 0 && id != old & IDENTIFIER {
        return Err(error_text::ABORT_DEVICE_STATE);
    }
    let extended = new & 0x2000_0000 != 0;
    // CiA 301 table 42: NMT, SYNC, EMCY, TIME, SDO and heartbeat identifiers are not for PDOs.
    let restricted = matches!(id, 0x000..=0x0FF | 0x100..=0x180 | 0x580..=0x5FF | 0x600..=0x67F | 0x6E0..);
    if new & INVALID == 0 && (extended || restricted) { Err(error_text::ABORT_RANGE) } else { Ok(()) }
}

/// A mapping becomes valid when all its entries are, and fit a frame.
fn check_count(dictionary: &Dictionary, index: u16, transmit: bool, count: i64) -> Result<(), AbortCode> {
    let mut bits = 0;
    for sub in (1..=MAPPED_MAX).take_while(|sub| i64::from(*sub) <= count) {
        bits += u32::from(slot(dictionary, dictionary.get(index, sub), transmit)?.kind.bits());
    }
    if bits > FRAME_BITS { Err(error_text::ABORT_PDO_LENGTH) } else { Ok(()) }
}

/// The object that a mapping entry names, when a PDO of this direction may carry it in this width.
fn slot(dictionary: &Dictionary, entry: i64, transmit: bool) -> Result<Slot, AbortCode> {
    let entry = PdoEntry::decode(u32::try_from(entry).map_err(|_| error_text::ABORT_NOT_MAPPABLE)?);
    let dummy = match (entry.address.index, entry.address.sub) {
        (0x0005, 0) => Some(Kind::U8),
        (0x0006, 0) => Some(Kind::U16),
        (0x0007, 0) => Some(Kind::U32),
        _ => None,
    };
    let (kind, allowed) = if let Some(kind) = dummy {
        (kind, !transmit)
    } else {
        let spec = dictionary.spec(entry.address)?;
        (spec.kind, if transmit { spec.in_tpdo } else { spec.in_rpdo })
    };
    if !allowed || kind.bits() != entry.bits {
        return Err(error_text::ABORT_NOT_MAPPABLE);
    }
    Ok(Slot { address: entry.address, kind, dummy: dummy.is_some() })
}

fn compile(dictionary: &Dictionary, communication: u16, mapping: u16) -> Pdo {
    let cob_id = dictionary.get(communication, PDO_COB_ID);
    let kind = u8::try_from(dictionary.get(communication, PDO_TYPE)).unwrap_or(u8::MAX);
    let count = dictionary.get(mapping, 0);
    let transmit = communication >= TPDO_COMMUNICATION;
    let mut slots = Vec::with_capacity(usize::from(MAPPED_MAX));
    for sub in (1..=MAPPED_MAX).take_while(|sub| i64::from(*sub) <= count) {
        // Entries were checked when the count was written.
        slots.extend(slot(dictionary, dictionary.get(mapping, sub), transmit));
    }
    let bytes = slots.iter().map(|slot| usize::from(slot.kind.bits() / 8)).sum();
    let cob_id = (cob_id & INVALID == 0).then(|| u16::try_from(cob_id & 0x7FF).unwrap_or(0));
    Pdo { cob_id, kind, slots, bytes }
}

fn apply(rpdo: &mut Rpdo, write: &mut impl FnMut(Address, i64)) -> bool {
    let Some(data) = rpdo.latched.take() else { return false };
    let mut at = 0;
    for slot in &rpdo.pdo.slots {
        let size = usize::from(slot.kind.bits() / 8);
        if let Some(bytes) = data.get(at..at + size)
            && !slot.dummy
        {
            write(slot.address, number(bytes, slot.kind));
        }
        at += size;
    }
    true
}

fn pack(pdo: &Pdo, dictionary: &Dictionary) -> [u8; 8] {
    let mut data = [0; 8];
    let mut at = 0;
    for slot in &pdo.slots {
        let value = dictionary.get(slot.address.index, slot.address.sub).to_le_bytes();
        let size = usize::from(slot.kind.bits() / 8);
        for (to, byte) in data.iter_mut().skip(at).take(size).zip(value) {
            *to = byte;
        }
        at += size;
    }
    data
}

fn push(tpdo: &mut Tpdo, now: Nanos, data: [u8; 8], out: &mut Vec<CanFrame>) {
    if let Some(id) = tpdo.pdo.cob_id {
        out.push(CanFrame::classic(CanId::standard(id), data.get(..tpdo.pdo.bytes).unwrap_or(&[])));
        tpdo.sent = Some((data, now));
    }
}

/// A count of time units in seconds.
fn seconds(count: i64, unit_s: f64) -> f64 {
    f64::from(u16::try_from(count).unwrap_or(u16::MAX)) * unit_s
}
