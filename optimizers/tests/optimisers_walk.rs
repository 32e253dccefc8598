//! Every optimiser against programs written from its paper (`oracles/walks.py`, plain Python, no packages).
//!
//! They walk on the same little problem with the same random numbers; each cost is compared, in the order of
//! evaluation, so that an equation, an order or a draw that differs shows at the first place where it matters.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
use std::cell::RefCell;
use taustream_optimizers::{
    Bfoa, Boa, Bso, BsoStep, De, End, Exempt, Ga, Gwo, Ibfoa, Iepso, Isma, Iwo, METHODS, Optimizer,
    Parameters, Problem, Pso, Reading, Run, Sampling, Schedule, Setup, Sma, Ssa, Swarming,
};

const WALKS: &str = include_str!("oracles/walks.txt");
/// The costs are printed with twelve digits, and the two languages' elementary functions differ in the last bits.
const TOLERANCE: f64 = 1e-9;

/// The problem of `oracles/field.py`; notes every cost.
struct Field {
    bounds: [[f64; 2]; 3],
    costs: RefCell<Vec<f64>>,
}

impl Problem for Field {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }
    fn cost(&self, x: &[f64]) -> f64 {
        let inside = x.iter().zip(&self.bounds).all(|(x, [low, high])| x >= low && x <= high);
        assert!(inside, "asked outside the box: {x:?}");
        let terms = x.iter().zip([-1.2, 2.3, 1.1]).zip([0.1, 0.2, 0.3]);
        let cost = terms.map(|((x, c), w)| w * (x - c) * (x - c) + 0.05 * (3.0 * x).sin()).sum();
        self.costs.borrow_mut().push(cost);
        cost
    }
}

/// The method with the small numbers of the oracles.
fn tiny(name: &str, reading: Reading) -> Box<dyn Optimizer> {
    let setup = Setup { reading, evaluations: None };
    let schedule = Schedule { population: 6, iterations: 4 };
    let parameters = Parameters {
        population: 4,
        tumbles: 3,
        swims: 2,
        reproductions: 1,
        dispersals: 3,
        survivors: 3,
        step: 0.4,
        dispersal_probability: 0.7,
        swarming: Some(Swarming { attraction: [0.1, 20.0], repulsion: [0.3, 100.0] }),
        disperses_last: reading == Reading::Printed,
    };
    let sma = Sma { schedule, restart: 0.15, ..Sma::set_up(setup) };
    match name {
        "bfoa" => Box::new(Bfoa { parameters, ..Bfoa::set_up(setup) }),
        "bfoa-elite" => Box::new(Bfoa { parameters, exempt: Exempt::Healthiest, greedy: false }),
        "greedy-bfoa" => Box::new(Bfoa { parameters, ..Bfoa::greedy(setup) }),
        "ibfoa" => Box::new(Ibfoa { parameters, ..Ibfoa::CASE_1 }),
        "ibfoa-best" => Box::new(Ibfoa { parameters, elite: Exempt::Best }),
        "bso" => Box::new(Bso { parameters, ..Bso::set_up(setup) }),
        "bso-step" => Box::new(BsoStep { parameters, ..BsoStep::set_up(setup) }),
        "sampling" => Box::new(Sampling { schedule }),
        "sma" => Box::new(sma),
        "isma" => Box::new(Isma { sma, laplace: [0.1, 0.4], ..Isma::set_up(setup) }),
        "boa" => Box::new(Boa { schedule, ..Boa::set_up(setup) }),
        "gwo" => Box::new(Gwo { schedule }),
        "ssa" => Box::new(Ssa { schedule, producers: 0.35, watch: 0.35, safety: 0.5 }),
        "pso" => Box::new(Pso { schedule, ..Pso::original(setup) }),
        "spso" => Box::new(Pso { schedule, ..Pso::standard(setup) }),
        "iepso" => Box::new(Iepso { schedule, replaced: 2, ..Iepso::set_up(setup) }),
        "ga" => Box::new(Ga { schedule, mutation: [0.3, 0.1], ..Ga::set_up(setup) }),
        "de" => Box::new(De { schedule, crossover: 0.6, ..De::set_up(setup) }),
        "iwo" => {
            let schedule = Schedule { population: 4, iterations: 4 };
            Box::new(Iwo { schedule, population_max: 6, ..Iwo::PAPER_004 })
        }
        other => panic!("the oracle has {other}, this test has not"),
    }
}

fn walk(optimizer: &dyn Optimizer, seed: u64) -> Vec<f64> {
    let field = Field { bounds: [[-3.0, 2.0], [-1.0, 4.0], [0.5, 2.5]], costs: RefCell::default() };
    let run = Run { seed, evaluations_max: 100_000, guesses: &[], is_over: &|| false, watch: &mut |_| () };
    let found = optimizer.minimise(&field, run).expect("sane numbers");
    let costs = field.costs.into_inner();
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!((found.end, found.progress.evaluations), (End::Done, costs.len()));
    assert!((found.cost - least).abs() <= 0.0, "found {}, the least was {least}", found.cost);
    costs
}

fn oracle() -> impl Iterator<Item = (&'static str, Reading, u64, Vec<f64>)> {
    WALKS.lines().map(|line| {
        let (head, costs) = line.split_once(": ").expect("a walk a line");
        let mut words = head.split(' ');
        let name = words.next().expect("a name");
        let reading = if words.next() == Some("printed") { Reading::Printed } else { Reading::Corrected };
        let seed = words.next().and_then(|s| s.parse().ok()).expect("a seed");
        let costs = costs.split(' ').map(|c| c.parse().expect("a number")).collect();
        (name, reading, seed, costs)
    })
}

#[test]
fn optimisers_walk_as_the_programs_written_from_the_papers() {
    let mut failed = Vec::new();
    for (name, reading, seed, theirs) in oracle() {
        let ours = walk(tiny(name, reading).as_ref(), seed);
        let same = ours.iter().zip(&theirs).take_while(|(a, b)| (*a - *b).abs() <= TOLERANCE).count();
        if same < ours.len() || same < theirs.len() {
            let at = (ours.get(same), theirs.get(same), ours.len(), theirs.len());
            failed.push(format!("{name} {reading:?} seed {seed}: evaluation {same}: {at:?}"));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Goal: no method escapes the oracle, and a reading that is said to differ does.
#[test]
fn optimisers_are_all_in_the_oracle_and_no_two_walk_alike() {
    for method in METHODS {
        assert!(oracle().any(|(name, ..)| name == method.name), "{} has no oracle", method.name);
        assert_eq!((method.make)(Setup::default()).name(), method.name);
    }
    let all: Vec<_> = oracle().collect();
    for (i, (a, read_a, seed_a, costs_a)) in all.iter().enumerate() {
        let alike = all[..i].iter().find(|(_, _, seed, costs)| seed == seed_a && costs == costs_a);
        let alike = alike.filter(|(b, ..)| !(a.starts_with("ibfoa") && b.starts_with("ibfoa")));
        assert!(
            alike.is_none(),
            "{a} {read_a:?} seed {seed_a} walks as {:?}",
            alike.map(|(b, r, ..)| (b, r))
        );
    }
    // Who is exempt matters only when dispersal would have met the one or the other.
    let elites = ["ibfoa", "ibfoa-best"].map(|n| {
        let walks = all.iter().filter(|(name, reading, ..)| *name == n && *reading == Reading::Corrected);
        walks.map(|(.., costs)| costs.clone()).collect::<Vec<_>>()
    });
    assert_ne!(elites[0], elites[1], "the two elites walk alike for every seed");
}
