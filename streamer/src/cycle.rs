//! The cycle: the only place where the stages meet.
//!
//! `subscribe -> splice -> sample -> guard -> encode -> send -> receive -> supervise -> report`. No stage calls
//! another, none returns early, none reads a clock: everything is a function of the tick and of what arrived, so a
//! recorded run replays exactly.
use crate::buses::Buses;
use crate::facts::Facts;
use crate::guard::Guard;
use crate::intake::{Answers, Handover, Intake};
use crate::report::Reporter;
use crate::supervise::{Orders, Supervisor};
use crate::tick::Tick;
use crate::track::Track;
use crate::turns::Memory;
use taustream_arm::Settings;
use taustream_drivers::{CanLink, DriveWish};

/// A stage of the cycle, named when it has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// A trajectory and commands were taken.
    Subscribe,
    /// The trajectory was taken over or refused.
    Splice,
    /// The setpoint was computed.
    Sample,
    /// It was let pass or replaced.
    Guard,
    /// Frames were written.
    Encode,
    /// Frames were handed over.
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
    pub const ALL: [Self; 9] = [
        Self::Subscribe,
        Self::Splice,
        Self::Sample,
        Self::Guard,
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
    track: Track,
    guard: Guard,
    buses: Buses,
    supervisor: Supervisor,
    reporter: Reporter,
}

impl Core {
    /// Puts the stages together for the arm of `settings`.
    #[must_use]
    pub fn new(settings: &Settings, buses: Buses, intake: Intake, recording: bool) -> Self {
        let limits = settings.robot.limits();
        let joints = settings.robot.joints.len();
        let (cycle, rules) = (&settings.cycle, &settings.supervision);
        Self {
            intake,
            track: Track::new(&limits, joints, cycle, rules),
            guard: Guard::new(limits, joints, cycle.period_us),
            buses,
            supervisor: Supervisor::new(settings),
            reporter: Reporter::new(settings.robot.digest, (joints, settings.buses.len()), cycle, recording),
        }
    }

    /// Takes the last pose that is known, before the first cycle.
    pub fn recall(&mut self, memory: &Memory) {
        self.supervisor.turns_mut().recall(memory);
    }

    /// The reading ends of the cycle's queues.
    #[must_use]
    pub fn readers(&self) -> crate::report::Readers {
        self.reporter.readers()
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

    /// Carries out what the judgement asks of the other stages.
    fn obey(&mut self, orders: &Orders) {
        if let Some(order) = orders.speed {
            self.track.change_speed(order);
        }
        if orders.drop_trajectory {
            let spare = self.track.drop_trajectory();
            self.intake.give_back(spare);
            self.guard.release();
        }
        if let Some(pose_rad) = &orders.pose_rad {
            self.track.set_pose(pose_rad);
        }
        if orders.clear_faults {
            self.buses.clear_faults();
        }
        if let Some(sequence) = orders.restore_buses {
            let links = Handover { sequence, links: self.buses.hand_out(), well: false };
            if let Some(refused) = self.intake.hand_out(links) {
                self.buses.take_back(refused.links, false);
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
/// into `facts`; only `judge` turns reasons into a change of phase, which steers the next cycle.
///
/// Real time: no allocation, no lock, no log line, no clock; system calls are one send and at most two receives a bus.
pub fn run_cycle<P: Probe>(core: &mut Core, tick: Tick, probe: &mut P) -> Next {
    let mut facts = Facts::begin(tick);
    let wish = core.supervisor.wish();

    let offer = core.intake.subscribe(&mut facts);
    let restored = core.intake.take_back(&mut facts);
    probe.ended(Stage::Subscribe);
    let (phase, speed) = (core.supervisor.phase(), core.supervisor.speed());
    let spare = core.track.splice(offer, phase, speed, &mut facts);
    core.intake.give_back(spare);
    probe.ended(Stage::Splice);
    let wanted = core.track.sample(wish == DriveWish::Enabled, &mut facts);
    probe.ended(Stage::Sample);
    let command = core.guard.limit(&wanted, &mut facts); // The last gate before metal.
    probe.ended(Stage::Guard);

    let told = core.supervisor.turns().tell(command.joints());
    core.buses.encode(tick.woke, wish, &told);
    probe.ended(Stage::Encode);
    core.buses.send(&mut facts);
    core.track.commit(&command.setpoint().position_rad, &mut facts);
    core.guard.commit(&facts);
    probe.ended(Stage::Send);
    core.buses.receive(tick.woke, &mut facts);
    core.supervisor.turns_mut().read(&mut facts);
    probe.ended(Stage::Receive);

    let mut answers: Answers = [None; _];
    let orders = core.supervisor.judge(&facts, core.intake.leave(), &mut answers);
    probe.ended(Stage::Supervise);
    core.reporter.write(&facts, &command, &core.track, (&core.supervisor, &orders));
    core.intake.answer(facts.verdict, &answers);
    core.obey(&orders);
    if let Some(back) = restored {
        core.buses.take_back(back.links, back.well);
    }
    probe.ended(Stage::Report);
    match orders.leave {
        None => Next::Go,
        Some(true) => Next::Ended,
        Some(false) => Next::EndedAtOnce,
    }
}
