//! Position limits: the tolerance, and arms that stand outside: they are energised, led inwards slowly, and never further
//! out, whatever setpoints arrive.
#![expect(clippy::approx_constant, reason = "3.1416 is the limit of the shipped arm")]
use crate::arrived;
use crate::harness::{CycleHarness, HOME_RAD, JOINTS, shipped_settings, swing};
use taustream_arm::Feedback;
use taustream_messages::{Command, FaultReason, Phase, ReferenceState};
use taustream_motion::limits::check_motion;
use taustream_motion::{JointArray, Stroke, Trajectory};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::names::Names;
use taustream_streamer::referencing::Recorded;

/// The limits of the shipped arm's joints are +-3.1416 rad.
const OUTSIDE: [(usize, f64); 2] = [(0, -3.25), (5, 3.3)];

fn arm_at(joints: &[(usize, f64)]) -> CycleHarness {
    let harness = CycleHarness::new();
    place(&harness, joints);
    harness
}

fn place(harness: &CycleHarness, joints: &[(usize, f64)]) {
    harness.script(|w| {
        for pose in &mut w.pipeline {
            joints.iter().for_each(|(joint, at_rad)| pose[*joint] = *at_rad);
        }
    });
}

/// Strokes of one second each on top of where the arm is, one after the other.
fn moves(harness: &CycleHarness, parts: &[&[(usize, f64)]]) -> Trajectory {
    let strokes: Vec<Stroke> = parts
        .iter()
        .enumerate()
        .map(|(index, part)| {
            let mut delta_rad: JointArray = [0.0; _];
            part.iter().for_each(|(joint, by_rad)| delta_rad[*joint] = *by_rad);
            Stroke { start_s: index as f64, duration_s: 1.0, n: 6, delta_rad }
        })
        .collect();
    Trajectory::new(JOINTS, arrived(harness), &strokes).unwrap()
}

/// How far outside its limits a joint was commanded at most.
fn most_outside_rad(harness: &CycleHarness, joint: usize) -> f64 {
    let limits = harness.settings.robot.limits()[joint];
    let world = harness.world.lock().unwrap();
    world.arrived.iter().map(|(_, pose)| limits.outside_rad(pose[joint]).abs()).fold(0.0, f64::max)
}

#[test]
fn joint_at_its_limit_or_a_count_outside_is_enabled_like_any_other() {
    for at_rad in [3.1416, 3.141_600_000_000_000_4, 3.1416 + 9e-4, -3.1416 - 9e-4] {
        let mut harness = arm_at(&[(5, at_rad)]);
        harness.run_until(Phase::Disabled, 60);
        assert_eq!(harness.ask(Command::Enable).why, AnswerReason::Enabling, "{at_rad}");
        harness.run_until(Phase::Holding, 50);
        harness.accept(Command::Speed { percent: 100.0 });
        assert!((harness.core.supervisor().speed() - 1.0).abs() < 1e-12, "no reduced speed at a limit");
    }
}

#[test]
fn arm_outside_on_both_sides_is_enabled_says_so_and_comes_in_slowly() {
    let mut harness = arm_at(&OUTSIDE);
    harness.run_until(Phase::Disabled, 60);
    let answer = harness.ask(Command::Enable);
    assert!(
        answer.accepted && matches!(answer.why, AnswerReason::EnablingOutside { joint: 0, .. }),
        "{answer:?}"
    );
    let sentence = answer.why.sentence(&Names::of(&harness.settings));
    for words in ["-3.2500 rad is 0.1084 rad outside [-3.1416, 3.1416]", "25 %", "taustream recover"] {
        assert!(sentence.contains(words), "{words} in: {sentence}");
    }
    harness.run_until(Phase::Holding, 50);
    // The operator's word for more speed holds for the motions after this one.
    let faster = harness.ask(Command::Speed { percent: 100.0 });
    assert_eq!(faster.why, AnswerReason::SpeedHeld { percent: 100.0, limit: 25.0 });
    let entry = moves(&harness, &[&[(0, 0.2), (5, -0.3)]]);
    assert!(check_motion(&entry, &harness.settings.robot.limits()).is_ok());
    assert!(matches!(harness.offer(entry.clone()), Decision::Accepted { .. }));
    harness.run(700);
    harness.ask(Command::Speed { percent: 90.0 });
    harness.accept(Command::Pause);
    harness.run_until(Phase::Paused, 1_000);
    harness.accept(Command::Resume);
    harness.run_until(Phase::Holding, 9_000);
    assert_eq!((arrived(&harness), harness.cause()), (entry.end_rad(), None));
    assert!(harness.cycles.iter().all(|cycle| cycle.sigma <= 0.25), "faster than a quarter");
    for (joint, at_rad) in OUTSIDE {
        let most = most_outside_rad(&harness, joint);
        assert!((most - (at_rad.abs() - 3.1416)).abs() < 1e-12, "joint {joint}: {most} rad outside");
    }
    // Inside: as fast as was chosen.
    harness.run(1);
    let inside = swing(&arrived(&harness), 0.1);
    assert!(matches!(harness.offer(inside), Decision::Accepted { .. }));
    harness.run(200);
    assert!((harness.cycles.last().unwrap().sigma - 0.9).abs() < 1e-9);
}

/// Goal: the guard alone keeps a joint from going further out: the intake's check is left out.
#[test]
fn setpoints_that_lead_further_outside_are_braked_at_once() {
    let cases: [&[&[(usize, f64)]]; 4] = [
        &[&[(0, -0.1)]],
        // The other joint comes in meanwhile.
        &[&[(0, 0.2), (5, 0.05)]],
        // Half way in, then back to where it stood: out again all the same.
        &[&[(0, 0.05)], &[(0, -0.05)]],
        // Inside, then out on the same side.
        &[&[(5, -0.3), (0, 0.2)], &[(5, 0.2)]],
    ];
    for (case, parts) in cases.iter().enumerate() {
        let mut harness = arm_at(&OUTSIDE);
        harness.enable();
        let trajectory = moves(&harness, parts);
        assert!(check_motion(&trajectory, &harness.settings.robot.limits()).is_err(), "case {case}");
        assert!(matches!(harness.offer(trajectory), Decision::Accepted { .. }));
        harness.run_until(Phase::Fault, 20_000);
        assert_eq!(harness.cause().unwrap().reason, FaultReason::Guard, "case {case}");
        for (joint, at_rad) in OUTSIDE {
            // What a brake from the slow start of a stroke still takes.
            let most = most_outside_rad(&harness, joint) - (at_rad.abs() - 3.1416);
            assert!(most < 1e-4, "case {case}, joint {joint}: {most} rad further outside");
        }
        // Where the brake has ended is no dead end.
        harness.accept(Command::ClearFault);
        harness.accept(Command::Enable);
        harness.run_until(Phase::Holding, 60);
        let home = moves(&harness, &[&[(0, -2.9 - arrived(&harness)[0]), (5, 2.9 - arrived(&harness)[5])]]);
        assert!(matches!(harness.offer(home), Decision::Accepted { .. }), "case {case}");
        harness.run_until(Phase::Holding, 9_000);
        assert_eq!(harness.cause(), None, "case {case}");
    }
}

/// Goal: small steps outwards, each below what is taken for rounding, do not add up.
#[test]
fn creeping_outwards_is_braked_before_it_amounts_to_anything() {
    let mut harness = arm_at(&[(5, 3.3)]);
    harness.enable();
    let creep = {
        let mut delta_rad: JointArray = [0.0; _];
        delta_rad[5] = 0.01;
        let stroke = Stroke { start_s: 0.0, duration_s: 600.0, n: 6, delta_rad };
        Trajectory::new(JOINTS, arrived(&harness), &[stroke]).unwrap()
    };
    assert!(matches!(harness.offer(creep), Decision::Accepted { .. }));
    harness.run_until(Phase::Fault, 2_400_000);
    let most = most_outside_rad(&harness, 5) - (3.3 - 3.1416);
    assert!(most < 2e-6, "{most} rad further outside");
}

/// A feedback that repeats itself: the revolution is right outside the limits, too, or it is asked for.
#[test]
fn wrapping_joint_outside_is_led_inwards_on_its_own_side() {
    const PERIOD_RAD: f64 = std::f64::consts::TAU;
    let wrapping = |range_rad: [f64; 2], at_rad: f64, remembered: bool| {
        let mut settings = shipped_settings();
        settings.servos[0].feedback = Feedback::Wraps;
        settings.servos[0].feedback_range_rad = [-PERIOD_RAD / 2.0, PERIOD_RAD / 2.0];
        settings.robot.joints[0].limits.position_rad = range_rad;
        let mut harness = CycleHarness::with(settings);
        place(&harness, &[(0, at_rad)]);
        let revolution_rad = (at_rad / PERIOD_RAD).round() * PERIOD_RAD;
        harness.script(|w| w.revolution_rad[0] = revolution_rad);
        if remembered {
            let near = Recorded { position_rad: at_rad - 0.3, offset_rad: revolution_rad, at_rest: true };
            harness.core.restore_poses(&std::array::from_fn(|joint| (joint == 0).then_some(near)));
        }
        harness.run_until(Phase::Disabled, 60);
        harness
    };
    let reference_state =
        |harness: &CycleHarness| harness.core.supervisor().referencing().resolved(0).reference_state;
    let comes_in = |mut harness: CycleHarness, at_rad: f64, expected: ReferenceState| {
        assert_eq!(reference_state(&harness), expected, "{at_rad}");
        let why = harness.ask(Command::Enable).why;
        let is_there = |position_rad: f64| (position_rad - at_rad).abs() < 1e-9;
        assert!(
            matches!(why, AnswerReason::EnablingOutside { joint: 0, position_rad, .. } if is_there(position_rad)),
            "{at_rad}: {why:?}"
        );
        harness.run_until(Phase::Holding, 60);
        let inwards = if at_rad > 0.0 { -0.6 } else { 0.6 };
        let entry = moves(&harness, &[&[(0, inwards)]]);
        assert!(matches!(harness.offer(entry), Decision::Accepted { .. }));
        harness.run_until(Phase::Holding, 9_000);
        assert_eq!(harness.cause(), None);
    };
    // One revolution fits: up to a quarter of the angles that the range leaves free, the reading alone decides.
    for at_rad in [4.2, -0.8] {
        comes_in(wrapping([-0.5, 4.0], at_rad, false), at_rad, ReferenceState::Encoder);
    }
    // Further out, it may as well stand beyond the other limit: only what was seen before tells.
    for at_rad in [4.55, -1.05] {
        let mut harness = wrapping([-0.5, 4.0], at_rad, false);
        assert_eq!(reference_state(&harness), ReferenceState::OutOfRange, "{at_rad}");
        assert!(
            matches!(harness.ask(Command::Enable).why, AnswerReason::NotReferenced { joint: 0, .. }),
            "{at_rad}"
        );
        comes_in(wrapping([-0.5, 4.0], at_rad, true), at_rad, ReferenceState::Record);
    }
    // A range of a whole revolution: by the record, or by the operator's word, which may lie outside.
    for at_rad in [3.25, -3.25] {
        comes_in(wrapping([-3.1416, 3.1416], at_rad, true), at_rad, ReferenceState::Record);
        let mut harness = wrapping([-3.1416, 3.1416], at_rad, false);
        assert_eq!(reference_state(&harness), ReferenceState::NoRecord);
        harness.accept(Command::Reference { joint: 0, at_rad });
        harness.run(40);
        comes_in(harness, at_rad, ReferenceState::Operator);
    }
    assert_eq!(HOME_RAD[0].to_bits(), 0, "the other joints stand inside");
}
