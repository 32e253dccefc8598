//! The results follow the numbers: corrupted numbers change every result.
use taustream_claims::statistics::{Moments, Summary};
use taustream_claims::{Sample, agrees, better};

fn sample(shift: f64) -> Sample {
    Sample::of((0..20).map(|i| f64::from(i).sin() + shift).collect())
}

#[test]
fn better_needs_a_difference_that_is_not_by_chance() {
    let other =
        Sample::of((0..20).map(|i| f64::from(i).sin() + 0.01 * f64::from(i * 7 % 5) - 0.02).collect());
    assert!(better("ours", &sample(-1.0), "other", &sample(0.0)).0);
    assert!(!better("ours", &sample(1.0), "other", &sample(0.0)).0);
    assert!(!better("ours", &sample(0.0), "other", &sample(0.0)).0, "equal samples");
    assert!(!better("ours", &sample(0.0), "other", &other).0, "noise");
    let few = Sample::of(vec![0.0, 0.0, 0.0]);
    assert!(!better("ours", &few, "other", &Sample::of(vec![1.0; 3])).0, "three pairs cannot be significant");
}

#[test]
fn mean_is_reproduced_when_it_is_near_or_not_significantly_different() {
    let ours = Summary::of(&sample(10.0).values);
    let printed = |mean, sd| Moments { n: 30, mean, sd };
    assert!(agrees(printed(10.9, 0.0), &ours), "within a tenth");
    assert!(!agrees(printed(13.0, 0.1), &ours), "far off");
    assert!(agrees(printed(13.0, 20.0), &ours), "far off, but within the spread");
    let zero = Summary::of(&[4.44e-16; 5]);
    assert!(agrees(printed(8.882e-16, 0.0), &zero), "rounding");
    assert!(!agrees(printed(1e-12, 0.0), &zero), "more than rounding");
}
