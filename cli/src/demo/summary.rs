//! What the demo says at its end.
use crate::live::follow::Executed;
use crate::live::replan::Planned;
use crate::offline::verify::Unmodelled;
use crate::plot::recording::Sample;
use crate::words::stalls_sentence;
use serde::Serialize;
use serde_json::Value;
use std::collections::HashMap;
use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use taustream_messages::Report;

/// One move.
#[derive(Debug, Serialize)]
pub(crate) struct Move {
    number: usize,
    planner: String,
    planning_s: f64,
    planned_s: f64,
    executed_s: f64,
    clearance_m: f64,
    tracking_error_rad_max: f64,
    strokes: u32,
    trajectory_id: u64,
}

impl Move {
    /// What planner, streamer and reports said about it.
    pub(crate) fn new(number: usize, planned: Planned, executed: Executed) -> Self {
        Self {
            number,
            planner: planned.planner,
            planning_s: planned.planning_s,
            planned_s: planned.duration_s,
            executed_s: executed.executed_s,
            clearance_m: planned.clearance_m,
            tracking_error_rad_max: executed.tracking_error_rad_max,
            strokes: planned.strokes,
            trajectory_id: planned.trajectory_id,
        }
    }
}

/// The whole demo.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    verdict: &'static str,
    moves: Vec<Move>,
    planned_s: f64,
    executed_s: f64,
    clearance_m: f64,
    /// The largest of any cycle.
    pub(super) tracking_error_rad_max: f64,
    /// Faults that were recovered from, as text.
    pub(super) faults: Vec<String>,
    /// Pauses by stalls of the computer that were ended by a resume, as text.
    pub(super) pauses: Vec<String>,
    frames_sent: u64,
    frames_lost: u64,
    frames_received: u64,
    cycles: u64,
    cycles_late: u64,
    cycles_skipped: u64,
    stalls: u64,
    guard_trips: u64,
    lateness_ns_p50: u64,
    lateness_ns_p99: u64,
    lateness_ns_max: u64,
    cycle_ns_p99: u64,
    /// True when the executed durations were counted in cycles, false when they come from the slower reports.
    executed_counted_in_cycles: bool,
    /// Pictures that were written.
    pub(crate) plots: Vec<PathBuf>,
    /// Links that move and have no shape.
    pub(super) unmodelled_links: Vec<String>,
    /// What the pictures show.
    #[serde(skip)]
    pub(crate) samples: Vec<Sample>,
}

impl Summary {
    /// The moves and the last report; nothing else is known.
    pub(super) fn new(last: &Report, moves: Vec<Move>) -> Self {
        let mut summary = Self {
            verdict: "DEMO OK",
            planned_s: 0.0,
            executed_s: 0.0,
            clearance_m: moves.iter().map(|m| m.clearance_m).fold(f64::INFINITY, f64::min),
            tracking_error_rad_max: 0.0,
            faults: Vec::new(),
            pauses: Vec::new(),
            frames_sent: last.frames_sent,
            frames_lost: last.frames_lost,
            frames_received: last.frames_received,
            cycles: last.cycles,
            cycles_late: last.cycles_late,
            cycles_skipped: last.cycles_skipped,
            stalls: last.stalls,
            guard_trips: last.guard_trips,
            lateness_ns_p50: last.lateness_ns_p50,
            lateness_ns_p99: last.lateness_ns_p99,
            lateness_ns_max: last.lateness_ns_max,
            cycle_ns_p99: last.cycle_ns_p99,
            executed_counted_in_cycles: false,
            plots: Vec::new(),
            unmodelled_links: Vec::new(),
            samples: Vec::new(),
            moves,
        };
        summary.add_up();
        summary
    }

    fn add_up(&mut self) {
        self.planned_s = self.moves.iter().map(|m| m.planned_s).sum();
        self.executed_s = self.moves.iter().map(|m| m.executed_s).sum();
    }

    /// Takes executed durations from the cycle log, which knows them to one cycle. A log that cannot be read leaves the
    /// durations of the reports in place.
    pub(crate) fn add_cycle_log(&mut self, path: &Path) {
        let durations = File::open(path).ok().and_then(|file| moving_s(BufReader::new(file)));
        let Some(durations) = durations else { return };
        let found: Option<Vec<f64>> =
            self.moves.iter().map(|m| durations.get(&m.trajectory_id).copied()).collect();
        let Some(found) = found else { return };
        for (one, executed_s) in self.moves.iter_mut().zip(found) {
            one.executed_s = executed_s;
        }
        self.executed_counted_in_cycles = true;
        self.add_up();
    }
}

/// Seconds from the first to the last moving cycle of each trajectory; `None` for a log that is none.
fn moving_s(log: impl BufRead) -> Option<HashMap<u64, f64>> {
    let mut period_s = None;
    let mut ticks: HashMap<u64, (u64, u64)> = HashMap::new();
    for line in log.lines() {
        let event: Value = serde_json::from_str(&line.ok()?).ok()?;
        let number = |key: &str| event.get(key).and_then(Value::as_u64);
        match event.get("event").and_then(Value::as_str)? {
            "start" => period_s = Some(std::time::Duration::from_micros(number("period_us")?).as_secs_f64()),
            "cycle" if event.get("phase").and_then(Value::as_str) == Some("moving") => {
                let (tick, id) = (number("tick")?, number("trajectory_id")?);
                ticks.entry(id).or_insert((tick, tick)).1 = tick;
            }
            _ => {}
        }
    }
    let period_s: f64 = period_s?;
    #[expect(clippy::cast_precision_loss, reason = "cycles of one demo are far below 2^53")]
    let seconds = |(first, last): (u64, u64)| (last.saturating_sub(first) + 1) as f64 * period_s;
    Some(ticks.into_iter().map(|(id, span)| (id, seconds(span))).collect())
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\nmove  planned (s)  executed (s)  clearance (m)  tracking error (mrad)  planning (s)  strokes"
        )?;
        for m in &self.moves {
            writeln!(
                f,
                "{:>4}  {:>11.3}  {:>12.3}  {:>13.4}  {:>21.3}  {:>12.3}  {:>7}\n      {}",
                m.number,
                m.planned_s,
                m.executed_s,
                m.clearance_m,
                m.tracking_error_rad_max * 1e3,
                m.planning_s,
                m.strokes,
                m.planner
            )?;
        }
        let counted = if self.executed_counted_in_cycles { "counted in cycles" } else { "to one report" };
        write!(f, "{}", Unmodelled(&self.unmodelled_links))?;
        writeln!(f, "planned duration         {:.3} s", self.planned_s)?;
        writeln!(f, "executed duration        {:.3} s ({counted})", self.executed_s)?;
        writeln!(f, "least clearance          {:.4} m", self.clearance_m)?;
        writeln!(f, "largest tracking error   {:.3} mrad", self.tracking_error_rad_max * 1e3)?;
        writeln!(
            f,
            "frames                   {} sent, {} lost, {} received",
            self.frames_sent, self.frames_lost, self.frames_received
        )?;
        writeln!(
            f,
            "cycles                   {}: {} late, {} skipped, {} stalls; lateness p50 {} us, p99 {} us, max {} us",
            self.cycles,
            self.cycles_late,
            self.cycles_skipped,
            self.stalls,
            self.lateness_ns_p50 / 1000,
            self.lateness_ns_p99 / 1000,
            self.lateness_ns_max / 1000
        )?;
        if let Some(sentence) = stalls_sentence(self.stalls) {
            writeln!(f, "stalls                   {sentence}")?;
        }
        for pause in &self.pauses {
            writeln!(f, "resumed                  {pause}")?;
        }
        for fault in &self.faults {
            writeln!(f, "fault, recovered from    {fault}")?;
        }
        for plot in &self.plots {
            writeln!(f, "plot                     {}", plot.display())?;
        }
        write!(f, "{}", self.verdict)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn executed_time_is_counted_in_moving_cycles_of_each_trajectory() {
        let log = r#"{"event":"start","format":1,"period_us":2000}
{"event":"cycle","tick":4,"phase":"holding","trajectory_id":0}
{"event":"cycle","tick":5,"phase":"moving","trajectory_id":9}
{"event":"cycle","tick":14,"phase":"moving","trajectory_id":9}
{"event":"phase","tick":15,"from":"moving","to":"holding"}
{"event":"cycle","tick":15,"phase":"holding","trajectory_id":9}
"#;
        let durations = moving_s(log.as_bytes()).unwrap();
        assert_eq!(durations.len(), 1);
        assert!((durations[&9] - 0.020).abs() < 1e-12, "{durations:?}");
    }

    #[test]
    fn cycle_log_that_is_none_changes_nothing() {
        for log in ["", "no json\n", "{\"event\":\"cycle\",\"phase\":\"moving\"}\n", "[]\n"] {
            assert!(moving_s(log.as_bytes()).is_none(), "{log}");
        }
    }
}
