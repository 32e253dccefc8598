//! One Piper from silence to following targets: the arm's controller as the master sees it.
//!
//! The arm sends its state by itself. First it is only received: an arm that is energised before this master has looked at
//! it is left as it is. Then its limits and its firmware are asked and compared, and once more before every energising.
//! While it follows, a cycle has three frames: targets of three pairs of joints. All times are on the driver's stall-free
//! clock, which does not advance while the master itself is stalled.
mod ask;
mod power;

use super::fault::{PiperFault, arm_code, driver_code};
use super::frames::{
    CONTROL_CAN, Command, DRIVER_ENABLED, DRIVER_FAULTS, Driver, JOINTS, Limits, MOVE_JOINTS, Message, Status,
};
use crate::bring_up::timing::{BringUpCycle, Timeouts};
use crate::servo::{DriveState, DriveTarget, Nanos};

/// How long the bus is received before anything is sent: a foreign master shows itself in this time.
const OBSERVE_MIN: Nanos = Nanos(100_000_000);
/// Drivers report some 40 times a second; without any of its reports for so long the arm is gone.
const NO_REPLY: Nanos = Nanos(350_000_000);
/// A question, or a command that was not confirmed, is repeated after this.
const REPEAT: Nanos = Nanos(50_000_000);
/// Characters of the firmware's frames that are kept.
const FIRMWARE_ROOM: usize = 64;

/// State of the bring-up.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Receiving, sending nothing.
    Observe { since: Nanos },
    /// Found energised; watched, left alone.
    Unowned,
    /// At this question: a joint's limits, then the firmware.
    Ask { question: usize, since: Nanos, enabling: bool },
    /// Compared, not energised.
    Ready,
    /// The joints are being energised.
    Enable { since: Nanos },
    /// The arm is commanded to take joint targets.
    Take { since: Nanos },
    /// Energised; following.
    On,
    /// The joints are being de-energised.
    Disable { since: Nanos },
    /// Without torque, or not as it was left; waits for the drive target to be disabled.
    Gone,
    /// What a joint states does not fit the settings.
    Refused { joint: usize, fault: PiperFault, object: u32, numbers: [f64; 2] },
}

/// What the settings say of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmPlan {
    /// Name of the firmware.
    pub firmware: [u8; 8],
    /// Largest speed of its own profile, percent.
    pub speed_percent: u8,
    /// How targets are followed: [`super::frames::FOLLOW_FAST`] or [`super::frames::FOLLOW_SMOOTH`].
    pub follow: u8,
    /// Range and greatest speed of each joint, as the arm counts angles.
    pub joints: [([f64; 2], f64); JOINTS],
}

/// What was received of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct JointImage {
    angle: Option<(i32, Nanos)>,
    driver: Option<(Driver, Nanos)>,
    speed_mrad_s: Option<i16>,
}

impl JointImage {
    fn is_enabled(&self) -> bool {
        self.driver.is_some_and(|(driver, _)| driver.status & DRIVER_ENABLED != 0)
    }
    fn faults(&self) -> u8 {
        self.driver.map_or(0, |(driver, _)| driver.status & DRIVER_FAULTS)
    }
}

/// Frames of one cycle: the targets of three pairs, and one more.
pub type CycleFrames = [Option<Command>; 4];

/// The master's image of the arm.
#[derive(Clone, Debug)]
pub struct Controller {
    plan: ArmPlan,
    timeouts: Timeouts,
    near_mdeg: i32,
    stage: Stage,
    last_target: DriveTarget,
    fault: Option<PiperFault>,
    status: Option<(Status, Nanos)>,
    joints: [JointImage; JOINTS],
    answered: Option<Limits>,
    firmware: ([u8; FIRMWARE_ROOM], usize),
    /// When to repeat what was sent last.
    next: Nanos,
    clearing: Option<Nanos>,
    set_zero: Option<u8>,
    sent_mdeg: [i32; JOINTS],
}

impl Controller {
    /// An arm of which nothing is known. Energised only when its commands are within `near_mdeg`, 0.001 degrees, of where it
    /// stands.
    #[must_use]
    pub fn new(plan: ArmPlan, timeouts: Timeouts, near_mdeg: i32) -> Self {
        Self {
            plan,
            timeouts,
            near_mdeg,
            stage: Stage::Observe { since: Nanos(0) },
            last_target: DriveTarget::TorqueOff,
            fault: None,
            status: None,
            joints: [JointImage::default(); JOINTS],
            answered: None,
            firmware: ([0; FIRMWARE_ROOM], 0),
            next: Nanos(0),
            clearing: None,
            set_zero: None,
            sent_mdeg: [0; JOINTS],
        }
    }

    /// The angle of a joint, 0.001 degrees; `None` before the first.
    #[must_use]
    pub fn angle(&self, joint: usize) -> Option<i32> {
        self.joints.get(joint)?.angle.map(|(angle, _)| angle)
    }

    /// The speed of a joint, 0.001 rad/s; `None` before the first.
    #[must_use]
    pub fn speed_mrad_s(&self, joint: usize) -> Option<i16> {
        self.joints.get(joint)?.speed_mrad_s
    }

    /// Status of a joint's driver, then the arm's status and who controls it, a byte each.
    #[must_use]
    pub fn status_word(&self, joint: usize) -> u32 {
        let driver =
            self.joints.get(joint).and_then(|joint| joint.driver).map_or(0, |(driver, _)| driver.status);
        let (arm, control) = self.status.map_or((0, 0), |(status, _)| (status.arm, status.control));
        u32::from(driver) | u32::from(arm) << 8 | u32::from(control) << 16
    }

    /// Where a joint is.
    #[must_use]
    pub fn state(&self, joint: usize) -> DriveState {
        let received = self.joints.get(joint).is_some_and(|joint| joint.angle.is_some());
        match self.stage {
            Stage::Observe { .. } if !received || self.fault == Some(PiperFault::NoAnswer) => {
                DriveState::Absent
            }
            Stage::Unowned => DriveState::EnergisedUnowned,
            Stage::Refused { joint: refused, .. } if refused == joint || refused >= JOINTS => {
                DriveState::Refused
            }
            Stage::Observe { .. } | Stage::Refused { .. } | Stage::Ask { enabling: false, .. } => {
                DriveState::Configuring
            }
            Stage::Gone => DriveState::Fault,
            _ if self.fault.is_some() || self.joint_code(joint).is_some() => DriveState::Fault,
            Stage::Ready => DriveState::Disabled,
            Stage::Ask { .. } | Stage::Enable { .. } | Stage::Take { .. } => DriveState::Enabling,
            Stage::On => DriveState::Enabled,
            Stage::Disable { .. } => DriveState::Disabling,
        }
    }

    /// The code to report of a joint, the limit that it concerns and the two numbers of it.
    #[must_use]
    pub fn error(&self, joint: usize) -> (u32, u32, [f64; 2]) {
        let plain = |code: u32| (code, 0, [0.0; 2]);
        match (self.stage, self.joint_code(joint), self.fault) {
            (Stage::Refused { joint: refused, fault, object, numbers }, ..)
                if refused == joint || refused >= JOINTS =>
            {
                (fault.code(), object, numbers)
            }
            (Stage::Unowned, ..) => plain(PiperFault::Unowned.code()),
            (_, Some(code), _) => plain(code),
            (_, None, Some(fault)) => plain(fault.code()),
            (_, None, None) => plain(0),
        }
    }

    /// What the arm says is wrong with a joint, or with itself.
    fn joint_code(&self, joint: usize) -> Option<u32> {
        let (status, _) = self.status?;
        let faults = self.joints.get(joint).map_or(0, JointImage::faults);
        let bit = |set: u8| set >> joint.min(7) & 1 != 0;
        if faults != 0 {
            Some(driver_code(faults))
        } else if bit(status.unreached) {
            Some(PiperFault::Unreached.code())
        } else if bit(status.beyond) {
            Some(PiperFault::Beyond.code())
        } else {
            (status.arm != 0).then(|| arm_code(status.arm))
        }
    }

    fn in_error(&self) -> bool {
        (0..JOINTS).any(|joint| self.joint_code(joint).is_some())
    }

    /// Takes what the arm sends. The joints whose angles came with it.
    ///
    /// Real time: arithmetic only.
    pub fn take(&mut self, now: Nanos, message: Message) -> [Option<usize>; 2] {
        match message {
            Message::Status(status) => self.status = Some((status, now)),
            Message::Angles(pair, angles) => {
                let first = usize::from(pair) * 2;
                for (joint, angle) in self.joints.iter_mut().skip(first).zip(angles) {
                    joint.angle = Some((angle, now));
                }
                return [Some(first), Some(first + 1)];
            }
            Message::Speed(number, speed, _) => {
                if let Some(joint) = self.image(number) {
                    joint.speed_mrad_s = Some(speed);
                }
            }
            Message::Driver(number, driver) => {
                if let Some(joint) = self.image(number) {
                    joint.driver = Some((driver, now));
                }
            }
            Message::Limits(limits) => self.answered = Some(limits),
            Message::Firmware(characters) => {
                let (text, used) = &mut self.firmware;
                for (slot, character) in text.iter_mut().skip(*used).zip(characters) {
                    *slot = character;
                    *used += 1;
                }
            }
            Message::Acknowledge(..) => {}
        }
        [None, None]
    }

    fn image(&mut self, number: u8) -> Option<&mut JointImage> {
        self.joints.get_mut(usize::from(number).checked_sub(1)?)
    }

    /// Clears findings, clears errors of the arm, and tries a refused arm again from the start.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self, now: Nanos) {
        match self.stage {
            Stage::Refused { .. } => self.observe(now, None),
            Stage::Ready => {
                self.fault = None;
                (self.clearing, self.next) = (self.in_error().then_some(now), now);
            }
            Stage::On => self.fault = None,
            Stage::Observe { .. }
            | Stage::Unowned
            | Stage::Ask { .. }
            | Stage::Enable { .. }
            | Stage::Take { .. }
            | Stage::Disable { .. }
            | Stage::Gone => {}
        }
    }

    /// Clears everything that is known of it, as at start.
    ///
    /// Real time: no allocation.
    pub fn start_over(&mut self, now: Nanos) {
        self.forget();
        self.observe(now, None);
    }

    /// Makes the angle where a joint stands its zero, in the next cycle; false unless the arm is compared and not energised.
    pub fn set_zero(&mut self, joint: usize) -> bool {
        let able =
            self.stage == Stage::Ready && !self.in_error() && self.last_target == DriveTarget::Disabled;
        if able {
            self.set_zero = u8::try_from(joint + 1).ok();
        }
        able
    }

    /// This cycle's frames to the arm. `targets` are 0.001 degrees, `None` for one that is no number.
    ///
    /// Real time: no allocation, bounded work.
    pub fn cycle(&mut self, cycle: BringUpCycle, targets: &[Option<i32>; JOINTS]) -> CycleFrames {
        let before = std::mem::replace(&mut self.last_target, cycle.drive_target);
        if cycle.drive_target == DriveTarget::TorqueOff && before != DriveTarget::TorqueOff {
            return self.torque_off(cycle.now);
        }
        let rises = cycle.drive_target == DriveTarget::Enabled
            && matches!(before, DriveTarget::Disabled | DriveTarget::Keep);
        let wanted = cycle.drive_target == DriveTarget::Enabled;
        match self.stage {
            Stage::Observe { since } => only(self.observing(cycle, since)),
            Stage::Unowned => only(self.unowned(cycle)),
            Stage::Ask { enabling: true, .. } | Stage::Enable { .. } | Stage::Take { .. } if !wanted => {
                self.disable(cycle.now)
            }
            Stage::Ask { question, since, enabling } => {
                only(self.asking(cycle.now, (question, since, enabling), targets))
            }
            Stage::Ready => only(self.ready(cycle.now, rises)),
            Stage::Enable { since } => self.enabling(cycle.now, since, targets),
            Stage::Take { since } => self.taking(cycle.now, since, targets),
            Stage::On => self.following(cycle, targets),
            Stage::Disable { since } => only(self.disabling(cycle.now, since)),
            Stage::Gone => only(self.gone(cycle)),
            Stage::Refused { .. } => only(None),
        }
    }

    fn go(&mut self, fault: PiperFault) {
        (self.clearing, self.set_zero) = (None, None);
        (self.fault, self.stage) = (Some(fault), Stage::Gone);
    }

    /// Back to the start, where nothing is changed before the arm has been looked at.
    fn observe(&mut self, now: Nanos, fault: Option<PiperFault>) {
        (self.fault, self.clearing, self.set_zero) = (fault, None, None);
        self.stage = Stage::Observe { since: now };
    }

    fn forget(&mut self) {
        (self.status, self.joints) = (None, [JointImage::default(); JOINTS]);
    }

    /// This command, when it is due again.
    fn again(&mut self, now: Nanos, command: Command) -> Option<Command> {
        (now >= self.next).then(|| {
            self.next = later(now, REPEAT);
            command
        })
    }

    /// The targets of all pairs, and one more frame. What is no number never becomes one: the last good angle stays.
    fn targets(&mut self, targets: &[Option<i32>; JOINTS], more: Option<Command>) -> CycleFrames {
        for (sent, target) in self.sent_mdeg.iter_mut().zip(targets) {
            *sent = target.unwrap_or(*sent);
        }
        let [a, b, c, d, e, f] = self.sent_mdeg;
        let pair = |number, targets| Some(Command::Targets(number, targets));
        [pair(0, [a, b]), pair(1, [c, d]), pair(2, [e, f]), more]
    }

    fn takes_targets(&self) -> bool {
        self.status.is_some_and(|(status, _)| (status.control, status.movement) == (CONTROL_CAN, MOVE_JOINTS))
    }
    fn any_enabled(&self) -> bool {
        self.joints.iter().any(JointImage::is_enabled)
    }
    fn all_enabled(&self) -> bool {
        self.joints.iter().all(JointImage::is_enabled)
    }
    /// All that an arm sends has come lately.
    fn is_heard(&self, now: Nanos) -> bool {
        let recent = |at: Option<Nanos>| at.is_some_and(|at| age(now, at) < NO_REPLY.0);
        recent(self.status.map(|(_, at)| at))
            && self
                .joints
                .iter()
                .all(|joint| recent(joint.angle.map(|(_, at)| at)) && recent(joint.driver.map(|(_, at)| at)))
    }
}

const fn only(command: Option<Command>) -> CycleFrames {
    [command, None, None, None]
}

const fn age(now: Nanos, then: Nanos) -> u64 {
    now.0.saturating_sub(then.0)
}

const fn later(now: Nanos, by: Nanos) -> Nanos {
    Nanos(now.0.saturating_add(by.0))
}
