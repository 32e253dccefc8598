//! The last pose: what is written when, what is believed at the next start, and how turns are chosen by it.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "a test ends by panicking and may sleep"
)]
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use taustream_arm::last_pose::LastPose;
use taustream_arm::state_dir::{Step, SystemDisk};
use taustream_arm::{Feedback, Settings};
use taustream_messages::{Phase, ReferenceState, Report};
use taustream_motion::MAX_JOINTS;
use taustream_streamer::pose_store::{Directories, PoseRecords, PoseStore};
use taustream_streamer::referencing::{LastPoses, Recorded, Rule};
use taustream_streamer::write_ahead::{self, JointNow, Recorder, Requester, StoreFault};

/// A place for records, gone after the test.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("taustream-pose-{name}-{}", std::process::id())))
    }
    fn store(&self, settings: &Settings, recorder: Recorder) -> PoseRecords {
        let directories = Directories { state: self.0.join("state"), epochs: self.0.join("epochs") };
        PoseRecords::new(settings, directories, Box::new(SystemDisk::default()), recorder)
    }
    fn restore_poses(&self, settings: &Settings) -> LastPoses {
        self.store(settings, write_ahead::pair().1).restore_poses()
    }
    fn file(&self, settings: &Settings) -> PathBuf {
        self.0.join("state").join(LastPose::file_name(&settings.name))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _left_behind = std::fs::remove_dir_all(&self.0);
    }
}

fn settings() -> Settings {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
    Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"))
}

fn report(phase: Phase, energised: u32, at_rad: f64, ms: u64) -> Report {
    Report {
        joint_count: 6,
        phase: phase.code(),
        energised,
        tick: ms,
        time_ns: 1_000_000_000 + ms * 1_000_000,
        measured_rad: [at_rad; MAX_JOINTS],
        multi_turn_offset_rad: [2.5; MAX_JOINTS],
        reference_state: [ReferenceState::Operator.code(); MAX_JOINTS],
        ..Report::default()
    }
}

/// The record after these reports, 100 ms apart, and a request before each whose energised count is above 0.
fn kept(name: &str, settings: &Settings, reports: &[(Phase, u32, f64)]) -> Option<Recorded> {
    let scratch = Scratch::new(name);
    let (mut requester, recorder) = write_ahead::pair();
    let mut store = scratch.store(settings, recorder);
    store.restore_poses();
    let mut under_way = false;
    for (number, (phase, energised, at_rad)) in (0_u64..).zip(reports) {
        if *energised > 0 && !under_way {
            assert_eq!(request(&mut requester, &mut store, *at_rad), Ok(()));
        } else if *energised == 0 && under_way {
            requester.release(number * 100 - 1);
        }
        under_way = *energised > 0;
        store.note(&report(*phase, *energised, *at_rad, number * 100));
    }
    drop(store);
    scratch.restore_poses(settings)[0]
}

fn request(requester: &mut Requester, store: &mut PoseRecords, at_rad: f64) -> Result<(), StoreFault> {
    let joint = JointNow { position_rad: at_rad, offset_rad: 2.5, reference_state: ReferenceState::Operator };
    let number = requester.request(&[joint; MAX_JOINTS]);
    store.serve();
    requester.answer(number).unwrap()
}

#[test]
fn record_at_rest_is_believed_and_one_of_a_motion_is_not() {
    use Phase::{Disabled, Holding, Moving};
    let settings = settings();
    let rest = kept("rest", &settings, &[(Disabled, 0, 0.5); 6]).unwrap();
    assert_eq!(rest, Recorded { position_rad: 0.5, offset_rad: 2.5, at_rest: true });
    // It holds: the next motion would have to wait for the disk if this were called rest.
    let mut moved = vec![(Disabled, 0, 0.5); 6];
    moved.extend([(Holding, 1, 0.5); 6]);
    assert!(!kept("hold", &settings, &moved).unwrap().at_rest);
    moved.push((Moving, 1, 0.5));
    assert!(!kept("moving", &settings, &moved).unwrap().at_rest, "the record of rest was left standing");
    moved.extend([(Disabled, 0, 0.7); 2]);
    assert!(!kept("just-off", &settings, &moved).unwrap().at_rest, "0.1 s is too short to be rest");
    moved.extend([(Disabled, 0, 0.7); 3]);
    let rest = kept("off", &settings, &moved).unwrap();
    assert_eq!((rest.at_rest, rest.position_rad), (true, 0.7));
    let falling: Vec<_> = (0..6).map(|i| (Disabled, 0, 0.1 * f64::from(i))).collect();
    assert!(!kept("falling", &settings, &falling).unwrap().at_rest, "a joint that falls does not rest");
}

#[test]
fn record_of_another_binding_is_not_believed() {
    let settings = settings();
    let scratch = Scratch::new("binding");
    let mut store = scratch.store(&settings, write_ahead::pair().1);
    for ms in [0, 100, 200, 300] {
        store.note(&report(Phase::Disabled, 0, 0.5, ms));
    }
    assert!(scratch.restore_poses(&settings).iter().filter(|joint| joint.is_some()).count() == 6);
    let changes: [fn(&mut Settings); 3] = [
        |s| s.servos[2].sign = -s.servos[2].sign,
        |s| s.servos[2].zero_offset_rad += 1e-9,
        |s| s.servos[2].feedback_range_rad[1] += 0.5,
    ];
    for change in changes {
        let mut other = settings.clone();
        change(&mut other);
        let known: Vec<bool> = scratch.restore_poses(&other).iter().take(6).map(Option::is_some).collect();
        assert_eq!(known, [true, true, false, true, true, true]);
    }
    // A drive that was never used by this record confirms nothing of it.
    let mut other = settings.clone();
    other.servos[2].node_id = 9;
    assert!(scratch.restore_poses(&other).iter().all(Option::is_none));
    // Broken, the file tells nothing of any joint.
    let file = scratch.file(&settings);
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("0.5", "0.6")).unwrap();
    assert!(scratch.restore_poses(&settings).iter().all(Option::is_none));
}

#[test]
fn drive_that_was_switched_off_keeps_its_record() {
    let settings = settings();
    let scratch = Scratch::new("off");
    let mut store = scratch.store(&settings, write_ahead::pair().1);
    for ms in [0, 100, 200, 300] {
        store.note(&report(Phase::Disabled, 0, 0.5, ms));
    }
    let mut gone = report(Phase::Configuring, 0, 0.9, 2_000);
    gone.reference_state = [ReferenceState::NoFeedback.code(); MAX_JOINTS];
    gone.multi_turn_offset_rad = [0.0; MAX_JOINTS];
    store.note(&gone);
    // A reading that has not been renewed says nothing either.
    let mut stale = report(Phase::Disabled, 0, 0.9, 4_000);
    stale.feedback_age_s = [10.0; MAX_JOINTS];
    store.note(&stale);
    let recorded = scratch.restore_poses(&settings)[0].unwrap();
    assert_eq!(recorded, Recorded { position_rad: 0.5, offset_rad: 2.5, at_rest: true });
}

/// A start during which the power goes at once leaves the record of rest as it was.
#[test]
fn record_of_rest_stands_until_motion_is_seen() {
    let settings = settings();
    let scratch = Scratch::new("start");
    let mut store = scratch.store(&settings, write_ahead::pair().1);
    for ms in [0, 100, 200, 300] {
        store.note(&report(Phase::Disabled, 0, 0.5, ms));
    }
    let mut store = scratch.store(&settings, write_ahead::pair().1);
    store.restore_poses();
    store.note(&report(Phase::Disabled, 0, 0.51, 0));
    assert!(scratch.restore_poses(&settings)[0].unwrap().at_rest);
    store.note(&report(Phase::Disabled, 0, 0.55, 100));
    assert!(!scratch.restore_poses(&settings)[0].unwrap().at_rest, "it is being moved by hand");
}

/// The thread does the same: a request is answered, and its answer tells what is wrong with a directory.
#[test]
fn request_is_answered_by_the_thread_with_what_is_wrong() {
    let settings = settings();
    let scratch = Scratch::new("thread");
    let (mut requester, recorder) = write_ahead::pair();
    let pose_store = PoseStore::start(scratch.store(&settings, recorder)).unwrap();
    let joint = JointNow { position_rad: 0.5, offset_rad: 2.5, reference_state: ReferenceState::Operator };
    let ask = |requester: &mut Requester| {
        let number = requester.request(&[joint; MAX_JOINTS]);
        loop {
            if let Some(answer) = requester.answer(number) {
                return answer;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    assert_eq!(ask(&mut requester), Ok(()));
    let open = |bits| {
        std::fs::set_permissions(scratch.0.join("state"), std::fs::Permissions::from_mode(bits)).unwrap();
    };
    open(0o777);
    let fault = ask(&mut requester).unwrap_err();
    assert_eq!(fault.fault.step, Step::Mode);
    let sentence = pose_store.directories().sentence(fault);
    assert!(sentence.contains("chmod") && sentence.contains("/state"), "{sentence}");
    open(0o700);
    std::fs::remove_dir_all(scratch.0.join("epochs")).unwrap();
    std::fs::write(scratch.0.join("epochs"), "in the way").unwrap();
    assert!(pose_store.directories().sentence(ask(&mut requester).unwrap_err()).contains("/epochs"));
    drop(pose_store);
}

/// Random numbers from a numbered seed.
fn random(seed: u64, salt: u64) -> f64 {
    let mut z =
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(salt.wrapping_mul(0xBF58_476D_1CE4_E5B9));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    f64::from(u32::try_from((z ^ (z >> 31)) >> 32).unwrap()) / f64::from(u32::MAX)
}

/// Goal: a joint is never called referenced on a wrong turn: whatever its period, its range, where it truly stands and
/// what its feedback says, as long as it moved less than the rest of half a period since the record.
#[test]
fn offset_that_is_chosen_is_the_true_one_or_none() {
    let mut chosen = [0_u32; 2];
    for seed in 0..200_000 {
        let within = |salt, low: f64, high: f64| low + (high - low) * random(seed, salt);
        let period_rad = 10_f64.powf(within(1, -2.0, 1.5));
        let range_rad = [-within(2, 0.1, 6.0), within(3, 0.1, 6.0)];
        let rule = Rule { feedback: Feedback::Wraps, period_rad, range_rad };
        let true_rad = within(4, range_rad[0], range_rad[1]);
        let turns = within(5, -50.0, 50.0).round();
        let reading_rad = true_rad - turns * period_rad;
        // Moved by hand while all was off, by less than what would bring another turn within reach.
        let recorded_rad = true_rad + within(6, -0.59, 0.59) * period_rad;
        let recorded = Recorded { position_rad: recorded_rad, offset_rad: 0.0, at_rest: true };
        let resolved = rule.resolve(reading_rad, Some(recorded), false);
        if resolved.reference_state.is_referenced() {
            let off_rad = (reading_rad + resolved.offset_rad - true_rad).abs();
            assert!(off_rad < 1e-6 * period_rad.max(1.0), "seed {seed}: {resolved:?} is {off_rad} rad off");
            chosen[0] += 1;
        } else {
            assert!(resolved.offset_rad == 0.0, "seed {seed}: {resolved:?}");
            chosen[1] += 1;
        }
        let blind = rule.resolve(reading_rad, None, false);
        let alone = range_rad[1] - range_rad[0] <= 0.8 * period_rad;
        assert_eq!(blind.reference_state.is_referenced(), alone, "seed {seed}: {blind:?}");
    }
    assert!(chosen.iter().all(|count| *count > 20_000), "{chosen:?}");
}
