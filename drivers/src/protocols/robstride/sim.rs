//! One simulated `RobStride` motor: frames and time in, frames out.
//!
//! No I/O and no clock: the same frames at the same times give the same answers, bit by bit. What is simple: of the modes
//! there is operation control; with another `run_mode` an energised motor gives no torque. Requests that change
//! identifiers, baud rate, protocol or flash are not carried out.
use super::frames::{Feedback, Mode, Operation, Parameter, Reply, Request, TIMEOUT_UNITS_A_MS, ranges};
use super::parameters::Parameters;
use crate::codec::mit::{MitCommand, MitRanges};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::impedance::{Impedance, Mounting};
use crate::sim::settings::SimulatedJoint;
use crate::sim::{Disturbance, ModelParameters, PlantParameters, PlantedObject, ServoModel};
use std::f64::consts::{PI, TAU};
use taustream_arm::{Feedback as FeedbackKind, RobStride};

/// Fault bit of an over-current, for faults that name none.
const OVER_CURRENT: u8 = 0x02;
/// All fault bits of a feedback.
const FAULTS: u8 = 0x3F;
/// `run_mode` of operation control.
const OPERATION_CONTROL: u32 = 0;
/// Temperatures of a motor that is well, and of one that warns, 0.1 degrees Celsius.
const WARM_DECICELSIUS: [u16; 2] = [350, 1360];

/// Its own keys of the section `[simulator]`.
pub(super) const KEYS: [&str; 6] = [
    "motor_position_range_rad",
    "motor_velocity_range_rad_s",
    "motor_torque_range_nm",
    "motor_torque_limit_nm",
    "motor_timeout_ms",
    "continuous_feedback_ms",
];

/// A motor as it is sold: ranges and limit that the settings state, operation control, and no watchdog. It counts revolutions
/// over a power cycle where the settings say that its feedback does.
pub(super) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let settings = servo.protocol.get::<RobStride>();
    let stated = |of: fn(&RobStride) -> f64| settings.map_or(1.0, of);
    let reach = |key, stated| joint.number(key, stated, 1e-3..=1e6);
    let torque_nm = stated(|motor| motor.torque_limit_nm);
    Box::new(RobStrideParameters {
        node_id: servo.node_id,
        host_id: 0,
        identity: [servo.node_id, 0, 0, 0, 0, 0, 0, 1],
        mounting: Mounting {
            sign: servo.sign,
            zero_offset_rad: servo.zero_offset_rad,
            start_rad: joint.start_rad(),
            plant: joint.plant(joint.load_for(torque_nm, settings.map(|motor| motor.gains))),
            step_ns: joint.step_ns(),
        },
        reach: [
            reach("motor_position_range_rad", stated(|motor| motor.ranges.position_rad)),
            reach("motor_velocity_range_rad_s", stated(|motor| motor.ranges.velocity_rad_s)),
            reach("motor_torque_range_nm", stated(|motor| motor.ranges.torque_nm)),
        ],
        gains_max: settings.map_or([1.0; 2], |motor| motor.gains_max),
        torque_limit_nm: reach("motor_torque_limit_nm", torque_nm),
        run_mode: 0,
        timeout_ms: joint.whole("motor_timeout_ms", 0, 0..=65_535),
        has_timeout: true,
        has_version: true,
        forgets_revolutions: servo.feedback != FeedbackKind::MultiTurn,
        continuous_ms: joint.whole("continuous_feedback_ms", 0, 0..=10_000),
        boot_s: joint.boot_s(),
    })
}

/// What a simulated motor is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobStrideParameters {
    /// Its identifier, 1 to 127.
    pub node_id: u8,
    /// The master that it answers before one has named itself.
    pub host_id: u8,
    /// Its unique number.
    pub identity: [u8; 8],
    /// Where it sits.
    pub mounting: Mounting,
    /// Reach of position, velocity and torque on the wire: of its model and firmware.
    pub reach: [f64; 3],
    /// Greatest kp and kd on the wire.
    pub gains_max: [f64; 2],
    /// `limit_torque` in its flash: the greatest torque of its model.
    pub torque_limit_nm: f64,
    /// `run_mode` in its flash.
    pub run_mode: u8,
    /// Watchdog in its flash, 0 is none.
    pub timeout_ms: u32,
    /// It has parameter 0x7028: firmware of 2025 and later.
    pub has_timeout: bool,
    /// It answers to "version"; else it takes that for "stop".
    pub has_version: bool,
    /// It knows its angle after power-up but for whole revolutions, as the maker's do; else it goes on counting.
    pub forgets_revolutions: bool,
    /// It also sends feedback by itself every so often; 0 is never.
    pub continuous_ms: u32,
    /// Time from power-up to the first answer.
    pub boot_s: f64,
}

/// A simulated motor.
#[derive(Clone, Debug)]
pub struct RobStrideMotor {
    parameters: RobStrideParameters,
    held: Parameters,
    joint: Impedance,
    mode: Mode,
    faults: u8,
    /// Faults that only a report tells.
    reported: u32,
    host_id: u8,
    now: Nanos,
    powered: Option<Nanos>,
    /// When it was last sent anything.
    fed: Nanos,
    sent: Nanos,
    warm: bool,
}

impl RobStrideMotor {
    /// A motor that powers up at the first call of [`Self::advance`].
    #[must_use]
    pub fn new(parameters: RobStrideParameters) -> Self {
        let mut motor = Self {
            held: Parameters::new(&parameters),
            joint: Impedance::new(parameters.mounting),
            mode: Mode::Reset,
            faults: 0,
            reported: 0,
            host_id: parameters.host_id,
            now: Nanos(0),
            powered: None,
            fed: Nanos(0),
            sent: Nanos(0),
            warm: false,
            parameters,
        };
        motor.forget_revolutions();
        motor
    }

    /// Its faults, six bits.
    #[must_use]
    pub const fn faults(&self) -> u8 {
        self.faults
    }

    /// It has started up.
    fn receives(&self) -> bool {
        self.powered.is_some_and(|powered| self.now.since_s(powered) >= self.parameters.boot_s)
    }

    fn ranges(&self) -> MitRanges {
        let [stiffness, damping] = self.parameters.gains_max;
        ranges(self.parameters.reach, stiffness, damping)
    }

    fn command(&self, operation: Operation) -> MitCommand {
        operation.decode(&self.ranges())
    }

    fn enable(&mut self) {
        if self.faults == 0 && self.reported == 0 {
            self.mode = Mode::Run;
            let follows = self.held.integer(Parameter::RunMode) == OPERATION_CONTROL;
            self.joint.energise(follows);
        }
    }

    fn disable(&mut self) {
        self.mode = Mode::Reset;
        self.joint.energise(false);
    }

    fn read(&self, index: u16) -> Option<[u8; 4]> {
        let narrow = |value: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "the parameter is this wide")]
            let value = value as f32;
            Some(value.to_le_bytes())
        };
        let state = self.joint.state(self.now);
        match index {
            0x7019 => narrow(state.position_rad),
            0x701A => narrow(state.torque_nm),
            0x701B => narrow(state.velocity_rad_s),
            0x7028 if !self.parameters.has_timeout => None,
            _ => self.held.get(index),
        }
    }

    /// `run_mode` changes only without torque.
    fn write(&mut self, index: u16, value: [u8; 4]) {
        if index != Parameter::RunMode.index() || !self.is_enabled() {
            self.held.set(index, value);
        }
    }

    /// What the encoder on the output shaft knows after power-up: the angle but for whole revolutions.
    fn forget_revolutions(&mut self) {
        if !self.parameters.forgets_revolutions {
            return;
        }
        let position_rad = self.joint.state(self.now).position_rad;
        let within_rad = match self.held.get(0x7029) {
            Some([1, ..]) => (position_rad + PI).rem_euclid(TAU) - PI,
            _ => position_rad.rem_euclid(TAU),
        };
        self.joint.set_reading(within_rad);
    }

    fn feedback(&mut self) -> CanFrame {
        self.sent = self.now;
        let mut state = self.joint.state(self.now);
        // The field repeats: 4 pi is followed by -4 pi.
        let [reach_rad, ..] = self.parameters.reach;
        state.position_rad = (state.position_rad + reach_rad).rem_euclid(2.0 * reach_rad) - reach_rad;
        let [cool, hot] = WARM_DECICELSIUS;
        self.reply(Reply::Feedback(Feedback {
            mode: self.mode,
            faults: self.faults,
            state: Feedback::pack(&state, &self.ranges()),
            decicelsius: if self.warm { hot } else { cool },
        }))
    }

    /// Fault report of type 21: it has bits of its own for what a feedback tells in six.
    fn fault_report(&self) -> CanFrame {
        const REPORTED: [(u8, u32); 6] =
            [(0x01, 1 << 2), (0x02, 1 << 16), (0x04, 1), (0x08, 1 << 8), (0x10, 1 << 14), (0x20, 1 << 7)];
        let stated = REPORTED.iter().filter(|(bit, _)| self.faults & bit != 0);
        let faults = stated.fold(self.reported, |all, (_, bit)| all | bit);
        self.reply(Reply::Fault { faults, warnings: u32::from(self.warm) })
    }

    fn reply(&self, reply: Reply) -> CanFrame {
        reply.encode(self.parameters.node_id, self.host_id)
    }
}

impl ServoModel for RobStrideMotor {
    fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        self.now = now;
        self.powered.get_or_insert(now);
        self.joint.move_on(now, self.held.float(Parameter::TorqueLimit));
        let timeout_s =
            f64::from(self.held.integer(Parameter::Timeout)) / (1000.0 * f64::from(TIMEOUT_UNITS_A_MS));
        if self.is_enabled()
            && self.parameters.has_timeout
            && timeout_s > 0.0
            && now.since_s(self.fed) > timeout_s
        {
            self.disable();
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
        let Some((host, request)) =
            Request::decode(frame, self.parameters.node_id).filter(|_| self.receives())
        else {
            return;
        };
        self.fed = self.now;
        if !request.is_setpoint() {
            self.host_id = host;
        }
        match request {
            Request::GetId => out.push(self.reply(Reply::Identity(self.parameters.identity))),
            Request::Operation(operation) => {
                self.joint.commanded = self.command(operation);
                out.push(self.feedback());
            }
            Request::Enable => {
                self.enable();
                out.push(self.feedback());
            }
            Request::Version if self.parameters.has_version => {
                out.push(self.reply(Reply::Version([0, 3, 0, 13])));
            }
            Request::Stop | Request::Version => {
                self.disable();
                out.push(self.feedback());
            }
            Request::ClearFault => {
                self.disable();
                (self.faults, self.reported) = (0, 0);
                out.push(self.feedback());
            }
            Request::SetZero => {
                self.joint.set_reading(0.0);
                self.joint.commanded.position_rad = 0.0;
                out.push(self.feedback());
            }
            Request::Read(index) => {
                let value = self.read(index);
                let (read, value) = (value.is_some(), value.unwrap_or_default());
                out.push(self.reply(Reply::Value { index, read, value }));
            }
            Request::Write(index, value) => {
                self.write(index, value);
                out.push(self.feedback());
            }
            Request::Other(_) => {}
        }
    }

    fn disturb(&mut self, disturbance: Disturbance, out: &mut Vec<CanFrame>) {
        match disturbance {
            Disturbance::Fault(code) => {
                self.disable();
                match code {
                    0x40..=0x5F => self.reported |= 1 << (code & 0x1F),
                    code => {
                        let named = u8::try_from(code).ok().filter(|bits| (1..=FAULTS).contains(bits));
                        self.faults |= named.unwrap_or(OVER_CURRENT);
                    }
                }
                if self.receives() {
                    out.push(self.fault_report());
                }
            }
            Disturbance::Jammed(jammed) => self.joint.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.joint.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.joint.mechanics.encoder_shift_rad = shift_rad,
            Disturbance::Warning(warm) => self.warm = warm,
            Disturbance::RefuseWrites(code) => self.held.locked = code != 0,
            // It has no such inputs.
            Disturbance::Inputs(_) => {}
            Disturbance::Restart => {
                self.disable();
                (self.faults, self.reported) = (0, 0);
                self.held.restart();
                self.host_id = self.parameters.host_id;
                self.joint.commanded = MitCommand::default();
                self.forget_revolutions();
                self.powered = Some(self.now);
            }
        }
    }

    fn node_id(&self) -> u8 {
        self.parameters.node_id
    }

    fn is_enabled(&self) -> bool {
        self.mode == Mode::Run
    }

    fn position_rad(&self) -> f64 {
        self.joint.mechanics.plant.position_rad
    }

    fn velocity_rad_s(&self) -> f64 {
        self.joint.mechanics.plant.velocity_rad_s
    }

    fn describe(&self) -> String {
        format!("mode={:?} faults=0x{:02X}", self.mode, self.faults)
    }

    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}

impl ModelParameters for RobStrideParameters {
    fn build(&self, _: &[PlantedObject]) -> Box<dyn ServoModel> {
        Box::new(RobStrideMotor::new(*self))
    }
    fn plant_mut(&mut self) -> &mut PlantParameters {
        &mut self.mounting.plant
    }
    fn start_rad_mut(&mut self) -> &mut f64 {
        &mut self.mounting.start_rad
    }
}
