//! The bench measures something, on a link without system calls and on the local one. No times are asserted.
#![expect(clippy::panic, reason = "helpers of tests fail by panicking")]
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::link::LinkChoice;
use taustream_streamer::bench::{BenchError, BenchOptions, compare, cycle};

fn options(link: Option<LinkChoice>) -> BenchOptions {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
    let settings = Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"));
    BenchOptions { settings, seconds: 0.4, slices: 4, link, allow_non_realtime: true }
}

#[test]
fn bench_counts_every_slice_and_stage() {
    for link in [None, Some(LinkChoice::Local)] {
        let result = cycle(&options(link)).unwrap();
        assert!(result.streamer_cycle.count >= 190 && result.bare_cycle.count >= 190, "{result:?}");
        assert_eq!(result.stages.len(), 11);
        assert!(result.stages.iter().all(|s| s.time.count > 0 && s.time.p50_ns > 0), "{result:?}");
        let whole: f64 = result.stages.iter().map(|s| s.share_percent).sum();
        assert!((whole - 100.0).abs() < 1e-6, "the stages are {whole} % of the cycle: {result:?}");
        for stage in &result.stages {
            let has_calls = matches!(stage.stage, "send" | "receive");
            assert_eq!(stage.bare.is_some_and(|b| b.count > 0), has_calls, "{stage:?}");
        }
        assert!(result.clock_read.count > 0);
        assert!(result.sixteen_p50_ratio > 0.0, "{result:?}");
        assert!(result.cycle_p50_ratio.is_finite() && result.lateness_p99_ratio > 0.0);
    }
}

#[test]
fn bench_without_slices_is_refused() {
    let refused = cycle(&BenchOptions { slices: 1, ..options(None) });
    assert!(matches!(refused, Err(BenchError::Options { .. })));
}

/// Goal: two arms on one interface's name are compared in one run, each with its own frames.
#[test]
fn bench_compares_one_bus_and_two_in_one_run() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/dual-bus.toml");
    let two = Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"));
    let result = compare(&BenchOptions { slices: 2, ..options(Some(LinkChoice::Local)) }, &[two]).unwrap();
    let names: Vec<(&str, usize)> = result.iter().map(|arm| (arm.arm.as_str(), arm.buses)).collect();
    assert_eq!(names, [("vcan6", 1), ("dual-bus", 2)]);
    assert!(result.iter().all(|arm| arm.cycle.count >= 190 && arm.bare.count >= 190), "{result:?}");
    assert!((result[0].p50_ratio - 1.0).abs() < 1e-12 && result[1].p50_ratio > 0.0, "{result:?}");
}
