//! Forward kinematics against plain matrix products and against the poses of real arms.
#![expect(clippy::unwrap_used, reason = "a case that cannot be made fails its test")]
mod common;
use common::SeededRng;
use core::f64::consts::{FRAC_PI_2, PI};
use taustream_motion::MAX_JOINTS;
use taustream_motion::chain::{Chain, ChainJoint, Column, Pose};

type Matrix = [[f64; 4]; 4];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let mut c = [[0.0; 4]; 4];
    for (row, c) in c.iter_mut().enumerate() {
        for (column, c) in c.iter_mut().enumerate() {
            *c = (0..4).map(|k| a[row][k] * b[k][column]).sum();
        }
    }
    c
}

fn turn_z(q: f64) -> Matrix {
    let (s, c) = q.sin_cos();
    [[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
}

fn turn_x(q: f64) -> Matrix {
    let (s, c) = q.sin_cos();
    [[1.0, 0.0, 0.0, 0.0], [0.0, c, -s, 0.0], [0.0, s, c, 0.0], [0.0, 0.0, 0.0, 1.0]]
}

fn shift(x: f64, z: f64) -> Matrix {
    [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]]
}

const IDENTITY: Matrix =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// a, alpha, d, theta offset.
type Row = [f64; 4];
type MakeJoint = fn(f64, f64, f64, f64) -> ChainJoint;

#[rustfmt::skip]
const UR5: [Row; 6] = [
    [0.0, FRAC_PI_2, 0.089_159, 0.0],
    [-0.425, 0.0, 0.0, 0.0],
    [-0.392_25, 0.0, 0.0, 0.0],
    [0.0, FRAC_PI_2, 0.109_15, 0.0],
    [0.0, -FRAC_PI_2, 0.094_65, 0.0],
    [0.0, 0.0, 0.0823, 0.0],
];

/// The modified rows of the Piper arm (vendor SDK 0.6.2, arms with the 2-degree offset).
fn piper() -> [Row; 6] {
    let deg = PI / 180.0;
    [
        [0.0, 0.0, 0.123, 0.0],
        [0.0, -90.0 * deg, 0.0, -172.22 * deg],
        [0.285_03, 0.0, 0.0, -102.78 * deg],
        [-0.021_98, 90.0 * deg, 0.250_75, 0.0],
        [0.0, -90.0 * deg, 0.0, 0.0],
        [0.0, 90.0 * deg, 0.091, 0.0],
    ]
}

fn standard(rows: &[Row]) -> Chain {
    let joints: Vec<_> =
        rows.iter().map(|[a, alpha, d, o]| ChainJoint::from_dh(*a, *alpha, *d, *o)).collect();
    Chain::new(&joints).unwrap()
}

fn modified(rows: &[Row]) -> Chain {
    let joints: Vec<_> =
        rows.iter().map(|[a, alpha, d, o]| ChainJoint::from_mdh(*a, *alpha, *d, *o)).collect();
    Chain::new(&joints).unwrap()
}

/// A joint of a row, one in three prismatic.
fn any_joint(rng: &mut SeededRng, [a, alpha, d, offset]: Row, is_standard: bool) -> ChainJoint {
    match (rng.whole(0, 2) == 0, is_standard) {
        (false, true) => ChainJoint::from_dh(a, alpha, d, offset),
        (false, false) => ChainJoint::from_mdh(a, alpha, d, offset),
        (true, true) => ChainJoint::prismatic_from_dh(a, alpha, d, offset),
        (true, false) => ChainJoint::prismatic_from_mdh(a, alpha, d, offset),
    }
}

fn gap(pose: &Pose, matrix: &Matrix) -> f64 {
    let ours = pose.to_homogeneous();
    (0..16).map(|i| (ours[(i / 4, i % 4)] - matrix[i / 4][i % 4]).abs()).fold(0.0, f64::max)
}

#[test]
fn chain_at_ten_thousand_poses_agrees_with_plain_matrix_products() {
    for seed in 0..10_000 {
        let mut rng = SeededRng::from_seed(seed);
        let rows = if seed % 2 == 0 {
            UR5.to_vec()
        } else {
            let count = rng.whole(1, 8) as usize;
            (0..count).map(|_| [0.5, PI, 0.5, PI].map(|span| rng.within(-span, span))).collect()
        };
        let position_rad = rng.joints(rows.len(), PI);
        let (by_dh, by_mdh) = (standard(&rows).frames(&position_rad), modified(&rows).frames(&position_rad));
        let (mut dh, mut mdh) = (IDENTITY, IDENTITY);
        assert!(gap(&by_dh[0], &IDENTITY) == 0.0 && gap(&by_mdh[0], &IDENTITY) == 0.0);
        for joint in 0..MAX_JOINTS {
            if let Some([a, alpha, d, offset]) = rows.get(joint) {
                let turn = turn_z(position_rad[joint] + offset);
                dh = times(&times(&times(&dh, &turn), &shift(*a, *d)), &turn_x(*alpha));
                mdh = times(
                    &times(&times(&times(&mdh, &turn_x(*alpha)), &shift(*a, 0.0)), &turn),
                    &shift(0.0, *d),
                );
            }
            // Frames of joints that do not exist repeat the tip.
            let gaps = [gap(&by_dh[joint + 1], &dh), gap(&by_mdh[joint + 1], &mdh)];
            assert!(gaps[0] < 1e-12 && gaps[1] < 1e-12, "seed {seed}, joint {joint}: {gaps:?}");
        }
    }
}

/// Goal: a prismatic row slides along the axis that the same row turns about, and holds its angle.
#[test]
fn prismatic_rows_agree_with_plain_matrix_products() {
    for seed in 0..3_000 {
        let mut rng = SeededRng::from_seed(seed);
        let rows: Vec<Row> =
            (0..rng.whole(1, 8)).map(|_| [0.5, PI, 0.5, PI].map(|span| rng.within(-span, span))).collect();
        let slides: Vec<bool> = rows.iter().map(|_| rng.whole(0, 1) == 0).collect();
        let position = rng.joints(rows.len(), PI);
        let of = |make: [MakeJoint; 2]| {
            let joints: Vec<ChainJoint> = rows
                .iter()
                .zip(&slides)
                .map(|([a, alpha, d, o], slides)| make[usize::from(*slides)](*a, *alpha, *d, *o))
                .collect();
            Chain::new(&joints).unwrap().frames(&position)
        };
        let by_dh = of([ChainJoint::from_dh, ChainJoint::prismatic_from_dh]);
        let by_mdh = of([ChainJoint::from_mdh, ChainJoint::prismatic_from_mdh]);
        let (mut dh, mut mdh) = (IDENTITY, IDENTITY);
        for (joint, ([a, alpha, d, offset], slides)) in rows.iter().zip(&slides).enumerate() {
            let q = position[joint];
            let (turn_rad, slide_m) = if *slides { (*offset, d + q) } else { (offset + q, *d) };
            let turn = turn_z(turn_rad);
            dh = times(&times(&times(&dh, &turn), &shift(*a, slide_m)), &turn_x(*alpha));
            mdh = times(
                &times(&times(&times(&mdh, &turn_x(*alpha)), &shift(*a, 0.0)), &turn),
                &shift(0.0, slide_m),
            );
            let gaps = [gap(&by_dh[joint + 1], &dh), gap(&by_mdh[joint + 1], &mdh)];
            assert!(gaps[0] < 1e-12 && gaps[1] < 1e-12, "seed {seed}, joint {joint}: {gaps:?}");
        }
    }
}

/// Poses that follow from the sums of the link lengths alone.
#[test]
fn ur5_at_known_poses_stands_where_its_lengths_say() {
    let chain = standard(&UR5);
    let tip = |q: [f64; 6]| {
        let mut position_rad = [0.0; MAX_JOINTS];
        position_rad[..6].copy_from_slice(&q);
        chain.frames(&position_rad)[6].translation.vector
    };
    for (q, expected) in [
        // Stretched along -x.
        ([0.0; 6], [-0.425 - 0.392_25, -0.109_15 - 0.0823, 0.089_159 - 0.094_65]),
        // Straight up.
        (
            [0.0, -FRAC_PI_2, 0.0, -FRAC_PI_2, 0.0, 0.0],
            [0.0, -0.109_15 - 0.0823, 0.089_159 + 0.425 + 0.392_25 + 0.094_65],
        ),
        // Stretched along -y: the first joint turned a quarter.
        ([FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, 0.0], [0.109_15 + 0.0823, -0.425 - 0.392_25, 0.089_159 - 0.094_65]),
    ] {
        let at = tip(q);
        let gap = (0..3).map(|i| (at[i] - expected[i]).abs()).fold(0.0, f64::max);
        assert!(gap < 1e-12, "{q:?}: {at:?} instead of {expected:?}");
    }
}

#[test]
fn piper_with_all_joints_at_zero_is_where_the_vendor_puts_it() {
    let flange = modified(&piper()).frames(&[0.0; MAX_JOINTS])[6];
    let at = flange.translation.vector * 1000.0;
    assert!((at.x - 56.1).abs() < 0.1 && at.y.abs() < 1e-9 && (at.z - 213.3).abs() < 0.1, "{at:?}");
    let z = flange.rotation * nalgebra::Vector3::z();
    let pitch_deg = z.x.atan2(z.z).to_degrees();
    assert!((pitch_deg - 85.0).abs() < 0.01, "{pitch_deg}");
    // Read as standard rows the same numbers put the flange somewhere else: the check can fail.
    let wrong = standard(&piper()).frames(&[0.0; MAX_JOINTS])[6].translation.vector * 1000.0;
    assert!((wrong.x - 56.1).abs() > 10.0 || (wrong.z - 213.3).abs() > 10.0, "{wrong:?}");
}

/// Goal: every column is the derivative of the pose, for both kinds of rows and all numbers of joints.
/// Method: central differences of forward kinematics, which know nothing of axes; a column of the wrong joint must not pass.
#[test]
fn jacobian_at_two_thousand_poses_is_the_derivative_of_the_tip() {
    const STEP_RAD: f64 = 1e-6;
    for seed in 0..2_000 {
        let mut rng = SeededRng::from_seed(seed);
        let count = rng.whole(1, 8) as usize;
        let rows: Vec<Row> =
            (0..count).map(|_| [0.5, PI, 0.5, PI].map(|span| rng.within(-span, span))).collect();
        let joints: Vec<ChainJoint> =
            rows.iter().map(|row| any_joint(&mut rng, *row, seed % 2 == 0)).collect();
        let chain = Chain::new(&joints).unwrap();
        let position_rad = rng.joints(count, PI);
        let (tip, columns) = chain.jacobian(count, &position_rad);
        assert_eq!(tip, chain.frames(&position_rad)[MAX_JOINTS]);
        let gap_to = |joint: usize, column: &Column| {
            let at = |by: f64| {
                let mut moved_rad = position_rad;
                moved_rad[joint] += by;
                chain.frames(&moved_rad)[MAX_JOINTS]
            };
            let (low, high) = (at(-STEP_RAD), at(STEP_RAD));
            let linear_m = (high.translation.vector - low.translation.vector) / (2.0 * STEP_RAD);
            let angular = (high.rotation * low.rotation.inverse()).scaled_axis() / (2.0 * STEP_RAD);
            (linear_m - column.linear_m).amax().max((angular - column.angular).amax())
        };
        for (joint, column) in columns.iter().enumerate().take(count) {
            let gap = gap_to(joint, column);
            assert!(gap < 1e-8, "seed {seed}, joint {joint}: {gap:e}");
        }
        assert!(columns[count..].iter().all(|column| *column == Column::ZERO), "seed {seed}");
        if count > 1 {
            assert!(gap_to(0, &columns[1]) > 1e-6, "seed {seed}: the columns do not differ");
        }
    }
}

/// A tree of any shape: for each joint the frame that it stands in, at random.
fn any_tree(rng: &mut SeededRng) -> (Chain, Vec<usize>) {
    let count = rng.whole(1, u32::try_from(MAX_JOINTS).unwrap()) as usize;
    let joints: Vec<ChainJoint> = (0..count)
        .map(|_| {
            let [a, alpha, d, offset] = [0.5, PI, 0.5, PI].map(|span| rng.within(-span, span));
            any_joint(rng, [a, alpha, d, offset], false)
        })
        .collect();
    let parents: Vec<usize> =
        (0..count).map(|joint| rng.whole(0, u32::try_from(joint).unwrap()) as usize).collect();
    (Chain::tree(&joints, &parents, &[count]).unwrap(), parents)
}

/// Goal: each frame of a tree is the product along its own branch, a joint moves exactly the frames that move when it turns, and
/// columns are derivatives for them and zero for all others.
#[test]
fn joints_of_a_tree_move_their_own_branches_and_nothing_else() {
    const STEP_RAD: f64 = 1e-6;
    let mut still = 0;
    for seed in 0..1_000 {
        let mut rng = SeededRng::from_seed(seed);
        let (chain, parents) = any_tree(&mut rng);
        let count = chain.joints();
        let position_rad = rng.joints(count, PI);
        let frames = chain.frames(&position_rad);
        for (joint, parent) in parents.iter().enumerate() {
            let alone = Chain::new(&[*chain.joint(joint).unwrap()]).unwrap();
            let mut angle_rad = [0.0; MAX_JOINTS];
            angle_rad[0] = position_rad[joint];
            let expected = frames[*parent] * alone.frames(&angle_rad)[1];
            let gap = (expected.to_homogeneous() - frames[joint + 1].to_homogeneous()).amax();
            assert!(gap < 1e-12, "seed {seed}, joint {joint}: {gap:e}");
        }
        for (frame, expected) in frames.iter().enumerate().take(count + 1) {
            let (tip, columns) = chain.jacobian(frame, &position_rad);
            assert_eq!(tip, *expected);
            for (joint, column) in columns.iter().enumerate() {
                let at = |by: f64| {
                    let mut moved_rad = position_rad;
                    moved_rad[joint] += by;
                    chain.frames(&moved_rad)[frame]
                };
                let (low, high) = (at(-STEP_RAD), at(STEP_RAD));
                let moves = joint < count && low != high;
                assert_eq!(chain.moves(joint, frame), moves, "seed {seed}, joint {joint}, frame {frame}");
                if !moves {
                    still += 1;
                    assert_eq!(*column, Column::ZERO, "seed {seed}, joint {joint}, frame {frame}");
                    continue;
                }
                let linear_m = (high.translation.vector - low.translation.vector) / (2.0 * STEP_RAD);
                let angular = (high.rotation * low.rotation.inverse()).scaled_axis() / (2.0 * STEP_RAD);
                let gap = (linear_m - column.linear_m).amax().max((angular - column.angular).amax());
                assert!(gap < 1e-8, "seed {seed}, joint {joint}, frame {frame}: {gap:e}");
            }
        }
    }
    assert!(still > 10_000, "{still}: the trees hardly branch");
}

#[test]
fn frame_that_two_frames_share_is_the_last_that_carries_both() {
    for seed in 0..300 {
        let mut rng = SeededRng::from_seed(seed);
        let (chain, parents) = any_tree(&mut rng);
        let carriers = |mut frame: usize| {
            let mut all = vec![frame];
            while frame > 0 {
                frame = parents[frame - 1];
                all.push(frame);
            }
            all
        };
        for a in 0..=chain.joints() {
            for b in 0..=chain.joints() {
                let (of_a, of_b) = (carriers(a), carriers(b));
                let expected = of_a.iter().find(|frame| of_b.contains(frame));
                assert_eq!(Some(&chain.common_frame(a, b)), expected, "seed {seed}: {a} and {b}");
            }
        }
    }
}

#[test]
fn trees_that_are_none_are_refused() {
    let joints = [ChainJoint::from_dh(0.1, 0.2, 0.3, 0.0); 4];
    let tree = |parents: &[usize], tips: &[usize]| Chain::tree(&joints, parents, tips);
    let branched = tree(&[0, 1, 0, 3], &[2, 4]).unwrap();
    assert!(branched.tips() == [2, 4] && branched.tip_frame() == 2 && !branched.is_serial());
    assert!(Chain::new(&joints).unwrap().is_serial());
    assert!(!tree(&[0, 1, 2, 3], &[2, 4]).unwrap().is_serial(), "two tips");
    for (parents, tips) in [
        (&[0, 1, 0][..], &[3][..]),
        (&[0, 2, 0, 3], &[4]),
        (&[0, 1, 0, 4], &[4]),
        (&[1, 1, 1, 1], &[4]),
        (&[0, 1, 0, 3], &[]),
        (&[0, 1, 0, 3], &[0]),
        (&[0, 1, 0, 3], &[5]),
        (&[0, 1, 0, 3], &[2, 4, 2]),
    ] {
        assert!(tree(parents, tips).is_none(), "{parents:?}, tips {tips:?}");
    }
}

#[test]
fn chain_of_no_joints_or_of_nine_is_refused() {
    let joint = ChainJoint::from_dh(0.0, 0.0, 0.1, 0.0);
    assert!(Chain::new(&[]).is_none());
    assert!(Chain::new(&[joint; MAX_JOINTS + 1]).is_none());
    assert_eq!(Chain::new(&[joint; MAX_JOINTS]).map(|chain| chain.joints()), Some(MAX_JOINTS));
}
