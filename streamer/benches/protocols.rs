//! What a protocol costs, and what more joints and buses do: the shipped cycle with its drivers and local links, against simulated
//! servos whose time does not count. Each arm beside one of CiA 402 drives, six joints on one bus, in turns of one run; fails where
//! a protocol takes more than a fifth more, or sixteen servos on four buses more than 2.6 times as long as six on one.
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
#[path = "../tests/bimanual/mod.rs"]
mod bimanual;

use arm::{Arm, shipped};
use taustream_arm::Settings;
use taustream_messages::Phase;
use taustream_streamer::cycle::NoProbe;
use taustream_streamer::rt;

/// Cycles in turns: both sides meet the same machine.
const SLICES: usize = 20;
const CYCLES: usize = 400;
/// Most that a protocol's cycle takes, in that of CiA 402.
const PROTOCOL_MAX: f64 = 1.2;
/// Most that sixteen servos on four buses take, in six of the same protocol on one.
const SIXTEEN_MAX: f64 = 2.6;
/// Settings of six joints on one bus, CiA 402 first. A Piper's three frames have a period of their own.
const SIX: [(&str, &str); 7] = [
    ("CiA 402", "vcan6.toml"),
    ("Damiao", "damiao6.toml"),
    ("RobStride", "robstride6.toml"),
    ("MyActuator", "rmd6.toml"),
    ("CubeMars", "ak6.toml"),
    ("ODrive", "odrive6.toml"),
    ("Piper", "piper.toml"),
];

/// Nanoseconds of one cycle.
fn timed(cycle: &mut dyn FnMut()) -> usize {
    let began = rt::now();
    cycle();
    usize::try_from(rt::now().0.saturating_sub(began.0)).unwrap()
}

fn moving(name: &str, settings: Settings) -> Arm {
    let mut arm = Arm::new(&format!("cost-{name}"), settings);
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
    let mut arms: Vec<(&str, Arm)> = Vec::new();
    for (name, file) in SIX {
        let arm = moving(file, shipped(file, str::to_owned));
        assert_eq!((arm.settings.servos.len(), arm.settings.buses.len()), (6, 1), "{name}");
        arms.push((name, arm));
    }
    arms.push(("Damiao, 16 on 4 buses", moving("sixteen", bimanual::settings(4))));
    let mut times: Vec<Vec<usize>> = vec![Vec::new(); arms.len()];
    for _ in 0..SLICES {
        for ((_, arm), times) in arms.iter_mut().zip(&mut times) {
            slice(arm, times);
        }
    }
    let medians: Vec<usize> = times.iter_mut().map(|times| quantile(times, 50)).collect();
    let tails: Vec<usize> = times.iter_mut().map(|times| quantile(times, 99)).collect();
    let ratio = |a: usize, b: usize| a as f64 / b as f64;
    let mut table = String::from("cycle                      p50 (ns)   p99 (ns)   p50 over CiA 402\n");
    for (((name, _), p50), p99) in arms.iter().zip(&medians).zip(&tails) {
        table += &format!("{name:<25} {p50:>9} {p99:>10} {:>18.3}\n", ratio(*p50, medians[0]));
    }
    let sixteen = ratio(medians[SIX.len()], medians[1]);
    table += &format!("16 Damiao motors on 4 buses over 6 on one: {sixteen:.3}\n");
    std::io::Write::write_all(&mut std::io::stdout(), table.as_bytes()).unwrap();
    // The tail is the machine's; the median is ours.
    for ((name, _), p50) in SIX.iter().zip(&medians) {
        assert!(ratio(*p50, medians[0]) <= PROTOCOL_MAX, "{name}: {table}");
    }
    assert!(sixteen <= SIXTEEN_MAX, "{table}");
}
