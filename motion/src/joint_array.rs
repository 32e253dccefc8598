//! Sums over the joints of an arm, half of an array at a time.
//!
//! An array has slots for [`MAX_JOINTS`] joints, and most arms use at most half of them. Loops of a constant length become
//! vector instructions, so what an arm does not use costs one comparison.
use crate::{JointArray, MAX_JOINTS, USUAL_JOINTS};

/// `sum + value * factor` of each joint of an arm with so many.
#[inline(always)]
pub(crate) fn add_scaled(sum: &mut JointArray, value: &JointArray, factor: f64, joints: usize) {
    each(sum, value, joints, |sum, value| *sum += value * factor);
}

/// `sum + |value| * factor` of each joint of an arm with so many.
#[inline(always)]
pub(crate) fn add_magnitude(sum: &mut JointArray, value: &JointArray, factor: f64, joints: usize) {
    each(sum, value, joints, |sum, value| *sum += value.abs() * factor);
}

#[inline(always)]
fn each(sum: &mut JointArray, value: &JointArray, joints: usize, add: impl Fn(&mut f64, f64)) {
    let (sums, values) = (sum.as_chunks_mut::<USUAL_JOINTS>().0, value.as_chunks::<USUAL_JOINTS>().0);
    for (sums, values) in sums.iter_mut().zip(values).take(joints.div_ceil(USUAL_JOINTS)) {
        for (sum, value) in sums.iter_mut().zip(values) {
            add(sum, *value);
        }
    }
}

/// Values of the first joints, base to tip, with zeros behind them.
#[must_use]
pub const fn joint_array<const JOINTS: usize>(values: [f64; JOINTS]) -> JointArray {
    const { assert!(JOINTS <= MAX_JOINTS, "more values than an arm has joints") }
    let mut all = [0.0; MAX_JOINTS];
    let mut joint = 0;
    while joint < JOINTS {
        all[joint] = values[joint];
        joint += 1;
    }
    all
}
