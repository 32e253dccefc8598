//! Messages come from shared memory that anybody of our user may have written: whatever their bits are, reading them
//! must neither panic nor let an unchecked number through.
#![expect(clippy::expect_used, reason = "helpers of tests fail by panicking")]
use proptest::prelude::*;
use taustream_messages::command::CommandError;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome, PlanRequestError, PlanStages, When};
use taustream_messages::plan_detail::PlanDetail;
use taustream_messages::scene::{
    CHANGES_MAX, FAR_M, FixedTo, MASS_KG_MAX, ObjectPose, ObjectShape, PAGE, SceneChange, SceneRequestError,
    What, is_object_name,
};
use taustream_messages::scene_reply::{ListedObject, MotionEffect, SceneOutcome};
use taustream_messages::target::{
    CheckedTargets, DUE_S_MAX, TARGETS_MAX, Target, TargetError, TargetOutcome,
};
use taustream_messages::tip_goal::{TipGoal, TipLine, TipOrientation};
use taustream_messages::trajectory::{Corrupted, MessageError};
use taustream_messages::way_points::{Blend, WAY_POINTS_MAX};
use taustream_messages::{
    AxisGoal, AxisState, CheckedSceneRequest, CheckedTrajectory, Command, CommandReply, CommandRequest,
    LAYOUT_VERSION, Outcome, Phase, PlanReply, PlanRequest, Receipt, Rejection, Replaces, Report, SceneReply,
    SceneRequest, TargetReply, TargetRequest, Text, TrajectoryMessage,
};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory, joint_array};

/// Makes a message of arbitrary bytes, as a hostile sender can.
#[expect(unsafe_code, reason = "a test of arbitrary bits has to write arbitrary bits")]
fn from_bytes<T: Copy>(bytes: &[u8]) -> Box<T> {
    assert_eq!(bytes.len(), size_of::<T>());
    // SAFETY: every message is `repr(C)` and holds only integers, floats and arrays of them, for which every bit
    // pattern is a value; the read is unaligned and of exactly the size of `T`.
    Box::new(unsafe { bytes.as_ptr().cast::<T>().read_unaligned() })
}

fn bytes_of(size: usize) -> impl Strategy<Value = Vec<u8>> {
    let any_byte = proptest::collection::vec(any::<u8>(), size);
    // Mostly zero bytes reach deeper than noise, which fails at the layout version.
    let sparse = proptest::collection::vec((0..size, any::<u8>()), 0..40).prop_map(move |writes| {
        let mut bytes = vec![0; size];
        bytes[..4].copy_from_slice(&LAYOUT_VERSION.to_ne_bytes());
        for (at, byte) in writes {
            bytes[at] = byte;
        }
        bytes
    });
    prop_oneof![any_byte, sparse]
}

fn example() -> CheckedTrajectory {
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[0] = 0.5;
    let strokes = [Stroke { start_s: 0.0, duration_s: 2.0, n: 6, delta_rad }];
    CheckedTrajectory {
        trajectory_id: 7,
        generation: 3,
        robot_digest: [9; 32],
        replaces: Replaces::Rest,
        trajectory: Trajectory::new(6, [0.0; MAX_JOINTS], &strokes).expect("a plain trajectory"),
    }
}

proptest! {
    #[test]
    fn trajectory_of_any_bytes_is_checked_or_refused(bytes in bytes_of(size_of::<TrajectoryMessage>())) {
        let message = from_bytes::<TrajectoryMessage>(&bytes);
        if let Ok(checked) = CheckedTrajectory::try_from(&*message) {
            prop_assert!((1..=MAX_JOINTS).contains(&checked.trajectory.joints()));
            prop_assert!(checked.trajectory.duration_s().is_finite());
            prop_assert!(checked.trajectory.end_rad().iter().all(|q| q.is_finite()));
        }
    }

    #[test]
    fn targets_of_any_bytes_are_checked_or_refused(
        request in bytes_of(size_of::<TargetRequest>()),
        reply in bytes_of(size_of::<TargetReply>()),
    ) {
        if let Ok(checked) = CheckedTargets::try_from(&*from_bytes::<TargetRequest>(&request)) {
            prop_assert!((1..=MAX_JOINTS).contains(&checked.joints));
            prop_assert!((1..=TARGETS_MAX).contains(&checked.targets.len()));
            prop_assert!(checked.targets.is_sorted_by(|a, b| a.due_s <= b.due_s));
            for target in &checked.targets {
                prop_assert!((0.0..=DUE_S_MAX).contains(&target.due_s));
                prop_assert!(target.position_rad.iter().all(|q| q.is_finite()));
                prop_assert!(target.velocity_rad_s.iter().flatten().all(|v| v.is_finite()));
            }
        }
        if let TargetOutcome::Refused { reason } = from_bytes::<TargetReply>(&reply).outcome() {
            prop_assert!(reason.chars().all(|c| !c.is_control()));
        }
    }

    #[test]
    fn scene_changes_of_any_bytes_are_checked_or_refused(
        request in bytes_of(size_of::<SceneRequest>()),
        reply in bytes_of(size_of::<SceneReply>()),
    ) {
        if let Ok(CheckedSceneRequest::Change(changes)) = CheckedSceneRequest::try_from(&*from_bytes::<SceneRequest>(&request)) {
            prop_assert!((1..=CHANGES_MAX).contains(&changes.len()));
            for change in &changes {
                prop_assert!(is_object_name(change.name()));
                if let SceneChange::Add { pose, mass_kg, .. } = change {
                    prop_assert!(pose.position_m.iter().all(|x| x.abs() <= FAR_M));
                    prop_assert!((0.0..=MASS_KG_MAX).contains(mass_kg));
                }
            }
        }
        match from_bytes::<SceneReply>(&reply).outcome() {
            SceneOutcome::Listed { objects, .. } => prop_assert!(objects.len() <= PAGE),
            SceneOutcome::Changed { note: text, .. } | SceneOutcome::Refused { reason: text } => {
                prop_assert!(text.chars().all(|c| !c.is_control()));
            }
        }
    }

    #[test]
    fn other_messages_of_any_bytes_never_panic(
        receipt in bytes_of(size_of::<Receipt>()),
        command in bytes_of(size_of::<CommandRequest>()),
        reply in bytes_of(size_of::<CommandReply>()),
        request in bytes_of(size_of::<PlanRequest>()),
        answer in bytes_of(size_of::<PlanReply>()),
        report in bytes_of(size_of::<Report>()),
    ) {
        if let Some(Outcome::Rejected(rejection)) = from_bytes::<Receipt>(&receipt).outcome() {
            prop_assert!(!rejection.to_string().is_empty());
        }
        if let Ok(Command::Speed { percent }) = Command::try_from(&*from_bytes::<CommandRequest>(&command)) {
            prop_assert!((0.0..=100.0).contains(&percent));
        }
        let reply = from_bytes::<CommandReply>(&reply);
        prop_assert!(reply.text().chars().all(|c| !c.is_control()));
        if let Ok(checked) = CheckedPlanRequest::try_from(&*from_bytes::<PlanRequest>(&request)) {
            prop_assert!(checked.goal_rad.iter().all(|q| q.is_finite()));
        }
        let _ = from_bytes::<PlanReply>(&answer).outcome();
        let report = from_bytes::<Report>(&report);
        prop_assert!(report.joints() <= MAX_JOINTS);
        let _ = report.checked();
    }
}

#[test]
fn trajectory_written_and_read_is_the_same() {
    let checked = example();
    let message = TrajectoryMessage::new(&checked);
    assert_eq!(CheckedTrajectory::try_from(&*message), Ok(checked));
}

#[test]
fn trajectory_corrupted_in_one_field_is_refused_for_that_field() {
    let cases: [(Corrupted, &str); 10] = [
        (Corrupted::Layout(LAYOUT_VERSION + 70), "layout version "),
        (Corrupted::Joints(0), "0 joints"),
        (Corrupted::Joints(17), "joint_count is 17"),
        (Corrupted::StrokeCount(600), "stroke_count is 600; at most 512"),
        (Corrupted::Exponent(3), "n is 3"),
        (Corrupted::Delta(f64::NAN), "delta_rad is not finite"),
        (Corrupted::Duration(0.0), "at least 0.001 s"),
        (Corrupted::Start(-1.0), "start_s is -1"),
        (Corrupted::Base(f64::INFINITY), "base_rad of joint 1"),
        (Corrupted::Replaces(5), "replaces code 5"),
    ];
    for (corrupted, words) in cases {
        let message = TrajectoryMessage::new(&example()).corrupted(corrupted);
        let error = CheckedTrajectory::try_from(&*message).expect_err("a corrupted message is refused");
        assert!(error.to_string().contains(words), "{corrupted:?} gave: {error}");
    }
    let other_robot = TrajectoryMessage::new(&example()).corrupted(Corrupted::Digest(1));
    let read = CheckedTrajectory::try_from(&*other_robot).expect("a digest is compared by the streamer");
    assert_ne!(read.robot_digest, example().robot_digest);
}

#[test]
fn cut_at_a_time_that_is_no_time_is_refused() {
    for at_s in [f64::NAN, f64::INFINITY, -0.5] {
        let mut checked = example();
        checked.replaces = Replaces::Cut { trajectory_id: 1, at_s };
        let error = CheckedTrajectory::try_from(&*TrajectoryMessage::new(&checked)).expect_err("no time");
        assert!(matches!(error, MessageError::CutTime { .. }), "{at_s} gave: {error}");
    }
}

#[test]
fn receipt_carries_every_outcome() {
    let outcomes = [
        Outcome::Accepted { from_s: 0.25, tick: 77 },
        Outcome::Rejected(Rejection::Malformed("stroke 3: n is 3".into())),
        Outcome::Rejected(Rejection::WrongRobot),
        Outcome::Rejected(Rejection::JointCount { got: 7, expected: 6 }),
        Outcome::Rejected(Rejection::StaleGeneration { got: 4, newest: 9 }),
        Outcome::Rejected(Rejection::Limit {
            joint: 2,
            at_s: 1.204,
            value: 3.3,
            limit: 3.1,
            what: "velocity, rad/s".into(),
        }),
        Outcome::Rejected(Rejection::NotAtBase { joint: 5, by_rad: 0.02 }),
        Outcome::Rejected(Rejection::NotReady { phase: Some(Phase::Paused) }),
        Outcome::Rejected(Rejection::CutPassed { at_s: 0.9, by_s: 0.02 }),
        Outcome::Rejected(Rejection::CutOutside { at_s: 0.9, begins_s: 0.0, ends_s: 0.8 }),
        Outcome::Rejected(Rejection::OtherTrajectory { cut: u64::MAX, running: 3 }),
        Outcome::Rejected(Rejection::NothingToCut { phase: Some(Phase::Holding) }),
        Outcome::Rejected(Rejection::SpeedChanges),
        Outcome::Rejected(Rejection::KeptStrokesDiffer { stroke: 11 }),
        Outcome::Rejected(Rejection::KeptBaseDiffers { joint: 4, by_rad: 1e-16 }),
        Outcome::Rejected(Rejection::TooLate { late_s: 0.75 }),
        Outcome::Rejected(Rejection::Busy),
    ];
    for outcome in outcomes {
        let receipt = Receipt::new(5, 4, &outcome);
        assert_eq!(receipt.outcome(), Some(outcome));
        assert_eq!(receipt.trajectory_id(), 5);
    }
}

#[test]
fn command_survives_the_wire_and_bad_ones_are_named() {
    let commands = [
        Command::Enable,
        Command::Disable,
        Command::Pause,
        Command::Resume,
        Command::Stop,
        Command::FastStop,
        Command::TorqueOff,
        Command::Speed { percent: 37.5 },
        Command::ClearFault,
        Command::Axis { axis: 1, goal: AxisGoal::Open, force: None },
        Command::Axis { axis: 0, goal: AxisGoal::Closed, force: Some(12.5) },
        Command::Axis { axis: 3, goal: AxisGoal::At(-0.25), force: Some(1.0) },
        Command::Axis { axis: 0, goal: AxisGoal::Stop, force: None },
        Command::Home { joint: 5 },
    ];
    for command in commands {
        assert_eq!(Command::try_from(&CommandRequest::from(command)), Ok(command));
    }
    for percent in [f64::NAN, -1.0, 100.5, f64::INFINITY] {
        let refused = Command::try_from(&CommandRequest::from(Command::Speed { percent }));
        assert!(matches!(refused, Err(CommandError::Percent { .. })), "{percent}");
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for (goal, force, what) in [
            (AxisGoal::At(bad), None, "position"),
            (AxisGoal::At(0.1), Some(bad), "force"),
            (AxisGoal::Open, Some(bad), "force"),
        ] {
            let request = CommandRequest::from(Command::Axis { axis: 0, goal, force });
            let refused = Command::try_from(&request).unwrap_err();
            assert!(matches!(refused, CommandError::Axis { what: said, .. } if said == what), "{refused}");
        }
    }
    for state in AxisState::ALL {
        assert_eq!(AxisState::from_code(state.code()), state);
    }
    assert_eq!(AxisState::from_code(77), AxisState::Fault);
}

#[test]
fn goals_of_the_tip_survive_the_wire_and_numbers_that_make_no_sense_are_refused() {
    let tip = TipGoal {
        tip: 1,
        position_m: [0.4, -0.3, 0.35],
        tolerance_m: 1e-3,
        orientation: Some(TipOrientation {
            quaternion_xyzw: [0.0, 0.6, 0.0, 0.8],
            tolerance_rad: [0.01, 0.02, f64::INFINITY],
        }),
        line: Some(TipLine { linear_m_s: 0.1, angular_rad_s: 1.0, off_m_max: 1e-3 }),
    };
    let request = |tip: TipGoal| CheckedPlanRequest {
        tip: Some(tip),
        deadline_ms: 100,
        ..CheckedPlanRequest::to_pose(6, [0.0; MAX_JOINTS])
    };
    let sent = |tip: TipGoal| CheckedPlanRequest::try_from(&PlanRequest::from(&request(tip)));
    for tip in [
        tip,
        TipGoal { orientation: None, ..tip },
        TipGoal { line: None, ..tip },
        TipGoal { orientation: None, line: None, ..tip },
    ] {
        assert_eq!(sent(tip), Ok(request(tip)));
    }
    let turned = |quaternion_xyzw: [f64; 4], tolerance_rad: [f64; 3]| TipGoal {
        orientation: Some(TipOrientation { quaternion_xyzw, tolerance_rad }),
        ..tip
    };
    let straight = |linear_m_s: f64| TipGoal {
        line: Some(TipLine { linear_m_s, angular_rad_s: 1.0, off_m_max: 1e-3 }),
        ..tip
    };
    for bad in [
        TipGoal { position_m: [f64::NAN, 0.0, 0.0], ..tip },
        TipGoal { position_m: [0.0, f64::INFINITY, 0.0], ..tip },
        TipGoal { tolerance_m: -1e-3, ..tip },
        TipGoal { tolerance_m: f64::INFINITY, ..tip },
        turned([0.0; 4], [0.0; 3]),
        turned([f64::NAN; 4], [0.0; 3]),
        turned([0.0, 0.0, 0.0, 1.0], [-0.1, 0.0, 0.0]),
        turned([0.0, 0.0, 0.0, 1.0], [f64::NAN, 0.0, 0.0]),
        straight(0.0),
        straight(f64::NAN),
        straight(f64::INFINITY),
    ] {
        let error = sent(bad).unwrap_err();
        assert!(matches!(error, PlanRequestError::Tip { .. }), "{bad:?}: {error}");
    }
}

#[test]
fn plan_request_and_answer_survive_the_wire() {
    let mut goal_rad = [0.0; MAX_JOINTS];
    goal_rad[5] = -1.25;
    let request = CheckedPlanRequest {
        when: When::AfterCurrent,
        deadline_ms: 1500,
        seed: 42,
        planner: "rrt-connect".into(),
        ..CheckedPlanRequest::to_pose(6, goal_rad)
    };
    assert_eq!(CheckedPlanRequest::try_from(&PlanRequest::from(&request)), Ok(request));
    let outcomes = [
        PlanOutcome::Failed { reason: "goal of joint 2 is outside its limits by 0.2 rad".into() },
        PlanOutcome::Planned {
            trajectory_id: 9,
            planning_s: 0.1,
            duration_s: 2.5,
            clearance_m: 0.03,
            strokes: 4,
            how: "RRT-Connect".into(),
            receipt: None,
            stages: PlanStages { received_ns: 1, planned_ns: 2, proven_ns: 3, sent_ns: 4, receipt_ns: 5 },
        },
    ];
    for outcome in outcomes {
        assert_eq!(PlanReply::new(&outcome, &PlanDetail::default()).outcome(), outcome);
    }
}

#[test]
fn way_points_survive_the_wire_and_those_that_make_no_sense_are_refused() {
    let pose = |value_rad: f64| std::array::from_fn(|joint| if joint < 6 { value_rad } else { 0.0 });
    let with = |via_rad: Vec<JointArray>, blend| CheckedPlanRequest {
        via_rad,
        blend,
        ..CheckedPlanRequest::to_pose(6, pose(0.5))
    };
    let sent = |request: &CheckedPlanRequest| CheckedPlanRequest::try_from(&PlanRequest::from(request));
    for good in [
        with(Vec::new(), Blend::Clearance),
        with(vec![pose(0.1), pose(-0.2)], Blend::Radians(0.0)),
        with(vec![pose(0.3); WAY_POINTS_MAX], Blend::Metres(0.05)),
    ] {
        assert_eq!(sent(&good), Ok(good));
    }
    let mut seventh = pose(0.1);
    seventh[6] = 0.1;
    for bad in [
        with(vec![pose(0.3); WAY_POINTS_MAX + 1], Blend::Clearance),
        with(vec![pose(0.3), pose(f64::NAN)], Blend::Clearance),
        with(vec![pose(f64::INFINITY)], Blend::Clearance),
        with(vec![seventh], Blend::Clearance),
        with(vec![pose(0.3)], Blend::Radians(f64::NAN)),
        with(vec![pose(0.3)], Blend::Radians(-1e-3)),
        with(vec![pose(0.3)], Blend::Metres(f64::INFINITY)),
    ] {
        assert!(sent(&bad).is_err(), "{bad:?}");
    }
}

#[test]
fn text_too_long_is_cut_at_a_character() {
    let long = "\u{e9}".repeat(200);
    let text = Text::new(&long).read();
    assert_eq!(text, "\u{e9}".repeat(120));
    assert_eq!(Text::new("a\nb").read(), "a b");
}

fn targets(due_s: &[f64]) -> CheckedTargets {
    let each = due_s.iter().map(|&due_s| Target {
        due_s,
        position_rad: joint_array([0.1, -0.2, 0.0, 0.0, 0.0, 0.0]),
        velocity_rad_s: None,
    });
    CheckedTargets { joints: 2, sequence: 5, sent_ns: 9, valid_s: 0.2, targets: each.collect() }
}

#[test]
fn targets_arrive_as_they_were_sent() {
    let mut sent = targets(&[0.0, 0.1, 0.1, 2.5]);
    sent.targets[1].velocity_rad_s = Some([0.5; MAX_JOINTS].map(|v| v * 0.0));
    assert_eq!(CheckedTargets::try_from(&TargetRequest::new(&sent)), Ok(sent));
}

#[test]
fn targets_that_make_no_sense_are_refused_with_their_place() {
    let read = |sent: &CheckedTargets| CheckedTargets::try_from(&TargetRequest::new(sent));
    let due = |due_s: &[f64]| read(&targets(due_s)).expect_err("must be refused");
    assert_eq!(due(&[]), TargetError::Count { got: 0 });
    assert_eq!(due(&[0.0; TARGETS_MAX + 1]), TargetError::Count { got: 65 });
    assert_eq!(due(&[0.2, 0.1]), TargetError::Due { target: 1, due_s: 0.1 });
    assert_eq!(due(&[-0.1]), TargetError::Due { target: 0, due_s: -0.1 });
    assert_eq!(due(&[DUE_S_MAX * 1.01]), TargetError::Due { target: 0, due_s: DUE_S_MAX * 1.01 });
    assert!(matches!(due(&[f64::NAN]), TargetError::Due { target: 0, .. }));
    let mut wrong = targets(&[0.0, 0.1]);
    wrong.targets[1].position_rad[1] = f64::INFINITY;
    assert_eq!(read(&wrong), Err(TargetError::Value { target: 1, joint: 1, value: f64::INFINITY }));
    let mut stranger = targets(&[0.0]);
    stranger.targets[0].position_rad[2] = 0.5;
    assert_eq!(read(&stranger), Err(TargetError::Value { target: 0, joint: 2, value: 0.5 }));
    for valid_s in [0.0, -1.0, f64::NAN, DUE_S_MAX * 1.01] {
        let wrong = CheckedTargets { valid_s, ..targets(&[0.0]) };
        assert!(matches!(read(&wrong), Err(TargetError::Valid { .. })), "{valid_s}");
    }
    let mut partly = targets(&[0.0]);
    partly.targets[0].velocity_rad_s = Some(joint_array([0.0, f64::NAN, 0.0, 0.0, 0.0, 0.0]));
    assert!(matches!(read(&partly), Err(TargetError::Value { target: 0, joint: 1, .. })));
}

#[test]
fn replies_to_targets_arrive_as_they_were_sent() {
    let outcomes = [
        TargetOutcome::Taken {
            trajectory_id: 7,
            cut_s: 1.25,
            rest_in_s: 0.5,
            planning_s: 0.001,
            note: "joint 2 kept inside its limit".to_owned(),
        },
        TargetOutcome::Superseded,
        TargetOutcome::Refused { reason: "link3 would touch box".to_owned() },
    ];
    for outcome in outcomes {
        let reply = TargetReply::new(11, &outcome);
        assert_eq!((reply.sequence(), reply.outcome()), (11, outcome));
    }
}

fn object_pose(position_m: [f64; 3]) -> ObjectPose {
    ObjectPose { position_m, quaternion_xyzw: [0.0, 0.6, 0.0, 0.8] }
}

fn addition(name: &str, shape: ObjectShape, pose: ObjectPose) -> SceneChange {
    SceneChange::Add {
        name: name.to_owned(),
        shape,
        pose,
        fixed_to: FixedTo::Tip,
        mass_kg: 2.0,
        replaces: true,
    }
}

#[test]
fn scene_changes_and_answers_arrive_as_they_were_sent() {
    let pose = object_pose([0.1, -2.0, 3.0]);
    let name = || "a".repeat(64);
    let all = vec![
        addition(&name(), ObjectShape::Box { size_m: [1.0, 2.0, 3.0] }, pose),
        addition("b", ObjectShape::Sphere { radius_m: 0.1 }, pose),
        addition("c", ObjectShape::Cylinder { radius_m: 0.1, length_m: 0.2 }, pose),
        addition("d", ObjectShape::Capsule { radius_m: 0.1, length_m: 0.2 }, pose),
        SceneChange::Remove { name: name() },
        SceneChange::Move { name: name(), pose },
        SceneChange::Attach { name: name(), mass_kg: 0.0 },
        SceneChange::Detach { name: name() },
    ];
    for request in [CheckedSceneRequest::Change(all), CheckedSceneRequest::List { first: 32 }] {
        assert_eq!(CheckedSceneRequest::try_from(&SceneRequest::from(&request)), Ok(request));
    }
    let object =
        ListedObject { name: name(), shape: ObjectShape::Mesh, pose, fixed_to: FixedTo::Base, mass_kg: 0.0 };
    let listed = |objects| SceneOutcome::Listed {
        revision: 9,
        total: 40,
        first: 16,
        objects,
        last_effect: "what".to_owned(),
    };
    let changed = |effect| SceneOutcome::Changed {
        revision: 9,
        total: 3,
        effect,
        note: "why".to_owned(),
        times_ns: [1, 2, 3],
    };
    for outcome in [
        listed(vec![object.clone(); PAGE]),
        listed(Vec::new()),
        changed(MotionEffect::Rests),
        changed(MotionEffect::Free),
        changed(MotionEffect::Rerouted { trajectory_id: 7 }),
        changed(MotionEffect::Stopped),
        changed(MotionEffect::StoppedLate),
        SceneOutcome::Refused { reason: "no".to_owned() },
    ] {
        assert_eq!(SceneReply::new(&outcome).outcome(), outcome);
    }
}

#[test]
fn scene_changes_that_make_no_sense_are_refused_with_their_place() {
    let good = addition("a", ObjectShape::Sphere { radius_m: 0.1 }, object_pose([0.0; 3]));
    let (ball, here) = (ObjectShape::Sphere { radius_m: 0.1 }, object_pose([0.0; 3]));
    let stretched = ObjectPose { quaternion_xyzw: [0.0, 0.0, 0.0, 1.1], ..here };
    let heavy = |mass_kg| SceneChange::Attach { name: "a".to_owned(), mass_kg };
    for (bad, expected) in [
        (addition("", ball, here), What::Name),
        (addition("a b", ball, here), What::Name),
        (addition(&"a".repeat(65), ball, here), What::Name),
        (addition("a", ObjectShape::Sphere { radius_m: -1.0 }, here), What::Size { value_m: -1.0 }),
        (addition("a", ObjectShape::Box { size_m: [1.0, 101.0, 1.0] }, here), What::Size { value_m: 101.0 }),
        (addition("a", ObjectShape::Mesh, here), What::Mesh),
        (
            addition("a", ball, object_pose([0.0, f64::INFINITY, 0.0])),
            What::Position { value_m: f64::INFINITY },
        ),
        (addition("a", ball, stretched), What::Quaternion { length: 1.1 }),
        (heavy(-1.0), What::Mass { value_kg: -1.0 }),
    ] {
        let request = CheckedSceneRequest::Change(vec![good.clone(), bad]);
        let refused = CheckedSceneRequest::try_from(&SceneRequest::from(&request));
        let Err(SceneRequestError::Change { index: 1, what }) = refused else { panic!("{refused:?}") };
        assert_eq!(what.to_string(), expected.to_string());
    }
    for count in [0, CHANGES_MAX + 1] {
        let request = CheckedSceneRequest::Change(vec![good.clone(); count]);
        let refused = CheckedSceneRequest::try_from(&SceneRequest::from(&request));
        assert_eq!(refused, Err(SceneRequestError::Count { got: u32::try_from(count).expect("small") }));
    }
}
