//! The seam between the cycle and a servo protocol.
//!
//! A driver serves the joints of one bus that speak one protocol. It is pure: frames in, frames out, time as an
//! argument. Bring-up (finding, configuring, energising) is a state machine inside the driver, advanced once a
//! cycle by `encode`; the streamer only sets the target and reads the status.
use crate::frame::{CanFrame, CanId, FrameBatch};
use taustream_motion::MAX_JOINTS;

/// `CLOCK_MONOTONIC` in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Nanos(pub u64);

impl Nanos {
    /// Seconds from `earlier` to this; 0 when `earlier` is later.
    #[must_use]
    pub fn since_s(self, earlier: Self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "2^53 ns are 104 days")]
        let ns = self.0.saturating_sub(earlier.0) as f64;
        ns * 1e-9
    }
}

/// The command of one joint, on the link side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointCommand {
    /// Target angle.
    pub position_rad: f64,
    /// Its derivative.
    pub velocity_rad_s: f64,
    /// Its second derivative.
    pub acceleration_rad_s2: f64,
    /// Torque on top of what the servo's own control gives, for protocols that carry it; cut off at the servo's range.
    pub torque_nm: f64,
}

/// What the streamer wants of all drives of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveTarget {
    /// Configured, communicating, not energised.
    Disabled,
    /// Energised, following the commands.
    Enabled,
    /// What holds continues to hold, what is off stays off: nothing is energised, de-energised or moved. Drives that were
    /// found holding ([`DriveState::Adopted`]) are taken into the cycle.
    Keep,
    /// De-energised at once, whatever the state: the emergency target.
    TorqueOff,
}

/// Where one drive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// No feedback yet.
    Absent,
    /// Being configured.
    Configuring,
    /// It was found energised before anything was sent to it, and not as this master would have left it; nothing was
    /// changed, and nothing will be. [`ServoStatus::error_code`] and [`ServoStatus::refused_object`] say what differs.
    EnergisedUnowned,
    /// Found energised exactly as this master leaves its drives; it holds [`ServoStatus::hold_position_rad`] until the target
    /// changes from `Keep`.
    Adopted,
    /// Configured, communicating, not energised.
    Disabled,
    /// On its way to energised.
    Enabling,
    /// Energised and following the commands.
    Enabled,
    /// Energised, and moved by its own homing, not by the commands; see [`ServoStatus::homing`].
    Homing,
    /// On its way to de-energised.
    Disabling,
    /// In its fault state (or reacting to a fault).
    Fault,
    /// It refused a configuration step; see [`ServoStatus::error_code`] and [`ServoStatus::refused_object`].
    Refused,
}

impl DriveState {
    /// Whether a drive in this state reports its position every cycle, without interruption since it was configured or
    /// adopted; before, the last position that was read stands still.
    #[must_use]
    pub fn reports(self) -> bool {
        match self {
            Self::Disabled
            | Self::Adopted
            | Self::Enabling
            | Self::Enabled
            | Self::Homing
            | Self::Disabling
            | Self::Fault => true,
            Self::Absent | Self::Configuring | Self::EnergisedUnowned | Self::Refused => false,
        }
    }
}

/// What is known of the homing of a drive in [`DriveState::Homing`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HomingState {
    /// It does not home itself.
    #[default]
    None,
    /// It still holds, and is on its way to its homing mode.
    Preparing,
    /// In its homing mode, in motion or coming to rest: it is where it is measured.
    Running,
    /// On its way back to the mode in which it follows commands; it holds [`ServoStatus::hold_position_rad`].
    Returning,
    /// Homed: its position counts from its home position. It holds, until the command is there and homing is not asked for.
    Attained,
    /// Ended because it was not asked for any more; it holds likewise.
    Aborted,
    /// Failed, and why, as [`ServoStatus::error_code`] and [`ServoStatus::refused_object`]; it holds likewise.
    Failed {
        /// The code.
        code: u32,
        /// The object; 0 when none is to blame.
        object: u32,
    },
}

/// PDOs 2 to 4 of a CANopen drive that this master does not use and that the drive does not let be switched off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixedPdos(u8);

impl FixedPdos {
    /// None.
    pub const NONE: Self = Self(0);

    /// Adds the one whose communication record has this index.
    pub(crate) fn note(&mut self, index: u16) {
        let first = if index >= 0x1800 { 4 } else { 0 };
        self.0 |= 1 << (first + (index & 0x3));
    }
    /// They as text: "RPDO 2, TPDO 2 and TPDO 3"; empty for none.
    #[must_use]
    pub fn words(self) -> String {
        let name = |at: u8| format!("{} {}", if at < 4 { "RPDO" } else { "TPDO" }, at % 4 + 1);
        let names: Vec<String> = (0..8).filter(|at| self.0 >> at & 1 != 0).map(name).collect();
        match names.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
            Some((only, _)) => only.clone(),
            None => String::new(),
        }
    }
}

/// What is known of one joint's drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoStatus {
    /// Where it is.
    pub state: DriveState,
    /// Measured link angle; NaN before the first feedback.
    pub position_rad: f64,
    /// Measured link velocity; NaN when the drive does not send it.
    pub velocity_rad_s: f64,
    /// Measured torque at the link; NaN when the drive does not send it.
    pub torque_nm: f64,
    /// Link angle that an adopted drive holds, or one that has been homing; NaN otherwise.
    pub hold_position_rad: f64,
    /// What is known of its homing.
    pub homing: HomingState,
    /// PDOs that are not needed and stay on (CANopen).
    pub fixed_pdos: FixedPdos,
    /// When the newest feedback arrived; `None` before the first.
    pub received: Option<Nanos>,
    /// The protocol's status word.
    pub status_word: u32,
    /// The protocol's error code (CiA 402: EMCY code, or SDO abort code when refused; see `bring_up`); 0 for none.
    pub error_code: u32,
    /// Object or register that was refused, in the protocol's numbers (CiA 402: `index << 8 | sub`); 0 for none.
    pub refused_object: u32,
    /// What the drive states of the refused object and what the settings say; 0 where there are no such numbers.
    pub refused_numbers: [f64; 2],
    /// The drive warns.
    pub warning: bool,
    /// The drive has stopped because it heard nothing of its master for too long.
    pub lost_master: bool,
    /// Code of its newest emergency message, "error reset" not counted; 0 before the first.
    pub emergency: u32,
    /// How many of them came; it wraps.
    pub emergencies: u32,
}

impl ServoStatus {
    /// What it refused, or states about itself against the settings.
    #[must_use]
    pub const fn refusal(&self) -> crate::bring_up::Refusal {
        crate::bring_up::Refusal {
            code: self.error_code,
            object: self.refused_object,
            numbers: self.refused_numbers,
        }
    }
    /// Before any feedback.
    pub const UNKNOWN: Self = Self {
        state: DriveState::Absent,
        position_rad: f64::NAN,
        velocity_rad_s: f64::NAN,
        torque_nm: f64::NAN,
        hold_position_rad: f64::NAN,
        homing: HomingState::None,
        fixed_pdos: FixedPdos::NONE,
        received: None,
        status_word: 0,
        error_code: 0,
        refused_object: 0,
        refused_numbers: [0.0; 2],
        warning: false,
        lost_master: false,
        emergency: 0,
        emergencies: 0,
    };
}

/// Why a servo's zero is not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ZeroRefused {
    /// The protocol, or this software's use of it, cannot.
    #[error("this servo's protocol sets no zero; state zero_offset_rad in the settings instead")]
    NotOffered,
    /// This driver does not serve the joint.
    #[error("the joint is not on this bus")]
    NoSuchJoint,
    /// The servo is energised, in fault or not configured.
    #[error("the servo is not configured and de-energised; disable the arm and clear its faults first")]
    NotReady,
}

/// A protocol's master side for the joints of one bus.
pub trait ServoDriver: Send {
    /// Writes this cycle's frames, in sending order (SYNC first). `commands` is indexed by joint of the arm; a frame that
    /// holds commands is pushed with their joints ([`FrameBatch::push_setpoints`]).
    ///
    /// Real time: no allocation, no I/O, bounded work.
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    );

    /// Takes one received frame; frames of others, and malformed ones, change nothing.
    ///
    /// Real time: no allocation, no I/O, bounded work.
    fn decode(&mut self, now: Nanos, frame: &CanFrame);

    /// The arm's joints that this driver serves.
    fn joints(&self) -> &[usize];

    /// What is known of a joint of [`Self::joints`]; [`ServoStatus::UNKNOWN`] for any other.
    fn status(&self, joint: usize) -> ServoStatus;

    /// Asks drives in fault to forget it (rising edge of fault reset), over the next cycles.
    ///
    /// Real time: no allocation.
    fn clear_faults(&mut self);

    /// Clears everything that is known of the drives, as at start: nothing is changed before they were looked at
    /// again. For a bus that comes back after it was lost: drives may have been restarted, replaced or moved.
    ///
    /// Real time: no allocation.
    fn start_over(&mut self);

    /// Makes the angle where a joint's servo stands its zero, for good, over the next cycle. Only for a servo that is
    /// configured and not energised.
    ///
    /// Real time: no allocation.
    ///
    /// # Errors
    /// What stands against it. A protocol that cannot do this refuses always.
    fn set_zero(&mut self, joint: usize) -> Result<(), ZeroRefused> {
        let _ = joint;
        Err(ZeroRefused::NotOffered)
    }

    /// Says, before each [`Self::encode`], which joint's servo is to home itself, of all that there are: only while it is
    /// said the homing goes on. Servos without homing ignore it.
    ///
    /// Real time: no allocation.
    fn set_homing(&mut self, joint: Option<usize>) {
        let _ = joint;
    }

    /// The newest frame by which another master commands these drives, when it came less than half a second ago.
    ///
    /// Real time: arithmetic only.
    fn other_master(&self) -> Option<CanId> {
        None
    }

    /// The sentence for an error code of this protocol: "0x8611 following error too large".
    fn explain(&self, error_code: u32) -> String;
}
