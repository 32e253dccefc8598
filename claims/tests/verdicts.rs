//! The results follow the numbers: corrupted numbers change every result.
use taustream_claims::statistics::{Level, Moments, Summary};
use taustream_claims::{Claim, Effect, Sample, Verdict, agrees};

const LEVEL: Level = Level::FIVE_PERCENT;

fn sample(shift: f64) -> Sample {
    Sample::of((0..20).map(|i| f64::from(i).sin() + shift).collect())
}

/// Goal: four words from an interval and a margin, and no word for a coin toss.
#[test]
fn verdict_of_an_effect_needs_an_interval_on_one_side() {
    let noise = |i: i32| 1.0 + 0.004 * f64::from(i * 7 % 11 - 5);
    let costs = |factor: f64, count: i32| -> Vec<f64> { (0..count).map(|i| factor * noise(i)).collect() };
    let theirs = costs(1.0, 30);
    let against = |ours: &[f64]| Effect::ratio(("ours", ours), ("theirs", &theirs), (1e-300, LEVEL));
    let twisted: Vec<f64> = theirs.iter().rev().map(|v| 0.95 * v).collect();
    assert_eq!(against(&twisted).verdict(), Verdict::Holds, "5 % less");
    assert_eq!(against(&costs(1.05, 30)).verdict(), Verdict::DoesNotHold, "5 % more");
    assert_eq!(against(&theirs).verdict(), Verdict::DoesNotHold, "the same");
    let tiny: Vec<f64> = theirs.iter().map(|v| 0.998 * v).collect();
    assert_eq!(
        against(&tiny).verdict(),
        Verdict::DoesNotHold,
        "less for certain, and by less than the margin"
    );
    let wild: Vec<f64> = (0..30).map(|i| theirs[i] * (0.3 * (2.3 * i as f64).sin()).exp()).collect();
    assert_eq!(against(&wild).verdict(), Verdict::Open);
    let few = Effect::ratio(("ours", &twisted[..5]), ("theirs", &theirs[..5]), (1e-300, LEVEL));
    assert_eq!(few.verdict(), Verdict::Open, "five pairs cannot be significant");
    // What is below the floor is rounding: 1e-14 and 1e-16 are one error.
    let floored = Effect::ratio(("ours", &[1e-16; 30]), ("theirs", &[1e-14; 30]), (1e-7, LEVEL));
    assert_eq!(floored.verdict(), Verdict::DoesNotHold);
}

#[test]
fn verdict_of_counts_is_no_word_for_a_coin_toss() {
    for (count, word) in [(52, Verdict::Open), (20, Verdict::DoesNotHold), (75, Verdict::Holds)] {
        assert_eq!(Effect::majority("it bends", [count, 100], LEVEL).verdict(), word, "{count} of 100");
    }
    for (count, of, word) in [(0, 30, Verdict::Holds), (1, 30, Verdict::DoesNotHold), (0, 10, Verdict::Open)]
    {
        assert_eq!(Effect::never("it touches", [count, of], LEVEL).verdict(), word, "{count} of {of}");
    }
}

#[test]
fn verdict_of_a_spread_needs_more_than_a_smaller_deviation() {
    let values =
        |scale: f64| -> Vec<f64> { (0..100).map(|i| scale * f64::from(i * 37 % 101 - 50)).collect() };
    let wide = values(1.0);
    let steadier = |scale: f64| Effect::steadier(("a", &values(scale)), ("b", &wide), (2.0, LEVEL)).verdict();
    assert_eq!(steadier(0.5), Verdict::Holds);
    assert_eq!(steadier(0.93), Verdict::Open, "7 % less, of 100 values");
    assert_eq!(steadier(2.0), Verdict::DoesNotHold);
}

#[test]
fn verdict_of_several_parts_is_that_of_the_weakest_or_of_the_strongest() {
    use Verdict::{CannotBeChecked, DoesNotHold, Holds, Open};
    assert_eq!(Verdict::all([Holds, Open, Holds]), Open);
    assert_eq!(Verdict::all([Holds, Open, DoesNotHold]), DoesNotHold);
    assert_eq!(Verdict::all([Holds, Holds]), Holds);
    assert_eq!(Verdict::any([DoesNotHold, Holds]), Holds);
    assert_eq!(Verdict::any([DoesNotHold, Open]), Open);
    assert_eq!(Verdict::all([]), CannotBeChecked);
}

#[test]
fn mean_is_reproduced_when_it_is_near_or_not_significantly_different() {
    let ours = Summary::of(&sample(10.0).values);
    let printed = |mean, sd| Moments { n: 30, mean, sd };
    assert!(agrees(printed(10.9, 0.0), &ours), "within a tenth");
    assert!(!agrees(printed(13.0, 0.1), &ours), "far off");
    assert!(agrees(printed(13.0, 20.0), &ours), "far off, but within the spread");
    let zero = Summary::of(&[4.44e-16; 5]);
    assert!(agrees(printed(8.882e-16, 0.0), &zero), "rounding");
    assert!(!agrees(printed(1e-12, 0.0), &zero), "more than rounding");
}

/// Goal: a word that depends on the master seed is no word, and what the first seed said stays to be seen.
#[test]
fn claim_whose_word_depends_on_the_seed_is_not_told_apart() {
    use Verdict::{DoesNotHold, Holds, Open};
    let claim = |others: [Verdict; 3]| {
        let mut claim = Claim::measured("it works", "a rule", true, String::new());
        claim.repeat(others);
        claim
    };
    let same = claim([Holds; 3]);
    assert_eq!((same.verdict, same.agreement(), same.depends_on_the_seed()), (Holds, Some([3, 3]), false));
    for others in [[Holds, DoesNotHold, Holds], [Open, Holds, Holds]] {
        let other = claim(others);
        assert_eq!((other.verdict, other.first_seed, other.agreement()), (Open, Holds, Some([2, 3])));
        assert!(other.depends_on_the_seed());
    }
    assert_eq!(Claim::measured("it works", "a rule", true, String::new()).agreement(), None);
}
