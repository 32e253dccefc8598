//! `taustream status`: one report of the streamer, as text or as JSON.
use super::axis::AxisStatus;
use super::client::Client;
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::offline::verify::Unmodelled;
use crate::output::Form;
use crate::words::{fault_sentence, pause_sentence, stalls_sentence};
use serde::Serialize;
use std::fmt;
use taustream_arm::text::counted;
use taustream_drivers::ErrorFrame;
use taustream_messages::{BusReport, Phase, ReferenceState, Report};

/// One joint.
#[derive(Debug, Serialize)]
struct JointStatus {
    name: String,
    command_rad: f64,
    command_velocity_rad_s: f64,
    command_acceleration_rad_s2: f64,
    command_jerk_rad_s3: f64,
    measured_rad: f64,
    /// Null where the drive does not send it.
    measured_velocity_rad_s: f64,
    /// Null where the drive does not send it.
    measured_torque_nm: f64,
    tracking_error_rad: f64,
    tracking_error_rad_max: f64,
    feedback_age_s: f64,
    drive_status: u32,
    drive_error: u32,
    /// The status word as text.
    drive_status_text: String,
    /// The error code as text; null when there is none.
    drive_error_text: Option<String>,
    /// It is referenced; only then it may be energised.
    referenced: bool,
    reference: &'static str,
}

/// The fault of the arm.
#[derive(Debug, Serialize)]
struct FaultStatus {
    reason: u32,
    joint: Option<u32>,
    bus: Option<u32>,
    code: u32,
    object: u32,
    value: f64,
    limit: f64,
    message: String,
}

/// Why the arm is paused.
#[derive(Debug, Serialize)]
struct PauseStatus {
    /// "operator" or "stall".
    reason: &'static str,
    gap_s: f64,
    message: String,
}

/// One bus.
#[derive(Debug, Serialize)]
struct BusStatus {
    name: String,
    interface: String,
    /// "well", or what is wrong with it and what to do.
    state: String,
    silent: bool,
    frames_sent: u64,
    frames_lost: u64,
    frames_received: u64,
    cycles_lost: u64,
    in_flight: u32,
    receive_lost: u64,
    echoes_missing: u64,
    error_frames: u64,
    /// What the newest error frame says; null when there was none.
    newest_error: Option<String>,
}

/// The motion that runs or ran last.
#[derive(Debug, Serialize)]
struct MotionStatus {
    trajectory_id: u64,
    generation: u64,
    at_s: f64,
    duration_s: f64,
    /// The accepted motion that waits for its cut.
    successor: Option<SuccessorStatus>,
    /// When everything accepted has ended, in trajectory time, and where.
    end_s: f64,
    end_rad: Vec<f64>,
}

/// The motion that waits.
#[derive(Debug, Serialize)]
struct SuccessorStatus {
    trajectory_id: u64,
    /// Trajectory time of the takeover.
    from_s: f64,
}

/// What the streamer says.
#[derive(Debug, Serialize)]
pub(crate) struct Status {
    arm: String,
    robot_digest: String,
    phase: &'static str,
    energised: bool,
    fault: Option<FaultStatus>,
    paused: Option<PauseStatus>,
    sigma: f64,
    speed_percent: f64,
    /// The speed is still that of the start.
    first_speed: bool,
    /// Drives are kept as they were found holding at start.
    adopted: bool,
    motion: Option<MotionStatus>,
    joints: Vec<JointStatus>,
    /// Grippers and lifts.
    axes: Vec<AxisStatus>,
    buses: Vec<BusStatus>,
    /// Links that move and have no shape: nothing keeps them from being hit.
    unmodelled_links: Vec<String>,
    /// Number of the report; gaps are reports that this reader missed.
    sequence: u64,
    tick: u64,
    time_ns: u64,
    cycles: u64,
    cycles_late: u64,
    cycles_skipped: u64,
    stalls: u64,
    frames_sent: u64,
    frames_lost: u64,
    frames_received: u64,
    guard_trips: u64,
    accepted: u64,
    rejected: u64,
    lateness_ns_p50: u64,
    lateness_ns_p99: u64,
    lateness_ns_p999: u64,
    lateness_ns_max: u64,
    cycle_ns_p99: u64,
    cycle_ns_max: u64,
}

/// Waits for a report and prints it.
pub(crate) fn run(form: Form, arm: &ArmName) -> Result<(), Failure> {
    let (report, phase) = Client::join(&arm.name)?.report()?;
    form.print(&Status::of(&report, phase, arm))
}

impl Status {
    pub(crate) fn of(r: &Report, phase: Phase, arm: &ArmName) -> Self {
        let fault = (r.fault_reason != 0).then(|| FaultStatus {
            reason: r.fault_reason,
            joint: (r.fault_joint != u32::MAX).then_some(r.fault_joint),
            bus: (r.fault_bus != u32::MAX).then_some(r.fault_bus),
            code: r.fault_code,
            object: r.fault_object,
            value: r.fault_value,
            limit: r.fault_limit,
            message: fault_sentence(r, arm),
        });
        let motion = (r.trajectory_id != 0).then(|| MotionStatus {
            trajectory_id: r.trajectory_id,
            generation: r.generation,
            at_s: r.trajectory_s,
            duration_s: r.trajectory_duration_s,
            successor: (r.successor_id != 0)
                .then_some(SuccessorStatus { trajectory_id: r.successor_id, from_s: r.successor_from_s }),
            end_s: r.end_s,
            end_rad: r.end_rad.iter().take(r.joints()).copied().collect(),
        });
        Self {
            arm: arm.name.clone(),
            robot_digest: r.robot_digest.iter().map(|byte| format!("{byte:02x}")).collect(),
            phase: phase.word(),
            energised: r.energised == 1,
            fault,
            paused: paused(r),
            sigma: r.sigma,
            speed_percent: r.speed_percent,
            first_speed: r.first_speed == 1,
            adopted: r.adopted == 1,
            motion,
            joints: joints(r, arm),
            axes: AxisStatus::all(r, arm),
            buses: buses(r, arm),
            unmodelled_links: arm.unmodelled_links.clone(),
            sequence: r.sequence,
            tick: r.tick,
            time_ns: r.time_ns,
            cycles: r.cycles,
            cycles_late: r.cycles_late,
            cycles_skipped: r.cycles_skipped,
            stalls: r.stalls,
            frames_sent: r.frames_sent,
            frames_lost: r.frames_lost,
            frames_received: r.frames_received,
            guard_trips: r.guard_trips,
            accepted: r.accepted,
            rejected: r.rejected,
            lateness_ns_p50: r.lateness_ns_p50,
            lateness_ns_p99: r.lateness_ns_p99,
            lateness_ns_p999: r.lateness_ns_p999,
            lateness_ns_max: r.lateness_ns_max,
            cycle_ns_p99: r.cycle_ns_p99,
            cycle_ns_max: r.cycle_ns_max,
        }
    }
}

fn paused(r: &Report) -> Option<PauseStatus> {
    let (pause, message) = (r.pause()?, pause_sentence(r)?);
    Some(PauseStatus { reason: pause.reason.word(), gap_s: pause.gap_s, message })
}

fn joints(r: &Report, arm: &ArmName) -> Vec<JointStatus> {
    let at = |array: &[f64], joint: usize| array.get(joint).copied().unwrap_or(f64::NAN);
    let word = |array: &[u32], joint: usize| array.get(joint).copied().unwrap_or(0);
    let names = arm.names_in(r);
    (0..r.joints())
        .map(|j| JointStatus {
            name: arm.joints.get(j).cloned().unwrap_or_else(|| format!("joint{}", j + 1)),
            command_rad: at(&r.command_rad, j),
            command_velocity_rad_s: at(&r.command_velocity_rad_s, j),
            command_acceleration_rad_s2: at(&r.command_acceleration_rad_s2, j),
            command_jerk_rad_s3: at(&r.command_jerk_rad_s3, j),
            measured_rad: at(&r.measured_rad, j),
            measured_velocity_rad_s: at(&r.measured_velocity_rad_s, j),
            measured_torque_nm: at(&r.measured_torque_nm, j),
            tracking_error_rad: at(&r.tracking_error_rad, j),
            tracking_error_rad_max: at(&r.tracking_error_rad_max, j),
            feedback_age_s: at(&r.feedback_age_s, j),
            drive_status: word(&r.drive_status, j),
            drive_error: word(&r.drive_error, j),
            drive_status_text: names.status_word(j, word(&r.drive_status, j)),
            drive_error_text: Some(word(&r.drive_error, j))
                .filter(|code| *code != 0)
                .map(|code| names.error_code(j, code)),
            referenced: ReferenceState::from_code(word(&r.reference_state, j)).is_referenced(),
            reference: ReferenceState::from_code(word(&r.reference_state, j)).word(),
        })
        .collect()
}

fn buses(r: &Report, arm: &ArmName) -> Vec<BusStatus> {
    let names = arm.names_in(r);
    let status = |(index, bus): (usize, &BusReport)| {
        let name = names.buses.get(index).cloned().unwrap_or_default();
        let error = ErrorFrame { class: bus.error_class, data: bus.error_data };
        BusStatus {
            name: name.name,
            interface: name.interface,
            state: names.bus_state(index, bus),
            silent: bus.silent != 0,
            frames_sent: bus.frames_sent,
            frames_lost: bus.frames_lost,
            frames_received: bus.frames_received,
            cycles_lost: bus.cycles_lost,
            in_flight: bus.in_flight,
            receive_lost: bus.receive_lost,
            echoes_missing: bus.echoes_missing,
            error_frames: bus.error_frames,
            newest_error: (bus.error_frames > 0).then(|| error.sentence()),
        }
    };
    r.buses().iter().enumerate().map(status).collect()
}

impl Status {
    /// What has to be known before the arm is trusted to move.
    fn trust(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.first_speed {
            writeln!(f, "the first speed after start: `taustream speed 100` lifts it")?;
        }
        if self.adopted {
            writeln!(
                f,
                "drives hold from before this start, as this arm's settings left them: `enable` takes them over"
            )?;
        }
        for joint in self.joints.iter().filter(|joint| !joint.referenced) {
            writeln!(f, "joint {} is not referenced: {}", joint.name, joint.reference)?;
        }
        write!(f, "{}", Unmodelled(&self.unmodelled_links))
    }
}

impl Status {
    fn why_it_rests(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(fault) = &self.fault {
            writeln!(f, "fault: {}", fault.message)?;
        }
        if let Some(pause) = &self.paused {
            writeln!(f, "{}", pause.message)?;
        }
        Ok(())
    }
}

impl Status {
    fn beside_the_path(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for axis in &self.axes {
            writeln!(f, "{axis}")?;
        }
        self.buses.iter().try_for_each(|bus| write!(f, "{bus}"))
    }
}

impl fmt::Display for BusStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "bus {} ({}): {}; {} sent, {} lost in {}, {} received, {} in flight",
            self.name,
            self.interface,
            self.state,
            self.frames_sent,
            self.frames_lost,
            counted(self.cycles_lost, "cycle"),
            self.frames_received,
            self.in_flight
        )?;
        if self.receive_lost + self.echoes_missing > 0 {
            writeln!(
                f,
                "  this computer read too slowly: {} lost in receiving, {} of its own did not come back",
                counted(self.receive_lost, "frame"),
                self.echoes_missing
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let energised = if self.energised { "energised" } else { "not energised" };
        writeln!(
            f,
            "arm {}: {}, {energised}, speed {} %, sigma {:.3}",
            self.arm, self.phase, self.speed_percent, self.sigma
        )?;
        self.trust(f)?;
        self.why_it_rests(f)?;
        match &self.motion {
            Some(m) => {
                let (id, generation) = (m.trajectory_id, m.generation);
                write!(f, "motion {id} (generation {generation}): {:.3} of {:.3} s", m.at_s, m.duration_s)?;
                match &m.successor {
                    Some(next) => {
                        writeln!(f, "; motion {} follows at {:.3} s", next.trajectory_id, next.from_s)?;
                    }
                    None => writeln!(f)?,
                }
            }
            None => writeln!(f, "motion: none since the streamer started")?,
        }
        writeln!(
            f,
            "  joint              command (rad)  measured (rad)  tracking error (mrad), largest  feedback age (ms)  drive"
        )?;
        for j in &self.joints {
            writeln!(
                f,
                "  {:<18} {:>12.6}  {:>14.6}  {:>21.3}  {:>7.3}  {:>17.1}  {}",
                j.name,
                j.command_rad,
                j.measured_rad,
                j.tracking_error_rad * 1e3,
                j.tracking_error_rad_max * 1e3,
                j.feedback_age_s * 1e3,
                j.drive_status_text
            )?;
        }
        for (joint, error) in self.joints.iter().filter_map(|j| Some((&j.name, j.drive_error_text.as_ref()?)))
        {
            writeln!(f, "drive of joint {joint}: {error}")?;
        }
        self.beside_the_path(f)?;
        writeln!(
            f,
            "cycle {}: late {}, skipped {}, stalls {}, guard trips {}",
            self.cycles, self.cycles_late, self.cycles_skipped, self.stalls, self.guard_trips
        )?;
        if let Some(sentence) = stalls_sentence(self.stalls) {
            writeln!(f, "stalls since its start: {sentence}")?;
        }
        writeln!(
            f,
            "lateness (us): p50 {}, p99 {}, p99.9 {}, max {}; time in the cycle: p99 {}, max {}",
            self.lateness_ns_p50 / 1000,
            self.lateness_ns_p99 / 1000,
            self.lateness_ns_p999 / 1000,
            self.lateness_ns_max / 1000,
            self.cycle_ns_p99 / 1000,
            self.cycle_ns_max / 1000
        )?;
        write!(
            f,
            "frames: {} sent, {} lost, {} received; trajectories: {} accepted, {} rejected",
            self.frames_sent, self.frames_lost, self.frames_received, self.accepted, self.rejected
        )
    }
}
