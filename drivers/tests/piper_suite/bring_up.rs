//! From silence to a compared arm, and to one that is refused.
use super::{Bench, START_RAD};
use taustream_drivers::protocols::piper::fault::PiperFault;
use taustream_drivers::protocols::piper::frames::{ALL, Command, JOINTS};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn arm_is_asked_and_compared_and_nothing_of_it_is_changed() {
    let mut bench = Bench::new();
    assert_eq!(bench.states(), [DriveState::Absent; JOINTS]);
    let mut asked = Vec::new();
    for _ in 0..400 {
        bench.step();
        asked.extend(bench.commanded());
    }
    assert_eq!(bench.states(), [DriveState::Disabled; JOINTS]);
    let mut expected: Vec<Command> = (1..=6).map(Command::AskLimits).collect();
    expected.push(Command::AskFirmware);
    assert_eq!(asked, expected);
}

#[test]
fn angles_are_those_of_the_links() {
    let mut bench = Bench::with(|_, parameters| parameters.plant.gravity_nm = 0.0);
    bench.until(DriveState::Disabled);
    for (joint, start_rad) in START_RAD.iter().enumerate() {
        let away_rad = bench.status(joint).position_rad - start_rad;
        assert!(away_rad.abs() < 2e-5, "joint {joint} is {away_rad} rad away");
    }
}

#[test]
fn arm_that_another_master_energised_is_left_as_it_is() {
    let mut bench = Bench::new();
    bench.steps(12);
    bench.inject(Command::Enable(2));
    for _ in 0..400 {
        bench.step();
        assert_eq!(bench.commanded(), []);
    }
    assert_eq!(bench.states(), [DriveState::EnergisedUnowned; JOINTS]);
    assert!(bench.why(0).contains("energised before this streamer came"), "{}", bench.why(0));
    // Torque off is possible, and nothing else.
    bench.target = DriveTarget::TorqueOff;
    bench.step();
    assert_eq!(bench.commanded(), [Command::Disable(ALL)]);
    bench.steps(20);
    bench.target = DriveTarget::Disabled;
    bench.until(DriveState::Disabled);
}

#[test]
fn narrower_limits_of_the_arm_are_refused_with_both_numbers() {
    for (change, words) in [
        (0, "least angle of this joint is -1.5708 rad, but the robot goes to -1.7453 rad"),
        (1, "greatest angle of this joint is 1.5708 rad, but the robot goes to 1.7453 rad"),
        (2, "speed limit of this joint is 2.500 rad/s, but the robot stops from 3.000 rad/s"),
    ] {
        let mut bench = Bench::with(|joint, parameters| match (joint, change) {
            (3, 0) => parameters.limits.least_decidegrees = -900,
            (3, 1) => parameters.limits.most_decidegrees = 900,
            (3, 2) => parameters.limits.speed_mrad_s = 2500,
            _ => {}
        });
        bench.until_one(3, DriveState::Refused);
        assert_eq!(bench.status(3).error_code, PiperFault::Limits.code());
        assert!(bench.why(3).contains(words), "{}", bench.why(3));
        assert_eq!(bench.status(2).state, DriveState::Configuring);
    }
}

#[test]
fn another_firmware_is_refused_for_the_whole_arm() {
    let mut bench = Bench::with(|_, parameters| parameters.firmware = *b"S-V1.8-2");
    bench.until(DriveState::Refused);
    assert!(bench.why(5).contains("another firmware"), "{}", bench.why(5));
    bench.driver.clear_faults();
    bench.step();
    assert_eq!(bench.states(), [DriveState::Configuring; JOINTS]);
}

/// A device that is no Piper, or half of one: its frames do not suffice.
#[test]
fn arm_of_which_a_part_is_silent_is_absent() {
    let mut bench = Bench::new();
    bench.silent[3] = true;
    bench.steps(400);
    assert_eq!(bench.states(), [DriveState::Absent; JOINTS]);
    assert!(bench.why(0).contains("does not send its state, angles and drivers"), "{}", bench.why(0));
    bench.silent[3] = false;
    bench.until(DriveState::Disabled);
}

/// A leader arm sends the very frames of a master.
#[test]
fn leader_arm_on_the_bus_is_another_master() {
    let mut bench = Bench::new();
    for _ in 0..200 {
        bench.arriving.push(Command::Targets(0, [0, 0]).encode());
        bench.step();
        assert!(bench.sent.is_empty());
    }
    assert!(bench.driver.other_master().is_some());
    assert!(bench.why(0).contains("leader arm"), "{}", bench.why(0));
    bench.until(DriveState::Disabled);
}
