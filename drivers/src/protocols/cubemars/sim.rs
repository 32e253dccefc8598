//! One simulated `CubeMars` AK motor in MIT mode: frames and time in, frames out.
//!
//! No I/O and no clock: the same frames at the same times give the same answers, bit by bit.
//!
//! It behaves as the firmware that the protocol comes from: a command to a motor that is not in motor mode is answered and
//! not taken; one whose time without a frame has run out stays in motor mode with its command cleared, and follows the next
//! command at once; an error ends motor mode, and leaving motor mode clears it.
//!
//! Source: Mini Cheetah motor driver (B. Katz, MIT, 2018); the maker's manual says nothing of these cases.
use super::frames::{Feedback, Request, Special};
use crate::codec::mit::{MitCommand, MitRanges, MitState};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::impedance::{Impedance, Mounting};
use crate::sim::settings::SimulatedJoint;
use crate::sim::{Disturbance, ModelParameters, PlantParameters, PlantedObject, ServoModel};
use taustream_arm::CubeMars;

/// Error of an over-current, for faults that name none.
const OVER_CURRENT: u8 = 2;
/// Temperatures of a motor that is well, and of one that warns: degrees Celsius plus 40.
const WARM: [u8; 2] = [75, 145];
/// How long it does not answer after "here is zero".
const ZEROING_S: f64 = 1.0;

/// Its own keys of the section `[simulator]`.
pub(super) const KEYS: [&str; 4] =
    ["motor_position_range_rad", "motor_velocity_range_rad_s", "motor_torque_range_nm", "motor_timeout_ms"];

/// A motor with the ranges and the watchdog that the settings state.
pub(super) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let settings = servo.protocol.get::<CubeMars>();
    let stated = |of: fn(&CubeMars) -> f64| settings.map_or(1.0, of);
    let reach = |key, stated| joint.number(key, stated, 1e-3..=1e6);
    let torque_nm = stated(|motor| motor.ranges.torque_nm);
    let timeout_ms = settings.map_or(0, |motor| motor.watchdog_ms);
    let plant = joint.plant(joint.load_for(torque_nm, settings.map(|motor| motor.gains)));
    Box::new(CubeMarsParameters {
        node_id: servo.node_id,
        feedback_id: settings.map_or(0, |motor| motor.feedback_id),
        mounting: Mounting {
            sign: servo.sign,
            zero_offset_rad: servo.zero_offset_rad,
            start_rad: joint.start_rad(),
            plant,
            step_ns: joint.step_ns(),
        },
        reach: [
            reach("motor_position_range_rad", stated(|motor| motor.ranges.position_rad)),
            reach("motor_velocity_range_rad_s", stated(|motor| motor.ranges.velocity_rad_s)),
            reach("motor_torque_range_nm", torque_nm),
        ],
        torque_nm_max: plant.torque_nm_max,
        timeout_ms: joint.whole("motor_timeout_ms", timeout_ms, 0..=65_535),
        short_feedback: false,
        boot_s: joint.boot_s(),
    })
}

/// What a simulated motor is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubeMarsParameters {
    /// Its identifier, 1 to 127.
    pub node_id: u8,
    /// Identifier of its feedback: its own (the manual), or 0.
    pub feedback_id: u16,
    /// Where it sits.
    pub mounting: Mounting,
    /// Reach of position, velocity and torque on the wire: of its model and firmware.
    pub reach: [f64; 3],
    /// Greatest torque that it gives.
    pub torque_nm_max: f64,
    /// Time without a frame after which it drops its command, 0 is none: set in the maker's tool.
    pub timeout_ms: u32,
    /// It answers with six bytes, as firmware before the second generation.
    pub short_feedback: bool,
    /// Time from power-up to the first answer.
    pub boot_s: f64,
}

/// A simulated motor.
#[derive(Clone, Debug)]
pub struct CubeMarsMotor {
    parameters: CubeMarsParameters,
    joint: Impedance,
    error: u8,
    now: Nanos,
    powered: Option<Nanos>,
    /// When it was last sent anything.
    fed: Nanos,
    zeroed: Option<Nanos>,
    warm: bool,
}

impl CubeMarsMotor {
    /// A motor that powers up at the first call of [`Self::advance`].
    #[must_use]
    pub fn new(parameters: CubeMarsParameters) -> Self {
        Self {
            joint: Impedance::new(parameters.mounting),
            error: 0,
            now: Nanos(0),
            powered: None,
            fed: Nanos(0),
            zeroed: None,
            warm: false,
            parameters,
        }
    }

    /// Its error; 0 for none.
    #[must_use]
    pub const fn error(&self) -> u8 {
        self.error
    }

    /// It has started up, and is not busy with its zero.
    fn receives(&self) -> bool {
        let up = self.powered.is_some_and(|powered| self.now.since_s(powered) >= self.parameters.boot_s);
        up && self.zeroed.is_none_or(|zeroed| self.now.since_s(zeroed) >= ZEROING_S)
    }

    const fn ranges(&self) -> MitRanges {
        let [position_rad, velocity_rad_s, torque_nm] = self.parameters.reach;
        MitRanges::symmetric(position_rad, velocity_rad_s, torque_nm)
    }

    fn feedback(&self) -> CanFrame {
        let state: MitState = self.joint.state(self.now);
        let [cool, hot] = WARM;
        let temperature = if self.warm { hot } else { cool };
        let feedback = Feedback {
            state: state.encode(&self.ranges()),
            health: (!self.parameters.short_feedback).then_some([temperature, self.error]),
        };
        feedback.encode(self.parameters.node_id, self.parameters.feedback_id)
    }
}

impl ServoModel for CubeMarsMotor {
    fn advance(&mut self, now: Nanos, _: &mut Vec<CanFrame>) {
        self.now = now;
        self.powered.get_or_insert(now);
        self.joint.move_on(now, self.parameters.torque_nm_max);
        let timeout_s = f64::from(self.parameters.timeout_ms) * 1e-3;
        if timeout_s > 0.0 && now.since_s(self.fed) > timeout_s {
            self.joint.commanded = MitCommand::default();
        }
    }

    fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        if now > self.now || self.powered.is_none() {
            self.advance(now, out);
        }
        let Some(request) = Request::decode(frame, self.parameters.node_id).filter(|_| self.receives())
        else {
            return;
        };
        self.fed = self.now;
        match request {
            Request::Special(Special::Enter) if self.error == 0 => self.joint.energise(true),
            Request::Special(Special::Exit) => {
                self.joint.energise(false);
                self.error = 0;
            }
            Request::Special(Special::SetZero) => {
                self.joint.set_reading(0.0);
                self.zeroed = Some(self.now);
            }
            Request::Mit(bytes) if self.is_enabled() => {
                self.joint.commanded = MitCommand::decode(bytes, &self.ranges());
            }
            Request::Special(Special::Enter) | Request::Mit(_) => {}
        }
        out.push(self.feedback());
    }

    fn disturb(&mut self, disturbance: Disturbance, _: &mut Vec<CanFrame>) {
        match disturbance {
            Disturbance::Fault(code) => {
                let named = u8::try_from(code).ok().filter(|code| (1..=7).contains(code));
                self.joint.energise(false);
                self.error = named.unwrap_or(OVER_CURRENT);
            }
            Disturbance::Jammed(jammed) => self.joint.mechanics.plant.jammed = jammed,
            Disturbance::Object(at_rad) => self.joint.mechanics.plant.place_object(at_rad),
            Disturbance::EncoderShift(shift_rad) => self.joint.mechanics.encoder_shift_rad = shift_rad,
            Disturbance::Warning(warm) => self.warm = warm,
            Disturbance::RefuseWrites(_) | Disturbance::Inputs(_) => {}
            Disturbance::Restart => {
                self.joint.energise(false);
                self.error = 0;
                self.joint.commanded = MitCommand::default();
                self.powered = Some(self.now);
            }
        }
    }

    fn node_id(&self) -> u8 {
        self.parameters.node_id
    }

    fn is_enabled(&self) -> bool {
        self.joint.is_energised()
    }

    fn position_rad(&self) -> f64 {
        self.joint.mechanics.plant.position_rad
    }

    fn velocity_rad_s(&self) -> f64 {
        self.joint.mechanics.plant.velocity_rad_s
    }

    fn describe(&self) -> String {
        format!("motor_mode={} error={}", self.is_enabled(), self.error)
    }

    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}

impl ModelParameters for CubeMarsParameters {
    fn build(&self, _: &[PlantedObject]) -> Box<dyn ServoModel> {
        Box::new(CubeMarsMotor::new(*self))
    }
    fn plant_mut(&mut self) -> &mut PlantParameters {
        &mut self.mounting.plant
    }
    fn start_rad_mut(&mut self) -> &mut f64 {
        &mut self.mounting.start_rad
    }
}
