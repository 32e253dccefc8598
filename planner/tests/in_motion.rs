//! Replacements of motions that run: what keeps the limits from the cut on, and what does not.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, scene, ur5};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_motion::cut::{difference, kept};
use taustream_motion::limits::check_motion_from;
use taustream_motion::{JointLimits, MAX_JOINTS, Trajectory};
use taustream_planner::PlanOptions;
use taustream_planner::in_motion::{CutPoint, NoReplacement, Surroundings};
use taustream_planner::timing::Path;

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
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel };
    let limits = robot.limits();
    let first = train(&limits);
    let mut motions = vec![(first.clone(), 0.0)];
    for share in [0.2, 0.5, 0.8] {
        let at_s = share * first.duration_s();
        let cut = cut_point(&first, (at_s, at_s));
        motions.push((around.direct((&cut, &pose(THERE)), &options()).expect("strokes").trajectory, at_s));
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
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel };
    let running = train(&robot.limits());
    let end_s = running.duration_s();
    for from_s in [end_s, 0.4 * end_s] {
        let cut = cut_point(&running, (end_s, from_s));
        let made = around.after_end((&cut, &pose(THERE)), &options()).expect("a motion").trajectory;
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
    assert!(around.after_end((&unknown(end_s), &pose(THERE)), &options()).is_ok());
    let refused = around.after_end((&unknown(0.1), &pose(THERE)), &options());
    assert_eq!(refused, Err(NoReplacement::Unknown));
}

/// Goal: at every cut there are a taper, a direct way and a way over rest to another goal; all are proven from the cut on, and repeat what has
/// begun.
#[test]
fn taper_direct_and_rest_first_keep_the_limits_and_what_has_begun() {
    let (robot, scene, cancel) = (ur5(), scene("open"), AtomicBool::new(false));
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel };
    let running = train(&robot.limits());
    for step in 1..12 {
        let at_s = running.duration_s() * f64::from(step) / 12.0;
        let cut = cut_point(&running, (at_s, at_s));
        let taper = around.taper(&cut, &options()).expect("a taper").trajectory;
        let over = around.rest_first((&cut, &pose(THERE)), &options()).expect("a way").trajectory;
        assert!(taper.duration_s() <= running.duration_s() + 1e-9);
        let direct = around.direct((&cut, &pose(THERE)), &options()).expect("strokes").trajectory;
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
    let around = Surroundings { robot: &robot, scene: &scene, cancel: &cancel };
    let running = train(&robot.limits());
    let cut = CutPoint { trajectory: None, ..cut_point(&running, (0.3, 0.3)) };
    assert_eq!(around.taper(&cut, &options()), Err(NoReplacement::Unknown));
    assert_eq!(around.rest_first((&cut, &pose(THERE)), &options()), Err(NoReplacement::Unknown));
    let mut queued = running;
    let full = loop {
        let cut = cut_point(&queued, (queued.duration_s(), 0.0));
        let goal_rad = if queued.end_rad()[0] > 0.5 { pose(HOME) } else { pose(AWAY) };
        match around.after_end((&cut, &goal_rad), &options()) {
            Ok(made) => queued = made.trajectory,
            Err(full) => break full,
        }
    };
    assert!(full.to_string().contains("at most 512"), "{full}");
}
