//! Torques of a CiA 402 drive between newton metres at the joint and thousandths of its motor's rated torque.
//!
//! A motor behind a gear gives the joint its torque times the ratio; what the gear loses is not in it.
use taustream_arm::{Cia402, Servo, TorqueSettings};

/// The unit of one drive's torques.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveTorque {
    /// What its settings say.
    pub settings: TorqueSettings,
    per_mille_per_nm: f64,
}

impl DriveTorque {
    /// Of a servo; none where its settings state no torques.
    #[must_use]
    pub fn of(servo: &Servo) -> Option<Self> {
        let cia402 = servo.protocol.get::<Cia402>()?;
        let settings = cia402.torque?;
        let per_mille_per_nm = settings.per_mille_per_nm(servo.sign, cia402.gear_ratio);
        Some(Self { settings, per_mille_per_nm })
    }

    /// A torque at the joint as 0x60B2 has it; none for what is no number. It ends at the ends of 16 bits.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn per_mille(&self, torque_nm: f64) -> i16 {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the cast saturates, and makes 0 of what is no number"
        )]
        let per_mille = (torque_nm * self.per_mille_per_nm).round() as i16;
        per_mille
    }

    /// What 0x6077 says, at the joint.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn nm(&self, per_mille: i16) -> f64 {
        f64::from(per_mille) / self.per_mille_per_nm
    }
}
