//! Processes that are stopped, killed or flooded under a moving arm: the streamer says so, blames no drive, and comes back by command
//! alone; a planner is missed by nobody until the next request.
use crate::scenarios::{CheckMode, Goals, Scenario, enable, go, is_ready_to_enable, set_off};
use crate::test_bench::{Motion, TIMEOUT, TestBench};
use crate::virtual_arm::random::SeededRng;
use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use std::thread::sleep;
use std::time::{Duration, Instant};
use taustream_messages::plan::CheckedPlanRequest;
use taustream_messages::service::Wire;
use taustream_messages::{Command, CommandRequest, FaultReason, PauseReason, Phase, PlanRequest};
use taustream_motion::MAX_JOINTS;

/// Longer than the drives' watchdog for missing setpoints; the second one than that for a missing heartbeat, too.
const LONG_MS: [u64; 2] = [300, 600];
/// From what the drives bridge to what leaves the arm paused.
const SHORT_MS: [u64; 5] = [1, 3, 8, 16, 30];
/// Planners that are killed; `TAUSTREAM_KILLS` replaces it.
const KILLS: u64 = 3;
/// Requests of a flood, and how many may be on their way at once.
const FLOOD: u32 = 400;

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[
    scenario("streamer_stopped_shortly_mid_motion_goes_on_or_pauses", stopped_shortly),
    // What the drives send meanwhile overflows the socket of a process that is stopped.
    Scenario {
        check_mode: CheckMode::WithLosses,
        ..scenario("streamer_stopped_for_long_mid_motion_names_its_own_stall", stopped_for_long)
    },
    scenario("planners_killed_in_motion_one_after_the_other_change_nothing", planners_killed),
    scenario("request_floods_in_motion_change_nothing", floods),
];

const fn scenario(name: &'static str, run: fn(&mut TestBench, &Goals) -> Result<()>) -> Scenario {
    Scenario { name, run, check_mode: CheckMode::Exactly, settings: None }
}

fn stop_for(bench: &TestBench, duration: Duration) -> Result<()> {
    bench.streamer.signal(Signal::STOP)?;
    sleep(duration);
    bench.streamer.signal(Signal::CONT)
}

/// A stop up to `stall_resume_ms` is over by itself; a longer one, below the drives' watchdog, leaves the arm paused with its
/// length, and `resume` continues. How long each really was, the streamer says.
fn stopped_shortly(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    let resumes_s = f64::from(bench.settings.cycle.stall_resume_ms) * 1e-3;
    enable(bench)?;
    bench.cli_done(&["speed", "20"])?;
    let motion = set_off(bench, goals, 0, 0.1)?;
    for ms in SHORT_MS {
        let before = bench.report()?.0;
        stop_for(bench, Duration::from_millis(ms))?;
        let after = bench.await_report("a report from after the stop", |report, phase| {
            report.cycles > before.cycles + 50
                && (phase == Phase::Paused || report.trajectory_s > before.trajectory_s)
        })?;
        let phase = Phase::from_code(after.phase).context("a report without a phase")?;
        ensure!(matches!(phase, Phase::Moving | Phase::Paused), "{ms} ms: the arm is {}", phase.word());
        if phase == Phase::Paused {
            let pause = after.pause().context("paused without a reason")?;
            ensure!(pause.reason == PauseReason::Stall, "{ms} ms: paused by {:?}", pause.reason);
            ensure!(pause.gap_s > resumes_s, "{ms} ms: paused after a gap of only {} s", pause.gap_s);
            bench.cli_done(&["resume"])?;
        } else {
            let stopped_s = Duration::from_millis(ms).as_secs_f64();
            ensure!(stopped_s <= resumes_s, "{ms} ms did not leave the arm paused");
        }
    }
    bench.cli_done(&["speed", "100"])?;
    let report = bench.await_end_of(motion)?;
    ensure!(report.guard_trips == 0, "the guard tripped");
    Ok(())
}

/// The drives have stopped by their own watchdogs meanwhile. That is the streamer's doing, and it says so.
fn stopped_for_long(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    for ms in LONG_MS {
        bench.cli_done(&["speed", "20"])?;
        set_off(bench, goals, 0, 0.1)?;
        stop_for(bench, Duration::from_millis(ms))?;
        let report = bench.await_phase(Phase::Fault)?;
        let cause = report.cause().context("a fault without a cause")?;
        ensure!(cause.reason == FaultReason::Stall, "stopped for {ms} ms, the report says {cause:?}");
        ensure!(report.trajectory_s < report.trajectory_duration_s, "the motion had ended before the stop");
        let status = bench.cli_done(&["status"])?.stdout;
        ensure!(status.contains("loop stalled"), "no `loop stalled` in the status: {status}");
        bench.cli_refused(&["replan", "--goal", &goals.text(1)?], "fault")?;
        bench.cli_refused(&["enable"], "clear-fault")?;
        let since = Instant::now();
        while !is_ready_to_enable(bench)? {
            ensure!(since.elapsed() < TIMEOUT, "the fault cannot be cleared: {}", bench.streamer.said());
            bench.cli(&["clear-fault"])?;
        }
        enable(bench)?;
        bench.cli_done(&["speed", "100"])?;
        go(bench, goals, 1)?;
    }
    ensure!(bench.report()?.0.guard_trips == 0, "the guard tripped");
    Ok(())
}

/// What was accepted goes on, a replacement that waits takes over, and the next planner goes on from a motion that it has not sent.
fn planners_killed(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    let count = match std::env::var("TAUSTREAM_KILLS") {
        Ok(text) => text.parse().context("TAUSTREAM_KILLS is a whole number")?,
        Err(_) => KILLS,
    };
    enable(bench)?;
    bench.cli_done(&["speed", "100"])?;
    let mut rng = SeededRng::new(count, 2);
    let mut goal = 0;
    for number in 0..count {
        replan_once_known(bench, &goals.text(goal)?).with_context(|| format!("before kill {number}"))?;
        sleep(Duration::from_millis(rng.whole(50, 600)));
        goal = (goal + 1) % goals.0.len();
        let last = bench.replan(&goals.text(goal)?).with_context(|| format!("kill {number}, in motion"))?;
        sleep(Duration::from_millis(rng.whole(0, 60)));
        bench.planner.signal(Signal::KILL)?;
        bench.planner.await_end()?;
        let (report, phase) = bench.report()?;
        ensure!(phase == Phase::Moving, "kill {number}: the arm is {}", phase.word());
        ensure!(report.guard_trips == 0, "kill {number}: the guard tripped");
        bench.restart_planner()?;
        if number % 2 == 0 {
            bench.await_end_of(last)?;
        }
        goal = (goal + 1) % goals.0.len();
    }
    let motion = replan_once_known(bench, &goals.text(goal)?)?;
    let report = bench.await_end_of(motion)?;
    ensure!(report.guard_trips == 0, "the guard tripped");
    println!("       {count} planners were killed in motion; {} trajectories accepted", report.accepted);
    Ok(())
}

/// A replacement that waits is known to the planner that has sent it; its successor refuses until the motion has taken over, and
/// says why.
fn replan_once_known(bench: &TestBench, goal: &str) -> Result<Motion> {
    let since = Instant::now();
    loop {
        match bench.replan(goal) {
            Err(why) if format!("{why:#}").contains("not known here") && since.elapsed() < TIMEOUT => {
                sleep(Duration::from_millis(50));
            }
            answer => return answer,
        }
    }
}

/// Commands that change nothing, and requests to plan that are refused, as fast as they can be sent.
fn floods(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.cli_done(&["speed", "50"])?;
    let motion = set_off(bench, goals, 0, 0.1)?;
    let wire = Wire::join(&bench.settings.name, "flood", &taustream_arm::runtime::directory()?)?;
    let (commands, plans) = (wire.command_client()?, wire.plan_client()?);
    let joints = bench.settings.robot.joints.len();
    let malformed = PlanRequest::from(&CheckedPlanRequest::to_pose(joints, [f64::NAN; MAX_JOINTS]));
    let before = bench.report()?.0;
    for _ in 0..FLOOD {
        // Nobody waits for the answers; more than the service holds are dropped.
        let command = commands.send_copy(CommandRequest::new(Command::Enable, Duration::from_millis(200)));
        let plan = plans.send_copy(malformed);
        ensure!(command.is_ok() && plan.is_ok(), "a request cannot be sent");
    }
    // An operator's command comes through.
    bench.cli_done(&["speed", "100"])?;
    let report = bench.await_end_of(motion)?;
    ensure!(report.guard_trips == 0, "the guard tripped");
    ensure!(report.accepted == before.accepted, "a request of the flood was accepted");
    go(bench, goals, 1)?;
    Ok(())
}
