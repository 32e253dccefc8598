//! An operator who enables, moves, pauses and stops an arm at random times, and recovers it after faults.
use super::random::SeededRng;
use taustream_messages::{Command, Phase};
use taustream_streamer::answer::AnswerReason;

/// What the operator does next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deed {
    /// A command.
    Command(Command),
    /// A trajectory from where the arm is commanded.
    Trajectory,
}

/// One operator.
#[derive(Clone, Debug)]
pub struct Operator {
    rng: SeededRng,
    next_ms: u64,
    /// Only brings the arm back: no stops, no random commands.
    recovers: bool,
    /// The last refusal.
    refused: Option<AnswerReason>,
    speed_restored: bool,
}

impl Operator {
    /// The operator of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let rng = SeededRng::new(seed, 2);
        Self { rng, next_ms: 300, recovers: false, refused: None, speed_restored: false }
    }

    /// From now on the arm is only brought back to where it can be moved.
    pub fn recover(&mut self) {
        self.recovers = true;
        self.refused = None;
    }

    /// The arm runs at full speed again.
    #[must_use]
    pub fn is_ready(&self, phase: Phase) -> bool {
        self.recovers && self.speed_restored && phase == Phase::Holding
    }

    /// An answer came.
    pub fn answered(&mut self, accepted: bool, why: AnswerReason) {
        self.refused = (!accepted).then_some(why);
    }

    /// What is done at this millisecond, if anything.
    pub fn act(&mut self, now_ms: u64, phase: Phase) -> Option<Deed> {
        if now_ms < self.next_ms {
            return None;
        }
        let pause_ms = if self.rng.chance(0.3) { self.rng.whole(2, 30) } else { self.rng.whole(30, 500) };
        self.next_ms = now_ms + pause_ms;
        if self.recovers {
            return self.next_recovery(phase).map(Deed::Command);
        }
        if self.rng.chance(0.15) {
            return Some(self.any());
        }
        self.next_step(phase)
    }

    /// What a person does who wants the arm to work.
    fn next_step(&mut self, phase: Phase) -> Option<Deed> {
        match phase {
            Phase::Holding => Some(Deed::Trajectory),
            Phase::Moving => match self.rng.whole(0, 9) {
                0 => Some(Deed::Command(Command::Pause)),
                1 => Some(Deed::Command(Command::Stop)),
                2 => Some(Deed::Command(Command::FastStop)),
                3 | 4 => Some(Deed::Command(Command::Speed { percent: self.rng.within(10.0, 100.0) })),
                _ => None,
            },
            Phase::Pausing | Phase::Paused => Some(Deed::Command(Command::Resume)),
            Phase::Configuring
            | Phase::Disabled
            | Phase::Enabling
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Fault
            | Phase::Locked
            | Phase::Homing
            | Phase::Disabling => self.next_recovery(phase).map(Deed::Command),
        }
    }

    /// The command that leads back to an arm that holds.
    fn next_recovery(&mut self, phase: Phase) -> Option<Command> {
        match phase {
            Phase::Disabled | Phase::Locked => Some(Command::Enable),
            Phase::Paused => Some(Command::Stop),
            Phase::Moving | Phase::Pausing if self.recovers => Some(Command::Stop),
            Phase::Holding if !self.speed_restored => {
                self.speed_restored = self.recovers;
                Some(Command::Speed { percent: 100.0 })
            }
            Phase::Fault => Some(match self.refused.take() {
                Some(AnswerReason::PartlyEnergised { .. } | AnswerReason::HoldsBesideFailed { .. }) => {
                    Command::Disable
                }
                Some(AnswerReason::Unowned { .. }) => Command::TorqueOff,
                // A drive that cannot be trusted to hold: support the arm and take the torque off.
                Some(AnswerReason::NoFeedback { .. } | AnswerReason::Tracking { .. })
                    if self.rng.chance(0.3) =>
                {
                    Command::Disable
                }
                Some(_) | None => Command::ClearFault,
            }),
            Phase::Configuring
            | Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Homing
            | Phase::Disabling => None,
        }
    }

    /// Anything, whatever the phase.
    fn any(&mut self) -> Deed {
        Deed::Command(match self.rng.whole(0, 9) {
            0 => Command::Enable,
            1 => Command::Disable,
            2 => Command::Pause,
            3 => Command::Resume,
            4 => Command::Stop,
            5 => Command::FastStop,
            6 => Command::ClearFault,
            7 => Command::Speed { percent: self.rng.within(0.0, 100.0) },
            8 if self.rng.chance(0.3) => Command::TorqueOff,
            _ => return Deed::Trajectory,
        })
    }
}
