//! A disk whose every operation may fail, and that loses at a power cut what was not synced.
#![expect(clippy::disallowed_types, reason = "one thread; nothing here is real-time")]
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use taustream_arm::state_dir::{Directory, Disk, DiskFault, Step};

pub const ENOSPC: i32 = 28;
pub const EIO: i32 = 5;
pub const EROFS: i32 = 30;

/// What goes wrong, counted in operations from the start of a life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plan {
    Well,
    /// One operation fails.
    Once(u64, i32),
    /// From this one on every change fails.
    From(u64, i32),
    /// The power is cut before this one has returned.
    Cut(u64),
    /// This one never returns, nor any after it.
    Hangs(u64),
}

#[derive(Clone, Debug, Default)]
struct Inode {
    bytes: Vec<u8>,
    synced: Option<Vec<u8>>,
}

#[derive(Clone, Debug)]
enum Change {
    Link(String, usize),
    Unlink(String),
}

fn apply(names: &mut BTreeMap<String, usize>, change: &Change) {
    match change {
        Change::Link(name, inode) => drop(names.insert(name.clone(), *inode)),
        Change::Unlink(name) => drop(names.remove(name)),
    }
}

#[derive(Clone, Debug, Default)]
struct Folder {
    names: BTreeMap<String, usize>,
    durable: BTreeMap<String, usize>,
    pending: Vec<Change>,
}

#[derive(Debug)]
struct State {
    inodes: Vec<Inode>,
    folders: BTreeMap<PathBuf, Folder>,
    operations: u64,
    plan: Plan,
    dead: bool,
}

#[derive(Clone, Debug)]
pub struct FakeDisk(Arc<Mutex<State>>);

impl FakeDisk {
    pub fn new() -> Self {
        let state = State {
            inodes: Vec::new(),
            folders: BTreeMap::new(),
            operations: 0,
            plan: Plan::Well,
            dead: false,
        };
        Self(Arc::new(Mutex::new(state)))
    }

    /// Begins a life of the computer.
    pub fn begin(&self, plan: Plan) {
        let mut state = self.0.lock().unwrap();
        (state.operations, state.plan, state.dead) = (0, plan, false);
    }

    /// Changes what goes wrong from the next operation on.
    pub fn change_plan(&self, plan: Plan) {
        self.begin(plan);
    }

    /// The power was cut, by plan.
    pub fn is_dead(&self) -> bool {
        self.0.lock().unwrap().dead
    }

    /// What a power cut leaves: any part of what was not synced, decided by `pick` below a number.
    pub fn crash(&self, pick: &mut dyn FnMut(usize) -> usize) {
        let mut state = self.0.lock().unwrap();
        for inode in &mut state.inodes {
            if inode.synced.as_ref() != Some(&inode.bytes) {
                let length = inode.bytes.len();
                inode.bytes = match (pick(4), inode.synced.take()) {
                    (0, Some(synced)) => synced,
                    (1, _) => inode.bytes.clone(),
                    (2, _) => inode.bytes[..pick(length + 1)].to_vec(),
                    _ => vec![0; length],
                };
                inode.synced = Some(inode.bytes.clone());
            }
        }
        for folder in state.folders.values_mut() {
            let mut names = folder.durable.clone();
            for change in &folder.pending {
                if pick(2) == 0 {
                    apply(&mut names, change);
                }
            }
            (folder.names, folder.durable, folder.pending) = (names.clone(), names, Vec::new());
        }
    }
}

impl State {
    /// One operation: fails, kills the power, or goes on.
    fn step(&mut self, changes: bool) -> io::Result<()> {
        let now = self.operations;
        self.operations += 1;
        while matches!(self.plan, Plan::Hangs(at) if now >= at) {
            std::thread::park();
        }
        self.dead |= matches!(self.plan, Plan::Cut(at) if now >= at);
        let errno = match self.plan {
            _ if self.dead => Some(EIO),
            Plan::Once(at, errno) => (now == at).then_some(errno),
            Plan::From(at, errno) => (now >= at && changes).then_some(errno),
            Plan::Well | Plan::Cut(_) | Plan::Hangs(_) => None,
        };
        errno.map_or(Ok(()), |errno| Err(io::Error::from_raw_os_error(errno)))
    }
}

struct Opened {
    disk: FakeDisk,
    path: PathBuf,
    newest: Option<usize>,
}

impl Opened {
    fn with<T>(
        &mut self,
        changes: bool,
        does: impl FnOnce(&mut Vec<Inode>, &mut Folder, &mut Option<usize>) -> T,
    ) -> io::Result<T> {
        let mut state = self.disk.0.lock().unwrap();
        let result = state.step(changes);
        // A power cut falls before or after what the operation does.
        let cut_after = state.dead && state.operations.is_multiple_of(2);
        match result {
            Err(error) if !cut_after => Err(error),
            result => {
                let State { inodes, folders, .. } = &mut *state;
                let done = does(inodes, folders.get_mut(&self.path).unwrap(), &mut self.newest);
                result.map(|()| done)
            }
        }
    }
}

impl Disk for FakeDisk {
    fn open(&self, directory: &Path, make: bool) -> Result<Box<dyn Directory>, DiskFault> {
        let mut state = self.0.lock().unwrap();
        let missing = !state.folders.contains_key(directory);
        state.step(make && missing).map_err(|e| DiskFault::new(Step::Directory, &e))?;
        if missing && !make {
            return Err(DiskFault::new(Step::Directory, &io::Error::from_raw_os_error(2)));
        }
        state.folders.entry(directory.to_owned()).or_default();
        drop(state);
        Ok(Box::new(Opened { disk: self.clone(), path: directory.to_owned(), newest: None }))
    }
}

impl Directory for Opened {
    fn lock(&mut self, _name: &str) -> Result<(), DiskFault> {
        self.with(true, |_, _, _| ()).map_err(|e| DiskFault::new(Step::Lock, &e))
    }
    fn read(&mut self, name: &str) -> Result<Option<Vec<u8>>, DiskFault> {
        let read =
            self.with(false, |inodes, folder, _| folder.names.get(name).map(|i| inodes[*i].bytes.clone()));
        read.map_err(|e| DiskFault::new(Step::Read, &e))
    }
    fn create(&mut self, name: &str) -> io::Result<()> {
        self.with(true, |inodes, folder, newest| {
            inodes.push(Inode::default());
            *newest = Some(inodes.len() - 1);
            let change = Change::Link(name.to_owned(), inodes.len() - 1);
            apply(&mut folder.names, &change);
            folder.pending.push(change);
        })
    }
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.with(true, |inodes, _, newest| inodes[newest.unwrap()].bytes.extend_from_slice(bytes))
    }
    fn sync(&mut self) -> io::Result<()> {
        self.with(true, |inodes, _, newest| {
            let inode = &mut inodes[newest.unwrap()];
            inode.synced = Some(inode.bytes.clone());
        })
    }
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        self.with(true, |_, folder, _| {
            let inode = folder.names[from];
            for change in [Change::Link(to.to_owned(), inode), Change::Unlink(from.to_owned())] {
                apply(&mut folder.names, &change);
                folder.pending.push(change);
            }
        })
    }
    fn sync_directory(&mut self) -> io::Result<()> {
        self.with(true, |_, folder, _| {
            folder.durable = folder.names.clone();
            folder.pending.clear();
        })
    }
}
