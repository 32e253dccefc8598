//! Homing of one joint of a simulated arm: the shipped cycle, the CiA 402 master and simulated drives, on simulated time.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]
#![expect(dead_code, reason = "helpers that other tests use")]
mod arm;

use arm::{Arm, JOINTS, shipped};
use taustream_arm::Settings;
use taustream_drivers::sim::{Drive, FaultRequest};
use taustream_drivers::{CanId, Nanos};
use taustream_messages::{Command, FaultReason, Phase, ReferenceState, Replaces};
use taustream_motion::{JointArray, Stroke, Trajectory};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::cycle::NoProbe;
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::names::Names;

/// The last joint: a wrist without gravity, whose drive counts with the joint.
const JOINT: usize = 5;
const NODE: u16 = 6;
/// Where its positive limit switch is: 0.02 rad beyond its range.
const SWITCH_RAD: f64 = 3.1616;
const COUNTS_PER_RAD: f64 = 101.0 * 131_072.0 / std::f64::consts::TAU;
/// Counts are that much of an angle, and a cycle at homing speed.
const TOLERANCE_RAD: f64 = 0.005;

/// The shipped settings, with a method of homing.
fn settings(method: i8) -> Settings {
    shipped("vcan6-homing.toml", |text| text.replace("method = 18", &format!("method = {method}")))
}

/// An arm that is configured, and whose last drive counts from where its power came: 0.4 rad beside the truth.
fn configured(name: &str, settings: Settings) -> Arm {
    let mut arm = Arm::new(name, settings);
    let joints = arm.simulator.simulator.joints();
    let now = arm.now();
    let beside = FaultRequest::parse("joint=wrist_3,kind=jump,value=0.4", &joints).unwrap();
    arm.simulator.simulator.request(now, beside);
    arm.run_until(Phase::Disabled, 8_000);
    arm.run(60);
    arm
}

fn refused(arm: &mut Arm, command: Command) -> AnswerReason {
    assert!(arm.command_queue.commands.ask(command, Nanos(u64::MAX)).is_some());
    arm.step(&mut NoProbe);
    let answer = arm.command_queue.commands.answer().unwrap();
    assert!(!answer.accepted, "{command:?}");
    answer.why
}

fn reference_state(arm: &Arm) -> ReferenceState {
    arm.core.supervisor().referencing().resolved(JOINT).reference_state
}

fn drive(arm: &Arm, joint: usize) -> &Drive {
    arm.simulator.simulator.drive(joint).unwrap().get().unwrap()
}

fn true_rad(arm: &Arm) -> f64 {
    arm.simulator.simulator.drive(JOINT).unwrap().position_rad()
}

fn speed_rad_s(arm: &Arm) -> f64 {
    arm.simulator.simulator.drive(JOINT).unwrap().velocity_rad_s()
}

/// Controlword and target of the newest frame to a drive.
fn rpdo(arm: &Arm, node: u16) -> Option<(u16, i32)> {
    let frame = arm.sent[0].iter().find(|frame| frame.id() == CanId::standard(0x200 + node))?;
    let data = frame.data();
    Some((u16::from_le_bytes([data[0], data[1]]), i32::from_le_bytes(data[2..6].try_into().unwrap())))
}

/// Runs cycles while the arm homes, and holds each against what must always be so; how many they were.
fn watch(arm: &mut Arm, most: u64, mut ends: impl FnMut(&Arm) -> bool) -> u64 {
    let mut others: Option<Vec<i32>> = None;
    for cycle in 0..most {
        if ends(arm) {
            return cycle;
        }
        arm.step(&mut NoProbe);
        let targets: Vec<i32> = (1..NODE).filter_map(|node| Some(rpdo(arm, node)?.1)).collect();
        let energised = (0..JOINTS).all(|joint| drive(arm, joint).statusword() & 0x6F == 0x27);
        if energised && arm.phase() == Phase::Homing {
            // The other joints hold, count for count.
            let before = others.get_or_insert_with(|| targets.clone());
            assert_eq!(*before, targets, "tick {}", arm.tick);
        }
        let speed = speed_rad_s(arm).abs();
        assert!(speed < 0.9, "tick {}: {speed} rad/s", arm.tick);
        // In its position mode the drive is never commanded to be elsewhere than it is.
        if drive(arm, JOINT).mode() == 8 && energised {
            let (_, target) = rpdo(arm, NODE).unwrap();
            let by_rad = (f64::from(target) - f64::from(drive(arm, JOINT).counted())).abs() / COUNTS_PER_RAD;
            assert!(by_rad < TOLERANCE_RAD, "tick {}: {by_rad} rad from its target", arm.tick);
        }
    }
    panic!("{:?} after {most} cycles, cause {:?}", arm.phase(), arm.core.supervisor().cause());
}

fn joint_array(values: [f64; JOINTS]) -> JointArray {
    std::array::from_fn(|joint| values.get(joint).copied().unwrap_or(0.0))
}

fn home(arm: &mut Arm) {
    arm.ask(Command::Home { joint: 5 });
    assert_eq!(arm.phase(), Phase::Homing);
}

/// Into the motion towards the switch.
fn homing_moves(arm: &mut Arm) {
    home(arm);
    watch(arm, 5_000, |arm| speed_rad_s(arm) > 0.7);
}

fn measured_rad(arm: &Arm) -> f64 {
    let resolved = arm.core.supervisor().referencing().resolved(JOINT);
    let zero_rad = arm.settings.servos[JOINT].zero_offset_rad;
    f64::from(drive(arm, JOINT).counted()) / COUNTS_PER_RAD + zero_rad + resolved.offset_rad
}

/// Goal: a joint whose drive counts from anywhere is referenced by its homing, and the arm is ready after `enable`.
#[test]
fn joint_with_incremental_feedback_homes_and_the_arm_is_ready_after_enable() {
    let mut arm = configured("homing", settings(18));
    let why = refused(&mut arm, Command::Enable);
    assert!(matches!(why, AnswerReason::NotReferenced { joint: JOINT, .. }), "{why:?}");
    assert!((measured_rad(&arm) - true_rad(&arm)).abs() > 0.3, "the drive counts from elsewhere");
    home(&mut arm);
    watch(&mut arm, 20_000, |arm| arm.phase() != Phase::Homing);
    assert_eq!(arm.phase(), Phase::Locked, "{:?}", arm.core.supervisor().cause());
    assert_eq!(reference_state(&arm), ReferenceState::Homed);
    assert!((true_rad(&arm) - SWITCH_RAD).abs() < 0.05, "{} rad", true_rad(&arm));
    arm.run(200);
    let newest = arm.newest.unwrap();
    assert!((measured_rad(&arm) - true_rad(&arm)).abs() < TOLERANCE_RAD, "{}", measured_rad(&arm));
    assert!((newest.position_rad[JOINT] - measured_rad(&arm)).abs() < TOLERANCE_RAD, "the command follows");
    arm.ask(Command::Enable);
    assert_eq!(arm.phase(), Phase::Holding);
    arm.run(200);
    // It stands a little outside its range, where the switch is, and may only move inwards.
    let inwards = Stroke {
        start_s: 0.0,
        duration_s: 2.0,
        n: 6,
        delta_rad: joint_array([0.0, 0.0, 0.0, 0.0, 0.0, -0.5]),
    };
    let base_rad = arm.newest.unwrap().position_rad;
    let trajectory = Trajectory::new(JOINTS, base_rad, &[inwards]).unwrap();
    let decision = arm.offer(&trajectory, Replaces::Rest);
    assert!(matches!(decision, Decision::Accepted { .. }), "{decision:?}");
    arm.run_until(Phase::Holding, 20_000);
    arm.run(100);
    assert!((true_rad(&arm) - (base_rad[JOINT] - 0.5)).abs() < TOLERANCE_RAD);
}

/// Goal: nothing else begins while a joint homes.
#[test]
fn nothing_else_is_accepted_while_a_joint_homes() {
    let mut arm = configured("homing-else", settings(18));
    homing_moves(&mut arm);
    let rest = Stroke { start_s: 0.0, duration_s: 1.0, n: 6, delta_rad: joint_array([0.1; JOINTS]) };
    let trajectory = Trajectory::new(JOINTS, arm.newest.unwrap().position_rad, &[rest]).unwrap();
    let decision = arm.offer(&trajectory, Replaces::Rest);
    assert_eq!(decision, Decision::NotReady { phase: Phase::Homing });
    for (command, expected) in [
        (Command::Home { joint: 5 }, AnswerReason::Wait),
        (Command::Enable, AnswerReason::Wait),
        (Command::Disable, AnswerReason::StopFirst),
        (Command::Resume, AnswerReason::NothingToResume),
    ] {
        assert_eq!(refused(&mut arm, command), expected, "{command:?}");
    }
    watch(&mut arm, 20_000, |arm| arm.phase() != Phase::Homing);
    assert_eq!(reference_state(&arm), ReferenceState::Homed);
}

/// Goal: `stop` and `pause` end a homing, and nothing of it goes on.
#[test]
fn homing_that_is_stopped_comes_to_rest_and_stays_there() {
    for command in [Command::Stop, Command::Pause] {
        let mut arm = configured("homing-stop", settings(18));
        homing_moves(&mut arm);
        arm.ask(command);
        // The next frames carry it: the start bit is gone.
        arm.step(&mut NoProbe);
        let (control, _) = rpdo(&arm, NODE).unwrap();
        assert_eq!(control, 0x010F, "halt, without the start bit");
        let cycles = watch(&mut arm, 3_000, |arm| arm.phase() == Phase::Locked);
        assert!(cycles > 100, "it has to come to rest first");
        let at_rad = true_rad(&arm);
        arm.run(2_000);
        assert!((true_rad(&arm) - at_rad).abs() < TOLERANCE_RAD, "{command:?}: it went on");
        assert_eq!(reference_state(&arm), ReferenceState::Homing);
        assert_eq!(refused(&mut arm, Command::Enable), AnswerReason::NotHomed { joint: JOINT });
        // And again, from there.
        home(&mut arm);
        watch(&mut arm, 20_000, |arm| arm.phase() != Phase::Homing);
        assert_eq!((arm.phase(), reference_state(&arm)), (Phase::Locked, ReferenceState::Homed));
    }
}

/// Goal: whatever stops the arm stops a homing; where the drives hold, they hold where the joint has come to rest.
#[test]
fn faults_of_any_joint_end_the_homing_and_the_arm_holds() {
    let cases = [
        ("", FaultReason::Operator, None),
        ("joint=elbow,kind=silence", FaultReason::FeedbackLate, Some(2)),
        ("joint=wrist_3,kind=silence", FaultReason::FeedbackLate, Some(JOINT)),
        ("joint=elbow,kind=fault,value=0x7305", FaultReason::DriveFault, Some(2)),
        ("joint=wrist_3,kind=fault,value=0x7305", FaultReason::DriveFault, Some(JOINT)),
        ("joint=wrist_3,kind=warning", FaultReason::DriveWarning, Some(JOINT)),
    ];
    for (fault, reason, joint) in cases {
        let mut arm = configured("homing-fault", settings(18));
        homing_moves(&mut arm);
        if fault.is_empty() {
            arm.ask(Command::FastStop);
        } else {
            let joints = arm.simulator.simulator.joints();
            let now = arm.now();
            arm.simulator.simulator.request(now, FaultRequest::parse(fault, &joints).unwrap());
        }
        arm.run_until(Phase::Fault, 400);
        let cause = arm.core.supervisor().cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (reason, joint), "{fault}");
        arm.run(3_000);
        let at_rad = true_rad(&arm);
        arm.run(1_000);
        assert!((true_rad(&arm) - at_rad).abs() < TOLERANCE_RAD, "{fault}: it goes on");
        assert!(speed_rad_s(&arm).abs() < 0.01, "{fault}");
        assert_ne!(reference_state(&arm), ReferenceState::Homed, "{fault}");
    }
}

/// Goal: after a fast stop in a homing the drive is back in its position mode, and the fault can be cleared.
#[test]
fn fault_in_a_homing_is_cleared_and_the_joint_homed_again() {
    let mut arm = configured("homing-clear", settings(18));
    homing_moves(&mut arm);
    arm.ask(Command::FastStop);
    arm.run(3_000);
    assert_eq!((arm.phase(), drive(&arm, JOINT).mode()), (Phase::Fault, 8));
    arm.ask(Command::ClearFault);
    assert_eq!(arm.phase(), Phase::Locked);
    home(&mut arm);
    watch(&mut arm, 20_000, |arm| arm.phase() != Phase::Homing);
    assert_eq!(reference_state(&arm), ReferenceState::Homed);
}

/// Goal: torque off ends it at once, and the drive comes back to its position mode before it can be energised.
#[test]
fn torque_off_in_a_homing_leaves_no_drive_in_its_homing_mode() {
    let mut arm = configured("homing-torque-off", settings(18));
    homing_moves(&mut arm);
    arm.ask(Command::TorqueOff);
    arm.run(2_000);
    assert_eq!(drive(&arm, JOINT).statusword() & 0x04, 0, "it is energised");
    assert_eq!(drive(&arm, JOINT).mode(), 8);
    arm.ask(Command::ClearFault);
    arm.run_until(Phase::Disabled, 3_000);
    arm.run(100);
    home(&mut arm);
    watch(&mut arm, 20_000, |arm| arm.phase() != Phase::Homing);
    assert_eq!(reference_state(&arm), ReferenceState::Homed);
}

/// Goal: a homing that does not end in its time, or that the drive cannot do, is a fault that says so, and the joint rests.
#[test]
fn homing_that_fails_is_named_and_the_joint_rests() {
    let mut late = settings(18);
    let cia402 = *late.servos[JOINT].protocol.get::<taustream_arm::Cia402>().unwrap();
    let homing = cia402.homing.map(|homing| taustream_arm::HomingSettings { timeout_s: 1.0, ..homing });
    late.servos[JOINT].protocol = taustream_arm::Cia402 { homing, ..cia402 }.into();
    // A method that the drive does not have.
    let unknown = settings(5);
    for (settings, words) in [(late, "homing has not ended within its time"), (unknown, "0x6098")] {
        let names = Names::of(&settings);
        let mut arm = configured("homing-fails", settings);
        home(&mut arm);
        arm.run_until(Phase::Fault, 5_000);
        let cause = arm.core.supervisor().cause().unwrap();
        assert_eq!((cause.reason, cause.joint), (FaultReason::HomingFailed, Some(JOINT)));
        let sentence = names.fault(&cause);
        assert!(sentence.contains(words) && sentence.contains("wrist_3"), "{sentence}");
        arm.run(2_000);
        assert!(speed_rad_s(&arm).abs() < 0.01);
        assert_eq!((arm.phase(), drive(&arm, JOINT).mode()), (Phase::Fault, 8));
        arm.ask(Command::ClearFault);
        assert_eq!(arm.phase(), Phase::Locked);
    }
}

/// Goal: a joint that was referenced with an offset begins its homing where it stands, without a step.
#[test]
fn homing_of_a_referenced_joint_begins_without_a_step() {
    let mut arm = configured("homing-again", settings(37));
    let at_rad = measured_rad(&arm) + 1.0;
    arm.ask(Command::Reference { joint: 5, at_rad });
    arm.run(60);
    arm.ask(Command::Enable);
    arm.run_until(Phase::Holding, 3_000);
    arm.run(300);
    assert!((measured_rad(&arm) - at_rad).abs() < TOLERANCE_RAD);
    let before_rad = true_rad(&arm);
    home(&mut arm);
    watch(&mut arm, 5_000, |arm| arm.phase() != Phase::Homing);
    assert_eq!((arm.phase(), reference_state(&arm)), (Phase::Locked, ReferenceState::Homed));
    arm.run(300);
    assert!((true_rad(&arm) - before_rad).abs() < TOLERANCE_RAD, "homed where it stands, and it moved");
    // Method 37: where it stands is the home position.
    assert!((measured_rad(&arm) - SWITCH_RAD).abs() < TOLERANCE_RAD, "{}", measured_rad(&arm));
}

/// Goal: drives without homing, and arms that are not at rest, get the reason.
#[test]
fn homing_is_refused_where_it_is_not_set_up_or_something_moves() {
    let settings = settings(18);
    let names = Names::of(&settings);
    let mut arm = configured("homing-refused", settings);
    let why = refused(&mut arm, Command::Home { joint: 0 });
    assert_eq!(why, AnswerReason::NoHoming { joint: 0 });
    assert!(why.sentence(&names).contains("[servo.homing]"), "{}", why.sentence(&names));
    assert_eq!(refused(&mut arm, Command::Home { joint: 6 }), AnswerReason::NoSuchJoint { joint: 6 });
    arm.ask(Command::Reference { joint: 5, at_rad: 0.0 });
    arm.run(60);
    arm.ask(Command::Enable);
    arm.run_until(Phase::Holding, 3_000);
    arm.run(100);
    arm.move_it(0.2);
    arm.run(300);
    assert_eq!(refused(&mut arm, Command::Home { joint: 5 }), AnswerReason::StopFirst);
    let damiao = Names::of(&shipped("damiao6.toml", str::to_owned));
    let words = AnswerReason::NoHoming { joint: 2 }.sentence(&damiao);
    assert!(words.contains("have no homing") && words.contains("taustream reference"), "{words}");
}

/// Goal: an end of the streamer in a homing is orderly.
#[test]
fn end_of_the_streamer_in_a_homing_stops_it_and_de_energises() {
    let mut arm = configured("homing-end", settings(18));
    homing_moves(&mut arm);
    arm.command_queue.shutdown_handle().request(taustream_streamer::intake::Shutdown::Orderly);
    arm.run(6_000);
    assert_eq!(drive(&arm, JOINT).statusword() & 0x04, 0, "it is energised");
    assert!(arm.visited.contains(&Phase::Locked), "{:?}", arm.visited);
}
