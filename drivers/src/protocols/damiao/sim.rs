//! One simulated Damiao motor: frames and time in, frames out.
//!
//! No I/O and no clock: the same frames at the same times give the same answers, bit by bit. The gains of MIT commands
//! act: the motor is the spring and damper that they make of it, and gravity bends it. What is simple: of the modes there
//! are MIT and `POS_VEL`, and commands of the two others are answered without effect.
//!
//! A motor remembers its newest MIT command while it is not energised and takes it up when it is: that is the worst
//! that the manual leaves open.
use super::frames::{
    Feedback, Register, Reply, Request, STATUS_DISABLED, STATUS_ENABLED, STATUS_LOST_COMMUNICATION, Special,
    TIMEOUT_UNITS_A_MS, Wire,
};
use super::sim_registers::Registers;
use crate::codec::mit::{MitCommand, MitRanges, MitState};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::controller::Controller;
use crate::sim::impedance::spring_nm;
use crate::sim::mechanics::Mechanics;
use crate::sim::settings::SimulatedJoint;
use crate::sim::{Disturbance, LoopParameters, ModelParameters, PlantParameters, PlantedObject, ServoModel};
use taustream_arm::{Damiao, DamiaoMode};

/// Register 10: MIT commands.
const MODE_MIT: u32 = 1;
/// Register 10: `POS_VEL` commands.
const MODE_POS_VEL: u32 = 2;
/// Status of an over-current, for faults that name none.
const OVER_CURRENT: u8 = 0xA;
/// Temperatures of a motor that is well, and of one that warns.
const WARM_CELSIUS: [u8; 2] = [35, 105];
/// Least time in which a `POS_VEL` command is carried out.
const POS_VEL_PERIOD_S: f64 = 1e-3;

/// Its own keys of the section `[simulator]`.
pub(super) const KEYS: [&str; 7] = [
    "motor_position_range_rad",
    "motor_velocity_range_rad_s",
    "motor_torque_range_nm",
    "motor_mode",
    "motor_timeout_ms",
    "mode_offset_ids",
    "continuous_feedback_ms",
];

/// A motor as it is sold: its flash holds the ranges that the settings state, MIT mode, and no watchdog.
pub(super) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let damiao = servo.protocol.get::<Damiao>();
    let [position_rad, velocity_rad_s, torque_nm] =
        damiao.map_or([1.0; 3], |d| [d.ranges.position_rad, d.ranges.velocity_rad_s, d.ranges.torque_nm]);
    let gains = damiao.and_then(|damiao| match damiao.mode {
        DamiaoMode::Mit(gains) => Some(gains),
        DamiaoMode::PosVel => None,
    });
    let reach = |key, stated| joint.number(key, stated, 1e-3..=1e6);
    Box::new(MotorParameters {
        node_id: servo.node_id,
        feedback_id: damiao.map_or(0, |damiao| damiao.feedback_id),
        wire: joint.bus_kind().map_or(Wire::Classic, super::wire_of),
        sign: servo.sign,
        zero_offset_rad: servo.zero_offset_rad,
        start_rad: joint.start_rad(),
        plant: joint.plant(joint.load_for(torque_nm, gains)),
        loops: joint.loops(),
        ranges: [
            reach("motor_position_range_rad", position_rad),
            reach("motor_velocity_range_rad_s", velocity_rad_s),
            reach("motor_torque_range_nm", torque_nm),
        ],
        mode: joint.whole("motor_mode", 1, 1..=4),
        timeout_ms: joint.whole("motor_timeout_ms", 0, 0..=65_535),
        mode_offset_ids: joint.flag("mode_offset_ids", false),
        continuous_ms: joint.whole("continuous_feedback_ms", 0, 0..=10_000),
        boot_s: joint.boot_s(),
        step_ns: joint.step_ns(),
    })
}

/// What a simulated motor is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorParameters {
    /// Identifier of its commands, 1 to 15.
    pub node_id: u8,
    /// Identifier of its feedback.
    pub feedback_id: u16,
    /// Kind of the frames that it sends.
    pub wire: Wire,
    /// Motor direction against link direction, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the motor says 0.
    pub zero_offset_rad: f64,
    /// Link angle at power-up.
    pub start_rad: f64,
    /// Mechanics.
    pub plant: PlantParameters,
    /// Control in `POS_VEL`.
    pub loops: LoopParameters,
    /// Reach of position, velocity and torque in its flash.
    pub ranges: [f64; 3],
    /// Mode in its flash, 1 to 4.
    pub mode: u32,
    /// Watchdog in its flash, 0 is none.
    pub timeout_ms: u32,
    /// It takes special commands at the identifier of its mode too, as the manual allows.
    pub mode_offset_ids: bool,
    /// It also sends feedback by itself every so often; 0 is never.
    pub continuous_ms: u32,
    /// Time from power-up to the first answer.
    pub boot_s: f64,
    /// Step of the simulated mechanics, 10,000 to 1,000,000 ns.
    pub step_ns: u64,
}

/// A simulated motor.
#[derive(Clone, Debug)]
pub struct Motor {
    parameters: MotorParameters,
    registers: Registers,
    mechanics: Mechanics,
    controller: Controller,
    /// The newest MIT command, motor side.
    commanded: MitCommand,
    /// The largest speed of the newest `POS_VEL` command.
    speed_rad_s: f64,
    status: u8,
    torque_nm: f64,
    /// Motor angle that counts as zero, after "set zero".
    zero_shift_rad: f64,
    now: Nanos,
    powered: Option<Nanos>,
    /// When it was last commanded.
    fed: Nanos,
    sent: Nanos,
    warm: bool,
}

impl Motor {
    /// A motor that powers up at the first call of [`Self::advance`].
    #[must_use]
    pub fn new(parameters: MotorParameters) -> Self {
        Self {
            registers: Registers::new(&parameters),
            mechanics: Mechanics::new(parameters.plant, parameters.start_rad, parameters.step_ns),
            controller: Controller::new(parameters.loops),
            commanded: MitCommand::default(),
            speed_rad_s: 0.0,
            status: STATUS_DISABLED,
            torque_nm: 0.0,
            zero_shift_rad: 0.0,
            now: Nanos(0),
            powered: None,
            fed: Nanos(0),
            sent: Nanos(0),
            warm: false,
            parameters,
        }
    }

    /// Status nibble.
    #[must_use]
    pub const fn status(&self) -> u8 {
        self.status
    }

    /// It has started up.
    fn receives(&self) -> bool {
        self.powered.is_some_and(|powered| self.now.since_s(powered) >= self.parameters.boot_s)
    }

    fn special(&mut self, special: Special, mode: u8) -> Option<CanFrame> {
        let own =
            mode == 0 || self.parameters.mode_offset_ids && u32::from(mode) + 1 == self.registers.mode();
        if !own {
            return None;
        }
        self.fed = self.now;
        match special {
            Special::Enable if self.status == STATUS_DISABLED => self.energise(),
            Special::Disable if self.is_enabled() => self.disable(STATUS_DISABLED),
            Special::SetZero if !self.is_enabled() => self.zero_shift_rad += self.motor_rad(0.0),
            Special::ClearError if !self.is_enabled() => self.status = STATUS_DISABLED,
            Special::Enable | Special::Disable | Special::SetZero | Special::ClearError => {}
        }
        Some(self.feedback())
    }

    fn energise(&mut self) {
        self.status = STATUS_ENABLED;
        self.mechanics.plant.energise(true);
        let at_rad = self.mechanics.read_rad(0.0);
        self.controller.energise(at_rad);
    }

    fn disable(&mut self, status: u8) {
        self.status = status;
        self.torque_nm = 0.0;
        self.controller.release();
        self.mechanics.plant.energise(false);
    }

    fn mit(&mut self, bytes: [u8; 8]) -> Option<CanFrame> {
        if self.registers.mode() != MODE_MIT {
            return None;
        }
        self.fed = self.now;
        self.commanded = MitCommand::decode(bytes, &self.ranges());
        Some(self.feedback())
    }

    fn pos_vel(&mut self, position_rad: f64, velocity_rad_s: f64) -> Option<CanFrame> {
        if self.registers.mode() != MODE_POS_VEL {
            return None;
        }
        self.fed = self.now;
        if position_rad.is_finite() && velocity_rad_s.is_finite() && velocity_rad_s > 0.0 {
            let to_rad = self.link_rad(position_rad);
            let time_s = (to_rad - self.controller.reference_rad()).abs() / velocity_rad_s;
            self.controller.set_target(self.now, to_rad, time_s.max(POS_VEL_PERIOD_S));
            self.speed_rad_s = velocity_rad_s;
        }
        Some(self.feedback())
    }

    fn write(&mut self, number: u8, value: [u8; 4]) -> Option<CanFrame> {
        let held = self.registers.set(number, value)?;
        Some(self.register(number, true, held))
    }

    /// Moves the mechanics up to the last whole step before `now`.
    fn move_on(&mut self, now: Nanos) {
        let dt_s = self.mechanics.step_s();
        // The largest speed that a POS_VEL command states bounds the speed loop too.
        let plant = self.parameters.plant;
        let slowed =
            PlantParameters { speed_rad_s_max: plant.speed_rad_s_max.min(self.speed_rad_s), ..plant };
        for at in self.mechanics.due(now) {
            let read = (self.mechanics.read_rad(0.0), self.mechanics.plant.velocity_rad_s);
            let torque_nm = match self.registers.mode() {
                _ if !self.is_enabled() => 0.0,
                MODE_MIT => self.spring_nm(dt_s),
                MODE_POS_VEL => self.controller.step(at, dt_s, read, &slowed),
                _ => 0.0,
            };
            self.torque_nm = torque_nm;
            self.mechanics.plant.step(torque_nm, dt_s);
        }
    }

    /// The torque at the link of the spring and damper that a command makes of the motor.
    fn spring_nm(&self, dt_s: f64) -> f64 {
        let sign = self.parameters.sign;
        let at = [self.motor_rad(0.0), self.mechanics.plant.velocity_rad_s * sign];
        let wanted_nm = spring_nm(&self.commanded, at, self.parameters.plant.inertia_kg_m2, dt_s);
        let [.., reach_nm] = self.registers.ranges();
        sign * wanted_nm.clamp(-reach_nm, reach_nm)
    }

    /// Angle of the output shaft as the motor reads it.
    fn motor_rad(&self, ahead_s: f64) -> f64 {
        let link_rad = self.mechanics.read_rad(ahead_s);
        (link_rad - self.parameters.zero_offset_rad) * self.parameters.sign - self.zero_shift_rad
    }

    fn link_rad(&self, motor_rad: f64) -> f64 {
        (motor_rad + self.zero_shift_rad) * self.parameters.sign + self.parameters.zero_offset_rad
    }

    fn ranges(&self) -> MitRanges {
        let [position_rad, velocity_rad_s, torque_nm] = self.registers.ranges();
        MitRanges::symmetric(position_rad, velocity_rad_s, torque_nm)
    }

    fn feedback(&mut self) -> CanFrame {
        self.sent = self.now;
        let sign = self.parameters.sign;
        let state = MitState {
            position_rad: self.motor_rad(self.mechanics.ahead_s(self.now)),
            velocity_rad_s: self.mechanics.plant.velocity_rad_s * sign,
            torque_nm: self.torque_nm * sign,
        };
        let [cool, hot] = WARM_CELSIUS;
        let celsius = if self.warm { hot } else { cool };
        let feedback = Feedback {
            status: self.status,
            state: state.encode(&self.ranges()),
            stage_celsius: celsius,
            winding_celsius: celsius,
        };
        self.reply(Reply::Feedback(feedback))
    }

    fn register(&self, number: u8, written: bool, value: [u8; 4]) -> CanFrame {
        self.reply(Reply::Register { number, written, value })
    }

    fn reply(&self, reply: Reply) -> CanFrame {
        let MotorParameters { node_id, feedback_id, wire, .. } = self.parameters;
        reply.encode(node_id, feedback_id, wire)
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
        self.powered.get_or_insert(now);
        self.move_on(now);
        let timeout_s = self.registers.timeout_s();
        if self.is_enabled() && timeout_s > 0.0 && now.since_s(self.fed) > timeout_s {
            self.disable(STATUS_LOST_COMMUNICATION);
        }
        let every_s = f64::from(self.parameters.continuous_ms) * 1e-3;
        if every_s > 0.0 && self.receives() && now.since_s(self.sent) >= every_s {
            out.push(self.feedback());
        }
    }

    fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if now > self.now || self.powered.is_none() {
            self.advance(now, out);
        }
        // A classic controller would not even acknowledge an FD frame.
        let foreign = frame.is_fd() && self.parameters.wire == Wire::Classic;
        let request = Request::decode(frame, self.parameters.node_id).filter(|_| self.receives() && !foreign);
        let answer = match request {
            None => None,
            Some(Request::Special(special, mode)) => self.special(special, mode),
            Some(Request::Mit(bytes)) => self.mit(bytes),
            Some(Request::PosVel { position_rad, velocity_rad_s }) => {
                self.pos_vel(f64::from(position_rad), f64::from(velocity_rad_s))
            }
            Some(Request::OtherMode(mode)) => {
                (self.registers.mode() == u32::from(mode)).then(|| self.feedback())
            }
            Some(Request::Read(number)) => {
                self.registers.get(number).map(|value| self.register(number, false, value))
            }
            Some(Request::Write(number, value)) => self.write(number, value),
            Some(Request::Store) => {
                if self.status == STATUS_DISABLED {
                    self.registers.store();
                }
                None
            }
            Some(Request::Refresh) => Some(self.feedback()),
        };
        out.extend(answer);
    }

    fn disturb(&mut self, disturbance: Disturbance, _: &mut Vec<CanFrame>) {
        match disturbance {
            Disturbance::Fault(code) => {
                let named = u8::try_from(code).ok().filter(|code| (0x8..=0xE).contains(code));
                self.disable(named.unwrap_or(OVER_CURRENT));
            }
            Disturbance::Jammed(jammed) => self.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.mechanics.encoder_shift_rad = shift_rad,
            Disturbance::Warning(warm) => self.warm = warm,
            Disturbance::RefuseWrites(code) => self.registers.locked = code != 0,
            // It has no such inputs.
            Disturbance::Inputs(_) => {}
            Disturbance::Restart => {
                self.disable(STATUS_DISABLED);
                self.registers.restart();
                self.commanded = MitCommand::default();
                self.powered = Some(self.now);
            }
        }
    }

    fn is_enabled(&self) -> bool {
        self.status == STATUS_ENABLED
    }
    fn position_rad(&self) -> f64 {
        self.mechanics.plant.position_rad
    }
    fn velocity_rad_s(&self) -> f64 {
        self.mechanics.plant.velocity_rad_s
    }
    fn weigh(&mut self, weight_nm: f64) -> bool {
        self.mechanics.plant.weight_nm = Some(weight_nm);
        true
    }
    fn node_id(&self) -> u8 {
        self.parameters.node_id
    }
    fn describe(&self) -> String {
        format!("status=0x{:X}", self.status)
    }
    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}

impl Registers {
    /// The watchdog.
    fn timeout_s(&self) -> f64 {
        f64::from(self.integer(Register::Timeout)) / (1000.0 * f64::from(TIMEOUT_UNITS_A_MS))
    }
    fn mode(&self) -> u32 {
        self.integer(Register::Mode)
    }
    fn ranges(&self) -> [f64; 3] {
        [Register::PositionRange, Register::VelocityRange, Register::TorqueRange].map(|r| self.float(r))
    }
}
