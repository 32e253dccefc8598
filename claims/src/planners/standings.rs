//! The tables of a contest.
use super::contest::Outcome;
use super::{Contest, Run};
use crate::number::figures;
use crate::statistics::{Summary, quantile, wilcoxon};
use crate::table::{Cell, Table};

/// A number of a motion that is compared.
type Figure = fn(&Run) -> f64;

/// Every entrant over all problems, beside the first one.
pub(super) fn overall(contest: &Contest, outcomes: &[Outcome]) -> Table {
    let first = contest.entrants.first().map_or("", |e| e.name.as_str());
    let columns = [
        "planner".to_owned(),
        "found".to_owned(),
        "planning p50 (ms)".to_owned(),
        "p95 (ms)".to_owned(),
        format!("planning over {first}"),
        "motion (s)".to_owned(),
        format!("motion over {first}"),
        "shorter:longer".to_owned(),
        format!("tip way over {first}"),
        format!("joint travel over {first}"),
        "poses checked".to_owned(),
    ];
    let note = format!(
        "Problems whose straight line is blocked; work as {} ms of deadline grant it. Times are processor time of one thread. \
         Figures are medians over the motions found; those over {first} are medians of the ratio, problem by problem, \
         where both found one, with the signed-rank test of the motions' durations.",
        contest.deadline.as_millis()
    );
    let mut table = Table::new("Planners", "", &note, &columns.each_ref().map(String::as_str));
    for (i, entrant) in contest.entrants.iter().enumerate() {
        let runs: Vec<&Run> = outcomes.iter().filter_map(|o| o.runs.get(i)?.as_ref()).collect();
        let median = |figure: Figure| quantile(&runs.iter().map(|r| figure(r)).collect::<Vec<_>>(), 0.5);
        let planning_ms: Vec<f64> = runs.iter().map(|r| 1e3 * r.planning_s).collect();
        let both: Vec<[&Run; 2]> = outcomes
            .iter()
            .filter_map(|o| Some([o.runs.get(i)?.as_ref()?, o.runs.first()?.as_ref()?]))
            .collect();
        let ratio = |figure: Figure| {
            let ratios: Vec<f64> = both.iter().map(|[ours, theirs]| figure(ours) / figure(theirs)).collect();
            Cell::number(quantile(&ratios, 0.5))
        };
        let durations = |k: usize| both.iter().map(|pair| pair[k].duration_s).collect::<Vec<_>>();
        let test = if i == 0 || both.is_empty() {
            Cell::None
        } else {
            Cell::Test(wilcoxon(&durations(0), &durations(1)))
        };
        table.row(
            entrant.name.clone(),
            vec![
                Cell::Share { count: runs.len(), of: outcomes.len() },
                Cell::number(quantile(&planning_ms, 0.5)),
                Cell::number(quantile(&planning_ms, 0.95)),
                ratio(|r| r.planning_s),
                Cell::number(median(|r| r.duration_s)),
                ratio(|r| r.duration_s),
                test,
                ratio(|r| r.tip_m),
                ratio(|r| r.travel_rad),
                Cell::number(median(|r| r.checks as f64)),
            ],
        );
    }
    table
}

/// What was found set by set, and how long the motions take.
pub(super) fn by_set(contest: &Contest, outcomes: &[Outcome]) -> Table {
    let mut columns = vec!["planner"];
    columns.extend(contest.sets.iter().map(|set| set.name.as_str()));
    let note = "Motions found of all problems, and the median of their durations (s).";
    let mut table = Table::new("Planners by set", "", note, &columns);
    for (i, entrant) in contest.entrants.iter().enumerate() {
        let cell = |set: usize| {
            let all: Vec<&Outcome> = outcomes.iter().filter(|o| o.set == set).collect();
            let found: Vec<f64> =
                all.iter().filter_map(|o| Some(o.runs.get(i)?.as_ref()?.duration_s)).collect();
            if found.is_empty() {
                return Cell::Share { count: 0, of: all.len() };
            }
            Cell::words(format!("{}/{}, {}", found.len(), all.len(), figures(Summary::of(&found).median)))
        };
        table.row(entrant.name.clone(), (0..contest.sets.len()).map(cell).collect());
    }
    table
}
