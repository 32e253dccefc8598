//! What keeps a jog going: keys of a terminal, or bytes on standard input.
use crate::failure::Failure;
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use std::io::{self, IsTerminal, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

/// Bytes that are read ahead: they are taken every few milliseconds.
const BYTES_AHEAD: usize = 256;

/// What was pressed or read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Key {
    /// Move on in this direction, 1 or -1.
    Held(f64),
    /// Move no further.
    Stop,
    /// The end.
    Leave,
}

/// Where keys come from. The terminal is set back when it goes.
pub(super) enum Keys {
    Terminal,
    Bytes(Receiver<u8>),
}

impl Keys {
    /// Keys of the terminal if standard input is one, else its bytes.
    pub(super) fn open() -> Result<Self, Failure> {
        if io::stdin().is_terminal() {
            enable_raw_mode()
                .map_err(|e| Failure::Failed(format!("the terminal gives no single keys: {e}")))?;
            return Ok(Self::Terminal);
        }
        let (sender, receiver) = sync_channel(BYTES_AHEAD);
        thread::spawn(move || {
            for byte in io::stdin().lock().bytes() {
                let Ok(byte) = byte else { return };
                if sender.send(byte).is_err() {
                    return;
                }
            }
        });
        Ok(Self::Bytes(receiver))
    }

    /// The next key within a time.
    pub(super) fn next(&self, within: Duration) -> Option<Key> {
        match self {
            Self::Terminal => match event::poll(within) {
                Ok(false) => None,
                Ok(true) => match event::read() {
                    Ok(Event::Key(key)) if key.kind != KeyEventKind::Release => {
                        Some(of_key(key.code, key.modifiers))
                    }
                    Ok(_) => None,
                    Err(_) => Some(Key::Leave),
                },
                Err(_) => Some(Key::Leave),
            },
            Self::Bytes(bytes) => match bytes.recv_timeout(within) {
                Ok(byte) => of_byte(byte),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => Some(Key::Leave),
            },
        }
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        if matches!(self, Self::Terminal) {
            // There is no one to tell: the program ends.
            let _ = disable_raw_mode();
        }
    }
}

fn of_key(code: KeyCode, modifiers: KeyModifiers) -> Key {
    if modifiers.contains(KeyModifiers::CONTROL) {
        return if matches!(code, KeyCode::Char('c' | 'C' | 'd' | 'D')) { Key::Leave } else { Key::Stop };
    }
    if matches!(code, KeyCode::Right | KeyCode::Up | KeyCode::Char('+')) {
        Key::Held(1.0)
    } else if matches!(code, KeyCode::Left | KeyCode::Down | KeyCode::Char('-')) {
        Key::Held(-1.0)
    } else if matches!(code, KeyCode::Esc | KeyCode::Char('q' | 'Q')) {
        Key::Leave
    } else {
        Key::Stop
    }
}

/// White space says nothing: whoever writes lines writes it too.
fn of_byte(byte: u8) -> Option<Key> {
    match byte {
        b'+' => Some(Key::Held(1.0)),
        b'-' => Some(Key::Held(-1.0)),
        b'q' | b'Q' => Some(Key::Leave),
        byte if byte.is_ascii_whitespace() => None,
        _ => Some(Key::Stop),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_keys_that_say_so_move_the_arm() {
        for byte in 0..=u8::MAX {
            let moves = matches!(of_byte(byte), Some(Key::Held(_)));
            assert_eq!(moves, byte == b'+' || byte == b'-', "{byte}");
        }
        assert_eq!(of_key(KeyCode::Right, KeyModifiers::NONE), Key::Held(1.0));
        assert_eq!(of_key(KeyCode::Char('-'), KeyModifiers::NONE), Key::Held(-1.0));
        assert_eq!(of_key(KeyCode::Char('+'), KeyModifiers::CONTROL), Key::Stop);
        assert_eq!(of_key(KeyCode::Char('c'), KeyModifiers::CONTROL), Key::Leave);
        assert_eq!(of_key(KeyCode::Enter, KeyModifiers::NONE), Key::Stop);
    }
}
