//! The shipped cycle, its CiA 402 driver and its local link under a counting allocator: no allocation, no free.
//!
//! The far end of the link is the simulator's drives, on the same thread and on simulated time, so that 60,000 cycles
//! with trajectories, pauses, stops and faults take seconds and always run the same. Only what `run_cycle` itself does
//! counts.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]
mod arm;
mod bimanual;
mod fed;

use arm::{Arm, shipped};
use taustream_arm::Settings;
use taustream_drivers::Nanos;
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_drivers::sim::FaultRequest;
use taustream_messages::{AxisGoal, AxisState, Command, Phase, Replaces};
use taustream_motion::cut::kept;
use taustream_motion::limits::check_motion_from;
use taustream_motion::{Stroke, Trajectory, joint_array};
use taustream_streamer::cycle::{Probe, Stage};
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::successor::CutRefusal;

#[path = "../../drivers/tests/counting/mod.rs"]
mod counting;
use counting::{CountingAllocator, allocations};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn counted(name: &str, settings: Settings) -> Arm {
    let mut arm = Arm::new(name, settings);
    arm.around = |cycle| allocations(cycle);
    arm
}

#[test]
fn cycle_over_sixty_thousand_runs_with_motions_stops_and_faults_never_allocates() {
    let mut arm = counted("no-alloc", shipped("vcan6.toml", str::to_owned));
    live_through(&mut arm, 60_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

#[test]
fn cycle_with_damiao_motors_never_allocates() {
    let mut arm = counted("no-alloc-damiao", shipped("damiao6.toml", str::to_owned));
    live_through(&mut arm, 40_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

/// A joint that homes itself, is stopped in it, and homes again.
#[test]
fn cycle_with_a_joint_that_homes_itself_never_allocates() {
    let multi_turn = |text: &str| text.replace("\"incremental\"\n", "\"multi-turn\"\n");
    let mut arm = counted("no-alloc-homing", shipped("vcan6-homing.toml", multi_turn));
    live_through(&mut arm, 5_000);
    arm.ask(Command::Home { joint: 5 });
    arm.run(1_500);
    assert_eq!(arm.phase(), Phase::Homing);
    arm.ask(Command::Stop);
    arm.run_until(Phase::Locked, 3_000);
    arm.ask(Command::Home { joint: 5 });
    arm.run_until(Phase::Locked, 20_000);
    arm.ask(Command::Enable);
    arm.run(100);
    assert_eq!(arm.phase(), Phase::Holding);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

/// A gripper that opens, closes on an object, is led elsewhere in motion and is stopped, beside all that happens to the arm.
#[test]
fn cycle_with_a_gripper_never_allocates() {
    let mut arm = counted("no-alloc-gripper", shipped("damiao6-gripper.toml", str::to_owned));
    live_through(&mut arm, 10_000);
    let joints = arm.simulator.simulator.joints();
    let object = FaultRequest::parse("joint=gripper,kind=object,value=1.5", &joints).unwrap();
    for goal in [AxisGoal::Open, AxisGoal::Closed, AxisGoal::At(0.05), AxisGoal::Stop, AxisGoal::Closed] {
        arm.ask(Command::Axis { axis: 0, goal, force: None });
        arm.run(400);
    }
    let now = arm.now();
    arm.ask(Command::Axis { axis: 0, goal: AxisGoal::Open, force: None });
    arm.run(3_000);
    arm.simulator.simulator.request(now, object);
    arm.ask(Command::Axis { axis: 0, goal: AxisGoal::Closed, force: Some(20.0) });
    arm.run(3_000);
    assert_eq!(arm.newest.unwrap().axes[0].state(), AxisState::InContact);
    arm.ask(Command::FastStop);
    recover(&mut arm);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

#[test]
fn cycle_with_robstride_motors_never_allocates() {
    let mut arm = counted("no-alloc-robstride", shipped("robstride6.toml", str::to_owned));
    live_through(&mut arm, 25_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

#[test]
fn cycle_with_cubemars_motors_never_allocates() {
    let mut arm = counted("no-alloc-cubemars", shipped("ak6.toml", str::to_owned));
    live_through(&mut arm, 25_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

#[test]
fn cycle_with_myactuator_motors_never_allocates() {
    let mut arm = counted("no-alloc-myactuator", shipped("rmd6.toml", str::to_owned));
    live_through(&mut arm, 15_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

#[test]
fn cycle_with_odrive_axes_never_allocates() {
    let mut arm = counted("no-alloc-odrive", shipped("odrive6.toml", str::to_owned));
    live_through(&mut arm, 15_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

/// The arm controller of a Piper: its joints have ranges and signs of their own, so it is not led to the others' home.
#[test]
fn cycle_with_a_piper_never_allocates() {
    let mut arm = counted("no-alloc-piper", shipped("piper.toml", str::to_owned));
    live_through(&mut arm, 15_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

/// Fourteen joints and two grippers: every slot that there is, on four buses.
#[test]
fn cycle_with_sixteen_servos_on_four_buses_never_allocates() {
    let mut arm = counted("no-alloc-sixteen", bimanual::settings(4));
    assert_eq!((arm.settings.slots(), arm.settings.buses.len()), (16, 4));
    live_through(&mut arm, 15_000);
    for axis in [0, 1] {
        for goal in [AxisGoal::Open, AxisGoal::Closed] {
            arm.ask(Command::Axis { axis, goal, force: None });
            arm.run(400);
        }
    }
    arm.ask(Command::FastStop);
    recover(&mut arm);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

/// The same with torques beside the positions, on an arm that feels its masses.
#[test]
fn cycle_with_torques_beside_positions_never_allocates() {
    let settings = fed::settings("no-alloc-fed", 0.5, &fed::section(true, 1.0));
    let mut arm = fed::arm("no-alloc-fed", settings, 0.5);
    arm.around = |cycle| allocations(cycle);
    live_through(&mut arm, 25_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

/// The same over two buses with a bit rate, setpoints that share frames and take turns, and rarer answers.
#[test]
fn cycle_over_two_buses_packed_and_staggered_never_allocates() {
    let traffic =
        "bitrate_bit_s = 1000000\npacked = true\nsetpoint_every = 2\nstagger = true\nfeedback_every = 2";
    let edit = |text: &str| text.replace("bitrate_bit_s = 1000000", traffic);
    let mut arm = counted("no-alloc-two", shipped("dual-bus.toml", edit));
    assert!(arm.settings.buses.len() == 2 && arm.settings.buses.iter().all(|bus| bus.traffic.packed));
    live_through(&mut arm, 25_000);
    assert_eq!(arm.calls, 0, "allocations and frees in {} cycles", arm.counted);
}

fn fault(arm: &mut Arm, spec: &str) {
    let request = FaultRequest::parse(spec, &arm.simulator.simulator.joints()).unwrap();
    arm.simulator.simulator.request(arm.now(), request);
}

/// From fault back to holding, by the whole way down and up.
fn recover(arm: &mut Arm) {
    arm.run_until(Phase::Fault, 3_000);
    arm.simulator.simulator.clear(None);
    arm.run(100);
    arm.ask(Command::Disable);
    arm.run(500);
    clear(arm);
    arm.run(400);
    arm.enable();
}

/// Clears until the arm is ready: motors come back with faults of their own, and one that kept its torque without a master is
/// let go first.
fn clear(arm: &mut Arm) {
    for _ in 0..10 {
        if arm.try_ask(Command::ClearFault).is_err() {
            let _not_while_it_is_off = arm.try_ask(Command::TorqueOff);
        }
        arm.run(1_000);
        if arm.phase() == Phase::Disabled {
            return;
        }
    }
    panic!("{:?} cannot be cleared: {:?}", arm.phase(), arm.core.supervisor().cause());
}

/// The first bus vanishes under the motion and comes back; this thread plays the service thread's part.
fn lose_a_bus_and_restore_it(arm: &mut Arm) {
    arm.far_ends[0] = None;
    arm.run_until(Phase::Fault, 3_000);
    arm.run(200);
    if arm.far_ends.len() > 1 {
        // Joints that still hold come first.
        arm.ask(Command::Disable);
        arm.run(500);
    }
    let servos = link::open(&arm.settings.buses[0], LinkChoice::Local, LinkRole::Servos, &arm.runtime);
    arm.far_ends[0] = Some(servos.unwrap());
    assert!(arm.command_queue.commands.ask(Command::ClearFault, Nanos(u64::MAX)).is_some());
    arm.run(1);
    let mut handover =
        arm.command_queue.trajectories.failed_links().expect("the failed bus's link is handed out");
    handover.recovered = handover.links.iter_mut().flatten().all(|link| link.reopen().is_ok());
    assert!(handover.recovered, "the link cannot be reopened");
    arm.run(3);
    arm.command_queue.trajectories.return_links(handover);
    arm.run(1);
    assert!(arm.command_queue.commands.answer().unwrap().accepted);
    // The drives' own watchdogs have left faults, which are reported once they were looked at again.
    arm.run(1_000);
    if arm.phase() == Phase::Fault {
        clear(arm);
    }
    arm.enable();
}

/// Replaces the motion that runs by the same with a small stroke more.
fn replace(arm: &mut Arm, running: &Trajectory, (ahead_s, by_rad): (f64, f64)) -> Decision {
    let newest = arm.newest.unwrap();
    let (trajectory_id, at_s) = (newest.trajectory_id, newest.s + ahead_s);
    let kept = kept(running, at_s, at_s);
    let later = running.strokes().iter().filter(|stroke| stroke.start_s >= at_s);
    let stroke = Stroke {
        start_s: at_s,
        duration_s: 1.5,
        n: 6,
        delta_rad: joint_array([by_rad, 0.0, by_rad, 0.0, 0.0, by_rad]),
    };
    let mut strokes = kept.strokes.to_vec();
    strokes.push(stroke);
    strokes.extend(later);
    let trajectory = Trajectory::new(running.joints(), kept.base_rad, &strokes).unwrap();
    check_motion_from(&trajectory, &arm.settings.robot.limits(), at_s).unwrap();
    arm.offer(&trajectory, Replaces::Cut { trajectory_id, at_s })
}

/// Motions, pauses, stops and faults, over and over.
fn live_through(arm: &mut Arm, cycles: u64) {
    arm.enable();
    let mut round = 0;
    let (mut accepted, mut refused) = (0, 0);
    let mut count = |decision: Decision| match decision {
        Decision::Waits { .. } => accepted += 1,
        Decision::Cut(CutRefusal::Passed { .. }) => refused += 1,
        Decision::Accepted { .. }
        | Decision::Cut(_)
        | Decision::Stale { .. }
        | Decision::NotAtBase { .. }
        | Decision::NotReady { .. } => panic!("{decision:?}"),
    };
    while arm.counted < cycles || round < 5 {
        let running = arm.move_it(1.0);
        arm.run(300);
        // One that is refused, one that takes the place of what waits, and takes over.
        for (ahead_s, by_rad) in [(0.3, 0.04), (-0.1, 0.04), (0.05, -0.04)] {
            count(replace(arm, &running, (ahead_s, by_rad)));
        }
        arm.run(100);
        arm.ask(Command::Pause);
        arm.run_until(Phase::Paused, 1_500);
        arm.ask(Command::Speed { percent: 60.0 });
        arm.ask(Command::Resume);
        arm.run(200);
        arm.ask(Command::Speed { percent: 100.0 });
        arm.run_until(Phase::Holding, 8_000);
        arm.move_it(1.0);
        arm.run(700);
        arm.ask(Command::Stop);
        arm.run_until(Phase::Holding, 1_500);
        arm.run(100);
        let running = arm.move_it(0.5);
        arm.run(450);
        // Dropped by what comes next.
        count(replace(arm, &running, (0.5, 0.04)));
        arm.run(50);
        let joint = round % arm.settings.robot.joints.len() + 1;
        match round % 5 {
            0 => fault(arm, &format!("joint={joint},kind=silence")),
            1 => fault(arm, &format!("joint={joint},kind=fault")),
            2 => fault(arm, &format!("joint={joint},kind=jump,value=0.1")),
            3 => {
                lose_a_bus_and_restore_it(arm);
                round += 1;
                continue;
            }
            _ => arm.ask(Command::FastStop),
        }
        recover(arm);
        round += 1;
    }
    assert!(accepted >= 3 * round && refused == round, "{accepted} replacements, {refused} refused");
    for phase in [Phase::Moving, Phase::Paused, Phase::Stopping, Phase::FastStopping, Phase::Fault] {
        assert!(arm.visited.contains(&phase), "{phase:?} was never reached");
    }
}

/// Allocates once, in a stage of the shipped cycle.
struct Planted;

impl Probe for Planted {
    fn ended(&mut self, stage: Stage) {
        if stage == Stage::Guard {
            std::hint::black_box(Box::new(1_u64));
        }
    }
}

#[test]
fn planted_allocation_in_the_cycle_is_counted() {
    let mut arm = counted("planted", shipped("vcan6.toml", str::to_owned));
    arm.run(10);
    assert_eq!(arm.calls, 0);
    arm.step(&mut Planted);
    assert_eq!(arm.calls, 2, "one allocation and its free");
}
