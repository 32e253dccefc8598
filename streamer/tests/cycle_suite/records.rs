//! What is believed at the next start, whatever the disk did and whenever the power was cut: the true revolution or none.
#[path = "fake_disk.rs"]
mod fake_disk;

use crate::harness::{CycleHarness, HOME_RAD, JOINTS, PERIOD_NS, shipped_settings};
use fake_disk::{EIO, ENOSPC, EROFS, FakeDisk, Plan};
use std::sync::mpsc::channel;
use std::time::Duration;
use taustream_arm::{Feedback, Settings};
use taustream_drivers::{DriveState, DriveTarget};
use taustream_messages::{Command, Phase, ReferenceState};
use taustream_motion::{MAX_JOINTS, Stroke, Trajectory};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::intake::Shutdown;
use taustream_streamer::names::Names;
use taustream_streamer::pose_store::{Directories, NotFinished, PoseRecords, PoseStore};
use taustream_streamer::write_ahead::{self, JointNow};

/// The feedback of joint 1 repeats itself this often, and its range holds many of them.
const PERIOD_RAD: f64 = 0.2;

fn settings() -> Settings {
    let mut settings = shipped_settings();
    settings.servos[0].feedback = Feedback::Wraps;
    settings.servos[0].feedback_range_rad = [0.0, PERIOD_RAD];
    settings
}

/// Random numbers from a numbered seed.
struct Rng(u64);

impl Rng {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % count
    }
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(u32::try_from(self.below(1 << 20)).unwrap()) / f64::from(1 << 20)
    }
}

/// A computer and an arm through several starts.
struct Story {
    disk: FakeDisk,
    truth_rad: f64,
    /// Whole periods that the drive counts beside the truth since it was switched on.
    counted_beside: f64,
    state: &'static str,
}

impl Story {
    fn new() -> Self {
        Self { disk: FakeDisk::new(), truth_rad: 0.0, counted_beside: 3.0, state: "/a" }
    }

    /// Starts a streamer; what it believes once the drives answer is checked.
    fn start(&mut self, plan: Plan, note: &str) -> CycleHarness {
        self.disk.begin(plan);
        let mut harness = CycleHarness::with(settings());
        let directories = Directories { state: self.state.into(), epochs: "/epochs".into() };
        let (requester, recorder) = write_ahead::pair();
        let disk = Box::new(self.disk.clone());
        harness.keep(PoseRecords::new(&settings(), directories, disk, recorder), requester);
        let (truth_rad, revolution_rad) = (self.truth_rad, self.counted_beside * PERIOD_RAD);
        harness.script(|w| {
            let mut pose_rad = HOME_RAD;
            pose_rad[0] = truth_rad;
            w.pipeline = [pose_rad; 3];
            w.revolution_rad[0] = revolution_rad;
        });
        harness.run_until(Phase::Disabled, 60);
        harness.run(60);
        check_belief(&harness, truth_rad, note);
        harness
    }

    /// The power goes: the computer's, the drives', or a falling arm's.
    fn cut(&mut self, harness: CycleHarness, rng: &mut Rng) {
        let (truth_rad, energised) = {
            let world = harness.world.lock().unwrap();
            let energised = world.drive_target == Some(DriveTarget::Enabled)
                || world.states.iter().any(|s| matches!(s, DriveState::Enabled | DriveState::Enabling));
            (world.pipeline[0][0], energised)
        };
        drop(harness);
        let by_rad = if energised { rng.within(-0.5, 0.5) } else { rng.within(-0.05, 0.05) };
        self.truth_rad = (truth_rad + by_rad).clamp(-2.5, 2.5);
        self.counted_beside = (rng.within(-5.0, 5.0)).round();
        self.disk.crash(&mut |count| rng.below(count));
    }
}

fn reference_state(harness: &CycleHarness) -> ReferenceState {
    harness.core.supervisor().referencing().resolved(0).reference_state
}

fn check_belief(harness: &CycleHarness, truth_rad: f64, note: &str) {
    let resolved = harness.core.supervisor().referencing().resolved(0);
    if resolved.reference_state.is_referenced() {
        let beside_rad = harness.world.lock().unwrap().revolution_rad[0];
        let off_rad = (resolved.offset_rad - beside_rad).abs();
        assert!(off_rad < 1e-9, "{note}: {off_rad} rad off at {truth_rad}, {resolved:?}");
    }
}

fn reference(harness: &mut CycleHarness) -> bool {
    let at_rad = harness.world.lock().unwrap().pipeline[0][0];
    harness.ask_and_wait(Command::Reference { joint: 0, at_rad }).accepted
}

fn movement(harness: &CycleHarness, by_rad: f64) -> Trajectory {
    let base_rad = harness.world.lock().unwrap().pipeline[0];
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[0] = by_rad;
    Trajectory::new(JOINTS, base_rad, &[Stroke { start_s: 0.0, duration_s: 1.0, n: 6, delta_rad }]).unwrap()
}

/// References if needed, enables, moves by several periods, stops, rests; ends early when the power is cut.
fn work(harness: &mut CycleHarness, rng: &mut Rng, disk: &FakeDisk) {
    let ends = rng.below(2_200);
    let until = harness.tick + u64::try_from(ends).unwrap();
    let over = |harness: &CycleHarness| disk.is_dead() || harness.tick >= until;
    if !reference_state(harness).is_referenced() && !reference(harness) || over(harness) {
        return;
    }
    harness.run(u64::try_from(rng.below(400)).unwrap());
    if over(harness) || !harness.ask_and_wait(Command::Enable).accepted {
        return;
    }
    let mut ask = rng.below(3);
    let by_rad = rng.within(-0.6, 0.6);
    while !over(harness) {
        match (harness.phase(), ask) {
            (Phase::Holding, 0..2) => {
                assert!(matches!(harness.offer(movement(harness, by_rad)), Decision::Accepted { .. }));
                ask += 1;
            }
            (Phase::Holding, _) => assert!(harness.ask_and_wait(Command::Disable).accepted),
            _ => drop(harness.step_after(1)),
        }
    }
}

/// Goal: for every operation of the disk, every fault of it and a power cut at it, what is believed at every later start is
/// the true revolution or nothing.
/// Method: lives of a computer with one planned fault, in one or two state directories; what was not synced is lost in
/// part; the drives count from another period after every cut, and an energised arm falls.
#[test]
fn revolution_that_is_believed_after_any_fault_and_any_power_cut_is_the_true_one() {
    let mut believed = [0_u32; 2];
    let plans =
        |at| [Plan::Well, Plan::Once(at, EIO), Plan::From(at, ENOSPC), Plan::From(at, EROFS), Plan::Cut(at)];
    for seed in 0..200_u64 {
        let mut rng = Rng(seed ^ 0x9E37_79B9_7F4A_7C15);
        rng.below(2);
        let mut story = Story::new();
        for life in 0..4 {
            story.state = if rng.below(4) == 0 { "/b" } else { "/a" };
            // The second life goes through every fault of every operation; the others are as they come.
            let drawn = (u64::try_from(rng.below(40)).unwrap(), rng.below(5));
            let (at, kind) = if life == 1 { (seed % 40, usize::try_from(seed / 40).unwrap()) } else { drawn };
            let plan = plans(at)[kind];
            let note = format!("seed {seed}, life {life}, {plan:?}, {}", story.state);
            let mut harness = story.start(plan, &note);
            harness.store_every = [1, 1, 7, 90][rng.below(4)];
            believed[usize::from(reference_state(&harness).is_referenced())] += u32::from(life > 0);
            let disk = story.disk.clone();
            work(&mut harness, &mut rng, &disk);
            check_belief(&harness, story.truth_rad, &note);
            story.cut(harness, &mut rng);
        }
    }
    assert!(believed.iter().all(|count| *count > 40), "not believed, believed: {believed:?}");
}

/// A record of rest is on the disk; the arm is then used with the disk as `plan` makes it, and everything loses its power.
fn used_after_rest(plan: Plan) -> (bool, String, ReferenceState) {
    let (mut story, mut rng) = (Story::new(), Rng(1));
    let mut harness = story.start(Plan::Well, "first");
    assert!(reference(&mut harness));
    harness.run(400);
    story.disk.change_plan(plan);
    let answer = harness.ask_and_wait(Command::Enable);
    if answer.accepted {
        harness.run_until(Phase::Holding, 100);
        assert!(matches!(harness.offer(movement(&harness, 0.45)), Decision::Accepted { .. }));
        harness.run_until(Phase::Holding, 2_000);
    }
    let sentence = answer.why.sentence(&Names { directories: directories(), ..Names::of(&settings()) });
    story.cut(harness, &mut rng);
    let harness = story.start(Plan::Well, "second");
    (answer.accepted, sentence, reference_state(&harness))
}

fn directories() -> Directories {
    Directories { state: "/a".into(), epochs: "/epochs".into() }
}

#[test]
fn enable_is_refused_while_the_disk_does_not_take_the_record_that_says_so() {
    for (errno, words) in [(ENOSPC, "No space left"), (EROFS, "Read-only"), (EIO, "Input/output error")] {
        let (accepted, sentence, after) = used_after_rest(Plan::From(0, errno));
        assert!(
            !accepted && sentence.contains(words) && sentence.contains("state directory /a"),
            "{sentence}"
        );
        assert_eq!(after, ReferenceState::Record, "nothing has moved, and the record of rest still tells so");
    }
    let (accepted, sentence, after) = used_after_rest(Plan::Well);
    assert!(accepted, "{sentence}");
    assert_eq!(after, ReferenceState::RecordMoving, "the power was cut while the drives were energised");
}

#[test]
fn arm_that_was_used_from_another_state_directory_is_not_referenced_by_the_older_record() {
    let (mut story, mut rng) = (Story::new(), Rng(2));
    let mut harness = story.start(Plan::Well, "a");
    assert!(reference(&mut harness));
    harness.run(400);
    story.cut(harness, &mut rng);
    // Looking does no harm.
    story.state = "/b";
    let mut harness = story.start(Plan::Well, "b looks");
    assert_eq!(reference_state(&harness), ReferenceState::NoRecord);
    harness.run(500);
    story.cut(harness, &mut rng);
    story.state = "/a";
    let harness = story.start(Plan::Well, "a again");
    assert_eq!(reference_state(&harness), ReferenceState::Record);
    story.cut(harness, &mut rng);

    story.state = "/b";
    let mut harness = story.start(Plan::Well, "b works");
    assert!(reference(&mut harness));
    harness.run(400);
    assert!(harness.ask_and_wait(Command::Enable).accepted);
    harness.run_until(Phase::Holding, 100);
    assert!(matches!(harness.offer(movement(&harness, 0.45)), Decision::Accepted { .. }));
    harness.run_until(Phase::Holding, 2_000);
    assert!(harness.ask_and_wait(Command::Disable).accepted);
    harness.run(500);
    story.cut(harness, &mut rng);
    let harness = story.start(Plan::Well, "b knows");
    assert_eq!(reference_state(&harness), ReferenceState::Record);
    story.cut(harness, &mut rng);
    story.state = "/a";
    let harness = story.start(Plan::Well, "a is out of date");
    assert_eq!(reference_state(&harness), ReferenceState::NoRecord);
}

/// A disk that never answers: the cycle goes on, `stop` is answered at once, and nothing is energised.
#[test]
fn disk_that_does_not_answer_delays_enable_and_nothing_else() {
    let mut story = Story::new();
    let mut harness = story.start(Plan::Well, "start");
    assert!(reference(&mut harness));
    harness.run(400);
    let store = harness.store.take();
    let late = harness.ask_and_wait(Command::Enable);
    assert!(matches!(late.why, AnswerReason::RecordLate { .. }), "{:?}", late.why);
    assert!(late.why.sentence(&Names::of(&settings())).contains("1.0 s"));
    assert_eq!((harness.phase(), harness.world.lock().unwrap().arrived.len()), (Phase::Disabled, 0));

    assert!(harness.queue_request(Command::Enable).is_none());
    assert!(matches!(harness.queue_request(Command::Enable).unwrap().why, AnswerReason::Wait));
    let overtaken = harness.queue_request(Command::Stop).unwrap();
    assert!(
        matches!(overtaken.why, AnswerReason::NothingMoves | AnswerReason::Overtaken),
        "{:?}",
        overtaken.why
    );
    let second = harness.command_queue.commands.answer().unwrap();
    assert!([overtaken.why, second.why].contains(&AnswerReason::Overtaken));
    // The record that comes too late energises nothing.
    harness.store = store;
    harness.run(600);
    assert_eq!(harness.phase(), Phase::Disabled);
    assert!(harness.ask_and_wait(Command::Enable).accepted);
    harness.run_until(Phase::Holding, 100);
}

#[test]
fn orderly_end_waits_for_the_record_of_rest_but_not_for_long() {
    let ends = |broken: bool| {
        let mut story = Story::new();
        let mut harness = story.start(Plan::Well, "start");
        assert!(reference(&mut harness));
        harness.run(400);
        assert!(harness.ask_and_wait(Command::Enable).accepted);
        harness.run_until(Phase::Holding, 100);
        if broken {
            story.disk.change_plan(Plan::From(0, ENOSPC));
        }
        harness.shutdown(Shutdown::Orderly);
        let begun = harness.tick;
        while harness.step_after(1) == taustream_streamer::cycle::Next::Go {
            assert!(harness.tick - begun < 3_000_000_000 / PERIOD_NS, "it does not end");
        }
        story.cut(harness, &mut Rng(3));
        story.disk.begin(Plan::Well);
        reference_state(&story.start(Plan::Well, "after"))
    };
    assert_eq!(ends(false), ReferenceState::Record);
    assert_eq!(ends(true), ReferenceState::RecordMoving);
}

/// Goal: a disk that never answers does not keep the process from ending, and the file that waits for it is named.
#[test]
fn end_with_a_disk_that_does_not_answer_comes_and_names_the_file() {
    // The record is written first, by six operations, and then the epochs.
    for (operation, file) in
        [(0, "/a/vcan6.last-pose"), (5, "/a/vcan6.last-pose"), (6, "/epochs/drives.epochs")]
    {
        let disk = FakeDisk::new();
        disk.begin(Plan::Hangs(operation));
        let (mut requester, recorder) = write_ahead::pair();
        requester.request(&[JointNow::UNKNOWN; MAX_JOINTS]);
        let records = PoseRecords::new(&settings(), directories(), Box::new(disk), recorder);
        let mut store = PoseStore::start(records).unwrap();
        let (ended, end) = channel();
        std::thread::spawn(move || ended.send(store.finish()));
        let end = end.recv_timeout(Duration::from_secs(60)).expect("the end never came");
        assert_eq!(end, Err(NotFinished::DiskHangs(file.into())));
        assert!(end.unwrap_err().to_string().contains("has not answered for 3 s"));
    }
}
