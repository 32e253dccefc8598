//! From silence to a motor that is off and ours: when it is asked at all, and what is never sent.
use super::{edited, energised, motor_of, requests};
use crate::motor_bench::{Arm, JOINTS, START_RAD};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::cubemars::frames::{Request, Special};
use taustream_drivers::{DriveState, DriveTarget, protocols};

const EXIT: Request = Request::Special(Special::Exit);
const ELBOW: MitRanges = MitRanges::symmetric(12.5, 50.0, 65.0);

/// A command of another master that holds the elbow at an angle.
fn hold(position_rad: f64) -> Request {
    let command =
        MitCommand { position_rad, stiffness_nm_rad: 400.0, damping_nm_s_rad: 5.0, ..MitCommand::default() };
    Request::Mit(command.encode(&ELBOW).unwrap())
}

#[test]
fn motor_is_not_asked_before_its_watchdog_has_passed_in_silence() {
    for (watchdog_ms, quiet) in [("\nwatchdog_ms = 100", 150..=300), ("\nwatchdog_ms = 750", 800..=1_000)] {
        let mut arm = Arm::with(edited(&[("\nwatchdog_ms = 100", watchdog_ms)]), |_| {});
        let mut silent = 0;
        while arm.sent.is_empty() {
            arm.step();
            silent += 1;
        }
        assert!(quiet.contains(&silent), "{watchdog_ms}: asked after {silent} ms");
        assert!((1..=6).all(|node| requests(&arm, node) == [EXIT]), "{:?}", arm.sent);
        arm.until(DriveState::Disabled);
        for joint in 0..JOINTS {
            let off_rad = (arm.status(joint).position_rad - START_RAD[joint]).abs();
            assert!(off_rad < 25.0 / 65_535.0, "joint {joint}: {off_rad} rad off");
        }
    }
}

/// Another master, long gone, whose motor has a watchdog: it has dropped its command by itself before it is asked anything.
#[test]
fn motor_that_a_dead_master_left_energised_is_limp_before_it_is_asked() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.now.0 += 100_000_000;
    arm.inject(&[]);
    arm.now.0 += 100_000_000;
    arm.inject(&[Request::Special(Special::Enter).encode(3), hold(1.0).encode(3)]);
    let mut angles_rad = Vec::new();
    while arm.sent.is_empty() {
        arm.step();
        angles_rad.push(arm.servo(2).position_rad());
    }
    assert!((angles_rad[90] - 1.0).abs() < 0.03, "until its watchdog it holds: {}", angles_rad[90]);
    let fallen_rad = angles_rad[angles_rad.len() - 1] - angles_rad[90];
    assert!(fallen_rad > 0.01, "it fell before anything was sent: {fallen_rad} rad");
    arm.until(DriveState::Disabled);
}

/// Another master at work: its motor holds a load, and is not touched until that master is silent for longer than the watchdog.
#[test]
fn motor_of_a_master_at_work_is_left_alone_until_torque_off() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.now.0 += 200_000_000;
    arm.inject(&[]);
    arm.now.0 += 200_000_000;
    let works = |arm: &mut Arm, cycles: u32| {
        for _ in 0..cycles {
            let answers = arm.inject(&[Request::Special(Special::Enter).encode(3), hold(1.0).encode(3)]);
            // Whoever listens on a bus hears both.
            arm.arriving.push(hold(1.0).encode(3));
            arm.arriving.extend(answers);
            arm.step();
            if arm.drive_target != DriveTarget::TorqueOff {
                assert!(requests(arm, 3).is_empty(), "an energised motor was sent {:?}", arm.sent);
            }
        }
    };
    works(&mut arm, 2_000);
    assert_eq!((arm.status(2).state, arm.servo(2).is_enabled()), (DriveState::EnergisedUnowned, true));
    assert!(arm.why(2).contains("energised before this streamer came"), "{}", arm.why(2));
    arm.drive_target = DriveTarget::TorqueOff;
    arm.step();
    assert!(requests(&arm, 3).contains(&EXIT), "the emergency reaches it");
    assert!(!arm.servo(2).is_enabled());
    arm.drive_target = DriveTarget::Disabled;
    arm.until(DriveState::Disabled);
}

#[test]
fn motor_of_a_master_that_ends_is_taken_after_its_watchdog() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    for _ in 0..500 {
        arm.step();
        let answers = arm.inject(&[hold(1.0).encode(3)]);
        arm.arriving.push(hold(1.0).encode(3));
        arm.arriving.extend(answers);
    }
    assert_eq!(arm.status(2).state, DriveState::EnergisedUnowned);
    arm.until(DriveState::Disabled);
    arm.enable();
}

/// Motors that a streamer has left energised, with the watchdog that the settings state: they are limp when the next one asks.
#[test]
fn motors_that_a_dead_streamer_left_energised_are_limp_before_the_next_one_asks() {
    let settings = edited(&[]);
    let mut arm = Arm::enabled(settings.clone());
    arm.driver = protocols::of_bus(&settings, 0).unwrap();
    arm.drive_target = DriveTarget::Disabled;
    arm.arriving.clear();
    for _ in 0..150 {
        arm.step();
        assert!(arm.sent.is_empty(), "{:?}", arm.sent);
    }
    assert_eq!(energised(&arm), [true; JOINTS], "still in motor mode, without a command");
    arm.until(DriveState::Disabled);
    assert_eq!(energised(&arm), [false; JOINTS]);
    arm.enable();
}

#[test]
fn absent_motor_is_asked_ten_times_a_second_and_no_more() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.fault(4, "kind=silence");
    arm.steps(2_000);
    let requested: usize = (0..1_000)
        .map(|_| {
            arm.step();
            requests(&arm, 5).len()
        })
        .sum();
    assert!((9..=11).contains(&requested), "{requested} requests a second");
    assert_eq!(arm.status(4).state, DriveState::Absent);
    assert!(arm.why(4).contains("does not answer"), "{}", arm.why(4));
    arm.simulator.clear(None);
    arm.until(DriveState::Disabled);
}

#[test]
fn answers_under_another_identifier_and_of_six_bytes_are_understood() {
    let feedback = [("feedback_id = 1\n", "feedback_id = 0\n"), ("feedback_id = 2\n", "feedback_id = 0\n")];
    let mut arm = Arm::with(edited(&feedback), |setup| motor_of(setup).short_feedback = true);
    arm.enable();
    arm.steps(500);
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
}
