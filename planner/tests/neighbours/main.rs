//! Two arms in one room, each with its own planner: over real shared memory, with streamers played by the test.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
#[path = "../common/mod.rs"]
mod common;
mod played;
use common::{pose, ur5};
use played::{FROM, MARGIN_M, MIDDLE, Room, TO, base, join, wait_until};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Barrier};
use std::thread;
use std::time::Duration;
use taustream_arm::body::{Body, to_parry};
use taustream_arm::rng::SeededRng;
use taustream_arm::{Neighbour, Scene};
use taustream_messages::plan::PlanOutcome;
use taustream_messages::{Phase, Replaces};
use taustream_planner::PlanOptions;
use taustream_planner::neighbours::commitment::Commitments;
use taustream_planner::neighbours::swept::{Bodies, Occupancy, Part};
use taustream_planner::send::Outbox;

/// What samples of a distance may be off by: between two of them, arms move.
const SAMPLED_M: f64 = 4e-3;

/// Goal: the true pose of the other arm counts. Method: the same request with a planner that knows nothing of it touches it.
#[test]
fn neighbour_at_rest_is_in_the_way_where_it_is() {
    let crossing = |test: &str, minds: [bool; 2]| {
        let room = Room::new(test, [FROM, MIDDLE], 4.0);
        room.run(minds, |room| {
            room.go(0, TO);
            room.wait_for_rest();
        });
        room.least_distance_m()
    };
    let (minding_m, ignorant_m) = (crossing("rest", [true, true]), crossing("ignorant", [false, true]));
    assert!(minding_m > MARGIN_M - SAMPLED_M, "{minding_m}");
    assert!(ignorant_m < 0.0, "{ignorant_m}: this scene would not show a planner that ignores the other arm");
}

/// Goal: the whole committed motion of the other arm counts, and the refusal says whose it is and that waiting helps.
#[test]
fn neighbours_motion_counts_until_it_has_ended() {
    let room = Room::new("motion", [FROM, [-1.3, -1.57, 0.0, -1.57, -1.57, 0.0]], 1.0);
    room.run([true, true], |room| {
        room.go(0, TO);
        assert!(room.is_moving(0));
        let name = &room.names[0];
        let (reason, for_now) = room.refusal(1, MIDDLE);
        assert!(
            for_now && reason.contains(&format!("neighbour `{name}` is moving along trajectory")),
            "{reason}"
        );
        assert!(reason.contains("--wait-s"), "{reason}");
        room.wait_for_rest();
        room.go(1, MIDDLE);
        room.wait_for_rest();
        // And now it is in the way at rest, which waiting does not change.
        let reason = room.lasting_refusal(0, MIDDLE);
        assert!(reason.contains(&room.names[1]), "{reason}");
    });
    assert!(room.least_distance_m() > MARGIN_M - SAMPLED_M);
}

/// Goal: whoever commits second sees the first. Method: both ask at once for motions that cross, with pauses and random speeds.
#[test]
fn motions_of_two_planners_never_come_too_near_in_any_interleaving() {
    let mut rng = SeededRng::new(35, 0);
    let (mut planned, mut refused) = (0, 0);
    for round in 0..4 {
        let room = Room::new(&format!("race{round}"), [FROM, FROM], 4.0);
        let plans: [Vec<(f64, f64)>; 2] = std::array::from_fn(|_| {
            let one = || (rng.within(0.0, 60.0), rng.within(-1.3, 1.3));
            std::iter::repeat_with(one).take(5).collect()
        });
        let pauses: Vec<f64> = (0..12).map(|_| rng.within(0.0, 2.0)).collect();
        room.run([true, true], |room| {
            thread::scope(|s| {
                let ask = |side: usize| {
                    let (plans, room) = (&plans, &room);
                    s.spawn(move || {
                        let mut counts = [0, 0];
                        for (delay_ms, pan_rad) in &plans[side] {
                            thread::sleep(Duration::from_secs_f64(delay_ms * 1e-3));
                            let mut goal = MIDDLE;
                            goal[0] = *pan_rad;
                            let reply = room.ask(side, goal);
                            let failed = matches!(reply.outcome(), PlanOutcome::Failed { .. });
                            counts[usize::from(failed)] += 1;
                        }
                        counts
                    })
                };
                let asked = [ask(0), ask(1)];
                for (number, pause) in pauses.iter().enumerate() {
                    let mut state = room.arms[number % 2].state.lock().expect("no panic");
                    state.speed = if *pause < 0.5 { 0.0 } else { 2.0 * pause };
                    drop(state);
                    thread::sleep(Duration::from_millis(100));
                }
                room.arms.iter().for_each(|arm| arm.state.lock().expect("no panic").speed = 4.0);
                for counts in asked.map(|asked| asked.join().expect("no panic")) {
                    planned += counts[0];
                    refused += counts[1];
                }
            });
            room.wait_for_rest();
        });
        let least_m = room.least_distance_m();
        assert!(least_m > MARGIN_M - SAMPLED_M, "round {round}: {least_m}");
    }
    assert!(planned >= 8 && refused >= 2, "{planned} planned, {refused} refused: the arms did not meet");
}

/// Goal: the later of two commitments sees the earlier one. Method: both are asked in the same instant for motions that meet in the
/// middle, and plan for the same 0.4 s, so that neither motion exists while the other one is planned.
#[test]
fn motions_that_are_planned_at_the_same_time_do_not_meet() {
    let room = Room::new("meet", [FROM, FROM], 1.0);
    let both = Barrier::new(2);
    room.run([true, true], |room| {
        for goal in [TO, FROM, TO] {
            thread::scope(|s| {
                for side in 0..2 {
                    let both = &both;
                    s.spawn(move || {
                        both.wait();
                        room.ask(side, goal)
                    });
                }
            });
            room.wait_for_rest();
            // Whoever was refused follows.
            (0..2).for_each(|side| {
                let _answer = room.ask(side, goal);
                room.wait_for_rest();
            });
        }
    });
    let least_m = room.least_distance_m();
    assert!(least_m > MARGIN_M - SAMPLED_M, "{least_m}");
}

/// Goal: nobody plans, and nothing moves on, while it is not known where the other arm is.
#[test]
fn neighbour_that_does_not_report_stops_a_motion_and_refuses_plans() {
    let room = Room::new("mute", [FROM, TO], 1.0);
    room.run([true, true], |room| {
        room.go(0, MIDDLE);
        room.arms[1].mute.store(true, Ordering::SeqCst);
        wait_until("the arm was stopped", || room.arms[0].state.lock().expect("no panic").stops > 0);
        let (reason, for_now) = room.refusal(0, MIDDLE);
        assert!(for_now && reason.contains("is not known") && reason.contains("other.toml"), "{reason}");
        room.arms[1].mute.store(false, Ordering::SeqCst);
        thread::sleep(Duration::from_millis(100));
        room.go(0, MIDDLE);
        room.wait_for_rest();
        // A drive without feedback, a joint that homes: the pose of that arm is not known either.
        room.arms[1].state.lock().expect("no panic").phase = Some(Phase::Homing);
        thread::sleep(Duration::from_millis(100));
        let (reason, _) = room.refusal(0, FROM);
        assert!(reason.contains("homing"), "{reason}");
    });
}

/// Goal: an arm that is pushed by hand, and a motion that no planner has committed, lead the other arm round or stop it.
#[test]
fn neighbour_that_moves_without_commitment_stops_a_motion() {
    let room = Room::new("pushed", [FROM, TO], 0.5);
    room.run([true, true], |room| {
        room.go(0, TO);
        {
            let mut state = room.arms[1].state.lock().expect("no panic");
            (state.phase, state.rest_rad) = (Some(Phase::Disabled), pose(MIDDLE));
        }
        wait_until("the arm was led round or stopped", || {
            let state = room.arms[0].state.lock().expect("no panic");
            state.stops > 0 || state.generation > 1
        });
    });
    let room = Room::new("intruder", [FROM, TO], 0.5);
    room.run([true, true], |room| {
        room.go(0, MIDDLE);
        let wire = join(&room.names[1], "intruder");
        let outbox = Outbox::open(&wire).expect("opens");
        let (robot, scene) = (ur5(), Scene::default());
        let plan = taustream_planner::plan(&robot, &scene, &pose(TO), &pose(MIDDLE), &PlanOptions::default());
        let motion = plan.expect("a plan").trajectory;
        outbox.send(&robot, &motion, Replaces::Rest, Duration::from_secs(2)).expect("sent");
        wait_until("the arm was stopped", || room.arms[0].state.lock().expect("no panic").stops > 0);
    });
}

/// Goal: a planner that died, or got no receipt, between sending and the receipt leaves no gap.
#[test]
fn motion_without_a_receipt_is_waited_for_and_then_counts() {
    let room = Room::new("pending", [FROM, [-1.3, -1.57, 0.0, -1.57, -1.57, 0.0]], 0.4);
    room.run([true, true], |room| {
        let commitments =
            Commitments::open(&room.runtime, &room.names[0], &[room.names[1].as_str()]).expect("opens");
        let turn = commitments.take_turn(Duration::from_secs(1)).expect("free");
        turn.announce(Duration::from_millis(700)).expect("written");
        drop(turn);
        let (reason, _) = room.refusal(1, MIDDLE);
        assert!(
            reason.contains("did not see what became of it") && reason.contains(&room.names[0]),
            "{reason}"
        );
        thread::sleep(Duration::from_millis(800));
        room.arms[0].deaf.store(true, Ordering::SeqCst);
        let _no_receipt = room.ask(0, TO);
        assert!(room.is_moving(0), "accepted all the same");
        let (reason, _) = room.refusal(1, MIDDLE);
        assert!(reason.contains(&room.names[0]), "{reason}");
        room.arms[0].deaf.store(false, Ordering::SeqCst);
        room.wait_for_rest();
    });
    assert!(room.least_distance_m() > MARGIN_M - SAMPLED_M);
}

/// Goal: the obstacles of a motion cover the arm at every instant of it. Method: points of the links at random instants.
#[test]
fn obstacles_of_a_motion_cover_the_arm_at_every_instant() {
    let (robot, scene) = (ur5(), Scene::default());
    let neighbour = Neighbour {
        name: "right".to_owned(),
        file: "right.toml".into(),
        robot: robot.clone(),
        base: base(),
        margin_m: MARGIN_M,
        tracking_error_rad_max: 0.05,
        report_rate_hz: 100.0,
    };
    let bodies = Bodies::new(&neighbour, Arc::new(robot.clone())).expect("shapes");
    let plan = taustream_planner::plan(&robot, &scene, &pose(FROM), &pose(TO), &PlanOptions::default());
    let trajectory = plan.expect("a plan").trajectory;
    let (duration_s, mut rng) = (trajectory.duration_s(), SeededRng::new(4, 0));
    let span_s = [0.3 * duration_s, duration_s];
    let parts = vec![Part { trajectory: trajectory.clone(), span_s }];
    let off_rad = pose([0.01; 6]);
    let obstacles = bodies.obstacles(&Occupancy::Moves { parts }, &off_rad, 0.0);
    assert!((20..=300).contains(&obstacles.len()), "{}", obstacles.len());
    let covers: Vec<_> = obstacles
        .iter()
        .map(|obstacle| {
            let body =
                Body::new(&obstacle.shape, &taustream_motion::chain::Pose::identity()).expect("a shape");
            let at = body.placed(&to_parry(&obstacle.pose));
            (body, at)
        })
        .collect();
    for _ in 0..2_000 {
        let mut q = trajectory.sample(rng.within(span_s[0], span_s[1])).position_rad;
        q.iter_mut().take(6).for_each(|q| *q += rng.within(-0.01, 0.01));
        let frames = robot.chain.frames(&q);
        let shape = &robot.shapes[rng.index(robot.shapes.len())];
        // A point inside the capsule: on its axis, moved by less than its radius.
        let taustream_arm::Shape::Capsule { radius_m, length_m } = shape.shape else { continue };
        let inside = nalgebra::Point3::new(0.99 * radius_m, 0.0, rng.within(-0.5, 0.5) * length_m);
        let point = base() * frames[shape.frame] * shape.pose * inside;
        let ball = Body::new(
            &taustream_arm::Shape::Sphere { radius_m: 1e-9 },
            &taustream_motion::chain::Pose::identity(),
        );
        let ball = ball.expect("a ball");
        let at =
            ball.placed(&to_parry(&taustream_motion::chain::Pose::translation(point.x, point.y, point.z)));
        let is_covered = covers.iter().any(|(body, of)| body.distance_m(of, &ball, &at) <= 0.0);
        assert!(is_covered, "{point:?} of link {} is outside of every obstacle", shape.link);
    }
}
