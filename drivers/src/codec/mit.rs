//! The packing of the "MIT" commands and answers, which Damiao, `CubeMars`, `MyActuator`, `RobStride` and Piper share.
//!
//! Each quantity is an unsigned number that spans its range; the ranges are the motor's and come as data. Encoding
//! rounds to the nearest code, so a decoded value lies at most half a step from what was encoded. The vendors' own code
//! truncates, which is a mean error of half a step in one direction: 0.19 mrad of angle in 25 rad. Zero is no code of a
//! symmetric range: it decodes to half a step above.
//!
//! Source: Mini Cheetah motor driver (B. Katz, MIT, 2018), as the vendors' manuals print it.

/// A range of a quantity on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    low: f64,
    high: f64,
    /// Largest code.
    top: u16,
}

impl Span {
    /// From `low` to `high` in `bits` bits, 1 to 16.
    #[must_use]
    pub const fn new(low: f64, high: f64, bits: u32) -> Self {
        let unused = 16_u32.saturating_sub(bits);
        Self { low, high, top: u16::MAX >> unused }
    }
    /// From minus to plus `reach`.
    #[must_use]
    pub const fn symmetric(reach: f64, bits: u32) -> Self {
        Self::new(-reach, reach, bits)
    }
    /// The code of a value, which is first brought into the range; `None` for what is no number.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(&self, value: f64) -> Option<u16> {
        let Self { low, high, top } = *self;
        if value.is_nan() {
            return None;
        }
        let code = ((value.clamp(low, high) - low) * f64::from(top) / (high - low)).round();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole, 0 to top")]
        let code = code as u16;
        Some(code.min(top))
    }
    /// The value of a code.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn decode(&self, code: u16) -> f64 {
        f64::from(code) * (self.high - self.low) / f64::from(self.top) + self.low
    }
    /// Distance between two neighbouring codes.
    #[must_use]
    pub fn step(&self) -> f64 {
        (self.high - self.low) / f64::from(self.top)
    }
}

/// The ranges of one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MitRanges {
    /// Angle, rad, 16 bits.
    pub position: Span,
    /// Angular velocity, rad/s, 12 bits.
    pub velocity: Span,
    /// Stiffness, Nm/rad, 12 bits.
    pub stiffness: Span,
    /// Damping, Nm s/rad, 12 bits.
    pub damping: Span,
    /// Torque, Nm, 12 bits.
    pub torque: Span,
}

/// Stiffness that 12 bits span, Nm/rad.
pub const STIFFNESS_MAX: f64 = 500.0;
/// Damping that 12 bits span, Nm s/rad.
pub const DAMPING_MAX: f64 = 5.0;

impl MitRanges {
    /// The widths and gains that all vendors share, with a motor's reach of angle, velocity and torque.
    #[must_use]
    pub const fn symmetric(position_rad: f64, velocity_rad_s: f64, torque_nm: f64) -> Self {
        Self {
            position: Span::symmetric(position_rad, 16),
            velocity: Span::symmetric(velocity_rad_s, 12),
            stiffness: Span::new(0.0, STIFFNESS_MAX, 12),
            damping: Span::new(0.0, DAMPING_MAX, 12),
            torque: Span::symmetric(torque_nm, 12),
        }
    }
}

/// One command: `torque = stiffness (position - q) + damping (velocity - w) + torque`. Motor side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MitCommand {
    /// Wanted angle.
    pub position_rad: f64,
    /// Wanted velocity.
    pub velocity_rad_s: f64,
    /// Gain on the angle.
    pub stiffness_nm_rad: f64,
    /// Gain on the velocity.
    pub damping_nm_s_rad: f64,
    /// Torque on top.
    pub torque_nm: f64,
}

impl MitCommand {
    /// The eight bytes; `None` when one of the five is no number.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(&self, ranges: &MitRanges) -> Option<[u8; 8]> {
        let [p_high, p_low] = ranges.position.encode(self.position_rad)?.to_be_bytes();
        let velocity = ranges.velocity.encode(self.velocity_rad_s)?;
        let stiffness = ranges.stiffness.encode(self.stiffness_nm_rad)?;
        let damping = ranges.damping.encode(self.damping_nm_s_rad)?;
        let torque = ranges.torque.encode(self.torque_nm)?;
        let [v, v_kp, kp] = pack_twice_12(velocity, stiffness);
        let [kd, kd_t, t] = pack_twice_12(damping, torque);
        Some([p_high, p_low, v, v_kp, kp, kd, kd_t, t])
    }
    /// From eight bytes: any eight are a command.
    #[must_use]
    pub fn decode(bytes: [u8; 8], ranges: &MitRanges) -> Self {
        let [p_high, p_low, v, v_kp, kp, kd, kd_t, t] = bytes;
        let (velocity, stiffness) = unpack_twice_12([v, v_kp, kp]);
        let (damping, torque) = unpack_twice_12([kd, kd_t, t]);
        Self {
            position_rad: ranges.position.decode(u16::from_be_bytes([p_high, p_low])),
            velocity_rad_s: ranges.velocity.decode(velocity),
            stiffness_nm_rad: ranges.stiffness.decode(stiffness),
            damping_nm_s_rad: ranges.damping.decode(damping),
            torque_nm: ranges.torque.decode(torque),
        }
    }
}

/// What a motor measures. Motor side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MitState {
    /// Angle.
    pub position_rad: f64,
    /// Velocity.
    pub velocity_rad_s: f64,
    /// Torque.
    pub torque_nm: f64,
}

impl MitState {
    /// The five bytes in the middle of an answer; what is no number is sent as the middle of its range.
    #[must_use]
    pub fn encode(&self, ranges: &MitRanges) -> [u8; 5] {
        let code = |span: &Span, value: f64| span.encode(value).unwrap_or(span.top / 2);
        let [p_high, p_low] = code(&ranges.position, self.position_rad).to_be_bytes();
        let velocity = code(&ranges.velocity, self.velocity_rad_s);
        let torque = code(&ranges.torque, self.torque_nm);
        let [v, v_t, t] = pack_twice_12(velocity, torque);
        [p_high, p_low, v, v_t, t]
    }
    /// From those five bytes.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn decode(bytes: [u8; 5], ranges: &MitRanges) -> Self {
        let [p_high, p_low, v, v_t, t] = bytes;
        let (velocity, torque) = unpack_twice_12([v, v_t, t]);
        Self {
            position_rad: ranges.position.decode(u16::from_be_bytes([p_high, p_low])),
            velocity_rad_s: ranges.velocity.decode(velocity),
            torque_nm: ranges.torque.decode(torque),
        }
    }
}

/// A packed command that does not read as a special one. Seven 0xFF and one of the bytes that mean something do, which is
/// everything at its highest; one step less of the angle does not.
#[must_use]
pub const fn unlike_special(bytes: [u8; 8]) -> [u8; 8] {
    match bytes {
        [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] => [0xFF, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last],
        other => other,
    }
}

/// Two numbers of 12 bits in three bytes, the first one's high bits first.
fn pack_twice_12(first: u16, second: u16) -> [u8; 3] {
    let both = u32::from(first & 0xFFF) << 12 | u32::from(second & 0xFFF);
    let [_, a, b, c] = both.to_be_bytes();
    [a, b, c]
}

fn unpack_twice_12([a, b, c]: [u8; 3]) -> (u16, u16) {
    let both = u32::from_be_bytes([0, a, b, c]);
    ((both >> 12 & 0xFFF) as u16, (both & 0xFFF) as u16)
}
