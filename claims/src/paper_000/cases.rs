//! Case 1 and case 2: IBFOA, BFOA and BSO on random scenes, their variants, random sampling, and the straight line.
use super::contenders::{ALL, Contender, GREEDY_TOO, PAPERS_OWN, WITH_A_CLAIM};
use super::course::{Course, curve};
use super::meeting::{Field, Meeting};
use super::{Unit, ours, verdicts};
use crate::chart::Panel;
use crate::claim::Claim;
use crate::effect::Effect;
use crate::figure::Figure;
use crate::looks::{self, Looks, settle};
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, Moments, Summary, welch};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::control_points::Case;
use taustream_optimizers::{Parameters, Reading};

/// Above any schedule of the paper's.
const ENOUGH: usize = 50_000_000;
/// Evaluations of a quick run.
const QUICK: usize = 260;
/// Points of a curve.
const POINTS: usize = 160;

/// A column of the paper's table 2: means and deviations in the order of [`PAPERS_OWN`].
struct Printed {
    runs: usize,
    mean: [f64; 3],
    sd: [f64; 3],
}

/// Runs of case 1 as printed: one collision refutes it.
const RUNS_PRINTED: usize = 20;

const CASE_1: Printed = Printed { runs: 300, mean: [2.08e4, 1.96e4, 2.01e4], sd: [1.12e4, 1.04e4, 1.28e4] };
const CASE_2: Printed = Printed { runs: 20, mean: [1.37e4, 1.24e4, 1.82e4], sd: [6.13e3, 3.89e3, 8.95e3] };

impl Printed {
    fn moments(&self, i: usize) -> Option<Moments> {
        let (mean, sd) = (*self.mean.get(i)?, *self.sd.get(i)?);
        Some(Moments { n: self.runs, mean, sd })
    }
}

/// What is run.
pub(super) struct Trials<'a> {
    name: &'static str,
    printed: &'a Printed,
    pub(super) parameters: Parameters,
    unit: Unit,
    reading: Reading,
    pub(super) contenders: &'a [Contender],
    looks: Looks,
}

/// Case 1 in both units, as printed and corrected.
pub(crate) fn case_1(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome { ours: ours(), ..Outcome::default() };
    outcome.claims.extend(own_table());
    let looks = run_context.looks(looks::CASE_1, 3);
    let printed = &CASE_1;
    let parameters = Parameters::CASE_1;
    for unit in Unit::BOTH {
        // What carries the gain does not depend on the unit.
        let contenders = match unit {
            Unit::Metres if run_context.is_repeat() => &ALL[..WITH_A_CLAIM],
            Unit::Metres => &ALL[..],
            Unit::Millimetres => &GREEDY_TOO[..],
        };
        let reading = Reading::Corrected;
        let trials = Trials { name: "Case 1", printed, parameters, unit, reading, contenders, looks };
        trials.evaluate(run_context, &mut outcome)?;
    }
    let (contenders, reading) = (&PAPERS_OWN[..], Reading::Printed);
    let parameters = Parameters { disperses_last: true, ..parameters };
    let unit = Unit::Millimetres;
    let runs = run_context.runs(RUNS_PRINTED, 3).min(RUNS_PRINTED);
    let looks = Looks::new(runs, 1);
    let trials = Trials { name: "Case 1 as printed", printed, parameters, unit, reading, contenders, looks };
    let mut field = Field::new(contenders.len());
    let all: Vec<usize> = (0..contenders.len()).collect();
    trials.run(run_context, &mut field, (&all, runs))?;
    outcome.tables.push(trials.table(&field));
    outcome.claims.push(verdicts::as_printed(&field, runs));
    Ok(outcome)
}

/// Case 2, in the unit whose values are near the paper's.
pub(crate) fn case_2(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome { ours: ours(), ..Outcome::default() };
    let trials = Trials {
        name: "Case 2",
        printed: &CASE_2,
        parameters: Parameters::CASE_2,
        unit: Unit::Millimetres,
        reading: Reading::Corrected,
        contenders: &PAPERS_OWN,
        // Never more than of case 1: --runs asks for few of everything.
        looks: run_context.looks_at_most(looks::CASE_2, 1),
    };
    trials.evaluate(run_context, &mut outcome)?;
    Ok(outcome)
}

impl Trials<'_> {
    /// Runs methods in the scenes below `runs` that they have not met.
    fn run(
        &self,
        run_context: &RunContext,
        field: &mut Field,
        (methods, runs): (&[usize], usize),
    ) -> Result<(), Stop> {
        let meeting = Meeting {
            model: self.unit.model(self.reading),
            fair: self.unit.model(Reading::Corrected),
            centres_m: Case::CENTRES_M,
            budget: run_context.choose(ENOUGH, QUICK),
        };
        for (i, contender) in self.contenders.iter().enumerate().filter(|(i, _)| methods.contains(i)) {
            let (name, unit) = (self.name, self.unit.name());
            run_context.say(&format!("  {name}, {unit}: {}, {runs} runs ..", contender.name));
            meeting.run(run_context, (&mut *field, i), &|| (contender.make)(self.parameters), runs)?;
        }
        Ok(())
    }

    /// All contenders meet at the first look, later those only of which some claim is not settled.
    fn evaluate(&self, run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
        let mut field = Field::new(self.contenders.len());
        let methods = verdicts::methods(self);
        let claims = settle(self.looks, |look| {
            let is_needed = |i: &usize| {
                look.is_first()
                    || methods.iter().enumerate().any(|(c, methods)| look.is_open(c) && methods.contains(i))
            };
            let needed: Vec<usize> = (0..self.contenders.len()).filter(is_needed).collect();
            self.run(run_context, &mut field, (&needed, look.runs))?;
            Ok::<_, Stop>(verdicts::claims(self, &field, look.level))
        })?;
        outcome.tables.push(self.table(&field));
        outcome.tables.push(self.course(&field));
        outcome.figures.push(self.figure(&field));
        outcome.claims.extend(claims);
        Ok(())
    }

    pub(super) fn title(&self) -> String {
        format!("{}, {}", self.name, self.unit.name())
    }

    fn table(&self, field: &Field) -> Table {
        let columns = [
            "",
            "paper, mean",
            "paper, sd",
            "population's best at the end, mean",
            "median",
            "best so far, median",
            "evaluations",
            "rises of the population's best",
            "end: less than BFOA by (%)",
            "best so far at equal evaluations: less than BFOA by (%)",
            "less than a free straight line",
            "free of collision",
        ];
        let all: Vec<usize> = (0..PAPERS_OWN.len().min(self.contenders.len())).collect();
        let free: Vec<usize> = field.free(&all).collect();
        let scenes = field.straight.len();
        let stuck = scenes - self.ever_free(field).count();
        let note = format!(
            "{} runs of ours, up to {scenes} of methods of which a row asked for more, {} of the paper; the same scene and first population for all. Means, medians [quartiles] and effects \
             [95 % intervals] are over scenes that end free of collision: means and medians where all of {} do ({} scenes), \
             effects where both methods do. In {stuck} scenes every method ends in collision.",
            self.looks.first(),
            self.printed.runs,
            PAPERS_OWN.map(|c| c.name).join(", "),
            free.len()
        );
        let mut table = Table::new(&self.title(), "cost J_c", &note, &columns);
        for (i, contender) in self.contenders.iter().enumerate() {
            table.row(contender.name, self.cells(field, i, &free));
        }
        let free: Vec<f64> = field.straight.iter().filter(|(_, is_free)| *is_free).map(|(c, _)| *c).collect();
        let mut cells = vec![Cell::None; columns.len() - 1];
        if !free.is_empty() {
            cells[4] = Cell::Median(Summary::of(&free));
        }
        cells[5] = Cell::Number(1.0);
        cells[10] = Cell::Share { count: free.len(), of: field.straight.len() };
        table.row("straight line, where it is free", cells);
        table
    }

    /// Scenes that some method leaves free of collision.
    fn ever_free<'a>(&'a self, field: &'a Field) -> impl Iterator<Item = usize> + 'a {
        let is_free =
            |run: &usize| field.collides.iter().any(|c| c.get(*run).is_some_and(|collides| !collides));
        (0..field.straight.len()).filter(is_free)
    }

    fn cells(&self, field: &Field, i: usize, free: &[usize]) -> Vec<Cell> {
        let courses = field.of(i);
        let paper = self.printed.moments(i).filter(|_| i < PAPERS_OWN.len());
        let maybe = |value: Option<f64>| value.map_or(Cell::None, Cell::Paper);
        let of = |figure: &dyn Fn(&Course) -> f64| -> Option<Summary> {
            let values: Vec<f64> = free.iter().filter_map(|run| courses.get(*run).map(figure)).collect();
            (!values.is_empty()).then(|| Summary::of(&values))
        };
        let (end, best) = (of(&Course::last), of(&|c| c.found.cost));
        let rises: usize = courses.iter().map(Course::rises).sum();
        let steps: usize = courses.iter().map(Course::steps).sum();
        let evaluations: f64 = courses.iter().map(Course::evaluations).sum();
        let free_lines = field.straight.iter().zip(courses).filter(|((_, is_free), _)| *is_free);
        let beaten = free_lines.clone().filter(|((line, _), c)| c.found.cost < *line).count();
        let collide = field.collides.get(i).map_or(0, |c| c.iter().filter(|c| **c).count());
        let effect = |effect: Effect| if i == 0 { Cell::None } else { Cell::estimate(effect.estimate) };
        vec![
            maybe(paper.map(|m| m.mean)),
            maybe(paper.map(|m| m.sd)),
            end.map_or(Cell::None, Cell::Mean),
            end.map_or(Cell::None, Cell::Median),
            best.map_or(Cell::None, Cell::Median),
            Cell::number(evaluations / courses.len().max(1) as f64),
            Cell::Share { count: rises, of: steps },
            effect(field.at_the_end([i, 0], [""; 2], Level::FIVE_PERCENT)),
            effect(field.at_equal_evaluations([i, 0], [""; 2], Level::FIVE_PERCENT)),
            Cell::Share { count: beaten, of: free_lines.count() },
            Cell::Share { count: courses.len() - collide, of: courses.len() },
        ]
    }

    /// The mean curves of figures 2 and 3, over scenes that end free of collision.
    fn course(&self, field: &Field) -> Table {
        const SHARES: [f64; 6] = [0.02, 0.1, 0.25, 0.5, 0.75, 1.0];
        let all: Vec<usize> = (0..PAPERS_OWN.len().min(self.contenders.len())).collect();
        let free: Vec<usize> = field.free(&all).collect();
        let heading = SHARES.map(|share| format!("after {:.0} % of the iterations", 100.0 * share));
        let columns: Vec<&str> = std::iter::once("").chain(heading.iter().map(String::as_str)).collect();
        let note = format!(
            "population's best, mean ± deviation over the {} scenes that the paper's three methods end free of collision",
            free.len()
        );
        let name = format!("Figures 2 and 3: mean curves, {}", self.title());
        let mut table = Table::new(&name, "cost J_c", &note, &columns);
        for (i, contender) in self.contenders.iter().enumerate() {
            let at = |share: f64| {
                let costs = free.iter().filter_map(|run| field.of(i).get(*run)?.after(share));
                let costs: Vec<f64> = costs.collect();
                if costs.is_empty() { Cell::None } else { Cell::Mean(Summary::of(&costs)) }
            };
            table.row(contender.name, SHARES.map(at).to_vec());
        }
        table
    }

    fn figure(&self, field: &Field) -> Figure {
        let mut panel = Panel::new("iterations", "population's best (J_c)");
        panel.is_log = true;
        for (contender, courses) in self.contenders.iter().zip(&field.courses) {
            panel.spread(contender.name, &curve(courses, POINTS));
        }
        let file =
            format!("000-{}.svg", self.title().to_lowercase().replace([',', ' '], "-").replace("--", "-"));
        let title = format!("Paper 000, {}: median and quartiles of all runs", self.title());
        Figure::of(&file, &title, 1, &[panel])
    }
}

/// What the paper's own table says, by its own numbers.
fn own_table() -> Vec<Claim> {
    let one = |name: &str, case: &Printed| {
        let p = |i: usize| {
            let both = case.moments(1).zip(case.moments(i));
            both.and_then(|(a, b)| welch(a, b)).unwrap_or(f64::NAN)
        };
        let [bfoa, bso] = [p(0), p(2)];
        Claim::exact(
            &format!("Table 2 shows IBFOA to be better than BFOA and BSO ({name})"),
            "Welch's test on the printed means, deviations and numbers of runs, at 5 %, against both",
            bfoa < crate::statistics::SIGNIFICANT && bso < crate::statistics::SIGNIFICANT,
            format!("p = {} against BFOA, p = {} against BSO", figures(bfoa), figures(bso)),
        )
    };
    vec![one("case 1", &CASE_1), one("case 2", &CASE_2)]
}
