//! The last pose: what is written when, what is believed at the next start, and how turns are chosen by it.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "a test ends by panicking and may sleep"
)]
use std::path::{Path, PathBuf};
use taustream_arm::last_pose::LastPose;
use taustream_arm::{Feedback, Settings};
use taustream_messages::{Phase, ReferenceState, Report};
use taustream_motion::MAX_JOINTS;
use taustream_streamer::pose_store::{PoseStore, restore_poses};
use taustream_streamer::referencing::{Recorded, Rule};

struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("taustream-memory-{name}-{}", std::process::id())))
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
        time_ns: 1_000_000_000 + ms * 1_000_000,
        measured_rad: [at_rad; MAX_JOINTS],
        multi_turn_offset_rad: [2.5; MAX_JOINTS],
        reference_state: [ReferenceState::Encoder.code(); MAX_JOINTS],
        ..Report::default()
    }
}

/// The record after these reports, 100 ms apart.
fn kept(name: &str, settings: &Settings, reports: &[(Phase, u32, f64)]) -> Option<Recorded> {
    let scratch = Scratch::new(name);
    let mut pose_store = PoseStore::start(settings, scratch.0.clone()).unwrap();
    for (number, (phase, energised, at_rad)) in (0_u64..).zip(reports) {
        pose_store.note(&report(*phase, *energised, *at_rad, number * 100));
        // The writer takes one record at a time.
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    drop(pose_store);
    restore_poses(settings, &scratch.0)[0]
}

#[test]
fn record_at_rest_is_believed_and_one_of_a_motion_is_not() {
    use Phase::{Disabled, Holding, Moving};
    let settings = settings();
    let rest = kept("rest", &settings, &[(Disabled, 0, 0.5); 6]).unwrap();
    assert_eq!(rest, Recorded { position_rad: 0.5, offset_rad: 2.5, at_rest: true });
    // It holds, and may lose torque where it is: the power may be cut.
    assert!(kept("hold", &settings, &[(Holding, 1, 0.5); 6]).unwrap().at_rest);
    let mut falls = settings.clone();
    falls.servos[0].limp_is_safe = false;
    assert!(!kept("falls", &falls, &[(Holding, 1, 0.5); 6]).unwrap().at_rest);
    let mut moved = vec![(Holding, 1, 0.5); 6];
    moved.push((Moving, 1, 0.5));
    assert!(!kept("moving", &settings, &moved).unwrap().at_rest, "the record of the hold was left standing");
    let falling: Vec<_> = (0..6).map(|i| (Disabled, 0, 0.1 * f64::from(i))).collect();
    assert!(!kept("falling", &settings, &falling).unwrap().at_rest, "a joint that falls does not rest");
}

#[test]
fn record_of_another_binding_is_not_believed() {
    let settings = settings();
    let scratch = Scratch::new("binding");
    let mut pose_store = PoseStore::start(&settings, scratch.0.clone()).unwrap();
    pose_store.note(&report(Phase::Disabled, 0, 0.5, 0));
    drop(pose_store);
    assert!(restore_poses(&settings, &scratch.0).iter().filter(|joint| joint.is_some()).count() == 6);
    let changes: [fn(&mut Settings); 4] = [
        |s| s.servos[2].sign = -s.servos[2].sign,
        |s| s.servos[2].zero_offset_rad += 1e-9,
        |s| s.servos[2].node_id = 9,
        |s| s.servos[2].feedback_range_rad[1] += 0.5,
    ];
    for change in changes {
        let mut other = settings.clone();
        change(&mut other);
        let known: Vec<bool> =
            restore_poses(&other, &scratch.0).iter().take(6).map(Option::is_some).collect();
        assert_eq!(known, [true, true, false, true, true, true]);
    }
    // Broken, the file tells nothing of any joint.
    let file = LastPose::file(&scratch.0, &settings.name);
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("0.5", "0.6")).unwrap();
    assert!(restore_poses(&settings, &scratch.0).iter().all(Option::is_none));
}

#[test]
fn drive_that_was_switched_off_keeps_its_record() {
    let settings = settings();
    let scratch = Scratch::new("off");
    let mut pose_store = PoseStore::start(&settings, scratch.0.clone()).unwrap();
    for ms in [0, 100, 200, 300] {
        pose_store.note(&report(Phase::Disabled, 0, 0.5, ms));
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let mut gone = report(Phase::Configuring, 0, 0.5, 2_000);
    gone.reference_state = [ReferenceState::NoFeedback.code(); MAX_JOINTS];
    gone.multi_turn_offset_rad = [0.0; MAX_JOINTS];
    pose_store.note(&gone);
    drop(pose_store);
    let recorded = restore_poses(&settings, &scratch.0)[0].unwrap();
    assert_eq!(recorded, Recorded { position_rad: 0.5, offset_rad: 2.5, at_rest: true });
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
