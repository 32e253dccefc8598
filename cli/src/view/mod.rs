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
    /// A piece with a meaning.
    pub(crate) fn new(text: impl Into<String>, tone: Tone) -> Self {
        Self { text: text.into(), tone }
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

    /// The line within so many columns.
    pub(crate) fn cut(self, columns: usize) -> Self {
        let mut left = columns;
        let mut kept = Vec::new();
        for span in self.0 {
            let text: String = span.text.chars().take(left).collect();
            left -= text.chars().count();
            kept.push(Span { text, tone: span.tone });
        }
        Self(kept)
    }
}
