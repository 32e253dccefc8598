//! `taustream doctor`: is this computer fit to drive an arm, and what would make it so?
//!
//! Looks at files of the kernel and measures wake-ups; changes nothing. It is no safety function, and says so.
mod buses;
mod cpus;
mod finding;
mod host;
mod kernel;
mod latency;
mod memory;
mod rights;
mod subject;
#[cfg(test)]
mod tests;
mod tree;

use crate::args::{DoctorArgs, SAFETY};
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use finding::{Finding, Grade};
use latency::Latency;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use subject::Subject;
use taustream_arm::text::counted;
use taustream_arm::{Settings, runtime, settings::CycleSettings};
use taustream_streamer::bench::wake_ups;
use tree::Tree;

/// Where settings say nothing of the cycle: what the shipped ones say.
const USUAL_CYCLE: CycleSettings = CycleSettings {
    period_us: 1_000,
    tolerated_gap_periods: 2,
    stall_resume_ms: 20,
    drive_watchdog_ms: 100,
    heartbeat_lost_ms: 350,
    priority: 80,
    cpu: None,
    report_rate_hz: 100.0,
};

/// Everything that was found.
#[derive(Debug, Serialize)]
struct Diagnosis {
    /// The worst grade of any finding.
    grade: Grade,
    ok: usize,
    unknown: usize,
    warnings: usize,
    problems: usize,
    settings: Option<String>,
    findings: Vec<Finding>,
    latency: Option<Latency>,
    safety: String,
}

impl Diagnosis {
    fn of(settings: Option<&Settings>, findings: Vec<Finding>, latency: Option<Latency>) -> Self {
        let count = |grade| findings.iter().filter(|f| f.grade == grade).count();
        Self {
            grade: findings.iter().map(|f| f.grade).max().unwrap_or(Grade::Unknown),
            ok: count(Grade::Ok),
            unknown: count(Grade::Unknown),
            warnings: count(Grade::Warning),
            problems: count(Grade::Problem),
            settings: settings.map(|s| s.file.display().to_string()),
            findings,
            latency,
            safety: SAFETY.replace('\n', " "),
        }
    }

    /// The result as a sentence.
    fn total(&self) -> String {
        let verdict = match self.grade {
            Grade::Problem => "NOT FIT to drive an arm",
            Grade::Warning => "fit for trials, not at its best",
            Grade::Unknown | Grade::Ok => "fit",
        };
        format!(
            "{verdict}: {} ok, {}, {}, {} unknown",
            self.ok,
            counted(self.warnings, "warning"),
            counted(self.problems, "problem"),
            self.unknown
        )
    }

    /// Names of the problems.
    fn problem_names(&self) -> String {
        let names = self.findings.iter().filter(|f| f.grade == Grade::Problem).map(|f| f.name);
        names.collect::<Vec<_>>().join(", ")
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for finding in &self.findings {
            writeln!(f, "{finding}")?;
        }
        if let Some(latency) = &self.latency {
            writeln!(f, "\n{latency}")?;
        }
        writeln!(f, "\n{}", self.total())?;
        write!(f, "{}", self.safety)
    }
}

/// Examines, measures and prints; a problem is a failure.
pub(crate) fn run(form: Form, given: Option<&Path>, args: &DoctorArgs) -> Result<(), Failure> {
    let settings = match arm::settings(given) {
        Ok(settings) => Some(settings),
        // Settings that were named must be sound; without any the computer can still be looked at.
        Err(failure) if given.is_some() => return Err(failure),
        Err(_) => None,
    };
    let mut cycle = settings.as_ref().map_or(USUAL_CYCLE, |s| s.cycle);
    cycle.priority = args.priority.unwrap_or(cycle.priority);
    let subject = this_computer(settings, cycle.priority);
    let mut findings = examine(&subject);
    let latency = if args.seconds > 0.0 {
        form.progress(format_args!(
            "measuring wake-ups for {} s at priority {} ..",
            args.seconds, cycle.priority
        ));
        let measured = wake_ups(&cycle, args.seconds);
        let wake_ups = measured.map_err(|e| Failure::Failed(format!("wake-ups cannot be measured: {e}")))?;
        let bounded = findings.iter().any(|f| f.name == "kernel" && f.grade == Grade::Ok);
        Some(Latency { wake_ups, seconds: args.seconds, bounded })
    } else {
        None
    };
    findings.push(latency.as_ref().map_or_else(
        || Finding::unknown("wake-up latency", "not measured (--seconds 0)"),
        Latency::evaluate,
    ));
    let diagnosis = Diagnosis::of(subject.settings.as_ref(), findings, latency);
    form.print(&diagnosis)?;
    if diagnosis.grade == Grade::Problem {
        let names = diagnosis.problem_names();
        return Err(Failure::Failed(format!("{}: {names}", counted(diagnosis.problems, "problem"))));
    }
    Ok(())
}

/// Everything that files tell.
fn examine(subject: &Subject) -> Vec<Finding> {
    let parts: [fn(&Subject) -> Vec<Finding>; 6] =
        [kernel::examine, rights::examine, cpus::examine, buses::examine, memory::examine, host::examine];
    parts.iter().flat_map(|part| part(subject)).collect()
}

fn this_computer(settings: Option<Settings>, priority: u8) -> Subject {
    let uid = rustix::process::geteuid().as_raw();
    let shm = rustix::fs::statvfs("/dev/shm").ok();
    Subject {
        tree: Tree::new("/"),
        settings,
        priority,
        uid,
        runtime: runtime::expected(uid, Path::new("/run")).display().to_string(),
        shm_free: shm.map(|metadata| metadata.f_bavail.saturating_mul(metadata.f_frsize)),
        controller: taustream_drivers::link::controller,
    }
}
