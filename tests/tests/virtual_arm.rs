//! The whole system in virtual time: many seeds on every arm, the same seed twice, and planted faults that the checker must
//! find.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
use std::panic::{AssertUnwindSafe, catch_unwind};
use taustream_tests::virtual_arm::arms::{self, SimulatedArm};
use taustream_tests::virtual_arm::checker::Rule;
use taustream_tests::virtual_arm::plan::Plan;
use taustream_tests::virtual_arm::planted::{PlantedDriver, PlantedFault};
use taustream_tests::virtual_arm::run::{Outcome, PLAN_MS, Replacing, run, run_replacing};
use taustream_tests::virtual_arm::world::shipped;

/// Seeds for each arm in an ordinary run; `TAUSTREAM_SEEDS` replaces it.
const SEEDS: u64 = 10;
/// Seeds that have found a fault of the product: a drive that was lost after `torque-off` could not be cleared.
const FOUND: [(&str, u64); 4] = [("one-bus", 16), ("one-bus", 19), ("one-bus", 50), ("dual-bus", 19)];

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect("a whole number"))
}

fn run_seed(arm: &SimulatedArm, seed: u64) -> Outcome {
    let settings = arm.settings().expect("settings");
    let plan = Plan::random(seed, &settings, PLAN_MS);
    let again = format!("TAUSTREAM_SEED={seed} TAUSTREAM_ARM={}", arm.name);
    let outcome = catch_unwind(AssertUnwindSafe(|| run(arm, seed, &plan, &shipped)));
    let Ok(outcome) = outcome else { panic!("a panic of the product; again: {again}") };
    outcome.expect("an arm that can be simulated")
}

fn seeds_of(name: &str) {
    let arm = SimulatedArm::by_name(name).expect("an arm");
    let outcomes = (0..number("TAUSTREAM_SEEDS").unwrap_or(SEEDS)).map(|seed| run_seed(&arm, seed));
    let (mut bad, mut total_ms, mut compared) = (Vec::new(), 0, 0);
    for outcome in outcomes {
        total_ms += outcome.duration_ms;
        compared += outcome.compared;
        if !outcome.violations.is_empty() {
            bad.push(outcome);
        }
    }
    println!("{name}: {} s of arm time, {compared} setpoints of moving joints", total_ms / 1000);
    assert!(compared > 1_000, "hardly anything moved");
    if let Some(first) = bad.first() {
        let seeds: Vec<u64> = bad.iter().map(|outcome| outcome.seed).collect();
        let firsts: Vec<String> = bad.iter().map(|o| format!("{}: {}", o.seed, o.violations[0])).collect();
        panic!("{} seeds fail: {seeds:?}\n{}\nthe first, {first}", bad.len(), firsts.join("\n"));
    }
}

#[test]
fn vcan6() {
    seeds_of("vcan6");
}

#[test]
fn dual_bus() {
    seeds_of("dual-bus");
}

#[test]
fn one_bus() {
    seeds_of("one-bus");
}

#[test]
fn damiao6() {
    seeds_of("damiao6");
}

#[test]
fn damiao6_fd() {
    seeds_of("damiao6-fd");
}

#[test]
fn robstride6() {
    seeds_of("robstride6");
}

#[test]
fn odrive6() {
    seeds_of("odrive6");
}

#[test]
fn pos_vel() {
    seeds_of("pos-vel");
}

#[test]
fn vcan6_go_on() {
    seeds_of("vcan6-go-on");
}

/// Goal: replacements at random moments, with everything that goes wrong between, break no rule. Method: the same seeds as above,
/// and motions that are replaced every few tens of milliseconds; a tenth of the messages is spoiled by one bit.
fn replaced_seeds_of(name: &str) {
    let arm = SimulatedArm::by_name(name).expect("an arm");
    let settings = arm.settings().expect("settings");
    let (mut accepted, mut refused) = (0, 0);
    for seed in 0..number("TAUSTREAM_SEEDS").unwrap_or(SEEDS) {
        let plan = Plan::random(seed, &settings, PLAN_MS);
        let outcome = run_replacing(&arm, seed, (&plan, &shipped), Replacing::Sound).expect("an arm");
        assert!(outcome.violations.is_empty(), "with replacements, {outcome}");
        accepted += outcome.replacements.0;
        refused += outcome.replacements.1;
    }
    println!("{name}: {accepted} replacements, {refused} refused");
    assert!(accepted > 20 && refused > 5, "{accepted} replacements, {refused} refused");
}

#[test]
fn vcan6_with_replacements() {
    replaced_seeds_of("vcan6");
}

#[test]
fn damiao6_with_replacements() {
    replaced_seeds_of("damiao6");
}

#[test]
fn dual_bus_with_replacements() {
    replaced_seeds_of("dual-bus");
}

/// Goal: no stream of targets, with everything that goes wrong between, breaks a rule. Method: the same seeds again; targets
/// come 1 to 500 times a second, with gaps and jumps, also while the arm pauses, is slowed down, or holds after a stop.
fn streamed_seeds_of(name: &str) {
    let arm = SimulatedArm::by_name(name).expect("an arm");
    let settings = arm.settings().expect("settings");
    let mut accepted = 0;
    for seed in 0..number("TAUSTREAM_SEEDS").unwrap_or(SEEDS) {
        let plan = Plan::random(seed, &settings, PLAN_MS);
        let outcome = run_replacing(&arm, seed, (&plan, &shipped), Replacing::Stream).expect("an arm");
        assert!(outcome.violations.is_empty(), "with a stream of targets, {outcome}");
        accepted += outcome.replacements.0;
    }
    println!("{name}: {accepted} pieces of streams");
    assert!(accepted > 200, "{accepted} pieces of streams");
}

#[test]
fn vcan6_with_a_stream() {
    streamed_seeds_of("vcan6");
}

#[test]
fn damiao6_with_a_stream() {
    streamed_seeds_of("damiao6");
}

#[test]
fn dual_bus_with_a_stream() {
    streamed_seeds_of("dual-bus");
}

/// Goal: a follower that does not continue its reference is found by the rate rule.
#[test]
fn stream_without_its_reference_is_found_by_the_rate_rule() {
    let arm = SimulatedArm::by_name("vcan6").expect("an arm");
    let found = (0..10).any(|seed| {
        let plan = Plan::calm();
        let replaces = Replacing::StreamWithoutReference;
        let outcome = run_replacing(&arm, seed, (&plan, &shipped), replaces).expect("an arm");
        outcome.violations.iter().any(|violation| violation.rule == Rule::Rate)
    });
    assert!(found, "no seed has shown it");
}

/// Goal: a motion whose pending strokes are dropped, without strokes that bring it down, is found to be beyond the motion limits
/// that every accepted motion keeps. So the check at the intake is what keeps an arm from it.
#[test]
fn dropping_pending_strokes_alone_is_found_by_the_rate_rule() {
    let arm = SimulatedArm::by_name("vcan6").expect("an arm");
    let found = (0..20).any(|seed| {
        let outcome =
            run_replacing(&arm, seed, (&Plan::calm(), &shipped), Replacing::DropAlone).expect("an arm");
        outcome.violations.iter().any(|violation| violation.rule == Rule::Rate)
    });
    assert!(found, "no seed has shown it");
}

/// The seed and the arm of the environment; without them, a calm one.
#[test]
fn one_seed() {
    let name = std::env::var("TAUSTREAM_ARM").unwrap_or_else(|_| "vcan6".into());
    let arm = SimulatedArm::by_name(&name).expect("TAUSTREAM_ARM names an arm");
    let outcome = run_seed(&arm, number("TAUSTREAM_SEED").unwrap_or(0));
    assert!(outcome.violations.is_empty(), "{outcome}");
}

#[test]
fn seeds_that_found_a_fault_pass() {
    for (name, seed) in FOUND {
        let outcome = run_seed(&SimulatedArm::by_name(name).expect("an arm"), seed);
        assert!(outcome.violations.is_empty(), "{outcome}");
    }
}

#[test]
fn same_seed_gives_the_same_traffic_bit_by_bit() {
    for arm in arms::ALL {
        let [first, second] = [(); 2].map(|()| run_seed(&arm, 4));
        assert!(first.frames > 10_000, "{}: {} frames", arm.name, first.frames);
        assert_eq!((first.frames, first.digest), (second.frames, second.digest), "{}", arm.name);
        assert_eq!(first.story, second.story, "{}", arm.name);
        assert_ne!(first.digest, run_seed(&arm, 9).digest, "{}", arm.name);
    }
}

/// Rules that a run with a planted fault breaks.
fn broken(arm: &SimulatedArm, fault: PlantedFault, seed: u64) -> Vec<Rule> {
    let outcome = run(arm, seed, &Plan::calm(), &|driver| Box::new(PlantedDriver::new(driver, fault)));
    let outcome = outcome.expect("an arm that can be simulated");
    let mut rules: Vec<Rule> = outcome.violations.iter().map(|violation| violation.rule).collect();
    rules.sort_unstable();
    rules.dedup();
    rules
}

/// Goal: the checker finds, on every kind of arm, each fault that a driver can be made to have; and finds nothing without.
#[test]
fn planted_fault_is_found_by_the_rule_that_it_breaks() {
    let arms = ["vcan6", "damiao6", "pos-vel"].map(|name| SimulatedArm::by_name(name).expect("an arm"));
    for arm in arms {
        let faults = [
            (PlantedFault::DoubledStep, Rule::OnPath),
            (PlantedFault::DoubledStep, Rule::Rate),
            (PlantedFault::HeldAndJumped { cycles: 1 }, Rule::Rate),
            (PlantedFault::HeldAndJumped { cycles: 40 }, Rule::Continuity),
            (PlantedFault::Ripple, Rule::Rate),
            (PlantedFault::OutOfRange, Rule::Range),
            (PlantedFault::OtherJoint, Rule::OnPath),
            (PlantedFault::IgnoredStop, Rule::Standing),
            (PlantedFault::EnergisedAlone, Rule::Phase),
        ];
        for (fault, rule) in faults {
            let rules = broken(&arm, fault, 0);
            println!("{} {fault:?}: {rules:?}", arm.name);
            assert!(rules.contains(&rule), "{}: {fault:?} breaks {rules:?}, expected {rule:?}", arm.name);
        }
    }
}
