//! The object dictionary of a simulated drive: values, and the checks that concern one object alone.
//!
//! What ties objects together (PDO rules, device states) is `drive_objects`' business.
//! Source: CiA 301 section 7.2.4.3.17 (abort codes).
use super::objects::{Access, Kind, Spec, objects};
use super::planted::{ObjectChange, PlantedObject};
use crate::codec::Address;
use crate::codec::error_text;

/// Longest value in bytes: text.
pub(crate) const VALUE_MAX: usize = 64;

/// An SDO abort code (CiA 301, 7.2.4.3.17).
pub(crate) type AbortCode = u32;

/// A value as it stands on the wire, least significant byte first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bytes {
    bytes: [u8; VALUE_MAX],
    len: usize,
}

impl Bytes {
    /// Nothing yet.
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; VALUE_MAX], len: 0 }
    }
    /// Appends the bytes that fit; false when some did not.
    pub(crate) fn extend(&mut self, more: &[u8]) -> bool {
        let Some(slots) = self.bytes.get_mut(self.len..) else { return false };
        for (slot, byte) in slots.iter_mut().zip(more) {
            *slot = *byte;
        }
        let taken = more.len().min(slots.len());
        self.len += taken;
        taken == more.len()
    }
    /// The bytes.
    pub(crate) fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&[])
    }
}

/// Values of all objects of one drive.
#[derive(Clone, Debug)]
pub(crate) struct Dictionary {
    specs: Vec<Spec>,
    values: Vec<i64>,
    /// Values that a reset brings back: the defaults, or what 0x1010 stored.
    stored: Vec<i64>,
    /// Objects that are refused with another code than CiA 301 has for it.
    codes: Vec<(Address, AbortCode)>,
    /// Objects that are read in more bytes than their type has.
    wide: Vec<(Address, u8)>,
}

impl Dictionary {
    /// A dictionary as shipped.
    pub(crate) fn new(node: u8) -> Self {
        let specs = objects(node);
        let values: Vec<i64> = specs.iter().map(|spec| spec.default).collect();
        Self { specs, stored: values.clone(), values, codes: Vec::new(), wide: Vec::new() }
    }

    /// Changes the value that a power-up gives an object; for set-up.
    pub(crate) fn ship(&mut self, address: Address, value: i64) {
        if let Some(at) = self.find(address) {
            for list in [&mut self.values, &mut self.stored] {
                if let Some(slot) = list.get_mut(at) {
                    *slot = value;
                }
            }
            if let Some(spec) = self.specs.get_mut(at) {
                spec.default = value;
            }
        }
    }

    /// Changes an object as shipped; false when there is none, or it cannot be changed so.
    pub(crate) fn plant(&mut self, object: PlantedObject) -> bool {
        let address = object.address;
        let Some(at) = self.find(address) else { return false };
        let Some(kind) = self.specs.get(at).map(|spec| spec.kind) else { return false };
        match object.change {
            ObjectChange::Value(value) => {
                let fits = narrow(value, kind) == value;
                if fits {
                    self.ship(address, value);
                }
                fits
            }
            ObjectChange::ReadOnly => {
                self.fix_where(|spec| (spec.index, spec.sub) == (address.index, address.sub));
                true
            }
            ObjectChange::Refused(code) => {
                self.codes.push((address, code));
                true
            }
            ObjectChange::Bytes(bytes) => {
                self.wide.push((address, bytes));
                bytes > kind.bits() / 8 && kind.bits() > 0
            }
            ObjectChange::Absent => {
                self.specs.remove(at);
                self.values.remove(at);
                self.stored.remove(at);
                true
            }
        }
    }

    /// Makes objects of these indices read-only.
    pub(crate) fn fix(&mut self, indices: std::ops::RangeInclusive<u16>) {
        self.fix_where(|spec| indices.contains(&spec.index));
    }

    fn fix_where(&mut self, holds: impl Fn(&Spec) -> bool) {
        for spec in self.specs.iter_mut().filter(|spec| holds(spec)) {
            spec.access = Access::ReadOnly;
        }
    }

    /// The code with which an object is refused, in place of the one of CiA 301.
    fn refusal(&self, address: Address, code: AbortCode) -> AbortCode {
        self.codes.iter().find(|(other, _)| *other == address).map_or(code, |(_, own)| *own)
    }

    /// The value of an object; 0 when there is none.
    pub(crate) fn get(&self, index: u16, sub: u8) -> i64 {
        self.find(Address::new(index, sub)).and_then(|at| self.values.get(at)).copied().unwrap_or(0)
    }

    /// Sets a value that has been checked, or that the drive itself computes; it is confined to the type's width.
    pub(crate) fn set(&mut self, index: u16, sub: u8, value: i64) {
        if let Some(at) = self.find(Address::new(index, sub))
            && let (Some(slot), Some(spec)) = (self.values.get_mut(at), self.specs.get(at))
        {
            *slot = narrow(value, spec.kind);
        }
    }

    /// What the object is.
    pub(crate) fn spec(&self, address: Address) -> Result<&Spec, AbortCode> {
        match self.find(address).and_then(|at| self.specs.get(at)) {
            Some(spec) => Ok(spec),
            None if self.specs.iter().any(|spec| spec.index == address.index) => {
                Err(self.refusal(address, error_text::ABORT_NO_SUBINDEX))
            }
            None => Err(self.refusal(address, error_text::ABORT_NO_OBJECT)),
        }
    }

    /// Reads an object for an SDO.
    pub(crate) fn read(&self, address: Address) -> Result<Bytes, AbortCode> {
        let spec = self.spec(address)?;
        if spec.access == Access::WriteOnly {
            return Err(error_text::ABORT_WRITE_ONLY);
        }
        let mut out = Bytes::new();
        if let Kind::Text(text) = spec.kind {
            out.extend(text.as_bytes());
        } else {
            let all = self.get(address.index, address.sub).to_le_bytes();
            let wide = self.wide.iter().find(|(other, _)| *other == address).map(|(_, bytes)| *bytes);
            out.extend(all.get(..usize::from(wide.unwrap_or(spec.kind.bits() / 8))).unwrap_or(&[]));
        }
        Ok(out)
    }

    /// Checks a value that an SDO writes against the object alone; the number when it may stand there.
    ///
    /// A transfer that did not state its size is taken when it is as long as the object or longer.
    pub(crate) fn check_write(&self, address: Address, bytes: &[u8], sized: bool) -> Result<i64, AbortCode> {
        let spec = self.spec(address)?;
        if spec.access == Access::ReadOnly {
            return Err(self.refusal(address, error_text::ABORT_READ_ONLY));
        }
        let size = usize::from(spec.kind.bits() / 8);
        let value = bytes.get(..size).ok_or(error_text::ABORT_TOO_SHORT)?;
        if sized && bytes.len() > size {
            return Err(error_text::ABORT_TOO_LONG);
        }
        let value = number(value, spec.kind);
        if !spec.choices.is_empty() && !spec.choices.contains(&value) {
            return Err(error_text::ABORT_RANGE);
        }
        match value {
            low if low < spec.low => Err(error_text::ABORT_TOO_LOW),
            high if high > spec.high => Err(error_text::ABORT_TOO_HIGH),
            _ => Ok(value),
        }
    }

    /// Stores the values that a user may write (0x1010).
    pub(crate) fn store(&mut self) {
        for ((spec, value), stored) in self.specs.iter().zip(&self.values).zip(&mut self.stored) {
            if spec.access == Access::ReadWrite && !is_live(spec.index) {
                *stored = *value;
            }
        }
    }

    /// Makes the next reset bring back the values as shipped (0x1011).
    pub(crate) fn restore(&mut self) {
        for (spec, stored) in self.specs.iter().zip(&mut self.stored) {
            *stored = spec.default;
        }
    }

    /// Back to the stored values: communication objects only (below 0x2000), or all.
    pub(crate) fn reset(&mut self, communication_only: bool) {
        for ((spec, value), stored) in self.specs.iter().zip(&mut self.values).zip(&self.stored) {
            if !communication_only || spec.index < 0x2000 {
                *value = *stored;
            }
        }
    }

    /// Moves the identifiers that contain the node id to another one.
    pub(crate) fn readdress(&mut self, from: u8, to: u8) {
        let change = i64::from(to) - i64::from(from);
        let holds_id = |spec: &Spec| matches!((spec.index, spec.sub), (0x1014, 0) | (0x1400..=0x15FF | 0x1800..=0x19FF, 1));
        for ((spec, value), stored) in self.specs.iter_mut().zip(&mut self.values).zip(&mut self.stored) {
            if holds_id(spec) {
                spec.default += change;
                *value += change;
                *stored += change;
            }
        }
    }

    fn find(&self, address: Address) -> Option<usize> {
        self.specs.binary_search_by_key(&(address.index, address.sub), |spec| (spec.index, spec.sub)).ok()
    }
}

/// Objects that a master commands with: they never start from a stored value.
fn is_live(index: u16) -> bool {
    matches!(index, 0x1003 | 0x1010 | 0x1011 | 0x6040 | 0x6060 | 0x607A | 0x60B0..=0x60B2)
}

/// The number that little-endian bytes spell in a type.
pub(crate) fn number(bytes: &[u8], kind: Kind) -> i64 {
    let mut all = [0; 8];
    for (slot, byte) in all.iter_mut().zip(bytes) {
        *slot = *byte;
    }
    narrow(i64::from_le_bytes(all), kind)
}

/// Confines a number to a type by cutting bits off, as a register would.
fn narrow(value: i64, kind: Kind) -> i64 {
    let cut = 64 - u32::from(kind.bits());
    match kind {
        Kind::U8 | Kind::U16 | Kind::U32 => value & (i64::MAX >> (cut - 1)),
        Kind::I8 | Kind::I16 | Kind::I32 => value << cut >> cut,
        Kind::Text(_) => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_the_width_and_sign_of_their_type() {
        for (bytes, kind, value) in [
            (&[0xFF_u8][..], Kind::U8, 255),
            (&[0xFF], Kind::I8, -1),
            (&[0xFD], Kind::I8, -3),
            (&[0x00, 0x80], Kind::I16, -32_768),
            (&[0x00, 0x80], Kind::U16, 32_768),
            (&[0, 0, 0, 0x80], Kind::I32, i64::from(i32::MIN)),
            (&[0xFF, 0xFF, 0xFF, 0xFF], Kind::U32, 0xFFFF_FFFF),
        ] {
            assert_eq!(number(bytes, kind), value, "{bytes:02X?} as {kind:?}");
        }
    }

    #[test]
    fn store_keeps_parameters_but_not_commands_and_restore_forgets_them() {
        let mut dictionary = Dictionary::new(1);
        dictionary.set(0x1017, 0, 250);
        dictionary.set(0x6040, 0, 0x0F);
        dictionary.store();
        dictionary.reset(false);
        assert_eq!((dictionary.get(0x1017, 0), dictionary.get(0x6040, 0)), (250, 0));
        dictionary.restore();
        dictionary.reset(true);
        assert_eq!(dictionary.get(0x1017, 0), 0);
    }
}
