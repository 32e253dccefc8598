//! Bars of characters: how far, where, and how much of a limit.
use super::{Span, Tone};

/// Use of a limit from which on a value is worth a look.
const NEAR: f64 = 0.8;

/// The characters of a bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ink {
    full: char,
    empty: char,
    middle: char,
}

impl Ink {
    /// Blocks where the locale has them, else plain ASCII.
    pub(super) fn of_locale() -> Self {
        let set = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
        // The first one that is set decides, as setlocale has it.
        let locale = set("LC_ALL").or_else(|| set("LC_CTYPE")).or_else(|| set("LANG")).unwrap_or_default();
        let locale = locale.to_ascii_lowercase();
        if locale.contains("utf-8") || locale.contains("utf8") {
            Self { full: '\u{2588}', empty: '\u{b7}', middle: '\u{2502}' }
        } else {
            Self::ASCII
        }
    }

    /// What every terminal has.
    pub(super) const ASCII: Self = Self { full: '#', empty: '-', middle: '|' };
}

/// A share as a number of `cells`, from 0 to all of them; 0 for what is no number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to a few dozen cells")]
fn cells_of(share: f64, cells: usize) -> usize {
    let cells_f64 = f64::from(u16::try_from(cells).unwrap_or(u16::MAX));
    // `clamp` leaves NaN, and the cast makes 0 of it.
    ((share.clamp(0.0, 1.0) * cells_f64).floor() as usize).min(cells)
}

/// How far a motion has come.
pub(super) fn progress(done: f64, cells: usize, ink: Ink) -> String {
    let full = cells_of(done, cells);
    (0..cells).map(|cell| if cell < full { ink.full } else { ink.empty }).collect()
}

/// Where a value stands between two ends; near an end it is worth a look, beyond it is bad.
pub(super) fn position(value: f64, [low, high]: [f64; 2], cells: usize, ink: Ink) -> Span {
    let share = (value - low) / (high - low);
    if !share.is_finite() {
        return Span::new(std::iter::repeat_n(ink.empty, cells).collect::<String>(), Tone::Quiet);
    }
    let at = cells_of(share, cells).min(cells.saturating_sub(1));
    let text: String = (0..cells).map(|cell| if cell == at { ink.full } else { ink.empty }).collect();
    // Use of the half range that the value is in.
    Span::new(text, tone(2.0 * (share - 0.5)))
}

/// A signed value against a limit that holds for both signs, from the middle outwards.
pub(super) fn signed(value: f64, limit: f64, cells: usize, ink: Ink) -> Span {
    let used = value / limit;
    let side = cells.saturating_sub(1) / 2;
    let full = cells_of(used.abs(), side);
    let text: String = (0..=2 * side)
        .map(|cell| {
            if cell == side {
                return ink.middle;
            }
            let away = cell.abs_diff(side);
            let same_side = (cell > side) == (used > 0.0);
            if same_side && away <= full { ink.full } else { ink.empty }
        })
        .collect();
    Span::new(text, if used.is_finite() { tone(used) } else { Tone::Quiet })
}

/// The meaning of a use of a limit, 1 being all of it.
fn tone(used: f64) -> Tone {
    if used.abs() > 1.0 {
        Tone::Bad
    } else if used.abs() >= NEAR {
        Tone::Warning
    } else {
        Tone::Good
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ODD: [f64; 6] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 0.0];

    #[test]
    fn bar_is_as_long_for_any_number() {
        for value in ODD {
            for limit in ODD {
                assert_eq!(progress(value / limit, 20, Ink::ASCII).len(), 20);
                assert_eq!(position(value, [-limit, limit], 12, Ink::ASCII).text.len(), 12);
                assert_eq!(signed(value, limit, 11, Ink::ASCII).text.len(), 11);
            }
        }
    }

    #[test]
    fn bar_shows_the_share_its_sign_and_what_it_means() {
        assert_eq!(progress(0.5, 10, Ink::ASCII), "#####-----");
        assert_eq!(position(0.0, [-1.0, 1.0], 5, Ink::ASCII).text, "--#--");
        assert_eq!(position(1.0, [-1.0, 1.0], 5, Ink::ASCII).text, "----#");
        assert_eq!(position(-0.95, [-1.0, 1.0], 5, Ink::ASCII).tone, Tone::Warning);
        assert_eq!(position(1.01, [-1.0, 1.0], 5, Ink::ASCII).tone, Tone::Bad);
        assert_eq!(signed(0.5, 1.0, 9, Ink::ASCII), Span::new("----|##--", Tone::Good));
        assert_eq!(signed(-0.9, 1.0, 9, Ink::ASCII), Span::new("-###|----", Tone::Warning));
        assert_eq!(signed(2.0, 1.0, 9, Ink::ASCII), Span::new("----|####", Tone::Bad));
    }
}
