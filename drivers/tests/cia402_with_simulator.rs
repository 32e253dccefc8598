//! The master against the simulated drives, frame by frame in memory: two independent readings of one protocol.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::codec::cia402::{Cia402Driver, CountScale, rad_from_counts};
use taustream_drivers::sim::{Drive, ServoSimulator, settings::drives};
use taustream_drivers::{CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver};
use taustream_motion::MAX_JOINTS;

const JOINTS: usize = 6;
/// Where a UR5 stands free.
const START_RAD: [f64; JOINTS] = [0.1, -1.2, 1.0, -0.5, 0.3, -0.2];

/// Six simulated drives and their master, in cycles of 1 ms.
struct Arm {
    driver: Cia402Driver,
    simulator: ServoSimulator,
    settings: Settings,
    now: Nanos,
    drive_target: DriveTarget,
    commands: [JointCommand; MAX_JOINTS],
    /// Frames of the drives that arrive in the next cycle.
    arriving: Vec<CanFrame>,
}

impl Arm {
    fn new() -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
        let settings = Settings::load(&file).unwrap();
        let setups = drives(&settings, Some(&START_RAD)).unwrap();
        Self {
            driver: Cia402Driver::new(&settings, 0).unwrap(),
            simulator: ServoSimulator::new(setups, 1, 1),
            settings,
            now: Nanos(1_000_000_000),
            drive_target: DriveTarget::Disabled,
            commands: [JointCommand::default(); MAX_JOINTS],
            arriving: Vec::new(),
        }
    }

    fn step(&mut self) {
        let mut batch = FrameBatch::new();
        self.driver.encode(self.now, self.drive_target, &self.commands, &mut batch);
        for frame in self.arriving.drain(..) {
            self.driver.decode(self.now, &frame);
        }
        let mut out = [Vec::new()];
        self.simulator.advance(self.now, &mut out);
        self.simulator.receive(self.now, 0, batch.frames(), &mut out);
        self.arriving.append(&mut out[0]);
        self.now.0 += 1_000_000;
    }

    fn states(&self) -> [DriveState; JOINTS] {
        std::array::from_fn(|joint| self.driver.status(joint).state)
    }

    /// Cycles until all drives are in the state.
    fn until(&mut self, state: DriveState) -> u32 {
        for cycle in 0..5_000 {
            if self.states() == [state; JOINTS] {
                return cycle;
            }
            self.step();
        }
        let codes: [(u32, u32); JOINTS] = std::array::from_fn(|joint| {
            let status = self.driver.status(joint);
            (status.error_code, status.refused_object)
        });
        panic!("not {state:?} but {:?}, codes {codes:X?}", self.states());
    }

    fn enable(&mut self) {
        self.until(DriveState::Disabled);
        for joint in 0..JOINTS {
            self.commands[joint].position_rad = self.driver.status(joint).position_rad;
        }
        self.drive_target = DriveTarget::Enabled;
        self.step();
        self.until(DriveState::Enabled);
    }
}

#[test]
fn simulated_drives_come_up_follow_a_sine_and_go_down() {
    let mut arm = Arm::new();
    arm.enable();
    let base = arm.commands;
    // The first half second catches joints that fell while they were limp; then it is tracking.
    let (mut caught_rad, mut worst_rad) = (0.0_f64, 0.0_f64);
    // Two cycles of transport: a command acts at the next SYNC, and is seen at the one after it.
    let mut delayed = [base; 3];
    for cycle in 0..4_000 {
        let angle_rad = 0.2 * (1.0 - (f64::from(cycle) * 1e-3 * std::f64::consts::PI).cos());
        for (command, base) in arm.commands.iter_mut().zip(base) {
            command.position_rad = base.position_rad + angle_rad;
        }
        delayed.rotate_right(1);
        delayed[0] = arm.commands;
        arm.step();
        assert_eq!(arm.states(), [DriveState::Enabled; JOINTS], "cycle {cycle}");
        for (joint, command) in delayed[2].iter().enumerate().take(JOINTS) {
            let lag_rad = command.position_rad - arm.driver.status(joint).position_rad;
            let worst = if cycle < 500 { &mut caught_rad } else { &mut worst_rad };
            *worst = worst.max(lag_rad.abs());
        }
    }
    println!("largest tracking error {worst_rad:.6} rad, while catching the limp joints {caught_rad:.6} rad");
    assert!(caught_rad < arm.settings.supervision.tracking_error_rad_max, "off by {caught_rad} rad");
    assert!(worst_rad < 0.02, "off by {worst_rad} rad; the shipped settings promise well under 0.02");
    let travelled = arm.simulator.drive(0).unwrap().position_rad() - base[0].position_rad;
    assert!(
        travelled.abs() < 0.01,
        "a whole number of periods ends where it began, not {travelled} rad away"
    );
    arm.drive_target = DriveTarget::Disabled;
    arm.step();
    arm.until(DriveState::Disabled);
}

#[test]
fn simulated_drive_and_master_agree_on_sign_gear_and_zero() {
    let mut arm = Arm::new();
    arm.until(DriveState::Disabled);
    for (joint, start_rad) in START_RAD.iter().enumerate() {
        let scale = CountScale::of(&arm.settings.servos[joint]).unwrap();
        let count_rad = (rad_from_counts(&scale, 1) - rad_from_counts(&scale, 0)).abs();
        // Not energised, a joint may fall: the feedback is up to two cycles older than the drive's own angle.
        let drive = arm.simulator.drive(joint).unwrap();
        let aged_rad = drive.velocity_rad_s().abs() * 2e-3 + 1e-4;
        let off_rad = (arm.driver.status(joint).position_rad - drive.position_rad()).abs();
        assert!(off_rad <= 2.0 * count_rad + aged_rad, "joint {joint}: {off_rad:e} rad off");
        assert!((drive.position_rad() - start_rad).abs() < 1.0, "joint {joint} is nowhere near its start");
    }
}

#[test]
fn restarted_master_that_still_observes_energised_drives_releases_them_on_request() {
    let mut arm = Arm::new();
    arm.enable();
    // The old master is gone without a word; the new one comes up before the drives miss it.
    arm.driver = Cia402Driver::new(&arm.settings, 0).unwrap();
    arm.drive_target = DriveTarget::Disabled;
    for _ in 0..20 {
        arm.step();
    }
    assert_eq!(arm.states(), [DriveState::Configuring; JOINTS]);
    arm.drive_target = DriveTarget::TorqueOff;
    for _ in 0..300 {
        arm.step();
    }
    assert!(
        (0..JOINTS)
            .all(|joint| arm.simulator.drive(joint).unwrap().get::<Drive>().unwrap().statusword() & 0x04 == 0)
    );
    arm.drive_target = DriveTarget::Disabled;
    arm.until(DriveState::Disabled);
}
