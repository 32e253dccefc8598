//! The shipped cycle over scripted drives: every stop, every supervised fault, stalls, and the way back.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::disallowed_types,
    unreachable_pub,
    reason = "helpers of tests fail by panicking; what reaches the drives is compared bit by bit; nothing here is real-time"
)]
#[path = "cycle_suite/bus_faults.rs"]
mod bus_faults;
#[path = "cycle_suite/cuts.rs"]
mod cuts;
#[path = "cycle_suite/faults.rs"]
mod faults;
mod harness;
#[path = "cycle_suite/limits.rs"]
mod limits;
#[path = "cycle_suite/motion.rs"]
mod motion;
#[path = "cycle_suite/partial_send.rs"]
mod partial_send;
#[path = "cycle_suite/power.rs"]
mod power;
#[path = "cycle_suite/receive_path.rs"]
mod receive_path;
#[path = "cycle_suite/records.rs"]
mod records;
#[path = "cycle_suite/trust.rs"]
mod trust;

use harness::CycleHarness;
use taustream_motion::Trajectory;

/// Room for rounding only: a difference over a period averages the derivative, it cannot exceed it.
const ROUNDING: f64 = 1.0 + 1e-6;

fn assert_within_stop_limits(harness: &CycleHarness) {
    let worst = harness.worst_use_of_stop_limits();
    assert!(worst.iter().all(|w| *w <= ROUNDING), "use of stop limits (v, a, j): {worst:?}");
}

/// Every setpoint that a trajectory made is, bit for bit, that trajectory at the logged time.
fn assert_on_path(harness: &CycleHarness, trajectory: &Trajectory) {
    let mut seen = 0;
    for cycle in harness.cycles.iter().filter(|c| c.trajectory_id != 0) {
        let expected = trajectory.sample(cycle.s).position_rad;
        assert_eq!(cycle.position_rad, expected, "tick {} at s = {}", cycle.tick, cycle.s);
        seen += 1;
    }
    assert!(seen > 10, "only {seen} setpoints of a trajectory");
}

fn arrived(harness: &CycleHarness) -> taustream_motion::JointArray {
    harness.world.lock().unwrap().arrived.last().unwrap().1
}
