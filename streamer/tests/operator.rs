//! An operator can always stop: with a log that nobody reads, a disk that hangs, names that vanish, files that are spoiled.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "tests beside real processes wait, and fail by panicking"
)]
mod live;

use live::{Arm, GIVEN_UP_AFTER, Operator};
use rustix::pipe::{PipeFlags, fcntl_setpipe_size, pipe_with};
use rustix::process::Signal;
use std::fs::{self, OpenOptions};
use std::path::PathBuf;
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};
use taustream_messages::{Command, Outcome, Phase, Rejection};

/// Goal: `stop` is answered in motion while nobody reads the log. Method: a stderr pipe of 4 KiB whose reader has stopped, and more
/// commands than fill it; every one of them must be answered, and the stop must stop the arm.
#[test]
fn stop_with_a_log_that_nobody_reads_stops_the_moving_arm() {
    let arm = Arm::new("unread");
    let (_stopped_reader, stderr) = pipe_with(PipeFlags::CLOEXEC).unwrap();
    fcntl_setpipe_size(&stderr, 4096).unwrap();
    let mut streamer = arm.streamer(&[], Stdio::from(stderr));
    let mut operator = Operator::of(&arm);
    operator.set_out(&arm);
    for n in 0..120 {
        // Each one words another line, so that no count takes their place; that too many ramps are refused is no matter.
        let percent = 60.0 + f64::from(n) / 7.0;
        assert!(!operator.command(Command::Speed { percent }).text().is_empty());
    }
    assert!(operator.command(Command::Stop).is_accepted());
    operator.until(Phase::Holding);
    assert!(streamer.is_alive());
}

/// Goal: a disk that hangs delays neither a stop nor the end. Method: the cycle log goes into a pipe that is full for ever, which is what a hung
/// disk looks like to its writer.
#[test]
fn stop_with_a_disk_that_hangs_stops_the_moving_arm() {
    let arm = Arm::new("disk");
    let log = arm.root.join("cycle.log");
    rustix::fs::mknodat(
        rustix::fs::CWD,
        &log,
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR,
        0,
    )
    .unwrap();
    let reader = OpenOptions::new().read(true).write(true).open(&log).unwrap();
    fcntl_setpipe_size(&reader, 4096).unwrap();
    let errors = arm.root.join("stderr");
    let stderr = Stdio::from(fs::File::create(&errors).unwrap());
    let mut streamer = arm.streamer(&["--cycle-log", log.to_str().unwrap()], stderr);
    let mut operator = Operator::of(&arm);
    operator.set_out(&arm);
    thread::sleep(Duration::from_millis(300));
    assert!(operator.command(Command::Stop).is_accepted());
    operator.until(Phase::Holding);

    // It ends all the same, and says which file is not whole.
    streamer.signal(Signal::TERM);
    let since = Instant::now();
    while streamer.is_alive() {
        assert!(since.elapsed() < GIVEN_UP_AFTER, "the streamer waits for its cycle log for ever");
        thread::sleep(Duration::from_millis(20));
    }
    let said = fs::read_to_string(&errors).unwrap();
    assert!(said.contains(&format!("cycle log {}: a write has not returned", log.display())), "{said}");
}

/// Goal: names in shared memory vanish in motion, and the arm is stopped all the same; then the services are open again.
#[test]
fn stop_after_all_segments_were_deleted_comes_by_the_socket_and_services_come_back() {
    let arm = Arm::new("segments");
    let _streamer = arm.streamer(&[], Stdio::null());
    let mut operator = Operator::of(&arm);
    operator.set_out(&arm);
    for segment in arm.segments() {
        fs::remove_file(segment).unwrap();
    }
    assert!(arm.by_socket("stop", false).is_accepted());
    arm.until_phase_by_socket(Phase::Holding);
    drop(operator);
    let since = Instant::now();
    while arm.segments().iter().filter(|path| path.extension().is_some_and(|e| e == "data")).count() < 3 {
        assert!(since.elapsed() < GIVEN_UP_AFTER, "the services did not come back");
        thread::sleep(Duration::from_millis(20));
    }
    Operator::of(&arm).until(Phase::Holding);
}

/// Goal: the same with the whole runtime directory, sockets included: the abstract name is left.
#[test]
fn stop_after_the_runtime_directory_was_deleted_comes_by_the_abstract_name() {
    let arm = Arm::new("directory");
    let _streamer = arm.streamer(&[], Stdio::null());
    let mut operator = Operator::of(&arm);
    operator.set_out(&arm);
    fs::remove_dir_all(&arm.runtime).unwrap();
    let reply = arm.by_socket("stop --fast", true);
    assert!(reply.is_accepted(), "{}", reply.text());
    arm.until_phase_by_socket(Phase::Fault);
    let since = Instant::now();
    while !taustream_messages::operator::socket_file(&arm.name, &arm.runtime).exists() {
        assert!(since.elapsed() < GIVEN_UP_AFTER, "the socket did not come back");
        thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(arm.by_socket("phase", false).phase(), Some(Phase::Fault));
}

/// Goal: what comes by the socket is a stop or nothing, and hostile clients do not keep others out.
#[test]
fn socket_takes_stops_only_and_outlives_hostile_clients() {
    use std::io::Write;
    use std::os::unix::net::UnixStream;
    let arm = Arm::new("hostile");
    let mut streamer = arm.streamer(&[], Stdio::null());
    let operator = Operator::of(&arm);
    operator.enable();
    for request in ["enable", "resume", "speed 100", "STOP", "", "stop\u{0}"] {
        let reply = arm.by_socket(request, true);
        assert!(!reply.is_accepted() && reply.text().contains("torque-off"), "{request:?}: {}", reply.text());
    }
    let path = taustream_messages::operator::socket_file(&arm.name, &arm.runtime);
    let idle: Vec<UnixStream> = (0..40)
        .map(|n| {
            let mut stream = UnixStream::connect(&path).unwrap();
            let _cut_off = stream.write_all(&vec![b'x'; n * 50]);
            stream
        })
        .collect();
    let since = Instant::now();
    // Places become free as idle clients are dropped.
    loop {
        if arm.try_by_socket("torque-off", true).is_some_and(|reply| reply.is_accepted()) {
            break;
        }
        assert!(since.elapsed() < GIVEN_UP_AFTER, "kept out for ever");
        thread::sleep(Duration::from_millis(100));
    }
    drop(idle);
    arm.until_phase_by_socket(Phase::Fault);
    assert!(streamer.is_alive());
}

/// Every file that the arm has now: segments, and what stands below iceoryx2/ in the runtime directory; locks and markers too.
fn files(arm: &Arm) -> Vec<PathBuf> {
    let mut found = arm.segments();
    let mut directories = vec![arm.runtime.clone()];
    while let Some(directory) = directories.pop() {
        for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() && !path.ends_with("links") {
                directories.push(path);
            } else if path.is_file() {
                found.push(path);
            }
        }
    }
    found
}

/// The kind of a file: what stands behind the last dot of its name.
fn kind(path: &std::path::Path) -> String {
    path.extension().map_or_else(String::new, |e| e.to_string_lossy().into_owned())
}

/// Spoils a file.
type Spoil = fn(&std::path::Path);

/// Goal: whatever was done to the files of a streamer that was killed, the next one comes up and leaves nothing behind. Method:
/// every kind of file is deleted, truncated and overwritten, each before a kill and a start.
#[test]
fn start_after_any_kind_of_file_was_spoiled_and_a_kill_comes_up_and_leaves_no_segments() {
    let arm = Arm::new("spoiled");
    let mut streamer = arm.streamer(&[], Stdio::null());
    let mut kinds: Vec<String> = files(&arm).iter().map(|path| kind(path)).collect();
    kinds.sort_unstable();
    kinds.dedup();
    assert!(kinds.len() >= 8, "{kinds:?}");
    let whole = arm.segments().len();
    let ways: [(&str, Spoil); 3] = [
        ("delete", |path| drop(fs::remove_file(path))),
        ("truncate", |path| drop(OpenOptions::new().write(true).truncate(true).open(path))),
        ("overwrite", |path| {
            let length =
                fs::metadata(path).map_or(64, |found| usize::try_from(found.len()).unwrap_or(64)).max(64);
            // In place, as a stray writer would.
            let mut file = OpenOptions::new().write(true).open(path).unwrap();
            let noise: Vec<u8> =
                (0..length).map(|n| u8::try_from((n * 131 + 7) % 251).unwrap_or(0)).collect();
            let _refused = std::io::Write::write_all(&mut file, &noise);
        }),
    ];
    for kind_of_file in &kinds {
        for (way, spoil) in ways {
            // First killed: a process that is killed while its memory is being spoiled may die by it, which is another matter.
            streamer.kill();
            for path in files(&arm).iter().filter(|path| kind(path) == *kind_of_file) {
                spoil(path);
            }
            streamer = arm.streamer(&[], Stdio::null());
            assert!(
                arm.segments().len() <= whole,
                "{way} {kind_of_file}: {} segments instead of {whole}",
                arm.segments().len()
            );
            assert!(streamer.is_alive(), "{way} {kind_of_file}");
        }
    }
    let operator = Operator::of(&arm);
    operator.phase();
    drop(operator);
    streamer.signal(Signal::TERM);
    let since = Instant::now();
    while streamer.is_alive() {
        assert!(since.elapsed() < GIVEN_UP_AFTER);
        thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(arm.segments(), Vec::<PathBuf>::new(), "left behind");
}

/// Goal: what its sender has given up is not carried out later. Method: the streamer is stopped by the kernel; a command, and a
/// motion, are sent and given up; then it continues.
#[test]
fn commands_and_motions_that_were_given_up_are_not_carried_out_later() {
    let arm = Arm::new("late");
    let streamer = arm.streamer(&[], Stdio::null());
    let operator = Operator::of(&arm);
    operator.until(Phase::Disabled);
    streamer.signal(Signal::STOP);
    assert!(operator.try_command(Command::Enable, Duration::from_millis(200)).is_none());
    thread::sleep(Duration::from_millis(300));
    streamer.signal(Signal::CONT);
    for _ in 0..50 {
        assert!(matches!(operator.phase(), Phase::Disabled | Phase::Configuring | Phase::Fault));
    }
}

#[test]
fn motion_that_was_given_up_is_rejected_as_too_late() {
    let arm = Arm::new("too-late");
    let _streamer = arm.streamer(&[], Stdio::null());
    let operator = Operator::of(&arm);
    operator.enable();
    let outcome = operator.send(&arm, 1, Duration::ZERO);
    assert!(matches!(outcome, Outcome::Rejected(Rejection::TooLate { .. })), "{outcome:?}");
    assert_eq!(operator.phase(), Phase::Holding);
}

/// Goal: no number is the last. 2^64 - 1, and then 1, as a planner sends it.
#[test]
fn generation_of_all_ones_locks_nobody_out() {
    let arm = Arm::new("generation");
    let _streamer = arm.streamer(&[], Stdio::null());
    let operator = Operator::of(&arm);
    operator.enable();
    let outcome = operator.send(&arm, u64::MAX, GIVEN_UP_AFTER);
    assert!(matches!(outcome, Outcome::Rejected(Rejection::StaleGeneration { .. })), "{outcome:?}");
    for generation in [1, (1 << 63) - 1, u64::MAX - 5, 3] {
        let outcome = operator.send(&arm, generation, GIVEN_UP_AFTER);
        assert!(matches!(outcome, Outcome::Accepted { .. }), "{generation}: {outcome:?}");
        assert!(operator.command(Command::Stop).is_accepted());
        operator.until(Phase::Holding);
    }
}
