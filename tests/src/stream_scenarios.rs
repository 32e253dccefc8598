//! Streams of targets over the real processes. The recording is checked to the bit, as for every scenario, so each piece goes on
//! from the one before it without a step, and ends at rest.
use crate::scenarios::{CheckMode, Goals, Scenario, enable, end_at};
use crate::test_bench::{Process, TestBench};
use crate::virtual_arm::random::SeededRng;
use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use std::thread::sleep;
use std::time::{Duration, Instant};
use taustream_messages::{Phase, Report};

/// Length of the stream, s; `TAUSTREAM_STREAM_S` replaces it.
const STREAM_S: u64 = 12;
/// Time between two targets.
const PERIOD: Duration = Duration::from_millis(20);
/// Swing of every joint around its first pose, rad.
const SWING_RAD: f64 = 0.12;

/// Speed of the jog, rad/s, and the joint that it moves.
const JOG_RAD_S: f64 = 0.2;
const WRIST_3: usize = 5;

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[
    Scenario {
        name: "stream_of_targets_with_gaps_and_jumps_is_followed_to_its_end",
        run: gaps,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "client_and_planner_killed_in_a_stream_leave_the_arm_at_rest",
        run: killed,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "jog_in_a_stream_of_refreshes_moves_and_stops_without_them",
        run: jog,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
];

/// A stream around the pose in which the arm stands.
struct Stream {
    client: Process,
    from_rad: Vec<f64>,
    begun: Instant,
    sent: u32,
    taken: u64,
}

impl Stream {
    fn begin(bench: &mut TestBench, name: &str) -> Result<Self> {
        let (report, _) = bench.report()?;
        let joints = usize::try_from(report.joint_count)?;
        let client = bench.start_cli(&["follow", "--json"], name)?;
        let from_rad = report.command_rad.iter().take(joints).copied().collect();
        Ok(Self { client, from_rad, begun: Instant::now(), sent: 0, taken: report.accepted })
    }

    /// The next target of a slow swing, or this far from its middle.
    fn send(&mut self, offset_rad: Option<f64>) -> Result<()> {
        let swing_rad = SWING_RAD * (self.begun.elapsed().as_secs_f64() * 2.0).sin();
        let offset_rad = offset_rad.unwrap_or(swing_rad);
        let target: Vec<String> = self.from_rad.iter().map(|q| (q + offset_rad).to_string()).collect();
        self.sent += 1;
        self.client.show(&target.join(","))
    }

    fn send_for(&mut self, time: Duration) -> Result<()> {
        let begun = Instant::now();
        while begun.elapsed() < time {
            self.send(None)?;
            sleep(PERIOD);
        }
        Ok(())
    }

    /// The arm has taken pieces of it.
    fn ensure_followed(&self, report: &Report, least: u64) -> Result<()> {
        let pieces = report.accepted - self.taken;
        ensure!(pieces >= least, "{} targets gave only {pieces} pieces: {}", self.sent, self.client.said());
        ensure!(report.guard_trips == 0, "the guard tripped {} times", report.guard_trips);
        println!("       {} targets, {pieces} pieces accepted", self.sent);
        Ok(())
    }
}

fn gaps(bench: &mut TestBench, _: &Goals) -> Result<()> {
    enable(bench)?;
    let seconds = match std::env::var("TAUSTREAM_STREAM_S") {
        Ok(text) => text.parse().context("TAUSTREAM_STREAM_S is a whole number")?,
        Err(_) => STREAM_S,
    };
    let mut stream = Stream::begin(bench, "follow")?;
    let mut rng = SeededRng::new(seconds, 1);
    while stream.begun.elapsed() < Duration::from_secs(seconds) {
        stream.send_for(Duration::from_millis(rng.whole(500, 2_500)))?;
        if rng.chance(0.5) {
            stream.send(Some(rng.within(-SWING_RAD, SWING_RAD)))?;
        }
        sleep(Duration::from_millis(rng.whole(100, 800)));
    }
    stream.send(Some(0.0))?;
    end_at(bench, &stream.from_rad.clone())?;
    let (report, _) = bench.report()?;
    stream.ensure_followed(&report, seconds)
}

fn killed(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let mut stream = Stream::begin(bench, "follow-killed")?;
    stream.send_for(Duration::from_secs(3))?;
    stream.client.signal(Signal::KILL)?;
    let report = at_rest(bench)?;
    stream.ensure_followed(&report, 3)?;

    let mut stream = Stream::begin(bench, "follow-on")?;
    stream.send_for(Duration::from_secs(3))?;
    bench.planner.signal(Signal::KILL)?;
    bench.planner.await_end()?;
    let report = at_rest(bench)?;
    stream.ensure_followed(&report, 3)?;

    bench.restart_planner()?;
    bench.replan(&goals.text(1)?)?;
    end_at(bench, goals.rad(1)?)
}

/// Goal: a jog moves one joint while it is refreshed, and stops when refreshes stay away, or its process is killed.
fn jog(bench: &mut TestBench, _: &Goals) -> Result<()> {
    enable(bench)?;
    let (before, _) = bench.report()?;
    let speed_rad_s = JOG_RAD_S.to_string();
    let words = ["jog", "--joint", "wrist_3", "--speed-rad-s", &speed_rad_s];
    for (name, kills) in [("jog", false), ("jog-killed", true)] {
        let mut client = bench.start_cli(&words, name)?;
        let from = bench.report()?.0.command_rad[WRIST_3];
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(2) {
            client.show("+")?;
            sleep(PERIOD);
        }
        let (last, _) = bench.report()?;
        if kills {
            client.signal(Signal::KILL)?;
        }
        let rest = at_rest(bench)?;
        let moved_rad = rest.command_rad[WRIST_3] - from;
        let further_rad = rest.command_rad[WRIST_3] - last.command_rad[WRIST_3];
        ensure!(
            moved_rad > 0.2 * JOG_RAD_S,
            "the joint has moved by {moved_rad} rad only: {}",
            client.said()
        );
        // What was committed, and what was on its way.
        ensure!(
            further_rad < JOG_RAD_S,
            "the joint has moved on by {further_rad} rad after the last refresh"
        );
        let others = before.command_rad.iter().zip(&rest.command_rad).enumerate();
        let moves = others.filter(|(joint, _)| *joint != WRIST_3).any(|(_, (a, b))| (a - b).abs() > 1e-12);
        ensure!(!moves, "a jog of one joint has moved another: {:?}", rest.command_rad);
        ensure!(rest.guard_trips == 0, "the guard tripped {} times", rest.guard_trips);
        println!("       jogged by {moved_rad:.4} rad, {further_rad:.4} rad after the last refresh");
    }
    Ok(())
}

/// The arm holds, and goes on holding.
fn at_rest(bench: &mut TestBench) -> Result<Report> {
    let first = bench.await_phase(Phase::Holding)?;
    sleep(Duration::from_millis(500));
    let (report, phase) = bench.report()?;
    ensure!(phase == Phase::Holding, "the arm is {} after its stream has died", phase.word());
    let same = first.command_rad.map(f64::to_bits) == report.command_rad.map(f64::to_bits);
    ensure!(same, "the arm moves after its stream has died");
    Ok(report)
}
