//! Numbers that the paper does not print: the unit of L, where the spheres are, BSO's constants, and the tree's step.
use super::contenders::{BFOA, BSO, IBFOA};
use super::meeting::{Field, Meeting};
use super::{Unit, trees};
use crate::effect::Effect;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::swept::{At, FACTORS, at_some, label};
use crate::table::{Cell, Table};
use taustream_optimizers::cost::CostModel;
use taustream_optimizers::papers::control_points::Case;
use taustream_optimizers::{Bso, Parameters, Reading, Setup};

const RUNS: usize = 14;
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

/// The paper's three at one value; with BSO's constants, IBFOA against BSO alone.
struct Setting {
    label: String,
    free: usize,
    of: usize,
    /// IBFOA less than BFOA: at the end, after a quarter.
    bfoa: Option<[Effect; 2]>,
    /// IBFOA less than BSO at the end.
    bso: Effect,
}

impl Setting {
    /// The methods are BFOA, IBFOA, BSO, and BSO's variants.
    fn of(label: String, field: &Field, bso: usize) -> Self {
        let both = [1, 0];
        let bfoa = (bso == 2)
            .then(|| [field.at_the_end(both, "IBFOA", "BFOA"), field.after_a_quarter(both, "IBFOA", "BFOA")]);
        Self {
            label,
            free: field.free(&[1, bso]).count(),
            of: field.straight.len(),
            bfoa,
            bso: field.at_the_end([1, bso], "IBFOA", "BSO"),
        }
    }

    fn cells(&self) -> Vec<Cell> {
        let of = |which: usize| {
            self.bfoa.as_ref().map_or(Cell::None, |effects| Cell::estimate(effects[which].estimate))
        };
        vec![Cell::Share { count: self.free, of: self.of }, of(0), of(1), Cell::estimate(self.bso.estimate)]
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut settings = Vec::new();
    for (i, factor) in UNITS.into_iter().enumerate() {
        let label = label("weight of L (1/m)", factor * CostModel::default().weights[0]);
        let constants = if i == 0 { &SWEPT[..] } else { &[] };
        settings.extend(meet(run_context, label, [factor, 1.0], constants)?);
    }
    for size in BOXES {
        let label = format!("centres' box times {}", figures(size));
        settings.extend(meet(run_context, label, [1.0, size], &[])?);
    }
    let (tree_table, tree_claim) =
        trees::over_steps(run_context, run_context.runs(RUNS, QUICK_RUNS).min(RUNS))?;
    let bfoa = |which: usize| -> Vec<At> {
        let at =
            |s: &Setting| s.bfoa.as_ref().map(|effects| At::all(s.label.clone(), &effects[which..=which]));
        settings.iter().filter_map(at).collect()
    };
    let bso: Vec<At> =
        settings.iter().map(|s| At::all(s.label.clone(), std::slice::from_ref(&s.bso))).collect();
    let rule = "in scenes that both leave without collision, the population's best at the end is less: above 0 (holds), below 2 % (does not \
                hold), or neither";
    let quarter = "the population's best after a quarter of the iterations is less: above 0 (holds), below 2 % (does not hold), or neither";
    let claims = vec![
        at_some("IBFOA finds better solutions than BFOA", rule, &bfoa(0)),
        at_some("IBFOA converges faster than BFOA", quarter, &bfoa(1)),
        at_some("IBFOA finds better solutions than BSO", rule, &bso),
        tree_claim,
    ];
    Ok(Outcome { tables: vec![table(&settings), tree_table], claims, ..Outcome::default() })
}

/// The methods at a weight of L and a size of the box over ours, also with other constants of BSO.
fn meet(
    run_context: &RunContext,
    label: String,
    [weight, size]: [f64; 2],
    constants: &[Swept],
) -> Result<Vec<Setting>, Stop> {
    run_context.say(&format!("  {label} .."));
    let mut model = Unit::Metres.model(Reading::Corrected);
    model.weights[0] *= weight;
    let meeting = Meeting {
        model,
        fair: model,
        centres_m: Case::CENTRES_M.map(|ends| ends.map(|end| size * end)),
        runs: run_context.runs(RUNS, QUICK_RUNS).min(RUNS),
        budget: run_context.choose(usize::MAX, QUICK),
    };
    let mut courses = Vec::new();
    for contender in [BFOA, IBFOA, BSO] {
        courses.push(meeting.courses(run_context, &|| (contender.make)(Parameters::CASE_1))?);
    }
    let mut labels = vec![(label, 2)];
    for Swept { name, ours, make } in constants {
        for value in FACTORS.map(|factor| factor * ours) {
            labels.push((self::label(&format!("BSO: {name}"), value), courses.len()));
            let paper = || Bso { parameters: Parameters::CASE_1, ..Bso::set_up(Setup::default()) };
            courses.push(meeting.courses(run_context, &|| Box::new(make(value, paper())))?);
        }
    }
    let field = meeting.field(run_context, courses)?;
    Ok(labels.into_iter().map(|(label, bso)| Setting::of(label, &field, bso)).collect())
}

fn table(settings: &[Setting]) -> Table {
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
    settings.iter().for_each(|setting| table.row(setting.label.clone(), setting.cells()));
    table
}
