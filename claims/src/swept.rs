//! Numbers that a paper does not print: what its claims are worth over a decade of each.
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::number::figures;

/// A decade round ours, on its logarithm.
pub(crate) const FACTORS: [f64; 2] = [0.316_227_766, 3.162_277_66];

/// One value of a number that is not printed, with all others ours, and what its runs say of a claim.
pub(crate) struct At {
    /// The number and its value.
    pub(crate) label: String,
    /// The word there.
    pub(crate) verdict: Verdict,
}

impl At {
    /// The claim stands there when all of these effects do.
    pub(crate) fn all(label: impl Into<String>, effects: &[Effect]) -> Self {
        Self { label: label.into(), verdict: Verdict::all(effects.iter().map(Effect::verdict)) }
    }

    /// What a calculation says.
    pub(crate) fn exact(label: impl Into<String>, holds: bool) -> Self {
        let verdict = if holds { Verdict::Holds } else { Verdict::DoesNotHold };
        Self { label: label.into(), verdict }
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
