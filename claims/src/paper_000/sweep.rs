//! Numbers that the paper does not print: the unit of L, where the spheres are, BSO's constants, and the tree's step.
use super::contenders::{BFOA, BSO, IBFOA};
use super::meeting::{Field, Meeting};
use super::{Unit, trees};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::looks::{self, Look, settle};
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::Level;
use crate::swept::{At, FACTORS, Values, at_some, label};
use crate::table::{Cell, Table};
use taustream_optimizers::cost::CostModel;
use taustream_optimizers::papers::control_points::Case;
use taustream_optimizers::{Bso, Optimizer, Parameters, Reading, Setup};

/// Places of the claims.
const BETTER: usize = 0;
const FASTER: usize = 1;
const BETTER_THAN_BSO: usize = 2;
/// The place of BSO with our constants.
const PAPERS_BSO: usize = 2;

const QUICK_RUNS: usize = 2;
const QUICK: usize = 130;
/// Weights of L over ours, which is 7 a metre; the last one is 7 a millimetre.
const UNITS: [f64; 3] = [1.0, 31.622_776_6, 1_000.0];
/// Sides of the box of the spheres' centres over ours, a decade: a smaller one leaves the arm no room.
const BOXES: [f64; 2] = [0.562_341_325, 5.623_413_25];

/// A constant of BSO.
struct Swept {
    name: &'static str,
    ours: f64,
    make: fn(f64, Bso) -> Bso,
}

const SWEPT: [Swept; 3] = [
    Swept { name: "w", ours: Bso::INERTIA, make: |inertia, ours| Bso { inertia, ..ours } },
    Swept { name: "c_1", ours: Bso::PULLS[0], make: |c, ours| Bso { pulls: [c, Bso::PULLS[1]], ..ours } },
    Swept { name: "c_2", ours: Bso::PULLS[1], make: |c, ours| Bso { pulls: [Bso::PULLS[0], c], ..ours } },
];

/// The methods at one weight of L and one size of the box: BFOA, IBFOA, BSO, and BSO with other constants.
struct Comparison {
    meeting: Meeting,
    makes: Vec<Box<dyn Fn() -> Box<dyn Optimizer> + Sync>>,
    field: Field,
    /// What stands in the table: a value, and the BSO there.
    rows: Vec<(String, usize)>,
}

impl Comparison {
    /// At a weight of L and a size of the box over ours, also with other constants of BSO.
    fn new(
        run_context: &RunContext,
        label: String,
        [weight, size]: [f64; 2],
        constants: &'static [Swept],
    ) -> Self {
        let mut model = Unit::Metres.model(Reading::Corrected);
        model.weights[0] *= weight;
        let meeting = Meeting {
            model,
            fair: model,
            centres_m: Case::CENTRES_M.map(|ends| ends.map(|end| size * end)),
            budget: run_context.choose(usize::MAX, QUICK),
        };
        let mut makes: Vec<Box<dyn Fn() -> Box<dyn Optimizer> + Sync>> = Vec::new();
        for contender in [BFOA, IBFOA, BSO] {
            makes.push(Box::new(move || (contender.make)(Parameters::CASE_1)));
        }
        let mut rows = vec![(label, PAPERS_BSO)];
        for Swept { name, ours, make } in constants {
            for value in FACTORS.map(|factor| factor * ours) {
                rows.push((self::label(&format!("BSO: {name}"), value), makes.len()));
                let paper = || Bso { parameters: Parameters::CASE_1, ..Bso::set_up(Setup::default()) };
                makes.push(Box::new(move || Box::new(make(value, paper()))));
            }
        }
        Self { meeting, field: Field::new(makes.len()), makes, rows }
    }

    /// All methods at the first look; later the paper's own two or the BSOs, as their claims are open.
    fn run(&mut self, run_context: &RunContext, look: &Look) -> Result<(), Stop> {
        let label = self.rows.first().map_or("", |(label, _)| label.as_str());
        run_context.say(&format!("  {label}, {} scenes ..", look.runs));
        let is_bfoa_open = look.is_open(BETTER) || look.is_open(FASTER);
        for (method, make) in self.makes.iter().enumerate() {
            let is_needed = match method {
                0 => is_bfoa_open,
                1 => is_bfoa_open || look.is_open(BETTER_THAN_BSO),
                _ => look.is_open(BETTER_THAN_BSO),
            };
            if is_needed {
                self.meeting.run(run_context, (&mut self.field, method), make.as_ref(), look.runs)?;
            }
        }
        Ok(())
    }

    fn at_the_end(&self, bso: usize, level: Level) -> Effect {
        self.field.at_the_end([1, bso], ["IBFOA", "BSO"], level)
    }

    /// IBFOA less than BFOA, at the end and after a quarter.
    fn bfoa(&self, level: Level) -> [Effect; 2] {
        let names = ["IBFOA", "BFOA"];
        [self.field.at_the_end([1, 0], names, level), self.field.after_a_quarter([1, 0], names, level)]
    }

    fn cells(&self, bso: usize) -> Vec<Cell> {
        let level = Level::FIVE_PERCENT;
        let bfoa = self
            .bfoa(level)
            .map(|effect| if bso == PAPERS_BSO { Cell::estimate(effect.estimate) } else { Cell::None });
        let of = self.field.of(1).len().min(self.field.of(bso).len());
        let free = Cell::Share { count: self.field.free(&[1, bso]).count(), of };
        let bso = Cell::estimate(self.at_the_end(bso, level).estimate);
        std::iter::once(free).chain(bfoa).chain([bso]).collect()
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut comparisons = Vec::new();
    for (i, factor) in UNITS.into_iter().enumerate() {
        let label = label("weight of L (1/m)", factor * CostModel::default().weights[0]);
        let constants = if i == 0 { &SWEPT[..] } else { &[] };
        comparisons.push(Comparison::new(run_context, label, [factor, 1.0], constants));
    }
    for size in BOXES {
        let label = format!("centres' box times {}", figures(size));
        comparisons.push(Comparison::new(run_context, label, [1.0, size], &[]));
    }
    let looks = run_context.looks_at_most(looks::UNPRINTED_000, QUICK_RUNS);
    let claims = settle(looks, |look| {
        comparisons.iter_mut().try_for_each(|comparison| comparison.run(run_context, look))?;
        Ok::<_, Stop>(claims(&comparisons, look.level))
    })?;
    let (tree_table, tree_claim) = trees::over_steps(run_context, looks.first())?;
    let tables = vec![table(&comparisons), tree_table];
    Ok(Outcome { tables, claims: [claims, vec![tree_claim]].concat(), ..Outcome::default() })
}

/// In the order of [`BETTER`], [`FASTER`], [`BETTER_THAN_BSO`].
fn claims(comparisons: &[Comparison], level: Level) -> Vec<Claim> {
    let values = Values { count: comparisons.len(), level };
    let bfoa = |which: usize| -> Vec<At> {
        let at = |comparison: &Comparison| {
            let label = comparison.rows.first().map_or("", |(label, _)| label.as_str());
            At::some(label, values, |level| comparison.bfoa(level)[which..=which].to_vec())
        };
        comparisons.iter().map(at).collect()
    };
    let rows =
        || comparisons.iter().flat_map(|comparison| comparison.rows.iter().map(move |row| (comparison, row)));
    let values = Values { count: rows().count(), level };
    let bso = rows().map(|(comparison, (label, bso))| {
        At::some(label.as_str(), values, |level| vec![comparison.at_the_end(*bso, level)])
    });
    let rule = "in scenes that both leave without collision, the population's best at the end is less: above 0 (holds), below 2 % (does not \
                hold), or neither";
    let quarter = "the population's best after a quarter of the iterations is less: above 0 (holds), below 2 % (does not hold), or neither";
    vec![
        at_some("IBFOA finds better solutions than BFOA", rule, &bfoa(0)),
        at_some("IBFOA converges faster than BFOA", quarter, &bfoa(1)),
        at_some("IBFOA finds better solutions than BSO", rule, &bso.collect::<Vec<_>>()),
    ]
}

fn table(comparisons: &[Comparison]) -> Table {
    let columns = [
        "",
        "scenes free of collision",
        "IBFOA less than BFOA, at the end (%)",
        "after a quarter (%)",
        "IBFOA less than BSO, at the end (%)",
    ];
    let note = format!(
        "case 1; ours: L in m (7 a metre), centres in x, y ±0.8 m, z 0 to 0.9 m, BSO with w = {}, c_1 = {}, c_2 = {}; each row changes one of \
         them; effect [95 % interval]",
        Bso::INERTIA,
        Bso::PULLS[0],
        Bso::PULLS[1]
    );
    let mut table = Table::new("Numbers that the paper does not print", "cost J_c", &note, &columns);
    for comparison in comparisons {
        comparison.rows.iter().for_each(|(label, bso)| table.row(label.clone(), comparison.cells(*bso)));
    }
    table
}
