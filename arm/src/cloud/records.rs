//! What PLY and PCD files have in common: lines of a header, and records of one length behind them.
use super::no_fields;
use crate::mesh::Refusal;

/// The header of a PLY or PCD file, line by line, and where the points begin.
pub(super) fn header(bytes: &[u8], is_last: fn(&str) -> bool) -> Option<(Vec<&str>, &[u8])> {
    /// No header is longer.
    const LINES_MAX: usize = 1_000;
    let mut lines = Vec::new();
    let mut rest = bytes;
    for _ in 0..LINES_MAX {
        let end = rest.iter().position(|b| *b == b'\n')?;
        let line = std::str::from_utf8(&rest[..end]).ok()?.trim_end();
        rest = &rest[end + 1..];
        lines.push(line);
        if is_last(line) {
            return Some((lines, rest));
        }
    }
    None
}

/// How a number stands in a binary file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Column {
    /// From the record's begin.
    pub(super) offset: usize,
    /// 4 or 8 bytes of a floating-point number.
    pub(super) bytes: usize,
}

/// The points of binary records of one length.
pub(super) fn records(
    bytes: &[u8],
    (count, length): (usize, usize),
    fields: [Column; 3],
    is_big_endian: bool,
) -> Result<Vec<[f64; 3]>, Refusal> {
    let needed = count.checked_mul(length).filter(|needed| *needed <= bytes.len());
    let Some(needed) = needed else {
        let value = format!("ends after {} bytes of points", bytes.len());
        return Err((value, format!("{count} points of {length} bytes")));
    };
    let number = |record: &[u8], field: Column| -> Option<f64> {
        let raw = record.get(field.offset..field.offset + field.bytes)?;
        let mut single: [u8; 8] = [0; 8];
        single.get_mut(..field.bytes)?.copy_from_slice(raw);
        if is_big_endian {
            single.get_mut(..field.bytes)?.reverse();
        }
        Some(match field.bytes {
            4 => f64::from(f32::from_le_bytes(*single.first_chunk()?)),
            _ => f64::from_le_bytes(single),
        })
    };
    let mut points = Vec::with_capacity(count);
    for record in bytes[..needed].chunks_exact(length.max(1)) {
        let mut point = [0.0; 3];
        for (x, field) in point.iter_mut().zip(fields) {
            *x = number(record, field).ok_or_else(|| no_fields(""))?;
        }
        points.push(point);
    }
    Ok(points)
}
