//! `taustream bench follow`, on shorter streams: every figure of it follows from the arguments alone.
use crate::common::Scratch;

/// Goal: streams are followed inside the limits, also at the seams of chunks that do not fit, and lag at most 1.5 times as much as
/// Ruckig, which is called anew for every target at once.
#[test]
fn streams_are_followed_inside_the_limits_and_lag_little_more_than_ruckig() {
    let scratch = Scratch::new();
    for robot in ["ur5", "piper"] {
        let words = ["bench", "follow", "--robot", robot, "--seconds", "6", "--json"];
        let answer = scratch.run(&words).json();
        let jerk_rad_s3 = answer["limits"]["jerk_rad_s3"].as_f64().expect("a limit");
        let streams = answer["streams"].as_array().expect("streams");
        assert_eq!(streams.len(), 5, "{answer}");
        for row in streams {
            let peak_rad_s3 = row["taustream"]["jerk_rad_s3"].as_f64().expect("a peak");
            assert!(peak_rad_s3 <= jerk_rad_s3 * (1.0 + 1e-6), "{robot}: {row}");
            assert!(row["lag_ratio"].as_f64() <= Some(1.5), "{robot}: {row}");
        }
        for seam in answer["seams"].as_array().expect("seams") {
            assert!(seam["taustream"].as_f64() <= Some(jerk_rad_s3 * (1.0 + 1e-6)), "{robot}: {seam}");
            assert!(seam["linear"].as_f64() >= Some(1e3 * jerk_rad_s3), "{robot}: {seam}");
        }
    }
}
