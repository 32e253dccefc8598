//! The reward by itself, and whether it helps.
use super::methods::{BUDGET, PRECISION_MM, QUICK, contender, counted};
use super::watched::{Objective, Reaching, reach};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::looks::{self, settle};
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, wilcoxon};
use crate::table::{Cell, Table};
use crate::trial::Sample;
use taustream_optimizers::Reading;
use taustream_optimizers::papers::reach::{FiveJointArm, Reward};

/// Ranges of the outer and of the inner reward in table 4.
const RANGES: [[f64; 2]; 2] = [[-12.0, 0.0], [-24.0, -12.0]];
/// The generation by which the printed run with reward is precise enough.
const PRINTED_GENERATION: f64 = 19.0;
/// Errors at which a reward's range is looked for.
const SCAN: u32 = 20_000;

/// Looks at it.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome::default();
    ranges(&mut outcome);
    does_it_help(run_context, &mut outcome)?;
    Ok(outcome)
}

/// Least and highest value of a reward over errors from `from` to `to`, evenly spread over the logarithm.
fn range(reward: &Reward, from: f64, to: f64) -> [f64; 2] {
    let at = |i: u32| from * (to / from).powf(f64::from(i) / f64::from(SCAN));
    let values = (0..=SCAN).map(|i| reward.of(at(i)));
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], s| [l.min(s), h.max(s)])
}

fn ranges(outcome: &mut Outcome) {
    let columns = ["", "paper, least", "paper, highest", "ours, least", "ours, highest"];
    let note = "least and highest value of eq. 17 over errors spread evenly over their logarithm";
    let mut table = Table::new("Table 4, ranges of the rewards", "s", note, &columns);
    let mut is_kept = Vec::new();
    for reading in [Reading::Printed, Reading::Corrected] {
        let reward = Reward { reading, ..Reward::PAPER_003 };
        // The printed split is at λ = 0.99, a hundredth of the threshold.
        let (word, split) = match reading {
            Reading::Printed => ("printed", 0.01 * reward.threshold_m),
            Reading::Corrected => ("corrected", reward.inner_m),
        };
        // Just beyond the split, which belongs to the inner one.
        let outer = range(&reward, split * (1.0 + 1e-9), reward.threshold_m);
        let inner = range(&reward, 1e-6 * reward.inner_m, split);
        for ((name, [least, highest]), paper) in [("outer", outer), ("inner", inner)].into_iter().zip(RANGES)
        {
            // What it is short of at the ends of the scan is not a fault.
            is_kept.push((reading, least >= paper[0] - 1e-4 && highest <= paper[1] + 1e-4, highest));
            let label = format!("{name}, {word}: split at {} mm", figures(1e3 * split));
            let ours = [Cell::number(least), Cell::number(highest)];
            table.row(label, paper.map(Cell::Paper).into_iter().chain(ours).collect());
        }
    }
    outcome.tables.push(table);
    let kept = |r: Reading| is_kept.iter().filter(|(reading, ..)| *reading == r).all(|(_, kept, _)| *kept);
    let highest = is_kept.iter().map(|(.., highest)| *highest).fold(f64::NEG_INFINITY, f64::max);
    outcome.claims.push(Claim::exact(
        "The rewards run from -12 to 0 and from -24 to -12 (table 4)",
        "eq. 17 as printed stays within these ranges over all errors of its two pieces",
        kept(Reading::Printed),
        format!(
            "highest \"reward\" as printed: {}; with the split at s the ranges {}",
            figures(highest),
            if kept(Reading::Corrected) { "fit" } else { "do not fit either" }
        ),
    ));
    let (reward, eps) = (Reward::PAPER_003, Reward::PAPER_003.threshold_m);
    let jump = reward.of(eps * (1.0 + 1e-9)) - reward.of(eps);
    outcome.claims.push(Claim::exact(
        "The objective is softened where punishment and reward meet",
        "the cost jumps at the threshold by less than the whole range of the rewards",
        jump < RANGES[0][1] - RANGES[1][0],
        format!("it jumps by {} s at {} mm", figures(jump), figures(1e3 * eps)),
    ));
}

/// Runs of one method on one objective.
struct Ran {
    generation: Sample,
    error: Sample,
    evaluations: Option<f64>,
}

impl Ran {
    /// None yet.
    const NONE: Self = Self {
        generation: Sample { values: Vec::new(), evaluations: None },
        error: Sample { values: Vec::new(), evaluations: None },
        evaluations: None,
    };

    /// Further runs until there are so many.
    fn up_to(
        &mut self,
        run_context: &RunContext,
        (name, objective): (&str, Objective),
        (runs, budget): (usize, usize),
    ) -> Result<(), Stop> {
        let task = FiveJointArm::task(Reading::Corrected);
        let from = self.error.values.len();
        let further: Vec<Reaching> = run_context.each(runs.saturating_sub(from), |i| {
            let contender = contender(name, Reading::Corrected, budget)?;
            reach(run_context, &contender, (task, objective), from + i, budget)
        })?;
        self.generation.values.extend(further.iter().map(|r| r.generation));
        self.error.values.extend(further.iter().map(|r| r.error_mm));
        let trials: Vec<_> = further.into_iter().map(|r| r.trial).collect();
        self.evaluations = self.evaluations.or(Sample::best(&trials).evaluations);
        Ok(())
    }
}

fn does_it_help(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let (looks, budget) = (run_context.looks(looks::REWARD, 3), run_context.choose(BUDGET, QUICK));
    let runs = looks.first();
    let columns = [
        "",
        "paper, generation",
        "generation to 0.005 mm",
        "reached",
        "error (mm)",
        "generation, with reward less:more",
        "evaluations",
    ];
    let note = format!(
        "{runs} runs of {budget} evaluations; of iepso with and without reward up to {} where a row asks for them; median [quartiles]; generation of \
         those that reached it",
        looks.last()
    );
    let mut table = Table::new("Figure 10: with and without reward", "", &note, &columns);
    for name in ["iepso", "de"] {
        run_context.say(&format!("  {name} with and without reward .."));
        let is_paper = name == "iepso";
        if !is_paper && run_context.is_repeat() {
            continue;
        }
        let (mut with, mut without, mut alone) = (Ran::NONE, Ran::NONE, Ran::NONE);
        with.up_to(run_context, (name, Objective::Reward), (runs, budget))?;
        without.up_to(run_context, (name, Objective::TimeAndError), (runs, budget))?;
        alone.up_to(run_context, (name, Objective::Error), (runs, budget))?;
        if is_paper {
            outcome.claims.extend(settle(looks, |look| {
                with.up_to(run_context, (name, Objective::Reward), (look.runs, budget))?;
                without.up_to(run_context, (name, Objective::TimeAndError), (look.runs, budget))?;
                Ok::<_, Stop>(claims(&with, &without, look.level))
            })?);
        }
        let printed = if is_paper { Cell::Paper(PRINTED_GENERATION) } else { Cell::None };
        table.row(format!("{name}, reward and punishment"), cells(&with, printed, None));
        table.row(format!("{name}, time + error, no reward"), cells(&without, Cell::None, Some(&with)));
        table.row(format!("{name}, error alone"), cells(&alone, Cell::None, Some(&with)));
    }
    outcome.tables.push(table);
    Ok(())
}

fn cells(ran: &Ran, printed: Cell, with: Option<&Ran>) -> Vec<Cell> {
    let generations = &ran.generation.values;
    let reached: Vec<f64> = generations.iter().copied().filter(|g| g.is_finite()).collect();
    let (count, of) = (reached.len(), generations.len());
    vec![
        printed,
        if reached.is_empty() { Cell::None } else { Cell::Median(Sample::of(reached).summary()) },
        Cell::Share { count, of },
        Cell::Median(ran.error.summary()),
        with.map_or(Cell::None, |w| Cell::Test(wilcoxon(&w.generation.values, generations))),
        Cell::maybe(ran.evaluations),
    ]
}

fn claims(with: &Ran, without: &Ran, level: Level) -> Vec<Claim> {
    let rule =
        "IEPSO, corrected: less with the reward: above 0 (holds), below 1 % (does not hold), or neither";
    let generations = [with, without].map(|r| counted(&r.generation.values));
    let errors = [with, without].map(|r| r.error.values.clone());
    let compare = |[ours, theirs]: [Vec<f64>; 2], floor: f64| {
        vec![Effect::ratio(("with reward", &ours), ("without", &theirs), (floor, level))]
    };
    let reached = counted(&with.generation.values);
    vec![
        Claim::tested("The reward makes IEPSO converge faster", rule, compare(generations, 1.0)),
        Claim::tested("The reward makes IEPSO more accurate", rule, compare(errors, PRECISION_MM)),
        Claim::tested(
            "With the reward the precision of 0.005 mm is met at generation 19",
            "IEPSO, corrected: the median run meets it by then",
            vec![Effect::below(("the generation", &reached), PRINTED_GENERATION, ("generations", level))],
        ),
    ]
}
