//! Points that a camera saw.
use super::common::pose;
use super::played::{Played, TO, at, empty, on_the_way, wait_until_rest, with_service};
use taustream_messages::cloud::CheckedCloud;
use taustream_messages::plan::PlanOutcome;
use taustream_messages::scene::ObjectShape;
use taustream_messages::scene_reply::{MotionEffect, SceneOutcome};

/// A sheet of points, which stands around the tip half way from left to right.
fn seen() -> CheckedCloud {
    let side = |i: usize| (i as f64 - 4.5) * 0.02;
    let sheet = (0..100).map(|i| [side(i % 10), side(i / 10), 0.0]).chain([[f64::NAN; 3]]).collect();
    CheckedCloud {
        name: "seen".to_owned(),
        pose: at(on_the_way(0.0)),
        point_radius_m: 0.012,
        points_m: sheet,
        replaces: true,
    }
}

/// Goal: points that a camera saw count in plans as any obstacle does, and a later message takes the place of an earlier one.
#[test]
fn points_of_a_message_count_in_plans_and_are_replaced_by_later_ones() {
    let played = Played::default();
    with_service("cloud", &empty(), &played, |asker| {
        let mut seen = seen();
        let outcome = asker.cloud(&seen);
        assert!(matches!(outcome, SceneOutcome::Changed { total: 1, .. }), "{outcome:?}");
        let mut half_way = TO;
        half_way[0] = 0.0;
        let PlanOutcome::Failed { reason } = asker.go(pose(half_way)) else { panic!("into the points") };
        assert!(reason.contains("seen"), "{reason}");
        let listed = asker.objects().pop().expect("one object");
        assert_eq!((listed.name.as_str(), listed.shape), ("seen", ObjectShape::Cloud));

        seen.pose = at([0.0, 0.0, 3.0]);
        let outcome = asker.cloud(&seen);
        assert!(matches!(outcome, SceneOutcome::Changed { total: 1, .. }), "{outcome:?}");
        let PlanOutcome::Planned { .. } = asker.go(pose(half_way)) else { panic!("the points have gone") };

        let refused = |cloud: &CheckedCloud| match asker.cloud(cloud) {
            SceneOutcome::Refused { reason } => reason,
            outcome @ (SceneOutcome::Listed { .. } | SceneOutcome::Changed { .. }) => panic!("{outcome:?}"),
        };
        seen.replaces = false;
        assert!(refused(&seen).contains("already"));
        seen.replaces = true;
        seen.points_m = vec![[f64::NAN; 3]; 4];
        assert!(refused(&seen).contains("no point"), "{}", refused(&seen));
        seen.points_m = vec![[0.0, 0.0, 2e3]];
        assert!(refused(&seen).contains("2000"), "{}", refused(&seen));
    });
}

/// Goal: points that come in the way of a motion that runs lead the arm another way, or stop it before them.
#[test]
fn points_in_the_way_of_what_runs_lead_the_arm_round_or_stop_it() {
    let played = Played::default();
    with_service("cloud-in-motion", &empty(), &played, |asker| {
        let PlanOutcome::Planned { .. } = asker.go(pose(TO)) else { panic!("no plan") };
        let SceneOutcome::Changed { effect, note, .. } = asker.cloud(&seen()) else { panic!("refused") };
        assert!(
            matches!(effect, MotionEffect::Rerouted { .. } | MotionEffect::Stopped),
            "{effect:?}: {note}"
        );
        assert!(note.contains("seen"), "{note}");
        wait_until_rest(&played);
    });
}
