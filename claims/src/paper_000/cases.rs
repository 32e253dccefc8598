//! Case 1 and case 2: IBFOA, BFOA and BSO on random scenes, their variants, random sampling, and the straight line.
use super::contenders::{ALL, Contender, LONG, PAPERS_OWN};
use super::course::{Course, curve, equal_evaluations, follow};
use super::{Unit, case, ours, refused, ur5};
use crate::chart::Panel;
use crate::claim::Claim;
use crate::figure::Figure;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Moments, Paired, Summary, welch, wilcoxon};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::control_points::CONTROL_POINTS;
use taustream_optimizers::{Parameters, Reading};

/// Above any schedule of the paper's.
const ENOUGH: usize = 50_000_000;
/// Evaluations of a quick run.
const QUICK: usize = 260;
/// Points of a curve.
const POINTS: usize = 160;
/// Fewest pairs of which the signed-rank test can say anything at 5 %: with five, the least p is 0.0625.
const PAIRS_MIN: usize = 6;

/// A column of the paper's table 2: means and deviations in the order of [`PAPERS_OWN`].
struct Printed {
    runs: usize,
    mean: [f64; 3],
    sd: [f64; 3],
}

const CASE_1: Printed = Printed { runs: 300, mean: [2.08e4, 1.96e4, 2.01e4], sd: [1.12e4, 1.04e4, 1.28e4] };
const CASE_2: Printed = Printed { runs: 20, mean: [1.37e4, 1.24e4, 1.82e4], sd: [6.13e3, 3.89e3, 8.95e3] };

impl Printed {
    fn moments(&self, i: usize) -> Option<Moments> {
        let (mean, sd) = (*self.mean.get(i)?, *self.sd.get(i)?);
        Some(Moments { n: self.runs, mean, sd })
    }
}

/// What is run.
struct Trials<'a> {
    name: &'static str,
    printed: &'a Printed,
    parameters: Parameters,
    unit: Unit,
    reading: Reading,
    contenders: &'a [Contender],
    runs: usize,
}

/// What came of it.
struct Field {
    /// Method by method, run by run.
    courses: Vec<Vec<Course>>,
    /// Cost of the straight line of each run, and whether it is free.
    straight: Vec<(f64, bool)>,
    /// Of each method: runs whose best collides by the least distance.
    colliding: Vec<usize>,
}

/// Case 1 in both units, as printed and corrected.
pub(crate) fn case_1(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome { ours: ours(), ..Outcome::default() };
    outcome.claims.extend(own_table());
    let runs = run_context.runs(CASE_1.runs, 3);
    let printed = &CASE_1;
    let parameters = Parameters::CASE_1;
    for unit in Unit::BOTH {
        let (contenders, reading) = (&ALL[..], Reading::Corrected);
        let trials = Trials { name: "Case 1", printed, parameters, unit, reading, contenders, runs };
        trials.evaluate(run_context, &mut outcome)?;
    }
    let (contenders, reading) = (&PAPERS_OWN[..], Reading::Printed);
    let parameters = Parameters { disperses_last: true, ..parameters };
    let unit = Unit::Millimetres;
    let trials = Trials { name: "Case 1 as printed", printed, parameters, unit, reading, contenders, runs };
    let field = trials.run(run_context)?;
    outcome.tables.push(trials.table(&field));
    outcome.claims.push(as_printed(&field, runs));
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
        contenders: &LONG,
        // As many for each of case 1 as in the paper: its twenty take hours of its computer, and minutes of ours.
        runs: (run_context.runs(CASE_1.runs, 1) * CASE_2.runs / CASE_1.runs).clamp(1, CASE_2.runs),
    };
    trials.evaluate(run_context, &mut outcome)?;
    Ok(outcome)
}

impl Trials<'_> {
    fn run(&self, run_context: &RunContext) -> Result<Field, Stop> {
        let robot = ur5()?;
        let budget = run_context.choose(ENOUGH, QUICK);
        let model = self.unit.model(self.reading);
        let mut field = Field { courses: Vec::new(), straight: Vec::new(), colliding: Vec::new() };
        for contender in self.contenders {
            run_context.say(&format!(
                "  {}, {}: {}, {} runs ..",
                self.name,
                self.unit.name(),
                contender.name,
                self.runs
            ));
            let one = |run: usize| -> Result<Course, Stop> {
                let problem = case(run_context, &robot, run)?
                    .problem(&robot, CONTROL_POINTS, model)
                    .map_err(refused)?;
                follow(
                    run_context,
                    (contender.make)(self.parameters).as_ref(),
                    &problem,
                    run_context.seed(run),
                    budget,
                )
            };
            field.courses.push(run_context.each(self.runs, one)?);
        }
        // What is free is decided by the least distance, whatever was optimised.
        let fair = self.unit.model(Reading::Corrected);
        for run in 0..self.runs {
            let problem =
                case(run_context, &robot, run)?.problem(&robot, CONTROL_POINTS, fair).map_err(refused)?;
            let straight = problem.straight();
            let rated = problem.rate_exactly(&straight);
            field.straight.push(rated.map_or((f64::NAN, false), |c| (c.cost, !c.collision)));
            field.colliding.resize(field.courses.len(), 0);
            for (count, courses) in field.colliding.iter_mut().zip(&field.courses) {
                let rated = courses.get(run).and_then(|c| problem.rate_exactly(&c.found.x));
                *count += usize::from(rated.is_none_or(|c| c.collision));
            }
        }
        Ok(field)
    }

    fn evaluate(&self, run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
        let field = self.run(run_context)?;
        outcome.tables.push(self.table(&field));
        outcome.figures.push(self.figure(&field));
        outcome.claims.extend(self.claims(&field));
        Ok(())
    }

    fn title(&self) -> String {
        format!("{}, {}", self.name, self.unit.name())
    }

    fn table(&self, field: &Field) -> Table {
        let columns = [
            "",
            "paper, mean",
            "paper, sd",
            "population's best at the end",
            "best so far",
            "evaluations",
            "rises of the population's best",
            "end, less:more than BFOA",
            "best so far at equal evaluations, less:more than BFOA",
            "less than a free straight line",
            "free of collision",
        ];
        let note = format!(
            "{} runs of ours, {} of the paper; mean ± deviation over scenes; the same scene and first population for all. \
             Signed-rank tests pair by scene.",
            self.runs, self.printed.runs
        );
        let mut table = Table::new(&self.title(), "cost J_c", &note, &columns);
        for (i, (contender, courses)) in self.contenders.iter().zip(&field.courses).enumerate() {
            let paper = self.printed.moments(i);
            let maybe = |value: Option<f64>| value.map_or(Cell::None, Cell::Paper);
            let rises: usize = courses.iter().map(Course::rises).sum();
            let steps: usize = courses.iter().map(Course::steps).sum();
            let evaluations: f64 = courses.iter().map(Course::evaluations).sum();
            let free_lines = field.straight.iter().zip(courses).filter(|((_, is_free), _)| *is_free);
            let beaten = free_lines.clone().filter(|((line, _), c)| c.found.cost < *line).count();
            let collides = field.colliding.get(i).copied().unwrap_or(0);
            table.row(
                contender.name,
                vec![
                    maybe(paper.map(|m| m.mean)),
                    maybe(paper.map(|m| m.sd)),
                    Cell::Mean(ends(courses)),
                    Cell::Mean(bests(courses)),
                    Cell::number(evaluations / courses.len().max(1) as f64),
                    Cell::Share { count: rises, of: steps },
                    if i == 0 { Cell::None } else { Cell::Test(field.at_the_end(i, 0)) },
                    if i == 0 { Cell::None } else { Cell::Test(field.at_equal_evaluations(i, 0)) },
                    Cell::Share { count: beaten, of: free_lines.count() },
                    Cell::Share { count: courses.len() - collides, of: courses.len() },
                ],
            );
        }
        let free: Vec<f64> = field.straight.iter().filter(|(_, is_free)| *is_free).map(|(c, _)| *c).collect();
        let mut cells = vec![Cell::None; columns.len() - 1];
        if !free.is_empty() {
            cells[3] = Cell::Mean(Summary::of(&free));
        }
        cells[4] = Cell::Number(1.0);
        cells[9] = Cell::Share { count: free.len(), of: field.straight.len() };
        table.row("straight line, where it is free", cells);
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
        let title = format!("Paper 000, {}: median and quartiles of {} runs", self.title(), self.runs);
        Figure::of(&file, &title, 1, &[panel])
    }

    fn claims(&self, field: &Field) -> Vec<Claim> {
        let title = self.title();
        let shares = |i: usize, j: usize| {
            let mean = |k: usize| field.courses.get(k).map_or(f64::NAN, |c| ends(c).mean);
            100.0 * (mean(i) / mean(j) - 1.0)
        };
        let less = |i: usize, name: &str| {
            let (end, best) = (field.at_the_end(1, i), field.at_equal_evaluations(1, i));
            self.compared(
                &format!("IBFOA finds better solutions than {name} ({title})"),
                end,
                format!(
                    "mean {:+.1} %, {}; best so far at equal evaluations: {}",
                    shares(1, i),
                    words(end),
                    words(best)
                ),
            )
        };
        let mut claims = vec![less(0, "BFOA"), less(2, "BSO")];
        claims.push(self.stability(field));
        claims.push(self.steps_up(field));
        let evaluations =
            |i: usize| field.courses.get(i).map_or(f64::NAN, |c| mean(c.iter().map(Course::evaluations)));
        claims.push(Claim::decided(
            &format!("IBFOA needs nearly no extra computation ({title})"),
            "its evaluations are at most 1 % more than BFOA's",
            evaluations(1) <= 1.01 * evaluations(0),
            format!("{} against {} evaluations a run", figures(evaluations(1)), figures(evaluations(0))),
        ));
        claims.extend(self.variants(field));
        claims
    }

    /// A claim about the populations at the end.
    fn compared(&self, says: &str, end: Paired, numbers: String) -> Claim {
        if self.runs < PAIRS_MIN {
            return Claim::unchecked(says, "with so few runs no difference is significant", numbers);
        }
        let rule = "the population's best at the end is less than the other's by the signed-rank test at 5 %";
        Claim::decided(says, rule, end.is_less(), numbers)
    }

    /// The paper reads stability off the deviation over scenes, which is mostly that of the scenes. What is left of it
    /// after each scene's mean over the paper's methods is taken off says more.
    fn stability(&self, field: &Field) -> Claim {
        let own = |i: usize| -> Vec<f64> {
            let of = |c: &Vec<Course>, run: usize| c.get(run).map_or(f64::NAN, Course::last);
            let all = || field.courses.iter().take(PAPERS_OWN.len());
            let scene = |run: usize| mean(all().map(|c| of(c, run)));
            (0..self.runs)
                .map(|run| field.courses.get(i).map_or(f64::NAN, |c| of(c, run)) / scene(run))
                .collect()
        };
        let [bfoa, ibfoa] = [0, 1].map(|i| Summary::of(&own(i)));
        let raw = [0, 1].map(|i| field.courses.get(i).map_or(f64::NAN, |c| ends(c).sd));
        let says = format!("IBFOA is more stable than BFOA: a deviation 7 % less ({})", self.title());
        if self.runs < PAIRS_MIN || raw[0] <= 0.0 || bfoa.sd <= 0.0 {
            return Claim::unchecked(
                &says,
                "six runs at least, and runs that differ",
                format!("{} runs", self.runs),
            );
        }
        Claim::decided(
            &says,
            "deviations, of the population's best at the end and of its ratio to its scene's mean, are both less",
            raw[1] < raw[0] && ibfoa.sd < bfoa.sd,
            format!(
                "deviation {:+.1} %, with the scene's part taken off {:+.1} %",
                100.0 * (raw[1] / raw[0] - 1.0),
                100.0 * (ibfoa.sd / bfoa.sd - 1.0)
            ),
        )
    }

    /// Steps of the mean curve at dispersals.
    fn steps_up(&self, field: &Field) -> Claim {
        let every = self.parameters.tumbles * self.parameters.reproductions;
        let share = |i: usize| -> (usize, usize) {
            let pairs = field.courses.get(i).into_iter().flatten().flat_map(|c| c.dispersals(every));
            pairs.fold((0, 0), |(up, all), [before, after]| (up + usize::from(after > before), all + 1))
        };
        let rises = field.courses.get(1).map_or(0, |c| c.iter().map(Course::rises).sum());
        let ([a, b], of) = ([share(1), share(0)], |(up, all): (usize, usize)| format!("{up} of {all}"));
        Claim::decided(
            &format!("The elite keeps IBFOA's fitness from rising ({})", self.title()),
            "the population's best of IBFOA rises in no iteration of any run",
            rises == 0,
            format!("{rises} rises in all; right after dispersals: IBFOA {}, BFOA {}", of(a), of(b)),
        )
    }

    /// What carries the difference, where the variants were run.
    fn variants(&self, field: &Field) -> Vec<Claim> {
        let at = |name: &str| self.contenders.iter().position(|c| c.name == name);
        let mut claims = Vec::new();
        let mut compare = |says: &str, first: Option<usize>, second: Option<usize>| {
            if let (Some(a), Some(b)) = (first, second) {
                let (end, best) = (field.at_the_end(a, b), field.at_equal_evaluations(a, b));
                claims.push(self.compared(
                    &format!("{says} ({})", self.title()),
                    end,
                    format!("{}; best so far at equal evaluations: {}", words(end), words(best)),
                ));
            }
        };
        let elite = at("BFOA with the printed elite, no decay");
        compare("Preserving the elite improves BFOA, without decay", elite, Some(0));
        compare("Decaying survivors and dispersal improve BFOA with an elite", Some(1), elite);
        compare(
            "Not in the paper: taking worsening steps back is better than IBFOA",
            at("greedy BFOA"),
            Some(1),
        );
        claims
    }
}

impl Field {
    /// Population's best at the end, method `i` against `j`.
    fn at_the_end(&self, i: usize, j: usize) -> Paired {
        let of = |k: usize| -> Vec<f64> { self.of(k).iter().map(Course::last).collect() };
        wilcoxon(&of(i), &of(j))
    }

    /// Best so far at equal evaluations, method `i` against `j`.
    fn at_equal_evaluations(&self, i: usize, j: usize) -> Paired {
        let [ours, theirs] = equal_evaluations(self.of(i), self.of(j));
        wilcoxon(&ours, &theirs)
    }

    fn of(&self, i: usize) -> &[Course] {
        self.courses.get(i).map_or(&[], Vec::as_slice)
    }
}

fn ends(courses: &[Course]) -> Summary {
    Summary::of(&courses.iter().map(Course::last).collect::<Vec<_>>())
}

fn bests(courses: &[Course]) -> Summary {
    Summary::of(&courses.iter().map(|c| c.found.cost).collect::<Vec<_>>())
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    Summary::of(&values.collect::<Vec<_>>()).mean
}

fn words(test: Paired) -> String {
    format!("{} less, {} more, p = {}", test.less, test.more, figures(test.p))
}

/// What the paper's own table says, by its own numbers.
fn own_table() -> Vec<Claim> {
    let one = |name: &str, case: &Printed| {
        let p = |i: usize| {
            let both = case.moments(1).zip(case.moments(i));
            both.and_then(|(a, b)| welch(a, b)).unwrap_or(f64::NAN)
        };
        let [bfoa, bso] = [p(0), p(2)];
        Claim::decided(
            &format!("Table 2 shows IBFOA to be better than BFOA and BSO ({name})"),
            "Welch's test on the printed means, deviations and numbers of runs, at 5 %, against both",
            bfoa < crate::statistics::SIGNIFICANT && bso < crate::statistics::SIGNIFICANT,
            format!("p = {} against BFOA, p = {} against BSO", figures(bfoa), figures(bso)),
        )
    };
    vec![one("case 1", &CASE_1), one("case 2", &CASE_2)]
}

/// Eq. 3.9 adds the distances to all links: what its optima are worth.
fn as_printed(field: &Field, runs: usize) -> Claim {
    let colliding: Vec<String> =
        PAPERS_OWN.iter().zip(&field.colliding).map(|(c, n)| format!("{} {n} of {runs}", c.name)).collect();
    Claim::decided(
        "The optimised trajectories are free of collisions, with the penalty of eq. 3.8 and 3.9 as printed",
        "no best trajectory of the three methods comes nearer to a sphere than its radius and expansion",
        field.colliding.iter().all(|n| *n == 0),
        format!("colliding: {}", colliding.join(", ")),
    )
}
