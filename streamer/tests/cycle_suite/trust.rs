//! What is trusted at start: drives that hold from before, turns of feedback that repeats itself, the first speed.
use crate::harness::{CycleHarness, HOME_RAD, JOINTS, shipped_settings, swing};
use crate::{arrived, assert_on_path};
use taustream_arm::{Feedback, Settings};
use taustream_drivers::{DriveState, DriveTarget};
use taustream_messages::{Command, FaultReason, Phase, ReferenceState};
use taustream_motion::{JointArray, MAX_JOINTS, joint_array};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::names::Names;
use taustream_streamer::referencing::{LastPoses, Recorded};

/// Where the drives hold: beside the measured pose by a sag.
const HOLD_POSITION_RAD: JointArray = joint_array([0.001, -1.568, 1.571, -1.57, -1.569, 0.002]);

/// An arm whose drives hold from before, but for those of `off`.
fn adopted(off: &[usize]) -> CycleHarness {
    let mut harness = CycleHarness::new();
    harness.script(|w| {
        w.hold_position_rad = HOLD_POSITION_RAD;
        for joint in (0..JOINTS).filter(|joint| !off.contains(joint)) {
            w.forced[joint] = Some(DriveState::Adopted);
            w.states[joint] = DriveState::Adopted;
        }
    });
    harness.run_until(Phase::Locked, 60);
    harness.script(|w| w.forced = [None; MAX_JOINTS]);
    harness
}

fn drive_target(harness: &CycleHarness) -> Option<DriveTarget> {
    harness.world.lock().unwrap().drive_target
}

#[test]
fn adopted_drives_are_kept_and_moved_only_after_enable() {
    let mut harness = adopted(&[]);
    assert!(harness.core.supervisor().has_adopted());
    for _ in 0..200 {
        harness.run(1);
        assert_eq!((harness.phase(), drive_target(&harness)), (Phase::Locked, Some(DriveTarget::Keep)));
    }
    assert!(harness.world.lock().unwrap().arrived.is_empty(), "a command was sent to the drives");
    let decision = harness.offer(swing(&HOLD_POSITION_RAD, 1.0));
    assert_eq!(decision, Decision::NotReady { phase: Phase::Locked });
    assert_eq!(harness.ask(Command::Enable).why, AnswerReason::TakingOver);
    harness.run_until(Phase::Holding, 50);
    // The hold itself is the commanded pose, not the sag.
    let first = harness.world.lock().unwrap().arrived[0].1;
    assert_eq!(first[..JOINTS], HOLD_POSITION_RAD[..JOINTS]);
    assert!(!harness.core.supervisor().has_adopted());
    let trajectory = swing(&HOLD_POSITION_RAD, 1.0);
    assert!(matches!(harness.offer(trajectory.clone()), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 4_000);
    assert_on_path(&harness, &trajectory);
    let end_rad = trajectory.end_rad();
    assert!(arrived(&harness).iter().zip(end_rad).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn adopted_drives_beside_others_that_are_off_are_taken_over_together() {
    let mut harness = adopted(&[2, 4]);
    harness.run(50);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
    let first = harness.world.lock().unwrap().arrived[0].1;
    for joint in 0..JOINTS {
        let expected = if [2, 4].contains(&joint) { HOME_RAD[joint] } else { HOLD_POSITION_RAD[joint] };
        assert!((first[joint] - expected).abs() < 1e-12, "joint {joint}: {} not {expected}", first[joint]);
    }
}

#[test]
fn adopted_drives_that_stop_answering_are_a_fault_and_still_hold() {
    let mut harness = adopted(&[]);
    harness.run(50);
    harness.script(|w| w.silent = Some(3));
    harness.run_until(Phase::Fault, 100);
    assert_eq!(harness.cause().unwrap().reason, FaultReason::FeedbackLate);
    harness.run(200);
    assert_eq!(drive_target(&harness), Some(DriveTarget::Keep), "it lost its torque");
    harness.script(|w| w.silent = None);
    harness.run(5);
    harness.accept(Command::ClearFault);
    assert_eq!(harness.phase(), Phase::Locked);
    harness.accept(Command::Disable);
    harness.run(1);
    assert_eq!(drive_target(&harness), Some(DriveTarget::Disabled));
    harness.run_until(Phase::Disabled, 50);
}

#[test]
fn adopted_drives_that_cannot_be_taken_over_go_on_holding() {
    let mut harness = adopted(&[]);
    harness.run(50);
    harness.script(|w| w.forced[5] = Some(DriveState::Adopted));
    harness.accept(Command::Enable);
    harness.script(|w| w.error_code = 0x0001_000A);
    harness.run_until(Phase::Fault, 50);
    let cause = harness.cause().unwrap();
    assert_eq!((cause.reason, cause.joint.is_some()), (FaultReason::DriveFault, true));
    harness.run(100);
    assert_eq!(drive_target(&harness), Some(DriveTarget::Keep), "it lost its torque");
    harness.script(|w| w.error_code = 0);
    harness.run(5);
    harness.script(|w| w.states = [DriveState::Adopted; MAX_JOINTS]);
    harness.run(1);
    harness.accept(Command::ClearFault);
    assert_eq!(harness.world.lock().unwrap().clears, 1, "what the last try has found is forgotten");
    harness.run(1);
    assert_eq!(harness.phase(), Phase::Locked);
}

#[test]
fn adopted_drives_are_de_energised_by_torque_off() {
    let mut harness = adopted(&[]);
    harness.run(50);
    harness.accept(Command::TorqueOff);
    harness.run(2);
    assert_eq!((harness.phase(), drive_target(&harness)), (Phase::Fault, Some(DriveTarget::TorqueOff)));
    harness.accept(Command::ClearFault);
    harness.run_until(Phase::Disabled, 60);
}

#[test]
fn unowned_drive_is_named_with_what_differs_and_what_to_do() {
    let mut harness = CycleHarness::new();
    harness.script(|w| {
        w.hold_position_rad = HOLD_POSITION_RAD;
        w.forced = [Some(DriveState::Adopted); MAX_JOINTS];
        w.forced[1] = Some(DriveState::EnergisedUnowned);
        (w.error_code, w.refused_object) = (0x0001_0011, 0x60_C201);
    });
    harness.run_until(Phase::Fault, 60);
    let sentence = Names::of(&harness.settings).fault(&harness.cause().unwrap());
    for words in ["energised, unowned", "joint 2", "0x60C2:01", "`torque-off`"] {
        assert!(sentence.contains(words), "{words} in: {sentence}");
    }
    assert_eq!(harness.ask(Command::ClearFault).why, AnswerReason::Unowned { joint: 1 });
    assert!(matches!(harness.ask(Command::Enable).why, AnswerReason::ClearFirst { .. }));
    harness.run(50);
    assert_eq!(drive_target(&harness), Some(DriveTarget::Disabled), "only an operator de-energises");
    // Whoever used it has ended without torque: the others, which hold, are adopted beside it.
    harness.script(|w| w.forced[1] = Some(DriveState::Disabled));
    harness.run(1);
    harness.accept(Command::ClearFault);
    harness.run_until(Phase::Locked, 10);
    assert_eq!(drive_target(&harness), Some(DriveTarget::Disabled));
    harness.run(1);
    assert_eq!(drive_target(&harness), Some(DriveTarget::Keep));
}

/// The shipped arm with a feedback that repeats itself every `period_rad` on joint 1.
fn wrapping(period_rad: f64) -> Settings {
    let mut settings = shipped_settings();
    settings.servos[0].feedback = Feedback::Wraps;
    settings.servos[0].feedback_range_rad = [0.0, period_rad];
    settings
}

fn reference_state(harness: &CycleHarness, joint: usize) -> ReferenceState {
    harness.core.supervisor().referencing().resolved(joint).reference_state
}

#[test]
fn unreferenced_joint_is_not_enabled_until_it_is_referenced() {
    let mut harness = CycleHarness::with(wrapping(1.0));
    harness.script(|w| w.revolution_rad[0] = 2.0);
    harness.run_until(Phase::Disabled, 60);
    assert_eq!(reference_state(&harness, 0), ReferenceState::NoRecord);
    let refused = harness.ask(Command::Enable);
    assert!(matches!(
        refused.why,
        AnswerReason::NotReferenced { joint: 0, reference_state: ReferenceState::NoRecord, .. }
    ));
    let sentence = refused.why.sentence(&Names::of(&harness.settings));
    assert!(sentence.contains("joint 1") && sentence.contains("taustream reference"), "{sentence}");

    // It reads -2 and stands at 0: what cannot be meant is refused with by how much.
    let far = harness.ask(Command::Reference { joint: 0, at_rad: 0.45 });
    assert!(matches!(far.why, AnswerReason::ReferenceFar { joint: 0, .. }), "{:?}", far.why);
    let outside = harness.ask(Command::Reference { joint: 0, at_rad: 4.0 });
    assert!(matches!(outside.why, AnswerReason::ReferenceOutside { joint: 0, .. }), "{:?}", outside.why);
    let known = harness.ask(Command::Reference { joint: 1, at_rad: 0.0 });
    assert!(matches!(known.why, AnswerReason::ReferenceNotNeeded { joint: 1, .. }), "{:?}", known.why);
    assert!(matches!(
        harness.ask(Command::Reference { joint: 6, at_rad: 0.0 }).why,
        AnswerReason::NoSuchJoint { .. }
    ));
    assert_eq!(reference_state(&harness, 0), ReferenceState::NoRecord, "a refused word changes nothing");

    harness.accept(Command::Reference { joint: 0, at_rad: 0.2 });
    assert_eq!(reference_state(&harness, 0), ReferenceState::Operator);
    // The turn takes effect at once, which is no motion of the joint.
    harness.run(40);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
    assert!(matches!(
        harness.ask(Command::Reference { joint: 0, at_rad: 0.0 }).why,
        AnswerReason::Energised { .. }
    ));
    let trajectory = swing(&HOME_RAD, 1.0);
    assert!(matches!(harness.offer(trajectory.clone()), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 4_000);
    assert_on_path(&harness, &trajectory);
    let off_rad = (arrived(&harness)[0] - trajectory.end_rad()[0]).abs();
    assert!(off_rad < 1e-9, "the joint ended {off_rad} rad off");
}

#[test]
fn last_pose_resolves_the_multi_turn_offset_only_near_it_and_only_from_rest() {
    let recorded = |position_rad: f64, at_rest: bool| {
        let mut memory: LastPoses = [None; MAX_JOINTS];
        memory[0] = Some(Recorded { position_rad, offset_rad: 2.0, at_rest });
        memory
    };
    for (memory, expected) in [
        (recorded(0.3, true), ReferenceState::Record),
        (recorded(0.45, true), ReferenceState::RecordFar),
        (recorded(0.0, false), ReferenceState::RecordMoving),
        (recorded(f64::NAN, true), ReferenceState::RecordFar),
        ([None; MAX_JOINTS], ReferenceState::NoRecord),
    ] {
        let mut harness = CycleHarness::with(wrapping(1.0));
        harness.script(|w| w.revolution_rad[0] = 2.0);
        harness.core.restore_poses(&memory);
        harness.run_until(Phase::Disabled, 60);
        assert_eq!(reference_state(&harness, 0), expected, "{memory:?}");
        assert_eq!(harness.ask(Command::Enable).accepted, expected.is_referenced(), "{memory:?}");
    }
}

#[test]
fn drive_that_comes_back_keeps_its_offset_from_rest_and_loses_it_from_use() {
    let mut harness = CycleHarness::with(wrapping(1.0));
    harness.script(|w| w.revolution_rad[0] = 2.0);
    harness.run_until(Phase::Disabled, 60);
    harness.accept(Command::Reference { joint: 0, at_rad: 0.0 });
    harness.run(300);
    // Its supply was off: it counts from another turn now.
    let power_cut = |harness: &mut CycleHarness, revolution_rad: f64| {
        harness.script(|w| w.forced[0] = Some(DriveState::Absent));
        harness.run(20);
        harness.script(|w| (w.forced[0], w.revolution_rad[0]) = (None, revolution_rad));
        harness.run(60);
    };
    power_cut(&mut harness, -1.0);
    assert_eq!(reference_state(&harness, 0), ReferenceState::Record);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
    assert!((arrived(&harness)[0] - HOME_RAD[0]).abs() < 1e-9);
    power_cut(&mut harness, 1.0);
    assert_eq!(harness.phase(), Phase::Fault);
    harness.accept(Command::Disable);
    harness.run(20);
    assert_eq!(
        reference_state(&harness, 0),
        ReferenceState::RecordMoving,
        "it may have fallen a turn while it was off"
    );
}

#[test]
fn incremental_feedback_is_referenced_by_the_operator_alone() {
    let mut settings = shipped_settings();
    settings.servos[0].feedback = Feedback::Incremental;
    let mut harness = CycleHarness::with(settings);
    let mut memory: LastPoses = [None; MAX_JOINTS];
    memory[0] = Some(Recorded { position_rad: 0.0, offset_rad: 0.7, at_rest: true });
    harness.core.restore_poses(&memory);
    harness.script(|w| w.revolution_rad[0] = 0.7);
    harness.run_until(Phase::Disabled, 60);
    assert_eq!(reference_state(&harness, 0), ReferenceState::Incremental);
    assert!(!harness.ask(Command::Enable).accepted);
    harness.accept(Command::Reference { joint: 0, at_rad: HOME_RAD[0] });
    harness.run(40);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
    assert!((arrived(&harness)[0] - HOME_RAD[0]).abs() < 1e-9);
}

/// A drive that held all the while was never without power: what was known of its turn holds, even in motion.
#[test]
fn adopted_drive_keeps_the_known_multi_turn_offset() {
    let mut harness = CycleHarness::with(wrapping(0.1));
    let mut memory: LastPoses = [None; MAX_JOINTS];
    memory[0] = Some(Recorded { position_rad: 0.4, offset_rad: 2.0, at_rest: false });
    harness.core.restore_poses(&memory);
    harness.script(|w| {
        (w.hold_position_rad, w.revolution_rad[0]) = (HOLD_POSITION_RAD, 2.0);
        w.forced = [Some(DriveState::Adopted); MAX_JOINTS];
        w.states = w.forced.map(|_| DriveState::Adopted);
    });
    harness.run_until(Phase::Locked, 60);
    harness.script(|w| w.forced = [None; MAX_JOINTS]);
    harness.run(50);
    assert_eq!(reference_state(&harness, 0), ReferenceState::Adoption);
    harness.accept(Command::Enable);
    harness.run_until(Phase::Holding, 50);
    assert!((arrived(&harness)[0] - HOLD_POSITION_RAD[0]).abs() < 1e-9, "{} rad", arrived(&harness)[0]);
}

#[test]
fn first_motion_after_start_is_slow_until_a_speed_is_chosen() {
    let mut settings = shipped_settings();
    settings.supervision.first_speed_percent = 25.0;
    let sigma_of = |harness: &mut CycleHarness| {
        let base = arrived(harness);
        assert!(matches!(harness.offer(swing(&base, 0.3)), Decision::Accepted { .. }));
        harness.run(300);
        harness.cycles.last().unwrap().sigma
    };
    // Every start begins slow, and a disable does not make it fast.
    for _ in 0..2 {
        let mut harness = CycleHarness::with(settings.clone());
        harness.enable();
        harness.run(1);
        assert_eq!(sigma_of(&mut harness), 0.25);
        harness.run_until(Phase::Holding, 20_000);
        harness.accept(Command::Disable);
        harness.run_until(Phase::Disabled, 60);
        harness.accept(Command::Enable);
        harness.run_until(Phase::Holding, 50);
        harness.run(1);
        assert!(harness.core.supervisor().is_first_speed());
        assert_eq!(sigma_of(&mut harness), 0.25);
        harness.run_until(Phase::Holding, 20_000);
        harness.accept(Command::Speed { percent: 100.0 });
        assert!(!harness.core.supervisor().is_first_speed());
        assert_eq!(sigma_of(&mut harness), 1.0);
    }
}
