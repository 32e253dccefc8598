//! One joint of a simulated Piper: frames and time in, frames out.
//!
//! The arm has one controller for six joints; here each joint serves its part of the frames, and what the controller says of
//! several joints at once is taken from [`SharedArm`]: an even joint sends the angles of its pair, joint 1 the arm's status
//! and firmware. No I/O and no clock: the same frames at the same times give the same answers, bit by bit.
//!
//! Where the maker's text leaves it open, the arm does the worst: a target that came before it took targets is remembered,
//! and a joint whose driver has a fault loses its torque. Nothing here has been compared with an arm.
use super::frames::{
    ALL, CONTROL_CAN, Command, DRIVER_ENABLED, DRIVER_FAULTS, Driver, FOLLOW_FAST, JOINTS, Limits,
    MOVE_JOINTS, Message, Status, from_millidegrees, millidegrees,
};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::controller::{Controller, LoopParameters};
use crate::sim::disturbance::Disturbance;
use crate::sim::mechanics::Mechanics;
use crate::sim::plant::PlantParameters;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, AtomicU8, Ordering};

/// Period of angles, speeds and status: some 200 times a second.
const FAST_S: f64 = 0.005;
/// Period of the drivers' reports: some 40 times a second.
const SLOW_S: f64 = 0.025;
/// Most time between two targets over which the controller interpolates.
const INTERPOLATE_S: f64 = 0.02;
/// Driver fault of a fault that names none.
const DRIVER_ERROR: u8 = 0x20;
/// Arm status when a joint is in fault.
const STATUS_JOINT: u8 = 9;
/// Arm status in an emergency stop.
const STATUS_STOP: u8 = 1;
/// Low byte of the identifier of joint settings, as it is acknowledged.
const JOINT_SETTING: u8 = 0x75;
/// Temperatures of a driver that is well, and of one that warns.
const WARM_CELSIUS: [i8; 2] = [35, 80];

/// What the joints of one arm know of each other.
#[derive(Debug, Default)]
pub struct SharedArm {
    angles_mdeg: [AtomicI32; JOINTS],
    faults: [AtomicU8; JOINTS],
}

/// What a simulated joint is made of.
#[derive(Clone, Debug)]
pub struct PiperParameters {
    /// Number of the joint, 1 to 6.
    pub number: u8,
    /// The arm's direction against the link's, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the arm says 0.
    pub zero_offset_rad: f64,
    /// Link angle at power-up.
    pub start_rad: f64,
    /// Mechanics.
    pub plant: PlantParameters,
    /// Control.
    pub loops: LoopParameters,
    /// The joint's own limits.
    pub limits: Limits,
    /// Name of the arm's firmware.
    pub firmware: [u8; 8],
    /// Time from power-up to the first frame.
    pub boot_s: f64,
    /// Step of the simulated mechanics, 10,000 to 1,000,000 ns.
    pub step_ns: u64,
    /// In common with the other joints.
    pub arm: Arc<SharedArm>,
}

/// A simulated joint.
#[derive(Clone, Debug)]
pub struct PiperJoint {
    parameters: PiperParameters,
    mechanics: Mechanics,
    controller: Controller,
    is_enabled: bool,
    faults: u8,
    stopped: bool,
    /// Control mode, move mode, speed in percent, how targets are followed.
    mode: [u8; 4],
    target_mdeg: Option<i32>,
    target_at: Nanos,
    /// Angle that counts as zero, after "set zero".
    shift_rad: f64,
    now: Nanos,
    powered: Option<Nanos>,
    fast_at: Nanos,
    slow_at: Nanos,
    warm: bool,
    locked: bool,
}

impl PiperJoint {
    /// A joint that powers up at the first call of [`Self::advance`].
    #[must_use]
    pub fn new(parameters: PiperParameters) -> Self {
        Self {
            mechanics: Mechanics::new(parameters.plant, parameters.start_rad, parameters.step_ns),
            controller: Controller::new(parameters.loops),
            is_enabled: false,
            faults: 0,
            stopped: false,
            mode: [0; 4],
            target_mdeg: None,
            target_at: Nanos(0),
            shift_rad: 0.0,
            now: Nanos(0),
            powered: None,
            fast_at: Nanos(0),
            slow_at: Nanos(0),
            warm: false,
            locked: false,
            parameters,
        }
    }

    /// Lets time pass up to `now`, and pushes what the joint's part of the controller sends by itself.
    pub fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        self.now = now;
        self.powered.get_or_insert(now);
        self.move_on(now);
        self.share();
        if !self.is_up() {
            return;
        }
        if now.since_s(self.fast_at) >= FAST_S {
            self.fast_at = now;
            self.send_fast(out);
        }
        if now.since_s(self.slow_at) >= SLOW_S {
            self.slow_at = now;
            out.push(Message::Driver(self.parameters.number, self.driver()).encode());
        }
    }

    /// Takes a frame from the bus and pushes the answer. Frames for others, and malformed ones, change nothing.
    pub fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if now > self.now || self.powered.is_none() {
            self.advance(now, out);
        }
        // A classic controller would not even acknowledge an FD frame.
        if !self.is_up() || frame.is_fd() {
            return;
        }
        let Some(command) = Command::decode(frame) else { return };
        let number = self.parameters.number;
        let mine = |joint: u8| joint == number || joint == ALL;
        match command {
            Command::Enable(joint) if mine(joint) => self.energise(),
            Command::Disable(joint) if mine(joint) => self.release(),
            Command::Mode { control, movement, speed_percent, follow } => {
                self.mode = [control, movement, speed_percent, follow];
                self.follow();
            }
            Command::Targets(pair, [odd, even]) if pair == (number - 1) / 2 => {
                self.target_mdeg = Some(if number % 2 == 1 { odd } else { even });
                self.follow();
                self.target_at = now;
            }
            Command::AskLimits(joint) if mine(joint) => {
                out.push(Message::Limits(self.parameters.limits).encode());
            }
            Command::SetZero(joint) if mine(joint) => {
                let able = !self.is_enabled && !self.locked;
                if able {
                    self.shift_rad += self.arm_rad(0.0);
                }
                out.push(Message::Acknowledge(JOINT_SETTING, able).encode());
            }
            Command::ClearErrors(joint) if mine(joint) => {
                self.faults = 0;
                out.push(Message::Acknowledge(JOINT_SETTING, false).encode());
            }
            Command::Stop => {
                self.stopped = true;
                self.target_mdeg = None;
            }
            Command::Resume => {
                self.release();
                (self.stopped, self.faults, self.target_mdeg) = (false, 0, None);
            }
            Command::AskFirmware if number == 1 => {
                out.push(Message::Firmware(*b"H-V1.2-1").encode());
                out.push(Message::Firmware(self.parameters.firmware).encode());
            }
            Command::Enable(_)
            | Command::Disable(_)
            | Command::Targets(..)
            | Command::AskLimits(_)
            | Command::SetZero(_)
            | Command::ClearErrors(_)
            | Command::AskFirmware
            | Command::Other => {}
        }
    }

    /// Puts a fault into the joint.
    pub fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Fault(code) => {
                let [_, low] = code.to_be_bytes();
                let named = low & DRIVER_FAULTS;
                self.faults |= if named == 0 { DRIVER_ERROR } else { named };
                self.release();
            }
            Disturbance::Jammed(jammed) => self.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.mechanics.encoder_shift_rad = shift_rad,
            Disturbance::Warning(warm) => self.warm = warm,
            Disturbance::RefuseWrites(code) => self.locked = code != 0,
            // It has no such inputs.
            Disturbance::Inputs(_) => {}
            Disturbance::Restart => {
                self.release();
                (self.faults, self.stopped, self.target_mdeg, self.mode) = (0, false, None, [0; 4]);
                self.powered = Some(self.now);
            }
        }
    }

    /// Number of the joint, 1 to 6.
    #[must_use]
    pub const fn node_id(&self) -> u8 {
        self.parameters.number
    }
    /// It carries torque and takes targets.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        self.is_enabled && self.takes_targets()
    }
    /// Status of its driver.
    #[must_use]
    pub const fn driver_status(&self) -> u8 {
        self.faults | if self.is_enabled { DRIVER_ENABLED } else { 0 }
    }
    /// True angle of the link, which no encoder fault can bend.
    #[must_use]
    pub const fn position_rad(&self) -> f64 {
        self.mechanics.plant.position_rad
    }
    /// True angular velocity of the link.
    #[must_use]
    pub const fn velocity_rad_s(&self) -> f64 {
        self.mechanics.plant.velocity_rad_s
    }

    fn is_up(&self) -> bool {
        self.powered.is_some_and(|powered| self.now.since_s(powered) >= self.parameters.boot_s)
    }

    fn takes_targets(&self) -> bool {
        let [control, movement, ..] = self.mode;
        (control, movement) == (CONTROL_CAN, MOVE_JOINTS) && !self.stopped
    }

    fn energise(&mut self) {
        if self.faults == 0 && !self.stopped && !self.is_enabled {
            self.is_enabled = true;
            self.mechanics.plant.energise(true);
            let at_rad = self.mechanics.read_rad(0.0);
            self.controller.energise(at_rad);
            self.follow();
        }
    }

    fn release(&mut self) {
        self.is_enabled = false;
        self.controller.release();
        self.mechanics.plant.energise(false);
    }

    /// Goes to the newest target, in the time that targets take to come.
    fn follow(&mut self) {
        let Some(target_mdeg) = self.target_mdeg.filter(|_| self.is_enabled()) else { return };
        let to_rad = self.link_rad(from_millidegrees(target_mdeg));
        let period_s = self.now.since_s(self.target_at).clamp(FAST_S, INTERPOLATE_S);
        let [.., percent, follow] = self.mode;
        // Its own profile takes the time that the greatest speed leaves it.
        let speed_rad_s = self.parameters.limits.speed_rad_s() * f64::from(percent.min(100)) * 0.01;
        let away_rad = (to_rad - self.controller.reference_rad()).abs();
        let own_s = if follow == FOLLOW_FAST { 0.0 } else { away_rad / speed_rad_s.max(1e-3) };
        self.controller.set_target(self.now, to_rad, period_s.max(own_s));
    }

    /// Moves the mechanics up to the last whole step before `now`.
    fn move_on(&mut self, now: Nanos) {
        let dt_s = self.mechanics.step_s();
        let plant = self.parameters.plant;
        for at in self.mechanics.due(now) {
            let read = (self.mechanics.read_rad(0.0), self.mechanics.plant.velocity_rad_s);
            let torque_nm = if self.is_enabled { self.controller.step(at, dt_s, read, &plant) } else { 0.0 };
            self.mechanics.plant.step(torque_nm, dt_s);
        }
    }

    /// Angle as the arm counts it.
    fn arm_rad(&self, ahead_s: f64) -> f64 {
        let link_rad = self.mechanics.read_rad(ahead_s);
        (link_rad - self.parameters.zero_offset_rad) * self.parameters.sign - self.shift_rad
    }

    fn link_rad(&self, arm_rad: f64) -> f64 {
        (arm_rad + self.shift_rad) * self.parameters.sign + self.parameters.zero_offset_rad
    }

    fn place(&self) -> usize {
        usize::from(self.parameters.number.clamp(1, 6)) - 1
    }

    /// Lets the other joints know.
    fn share(&self) {
        let angle = millidegrees(self.arm_rad(self.mechanics.ahead_s(self.now))).unwrap_or(0);
        let arm = &self.parameters.arm;
        if let (Some(own_angle), Some(own_faults)) =
            (arm.angles_mdeg.get(self.place()), arm.faults.get(self.place()))
        {
            own_angle.store(angle, Ordering::Relaxed);
            own_faults.store(self.faults, Ordering::Relaxed);
        }
    }

    fn send_fast(&self, out: &mut Vec<CanFrame>) {
        let (number, arm) = (self.parameters.number, &self.parameters.arm);
        if number == 1 {
            out.push(Message::Status(self.status()).encode());
        }
        let angle =
            |place: usize| arm.angles_mdeg.get(place).map_or(0, |angle| angle.load(Ordering::Relaxed));
        if number % 2 == 0 {
            let pair = (number - 1) / 2;
            out.push(Message::Angles(pair, [angle(self.place() - 1), angle(self.place())]).encode());
        }
        let speed_mrad_s = self.mechanics.plant.velocity_rad_s * self.parameters.sign * 1e3;
        #[expect(clippy::cast_possible_truncation, reason = "saturation is fine")]
        let (speed, current) = (speed_mrad_s as i16, (self.controller.torque_nm() * 100.0) as i16);
        out.push(Message::Speed(number, speed, current).encode());
    }

    fn status(&self) -> Status {
        let [control, movement, ..] = self.mode;
        let faulty = self.parameters.arm.faults.iter().any(|faults| faults.load(Ordering::Relaxed) != 0);
        let arm = if self.stopped {
            STATUS_STOP
        } else if faulty {
            STATUS_JOINT
        } else {
            0
        };
        Status { control, arm, movement, ..Status::default() }
    }

    const fn driver(&self) -> Driver {
        let [cool, hot] = WARM_CELSIUS;
        let celsius = if self.warm { hot } else { cool };
        Driver {
            supply_decivolts: 240,
            stage_celsius: celsius as i16,
            motor_celsius: celsius,
            status: self.driver_status(),
            current_milliamperes: 100,
        }
    }
}
