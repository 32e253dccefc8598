//! Numbers that a paper does not print: what its claims are worth over a decade of each.
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::number::figures;
use crate::statistics::Level;

/// A decade round ours, on its logarithm.
pub(crate) const FACTORS: [f64; 2] = [0.316_227_766, 3.162_277_66];

/// One value of a number that is not printed, with all others ours, and what its runs say of a claim.
pub(crate) struct At {
    /// The number and its value.
    pub(crate) label: String,
    /// The word there.
    pub(crate) verdict: Verdict,
}

/// How many values a claim is looked at, and the level of all of them together.
#[derive(Clone, Copy)]
pub(crate) struct Values {
    pub(crate) count: usize,
    pub(crate) level: Level,
}

impl Values {
    /// So many, in a single look.
    pub(crate) const fn of(count: usize) -> Self {
        Self { count, level: Level::FIVE_PERCENT }
    }

    /// What all effects say at the level of one value alone, and at that of one of so many.
    fn words(self, effects: impl Fn(Level) -> Vec<Effect>) -> [Verdict; 2] {
        let levels = [self.level, self.level.over(self.count)];
        levels.map(|level| Verdict::all(effects(level).iter().map(Effect::verdict)))
    }
}

impl At {
    /// For a claim that one value suffices for: what speaks for it is held to the level of one of so many values, what
    /// speaks against it, which has to be so at all of them, to that of one.
    pub(crate) fn some(
        label: impl Into<String>,
        values: Values,
        effects: impl Fn(Level) -> Vec<Effect>,
    ) -> Self {
        Self { label: label.into(), verdict: words_for_some(values.words(effects)) }
    }

    /// For a claim that has to stand at all values: the other way round.
    pub(crate) fn every(
        label: impl Into<String>,
        values: Values,
        effects: impl Fn(Level) -> Vec<Effect>,
    ) -> Self {
        let verdict = match values.words(effects) {
            [_, Verdict::DoesNotHold] => Verdict::DoesNotHold,
            [Verdict::DoesNotHold, _] => Verdict::Open,
            [alone, _] => alone,
        };
        Self { label: label.into(), verdict }
    }

    /// What a calculation says.
    pub(crate) fn exact(label: impl Into<String>, holds: bool) -> Self {
        let verdict = if holds { Verdict::Holds } else { Verdict::DoesNotHold };
        Self { label: label.into(), verdict }
    }
}

/// The word at one value, from those at the level of one value and of one of so many.
pub(crate) fn words_for_some([alone, of_many]: [Verdict; 2]) -> Verdict {
    match alone {
        Verdict::Holds => of_many,
        Verdict::DoesNotHold | Verdict::Open | Verdict::CannotBeChecked => alone,
    }
}

/// The name of a number that was multiplied, with its new value.
pub(crate) fn label(name: &str, value: f64) -> String {
    format!("{name} = {}", figures(value))
}

/// The values by the word that they get.
pub(crate) fn places(settings: &[At]) -> String {
    let with = |wanted: Verdict| {
        let labels = settings.iter().filter(|s| s.verdict == wanted).map(|s| s.label.as_str());
        labels.collect::<Vec<_>>().join(", ")
    };
    let words = [("so", Verdict::Holds), ("not so", Verdict::DoesNotHold), ("not told apart", Verdict::Open)];
    let words = words.map(|(word, verdict)| (word, with(verdict)));
    let words = words.iter().filter(|(_, labels)| !labels.is_empty());
    words.map(|(word, labels)| format!("{word} at {labels}")).collect::<Vec<_>>().join("; ")
}

/// A claim that stands where it does at one value at least.
pub(crate) fn at_some(says: &str, rule: &str, settings: &[At]) -> Claim {
    let verdict = Verdict::any(settings.iter().map(|s| s.verdict));
    Claim::weighed(&format!("{says}, at some value of what is not printed"), rule, verdict, Vec::new())
        .beside(places(settings))
}

/// A claim that stands where it does at every value.
pub(crate) fn at_every(says: &str, rule: &str, settings: &[At]) -> Claim {
    let verdict = Verdict::all(settings.iter().map(|s| s.verdict));
    Claim::weighed(&format!("{says}, whatever is not printed"), rule, verdict, Vec::new())
        .beside(places(settings))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: six of eight coins on one side are no news among forty handfuls.
    #[test]
    fn one_of_many_values_needs_more_evidence_than_a_single_one() {
        use Verdict::{DoesNotHold, Holds, Open};
        let effects = |count: usize| move |level| vec![Effect::majority("it bends", [count, 100], level)];
        let words = |count: usize, values: usize| {
            let values = Values::of(values);
            [At::some("a", values, effects(count)), At::every("a", values, effects(count))]
                .map(|at| at.verdict)
        };
        assert_eq!(words(61, 1), [Holds, Holds]);
        assert_eq!(words(61, 40), [Open, Holds], "one of forty holds by chance");
        assert_eq!(words(49, 1), [DoesNotHold, DoesNotHold]);
        assert_eq!(words(49, 40), [DoesNotHold, Open], "one of forty does not by chance");
        assert_eq!(words(75, 40), [Holds, Holds]);
    }

    #[test]
    fn swept_claim_names_the_values_by_their_words_and_needs_one_or_all() {
        let open = At { label: "c".to_owned(), verdict: Verdict::Open };
        let settings = [At::exact("a", true), At::exact("b", false), open, At::exact("d", true)];
        let [some, every] = [at_some, at_every].map(|claim| claim("It works", "a rule", &settings));
        assert_eq!((some.verdict, every.verdict), (Verdict::Holds, Verdict::DoesNotHold));
        for claim in [some, every] {
            assert_eq!(claim.numbers, "so at a, d; not so at b; not told apart at c");
        }
        assert_eq!(at_some("It works", "a rule", &settings[1..3]).verdict, Verdict::Open);
        assert_eq!(at_every("It works", "a rule", &settings[2..]).verdict, Verdict::Open);
        assert_eq!(at_every("It works", "a rule", &[]).verdict, Verdict::CannotBeChecked);
        assert_eq!(label("H_o", 20.0), "H_o = 20");
    }
}
