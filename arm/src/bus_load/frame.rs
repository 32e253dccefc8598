//! How long a CAN frame is, with the most stuff bits that it can have and the pause behind it.
//!
//! Sources: ISO 11898-1 (frame formats, stuffing); Davis, Burns, Bril and Lukkien, "Controller Area Network (CAN)
//! schedulability analysis: refuted, revisited and revised", Real-Time Systems 35, 2007, equation 1 (classic frames).

/// What frames a servo and its master exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Classic CAN.
    Classic,
    /// CAN FD with bit rate switch.
    Fd,
}

/// A kind of frame: what its length depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Classic or FD.
    pub format: Format,
    /// 29-bit identifier.
    pub extended: bool,
    /// Bytes of data; FD rounds up to what it can state.
    pub bytes: u32,
}

/// Bits of a frame in each of its phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bits {
    /// At the nominal rate.
    pub nominal: u32,
    /// At the rate of the data phase; 0 in a classic frame.
    pub data: u32,
}

/// The rates of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRates {
    /// Nominal, bit/s.
    pub nominal_bit_s: u32,
    /// Data phase, bit/s; the nominal one on classic CAN.
    pub data_bit_s: u32,
}

impl Frame {
    /// A frame with an 11-bit identifier.
    #[must_use]
    pub const fn standard(format: Format, bytes: u32) -> Self {
        Self { format, extended: false, bytes }
    }

    /// Most bits that the frame can have, and its pause.
    #[must_use]
    pub fn most_bits(self) -> Bits {
        match self.format {
            Format::Classic => {
                // Exposed to stuffing: start, identifier, control, data and checksum.
                let data = 8 * self.bytes.min(8);
                let (fixed, exposed) = if self.extended { (67, 54) } else { (47, 34) };
                Bits { nominal: fixed + data + (exposed + data - 1) / 4, data: 0 }
            }
            Format::Fd => {
                // Start, identifier and control up to the switch of the bit rate; then error state, length, data.
                let arbitration = if self.extended { 36 } else { 17 };
                let bytes = fd_bytes(self.bytes);
                let exposed = 5 + 8 * bytes;
                // Acknowledgement, end of frame and pause are back at the nominal rate, and are not stuffed.
                let nominal = arbitration + (arbitration - 1) / 4 + 12;
                // The checksum grows above 16 bytes; its stuff bits stand at fixed places.
                let (checksum, fixed_stuff) = if bytes <= 16 { (17, 6) } else { (21, 7) };
                let stuff = (exposed + (arbitration - 1) % 4) / 4;
                Bits { nominal, data: exposed + stuff + 4 + checksum + fixed_stuff + 1 }
            }
        }
    }
}

impl Bits {
    /// Time on the bus, s.
    #[must_use]
    pub fn seconds(self, rates: BitRates) -> f64 {
        let time_s = |bits: u32, bit_s: u32| f64::from(bits) / f64::from(bit_s.max(1));
        time_s(self.nominal, rates.nominal_bit_s) + time_s(self.data, rates.data_bit_s)
    }
}

/// Data bytes of the FD frame that holds `bytes`.
#[must_use]
pub const fn fd_bytes(bytes: u32) -> u32 {
    match bytes {
        0..=8 => bytes,
        9..=12 => 12,
        13..=16 => 16,
        17..=20 => 20,
        21..=24 => 24,
        25..=32 => 32,
        33..=48 => 48,
        _ => 64,
    }
}
