//! What is trusted at start: drives that hold from before, turns of feedback that repeats itself, the first speed.
use crate::rig::{HOME_RAD, JOINTS, Rig, shipped_settings, swing};
use crate::{arrived, assert_on_path};
use taustream_arm::{Feedback, Settings};
use taustream_drivers::{DriveState, DriveWish};
use taustream_messages::{Command, FaultReason, Phase, Standing};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_streamer::facts::Decision;
use taustream_streamer::names::Names;
use taustream_streamer::turns::{Memory, Recorded};
use taustream_streamer::words::Why;

/// Where the drives hold: beside the measured pose by a sag.
const HELD_RAD: JointArray = [0.001, -1.568, 1.571, -1.57, -1.569, 0.002, 0.0, 0.0];

/// An arm whose drives hold from before, but for those of `off`.
fn adopted(off: &[usize]) -> Rig {
    let mut rig = Rig::new();
    rig.script(|w| {
        w.held_rad = HELD_RAD;
        for joint in (0..JOINTS).filter(|joint| !off.contains(joint)) {
            w.forced[joint] = Some(DriveState::Adopted);
            w.states[joint] = DriveState::Adopted;
        }
    });
    rig.run_until(Phase::Locked, 60);
    rig.script(|w| w.forced = [None; MAX_JOINTS]);
    rig
}

fn wish(rig: &Rig) -> Option<DriveWish> {
    rig.world.lock().unwrap().wish
}

#[test]
fn adopted_drives_are_kept_and_moved_only_after_enable() {
    let mut rig = adopted(&[]);
    assert!(rig.core.supervisor().has_adopted());
    for _ in 0..200 {
        rig.run(1);
        assert_eq!((rig.phase(), wish(&rig)), (Phase::Locked, Some(DriveWish::Keep)));
    }
    assert!(rig.world.lock().unwrap().arrived.is_empty(), "a command was meant for metal");
    let decision = rig.offer(swing(&HELD_RAD, 1.0));
    assert_eq!(decision, Decision::NotReady { phase: Phase::Locked });
    assert_eq!(rig.ask(Command::Enable).why, Why::TakingOver);
    rig.run_until(Phase::Holding, 50);
    // The hold itself is the commanded pose, not the sag.
    let first = rig.world.lock().unwrap().arrived[0].1;
    assert_eq!(first[..JOINTS], HELD_RAD[..JOINTS]);
    assert!(!rig.core.supervisor().has_adopted());
    let trajectory = swing(&HELD_RAD, 1.0);
    assert!(matches!(rig.offer(trajectory.clone()), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 4_000);
    assert_on_path(&rig, &trajectory);
    let end_rad = trajectory.end_rad();
    assert!(arrived(&rig).iter().zip(end_rad).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn adopted_drives_beside_others_that_are_off_are_taken_over_together() {
    let mut rig = adopted(&[2, 4]);
    rig.run(50);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
    let first = rig.world.lock().unwrap().arrived[0].1;
    for joint in 0..JOINTS {
        let expected = if [2, 4].contains(&joint) { HOME_RAD[joint] } else { HELD_RAD[joint] };
        assert!((first[joint] - expected).abs() < 1e-12, "joint {joint}: {} not {expected}", first[joint]);
    }
}

#[test]
fn adopted_drives_that_fall_silent_are_a_fault_and_still_kept() {
    let mut rig = adopted(&[]);
    rig.run(50);
    rig.script(|w| w.silent = Some(3));
    rig.run_until(Phase::Fault, 100);
    assert_eq!(rig.cause().unwrap().reason, FaultReason::FeedbackLate);
    rig.run(200);
    assert_eq!(wish(&rig), Some(DriveWish::Keep), "it let go");
    rig.script(|w| w.silent = None);
    rig.run(5);
    rig.accept(Command::ClearFault);
    assert_eq!(rig.phase(), Phase::Locked);
    rig.accept(Command::Disable);
    rig.run(1);
    assert_eq!(wish(&rig), Some(DriveWish::Disabled));
    rig.run_until(Phase::Disabled, 50);
}

#[test]
fn adopted_drives_that_cannot_be_taken_over_go_on_holding() {
    let mut rig = adopted(&[]);
    rig.run(50);
    rig.script(|w| w.forced[5] = Some(DriveState::Adopted));
    rig.accept(Command::Enable);
    rig.script(|w| w.error_code = 0x0001_000A);
    rig.run_until(Phase::Fault, 50);
    let cause = rig.cause().unwrap();
    assert_eq!((cause.reason, cause.joint.is_some()), (FaultReason::DriveFault, true));
    rig.run(100);
    assert_eq!(wish(&rig), Some(DriveWish::Keep), "it let go");
    rig.script(|w| w.error_code = 0);
    rig.run(5);
    rig.script(|w| w.states = [DriveState::Adopted; MAX_JOINTS]);
    rig.run(1);
    rig.accept(Command::ClearFault);
    assert_eq!(rig.world.lock().unwrap().clears, 1, "what the last try has found is forgotten");
    rig.run(1);
    assert_eq!(rig.phase(), Phase::Locked);
}

#[test]
fn adopted_drives_are_let_go_by_torque_off() {
    let mut rig = adopted(&[]);
    rig.run(50);
    rig.accept(Command::TorqueOff);
    rig.run(2);
    assert_eq!((rig.phase(), wish(&rig)), (Phase::Fault, Some(DriveWish::TorqueOff)));
    rig.accept(Command::ClearFault);
    rig.run_until(Phase::Disabled, 60);
}

#[test]
fn unowned_drive_is_named_with_what_differs_and_what_to_do() {
    let mut rig = Rig::new();
    rig.script(|w| {
        w.held_rad = HELD_RAD;
        w.forced = [Some(DriveState::Adopted); MAX_JOINTS];
        w.forced[1] = Some(DriveState::EnergisedUnowned);
        (w.error_code, w.refused_object) = (0x0001_0011, 0x60_C201);
    });
    rig.run_until(Phase::Fault, 60);
    let sentence = Names::of(&rig.settings).fault(&rig.cause().unwrap());
    for words in ["energised, unowned", "joint 2", "0x60C2:01", "`torque-off`"] {
        assert!(sentence.contains(words), "{words} in: {sentence}");
    }
    assert_eq!(rig.ask(Command::ClearFault).why, Why::Unowned { joint: 1 });
    assert!(matches!(rig.ask(Command::Enable).why, Why::ClearFirst));
    rig.run(50);
    assert_eq!(wish(&rig), Some(DriveWish::Disabled), "only an operator lets go");
    // Whoever used it has ended and let go: the others, which hold, are adopted beside it.
    rig.script(|w| w.forced[1] = Some(DriveState::Disabled));
    rig.run(1);
    rig.accept(Command::ClearFault);
    rig.run_until(Phase::Locked, 10);
    assert_eq!(wish(&rig), Some(DriveWish::Disabled));
    rig.run(1);
    assert_eq!(wish(&rig), Some(DriveWish::Keep));
}

/// The shipped arm with a feedback that repeats itself every `period_rad` on joint 1.
fn wrapping(period_rad: f64) -> Settings {
    let mut settings = shipped_settings();
    settings.servos[0].feedback = Feedback::Wraps;
    settings.servos[0].feedback_range_rad = [0.0, period_rad];
    settings
}

fn standing(rig: &Rig, joint: usize) -> Standing {
    rig.core.supervisor().turns().resolved(joint).standing
}

#[test]
fn joint_without_a_turn_is_not_enabled_until_it_is_referenced() {
    let mut rig = Rig::with(wrapping(1.0));
    rig.script(|w| w.turn_rad[0] = 2.0);
    rig.run_until(Phase::Disabled, 60);
    assert_eq!(standing(&rig, 0), Standing::NoRecord);
    let refused = rig.ask(Command::Enable);
    assert!(matches!(refused.why, Why::NotReferenced { joint: 0, standing: Standing::NoRecord, .. }));
    let sentence = refused.why.sentence(&Names::of(&rig.settings));
    assert!(sentence.contains("joint 1") && sentence.contains("taustream reference"), "{sentence}");

    // It reads -2 and stands at 0: what cannot be meant is refused with by how much.
    let far = rig.ask(Command::Reference { joint: 0, at_rad: 0.45 });
    assert!(matches!(far.why, Why::ReferenceFar { joint: 0, .. }), "{:?}", far.why);
    let outside = rig.ask(Command::Reference { joint: 0, at_rad: 4.0 });
    assert!(matches!(outside.why, Why::ReferenceOutside { joint: 0, .. }), "{:?}", outside.why);
    let known = rig.ask(Command::Reference { joint: 1, at_rad: 0.0 });
    assert!(matches!(known.why, Why::ReferenceNotNeeded { joint: 1, .. }), "{:?}", known.why);
    assert!(matches!(rig.ask(Command::Reference { joint: 6, at_rad: 0.0 }).why, Why::NoSuchJoint { .. }));
    assert_eq!(standing(&rig, 0), Standing::NoRecord, "a refused word changes nothing");

    rig.accept(Command::Reference { joint: 0, at_rad: 0.2 });
    assert_eq!(standing(&rig, 0), Standing::Operator);
    // The turn takes effect at once, which is no motion of the joint.
    rig.run(40);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
    assert!(matches!(rig.ask(Command::Reference { joint: 0, at_rad: 0.0 }).why, Why::Energised { .. }));
    let trajectory = swing(&HOME_RAD, 1.0);
    assert!(matches!(rig.offer(trajectory.clone()), Decision::Accepted { .. }));
    rig.run_until(Phase::Holding, 4_000);
    assert_on_path(&rig, &trajectory);
    let off_rad = (arrived(&rig)[0] - trajectory.end_rad()[0]).abs();
    assert!(off_rad < 1e-9, "the joint ended {off_rad} rad off");
}

#[test]
fn last_pose_tells_the_turn_only_near_it_and_only_from_rest() {
    let recorded = |position_rad: f64, at_rest: bool| {
        let mut memory: Memory = [None; MAX_JOINTS];
        memory[0] = Some(Recorded { position_rad, offset_rad: 2.0, at_rest });
        memory
    };
    for (memory, expected) in [
        (recorded(0.3, true), Standing::Record),
        (recorded(0.45, true), Standing::RecordFar),
        (recorded(0.0, false), Standing::RecordMoving),
        (recorded(f64::NAN, true), Standing::RecordFar),
        ([None; MAX_JOINTS], Standing::NoRecord),
    ] {
        let mut rig = Rig::with(wrapping(1.0));
        rig.script(|w| w.turn_rad[0] = 2.0);
        rig.core.recall(&memory);
        rig.run_until(Phase::Disabled, 60);
        assert_eq!(standing(&rig, 0), expected, "{memory:?}");
        assert_eq!(rig.ask(Command::Enable).accepted, expected.is_referenced(), "{memory:?}");
    }
}

#[test]
fn drive_that_comes_back_keeps_its_turn_from_rest_and_loses_it_from_use() {
    let mut rig = Rig::with(wrapping(1.0));
    rig.script(|w| w.turn_rad[0] = 2.0);
    rig.run_until(Phase::Disabled, 60);
    rig.accept(Command::Reference { joint: 0, at_rad: 0.0 });
    rig.run(40);
    // Its supply was off: it counts from another turn now.
    let power_cut = |rig: &mut Rig, turn_rad: f64| {
        rig.script(|w| w.forced[0] = Some(DriveState::Absent));
        rig.run(20);
        rig.script(|w| (w.forced[0], w.turn_rad[0]) = (None, turn_rad));
        rig.run(60);
    };
    power_cut(&mut rig, -1.0);
    assert_eq!(standing(&rig, 0), Standing::Record);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
    assert!((arrived(&rig)[0] - HOME_RAD[0]).abs() < 1e-9);
    power_cut(&mut rig, 1.0);
    assert_eq!(rig.phase(), Phase::Fault);
    rig.accept(Command::Disable);
    rig.run(20);
    assert_eq!(standing(&rig, 0), Standing::RecordMoving, "it may have fallen a turn while it was off");
}

#[test]
fn incremental_feedback_is_referenced_by_the_operator_alone() {
    let mut settings = shipped_settings();
    settings.servos[0].feedback = Feedback::Incremental;
    let mut rig = Rig::with(settings);
    let mut memory: Memory = [None; MAX_JOINTS];
    memory[0] = Some(Recorded { position_rad: 0.0, offset_rad: 0.7, at_rest: true });
    rig.core.recall(&memory);
    rig.script(|w| w.turn_rad[0] = 0.7);
    rig.run_until(Phase::Disabled, 60);
    assert_eq!(standing(&rig, 0), Standing::Incremental);
    assert!(!rig.ask(Command::Enable).accepted);
    rig.accept(Command::Reference { joint: 0, at_rad: HOME_RAD[0] });
    rig.run(40);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
    assert!((arrived(&rig)[0] - HOME_RAD[0]).abs() < 1e-9);
}

/// A drive that held all the while was never without power: what was known of its turn holds, even in motion.
#[test]
fn adopted_drive_keeps_the_turn_that_was_known() {
    let mut rig = Rig::with(wrapping(0.1));
    let mut memory: Memory = [None; MAX_JOINTS];
    memory[0] = Some(Recorded { position_rad: 0.4, offset_rad: 2.0, at_rest: false });
    rig.core.recall(&memory);
    rig.script(|w| {
        (w.held_rad, w.turn_rad[0]) = (HELD_RAD, 2.0);
        w.forced = [Some(DriveState::Adopted); MAX_JOINTS];
        w.states = w.forced.map(|_| DriveState::Adopted);
    });
    rig.run_until(Phase::Locked, 60);
    rig.script(|w| w.forced = [None; MAX_JOINTS]);
    rig.run(50);
    assert_eq!(standing(&rig, 0), Standing::Adoption);
    rig.accept(Command::Enable);
    rig.run_until(Phase::Holding, 50);
    assert!((arrived(&rig)[0] - HELD_RAD[0]).abs() < 1e-9, "{} rad", arrived(&rig)[0]);
}

#[test]
fn first_motion_after_start_is_slow_until_a_speed_is_chosen() {
    let mut settings = shipped_settings();
    settings.supervision.first_speed_percent = 25.0;
    let sigma_of = |rig: &mut Rig| {
        let base = arrived(rig);
        assert!(matches!(rig.offer(swing(&base, 0.3)), Decision::Accepted { .. }));
        rig.run(300);
        rig.cycles.last().unwrap().sigma
    };
    // Every start begins slow, and a disable does not make it fast.
    for _ in 0..2 {
        let mut rig = Rig::with(settings.clone());
        rig.enable();
        rig.run(1);
        assert_eq!(sigma_of(&mut rig), 0.25);
        rig.run_until(Phase::Holding, 20_000);
        rig.accept(Command::Disable);
        rig.run_until(Phase::Disabled, 60);
        rig.accept(Command::Enable);
        rig.run_until(Phase::Holding, 50);
        rig.run(1);
        assert!(rig.core.supervisor().is_first_speed());
        assert_eq!(sigma_of(&mut rig), 0.25);
        rig.run_until(Phase::Holding, 20_000);
        rig.accept(Command::Speed { percent: 100.0 });
        assert!(!rig.core.supervisor().is_first_speed());
        assert_eq!(sigma_of(&mut rig), 1.0);
    }
}
