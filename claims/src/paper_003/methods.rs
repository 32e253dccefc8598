//! Table 5 and figures 4, 7 to 9: which method comes how near, how fast, at what cost.
use super::printed::TABLE_5;
use super::watched::{Contender, Objective, Reaching, reach};
use crate::chart::Panel;
use crate::claim::{Claim, Verdict};
use crate::effect::{Claimed, Effect};
use crate::figure::Figure;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile, wilcoxon};
use crate::table::{Cell, Table};
use crate::trial::Sample;
use taustream_optimizers::papers::reach::{FiveJointArm, Reach};
use taustream_optimizers::{De, Exchange, Ga, Iepso, Pso, Reading, Setup};

/// Runs, and evaluations of the paper's 1000 generations of 40 after the first one.
pub(super) const RUNS: usize = 30;
pub(super) const BUDGET: usize = 40 + 40 * 1000;
pub(super) const QUICK: usize = 4_000;

/// The rows: name, which row of table 5, reading of method and objective.
const ROWS: [(&str, Option<usize>, Reading); 10] = [
    ("pso", Some(0), Reading::Corrected),
    ("spso", Some(1), Reading::Corrected),
    ("pso, inertia 0.9 to 0.4", None, Reading::Corrected),
    ("iepso", Some(2), Reading::Printed),
    ("iepso", Some(2), Reading::Corrected),
    ("elimination only", None, Reading::Corrected),
    ("exchange only", None, Reading::Corrected),
    ("ga", Some(3), Reading::Corrected),
    ("de", Some(4), Reading::Corrected),
    ("iepso with φ3 as printed", None, Reading::Corrected),
];
/// What the corrected IEPSO is in [`ROWS`].
const IEPSO: usize = 4;
/// Rows that a claim compares it with: the paper's other four.
const OTHERS: [usize; 4] = [0, 1, 7, 8];
/// Generations at which the paper's curves of F and of the error have come to rest.
const PRINTED_GENERATIONS: [usize; 2] = [45, 180];
/// The paper's precision: errors below it are rounding.
pub(super) const PRECISION_MM: f64 = 1e-7;
/// A cost that is less by less is not less: a hundredth of what its best rows differ by (s).
pub(super) const COST_MARGIN_S: f64 = 0.1;

/// A method of the table with a schedule that fits the budget.
pub(super) fn contender(name: &str, reading: Reading, budget: usize) -> Result<Contender, Stop> {
    let setup = Setup { reading, evaluations: Some(budget) };
    let population = Pso::PAPER_003.population;
    let swarm = |constants| Pso { constants, ..Pso::standard(setup) };
    let iepso = Iepso::set_up(setup);
    let plain = Pso::PAPER_003.fitted(Some(budget), population);
    let all = |optimizer| Contender { optimizer, per_generation: population };
    Ok(match name {
        "pso" => all(Box::new(Pso::original(setup))),
        "spso" => all(Box::new(Pso::standard(setup))),
        "pso, inertia 0.9 to 0.4" => all(Box::new(swarm(Iepso::CONSTANTS))),
        "iepso" => Contender { optimizer: Box::new(iepso), per_generation: population + Iepso::REPLACED },
        "iepso with φ3 as printed" => Contender {
            optimizer: Box::new(Iepso { exchange: Exchange::Magnitude, ..iepso }),
            per_generation: population + Iepso::REPLACED,
        },
        "elimination only" => Contender {
            optimizer: Box::new(Iepso { weight: [0.0; 2], ..iepso }),
            per_generation: population + Iepso::REPLACED,
        },
        "exchange only" => all(Box::new(Iepso { replaced: 0, schedule: plain, ..iepso })),
        "ga" => all(Box::new(Ga::set_up(setup))),
        "de" => all(Box::new(De::set_up(setup))),
        other => return Err(Stop::Refused(format!("there is no contender named {other}"))),
    })
}

/// All runs of one row.
struct Ran {
    label: String,
    runs: Vec<Reaching>,
}

impl Ran {
    fn sample(&self, figure: impl Fn(&Reaching) -> f64) -> Sample {
        Sample::of(self.runs.iter().map(figure).collect())
    }

    fn cost(&self) -> Sample {
        self.sample(|r| r.trial.found.cost)
    }

    /// Lower quartile, median and upper quartile of cost (0) or error (1) over generations.
    fn curve(&self, which: usize) -> Vec<(f64, [f64; 3])> {
        let generations = self.runs.iter().map(|r| r.best.len()).max().unwrap_or(0);
        let step = (generations / 200).max(1);
        let at = |g: usize| {
            let here = |r: &Reaching| r.best.get(g).or(r.best.last()).map(|b| b[which]);
            let values: Vec<f64> = self.runs.iter().filter_map(here).collect();
            (g as f64, [0.25, 0.5, 0.75].map(|q| quantile(&values, q)))
        };
        (0..generations).step_by(step).map(at).collect()
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let (runs, budget) = (run_context.runs(RUNS, 4), run_context.choose(BUDGET, QUICK));
    let mut ran = Vec::new();
    for (name, _, reading) in ROWS {
        let word = match (name, reading) {
            ("iepso", Reading::Printed) => ", printed",
            ("iepso", Reading::Corrected) => ", corrected",
            (_, Reading::Printed | Reading::Corrected) => "",
        };
        run_context.say(&format!("  {name}{word}, {runs} runs .."));
        let task = FiveJointArm::task(reading);
        let one = |run| {
            reach(run_context, &contender(name, reading, budget)?, (task, Objective::Reward), run, budget)
        };
        ran.push(Ran { label: format!("{name}{word}"), runs: run_context.each(runs, one)? });
    }
    let mut outcome = Outcome::default();
    outcome.ours.push(
        "pso: inertia 1, pulls 2; spso: constriction 0.729, 1.494; ga: tournaments of two, blend 0.5, mutation 0.1 of \
         the box with probability 0.1; de: rand/1/bin, F 0.5, CR 0.9; iepso: four of forty replaced a generation"
            .to_owned(),
    );
    outcome.tables.push(table(&ran, runs, budget));
    outcome.figures.push(figure(&ran, runs));
    outcome.figures.extend(ran.get(IEPSO).and_then(|ran| ran.runs.first()).map(first_run));
    outcome.claims = claims(&ran);
    Ok(outcome)
}

/// The least cost that there can be: the arm is planar but for its first joint, whose angle is the target's bearing
/// or that turned round; the reward is at most 8 j.
fn least_cost(task: &Reach) -> f64 {
    let [x, y, _] = task.target_m;
    y.atan2(x).abs() / FiveJointArm::SPEED_RAD_S - 8.0 * task.reward.factor
}

fn table(ran: &[Ran], runs: usize, budget: usize) -> Table {
    let columns = [
        "",
        "paper, F",
        "paper, error (mm)",
        "F",
        "best F",
        "error (mm)",
        "worst error (mm)",
        "runs to 0.005 mm",
        "generation to 0.005 mm",
        "F: iepso corrected less:more",
        "evaluations",
    ];
    let note = format!(
        "{runs} runs of {budget} evaluations (1000 generations of 40 in a full run); median [quartiles]; only IEPSO \
         has two readings"
    );
    let mut table = Table::new("Table 5: methods", "F in s", &note, &columns);
    let reference = ran.get(IEPSO).map(Ran::cost);
    for (i, (row, (_, paper, _))) in ran.iter().zip(ROWS).enumerate() {
        let paper = paper.and_then(|p| TABLE_5.get(p));
        let (cost, error) = (row.cost(), row.sample(|r| r.error_mm));
        let reached: Vec<f64> = row.runs.iter().map(|r| r.generation).filter(|g| g.is_finite()).collect();
        let test = reference.as_ref().filter(|_| i != IEPSO).map(|s| wilcoxon(&s.values, &cost.values));
        let trials: Vec<_> = row.runs.iter().map(|r| r.trial.clone()).collect();
        table.row(
            row.label.clone(),
            vec![
                paper.map_or(Cell::None, |p| Cell::Paper(p.cost)),
                paper.map_or(Cell::None, |p| Cell::Paper(p.error_mm)),
                Cell::Median(cost.summary()),
                Cell::number(cost.summary().least),
                Cell::Median(error.summary()),
                Cell::number(error.summary().most),
                Cell::Share { count: reached.len(), of: row.runs.len() },
                if reached.is_empty() { Cell::None } else { Cell::Median(Sample::of(reached).summary()) },
                test.map_or(Cell::None, Cell::Test),
                Cell::maybe(Sample::best(&trials).evaluations),
            ],
        );
    }
    table
}

fn figure(ran: &[Ran], runs: usize) -> Figure {
    let mut error = Panel { is_log: true, ..Panel::new("generation", "error of the best so far (mm)") };
    let mut above = Panel { is_log: true, ..Panel::new("generation", "F of the best so far - least F (s)") };
    let least = least_cost(&FiveJointArm::task(Reading::Corrected));
    for row in ran {
        error.spread(&row.label, &row.curve(1));
        let over: Vec<_> = row.curve(0).into_iter().map(|(g, y)| (g, y.map(|y| y - least))).collect();
        above.spread(&row.label, &over);
    }
    let title = format!("Paper 003, figures 4 and 7 to 9: median and quartiles of {runs} runs");
    Figure::of("003-convergence.svg", &title, 1, &[error, above])
}

/// Figures 5 and 6: the best point's angles and its reward or punishment over the generations of one run.
fn first_run(run: &Reaching) -> Figure {
    let task = FiveJointArm::task(Reading::Corrected);
    let mut angles = Panel::new("generation", "angle of the best so far (rad)");
    for joint in 0..4 {
        let points = run.angles_rad.iter().enumerate().map(|(g, q)| (g as f64, q[joint]));
        angles.line(&format!("joint {}", joint + 1), points.collect());
    }
    let mut reward = Panel::new("generation", "reward or punishment of the best so far (s)");
    let points =
        run.best.iter().enumerate().map(|(g, [_, error_mm])| (g as f64, task.reward.of(1e-3 * error_mm)));
    reward.line("S", points.collect());
    let title = "Paper 003, figures 5 and 6: first run of IEPSO, corrected";
    Figure::of("003-angles.svg", title, 1, &[angles, reward])
}

fn claims(ran: &[Ran]) -> Vec<Claim> {
    let Some(iepso) = ran.get(IEPSO) else { return Vec::new() };
    let others: Vec<&Ran> = OTHERS.iter().filter_map(|i| ran.get(*i)).collect();
    let ratio = |figure: fn(&Reaching) -> f64, floor: f64| -> Vec<Effect> {
        let of = |ran: &Ran| counted(&ran.sample(figure).values);
        let ours = of(iepso);
        others
            .iter()
            .map(|o| Effect::ratio(("iepso", &ours), (&o.label, &of(o)), (floor, Level::FIVE_PERCENT)))
            .collect()
    };
    let rule = |what: &str, margin: &str| {
        format!(
            "IEPSO corrected, equal evaluations: {what} less than that of each of the other four: above 0 (holds), below {margin} \
             (does not hold), or neither"
        )
    };
    let cost = others.iter().map(|o| {
        Effect::difference(
            ("iepso", &iepso.cost()),
            (&o.label, &o.cost()),
            (COST_MARGIN_S, "s", Level::FIVE_PERCENT),
        )
    });
    let mut claims = vec![
        Claim::tested(
            "IEPSO's error is the least of the five",
            &rule("errors, of which what is below the paper's precision of 1e-7 mm counts as equal,", "1 %"),
            ratio(|r| r.error_mm, PRECISION_MM),
        ),
        Claim::tested(
            "IEPSO converges fastest: first within 0.005 mm",
            &rule("generations (one more than there are, for a run that does not get there)", "1 %"),
            ratio(|r| r.generation, 1.0),
        ),
        Claim::tested(
            "IEPSO plans the most efficient motion (least F)",
            &rule("F", &format!("{COST_MARGIN_S} s")),
            cost.collect(),
        ),
    ];
    claims.push(poor_swarms(ran));
    claims.push(optimum(ran));
    claims.push(exchange(ran));
    claims.extend(rest(iepso));
    claims
}

fn poor_swarms(ran: &[Ran]) -> Claim {
    let precision_mm = 1e3 * FiveJointArm::task(Reading::Corrected).reward.threshold_m;
    let swarms = ran.iter().zip(ROWS).filter(|(_, (name, ..))| ["pso", "spso"].contains(name));
    let above = |(ran, _): (&Ran, _)| {
        let errors = ran.sample(|r| r.error_mm);
        Effect::above(
            (&format!("{}'s error", ran.label), &errors.values),
            precision_mm,
            ("mm", Level::FIVE_PERCENT),
        )
    };
    Claim::tested(
        "PSO and SPSO are caught in local optima and cannot meet the precision",
        "the median error of both is above 0.005 mm",
        swarms.map(above).collect(),
    )
}

fn optimum(ran: &[Ran]) -> Claim {
    let least = least_cost(&FiveJointArm::task(Reading::Corrected));
    let best = ran.iter().min_by(|a, b| a.cost().summary().least.total_cmp(&b.cost().summary().least));
    let found = best.map_or(f64::NAN, |b| b.cost().summary().least);
    let paper = TABLE_5.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
    Claim::exact(
        "F = -16.56 is the global optimum",
        "the printed F is within 0.05 of the least F that can be: |bearing of the target|/ω - 24",
        (paper - least).abs() <= 0.05,
        format!(
            "least possible {}, least found {} by {}: {} s below the printed one",
            figures(least),
            figures(found),
            best.map_or("nobody", |b| b.label.as_str()),
            figures(paper - least)
        ),
    )
}

/// Does the exchange help, as printed or with its sign?
fn exchange(ran: &[Ran]) -> Claim {
    let find = |name: &str| ran.iter().find(|r| r.label == name).map(Ran::cost);
    let [Some(with), Some(printed), Some(without)] =
        ["iepso, corrected", "iepso with φ3 as printed", "elimination only"].map(find)
    else {
        return Claim::unchecked("The exchange φ3 helps the global search", "no such runs", String::new());
    };
    let against = |name: &str, sample: &Sample| {
        Effect::difference(
            (name, sample),
            ("without φ3", &without),
            (COST_MARGIN_S, "s", Level::FIVE_PERCENT),
        )
    };
    let effects = vec![against("with φ3 signed", &with), against("with φ3 as printed", &printed)];
    Claim::weighed(
        "The exchange φ3 helps the global search",
        "on the corrected objective, F is less than with c3 = 0, with its sign or without: above 0 (holds), both below 0.1 s (does not \
         hold), or neither",
        Verdict::any(effects.iter().map(Effect::verdict)),
        effects,
    )
}

/// When the median run's curves come to rest.
fn rest(iepso: &Ran) -> [Claim; 2] {
    let [cost_at, error_at] = PRINTED_GENERATIONS;
    let at = |which: usize, g: usize| -> Vec<f64> {
        iepso.runs.iter().filter_map(|r| r.best.get(g).or(r.best.last()).map(|b| b[which])).collect()
    };
    let (then, end) = (Sample::of(at(0, cost_at)), Sample::of(at(0, usize::MAX)));
    let margin = 0.01 * quantile(&end.values, 0.5).abs();
    let fallen = Effect::difference(
        ("F at the end", &end),
        ("F at generation 45", &then),
        (margin, "s", Level::FIVE_PERCENT),
    );
    let error = at(1, error_at);
    [
        Claim::tested(
            "F has converged at about generation 45 (figure 3)",
            "it falls by less than 1 % of its end after that",
            vec![fallen.claimed(Claimed::Nothing)],
        ),
        Claim::tested(
            "The error is zero at about generation 180 (figure 4)",
            "the median error is then within the precision of 0.005 mm",
            vec![Effect::below(("the error at generation 180", &error), 0.005, ("mm", Level::FIVE_PERCENT))],
        ),
    ]
}

/// Generations, one more than there are for a run that did not get there; other figures stay what they are.
pub(super) fn counted(values: &[f64]) -> Vec<f64> {
    let last = (BUDGET / Pso::PAPER_003.population) as f64 + 1.0;
    values.iter().map(|v| if v.is_finite() { *v } else { last }).collect()
}
