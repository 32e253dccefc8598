//! Services of two arms on one host must not meet, and a wrong name is refused.
#![expect(clippy::expect_used, reason = "helpers of tests fail by panicking")]
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use taustream_messages::service::{ServiceError, Wire};
use taustream_messages::{LAYOUT_VERSION, Phase, Report};

static NEXT: AtomicU32 = AtomicU32::new(0);

/// An arm that no other test, nor another run at the same time, uses; iceoryx2 leaves a file of each arm in /dev/shm
/// and directories below the root, and they go with this.
struct Arm {
    name: String,
    runtime: PathBuf,
}

impl Arm {
    fn new(stem: &str) -> Self {
        let name = format!("{stem}-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let runtime = std::env::temp_dir().join(format!("taustream-services-{name}"));
        let _said_by_join = std::fs::create_dir_all(&runtime);
        Self { name, runtime }
    }

    fn join(&self, node: &str) -> Wire {
        Wire::join(&self.name, node, &self.runtime).expect("join")
    }
}

impl Drop for Arm {
    fn drop(&mut self) {
        let _left = std::fs::remove_dir_all(&self.runtime);
        let mine = format!(".{}.", self.name);
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().contains(&mine) {
                let _left = std::fs::remove_file(entry.path());
            }
        }
    }
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
    let (left, right) = (Arm::new("left"), Arm::new("right"));
    let (writer, same, other) = (left.join("writer"), left.join("reader"), right.join("reader"));
    let publisher = writer.report_publisher().expect("publisher");
    let hears = same.report_subscriber().expect("subscriber");
    let deaf = other.report_subscriber().expect("subscriber");

    publisher.send_copy(report(11)).expect("send");

    let received = hears.receive().expect("receive").expect("one report");
    assert_eq!(received.sequence, 11);
    assert!(received.checked().is_some());
    assert!(deaf.receive().expect("receive").is_none(), "a report crossed from one arm to another");
}

#[test]
fn command_service_has_one_server() {
    let arm = Arm::new("twice");
    let (first, second) = (arm.join("first"), arm.join("second"));
    let _server = first.command_server().expect("the first server");
    let error = second.command_server().expect_err("a second server");
    assert!(matches!(error, ServiceError::Refused { .. }), "{error}");
}

#[test]
fn arm_name_that_is_no_file_name_is_refused() {
    for name in ["", "a/b", "..", "x y", "this-name-is-much-longer-than-32-bytes"] {
        let error = Wire::join(name, "test", &std::env::temp_dir()).expect_err("a bad name");
        assert!(matches!(error, ServiceError::Name { .. }), "{name}: {error}");
    }
}

#[test]
fn no_running_process_is_reported_with_the_remedy() {
    let arm = Arm::new("nobody");
    let wire = arm.join("test");
    let sentence = wire.not_running("taustream-streamer").to_string();
    assert!(sentence.contains("taustream-streamer of arm `nobody-"), "{sentence}");
    assert!(sentence.contains("start taustream-streamer first"), "{sentence}");
}

/// Goal: a 25th reader gets the reason, and the 24 before it continue.
#[test]
fn readers_of_reports_beyond_the_maximum_are_refused_with_the_number_and_the_remedy() {
    let arm = Arm::new("crowd");
    let writer = arm.join("writer");
    let publisher = writer.report_publisher().expect("publisher");
    let reader = arm.join("reader");
    let readers: Vec<_> = (0..24).map(|_| reader.report_subscriber().expect("one of 24 readers")).collect();
    let error = reader.report_subscriber().expect_err("a 25th reader").to_string();
    assert!(error.contains("24") && error.contains("end one"), "{error}");
    publisher.send_copy(report(5)).expect("send");
    assert!(readers.iter().all(|r| r.receive().expect("receive").is_some()));
}
