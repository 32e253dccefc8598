//! The objects that a simulated drive has: CiA 301 communication objects and the CiA 402 objects of its modes. Data only; the rules that tie objects together stand in `drive_objects`.
//!
//! Source: CiA 301 (communication profile) and CiA 402-2 (drive profile).

use super::modes::{HOMING_METHODS, MODES, SUPPORTED};

/// Type of an object's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    U8,
    U16,
    U32,
    I8,
    I16,
    I32,
    /// A visible string, read in segments.
    Text(&'static str),
}

impl Kind {
    /// Bits of a value; 0 for text, which no PDO carries.
    pub(crate) const fn bits(self) -> u8 {
        match self {
            Self::U8 | Self::I8 => 8,
            Self::U16 | Self::I16 => 16,
            Self::U32 | Self::I32 => 32,
            Self::Text(_) => 0,
        }
    }

    /// The values that the type can hold.
    const fn range(self) -> (i64, i64) {
        match self {
            Self::U8 => (0, 0xFF),
            Self::U16 => (0, 0xFFFF),
            Self::U32 => (0, 0xFFFF_FFFF),
            Self::I8 => (-0x80, 0x7F),
            Self::I16 => (-0x8000, 0x7FFF),
            Self::I32 => (-0x8000_0000, 0x7FFF_FFFF),
            Self::Text(_) => (0, 0),
        }
    }
}

/// Who may do what with an object by SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    ReadOnly,
    ReadWrite,
    WriteOnly,
}

/// One object (index and subindex) and what may be written to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spec {
    pub(crate) index: u16,
    pub(crate) sub: u8,
    pub(crate) kind: Kind,
    pub(crate) access: Access,
    /// A transmit PDO may carry it.
    pub(crate) in_tpdo: bool,
    /// A receive PDO may carry it.
    pub(crate) in_rpdo: bool,
    pub(crate) low: i64,
    pub(crate) high: i64,
    /// When not empty: the only values allowed.
    pub(crate) choices: &'static [i64],
    /// Value after power-up.
    pub(crate) default: i64,
}

impl Spec {
    const fn new(index: u16, sub: u8, kind: Kind, access: Access, default: i64) -> Self {
        let (low, high) = kind.range();
        let (in_tpdo, in_rpdo) = (false, false);
        Self { index, sub, kind, access, in_tpdo, in_rpdo, low, high, choices: &[], default }
    }
    const fn ro(index: u16, sub: u8, kind: Kind, default: i64) -> Self {
        Self::new(index, sub, kind, Access::ReadOnly, default)
    }
    const fn rw(index: u16, sub: u8, kind: Kind, default: i64) -> Self {
        Self::new(index, sub, kind, Access::ReadWrite, default)
    }
    const fn tpdo(mut self) -> Self {
        self.in_tpdo = true;
        self
    }
    const fn rpdo(mut self) -> Self {
        self.in_rpdo = true;
        self
    }
    const fn within(mut self, low: i64, high: i64) -> Self {
        self.low = low;
        self.high = high;
        self
    }
    const fn one_of(mut self, choices: &'static [i64]) -> Self {
        self.choices = choices;
        self
    }
}

/// Receive, and transmit, PDOs of a drive.
pub(crate) const PDOS: u16 = 4;
/// Objects that one PDO carries at most.
pub(crate) const MAPPED_MAX: u8 = 8;
/// Error history entries (0x1003).
pub(crate) const HISTORY: u8 = 8;
/// Heartbeat consumer entries (0x1016).
pub(crate) const CONSUMERS: u8 = 2;
/// "PDO not valid", bit 31 of a COB-ID parameter.
pub(crate) const INVALID: i64 = 0x8000_0000;

/// 0x6040 controlword.
const CONTROLWORD: i64 = 0x6040_0010;
/// 0x6041 statusword.
const STATUSWORD: i64 = 0x6041_0010;

/// Every object of the drive with this node id, sorted by index and subindex.
pub(crate) fn objects(node: u8) -> Vec<Spec> {
    let mut all = Vec::with_capacity(192);
    communication(node, &mut all);
    for n in 0..PDOS {
        pdo(node, n, &mut all);
    }
    power(&mut all);
    motion(&mut all);
    vendor(&mut all);
    all.sort_by_key(|spec| (spec.index, spec.sub));
    all
}

/// CiA 301 objects 0x1000 to 0x1029.
fn communication(node: u8, all: &mut Vec<Spec>) {
    let id = i64::from(node);
    all.extend([
        Spec::ro(0x1000, 0, Kind::U32, 0x0002_0192),
        Spec::ro(0x1001, 0, Kind::U8, 0).tpdo(),
        // Only 0 may be written: it clears the history.
        Spec::rw(0x1003, 0, Kind::U8, 0).one_of(&[0]),
        // The predefined identifiers are the only ones: moving SYNC or EMCY is refused.
        Spec::rw(0x1005, 0, Kind::U32, 0x80).one_of(&[0x80]),
        Spec::rw(0x1006, 0, Kind::U32, 0),
        Spec::rw(0x1007, 0, Kind::U32, 0),
        Spec::ro(0x1008, 0, Kind::Text("taustream simulated drive"), 0),
        Spec::ro(0x1009, 0, Kind::Text("none"), 0),
        Spec::ro(0x100A, 0, Kind::Text(env!("CARGO_PKG_VERSION")), 0),
        Spec::ro(0x1010, 0, Kind::U8, 1),
        Spec::rw(0x1010, 1, Kind::U32, 1),
        Spec::ro(0x1011, 0, Kind::U8, 1),
        Spec::rw(0x1011, 1, Kind::U32, 1),
        Spec::ro(0x1014, 0, Kind::U32, 0x80 + id),
        Spec::ro(0x1016, 0, Kind::U8, i64::from(CONSUMERS)),
        Spec::rw(0x1017, 0, Kind::U16, 0),
        Spec::ro(0x1018, 0, Kind::U8, 4),
        Spec::ro(0x1018, 1, Kind::U32, 0), // No vendor has this number: it cannot be mistaken for a real drive.
        Spec::ro(0x1018, 2, Kind::U32, 0x0000_5451),
        Spec::ro(0x1018, 3, Kind::U32, 0x0001_0000),
        Spec::ro(0x1018, 4, Kind::U32, id),
        Spec::rw(0x1019, 0, Kind::U8, 0).within(0, 240),
        Spec::ro(0x1029, 0, Kind::U8, 1),
        Spec::rw(0x1029, 1, Kind::U8, 0).within(0, 2),
    ]);
    all.extend((1..=HISTORY).map(|sub| Spec::ro(0x1003, sub, Kind::U32, 0)));
    all.extend((1..=CONSUMERS).map(|sub| Spec::rw(0x1016, sub, Kind::U32, 0)));
}

/// Parameters and mapping of receive and transmit PDO `n` (zero-based).
///
/// As shipped, PDO1 carries control- and statusword and PDO2 adds the mode; 3 and 4 are off (CiA 402-3).
fn pdo(node: u8, n: u16, all: &mut Vec<Spec>) {
    let (id, step) = (i64::from(node), i64::from(n) * 0x100);
    let off = if n < 2 { 0 } else { INVALID };
    let (count, rx, tx) = match n {
        0 => (1, [CONTROLWORD, 0], [STATUSWORD, 0]),
        1 => (2, [CONTROLWORD, 0x6060_0008], [STATUSWORD, 0x6061_0008]),
        _ => (0, [0, 0], [0, 0]),
    };
    all.extend([
        Spec::ro(0x1400 + n, 0, Kind::U8, 5),
        Spec::rw(0x1400 + n, 1, Kind::U32, off + 0x200 + step + id),
        Spec::rw(0x1400 + n, 2, Kind::U8, 255),
        Spec::rw(0x1400 + n, 5, Kind::U16, 0),
        Spec::rw(0x1600 + n, 0, Kind::U8, count).within(0, i64::from(MAPPED_MAX)),
        Spec::ro(0x1800 + n, 0, Kind::U8, 6),
        Spec::rw(0x1800 + n, 1, Kind::U32, off + 0x4000_0000 + 0x180 + step + id),
        Spec::rw(0x1800 + n, 2, Kind::U8, 255),
        Spec::rw(0x1800 + n, 3, Kind::U16, 100),
        Spec::rw(0x1800 + n, 5, Kind::U16, 0),
        Spec::rw(0x1800 + n, 6, Kind::U8, 0).within(0, 240),
        Spec::rw(0x1A00 + n, 0, Kind::U8, count).within(0, i64::from(MAPPED_MAX)),
    ]);
    for sub in 1..=MAPPED_MAX {
        let slot = usize::from(sub - 1);
        all.push(Spec::rw(0x1600 + n, sub, Kind::U32, rx.get(slot).copied().unwrap_or(0)));
        all.push(Spec::rw(0x1A00 + n, sub, Kind::U32, tx.get(slot).copied().unwrap_or(0)));
    }
}

/// CiA 402 device control.
fn power(all: &mut Vec<Spec>) {
    all.extend([
        Spec::rw(0x6007, 0, Kind::I16, 1).within(0, 3),
        Spec::ro(0x603F, 0, Kind::U16, 0).tpdo(),
        Spec::rw(0x6040, 0, Kind::U16, 0).rpdo().tpdo(),
        Spec::ro(0x6041, 0, Kind::U16, 0).tpdo(),
        Spec::rw(0x605A, 0, Kind::I16, 2).one_of(&[0, 1, 2, 3, 5, 6, 7]),
        Spec::rw(0x605B, 0, Kind::I16, 0).within(0, 1),
        Spec::rw(0x605C, 0, Kind::I16, 1).within(0, 1),
        Spec::rw(0x605D, 0, Kind::I16, 1).within(1, 3),
        Spec::rw(0x605E, 0, Kind::I16, 2).within(0, 3),
        // What 0x6502 says, or no mode.
        Spec::rw(0x6060, 0, Kind::I8, 0).one_of(MODES).rpdo(),
        Spec::ro(0x6061, 0, Kind::I8, 0).tpdo(),
        Spec::ro(0x6502, 0, Kind::U32, SUPPORTED),
    ]);
}

/// CiA 402 position control. Scales, windows and limits get their defaults from the settings.
fn motion(all: &mut Vec<Spec>) {
    all.extend([
        Spec::ro(0x6062, 0, Kind::I32, 0).tpdo(),
        Spec::ro(0x6064, 0, Kind::I32, 0).tpdo(),
        Spec::rw(0x6065, 0, Kind::U32, 0xFFFF_FFFF),
        Spec::rw(0x6066, 0, Kind::U16, 0),
        // Half a per mille of a motor revolution of 131072 counts.
        Spec::rw(0x6067, 0, Kind::U32, 64),
        Spec::ro(0x606C, 0, Kind::I32, 0).tpdo(),
        Spec::rw(0x6072, 0, Kind::U16, 1000),
        Spec::ro(0x6076, 0, Kind::U32, 0),
        Spec::ro(0x6077, 0, Kind::I16, 0).tpdo(),
        Spec::rw(0x607A, 0, Kind::I32, 0).rpdo().tpdo(),
        // 0 and 0: positions do not wrap.
        Spec::ro(0x607B, 0, Kind::U8, 2),
        Spec::ro(0x607B, 1, Kind::I32, 0),
        Spec::ro(0x607B, 2, Kind::I32, 0),
        Spec::rw(0x607C, 0, Kind::I32, 0),
        Spec::ro(0x607E, 0, Kind::U8, 0),
        Spec::ro(0x607D, 0, Kind::U8, 2),
        Spec::rw(0x607D, 1, Kind::I32, i64::from(i32::MIN)),
        Spec::rw(0x607D, 2, Kind::I32, i64::from(i32::MAX)),
        Spec::rw(0x607F, 0, Kind::U32, 1).rpdo(),
        // Revolutions of the motor a minute.
        Spec::rw(0x6080, 0, Kind::U32, 1).rpdo(),
        Spec::rw(0x6081, 0, Kind::U32, 1).rpdo(),
        Spec::rw(0x6082, 0, Kind::U32, 0).one_of(&[0]),
        Spec::rw(0x6083, 0, Kind::U32, 1).within(1, 0xFFFF_FFFF).rpdo(),
        Spec::rw(0x6084, 0, Kind::U32, 1).within(1, 0xFFFF_FFFF).rpdo(),
        Spec::rw(0x6085, 0, Kind::U32, 1).within(1, 0xFFFF_FFFF),
        Spec::ro(0x608F, 0, Kind::U8, 2),
        Spec::ro(0x608F, 1, Kind::U32, 1),
        Spec::ro(0x608F, 2, Kind::U32, 1),
        Spec::ro(0x6091, 0, Kind::U8, 2),
        Spec::ro(0x6091, 1, Kind::U32, 1),
        Spec::ro(0x6091, 2, Kind::U32, 1),
        Spec::ro(0x6092, 0, Kind::U8, 2),
        Spec::ro(0x6092, 1, Kind::U32, 1),
        Spec::ro(0x6092, 2, Kind::U32, 1),
        Spec::ro(0x6093, 0, Kind::U8, 2),
        Spec::ro(0x6093, 1, Kind::U32, 1),
        Spec::ro(0x6093, 2, Kind::U32, 1),
        Spec::rw(0x6098, 0, Kind::I8, 0).one_of(HOMING_METHODS),
        Spec::ro(0x6099, 0, Kind::U8, 2),
        Spec::rw(0x6099, 1, Kind::U32, 1).within(1, 0xFFFF_FFFF),
        Spec::rw(0x6099, 2, Kind::U32, 1).within(1, 0xFFFF_FFFF),
        Spec::rw(0x609A, 0, Kind::U32, 1).within(1, 0xFFFF_FFFF),
        Spec::rw(0x60B0, 0, Kind::I32, 0).rpdo(),
        Spec::rw(0x60B1, 0, Kind::I32, 0).rpdo(),
        Spec::rw(0x60B2, 0, Kind::I16, 0).rpdo(),
        Spec::ro(0x60C1, 0, Kind::U8, 1),
        Spec::rw(0x60C1, 1, Kind::I32, 0).rpdo(),
        Spec::ro(0x60C2, 0, Kind::U8, 2),
        Spec::rw(0x60C2, 1, Kind::U8, 1).within(1, 255),
        Spec::rw(0x60C2, 2, Kind::I8, -3).within(-6, 0),
        Spec::rw(0x60C5, 0, Kind::U32, 1).rpdo(),
        Spec::rw(0x60C6, 0, Kind::U32, 1).rpdo(),
        Spec::ro(0x60F4, 0, Kind::I32, 0).tpdo(),
        // Bit 0 negative, bit 1 positive limit switch.
        Spec::ro(0x60FD, 0, Kind::U32, 0).tpdo(),
        Spec::ro(0x60FE, 0, Kind::U8, 2),
        Spec::rw(0x60FE, 1, Kind::U32, 0).rpdo(),
        Spec::rw(0x60FE, 2, Kind::U32, 0),
        Spec::rw(0x60FF, 0, Kind::I32, 0).rpdo().tpdo(),
    ]);
}

/// Objects of this simulator alone.
fn vendor(all: &mut Vec<Spec>) {
    all.extend([
        Spec::ro(0x2000, 0, Kind::U8, 2),
        // SYNC watchdog: milliseconds without SYNC while energised; 0 = off.
        Spec::rw(0x2000, 1, Kind::U16, 0),
        // Its reaction: 0 report and hold, 1 fault reaction (0x605E), 2 torque off.
        Spec::rw(0x2000, 2, Kind::U8, 1).within(0, 2),
        // Writing an EMCY code provokes that fault.
        Spec::new(0x2002, 0, Kind::U16, Access::WriteOnly, 0).within(1, 0xFFFF),
    ]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_stand_once_each_and_defaults_are_inside_their_ranges() {
        let all = objects(5);
        assert!(all.len() > 120, "only {} objects", all.len());
        for pair in all.windows(2) {
            let keys = [(pair[0].index, pair[0].sub), (pair[1].index, pair[1].sub)];
            assert!(keys[0] < keys[1], "{keys:04X?} out of order or double");
        }
        for spec in &all {
            let (low, high) = spec.kind.range();
            assert!(low <= spec.low && spec.high <= high, "{:04X}:{}", spec.index, spec.sub);
            // The fault trigger is write-only: it has no value of its own.
            let outside = !(spec.low..=spec.high).contains(&spec.default);
            assert!(!outside || spec.access == Access::WriteOnly, "{:04X}:{}", spec.index, spec.sub);
        }
    }
}
