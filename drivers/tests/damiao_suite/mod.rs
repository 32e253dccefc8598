//! A bench of a bus in memory: the drivers of its settings against its simulated servos, in cycles of 1 ms.
use std::path::{Path, PathBuf};
use taustream_arm::Settings;
use taustream_drivers::protocols::BusDriver;
use taustream_drivers::protocols::damiao::{Motor, MotorParameters};
use taustream_drivers::sim::settings::{DriveSetup, drives};
use taustream_drivers::sim::{FaultRequest, ServoModel, ServoSimulator};
use taustream_drivers::{
    CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus, protocols,
};

mod bring_up;
mod faults;
mod frames;
mod golden;
mod hostile;
mod operation;

pub(crate) const JOINTS: usize = 6;
/// Where a UR5 stands free.
pub(crate) const START_RAD: [f64; JOINTS] = [0.1, -1.2, 1.0, -0.5, 0.3, -0.2];

pub(crate) struct Arm {
    pub(crate) driver: BusDriver,
    pub(crate) simulator: ServoSimulator,
    pub(crate) settings: Settings,
    pub(crate) now: Nanos,
    pub(crate) drive_target: DriveTarget,
    pub(crate) commands: [JointCommand; 8],
    /// Frames of the newest cycle.
    pub(crate) sent: Vec<CanFrame>,
    /// Frames of the servos that arrive in the next cycle.
    pub(crate) arriving: Vec<CanFrame>,
}

pub(crate) fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(name)
}

/// The shipped settings of six motors with some of the text replaced, everywhere.
pub(crate) fn edited(edits: &[(&str, &str)]) -> Settings {
    let path = file("damiao6.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "the shipped settings have no {from:?}");
        text = text.replace(from, to);
    }
    Settings::from_toml(&path, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

/// MIT as shipped, or `pos_vel`.
pub(crate) fn pos_vel() -> Settings {
    let kp = [("stiffness_nm_rad = 400.0\n", ""), ("stiffness_nm_rad = 60.0\n", "")];
    let kd = [("damping_nm_s_rad = 5.0\n", ""), ("damping_nm_s_rad = 1.5\n", "")];
    edited(
        &[&kp[..], &kd, &[("gain_ramp_ms = 200\n", ""), ("mode = \"mit\"", "mode = \"pos_vel\"")]].concat(),
    )
}

impl Arm {
    pub(crate) fn new() -> Self {
        Self::with(edited(&[]), |_| {})
    }

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
            commands: [JointCommand::default(); 8],
            sent: Vec::new(),
            arriving: Vec::new(),
        }
    }

    /// The same without brakes: a joint without torque falls.
    pub(crate) fn without_brakes(settings: Settings) -> Self {
        Self::with(settings, |setup| setup.parameters.plant_mut().brake = false)
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

    pub(crate) fn enable(&mut self) {
        self.until(DriveState::Disabled);
        // As in the streamer: a while of feedback before anything is energised.
        self.steps(50);
        self.hold();
        self.drive_target = DriveTarget::Enabled;
        self.step();
        self.until(DriveState::Enabled);
    }

    pub(crate) fn enabled(settings: Settings) -> Self {
        let mut arm = Self::with(settings, |_| {});
        arm.enable();
        arm
    }

    pub(crate) fn clear_faults(&mut self) {
        self.driver.clear_faults();
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

    /// Status nibble of a simulated motor.
    pub(crate) fn nibble(&self, joint: usize) -> u8 {
        self.servo(joint).get::<Motor>().unwrap().status()
    }

    /// Bytes of the newest cycle's frames under an identifier.
    pub(crate) fn under(&self, id: u32) -> Vec<Vec<u8>> {
        self.sent.iter().filter(|frame| frame.id().raw() == id).map(|frame| frame.data().to_vec()).collect()
    }
}

/// The parameters of a motor, to be changed before it powers up.
pub(crate) fn motor_of(setup: &mut DriveSetup) -> &mut MotorParameters {
    setup.parameters.get_mut().unwrap()
}
