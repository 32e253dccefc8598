//! What is examined: a computer, and what the arm's settings want of it.
use super::tree::Tree;
use taustream_arm::Settings;
use taustream_drivers::link::Controller;

/// What the driver says of an interface.
pub(crate) type AskController = fn(&str) -> Controller;

/// A computer as seen through its files, and what is wanted of it. Everything that is no file comes as a value, so that
/// tests can doctor it.
pub(crate) struct Subject {
    /// /proc, /sys, /dev and /run.
    pub(crate) tree: Tree,
    /// The arm, when its settings are sound.
    pub(crate) settings: Option<Settings>,
    /// `SCHED_FIFO` priority that the cycle wants.
    pub(crate) priority: u8,
    /// The user that the runtime directory is to belong to.
    pub(crate) uid: u32,
    /// Where the runtime directory is expected, below the tree.
    pub(crate) runtime: String,
    /// Free bytes in /dev/shm.
    pub(crate) shm_free: Option<u64>,
    /// Asks the kernel about a CAN controller.
    pub(crate) controller: AskController,
}

impl Subject {
    /// The CPU that the cycle is bound to, if it is.
    pub(crate) fn cpu(&self) -> Option<usize> {
        self.settings.as_ref().and_then(|s| s.cycle.cpu)
    }

    /// The process whose rights count: a running streamer of this user, else this one, which asks for the user. Its directory
    /// in /proc, and who it is as text. Another user's streamer says nothing of what this user may.
    pub(crate) fn process(&self) -> (String, String) {
        let is_streamer = |name: &str| STREAMER.starts_with(name) && name.len() >= COMM_MAX;
        let streamers: Vec<u32> =
            self.processes().filter(|(_, name)| is_streamer(name)).map(|(pid, _)| pid).collect();
        if let Some(pid) = streamers.iter().find(|pid| self.owner(**pid) == Some(self.uid)) {
            return (format!("proc/{pid}"), format!("the running {STREAMER} (process {pid})"));
        }
        let others = streamers.first().map_or_else(String::new, |pid| {
            format!(" (the running {STREAMER}, process {pid}, is another user's)")
        });
        ("proc/self".to_owned(), format!("this user{others}"))
    }

    /// The user that a process acts as.
    fn owner(&self, pid: u32) -> Option<u32> {
        let status = self.tree.text(&format!("proc/{pid}/status"))?;
        let ids = status.lines().find_map(|line| line.strip_prefix("Uid:"))?;
        ids.split_whitespace().nth(1)?.parse().ok()
    }

    /// `SCHED_FIFO` or `SCHED_RR` priority of a process; 0 for an ordinary one.
    pub(crate) fn realtime_priority(&self, pid: u32) -> Option<i64> {
        let stat = self.tree.text(&format!("proc/{pid}/stat"))?;
        // After the name in brackets, which may hold blanks, rt_priority is field 40 of the manual's count from 1.
        let (_, fields) = stat.rsplit_once(')')?;
        fields.split_whitespace().nth(40 - 3)?.parse().ok()
    }

    /// Number and name of every process. The kernel cuts names after 15 bytes.
    pub(crate) fn processes(&self) -> impl Iterator<Item = (u32, String)> {
        let pids = self.tree.names("proc").into_iter().filter_map(|name| name.parse::<u32>().ok());
        pids.filter_map(|pid| Some((pid, self.tree.text(&format!("proc/{pid}/comm"))?)))
    }
}

/// The process that owns the arm.
const STREAMER: &str = "taustream-streamer";
/// Bytes of a process's name that the kernel keeps.
pub(crate) const COMM_MAX: usize = 15;
