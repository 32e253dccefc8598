//! One CiA 402 node from silence to cyclic synchronous position (can-protocols section 1.5).
//!
//! First it only listens: a drive that is energised before this master has configured it is left as it is. Then the
//! communication part is reset, the drive configured by SDO, and started. All times are on the driver's patient
//! clock, which stands still while the master itself is stalled, so that our own lateness is no fault of a drive.
use crate::bring_up::adopt::Adoption;
use crate::bring_up::pace::{Cycle, Patience};
use crate::bring_up::plan::{Check, HEARTBEAT_LOST_MS, NodePlan, Step};
use crate::bring_up::power::{Aim, Heard, Power};
use crate::bring_up::trouble::Trouble;
use crate::codec::canopen::{Emcy, Nmt, NmtCommand, NmtState};
use crate::codec::cia402_words::{CONTROL_OFF, DriveStep, STATUS_ENERGISED, STATUS_WARNING};
use crate::codec::object;
use crate::codec::sdo::{SdoBytes, SdoRequest, SdoResponse};
use crate::codec::sdo_client::{SdoClient, SdoJob, SdoOutcome, SdoValue};
use crate::codec::words::{ABORT_NO_OBJECT, ABORT_NO_SUBINDEX, ABORT_TIMEOUT};
use crate::servo::{DriveState, DriveWish, Nanos};

/// How long a boot-up may take.
const BOOT_UP_TIMEOUT: Nanos = Nanos(5_000_000_000);
/// Pause between two looks at a drive that is waited for.
pub(super) const LOOK_AGAIN: Nanos = Nanos(100_000_000);
/// How long the bus is listened to before anything is reset: a foreign SYNC shows itself in this time.
pub(super) const LISTEN_LEAST: Nanos = Nanos(100_000_000);
/// How long "voltage off" is sent to a lost drive before its setpoints end.
const FAREWELL: Nanos = Nanos(100_000_000);
/// How long a node may take from NMT start to its first TPDO.
const START_TIMEOUT: Nanos = Nanos(500_000_000);
const HEARTBEAT_LOST: Nanos = Nanos(HEARTBEAT_LOST_MS as u64 * 1_000_000);
/// NMT start is sent this often before the drive counts as refusing.
const START_TRIES: u8 = 3;
/// Heartbeats in a row that deny "operational" before it is believed: one may have been queued before the start.
const DENIALS_MAX: u8 = 2;

/// Where the bring-up stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Reading the statusword, changing nothing.
    Listen { since: Nanos, next: Nanos, trouble: Option<Trouble> },
    /// Found energised; reading whether it is ours.
    Verify,
    /// Found energised and ours: it holds, and waits for the wish to keep it.
    Held { next: Nanos },
    /// To be kept: NMT start sent, which leaves the power stage alone; waiting for the first TPDO.
    Rejoin { since: Nanos, tries: u8 },
    /// Found energised and not ours, and why; watched, left alone.
    Unowned { next: Nanos, trouble: Trouble, object: u32 },
    /// Waiting for boot-up.
    Reset { since: Nanos },
    /// At this step of the plan.
    Configure { step: usize, since: Nanos },
    /// NMT start sent; waiting for the first TPDO.
    Start { since: Nanos, tries: u8 },
    /// Process data flows.
    Operational { farewell: Option<Nanos> },
    /// Lost its configuration while in use; waits for the wish to be disabled.
    Gone(Trouble),
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

/// What a node is told in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoint {
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
}

/// The master's image of one node.
#[derive(Clone, Debug)]
pub struct Node {
    pub(super) plan: NodePlan,
    steps: Vec<Step>,
    patience: Patience,
    pub(super) stage: Stage,
    pub(super) sdo: SdoClient,
    pub(super) adoption: Adoption,
    pub(super) held: Option<i32>,
    pub(super) nmt: Option<NmtCommand>,
    power: Power,
    wished: DriveWish,
    pub(super) heard: bool,
    pub(super) status: u16,
    position: Option<i32>,
    told: Option<i32>,
    tpdo_at: Nanos,
    heartbeat_at: Nanos,
    denials: u8,
    emcy: u16,
    asked_error: bool,
}

impl Node {
    /// A node of which nothing is known.
    #[must_use]
    pub fn new(plan: NodePlan, patience: Patience) -> Self {
        Self {
            plan,
            steps: plan.steps(),
            patience,
            stage: Stage::Listen { since: Nanos(0), next: Nanos(0), trouble: None },
            sdo: SdoClient::default(),
            adoption: Adoption::new(&plan),
            held: None,
            nmt: None,
            power: Power::new(patience.step, plan.feedback_every),
            wished: DriveWish::Disabled,
            heard: false,
            status: 0,
            position: None,
            told: None,
            tpdo_at: Nanos(0),
            heartbeat_at: Nanos(0),
            denials: 0,
            emcy: 0,
            asked_error: false,
        }
    }

    /// True when the node needs SYNC to come up or to work.
    #[must_use]
    pub const fn needs_sync(&self) -> bool {
        matches!(self.stage, Stage::Start { .. } | Stage::Rejoin { .. } | Stage::Operational { .. })
    }

    /// What an adopted drive holds, in counts.
    #[must_use]
    pub fn held(&self) -> Option<i32> {
        self.held.filter(|_| self.state() == DriveState::Adopted)
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

    /// Where the drive is.
    #[must_use]
    pub fn state(&self) -> DriveState {
        match self.stage {
            Stage::Listen { .. } if !self.heard => DriveState::Absent,
            Stage::Listen { .. }
            | Stage::Verify
            | Stage::Reset { .. }
            | Stage::Configure { .. }
            | Stage::Start { .. } => DriveState::Configuring,
            Stage::Held { .. } | Stage::Rejoin { .. } => DriveState::Adopted,
            Stage::Unowned { .. } => DriveState::EnergisedUnowned,
            Stage::Operational { .. } => self.power.state(self.status),
            Stage::Gone(_) => DriveState::Fault,
            Stage::Refused { .. } => DriveState::Refused,
        }
    }

    /// The code to report, and the object it concerns (`index << 8 | sub`, or 0).
    #[must_use]
    pub fn error(&self) -> (u32, u32) {
        let emcy = u32::from(self.emcy);
        let of = |trouble: Option<Trouble>| trouble.map_or(0, Trouble::code);
        match self.stage {
            Stage::Listen { trouble, .. } => (of(trouble), 0),
            Stage::Refused { code, object } => (code, object),
            Stage::Gone(trouble) => (trouble.code(), 0),
            Stage::Operational { .. } => {
                let trouble = of(self.power.trouble());
                let drive_first = emcy != 0 && (self.in_fault() || trouble == 0);
                (if drive_first { emcy } else { trouble }, 0)
            }
            Stage::Unowned { trouble, object, .. } => (trouble.code(), object),
            Stage::Verify
            | Stage::Held { .. }
            | Stage::Rejoin { .. }
            | Stage::Reset { .. }
            | Stage::Configure { .. }
            | Stage::Start { .. } => (emcy, 0),
        }
    }

    /// The newest target in counts, from the start of process data until the node is looked at anew. Nobody else may
    /// guess one: a drive that still listens would go there.
    #[must_use]
    pub const fn told(&self) -> Option<i32> {
        self.told
    }

    /// What the node is to be told in this cycle, while process data flows.
    ///
    /// Real time: arithmetic only.
    pub fn setpoint(&mut self, cycle: Cycle, target: Target) -> Option<Setpoint> {
        if !self.needs_sync() {
            self.power.watch(cycle.wish);
            return None;
        }
        let heard = Heard {
            status: self.status,
            fresh: self.age(cycle.now, self.tpdo_at) <= self.patience.feedback.0,
            command_near: target.near,
        };
        let control = match self.stage {
            Stage::Operational { .. } => self.power.control(cycle.now, cycle.wish, heard),
            Stage::Rejoin { .. } if cycle.wish != DriveWish::TorqueOff => Power::keeping(self.status),
            Stage::Listen { .. }
            | Stage::Verify
            | Stage::Held { .. }
            | Stage::Rejoin { .. }
            | Stage::Unowned { .. }
            | Stage::Reset { .. }
            | Stage::Configure { .. }
            | Stage::Start { .. }
            | Stage::Gone(_)
            | Stage::Refused { .. } => {
                self.power.watch(cycle.wish);
                CONTROL_OFF
            }
        };
        let aim = if matches!(self.stage, Stage::Rejoin { .. }) { Aim::Held } else { self.power.aim() };
        // A command that is no number must never become one: the last good target stays.
        let wanted = match aim {
            Aim::Measured => self.position,
            Aim::Held => self.held,
            Aim::Command => target.counts,
        };
        self.told = wanted.or(self.told);
        if aim == Aim::Command {
            // What is kept, should the wish become to keep.
            self.held = self.told;
        }
        self.told.map(|target_counts| Setpoint { control, target_counts })
    }

    /// This cycle's network command and SDO request: at most one of each.
    ///
    /// Real time: no allocation, bounded work.
    pub fn service(&mut self, cycle: Cycle) -> Service {
        let torque_off = cycle.wish == DriveWish::TorqueOff && self.wished != DriveWish::TorqueOff;
        self.wished = cycle.wish;
        if torque_off && !self.needs_sync() {
            // Without process data the emergency goes by SDO, before whatever was being asked; then the drive is looked
            // at again from the start.
            if matches!(self.stage, Stage::Verify | Stage::Held { .. }) {
                self.listen(cycle.now, None);
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

    /// Takes process data: statusword and position.
    ///
    /// Real time: arithmetic only. True when it was taken: before the mapping is ours its meaning is not known.
    pub fn take_tpdo(&mut self, now: Nanos, status: u16, position: i32) -> bool {
        self.heard = true;
        match self.stage {
            Stage::Start { .. } => {
                self.stage = Stage::Operational { farewell: None };
                self.heartbeat_at = now;
                self.denials = 0;
            }
            Stage::Rejoin { .. } => {
                self.stage = Stage::Operational { farewell: None };
                self.heartbeat_at = now;
                self.denials = 0;
                self.power.adopt();
            }
            Stage::Operational { .. } => {}
            Stage::Listen { .. }
            | Stage::Verify
            | Stage::Held { .. }
            | Stage::Unowned { .. }
            | Stage::Reset { .. }
            | Stage::Configure { .. }
            | Stage::Gone(_)
            | Stage::Refused { .. } => return false,
        }
        if self.in_fault() && DriveStep::from_status(status) != Some(DriveStep::Fault) {
            (self.emcy, self.asked_error) = (0, false);
        }
        (self.status, self.position, self.tpdo_at) = (status, Some(position), now);
        true
    }

    /// Takes an SDO answer.
    ///
    /// Real time: no allocation.
    pub fn take_sdo(&mut self, response: SdoResponse) {
        self.heard = true;
        self.sdo.accept(response);
    }

    /// Takes an emergency message.
    ///
    /// Real time: arithmetic only.
    pub fn take_emcy(&mut self, emcy: Emcy) {
        self.heard = true;
        self.emcy = emcy.code;
    }

    /// Takes a heartbeat or boot-up.
    ///
    /// Real time: arithmetic only.
    pub fn take_heartbeat(&mut self, now: Nanos, state: NmtState) {
        self.heard = true;
        self.heartbeat_at = now;
        self.denials = if state == NmtState::Operational { 0 } else { self.denials.saturating_add(1) };
        match (state, self.stage) {
            (NmtState::BootUp, Stage::Reset { .. }) => self.stage = Stage::Configure { step: 0, since: now },
            (NmtState::BootUp, Stage::Operational { .. }) => self.leave(now, Trouble::Restarted),
            (NmtState::BootUp, Stage::Gone(_)) => {}
            // It has just started: whatever was asked before is lost, and it can be asked at once.
            (NmtState::BootUp, _) => self.listen(now, None),
            // SDO does not work in NMT stopped; pre-operational does not touch the power stage.
            (NmtState::Stopped, Stage::Listen { .. }) => self.nmt = Some(NmtCommand::PreOperational),
            (_, Stage::Operational { .. }) if self.denials >= DENIALS_MAX => {
                self.leave(now, Trouble::LeftOperational);
            }
            _ => {}
        }
    }

    /// Forgets findings, resets a drive in fault, and tries a refused drive again from the start.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self, now: Nanos) {
        self.power.clear(self.status);
        if !self.in_fault() {
            self.emcy = 0;
        }
        self.asked_error = false;
        if matches!(self.stage, Stage::Refused { .. }) {
            self.listen(now, None);
        }
    }

    /// Back to silence: nothing of what was heard counts any more.
    ///
    /// Real time: no allocation.
    pub fn start_over(&mut self, now: Nanos) {
        self.listen(now, None);
        (self.heard, self.status, self.position) = (false, 0, None);
        (self.nmt, self.denials) = (None, 0);
    }

    fn in_fault(&self) -> bool {
        matches!(DriveStep::from_status(self.status), Some(DriveStep::Fault | DriveStep::FaultReaction))
    }

    pub(super) fn age(&self, now: Nanos, then: Nanos) -> u64 {
        now.0.saturating_sub(then.0)
    }

    /// Back to the start, where nothing is changed before the drive has been looked at.
    pub(super) fn listen(&mut self, now: Nanos, trouble: Option<Trouble>) {
        self.sdo.cancel();
        self.power = Power::new(self.patience.step, self.plan.feedback_every);
        self.told = None;
        self.power.watch(self.wished);
        (self.emcy, self.asked_error) = (0, false);
        self.stage = Stage::Listen { since: now, next: now, trouble };
    }

    fn leave(&mut self, now: Nanos, trouble: Trouble) {
        if self.wished == DriveWish::Disabled {
            self.listen(now, Some(trouble));
        } else {
            self.sdo.cancel();
            self.stage = Stage::Gone(trouble);
        }
    }

    pub(super) fn torque_off_by_sdo(&mut self) {
        self.sdo.begin(SdoJob::Write(object::CONTROLWORD, SdoBytes::from_u16(0)));
    }

    pub(super) fn refuse(&mut self, code: u32, job: SdoJob) {
        self.stage = Stage::Refused { code, object: job.address().packed() };
    }

    /// What the stage does by itself, when no answer is awaited.
    fn advance(&mut self, cycle: Cycle) {
        let now = cycle.now;
        match self.stage {
            Stage::Held { .. } if cycle.wish == DriveWish::Keep && !cycle.other_master => {
                self.sdo.cancel();
                self.rejoin(now, 1);
            }
            Stage::Listen { next, .. } | Stage::Unowned { next, .. } | Stage::Held { next } => {
                if self.sdo.is_idle() && now >= next {
                    self.sdo.begin(SdoJob::Read(object::STATUSWORD));
                }
            }
            Stage::Verify => {
                if self.sdo.is_idle()
                    && let Some(job) = self.adoption.job(now)
                {
                    self.sdo.begin(job);
                }
            }
            Stage::Rejoin { since, tries } => {
                if self.age(now, since) >= START_TIMEOUT.0 {
                    if tries < START_TRIES {
                        self.rejoin(now, tries + 1);
                    } else {
                        self.unowned(now, Trouble::NotOperational, 0);
                    }
                }
            }
            Stage::Reset { since } => {
                if self.age(now, since) >= BOOT_UP_TIMEOUT.0 {
                    self.listen(now, Some(Trouble::NoBootUp));
                }
            }
            Stage::Configure { step, .. } => {
                if self.sdo.is_idle() {
                    match self.steps.get(step) {
                        Some(step) => self.sdo.begin(step.job),
                        None => self.start(now, 1),
                    }
                }
            }
            Stage::Start { since, tries } => {
                if self.age(now, since) >= START_TIMEOUT.0 {
                    if tries < START_TRIES {
                        self.start(now, tries + 1);
                    } else {
                        self.stage = Stage::Refused { code: Trouble::NotOperational.code(), object: 0 };
                    }
                }
            }
            Stage::Operational { farewell } => self.supervise(cycle, farewell),
            Stage::Gone(trouble) => {
                if cycle.wish == DriveWish::Disabled {
                    self.listen(now, Some(trouble));
                }
            }
            Stage::Refused { .. } => {}
        }
    }

    fn start(&mut self, now: Nanos, tries: u8) {
        self.nmt = Some(NmtCommand::Start);
        self.stage = Stage::Start { since: now, tries };
    }

    fn supervise(&mut self, cycle: Cycle, farewell: Option<Nanos>) {
        let now = cycle.now;
        if self.age(now, self.heartbeat_at) >= HEARTBEAT_LOST.0 {
            // A silent drive may still listen: it keeps its setpoints until the wish is disabled.
            self.power.note(Trouble::HeartbeatLost);
            if cycle.wish == DriveWish::Disabled && self.power.aim() == Aim::Measured {
                let since = farewell.unwrap_or(now);
                self.stage = Stage::Operational { farewell: Some(since) };
                if self.age(now, since) >= FAREWELL.0 {
                    self.heard = false;
                    self.listen(now, Some(Trouble::HeartbeatLost));
                }
            }
        } else {
            self.ask_error();
        }
    }

    /// Asks a drive in fault for its error code, once: its emergency message was lost, or came before we listened.
    pub(super) fn ask_error(&mut self) -> bool {
        let due = self.in_fault() && self.emcy == 0 && !self.asked_error && self.sdo.is_idle();
        if due {
            self.asked_error = true;
            self.sdo.begin(SdoJob::Read(object::ERROR_CODE));
        }
        due
    }

    /// What an answer means for the stage.
    fn settle(&mut self, cycle: Cycle, job: SdoJob, outcome: SdoOutcome) {
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
        match self.stage {
            Stage::Listen { .. } | Stage::Unowned { .. } | Stage::Held { .. } => {
                self.settle_look(cycle, job, outcome);
            }
            Stage::Verify => self.settle_verify(cycle.now, job, outcome),
            Stage::Configure { step, since } => self.settle_step(cycle.now, outcome, (step, since)),
            Stage::Reset { .. }
            | Stage::Start { .. }
            | Stage::Rejoin { .. }
            | Stage::Operational { .. }
            | Stage::Gone(_)
            | Stage::Refused { .. } => {}
        }
    }

    fn settle_step(&mut self, now: Nanos, outcome: SdoOutcome, at: (usize, Nanos)) {
        let (index, since) = at;
        let Some(step) = self.steps.get(index).copied() else { return };
        match outcome {
            SdoOutcome::Written => self.next_step(now, index),
            SdoOutcome::Aborted(ABORT_NO_OBJECT | ABORT_NO_SUBINDEX) if step.optional => {
                self.next_step(now, index);
            }
            SdoOutcome::Aborted(code) => self.refuse(code, step.job),
            SdoOutcome::TimedOut => self.refuse(ABORT_TIMEOUT, step.job),
            SdoOutcome::Value(value) => match self.judge(now, step, since, value) {
                Ok(true) => self.next_step(now, index),
                Ok(false) => {}
                Err(trouble) => self.refuse(trouble.code(), step.job),
            },
        }
    }

    fn next_step(&mut self, now: Nanos, index: usize) {
        self.stage = Stage::Configure { step: index + 1, since: now };
    }

    /// Whether the value lets the plan go on; false asks again, or the stage has changed.
    fn judge(&mut self, now: Nanos, step: Step, since: Nanos, value: SdoValue) -> Result<bool, Trouble> {
        let Some(number) = value.as_unsigned(step.width) else { return Err(Trouble::WrongWidth) };
        match step.check {
            Check::Present => Ok(true),
            Check::Profile402 if number & 0xFFFF == u32::from(object::PROFILE_402) => Ok(true),
            Check::Profile402 => Err(Trouble::NotCia402),
            Check::OffersCsp if number & object::SUPPORTS_CSP != 0 => Ok(true),
            Check::OffersCsp => Err(Trouble::NoCsp),
            Check::NotEnergised => {
                self.status = (number & 0xFFFF) as u16;
                if self.status & STATUS_ENERGISED == 0 {
                    return Ok(true);
                }
                self.stage = Stage::Unowned { next: now, trouble: Trouble::Foreign, object: 0 };
                Ok(false)
            }
            Check::BecomesCsp if number == u32::from(object::MODE_CSP.cast_unsigned()) => Ok(true),
            Check::BecomesCsp if self.age(now, since) < self.patience.step.0 => Ok(false),
            Check::BecomesCsp => Err(Trouble::ModeNotTaken),
            Check::Position => {
                self.position = Some(number.cast_signed());
                Ok(true)
            }
            Check::Equals { value, mask } => {
                if number & mask == value & mask {
                    Ok(true)
                } else {
                    Err(Trouble::Foreign)
                }
            }
        }
    }
}
