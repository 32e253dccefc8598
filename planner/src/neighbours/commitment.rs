//! Who may commit a motion: one planner at a time, of two arms that are neighbours.
//!
//! Each pair of arms has a lock file, which the kernel releases when its holder dies, and each arm a record of what its planner has
//! committed. A planner takes the locks of all its pairs, in the order of their names, checks its motion against what the records
//! and reports of the others say then, writes down that it is about to send, sends, and writes down what became of it.
//! So two planners never check at the same time, and whoever checks later knows what the other has sent. Where a planner dies
//! between sending and the receipt, its record says until when the streamer may still accept the motion.
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read};
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};
use taustream_messages::clock::now_ns;

/// Below the runtime directory.
const DIRECTORY: &str = "neighbours";
/// How often a lock that another planner holds is tried.
const POLL: Duration = Duration::from_millis(1);
/// Motions that a record names: one runs, one waits, others were replaced or are about to begin.
const IDS_MAX: usize = 8;
/// Longest time for which a motion is valid; a record that says more is of before the computer was started.
pub(crate) const VALID_NS_MAX: u64 = 10_000_000_000;
/// Records are padded, so that a shorter one leaves nothing behind of a longer one.
const RECORD_BYTES: usize = 512;

/// What the planner of an arm has committed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Grows with everything that the planner does to its arm.
    pub sequence: u64,
    /// `CLOCK_MONOTONIC` until which the streamer may accept a motion whose receipt was not seen, ns; 0 for none.
    pub pending_until_ns: u64,
    /// The motions that were checked against the neighbours, newest last.
    pub trajectory_ids: Vec<u64>,
}

impl Record {
    /// True while the streamer may accept a motion of which nothing more is known.
    #[must_use]
    pub fn is_pending(&self, now_ns: u64) -> bool {
        let left_ns = self.pending_until_ns.saturating_sub(now_ns);
        (1..=VALID_NS_MAX).contains(&left_ns)
    }

    fn text(&self) -> String {
        let ids: Vec<String> = self.trajectory_ids.iter().map(u64::to_string).collect();
        let text = format!("{} {} {}", self.sequence, self.pending_until_ns, ids.join(" "));
        format!("{text:<width$}\n", width = RECORD_BYTES - 1)
    }

    fn parse(text: &str) -> Option<Self> {
        let mut numbers = text.split_whitespace().map(str::parse::<u64>);
        let (sequence, pending_until_ns) = (numbers.next()?.ok()?, numbers.next()?.ok()?);
        let trajectory_ids: Vec<u64> = numbers.collect::<Result<_, _>>().ok()?;
        (trajectory_ids.len() <= IDS_MAX).then_some(Self { sequence, pending_until_ns, trajectory_ids })
    }
}

/// Why nothing can be committed.
#[derive(Debug, thiserror::Error)]
pub enum CommitError {
    /// Another planner has the lock.
    #[error(
        "the planner of neighbour `{neighbour}` has been sending a motion for {within_s:.1} s; ask again, or end it if it hangs"
    )]
    Busy {
        /// The arm.
        neighbour: String,
        /// How long it was waited for.
        within_s: f64,
    },
    /// The disk.
    #[error("{}: {why}; remove that file while both arms rest", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
}

/// The lock files and records of one arm and its neighbours.
#[derive(Debug)]
pub struct Commitments {
    directory: PathBuf,
    own: String,
    /// The neighbours, with the file of the pair, in the order of these files.
    pairs: Vec<(String, PathBuf)>,
}

/// The right to commit a motion, until it is dropped.
#[derive(Debug)]
pub struct Turn<'a> {
    commitments: &'a Commitments,
    locks: Vec<(File, &'a Path)>,
}

impl Commitments {
    /// Makes the directory, below the runtime directory.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(runtime: &Path, own: &str, neighbours: &[&str]) -> Result<Self, CommitError> {
        let directory = runtime.join(DIRECTORY);
        make(&directory)?;
        let pair = |other: &&str| {
            let (first, second) = if own < *other { (own, *other) } else { (*other, own) };
            ((*other).to_owned(), directory.join(format!("{first}+{second}.lock")))
        };
        let mut pairs: Vec<(String, PathBuf)> = neighbours.iter().map(pair).collect();
        pairs.sort_by(|a, b| a.1.cmp(&b.1));
        Ok(Self { own: own.to_owned(), pairs, directory })
    }

    /// Takes the locks of all pairs.
    ///
    /// # Errors
    /// When another planner holds one for longer, or a file cannot be locked.
    pub fn take_turn(&self, within: Duration) -> Result<Turn<'_>, CommitError> {
        make(&self.directory)?;
        let since = Instant::now();
        let mut locks = Vec::new();
        for (neighbour, path) in &self.pairs {
            let file = loop {
                let file = open(path)?;
                match file.try_lock() {
                    // Somebody may have deleted the file, and made another one.
                    Ok(()) if is_at(&file, path) => break file,
                    Ok(()) => {}
                    Err(TryLockError::Error(e)) => return Err(failed(path, &e)),
                    Err(TryLockError::WouldBlock) if since.elapsed() > within => {
                        let (neighbour, within_s) = (neighbour.clone(), within.as_secs_f64());
                        return Err(CommitError::Busy { neighbour, within_s });
                    }
                    Err(TryLockError::WouldBlock) => thread::sleep(POLL),
                }
            };
            locks.push((file, path.as_path()));
        }
        Ok(Turn { commitments: self, locks })
    }

    /// What an arm's planner has written down last.
    ///
    /// # Errors
    /// When the file makes no sense.
    pub fn record_of(&self, arm: &str) -> Result<Record, CommitError> {
        let path = self.record_path(arm);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Record::default()),
            Err(e) => return Err(failed(&path, &e)),
        };
        let mut text = String::new();
        file.take(2 * RECORD_BYTES as u64).read_to_string(&mut text).map_err(|e| failed(&path, &e))?;
        Record::parse(&text)
            .ok_or_else(|| CommitError::File { path, why: "is no record of a planner".to_owned() })
    }

    fn record_path(&self, arm: &str) -> PathBuf {
        self.directory.join(format!("{arm}.committed"))
    }

    /// The file that says what the tip of an arm holds.
    #[must_use]
    pub fn tip_path(&self, arm: &str) -> PathBuf {
        self.directory.join(format!("{arm}.tip.toml"))
    }
}

impl Turn<'_> {
    /// Writes down that a motion is about to be sent, which the streamer may accept for as long as `valid`.
    ///
    /// # Errors
    /// When the lock is no longer the one of the pair, or the disk refuses: nothing may be sent then.
    pub fn announce(&self, valid: Duration) -> Result<(), CommitError> {
        for (file, path) in &self.locks {
            if !is_at(file, path) {
                return Err(CommitError::File {
                    path: (*path).to_owned(),
                    why: "was deleted by somebody while it was locked".to_owned(),
                });
            }
        }
        let valid_ns = u64::try_from(valid.as_nanos()).unwrap_or(VALID_NS_MAX).min(VALID_NS_MAX);
        self.change(&self.commitments.own, |record| {
            record.pending_until_ns = now_ns().saturating_add(valid_ns);
        })
    }

    /// Writes down what was sent. Without a receipt it stays pending.
    ///
    /// # Errors
    /// When the disk refuses; the motion then stays pending until it is not valid any more.
    pub fn settle(&self, trajectory_id: Option<u64>, was_answered: bool) -> Result<(), CommitError> {
        self.change(&self.commitments.own, |record| {
            record.trajectory_ids.extend(trajectory_id);
            let surplus = record.trajectory_ids.len().saturating_sub(IDS_MAX);
            record.trajectory_ids.drain(..surplus);
            if was_answered {
                record.pending_until_ns = 0;
            }
        })
    }

    /// Clears what a planner has left pending, once a report has said what became of it.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn clear_pending(&self, arm: &str) -> Result<(), CommitError> {
        self.change(arm, |record| record.pending_until_ns = 0)
    }

    fn change(&self, arm: &str, change: impl FnOnce(&mut Record)) -> Result<(), CommitError> {
        // What makes no sense is replaced by its owner.
        let own = arm == self.commitments.own;
        let record = self.commitments.record_of(arm);
        let mut record = if own { record.unwrap_or_default() } else { record? };
        // The clock makes it differ from every earlier one, also where the file was lost.
        record.sequence = record.sequence.saturating_add(1).max(now_ns());
        change(&mut record);
        let path = self.commitments.record_path(arm);
        // In one piece: a reader without the lock, or a death in the middle, meets the old record or the new one.
        let file = OpenOptions::new().write(true).create(true).truncate(false).mode(0o600).open(&path);
        file.and_then(|file| file.write_all_at(record.text().as_bytes(), 0)).map_err(|e| failed(&path, &e))
    }
}

fn make(directory: &Path) -> Result<(), CommitError> {
    fs::DirBuilder::new().recursive(true).mode(0o700).create(directory).map_err(|e| failed(directory, &e))
}

fn open(path: &Path) -> Result<File, CommitError> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(0o600);
    options.open(path).map_err(|e| failed(path, &e))
}

fn is_at(file: &File, path: &Path) -> bool {
    let (of_file, of_path) = (file.metadata(), fs::symlink_metadata(path));
    matches!((of_file, of_path), (Ok(a), Ok(b)) if (a.dev(), a.ino()) == (b.dev(), b.ino()))
}

fn failed(path: &Path, error: &io::Error) -> CommitError {
    CommitError::File { path: path.to_owned(), why: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("taustream-commitment-{name}-{}", std::process::id()));
        let _none = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        path
    }

    #[test]
    fn turn_is_one_planners_at_a_time_and_ends_with_it() {
        let runtime = scratch("turn");
        let left = Commitments::open(&runtime, "left", &["right", "third"]).unwrap();
        let right = Commitments::open(&runtime, "right", &["left"]).unwrap();
        let turn = left.take_turn(Duration::ZERO).unwrap();
        let refused = right.take_turn(Duration::from_millis(5)).unwrap_err().to_string();
        assert!(refused.contains("neighbour `left`"), "{refused}");
        drop(turn);
        let turn = right.take_turn(Duration::ZERO).unwrap();
        assert!(left.take_turn(Duration::ZERO).is_err(), "and the other way round");
        // A cleaner that deletes the lock file gives a second planner a turn, but the first one sends nothing any more.
        fs::remove_file(runtime.join("neighbours/left+right.lock")).unwrap();
        let refused = turn.announce(Duration::from_secs(1)).unwrap_err().to_string();
        assert!(refused.contains("was deleted"), "{refused}");
        fs::remove_dir_all(runtime).unwrap();
    }

    #[test]
    fn record_says_what_was_sent_and_for_how_long_it_is_pending() {
        let runtime = scratch("record");
        let left = Commitments::open(&runtime, "left", &["right"]).unwrap();
        let right = Commitments::open(&runtime, "right", &["left"]).unwrap();
        assert_eq!(right.record_of("left").unwrap(), Record::default());
        let turn = left.take_turn(Duration::ZERO).unwrap();
        turn.announce(Duration::from_secs(2)).unwrap();
        let announced = right.record_of("left").unwrap();
        let now_ns = now_ns();
        assert!(announced.is_pending(now_ns) && !announced.is_pending(now_ns + 2_000_000_000));
        assert!(!announced.is_pending(now_ns.saturating_sub(60_000_000_000)), "of before a restart");
        (1..=20).for_each(|id| turn.settle(Some(id), true).unwrap());
        let settled = right.record_of("left").unwrap();
        assert_eq!(settled.trajectory_ids, (13..=20).collect::<Vec<u64>>());
        assert!(settled.pending_until_ns == 0 && settled.sequence > announced.sequence);
        turn.announce(Duration::from_secs(1)).unwrap();
        turn.settle(Some(21), false).unwrap();
        assert!(
            right.record_of("left").unwrap().pending_until_ns > 0,
            "nobody knows whether it was accepted"
        );
        fs::write(runtime.join("neighbours/left.committed"), "7 x").unwrap();
        let refused = right.record_of("left").unwrap_err().to_string();
        assert!(refused.contains("left.committed") && refused.contains("remove"), "{refused}");
        fs::remove_dir_all(runtime).unwrap();
    }
}
