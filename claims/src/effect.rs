//! The size of an effect, its doubt, and what both say of a claim.
use crate::claim::Verdict;
use crate::number::figures;
use crate::statistics::{Estimate, Level, Paired, median, share, shift, spread, wilcoxon};
use crate::trial::Sample;
use std::fmt;

/// What is claimed of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Claimed {
    /// It is there: above 0, and not below the margin.
    Gain,
    /// It is not there: below the margin.
    Nothing,
    /// It happens in no run: one refutes it, and enough runs without make it less frequent than the margin.
    Never,
}

/// An effect with its interval and its margin, which was stated before anything was measured.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Effect {
    /// What it compares, in words that end where the number begins.
    pub what: String,
    /// Unit of value, interval and margin.
    pub unit: &'static str,
    /// The estimate.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// What counts as no effect.
    pub margin: f64,
    /// Its direction.
    pub claimed: Claimed,
    /// Two-sided probability of such a sample without any effect; none where the interval is the test.
    pub p: Option<f64>,
    /// How many runs, or pairs of runs.
    pub n: usize,
    /// Medians, counts: what else a reader asks for.
    pub note: String,
}

/// A gain in cost below this share is none (%).
const MARGIN_PERCENT: f64 = 1.0;
/// What never happens is less frequent than this (%): 30 runs without it show as much.
const NEVER_PERCENT: f64 = 12.5;
/// A majority by less than this is none (points).
const MAJORITY_POINTS: f64 = 10.0;

impl Effect {
    /// What it says of its claim.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let [low, high] = self.estimate.interval;
        match self.claimed {
            Claimed::Gain if high < self.margin => Verdict::DoesNotHold,
            Claimed::Gain if low > 0.0 => Verdict::Holds,
            Claimed::Nothing if high < self.margin => Verdict::Holds,
            Claimed::Nothing if low > self.margin => Verdict::DoesNotHold,
            Claimed::Never if self.estimate.value > 0.0 => Verdict::DoesNotHold,
            Claimed::Never if high < self.margin => Verdict::Holds,
            Claimed::Gain | Claimed::Nothing | Claimed::Never => Verdict::Open,
        }
    }

    /// By how many percent the first is less than the second, pair by pair: the shift of the ratios' logarithms. Values
    /// below `floor` count as it: what is below is rounding.
    #[must_use]
    pub fn ratio(
        (name, ours): (&str, &[f64]),
        (other, theirs): (&str, &[f64]),
        (floor, level): (f64, Level),
    ) -> Self {
        let floored = |values: &[f64]| values.iter().map(|v| v.max(floor)).collect::<Vec<_>>();
        let (ours, theirs) = (floored(ours), floored(theirs));
        let logs: Vec<f64> = ours.iter().zip(&theirs).map(|(a, b)| (b / a).ln()).collect();
        let estimate = shift(&logs, level).map(|log| 100.0 * (1.0 - (-log).exp()));
        Self {
            what: format!("{name} less than {other} by"),
            unit: "%",
            estimate,
            margin: MARGIN_PERCENT,
            claimed: Claimed::Gain,
            p: Some(wilcoxon(&logs, &vec![0.0; logs.len()]).p),
            n: logs.len(),
            note: beside(&ours, &theirs),
        }
    }

    /// By how much the first is less than the second, pair by pair.
    #[must_use]
    pub fn difference(
        (name, ours): (&str, &Sample),
        (other, theirs): (&str, &Sample),
        (margin, unit, level): (f64, &'static str, Level),
    ) -> Self {
        let differences: Vec<f64> = ours.values.iter().zip(&theirs.values).map(|(a, b)| b - a).collect();
        Self {
            what: format!("{name} less than {other} by"),
            unit,
            estimate: shift(&differences, level),
            margin,
            claimed: Claimed::Gain,
            p: Some(wilcoxon(&ours.values, &theirs.values).p),
            n: differences.len(),
            note: beside(&ours.values, &theirs.values),
        }
    }

    /// By how many percent the first is spread less than the second, by Brown and Forsythe's test.
    #[must_use]
    pub fn steadier(
        (name, ours): (&str, &[f64]),
        (other, theirs): (&str, &[f64]),
        (margin, level): (f64, Level),
    ) -> Self {
        let (estimate, p) = spread(ours, theirs, level);
        let [low, high] = estimate.interval;
        let estimate = Estimate { value: -100.0 * estimate.value, interval: [-100.0 * high, -100.0 * low] };
        Self {
            what: format!("{name} spread less than {other} by"),
            unit: "%",
            estimate,
            margin,
            claimed: Claimed::Gain,
            p: Some(p),
            n: ours.len(),
            note: "Brown and Forsythe".to_owned(),
        }
    }

    /// By how many points more than half of the runs do something.
    #[must_use]
    pub fn majority(what: &str, [count, of]: [usize; 2], level: Level) -> Self {
        let estimate = share(count, of, level).map(|share| 100.0 * (share - 0.5));
        Self {
            what: format!("{what} in {count} of {of} runs, above half by"),
            unit: "points",
            estimate,
            margin: MAJORITY_POINTS,
            claimed: Claimed::Gain,
            p: None,
            n: of,
            note: String::new(),
        }
    }

    /// The share of runs that do what no run is claimed to do.
    #[must_use]
    pub fn never(what: &str, [count, of]: [usize; 2], level: Level) -> Self {
        Self {
            what: format!("{what} in {count} of {of} runs,"),
            unit: "%",
            estimate: share(count, of, level).map(|share| 100.0 * share),
            margin: NEVER_PERCENT,
            claimed: Claimed::Never,
            p: None,
            n: 0,
            note: String::new(),
        }
    }

    /// How far a median is below a value.
    #[must_use]
    pub fn below((name, values): (&str, &[f64]), at_most: f64, (unit, level): (&'static str, Level)) -> Self {
        let median = median(values, level);
        let [low, high] = median.interval;
        let estimate = Estimate { value: at_most - median.value, interval: [at_most - high, at_most - low] };
        Self {
            what: format!("median of {name} {}, below {} by", figures(median.value), figures(at_most)),
            unit,
            estimate,
            margin: 0.0,
            claimed: Claimed::Gain,
            p: None,
            n: values.len(),
            note: String::new(),
        }
    }

    /// How far a median is above a value.
    #[must_use]
    pub fn above((name, values): (&str, &[f64]), at_least: f64, unit: (&'static str, Level)) -> Self {
        let below = Self::below((name, values), at_least, unit);
        let Estimate { value, interval: [low, high] } = below.estimate;
        Self {
            what: below.what.replace(", below ", ", above "),
            estimate: Estimate { value: -value, interval: [-high, -low] },
            ..below
        }
    }

    /// How far a median is from a printed value, either way.
    #[must_use]
    pub fn near(
        (name, values): (&str, &[f64]),
        printed: f64,
        (margin, unit, level): (f64, &'static str, Level),
    ) -> Self {
        let median = median(values, level);
        let [low, high] = median.interval.map(|end| (end - printed).abs());
        let value = (median.value - printed).abs();
        let nearest =
            if (median.interval[0]..=median.interval[1]).contains(&printed) { 0.0 } else { low.min(high) };
        Self {
            what: format!(
                "median of {name} {}, off the printed {} by",
                figures(median.value),
                figures(printed)
            ),
            unit,
            estimate: Estimate { value, interval: [nearest, low.max(high)] },
            margin,
            claimed: Claimed::Nothing,
            p: None,
            n: values.len(),
            note: String::new(),
        }
    }

    /// A rise in percent that is claimed not to be there.
    #[must_use]
    pub fn no_rise(what: &str, logs: &[f64], (margin, level): (f64, Level)) -> Self {
        Self {
            what: what.to_owned(),
            unit: "%",
            estimate: shift(logs, level).map(|log| 100.0 * (log.exp() - 1.0)),
            margin,
            claimed: Claimed::Nothing,
            p: Some(wilcoxon(logs, &vec![0.0; logs.len()]).p),
            n: logs.len(),
            note: String::new(),
        }
    }

    /// The same with another claim about it.
    #[must_use]
    pub fn claimed(self, claimed: Claimed) -> Self {
        Self { claimed, ..self }
    }

    /// The same with another margin.
    #[must_use]
    pub fn margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }
}

/// Medians and pairs.
fn beside(ours: &[f64], theirs: &[f64]) -> String {
    let Paired { less, more, equal, .. } = wilcoxon(ours, theirs);
    let [a, b] = [ours, theirs].map(|values| figures(crate::statistics::quantile(values, 0.5)));
    format!("medians {a} and {b}; {less} less, {more} more, {equal} equal")
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, unit, estimate: Estimate { value, interval: [low, high] }, p, note, n, .. } = self;
        write!(f, "{what} {} {unit} [{}, {}]", rounded(*value), rounded(*low), rounded(*high))?;
        let p = p.filter(|p| p.is_finite()).map(|p| format!("p = {}", figures(p)));
        let n = (*n > 0).then(|| format!("n = {n}"));
        let more = [Some(note.clone()).filter(|n| !n.is_empty()), p, n];
        let more: Vec<String> = more.into_iter().flatten().collect();
        if more.is_empty() { Ok(()) } else { write!(f, " ({})", more.join("; ")) }
    }
}

/// Three figures: an interval says how many count.
pub(crate) fn rounded(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() || !(1e-3..1e4).contains(&size) {
        return figures(value);
    }
    let decimals = if size >= 100.0 {
        0
    } else if size >= 10.0 {
        1
    } else {
        2
    };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
