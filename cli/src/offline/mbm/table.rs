//! The measurement as a table.
use super::Answer;
use std::fmt;
use taustream_claims::planners::mbm::Row;

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} ({} joints), seed {}: `{}`", self.robot, self.joints, self.seed, self.command)?;
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        writeln!(f, "times in ms, p50/p95; first and plan are processor time, request is elapsed time\n")?;
        writeln!(
            f,
            "| set | valid | solved | first | plan | request | length p50 (rad) | duration p50 (s) | in 10 ms | longest (ms) | in 50 ms | longest (ms) |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|---|---|---|")?;
        for row in &self.sets {
            writeln!(f, "{}", line(row))?;
        }
        for row in &self.sets {
            if row.set != "all" {
                ids(f, &row.set, "start or goal nearer than the margin", &row.invalid_ids)?;
                ids(f, &row.set, "NOT solved", &row.unsolved_ids)?;
            }
        }
        Ok(())
    }
}

fn line(row: &Row) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
    let both = |p50, p95| format!("{} / {}", number(p50), number(p95));
    let mut cells = vec![
        row.set.clone(),
        format!("{} of {}", row.valid, row.problems),
        row.solved.to_string(),
        both(row.first_ms_p50, row.first_ms_p95),
        both(row.planning_ms_p50, row.planning_ms_p95),
        both(row.request_ms_p50, row.request_ms_p95),
        number(row.length_rad_p50),
        number(row.duration_s_p50),
    ];
    for within in &row.deadlines {
        cells.extend([within.solved.to_string(), number(within.elapsed_ms_max)]);
    }
    format!("| {} |", cells.join(" | "))
}

fn ids(f: &mut fmt::Formatter<'_>, set: &str, what: &str, ids: &[usize]) -> fmt::Result {
    if ids.is_empty() {
        return Ok(());
    }
    let numbers: Vec<String> = ids.iter().map(usize::to_string).collect();
    writeln!(f, "{set}, {what}: {}", numbers.join(", "))
}
