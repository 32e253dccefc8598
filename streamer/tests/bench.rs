//! The bench measures something, on a link without system calls and on the local one. No times are asserted.
#![expect(clippy::panic, reason = "helpers of tests fail by panicking")]
use std::path::Path;
use taustream_arm::Settings;
use taustream_drivers::link::LinkChoice;
use taustream_streamer::bench::{BenchError, BenchOptions, cycle};

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
        assert_eq!(result.stages.len(), 9);
        assert!(result.stages.iter().all(|s| s.time.count > 0 && s.time.p50_ns > 0), "{result:?}");
        let whole: f64 = result.stages.iter().map(|s| s.share_percent).sum();
        assert!((whole - 100.0).abs() < 1e-6, "the stages are {whole} % of the cycle: {result:?}");
        for stage in &result.stages {
            let has_calls = matches!(stage.stage, "send" | "receive");
            assert_eq!(stage.bare.is_some_and(|b| b.count > 0), has_calls, "{stage:?}");
        }
        assert!(result.clock_read.count > 0);
        assert!(result.cycle_p50_ratio.is_finite() && result.lateness_p99_ratio > 0.0);
    }
}

#[test]
fn bench_without_slices_is_refused() {
    let refused = cycle(&BenchOptions { slices: 1, ..options(None) });
    assert!(matches!(refused, Err(BenchError::Options { .. })));
}
