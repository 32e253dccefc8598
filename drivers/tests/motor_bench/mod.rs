//! A bench of a bus in memory: the drivers of its settings against its simulated servos, in cycles of 1 ms.
use std::path::{Path, PathBuf};
use taustream_arm::Settings;
use taustream_drivers::protocols::{self, BusDriver};
use taustream_drivers::sim::settings::{DriveSetup, drives};
use taustream_drivers::sim::{FaultRequest, ServoModel, ServoSimulator};
use taustream_drivers::{
    CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus,
};
use taustream_motion::MAX_JOINTS;

/// Joints of the shipped arms.
pub(crate) const JOINTS: usize = 6;
/// Where a UR5 stands free.
pub(crate) const START_RAD: [f64; JOINTS] = [0.1, -1.2, 1.0, -0.5, 0.3, -0.2];

pub(crate) struct Arm {
    pub(crate) driver: BusDriver,
    pub(crate) simulator: ServoSimulator,
    pub(crate) settings: Settings,
    pub(crate) now: Nanos,
    pub(crate) drive_target: DriveTarget,
    pub(crate) commands: [JointCommand; MAX_JOINTS],
    /// Frames of the newest cycle.
    pub(crate) sent: Vec<CanFrame>,
    /// Frames of the servos that arrive in the next cycle.
    pub(crate) arriving: Vec<CanFrame>,
}

pub(crate) fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(name)
}

/// Shipped settings with some of the text replaced, everywhere.
pub(crate) fn edited(name: &str, edits: &[(&str, &str)]) -> Settings {
    let path = file(name);
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "the shipped settings have no {from:?}");
        text = text.replace(from, to);
    }
    Settings::from_toml(&path, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

impl Arm {
    /// An arm whose simulated servos are changed before they power up.
    pub(crate) fn with(settings: Settings, change: impl Fn(&mut DriveSetup)) -> Self {
        let mut setups = drives(&settings, Some(&START_RAD)).unwrap();
        setups.iter_mut().for_each(change);
        Self {
            driver: protocols::of_bus(&settings, 0).unwrap(),
            simulator: ServoSimulator::new(setups, 1, 1),
            settings,
            now: Nanos(1_000_000_000),
            drive_target: DriveTarget::Disabled,
            commands: [JointCommand::default(); MAX_JOINTS],
            sent: Vec::new(),
            arriving: Vec::new(),
        }
    }

    pub(crate) fn step(&mut self) {
        let mut batch = FrameBatch::new();
        self.driver.encode(self.now, self.drive_target, &self.commands, &mut batch);
        self.sent = batch.frames().to_vec();
        for frame in self.arriving.drain(..) {
            self.driver.decode(self.now, &frame);
        }
        let mut out = [Vec::new()];
        self.simulator.advance(self.now, &mut out);
        self.simulator.receive(self.now, 0, &self.sent, &mut out);
        self.arriving.append(&mut out[0]);
        self.now.0 += 1_000_000;
    }

    pub(crate) fn steps(&mut self, count: u32) {
        for _ in 0..count {
            self.step();
        }
    }

    pub(crate) fn status(&self, joint: usize) -> ServoStatus {
        self.driver.status(joint)
    }

    pub(crate) fn states(&self) -> Vec<DriveState> {
        (0..self.settings.servos.len()).map(|joint| self.status(joint).state).collect()
    }

    /// Cycles until all servos are in the state.
    pub(crate) fn until(&mut self, state: DriveState) -> u32 {
        for cycle in 0..6_000 {
            if self.states().iter().all(|other| *other == state) {
                return cycle;
            }
            self.step();
        }
        panic!("not {state:?} but {:?}: {}", self.states(), self.why(0));
    }

    /// Cycles until one servo is in the state.
    pub(crate) fn until_one(&mut self, joint: usize, state: DriveState) -> u32 {
        for cycle in 0..6_000 {
            if self.status(joint).state == state {
                return cycle;
            }
            self.step();
        }
        panic!("joint {joint} is not {state:?} but {:?}: {}", self.status(joint).state, self.why(joint));
    }

    /// What an operator reads about a servo.
    pub(crate) fn why(&self, joint: usize) -> String {
        let status = self.status(joint);
        taustream_drivers::words::explain_refusal(&status.refusal())
    }

    /// Sets the commands to where the joints are, as the streamer does before it enables.
    pub(crate) fn hold(&mut self) {
        for joint in 0..self.settings.servos.len() {
            self.commands[joint] =
                JointCommand { position_rad: self.status(joint).position_rad, ..JointCommand::default() };
        }
    }

    /// Configured, and a while of feedback, as in the streamer before anything is energised.
    pub(crate) fn ready(&mut self) {
        self.until(DriveState::Disabled);
        self.steps(50);
        self.hold();
    }

    pub(crate) fn enable(&mut self) {
        self.ready();
        self.drive_target = DriveTarget::Enabled;
        self.step();
        self.until(DriveState::Enabled);
    }

    pub(crate) fn enabled(settings: Settings) -> Self {
        let mut arm = Self::with(settings, |_| {});
        arm.enable();
        arm
    }

    pub(crate) fn disable(&mut self) {
        self.drive_target = DriveTarget::Disabled;
        self.step();
    }

    /// Requests a fault of a joint from now on.
    pub(crate) fn fault(&mut self, joint: usize, spec: &str) {
        let names = self.simulator.joints();
        let text = format!("joint={},{spec}", names[joint]);
        self.simulator.request(self.now, FaultRequest::parse(&text, &names).unwrap());
    }

    pub(crate) fn servo(&self, joint: usize) -> &dyn ServoModel {
        self.simulator.drive(joint).unwrap()
    }

    /// The simulated servos get frames that the driver did not send.
    pub(crate) fn inject(&mut self, frames: &[CanFrame]) -> Vec<CanFrame> {
        let mut out = [Vec::new()];
        self.simulator.advance(self.now, &mut out);
        self.simulator.receive(self.now, 0, frames, &mut out);
        let [out] = out;
        out
    }

    /// The commands swing the joints for so long; the largest distance of each joint from its command.
    pub(crate) fn swing(&mut self, cycles: u32) -> Vec<f64> {
        let base = self.commands;
        let mut errors_rad = vec![0.0_f64; self.settings.servos.len()];
        for cycle in 0..cycles {
            let t_s = f64::from(cycle) * 1e-3;
            for (command, base) in self.commands.iter_mut().zip(base) {
                *command = JointCommand {
                    position_rad: base.position_rad + 0.3 * (1.0 - (2.0 * t_s).cos()),
                    velocity_rad_s: 0.6 * (2.0 * t_s).sin(),
                    ..*command
                };
            }
            self.step();
            for (joint, worst) in errors_rad.iter_mut().enumerate() {
                let off_rad = (self.status(joint).position_rad - self.commands[joint].position_rad).abs();
                *worst = worst.max(off_rad);
            }
        }
        errors_rad
    }
}
