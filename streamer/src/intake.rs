//! The queues between the service thread and the cycle: trajectories in, commands in, answers out.
//!
//! Trajectories travel in boxes that are made at start and go round: empty from the cycle to the service thread,
//! filled back. So nothing is allocated or freed on the real-time thread, and a sender that floods finds no box.
use crate::buses::Links;
use crate::facts::{Asked, COMMANDS_MAX, Facts, Restored, Verdict};
use crate::words::Answer;
use crossbeam_queue::ArrayQueue;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use taustream_messages::{CheckedTrajectory, Replaces};
use taustream_motion::{MAX_JOINTS, Trajectory};

/// Boxes in circulation: one runs, one waits, two are being checked or answered.
const BOXES: usize = 4;
/// Commands that may be on their way at one time.
pub const COMMANDS_PENDING_MAX: usize = 16;

/// The answers of one cycle: to its commands, and to a `clear-fault` of before that waited for a bus.
pub type Answers = [Option<Answer>; COMMANDS_MAX + 1];

/// A trajectory in its box.
pub type Boxed = Box<CheckedTrajectory>;

/// How the streamer is asked to end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Leave {
    /// Not at all.
    #[default]
    No,
    /// Stop on the path, hold, de-energise, end.
    Orderly,
    /// Torque off and end: the arm may fall.
    AtOnce,
}

/// Links of failed buses, on their way to be started over or back. One at a time is on its way.
pub struct Handover {
    /// The `clear-fault` that asked for it.
    pub sequence: u64,
    /// The links; none of the buses that are well.
    pub links: Links,
    /// On the way back: every one of them was started over.
    pub well: bool,
}

struct Queues {
    leave: AtomicU8,
    failed_links: ArrayQueue<Handover>,
    restored_links: ArrayQueue<Handover>,
    empty: ArrayQueue<Boxed>,
    filled: ArrayQueue<Boxed>,
    verdicts: ArrayQueue<Verdict>,
    asked: ArrayQueue<Asked>,
    answers: ArrayQueue<Answer>,
}

impl std::fmt::Debug for Queues {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Queues").field("leave", &self.leave).finish_non_exhaustive()
    }
}

/// The cycle's end of the queues.
#[derive(Debug)]
pub struct Intake(Arc<Queues>);

/// The service thread's end of the queues.
#[derive(Debug)]
pub struct Desk(Arc<Queues>);

/// Makes both ends, with all boxes at the service thread's.
#[must_use]
pub fn pair() -> (Intake, Desk) {
    let queues = Arc::new(Queues {
        leave: AtomicU8::new(0),
        failed_links: ArrayQueue::new(1),
        restored_links: ArrayQueue::new(1),
        empty: ArrayQueue::new(BOXES),
        filled: ArrayQueue::new(BOXES),
        verdicts: ArrayQueue::new(BOXES),
        asked: ArrayQueue::new(COMMANDS_PENDING_MAX),
        answers: ArrayQueue::new(COMMANDS_PENDING_MAX),
    });
    // One joint and no stroke: a trajectory that the checks of `Trajectory` always let pass.
    while let Ok(trajectory) = Trajectory::new(1, [0.0; MAX_JOINTS], &[]) {
        let blank = CheckedTrajectory {
            trajectory_id: 0,
            generation: 0,
            robot_digest: [0; 32],
            replaces: Replaces::Rest,
            trajectory,
        };
        if queues.empty.push(Box::new(blank)).is_err() {
            break;
        }
    }
    (Intake(Arc::clone(&queues)), Desk(queues))
}

impl Intake {
    /// Takes this cycle's commands, and one trajectory if one waits.
    ///
    /// Real time: at most [`COMMANDS_MAX`] commands and one trajectory; no allocation.
    pub fn subscribe(&mut self, facts: &mut Facts) -> Option<Boxed> {
        for slot in facts.commands.iter_mut().take(COMMANDS_MAX) {
            *slot = self.0.asked.pop();
        }
        self.0.filled.pop()
    }

    /// Hands a box back that the track does not need any more.
    ///
    /// Real time: no allocation; never frees (there is room for every box that exists).
    pub fn give_back(&mut self, spare: Option<Boxed>) {
        if let Some(Err(stranger)) = spare.map(|b| self.0.empty.push(b)) {
            Box::leak(stranger);
        }
    }

    /// Hands links out to be started over; gives them back when others are still on their way.
    ///
    /// Real time: moves pointers.
    pub fn hand_out(&mut self, links: Handover) -> Option<Handover> {
        self.0.failed_links.push(links).err()
    }

    /// Takes links that come back.
    ///
    /// Real time: moves pointers.
    pub fn take_back(&mut self, facts: &mut Facts) -> Option<Handover> {
        let back = self.0.restored_links.pop()?;
        facts.restored = Some(Restored { sequence: back.sequence, well: back.well });
        Some(back)
    }

    /// How the streamer is asked to end.
    ///
    /// Real time: one atomic load.
    #[must_use]
    pub fn leave(&self) -> Leave {
        match self.0.leave.load(Ordering::Relaxed) {
            0 => Leave::No,
            1 => Leave::Orderly,
            _ => Leave::AtOnce,
        }
    }

    /// Answers the trajectory and the commands of a cycle. Every box and every command has room for its answer.
    ///
    /// Real time: no allocation.
    pub fn answer(&mut self, verdict: Option<Verdict>, answers: &Answers) {
        if let Some(verdict) = verdict {
            self.0.verdicts.force_push(verdict);
        }
        for answer in answers.iter().flatten() {
            self.0.answers.force_push(*answer);
        }
    }
}

impl Desk {
    /// An empty box to fill, if one is free.
    #[must_use]
    pub fn empty_box(&self) -> Option<Boxed> {
        self.0.empty.pop()
    }

    /// Hands a filled box to the cycle, or puts one back that was not used.
    pub fn offer(&self, filled: Boxed) {
        // A box came out of `empty`, so there is room in `filled` for it.
        if let Err(refused) = self.0.filled.push(filled) {
            self.put_back(refused);
        }
    }

    /// Puts an unused box back.
    pub fn put_back(&self, unused: Boxed) {
        drop(self.0.empty.push(unused));
    }

    /// Asks the cycle; false when too many commands are on their way.
    #[must_use]
    pub fn ask(&self, asked: Asked) -> bool {
        self.0.asked.push(asked).is_ok()
    }

    /// Links that are to be started over.
    #[must_use]
    pub fn failed_links(&self) -> Option<Handover> {
        self.0.failed_links.pop()
    }

    /// Gives links back to the cycle.
    pub fn give_back_links(&self, links: Handover) {
        // One handover is on its way at a time, so there is room.
        drop(self.0.restored_links.push(links));
    }

    /// A handle by which another thread asks the cycle to end.
    #[must_use]
    pub fn leaver(&self) -> Leaver {
        Leaver(Arc::clone(&self.0))
    }

    /// The next answer to a command.
    #[must_use]
    pub fn answer(&self) -> Option<Answer> {
        self.0.answers.pop()
    }

    /// The next answer to a trajectory.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.0.verdicts.pop()
    }
}

/// Asks the cycle to end.
#[derive(Clone, Debug)]
pub struct Leaver(Arc<Queues>);

impl Leaver {
    /// Asks; a stronger wish replaces a weaker one.
    pub fn ask(&self, leave: Leave) {
        let wish = match leave {
            Leave::No => 0,
            Leave::Orderly => 1,
            Leave::AtOnce => 2,
        };
        self.0.leave.fetch_max(wish, Ordering::Relaxed);
    }
}
