//! What the runs of a case say of the paper's claims.
//!
//! The methods meet in the same scenes, so a difference is that of pairs. Only scenes in which both end free of collision
//! count: elsewhere the penalty, which is a thousand times the rest, measures how deep a path collides.
use super::cases::Trials;
use super::contenders::PAPERS_OWN;
use super::course::{Course, equal_evaluations};
use super::meeting::Field;
use crate::claim::{Claim, Verdict};
use crate::effect::{Claimed, Effect};
use crate::statistics::{Level, quantile};

/// A mean distance from the median that is smaller by less than this is as large (%); the paper claims 7.
const STEADIER_PERCENT: f64 = 2.0;
/// A rise of the mean curve at dispersals below this is none (%).
const RISE_PERCENT: f64 = 1.0;

/// A gain in cost below this is none (%): a third of the 6 that the paper claims.
const GAIN_PERCENT: f64 = 2.0;
/// A population's best above the scene's median by this factor collides.
const COLLIDING: f64 = 3.0;
/// Costs are positive.
const FLOOR: f64 = f64::MIN_POSITIVE;

const BOTH_FREE: &str = "in scenes that both leave without collision, the population's best at the end is less: the interval lies above 0 \
     (holds), below 2 % (does not hold), or neither";

/// The methods, by their places among the contenders, of which each of [`claims`] may ask for further scenes. A spread needs
/// thousands of scenes: that row takes those that the others ask for.
pub(super) fn methods(trials: &Trials) -> Vec<Vec<usize>> {
    let own = [vec![0, 1], vec![1, 2], vec![0, 1], Vec::new(), vec![0, 1], vec![0, 1]];
    let pairs = variant_pairs(trials).into_iter().map(|(_, pair)| pair.map(|(i, _)| i).to_vec());
    own.into_iter().chain(pairs).collect()
}

/// The verdicts.
pub(super) fn claims(trials: &Trials, field: &Field, level: Level) -> Vec<Claim> {
    let title = trials.title();
    let less = |i: usize, name: &str| {
        let says = format!("IBFOA finds better solutions than {name} ({title})");
        compared((field, level), &says, [(1, "IBFOA"), (i, name)])
    };
    let mut claims = vec![
        less(0, "BFOA"),
        less(2, "BSO"),
        faster((field, level), &title),
        steadier((field, level), &title),
    ];
    claims.push(elite(trials, (field, level)));
    let logs = field.logs([1, 0], |c| Some(c.evaluations()));
    claims.push(Claim::tested(
        &format!("IBFOA needs nearly no extra computation ({title})"),
        "its evaluations are less than 1 % more than BFOA's",
        vec![Effect::no_rise("evaluations of IBFOA over BFOA's, more by", &logs, (RISE_PERCENT, level))],
    ));
    claims.extend(variants(trials, (field, level)));
    claims
}

fn compared(
    (field, level): (&Field, Level),
    says: &str,
    [(i, ours), (j, theirs)]: [(usize, &str); 2],
) -> Claim {
    let (end, best) = (
        field.at_the_end([i, j], [ours, theirs], level),
        field.at_equal_evaluations([i, j], [ours, theirs], level),
    );
    let verdict = end.verdict();
    Claim::weighed(says, BOTH_FREE, verdict, vec![end])
        .beside(format!("best so far at equal evaluations: {best}"))
}

/// Figures 2 and 3 show IBFOA below BFOA from the first iterations on.
fn faster((field, level): (&Field, Level), title: &str) -> Claim {
    Claim::tested(
        &format!("IBFOA converges faster than BFOA ({title})"),
        "the population's best after a quarter of the iterations is less: above 0 (holds), below 2 % (does not hold), or neither",
        vec![field.after_a_quarter([1, 0], ["IBFOA", "BFOA"], level)],
    )
}

/// The paper reads stability off the deviation over scenes, which is mostly that of the scenes. What is left of it after
/// each scene's median over the paper's methods is taken off says more.
fn steadier((field, level): (&Field, Level), title: &str) -> Claim {
    let all: Vec<usize> = (0..PAPERS_OWN.len()).collect();
    let own = |i: usize| -> Vec<f64> {
        let of = |k: usize, run: usize| field.of(k).get(run).map_or(f64::NAN, |c| c.last().ln());
        let scene = |run: usize| quantile(&all.iter().map(|k| of(*k, run)).collect::<Vec<_>>(), 0.5);
        // A population that ends in collision beside free ones says how deep it collides, not how steady the method is.
        let ends_free = |run: &usize| all.iter().all(|k| of(*k, *run) - scene(*run) < COLLIDING.ln());
        field.free(&all).filter(ends_free).map(|run| of(i, run) - scene(run)).collect()
    };
    Claim::tested(
        &format!("IBFOA is more stable than BFOA: a deviation 7 % less ({title})"),
        "the logarithm of the population's best at the end, less the scene's median over the three methods, is spread less by Brown \
         and Forsythe's test, in scenes that no population ends in collision, of which this row asks for none of its own: above 0 (holds), below \
         2 % (does not hold), or neither",
        vec![Effect::steadier(("IBFOA", &own(1)), ("BFOA", &own(0)), (STEADIER_PERCENT, level))],
    )
}

/// The mean curve at dispersals: figures 2 and 3 show it rising with BFOA, and not with IBFOA.
fn elite(trials: &Trials, (field, level): (&Field, Level)) -> Claim {
    let every = trials.parameters.tumbles * trials.parameters.reproductions;
    let rises = |i: usize| -> Vec<f64> {
        let of = |c: &Course| {
            let logs: Vec<f64> = c.dispersals(every).map(|[before, after]| (after / before).ln()).collect();
            logs.iter().sum::<f64>() / logs.len() as f64
        };
        field.free(&[0, 1]).filter_map(|run| field.of(i).get(run).map(of)).collect()
    };
    let name = |who: &str| format!("{who}'s curve rises at a dispersal by");
    let ours = Effect::no_rise(&name("IBFOA"), &rises(1), (RISE_PERCENT, level));
    let theirs = Effect::no_rise(&name("BFOA"), &rises(0), (RISE_PERCENT, level)).claimed(Claimed::Gain);
    let up: usize = field.of(1).iter().map(Course::rises).sum();
    let steps: usize = field.of(1).iter().map(Course::steps).sum();
    Claim::tested(
        &format!("The elite keeps IBFOA's curve from rising at dispersals, where BFOA's rises ({})", trials.title()),
        "the population's best after the step that follows a dispersal, over that before: IBFOA's rise is below 1 %, and BFOA's is \
         not",
        vec![ours, theirs],
    )
    .beside(format!("IBFOA's population's best rises in {up} of {steps} iterations, most of them without a dispersal"))
}

/// What carries the difference, where the variants were run.
fn variants(trials: &Trials, (field, level): (&Field, Level)) -> Vec<Claim> {
    let claim = |(says, pair): (&str, [(usize, &str); 2])| {
        compared((field, level), &format!("{says} ({})", trials.title()), pair)
    };
    variant_pairs(trials).into_iter().map(claim).collect()
}

/// What is claimed of each variant that was run, and the two methods that decide it.
fn variant_pairs(trials: &Trials) -> Vec<(&'static str, [(usize, &'static str); 2])> {
    const ELITE: &str = "BFOA with the printed elite, no decay";
    let at = |name: &str| trials.contenders.iter().position(|c| c.name == name);
    let (elite, greedy) = (at(ELITE), at("greedy BFOA"));
    let pairs = [
        (
            "Preserving the elite improves BFOA, without decay",
            elite.map(|e| [(e, "with the elite"), (0, "BFOA")]),
        ),
        (
            "Decaying survivors and dispersal improve BFOA with an elite",
            elite.map(|e| [(1, "IBFOA"), (e, "BFOA with the elite")]),
        ),
        (
            "Not in the paper: taking worsening steps back is better than IBFOA",
            greedy.map(|g| [(g, "greedy BFOA"), (1, "IBFOA")]),
        ),
    ];
    pairs.into_iter().filter_map(|(says, pair)| Some((says, pair?))).collect()
}

impl Field {
    /// Runs in which each of some methods ends free of collision.
    pub(super) fn free<'a>(&'a self, methods: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
        let collides =
            |k: usize, run: usize| self.collides.get(k).and_then(|c| c.get(run)).copied().unwrap_or(true);
        (0..self.straight.len()).filter(move |run| methods.iter().all(|k| !collides(*k, *run)))
    }

    /// Logarithms of a figure of one method over that of another, in scenes that both leave free.
    fn logs(&self, [i, j]: [usize; 2], figure: impl Fn(&Course) -> Option<f64>) -> Vec<f64> {
        let of = |k: usize, run: usize| self.of(k).get(run).and_then(&figure);
        self.free(&[i, j]).filter_map(|run| Some((of(i, run)? / of(j, run)?).ln())).collect()
    }

    /// Population's best at the end, method `i` against `j`.
    pub(super) fn at_the_end(&self, pair: [usize; 2], names: [&str; 2], level: Level) -> Effect {
        self.gain(pair, names, level, |course| Some(course.last()))
    }

    /// Population's best after a quarter of the iterations, method `i` against `j`.
    pub(super) fn after_a_quarter(&self, pair: [usize; 2], names: [&str; 2], level: Level) -> Effect {
        self.gain(pair, names, level, |course| course.after(0.25))
    }

    /// A figure of method `i` against that of `j`, in scenes that both leave free.
    fn gain(
        &self,
        [i, j]: [usize; 2],
        [ours, theirs]: [&str; 2],
        level: Level,
        figure: impl Fn(&Course) -> Option<f64>,
    ) -> Effect {
        let of = |k: usize| -> Vec<f64> {
            self.free(&[i, j]).filter_map(|run| figure(self.of(k).get(run)?)).collect()
        };
        Effect::ratio((ours, &of(i)), (theirs, &of(j)), (FLOOR, level)).margin(GAIN_PERCENT)
    }

    /// Best so far at equal evaluations, method `i` against `j`.
    pub(super) fn at_equal_evaluations(
        &self,
        [i, j]: [usize; 2],
        [ours, theirs]: [&str; 2],
        level: Level,
    ) -> Effect {
        let [a, b] = equal_evaluations(self.of(i), self.of(j));
        let free = |values: &[f64]| -> Vec<f64> {
            self.free(&[i, j]).filter_map(|run| values.get(run).copied()).collect()
        };
        Effect::ratio((ours, &free(&a)), (theirs, &free(&b)), (FLOOR, level)).margin(GAIN_PERCENT)
    }

    /// All runs of a method.
    pub(super) fn of(&self, i: usize) -> &[Course] {
        self.courses.get(i).map_or(&[], Vec::as_slice)
    }
}

/// Eq. 3.9 adds the distances to all links: what its optima are worth.
pub(super) fn as_printed(field: &Field, runs: usize) -> Claim {
    let missed = |(contender, collides): (&super::contenders::Contender, &Vec<bool>)| {
        Effect::never(
            &format!("{} collides", contender.name),
            [collides.iter().filter(|c| **c).count(), runs],
            Level::FIVE_PERCENT,
        )
    };
    let effects: Vec<Effect> = PAPERS_OWN.iter().zip(&field.collides).map(missed).collect();
    Claim::weighed(
        "The optimised trajectories are free of collisions, with the penalty of eq. 3.8 and 3.9 as printed",
        "no best trajectory of the three methods comes nearer to a sphere than its radius and expansion; one refutes it",
        Verdict::all(effects.iter().map(Effect::verdict)),
        effects,
    )
}
