//! Replacements of motions that run: what keeps the limits from the cut on, and what does not.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, scene, ur5};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_motion::cut::{difference, kept};
use taustream_motion::limits::check_motion_from;
use taustream_motion::{JointLimits, MAX_JOINTS, Trajectory};
use taustream_planner::in_motion::{CutPoint, NoReplacement, Surroundings};
use taustream_planner::timing::Path;
use taustream_planner::{Blend, PlanOptions};

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];
const AWAY: [f64; 6] = [1.5, -1.2, 1.2, -1.3, -1.57, 0.8];
const THERE: [f64; 6] = [-0.6, -1.5, 1.5, -1.57, -1.57, 0.0];

/// A straight move as the planner times it: a train of overlapping strokes.
fn train(limits: &[JointLimits; MAX_JOINTS]) -> Trajectory {
    let corners_rad = [pose(HOME), pose(AWAY)];
    let path = Path { corners_rad: &corners_rad, joints: 6, limits };
    path.stopping().expect("a timing").trajectory
}

/// Highest use of the motion limits of acceleration and jerk from a cut on, by a dense scan.
fn most_used(trajectory: &Trajectory, cut_s: f64, limits: &[JointLimits; MAX_JOINTS]) -> [f64; 2] {
    let mut most = [0.0_f64; 2];
    for step in 0..4_000 {
        let t_s = cut_s + (trajectory.duration_s() - cut_s) * f64::from(step) / 4_000.0;
        let at = trajectory.sample(t_s);
        for (joint, limits) in limits.iter().enumerate().take(6) {
            most[0] = most[0].max(at.acceleration_rad_s2[joint].abs() / limits.motion.acceleration_rad_s2);
            most[1] = most[1].max(at.jerk_rad_s3[joint].abs() / limits.motion.jerk_rad_s3);
        }
    }
    most
}

/// Goal: continuity is free, limits are not. Pending strokes cancel running ones, so that dropping them alone leaves the limits; the
/// check from the cut on refuses it. Method: trains of the planner, and the fitted strokes of replacements of them.
#[test]
fn dropping_pending_strokes_alone_leaves_the_limits() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let limits = robot.limits();
    let first = train(&limits);
    let mut motions = vec![(first.clone(), 0.0)];
    for share in [0.2, 0.5, 0.8] {
        let at_s = share * first.duration_s();
        let cut = cut_point(&first, (at_s, at_s));
        motions.push((around.direct((&cut, &[pose(THERE)]), &options()).expect("strokes").trajectory, at_s));
    }
    let (mut worst, mut refused) = ([0.0_f64; 2], 0);
    for (running, from_s) in &motions {
        for step in 1..40 {
            let cut_s = from_s + (running.duration_s() - from_s) * f64::from(step) / 40.0;
            let kept = kept(running, cut_s, cut_s);
            let dropped = Trajectory::new(6, kept.base_rad, kept.strokes).expect("kept strokes");
            let used = most_used(&dropped, cut_s, &limits);
            worst = [worst[0].max(used[0]), worst[1].max(used[1])];
            if used.iter().any(|used| *used > 1.001) {
                refused += 1;
                assert!(check_motion_from(&dropped, &limits, cut_s).is_err(), "cut at {cut_s} s: {used:?}");
            }
        }
    }
    println!("dropping alone: {:.2} x acceleration, {:.2} x jerk, {refused} of 156 cuts", worst[0], worst[1]);
    assert!(worst[0] > 2.0 && worst[1] > 4.0, "{worst:?}");
    assert!(refused > 40, "{refused}");
}

fn cut_point(running: &Trajectory, (at_s, from_s): (f64, f64)) -> CutPoint {
    CutPoint {
        trajectory_id: 7,
        trajectory: Some(running.clone()),
        at_s,
        from_s,
        end_s: running.duration_s(),
        end_rad: running.end_rad(),
    }
}

fn options() -> PlanOptions {
    PlanOptions { deadline: Duration::from_millis(500), ..PlanOptions::default() }
}

/// Goal: what follows the end of a motion repeats nothing of one that runs, all of one that waits, and ends at the goal.
#[test]
fn motion_after_the_end_goes_on_from_there_bit_by_bit() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let running = train(&robot.limits());
    let end_s = running.duration_s();
    for from_s in [end_s, 0.4 * end_s] {
        let cut = cut_point(&running, (end_s, from_s));
        let made = around.after_end((&cut, &[pose(THERE)]), &options()).expect("a motion").trajectory;
        assert_eq!(difference(&running, &made, (end_s, from_s)), None);
        assert!(check_motion_from(&made, &robot.limits(), end_s).is_ok());
        let folded = made.strokes().iter().filter(|stroke| stroke.start_s < end_s).count();
        assert_eq!(folded == 0, from_s >= end_s, "{folded} strokes kept");
        for (at_rad, goal_rad) in made.end_rad().iter().zip(pose(THERE)) {
            assert!((at_rad - goal_rad).abs() < 1e-12);
        }
        let sampled = [running.sample(end_s), made.sample(end_s)];
        assert_eq!(sampled[0], sampled[1]);
    }
    // Strokes that another process has sent can only be gone on from when all of them are folded.
    let unknown = |from_s| CutPoint { trajectory: None, ..cut_point(&running, (end_s, from_s)) };
    assert!(around.after_end((&unknown(end_s), &[pose(THERE)]), &options()).is_ok());
    let refused = around.after_end((&unknown(0.1), &[pose(THERE)]), &options());
    assert_eq!(refused, Err(NoReplacement::Unknown));
}

/// Goal: at every cut there are a taper, a direct way and a way over rest to another goal; all are proven from the cut on, and repeat what has
/// begun.
#[test]
fn taper_direct_and_rest_first_keep_the_limits_and_what_has_begun() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let running = train(&robot.limits());
    for step in 1..12 {
        let at_s = running.duration_s() * f64::from(step) / 12.0;
        let cut = cut_point(&running, (at_s, at_s));
        let taper = around.taper(&cut, &options()).expect("a taper").trajectory;
        let over = around.rest_first((&cut, &[pose(THERE)]), &options()).expect("a way").trajectory;
        assert!(taper.duration_s() <= running.duration_s() + 1e-9);
        let direct = around.direct((&cut, &[pose(THERE)]), &options()).expect("strokes").trajectory;
        assert!(direct.duration_s() < over.duration_s(), "straight on is quicker than over rest");
        for made in [&taper, &over, &direct] {
            assert_eq!(difference(&running, made, (at_s, at_s)), None);
            assert!(check_motion_from(made, &robot.limits(), at_s).is_ok(), "cut at {at_s} s");
        }
        for (at_rad, goal_rad) in
            [over.end_rad(), direct.end_rad()].iter().flat_map(|end| end.iter().zip(pose(THERE)))
        {
            assert!((at_rad - goal_rad).abs() < 1e-12, "cut at {at_s} s");
        }
    }
}

#[test]
fn replacements_without_known_strokes_or_with_too_many_say_so() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let running = train(&robot.limits());
    let cut = CutPoint { trajectory: None, ..cut_point(&running, (0.3, 0.3)) };
    assert_eq!(around.taper(&cut, &options()), Err(NoReplacement::Unknown));
    assert_eq!(around.rest_first((&cut, &[pose(THERE)]), &options()), Err(NoReplacement::Unknown));
    let mut queued = running;
    let full = loop {
        let cut = cut_point(&queued, (queued.duration_s(), 0.0));
        let goal_rad = if queued.end_rad()[0] > 0.5 { pose(HOME) } else { pose(AWAY) };
        match around.after_end((&cut, &[goal_rad]), &options()) {
            Ok(made) => queued = made.trajectory,
            Err(full) => break full,
        }
    };
    assert!(full.to_string().contains("at most 512"), "{full}");
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// How far a pose is from the straight lines that join some others.
fn off(pose_rad: &[f64; MAX_JOINTS], corners_rad: &[[f64; MAX_JOINTS]]) -> f64 {
    let from_line = |pair: &[[f64; MAX_JOINTS]]| {
        let along = |to: &[f64; MAX_JOINTS]| -> f64 {
            (0..6).map(|j| (pair[1][j] - pair[0][j]) * (to[j] - pair[0][j])).sum()
        };
        let share = (along(pose_rad) / along(&pair[1])).clamp(0.0, 1.0);
        let nearest: [f64; MAX_JOINTS] =
            std::array::from_fn(|j| pair[0][j] + share * (pair[1][j] - pair[0][j]));
        distance(pose_rad, &nearest)
    };
    corners_rad.windows(2).map(from_line).fold(f64::INFINITY, f64::min)
}

/// Slowest and farthest from straight lines in a span.
fn slowest_and_off(motion: &Trajectory, [from_s, to_s]: [f64; 2], lines: &[[f64; MAX_JOINTS]]) -> [f64; 2] {
    (0..=2_000).fold([f64::INFINITY, 0.0], |[slowest, farthest], step| {
        let at = motion.sample(from_s + (to_s - from_s) * f64::from(step) / 2_000.0);
        [
            slowest.min(distance(&at.velocity_rad_s, &[0.0; MAX_JOINTS])),
            farthest.max(off(&at.position_rad, lines)),
        ]
    })
}

/// Goal: a motion that another one goes on from does not stop at its end. The sum repeats what has begun, keeps limits and blend,
/// and is quicker than one after the other.
#[test]
fn queued_motion_rounds_the_corner_within_the_blend() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let running = train(&robot.limits());
    let end_s = running.duration_s();
    for (goal, saved, least_rad_s) in [
        ([2.5, -0.9, 1.0, -1.1, -1.57, 1.4], 0.83, 0.05),
        ([1.5, -1.9, 1.9, -1.3, -1.0, 0.8], 0.91, 0.05),
        // Nearly the way back.
        (THERE, 0.93, 0.01),
    ] {
        for (share, blend_rad) in [(0.1, 0.4), (0.4, 0.1), (0.6, 0.2), (0.8, 0.2)] {
            let at_s = share * end_s;
            let [cut, end] = [(at_s, at_s), (end_s, end_s)].map(|cut| cut_point(&running, cut));
            let options = PlanOptions { blend: Blend::Radians(blend_rad), ..options() };
            let made = around.past_end([&cut, &end], &[pose(goal)], &options).expect("a motion");
            let motion = &made.trajectory;
            let after_s =
                around.after_end((&end, &[pose(goal)]), &options).expect("a motion").trajectory.duration_s();
            let lines = [pose(HOME), pose(AWAY), pose(goal)];
            let [slowest, off_rad] = slowest_and_off(motion, [at_s, end_s], &lines);
            let label = format!(
                "to {goal:?} from {share} of the motion: {:.3} s, after it {after_s:.3} s, {off_rad:.4} rad off, {}",
                motion.duration_s(),
                made.how
            );
            assert!(made.how.starts_with("on past 0.859 s, rounded by at most 0."), "{label}");
            assert_eq!(difference(&running, motion, (at_s, at_s)), None, "{label}");
            assert!(check_motion_from(motion, &robot.limits(), at_s).is_ok(), "{label}");
            assert!(motion.duration_s() < after_s && off_rad <= blend_rad, "{label}");
            assert!(share > 0.6 || motion.duration_s() < saved * after_s, "{label}");
            assert!(share > 0.6 || slowest > least_rad_s, "{slowest} rad/s: {label}");
            let ends = motion.end_rad();
            assert!(ends.iter().zip(pose(goal)).all(|(at, goal)| (at - goal).abs() < 1e-12), "{label}");
        }
    }
}

/// Goal: without a blend, or when it is too late to round a corner, the arm stops there; so it does before strokes that are
/// not known.
#[test]
fn queued_motion_stops_where_no_corner_may_be_rounded() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let running = train(&robot.limits());
    let end_s = running.duration_s();
    let end = cut_point(&running, (end_s, end_s));
    let sharp = PlanOptions { blend: Blend::Radians(0.0), ..options() };
    let unknown = CutPoint { trajectory: None, ..cut_point(&running, (0.3, 0.3)) };
    let late = cut_point(&running, (end_s - 1e-3, end_s - 1e-3));
    for (cut, options) in
        [(&cut_point(&running, (0.3, 0.3)), sharp), (&unknown, options()), (&late, options())]
    {
        let made = around.past_end([cut, &end], &[pose(THERE)], &options).expect("a motion");
        assert!(made.how.starts_with("after 0.859 s: "), "{}", made.how);
        assert_eq!(made.trajectory.sample(end_s), running.sample(end_s));
    }
}

/// Goal: way points of a replacement are passed within the blend, without a stop; all limits hold from the cut on.
#[test]
fn replacement_passes_way_points_within_the_blend() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel, held_joints: 0 };
    let running = train(&robot.limits());
    let points = [[0.9, -1.1, 1.5, -1.5, -1.57, 0.2], [0.2, -1.0, 1.2, -1.2, -1.2, -0.4], THERE].map(pose);
    for share in [0.2, 0.5, 0.8] {
        let at_s = share * running.duration_s();
        let cut = cut_point(&running, (at_s, at_s));
        let options = PlanOptions { blend: Blend::Radians(0.15), ..options() };
        let made = around.direct((&cut, &points), &options).expect("strokes");
        let stopping = PlanOptions { blend: Blend::Radians(0.0), ..options };
        let at_rest = around.direct((&cut, &points), &stopping).expect("strokes").trajectory;
        let motion = &made.trajectory;
        let label = format!("cut at {at_s} s: {:.3} s, {}", motion.duration_s(), made.how);
        assert_eq!(difference(&running, motion, (at_s, at_s)), None, "{label}");
        assert!(check_motion_from(motion, &robot.limits(), at_s).is_ok(), "{label}");
        assert!(motion.duration_s() < 0.9 * at_rest.duration_s(), "{label}, {:.3} s", at_rest.duration_s());
        for point in &points[..2] {
            let poses =
                (0..=4_000).map(|step| motion.sample(motion.duration_s() * f64::from(step) / 4_000.0));
            let off_rad = poses.map(|at| distance(&at.position_rad, point)).fold(f64::INFINITY, f64::min);
            // The lines are kept within the blend; the corner itself may be cut by more.
            assert!(off_rad <= 0.3, "{off_rad} rad: {label}");
        }
        let [slowest, _] = slowest_and_off(motion, [at_s, motion.duration_s() - 0.4], &points);
        assert!(slowest > 0.02, "{slowest} rad/s: {label}");
    }
}
