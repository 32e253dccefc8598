//! Faults inside a simulated servo or its mechanics, whatever it speaks.

/// A fault inside a servo or its mechanics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    /// The servo detects a fault. CiA 402: with this EMCY code. Damiao: with this status, where it is 8 to 0xE, and
    /// over-current for any other code.
    Fault(u16),
    /// The joint is jammed, or free again.
    Jammed(bool),
    /// The joint cannot pass this link angle, or is free again.
    Object(Option<f64>),
    /// The encoder reads this much too far.
    EncoderShift(f64),
    /// CiA 402: the warning bit of the statusword. Damiao has none: the temperatures that it states rise.
    Warning(bool),
    /// Every write is refused; 0 ends it. CiA 402: with this SDO abort code. Damiao: the echo holds the old value.
    RefuseWrites(u32),
    /// CiA 402: these digital inputs (0x60FD) are active, whatever the joint's place; 0 ends it.
    Inputs(u8),
    /// The servo restarts, as after a dip of its supply: torque is gone meanwhile.
    Restart,
}
