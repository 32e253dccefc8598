//! The queues between the service thread and the cycle: trajectories in, commands in, answers out.
//!
//! Trajectories travel in boxes that are made at start and go round: empty from the cycle to the service thread,
//! filled back. So nothing is allocated or freed on the real-time thread, and a sender that floods finds no box.
use crate::answer::CommandAnswer;
use crate::buses::Links;
use crate::cycle_state::{COMMANDS_MAX, CycleState, PendingCommand, Restored, TrajectoryResult};
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
pub type Answers = [Option<CommandAnswer>; COMMANDS_MAX + 1];

/// A trajectory in its box.
pub type Boxed = Box<CheckedTrajectory>;

/// How the streamer is asked to end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shutdown {
    /// Not at all.
    #[default]
    No,
    /// Stop on the path, hold, de-energise, end.
    Orderly,
    /// Torque off and end: the arm may fall.
    AtOnce,
}

/// Links of failed buses, on their way to be restarted or back. One at a time is on its way.
pub struct Handover {
    /// The `clear-fault` that asked for it.
    pub sequence: u64,
    /// The links; none of the buses that are well.
    pub links: Links,
    /// On the way back: every one of them was restarted.
    pub recovered: bool,
}

struct Queues {
    shutdown: AtomicU8,
    failed_links: ArrayQueue<Handover>,
    restored_links: ArrayQueue<Handover>,
    empty: ArrayQueue<Boxed>,
    filled: ArrayQueue<Boxed>,
    trajectory_results: ArrayQueue<TrajectoryResult>,
    pending: ArrayQueue<PendingCommand>,
    answers: ArrayQueue<CommandAnswer>,
}

impl std::fmt::Debug for Queues {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Queues").field("leave", &self.shutdown).finish_non_exhaustive()
    }
}

/// The cycle's end of the queues.
#[derive(Debug)]
pub struct Intake(Arc<Queues>);

/// The service thread's end of the queues.
#[derive(Debug)]
pub struct CommandQueue(Arc<Queues>);

/// Makes both ends, with all boxes at the service thread's.
#[must_use]
pub fn pair() -> (Intake, CommandQueue) {
    let queues = Arc::new(Queues {
        shutdown: AtomicU8::new(0),
        failed_links: ArrayQueue::new(1),
        restored_links: ArrayQueue::new(1),
        empty: ArrayQueue::new(BOXES),
        filled: ArrayQueue::new(BOXES),
        trajectory_results: ArrayQueue::new(BOXES),
        pending: ArrayQueue::new(COMMANDS_PENDING_MAX),
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
    (Intake(Arc::clone(&queues)), CommandQueue(queues))
}

impl Intake {
    /// Takes this cycle's commands, and one trajectory if one waits.
    ///
    /// Real time: at most [`COMMANDS_MAX`] commands and one trajectory; no allocation.
    pub fn subscribe(&mut self, cycle_state: &mut CycleState) -> Option<Boxed> {
        for slot in cycle_state.commands.iter_mut().take(COMMANDS_MAX) {
            *slot = self.0.pending.pop();
        }
        self.0.filled.pop()
    }

    /// Hands a box back that the track does not need any more.
    ///
    /// Real time: no allocation; never frees (there is room for every box that exists).
    pub fn recycle(&mut self, spare: Option<Boxed>) {
        if let Some(Err(stranger)) = spare.map(|b| self.0.empty.push(b)) {
            Box::leak(stranger);
        }
    }

    /// Hands links out to be restarted; gives them back when others are still on their way.
    ///
    /// Real time: moves pointers.
    pub fn hand_out(&mut self, links: Handover) -> Option<Handover> {
        self.0.failed_links.push(links).err()
    }

    /// Takes links that come back.
    ///
    /// Real time: moves pointers.
    pub fn reclaim(&mut self, cycle_state: &mut CycleState) -> Option<Handover> {
        let back = self.0.restored_links.pop()?;
        cycle_state.restored = Some(Restored { sequence: back.sequence, recovered: back.recovered });
        Some(back)
    }

    /// How the streamer is asked to end.
    ///
    /// Real time: one atomic load.
    #[must_use]
    pub fn shutdown(&self) -> Shutdown {
        match self.0.shutdown.load(Ordering::Relaxed) {
            0 => Shutdown::No,
            1 => Shutdown::Orderly,
            _ => Shutdown::AtOnce,
        }
    }

    /// Answers the trajectory and the commands of a cycle. Every box and every command has room for its answer.
    ///
    /// Real time: no allocation.
    pub fn answer(&mut self, trajectory_result: Option<TrajectoryResult>, answers: &Answers) {
        if let Some(trajectory_result) = trajectory_result {
            self.0.trajectory_results.force_push(trajectory_result);
        }
        for answer in answers.iter().flatten() {
            self.0.answers.force_push(*answer);
        }
    }
}

impl CommandQueue {
    /// An empty box to fill, if one is free.
    #[must_use]
    pub fn empty_box(&self) -> Option<Boxed> {
        self.0.empty.pop()
    }

    /// Hands a filled box to the cycle, or puts one back that was not used.
    pub fn offer(&self, filled: Boxed) {
        // A box came out of `empty`, so there is room in `filled` for it.
        if let Err(refused) = self.0.filled.push(filled) {
            self.return_unused(refused);
        }
    }

    /// Puts an unused box back.
    pub fn return_unused(&self, unused: Boxed) {
        drop(self.0.empty.push(unused));
    }

    /// Asks the cycle; false when too many commands are on their way.
    #[must_use]
    pub fn push_command(&self, pending: PendingCommand) -> bool {
        self.0.pending.push(pending).is_ok()
    }

    /// Links that are to be restarted.
    #[must_use]
    pub fn failed_links(&self) -> Option<Handover> {
        self.0.failed_links.pop()
    }

    /// Gives links back to the cycle.
    pub fn return_links(&self, links: Handover) {
        // One handover is on its way at a time, so there is room.
        drop(self.0.restored_links.push(links));
    }

    /// A handle by which another thread asks the cycle to end.
    #[must_use]
    pub fn shutdown_handle(&self) -> ShutdownHandle {
        ShutdownHandle(Arc::clone(&self.0))
    }

    /// The next answer to a command.
    #[must_use]
    pub fn answer(&self) -> Option<CommandAnswer> {
        self.0.answers.pop()
    }

    /// The next answer to a trajectory.
    #[must_use]
    pub fn trajectory_result(&self) -> Option<TrajectoryResult> {
        self.0.trajectory_results.pop()
    }
}

/// Asks the cycle to end.
#[derive(Clone, Debug)]
pub struct ShutdownHandle(Arc<Queues>);

impl ShutdownHandle {
    /// Requests; a stronger request replaces a weaker one.
    pub fn request(&self, shutdown: Shutdown) {
        let level = match shutdown {
            Shutdown::No => 0,
            Shutdown::Orderly => 1,
            Shutdown::AtOnce => 2,
        };
        self.0.shutdown.fetch_max(level, Ordering::Relaxed);
    }
}
