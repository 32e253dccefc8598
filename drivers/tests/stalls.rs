//! What a stall of the setpoints does to a joint, by kind of drive and by what is sent after it: the table of
//! `docs/adr/0012-what-follows-a-stall.md`, measured on simulated drives.
//!
//! A joint moves at constant speed. For 3 to 20 ms no frame comes; then the setpoints continue in one of three ways. Measured is
//! the largest acceleration of the link from the stall's first missing setpoint to 60 ms after its end, from the true
//! velocity, and beside it what arithmetic says of the drive's reference alone.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests fail by panicking; counts of cycles are small"
)]
use std::fmt::Write as _;
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::protocols::{self, BusDriver};
use taustream_drivers::sim::ServoSimulator;
use taustream_drivers::sim::settings::drives;
use taustream_drivers::{CanFrame, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver};
use taustream_motion::MAX_JOINTS;

const PERIOD_S: f64 = 1e-3;
const START_RAD: [f64; 6] = [0.0, -1.2, 1.0, -0.5, 0.3, -0.2];
/// Speed of the joint: so low that no motor reaches its largest torque, and the figures grow in proportion to it.
const SPEED_RAD_S: f64 = 0.02;
/// Time to reach it.
const EASE_S: f64 = 0.2;
/// The joint that moves: the pan, which carries no load.
const JOINT: usize = 0;
/// The first is no stall: what the motion itself needs.
const STALLS_MS: [u32; 7] = [1, 3, 4, 5, 8, 12, 20];

/// What follows a stall.
#[derive(Clone, Copy, Debug, PartialEq)]
enum After {
    /// The last setpoint again, until the joint rests.
    Freeze,
    /// The next setpoint of the path, as if no time had passed.
    FromTheLast,
    /// The setpoint that the path has by now.
    InTime,
}

const WAYS: [After; 3] = [After::Freeze, After::FromTheLast, After::InTime];

/// The path: eased into constant speed.
fn path(t: f64) -> JointCommand {
    let u = (t / EASE_S).clamp(0.0, 1.0);
    // The integral of 3 u^2 - 2 u^3, in proportion to the time beyond the ease.
    let eased_s = EASE_S * (u * u * u - u * u * u * u / 2.0) + (t - EASE_S).max(0.0);
    JointCommand {
        position_rad: START_RAD[JOINT] + SPEED_RAD_S * eased_s,
        velocity_rad_s: SPEED_RAD_S * (3.0 * u * u - 2.0 * u * u * u),
        ..JointCommand::default()
    }
}

struct Arm {
    driver: BusDriver,
    simulator: ServoSimulator,
    now: Nanos,
    drive_target: DriveTarget,
    commands: [JointCommand; MAX_JOINTS],
    arriving: Vec<CanFrame>,
}

impl Arm {
    fn new(file: &str, simulator: &str) -> Self {
        let is_pos_vel = file == "pos_vel";
        let file = if is_pos_vel { "damiao6.toml" } else { file };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(file);
        let mut text = std::fs::read_to_string(&path).unwrap();
        if is_pos_vel {
            let gains = ["stiffness_nm_rad = ", "damping_nm_s_rad = ", "gain_ramp_ms = "];
            let lines = text.lines().filter(|line| !gains.iter().any(|gain| line.starts_with(gain)));
            text = lines.collect::<Vec<_>>().join("\n").replace("mode = \"mit\"", "mode = \"pos_vel\"");
        }
        let text = if text.contains("\n[simulator]\n") {
            text.replace("\n[simulator]\n", &format!("\n[simulator]\n{simulator}\n"))
        } else {
            format!("{text}\n[simulator]\n{simulator}\n")
        };
        let settings = Settings::from_toml(&path, &text).unwrap_or_else(|faults| panic!("{faults}"));
        let setups = drives(&settings, Some(&START_RAD)).unwrap_or_else(|faults| panic!("{faults}"));
        let mut arm = Self {
            driver: protocols::of_bus(&settings, 0).unwrap(),
            simulator: ServoSimulator::new(setups, 1, 1),
            now: Nanos(1_000_000_000),
            drive_target: DriveTarget::Disabled,
            commands: [JointCommand::default(); MAX_JOINTS],
            arriving: Vec::new(),
        };
        arm.until(DriveState::Disabled);
        for _ in 0..50 {
            arm.step();
        }
        for joint in 0..START_RAD.len() {
            arm.commands[joint].position_rad = arm.driver.status(joint).position_rad;
        }
        arm.drive_target = DriveTarget::Enabled;
        arm.until(DriveState::Enabled);
        for _ in 0..600 {
            arm.step();
        }
        arm
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

    /// A period in which no frame comes.
    fn stall(&mut self) {
        let mut out = [Vec::new()];
        self.simulator.advance(self.now, &mut out);
        self.arriving.append(&mut out[0]);
        self.now.0 += 1_000_000;
    }

    fn until(&mut self, state: DriveState) {
        for _ in 0..8_000 {
            if (0..START_RAD.len()).all(|joint| self.driver.status(joint).state == state) {
                return;
            }
            self.step();
        }
        panic!("not {state:?}");
    }

    fn velocity_rad_s(&self) -> f64 {
        self.simulator.drive(JOINT).unwrap().velocity_rad_s()
    }
}

/// The largest acceleration of the link around a stall, and without one.
fn measured(file: &str, simulator: &str, stall: u32, after: After) -> f64 {
    let mut arm = Arm::new(file, simulator);
    let from_rad = arm.commands[JOINT].position_rad - START_RAD[JOINT];
    let command = |t: f64| JointCommand { position_rad: path(t).position_rad + from_rad, ..path(t) };
    let mut ticks = 0_u32;
    for _ in 0..500 {
        ticks += 1;
        arm.commands[JOINT] = command(f64::from(ticks) * PERIOD_S);
        arm.step();
    }
    let last = arm.commands[JOINT];
    let (mut before, mut most) = (arm.velocity_rad_s(), 0.0_f64);
    let mut look = |arm: &Arm| {
        let now = arm.velocity_rad_s();
        most = most.max((now - before).abs() / PERIOD_S);
        before = now;
    };
    // A gap of `stall` periods between two setpoints: one less are missing.
    for _ in 1..stall {
        arm.stall();
        look(&arm);
    }
    for later in 0..60_u32 {
        arm.commands[JOINT] = match after {
            After::Freeze => JointCommand { position_rad: last.position_rad, ..JointCommand::default() },
            After::FromTheLast => command(f64::from(ticks + 1 + later) * PERIOD_S),
            After::InTime => command(f64::from(ticks + stall + later) * PERIOD_S),
        };
        arm.step();
        look(&arm);
    }
    most / SPEED_RAD_S
}

/// What a drive's reference is accelerated by, when it runs along straight lines from setpoint to setpoint.
fn reckoned(extrapolates: bool, stall: u32, after: After) -> f64 {
    let (t, d) = (PERIOD_S, f64::from(stall));
    let [at_the_stall, at_its_end]: [f64; 2] = match (extrapolates, after) {
        (false, After::Freeze) => [1.0, 0.0],
        (false, After::FromTheLast) => [1.0, 1.0],
        // It has to catch up with `d` periods in one, and brakes from that.
        (false, After::InTime) => [1.0, d],
        // The first SYNC after the stall latches the setpoint that came before it.
        (true, After::Freeze | After::FromTheLast) => [0.0, d - 1.0],
        (true, After::InTime) => [0.0, 2.0 * (d - 1.0)],
    };
    at_the_stall.max(at_its_end) / t
}

/// Goal: the setting that each kind of drive has by default is the gentlest of the three for stalls of 3 to 20 ms, by the
/// measured peak of the link's acceleration. The table is printed.
#[test]
fn what_follows_a_stall_by_default_is_the_gentlest_for_each_kind_of_drive() {
    let kinds = [
        ("CiA 402, holds", "vcan6.toml", "", Some(false), After::Freeze),
        ("CiA 402, extrapolates", "vcan6.toml", "extrapolation_ms = 50.0", Some(true), After::InTime),
        ("Damiao MIT", "damiao6.toml", "", None, After::InTime),
        ("Damiao POS_VEL", "pos_vel", "", None, After::Freeze),
    ];
    let mut table =
        String::from("peak acceleration at 1 rad/s, rad/s2 (of the reference alone, by arithmetic)\n");
    let mut wrong = String::new();
    for (kind, file, simulator, extrapolates, by_default) in kinds {
        for stall in STALLS_MS {
            let peaks = WAYS.map(|after| measured(file, simulator, stall, after));
            write!(table, "{kind:<22} {stall:>2} ms").unwrap();
            for (after, peak) in WAYS.into_iter().zip(peaks) {
                let beside = extrapolates
                    .map_or(String::new(), |kind| format!(" ({:.0})", reckoned(kind, stall, after)));
                write!(table, "  {after:?} {peak:.0}{beside}").unwrap();
            }
            table.push('\n');
            let chosen = WAYS.into_iter().position(|after| after == by_default).unwrap();
            let least = peaks.into_iter().fold(f64::INFINITY, f64::min);
            if stall > 1 && peaks[chosen] > least * 1.05 {
                writeln!(wrong, "{kind}, {stall} ms: {by_default:?} is not the gentlest of {peaks:?}")
                    .unwrap();
            }
        }
    }
    std::io::Write::write_all(&mut std::io::stdout(), table.as_bytes()).unwrap();
    assert!(wrong.is_empty(), "{wrong}{table}");
}
