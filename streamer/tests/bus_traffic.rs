//! Ways to carry setpoints and answers, and buses that are too full or lost: the shipped cycle over simulated drives.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests fail by panicking"
)]
mod arm;

use arm::{Arm, JOINTS, shipped};
use taustream_arm::{BusKind, Settings};
use taustream_drivers::sim::LinkedSimulator;
use taustream_drivers::{CanFrame, Nanos};
use taustream_messages::{Command, FaultReason, Phase};

/// The six servos of one virtual bus, with further keys for it.
fn six_with(keys: &str) -> Settings {
    let mut settings = shipped("vcan6.toml", |text| text.replace("virtual = true", keys));
    // Simulated time: nothing holds the drives up, so limits may be as tight as on real ones.
    settings.supervision.feedback_age_s_max = 0.012;
    settings
}

/// A target that was sent to a drive, read from the wire without a line of the product's codec.
#[derive(Clone, Copy, Debug)]
struct SentSetpoint {
    tick: u64,
    node: u32,
    counts: i32,
}

fn i32_at(data: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(data[at..at + 4].try_into().unwrap())
}

/// Targets of plain setpoints (RPDO 1, controlword first) and of packed ones (two targets at 0x300 plus the first node).
fn setpoints_in(tick: u64, frames: &[CanFrame]) -> Vec<SentSetpoint> {
    let mut found = Vec::new();
    for frame in frames {
        let (id, data) = (frame.id().raw(), frame.data());
        match (id, data.len()) {
            (0x201..=0x206, 6) => {
                found.push(SentSetpoint { tick, node: id - 0x200, counts: i32_at(data, 2) });
            }
            (0x301..=0x306, 8) => {
                found.push(SentSetpoint { tick, node: id - 0x300, counts: i32_at(data, 0) });
                found.push(SentSetpoint { tick, node: id - 0x300 + 1, counts: i32_at(data, 4) });
            }
            _ => {}
        }
    }
    found
}

/// Largest use of the stop limits by the targets that were sent to each drive, by plain differences over their true times.
fn worst_use(settings: &Settings, received: &[SentSetpoint]) -> [f64; 3] {
    let limits = settings.robot.limits();
    let mut worst = [0.0_f64; 3];
    for (node, limits) in (1_u32..).zip(limits.iter().take(JOINTS)) {
        let mine: Vec<&SentSetpoint> = received.iter().filter(|setpoint| setpoint.node == node).collect();
        assert!(mine.len() > 100, "node {node} was sent {} targets", mine.len());
        let per_rad = 101.0 * 131_072.0 / std::f64::consts::TAU;
        for window in mine.windows(4) {
            let q = [0, 1, 2, 3].map(|i: usize| f64::from(window[i].counts) / per_rad);
            let t = [0, 1, 2, 3].map(|i: usize| window[i].tick as f64 * 1e-3);
            let v = [0, 1, 2].map(|i: usize| (q[i + 1] - q[i]) / (t[i + 1] - t[i]));
            let a = [0, 1].map(|i: usize| 2.0 * (v[i + 1] - v[i]) / (t[i + 2] - t[i]));
            let j = 3.0 * (a[1] - a[0]) / (t[3] - t[0]);
            let stop = limits.stop;
            // A count is 4.7e-7 rad: what rounding alone does to differences over so short a time is taken off.
            let (h, count) = ((t[3] - t[0]) / 3.0, 1.0 / per_rad);
            let rest = |value: f64, rounding: f64| (value.abs() - rounding).max(0.0);
            worst[0] = worst[0].max(rest(v[2], count / h) / stop.velocity_rad_s);
            worst[1] = worst[1].max(rest(a[1], 2.0 * count / (h * h)) / stop.acceleration_rad_s2);
            worst[2] = worst[2].max(rest(j, 4.0 * count / (h * h * h)) / stop.jerk_rad_s3);
        }
    }
    worst
}

/// Cycles from one target of a node to the next, least and most.
fn gaps(received: &[SentSetpoint], node: u32) -> (u64, u64) {
    let ticks: Vec<u64> =
        received.iter().filter(|setpoint| setpoint.node == node).map(|setpoint| setpoint.tick).collect();
    let steps = || ticks.windows(2).map(|pair| pair[1] - pair[0]);
    (steps().min().unwrap(), steps().max().unwrap())
}

/// Enables, moves to and fro, and returns what was sent to the drives while moving, and the largest tracking error.
fn move_once(name: &str, settings: Settings) -> (Arm, Vec<SentSetpoint>, f64) {
    let mut arm = Arm::new(name, settings);
    arm.enable();
    arm.move_it(1.0);
    let (mut received, mut worst_rad) = (Vec::new(), 0.0_f64);
    for _ in 0..8_000 {
        if arm.phase() != Phase::Moving {
            break;
        }
        arm.run(1);
        received.extend(setpoints_in(arm.tick, &arm.sent[0]));
        let (_, largest) = arm.core.supervisor().watch().tracking_rad();
        worst_rad = largest.iter().fold(worst_rad, |worst, error| worst.max(*error));
    }
    let cause = arm.core.supervisor().cause();
    assert_eq!(arm.phase(), Phase::Holding, "{name}: {cause:?}");
    (arm, received, worst_rad)
}

/// Goal: every way to carry setpoints follows the motion within the stop limits, at its stated rate, to its end.
#[test]
fn every_setpoint_packing_follows_at_its_rate_inside_the_stop_limits() {
    let table = [
        ("plain", "virtual = true", 1),
        ("decimated", "virtual = true\nsetpoint_every = 2", 2),
        ("slowest", "virtual = true\nsetpoint_every = 10", 10),
        ("staggered", "virtual = true\nsetpoint_every = 3\nstagger = true", 3),
        ("packed", "virtual = true\npacked = true", 1),
        ("quiet", "virtual = true\nfeedback_every = 4", 1),
        ("all", "virtual = true\npacked = true\nsetpoint_every = 4\nstagger = true\nfeedback_every = 3", 4),
    ];
    let mut plain_rad = f64::INFINITY;
    for (name, keys, every) in table {
        let (arm, received, worst_rad) = move_once(&format!("way-{name}"), six_with(keys));
        for node in 1..=6 {
            assert_eq!(gaps(&received, node), (every, every), "{name}: node {node}");
        }
        let used = worst_use(&arm.settings, &received);
        assert!(used.iter().all(|share| *share <= 1.001), "{name}: {used:?} of the stop limits");
        assert!(used[0] > 0.2, "{name}: hardly moved, {used:?}");
        // The end of the motion itself was sent, not the last setpoint before it.
        let goal = arm.newest.unwrap().position_rad;
        for servo in &arm.settings.servos {
            let node = u32::from(servo.node_id);
            let last = received.iter().rev().find(|setpoint| setpoint.node == node).unwrap();
            let per_rad = servo.sign * 101.0 * 131_072.0 / std::f64::consts::TAU;
            let want = ((goal[servo.joint] - servo.zero_offset_rad) * per_rad).round();
            assert!(
                (f64::from(last.counts) - want).abs() < 0.5,
                "{name}: node {node} ends at {}",
                last.counts
            );
        }
        // What the bus delays is known and taken off: rarer setpoints do not look like worse drives.
        if name == "plain" {
            plain_rad = worst_rad;
        }
        assert!(worst_rad < 2.0 * plain_rad, "{name}: off by {worst_rad} rad, plain by {plain_rad}");
    }
}

/// Goal: staggered setpoints come in equal shares, undecimated ones in every cycle.
#[test]
fn staggered_setpoints_come_in_equal_shares() {
    for (keys, shares) in [
        ("virtual = true\nsetpoint_every = 3", vec![6, 0, 0]),
        ("virtual = true\nsetpoint_every = 3\nstagger = true", vec![2, 2, 2]),
        ("virtual = true\nsetpoint_every = 2\nstagger = true\npacked = true", vec![4, 2]),
    ] {
        let mut arm = Arm::new("shares", six_with(keys));
        arm.enable();
        // Repeated controlwords are no targets, and a controlword that changes takes its target along: wait for rest.
        arm.run(50);
        let mut counts = Vec::new();
        for _ in 0..shares.len() {
            arm.run(1);
            counts.push(setpoints_in(arm.tick, &arm.sent[0]).len());
        }
        counts.sort_unstable_by(|a, b| b.cmp(a));
        assert_eq!(counts, shares, "{keys}");
    }
}

/// Goal: a pause of the process with decimated setpoints: each joint rests at its last setpoint, and come together
/// again inside the stop limits.
#[test]
fn stall_with_decimated_setpoints_brings_the_joints_together_again() {
    let mut arm = Arm::new("stall", six_with("virtual = true\nsetpoint_every = 4\nstagger = true"));
    arm.enable();
    arm.move_it(1.0);
    arm.run(500);
    let mut received = Vec::new();
    let mut run = |arm: &mut Arm, cycles: u64, after: bool| {
        for _ in 0..cycles {
            arm.run(1);
            if after {
                received.extend(setpoints_in(arm.tick, &arm.sent[0]));
            }
        }
    };
    // Nothing runs for 15 ms: beyond what the drives bridge, within what resumes by itself.
    run(&mut arm, 30, false);
    arm.tick += 15;
    run(&mut arm, 4_000, true);
    assert_eq!(arm.phase(), Phase::Holding, "{:?}", arm.core.supervisor().cause());
    let used = worst_use(&arm.settings, &received);
    assert!(used.iter().all(|share| *share <= 1.001), "{used:?} of the stop limits");
}

/// Goal: a drive that cannot skip the other's part refuses by name, and says what to do.
#[test]
fn drive_without_dummy_entries_refuses_packed_setpoints_by_object() {
    let edit = |text: &str| {
        let text = text.replace("virtual = true", "virtual = true\npacked = true");
        text.replace("[simulator]\n", "[simulator]\ndummy_mapping = [true, true, true, false, true, true]\n")
    };
    let mut arm = Arm::new("dummies", shipped("vcan6.toml", edit));
    arm.run(3_000);
    let cause = arm.core.supervisor().cause().expect("a drive that refuses is a fault");
    assert_eq!((cause.joint, cause.code, cause.object), (Some(3), 0x0604_0041, 0x0016_0101), "{cause:X?}");
    let words = taustream_drivers::words::explain_refusal(&taustream_drivers::bring_up::Refusal {
        code: cause.code,
        object: cause.object,
        numbers: [cause.value, cause.limit],
    });
    assert!(words.contains("object 0x1601:01") && words.contains("take `packed` off"), "{words}");
}

/// Six drives on one classic bus of 1 Mbit/s, which no settings file may ask for.
fn overloaded() -> Settings {
    let mut settings = shipped("vcan6.toml", str::to_owned);
    settings.buses[0].kind = BusKind::Classic { bitrate_bit_s: 1_000_000 };
    assert!(settings.bus_load(0).unwrap().is_refused());
    settings
}

/// Goal: an overloaded bus behaves like one: its queue grows, frames are lost, answers are late, and the arm is stopped.
/// The same arm on two buses knows nothing of it.
#[test]
fn one_overloaded_bus_loses_frames_and_stops_the_arm_where_two_do_not() {
    // The arm moves on a bus without limits, which then becomes the one that no settings file may ask for.
    let mut one = Arm::new("one-bus", shipped("vcan6.toml", str::to_owned));
    one.enable();
    one.move_it(1.0);
    one.run(300);
    one.simulator = LinkedSimulator::new(one.simulator.simulator.clone(), &overloaded().buses, 64);
    for _ in 0..3_000 {
        if one.phase() == Phase::Fault {
            break;
        }
        one.run(1);
    }
    let cause = one.core.supervisor().cause().unwrap();
    assert!(one.visited.contains(&Phase::FastStopping), "{:?} {cause:?}", one.visited);
    let stopped = matches!(cause.reason, FaultReason::FeedbackLate | FaultReason::DriveFault);
    assert!(stopped, "{cause:?}");
    let seen = one.simulator.wire(0).unwrap().counters();
    let words = one.simulator.wire(0).unwrap().in_words("one", one.now());
    assert!(seen.lost_from_master > 100 && seen.longest_queue == 64, "{words}");

    let mut settings = shipped("dual-bus.toml", str::to_owned);
    settings.supervision.feedback_age_s_max = 0.012;
    let mut two = Arm::new("two-buses", settings);
    two.enable();
    two.move_it(1.0);
    two.run_until(Phase::Holding, 8_000);
    for bus in 0..2 {
        let wire = two.simulator.wire(bus).unwrap();
        let (found, planned) = (wire.counters(), two.settings.bus_load(bus).unwrap().percent);
        assert_eq!((found.lost_from_master, found.lost_from_drives), (0, 0), "{found:?}");
        assert!(found.longest_queue <= 8, "{found:?}");
        assert!(seen.longest_wait_ns > 5 * found.longest_wait_ns, "{seen:?} beside {found:?}");
        // Worst-case stuffing is a bound; real frames come within it, and not far below.
        let (_, fullest) = wire.load_percent(two.now());
        assert!(fullest < planned && fullest > 0.75 * planned, "bus {bus}: {fullest} of planned {planned} %");
    }
}

/// Goal: on an overloaded bus the drives' heartbeats starve, so the arm does not even come up to stay.
#[test]
fn overloaded_bus_starves_the_heartbeats_and_never_holds() {
    let mut arm = Arm::new("starved", overloaded());
    for _ in 0..4_000 {
        arm.run(1);
        assert_ne!(arm.phase(), Phase::Holding);
        if arm.phase() == Phase::Disabled && arm.tick.is_multiple_of(100) {
            // Refused, or taken and not reached: both are fine, holding is not.
            let _ = arm.command_queue.commands.ask(Command::Enable, Nanos(u64::MAX));
        }
        let _answered = arm.command_queue.commands.answer();
    }
    let seen = arm.simulator.wire(0).unwrap().counters();
    assert!(seen.longest_wait_ns > 100_000_000, "{seen:?}");
}

/// Goal: when one bus is lost, the joints of the other are stopped on the path, and nothing more is sent to the lost ones.
#[test]
fn lost_bus_stops_the_joints_of_the_other_on_the_path() {
    let mut arm = Arm::new("lost-bus", shipped("dual-bus.toml", str::to_owned));
    arm.enable();
    arm.move_it(1.0);
    arm.run(600);
    assert_eq!(arm.phase(), Phase::Moving);
    arm.far_ends[1] = None;
    let mut sent_after = 0;
    for _ in 0..3_000 {
        arm.run(1);
        sent_after += setpoints_in(arm.tick, &arm.sent[0]).len();
        if arm.phase() == Phase::Fault {
            break;
        }
    }
    let cause = arm.core.supervisor().cause().unwrap();
    assert_eq!((arm.phase(), cause.reason), (Phase::Fault, FaultReason::BusFault), "{cause:?}");
    assert!(arm.visited.contains(&Phase::FastStopping), "{:?}", arm.visited);
    assert!(sent_after > 150, "the reachable joints were sent {sent_after} targets on their way to rest");
    for (joint, limits) in arm.settings.robot.limits().iter().enumerate().take(3) {
        let speed_rad_s = arm.simulator.simulator.drive(joint).unwrap().velocity_rad_s();
        assert!(speed_rad_s.abs() < 0.05 * limits.motion.velocity_rad_s, "joint {joint} moves");
    }
}
