//! Reading the log of `candump -L`, strictly: what cannot be read for certain is an error, never skipped.
//!
//! One frame a line: `(1700000000.123456) vcan0 123#1122` (classic), `#R` or `#R4` (remote request), `##1` and data (FD with
//! its flags). Three hexadecimal digits are an 11-bit id, eight a 29-bit one; in the latter, bit 29 marks an error
//! frame. Source: can-utils, lib.h, "CAN frame ASCII representation".
use std::str::FromStr;
use taustream_drivers::{CanFrame, CanId};

/// COB-ID of SYNC (CiA 301).
const SYNC: CanId = CanId::standard(0x080);
/// Marks a 29-bit id in [`CanId`], as in linux/can.h.
const EXTENDED: u32 = 0x8000_0000;
/// Marks a remote request in [`CanId`].
const REMOTE: u32 = 0x4000_0000;
/// Marks an error frame, in the log's eight digits as in [`CanId`].
const ERROR: u32 = 0x2000_0000;

/// One recorded frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Kernel time stamp, wall clock, microseconds since 1970.
    pub time_us: u64,
    /// Interface that it was seen on.
    pub interface: String,
    /// The frame. FD frames are compared by id, kind and data: the log's flags beyond "FD" are not kept.
    pub frame: CanFrame,
}

impl Record {
    /// True for a SYNC.
    #[must_use]
    pub fn is_sync(&self) -> bool {
        self.frame.id() == SYNC && !self.frame.is_fd()
    }
}

/// A log that is not what `candump -L` writes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("candump log, line {line}: {why}: {text:?}")]
pub struct BadLine {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong.
    pub why: &'static str,
    /// The line, at most its first 120 characters.
    pub text: String,
}

/// Reads a whole log. A last line without its newline is an error: the recorder was cut off while writing it.
///
/// # Errors
/// The first line that is not a frame.
pub fn parse(log: &str) -> Result<Vec<Record>, BadLine> {
    let bad = |line: usize, text: &str, why| BadLine { line, why, text: text.chars().take(120).collect() };
    let mut records = Vec::new();
    for (index, line) in log.split_inclusive('\n').enumerate() {
        let text = line.strip_suffix('\n').ok_or_else(|| bad(index + 1, line, "cut off in the middle"))?;
        records.push(text.parse().map_err(|why| bad(index + 1, text, why))?);
    }
    Ok(records)
}

/// How many SYNCs a recording holds for one interface.
#[must_use]
pub fn count_syncs(records: &[Record], interface: &str) -> usize {
    records.iter().filter(|record| record.interface == interface && record.is_sync()).count()
}

impl FromStr for Record {
    type Err = &'static str;

    fn from_str(line: &str) -> Result<Self, &'static str> {
        let mut words = line.split(' ');
        let (Some(time), Some(interface), Some(frame), None) =
            (words.next(), words.next(), words.next(), words.next())
        else {
            return Err("expected three words: (time) interface frame");
        };
        if interface.is_empty() {
            return Err("no interface");
        }
        Ok(Self { time_us: parse_time(time)?, interface: interface.to_owned(), frame: parse_frame(frame)? })
    }
}

/// `(1700000000.123456)`.
fn parse_time(text: &str) -> Result<u64, &'static str> {
    const WHY: &str = "expected a time like (1700000000.123456)";
    let inner = text.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')).ok_or(WHY)?;
    let (seconds, micros) = inner.split_once('.').ok_or(WHY)?;
    let is_number = |digits: &str| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    if !is_number(seconds) || !is_number(micros) || micros.len() != 6 {
        return Err(WHY);
    }
    let seconds: u64 = seconds.parse().map_err(|_| WHY)?;
    let micros: u64 = micros.parse().map_err(|_| WHY)?;
    seconds.checked_mul(1_000_000).and_then(|whole| whole.checked_add(micros)).ok_or(WHY)
}

/// `123#1122`, `123#R`, `123##1aabb`.
fn parse_frame(text: &str) -> Result<CanFrame, &'static str> {
    let (id, rest) = text.split_once('#').ok_or("expected a frame like 123#1122")?;
    let id = parse_id(id)?;
    if let Some(fd) = rest.strip_prefix('#') {
        let (flags, data) = fd.split_at_checked(1).ok_or("an FD frame without its flags")?;
        if !is_hex(flags) {
            return Err("the flags of an FD frame are one hexadecimal digit");
        }
        let data = parse_data(data)?;
        if !matches!(data.len(), 0..=8 | 12 | 16 | 20 | 24 | 32 | 48 | 64) {
            return Err("no FD frame has that length");
        }
        return Ok(CanFrame::fd(CanId::from_raw(id), &data));
    }
    if let Some(length) = rest.strip_prefix('R') {
        // A remote request carries a length but no data.
        return match length.as_bytes() {
            [] | [b'0'..=b'8'] => Ok(CanFrame::classic(CanId::from_raw(id | REMOTE), &[])),
            _ => Err("the length of a remote request is one digit, at most 8"),
        };
    }
    let data = parse_data(rest)?;
    if data.len() > 8 {
        return Err("a classic frame has at most 8 bytes");
    }
    Ok(CanFrame::classic(CanId::from_raw(id), &data))
}

/// Three digits: 11 bits. Eight: 29 bits, or an error frame.
fn parse_id(text: &str) -> Result<u32, &'static str> {
    const WHY: &str = "an id is three or eight hexadecimal digits";
    if !is_hex(text) {
        return Err(WHY);
    }
    let id = u32::from_str_radix(text, 16).map_err(|_| WHY)?;
    match text.len() {
        3 if id <= 0x7FF => Ok(id),
        3 => Err("an 11-bit id is at most 7FF"),
        8 if id & ERROR != 0 && id < 2 * ERROR => Ok(id),
        8 if id < ERROR => Ok(id | EXTENDED),
        8 => Err("a 29-bit id is at most 1FFFFFFF"),
        _ => Err(WHY),
    }
}

/// Pairs of digits.
fn parse_data(text: &str) -> Result<Vec<u8>, &'static str> {
    const WHY: &str = "data is pairs of hexadecimal digits";
    if !is_hex(text) || !text.len().is_multiple_of(2) {
        return Err(WHY);
    }
    let pair = |at: usize| text.get(at..at + 2).and_then(|pair| u8::from_str_radix(pair, 16).ok()).ok_or(WHY);
    (0..text.len()).step_by(2).map(pair).collect()
}

/// Digits alone: `from_str_radix` would take a sign, too.
fn is_hex(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candump_log_of_every_kind_of_frame_is_read() {
        let log = "(1700000000.000001) vcan0 080#\n(1700000000.000250) vcan0 201#0F00E8030000\n\
                   (0.999999) can1 1234ABCD#01\n(1.000000) vcan0 20000040#0000000000000000\n\
                   (1.000000) vcan0 705#R\n(1.000000) vcan0 123##3AABBCCDD\n";
        let records = parse(log).unwrap();
        let frames: Vec<CanFrame> = records.iter().map(|record| record.frame).collect();
        let expected = [
            CanFrame::classic(SYNC, &[]),
            CanFrame::classic(CanId::standard(0x201), &[0x0F, 0x00, 0xE8, 0x03, 0x00, 0x00]),
            CanFrame::classic(CanId::from_raw(0x9234_ABCD), &[1]),
            CanFrame::classic(CanId::from_raw(0x2000_0040), &[0; 8]),
            CanFrame::classic(CanId::from_raw(0x4000_0705), &[]),
            CanFrame::fd(CanId::standard(0x123), &[0xAA, 0xBB, 0xCC, 0xDD]),
        ];
        assert_eq!(frames, expected);
        assert_eq!(records[1].time_us, 1_700_000_000_000_250);
        assert_eq!(records[2].interface, "can1");
        assert_eq!((count_syncs(&records, "vcan0"), count_syncs(&records, "can1")), (1, 0));
        assert_eq!(parse(""), Ok(Vec::new()));
    }

    #[test]
    fn candump_line_that_is_malformed_is_an_error_with_its_number() {
        let good = "(1700000000.000001) vcan0 080#\n";
        let bad = [
            "",
            "(1700000000.000001) vcan0",
            "(1700000000.000001) vcan0 080# T",
            "(1700000000.000001)  vcan0 080#",
            "1700000000.000001 vcan0 080#",
            "(1700000000.0001) vcan0 080#",
            "(-1.000001) vcan0 080#",
            "(99999999999999999999.000001) vcan0 080#",
            "(18446744073709551615.000001) vcan0 080#",
            "(1700000000.000001) vcan0 080",
            "(1700000000.000001) vcan0 80#",
            "(1700000000.000001) vcan0 800#",
            "(1700000000.000001) vcan0 +80#",
            "(1700000000.000001) vcan0 40000000#",
            "(1700000000.000001) vcan0 201#0F0",
            "(1700000000.000001) vcan0 201#0G",
            "(1700000000.000001) vcan0 201#é",
            "(1700000000.000001) vcan0 201#000000000000000000",
            "(1700000000.000001) vcan0 201#R9",
            "(1700000000.000001) vcan0 201##",
            "(1700000000.000001) vcan0 201##x00",
            "(1700000000.000001) vcan0 201##1000000000000000000",
            "(1700000000.000001) vcan0 080#\r",
        ];
        for line in bad {
            let Err(error) = parse(&format!("{good}{line}\n{good}")) else { panic!("{line:?} was read") };
            assert_eq!((error.line, error.text.as_str()), (2, line));
        }
        let Err(error) = parse("(1700000000.000001) vcan0 080#\n(1700000000.0") else {
            panic!("cut off, but read")
        };
        assert_eq!((error.line, error.why), (2, "cut off in the middle"));
    }

    proptest::proptest! {
        /// Goal: no log, however broken, panics; one flipped character never passes for the same frame.
        #[test]
        fn candump_log_of_any_kind_is_read_or_refused(
            garbage in "(\\PC|[()#.R 0-9a-f\n]){0,80}",
            at in 0_usize..43,
            with in proptest::char::range(' ', '~'),
        ) {
            let _ = parse(&garbage);
            let line = "(1700000000.000250) vcan0 201#0F00E8030000\n";
            let mut corrupted = line.to_owned();
            corrupted.replace_range(at..=at, &with.to_string());
            let same = |log: &str| parse(log) == parse(line);
            let is_equal = corrupted.eq_ignore_ascii_case(line);
            proptest::prop_assert!(!same(&corrupted) || is_equal, "{corrupted:?} was read as {line:?}");
        }
    }
}
