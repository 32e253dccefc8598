//! A claim, its rule, and the result.
use crate::effect::Effect;
use crate::statistics::{Moments, Summary, welch};
use std::fmt;

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The numbers satisfy the rule.
    Holds,
    /// They do not: what is claimed is excluded, or smaller than the margin.
    DoesNotHold,
    /// The interval of the effect reaches from nothing, or less, to more than the margin.
    #[serde(rename = "not_told_apart")]
    Open,
    /// The paper, or this run, does not give what a check needs.
    CannotBeChecked,
}

impl Verdict {
    /// Of a claim that holds where all of its parts do.
    #[must_use]
    pub fn all(parts: impl IntoIterator<Item = Self>) -> Self {
        let rank = |verdict: &Self| match verdict {
            Self::DoesNotHold => 0,
            Self::Open => 1,
            Self::CannotBeChecked => 2,
            Self::Holds => 3,
        };
        parts.into_iter().min_by_key(rank).unwrap_or(Self::CannotBeChecked)
    }

    /// Of a claim that holds where one of its parts does.
    #[must_use]
    pub fn any(parts: impl IntoIterator<Item = Self>) -> Self {
        let rank = |verdict: &Self| match verdict {
            Self::Holds => 0,
            Self::Open => 1,
            Self::DoesNotHold => 2,
            Self::CannotBeChecked => 3,
        };
        parts.into_iter().min_by_key(rank).unwrap_or(Self::CannotBeChecked)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
            Self::Open => "not told apart",
            Self::CannotBeChecked => "cannot be checked",
        })
    }
}

/// A claim of a paper.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Claim {
    /// What the paper says, in our words.
    pub says: String,
    /// When it counts as true; or what is missing.
    pub rule: String,
    /// What the rule said; with several master seeds, the word that they all give, or "not told apart".
    pub verdict: Verdict,
    /// What the rule said of the first master seed.
    pub first_seed: Verdict,
    /// The numbers that it looked at.
    pub numbers: String,
    /// Effect sizes with intervals and tests; none where nothing is random.
    pub effects: Vec<Effect>,
    /// True when the verdict is a calculation, which no number of runs changes.
    pub is_exact: bool,
    /// The verdicts of the same experiment with further master seeds.
    pub other_seeds: Vec<Verdict>,
}

impl Claim {
    fn new(says: &str, rule: &str, verdict: Verdict, numbers: String) -> Self {
        Self {
            says: says.to_owned(),
            rule: rule.to_owned(),
            verdict,
            first_seed: verdict,
            numbers,
            effects: Vec::new(),
            is_exact: false,
            other_seeds: Vec::new(),
        }
    }

    /// A claim that a calculation decides.
    #[must_use]
    pub fn exact(says: &str, rule: &str, holds: bool, numbers: String) -> Self {
        let verdict = if holds { Verdict::Holds } else { Verdict::DoesNotHold };
        Self { is_exact: true, ..Self::new(says, rule, verdict, numbers) }
    }

    /// A claim that counts of this run decide, where no effect has an interval.
    #[must_use]
    pub fn measured(says: &str, rule: &str, holds: bool, numbers: String) -> Self {
        Self { is_exact: false, ..Self::exact(says, rule, holds, numbers) }
    }

    /// A claim that holds where every effect is what it is claimed to be.
    #[must_use]
    pub fn tested(says: &str, rule: &str, effects: Vec<Effect>) -> Self {
        let verdict = Verdict::all(effects.iter().map(Effect::verdict));
        Self { effects, ..Self::new(says, rule, verdict, String::new()) }
    }

    /// A claim whose verdict was made from several effects in a way that its rule states.
    #[must_use]
    pub fn weighed(says: &str, rule: &str, verdict: Verdict, effects: Vec<Effect>) -> Self {
        Self { effects, ..Self::new(says, rule, verdict, String::new()) }
    }

    /// The same with more numbers beside the effects.
    #[must_use]
    pub fn beside(mut self, numbers: impl Into<String>) -> Self {
        self.numbers = numbers.into();
        self
    }

    /// The same where nothing of it is random.
    #[must_use]
    pub fn calculated(self) -> Self {
        Self { is_exact: true, ..self }
    }

    /// A claim whose check needs what the paper does not give; `numbers` is what can be shown instead.
    #[must_use]
    pub fn unchecked(says: &str, missing: &str, numbers: String) -> Self {
        Self { is_exact: true, ..Self::new(says, missing, Verdict::CannotBeChecked, numbers) }
    }

    /// What a run that is too short says of it.
    pub(crate) fn unproven(&mut self) {
        if !self.is_exact {
            self.verdict = Verdict::CannotBeChecked;
            self.first_seed = self.verdict;
            self.rule = format!("not checked: a quick run proves nothing; in a full run: {}", self.rule);
        }
    }

    /// Effects and numbers as text.
    #[must_use]
    pub fn evidence(&self) -> String {
        let effects = self.effects.iter().map(ToString::to_string);
        let numbers = (!self.numbers.is_empty()).then(|| self.numbers.clone());
        effects.chain(numbers).collect::<Vec<_>>().join("; ")
    }

    /// Adds what further master seeds say. A word that depends on the seed is none: such a claim is not told apart.
    pub fn repeat(&mut self, other_seeds: impl IntoIterator<Item = Verdict>) {
        self.other_seeds.extend(other_seeds);
        if self.depends_on_the_seed() {
            self.verdict = Verdict::Open;
        }
    }

    /// True when the master seeds do not all give the same word.
    #[must_use]
    pub fn depends_on_the_seed(&self) -> bool {
        self.other_seeds.iter().any(|other| *other != self.first_seed)
    }

    /// How many of the further master seeds give the first one's word; `None` without any.
    #[must_use]
    pub fn agreement(&self) -> Option<[usize; 2]> {
        let same = self.other_seeds.iter().filter(|verdict| **verdict == self.first_seed).count();
        (!self.other_seeds.is_empty()).then_some([same, self.other_seeds.len()])
    }
}

/// How far a mean may be from a printed one, in shares of it, to be the same whatever its spread is.
const SAME_SHARE: f64 = 0.1;
/// What both may differ by as a matter of rounding.
const ROUNDING: f64 = 1e-13;

/// The rule that a printed mean and deviation are reproduced: the means differ by less than a tenth, or by rounding
/// errors (1e-13), or by what Welch's test calls chance (p of 5 % or more).
#[must_use]
pub fn agrees(printed: Moments, ours: &Summary) -> bool {
    let away = (printed.mean - ours.mean).abs();
    let is_chance = || welch(printed, ours.moments()).is_some_and(|p| p >= crate::statistics::SIGNIFICANT);
    away <= SAME_SHARE * printed.mean.abs() || away <= ROUNDING || is_chance()
}
