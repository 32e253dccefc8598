//! What a second protocol costs: the shipped cycle with Damiao motors beside the same with CiA 402 drives, in one run;
//! fails where it is more than a tenth.
//!
//! Run with `cargo bench -p taustream-streamer --bench protocols`.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests fail by panicking"
)]
#[path = "../tests/arm/mod.rs"]
mod arm;

use arm::{Arm, shipped};
use taustream_messages::Phase;
use taustream_streamer::cycle::NoProbe;
use taustream_streamer::rt;

/// Cycles in turns: both sides meet the same machine.
const SLICES: usize = 20;
const CYCLES: usize = 400;
/// The design's figure: under 10 % of the cycle.
const COST_MAX: f64 = 1.10;

/// Nanoseconds of one cycle.
fn timed(cycle: &mut dyn FnMut()) -> usize {
    let began = rt::now();
    cycle();
    usize::try_from(rt::now().0.saturating_sub(began.0)).unwrap()
}

fn moving(name: &str, settings: &str) -> Arm {
    let mut arm = Arm::new(name, shipped(settings, str::to_owned));
    assert_eq!(arm.settings.servos.len(), 6, "both sides move six joints");
    arm.around = |cycle| timed(cycle);
    arm.enable();
    arm
}

/// Times of cycles in motion.
fn slice(arm: &mut Arm, times: &mut Vec<usize>) {
    if arm.phase() != Phase::Moving {
        arm.run_until(Phase::Holding, 8_000);
        arm.move_it(1.0);
    }
    for _ in 0..CYCLES {
        let before = arm.calls;
        arm.step(&mut NoProbe);
        times.push(arm.calls - before);
    }
}

fn quantile(times: &mut [usize], share: usize) -> usize {
    times.sort_unstable();
    times[times.len() * share / 100]
}

fn main() {
    let (mut drives, mut motors) =
        (moving("cost-cia402", "vcan6.toml"), moving("cost-damiao", "damiao6.toml"));
    let (mut drive_ns, mut motor_ns) = (Vec::new(), Vec::new());
    for _ in 0..SLICES {
        slice(&mut drives, &mut drive_ns);
        slice(&mut motors, &mut motor_ns);
    }
    let medians = [quantile(&mut drive_ns, 50), quantile(&mut motor_ns, 50)];
    let tails = [quantile(&mut drive_ns, 99), quantile(&mut motor_ns, 99)];
    let ratio = |[drives, motors]: [usize; 2]| motors as f64 / drives as f64;
    let figures = format!(
        "cycle in ns, CiA 402 then Damiao: p50 {medians:?} = {:.3}, p99 {tails:?} = {:.3}",
        ratio(medians),
        ratio(tails)
    );
    std::io::Write::write_all(&mut std::io::stdout(), format!("{figures}\n").as_bytes()).unwrap();
    // The tail is the machine's; the median is ours.
    assert!(ratio(medians) < COST_MAX, "p50 {medians:?} ns: {:.3}", ratio(medians));
}
