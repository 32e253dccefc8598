//! One CiA 402 node from silence to cyclic synchronous position.
//!
//! First it only receives: a drive that is energised before this master has configured it is left as it is. Then the
//! communication part is reset, the drive configured by SDO, and started. All times are on the driver's stall-free
//! clock, which does not advance while the master itself is stalled, so that our own lateness is no fault of a drive.
use crate::bring_up::adopt::Adoption;
use crate::bring_up::brake::Brake;
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::homing::{Homing, HomingTarget};
use crate::bring_up::homing_plan::HomingPlan;
use crate::bring_up::inputs::Inputs;
use crate::bring_up::plan::{HEARTBEAT_LOST_MS, NodePlan};
use crate::bring_up::power::{Power, Received, TargetSource};
use crate::bring_up::scale::StatedScale;
use crate::bring_up::steps::{Parts, Step};
use crate::bring_up::timing::{BringUpCycle, Timeouts, nanos};
use crate::codec::canopen::{Nmt, NmtCommand};
use crate::codec::cia402_words::{CONTROL_OFF, DriveStep, STATUS_WARNING};
use crate::codec::emcy::HEARTBEAT;
use crate::codec::object;
use crate::codec::sdo::{SdoBytes, SdoRequest};
use crate::codec::sdo_client::{SdoClient, SdoJob, SdoOutcome};
use crate::servo::{DriveState, DriveTarget, FixedPdos, HomingState, Nanos};

/// Pause between two looks at the modes display of a drive that is being energised.
const MODE_AGAIN: Nanos = Nanos(20_000_000);
/// Pause between two looks at a drive that is waited for.
pub(super) const OBSERVE_AGAIN: Nanos = Nanos(100_000_000);
/// How long the bus is listened to before anything is reset: a foreign SYNC shows itself in this time.
pub(super) const OBSERVE_MIN: Nanos = Nanos(100_000_000);
/// How long "voltage off" is sent to a lost drive before its setpoints end.
const SHUTDOWN_FRAMES: Nanos = Nanos(100_000_000);
/// How long a node may take from NMT start to its first TPDO.
const START_TIMEOUT: Nanos = Nanos(500_000_000);
const HEARTBEAT_LOST: Nanos = Nanos(HEARTBEAT_LOST_MS as u64 * 1_000_000);
/// NMT start is sent this often before the drive counts as refusing.
const START_TRIES: u8 = 3;

pub(super) const SCALE_DIFFERS: u32 = BringUpFault::ScaleDiffers.code();
const LIMIT_TOO_LOW: u32 = BringUpFault::LimitTooLow.code();
const RATED_TORQUE_DIFFERS: u32 = BringUpFault::RatedTorqueDiffers.code();
const NOT_TAKEN: u32 = BringUpFault::NotTaken.code();

/// What the modes display (0x6061) has said.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ModeDisplay {
    /// It says the mode of the settings.
    pub(super) is_right: bool,
    /// When it was asked last.
    pub(super) asked: Nanos,
}

/// State of the bring-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NodeStage {
    /// Reading the statusword, changing nothing.
    Observe { since: Nanos, next: Nanos, fault: Option<BringUpFault> },
    /// Found energised; reading whether it is ours.
    Verify,
    /// Found energised and ours: it holds, and waits for the drive target to keep it.
    Held { next: Nanos },
    /// To be kept: NMT start sent, which leaves the power stage alone; waiting for the first TPDO.
    Rejoin { since: Nanos, tries: u8 },
    /// Found energised and not ours, and why; watched, left alone.
    Unowned { next: Nanos, fault: BringUpFault, object: u32 },
    /// Waiting for boot-up.
    Reset { since: Nanos },
    /// At this step of the plan.
    Configure { step: usize, since: Nanos },
    /// NMT start sent; waiting for the first TPDO.
    Start { since: Nanos, tries: u8 },
    /// Process data flows.
    Operational { shutdown_since: Option<Nanos> },
    /// Lost its configuration while in use; waits for the drive target to be disabled.
    Gone(BringUpFault),
    /// A step was refused.
    Refused { code: u32, object: u32 },
}

/// What a node wants sent after the setpoints of a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Service {
    /// A network command.
    pub nmt: Option<Nmt>,
    /// A request.
    pub sdo: Option<SdoRequest>,
}

/// What is sent to a node in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveSetpoint {
    /// Controlword.
    pub control: u16,
    /// Target in counts.
    pub target_counts: i32,
}

/// The command for a node in this cycle.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// In counts; `None` when the command was not a number.
    pub counts: Option<i32>,
    /// Close enough to the measured position to energise.
    pub near: bool,
    /// Torque beside it, at the joint.
    pub torque_nm: f64,
}

/// The master's image of one node.
#[derive(Clone, Debug)]
pub struct Node {
    pub(super) plan: NodePlan,
    pub(super) steps: Vec<Step>,
    pub(super) timeouts: Timeouts,
    boot_timeout: Nanos,
    pub(super) stage: NodeStage,
    pub(super) sdo: SdoClient,
    pub(super) adoption: Adoption,
    pub(super) held: Option<i32>,
    pub(super) nmt: Option<NmtCommand>,
    pub(super) power: Power,
    pub(super) last_target: DriveTarget,
    pub(super) received: bool,
    pub(super) status: u16,
    pub(super) position: Option<i32>,
    pub(super) commanded: Option<i32>,
    pub(super) tpdo_at: Nanos,
    pub(super) heartbeat_at: Nanos,
    pub(super) denials: u8,
    pub(super) emcy: u16,
    /// The newest emergency message that was no "error reset", and how many came.
    pub(super) emergency: (u16, u32),
    pub(super) requested_error: bool,
    /// A communication reset was sent and its boot-up has not come yet.
    pub(super) reset_sent: bool,
    /// What differs in the group of steps that is at work.
    pub(super) differs: Parts,
    /// What the object that was compared last holds; `None` when it did not let itself be read.
    pub(super) there: Option<u32>,
    /// PDOs that are not needed and stay on.
    pub(super) fixed_pdos: FixedPdos,
    pub(super) mode: ModeDisplay,
    pub(super) inputs: Inputs,
    pub(super) brake: Brake,
    pub(super) stated: StatedScale,
    pub(super) homing: Homing,
    pub(super) homing_plan: Option<HomingPlan>,
    /// What the drive states of the object that contradicts the settings, and what they say.
    pub(super) numbers: [f64; 2],
}

impl Node {
    /// A node of which nothing is known.
    #[must_use]
    pub fn new(plan: NodePlan, timeouts: Timeouts) -> Self {
        Self {
            plan,
            steps: plan.steps(),
            timeouts,
            boot_timeout: nanos(plan.features.boot_timeout_s).unwrap_or(Nanos(u64::MAX)),
            stage: NodeStage::Observe { since: Nanos(0), next: Nanos(0), fault: None },
            sdo: SdoClient::default(),
            adoption: Adoption::new(&plan),
            held: None,
            nmt: None,
            power: plan.power(timeouts.step),
            last_target: DriveTarget::Disabled,
            received: false,
            status: 0,
            position: None,
            commanded: None,
            tpdo_at: Nanos(0),
            heartbeat_at: Nanos(0),
            denials: 0,
            emcy: 0,
            emergency: (0, 0),
            requested_error: false,
            reset_sent: false,
            differs: Parts::NONE,
            there: None,
            fixed_pdos: FixedPdos::NONE,
            mode: ModeDisplay::default(),
            inputs: Inputs::default(),
            brake: Brake::default(),
            stated: StatedScale::default(),
            homing: Homing::default(),
            homing_plan: plan.homing.map(|homing| HomingPlan::of(&homing, &plan)),
            numbers: [0.0; 2],
        }
    }

    /// True when the node needs SYNC to come up or to work.
    #[must_use]
    pub const fn needs_sync(&self) -> bool {
        matches!(
            self.stage,
            NodeStage::Start { .. } | NodeStage::Rejoin { .. } | NodeStage::Operational { .. }
        )
    }

    /// What an adopted drive holds, or one at the end of its homing, in counts.
    #[must_use]
    pub fn held(&self) -> Option<i32> {
        let adopted = self.held.filter(|_| self.state() == DriveState::Adopted);
        adopted.or_else(|| self.homing.held().filter(|_| self.state() == DriveState::Homing))
    }

    /// PDOs that are not needed, and that the drive does not let be switched off.
    #[must_use]
    pub const fn fixed_pdos(&self) -> FixedPdos {
        self.fixed_pdos
    }

    /// What is known of its homing.
    #[must_use]
    pub fn homing(&self) -> HomingState {
        if self.state() == DriveState::Homing { self.homing.outcome() } else { HomingState::None }
    }

    /// Newest position in counts.
    #[must_use]
    pub const fn position(&self) -> Option<i32> {
        self.position
    }

    /// Newest statusword.
    #[must_use]
    pub const fn status(&self) -> u16 {
        self.status
    }

    /// The drive warns.
    #[must_use]
    pub const fn warns(&self) -> bool {
        self.status & STATUS_WARNING != 0
    }

    /// The drive says, or shows by leaving NMT operational, that it has lost its master.
    #[must_use]
    pub fn lost_master(&self) -> bool {
        self.emcy == HEARTBEAT || self.stage == NodeStage::Gone(BringUpFault::LeftOperational)
    }

    /// Where the drive is.
    #[must_use]
    pub fn state(&self) -> DriveState {
        match self.stage {
            NodeStage::Observe { .. } if !self.received => DriveState::Absent,
            NodeStage::Observe { .. }
            | NodeStage::Verify
            | NodeStage::Reset { .. }
            | NodeStage::Configure { .. }
            | NodeStage::Start { .. } => DriveState::Configuring,
            NodeStage::Held { .. } | NodeStage::Rejoin { .. } => DriveState::Adopted,
            NodeStage::Unowned { .. } => DriveState::EnergisedUnowned,
            NodeStage::Operational { .. } => self.homing.state(self.power.state(self.status)),
            NodeStage::Gone(_) => DriveState::Fault,
            NodeStage::Refused { .. } => DriveState::Refused,
        }
    }

    /// The code to report, and the object it concerns (`index << 8 | sub`, or 0).
    #[must_use]
    pub fn error(&self) -> (u32, u32) {
        let emcy = u32::from(self.emcy);
        let of = |fault: Option<BringUpFault>| fault.map_or(0, BringUpFault::code);
        match self.stage {
            NodeStage::Observe { fault, .. } => (of(fault), 0),
            NodeStage::Refused { code, object } => (code, object),
            NodeStage::Gone(fault) => (fault.code(), 0),
            NodeStage::Operational { .. } => {
                let fault = of(self.power.fault());
                let drive_first = emcy != 0 && (self.in_fault() || fault == 0);
                (if drive_first { emcy } else { fault }, 0)
            }
            NodeStage::Unowned { fault, object, .. } => (fault.code(), object),
            NodeStage::Verify
            | NodeStage::Held { .. }
            | NodeStage::Rejoin { .. }
            | NodeStage::Reset { .. }
            | NodeStage::Configure { .. }
            | NodeStage::Start { .. } => (emcy, 0),
        }
    }

    /// What the drive states and what it should, where they contradict each other; 0 elsewhere.
    #[must_use]
    pub fn refused_numbers(&self) -> [f64; 2] {
        let homing = if let HomingState::Failed { code, .. } = self.homing() { code } else { 0 };
        match self.error().0.max(homing) {
            SCALE_DIFFERS | LIMIT_TOO_LOW | RATED_TORQUE_DIFFERS | NOT_TAKEN => self.numbers,
            _ => [0.0; 2],
        }
    }

    /// The newest target in counts, from the start of process data until the node is observed again. Nothing else may
    /// guess one: a drive that still receives would go there.
    #[must_use]
    pub const fn commanded(&self) -> Option<i32> {
        self.commanded
    }

    /// What is to be sent to the node in this cycle, while process data flows.
    ///
    /// Real time: arithmetic only.
    pub fn setpoint(&mut self, cycle: BringUpCycle, target: Target) -> Option<DriveSetpoint> {
        if !self.needs_sync() {
            self.power.watch(cycle.drive_target);
            return None;
        }
        let received = Received {
            status: self.status,
            fresh: self.age(cycle.now, self.tpdo_at) <= self.timeouts.feedback.0,
            command_near: target.near,
            in_mode: self.mode.is_right,
            homes: self.homing.suspends_following(),
            brake: self.brake.view(cycle.now, self.plan.brake.as_ref()),
        };
        self.homing.release_at(target.counts);
        let control = match self.stage {
            NodeStage::Operational { .. } => {
                let control = self.power.control(cycle.now, cycle.drive_target, received);
                if self.power.follows(control) { self.homing.control(control) } else { control }
            }
            NodeStage::Rejoin { .. } if cycle.drive_target != DriveTarget::TorqueOff => {
                self.power.keeping(self.status)
            }
            NodeStage::Observe { .. }
            | NodeStage::Verify
            | NodeStage::Held { .. }
            | NodeStage::Rejoin { .. }
            | NodeStage::Unowned { .. }
            | NodeStage::Reset { .. }
            | NodeStage::Configure { .. }
            | NodeStage::Start { .. }
            | NodeStage::Gone(_)
            | NodeStage::Refused { .. } => {
                self.power.watch(cycle.drive_target);
                CONTROL_OFF
            }
        };
        let target_source = if matches!(self.stage, NodeStage::Rejoin { .. }) {
            TargetSource::Held
        } else {
            self.power.target_source()
        };
        // A command that is no number must never become one: the last good target stays.
        let homing = self.homing.target().filter(|_| target_source == TargetSource::Command);
        let wanted = match (homing, target_source) {
            (Some(HomingTarget::Last), _) => None,
            (Some(HomingTarget::Measured), _) | (None, TargetSource::Measured) => self.position,
            (Some(HomingTarget::Held(counts)), _) => Some(counts),
            (None, TargetSource::Held) => self.held,
            (None, TargetSource::Command) => target.counts,
        };
        self.commanded = wanted.or(self.commanded);
        if target_source == TargetSource::Command {
            // What is held, should the target become `Keep`.
            self.held = self.commanded;
        }
        self.commanded.map(|target_counts| DriveSetpoint { control, target_counts })
    }

    /// This cycle's network command and SDO request: at most one of each.
    ///
    /// Real time: no allocation, bounded work.
    pub fn service(&mut self, cycle: BringUpCycle) -> Service {
        let torque_off =
            cycle.drive_target == DriveTarget::TorqueOff && self.last_target != DriveTarget::TorqueOff;
        self.last_target = cycle.drive_target;
        if torque_off && !self.needs_sync() {
            // Without process data the emergency goes by SDO, before whatever was being asked; then the drive is looked
            // at again from the start.
            if matches!(self.stage, NodeStage::Verify | NodeStage::Held { .. }) {
                self.observe(cycle.now, None);
            }
            self.torque_off_by_sdo();
        }
        if let Some((job, outcome)) = self.sdo.take() {
            self.settle(cycle, job, outcome);
        }
        self.advance(cycle);
        let nmt = self.nmt.take().map(|command| Nmt { command, node: self.plan.node });
        Service { nmt, sdo: self.sdo.poll(cycle.now) }
    }

    /// Clears findings, resets a drive in fault, and tries a refused drive again from the start.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self, now: Nanos) {
        self.power.clear(self.status);
        self.brake.clear();
        if !self.in_fault() {
            self.emcy = 0;
        }
        self.requested_error = false;
        if matches!(self.stage, NodeStage::Refused { .. }) {
            self.observe(now, None);
        }
    }

    /// Sends nothing: earlier feedback is no longer valid.
    ///
    /// Real time: no allocation.
    pub fn start_over(&mut self, now: Nanos) {
        self.observe(now, None);
        (self.received, self.status, self.position) = (false, 0, None);
        (self.nmt, self.denials, self.reset_sent) = (None, 0, false);
    }

    pub(super) fn in_fault(&self) -> bool {
        matches!(DriveStep::from_status(self.status), Some(DriveStep::Fault | DriveStep::FaultReaction))
    }

    pub(super) fn age(&self, now: Nanos, then: Nanos) -> u64 {
        now.0.saturating_sub(then.0)
    }

    /// Back to the start, where nothing is changed before the drive has been looked at.
    pub(super) fn observe(&mut self, now: Nanos, fault: Option<BringUpFault>) {
        self.sdo.cancel();
        self.power = self.plan.power(self.timeouts.step);
        self.commanded = None;
        self.homing.forget();
        self.inputs.forget();
        self.brake.forget();
        self.power.watch(self.last_target);
        (self.emcy, self.requested_error) = (0, false);
        self.stage = NodeStage::Observe { since: now, next: now, fault };
    }

    pub(super) fn torque_off_by_sdo(&mut self) {
        self.sdo.begin(SdoJob::Write(object::CONTROLWORD, SdoBytes::from_u16(0)));
    }

    pub(super) fn refuse(&mut self, code: u32, job: SdoJob) {
        self.stage = NodeStage::Refused { code, object: job.address().packed() };
    }

    /// What the stage does by itself, when no answer is awaited.
    fn advance(&mut self, cycle: BringUpCycle) {
        let now = cycle.now;
        match self.stage {
            NodeStage::Held { .. } if cycle.drive_target == DriveTarget::Keep && !cycle.other_master => {
                self.sdo.cancel();
                self.rejoin(now, 1);
            }
            NodeStage::Observe { next, .. } | NodeStage::Unowned { next, .. } | NodeStage::Held { next } => {
                if self.sdo.is_idle() && now >= next {
                    self.sdo.begin(SdoJob::Read(object::STATUSWORD));
                }
            }
            NodeStage::Verify => {
                if self.sdo.is_idle()
                    && let Some(job) = self.adoption.job(now)
                {
                    self.sdo.begin(job);
                }
            }
            NodeStage::Rejoin { since, tries } => {
                if self.age(now, since) >= START_TIMEOUT.0 {
                    if tries < START_TRIES {
                        self.rejoin(now, tries + 1);
                    } else {
                        self.unowned(now, BringUpFault::NotOperational, 0);
                    }
                }
            }
            NodeStage::Reset { since } => {
                if self.age(now, since) >= self.boot_timeout.0 {
                    self.observe(now, Some(BringUpFault::NoBootUp));
                }
            }
            NodeStage::Configure { step, .. } => {
                if self.sdo.is_idle() {
                    match self.steps.get(step) {
                        Some(step) => self.sdo.begin(step.job),
                        None => self.start(now, 1),
                    }
                }
            }
            NodeStage::Start { since, tries } => {
                if self.age(now, since) >= START_TIMEOUT.0 {
                    if tries < START_TRIES {
                        self.start(now, tries + 1);
                    } else {
                        self.stage =
                            NodeStage::Refused { code: BringUpFault::NotOperational.code(), object: 0 };
                    }
                }
            }
            NodeStage::Operational { shutdown_since } => self.supervise(cycle, shutdown_since),
            NodeStage::Gone(fault) => {
                if cycle.drive_target == DriveTarget::Disabled {
                    self.observe(now, Some(fault));
                }
            }
            NodeStage::Refused { .. } => {}
        }
    }

    fn start(&mut self, now: Nanos, tries: u8) {
        self.nmt = Some(NmtCommand::Start);
        self.stage = NodeStage::Start { since: now, tries };
    }

    fn supervise(&mut self, cycle: BringUpCycle, shutdown_since: Option<Nanos>) {
        let now = cycle.now;
        self.advance_homing(now);
        self.work_brake(now);
        if self.age(now, self.heartbeat_at) >= HEARTBEAT_LOST.0 {
            // A drive without feedback may still receive: it keeps its setpoints until the target is `Disabled`.
            self.power.note(BringUpFault::HeartbeatLost);
            if cycle.drive_target == DriveTarget::Disabled
                && self.power.target_source() == TargetSource::Measured
            {
                let since = shutdown_since.unwrap_or(now);
                self.stage = NodeStage::Operational { shutdown_since: Some(since) };
                if self.age(now, since) >= SHUTDOWN_FRAMES.0 {
                    self.received = false;
                    self.observe(now, Some(BringUpFault::HeartbeatLost));
                }
            }
        } else if !self.homing.is_idle() {
            self.inputs.forget();
            self.request_error();
        } else if !self.request_error() {
            self.request_mode(now);
            self.request_inputs(now);
        }
    }

    /// Looks at the modes display of a drive that shows its mode only in operation enabled.
    fn request_mode(&mut self, now: Nanos) {
        let enabled = DriveStep::from_status(self.status) == Some(DriveStep::OperationEnabled);
        if !enabled {
            // It shows it anew each time.
            self.mode.is_right &= !self.plan.features.late_mode_display;
        } else if !self.mode.is_right && self.sdo.is_idle() && self.age(now, self.mode.asked) >= MODE_AGAIN.0
        {
            self.mode.asked = now;
            self.sdo.begin(SdoJob::Read(object::MODE_DISPLAY));
        }
    }

    /// What an answer means for the stage.
    fn settle(&mut self, cycle: BringUpCycle, job: SdoJob, outcome: SdoOutcome) {
        if job.address() == object::CONTROLWORD {
            // The emergency's own write: the stage asks on, and sees what came of it.
            return;
        }
        if job.address() == object::ERROR_CODE {
            // A drive without the object, or that does not answer, stays in fault without a code.
            if let SdoOutcome::Value(value) = outcome
                && let Some(Ok(code)) = value.as_unsigned(2).map(u16::try_from)
            {
                self.emcy = code;
            }
            return;
        }
        if job.address() == object::OUTPUTS && matches!(self.stage, NodeStage::Operational { .. }) {
            return self.take_brake(cycle.now, job, outcome);
        }
        if job.address() == object::DIGITAL_INPUTS && matches!(self.stage, NodeStage::Operational { .. }) {
            return self.take_inputs(outcome);
        }
        match self.stage {
            NodeStage::Observe { .. } | NodeStage::Unowned { .. } | NodeStage::Held { .. } => {
                self.settle_observation(cycle, job, outcome);
            }
            NodeStage::Verify => self.settle_verify(cycle.now, job, outcome),
            NodeStage::Configure { step, since } => self.settle_step(cycle.now, outcome, (step, since)),
            NodeStage::Operational { .. } if !self.homing.is_idle() => {
                self.settle_homing(cycle.now, job, outcome);
            }
            NodeStage::Operational { .. } => {
                if let SdoOutcome::Value(value) = outcome
                    && job.address() == object::MODE_DISPLAY
                {
                    let mode = self.plan.features.position_mode.number();
                    self.mode.is_right = value.as_unsigned(1) == Some(u32::from(mode));
                }
            }
            NodeStage::Reset { .. }
            | NodeStage::Start { .. }
            | NodeStage::Rejoin { .. }
            | NodeStage::Gone(_)
            | NodeStage::Refused { .. } => {}
        }
    }
}
