//! What a Damiao motor's registers must hold, in the order in which they are looked at and written.
//!
//! Nothing is kept in the motor's flash: what was written is gone with the power, and is looked at again before the motor
//! is energised.
use crate::codec::damiao_frames::{Register, Request, TIMEOUT_UNITS_A_MS, mode_number};
use crate::codec::mit::MitRanges;
use taustream_arm::{Damiao, DamiaoMode};

/// One look at, or write to, a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Job {
    /// Read it.
    Read(Register),
    /// Write it; its echo must say the same.
    Write(Register),
    /// Read it once the motor has had time to change.
    ReadSettled(Register),
}

/// What one motor is to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorPlan {
    /// Identifier of its commands.
    pub node_id: u8,
    /// Its settings.
    pub damiao: Damiao,
    /// Largest speed that `pos_vel` commands state.
    pub speed_rad_s: f64,
}

/// What an answer means for the list of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CheckResult {
    /// This many jobs further.
    On(usize),
    /// The register holds something else.
    Differs,
}

/// From the first look to a configured motor.
pub const CONFIGURE: [Job; 8] = [
    Job::Read(Register::PositionRange),
    Job::Read(Register::VelocityRange),
    Job::Read(Register::TorqueRange),
    Job::Read(Register::Mode),
    Job::Write(Register::Mode),
    Job::ReadSettled(Register::Mode),
    Job::Write(Register::Timeout),
    Job::Read(Register::Timeout),
];
/// The mode is written only where it differs.
const MODE_READ: usize = 3;
const MODE_WRITTEN: usize = 3;

/// Before every energising: a motor that restarted has forgotten.
pub const VERIFY: [Job; 5] = [
    Job::Read(Register::PositionRange),
    Job::Read(Register::VelocityRange),
    Job::Read(Register::TorqueRange),
    Job::Read(Register::Mode),
    Job::Read(Register::Timeout),
];

impl Job {
    /// Its register.
    #[must_use]
    pub const fn register(self) -> Register {
        match self {
            Self::Read(register) | Self::Write(register) | Self::ReadSettled(register) => register,
        }
    }
    /// True for a write.
    #[must_use]
    pub const fn writes(self) -> bool {
        matches!(self, Self::Write(_))
    }
}

impl MotorPlan {
    /// The ranges on the wire.
    #[must_use]
    pub const fn ranges(&self) -> MitRanges {
        let damiao = &self.damiao;
        MitRanges::symmetric(damiao.position_range_rad, damiao.velocity_range_rad_s, damiao.torque_range_nm)
    }

    /// Time in which gains rise; 0 where there are none.
    #[must_use]
    pub const fn ramp_ns(&self) -> u64 {
        match self.damiao.mode {
            DamiaoMode::Mit { gain_ramp_ms, .. } => gain_ramp_ms as u64 * 1_000_000,
            DamiaoMode::PosVel => 0,
        }
    }

    /// The request of a job.
    #[must_use]
    pub fn request(&self, job: Job) -> Request {
        let register = job.register();
        if job.writes() {
            Request::Write(register as u8, self.wanted(register))
        } else {
            Request::Read(register as u8)
        }
    }

    /// Whether an answer lets the list continue. `index` is of [`CONFIGURE`], or none in [`VERIFY`].
    #[must_use]
    pub fn check_value(&self, job: Job, index: Option<usize>, value: [u8; 4]) -> CheckResult {
        let register = job.register();
        let agrees = match register {
            Register::PositionRange | Register::VelocityRange | Register::TorqueRange => {
                same(f32::from_le_bytes(value), self.wanted_float(register))
            }
            Register::FeedbackId | Register::NodeId | Register::Timeout | Register::Mode => {
                value == self.wanted(register)
            }
        };
        match (index == Some(MODE_READ), agrees) {
            (true, true) => CheckResult::On(MODE_WRITTEN),
            (true, false) | (false, true) => CheckResult::On(1),
            (false, false) => CheckResult::Differs,
        }
    }

    /// As the register holds it.
    fn wanted(&self, register: Register) -> [u8; 4] {
        match register {
            Register::FeedbackId => u32::from(self.damiao.feedback_id).to_le_bytes(),
            Register::NodeId => u32::from(self.node_id).to_le_bytes(),
            Register::Timeout => self.damiao.watchdog_ms.saturating_mul(TIMEOUT_UNITS_A_MS).to_le_bytes(),
            Register::Mode => mode_number(&self.damiao.mode).to_le_bytes(),
            Register::PositionRange | Register::VelocityRange | Register::TorqueRange => {
                self.wanted_float(register).to_le_bytes()
            }
        }
    }

    fn wanted_float(&self, register: Register) -> f32 {
        let damiao = &self.damiao;
        let wanted = match register {
            Register::PositionRange => damiao.position_range_rad,
            Register::VelocityRange => damiao.velocity_range_rad_s,
            Register::TorqueRange => damiao.torque_range_nm,
            Register::FeedbackId | Register::NodeId | Register::Timeout | Register::Mode => f64::NAN,
        };
        #[expect(clippy::cast_possible_truncation, reason = "the register is this wide")]
        let wanted = wanted as f32;
        wanted
    }
}

/// The same number but for the last digits of a decimal fraction; never for what is no number.
fn same(held: f32, wanted: f32) -> bool {
    (held - wanted).abs() <= 1e-6 * wanted.abs()
}
