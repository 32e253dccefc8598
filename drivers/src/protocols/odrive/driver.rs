//! The driver of the `ODrive` axes on one bus.
//!
//! One cycle on the bus: one setpoint to each drive. Estimates and heartbeats come by themselves, in the periods that the
//! drives are set to.
use super::axis::{Axis, AxisPlan, AxisTarget};
use super::frames::{Command, Message};
use crate::bring_up::timing::{StepTimer, Timeouts};
use crate::frame::{CanFrame, CanId, FrameBatch, JointSet};
use crate::servo::{DriveTarget, FixedPdos, HomingState, JointCommand, Nanos, ServoDriver, ServoStatus};
use std::f64::consts::TAU;
use taustream_motion::MAX_JOINTS;

/// How a link and a drive belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMapping {
    /// Joint of the robot.
    pub joint: usize,
    /// Node id of the drive.
    pub node_id: u8,
    /// Motor direction against link direction, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the drive says 0.
    pub zero_offset_rad: f64,
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
}

impl AxisMapping {
    /// Turns of the encoder in a radian of the link.
    #[must_use]
    pub fn turns_a_rad(&self) -> f64 {
        self.sign * self.gear_ratio / TAU
    }
    /// A command at the motor; `None` when a number of it is none.
    fn motor(&self, command: &JointCommand) -> Option<AxisTarget> {
        let target = AxisTarget {
            position_turns: (command.position_rad - self.zero_offset_rad) * self.turns_a_rad(),
            velocity_turns_s: command.velocity_rad_s * self.turns_a_rad(),
            torque_nm: command.torque_nm * self.sign / self.gear_ratio,
        };
        let finite = target.position_turns.is_finite()
            && target.velocity_turns_s.is_finite()
            && target.torque_nm.is_finite();
        finite.then_some(target)
    }
}

/// One drive: its joint, and when its position was received last.
#[derive(Clone, Debug)]
struct AxisJoint {
    mapping: AxisMapping,
    axis: Axis,
    received: Option<Nanos>,
}

/// The master of all `ODrive` axes of one bus.
#[derive(Clone, Debug)]
pub struct OdriveDriver {
    axes: Vec<AxisJoint>,
    joints: Vec<usize>,
    timeouts: Timeouts,
    near_rad: f64,
    clock: StepTimer,
}

impl OdriveDriver {
    /// A driver without drives. Each is energised only when its command is within `near_rad` of where it stands.
    #[must_use]
    pub fn new(timeouts: Timeouts, near_rad: f64, period_us: u32) -> Self {
        let clock = StepTimer::new(period_us);
        Self { axes: Vec::new(), joints: Vec::new(), timeouts, near_rad, clock }
    }

    /// Adds a drive.
    pub fn add(&mut self, mapping: AxisMapping, plan: AxisPlan) {
        let near_turns = (self.near_rad * mapping.turns_a_rad()).abs();
        let axis = Axis::new(plan, self.timeouts, near_turns);
        self.axes.push(AxisJoint { mapping, axis, received: None });
        self.joints.push(mapping.joint);
    }
}

impl ServoDriver for OdriveDriver {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let cycle = self.clock.tick(now, drive_target);
        for AxisJoint { mapping, axis, .. } in &mut self.axes {
            let target = commands.get(mapping.joint).and_then(|command| mapping.motor(command));
            for command in axis.cycle(cycle, target).into_iter().flatten() {
                let holds = matches!(command, Command::Position(_));
                let joints = if holds { JointSet::of(mapping.joint) } else { JointSet::EMPTY };
                out.push_setpoints(command.encode(mapping.node_id), joints);
            }
        }
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        let step_now = self.clock.now();
        for joint in &mut self.axes {
            if let Some(message) = Message::decode(frame, joint.mapping.node_id) {
                if joint.axis.take(step_now, message) {
                    joint.received = Some(now);
                }
                return;
            }
        }
        // Our own frames do not come back: whoever commands one of our drives is another master.
        if self.axes.iter().any(|joint| Command::is_to(frame, joint.mapping.node_id)) {
            self.clock.note_other_master(frame.id());
        }
    }

    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn status(&self, joint: usize) -> ServoStatus {
        let Some(AxisJoint { mapping, axis, received }) =
            self.axes.iter().find(|axis| axis.mapping.joint == joint)
        else {
            return ServoStatus::UNKNOWN;
        };
        let (error_code, refused_object, refused_numbers) = axis.error();
        let (position_turns, velocity_turns_s) = axis.measured().unwrap_or((f64::NAN, f64::NAN));
        ServoStatus {
            state: axis.state(),
            position_rad: position_turns / mapping.turns_a_rad() + mapping.zero_offset_rad,
            velocity_rad_s: velocity_turns_s / mapping.turns_a_rad(),
            torque_nm: f64::NAN,
            hold_position_rad: f64::NAN,
            homing: HomingState::None,
            fixed_pdos: FixedPdos::NONE,
            received: *received,
            status_word: axis.status_word(),
            error_code,
            refused_object,
            refused_numbers,
            warning: false,
            lost_master: axis.lost_master(),
            // Its errors stand in its heartbeat.
            emergency: 0,
            emergencies: 0,
        }
    }

    fn clear_faults(&mut self) {
        let step_now = self.clock.now();
        for joint in &mut self.axes {
            joint.axis.clear_faults(step_now);
        }
    }

    fn start_over(&mut self) {
        let step_now = self.clock.now();
        for joint in &mut self.axes {
            joint.axis.start_over(step_now);
            joint.received = None;
        }
        self.clock.forget_other_master();
    }

    fn other_master(&self) -> Option<CanId> {
        self.clock.other_master()
    }

    fn explain(&self, error_code: u32) -> String {
        crate::words::explain(error_code)
    }
}
