//! The driver of a Piper on one bus.
//!
//! One cycle on the bus: three frames with the targets of six joints. The arm sends its angles some 200 times a second by
//! itself; it has no watchdog that its maker documents.
use super::controller::{ArmPlan, Controller};
use super::frames::{Command, JOINTS, Message, from_millidegrees, millidegrees};
use crate::bring_up::timing::{StepTimer, Timeouts};
use crate::frame::{CanFrame, CanId, FrameBatch, JointSet};
use crate::servo::{
    DriveTarget, FixedPdos, HomingState, JointCommand, Nanos, ServoDriver, ServoStatus, ZeroRefused,
};
use taustream_motion::MAX_JOINTS;

/// How link angles and a joint of the arm belong together, and when it was received last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSlot {
    /// Joint of the robot.
    pub joint: usize,
    /// The arm's direction against the link's, +1.0 or -1.0.
    pub sign: f64,
    /// Link angle where the arm says 0.
    pub zero_offset_rad: f64,
}

impl JointSlot {
    fn arm_mdeg(&self, command: &JointCommand) -> Option<i32> {
        millidegrees((command.position_rad - self.zero_offset_rad) * self.sign)
    }
    fn link_rad(&self, angle_mdeg: i32) -> f64 {
        from_millidegrees(angle_mdeg) * self.sign + self.zero_offset_rad
    }
}

/// The master of one Piper.
#[derive(Clone, Debug)]
pub struct PiperDriver {
    slots: [JointSlot; JOINTS],
    joints: [usize; JOINTS],
    received: [Option<Nanos>; JOINTS],
    controller: Controller,
    clock: StepTimer,
}

impl PiperDriver {
    /// The driver of an arm whose joints 1 to 6 are `slots`. It is energised only when its commands are within `near_rad`
    /// of where it stands.
    #[must_use]
    pub fn new(
        plan: ArmPlan,
        slots: [JointSlot; JOINTS],
        timeouts: Timeouts,
        near_rad: f64,
        period_us: u32,
    ) -> Self {
        Self {
            slots,
            joints: slots.map(|slot| slot.joint),
            received: [None; JOINTS],
            controller: Controller::new(plan, timeouts, millidegrees(near_rad).unwrap_or(0)),
            clock: StepTimer::new(period_us),
        }
    }

    fn place_of(&self, joint: usize) -> Option<usize> {
        self.joints.iter().position(|served| *served == joint)
    }

    /// The joints whose targets are in the frame of a pair.
    fn pair(&self, pair: u8) -> JointSet {
        let first = usize::from(pair) * 2;
        let joints = self.joints.iter().skip(first).take(2);
        joints.fold(JointSet::EMPTY, |all, joint| all.union(JointSet::of(*joint)))
    }
}

impl ServoDriver for PiperDriver {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let cycle = self.clock.tick(now, drive_target);
        let targets =
            self.slots.map(|slot| commands.get(slot.joint).and_then(|command| slot.arm_mdeg(command)));
        for command in self.controller.cycle(cycle, &targets).into_iter().flatten() {
            let joints =
                if let Command::Targets(pair, _) = command { self.pair(pair) } else { JointSet::EMPTY };
            out.push_setpoints(command.encode(), joints);
        }
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        if let Some(message) = Message::decode(frame) {
            let angles = self.controller.take(self.clock.now(), message);
            for joint in angles.into_iter().flatten() {
                if let Some(received) = self.received.get_mut(joint) {
                    *received = Some(now);
                }
            }
        } else if Command::decode(frame).is_some_and(Command::acts) {
            // Our own frames do not come back: whoever commands the arm is another master, or a leader arm.
            self.clock.note_other_master(frame.id());
        }
    }

    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn status(&self, joint: usize) -> ServoStatus {
        let Some((place, slot)) =
            self.place_of(joint).and_then(|place| Some((place, self.slots.get(place)?)))
        else {
            return ServoStatus::UNKNOWN;
        };
        let (error_code, refused_object, refused_numbers) = self.controller.error(place);
        let angle = self.controller.angle(place);
        let speed = self.controller.speed_mrad_s(place);
        ServoStatus {
            state: self.controller.state(place),
            position_rad: angle.map_or(f64::NAN, |angle| slot.link_rad(angle)),
            velocity_rad_s: speed.map_or(f64::NAN, |speed| f64::from(speed) * 1e-3 * slot.sign),
            torque_nm: f64::NAN,
            hold_position_rad: f64::NAN,
            homing: HomingState::None,
            fixed_pdos: FixedPdos::NONE,
            received: self.received.get(place).copied().flatten(),
            status_word: self.controller.status_word(place),
            error_code,
            refused_object,
            refused_numbers,
            warning: false,
            lost_master: false,
            // Its faults stand in its state.
            emergency: 0,
            emergencies: 0,
        }
    }

    fn clear_faults(&mut self) {
        self.controller.clear_faults(self.clock.now());
    }

    fn start_over(&mut self) {
        self.controller.start_over(self.clock.now());
        self.received = [None; JOINTS];
        self.clock.forget_other_master();
    }

    fn set_zero(&mut self, joint: usize) -> Result<(), ZeroRefused> {
        let place = self.place_of(joint).ok_or(ZeroRefused::NoSuchJoint)?;
        if self.controller.set_zero(place) { Ok(()) } else { Err(ZeroRefused::NotReady) }
    }

    fn other_master(&self) -> Option<CanId> {
        self.clock.other_master()
    }

    fn explain(&self, error_code: u32) -> String {
        crate::words::explain(error_code)
    }
}
