//! What one cycle has found out: every stage writes down what happened, `supervise` alone draws conclusions.
use crate::phases::Event;
use crate::successor::CutRefusal;
use crate::tick::Tick;
use taustream_drivers::{CanId, ErrorFrame, JointSet, LinkFault, Nanos, ServoStatus};
use taustream_messages::{AxisReport, BusFault, Command, Phase};
pub use taustream_messages::{BUSES_MAX, Cause};
use taustream_motion::axis::AXES_MAX;
use taustream_motion::limits::Quantity;
use taustream_motion::time_scale::Scale;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Most commands taken in one cycle; more wait for the next.
pub const COMMANDS_MAX: usize = 4;
/// Most changes of phase in one cycle: a few commands and an event of each kind.
pub const TRANSITIONS_MAX: usize = 12;

/// A command with the number under which it is answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PendingCommand {
    /// Ties the answer to the question.
    pub sequence: u64,
    /// What is asked.
    pub command: Command,
    /// Until when its sender waits; it is not carried out later, unless it stops the arm.
    pub valid_until: Nanos,
}

/// The real-time thread's final word on a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryResult {
    /// The trajectory.
    pub trajectory_id: u64,
    /// Its generation.
    pub generation: u64,
    /// What became of it.
    pub decision: Decision,
}

/// Accepted, or why not: the reasons that only the moment can tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// It runs from the cycle `tick` on.
    Accepted {
        /// Cycle number.
        tick: u64,
    },
    /// It waits until the running one reaches its cut.
    Waits {
        /// Trajectory time from which it holds.
        from_s: f64,
    },
    /// It cuts, and the cut cannot be kept.
    Cut(CutRefusal),
    /// Not newer than `newest`.
    Stale {
        /// Newest generation accepted.
        newest: u64,
    },
    /// The commanded pose is not its base.
    NotAtBase {
        /// Zero-based joint.
        joint: usize,
        /// Distance.
        by_rad: f64,
    },
    /// The phase takes no trajectory.
    NotReady {
        /// The phase.
        phase: Phase,
    },
}

/// Why the guard refused a setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trip {
    /// Zero-based joint.
    pub joint: usize,
    /// What is wrong.
    pub kind: TripKind,
    /// The offending number.
    pub value: f64,
    /// The limit that it broke.
    pub limit: f64,
}

/// What the guard looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TripKind {
    /// NaN or infinite.
    NotFinite,
    /// Outside a limit.
    Limit(Quantity),
    /// The sample's derivatives do not belong to its positions.
    Inconsistent(Quantity),
    /// Too fast to stop before the position limit.
    CannotStop,
}

/// How far a brake off the path has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Braking {
    /// No brake.
    #[default]
    No,
    /// On its way to rest.
    Running,
    /// At rest.
    Rested,
}

/// One bus in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusState {
    /// Frames that the drivers wanted sent.
    pub requested: u32,
    /// Frames that the link took.
    pub sent: u32,
    /// Why not all, or why nothing could be received.
    pub fault: Option<LinkFault>,
    /// Frames received, own ones not counted.
    pub received: u32,
    /// Error frames received.
    pub errors: u32,
    /// Why nothing leaves on it any more, from its failure to `clear-fault`.
    pub failed: Option<BusFault>,
    /// Its controller is error-passive.
    pub passive: bool,
    /// Cycles in a row in which not everything was taken.
    pub consecutive_lost: u32,
    /// Frames passed to the link and not yet seen on the wire.
    pub in_flight: u32,
    /// Frames passed to the link whose echo was lost in this computer, since the link was opened.
    pub echoes_missing: u64,
    /// Frames that were lost because they arrived faster than they were read, since the link was opened.
    pub overflowed: u64,
    /// Frames were read late, or lost, in the time that feedback may take.
    pub receive_behind: bool,
    /// Frames have waited to be read for longer than feedback may take.
    pub unread: bool,
    /// The newest frame by which another master commands drives of this arm, for half a second.
    pub other_master: Option<CanId>,
    /// Whether frames of earlier cycles waited in the interface's queue; `None` when nobody asked.
    pub queued: Option<bool>,
    /// The newest error frame since start.
    pub newest_error: ErrorFrame,
    /// Error frames since start.
    pub error_frames: u64,
    /// SYNCs passed to the link since start.
    pub syncs: u64,
    /// Frames passed to the link so far.
    pub frames: u64,
}

/// Setpoints of one joint that were due and that the kernel did not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LostSetpoints {
    /// Zero-based joint.
    pub joint: usize,
    /// How many: in a row, or of the last 32.
    pub count: u32,
    /// How many of the last 32 may be lost; `None` when they were lost in a row, so that the drive has stopped.
    pub tolerated: Option<u32>,
}

/// What became of starting the failed buses over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restored {
    /// The `clear-fault` that asked for it.
    pub sequence: u64,
    /// Every one of them works again. If not, the client got the reason.
    pub recovered: bool,
}

/// One change of phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// In which cycle.
    pub tick: u64,
    /// The phase before.
    pub from: Phase,
    /// The phase after.
    pub to: Phase,
    /// What happened.
    pub event: Event,
    /// The fault behind it.
    pub cause: Option<Cause>,
}

/// Everything that one cycle has found out.
#[derive(Clone, Copy, Debug)]
pub struct CycleState {
    /// The cycle.
    pub tick: Tick,
    /// Commands taken in this cycle.
    pub commands: [Option<PendingCommand>; COMMANDS_MAX],
    /// What became of the trajectory that was offered.
    pub trajectory_result: Option<TrajectoryResult>,
    /// The drives are to be energised: the setpoint is meant for the drives.
    pub live: bool,
    /// Id of the trajectory that made the setpoint; 0 when the arm holds or brakes.
    pub trajectory_id: u64,
    /// Its trajectory time.
    pub trajectory_s: f64,
    /// It is the successor of the one that ran before, and its first setpoint has left.
    pub took_over: bool,
    /// How far the setpoint is from the trajectory while a difference is faded out, rad.
    pub off_path_rad: JointArray,
    /// The time scale at the setpoint.
    pub scale: Scale,
    /// Time since the last setpoint that left.
    pub gap_s: f64,
    /// That time is beyond what the drives bridge: trajectory time does not advance.
    pub frozen: bool,
    /// That time is beyond what the drives bridge, and the trajectory continues in time, as the settings say.
    pub bridged: bool,
    /// The setpoint is the trajectory's end.
    pub end_reached: bool,
    /// sigma is 0 and stays so.
    pub at_rest: bool,
    /// Another change of speed can be taken.
    pub can_ramp: bool,
    /// Why the guard refused the setpoint, in the cycle in which it did.
    pub trip: Option<Trip>,
    /// The brake that a trip began.
    pub braking: Braking,
    /// Lowest and highest angle of the brake, one pair a joint.
    pub sweep_rad: [[f64; 2]; MAX_JOINTS],
    /// The buses.
    pub buses: [BusState; BUSES_MAX],
    /// Failed buses came back from being restarted.
    pub restored: Option<Restored>,
    /// Joints on failed buses: what is known of them is old, and no command reaches them.
    pub unreachable: [bool; MAX_JOINTS],
    /// Joints whose setpoints were to leave in this cycle.
    pub due: JointSet,
    /// Those of them whose setpoints the kernel took.
    pub taken: JointSet,
    /// A joint that lost more setpoints than its drive bridges.
    pub lost: Option<LostSetpoints>,
    /// The drives, after receiving.
    pub servos: [ServoStatus; MAX_JOINTS],
    /// What the joints were commanded last ([`crate::last_sent::Ledger::commanded_rad`]), and behind them the axes.
    pub commanded_rad: JointArray,
    /// Why the last check of an axis's setpoint refused it, in the cycle in which it did.
    pub axis_trip: Option<Trip>,
    /// Axes whose commands move.
    pub axes_moving: [bool; AXES_MAX],
    /// What the axes do, at the end of the cycle.
    pub axes: [AxisReport; AXES_MAX],
}

impl CycleState {
    /// A cycle of which nothing is known yet.
    #[must_use]
    pub fn begin(tick: Tick) -> Self {
        Self {
            tick,
            commands: [None; COMMANDS_MAX],
            trajectory_result: None,
            live: false,
            trajectory_id: 0,
            trajectory_s: 0.0,
            took_over: false,
            off_path_rad: [0.0; MAX_JOINTS],
            scale: Scale::default(),
            gap_s: 0.0,
            frozen: false,
            bridged: false,
            end_reached: false,
            at_rest: false,
            can_ramp: false,
            trip: None,
            braking: Braking::No,
            sweep_rad: [[0.0; 2]; MAX_JOINTS],
            buses: [BusState::default(); BUSES_MAX],
            restored: None,
            unreachable: [false; MAX_JOINTS],
            due: JointSet::EMPTY,
            taken: JointSet::EMPTY,
            lost: None,
            servos: [ServoStatus::UNKNOWN; MAX_JOINTS],
            commanded_rad: [0.0; MAX_JOINTS],
            axis_trip: None,
            axes_moving: [false; AXES_MAX],
            axes: [AxisReport::default(); AXES_MAX],
        }
    }

    /// The first bus that has failed, and why.
    #[must_use]
    pub fn failed_bus(&self) -> Option<(usize, BusFault)> {
        self.buses.iter().enumerate().find_map(|(bus, found)| Some((bus, found.failed?)))
    }

    /// True when at least one frame left, or none was wanted because nothing has to be said. A failed bus sends nothing
    /// because nothing can be.
    #[must_use]
    pub fn setpoints_sent(&self) -> bool {
        let quiet = self.buses.iter().all(|b| b.requested == 0 && b.failed.is_none());
        quiet || self.buses.iter().any(|b| b.sent > 0)
    }
}
