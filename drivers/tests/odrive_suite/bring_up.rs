//! From silence to a configured drive, and to one that is refused.
use super::{Bench, JOINTS, TIMEOUT_S, plan};
use taustream_drivers::protocols::odrive::axis::Watchdog;
use taustream_drivers::protocols::odrive::fault::OdriveFault;
use taustream_drivers::protocols::odrive::frames::{Command, Query};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn drives_are_identified_configured_and_their_watchdog_is_read_back() {
    let mut bench = Bench::new();
    assert_eq!(bench.states(), [DriveState::Absent; JOINTS]);
    bench.until(DriveState::Disabled);
    for drive in &bench.drives {
        assert_eq!(drive.watchdog(), (TIMEOUT_S, true));
        assert!(!drive.is_enabled());
    }
    for joint in 0..JOINTS {
        assert!((bench.status(joint).position_rad - super::START_RAD[joint]).abs() < 1e-5, "joint {joint}");
    }
}

#[test]
fn watchdog_of_the_owner_is_neither_read_nor_written() {
    let plan = taustream_drivers::protocols::odrive::axis::AxisPlan { watchdog: Watchdog::Owner, ..plan() };
    let mut bench = Bench::with(plan, |_, _| {});
    for _ in 0..500 {
        bench.step();
        for joint in 0..JOINTS {
            let asks = bench.commanded(joint);
            assert!(asks.iter().all(|command| *command == Command::Request(Query::Version)), "{asks:?}");
        }
    }
    assert_eq!(bench.states(), [DriveState::Disabled; JOINTS]);
}

/// Nothing but a request is sent to a drive that another master has energised, until the operator asks for torque off.
#[test]
fn drive_that_another_master_energised_is_left_as_it_is() {
    let mut bench = Bench::new();
    let mut out = Vec::new();
    let now = bench.now;
    bench.drives[1].advance(now, &mut out);
    bench.now.0 += 100_000_000;
    let frame = Command::AxisState(8).encode(super::node(1));
    let now = bench.now;
    bench.drives[1].receive(now, &frame, &mut out);
    assert!(bench.drives[1].is_enabled());
    for _ in 0..1_000 {
        bench.step();
        assert_eq!(bench.commanded(1), []);
    }
    assert_eq!(bench.status(1).state, DriveState::EnergisedUnowned);
    assert!(bench.drives[1].is_enabled() && bench.drives[1].watchdog() == (0.0, false));
    assert!(bench.why(1).contains("energised before this streamer came"), "{}", bench.why(1));
    assert_eq!(bench.status(0).state, DriveState::Disabled);

    bench.target = DriveTarget::TorqueOff;
    bench.steps(2);
    assert!(!bench.drives[1].is_enabled());
    bench.target = DriveTarget::Disabled;
    bench.until(DriveState::Disabled);
}

#[test]
fn another_hardware_or_firmware_is_refused_with_both_versions() {
    for (change, code, words) in [
        (0, OdriveFault::Hardware, "it states 5.2.0, the settings 4.4.58"),
        (1, OdriveFault::Firmware, "it states 0.5.6, the settings 0.6.11"),
    ] {
        let mut bench = Bench::with(plan(), |joint, parameters| {
            if joint == 2 && change == 0 {
                parameters.version.hardware = [5, 2, 0];
            } else if joint == 2 {
                parameters.version.firmware = [0, 5, 6];
            }
        });
        bench.until_one(2, DriveState::Refused);
        bench.steps(100);
        assert_eq!(bench.status(2).error_code, code.code());
        assert!(bench.why(2).ends_with(words), "{}", bench.why(2));
        assert_eq!(
            bench.drives[2].watchdog(),
            (0.0, false),
            "an endpoint of an unknown firmware was written"
        );
        bench.until_one(0, DriveState::Disabled);
    }
}

#[test]
fn velocity_limit_below_the_joints_is_refused_with_both_numbers() {
    let mut bench = Bench::with(plan(), |joint, parameters| {
        parameters.velocity_limit_turns_s = if joint == 0 { 3.5 } else { f32::INFINITY };
    });
    bench.until_one(0, DriveState::Refused);
    assert!(bench.why(0).contains("3.500 turns/s against 4.000 turns/s"), "{}", bench.why(0));
    let mut bench = Bench::with(plan(), |_, parameters| parameters.velocity_limit_turns_s = f32::NAN);
    bench.until(DriveState::Refused);
}

#[test]
fn watchdog_that_is_not_taken_is_refused() {
    let mut bench = Bench::new();
    bench.drives[0].disturb(taustream_drivers::sim::Disturbance::RefuseWrites(1));
    bench.until_one(0, DriveState::Refused);
    assert_eq!(bench.status(0).error_code, OdriveFault::WatchdogTimeout.code());
    assert!(bench.why(0).contains("it holds 0, the settings say 0.1"), "{}", bench.why(0));
    // Refused drives are tried again from the start when the operator asks for it.
    bench.drives[0].disturb(taustream_drivers::sim::Disturbance::RefuseWrites(0));
    bench.driver.clear_faults();
    bench.until(DriveState::Disabled);
}

/// Firmware before 0.6.11 does not confirm writes; from then on the confirmation must not be taken for what is read back.
#[test]
fn drives_that_do_not_confirm_writes_are_configured_as_well() {
    let mut bench = Bench::with(plan(), |_, parameters| parameters.confirms_writes = false);
    bench.enable();
}

#[test]
fn drive_that_sends_nothing_is_absent_and_its_words_say_what_to_check() {
    let mut bench = Bench::with(plan(), |joint, parameters| {
        if joint == 0 {
            parameters.heartbeat_period_ms = 0;
        }
    });
    bench.silent[1] = true;
    bench.steps(1_000);
    for joint in [0, 1] {
        assert_eq!(bench.status(joint).state, DriveState::Absent, "joint {joint}");
        assert!(bench.why(joint).contains("heartbeat_msg_rate_ms"), "{}", bench.why(joint));
    }
    assert_eq!(bench.status(2).state, DriveState::Disabled);
}

#[test]
fn other_master_keeps_a_drive_from_being_configured() {
    let mut bench = Bench::new();
    for _ in 0..300 {
        bench.arriving.push(Command::ClearErrors.encode(super::node(0)));
        bench.step();
        assert!(bench.sent.is_empty());
    }
    assert!(bench.driver.other_master().is_some());
    assert!(bench.why(0).contains("another master"), "{}", bench.why(0));
    bench.until(DriveState::Disabled);
}
