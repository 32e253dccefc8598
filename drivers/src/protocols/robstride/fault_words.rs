//! Words for the faults of a `RobStride` motor.
//!
//! Source: `RobStride`, "RS00 User Manual" of 2026-04-28, sections 4.1.2 (six bits of each feedback) and 4.1.8 (fault report).

/// Faults of a feedback, by bit.
const STATED: [&str; 6] = [
    "under-voltage; check the supply",
    "over-current; check for a blocked joint and a short circuit",
    "too hot; let it cool down",
    "its magnetic encoder failed",
    "stall or overload; check for a blocked joint",
    "its encoder is not calibrated; calibrate it in the maker's tool",
];

/// Faults of a report alone, by bit.
const fn reported_words(bit: u8) -> &'static str {
    match bit {
        0 => "too hot (145 degrees Celsius); let it cool down",
        1 => "its driver chip failed",
        2 => "under-voltage; check the supply",
        3 => "over-voltage; check the supply and what brakes into it",
        4 => "over-current of phase B; check for a short circuit",
        5 => "over-current of phase C; check for a short circuit",
        7 => "its encoder is not calibrated; calibrate it in the maker's tool",
        8 => "its hardware identification failed",
        9 => "its position could not be initialised; switch its power off and on",
        14 => "stall or overload; check for a blocked joint",
        16 => "over-current of phase A; check for a short circuit",
        _ => "a fault that its manual does not list",
    }
}

/// What an error says: the six bits of a feedback, or `reported` and the number of a report's bit.
pub(super) fn fault_words(error: u8, reported: u8) -> String {
    if error & reported != 0 {
        let bit = error & 0x1F;
        return format!("fault bit {bit}: {}", reported_words(bit));
    }
    let stated: Vec<&str> =
        STATED.iter().enumerate().filter(|(bit, _)| error >> bit & 1 != 0).map(|(_, words)| *words).collect();
    if stated.is_empty() {
        "no fault".to_owned()
    } else {
        format!("faults 0x{error:02X}: {}", stated.join("; "))
    }
}
