//! Digital inputs of a CiA 402 drive (0x60FD): the switches that the profile names. A bit is 1 while its input is active, whatever
//! its level; inputs of the maker's own (bits 16 to 31) are not looked at.
//!
//! Directions are those of the drive: a joint with `sign = -1` has the drive's negative switch at its upper end.
//!
//! Source: CiA 402-2, "Digital inputs"; so in the manuals of Novanta (Denali, Everest) and Kinco (FD5).

/// Negative limit switch.
pub const NEGATIVE_LIMIT: u8 = 1;
/// Positive limit switch.
pub const POSITIVE_LIMIT: u8 = 1 << 1;
/// Home switch.
pub const HOME: u8 = 1 << 2;
/// Interlock.
pub const INTERLOCK: u8 = 1 << 3;
/// All of them.
pub const KNOWN: u8 = NEGATIVE_LIMIT | POSITIVE_LIMIT | HOME | INTERLOCK;

/// Those that are active in a value of the object.
#[must_use]
pub const fn active(value: u32) -> u8 {
    let [low, ..] = value.to_le_bytes();
    low & KNOWN
}

/// The active ones as text: ", negative limit switch active"; empty for none.
#[must_use]
pub fn words(inputs: u8) -> String {
    [
        (NEGATIVE_LIMIT, "negative limit switch"),
        (POSITIVE_LIMIT, "positive limit switch"),
        (HOME, "home switch"),
        (INTERLOCK, "interlock"),
    ]
    .into_iter()
    .filter(|(bit, _)| inputs & bit != 0)
    .map(|(_, name)| format!(", {name} active"))
    .collect()
}
