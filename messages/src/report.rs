//! The streamer's state, published off the real-time thread at a settable rate.
use crate::{
    AxisReport, BUSES_MAX, BusReport, Cause, FaultReason, LAYOUT_VERSION, Pause, PauseReason, Phase,
    RobotDigest,
};
use iceoryx2::prelude::ZeroCopySend;
use taustream_motion::MAX_JOINTS;
use taustream_motion::axis::AXES_MAX;

/// A report on the wire. Read [`Report::checked`] before any field.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct Report {
    /// See [`LAYOUT_VERSION`].
    pub layout_version: u32,
    /// How many joints the arm has.
    pub joint_count: u32,
    /// Number of this report; gaps are reports that this reader missed.
    pub sequence: u64,
    /// Cycle number.
    pub tick: u64,
    /// CLOCK_MONOTONIC of the cycle.
    pub time_ns: u64,
    /// The robot that the streamer drives.
    pub robot_digest: RobotDigest,
    /// [`Phase::code`].
    pub phase: u32,
    /// [`FaultReason::code`], 0 for none.
    pub fault_reason: u32,
    /// Zero-based joint of the fault, an axis behind the joints; `u32::MAX` for none.
    pub fault_joint: u32,
    /// Index of the bus of the fault; `u32::MAX` for none.
    pub fault_bus: u32,
    /// Code of the [`Cause`]: what it is depends on the reason.
    pub fault_code: u32,
    /// [`Cause::object`].
    pub fault_object: u32,
    /// How many buses the arm has.
    pub bus_count: u32,
    /// 1 when at least one drive is energised.
    pub energised: u32,
    /// The number that belongs to the fault reason.
    pub fault_value: f64,
    /// The limit that it broke.
    pub fault_limit: f64,
    /// [`PauseReason::code`], 0 for an arm that is not paused.
    pub pause_reason: u32,
    /// How long no setpoint left before a pause by a stall, s.
    pub pause_gap_s: f64,
    /// Newest generation accepted; a sender uses this plus 1.
    pub generation: u64,
    /// The trajectory that runs or ran last; 0 for none.
    pub trajectory_id: u64,
    /// Its trajectory time.
    pub trajectory_s: f64,
    /// Its duration at full speed.
    pub trajectory_duration_s: f64,
    /// The accepted trajectory that waits for its cut; 0 for none.
    pub successor_id: u64,
    /// Trajectory time from which that one is run.
    pub successor_from_s: f64,
    /// Trajectory time at which everything accepted has ended: the successor, or the one that runs.
    pub end_s: f64,
    /// The pose in which it ends; the commanded pose when none runs.
    pub end_rad: [f64; MAX_JOINTS],
    /// The time scale now.
    pub sigma: f64,
    /// The speed override in percent.
    pub speed_percent: f64,
    /// Commanded position, rad.
    pub command_rad: [f64; MAX_JOINTS],
    /// Commanded velocity, rad/s.
    pub command_velocity_rad_s: [f64; MAX_JOINTS],
    /// Commanded acceleration, rad/s^2.
    pub command_acceleration_rad_s2: [f64; MAX_JOINTS],
    /// Commanded jerk, rad/s^3.
    pub command_jerk_rad_s3: [f64; MAX_JOINTS],
    /// Measured position, rad.
    pub measured_rad: [f64; MAX_JOINTS],
    /// Measured velocity, rad/s; NaN where the drive does not send it.
    pub measured_velocity_rad_s: [f64; MAX_JOINTS],
    /// Measured torque at the joint, Nm; NaN where the drive does not send it.
    pub measured_torque_nm: [f64; MAX_JOINTS],
    /// Age of the newest feedback a joint, s; infinite before the first.
    pub feedback_age_s: [f64; MAX_JOINTS],
    /// Tracking error a joint, rad.
    pub tracking_error_rad: [f64; MAX_JOINTS],
    /// Largest tracking error since the last enable, rad.
    pub tracking_error_rad_max: [f64; MAX_JOINTS],
    /// [`ReferenceState::code`](crate::ReferenceState::code) of every joint: whether its multi-turn offset is known, and its source.
    pub reference_state: [u32; MAX_JOINTS],
    /// What was added to every joint's reading to get the measured position, rad.
    pub multi_turn_offset_rad: [f64; MAX_JOINTS],
    /// 1 while the speed override is that of the start, and no other was set.
    pub first_speed: u32,
    /// 1 while drives are kept as they were found holding at start; `enable` takes them over.
    pub adopted: u32,
    /// Drive status words (CiA 402 statusword, or the protocol's own).
    pub drive_status: [u32; MAX_JOINTS],
    /// Drive error codes, 0 for none.
    pub drive_error: [u32; MAX_JOINTS],
    /// How many axes beside the path the arm has.
    pub axis_count: u32,
    /// Zero.
    pub reserved: u32,
    /// The axes, in the order of the settings. What their servos say stands behind the joints, as that of joints does.
    pub axes: [AxisReport; AXES_MAX],
    /// The buses, in the order of the settings.
    pub buses: [BusReport; BUSES_MAX],
    /// Cycles since start.
    pub cycles: u64,
    /// Cycles that woke up more than half a period late.
    pub cycles_late: u64,
    /// Deadlines that were skipped.
    pub cycles_skipped: u64,
    /// Stalls that froze the trajectory.
    pub stalls: u64,
    /// Frames handed to the buses.
    pub frames_sent: u64,
    /// Frames that the buses refused.
    pub frames_lost: u64,
    /// Frames received.
    pub frames_received: u64,
    /// Guard trips.
    pub guard_trips: u64,
    /// Trajectories accepted.
    pub accepted: u64,
    /// Trajectories rejected.
    pub rejected: u64,
    /// Wake-up lateness over the last report window: median, ns.
    pub lateness_ns_p50: u64,
    /// 99th percentile, ns, since start.
    pub lateness_ns_p99: u64,
    /// 99.9th percentile, ns, since start.
    pub lateness_ns_p999: u64,
    /// Largest, ns, since start.
    pub lateness_ns_max: u64,
    /// Time in the cycle, 99th percentile, ns, since start.
    pub cycle_ns_p99: u64,
    /// Largest time in the cycle, ns, since start.
    pub cycle_ns_max: u64,
}

impl Report {
    /// The report when its layout, phase and joint count make sense.
    #[must_use]
    pub fn checked(&self) -> Option<(&Self, Phase)> {
        let joints = usize::try_from(self.joint_count).ok()?;
        let sane = self.layout_version == LAYOUT_VERSION && (1..=MAX_JOINTS).contains(&joints);
        Phase::from_code(self.phase).filter(|_| sane).map(|phase| (self, phase))
    }

    /// How many joints, never more than [`MAX_JOINTS`].
    #[must_use]
    pub fn joints(&self) -> usize {
        usize::try_from(self.joint_count).unwrap_or(MAX_JOINTS).min(MAX_JOINTS)
    }

    /// The axes that the arm has, in the order of the settings.
    #[must_use]
    pub fn axes(&self) -> &[AxisReport] {
        let most = AXES_MAX.min(MAX_JOINTS - self.joints());
        let count = usize::try_from(self.axis_count).unwrap_or(most).min(most);
        self.axes.get(..count).unwrap_or(&self.axes)
    }

    /// How many servos: joints, then axes; never more than [`MAX_JOINTS`].
    #[must_use]
    pub fn slots(&self) -> usize {
        self.joints() + self.axes().len()
    }

    /// The buses that the arm has, in the order of the settings.
    #[must_use]
    pub fn buses(&self) -> &[BusReport] {
        let count = usize::try_from(self.bus_count).unwrap_or(BUSES_MAX).min(BUSES_MAX);
        self.buses.get(..count).unwrap_or(&self.buses)
    }

    /// Writes why the arm stopped; `None` for no fault.
    pub fn set_cause(&mut self, cause: Option<Cause>) {
        let index = |part: Option<usize>| part.and_then(|i| u32::try_from(i).ok()).unwrap_or(u32::MAX);
        self.fault_reason = cause.map_or(0, |c| c.reason.code());
        self.fault_joint = index(cause.and_then(|c| c.joint));
        self.fault_bus = index(cause.and_then(|c| c.bus));
        (self.fault_code, self.fault_object) = cause.map_or((0, 0), |c| (c.code, c.object));
        (self.fault_value, self.fault_limit) = cause.map_or((0.0, 0.0), |c| (c.value, c.limit));
    }

    /// Why the arm stopped, with its evidence; joints and buses that the arm does not have are left out.
    #[must_use]
    pub fn cause(&self) -> Option<Cause> {
        let index = |raw: u32, count: usize| usize::try_from(raw).ok().filter(|i| *i < count);
        Some(Cause {
            reason: self.fault()?,
            joint: index(self.fault_joint, self.slots()),
            bus: index(self.fault_bus, self.buses().len()),
            code: self.fault_code,
            object: self.fault_object,
            value: self.fault_value,
            limit: self.fault_limit,
        })
    }

    /// Writes why the arm is paused; `None` for an arm that is not.
    pub fn set_pause(&mut self, pause: Option<Pause>) {
        self.pause_reason = pause.map_or(0, |pause| pause.reason.code());
        self.pause_gap_s = pause.map_or(0.0, |pause| pause.gap_s);
    }

    /// Why the arm is paused, or about to be.
    #[must_use]
    pub fn pause(&self) -> Option<Pause> {
        PauseReason::from_code(self.pause_reason).map(|reason| Pause { reason, gap_s: self.pause_gap_s })
    }

    /// The fault, if there is one.
    #[must_use]
    pub fn fault(&self) -> Option<FaultReason> {
        FaultReason::from_code(self.fault_reason)
    }
}
