//! The drivers of a shipped bus against the simulated servos of its `[simulator]`.
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::protocols::{self, BusDriver};
use taustream_drivers::sim::ServoSimulator;
use taustream_drivers::sim::settings::drives;
use taustream_drivers::{CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver};
use taustream_motion::MAX_JOINTS;

/// An arm in memory, at the period of its settings.
pub(crate) struct Arm {
    pub(crate) driver: BusDriver,
    pub(crate) simulator: ServoSimulator,
    pub(crate) period_ns: u64,
    pub(crate) now: Nanos,
    pub(crate) target: DriveTarget,
    pub(crate) commands: [JointCommand; MAX_JOINTS],
    pub(crate) arriving: Vec<CanFrame>,
}

/// Shipped settings with some of the text replaced, everywhere.
pub(crate) fn settings(name: &str, edits: &[(&str, &str)]) -> Settings {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(name);
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "no {from:?}");
        text = text.replace(from, to);
    }
    Settings::from_toml(&path, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

impl Arm {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            driver: protocols::of_bus(settings, 0).unwrap(),
            simulator: ServoSimulator::new(drives(settings, None).unwrap(), 1, 1),
            period_ns: u64::from(settings.cycle.period_us) * 1000,
            now: Nanos(1_000_000_000),
            target: DriveTarget::Disabled,
            commands: [JointCommand::default(); MAX_JOINTS],
            arriving: Vec::new(),
        }
    }

    pub(crate) fn step(&mut self) {
        let mut batch = FrameBatch::new();
        self.driver.encode(self.now, self.target, &self.commands, &mut batch);
        for frame in self.arriving.drain(..) {
            self.driver.decode(self.now, &frame);
        }
        let mut out = [Vec::new()];
        self.simulator.advance(self.now, &mut out);
        self.simulator.receive(self.now, 0, batch.frames(), &mut out);
        self.arriving.append(&mut out[0]);
        self.now.0 += self.period_ns;
    }

    pub(crate) fn until(&mut self, state: DriveState) {
        for _ in 0..3_000 {
            if (0..6).all(|joint| self.driver.status(joint).state == state) {
                return;
            }
            self.step();
        }
        let status = self.driver.status(0);
        panic!(
            "not {state:?}: {:?} {}",
            status.state,
            taustream_drivers::words::explain_refusal(&status.refusal())
        );
    }

    pub(crate) fn enable(&mut self) {
        self.until(DriveState::Disabled);
        (0..20).for_each(|_| self.step());
        for joint in 0..6 {
            self.commands[joint].position_rad = self.driver.status(joint).position_rad;
        }
        self.target = DriveTarget::Enabled;
        self.until(DriveState::Enabled);
    }
}
