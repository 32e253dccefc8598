//! Numbers for people: as many decimals as it takes to tell them apart.
//!
//! A refusal that reads "3.1416 is outside [-3.1416, 3.1416]" tells nothing. Every message that puts a value beside its
//! limit goes through here.
use crate::JointKind;
use core::fmt;

/// Decimals beyond which a number is written in full.
const DECIMALS_MAX: usize = 12;

/// How many decimals a group of numbers is written with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decimals(Option<usize>);

impl Decimals {
    /// At least `least`, and enough that numbers of the group which differ read differently.
    #[must_use]
    pub fn apart(group: &[f64], least: usize) -> Self {
        let mut gap = f64::INFINITY;
        for (index, a) in group.iter().enumerate() {
            for b in group.iter().skip(index + 1) {
                let by = (a - b).abs();
                // Not-a-number and 0 are no gap.
                gap = if by > 0.0 { gap.min(by) } else { gap };
            }
        }
        let mut unit = 1.0;
        for decimals in 0..=DECIMALS_MAX {
            // Two numbers that are a unit of the last place apart never round to the same.
            if decimals >= least && gap >= unit {
                return Self(Some(decimals));
            }
            unit /= 10.0;
        }
        Self(None)
    }

    /// One number of the group.
    #[must_use]
    pub fn show(self, value: f64) -> Shown {
        Shown { value, decimals: self.0 }
    }
}

/// A number with a chosen count of decimals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    value: f64,
    decimals: Option<usize>,
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.decimals {
            Some(decimals) => write!(f, "{:.decimals$}", self.value),
            None => write!(f, "{}", self.value),
        }
    }
}

/// An amount: four decimals, or two significant digits where these would read as nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amount(pub f64);

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size > 0.0 && size < 1e-3 { write!(f, "{:.1e}", self.0) } else { write!(f, "{:.4}", self.0) }
    }
}

/// A position that lies outside a range, with the range: "3.2500 rad is 0.1084 rad outside [-3.1416, 3.1416]".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutsideRange {
    /// Of the joint: rad, or m.
    pub kind: JointKind,
    /// The angle.
    pub position_rad: f64,
    /// Lowest and highest angle.
    pub range_rad: [f64; 2],
}

impl fmt::Display for OutsideRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, position_rad, range_rad: [low_rad, high_rad] } = *self;
        let unit = kind.unit();
        let decimals = Decimals::apart(&[position_rad, low_rad, high_rad], 4);
        let by_rad = (low_rad - position_rad).max(position_rad - high_rad);
        let (position, low, high) =
            (decimals.show(position_rad), decimals.show(low_rad), decimals.show(high_rad));
        write!(f, "{position} {unit} is {} {unit} outside [{low}, {high}]", Amount(by_rad))
    }
}

#[cfg(test)]
#[expect(clippy::approx_constant, reason = "3.1416 is the limit of a shipped arm")]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn decimals_grow_until_numbers_that_differ_read_differently() {
        let table: [(&[f64], &[&str]); 5] = [
            (&[3.2, -3.1416, 3.1416], &["3.2000", "-3.1416", "3.1416"]),
            (&[2.618, 2.617_993_877_991_494], &["2.618000", "2.617994"]),
            (&[3.141_600_000_000_000_4, 3.1416], &["3.1416000000000004", "3.1416"]),
            (&[1.0, 1.0], &["1.0000", "1.0000"]),
            (&[f64::NAN, 1.5], &["NaN", "1.5000"]),
        ];
        for (group, words) in table {
            let decimals = Decimals::apart(group, 4);
            for (value, word) in group.iter().zip(words) {
                assert_eq!(format!("{}", decimals.show(*value)), *word);
            }
        }
    }

    #[test]
    fn numbers_that_differ_never_read_alike() {
        for exponent in -16..3 {
            for step in 1..200 {
                let a = f64::from(step) * 0.037;
                let b = a + libm::pow(10.0, f64::from(exponent)) * (1.0 + f64::from(step % 7));
                let decimals = Decimals::apart(&[a, b], 4);
                let (a_word, b_word) = (format!("{}", decimals.show(a)), format!("{}", decimals.show(b)));
                assert!(a.to_bits() == b.to_bits() || a_word != b_word, "{a} and {b} read {a_word}");
            }
        }
    }

    #[test]
    fn angle_outside_its_range_shows_that_it_is() {
        let outside = |position_rad| {
            let kind = JointKind::Revolute;
            format!("{}", OutsideRange { kind, position_rad, range_rad: [-3.1416, 3.1416] })
        };
        assert_eq!(outside(3.25), "3.2500 rad is 0.1084 rad outside [-3.1416, 3.1416]");
        assert_eq!(outside(-3.141_606), "-3.141606 rad is 6.0e-6 rad outside [-3.141600, 3.141600]");
        assert_eq!(
            outside(3.141_600_000_000_000_4),
            "3.1416000000000004 rad is 4.4e-16 rad outside [-3.1416, 3.1416]"
        );
    }

    #[test]
    fn amounts_never_read_as_nothing() {
        assert_eq!(format!("{} {} {}", Amount(0.1084), Amount(6.12e-6), Amount(0.0)), "0.1084 6.1e-6 0.0000");
    }
}
