//! The demo's moves: enable, every goal, disable; everything that reports say is kept for the plots.
use super::file::DemoFile;
use super::summary::{Move, Summary};
use super::view::View;
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::interrupt;
use crate::live::client::{Client, Limit};
use crate::live::command::execute;
use crate::live::follow::{Executed, follow};
use crate::live::replan::ask_while;
use crate::output::{Form, note};
use crate::plot::recording::Sample;
use crate::view::Scale;
use crate::words::{fault_sentence, pause_sentence};
use std::cell::RefCell;
use std::thread;
use std::time::Duration;
use taustream_messages::plan::CheckedPlanRequest;
use taustream_messages::{Command, PauseReason, Phase, Report};
use taustream_motion::Setpoint;

/// Deadline of each plan; the shipped goals need a fraction of it.
const DEADLINE_MS: u32 = 4000;
/// Longest wait for drives that are found, configured, energised or switched off.
const DRIVES_S_MAX: f64 = 20.0;
/// Faults that the demo recovers from: a computer without real-time rights that is busy stalls again and again.
const FAULTS_MAX: usize = 20;
/// Longest wait for rest after a stop.
const REST_S_MAX: f64 = 5.0;

/// What is known at one time.
struct Seen {
    view: View,
    samples: Vec<Sample>,
    first_ns: Option<u64>,
    last: Option<Report>,
    tracking_error_rad_max: f64,
}

/// A demo under way.
pub(crate) struct Session<'a> {
    pub(super) arm: &'a ArmName,
    pub(super) client: Client,
    seen: RefCell<Seen>,
    limit: Limit,
    moves: Vec<Move>,
    faults: Vec<String>,
    pauses: RefCell<Vec<String>>,
    /// The count of stalls in the report that was last answered with a resume.
    resumed_at_stall: RefCell<u64>,
}

impl<'a> Session<'a> {
    /// Joins the services and waits until all drives are configured.
    pub(crate) fn begin(
        form: Form,
        demo: &DemoFile,
        arm: &'a ArmName,
        limit_s: f64,
    ) -> Result<Self, Failure> {
        let session = Self {
            arm,
            client: Client::join(&arm.name)?,
            seen: RefCell::new(Seen {
                view: View::new(form, arm, Scale::of(&demo.settings), demo.moves()),
                samples: Vec::new(),
                first_ns: None,
                last: None,
                tracking_error_rad_max: 0.0,
            }),
            limit: Limit::after_s(limit_s),
            moves: Vec::new(),
            faults: Vec::new(),
            pauses: RefCell::default(),
            resumed_at_stall: RefCell::default(),
        };
        session.wait_for(Phase::Disabled, "find and configure all drives")?;
        Ok(session)
    }

    /// Enables, then plans and executes one move after the other.
    pub(crate) fn go_through_goals(&mut self, demo: &DemoFile) -> Result<(), Failure> {
        while let Err(why) = self.enable() {
            self.recover(why)?;
        }
        execute(&self.client, self.arm, Command::Speed { percent: 100.0 }, 0.0)?;
        let joints = demo.settings.robot.joints.len();
        for goal_rad in &demo.goals_rad {
            let request = CheckedPlanRequest {
                deadline_ms: DEADLINE_MS,
                ..CheckedPlanRequest::to_pose(joints, *goal_rad)
            };
            self.repeat(|session, number| session.go(&request, number))?;
        }
        match &demo.changing_scene {
            Some(change) => self.go_through_changes(change, joints),
            None => Ok(()),
        }
    }

    /// Makes the next move, again after faults.
    pub(super) fn repeat(
        &mut self,
        mut go: impl FnMut(&Self, usize) -> Result<Move, Failure>,
    ) -> Result<(), Failure> {
        let number = self.moves.len() + 1;
        self.seen.borrow_mut().view.begin_move(number);
        let done = loop {
            match go(self, number) {
                Ok(done) => break done,
                Err(why) => self.recover(why)?,
            }
        };
        self.moves.push(done);
        self.check_time()
    }

    /// Plans and executes a move.
    pub(super) fn go(&self, request: &CheckedPlanRequest, number: usize) -> Result<Move, Failure> {
        let planned = ask_while(&self.client, self.arm, request, &mut || self.look(), &mut |_| ())?;
        let executed = self.follow_to_its_end(planned.trajectory_id)?;
        Ok(Move::new(number, planned, executed))
    }

    pub(super) fn follow_to_its_end(&self, trajectory_id: u64) -> Result<Executed, Failure> {
        follow(&self.client, self.arm, trajectory_id, |report, phase| self.see(report, phase))
    }

    /// Takes a report of a motion that is followed.
    pub(super) fn see(&self, report: &Report, phase: Phase) -> Result<(), Failure> {
        self.seen.borrow_mut().note(report, phase);
        self.check_time()?;
        self.resume_after_stall(report, phase)
    }

    /// A computer that is busy with other things may leave the arm paused. Then the demo does what an operator would, and
    /// says so. A pause by command is somebody else's request.
    fn resume_after_stall(&self, report: &Report, phase: Phase) -> Result<(), Failure> {
        let stalled = report.pause().is_some_and(|pause| pause.reason == PauseReason::Stall);
        let mut resumed_at = self.resumed_at_stall.borrow_mut();
        if phase != Phase::Paused || !stalled || *resumed_at == report.stalls {
            return Ok(());
        }
        match execute(&self.client, self.arm, Command::Resume, 0.0) {
            // Asked again at the next report, unless that says that the arm has stopped.
            Err(Failure::Refused(_)) => return Ok(()),
            done => done?,
        }
        *resumed_at = report.stalls;
        let why = pause_sentence(report).unwrap_or_default();
        note(format_args!("RESUMED: {why}"));
        self.pauses.borrow_mut().push(why);
        Ok(())
    }

    /// A computer that is busy with other things may hold the simulated servos up until the streamer stops the arm. Then
    /// the demo does what an operator would, says so, and counts it; every other failure is handed back.
    fn recover(&mut self, why: Failure) -> Result<(), Failure> {
        self.check_time()?;
        let (report, phase) = self.client.report()?;
        let in_fault = matches!(phase, Phase::Fault | Phase::FastStopping | Phase::Braking);
        let cleared = matches!(phase, Phase::Disabled | Phase::Locked) && !self.faults.is_empty();
        let gives_up = self.faults.len() >= FAULTS_MAX || matches!(why, Failure::Interrupted(_));
        if gives_up || !(in_fault || cleared) {
            return Err(why);
        }
        if in_fault {
            let fault = fault_sentence(&report, self.arm);
            note(format_args!("FAULT: {fault}; the arm was stopped. Clearing, enabling, planning again .."));
            self.faults.push(fault);
            self.wait_for(Phase::Fault, "come to rest")?;
        }
        let clears = || {
            if in_fault { execute(&self.client, self.arm, Command::ClearFault, REST_S_MAX) } else { Ok(()) }
        };
        match clears().and_then(|()| self.enable()) {
            // Another fault on the way: the next request is refused for it, and comes back here.
            Err(again @ (Failure::Failed(_) | Failure::Refused(_))) => {
                note(format_args!("  {again}"));
                Ok(())
            }
            done => done,
        }
    }

    fn enable(&self) -> Result<(), Failure> {
        self.look()?;
        execute(&self.client, self.arm, Command::Enable, DRIVES_S_MAX)
    }

    /// Switches the drives off and sums up.
    pub(crate) fn finish(self) -> Result<Summary, Failure> {
        self.look()?;
        // Before the drives are off: an arm that sags then has no error.
        let tracking_error_rad_max = self.seen.borrow().tracking_error_rad_max;
        execute(&self.client, self.arm, Command::Disable, DRIVES_S_MAX)?;
        self.look()?;
        let seen = self.seen.into_inner();
        let last = seen.last.ok_or_else(|| Failure::Failed("no report was received".to_owned()))?;
        let mut summary = Summary::new(&last, self.moves);
        summary.tracking_error_rad_max = tracking_error_rad_max;
        (summary.faults, summary.pauses) = (self.faults, self.pauses.into_inner());
        summary.unmodelled_links.clone_from(&self.arm.unmodelled_links);
        summary.samples = seen.samples;
        Ok(summary)
    }

    /// A failure while the arm is in a fault is reported with the fault: it is the cause.
    pub(crate) fn with_fault(&self, why: Failure) -> Failure {
        if let Err(unreachable) = self.look() {
            note(format_args!("  {unreachable}"));
        }
        let seen = self.seen.borrow();
        match (&seen.last, why) {
            (Some(report), Failure::Refused(text)) if report.fault_reason != 0 => {
                Failure::Failed(format!("{text}: {}", fault_sentence(report, self.arm)))
            }
            (_, other) => other,
        }
    }

    /// After a failure or Ctrl-C: stop on the path, wait for rest, switch off; what came of it. What cannot be done is
    /// said, and the streamer does the same once more when it is ended.
    pub(crate) fn stop_in_order(&self) -> &'static str {
        interrupt::forget();
        note("stopping the arm (Ctrl-C again ends the processes at once) ..");
        let mut well = true;
        for (command, wait_s) in [(Command::Stop, REST_S_MAX), (Command::Disable, DRIVES_S_MAX)] {
            if let Err(refused) = execute(&self.client, self.arm, command, wait_s) {
                note(format_args!("  {refused}"));
                well = false;
            }
        }
        if well {
            "the arm was stopped on its path and de-energised, and all processes were ended"
        } else {
            "the arm could not be stopped by command; its streamer was terminated, which stops the arm"
        }
    }

    pub(super) fn wait_for(&self, wanted: Phase, what: &str) -> Result<(), Failure> {
        let limit = Limit::after_s(DRIVES_S_MAX);
        loop {
            let (report, phase) = self.client.report()?;
            self.seen.borrow_mut().note(&report, phase);
            if phase == wanted {
                return Ok(());
            }
            // Waiting for the fault itself has ended above.
            if phase == Phase::Fault || limit.is_over() {
                let fault = fault_sentence(&report, self.arm);
                return Err(Failure::Failed(format!(
                    "the streamer did not {what}: it is {}: {fault}",
                    phase.word()
                )));
            }
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Takes all reports that have arrived.
    pub(super) fn look(&self) -> Result<(), Failure> {
        self.client.drain_reports(|report, phase| self.seen.borrow_mut().note(report, phase))
    }

    fn check_time(&self) -> Result<(), Failure> {
        if !self.limit.is_over() {
            return Ok(());
        }
        let paused = self.seen.borrow().last.as_ref().and_then(pause_sentence);
        let why = paused.map_or_else(String::new, |why| format!("; the arm is {why}"));
        Err(Failure::Failed(format!("the demo takes longer than --limit-s allows{why}")))
    }
}

impl Seen {
    fn note(&mut self, r: &Report, phase: Phase) {
        let first_ns = *self.first_ns.get_or_insert(r.time_ns);
        let t_s = Duration::from_nanos(r.time_ns.saturating_sub(first_ns)).as_secs_f64();
        // The streamer's own maximum sees every cycle, reports only some. It counts from the enable on.
        if matches!(phase, Phase::Holding | Phase::Moving) {
            let errors = r.tracking_error_rad_max.iter().take(r.joints());
            self.tracking_error_rad_max = errors.fold(self.tracking_error_rad_max, |max, e| max.max(e.abs()));
        }
        if r.energised == 1 {
            self.samples.push(Sample {
                t_s,
                commanded: Setpoint {
                    position_rad: r.command_rad,
                    velocity_rad_s: r.command_velocity_rad_s,
                    acceleration_rad_s2: r.command_acceleration_rad_s2,
                    jerk_rad_s3: r.command_jerk_rad_s3,
                },
                measured_rad: r.measured_rad,
                measured_age_s: r.feedback_age_s,
            });
        }
        self.view.show(r, phase, t_s);
        self.last = Some(*r);
    }
}
