//! Looks after n, 2n, 4n .. runs: a word is settled by evidence, and not by the number of looks.
use std::convert::Infallible;
use taustream_claims::statistics::Level;
use taustream_claims::{Claim, Effect, Looks, Verdict, settle};
use taustream_planner::rng::SeededRng;

const LOOKS: Looks = Looks::new(12, 4);
const SEEDS: u64 = 400;

/// Costs of both methods in one run: a scene that they share, noise, and a share that the first saves.
fn run(rng: &mut SeededRng, saved: f64, noise: f64) -> [f64; 2] {
    let scene = rng.within(1.0, 9.0);
    // Nearly normal, of deviation 1.
    let mut normal = || (0..12).map(|_| rng.within(-0.5, 0.5)).sum::<f64>();
    let [a, b] = [normal(), normal()].map(|n| scene * (noise * n).exp());
    [(1.0 - saved) * a, b]
}

/// The claim that the first is less, margin 1 %, and the runs that it took.
fn sequential(seed: u64, (saved, noise): (f64, f64), level: impl Fn(Level) -> Level) -> (Verdict, usize) {
    let mut rng = SeededRng::new(seed, 1);
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let claims = settle(LOOKS, |look| {
        while ours.len() < look.runs {
            let [a, b] = run(&mut rng, saved, noise);
            ours.push(a);
            theirs.push(b);
        }
        let effect = Effect::ratio(("ours", &ours), ("theirs", &theirs), (1e-300, level(look.level)));
        Ok::<_, Infallible>(vec![Claim::tested("it is less", "a rule", vec![effect])])
    });
    (claims.unwrap()[0].verdict, ours.len())
}

fn count(truth: (f64, f64), level: impl Fn(Level) -> Level + Copy, wanted: Verdict) -> u64 {
    (0..SEEDS).filter(|seed| sequential(*seed, truth, level).0 == wanted).count() as u64
}

/// Goal: a word that three seeds share is a word that nearly every seed gives.
#[test]
fn clear_effect_holds_and_a_tie_is_not_told_apart_at_nearly_every_seed() {
    let same = |level: Level| level;
    assert!(count((0.1, 0.1), same, Verdict::Holds) >= SEEDS * 98 / 100, "10 % less, noise of 10 %");
    assert!(count((-0.1, 0.1), same, Verdict::DoesNotHold) >= SEEDS * 98 / 100, "10 % more, noise of 10 %");
    assert!(count((0.0, 0.3), same, Verdict::Open) >= SEEDS * 92 / 100, "a tie, noise of 30 %");
    // A tie that the margin settles: the interval ends well below it.
    assert!(count((0.0, 0.01), same, Verdict::DoesNotHold) >= SEEDS * 98 / 100, "a tie, noise of 1 %");
}

/// Goal: more looks do not make a word more frequent by chance. With 5 % at every look the same seeds break the promise.
#[test]
fn looks_keep_the_promised_rate_of_errors() {
    let seeds = 4 * SEEDS;
    let wrong = |level: &dyn Fn(Level) -> Level| {
        (0..seeds).filter(|seed| sequential(*seed, (0.0, 0.3), level).0 == Verdict::Holds).count() as f64
    };
    // One side of 5 %, and three deviations of what chance makes of it.
    let promised = 0.025 * seeds as f64;
    let slack = 3.0 * promised.sqrt();
    let kept = wrong(&|level| level);
    assert!(kept <= promised + slack, "{kept} of {seeds} ties hold, {promised} were promised");
    let without = wrong(&|_| Level::FIVE_PERCENT);
    assert!(without > promised + slack, "{without} of {seeds} ties hold with 5 % at every look");
}

#[test]
fn clear_claim_takes_few_runs_and_a_tie_all() {
    let same = |level: Level| level;
    assert_eq!(sequential(1, (0.5, 0.1), same), (Verdict::Holds, 12));
    assert_eq!(sequential(1, (0.0, 0.3), same), (Verdict::Open, 96));
    assert_eq!((LOOKS.first(), LOOKS.last()), (12, 96));
    assert!((LOOKS.level().share() - 0.0125).abs() < 1e-15);
}

/// Goal: a settled claim stays what it was, and says that it needs no further runs.
#[test]
fn settled_claim_keeps_its_word_and_its_numbers() {
    let mut asked = Vec::new();
    let claims = settle(Looks::new(10, 3), |look| {
        asked.push([look.is_open(0), look.is_open(1)]);
        let second = match look.runs {
            10 | 20 => Effect::majority("b", [look.runs / 2, look.runs], look.level),
            _ => Effect::majority("b", [0, look.runs], look.level),
        };
        // What is settled would say something else at the second look.
        let first = if look.is_first() { look.runs } else { 0 };
        let first = Effect::majority("a", [first, look.runs], look.level);
        Ok::<_, Infallible>(vec![Claim::tested("a", "r", vec![first]), Claim::tested("b", "r", vec![second])])
    });
    let claims = claims.unwrap();
    assert_eq!(asked, [[true, true], [false, true], [false, true]]);
    assert_eq!(claims.iter().map(|c| c.verdict).collect::<Vec<_>>(), [Verdict::Holds, Verdict::DoesNotHold]);
    assert_eq!(claims.iter().map(|c| c.effects[0].n).collect::<Vec<_>>(), [10, 40]);
    let ended =
        settle(
            Looks::new(10, 3),
            |look| if look.is_first() { Ok(Vec::new()) } else { Err("a look at nothing") },
        );
    assert_eq!(ended, Ok(Vec::new()));
}
