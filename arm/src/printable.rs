//! Text as a terminal may get it: names and messages come from files and other processes, and a control character in them
//! could move the cursor, change the title or hide what stands before it.
use std::borrow::Cow;
use std::fmt::Write as _;

/// A character that a terminal executes instead of showing it, or that turns the direction of the text around.
fn is_obeyed(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text with every control character but line ends and tabs written out: `\u{1b}`.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| matches!(c, '\n' | '\t'), |out, c| write!(out, "{}", c.escape_unicode()))
}

/// The same for a JSON text, whose meaning stays: what the encoder leaves as it is stands inside of strings.
#[must_use]
pub fn printable_json(text: &str) -> Cow<'_, str> {
    escaped(text, |c| matches!(c, '\n' | '\t' | '\r'), |out, c| write!(out, "\\u{:04x}", u32::from(c)))
}

fn escaped(
    text: &str,
    keeps: impl Fn(char) -> bool,
    escape: impl Fn(&mut String, char) -> std::fmt::Result,
) -> Cow<'_, str> {
    if !text.chars().any(|c| is_obeyed(c) && !keeps(c)) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_obeyed(c) && !keeps(c) {
            let _always_room = escape(&mut out, c);
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_control_character_is_written_out_and_nothing_else_changes() {
        assert_eq!(printable("ärm\n\t_1"), "ärm\n\t_1");
        assert_eq!(printable("a\u{1b}[2Jb\r"), "a\\u{1b}[2Jb\\u{d}");
        for code in (0..=0x1f).chain(0x7f..=0x9f).chain([0x200f, 0x202e, 0x2067]) {
            let c = char::from_u32(code).unwrap();
            let text = printable(&format!("x{c}y")).into_owned();
            assert!(matches!(c, '\n' | '\t') || !text.contains(c), "{text:?}");
        }
    }

    #[test]
    fn json_keeps_its_meaning() {
        let value = serde_json::json!({ "name": "a\u{1b}\u{9b}\u{7f}\u{202e}b\nc" });
        let text = serde_json::to_string(&value).unwrap();
        let shown = printable_json(&text);
        assert!(shown.chars().all(|c| !is_obeyed(c)), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
    }
}
