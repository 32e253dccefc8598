//! Services of two arms on one host must not meet, and a wrong name is refused.
#![expect(clippy::expect_used, reason = "helpers of tests fail by panicking")]
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use taustream_messages::event::Topic;
use taustream_messages::files::ArmFiles;
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
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("{stem}-{}-{number}", std::process::id());
        let runtime = std::env::temp_dir().join(format!("taustream-services-{name}"));
        Self::of(name, runtime)
    }

    /// In a directory whose path leaves room for the names of sockets.
    fn in_directory(stem: &str, runtime: PathBuf) -> Self {
        Self::of(format!("{stem}-{}", std::process::id()), runtime)
    }

    fn of(name: String, runtime: PathBuf) -> Self {
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

/// Goal: whoever waits wakes up at once, of its topic only; where the path of a socket would be too long, waits are short sleeps.
#[test]
fn events_wake_who_waits_and_no_other_topic() {
    const LONG: Duration = Duration::from_secs(60);
    const WAIT: Duration = Duration::from_millis(100);
    let arm = Arm::in_directory("e", std::env::temp_dir().join(format!("e{}", std::process::id())));
    let (planner, client) = (arm.join("planner"), arm.join("client"));
    let (mut waits, asks) = (planner.events(Topic::Plan), client.events(Topic::Plan));
    let mut other = planner.events(Topic::Command);
    assert!(waits.are_there() && asks.are_there());
    for _ in 0..1_000 {
        asks.notify();
    }
    let since = Instant::now();
    waits.wait(LONG);
    assert!(since.elapsed() < LONG, "an event before the wait ends it");
    // Those of before are one.
    let since = Instant::now();
    waits.wait(WAIT);
    assert!(since.elapsed() >= WAIT / 2, "woken by nothing after {:?}", since.elapsed());
    let since = Instant::now();
    other.wait(WAIT);
    assert!(since.elapsed() >= WAIT / 2, "woken by another topic");
    drop(waits);
    // Nobody waits any more; nothing fails.
    asks.notify();
}

#[test]
fn without_events_waits_are_short_sleeps() {
    let mut arm = Arm::new("far");
    let deep = arm.runtime.join("x".repeat(60));
    std::fs::create_dir_all(&deep).expect("a directory");
    let top = std::mem::replace(&mut arm.runtime, deep);
    let wire = arm.join("client");
    let mut events = wire.events(Topic::Trajectory);
    assert!(!events.are_there());
    events.notify();
    let since = Instant::now();
    events.wait(Duration::from_secs(60));
    assert!(since.elapsed() < Duration::from_secs(60));
    drop((events, wire));
    arm.runtime = top;
}

#[test]
fn runtime_directory_with_too_long_a_path_is_refused_with_the_numbers() {
    let deep = std::env::temp_dir().join("x".repeat(150));
    std::fs::create_dir_all(&deep).expect("a directory");
    let error = Wire::join("deep", "test", &deep).expect_err("too long a path").to_string();
    assert!(error.contains("at most 255") && error.contains("TAUSTREAM_RUNTIME_DIR"), "{error}");
    let _left = std::fs::remove_dir_all(&deep);
}

/// Everything of an arm in shared memory and below the runtime directory.
fn names_of(arm: &Arm) -> Vec<PathBuf> {
    let mine = format!(".{}.", arm.name);
    let mut found = Vec::new();
    let mut directories = vec![PathBuf::from("/dev/shm"), arm.runtime.clone()];
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
            if entry.path().is_dir() {
                directories.push(entry.path());
            } else if entry.file_name().to_string_lossy().contains(&mine) {
                found.push(entry.path());
            }
        }
    }
    found.sort_unstable();
    found
}

/// Goal: a service that starts clears what is left of its own arm, and nothing of another one in the same runtime directory.
#[test]
fn claim_clears_what_is_left_of_its_arm_and_nothing_of_another() {
    let (dead, mut alive) = (Arm::new("dead"), Arm::new("alive"));
    std::fs::remove_dir_all(&alive.runtime).expect("its own");
    alive.runtime = dead.runtime.clone();
    let wire = alive.join("streamer");
    let publisher = wire.report_publisher().expect("publisher");
    let subscriber = wire.report_subscriber().expect("subscriber");
    let before = names_of(&alive);
    let uid = rustix::process::geteuid().as_raw();
    let left = [
        PathBuf::from(format!("/dev/shm/taustream.{uid}.{}.left_5.data", dead.name)),
        dead.runtime.join(format!("iceoryx2/services/taustream.{uid}.{}.left.service", dead.name)),
        dead.runtime.join(format!("iceoryx2/nodes/12345/taustream.{uid}.{}.node.details", dead.name)),
    ];
    for file in &left {
        std::fs::create_dir_all(file.parent().expect("a directory")).expect("made");
        std::fs::write(file, "spoiled").expect("written");
    }
    let claim = ArmFiles::of(&dead.name, &dead.runtime).claim("streamer").expect("claims");
    assert_eq!(left.iter().filter(|file| file.exists()).count(), 0, "left behind");
    assert!(!dead.runtime.join("iceoryx2/nodes/12345").exists());
    assert_eq!(names_of(&alive), before, "another arm's names were touched");
    let second = ArmFiles::of(&dead.name, &dead.runtime).claim("streamer").expect_err("a second streamer");
    assert!(second.to_string().contains(&std::process::id().to_string()), "{second}");
    drop(claim);
    publisher.send_copy(report(3)).expect("sent");
    assert_eq!(subscriber.receive().expect("received").expect("one report").sequence, 3);
}

/// Goal: names that live are not cleared, and the footprint tells when one of them goes.
#[test]
fn claim_beside_a_living_process_clears_nothing_and_missing_files_are_noticed() {
    let arm = Arm::new("beside");
    let wire = arm.join("planner");
    let _server = wire.plan_server().expect("server");
    let before = names_of(&arm);
    let claim = ArmFiles::of(&arm.name, &arm.runtime).claim("streamer").expect("claims");
    claim.started();
    assert_eq!(names_of(&arm), before);
    let footprint = wire.footprint();
    assert!(footprint.len() >= 6, "{footprint:?}");
    assert_eq!(footprint.missing(), None);
    let path = names_of(&arm).into_iter().find(|path| path.starts_with("/dev/shm")).expect("a segment");
    let bytes = std::fs::read(&path).expect("readable");
    std::fs::remove_file(&path).expect("removed");
    assert_eq!(footprint.missing().map(std::path::Path::to_owned), Some(path.clone()));
    // The same name again is another file.
    std::fs::write(&path, bytes).expect("written");
    assert!(footprint.missing().is_some(), "{}", path.display());
}

/// Goal: names that another user took first are refused at once, with file, owner and remedy. Only root can play that user.
#[test]
fn name_of_another_user_is_refused_at_once_with_file_owner_and_remedy() {
    let uid = rustix::process::geteuid().as_raw();
    let arm = Arm::new("squat");
    let path = PathBuf::from(format!("/dev/shm/taustream.{uid}.{}.0123_node.0_10_0.global_mgmt", arm.name));
    std::fs::write(&path, "").expect("written");
    if uid == 0 {
        std::os::unix::fs::chown(&path, Some(65_534), None).expect("root may");
        let error = Wire::join(&arm.name, "test", &arm.runtime).expect_err("another user's");
        let sentence = error.to_string();
        for word in [path.to_str().expect("text"), "uid 65534", "rm "] {
            assert!(sentence.contains(word), "{sentence}");
        }
    }
    std::fs::remove_file(&path).expect("removed");
    rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, rustix::fs::Mode::RUSR, 0)
        .expect("a pipe");
    let error = Wire::join(&arm.name, "test", &arm.runtime).expect_err("a pipe");
    assert!(error.to_string().contains("a pipe"), "{error}");
}

/// Goal: two services that start at once after both were killed do not clear each other's names: what one of them clears alone is all that
/// a start that did not come to its end has left, whoever's it was.
#[test]
fn mark_of_a_start_that_ended_in_the_middle_goes_with_the_names_it_speaks_of() {
    let arm = Arm::new("both");
    let files = ArmFiles::of(&arm.name, &arm.runtime);
    // Killed soon after their starts: both marks stay.
    for service in ["streamer", "planner"] {
        std::fs::write(arm.runtime.join(format!("{}.{service}.starting", arm.name)), "").expect("written");
    }
    let planner = files.claim("planner").expect("claims");
    let wire = arm.join("planner");
    let _server = wire.plan_server().expect("server");
    let footprint = wire.footprint();
    let streamer = files.claim("streamer").expect("claims");
    assert_eq!(footprint.missing(), None, "the streamer's start has cleared the planner's names");
    drop((planner, streamer));
}

/// Goal: names are not cleared while another process is about to open its services.
#[test]
fn clearing_waits_for_services_that_are_being_opened() {
    let arm = Arm::new("opening");
    let files = ArmFiles::of(&arm.name, &arm.runtime);
    let opening = files.opening().expect("lock");
    let wire = arm.join("planner");
    let _server = wire.plan_server().expect("server");
    let footprint = wire.footprint();
    let clears = std::thread::spawn(move || files.clear());
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(footprint.missing(), None, "cleared in the middle of it");
    drop(opening);
    clears.join().expect("no panic");
    assert!(footprint.missing().is_some(), "not cleared at all");
}

/// Goal: a second port of a service survives that somebody has deleted the service's files since the first one was opened (iceoryx2 ends the
/// process when it makes a service whose first share it still holds).
#[test]
fn second_port_of_a_service_whose_files_were_deleted_is_no_panic() {
    let arm = Arm::new("again");
    let wire = arm.join("planner");
    let subscriber = wire.report_subscriber().expect("subscriber");
    ArmFiles::of(&arm.name, &arm.runtime).clear();
    let publisher = wire.report_publisher();
    if let Ok(publisher) = publisher {
        publisher.send_copy(report(5)).expect("sent");
    }
    assert!(subscriber.receive().is_ok());
}
