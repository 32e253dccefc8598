//! Drivers that do what no driver may do, so that the checker can be seen to find it.
use taustream_drivers::protocols::BusDriver;
use taustream_drivers::{
    CanFrame, CanId, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus,
};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Cycles of motion after which a planted fault begins, the joint that it hits, and the speed that counts as motion, rad/s.
const AFTER_CYCLES: u32 = 200;
const JOINT: usize = 0;
const MOVING_RAD_S: f64 = 0.3;
/// Share of its largest speed below which a joint is about to stop, and cycles that a driver which ignores it goes on.
const STOPPING_SHARE: f64 = 0.3;
const RUNS_ON_CYCLES: u32 = 1_500;
/// Cycles of drives that are ready to be energised, after which a driver energises them by itself.
const ENERGISES_AFTER: u32 = 10;

/// What the driver does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlantedFault {
    /// One setpoint is twice as far from the one before as commanded.
    DoubledStep,
    /// A joint gets its last setpoint again for a while, and jumps to where it should be.
    HeldAndJumped {
        /// Cycles for which it is held.
        cycles: u32,
    },
    /// The setpoint swings about the commanded one, too hard for the jerk limit and within that of the acceleration.
    Ripple,
    /// Setpoints beyond the range of the joint.
    OutOfRange,
    /// A joint that is to come to rest goes on at its speed.
    IgnoredStop,
    /// The drives are energised without a command.
    EnergisedAlone,
    /// Signs of two joints are mixed up.
    OtherJoint,
}

/// A shipped driver with a fault.
pub struct PlantedDriver {
    driver: BusDriver,
    fault: PlantedFault,
    ready: u32,
    moving: u32,
    last: [JointCommand; MAX_JOINTS],
    sent_rad: f64,
    speed_rad_s: f64,
    runs_on: Option<u32>,
}

impl PlantedDriver {
    /// Plants a fault.
    #[must_use]
    pub fn new(driver: BusDriver, fault: PlantedFault) -> Self {
        Self {
            driver,
            fault,
            ready: 0,
            moving: 0,
            last: [JointCommand::default(); MAX_JOINTS],
            sent_rad: 0.0,
            speed_rad_s: 0.0,
            runs_on: None,
        }
    }

    /// What the joint is commanded instead.
    fn spoil(&mut self, command: &JointCommand, joints: &JointArray) -> f64 {
        let (is_rad, was_rad) = (command.position_rad, self.last[JOINT].position_rad);
        let since = self.moving.saturating_sub(AFTER_CYCLES);
        match self.fault {
            PlantedFault::DoubledStep if since == 1 => 2.0 * is_rad - was_rad,
            PlantedFault::HeldAndJumped { cycles } if (1..=cycles).contains(&since) => self.sent_rad,
            PlantedFault::Ripple if since > 0 => is_rad + 1.5e-4 * (0.3 * f64::from(since)).sin(),
            PlantedFault::OutOfRange if since > 0 => is_rad + 10.0,
            PlantedFault::OtherJoint if since > 0 => joints[JOINT + 1],
            PlantedFault::IgnoredStop => self.run_on(command),
            PlantedFault::DoubledStep
            | PlantedFault::HeldAndJumped { .. }
            | PlantedFault::Ripple
            | PlantedFault::OutOfRange
            | PlantedFault::EnergisedAlone
            | PlantedFault::OtherJoint => is_rad,
        }
    }

    /// Goes on at its speed when the joint is about to stop.
    fn run_on(&mut self, command: &JointCommand) -> f64 {
        let speed_rad_s = command.velocity_rad_s;
        let slow = speed_rad_s.abs() < STOPPING_SHARE * self.speed_rad_s.abs();
        if self.runs_on.is_none() && speed_rad_s.abs() >= self.speed_rad_s.abs() {
            self.speed_rad_s = speed_rad_s;
        } else if self.runs_on.is_none() && self.moving > 0 && slow {
            (self.runs_on, self.speed_rad_s) = (Some(RUNS_ON_CYCLES), speed_rad_s);
        }
        match &mut self.runs_on {
            Some(left) if *left > 0 => {
                *left -= 1;
                self.sent_rad + self.speed_rad_s * 1e-3
            }
            Some(_) | None => command.position_rad,
        }
    }
}

impl ServoDriver for PlantedDriver {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        let mut joints = self.driver.joints().iter();
        let ready = joints.all(|joint| self.driver.status(*joint).state == DriveState::Disabled);
        self.ready += u32::from(ready);
        let alone = self.fault == PlantedFault::EnergisedAlone && self.ready > ENERGISES_AFTER;
        let drive_target = if alone { DriveTarget::Enabled } else { drive_target };
        let mut spoiled = *commands;
        if drive_target == DriveTarget::Enabled && self.driver.joints().contains(&JOINT) {
            let moves = commands[JOINT].velocity_rad_s.abs() > MOVING_RAD_S;
            self.moving += u32::from(moves || self.moving > 0);
            spoiled[JOINT].position_rad =
                self.spoil(&commands[JOINT], &commands.map(|command| command.position_rad));
        }
        self.sent_rad = spoiled[JOINT].position_rad;
        self.last = *commands;
        self.driver.encode(now, drive_target, &spoiled, out);
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        self.driver.decode(now, frame);
    }

    fn joints(&self) -> &[usize] {
        self.driver.joints()
    }

    fn status(&self, joint: usize) -> ServoStatus {
        self.driver.status(joint)
    }

    fn clear_faults(&mut self) {
        self.driver.clear_faults();
    }

    fn start_over(&mut self) {
        self.driver.start_over();
    }

    fn other_master(&self) -> Option<CanId> {
        self.driver.other_master()
    }

    fn explain(&self, error_code: u32) -> String {
        self.driver.explain(error_code)
    }
}
