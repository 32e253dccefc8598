//! The unit of velocities in a CiA 402 drive: by the profile position units a second, in many drives revolutions of the motor.
//!
//! Nothing in the drive states it reliably (0x60A9 is optional), so the owner does.
use crate::reader::Table;
use std::f64::consts::TAU;

/// In which unit a drive takes speeds and, a second, accelerations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VelocityUnit {
    /// Position units a second, as CiA 402 has it.
    CountsPerSecond,
    /// Motor revolutions a minute.
    Rpm,
    /// Tenths of motor revolutions a minute.
    TenthRpm,
}

impl VelocityUnit {
    /// Every unit.
    pub const ALL: [Self; 3] = [Self::CountsPerSecond, Self::Rpm, Self::TenthRpm];

    /// Its word in settings files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::CountsPerSecond => "counts/s",
            Self::Rpm => "rpm",
            Self::TenthRpm => "0.1rpm",
        }
    }
    /// A speed of the joint in this unit, for a drive with so many motor revolutions a joint revolution and counts a motor
    /// revolution. Of an acceleration in rad/s^2 it makes this unit a second.
    #[must_use]
    pub fn of_rad_s(self, velocity_rad_s: f64, gear_ratio: f64, counts_per_rev: f64) -> f64 {
        let motor_rev_s = velocity_rad_s * gear_ratio / TAU;
        match self {
            Self::CountsPerSecond => motor_rev_s * counts_per_rev,
            Self::Rpm => motor_rev_s * 60.0,
            Self::TenthRpm => motor_rev_s * 600.0,
        }
    }
    /// The speed of the joint for a value in this unit; the inverse of [`Self::of_rad_s`].
    #[must_use]
    pub fn to_rad_s(self, value: f64, gear_ratio: f64, counts_per_rev: f64) -> f64 {
        value / self.of_rad_s(1.0, gear_ratio, counts_per_rev)
    }
}

/// Reads `velocity_unit`; `None` only after a fault.
pub(crate) fn read(table: &mut Table<'_>) -> Option<VelocityUnit> {
    const KEY: &str = "velocity_unit";
    const EXPECTED: &str = "\"counts/s\", \"rpm\" or \"0.1rpm\" (of the motor): the unit in which the drive takes speeds, and a second, accelerations";
    table.choice(KEY, EXPECTED, (&VelocityUnit::ALL, VelocityUnit::word))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: one speed is the same in every unit. A joint revolution a second behind a gear of 100.
    #[test]
    fn speeds_are_stated_in_the_unit_of_the_drive() {
        for (unit, expected) in [
            (VelocityUnit::CountsPerSecond, 100.0 * 4096.0),
            (VelocityUnit::Rpm, 6_000.0),
            (VelocityUnit::TenthRpm, 60_000.0),
        ] {
            let got = unit.of_rad_s(TAU, 100.0, 4096.0);
            assert!((got - expected).abs() < 1e-6, "{}: {got}", unit.word());
            let back_rad_s = unit.to_rad_s(got, 100.0, 4096.0);
            assert!((back_rad_s - TAU).abs() < 1e-12, "{}: {back_rad_s} rad/s", unit.word());
        }
    }
}
