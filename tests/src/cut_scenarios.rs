//! Motions that are replaced while they run, over the real processes. The recording is checked to the bit, as for every scenario:
//! each trajectory makes the setpoints from its cut on, and gives the same bits there as the one that it cuts.
use crate::scenarios::{CheckMode, Goals, Scenario, arrive_within, enable, end_at};
use crate::test_bench::TestBench;
use crate::virtual_arm::random::SeededRng;
use anyhow::{Context, Result, ensure};
use std::thread::sleep;
use std::time::Duration;
use taustream_messages::Phase;

/// Replans of one run; `TAUSTREAM_REPLANS` replaces it.
const REPLANS: u64 = 8;
/// How far a servo may be from the goal when the arm holds.
const AT_GOAL_RAD: f64 = 5e-3;

/// Every scenario, in the order in which they run.
pub const ALL: &[Scenario] = &[
    Scenario {
        name: "replans_at_random_moments_of_a_motion_are_taken_without_a_step",
        run: replans,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
    Scenario {
        name: "goals_in_a_queue_are_reached_without_holding_between",
        run: queue,
        check_mode: CheckMode::Exactly,
        settings: None,
    },
];

fn replans(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    let count = match std::env::var("TAUSTREAM_REPLANS") {
        Ok(text) => text.parse().context("TAUSTREAM_REPLANS is a whole number")?,
        Err(_) => REPLANS,
    };
    let mut rng = SeededRng::new(count, 1);
    let (mut in_motion, mut goal) = (0, 0);
    for number in 0..count {
        let before = bench.report()?;
        goal = (goal + 1 + usize::try_from(number % 2)?) % goals.0.len();
        bench
            .replan(&goals.text(goal)?)
            .with_context(|| format!("replan {number}, the arm was {:?}", before.1))?;
        in_motion += u32::from(before.1 == Phase::Moving);
        sleep(Duration::from_millis(rng.whole(20, 900)));
        if number % 5 == 3 && bench.report()?.1 == Phase::Moving {
            // Refused when the motion has just ended.
            bench.cli(&["pause", "--wait-s", "0"])?;
            sleep(Duration::from_millis(rng.whole(1, 300)));
            bench.cli(&["resume"])?;
        }
    }
    let last = bench.replan(&goals.text(goal)?)?;
    let report = arrive_within(bench, last, goals.rad(goal)?, AT_GOAL_RAD)?;
    ensure!(report.guard_trips == 0, "the guard tripped {} times", report.guard_trips);
    ensure!(in_motion >= 3, "only {in_motion} of {count} replans met an arm in motion");
    println!(
        "       {in_motion} of {count} replans met an arm in motion; {} trajectories accepted",
        report.accepted
    );
    Ok(())
}

/// Goal: goals that are queued are reached one after the other.
fn queue(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.replan(&goals.text(0)?)?;
    let words = |goal: usize| -> Result<Vec<String>> {
        let text = goals.text(goal)?;
        Ok(["replan", "--queue", "--json", "--goal", &text].map(str::to_owned).to_vec())
    };
    for goal in [1, 2] {
        let words = words(goal)?;
        bench.cli_done(&words.iter().map(String::as_str).collect::<Vec<_>>())?;
    }
    end_at(bench, goals.rad(2)?)
}
