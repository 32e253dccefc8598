//! A claim, its rule, and the result.
use crate::number::figures;
use crate::statistics::{Moments, Paired, Summary, welch, wilcoxon};
use crate::trial::Sample;
use std::fmt;

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The numbers satisfy the rule.
    Holds,
    /// They do not.
    DoesNotHold,
    /// The paper does not give what a check needs.
    CannotBeChecked,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
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
    /// What the rule said.
    pub verdict: Verdict,
    /// The numbers that it looked at.
    pub numbers: String,
}

impl Claim {
    /// A claim with the result of its rule.
    #[must_use]
    pub fn decided(says: &str, rule: &str, holds: bool, numbers: String) -> Self {
        let verdict = if holds { Verdict::Holds } else { Verdict::DoesNotHold };
        Self { says: says.to_owned(), rule: rule.to_owned(), verdict, numbers }
    }

    /// A claim whose check needs what the paper does not give; `numbers` is what can be shown instead.
    #[must_use]
    pub fn unchecked(says: &str, missing: &str, numbers: String) -> Self {
        let verdict = Verdict::CannotBeChecked;
        Self { says: says.to_owned(), rule: missing.to_owned(), verdict, numbers }
    }
}

/// The rule that one method is better than another: less in the median of paired runs, by the signed-rank test at 5 %.
#[must_use]
pub fn better(name: &str, ours: &Sample, other: &str, theirs: &Sample) -> (bool, String) {
    let paired = wilcoxon(&ours.values, &theirs.values);
    let [a, b] = [ours, theirs].map(|s| s.summary().median);
    let Paired { less, more, equal, p } = paired;
    let text = format!(
        "{name} {} against {other} {} (medians; {less} less, {more} more, {equal} equal; p = {})",
        figures(a),
        figures(b),
        figures(p)
    );
    (paired.is_less() && a <= b, text)
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
