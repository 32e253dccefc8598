//! The replan service over real shared memory, with a streamer played by the test.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, scene, sphere, ur5, ur5_distances_m};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::{Robot, Scene, runtime};
use taustream_messages::clock::now_ns;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome, When};
use taustream_messages::plan_detail::PlanDetail;
use taustream_messages::service::Wire;
use taustream_messages::target::{CheckedTargets, Target, TargetOutcome};
use taustream_messages::tip_goal::{TipGoal, TipLine, TipOrientation};
use taustream_messages::{
    CheckedTrajectory, LAYOUT_VERSION, Outcome, Phase, PlanRequest, Receipt, Rejection, Replaces, Report,
    TargetRequest,
};
use taustream_motion::JointArray;
use taustream_planner::send::{SendError, send_trajectory};
use taustream_planner::service::Service;

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];
const AWAY: [f64; 6] = [0.4, -1.4, 1.4, -1.57, -1.57, 0.0];
const THERE: [f64; 6] = [-0.4, -1.5, 1.5, -1.57, -1.57, 0.0];

/// When the played motion ends.
const ENDS_S: f64 = 2.5;

fn join(arm: &str, node: &str) -> Wire {
    Wire::join(arm, node, &runtime::directory().expect("a directory")).expect("joins")
}

/// What the played streamer shows, and what it saw.
struct Played {
    phase: AtomicU32,
    generation: AtomicU64,
    accepted: AtomicU64,
    cuts: AtomicU64,
    /// So many cuts come too late.
    late: AtomicU64,
    /// Joints that no trajectory may move, a bit each.
    still: AtomicU32,
    mute: AtomicBool,
    end: AtomicBool,
}

impl Played {
    fn new(phase: Phase) -> Self {
        Self {
            phase: AtomicU32::new(phase.code()),
            generation: AtomicU64::new(41),
            accepted: AtomicU64::new(0),
            cuts: AtomicU64::new(0),
            late: AtomicU64::new(0),
            still: AtomicU32::new(0),
            mute: AtomicBool::new(false),
            end: AtomicBool::new(false),
        }
    }

    fn show(&self, phase: Phase) {
        self.phase.store(phase.code(), Ordering::SeqCst);
    }

    fn report(&self, robot: &Robot, sequence: u64) -> Report {
        let moving = self.phase.load(Ordering::SeqCst) == Phase::Moving.code();
        Report {
            layout_version: LAYOUT_VERSION,
            joint_count: 6,
            sequence,
            robot_digest: robot.digest,
            phase: self.phase.load(Ordering::SeqCst),
            energised: 1,
            generation: self.generation.load(Ordering::SeqCst),
            trajectory_id: 7,
            trajectory_s: 0.5,
            trajectory_duration_s: ENDS_S,
            end_s: ENDS_S,
            command_rad: if moving { pose(HOME) } else { pose(AWAY) },
            end_rad: pose(AWAY),
            ..Report::default()
        }
    }

    /// Reports a hundred times a second and answers trajectories, as the streamer does.
    fn play(&self, arm: &str, robot: &Robot) {
        let wire = join(arm, "played-streamer");
        let reports = wire.report_publisher().expect("port");
        let receipts = wire.receipt_publisher().expect("port");
        let trajectories = wire.trajectory_subscriber().expect("port");
        let mut sequence = 0;
        while !self.end.load(Ordering::SeqCst) {
            if !self.mute.load(Ordering::SeqCst) {
                sequence += 1;
                reports.send_copy(self.report(robot, sequence)).expect("sent");
            }
            while let Some(sample) = trajectories.receive().expect("received") {
                let message = Box::new(*sample.payload());
                let checked = CheckedTrajectory::try_from(&*message).expect("a good message");
                let outcome = self.evaluate(&checked);
                receipts
                    .send_copy(Receipt::new(checked.trajectory_id, checked.generation, &outcome))
                    .expect("sent");
            }
            thread::sleep(Duration::from_millis(10));
        }
    }

    fn evaluate(&self, checked: &CheckedTrajectory) -> Outcome {
        let still = self.still.load(Ordering::SeqCst);
        for stroke in checked.trajectory.strokes() {
            let moved =
                stroke.delta_rad.iter().enumerate().find(|(j, delta)| still >> j & 1 == 1 && **delta != 0.0);
            assert!(moved.is_none(), "a joint that is to hold is moved: {moved:?}");
        }
        if let Replaces::Cut { at_s, .. } = checked.replaces {
            let number = self.cuts.fetch_add(1, Ordering::SeqCst);
            let strokes = checked.trajectory.strokes();
            assert!(
                strokes.iter().all(|stroke| stroke.start_s >= at_s),
                "nothing is known that could be kept"
            );
            assert_eq!(
                (at_s, checked.trajectory.base_rad()),
                (ENDS_S, &pose(AWAY)),
                "from the end of what runs"
            );
            if number < self.late.load(Ordering::SeqCst) {
                return Outcome::Rejected(Rejection::CutPassed { at_s, by_s: 0.01 });
            }
            self.generation.fetch_add(1, Ordering::SeqCst);
            return Outcome::Accepted { from_s: at_s, tick: 0 };
        }
        assert_eq!(checked.generation, self.generation.load(Ordering::SeqCst) + 1, "the next generation");
        let base_bits = checked.trajectory.base_rad().map(f64::to_bits);
        assert_eq!(base_bits, pose(AWAY).map(f64::to_bits), "from where the arm rests");
        self.accepted.fetch_add(1, Ordering::SeqCst);
        self.generation.fetch_add(1, Ordering::SeqCst);
        Outcome::Accepted { from_s: 0.0, tick: 9 }
    }
}

/// Runs a service and a played streamer around a test, in the open scene.
fn with_service(name: &str, played: &Played, test: impl FnOnce(&str, &Robot)) {
    with_service_in(&scene("open"), name, played, test);
}

fn with_service_in(scene: &Scene, name: &str, played: &Played, test: impl FnOnce(&str, &Robot)) {
    with_service_of(&ur5(), scene, name, played, test);
}

fn with_service_of(
    robot: &Robot,
    scene: &Scene,
    name: &str,
    played: &Played,
    test: impl FnOnce(&str, &Robot),
) {
    let arm = format!("test-{name}-{}", std::process::id());
    let (stop, ready) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|s| {
        s.spawn(|| played.play(&arm, robot));
        s.spawn(|| {
            let wire = join(&arm, "planner");
            let mut service = Service::open(&wire, robot, scene, &stop).expect("opens");
            ready.store(true, Ordering::SeqCst);
            service.serve();
        });
        // Whatever the test does, the threads end: a panic is handed on after that.
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let since = Instant::now();
            while !ready.load(Ordering::SeqCst) {
                assert!(since.elapsed() < Duration::from_secs(20), "the service did not open");
                thread::sleep(Duration::from_millis(5));
            }
            test(&arm, robot);
        }));
        stop.store(true, Ordering::SeqCst);
        played.end.store(true, Ordering::SeqCst);
        if let Err(panic) = result {
            std::panic::resume_unwind(panic);
        }
    });
}

fn request(when: When, planner: &str, goal_rad: JointArray) -> CheckedPlanRequest {
    CheckedPlanRequest {
        when,
        deadline_ms: 1_000,
        seed: 3,
        planner: planner.to_owned(),
        ..CheckedPlanRequest::to_pose(6, goal_rad)
    }
}

/// Asks and waits for the answer.
fn ask(arm: &str, requested: &CheckedPlanRequest, meanwhile: impl FnOnce()) -> PlanOutcome {
    ask_in_detail(arm, requested, meanwhile).0
}

fn ask_in_detail(
    arm: &str,
    requested: &CheckedPlanRequest,
    meanwhile: impl FnOnce(),
) -> (PlanOutcome, PlanDetail) {
    let wire = join(arm, "client");
    let client = wire.plan_client().expect("port");
    let pending = client.send_copy(PlanRequest::from(requested)).expect("sent");
    meanwhile();
    let since = Instant::now();
    loop {
        if let Some(reply) = pending.receive().expect("received") {
            return (reply.payload().outcome(), reply.payload().detail());
        }
        assert!(since.elapsed() < Duration::from_secs(20), "no answer");
        thread::sleep(Duration::from_millis(2));
    }
}

fn receipt_of(outcome: &PlanOutcome) -> Outcome {
    let PlanOutcome::Planned { receipt: Some(receipt), .. } = outcome else { panic!("{outcome:?}") };
    receipt.outcome().expect("known layout")
}

fn reason_of(outcome: &PlanOutcome) -> &str {
    let PlanOutcome::Failed { reason } = outcome else { panic!("{outcome:?}") };
    reason
}

#[test]
fn service_replan_at_rest_is_planned_from_the_commanded_pose_and_sent() {
    let played = Played::new(Phase::Holding);
    with_service("rest", &played, |arm, robot| {
        let outcome = ask(arm, &request(When::AtOnce, "", pose(THERE)), || ());
        assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: 0.0, tick: 9 });
        let PlanOutcome::Planned { trajectory_id, duration_s, strokes, .. } = outcome else { panic!() };
        assert!((1..1 << 53).contains(&trajectory_id) && duration_s > 0.0 && strokes > 0);

        // A second one continues from the report's generation; and a saved motion is sent by the same way.
        receipt_of(&ask(arm, &request(When::AtOnce, "straight", pose(THERE)), || ()));
        let wire = join(arm, "cli");
        let still = taustream_planner::timing::stand_still(6, &pose(AWAY)).expect("a pose");
        let sent = send_trajectory(&wire, robot, &still, Duration::from_secs(5)).expect("sent");
        let receipt = sent.receipt.expect("answered");
        assert_eq!((receipt.trajectory_id(), sent.generation), (sent.trajectory_id, 44));

        let mut other = robot.clone();
        other.message_digest[3] ^= 1;
        let error = send_trajectory(&wire, &other, &still, Duration::from_secs(5)).unwrap_err();
        assert!(matches!(error, SendError::WrongRobot { .. }), "{error}");
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst), 3);
}

/// Goal: an answer says what was tried and where the motion is nearest to something; a refusal says what was tried.
#[test]
fn service_answer_says_what_was_tried_and_where_the_motion_is_nearest() {
    let played = Played::new(Phase::Holding);
    let wall = sphere("wall", [-0.6, -0.2, 0.3], 0.15);
    let scene = Scene { obstacles: vec![wall], ..scene("open") };
    with_service_in(&scene, "detail", &played, |arm, robot| {
        let (outcome, detail) = ask_in_detail(arm, &request(When::AtOnce, "", pose(THERE)), || ());
        let PlanOutcome::Planned { clearance_m, duration_s, .. } = outcome else { panic!("{outcome:?}") };
        let nearest = detail.nearest.expect("a scene with an obstacle");
        assert!((0.0..=duration_s).contains(&nearest.at_s) && clearance_m >= nearest.required_m);
        assert!(robot.links.contains(&nearest.between[0]), "{nearest:?}");
        assert!(detail.path_length_rad > 0.1, "{}", detail.path_length_rad);
        assert!(detail.steps.iter().any(|step| step.what.contains("straight line")), "{:?}", detail.steps);
        assert!(detail.steps.iter().any(|step| step.motion_s.is_some()), "{:?}", detail.steps);
    });
    let played = Played::new(Phase::Holding);
    with_service_in(&ringed(), "detail-of-none", &played, |arm, _| {
        let one = CheckedPlanRequest { deadline_ms: 100, ..request(When::AtOnce, "", pose(RINGED)) };
        let (outcome, detail) = ask_in_detail(arm, &one, || ());
        let reason = reason_of(&outcome);
        assert!(
            detail.steps.iter().any(|step| step.what.contains("blocked")),
            "{reason}: {:?}",
            detail.steps
        );
        assert_eq!(detail.nearest, None);
    });
}

/// The operator's way on after a stop: the arm stands nearer to a ball than the margin, and is led away from it.
#[test]
fn service_replan_of_an_arm_from_a_urdf_is_planned_under_its_digest_and_sent() {
    let robot = Robot::load(&common::config("../tests/robots/ur5_balls.toml")).expect("a robot for tests");
    let played = Played::new(Phase::Holding);
    with_service_of(&robot, &scene("open"), "urdf", &played, |arm, _| {
        let outcome = ask(arm, &request(When::AtOnce, "", pose(THERE)), || ());
        assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: 0.0, tick: 9 });
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst), 1);
}

#[test]
fn service_replan_from_inside_the_margin_is_planned_and_says_so() {
    let played = Played::new(Phase::Holding);
    let mut ball = sphere("ball", [-0.6, 0.0, 0.1], 1e-6);
    let one = |ball| Scene { obstacles: vec![ball], ..scene("open") };
    let (room_m, _) = ur5_distances_m(&ur5(), &one(ball.clone()), &pose(AWAY));
    ball.shape = taustream_arm::Shape::Sphere { radius_m: room_m - 0.0117 };
    with_service_in(&one(ball), "margin", &played, |arm, _| {
        let outcome = ask(arm, &request(When::AtOnce, "", pose([1.2, -1.6, 1.2, -1.57, -1.57, 0.0])), || ());
        assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: 0.0, tick: 9 });
        let PlanOutcome::Planned { how, .. } = outcome else { panic!() };
        let said = "margin 0.0112 m for the first ";
        assert!(how.starts_with(said) && how.contains("nearer to ball than 0.0200 m"), "{how}");
    });
}

/// Goal: what `plan` goes to, the service goes to: the tip at a position, in a pose, and along a straight line.
#[test]
fn service_goals_of_the_tip_are_planned_at_rest_and_in_motion_and_lines_at_rest_only() {
    let played = Played::new(Phase::Holding);
    with_service("tip", &played, |arm, robot| {
        let tip_of = |q: [f64; 6]| robot.chain.frames(&pose(q))[6];
        let there = tip_of(THERE);
        let turned = TipOrientation {
            quaternion_xyzw: there.rotation.coords.into(),
            tolerance_rad: [1e-3, 1e-3, f64::INFINITY],
        };
        let line = TipLine { linear_m_s: 0.2, angular_rad_s: 1.0, off_m_max: 1e-3 };
        let here = tip_of(HOME).translation.vector;
        let aside = [here.x, here.y + 0.1, here.z];
        let at = |position_m: [f64; 3], orientation, line| CheckedPlanRequest {
            tip: Some(TipGoal { tip: 0, position_m, tolerance_m: 0.0, orientation, line }),
            ..request(When::AtOnce, "", pose(HOME))
        };
        let position = at(there.translation.vector.into(), None, None);
        let in_pose = at(there.translation.vector.into(), Some(turned), None);
        let straight = at(aside, None, Some(line));
        for (requested, words) in [
            (&position, "straight line"),
            (&in_pose, "straight line"),
            (&straight, "straight line of the tip, at most"),
        ] {
            let outcome = ask(arm, requested, || ());
            assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: 0.0, tick: 9 });
            let PlanOutcome::Planned { how, .. } = outcome else { panic!() };
            assert!(how.contains(words), "{how}");
        }
        let via = CheckedPlanRequest {
            via_rad: vec![pose([0.5, -1.2, 1.3, -1.57, -1.57, 0.3])],
            ..request(When::Queue, "", pose(THERE))
        };
        let outcome = ask(arm, &via, || ());
        assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: 0.0, tick: 9 });
        let PlanOutcome::Planned { how, .. } = outcome else { panic!() };
        assert!(how.contains("through 3 poses, 1 corners rounded"), "{how}");
        let outside = CheckedPlanRequest { via_rad: vec![pose([9.0; 6])], ..via };
        assert!(reason_of(&ask(arm, &outside, || ())).contains("way point 1"));
        let far = ask(arm, &at([3.0, 0.0, 0.0], None, None), || ());
        assert!(reason_of(&far).contains("out of reach"), "{far:?}");
        played.show(Phase::Moving);
        let refused = ask(arm, &straight, || ());
        assert!(reason_of(&refused).contains("begins at rest"), "{refused:?}");
        receipt_of(&ask(arm, &CheckedPlanRequest { when: When::AfterCurrent, ..in_pose.clone() }, || ()));
        played.show(Phase::Disabled);
        for requested in [&position, &straight] {
            assert!(reason_of(&ask(arm, requested, || ())).contains("taustream enable"));
        }
    });
}

/// Goal: a request for one group moves its joints alone: from rest, to a tip, and after what runs. What it
/// says of the other joints counts nothing.
#[test]
fn service_request_of_a_group_moves_its_joints_alone() {
    let robot = Robot::load(&common::config("../tests/robots/two_arms.toml")).expect("a robot for tests");
    let played = Played::new(Phase::Holding);
    let held_joints = robot.groups[0].others(6);
    played.still.store(held_joints, Ordering::SeqCst);
    with_service_of(&robot, &scene("open"), "group", &played, |arm, robot| {
        let here = robot.chain.frame(robot.tips[0].frame, &pose(AWAY)).translation.vector;
        let left = CheckedPlanRequest {
            held_joints,
            // Far outside, if the last three counted.
            ..request(When::AtOnce, "", pose([-0.4, -1.2, 1.2, 9.0, 9.0, 9.0]))
        };
        let via = CheckedPlanRequest { via_rad: vec![pose([0.0, -1.0, 1.0, 9.0, 9.0, 9.0])], ..left.clone() };
        let to_tip = |tip: u32| CheckedPlanRequest {
            tip: Some(TipGoal {
                tip,
                position_m: [here.x, here.y - 0.1, here.z],
                tolerance_m: 0.0,
                orientation: None,
                line: None,
            }),
            ..left.clone()
        };
        for requested in [&left, &via, &to_tip(0)] {
            let outcome = ask(arm, requested, || ());
            assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: 0.0, tick: 9 });
        }
        let refused = ask(arm, &to_tip(5), || ());
        assert!(reason_of(&refused).contains("there is no tip 6; the robot has 2"), "{refused:?}");
        for held_joints in [0b11_1111, 0b100_0001] {
            let refused = ask(arm, &CheckedPlanRequest { held_joints, ..left.clone() }, || ());
            assert!(
                reason_of(&refused).contains("it must leave at least one of them to move"),
                "{refused:?}"
            );
        }
        played.show(Phase::Moving);
        receipt_of(&ask(arm, &CheckedPlanRequest { when: When::AfterCurrent, ..left.clone() }, || ()));
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst), 3);
    assert_eq!(played.cuts.load(Ordering::SeqCst), 1);
}

#[test]
fn service_bad_requests_are_refused_in_words_and_nothing_is_sent() {
    let played = Played::new(Phase::Holding);
    with_service("bad", &played, |arm, _| {
        let good = request(When::AtOnce, "", pose(THERE));
        let seven = CheckedPlanRequest { joints: 7, ..good.clone() };
        let nan = {
            let mut goal = pose(THERE);
            goal[2] = f64::NAN;
            CheckedPlanRequest { goal_rad: goal, ..good.clone() }
        };
        let far = CheckedPlanRequest { goal_rad: pose([9.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ..good.clone() };
        let inside = CheckedPlanRequest { goal_rad: pose([0.0, 0.6, 0.0, 0.0, 0.0, 0.0]), ..good.clone() };
        let unknown = CheckedPlanRequest { planner: "teleport".to_owned(), ..good.clone() };
        for (requested, word) in [
            (&seven, "7 joint values"),
            (&nan, "goal of joint 3"),
            (&far, "shoulder_pan"),
            (&inside, "table"),
            (&unknown, "unknown planner `teleport`; use one of auto, straight"),
        ] {
            let outcome = ask(arm, requested, || ());
            assert!(reason_of(&outcome).contains(word), "{word}: {outcome:?}");
        }
        let runs = |phase: &Phase| matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused);
        for phase in Phase::ALL.into_iter().filter(|phase| *phase != Phase::Holding && !runs(phase)) {
            played.show(phase);
            let outcome = ask(arm, &good, || ());
            assert!(reason_of(&outcome).contains(phase.word()), "{outcome:?}");
        }
        played.mute.store(true, Ordering::SeqCst);
        let outcome = ask(arm, &good, || ());
        assert!(reason_of(&outcome).contains("taustream-streamer of arm"), "{outcome:?}");
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst), 0);
}

/// Goal: a motion whose strokes this planner has not sent is gone on from at its end, in every phase in which it runs; a cut
/// that comes too late is tried again.
#[test]
fn service_while_moving_goes_on_from_the_end_of_a_motion_that_it_does_not_know() {
    for (phase, when) in [
        (Phase::Moving, When::AtOnce),
        (Phase::Moving, When::AfterCurrent),
        (Phase::Pausing, When::AtOnce),
        (Phase::Paused, When::Queue),
    ] {
        let played = Played::new(phase);
        with_service("moving", &played, |arm, _| {
            played.late.store(2, Ordering::SeqCst);
            let outcome = ask(arm, &request(when, "", pose(THERE)), || ());
            assert_eq!(receipt_of(&outcome), Outcome::Accepted { from_s: ENDS_S, tick: 0 });
            assert_eq!(played.cuts.load(Ordering::SeqCst), 3, "{phase:?} {when:?}");
            let PlanOutcome::Planned { duration_s, how, .. } = outcome else { panic!() };
            assert!(duration_s > 0.1 && how.starts_with("after 2.500 s: "), "{duration_s} {how}");

            // No cut can be kept: the last reason is handed back, and nothing has changed.
            played.late.store(100, Ordering::SeqCst);
            let outcome = ask(arm, &request(when, "", pose(THERE)), || ());
            assert!(reason_of(&outcome).contains("already passed by 0.0100 s"), "{outcome:?}");
        });
        assert_eq!(played.accepted.load(Ordering::SeqCst), 0);
    }
}

/// The running motion ends while the new one is planned: it begins at rest then.
#[test]
fn service_motion_that_has_ended_meanwhile_is_gone_on_from_at_rest() {
    let played = Played::new(Phase::Moving);
    with_service("ended", &played, |arm, _| {
        played.late.store(1, Ordering::SeqCst);
        let outcome = ask(arm, &request(When::AfterCurrent, "", pose(THERE)), || {
            let since = Instant::now();
            while played.cuts.load(Ordering::SeqCst) == 0 {
                assert!(since.elapsed() < Duration::from_secs(20), "no cut was tried");
                thread::sleep(Duration::from_millis(1));
            }
            played.show(Phase::Holding);
        });
        let outcome = receipt_of(&outcome);
        assert!(matches!(outcome, Outcome::Accepted { .. }), "{outcome:?}");
    });
}

#[test]
fn service_cancel_needs_something_that_runs() {
    let played = Played::new(Phase::Holding);
    with_service("cancel", &played, |arm, _| {
        let outcome = ask(arm, &request(When::Cancel, "", pose(HOME)), || ());
        assert!(reason_of(&outcome).contains("nothing runs"), "{outcome:?}");
        played.show(Phase::Moving);
        let outcome = ask(arm, &request(When::Cancel, "", pose(HOME)), || ());
        assert!(reason_of(&outcome).contains("another process has sent"), "{outcome:?}");
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst) + played.cuts.load(Ordering::SeqCst), 0);
}

/// Goal: no client waits for a motion without a client. Method: planning that lasts, and a request that is dropped meanwhile.
#[test]
fn service_motion_whose_requester_has_gone_is_not_sent() {
    let played = Played::new(Phase::Moving);
    with_service_in(&ringed(), "gone", &played, |arm, _| {
        let wire = join(arm, "client");
        let client = wire.plan_client().expect("port");
        let hard =
            CheckedPlanRequest { deadline_ms: 3_000, ..request(When::AfterCurrent, "rrt", pose(RINGED)) };
        let pending = client.send_copy(PlanRequest::from(&hard)).expect("sent");
        thread::sleep(Duration::from_millis(300));
        drop(pending);
        let since = Instant::now();
        // The next request is served, so the service has looked at the one that is gone.
        while let PlanOutcome::Failed { reason } = ask(arm, &request(When::AtOnce, "", pose(THERE)), || ()) {
            assert!(reason.contains("another request"), "{reason}");
            assert!(since.elapsed() < Duration::from_secs(40), "the planner plans on for nobody");
        }
    });
    assert_eq!(played.cuts.load(Ordering::SeqCst), 1);
}

#[test]
fn service_second_planner_of_an_arm_is_refused() {
    let played = Played::new(Phase::Holding);
    with_service("second", &played, |arm, robot| {
        let (scene, stop) = (scene("open"), AtomicBool::new(false));
        let wire = join(arm, "second");
        let Err(error) = Service::open(&wire, robot, &scene, &stop) else {
            panic!("two planners serve one arm")
        };
        assert!(error.to_string().contains("has a taustream-planner already"), "{error}");
        // The first one still serves.
        receipt_of(&ask(arm, &request(When::AtOnce, "", pose(THERE)), || ()));
    });
}

/// A goal with the upper arm upright, its middle at (-0.056, 0.119) m.
const RINGED: [f64; 6] = [-2.7, -1.57, 1.4, -1.57, -1.57, 0.0];

/// A closed ring round the upper arm at [`RINGED`]: an arm cannot get into it, so a search continues until its deadline.
fn ringed() -> Scene {
    let side = |name: &str, [x, y]: [f64; 2], [width, depth]: [f64; 2]| {
        format!(
            "[[box]]\nname = \"{name}\"\ncenter_m = [{}, {}, 0.3]\nsize_m = [{width}, {depth}, 0.04]\nrpy_rad = [0.0, 0.0, 0.0]\n",
            x - 0.056,
            y + 0.119
        )
    };
    let sides = [
        side("left", [0.0, 0.108], [0.236, 0.02]),
        side("right", [0.0, -0.108], [0.236, 0.02]),
        side("front", [0.108, 0.0], [0.02, 0.236]),
        side("back", [-0.108, 0.0], [0.02, 0.236]),
    ];
    let text = format!("margin_m = 0.01\n{}", sides.concat());
    Scene::from_toml(std::path::Path::new("ringed.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"))
}

/// Goal: no client waits for a motion without a client. Method: a request with a deadline far beyond the timeout of the test is
/// dropped, as Ctrl-C does, or its process is gone; the next one must be answered long before that deadline. While the first
/// one is planned, others get that answer.
#[test]
fn service_planning_ends_when_its_requester_goes_and_others_are_answered_meanwhile() {
    let played = Played::new(Phase::Holding);
    with_service_in(&ringed(), "cancelled", &played, |arm, _| {
        let wire = join(arm, "client");
        let client = wire.plan_client().expect("port");
        let hard = CheckedPlanRequest { deadline_ms: 60_000, ..request(When::AtOnce, "", pose(RINGED)) };
        let pending = client.send_copy(PlanRequest::from(&hard)).expect("sent");
        let busy = loop {
            let outcome = ask(arm, &request(When::AtOnce, "", pose(THERE)), || ());
            if let PlanOutcome::Failed { reason } = outcome {
                break reason;
            }
        };
        assert!(busy.contains("another request") && busy.contains("60.0 s"), "{busy}");
        drop(pending);
        let since = Instant::now();
        while let PlanOutcome::Failed { reason } = ask(arm, &request(When::AtOnce, "", pose(THERE)), || ()) {
            assert!(reason.contains("another request"), "{reason}");
            assert!(since.elapsed() < Duration::from_secs(40), "the planner plans on for nobody");
            thread::sleep(Duration::from_millis(20));
        }
    });
}

/// One target, sent just now.
fn targets(position_rad: JointArray) -> CheckedTargets {
    let target = Target { due_s: 0.0, position_rad, velocity_rad_s: None };
    CheckedTargets { joints: 6, sequence: 1, sent_ns: now_ns(), valid_s: 20.0, targets: vec![target] }
}

/// Sends targets and waits for the answer.
fn stream(arm: &str, sent: &CheckedTargets) -> TargetOutcome {
    let wire = join(arm, "client");
    let client = wire.target_client().expect("port");
    let pending = client.send_copy(TargetRequest::new(sent)).expect("sent");
    let since = Instant::now();
    loop {
        if let Some(reply) = pending.receive().expect("received") {
            assert_eq!(reply.payload().sequence(), sent.sequence);
            return reply.payload().outcome();
        }
        assert!(since.elapsed() < Duration::from_secs(20), "no answer");
        thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn service_target_is_followed_as_far_as_it_is_proven_and_the_answer_says_so() {
    let played = Played::new(Phase::Holding);
    with_service("stream", &played, |arm, _| {
        let note = |outcome: TargetOutcome| match outcome {
            TargetOutcome::Taken { cut_s, rest_in_s, note, .. } => {
                assert!(cut_s <= 0.0 && rest_in_s > 0.0, "{cut_s} {rest_in_s}");
                note
            }
            TargetOutcome::Superseded | TargetOutcome::Refused { .. } => panic!("{outcome:?}"),
        };
        assert_eq!(note(stream(arm, &targets(pose(THERE)))), "");
        let far = note(stream(arm, &targets(pose([9.0, -1.4, 1.4, -1.57, -1.57, 0.0]))));
        assert!(far.contains("shoulder_pan is kept inside its limits") && far.contains("9 rad"), "{far}");
        let blocked = note(stream(arm, &targets(pose([0.0, 0.6, 0.0, 0.0, 0.0, 0.0]))));
        assert!(blocked.contains("% of the way") && blocked.contains("table"), "{blocked}");
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst), 3);
}

#[test]
fn service_targets_that_cannot_be_kept_are_refused_in_words_and_nothing_is_sent() {
    let played = Played::new(Phase::Holding);
    with_service("bad-stream", &played, |arm, _| {
        let reason = |sent: &CheckedTargets| match stream(arm, sent) {
            TargetOutcome::Refused { reason } => reason,
            outcome @ (TargetOutcome::Taken { .. } | TargetOutcome::Superseded) => panic!("{outcome:?}"),
        };
        let good = targets(pose(THERE));
        let seven = CheckedTargets { joints: 7, ..good.clone() };
        let old = CheckedTargets { sent_ns: now_ns() - 300_000_000, valid_s: 0.2, ..good.clone() };
        let none = CheckedTargets { targets: Vec::new(), ..good.clone() };
        assert!(reason(&seven).contains("7 joint values, ur5 has 6 joints"));
        assert!(reason(&old).contains("valid for 0.200 s"), "{}", reason(&old));
        assert!(reason(&none).contains("0 targets"));
        for phase in Phase::ALL.into_iter().filter(|phase| *phase != Phase::Holding) {
            played.show(phase);
            let runs = matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused);
            let word = if runs { "this planner has not sent" } else { phase.word() };
            let said = reason(&good);
            assert!(said.contains(word), "{phase:?}: {said}");
        }
    });
    assert_eq!(played.accepted.load(Ordering::SeqCst), 0);
}
