//! What every registered optimiser must do, whatever its method: count, stop, remember, repeat, refuse.
#![expect(clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
use proptest::prelude::*;
use std::cell::{Cell, RefCell};
use taustream_optimizers::papers::{Benchmark, Function};
use taustream_optimizers::{
    Bfoa, Boa, Bso, BsoStep, De, End, Exempt, Ga, Gwo, Ibfoa, Iepso, Isma, Iwo, METHODS, Method, Optimizer,
    Parallel, Parameters, Problem, Progress, Pso, Reading, Refusal, Run, Schedule, Setup, Sma, Solution, Ssa,
    Swarming, WORTHLESS, by_name,
};

/// A problem made of a closure; notes that no evaluation is outside the box.
struct CountedObjective<F> {
    bounds: Vec<[f64; 2]>,
    cost: F,
    times: Cell<usize>,
}

impl<F: Fn(&[f64]) -> f64> CountedObjective<F> {
    fn new(bounds: &[[f64; 2]], cost: F) -> Self {
        Self { bounds: bounds.to_vec(), cost, times: Cell::new(0) }
    }
}

impl<F: Fn(&[f64]) -> f64> Problem for CountedObjective<F> {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }
    fn cost(&self, x: &[f64]) -> f64 {
        let inside = x.iter().zip(&self.bounds).all(|(x, [low, high])| x >= low && x <= high);
        assert!(inside && x.len() == self.bounds.len(), "asked outside the box: {x:?}");
        self.times.set(self.times.get() + 1);
        (self.cost)(x)
    }
}

fn bowl(x: &[f64]) -> f64 {
    x.iter().map(|x| (x - 0.3) * (x - 0.3)).sum()
}

fn run(method: &dyn Optimizer, problem: &dyn Problem, seed: u64, budget: usize) -> Result<Solution, Refusal> {
    let (is_over, mut watch) = (|| false, |_: &Progress| ());
    let run = Run { seed, evaluations_max: budget, guesses: &[], is_over: &is_over, watch: &mut watch };
    method.minimise(problem, run)
}

/// Every method in both readings, fitted to a budget.
fn every(evaluations: usize) -> impl Iterator<Item = (&'static Method, Reading, Box<dyn Optimizer>)> {
    METHODS.iter().flat_map(move |method| {
        [Reading::Corrected, Reading::Printed].map(|reading| {
            let made = (method.make)(Setup { reading, evaluations: Some(evaluations) });
            (method, reading, made)
        })
    })
}

#[test]
fn optimiser_budget_is_kept_to_the_evaluation_and_counted() {
    for (method, _, made) in every(300) {
        for budget in [0, 1, 2, 7, 55, 56, 300] {
            let problem = CountedObjective::new(&[[-1.0, 1.0]; 3], bowl);
            let found = run(made.as_ref(), &problem, 3, budget).expect("sane");
            let (requested, name) = (problem.times.get(), method.name);
            assert_eq!(found.progress.evaluations, requested, "{name}, budget {budget}");
            assert!(requested <= budget, "{name} asked {requested} of {budget}");
            match found.end {
                End::Budget => assert_eq!(requested, budget, "{name} stopped before its budget was used up"),
                End::Done => {
                    assert!(
                        requested > 100 && budget == 300,
                        "{name} was done after {requested} of {budget}"
                    );
                }
                End::Cut => panic!("{name}: nobody cut it"),
            }
            assert_eq!(found.x.is_empty(), budget == 0, "{name}, budget {budget}");
        }
    }
}

#[test]
fn optimiser_is_cut_between_two_evaluations_and_returns_its_best() {
    for (method, _, made) in every(2_000) {
        for after in [0_usize, 1, 20, 333] {
            let least = Cell::new(f64::INFINITY);
            let problem = CountedObjective::new(&[[-1.0, 1.0]; 4], |x| {
                least.set(least.get().min(bowl(x)));
                bowl(x)
            });
            let (is_over, mut watch) = (|| problem.times.get() >= after, |_: &Progress| ());
            let run =
                Run { seed: 1, evaluations_max: 2_000, guesses: &[], is_over: &is_over, watch: &mut watch };
            let found = made.minimise(&problem, run).expect("sane");
            let seen = (found.end, found.progress.evaluations);
            assert_eq!(seen, (End::Cut, after), "{}", method.name);
            let best = if after == 0 { WORTHLESS } else { least.get() };
            assert!((found.cost - best).abs() <= 0.0, "{}: {} is not {best}", method.name, found.cost);
        }
    }
}

#[test]
fn optimiser_never_loses_its_best_and_shows_the_current_best_beside_it() {
    let mut lost = Vec::new();
    for (method, reading, made) in every(3_000) {
        let problem = Benchmark::shifted(Function::Ackley, 5, 1);
        let seen = RefCell::new(Vec::new());
        let (is_over, mut watch) = (|| false, |p: &Progress| seen.borrow_mut().push(*p));
        let run = Run { seed: 9, evaluations_max: 3_000, guesses: &[], is_over: &is_over, watch: &mut watch };
        let found = made.minimise(&problem, run).expect("sane");
        let (seen, name) = (seen.into_inner(), method.name);
        assert!(!seen.is_empty(), "{name} reported nothing");
        for pair in seen.windows(2) {
            assert!(pair[1].best <= pair[0].best, "{name}: the best so far rose");
            assert_eq!(pair[1].iteration, pair[0].iteration + 1, "{name}");
            if pair[1].current > pair[0].current && reading == Reading::Corrected {
                lost.push(name);
            }
        }
        assert!(seen.iter().all(|p| p.best <= p.current), "{name}: the population beats the best so far");
        assert!((problem.cost(&found.x) - found.cost).abs() <= 0.0, "{name}: the point does not cost that");
        assert!(found.cost < problem.cost(&[0.0; 5]) + 20.0);
    }
    lost.dedup();
    // Which methods are greedy is part of what they are; greedy bacteria still follow others uphill, and die.
    let theirs = ["ibfoa", "bfoa", "bso", "bso-step", "greedy-bfoa", "sma", "gwo", "iepso", "pso", "spso"];
    assert_eq!(lost, theirs, "these lose their best");
}

#[test]
fn optimiser_of_one_seed_repeats_bit_by_bit_on_any_number_of_threads() {
    let problem = Benchmark::shifted(Function::Griewank, 6, 2);
    for (method, reading, made) in every(1_500) {
        let alone = run(made.as_ref(), &problem, 17, 1_500).expect("sane");
        for threads in [0, 1, 2, 3, 8] {
            let spread = Parallel { problem: &problem, threads };
            let found = run(made.as_ref(), &spread, 17, 1_500).expect("sane");
            assert_eq!(found, alone, "{} {reading:?} on {threads} threads", method.name);
        }
        let other = run(made.as_ref(), &problem, 18, 1_500).expect("sane");
        assert_ne!(other.x, alone.x, "{}: the seed does nothing", method.name);
    }
}

/// Goal: a batch is spread over the threads, each point once and in its place.
#[test]
fn parallel_costs_are_those_of_one_thread_in_their_order() {
    let problem = Benchmark::new(Function::Rosenbrock, 3);
    let points: Vec<Vec<f64>> = (0..101).map(|i| vec![f64::from(i) * 0.1, 1.0, -0.5]).collect();
    let alone = problem.costs(&points);
    for threads in [0, 1, 2, 7, 100, usize::MAX] {
        let spread = Parallel { problem: &problem, threads };
        assert_eq!(spread.costs(&points), alone, "{threads} threads");
        assert!(spread.costs(&[]).is_empty());
    }
}

#[test]
fn optimiser_finds_the_bottom_of_a_bowl() {
    for (method, reading, made) in every(6_000) {
        let found =
            run(made.as_ref(), &CountedObjective::new(&[[-1.0, 1.0]; 4], bowl), 5, 6_000).expect("sane");
        // A random point costs 1.7 on average; a step of 0.2 cannot get nearer than about a hundredth of that,
        // undamped particles hardly get anywhere, and butterflies smell little where costs are small.
        let band = if ["pso", "boa"].contains(&method.name) { 0.3 } else { 0.03 };
        assert!(found.cost < band, "{} {reading:?}: {}", method.name, found.cost);
    }
}

#[test]
fn optimiser_uses_the_guesses_that_fit_and_clamps_them() {
    for (method, _, made) in every(500) {
        let first = RefCell::new(Vec::new());
        let problem = CountedObjective::new(&[[-1.0, 1.0]; 2], |x| {
            first.borrow_mut().push(x.to_vec());
            bowl(x)
        });
        let guesses = [vec![0.5, 7.0], vec![0.0; 3], vec![0.3, 0.3], vec![f64::NAN, 0.0]];
        let (is_over, mut watch) = (|| false, |_: &Progress| ());
        let run =
            Run { seed: 1, evaluations_max: 500, guesses: &guesses, is_over: &is_over, watch: &mut watch };
        let found = made.minimise(&problem, run).expect("sane");
        let first = first.borrow();
        assert_eq!(
            [&first[0], &first[2], &first[3]],
            [&[0.5, 1.0], &[0.3, 0.3], &[-1.0, 0.0]],
            "{}",
            method.name
        );
        assert!(found.cost <= 0.0, "{} lost the guess at the optimum", method.name);
    }
}

/// A box, and whether it is one.
const BOXES: [(&str, &[[f64; 2]], bool); 12] = [
    ("no coordinate", &[], false),
    ("inverted", &[[0.0, 1.0], [1.0, 0.0]], false),
    ("NaN below", &[[f64::NAN, 1.0]], false),
    ("NaN above", &[[0.0, f64::NAN]], false),
    ("no end above", &[[0.0, f64::INFINITY]], false),
    ("no end below", &[[f64::NEG_INFINITY, 0.0]], false),
    ("two infinities", &[[f64::INFINITY, f64::INFINITY]], false),
    ("a width beyond all numbers", &[[-f64::MAX, f64::MAX]], false),
    ("a point", &[[0.25, 0.25], [0.3, 0.3]], true),
    ("one side of length nothing", &[[0.0, 1.0], [0.3, 0.3]], true),
    ("very large", &[[-1e300, 1e300], [0.0, 1e300]], true),
    ("smaller than the smallest number", &[[0.0, 5e-324], [-5e-324, 0.0]], true),
];

#[test]
fn optimiser_refuses_what_is_no_box_and_lives_with_what_is_one() {
    for (method, _, made) in every(200) {
        for (what, bounds, is_box) in BOXES {
            let result = run(made.as_ref(), &CountedObjective::new(bounds, bowl), 2, 200);
            assert_eq!(result.is_ok(), is_box, "{}, {what}: {result:?}", method.name);
            if let Err(refusal) = result {
                assert!(
                    matches!(refusal, Refusal::Bounds { .. } | Refusal::Dimensions { .. }),
                    "{what}: {refusal}"
                );
            }
        }
    }
    let bounds = &[[0.0, 1.0], [2.0, -3.5]];
    let refusal = run(&Ibfoa::CASE_1, &CountedObjective::new(bounds, bowl), 0, 9).expect_err("inverted");
    assert!(refusal.to_string().starts_with("coordinate 1 (of 0..2) has the bounds 2 to -3.5"), "{refusal}");
}

#[test]
fn optimiser_lives_with_objectives_that_are_no_numbers() {
    type Objective = fn(&[f64]) -> f64;
    let objectives: [(&str, Objective); 8] = [
        ("NaN everywhere", |_| f64::NAN),
        ("infinite everywhere", |_| f64::INFINITY),
        ("minus infinity everywhere", |_| f64::NEG_INFINITY),
        ("NaN on one side", |x| if x[0] < 0.0 { f64::NAN } else { bowl(x) }),
        ("minus infinity on one side", |x| if x[0] < 0.0 { f64::NEG_INFINITY } else { bowl(x) }),
        ("the largest numbers", |x| if x[0] < 0.0 { f64::MAX } else { -f64::MAX }),
        ("the same everywhere", |_| 4.0),
        ("nothing everywhere", |_| 0.0),
    ];
    for (method, reading, made) in every(400) {
        for (what, objective) in objectives {
            let problem = CountedObjective::new(&[[-1.0, 1.0]; 3], objective);
            let found = run(made.as_ref(), &problem, 4, 400).expect("sane");
            let name = method.name;
            assert!(found.cost.is_finite() && !found.x.is_empty(), "{name} {reading:?}, {what}: {found:?}");
            if what.ends_with("on one side") {
                assert!(found.x[0] >= 0.0 && found.cost < 3.0, "{name}, {what}: {found:?}");
            }
        }
    }
}

#[test]
fn optimiser_has_an_answer_in_one_dimension_and_in_a_thousand() {
    for (method, _, made) in every(300) {
        for dimensions in [1, 1000] {
            let problem = CountedObjective::new(&vec![[-1.0, 1.0]; dimensions], bowl);
            let found = run(made.as_ref(), &problem, 6, 300).expect("sane");
            assert_eq!(found.x.len(), dimensions, "{}", method.name);
            // A random point of a thousand coordinates costs 423, and hardly ever less than 380.
            assert!(found.cost < 0.45 * dimensions as f64, "{} in {dimensions}: {}", method.name, found.cost);
        }
    }
    let too_many = CountedObjective::new(&vec![[0.0, 1.0]; 10_001], bowl);
    assert_eq!(run(&Ibfoa::CASE_1, &too_many, 0, 9), Err(Refusal::Dimensions { got: 10_001 }));
}

fn schedule(population: usize) -> Schedule {
    Schedule { population, iterations: 5 }
}

/// Every method with a population of its own.
fn of_population(name: &str, population: usize) -> Box<dyn Optimizer> {
    let (setup, schedule) = (Setup::default(), schedule(population));
    let parameters = Parameters { population, dispersals: 2, reproductions: 2, ..Parameters::CASE_1 };
    match name {
        "bfoa" => Box::new(Bfoa { parameters, ..Bfoa::set_up(setup) }),
        "greedy-bfoa" => Box::new(Bfoa { parameters, ..Bfoa::greedy(setup) }),
        "ibfoa" => Box::new(Ibfoa { parameters, ..Ibfoa::CASE_1 }),
        "bso" => Box::new(Bso { parameters, ..Bso::set_up(setup) }),
        "bso-step" => Box::new(BsoStep { parameters, ..BsoStep::set_up(setup) }),
        "sma" => Box::new(Sma { schedule, ..Sma::set_up(setup) }),
        "isma" => Box::new(Isma { sma: Sma { schedule, ..Sma::set_up(setup) }, ..Isma::set_up(setup) }),
        "boa" => Box::new(Boa { schedule, ..Boa::set_up(setup) }),
        "gwo" => Box::new(Gwo { schedule }),
        "ssa" => Box::new(Ssa { schedule, ..Ssa::set_up(setup) }),
        "pso" => Box::new(Pso { schedule, ..Pso::original(setup) }),
        "spso" => Box::new(Pso { schedule, ..Pso::standard(setup) }),
        "iepso" => Box::new(Iepso { schedule, ..Iepso::set_up(setup) }),
        "ga" => Box::new(Ga { schedule, ..Ga::set_up(setup) }),
        "de" => Box::new(De { schedule, ..De::set_up(setup) }),
        "iwo" => Box::new(Iwo { schedule, ..Iwo::PAPER_004 }),
        other => panic!("{other} is registered, this test does not know it"),
    }
}

#[test]
fn optimiser_of_any_population_answers_or_says_how_many_it_needs() {
    for method in METHODS {
        let mut least = None;
        for population in [0, 1, 2, 3, 4, 5, 10_001, usize::MAX] {
            let made = of_population(method.name, population);
            match run(made.as_ref(), &CountedObjective::new(&[[-1.0, 1.0]; 2], bowl), 1, 5_000) {
                Ok(found) => {
                    assert!(found.cost < 3.4 && population <= 5, "{} of {population}", method.name);
                    least = least.or(Some(population));
                }
                Err(Refusal::Parameter { method: who, what, value, .. }) => {
                    let reported = (who, what, value.to_bits());
                    let requested = (method.name, "the population", (population as f64).to_bits());
                    assert_eq!(reported, requested);
                    assert!(least.is_none() || population > 10_000, "{} of {population}", method.name);
                }
                Err(other) => panic!("{} of {population}: {other}", method.name),
            }
        }
        assert!(least.is_some_and(|l| (1..=4).contains(&l)), "{}: {least:?}", method.name);
    }
}

#[test]
fn optimiser_numbers_that_make_no_sense_are_refused_with_their_name() {
    let of = |p: Parameters| -> Box<dyn Optimizer> {
        Box::new(Bfoa { parameters: p, ..Bfoa::set_up(Setup::default()) })
    };
    let paper = Parameters::CASE_1;
    let bad: Vec<(&str, Box<dyn Optimizer>)> = vec![
        ("tumbles", of(Parameters { tumbles: 0, dispersals: usize::MAX, ..paper })),
        ("reproductions", of(Parameters { reproductions: 0, dispersals: usize::MAX, ..paper })),
        ("the step", of(Parameters { step: f64::NAN, ..paper })),
        ("the dispersal probability", of(Parameters { dispersal_probability: 1.5, ..paper })),
        ("z", Box::new(Sma { restart: -0.1, ..Sma::set_up(Setup::default()) })),
        ("the pull", Box::new(BsoStep { pull: f64::NAN, ..BsoStep::set_up(Setup::default()) })),
        ("F", Box::new(De { factor: f64::INFINITY, ..De::set_up(Setup::default()) })),
        ("most seeds", Box::new(Iwo { seeds: [3, 0], ..Iwo::PAPER_004 })),
        ("most seeds", Box::new(Iwo { seeds: [0, 0], ..Iwo::PAPER_004 })),
    ];
    for (what, made) in bad {
        let refusal =
            run(made.as_ref(), &CountedObjective::new(&[[-1.0, 1.0]], bowl), 1, 99).expect_err(what);
        assert!(refusal.to_string().contains(what), "{what}: {refusal}");
    }
}

/// Goal: the refinement that plans use does not change unnoticed.
/// Method: what it found before it shared its colony with the others, on a bowl in eighteen dimensions.
#[test]
fn ibfoa_case_1_walks_as_it_did_when_it_was_the_only_one() {
    let requested = |x: &[f64]| x.iter().enumerate().map(|(i, x)| (x - 0.1 * i as f64).powi(2)).sum();
    let guesses = [vec![0.5; 18], vec![9.0; 18]];
    let then = [
        (5, usize::MAX, 0x3fe6_f683_1e7e_0b4a_u64, 9_993, 0x3ff6_bea8_d51b_7daf_u64, 480),
        (6, 2_000, 0x3ff0_3b77_f73f_3f15, 2_000, 0x3ff6_0065_7b3e_5a49, 74),
        (7, 777, 0x4018_cb79_7f22_d39f, 777, 0x4018_cb79_7f22_d39f, 23),
    ];
    for (seed, evaluations_max, best, evaluations, current, iteration) in then {
        let rises = Cell::new(0);
        let last = Cell::new(f64::INFINITY);
        let mut watch = |p: &Progress| {
            rises.set(rises.get() + u32::from(p.current > last.get()));
            last.set(p.current);
        };
        let problem = CountedObjective::new(&[[-3.0, 2.0]; 18], requested);
        let run = Run { seed, evaluations_max, guesses: &guesses, is_over: &|| false, watch: &mut watch };
        let found = Ibfoa::CASE_1.minimise(&problem, run).expect("sane");
        assert_eq!(
            (found.progress.evaluations, found.progress.iteration),
            (evaluations, iteration),
            "seed {seed}"
        );
        // Exponentials differ in their last bits between machines.
        for (ours, then) in [(found.cost, best), (found.progress.current, current)] {
            assert!(
                (ours - f64::from_bits(then)).abs() < 1e-9,
                "seed {seed}: {ours}, was {}",
                f64::from_bits(then)
            );
        }
        assert!(
            evaluations < 1_000 || rises.get() > 0,
            "elitism as printed does not keep the curve from rising"
        );
    }
}

/// Goal: what makes a colony lose its best: a step that is kept though it is worse, dispersal, death of a bacterium that
/// has only just become the best, the others' attraction. Without all four the best never rises; with any it does.
#[test]
fn greedy_bacteria_lose_their_best_to_attraction_and_to_death_only() {
    let rises = |method: &Bfoa| {
        let (rises, last) = (Cell::new(0), Cell::new(f64::INFINITY));
        let mut watch = |p: &Progress| {
            rises.set(rises.get() + u32::from(p.current > last.replace(p.current)));
        };
        let problem = Benchmark::shifted(Function::Ackley, 5, 1);
        let run =
            Run { seed: 4, evaluations_max: 20_000, guesses: &[], is_over: &|| false, watch: &mut watch };
        method.minimise(&problem, run).expect("sane");
        rises.get()
    };
    let greedy = Bfoa::greedy(Setup::default());
    let with = |swarming, survivors| Parameters { swarming, survivors, ..greedy.parameters };
    let alone = Bfoa { parameters: with(None, 12), ..greedy };
    assert_eq!(rises(&alone), 0);
    let far = Swarming { attraction: [1e3, 1e-3], repulsion: [0.0, 1.0] };
    let drawn = Bfoa { parameters: with(Some(far), 12), ..greedy };
    let mortal = Bfoa { parameters: with(None, 6), ..greedy };
    for other in [drawn, mortal, Bfoa { greedy: false, ..alone }, Bfoa { exempt: Exempt::Nobody, ..alone }] {
        assert!(rises(&other) > 0, "{other:?}");
    }
}

#[test]
fn optimiser_of_an_unknown_name_is_refused_with_the_names_there_are() {
    let Err(unknown) = by_name("ibfoá", Setup::default()) else { panic!("nobody has that name") };
    let text = unknown.to_string();
    assert!(METHODS.iter().all(|m| text.contains(m.name)), "{text}");
    assert!(by_name(&"x".repeat(1_000_000), Setup::default()).err().is_some_and(|u| u.name.len() == 64));
    let mut names: Vec<&str> = METHODS.iter().map(|m| m.name).collect();
    names.sort_unstable();
    assert!(names.windows(2).all(|p| p[0] != p[1]), "a name is there twice: {names:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Goal: whatever the box, budget, population and objective, a run ends with a refusal or a point of the box.
    #[test]
    fn optimiser_on_anything_ends_with_a_refusal_or_a_point_of_the_box(
        which in 0..METHODS.len(),
        population in 0_usize..9,
        budget in 0_usize..400,
        seed: u64,
        bounds in prop::collection::vec([prop::num::f64::ANY, prop::num::f64::ANY], 0..4),
        sane: bool,
        table in prop::collection::vec(prop::num::f64::ANY, 1..20),
    ) {
        let bounds: Vec<[f64; 2]> = bounds
            .into_iter()
            .map(|[a, b]| if sane { [a.abs().min(b.abs()).min(1e300), a.abs().max(b.abs()).min(1e300)] } else { [a, b] })
            .collect();
        let requested = Cell::new(0_usize);
        let problem = CountedObjective::new(&bounds, |_| {
            requested.set(requested.get() + 1);
            table[requested.get() % table.len()]
        });
        let made = of_population(METHODS[which].name, population);
        if let Ok(found) = run(made.as_ref(), &problem, seed, budget) {
            let inside = found.x.iter().zip(&bounds).all(|(x, [low, high])| x >= low && x <= high);
            prop_assert!(inside && found.cost.is_finite(), "{}: {found:?}", METHODS[which].name);
            prop_assert!(found.progress.evaluations == requested.get() && requested.get() <= budget);
            prop_assert!(found.x.is_empty() == (requested.get() == 0));
        }
    }
}
