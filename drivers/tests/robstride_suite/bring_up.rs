//! From silence to a configured motor: what is looked at, what is written, and what is refused.
use super::{HOST, edited, energised, motor_of, request, requests};
use crate::motor_bench::{Arm, JOINTS, START_RAD};
use std::f64::consts::PI;
use taustream_drivers::codec::mit::MitCommand;
use taustream_drivers::protocols::robstride::RobStrideParameters;
use taustream_drivers::protocols::robstride::frames::{Operation, Request, ranges};
use taustream_drivers::{CanFrame, DriveState, DriveTarget, protocols};

/// Everything that motor 1 is sent, without repetitions of the same frame.
fn seen(arm: &mut Arm, cycles: u32) -> Vec<Request> {
    let mut seen: Vec<Request> = Vec::new();
    for _ in 0..cycles {
        arm.step();
        for request in requests(arm, 1) {
            if seen.last() != Some(&request) {
                seen.push(request);
            }
        }
    }
    seen
}

const WATCHDOG: Request = Request::Write(0x7028, 2_000_u32.to_le_bytes());
/// What motor 1 holds as its limit of torque, written back.
const LOOK: Request = Request::Write(0x700B, 120.0_f32.to_le_bytes());

fn is_look(request: Request) -> bool {
    let limits = [120.0_f32, 60.0, 14.0].map(f32::to_le_bytes);
    matches!(request, Request::Read(0x700B))
        || matches!(request, Request::Write(0x700B, held) if limits.contains(&held))
}

#[test]
fn bring_up_looks_by_writing_back_what_was_read_and_writes_only_the_watchdog() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    let seen = seen(&mut arm, 600);
    assert_eq!(
        seen,
        [
            Request::Read(0x700B),
            LOOK,
            Request::Read(0x700B),
            Request::Read(0x7019),
            Request::Read(0x7005),
            WATCHDOG,
            Request::Read(0x7028),
            LOOK,
        ]
    );
    assert_eq!(arm.states(), [DriveState::Disabled; JOINTS]);
    for joint in 0..JOINTS {
        let off_rad = (arm.status(joint).position_rad - START_RAD[joint]).abs();
        // One step of the wire, and a joint that has sagged in its brake not at all.
        assert!(off_rad < 8.0 * PI / 65_535.0, "joint {joint}: {off_rad} rad off");
    }
}

#[test]
fn mode_of_the_motor_is_written_read_back_and_never_stored() {
    let mut arm = Arm::with(edited(&[]), |setup| motor_of(setup).run_mode = 5);
    let seen = seen(&mut arm, 800);
    let write = seen.iter().position(|request| *request == Request::Write(0x7005, [0; 4])).unwrap();
    assert_eq!(seen[write - 1], Request::Read(0x7005));
    assert_eq!(seen[write + 1], Request::Read(0x7005), "and read back");
    assert!(
        !seen.iter().any(|request| matches!(request, Request::Other(_))),
        "the flash is the owner's: {seen:?}"
    );
    assert_eq!(arm.states(), [DriveState::Disabled; JOINTS]);
}

/// Goal: a motor of another model, or whose field spans something else than the settings say, is refused with what it holds.
#[test]
fn motor_of_another_type_or_range_is_refused_with_parameter_and_value() {
    type Change = fn(&mut RobStrideParameters);
    let changes: [(Change, &str); 4] = [
        (|motor| motor.torque_limit_nm = 17.0, "parameter 0x700B (limit_torque) of the motor holds 17"),
        // It reads 1.0 rad on a field of +-4 pi as 1.0 / 4 pi of its range.
        (|motor| motor.reach[0] = 6.25, "parameter 0x7019 (mechPos) of the motor holds 1"),
        (|motor| motor.torque_limit_nm = f64::NAN, "(limit_torque) of the motor holds NaN"),
        (
            |motor| motor.has_timeout = false,
            "parameter 0x7028 (canTimeout): the motor answers, but not to a read",
        ),
    ];
    for (change, words) in changes {
        let mut arm = Arm::with(edited(&[]), |setup| {
            if setup.joint == "elbow" {
                change(motor_of(setup));
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
        assert_eq!((arm.status(2).state, arm.servo(2).is_enabled()), (DriveState::Refused, false));
    }
}

#[test]
fn motor_that_does_not_take_what_is_written_is_refused_and_taken_once_it_does() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.fault(3, "kind=refuse,value=1");
    arm.until_one(3, DriveState::Refused);
    assert!(arm.why(3).contains("(canTimeout) of the motor holds 0 "), "{}", arm.why(3));
    arm.simulator.clear(None);
    arm.steps(50);
    assert_eq!(arm.status(3).state, DriveState::Refused, "nothing is tried again by itself");
    taustream_drivers::ServoDriver::clear_faults(&mut arm.driver);
    arm.until(DriveState::Disabled);
}

/// Another master, long gone: its motor holds a load when we come. It is recognised, reported and not changed, until the
/// emergency.
#[test]
fn motor_that_somebody_else_has_energised_is_left_alone_until_torque_off() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.now.0 += 100_000_000;
    arm.inject(&[]);
    arm.now.0 += 100_000_000;
    let spans = ranges([4.0 * PI, 20.0, 60.0], 5000.0, 100.0);
    let hold = MitCommand {
        position_rad: 1.0,
        stiffness_nm_rad: 400.0,
        damping_nm_s_rad: 20.0,
        ..MitCommand::default()
    };
    let hold = Operation::encode(&hold, &spans).unwrap();
    arm.inject(&[Request::Operation(hold).encode(0xFC, 3), Request::Enable.encode(0xFC, 3)]);
    assert!(arm.servo(2).is_enabled());
    arm.until_one(2, DriveState::EnergisedUnowned);
    assert!(arm.why(2).contains("energised before this streamer came"), "{}", arm.why(2));
    let held_rad = arm.servo(2).position_rad();
    for _ in 0..2_000 {
        arm.step();
        for request in requests(&arm, 3) {
            assert!(is_look(request), "an energised motor was sent {request:?}");
        }
    }
    assert_eq!((arm.status(2).state, arm.servo(2).is_enabled()), (DriveState::EnergisedUnowned, true));
    assert!((arm.servo(2).position_rad() - held_rad).abs() < 1e-3, "and it holds");
    arm.drive_target = DriveTarget::TorqueOff;
    arm.steps(200);
    assert!(!arm.servo(2).is_enabled(), "the emergency reaches it");
    arm.drive_target = DriveTarget::Disabled;
    arm.until(DriveState::Disabled);
}

/// Motors that a streamer has left energised: the next one says so, and sends nothing that could change them.
#[test]
fn motors_that_a_dead_streamer_left_energised_are_unowned() {
    let settings = edited(&[]);
    let mut arm = Arm::enabled(settings.clone());
    arm.driver = protocols::of_bus(&settings, 0).unwrap();
    arm.drive_target = DriveTarget::Disabled;
    for _ in 0..2_000 {
        arm.step();
        for node in 1..=6 {
            for request in requests(&arm, node) {
                assert!(
                    is_look(request) || !arm.servo(usize::from(node) - 1).is_enabled(),
                    "{request:?} to an energised motor"
                );
            }
        }
        if arm.states() == [DriveState::EnergisedUnowned; JOINTS] {
            return;
        }
        // Nothing commands them: before the second look their own watchdogs may have made them limp, which is as good.
        if energised(&arm).iter().all(|energised| !energised) {
            arm.enable();
            return;
        }
    }
    panic!("{:?}", arm.states());
}

#[test]
fn bus_with_another_master_is_left_alone_until_it_is_quiet() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    let foreign = Request::Read(0x701C).encode(0xFC, 2);
    for _ in 0..1_500 {
        arm.step();
        arm.arriving.push(foreign);
        let looks = |frame: &CanFrame| (1..=6).any(|node| request(frame, node).is_some_and(is_look));
        assert!(arm.sent.iter().all(looks), "only looks: {:?}", arm.sent);
    }
    assert_eq!(arm.states(), [DriveState::Configuring; JOINTS]);
    assert!(arm.why(0).contains("another master commands"), "{}", arm.why(0));
    arm.until(DriveState::Disabled);
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

/// The angle after power-up is known but for whole revolutions, and the field repeats: 0x7019 and the wire are compared as such.
#[test]
fn angle_in_rad_and_angle_on_the_wire_are_one_but_for_turns_of_the_field() {
    let mut arm = Arm::with(edited(&[]), |setup| {
        if setup.joint == "wrist_3" {
            motor_of(setup).mounting.zero_offset_rad = -25.5;
        }
    });
    arm.until(DriveState::Disabled);
    let request = Request::Read(0x7019).encode(HOST, 6);
    let value = arm.inject(&[request]);
    let held_rad = f32::from_le_bytes(value[0].data()[4..].try_into().unwrap());
    assert!(held_rad > 25.0, "{held_rad}");
}
