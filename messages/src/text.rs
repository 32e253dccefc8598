//! A short sentence in a message of fixed size.
use iceoryx2::prelude::ZeroCopySend;

/// Up to 240 bytes of UTF-8; longer text is cut at a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct Text {
    len: u32,
    reserved: u32,
    bytes: [u8; Self::CAPACITY],
}

impl Text {
    /// Most bytes.
    pub const CAPACITY: usize = 240;

    /// Copies as much of `text` as fits.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let end = text.floor_char_boundary(Self::CAPACITY);
        let mut bytes = [0; Self::CAPACITY];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self { len: u32::try_from(end).unwrap_or(0), reserved: 0, bytes }
    }

    /// The text; bytes that are not UTF-8 (the message may be hostile) are replaced, control characters too.
    #[must_use]
    pub fn read(&self) -> String {
        let len = usize::try_from(self.len).unwrap_or(0).min(Self::CAPACITY);
        let text = String::from_utf8_lossy(&self.bytes[..len]);
        text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
    }
}

impl Default for Text {
    fn default() -> Self {
        Self::new("")
    }
}
