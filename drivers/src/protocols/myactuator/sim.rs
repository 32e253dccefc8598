//! One simulated RMD motor: frames and time in, frames out.
//!
//! No I/O and no clock: the same frames at the same times give the same answers, bit by bit. The gains of commands in motion
//! mode act as in the other motors; in position mode its own loops follow. What is simple: of the commands there are those
//! that [`super::frames`] names, every other one is echoed; a stall of communication engages the brake's flag and cuts the
//! output, and a command afterwards does not restore it. An error that does not last ends after half a second, and what was
//! followed before is followed again, as section 8.1 has it.
use super::frames::{Reply, Request, Status, angle_of, rad_of};
use crate::codec::mit::{MitCommand, MitRanges, MitState};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::controller::Controller;
use crate::sim::impedance::spring_nm;
use crate::sim::mechanics::Mechanics;
use crate::sim::settings::SimulatedJoint;
use crate::sim::{Disturbance, LoopParameters, ModelParameters, PlantParameters, PlantedObject, ServoModel};
use taustream_arm::{MyActuator, MyActuatorMode, WireRanges};

/// Its own keys of the section `[simulator]`.
pub(super) const KEYS: [&str; 2] = ["rmd_model", "rmd_brake_released"];

/// What the firmware spans in motion mode (section 5.1), for motors whose settings state no ranges.
const FIRMWARE: WireRanges = WireRanges { position_rad: 12.5, velocity_rad_s: 45.0, torque_nm: 24.0 };
/// Error of an over-current, for faults that name none.
const OVER_CURRENT: u16 = 0x0010;
/// Errors that stay until a restart (section 8.2).
const LASTING: u16 = 0x0002 | 0x0010 | 0x0080;
/// How long the other errors take.
const RECOVERY_S: f64 = 0.5;
/// Temperatures of a motor that is well, and of one that is hot.
const WARM_CELSIUS: [i8; 2] = [35, 105];
/// Time that a restart takes.
const RESTART_S: f64 = 0.1;
/// How often the status is sent while there is an error.
const REPORT_S: f64 = 0.1;
/// Least time in which a command in position mode is carried out.
const POSITION_PERIOD_S: f64 = 1e-3;

/// What a simulated motor is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorParameters {
    /// Its number, 1 to 32.
    pub node_id: u8,
    /// Its model.
    pub model: [u8; 7],
    /// Motor direction against link direction, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the motor says 0.
    pub zero_offset_rad: f64,
    /// Link angle at power-up.
    pub start_rad: f64,
    /// Mechanics.
    pub plant: PlantParameters,
    /// Control in position mode.
    pub loops: LoopParameters,
    /// What its firmware spans in motion mode.
    pub ranges: WireRanges,
    /// Its brake is released at power-up.
    pub is_released: bool,
    /// Time from power-up to the first answer.
    pub boot_s: f64,
    /// Step of the simulated mechanics, 10,000 to 1,000,000 ns.
    pub step_ns: u64,
}

/// A motor as it is sold: the model that the settings state, no watchdog, the brake engaged.
pub(super) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let settings = servo.protocol.get::<MyActuator>();
    let (gains, ranges) = match settings.map(|settings| settings.mode) {
        Some(MyActuatorMode::Motion(gains, ranges)) => (Some(gains), ranges),
        Some(MyActuatorMode::Position) | None => (None, FIRMWARE),
    };
    let stated = settings.map_or([0; 7], |settings| settings.model);
    let model = joint.text("rmd_model").map_or(stated, |text| {
        let mut model = [0; 7];
        model.iter_mut().zip(text.bytes()).for_each(|(slot, byte)| *slot = byte);
        model
    });
    Box::new(MotorParameters {
        node_id: servo.node_id,
        model,
        sign: servo.sign,
        zero_offset_rad: servo.zero_offset_rad,
        start_rad: joint.start_rad(),
        plant: joint.plant(joint.load_for(ranges.torque_nm, gains)),
        loops: joint.loops(),
        ranges,
        is_released: joint.flag("rmd_brake_released", false),
        boot_s: joint.boot_s(),
        step_ns: joint.step_ns(),
    })
}

/// How a motor that is energised is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Follows {
    /// Nothing since its output was cut.
    Nothing,
    /// Commands in motion mode.
    Motion(MitCommand),
    /// Positions, at most this fast.
    Position { speed_rad_s: f64 },
}

/// A simulated motor.
#[derive(Clone, Debug)]
pub struct Motor {
    parameters: MotorParameters,
    mechanics: Mechanics,
    controller: Controller,
    follows: Follows,
    is_released: bool,
    errors: u16,
    watchdog_ms: u32,
    reports_errors: bool,
    locked: bool,
    torque_nm: f64,
    /// Motor angle that counts as zero.
    zero_shift_rad: f64,
    /// The zero after the next restart.
    next_shift_rad: f64,
    now: Nanos,
    /// When it answers from.
    starts: Option<Nanos>,
    fed: Nanos,
    reported: Nanos,
    failed: Nanos,
    warm: bool,
}

impl Motor {
    /// A motor that powers up at the first call of `advance`.
    #[must_use]
    pub fn new(parameters: MotorParameters) -> Self {
        Self {
            mechanics: Mechanics::new(parameters.plant, parameters.start_rad, parameters.step_ns),
            controller: Controller::new(parameters.loops),
            follows: Follows::Nothing,
            is_released: parameters.is_released,
            errors: 0,
            watchdog_ms: 0,
            reports_errors: false,
            locked: false,
            torque_nm: 0.0,
            zero_shift_rad: 0.0,
            next_shift_rad: 0.0,
            now: Nanos(0),
            starts: None,
            fed: Nanos(0),
            reported: Nanos(0),
            failed: Nanos(0),
            warm: false,
            parameters,
        }
    }

    /// The watchdog that it holds.
    #[must_use]
    pub const fn watchdog_ms(&self) -> u32 {
        self.watchdog_ms
    }

    fn receives(&self) -> bool {
        self.starts.is_some_and(|starts| self.now >= starts)
    }

    fn carry_out(&mut self, request: Request) -> Option<Reply> {
        self.fed = self.now;
        Some(match request {
            Request::Status => Reply::Status(self.status()),
            Request::Angle => Reply::Angle(angle_of(self.motor_rad(self.mechanics.ahead_s(self.now)))),
            Request::Model => Reply::Model(self.parameters.model),
            Request::Shutdown => {
                self.cut();
                Reply::Other(0x80)
            }
            Request::Release => {
                if self.errors == 0 {
                    self.is_released = true;
                }
                Reply::Other(0x77)
            }
            Request::Lock => {
                self.cut();
                self.is_released = false;
                Reply::Other(0x78)
            }
            Request::Reset => {
                self.restart(RESTART_S);
                return None;
            }
            Request::SetZero => {
                self.next_shift_rad = self.zero_shift_rad + self.motor_rad(0.0);
                Reply::Other(0x64)
            }
            Request::Watchdog(ms) => {
                if !self.locked {
                    self.watchdog_ms = ms;
                }
                Reply::Watchdog(self.watchdog_ms)
            }
            Request::ReportErrors(on) => {
                self.reports_errors = on;
                Reply::Other(0x20)
            }
            Request::Position { angle, speed } => self.position(rad_of(angle), f64::from(speed).to_radians()),
            Request::Motion(bytes) => self.motion(bytes),
            Request::Other(command) => Reply::Other(command),
        })
    }

    /// Restarts; it answers again after `pause_s`.
    fn restart(&mut self, pause_s: f64) {
        self.cut();
        (self.errors, self.is_released) = (0, self.parameters.is_released);
        self.zero_shift_rad = self.next_shift_rad;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 60 s")]
        let pause_ns = (pause_s * 1e9) as u64;
        self.starts = Some(Nanos(self.now.0.saturating_add(pause_ns)));
    }

    /// Ends errors that do not last.
    fn recover(&mut self, now: Nanos) {
        if self.errors == 0 || now.since_s(self.failed) < RECOVERY_S {
            return;
        }
        self.errors &= LASTING;
        if self.errors == 0 && self.follows != Follows::Nothing {
            self.mechanics.plant.energise(true);
            let at_rad = self.mechanics.read_rad(0.0);
            self.controller.energise(at_rad);
        }
    }

    /// No output any more.
    fn cut(&mut self) {
        self.follows = Follows::Nothing;
        self.torque_nm = 0.0;
        self.controller.release();
        self.mechanics.plant.energise(false);
    }

    fn energise(&mut self, follows: Follows) {
        if !self.is_released || self.errors != 0 {
            return;
        }
        if !ServoModel::is_enabled(self) {
            self.mechanics.plant.energise(true);
            let at_rad = self.mechanics.read_rad(0.0);
            self.controller.energise(at_rad);
        }
        self.follows = follows;
    }

    fn position(&mut self, motor_rad: f64, speed_rad_s: f64) -> Reply {
        self.energise(Follows::Position { speed_rad_s });
        if matches!(self.follows, Follows::Position { .. }) {
            let to_rad =
                (motor_rad + self.zero_shift_rad) * self.parameters.sign + self.parameters.zero_offset_rad;
            let time_s = (to_rad - self.controller.reference_rad()).abs() / speed_rad_s.max(1e-3);
            self.controller.set_target(self.now, to_rad, time_s.max(POSITION_PERIOD_S));
        }
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let [speed, degrees] =
            [self.speed_rad_s(), self.motor_rad(0.0)].map(|value| value.to_degrees().round() as i16);
        Reply::Position { speed, degrees }
    }

    fn motion(&mut self, bytes: [u8; 8]) -> Reply {
        self.energise(Follows::Motion(MitCommand::decode(bytes, &self.spans())));
        let state = MitState {
            position_rad: self.motor_rad(self.mechanics.ahead_s(self.now)),
            velocity_rad_s: self.speed_rad_s(),
            torque_nm: self.torque_nm * self.parameters.sign,
        };
        Reply::Motion(state.encode(&self.spans()))
    }

    fn status(&self) -> Status {
        let [cool, hot] = WARM_CELSIUS;
        let celsius = if self.warm { hot } else { cool };
        Status {
            winding_celsius: celsius,
            stage_celsius: celsius,
            is_released: self.is_released,
            decivolts: 480,
            errors: self.errors,
        }
    }

    /// Moves the mechanics up to the last whole step before `now`.
    fn move_on(&mut self, now: Nanos) {
        let dt_s = self.mechanics.step_s();
        for at in self.mechanics.due(now) {
            let read = (self.mechanics.read_rad(0.0), self.mechanics.plant.velocity_rad_s);
            self.torque_nm = match self.follows {
                _ if self.errors != 0 => 0.0,
                Follows::Nothing => 0.0,
                Follows::Motion(command) => self.spring_nm(&command, dt_s),
                Follows::Position { speed_rad_s } => {
                    let plant = self.parameters.plant;
                    let speed_rad_s_max = plant.speed_rad_s_max.min(speed_rad_s);
                    self.controller.step(at, dt_s, read, &PlantParameters { speed_rad_s_max, ..plant })
                }
            };
            self.mechanics.plant.step(self.torque_nm, dt_s);
        }
    }

    /// The torque at the link of the spring and damper that a command makes of the motor.
    fn spring_nm(&self, command: &MitCommand, dt_s: f64) -> f64 {
        let at = [self.motor_rad(0.0), self.speed_rad_s()];
        let wanted_nm = spring_nm(command, at, self.parameters.plant.inertia_kg_m2, dt_s);
        let reach_nm = self.parameters.ranges.torque_nm;
        self.parameters.sign * wanted_nm.clamp(-reach_nm, reach_nm)
    }

    /// Angle of the output shaft as the motor reads it.
    fn motor_rad(&self, ahead_s: f64) -> f64 {
        let link_rad = self.mechanics.read_rad(ahead_s);
        (link_rad - self.parameters.zero_offset_rad) * self.parameters.sign - self.zero_shift_rad
    }

    fn speed_rad_s(&self) -> f64 {
        self.mechanics.plant.velocity_rad_s * self.parameters.sign
    }

    fn spans(&self) -> MitRanges {
        let WireRanges { position_rad, velocity_rad_s, torque_nm } = self.parameters.ranges;
        MitRanges::symmetric(position_rad, velocity_rad_s, torque_nm)
    }
}

impl ModelParameters for MotorParameters {
    fn build(&self, _: &[PlantedObject]) -> Box<dyn ServoModel> {
        Box::new(Motor::new(*self))
    }
    fn plant_mut(&mut self) -> &mut PlantParameters {
        &mut self.plant
    }
    fn start_rad_mut(&mut self) -> &mut f64 {
        &mut self.start_rad
    }
}

impl ServoModel for Motor {
    fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        self.now = now;
        if self.starts.is_none() {
            self.restart(self.parameters.boot_s);
        }
        self.move_on(now);
        self.recover(now);
        let silent_s = now.since_s(self.fed);
        if self.watchdog_ms > 0 && self.is_released && silent_s > f64::from(self.watchdog_ms) * 1e-3 {
            self.cut();
            self.is_released = false;
        }
        let due = self.errors != 0 && self.reports_errors && now.since_s(self.reported) >= REPORT_S;
        if due && self.receives() {
            self.reported = now;
            out.push(Reply::Status(self.status()).encode(self.parameters.node_id));
        }
    }

    fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if now > self.now || self.starts.is_none() {
            self.advance(now, out);
        }
        let request = Request::decode(frame, self.parameters.node_id).filter(|_| self.receives());
        if let Some(reply) = request.and_then(|request| self.carry_out(request)) {
            out.push(reply.encode(self.parameters.node_id));
        }
    }

    fn disturb(&mut self, disturbance: Disturbance, _: &mut Vec<CanFrame>) {
        match disturbance {
            Disturbance::Fault(code) => {
                let named = super::frames::ERRORS.iter().any(|(bit, _)| *bit == code);
                self.errors |= if named { code } else { OVER_CURRENT };
                self.failed = self.now;
                self.mechanics.plant.energise(false);
            }
            Disturbance::Jammed(jammed) => self.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.mechanics.encoder_shift_rad = shift_rad,
            Disturbance::Warning(warm) => self.warm = warm,
            Disturbance::RefuseWrites(code) => self.locked = code != 0,
            // It has no such inputs.
            Disturbance::Inputs(_) => {}
            Disturbance::Restart => self.restart(self.parameters.boot_s),
        }
    }

    fn is_enabled(&self) -> bool {
        self.follows != Follows::Nothing && self.errors == 0
    }
    fn position_rad(&self) -> f64 {
        self.mechanics.plant.position_rad
    }
    fn velocity_rad_s(&self) -> f64 {
        self.mechanics.plant.velocity_rad_s
    }
    fn node_id(&self) -> u8 {
        self.parameters.node_id
    }
    fn describe(&self) -> String {
        let brake = if self.is_released { "released" } else { "engaged" };
        format!("errors=0x{:04X} brake={brake} output={}", self.errors, u8::from(self.is_enabled()))
    }
    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}
