//! The shipped settings: the drivers of their bus against the simulated servos of their `[simulator]`.
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::protocols::{self, BusDriver};
use taustream_drivers::sim::settings::drives;
use taustream_drivers::sim::{FaultRequest, ServoSimulator};
use taustream_drivers::{DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver};

struct Arm {
    driver: BusDriver,
    simulator: ServoSimulator,
    period_ns: u64,
    now: Nanos,
    target: DriveTarget,
    commands: [JointCommand; 8],
    arriving: Vec<taustream_drivers::CanFrame>,
}

fn settings(edits: &[(&str, &str)]) -> Settings {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/piper.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in edits {
        assert!(text.contains(from), "no {from:?}");
        text = text.replace(from, to);
    }
    Settings::from_toml(&path, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

impl Arm {
    fn new(settings: &Settings) -> Self {
        Self {
            driver: protocols::of_bus(settings, 0).unwrap(),
            simulator: ServoSimulator::new(drives(settings, None).unwrap(), 1, 1),
            period_ns: u64::from(settings.cycle.period_us) * 1000,
            now: Nanos(1_000_000_000),
            target: DriveTarget::Disabled,
            commands: [JointCommand::default(); 8],
            arriving: Vec::new(),
        }
    }

    fn step(&mut self) {
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

    fn until(&mut self, state: DriveState) {
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

    fn enable(&mut self) {
        self.until(DriveState::Disabled);
        (0..20).for_each(|_| self.step());
        for joint in 0..6 {
            self.commands[joint].position_rad = self.driver.status(joint).position_rad;
        }
        self.target = DriveTarget::Enabled;
        self.until(DriveState::Enabled);
    }
}

#[test]
fn shipped_settings_drive_the_simulated_arm() {
    let mut arm = Arm::new(&settings(&[]));
    arm.enable();
    let from: Vec<f64> = arm.commands.iter().map(|command| command.position_rad).collect();
    for cycle in 1..=400 {
        let phase = std::f64::consts::PI * f64::from(cycle) / 400.0;
        for (command, from_rad) in arm.commands.iter_mut().zip(&from).take(6) {
            command.position_rad = from_rad + 0.2 * (1.0 - phase.cos());
        }
        arm.step();
    }
    (0..100).for_each(|_| arm.step());
    for joint in 0..6 {
        let away_rad = arm.simulator.drive(joint).unwrap().position_rad() - arm.commands[joint].position_rad;
        assert!(away_rad.abs() < 2e-3, "joint {joint} rests {away_rad} rad away");
    }
}

#[test]
fn faults_on_request_act_on_the_shipped_arm() {
    let mut arm = Arm::new(&settings(&[]));
    arm.enable();
    let names = arm.simulator.joints();
    let text = format!("joint={},kind=fault,value=0x10", names[3]);
    arm.simulator.request(arm.now, FaultRequest::parse(&text, &names).unwrap());
    (0..100).for_each(|_| arm.step());
    let status = arm.driver.status(3);
    assert_eq!(status.state, DriveState::Fault);
    assert_eq!(arm.driver.explain(status.error_code), "driver of the joint: collision detected");
}

/// The arm's own speed limit in the simulator: narrower than the robot file's, it is refused with both numbers.
#[test]
fn slower_arm_than_the_robot_file_says_is_refused() {
    let slow = ("brake = false", "brake = false\npiper_speed_rad_s = [3.0, 3.0, 2.0, 3.0, 3.0, 3.0]");
    let mut arm = Arm::new(&settings(&[slow]));
    (0..400).for_each(|_| arm.step());
    let status = arm.driver.status(2);
    assert_eq!(status.state, DriveState::Refused);
    let words = taustream_drivers::words::explain_refusal(&status.refusal());
    assert!(words.contains("speed limit of this joint is 2.000 rad/s"), "{words}");
}
