//! The driver of the motors of one protocol on one bus.
//!
//! One cycle on the bus: one request to each motor, and its answer. A command acts when it arrives and is answered with the
//! position at that moment, so a position is less than one period old when it is seen.
use super::machine::{Machine, MotorTarget};
use super::{AnsweringMotor, Outbox, fault};
use crate::bring_up::timing::{self, StepTimer, Timeouts};
use crate::frame::{CanFrame, CanId, FrameBatch};
use crate::protocols::DriverError;
use crate::servo::{
    DriveTarget, FixedPdos, HomingState, JointCommand, Nanos, ServoDriver, ServoStatus, ZeroRefused,
};
use taustream_arm::{Servo, Settings};
use taustream_motion::MAX_JOINTS;

/// How link angles and a motor's angles belong together: the motor states the angle of its output shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
struct JointMapping {
    sign: f64,
    zero_offset_rad: f64,
}

impl JointMapping {
    /// A command on the motor side; `None` when a number of it is none.
    fn motor(self, command: &JointCommand) -> Option<MotorTarget> {
        let target = MotorTarget {
            position_rad: (command.position_rad - self.zero_offset_rad) * self.sign,
            velocity_rad_s: command.velocity_rad_s * self.sign,
            torque_nm: command.torque_nm * self.sign,
        };
        let finite = target.position_rad.is_finite()
            && target.velocity_rad_s.is_finite()
            && target.torque_nm.is_finite();
        finite.then_some(target)
    }
    fn link_rad(self, motor_rad: f64) -> f64 {
        motor_rad * self.sign + self.zero_offset_rad
    }
}

/// One motor and the joint that it moves.
#[derive(Clone, Debug)]
pub struct MotorJoint<M> {
    joint: usize,
    mapping: JointMapping,
    machine: Machine<M>,
    received: Option<Nanos>,
}

/// The master of all motors of one protocol on one bus.
#[derive(Clone, Debug)]
pub struct MotorDriver<M> {
    motors: Vec<MotorJoint<M>>,
    joints: Vec<usize>,
    clock: StepTimer,
}

impl<M: AnsweringMotor> MotorDriver<M> {
    /// A driver for the servos of `settings.buses[bus]` of which `motor` makes one; there may be none.
    ///
    /// # Errors
    /// When the settings cannot be configured in such motors.
    pub fn new(
        settings: &Settings,
        bus: usize,
        motor: impl Fn(&Servo) -> Result<Option<M>, DriverError>,
    ) -> Result<Self, DriverError> {
        if bus >= settings.buses.len() {
            return Err(DriverError::NoSuchBus { bus, buses: settings.buses.len() });
        }
        let supervision = &settings.supervision;
        let time = |key, value| timing::nanos(value).ok_or(DriverError::Supervision { key, value });
        let timeouts = Timeouts {
            step: time("drive_timeout_s", supervision.drive_timeout_s)?,
            feedback: time("feedback_age_s_max", supervision.feedback_age_s_max)?,
        };
        // As with every drive: energising must not start with a step.
        let near_rad = supervision.tracking_error_rad_max.min(supervision.position_jump_rad_max);
        time("tracking_error_rad_max and position_jump_rad_max", near_rad)?;
        let clock = StepTimer::new(settings.cycle.period_us);
        let mut driver = Self { motors: Vec::new(), joints: Vec::new(), clock };
        let joints = settings.slots().min(MAX_JOINTS);
        for servo in settings.servos.iter().filter(|servo| servo.bus == bus) {
            let Some(motor) = motor(servo)? else { continue };
            let joint = servo.joint;
            if joint >= joints || driver.motors.len() >= MAX_JOINTS {
                return Err(DriverError::JointBeyond { joint, joints });
            }
            driver.motors.push(MotorJoint {
                joint,
                mapping: JointMapping { sign: servo.sign, zero_offset_rad: servo.zero_offset_rad },
                machine: Machine::new(motor, timeouts, near_rad),
                received: None,
            });
            driver.joints.push(joint);
        }
        Ok(driver)
    }
}

impl<M: AnsweringMotor> ServoDriver for MotorDriver<M> {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let cycle = self.clock.tick(now, drive_target);
        for joint in &mut self.motors {
            let target = commands.get(joint.joint).and_then(|command| joint.mapping.motor(command));
            joint.machine.request(cycle, target, &mut Outbox::new(out, joint.joint));
        }
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        let step_now = self.clock.now();
        for joint in &mut self.motors {
            if let Some(measured) = joint.machine.take(step_now, frame) {
                if measured {
                    joint.received = Some(now);
                }
                return;
            }
        }
        // Our own frames do not come back: whoever commands one of our motors is another master.
        if self.motors.iter().any(|joint| joint.machine.is_to(frame)) {
            self.clock.note_other_master(frame.id());
        }
    }

    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn status(&self, joint: usize) -> ServoStatus {
        let Some(joint) = self.motors.iter().find(|motor| motor.joint == joint) else {
            return ServoStatus::UNKNOWN;
        };
        let measured = joint.machine.measured();
        let (error_code, refused_object) = joint.machine.error();
        ServoStatus {
            state: joint.machine.state(),
            position_rad: joint.mapping.link_rad(measured.position_rad),
            velocity_rad_s: measured.velocity_rad_s * joint.mapping.sign,
            torque_nm: measured.torque_nm * joint.mapping.sign,
            hold_position_rad: f64::NAN,
            homing: HomingState::None,
            fixed_pdos: FixedPdos::NONE,
            received: joint.received,
            status_word: joint.machine.status_word(),
            error_code,
            refused_numbers: [0.0; 2],
            refused_object,
            warning: joint.machine.warning(),
            lost_master: joint.machine.lost_master(),
            // Its faults stand in the status of each answer.
            emergency: 0,
            emergencies: 0,
        }
    }

    fn clear_faults(&mut self) {
        let step_now = self.clock.now();
        for joint in &mut self.motors {
            joint.machine.clear_faults(step_now);
        }
    }

    fn start_over(&mut self) {
        let step_now = self.clock.now();
        for joint in &mut self.motors {
            joint.machine.start_over(step_now);
            joint.received = None;
        }
        self.clock.forget_other_master();
    }

    fn set_zero(&mut self, joint: usize) -> Result<(), ZeroRefused> {
        let joint = self.motors.iter_mut().find(|motor| motor.joint == joint);
        let joint = joint.ok_or(ZeroRefused::NoSuchJoint)?;
        if joint.machine.set_zero() { Ok(()) } else { Err(ZeroRefused::NotReady) }
    }

    fn other_master(&self) -> Option<CanId> {
        self.clock.other_master()
    }

    fn explain(&self, error_code: u32) -> String {
        fault::explain(&M::WORDS, error_code, true)
    }
}
