//! A scene that changes under a running planner: over real shared memory, with a streamer played by the test that runs what it
//! accepts in real time.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
mod clouds;
#[path = "../common/mod.rs"]
mod common;
mod played;
use common::{pose, scene, sphere, ur5};
use played::{
    FROM, Played, TO, assert_commanded_free, at, ball, empty, on_the_way, wait_until_rest, with_service,
};
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::rng::SeededRng;
use taustream_messages::plan::PlanOutcome;
use taustream_messages::scene::{FixedTo, ObjectShape, SceneChange};
use taustream_messages::scene_reply::{MotionEffect, SceneOutcome};
use taustream_messages::{CheckedSceneRequest, Outcome, Replaces};
use taustream_motion::Trajectory;
use taustream_planner::kept_scene::{SceneFile, restore};
use taustream_planner::live_scene::{LiveScene, SceneChangeError};
use taustream_planner::send::Outbox;
use taustream_planner::world::World;
use taustream_planner::{PlanOptions, verify};

#[test]
fn scene_change_in_the_way_of_a_motion_leads_the_arm_round_and_others_leave_it() {
    let played = Played::default();
    with_service("reroute", &empty(), &played, |asker| {
        assert_eq!(asker.change(&[ball("far", [0.0, 0.0, 3.0], 0.1)]).0, MotionEffect::Rests);
        let PlanOutcome::Planned { duration_s, .. } = asker.go(pose(TO)) else { panic!("no plan") };
        assert!(duration_s > 1.2, "{duration_s}: too short for this test");
        assert_eq!(
            asker.change(&[ball("aside", [0.0, 0.0, -2.0], 0.1)]),
            (MotionEffect::Free, String::new())
        );
        let at_m = on_the_way(1.0);
        let (effect, note) = asker.change(&[ball("in-the-way", at_m, 0.04)]);
        let since = Instant::now();
        assert!(matches!(effect, MotionEffect::Rerouted { .. }), "{effect:?}: {note}");
        for word in ["in-the-way", "link", "required", "rerouted", "t = ", ", in "] {
            assert!(note.contains(word), "{word}: {note}");
        }
        wait_until_rest(&played);
        assert_commanded_free(&played, since, vec![sphere("in-the-way", at_m, 0.04)]);
        let state = played.state.lock().expect("no panic");
        let off_rad = (0..6).map(|j| (state.rest_rad[j] - TO[j]).abs()).fold(0.0, f64::max);
        assert!(off_rad < 1e-6 && state.stops == 0, "{off_rad} rad off, {} stops", state.stops);
    });
}

#[test]
fn scene_change_round_the_goal_stops_the_arm_on_its_path_and_says_why() {
    let played = Played::default();
    with_service("stop", &empty(), &played, |asker| {
        let PlanOutcome::Planned { .. } = asker.go(pose(TO)) else { panic!("no plan") };
        let (effect, note) = asker.change(&[ball("on-the-goal", on_the_way(1.5), 0.1)]);
        assert_eq!(effect, MotionEffect::Stopped, "{note}");
        assert!(note.contains("on-the-goal") && note.contains("a stop on the path"), "{note}");
        wait_until_rest(&played);
        assert_eq!(played.state.lock().expect("no panic").stops, 1);
        // The next plan knows the scene, and the list what became of the motion.
        let PlanOutcome::Failed { reason } = asker.go(pose(TO)) else { panic!("a plan into an obstacle") };
        assert!(reason.contains("on-the-goal"), "{reason}");
        let SceneOutcome::Listed { last_effect, .. } = asker.scene(&CheckedSceneRequest::List { first: 0 })
        else {
            panic!("no list")
        };
        assert_eq!(last_effect, note);
    });
}

/// Goal: a motion that another process has sent is checked as well, and stopped.
#[test]
fn scene_change_in_the_way_of_a_motion_of_another_process_stops_it() {
    let played = Played::default();
    with_service("foreign", &empty(), &played, |asker| {
        let robot = ur5();
        let plan = taustream_planner::plan(&robot, &empty(), &pose(FROM), &pose(TO), &PlanOptions::default());
        let motion = plan.expect("a plan").trajectory;
        // What was sent is seen while its sender is there.
        let outbox = Outbox::open(&asker.wire).expect("ports");
        let sent = outbox.send(&robot, &motion, Replaces::Rest, Duration::from_secs(2)).expect("sent");
        assert!(matches!(sent.receipt.and_then(|receipt| receipt.outcome()), Some(Outcome::Accepted { .. })));
        thread::sleep(Duration::from_millis(50));
        let aside = asker.change(&[ball("aside", [0.0, 0.0, -2.0], 0.1)]);
        assert_eq!(aside, (MotionEffect::Free, String::new()));
        let (effect, note) = asker.change(&[ball("in-the-way", on_the_way(1.0), 0.04)]);
        assert!(effect == MotionEffect::Stopped && note.contains("in-the-way"), "{effect:?} {note}");
    });
}

/// Goal: what the tip holds counts in plans, and rests where the tip leaves it.
#[test]
fn attached_object_moves_with_the_tip_and_counts_in_plans() {
    let played = Played::default();
    let tip_m = on_the_way(FROM[0]);
    with_service("attach", &empty(), &played, |asker| {
        // A long rod that hangs 20 cm below the tip.
        let rod = SceneChange::Add {
            name: "rod".to_owned(),
            shape: ObjectShape::Capsule { radius_m: 0.02, length_m: 0.2 },
            pose: at([tip_m[0], tip_m[1], tip_m[2] - 0.2]),
            fixed_to: FixedTo::Base,
            mass_kg: 0.0,
            replaces: false,
        };
        let below = on_the_way(0.0);
        let hindrance = ball("hindrance", [below[0], below[1], below[2] - 0.25], 0.05);
        asker.change(&[rod, hindrance.clone()]);
        let PlanOutcome::Planned { clearance_m, .. } = asker.go(pose(TO)) else { panic!("no plan") };
        assert!(clearance_m > 0.02);
        assert!(
            asker
                .refused(&[SceneChange::Attach { name: "rod".to_owned(), mass_kg: 1.0 }])
                .contains("at rest")
        );
        wait_until_rest(&played);
        let PlanOutcome::Planned { .. } = asker.go(pose(FROM)) else { panic!("no plan") };
        wait_until_rest(&played);
        thread::sleep(Duration::from_millis(50));
        asker.change(&[SceneChange::Attach { name: "rod".to_owned(), mass_kg: 1.0 }]);
        let rod = asker.objects().into_iter().find(|object| object.name == "rod").expect("listed");
        assert_eq!((rod.fixed_to, rod.mass_kg), (FixedTo::Tip, 1.0));
        let mut half_way = TO;
        half_way[0] = 0.0;
        let PlanOutcome::Failed { reason } = asker.go(pose(half_way)) else { panic!("through the rod") };
        assert!(reason.contains("rod") && reason.contains("hindrance"), "{reason}");
        let since = Instant::now();
        let PlanOutcome::Planned { .. } = asker.go(pose(TO)) else { panic!("no plan round it") };
        wait_until_rest(&played);
        thread::sleep(Duration::from_millis(50));
        asker.change(&[SceneChange::Detach { name: "rod".to_owned() }]);
        let rod = asker.objects().into_iter().find(|object| object.name == "rod").expect("listed");
        let tip_m = on_the_way(TO[0]);
        let off_m = (0..3).map(|i| (rod.pose.position_m[i] - tip_m[i] + [0.0, 0.0, 0.2][i]).abs());
        assert!(rod.fixed_to == FixedTo::Base && off_m.fold(0.0, f64::max) < 1e-6, "{rod:?}");
        let goes_out = played.state.lock().expect("no panic").commanded.iter().any(|(when, q)| {
            *when > since && (q[1] - FROM[1]).abs() + (q[2] - FROM[2]).abs() + (q[3] - FROM[3]).abs() > 0.05
        });
        assert!(goes_out, "the rod went through the hindrance");
    });
}

/// Goal: a request in motion whose way straight on is blocked is answered: ways round it are searched while the arm moves on. (On stacks of
/// the default size the planner aborted here.)
#[test]
fn request_in_motion_whose_straight_way_is_blocked_is_answered() {
    let played = Played::default();
    with_service("round", &scene("pillars"), &played, |asker| {
        for (first, then) in [(0.5, 1.5), (1.5, -1.5), (-1.5, 0.5)] {
            let PlanOutcome::Planned { .. } = asker.go(pose([first, -0.7, 0.7, -1.57, -1.57, 0.0])) else {
                panic!("no plan")
            };
            thread::sleep(Duration::from_millis(200));
            let outcome = asker.go(pose([then, -0.6, 0.9, -1.87, -1.57, 0.8]));
            assert!(matches!(outcome, PlanOutcome::Planned { .. }), "{outcome:?}");
            wait_until_rest(&played);
        }
    });
}

/// Goal: whatever programs send, by the thousand, every request is answered and nothing panics.
#[test]
fn scene_changes_by_the_thousand_are_answered_and_names_that_do_not_exist_are_said() {
    let played = Played::default();
    with_service("flood", &scene("open"), &played, |asker| {
        let reason = asker.refused(&[SceneChange::Remove { name: "nobody".to_owned() }]);
        assert!(reason.contains("nobody") && reason.contains("table"), "{reason}");
        let twice = [ball("one", [0.0, 0.0, 2.0], 0.1), ball("one", [0.0, 0.0, 2.0], 0.1)];
        assert!(asker.refused(&twice).contains("already"));
        assert!(asker.refused(&[ball("forearm_none", [f64::NAN, 0.0, 0.0], 0.1)]).contains("NaN m"));
        assert!(asker.refused(&[ball("link1", [0.0, 0.0, 2.0], 0.1)]).contains("name of a link"));
        let before = asker.objects().len();
        let PlanOutcome::Planned { .. } = asker.go(pose(TO)) else { panic!("no plan") };
        let mut rng = SeededRng::new(4, 11);
        for _ in 0..300 {
            let name = |index: usize| format!("o{index}");
            let changes: Vec<SceneChange> = (0..1 + rng.index(6))
                .map(|_| {
                    let (name, far_m) = (name(rng.index(8)), rng.within(1.5, 90.0));
                    match rng.index(4) {
                        0 => ball(&name, [0.0, 0.0, far_m], 0.1),
                        1 => SceneChange::Remove { name },
                        2 => SceneChange::Move { name, pose: at([0.0, far_m, 0.0]) },
                        _ => SceneChange::Detach { name },
                    }
                })
                .collect();
            match asker.scene(&CheckedSceneRequest::Change(changes)) {
                SceneOutcome::Changed { effect: MotionEffect::Free | MotionEffect::Rests, .. }
                | SceneOutcome::Refused { .. } => {}
                outcome @ (SceneOutcome::Changed { .. } | SceneOutcome::Listed { .. }) => {
                    panic!("{outcome:?}")
                }
            }
        }
        assert!(asker.objects().len() >= before);
    });
}

/// Goal: a world that follows the changes is the world of the scene as it is then.
/// Method: random changes; least distances in random poses against a world that is built anew.
#[test]
fn world_that_follows_changes_is_the_one_that_is_built_anew() {
    let robot = ur5();
    let mut live = LiveScene::new(&robot, &scene("pillars")).expect("builds");
    let mut rng = SeededRng::new(5, 11);
    let (mut made, mut held) = (0, 0);
    for round in 0..200 {
        let position =
            |rng: &mut SeededRng| at([rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(0.0, 1.2)]);
        let (name, which) = (format!("o{}", rng.index(6)), rng.index(6));
        let shape = match rng.index(4) {
            0 => ObjectShape::Sphere { radius_m: 0.1 },
            1 => ObjectShape::Box { size_m: [0.1, 0.2, 0.3] },
            2 => ObjectShape::Cylinder { radius_m: 0.05, length_m: 0.3 },
            _ => ObjectShape::Capsule { radius_m: 0.05, length_m: 0.3 },
        };
        let change = match which {
            0 | 1 => SceneChange::Add {
                name,
                shape,
                pose: position(&mut rng),
                fixed_to: if rng.unit() < 0.3 { FixedTo::Tip } else { FixedTo::Base },
                mass_kg: 0.5,
                replaces: rng.unit() < 0.5,
            },
            2 => SceneChange::Remove { name },
            3 => SceneChange::Move { name, pose: position(&mut rng) },
            4 => SceneChange::Attach { name, mass_kg: 0.5 },
            _ => SceneChange::Detach { name },
        };
        let rest = pose(std::array::from_fn(|_| rng.within(-2.0, 2.0)));
        let number = live.current().number;
        match live.apply(&[change], Some(&rest)) {
            Ok(_) => made += 1,
            Err(error) => {
                assert_eq!(live.current().number, number, "{error}");
                continue;
            }
        }
        let now = live.current();
        assert_eq!(now.number, number + 1);
        let anew = World::new(&now.robot, &now.scene).expect("builds");
        held += usize::from(now.robot.links.len() > robot.links.len());
        for _ in 0..5 {
            let q = pose(std::array::from_fn(|_| rng.within(-3.0, 3.0)));
            let measured =
                |world: &World| world.closest(&q).map(|(pair, distance_m)| (world.names(&pair), distance_m));
            let (Some((a, a_m)), Some((b, b_m))) = (measured(&now.world), measured(&anew)) else { panic!() };
            assert!(a == b && (a_m - b_m).abs() < 1e-12, "round {round}: {a:?} {a_m}, {b:?} {b_m}");
        }
    }
    assert!(made > 60 && held > 20, "{made} changes, {held} with something at the tip");
}

#[test]
fn changes_count_together_or_not_at_all_and_history_joins_them() {
    let mut live = LiveScene::new(&ur5(), &empty()).expect("builds");
    let bad = [ball("a", [0.0, 0.0, 2.0], 0.1), SceneChange::Remove { name: "b".to_owned() }];
    let error = live.apply(&bad, None).expect_err("no b");
    assert!(
        matches!(error, SceneChangeError::Unknown { .. }) && error.to_string().contains("has a"),
        "{error}"
    );
    assert!(live.objects().is_empty() && live.current().number == 1);
    live.apply(&bad[..1], None).expect("one");
    live.apply(&[ball("b", [0.0, 0.0, 3.0], 0.1)], None).expect("two");
    live.apply(&[SceneChange::Remove { name: "b".to_owned() }], None).expect("three");
    let since =
        |number: u64| live.changed_since(number).expect("known").obstacles.into_iter().collect::<Vec<_>>();
    assert_eq!(
        (since(1), since(2), since(4)),
        (vec!["a".to_owned(), "b".to_owned()], vec!["b".to_owned()], vec![])
    );
    let touching = [SceneChange::Add {
        name: "held".to_owned(),
        shape: ObjectShape::Sphere { radius_m: 0.5 },
        pose: at([0.0; 3]),
        fixed_to: FixedTo::Tip,
        mass_kg: 0.0,
        replaces: false,
    }];
    let error = live.apply(&touching, Some(&pose(FROM))).expect_err("touches the forearm");
    assert!(matches!(error, SceneChangeError::Touches { .. }), "{error}");
    let unplaced = live.apply(&[SceneChange::Attach { name: "a".to_owned(), mass_kg: 0.0 }], None);
    assert!(matches!(unplaced, Err(SceneChangeError::NoTip { .. })));
    assert!(
        verify(&ur5(), &live.current().scene, &Trajectory::new(6, pose(FROM), &[]).expect("rest")).is_ok()
    );
}

/// Goal: a planner that starts again knows what stood around the arm and what the tip held; a file that makes no sense is refused.
#[test]
fn kept_scene_comes_back_whole_and_a_bad_file_is_refused() {
    let folder = std::env::temp_dir().join(format!("taustream-kept-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("scene.toml");
    let (robot, scene) = (ur5(), scene("bracket"));
    let fresh = || LiveScene::new(&robot, &scene).expect("builds");
    let mut live = fresh();
    restore(&mut live, &path).expect("no file is no fault");
    let meshes =
        |live: &LiveScene| live.objects().into_iter().filter(|o| o.shape == ObjectShape::Mesh).count();
    assert!(meshes(&live) > 0, "a scene with a mesh");
    let mesh = live.objects().into_iter().find(|o| o.shape == ObjectShape::Mesh).expect("a mesh").name;
    let other = live.objects().into_iter().find(|o| o.shape != ObjectShape::Mesh).expect("another").name;
    let tool = SceneChange::Add {
        name: "tool".to_owned(),
        shape: ObjectShape::Capsule { radius_m: 0.01, length_m: 0.1 },
        pose: at([0.0, 0.0, 0.2]),
        fixed_to: FixedTo::Tip,
        mass_kg: 0.3,
        replaces: false,
    };
    let changes = [
        ball("ball", [0.1, 1.0 / 3.0, 2.0], 0.1),
        tool,
        SceneChange::Move { name: mesh, pose: at([0.0, 0.0, 5.0]) },
        SceneChange::Remove { name: other },
    ];
    {
        let file = SceneFile::open(&path).expect("a thread");
        for change in changes {
            live.apply(&[change], None).expect("made");
            file.keep(&live);
        }
    }
    let mut again = fresh();
    restore(&mut again, &path).expect("read");
    let sorted = |live: &LiveScene| {
        let mut all = live.objects();
        all.sort_by(|a, b| a.name.cmp(&b.name));
        all
    };
    assert_eq!(sorted(&again), sorted(&live));
    let good = std::fs::read_to_string(&path).expect("written");
    for (from, to, words) in [
        ("version = 1", "version = 2", "version = 2"),
        ("\"tip\"", "\"hand\"", "base or tip"),
        ("mass_kg = 0.3", "mass_kg = nan", "NaN"),
        ("\"capsule\"", "\"cone\"", "cone"),
        ("mass_kg", "mass_g", "mass_g"),
    ] {
        assert!(good.contains(from), "{from} in {good}");
        std::fs::write(&path, good.replacen(from, to, 1)).expect("written");
        let error = restore(&mut fresh(), &path).expect_err("refused").to_string();
        assert!(error.contains(words) && error.contains("scene.toml"), "{to}: {error}");
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}
