//! Motions that are replaced while they run, over the real processes. The recording is checked to the bit, as for every scenario:
//! each trajectory makes the setpoints from its cut on, and gives the same bits there as the one that it cuts.
use crate::scenarios::{CheckMode, Goals, Scenario, arrive_within, enable, end_at};
use crate::test_bench::{Stages, TestBench};
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
    let mut stages = Vec::new();
    for number in 0..count {
        let before = bench.report()?;
        goal = (goal + 1 + usize::try_from(number % 2)?) % goals.0.len();
        let motion = bench
            .replan(&goals.text(goal)?)
            .with_context(|| format!("replan {number}, the arm was {:?}", before.1))?;
        stages.push(motion.stages);
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
    print_stages(&stages);
    println!(
        "       {in_motion} of {count} replans met an arm in motion; {} trajectories accepted",
        report.accepted
    );
    Ok(())
}

/// Medians of what lies between the stages, ms, and what is not planning over what is. Nothing is asserted: the machine is slow.
fn print_stages(stages: &[Stages]) {
    let median_ms = |of: fn(&Stages) -> f64| {
        let mut all: Vec<f64> = stages.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN) * 1e3
    };
    let planning_ms = median_ms(|s| s.proven_s - s.received_s);
    let total_ms = median_ms(|s| s.accepted_s - s.received_s);
    println!(
        "       medians (ms): command to request {:.2}, to the planner {:.2}, strokes {:.2}, proof {:.2}, to the receipt {:.2}, \
         answer {:.2}; from request received to receipt over planning alone: {:.2}",
        median_ms(|s| s.command_s),
        median_ms(|s| s.received_s),
        median_ms(|s| s.planned_s - s.received_s),
        median_ms(|s| s.proven_s - s.planned_s),
        median_ms(|s| s.accepted_s - s.proven_s),
        median_ms(|s| s.answered_s - s.accepted_s),
        total_ms / planning_ms
    );
}

/// Goal: goals that are queued are reached one after the other, without a stop where the corner between them can still be rounded;
/// so are way points of a replacement.
fn queue(bench: &mut TestBench, goals: &Goals) -> Result<()> {
    enable(bench)?;
    bench.replan(&goals.text(0)?)?;
    let words = |goal: usize| -> Result<Vec<String>> {
        let text = goals.text(goal)?;
        Ok(["replan", "--queue", "--json", "--goal", &text].map(str::to_owned).to_vec())
    };
    let mut answers = Vec::new();
    for goal in [1, 2] {
        let words = words(goal)?;
        answers.push(bench.cli_done(&words.iter().map(String::as_str).collect::<Vec<_>>())?.stdout);
    }
    println!("       {}", answers.join("       "));
    // A stalled computer may ask too late for one of them.
    ensure!(answers.iter().any(|answer| answer.contains("rounded by at most")), "no corner was rounded");
    let (via, goal) = (goals.text(1)?, goals.text(0)?);
    let through = bench.cli_done(&["replan", "--json", "--via", &via, "--goal", &goal])?;
    println!("       {}", through.stdout);
    end_at(bench, goals.rad(0)?)
}
