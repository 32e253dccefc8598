//! The driver of Damiao motors on one bus.
//!
//! One cycle on the bus: one frame to each motor, and its answer. A command acts when it arrives and is answered with the
//! position at that moment, so a position is less than one period old when it is seen.
use crate::bring_up::damiao::{Motor, MotorTarget};
use crate::bring_up::damiao_plan::MotorPlan;
use crate::bring_up::fault;
use crate::bring_up::timing::{self, StepTimer, Timeouts};
use crate::codec::damiao_frames::{Reply, Request, Wire};
use crate::frame::{CanFrame, CanId, FrameBatch, JointSet};
use crate::servo::{DriveTarget, JointCommand, Nanos, ServoDriver, ServoStatus, ZeroRefused};
use taustream_arm::{BusKind, Servo, Settings};
use taustream_motion::MAX_JOINTS;

/// Why a driver cannot be made from settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DamiaoError {
    /// There is no such bus.
    #[error("bus {bus} was requested, but the settings have {buses}")]
    NoSuchBus {
        /// Index asked for.
        bus: usize,
        /// How many there are.
        buses: usize,
    },
    /// More joints than an arm may have, or a joint that the robot does not have.
    #[error("joint {} of the servos is not one of the {joints} joints of the robot", joint + 1)]
    JointBeyond {
        /// Index of the joint.
        joint: usize,
        /// Joints of the robot.
        joints: usize,
    },
    /// Feedback has room for four bits of the id.
    #[error("joint {} has node id {node_id}; Damiao motors have 1 to 15", joint + 1)]
    NodeId {
        /// Index of the joint.
        joint: usize,
        /// Its node id.
        node_id: u8,
    },
    /// A time or distance of the settings is not usable.
    #[error("supervision.{key} = {value}: expected a positive number")]
    Supervision {
        /// Its key.
        key: &'static str,
        /// Its value.
        value: f64,
    },
}

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

/// One motor: the joint that it moves, its receiving identifier, and its newest feedback.
#[derive(Clone, Debug)]
struct MotorJoint {
    joint: usize,
    node_id: u8,
    feedback_id: u16,
    mapping: JointMapping,
    motor: Motor,
    received: Option<Nanos>,
}

/// The master of all Damiao motors of one bus.
#[derive(Clone, Debug)]
pub struct DamiaoDriver {
    motors: Vec<MotorJoint>,
    joints: Vec<usize>,
    wire: Wire,
    clock: StepTimer,
}

impl DamiaoDriver {
    /// A driver for the Damiao servos of `settings.buses[bus]`; it may have none.
    ///
    /// # Errors
    /// When the settings cannot be configured in Damiao motors.
    pub fn new(settings: &Settings, bus: usize) -> Result<Self, DamiaoError> {
        let Some(kind) = settings.buses.get(bus).map(|bus| bus.kind) else {
            return Err(DamiaoError::NoSuchBus { bus, buses: settings.buses.len() });
        };
        let supervision = &settings.supervision;
        let time = |key, value| timing::nanos(value).ok_or(DamiaoError::Supervision { key, value });
        let timeouts = Timeouts {
            step: time("drive_timeout_s", supervision.drive_timeout_s)?,
            feedback: time("feedback_age_s_max", supervision.feedback_age_s_max)?,
        };
        // As with every drive: energising must not start with a step.
        let near_rad = supervision.tracking_error_rad_max.min(supervision.position_jump_rad_max);
        time("tracking_error_rad_max and position_jump_rad_max", near_rad)?;
        let clock = StepTimer::new(settings.cycle.period_us);
        let mut driver = Self { motors: Vec::new(), joints: Vec::new(), wire: wire_of(kind), clock };
        for servo in settings.servos.iter().filter(|servo| servo.bus == bus) {
            driver.add(settings, servo, timeouts, near_rad)?;
        }
        Ok(driver)
    }

    fn add(
        &mut self,
        settings: &Settings,
        servo: &Servo,
        timeouts: Timeouts,
        near_rad: f64,
    ) -> Result<(), DamiaoError> {
        let Some(damiao) = servo.protocol.as_damiao().copied() else { return Ok(()) };
        let (joint, node_id) = (servo.joint, servo.node_id);
        let joints = settings.robot.joints.len();
        let limits = settings.robot.joints.get(joint).map(|joint| joint.limits);
        let Some(limits) = limits.filter(|_| joint < MAX_JOINTS && self.motors.len() < MAX_JOINTS) else {
            return Err(DamiaoError::JointBeyond { joint, joints });
        };
        if !(1..=15).contains(&node_id) {
            return Err(DamiaoError::NodeId { joint, node_id });
        }
        let plan = MotorPlan { node_id, damiao, speed_rad_s: limits.stop.velocity_rad_s };
        self.motors.push(MotorJoint {
            joint,
            node_id,
            feedback_id: damiao.feedback_id,
            mapping: JointMapping { sign: servo.sign, zero_offset_rad: servo.zero_offset_rad },
            motor: Motor::new(plan, timeouts, near_rad),
            received: None,
        });
        self.joints.push(joint);
        Ok(())
    }
}

/// The kind of frames on a bus: FD where it is an FD bus, classic on a virtual one.
pub(crate) const fn wire_of(kind: BusKind) -> Wire {
    match kind {
        BusKind::Virtual | BusKind::Classic { .. } => Wire::Classic,
        BusKind::Fd { .. } => Wire::Fd,
    }
}

impl ServoDriver for DamiaoDriver {
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
            if let Some(request) = joint.motor.request(cycle, target) {
                let frame = request.encode(joint.node_id, self.wire);
                let joints = if request.is_setpoint() { JointSet::of(joint.joint) } else { JointSet::EMPTY };
                out.push_setpoints(frame, joints);
            }
        }
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        let step_now = self.clock.now();
        for joint in &mut self.motors {
            if let Some(reply) = Reply::decode(frame, joint.node_id, joint.feedback_id) {
                if joint.motor.take(step_now, reply) {
                    joint.received = Some(now);
                }
                return;
            }
        }
        // Our own frames do not come back: whoever commands one of our motors is another master.
        if self.motors.iter().any(|joint| Request::is_to(frame, joint.node_id)) {
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
        let measured = joint.motor.measured();
        let (error_code, refused_object) = joint.motor.error();
        ServoStatus {
            state: joint.motor.state(),
            position_rad: joint.mapping.link_rad(measured.position_rad),
            velocity_rad_s: measured.velocity_rad_s * joint.mapping.sign,
            hold_position_rad: f64::NAN,
            received: joint.received,
            status_word: joint.motor.status_word(),
            error_code,
            refused_numbers: [0.0; 2],
            refused_object,
            warning: false,
            lost_master: joint.motor.lost_master(),
            // Its faults stand in the status of each answer.
            emergency: 0,
            emergencies: 0,
        }
    }

    fn clear_faults(&mut self) {
        let step_now = self.clock.now();
        for joint in &mut self.motors {
            joint.motor.clear_faults(step_now);
        }
    }

    fn start_over(&mut self) {
        let step_now = self.clock.now();
        for joint in &mut self.motors {
            joint.motor.start_over(step_now);
            joint.received = None;
        }
        self.clock.forget_other_master();
    }

    fn set_zero(&mut self, joint: usize) -> Result<(), ZeroRefused> {
        let joint = self.motors.iter_mut().find(|motor| motor.joint == joint);
        let joint = joint.ok_or(ZeroRefused::NoSuchJoint)?;
        if joint.motor.set_zero() { Ok(()) } else { Err(ZeroRefused::NotReady) }
    }

    fn other_master(&self) -> Option<CanId> {
        self.clock.other_master()
    }

    fn explain(&self, error_code: u32) -> String {
        fault::explain(error_code)
    }
}
