//! A master that ends while the drives are energised, and the next one that finds them so.
use super::arm::{Arm, shipped};
use taustream_arm::{Reaction, Settings};
use taustream_drivers::codec::cia402::Cia402Driver;
use taustream_drivers::sim::{Drive, PowerState};
use taustream_drivers::words::explain_refusal;
use taustream_drivers::{CanFrame, DriveState, DriveTarget, ServoDriver};

/// Two encoder counts: what a drive steers to may not move by more.
const STILL_RAD: f64 = 1e-6;
/// How far a joint may creep while its loop and its friction settle on a target that rests.
const CREEP_RAD: f64 = 1e-3;

fn settings(reaction: Reaction) -> Settings {
    let mut settings = shipped();
    for servo in &mut settings.servos {
        servo.reaction = reaction;
    }
    settings
}

/// An arm that was moving when its master was killed `ms` ago.
pub(super) fn orphaned(reaction: Reaction, ms: u64) -> Arm {
    let mut arm = Arm::with(settings(reaction));
    arm.enable();
    arm.move_and_measure(0.26);
    assert!(arm.simulator.drive(1).unwrap().velocity_rad_s().abs() > 1.0, "it was not moving");
    arm.alone(ms);
    arm
}

pub(super) fn restart_as(arm: &mut Arm, settings: &Settings) {
    arm.driver = Cia402Driver::new(settings, 0).unwrap();
    for command in &mut arm.commands {
        command.position_rad = 0.0;
    }
}

/// Only SDO reads and the master's own heartbeat: `40 ..` to 0x600 + node, or 0x77F.
fn only_reads(frames: &[CanFrame]) -> bool {
    frames.iter().all(|frame| match frame.id().raw() {
        0x601..=0x606 => frame.data()[0] == 0x40,
        0x77F => true,
        _ => false,
    })
}

/// What each drive steers to, and where its joint is.
fn standing(arm: &Arm) -> [(f64, f64); 6] {
    std::array::from_fn(|joint| {
        let servo = arm.simulator.drive(joint).unwrap();
        (servo.get::<Drive>().unwrap().reference_rad(), servo.position_rad())
    })
}

fn assert_still(arm: &Arm, rest: &[(f64, f64); 6], when: &str) {
    for (joint, (now, then)) in standing(arm).iter().zip(rest).enumerate() {
        let (steered_rad, moved_rad) = ((now.0 - then.0).abs(), (now.1 - then.1).abs());
        assert!(steered_rad < STILL_RAD, "{when}: joint {joint} was steered by {steered_rad:e} rad");
        assert!(moved_rad < CREEP_RAD, "{when}: joint {joint} moved by {moved_rad:e} rad");
    }
}

/// Goal: whatever the drives have done meanwhile (gone on holding, held by their watchdog, stopped quickly), a new
/// master finds them by reading, keeps them without a jump, and moves them only on request.
#[test]
fn drives_that_hold_are_adopted_by_reading_and_kept_without_a_jump() {
    for (ms, state) in [
        (40, PowerState::OperationEnabled),
        (250, PowerState::OperationEnabled),
        (3_000, PowerState::QuickStopActive),
    ] {
        let mut arm = orphaned(Reaction::Hold, ms);
        assert_eq!(
            arm.simulator.drive(1).unwrap().get::<Drive>().unwrap().power_state(),
            state,
            "{ms} ms after"
        );
        let settings = arm.settings.clone();
        restart_as(&mut arm, &settings);
        let mut cycles = 0;
        while arm.states() != [DriveState::Adopted; 6] {
            arm.cycle(DriveTarget::Disabled);
            assert!(only_reads(&arm.sent), "{ms} ms: {:?}", arm.sent);
            cycles += 1;
            assert!(cycles < 3_000, "{ms} ms: {:?}", arm.states());
        }
        // The joints' own loops come to rest after the targets do.
        for _ in 0..500 {
            arm.cycle(DriveTarget::Disabled);
            assert!(only_reads(&arm.sent), "{ms} ms: {:?}", arm.sent);
        }
        let rest = standing(&arm);
        for cycle in 0..600 {
            arm.cycle(DriveTarget::Keep);
            for frame in &arm.sent {
                let data = frame.data();
                match frame.id().raw() {
                    0x000 => assert_eq!(data[0], 0x01, "{ms} ms: NMT {data:02X?}"),
                    0x201..=0x206 => assert!(matches!(data[0], 0x02 | 0x0F), "{ms} ms: control {data:02X?}"),
                    0x601..=0x606 => assert_eq!(data[0], 0x40, "{ms} ms: SDO {data:02X?}"),
                    _ => {}
                }
            }
            assert_eq!(arm.states(), [DriveState::Adopted; 6], "{ms} ms, cycle {cycle}");
            assert_still(&arm, &rest, &format!("{ms} ms, kept"));
        }
        for joint in 0..6 {
            let status = arm.status(joint);
            assert!(
                (status.hold_position_rad - status.position_rad).abs() < 0.01,
                "joint {joint}: {status:?}"
            );
            arm.commands[joint].position_rad = status.hold_position_rad;
        }
        arm.reach(DriveTarget::Enabled, DriveState::Enabled);
        assert_still(&arm, &rest, &format!("{ms} ms, taken over"));
        let worst_rad = arm.move_and_measure(1.0);
        assert!(worst_rad.iter().all(|worst| *worst < 0.006), "{ms} ms: {worst_rad:?}");
        arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    }
}

/// Goal: torque that is not kept is removed in order, from either hold, when the operator says so.
#[test]
fn adopted_drives_are_de_energised_on_request() {
    for ms in [40, 3_000] {
        for drive_target in [DriveTarget::Disabled, DriveTarget::TorqueOff] {
            let mut arm = orphaned(Reaction::Hold, ms);
            let settings = arm.settings.clone();
            restart_as(&mut arm, &settings);
            arm.reach(DriveTarget::Disabled, DriveState::Adopted);
            for _ in 0..300 {
                arm.cycle(DriveTarget::Keep);
            }
            arm.reach(drive_target, DriveState::Disabled);
            assert!((0..6).all(|joint| {
                arm.simulator.drive(joint).unwrap().get::<Drive>().unwrap().statusword() & 0x04 == 0
            }));
        }
    }
}

/// Goal: one object that differs is enough to leave a drive alone, and it is named; the emergency reaches it all the same.
#[test]
fn drives_of_another_configuration_are_left_alone_and_the_difference_named() {
    let mut other_period = settings(Reaction::Hold);
    other_period.cycle.period_us = 2_000;
    let cases = [(other_period, "0x60C2:01"), (settings(Reaction::Ramp), "0x605A:00")];
    for (foreign, object) in cases {
        let mut arm = orphaned(Reaction::Hold, 3_000);
        let rest = standing(&arm);
        restart_as(&mut arm, &foreign);
        for _ in 0..3_000 {
            arm.cycle(DriveTarget::Disabled);
            assert!(only_reads(&arm.sent), "{object}: {:?}", arm.sent);
        }
        // Nor does a target of `Keep` or `Enabled` change it.
        for drive_target in [DriveTarget::Keep, DriveTarget::Enabled, DriveTarget::Disabled] {
            for _ in 0..200 {
                arm.cycle(drive_target);
                assert!(only_reads(&arm.sent), "{object}: {:?}", arm.sent);
            }
        }
        assert_eq!(arm.states(), [DriveState::EnergisedUnowned; 6], "{object}");
        let status = arm.status(3);
        let words = explain_refusal(&status.refusal());
        assert!(words.contains(object) && words.contains("torque-off"), "{words}");
        assert_still(&arm, &rest, object);
        for _ in 0..500 {
            arm.cycle(DriveTarget::TorqueOff);
        }
        assert!(
            (0..6)
                .all(|joint| arm.simulator.drive(joint).unwrap().get::<Drive>().unwrap().statusword() & 0x04
                    == 0),
            "{object}"
        );
        // Then they are anybody's, and come up as after power-up.
        arm.reach(DriveTarget::Disabled, DriveState::Disabled);
    }
}

/// Goal: a target that returns to `Keep` while drives are being adopted leaves them holding.
#[test]
fn taking_over_that_is_called_off_leaves_the_drives_holding() {
    let mut arm = orphaned(Reaction::Hold, 3_000);
    let settings = arm.settings.clone();
    restart_as(&mut arm, &settings);
    arm.reach(DriveTarget::Disabled, DriveState::Adopted);
    for _ in 0..300 {
        arm.cycle(DriveTarget::Keep);
    }
    let rest = standing(&arm);
    // A command that lies far from the hold is not followed.
    for command in &mut arm.commands {
        command.position_rad = 3.0;
    }
    for _ in 0..100 {
        arm.cycle(DriveTarget::Enabled);
    }
    for joint in 0..6 {
        let status = arm.status(joint);
        assert!(arm.driver.explain(status.error_code).contains("too far"), "joint {joint}: {status:?}");
    }
    for _ in 0..300 {
        arm.cycle(DriveTarget::Keep);
    }
    assert_still(&arm, &rest, "called off");
    assert!(
        (0..6).all(|joint| arm.simulator.drive(joint).unwrap().get::<Drive>().unwrap().statusword() & 0x04 != 0),
        "one was de-energised"
    );
}
