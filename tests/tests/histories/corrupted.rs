//! Histories with a fault that was planted into their log: every rule must find its own.
use crate::checks::{Rule, violations};
use crate::log::Log;
use crate::story;
use taustream_messages::Phase;

/// Seeds whose histories are corrupted.
const SEEDS: u64 = 60;

/// Changes a log so that a rule is broken; false when there is nothing in it to change.
type Corruption = fn(&mut Log) -> bool;

/// The index of a cycle in the middle of those that fit, and that of its setpoint at the first drive.
fn middle(log: &Log, fits: impl Fn(&crate::log::Cycle) -> bool) -> Option<(usize, usize)> {
    let cycles: Vec<usize> = (1..log.cycles.len()).filter(|at| fits(&log.cycles[*at])).collect();
    let at = *cycles.get(cycles.len() / 2).filter(|_| cycles.len() > 40)?;
    let tick = log.cycles[at].tick;
    log.drives[0].iter().position(|(sent, _)| *sent == tick).map(|drive| (at, drive))
}

fn moving(cycle: &crate::log::Cycle) -> bool {
    cycle.phase == Phase::Moving && cycle.sent
}

/// Both what was logged and what the drive got, so that they agree.
fn shift(log: &mut Log, (at, drive): (usize, usize), by_rad: f64) -> bool {
    log.cycles[at].position_rad[0] += by_rad;
    log.drives[0][drive].1 += by_rad;
    true
}

const CORRUPTIONS: [(Rule, Corruption); 13] = [
    (Rule::Continuity, |log| middle(log, moving).is_some_and(|at| shift(log, at, 0.2))),
    (Rule::StopRate, |log| {
        // A thousandth of a degree beside the others.
        middle(log, moving).is_some_and(|at| shift(log, at, 2e-5))
    }),
    (Rule::MotionRate, |log| {
        let excess = log.limits[0].motion.velocity_rad_s * log.period_s;
        let Some((at, drive)) = middle(log, moving) else { return false };
        // Half a second at a speed that only a stop may have, reached and left as smoothly as you like.
        let count = 300.min(log.drives[0].len() - drive - 1);
        for (step, setpoint) in log.drives[0].iter_mut().skip(drive).take(count).enumerate() {
            setpoint.1 += 1.5 * excess * step as f64;
        }
        log.limits[0].stop.velocity_rad_s *= 1e3;
        log.limits[0].stop.acceleration_rad_s2 *= 1e6;
        log.limits[0].stop.jerk_rad_s3 *= 1e9;
        at > 0
    }),
    (Rule::Range, |log| {
        log.limits[0].position_rad[1] = log.drives[0].last().map_or(0.0, |last| last.1) - 2e-3;
        !log.drives[0].is_empty()
    }),
    (Rule::OnPath, |log| middle(log, moving).is_some_and(|at| shift(log, at, 1e-10))),
    (Rule::OnPath, |log| {
        // The drive gets another setpoint than the log says.
        middle(log, moving).is_some_and(|(_, drive)| {
            log.drives[0][drive].1 += 1e-12;
            true
        })
    }),
    (Rule::Time, |log| {
        middle(log, moving).is_some_and(|(at, _)| {
            log.cycles[at].s += 3e-3;
            true
        })
    }),
    (Rule::Takeover, |log| {
        let late = log.cycles.windows(2).position(|pair| pair[0].id != 0 && pair[1].id != pair[0].id);
        let Some(at) = late else { return false };
        let id = log.cycles[at + 1].id;
        log.motions.iter_mut().find(|motion| motion.id == id && motion.cut_s.is_some()).is_some_and(
            |motion| {
                motion.from_s -= 0.004;
                true
            },
        )
    }),
    (Rule::Standing, |log| {
        let stands = |cycle: &crate::log::Cycle| matches!(cycle.phase, Phase::Holding | Phase::Paused);
        middle(log, stands).is_some_and(|at| shift(log, at, 1e-9))
    }),
    (Rule::Stop, |log| {
        log.stop_cycles = 3;
        log.cycles.iter().any(|cycle| matches!(cycle.phase, Phase::Pausing | Phase::Stopping))
    }),
    (Rule::Hostile, |log| {
        log.swallowed.push("a cut too late".to_owned());
        true
    }),
    (Rule::Guard, |log| {
        log.guard_trips = 1;
        true
    }),
    (Rule::End, |log| {
        log.end = Phase::Moving;
        true
    }),
];

/// Goal: the checks find what they are there for. Method: sound histories whose logs are corrupted, one rule after the other.
#[test]
fn every_rule_finds_the_fault_that_is_planted_for_it() {
    let logs: Vec<Log> = (0..SEEDS).map(story::tell).collect();
    for (number, (rule, corrupt)) in CORRUPTIONS.into_iter().enumerate() {
        let mut tried = 0;
        for (seed, log) in logs.iter().enumerate() {
            let mut corrupted = log.clone();
            if corrupt(&mut corrupted) {
                let found = violations(&corrupted);
                tried += u32::from(found.iter().any(|violation| violation.rule == rule));
                assert!(
                    rule == Rule::StopRate || rule == Rule::Stop || !found.is_empty(),
                    "seed {seed}, corruption {number}: {rule:?} is not found"
                );
            }
        }
        println!("{rule:?}: found in {tried} of {SEEDS} histories");
        assert!(tried > 3, "corruption {number}: {rule:?} is found in {tried} histories only");
    }
}
