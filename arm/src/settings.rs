//! The settings of one arm's controller: robot, buses, servos, cycle, supervision.
use crate::{Faults, Robot, Scene};
use std::path::{Path, PathBuf};

/// What carries frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusKind {
    /// vcan: no bit rate. Refused on any other interface.
    Virtual,
    /// Classic CAN with a bit rate.
    Classic {
        /// Nominal bit rate.
        bitrate_bit_s: u32,
    },
}

/// One bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Its name in this file.
    pub name: String,
    /// Network interface ("vcan0"); the local link uses the same word as its name.
    pub interface: String,
    /// What carries frames.
    pub kind: BusKind,
}

/// Which protocol a servo speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// CANopen CiA 402, cyclic synchronous position.
    Cia402,
}

/// One servo: the binding of a joint to a node on a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    /// Index into [`Robot::joints`].
    pub joint: usize,
    /// Index into [`Settings::buses`].
    pub bus: usize,
    /// Node id, 1 to 127.
    pub node_id: u8,
    /// Its protocol.
    pub protocol: Protocol,
    /// +1.0 or -1.0: motor direction against link direction.
    pub sign: f64,
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Encoder counts a motor revolution.
    pub counts_per_rev: f64,
    /// Link angle at encoder count 0.
    pub zero_offset_rad: f64,
    /// Link angles that the feedback can tell apart.
    pub feedback_range_rad: [f64; 2],
    /// True when the joint may lose torque without harm (a brake, or no load).
    pub limp_is_safe: bool,
}

/// The cycle and what it tolerates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Period of the cycle.
    pub period_us: u32,
    /// Gap that the drives bridge by themselves, in periods.
    pub tolerated_gap_periods: u32,
    /// Longest stall after which the motion resumes by itself.
    pub stall_resume_ms: u32,
    /// Gap after which the drives' own watchdog has tripped.
    pub drive_watchdog_ms: u32,
    /// SCHED_FIFO priority.
    pub priority: u8,
    /// CPU that the real-time thread is bound to; none: not bound.
    pub cpu: Option<usize>,
    /// Reports a second.
    pub report_rate_hz: f64,
}

/// When the arm is stopped by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supervision {
    /// Oldest feedback while energised.
    pub feedback_age_s_max: f64,
    /// Largest tracking error.
    pub tracking_error_rad_max: f64,
    /// Largest step of a measured position between two samples.
    pub position_jump_rad_max: f64,
    /// Lost cycles in a row that make a bus fault.
    pub lost_cycles_max: u32,
    /// How long drives may take for each step of bring-up and enabling.
    pub drive_timeout_s: f64,
    /// Distance from a trajectory's base at which it is still taken.
    pub base_tolerance_rad: f64,
    /// Speed override at start, in percent.
    pub first_speed_percent: f64,
}

/// Checked settings of one arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Name of the arm; stands in the names of its services.
    pub name: String,
    /// The file that it was read from.
    pub file: PathBuf,
    /// The robot.
    pub robot: Robot,
    /// The scene that the planner serves.
    pub scene: Scene,
    /// The buses.
    pub buses: Vec<Bus>,
    /// One servo a joint, in the order of the joints.
    pub servos: Vec<Servo>,
    /// The cycle.
    pub cycle: Cycle,
    /// Supervision.
    pub supervision: Supervision,
}

impl Settings {
    /// Reads and checks a settings file and the robot and scene files that it names.
    ///
    /// # Errors
    /// Every fault at once, those of the robot and scene files included.
    pub fn load(_file: &Path) -> Result<Self, Faults> {
        todo!("arm")
    }
}
