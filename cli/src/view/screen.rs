//! Lines on a terminal, drawn over themselves. Colour only where it is wanted: `NO_COLOR` turns it off.
use super::{Line, Tone};
use crossterm::cursor::{Hide, MoveTo, MoveUp, Show};
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::style::{Color, Print, ResetColor, SetForegroundColor};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen,
    LeaveAlternateScreen, disable_raw_mode, enable_raw_mode, size,
};
use crossterm::{execute, queue};
use std::io::{self, IsTerminal, Write};
use std::time::Duration;

/// Where the terminal does not tell its size.
const USUAL_SIZE: (u16, u16) = (80, 24);

/// True when stdout is a terminal that can be drawn on.
pub(crate) fn is_terminal() -> bool {
    io::stdout().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Which part of the terminal is drawn on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Area {
    /// The lines below the last output, which stay when the program ends.
    Below,
    /// All of it, and as it was when the program ends.
    Whole,
}

/// A place to draw on. What was changed at the terminal is set back when it goes.
pub(crate) struct Screen {
    area: Area,
    coloured: bool,
    keys: bool,
    drawn: u16,
}

impl Screen {
    /// Draws below the last output.
    pub(crate) fn below() -> Self {
        Self { area: Area::Below, coloured: wants_colour(), keys: false, drawn: 0 }
    }

    /// Takes the whole terminal, and its keys where stdin is the terminal too.
    pub(crate) fn whole() -> io::Result<Self> {
        execute!(io::stdout(), EnterAlternateScreen, Hide)?;
        let mut screen = Self { area: Area::Whole, coloured: wants_colour(), keys: false, drawn: 0 };
        if io::stdin().is_terminal() {
            enable_raw_mode()?;
            screen.keys = true;
        }
        Ok(screen)
    }

    /// Columns and rows, asked every time: terminals are resized.
    pub(crate) fn size(&self) -> (usize, usize) {
        let (columns, rows) = size().unwrap_or(USUAL_SIZE);
        let or = |value: u16, usual: u16| usize::from(if value == 0 { usual } else { value });
        (or(columns, USUAL_SIZE.0), or(rows, USUAL_SIZE.1))
    }

    /// Draws the lines over those of the last time.
    pub(crate) fn draw(&mut self, lines: &[Line]) -> io::Result<()> {
        let (columns, rows) = self.size();
        let mut out = io::stdout().lock();
        queue!(out, BeginSynchronizedUpdate)?;
        match self.area {
            Area::Whole => queue!(out, MoveTo(0, 0))?,
            Area::Below if self.drawn > 0 => queue!(out, MoveUp(self.drawn))?,
            Area::Below => {}
        }
        // A line too many would scroll the terminal, and the next picture would not meet this one.
        let room = rows.saturating_sub(1).max(1);
        let shown = lines.iter().take(room);
        self.drawn = u16::try_from(shown.len()).unwrap_or(u16::MAX);
        for line in shown {
            queue!(out, Clear(ClearType::CurrentLine))?;
            for span in line.clone().cut(columns).0 {
                match colour(span.tone).filter(|_| self.coloured) {
                    Some(colour) => queue!(out, SetForegroundColor(colour), Print(span.text), ResetColor)?,
                    None => queue!(out, Print(span.text))?,
                }
            }
            // In raw mode a new line alone does not go back to the first column.
            queue!(out, Print("\r\n"))?;
        }
        queue!(out, Clear(ClearType::FromCursorDown), EndSynchronizedUpdate)?;
        out.flush()
    }

    /// Waits for up to `pause`; true when the user wants to leave (q, Esc, Ctrl-C).
    pub(crate) fn is_left_within(&self, pause: Duration) -> io::Result<bool> {
        if !self.keys {
            std::thread::sleep(pause);
            return Ok(false);
        }
        if !event::poll(pause)? {
            return Ok(false);
        }
        let Event::Key(key) = event::read()? else { return Ok(false) };
        let with_control = key.modifiers.contains(KeyModifiers::CONTROL);
        let leaves = matches!(key.code, KeyCode::Char('q' | 'Q') | KeyCode::Esc)
            || (with_control && matches!(key.code, KeyCode::Char('c' | 'C' | 'd' | 'D')));
        Ok(leaves && key.kind != KeyEventKind::Release)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A terminal that has gone cannot be set back, and need not be.
        if self.keys {
            let _gone = disable_raw_mode();
        }
        if self.area == Area::Whole {
            let _gone = execute!(io::stdout(), Show, LeaveAlternateScreen);
        }
    }
}

/// See <https://no-color.org>: set and not empty.
fn wants_colour() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

fn colour(tone: Tone) -> Option<Color> {
    match tone {
        Tone::Plain => None,
        Tone::Quiet => Some(Color::DarkGrey),
        Tone::Good => Some(Color::Green),
        Tone::Warning => Some(Color::Yellow),
        Tone::Bad => Some(Color::Red),
    }
}
