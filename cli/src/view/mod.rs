//! The live view of an arm: what `watch` and `demo` show while it moves.
//!
//! [`picture`] turns a report into lines whose parts say what they mean; [`screen`] puts lines on a terminal, in colour
//! or not. Everything that is not a terminal gets [`line()`].
mod bar;
mod joints;
mod picture;
mod screen;

pub(crate) use picture::{Picture, Scale, line};
pub(crate) use screen::{Screen, is_terminal};

use taustream_arm::printable::printable;

/// What a piece of text means; the screen makes a colour of it, or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tone {
    /// As any text.
    Plain,
    /// Headings and what rarely matters.
    Quiet,
    /// As it should be.
    Good,
    /// Worth a look.
    Warning,
    /// Stopped, lost or beyond a limit.
    Bad,
}

/// A piece of a line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Span {
    pub(crate) text: String,
    pub(crate) tone: Tone,
}

impl Span {
    /// A piece with a meaning. Names come from files, so nothing in them reaches the terminal that it would execute.
    pub(crate) fn new(text: impl Into<String>, tone: Tone) -> Self {
        let text = text.into();
        Self { text: printable(&text).into_owned(), tone }
    }
    /// A piece as any text.
    pub(crate) fn plain(text: impl Into<String>) -> Self {
        Self::new(text, Tone::Plain)
    }
}

/// One line of the view.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Line(pub(crate) Vec<Span>);

impl Line {
    /// A line of one piece.
    pub(crate) fn of(text: impl Into<String>, tone: Tone) -> Self {
        Self(vec![Span::new(text, tone)])
    }

    /// The line within so many columns; what does not fit is left out by whole words, and dots say so.
    pub(crate) fn cut(self, columns: usize) -> Self {
        let length: usize = self.0.iter().map(|span| span.text.chars().count()).sum();
        if length <= columns {
            return self;
        }
        let whole: Vec<char> = self.0.iter().flat_map(|span| span.text.chars()).collect();
        let room = columns.saturating_sub(DOTS.len());
        // The last word that ends within the room; a single long word is cut where it must be.
        let end =
            (1..=room).rev().find(|at| whole.get(*at).is_some_and(|c| c.is_whitespace())).unwrap_or(room);
        let mut left = end;
        let mut kept = Vec::new();
        for span in self.0 {
            let text: String = span.text.chars().take(left).collect();
            left -= text.chars().count();
            kept.push(Span { text, tone: span.tone });
        }
        kept.push(Span::new(DOTS.chars().take(columns).collect::<String>(), Tone::Quiet));
        Self(kept)
    }

    /// The line as several lines of so many columns, broken between words.
    pub(crate) fn wrapped(self, columns: usize) -> Vec<Self> {
        let mut lines = Vec::new();
        let mut line = Self::default();
        let mut used = 0;
        for span in self.0 {
            for word in span.text.split_inclusive(' ') {
                let length = word.chars().count();
                if used > 0 && used + word.trim_end().chars().count() > columns {
                    lines.push(std::mem::take(&mut line));
                    used = 0;
                }
                used += length;
                line.0.push(Span::new(word, span.tone));
            }
        }
        lines.push(line);
        lines
    }
}

/// What stands where text was left out.
const DOTS: &str = " ..";

#[cfg(test)]
mod tests {
    use super::*;

    fn text(line: &Line) -> String {
        line.0.iter().map(|span| span.text.as_str()).collect()
    }

    #[test]
    fn line_too_long_ends_with_a_whole_word_and_dots() {
        let line = || Line(vec![Span::plain("joint 3 elbow "), Span::new("is outside", Tone::Bad)]);
        assert_eq!(text(&line().cut(24)), "joint 3 elbow is outside");
        assert_eq!(text(&line().cut(23)), "joint 3 elbow is ..");
        assert_eq!(text(&line().cut(16)), "joint 3 elbow ..");
        assert_eq!(text(&line().cut(2)), " .");
        assert_eq!(text(&Line::of("averylongword", Tone::Plain).cut(8)), "avery ..");
    }

    #[test]
    fn wrapped_line_keeps_every_word() {
        let line =
            Line(vec![Span::plain("FAULT: joint 3 elbow "), Span::new("is outside its range", Tone::Bad)]);
        let lines = line.wrapped(16);
        assert_eq!(lines.iter().map(text).collect::<String>(), "FAULT: joint 3 elbow is outside its range");
        assert!(lines.iter().all(|line| text(line).trim_end().chars().count() <= 16), "{lines:?}");
        assert!(lines.len() >= 3);
    }
}
