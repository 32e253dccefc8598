//! The cycle: the only place where the stages meet.
//!
//! `subscribe -> splice -> sample -> guard -> axes -> feed-forward -> encode -> send -> receive -> supervise -> report`. No stage calls
//! another, none returns early, none reads a clock: everything is a function of the tick and of what arrived, so a
//! recorded run replays exactly.
use crate::axes::Axes;
use crate::buses::Buses;
use crate::cycle_state::CycleState;
use crate::feed_forward::FeedForward;
use crate::guard::Guard;
use crate::intake::{Answers, Handover, Intake};
use crate::last_sent::Ledger;
use crate::record_first::Records;
use crate::referencing::LastPoses;
use crate::report::{Reporter, Writers};
use crate::supervise::{Actions, Supervisor};
use crate::tick::Tick;
use crate::track::Track;
use crate::write_ahead::Requester;
use taustream_arm::Settings;
use taustream_drivers::{CanLink, DriveTarget};

/// A stage of the cycle, named when it has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// A trajectory and commands were taken.
    Subscribe,
    /// The trajectory was accepted or refused.
    Splice,
    /// The setpoint was computed.
    Sample,
    /// It was let pass or replaced.
    Guard,
    /// The setpoints of the axes beside the path were added.
    Axes,
    /// Torques were added to it.
    FeedForward,
    /// Frames were written.
    Encode,
    /// Frames were passed to the links.
    Send,
    /// Frames were taken and read.
    Receive,
    /// The next phase was decided.
    Supervise,
    /// Reports and records were pushed.
    Report,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: [Self; 11] = [
        Self::Subscribe,
        Self::Splice,
        Self::Sample,
        Self::Guard,
        Self::Axes,
        Self::FeedForward,
        Self::Encode,
        Self::Send,
        Self::Receive,
        Self::Supervise,
        Self::Report,
    ];
    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Subscribe => "subscribe",
            Self::Splice => "splice",
            Self::Sample => "sample",
            Self::Guard => "guard",
            Self::Axes => "axes",
            Self::FeedForward => "feed-forward",
            Self::Encode => "encode",
            Self::Send => "send",
            Self::Receive => "receive",
            Self::Supervise => "supervise",
            Self::Report => "report",
        }
    }
}

/// Watches the stages go by. The streamer's own watches nothing and costs nothing.
pub trait Probe {
    /// A stage has ended.
    fn ended(&mut self, stage: Stage);
}

/// Watches nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProbe;

impl Probe for NoProbe {
    #[inline(always)]
    fn ended(&mut self, _stage: Stage) {}
}

/// Everything that the cycle owns.
#[derive(Debug)]
pub struct Core {
    intake: Intake,
    ledger: Ledger,
    track: Track,
    guard: Guard,
    axes: Axes,
    feed_forward: FeedForward,
    buses: Buses,
    supervisor: Supervisor,
    reporter: Reporter,
}

impl Core {
    /// Puts the stages together for the arm of `settings`.
    #[must_use]
    pub fn new(settings: &Settings, buses: Buses, intake: Intake, reports: Writers) -> Self {
        let limits = settings.robot.limits();
        let joints = settings.robot.joints.len();
        Self {
            intake,
            ledger: Ledger::new(settings),
            track: Track::new(settings),
            guard: Guard::new(limits, joints, settings.cycle.period_us),
            axes: Axes::new(settings),
            feed_forward: FeedForward::new(settings),
            supervisor: Supervisor::new(settings, Records::none()),
            reporter: Reporter::new(settings, buses.local(), reports),
            buses,
        }
    }

    /// Takes the last pose that is known, before the first cycle.
    pub fn restore_poses(&mut self, last_poses: &LastPoses) {
        self.supervisor.referencing_mut().restore_poses(last_poses);
    }

    /// From now on drives are energised only after `requester`'s record is on the disk. A core without one, as benches use,
    /// drives no real arm.
    pub fn record_first(&mut self, requester: Requester) {
        self.supervisor.records = Records::new(requester);
    }

    /// The supervisor, to look at.
    #[must_use]
    pub fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// The links, for the bench's bare loop.
    pub(crate) fn links_mut(&mut self) -> impl Iterator<Item = &mut dyn CanLink> {
        self.buses.links_mut()
    }

    /// Carries out what the evaluation requires of the other stages.
    fn apply(&mut self, tick: Tick, actions: &Actions) {
        if let Some(order) = actions.speed {
            self.track.change_speed(order);
        }
        if actions.drop_trajectory {
            let spare = self.track.drop_successor();
            self.intake.recycle(spare);
            let spare = self.track.drop_trajectory();
            self.intake.recycle(spare);
            self.guard.release();
            self.ledger.rest(tick.number);
        }
        if let Some(pose_rad) = &actions.pose_rad {
            self.ledger.set_pose(pose_rad, tick.number);
            self.axes.set_pose(pose_rad, tick.number);
            self.track.restart();
            self.guard.permit_anew();
        }
        self.axes.apply(&actions.axes);
        if actions.clear_faults {
            self.buses.clear_faults();
        }
        if let Some(sequence) = actions.restore_buses {
            let links = Handover { sequence, links: self.buses.hand_out(), recovered: false };
            if let Some(refused) = self.intake.hand_out(links) {
                self.buses.reclaim(refused.links, false);
            }
        }
    }
}

/// What follows a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Another one.
    Go,
    /// The end: drives are de-energised.
    Ended,
    /// The end: drives could not be seen to be de-energised.
    EndedAtOnce,
}

/// Runs one cycle, from the newest plan to the report.
///
/// Every stage runs every time. A stage that cannot do its work hands on a value that is safe and writes the reason
/// into `cycle_state`; only `evaluate` turns reasons into a change of phase, which steers the next cycle.
///
/// Real time: no allocation, no lock, no log line, no clock; system calls are one send and at most two receives a bus.
pub fn run_cycle<P: Probe>(core: &mut Core, tick: Tick, probe: &mut P) -> Next {
    let mut cycle_state = CycleState::begin(tick);
    let drive_target = core.supervisor.drive_target();

    let offer = core.intake.subscribe(&mut cycle_state);
    let restored = core.intake.reclaim(&mut cycle_state);
    probe.ended(Stage::Subscribe);
    let (phase, speed) = (core.supervisor.phase(), core.supervisor.speed());
    let spare = core.track.splice(offer, (phase, speed), &core.ledger, &mut cycle_state);
    core.intake.recycle(spare);
    probe.ended(Stage::Splice);
    core.ledger.find_stopped(&mut cycle_state);
    let requested = core.track.sample(drive_target == DriveTarget::Enabled, &core.ledger, &mut cycle_state);
    probe.ended(Stage::Sample);
    let guarded = core.guard.limit(&requested, &core.ledger, &mut cycle_state); // The last check before the bus.
    probe.ended(Stage::Guard);
    let with_axes = core.axes.add(guarded, &mut cycle_state);
    probe.ended(Stage::Axes);
    let command = core.feed_forward.add(with_axes, &core.ledger, &cycle_state);
    probe.ended(Stage::FeedForward);

    let drive_commands = core.supervisor.referencing().to_drives(command.joints());
    core.buses.set_homing(core.supervisor.homing_joint());
    core.buses.encode(tick.wake_time, drive_target, &drive_commands);
    probe.ended(Stage::Encode);
    core.buses.send(&mut cycle_state);
    core.ledger.record(&command, requested.restart, &mut cycle_state);
    let replaced = core.track.commit(&command.setpoint().position_rad, &core.ledger, &mut cycle_state);
    core.axes.record(&command, &mut cycle_state);
    core.intake.recycle(replaced);
    probe.ended(Stage::Send);
    core.buses.receive(tick.wake_time, &mut cycle_state);
    core.supervisor.referencing_mut().read(&mut cycle_state);
    core.feed_forward.read(&cycle_state.servos);
    probe.ended(Stage::Receive);

    let mut answers: Answers = [None; _];
    let actions = core.supervisor.evaluate(&cycle_state, core.intake.shutdown(), &mut answers);
    core.axes.observe(core.supervisor.watch(), core.supervisor.phase(), &mut cycle_state);
    probe.ended(Stage::Supervise);
    core.reporter.write(&cycle_state, &command, &core.track, (&core.supervisor, &actions));
    core.intake.answer(cycle_state.trajectory_result, &answers);
    core.apply(tick, &actions);
    if let Some(back) = restored {
        core.buses.reclaim(back.links, back.recovered);
    }
    probe.ended(Stage::Report);
    match actions.shutdown {
        None => Next::Go,
        Some(true) => Next::Ended,
        Some(false) => Next::EndedAtOnce,
    }
}
