//! Services of two arms on one host must not meet, and a wrong name is refused.
use std::sync::atomic::{AtomicU32, Ordering};
use taustream_messages::service::{ServiceError, Wire};
use taustream_messages::{LAYOUT_VERSION, Phase, Report};

static NEXT: AtomicU32 = AtomicU32::new(0);

/// A name that no other test, nor another run at the same time, uses.
fn unique(stem: &str) -> String {
    format!("{stem}-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}

/// In one directory for all of them: what keeps arms apart is their name.
fn join(arm: &str, node: &str) -> Result<Wire, ServiceError> {
    let runtime = std::env::temp_dir().join(format!("taustream-services-{}", std::process::id()));
    let _said_by_join = std::fs::create_dir_all(&runtime);
    Wire::join(arm, node, &runtime)
}

fn report(sequence: u64) -> Report {
    Report {
        layout_version: LAYOUT_VERSION,
        joint_count: 6,
        sequence,
        phase: Phase::Holding.code(),
        ..Report::default()
    }
}

#[test]
fn report_reaches_readers_of_its_arm_only() {
    let (left, right) = (unique("left"), unique("right"));
    let writer = join(&left, "writer").expect("join");
    let same = join(&left, "reader").expect("join");
    let other = join(&right, "reader").expect("join");
    let publisher = writer.report_publisher().expect("publisher");
    let hears = same.report_subscriber().expect("subscriber");
    let deaf = other.report_subscriber().expect("subscriber");

    publisher.send_copy(report(11)).expect("send");

    let heard = hears.receive().expect("receive").expect("one report");
    assert_eq!(heard.sequence, 11);
    assert!(heard.checked().is_some());
    assert!(deaf.receive().expect("receive").is_none(), "a report crossed from one arm to another");
}

#[test]
fn command_service_has_one_server() {
    let arm = unique("twice");
    let first = join(&arm, "first").expect("join");
    let second = join(&arm, "second").expect("join");
    let _server = first.command_server().expect("the first server");
    let error = second.command_server().expect_err("a second server");
    assert!(matches!(error, ServiceError::Refused { .. }), "{error}");
}

#[test]
fn arm_name_that_is_no_file_name_is_refused() {
    for name in ["", "a/b", "..", "x y", "this-name-is-much-longer-than-32-bytes"] {
        let error = join(name, "test").expect_err("a bad name");
        assert!(matches!(error, ServiceError::Name { .. }), "{name}: {error}");
    }
}

#[test]
fn nobody_running_is_said_with_the_cure() {
    let wire = join(&unique("nobody"), "test").expect("join");
    let sentence = wire.not_running("taustream-streamer").to_string();
    assert!(sentence.contains("taustream-streamer of arm `nobody-"), "{sentence}");
    assert!(sentence.contains("start taustream-streamer first"), "{sentence}");
}
