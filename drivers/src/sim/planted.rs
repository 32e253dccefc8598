//! Objects of a simulated CiA 402 drive that hold another value than its settings make, or that it does not have:
//! `joint=elbow,object=0x6091:01,value=50`, `object=0x6092,value=absent`; or one that cannot be written, that is refused with
//! another abort code, or that is read in more bytes than its type has: `object=0x6007,access=read-only,abort=0x08000020`,
//! `object=0x6041,bytes=4`.
//!
//! A drive with another gear, feed, direction or range then counts so: the joint moves by another angle than commanded,
//! with feedback that agrees. The same text serves `--object` and the key `objects` of `[simulator]`.
use super::dictionary::Dictionary;
use super::drive::{Drive, DriveParameters};
use super::settings::DriveSetup;
use crate::codec::{Address, object};
use std::f64::consts::TAU;

/// One object and a change of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlantedObject {
    /// The object.
    pub address: Address,
    /// What is changed.
    pub change: ObjectChange,
}

/// What is changed of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectChange {
    /// It holds this value.
    Value(i64),
    /// It cannot be written.
    ReadOnly,
    /// Where it is refused, it is with this SDO abort code.
    Refused(u32),
    /// It is read in so many bytes.
    Bytes(u8),
    /// The drive does not have it.
    Absent,
}

/// Why an object cannot be planted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlantError {
    /// A piece without an equals sign, an unknown key, or one that appears twice.
    #[error(
        "{0:?} is no part of an object: expected joint= (all joints without it), object=0xINDEX:SUB, value=NUMBER|absent, \
         access=read-only, abort=0xCODE, bytes=NUMBER"
    )]
    Piece(String),
    /// A key that must be there.
    #[error("{0} is missing: expected for example joint=3,object=0x6091:01,value=50")]
    Missing(&'static str),
    /// No address or number.
    #[error("{key}={given}: expected {expected}")]
    Number {
        /// The key.
        key: &'static str,
        /// What stood there.
        given: String,
        /// What fits.
        expected: &'static str,
    },
    /// The joint is not one of the arm's.
    #[error("joint={0} is no joint of this arm")]
    Joint(String),
    /// The joint's servo has no objects.
    #[error(
        "joint {0} has no CiA 402 drive, so no objects; the parameters of motors are keys of [simulator]"
    )]
    NoDrive(String),
    /// The drive does not have the object, or it holds no such value.
    #[error("the simulated drive has no object {0}, or it cannot be changed so")]
    Object(Address),
}

/// Reads one text and plants it in the joints that it names.
///
/// # Errors
/// What was not understood, and what was expected.
pub fn plant(text: &str, setups: &mut [DriveSetup]) -> Result<(), PlantError> {
    let (mut joint, mut address) = (None, None);
    let (mut value, mut access, mut abort, mut bytes) = (None, None, None, None);
    for piece in text.split(',').map(str::trim) {
        let (key, given) = piece.split_once('=').ok_or_else(|| PlantError::Piece(piece.to_owned()))?;
        let slot = match key {
            "joint" => &mut joint,
            "object" => &mut address,
            "value" => &mut value,
            "access" => &mut access,
            "abort" => &mut abort,
            "bytes" => &mut bytes,
            _ => return Err(PlantError::Piece(piece.to_owned())),
        };
        if slot.replace(given).is_some() {
            return Err(PlantError::Piece(piece.to_owned()));
        }
    }
    let address = read_address(address.ok_or(PlantError::Missing("object"))?)?;
    let changes = read_changes([value, access, abort, bytes])?;
    let Some(name) = joint else {
        return setups.iter_mut().try_for_each(|setup| add(setup, address, &changes));
    };
    let by_number = name.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    let at = setups.iter().position(|setup| setup.joint == name).or(by_number);
    let setup = at.and_then(|at| setups.get_mut(at)).ok_or_else(|| PlantError::Joint(name.to_owned()))?;
    add(setup, address, &changes)
}

fn add(setup: &mut DriveSetup, address: Address, changes: &[ObjectChange]) -> Result<(), PlantError> {
    for change in changes {
        let object = PlantedObject { address, change: *change };
        match setup.parameters.takes_object(object) {
            None => return Err(PlantError::NoDrive(setup.joint.clone())),
            Some(false) => return Err(PlantError::Object(address)),
            Some(true) => setup.objects.push(object),
        }
    }
    Ok(())
}

/// What is changed, the absence last: what is gone cannot be changed any more.
fn read_changes(given: [Option<&str>; 4]) -> Result<Vec<ObjectChange>, PlantError> {
    let [value, access, abort, bytes] = given;
    let mut changes = Vec::new();
    if let Some(text) = access {
        let wrong = || PlantError::Number { key: "access", given: text.to_owned(), expected: "read-only" };
        changes.push((text == "read-only").then_some(ObjectChange::ReadOnly).ok_or_else(wrong)?);
    }
    if let Some(text) = abort {
        let expected = "an SDO abort code in hexadecimal, for example 0x08000020";
        let wrong = || PlantError::Number { key: "abort", given: text.to_owned(), expected };
        let code = text.strip_prefix("0x").and_then(|digits| u32::from_str_radix(digits, 16).ok());
        changes.push(ObjectChange::Refused(code.ok_or_else(wrong)?));
    }
    if let Some(text) = bytes {
        let wrong = || PlantError::Number { key: "bytes", given: text.to_owned(), expected: "1 to 4" };
        let number = text.parse().ok().filter(|number| (1..=4).contains(number));
        changes.push(ObjectChange::Bytes(number.ok_or_else(wrong)?));
    }
    if let Some(text) = value {
        changes.push(read_value(text)?.map_or(ObjectChange::Absent, ObjectChange::Value));
    }
    if changes.is_empty() { Err(PlantError::Missing("value")) } else { Ok(changes) }
}

fn read_address(text: &str) -> Result<Address, PlantError> {
    let wrong = || PlantError::Number {
        key: "object",
        given: text.to_owned(),
        expected: "index and subindex in hexadecimal, for example 0x6091:01, or an index alone for subindex 0",
    };
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let index = index.strip_prefix("0x").and_then(|digits| u16::from_str_radix(digits, 16).ok());
    let sub = u8::from_str_radix(sub, 16).ok();
    Ok(Address::new(index.ok_or_else(wrong)?, sub.ok_or_else(wrong)?))
}

fn read_value(text: &str) -> Result<Option<i64>, PlantError> {
    if text == "absent" {
        return Ok(None);
    }
    let number = match text.strip_prefix("0x") {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    number.map(Some).ok_or_else(|| PlantError::Number {
        key: "value",
        given: text.to_owned(),
        expected: "a whole number, decimal or after 0x, or absent",
    })
}

impl Drive {
    /// Changes an object for good, before power-up.
    pub(super) fn plant(&mut self, object: PlantedObject) {
        // Whether it has the object was found out where it was read.
        let _has_it = self.dictionary.plant(object);
        self.parameters = counted_as_stated(&self.shipped_parameters, &self.dictionary);
    }
}

/// The parameters of a drive that counts as its objects say. Objects that state no scale leave it as it was.
fn counted_as_stated(shipped: &DriveParameters, dictionary: &Dictionary) -> DriveParameters {
    let ratio = |first: Address, second: Address| {
        let [a, b] = [first, second].map(|address| dictionary.get(address.index, address.sub));
        let there = dictionary.spec(first).is_ok() && a > 0 && b > 0;
        #[expect(clippy::cast_precision_loss, reason = "objects have at most 32 bits")]
        let ratio = a as f64 / b as f64;
        there.then_some(ratio)
    };
    let gear = ratio(object::GEAR_MOTOR_REVOLUTIONS, object::GEAR_SHAFT_REVOLUTIONS);
    let feed = ratio(object::FEED, object::FEED_SHAFT_REVOLUTIONS);
    // CiA 402: without a feed constant the unit is the encoder's increment.
    let stated = match feed {
        Some(feed) => Some(feed / gear.unwrap_or(1.0)),
        None => ratio(object::ENCODER_INCREMENTS, object::ENCODER_REVOLUTIONS),
    };
    let factor = ratio(object::FACTOR_INCREMENTS, object::FACTOR_UNITS);
    let turned_round = dictionary.get(object::POLARITY.index, 0) & 0x80 != 0;
    let counted = DriveParameters {
        counts_per_rev: stated.unwrap_or(shipped.counts_per_rev) / factor.unwrap_or(1.0),
        sign: if turned_round { -shipped.sign } else { shipped.sign },
        ..*shipped
    };
    // CiA 402: the zero lies at the home position plus the offset.
    let home_offset = dictionary.get(object::HOME_OFFSET.index, 0) - i64::from(shipped.home_offset_counts);
    #[expect(clippy::cast_precision_loss, reason = "a difference of two 32-bit numbers")]
    let shift_rad = home_offset as f64 / counted.counts_per_rad();
    DriveParameters { zero_offset_rad: shipped.zero_offset_rad + shift_rad, ..counted }
}

/// Two 32-bit numbers whose ratio is this; none when there are none.
pub(super) fn as_ratio(value: f64) -> Option<[i64; 2]> {
    [1_i64, 10, 100, 1000, 10_000, 100_000].into_iter().find_map(|below| {
        #[expect(clippy::cast_precision_loss, reason = "at most 1e5")]
        let above = value * below as f64;
        let fits =
            (1.0..=f64::from(u32::MAX)).contains(&above) && (above - above.round()).abs() <= 1e-9 * above;
        #[expect(clippy::cast_possible_truncation, reason = "within 32 bits")]
        let above = above.round() as i64;
        fits.then_some([above, below])
    })
}

impl DriveParameters {
    /// Counts a radian of the link, with the sign of the motor's direction.
    #[must_use]
    pub fn counts_per_rad(&self) -> f64 {
        self.sign * self.gear_ratio * self.counts_per_rev / TAU
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_exact_where_there_is_one() {
        assert_eq!(as_ratio(101.0), Some([101, 1]));
        assert_eq!(as_ratio(100.5), Some([1005, 10]));
        assert_eq!(as_ratio(131_072.0 * 101.0), Some([13_238_272, 1]));
        assert_eq!(as_ratio(1e12), None);
        assert_eq!(as_ratio(1.0 / 3.0), None);
    }

    #[test]
    fn addresses_and_values_are_read_or_refused_with_what_was_expected() {
        assert_eq!(read_address("0x6091:01"), Ok(Address::new(0x6091, 1)));
        assert_eq!(read_address("0x607E"), Ok(Address::new(0x607E, 0)));
        assert_eq!(read_value("-5"), Ok(Some(-5)));
        assert_eq!(read_value("0x80"), Ok(Some(128)));
        assert_eq!(read_value("absent"), Ok(None));
        for wrong in ["6091:01", "0x60911", "0x6091:100", ""] {
            assert!(read_address(wrong).unwrap_err().to_string().contains("0x6091:01"), "{wrong}");
        }
        assert!(read_value("fifty").is_err());
    }
}
