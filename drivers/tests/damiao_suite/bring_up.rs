//! From silence to a configured motor: what is looked at, what is written, and what is refused.
use super::{Arm, DamiaoArm, JOINTS, edited, motor_of, pos_vel};
use taustream_arm::BusKind;
use taustream_drivers::protocols::damiao::frames::{Request, Special, Wire};
use taustream_drivers::{CanFrame, DriveState, DriveTarget, protocols};

/// Everything that motor 1 is sent, without repetitions of the same frame.
fn requests(arm: &mut Arm, cycles: u32) -> Vec<Request> {
    let mut seen: Vec<Request> = Vec::new();
    for _ in 0..cycles {
        arm.step();
        for frame in &arm.sent {
            if let Some(request) = Request::decode(frame, 1)
                && seen.last() != Some(&request)
            {
                seen.push(request);
            }
        }
    }
    seen
}

#[test]
fn bring_up_looks_first_and_writes_only_the_watchdog_of_a_motor_in_the_right_mode() {
    let mut arm = Arm::new();
    let seen = requests(&mut arm, 400);
    assert_eq!(
        seen,
        [
            Request::Refresh,
            Request::Read(21),
            Request::Read(22),
            Request::Read(23),
            Request::Read(10),
            Request::Write(9, 2000_u32.to_le_bytes()),
            Request::Read(9),
            Request::Refresh,
        ]
    );
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
    for joint in 0..6 {
        let off_rad = (arm.status(joint).position_rad - super::START_RAD[joint]).abs();
        // One step of the wire, and a joint that has sagged in its brake not at all.
        assert!(off_rad < 25.0 / 65_535.0, "joint {joint}: {off_rad} rad off");
    }
}

#[test]
fn mode_of_the_motor_is_written_read_back_and_survives_no_power_cycle() {
    let mut arm = Arm::with(pos_vel(), |_| {});
    let seen = requests(&mut arm, 600);
    let write = seen.iter().position(|r| *r == Request::Write(10, 2_u32.to_le_bytes())).unwrap();
    assert_eq!(seen[write - 1], Request::Read(10));
    assert_eq!(seen[write + 1], Request::Read(10), "and read back");
    assert!(!seen.contains(&Request::Store), "the flash is the owner's");
    assert_eq!(arm.states(), [DriveState::Disabled; 6]);
}

#[test]
fn every_motor_has_one_request_in_flight_while_it_is_configured() {
    let mut arm = Arm::with(edited(&[]), |setup| motor_of(setup).boot_s = 0.0);
    let mut open = 0_i32;
    for _ in 0..400 {
        if arm.status(0).state == DriveState::Disabled {
            return;
        }
        arm.step();
        open += i32::try_from(arm.sent.iter().filter(|frame| Request::is_to(frame, 1)).count()).unwrap();
        assert!(open <= 1, "{open} requests are open");
        open -= i32::try_from(arm.arriving.iter().filter(|frame| frame.id().raw() == 0x11).count()).unwrap();
        assert!(open >= 0);
    }
    panic!("never configured");
}

#[test]
fn motor_that_scales_otherwise_is_refused_with_register_and_value() {
    for (register, words) in [
        (
            0,
            "register 21 (PMAX) of the motor holds 12.566 and the settings say otherwise; make position_range_rad",
        ),
        (1, "register 22 (VMAX) of the motor holds 12.566"),
        (2, "register 23 (TMAX) of the motor holds 12.566"),
    ] {
        let mut arm = Arm::with(edited(&[]), |setup| {
            if setup.joint == "elbow" {
                motor_of(setup).ranges[register] = 12.566;
            }
        });
        arm.until_one(2, DriveState::Refused);
        assert!(arm.why(2).contains(words), "{}", arm.why(2));
        arm.steps(600);
        assert_eq!(arm.status(1).state, DriveState::Disabled, "its neighbours come up");
        assert!(arm.status(2).position_rad.is_nan(), "nobody knows what it says");
        // A target of enabled does not move a refused motor.
        arm.drive_target = DriveTarget::Enabled;
        arm.steps(500);
        assert_eq!((arm.status(2).state, arm.nibble(2)), (DriveState::Refused, 0));
    }
}

#[test]
fn motor_that_does_not_take_what_is_written_is_refused_and_taken_once_it_does() {
    let mut arm = Arm::new();
    arm.fault(3, "kind=refuse,value=0x08000022");
    arm.until_one(3, DriveState::Refused);
    assert!(arm.why(3).contains("register 9 (TIMEOUT) of the motor holds 0 "), "{}", arm.why(3));
    arm.simulator.clear(None);
    arm.steps(50);
    assert_eq!(arm.status(3).state, DriveState::Refused, "nothing is tried again by itself");
    arm.clear_faults();
    arm.until(DriveState::Disabled);
}

#[test]
fn motor_that_somebody_else_has_energised_is_left_alone_until_torque_off() {
    let mut arm = Arm::new();
    // Another master, long gone: the motor is enabled when we come.
    let mut out = [Vec::new()];
    let enable = Request::Special(Special::Enable, 0).encode(3, Wire::Classic);
    arm.now.0 += 100_000_000;
    arm.simulator.advance(arm.now, &mut out);
    arm.now.0 += 100_000_000;
    arm.simulator.advance(arm.now, &mut out);
    arm.simulator.receive(arm.now, 0, &[enable], &mut out);
    assert_eq!(arm.nibble(2), 1);
    arm.until_one(2, DriveState::EnergisedUnowned);
    for _ in 0..2_000 {
        arm.step();
        for frame in &arm.sent {
            assert!(
                matches!(Request::decode(frame, 3), None | Some(Request::Refresh)),
                "an energised motor was sent {frame:?}"
            );
        }
    }
    assert_eq!((arm.status(2).state, arm.nibble(2)), (DriveState::EnergisedUnowned, 1));
    arm.drive_target = DriveTarget::TorqueOff;
    arm.step();
    assert_eq!(arm.nibble(2), 0, "the emergency reaches it in the same cycle");
    arm.drive_target = DriveTarget::Disabled;
    arm.until(DriveState::Disabled);
}

/// Goal: motors that a streamer has left energised are never adopted by guess, in either mode: the next one says so, what to
/// do, and sends nothing but requests for feedback; an arm that was made safe comes up.
#[test]
fn motors_that_a_dead_streamer_left_energised_are_unowned_in_each_mode() {
    for settings in [edited(&[]), pos_vel()] {
        let mut arm = Arm::enabled(settings.clone());
        arm.driver = protocols::of_bus(&settings, 0).unwrap();
        arm.drive_target = DriveTarget::Disabled;
        arm.until(DriveState::EnergisedUnowned);
        for joint in 0..JOINTS {
            let said = arm.why(joint);
            for words in ["energised before this streamer came", "`torque-off`", "TIMEOUT", "`clear-fault`"] {
                assert!(said.contains(words), "{said}");
            }
        }
        arm.step();
        for frame in &arm.sent {
            let node = frame.data()[0];
            let request = Request::decode(frame, node);
            assert!(
                matches!(request, None | Some(Request::Refresh)),
                "an energised motor was sent {frame:?}"
            );
        }
        // Nobody commands them: their own watchdogs disable them, which is a fault until it is cleared.
        arm.until(DriveState::Fault);
        arm.clear_faults();
        arm.enable();
    }
}

#[test]
fn bus_with_another_master_is_left_alone_until_it_is_quiet() {
    let mut arm = Arm::new();
    let foreign = Request::Read(3).encode(2, Wire::Classic);
    for _ in 0..1_500 {
        arm.step();
        arm.arriving.push(foreign);
        assert!(
            arm.sent.iter().all(|frame| frame.id().raw() == 0x7FF && frame.data()[2] == 0xCC),
            "only looks"
        );
    }
    assert_eq!(arm.states(), [DriveState::Configuring; 6]);
    assert!(arm.why(0).contains("another master commands"), "{}", arm.why(0));
    arm.until(DriveState::Disabled);
}

#[test]
fn absent_motor_is_asked_ten_times_a_second_and_no_more() {
    let mut arm = Arm::new();
    arm.fault(4, "kind=silence");
    arm.steps(2_000);
    let requested: usize = (0..1_000)
        .map(|_| {
            arm.step();
            arm.sent.iter().filter(|frame| Request::is_to(frame, 5)).count()
        })
        .sum();
    assert!((9..=11).contains(&requested), "{requested} requests a second");
    assert_eq!(arm.status(4).state, DriveState::Absent);
    assert!(arm.why(4).contains("does not answer"), "{}", arm.why(4));
    arm.simulator.clear(None);
    arm.until(DriveState::Disabled);
}

#[test]
fn motors_on_an_fd_bus_are_spoken_to_in_fd_frames_with_bit_rate_switch() {
    let mut settings = edited(&[]);
    settings.buses[0].kind = BusKind::Fd { bitrate_bit_s: 1_000_000, data_bitrate_bit_s: 5_000_000 };
    let mut arm = Arm::enabled(settings.clone());
    arm.step();
    assert_eq!(arm.sent.len(), 6);
    let fd8 = |frame: &CanFrame| frame.is_fd() && frame.data().len() == 8;
    assert!(arm.sent.iter().all(fd8) && arm.arriving.iter().all(fd8), "both ways");
    // A classic motor does not receive them.
    let mut other_format = Arm::with(settings, |setup| motor_of(setup).wire = Wire::Classic);
    other_format.steps(500);
    assert_eq!(other_format.states(), [DriveState::Absent; 6]);
}
