//! A gripper beside the path: the shipped cycle and drivers, simulated motors, simulated time.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a case that cannot be made fails its test"
)]
mod arm;

use arm::{Arm, shipped};
use taustream_drivers::Nanos;
use taustream_drivers::sim::FaultRequest;
use taustream_messages::{AxisGoal, AxisReport, AxisState, Command, FaultReason, Phase};
use taustream_streamer::answer::{AnswerReason, CommandAnswer};
use taustream_streamer::cycle::NoProbe;
use taustream_streamer::names::Names;

const GRIPPER: usize = 6;
const FILE: &str = "damiao6-gripper.toml";
/// An object of 40 mm between the jaws: 2 rad of the motor's output.
const OBJECT: &str = "joint=gripper,kind=object,value=1.5";
const OBJECT_M: f64 = 0.03;

fn go(goal: AxisGoal) -> Command {
    Command::Axis { axis: 0, goal, force: None }
}

fn with_gripper(name: &str) -> Arm {
    Arm::new(name, shipped(FILE, str::to_owned))
}

fn enabled(name: &str) -> Arm {
    let mut arm = with_gripper(name);
    arm.enable();
    arm
}

/// The shipped CiA 402 arm with a claw on a drive that measures no torque.
fn on_cia402() -> taustream_arm::Settings {
    shipped("vcan6.toml", |text| {
        let (bound, _) = text.split_once("# The simulated servos").unwrap();
        format!("{bound}{SERVO}{AXIS}[simulator]\nbrake = true\nfollowing_window_rad = 0.3\n")
    })
}

fn answer(arm: &mut Arm, command: Command) -> CommandAnswer {
    assert!(arm.command_queue.commands.ask(command, Nanos(u64::MAX)).is_some());
    arm.step(&mut NoProbe);
    arm.command_queue.commands.answer().unwrap()
}

fn refusal(arm: &mut Arm, command: Command) -> String {
    let answer = answer(arm, command);
    assert!(!answer.accepted, "{command:?} was accepted");
    answer.why.sentence(&Names::of(&arm.settings))
}

fn axis(arm: &Arm) -> AxisReport {
    arm.newest.unwrap().axes[0]
}

fn plant_fault(arm: &mut Arm, text: &str) {
    let joints = arm.simulator.simulator.joints();
    let request = FaultRequest::parse(text, &joints).unwrap();
    let now = arm.now();
    arm.simulator.simulator.request(now, request);
}

/// Runs until the axis is in a state; fails after some seconds.
fn until(arm: &mut Arm, state: AxisState) {
    for _ in 0..6_000 {
        if axis(arm).state() == state {
            return;
        }
        arm.run(1);
    }
    panic!("{:?} instead of {state:?}", axis(arm));
}

#[test]
fn gripper_opens_closes_and_goes_to_a_width_while_the_arm_holds() {
    let mut arm = enabled("axes-open");
    assert_eq!(axis(&arm).state(), AxisState::Holding);
    for (goal, at_m) in [(AxisGoal::Open, 0.08), (AxisGoal::Closed, 0.0), (AxisGoal::At(0.03), 0.03)] {
        let why = answer(&mut arm, go(goal)).why;
        assert_eq!(why, AnswerReason::AxisGoes { axis: 0, to: at_m });
        arm.run(20);
        assert_eq!((axis(&arm).state(), axis(&arm).target), (AxisState::Moving, at_m));
        until(&mut arm, AxisState::Holding);
        arm.run(300);
        let gripper = axis(&arm);
        assert!((gripper.command - at_m).abs() < 1e-9, "{gripper:?}");
        assert!((gripper.measured - at_m).abs() < 5e-4, "{gripper:?}");
        assert_eq!(arm.phase(), Phase::Holding);
    }
}

/// Goal: no setpoint of the gripper is further from the one before than its speed, and its differences keep the stop limits.
#[test]
fn gripper_led_elsewhere_at_any_moment_keeps_its_limits_on_the_bus() {
    let mut arm = enabled("axes-limits");
    let stop = arm.settings.axes[0].output.limits.stop;
    let mut past = Vec::new();
    for (number, goal) in [0.08, 0.01, 0.05, 0.0, 0.08, 0.02].into_iter().enumerate() {
        arm.ask(go(AxisGoal::At(goal)));
        for cycle in 0..150 + 70 * number {
            // The first one was run with the command.
            arm.run(u64::from(cycle > 0));
            let cycle = arm.newest.unwrap();
            assert!(cycle.joint_sent[GRIPPER]);
            past.push(cycle.position_rad[GRIPPER]);
        }
    }
    for window in past.windows(4) {
        let (velocity, acceleration) = (window[3] - window[2], window[3] - 2.0 * window[2] + window[1]);
        let jerk = window[3] - 3.0 * window[2] + 3.0 * window[1] - window[0];
        assert!(velocity.abs() <= 1.001e-3 * stop.velocity_rad_s, "{window:?}");
        assert!(acceleration.abs() <= 1.001e-6 * stop.acceleration_rad_s2, "{window:?}");
        assert!(jerk.abs() <= 1.001e-9 * stop.jerk_rad_s3 + 1e-12, "{window:?}");
    }
}

#[test]
fn gripper_that_closes_on_an_object_holds_it_and_says_so() {
    let mut arm = enabled("axes-object");
    arm.ask(go(AxisGoal::Open));
    until(&mut arm, AxisState::Moving);
    until(&mut arm, AxisState::Holding);
    plant_fault(&mut arm, OBJECT);
    arm.ask(Command::Axis { axis: 0, goal: AxisGoal::Closed, force: Some(20.0) });
    until(&mut arm, AxisState::InContact);
    arm.run(500);
    let gripper = axis(&arm);
    assert_eq!((gripper.state(), arm.phase()), (AxisState::InContact, Phase::Holding));
    assert!((gripper.measured - OBJECT_M).abs() < 2e-4, "{gripper:?}");
    // 20 N are 1 mm of its spring of 20 N/mm; the squeeze is 3 mm at most. The motor states its torque in steps of 0.25 N.
    let squeeze_m = gripper.measured - gripper.command;
    assert!((0.0008..0.0012).contains(&squeeze_m), "{gripper:?}");
    assert!((-23.0..-17.0).contains(&gripper.force), "{gripper:?}");
    // The object goes: nothing is held any more.
    arm.simulator.simulator.clear(None);
    until(&mut arm, AxisState::Holding);
    arm.ask(go(AxisGoal::Open));
    until(&mut arm, AxisState::Moving);
    until(&mut arm, AxisState::Holding);
    assert!((axis(&arm).command - 0.08).abs() < 1e-9);
}

#[test]
fn gripper_moves_while_the_arm_moves_and_the_path_knows_nothing_of_it() {
    let mut arm = enabled("axes-moving");
    let trajectory = arm.move_it(1.0);
    arm.run(300);
    arm.ask(go(AxisGoal::At(0.06)));
    until(&mut arm, AxisState::Moving);
    for _ in 0..400 {
        arm.run(1);
        let cycle = arm.newest.unwrap();
        assert_eq!(arm.phase(), Phase::Moving);
        let on_path = trajectory.sample(cycle.s).position_rad;
        let commanded = cycle.position_rad.iter().zip(&on_path).take(GRIPPER);
        assert!(commanded.clone().all(|(q, wanted)| q.to_bits() == wanted.to_bits()), "{cycle:?}");
    }
    until(&mut arm, AxisState::Holding);
    arm.run_until(Phase::Holding, 8_000);
    assert!((axis(&arm).command - 0.06).abs() < 1e-9);
    // What runs next starts where the joints stand, whatever the gripper does.
    arm.move_it(0.5);
    arm.ask(go(AxisGoal::Closed));
    arm.run_until(Phase::Holding, 8_000);
}

#[test]
fn silent_gripper_servo_stops_the_arm_and_is_named() {
    let mut arm = enabled("axes-silent");
    arm.move_it(1.0);
    arm.ask(go(AxisGoal::Closed));
    arm.run(200);
    plant_fault(&mut arm, "joint=gripper,kind=silence");
    arm.run_until(Phase::Fault, 3_000);
    let cause = arm.core.supervisor().cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::FeedbackLate, Some(GRIPPER)));
    let said = Names::of(&arm.settings).fault(&cause);
    assert!(said.contains("at axis `gripper`"), "{said}");
    assert!(refusal(&mut arm, go(AxisGoal::Open)).contains("axis `gripper`"));
}

#[test]
fn faulted_gripper_servo_stops_the_arm_and_is_reported_as_a_fault() {
    let mut arm = enabled("axes-fault");
    plant_fault(&mut arm, "joint=gripper,kind=fault");
    arm.run_until(Phase::Fault, 3_000);
    let cause = arm.core.supervisor().cause().unwrap();
    assert_eq!((cause.reason, cause.joint), (FaultReason::DriveFault, Some(GRIPPER)));
    arm.run(5);
    assert_eq!(axis(&arm).state(), AxisState::Fault);
}

/// Goal: a fault of the arm leaves a held part held, or lets it go, as the settings say.
#[test]
fn fault_of_the_arm_leaves_the_part_held_or_lets_it_go_by_the_settings() {
    for (name, rule, squeeze_m) in [
        ("axes-hold", "on_fault = \"hold\"", 0.001..0.003),
        ("axes-relax", "on_fault = \"relax\"", -1e-4..3e-4),
    ] {
        let settings = shipped(FILE, |text| text.replacen("on_fault = \"hold\"", rule, 1));
        let mut arm = Arm::new(name, settings);
        arm.enable();
        plant_fault(&mut arm, OBJECT);
        arm.ask(go(AxisGoal::Closed));
        until(&mut arm, AxisState::InContact);
        arm.run(300);
        plant_fault(&mut arm, "joint=elbow,kind=warning");
        plant_fault(&mut arm, "joint=elbow,kind=jump,value=0.1");
        arm.run_until(Phase::Fault, 3_000);
        arm.run(500);
        let gripper = axis(&arm);
        assert!(squeeze_m.contains(&(gripper.measured - gripper.command)), "{rule}: {gripper:?}");
        assert_eq!(arm.phase(), Phase::Fault);
    }
}

#[test]
fn stop_and_pause_bring_the_gripper_to_rest_and_resume_does_not_lead_it_on() {
    let mut arm = enabled("axes-stop");
    for (command, moving_arm) in [(Command::Stop, false), (Command::Pause, false), (Command::Pause, true)] {
        if moving_arm {
            arm.move_it(1.0);
        }
        let far = if axis(&arm).command > 0.04 { 0.0 } else { 0.08 };
        arm.ask(go(AxisGoal::At(far)));
        arm.run(200);
        if !moving_arm {
            let said = refusal(&mut arm, Command::Disable);
            assert!(said.contains("axis `gripper` moves"), "{said}");
        }
        arm.ask(command);
        until(&mut arm, AxisState::Holding);
        let rests_at = axis(&arm).command;
        assert!((rests_at - far).abs() > 0.005, "{command:?}: it went on to {rests_at}");
        if moving_arm {
            arm.run_until(Phase::Paused, 3_000);
            arm.ask(Command::Resume);
            arm.run_until(Phase::Holding, 8_000);
        }
        arm.run(300);
        assert_eq!(axis(&arm).command.to_bits(), rests_at.to_bits());
    }
    arm.ask(Command::Axis { axis: 0, goal: AxisGoal::Open, force: None });
    arm.run(100);
    arm.ask(Command::Axis { axis: 0, goal: AxisGoal::Stop, force: None });
    until(&mut arm, AxisState::Holding);
    arm.ask(Command::Disable);
    arm.run_until(Phase::Disabled, 3_000);
    assert_eq!(axis(&arm).state(), AxisState::Holding, "the newest cycle that was live");
}

/// Goal: a stall that the servos bridge costs nothing; after one that they do not the setpoint is the last one again, and the
/// axis goes on from rest; a long one ends the motion.
#[test]
fn stall_of_the_loop_is_bridged_or_goes_on_from_rest_or_ends_the_motion() {
    for (name, settings, gap, goes_on) in [
        ("axes-stall-mit", shipped(FILE, str::to_owned), 15, true),
        ("axes-stall-long", shipped(FILE, str::to_owned), 40, false),
        ("axes-stall-freeze", on_cia402(), 10, true),
        ("axes-stall-freeze-long", on_cia402(), 40, false),
    ] {
        let bridged = u64::from(settings.bridged_gap_periods()) >= gap;
        let mut arm = Arm::new(name, settings);
        arm.enable();
        arm.ask(go(AxisGoal::Open));
        arm.run(400);
        let before = arm.newest.unwrap().position_rad[GRIPPER];
        arm.tick += gap - 1;
        arm.run(1);
        let after = arm.newest.unwrap().position_rad[GRIPPER];
        assert_eq!(after.to_bits() == before.to_bits(), !bridged, "{name}: {before}, then {after}");
        arm.run(5);
        let state = if goes_on { AxisState::Moving } else { AxisState::Holding };
        assert_eq!((axis(&arm).state(), arm.phase()), (state, Phase::Holding), "{name}");
        until(&mut arm, AxisState::Holding);
        let there = (axis(&arm).command - axis(&arm).goal).abs() < 1e-9;
        assert_eq!((there, arm.phase()), (goes_on, Phase::Holding), "{name}");
        if !goes_on {
            assert_eq!(arm.newest.unwrap().position_rad[GRIPPER].to_bits(), before.to_bits(), "{name}");
            arm.ask(go(AxisGoal::Open));
            until(&mut arm, AxisState::Moving);
            until(&mut arm, AxisState::Holding);
        }
    }
}

#[test]
fn bad_commands_are_refused_with_who_what_and_by_how_much() {
    let mut arm = with_gripper("axes-bad");
    arm.run_until(Phase::Disabled, 8_000);
    assert!(refusal(&mut arm, go(AxisGoal::Open)).contains("`enable` first"));
    arm.run(50);
    arm.enable();
    let force = |force| Command::Axis { axis: 0, goal: AxisGoal::Open, force: Some(force) };
    for (command, words) in [
        (go(AxisGoal::At(0.0801)), ["axis `gripper`", "0.000100 m outside [0.000000, 0.080000]"]),
        (go(AxisGoal::At(-0.5)), ["axis `gripper`", "0.500000 m outside"]),
        (go(AxisGoal::At(f64::NAN)), ["axis `gripper`", "NaN"]),
        (force(40.5), ["axis `gripper`", "up to 40.000 N, not 40.500 N"]),
        (force(0.0), ["axis `gripper`", "above 0"]),
        (force(f64::NAN), ["axis `gripper`", "NaN"]),
        (Command::Axis { axis: 1, goal: AxisGoal::Open, force: None }, ["no axis 2", "have 1"]),
        (Command::Axis { axis: u32::MAX, goal: AxisGoal::Open, force: None }, ["no axis", "have 1"]),
    ] {
        let said = refusal(&mut arm, command);
        for word in words {
            assert!(said.contains(word), "no {word:?} in: {said}");
        }
        assert_eq!(axis(&arm).state(), AxisState::Holding);
    }
}

/// Goal: a servo that measures no torque notices contact by its distance alone.
#[test]
fn gripper_on_a_cia_402_drive_notices_contact_by_its_lag() {
    let mut arm = Arm::new("axes-cia402", on_cia402());
    arm.enable();
    assert!(
        refusal(&mut arm, Command::Axis { axis: 0, goal: AxisGoal::Open, force: Some(1.0) })
            .contains("no force")
    );
    plant_fault(&mut arm, "joint=claw,kind=object,value=0.5");
    arm.ask(go(AxisGoal::Open));
    until(&mut arm, AxisState::InContact);
    arm.run(1_000);
    let claw = axis(&arm);
    assert!((claw.measured - 0.5).abs() < 1e-3 && (claw.command - 0.5).abs() <= 0.0201, "{claw:?}");
    assert!(claw.force.is_nan());
    assert_eq!((claw.state(), arm.phase()), (AxisState::InContact, Phase::Holding));
}

const SERVO: &str = r#"
[[servo]]
axis = "claw"
bus = "arm"
node_id = 7
protocol = "cia402"
sign = 1
gear_ratio = 20.0
counts_per_rev = 65536
zero_offset_rad = 0.0
feedback = "multi-turn"
feedback_range_rad = [-100.0, 100.0]
reaction = "hold"
limp_is_safe = false
"#;
const AXIS: &str = r#"
[[axis]]
name = "claw"
unit = "rad"
position_rad = [-0.1, 1.0]
open_rad = 1.0
closed_rad = 0.0
motion = { velocity_rad_s = 1.0, acceleration_rad_s2 = 10.0, jerk_rad_s3 = 200.0 }
contact = { lag_rad = 0.05, time_ms = 10, squeeze_rad = 0.02 }
tracking_error_rad_max = 0.19
covered_by = "link6"

"#;
