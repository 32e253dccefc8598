//! A brake that the master of a CiA 402 drive must release, as the table `[servo.brake]` of its servo states it.
//!
//! Most drives work their brake by themselves; without the table nothing is released. Whether a set bit releases the brake or closes
//! it differs between makers, so it has no default.
//!
//! Source: CiA 402-2, "Digital outputs": 0x60FE:01, bit 0 "set brake", and its mask 0x60FE:02.
use crate::reader::Table;

/// The brake of one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeSettings {
    /// Bit of 0x60FE:01 that works it.
    pub output_bit: u8,
    /// Value of that bit that releases it.
    pub released_by: bool,
    /// Time from the command to release until it is released.
    pub release_ms: u16,
    /// Time from the command to close until it holds.
    pub close_ms: u16,
}

const BITS: [i64; 2] = [0, 31];
const TIMES_MS: [i64; 2] = [0, 2_000];

impl BrakeSettings {
    /// The bit that works it.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        1 << (self.output_bit & 31)
    }
    /// What 0x60FE:01 holds where the brake is released, or closed.
    #[must_use]
    pub const fn output(&self, released: bool) -> u32 {
        if released == self.released_by { self.mask() } else { 0 }
    }
    /// Keys and values of the table.
    #[must_use]
    pub fn entries(&self) -> serde_json::Value {
        serde_json::json!({
            "output_bit": self.output_bit,
            "released_by": u8::from(self.released_by),
            "release_ms": self.release_ms,
            "close_ms": self.close_ms,
        })
    }
    /// What `check` says of it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let Self { output_bit, released_by, release_ms, close_ms } = *self;
        format!(
            "brake released by bit {output_bit} = {} of 0x60FE:01 ({release_ms} ms, closed in {close_ms} ms); it STAYS RELEASED when the \
             streamer is lost",
            u8::from(released_by)
        )
    }
}

/// Reads the table; the outer `None` only after a fault.
pub(crate) fn read(table: &mut Table<'_>) -> Option<Option<BrakeSettings>> {
    const KEY: &str = "brake";
    let Some(mut brake) = table.table_if_there(KEY) else { return (!table.had(KEY)).then_some(None) };
    let output_bit = brake.integer_or("output_bit", 0, BITS[0], BITS[1]);
    let released_by = brake.integer("released_by", 0, 1);
    let release_ms = brake.integer("release_ms", TIMES_MS[0], TIMES_MS[1]);
    let close_ms = brake.integer("close_ms", TIMES_MS[0], TIMES_MS[1]);
    brake.done();
    let time_ms = |ms: Option<i64>| ms.and_then(|ms| u16::try_from(ms).ok());
    Some(Some(BrakeSettings {
        output_bit: u8::try_from(output_bit?).ok()?,
        released_by: released_by? == 1,
        release_ms: time_ms(release_ms)?,
        close_ms: time_ms(close_ms)?,
    }))
}
