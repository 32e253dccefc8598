//! The files behind the services of one arm: which they are, whether they are still there, and how they are cleared away.
//!
//! Segments lie in `/dev/shm`, everything else below `iceoryx2/` in the runtime directory. iceoryx2 finds what a dead
//! process left behind by these files; when somebody deletes or spoils some of them, it cannot, and names stay taken for ever.
//! So every process that joins an arm holds a shared lock on a file of the arm, which the kernel drops when the process
//! dies. A service that starts and gets this lock alone knows that nobody uses the names, and clears them all.
use crate::service::{ServiceError, prefix};
use rustix::fs::OFlags;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

/// Where segments are, whatever the root path.
pub(crate) const SEGMENTS: &str = "/dev/shm";
/// Below the runtime directory.
pub(crate) const ROOT: &str = "iceoryx2";
/// End of the name of the segment in which iceoryx2 counts nodes. It stays when everybody has gone, so it says nothing
/// about who is there; and it is the only segment whose name is known beforehand.
pub(crate) const NODE_COUNTER: &str = ".global_mgmt";
/// What starts and claims the names.
const SERVICES: [&str; 2] = ["streamer", "planner"];
/// A service that starts holds the lock alone for as long as it takes to delete a few files.
const LOCK_WITHIN: Duration = Duration::from_secs(2);

/// The files of one arm of one user.
#[derive(Clone, Debug)]
pub struct ArmFiles {
    arm: String,
    uid: u32,
    runtime: PathBuf,
    prefix: String,
}

impl ArmFiles {
    /// The files of `arm` below `runtime`, of the user who asks.
    #[must_use]
    pub fn of(arm: &str, runtime: &Path) -> Self {
        let uid = rustix::process::geteuid().as_raw();
        Self { arm: arm.to_owned(), uid, runtime: runtime.to_owned(), prefix: prefix(arm, uid) }
    }

    /// The runtime directory.
    #[must_use]
    pub fn runtime(&self) -> &Path {
        &self.runtime
    }

    /// The segments of the arm that exist.
    #[must_use]
    pub fn segments(&self) -> Vec<PathBuf> {
        self.in_directory(Path::new(SEGMENTS))
    }

    fn in_directory(&self, directory: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(directory).into_iter().flatten().flatten();
        let ours = |name: &std::ffi::OsStr| name.as_encoded_bytes().starts_with(self.prefix.as_bytes());
        entries.filter(|entry| ours(&entry.file_name())).map(|entry| entry.path()).collect()
    }

    /// Deletes every name of the arm, and nothing of another arm, when nobody is about to open services. What is mapped stays usable
    /// for whoever has it mapped. A file that cannot be deleted stays; whoever opens it says so.
    pub fn clear(&self) {
        // Whoever holds it for longer hangs: then the names go all the same.
        let _nobody_opens = self.lock_file(&self.opening_path()).and_then(|file| {
            self.lock_within(&file, File::try_lock)?;
            Ok(file)
        });
        self.delete_names();
    }

    fn delete_names(&self) {
        let root = self.runtime.join(ROOT);
        let nodes = root.join("nodes");
        let mut found = self.segments();
        found.extend(self.in_directory(&root.join("services")));
        found.extend(self.in_directory(&nodes));
        let directories = fs::read_dir(&nodes).into_iter().flatten().flatten().map(|entry| entry.path());
        // The directory of a node bears the node's number only; what is in it bears the arm's name.
        let directories: Vec<PathBuf> = directories.filter(|path| path.is_dir()).collect();
        found.extend(directories.iter().flat_map(|node| self.in_directory(node)));
        // Sockets of events.
        found.extend(self.in_directory(&root));
        for path in found {
            let _gone_or_not_ours =
                if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        }
        for directory in directories {
            // Only an empty one goes.
            let _another_arms = fs::remove_dir(&directory);
        }
    }

    /// Refuses names that another user took before us, or that are no regular files: opening them could wait for ever.
    pub(crate) fn check_owner(&self) -> Result<(), ServiceError> {
        let counters = self
            .segments()
            .into_iter()
            .filter(|path| path.as_os_str().as_encoded_bytes().ends_with(NODE_COUNTER.as_bytes()));
        for path in counters {
            let Ok(facts) = fs::symlink_metadata(&path) else { continue };
            if facts.uid() != self.uid {
                let (arm, owner, uid) = (self.arm.clone(), facts.uid(), self.uid);
                return Err(ServiceError::Foreign { arm, path, owner, uid });
            }
            if !facts.is_file() {
                let kind = if facts.file_type().is_fifo() { "a pipe" } else { "no regular file" };
                return Err(ServiceError::Blocked { arm: self.arm.clone(), path, kind });
            }
        }
        Ok(())
    }

    fn lock_path(&self) -> PathBuf {
        self.runtime.join(format!("{}.users.lock", self.arm))
    }

    fn opening_path(&self) -> PathBuf {
        self.runtime.join(format!("{}.opening.lock", self.arm))
    }

    /// For a service that opens its ports: nobody clears names away until this is dropped. Names that went while some ports were open
    /// and others not would leave a service that nobody finds and that misses nothing.
    ///
    /// # Errors
    /// When the lock cannot be had.
    pub fn opening(&self) -> Result<Opening, ServiceError> {
        let file = self.lock_file(&self.opening_path())?;
        self.lock_within(&file, File::try_lock_shared)?;
        Ok(Opening { _lock: file })
    }

    fn lock_file(&self, path: &Path) -> Result<File, ServiceError> {
        // Neither a link nor a pipe in its place leads anywhere, or waits.
        let flags = OFlags::NOFOLLOW.union(OFlags::NONBLOCK).bits();
        let flags = i32::try_from(flags).unwrap_or(0);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600).custom_flags(flags);
        options.open(path).map_err(|e| self.lock_refused(path, &e))
    }

    fn lock_refused(&self, path: &Path, error: &io::Error) -> ServiceError {
        let why = format!("{}: {error}; remove that file", path.display());
        ServiceError::Refused { arm: self.arm.clone(), what: "lock", why }
    }

    /// Joins the users of the names.
    pub(crate) fn lock_shared(&self) -> Result<UsersLock, ServiceError> {
        let file = self.lock_file(&self.lock_path())?;
        self.lock_within(&file, File::try_lock_shared)?;
        Ok(UsersLock { file, files: self.clone() })
    }

    fn lock_within(
        &self,
        file: &File,
        lock: fn(&File) -> Result<(), TryLockError>,
    ) -> Result<(), ServiceError> {
        let since = Instant::now();
        loop {
            match lock(file) {
                Ok(()) => return Ok(()),
                Err(TryLockError::WouldBlock) if since.elapsed() < LOCK_WITHIN => {
                    thread::sleep(Duration::from_millis(5));
                }
                Err(TryLockError::WouldBlock) => {
                    let why = "another process of the arm has been starting for too long; end it".to_owned();
                    return Err(ServiceError::Refused { arm: self.arm.clone(), what: "join", why });
                }
                Err(TryLockError::Error(e)) => return Err(self.lock_refused(&self.runtime, &e)),
            }
        }
    }

    /// For a service that starts: clears the names when nobody uses them, or when an earlier start with these names did not
    /// come to its end; then joins their users. The names of others who live are left as they are otherwise.
    ///
    /// # Errors
    /// When the lock cannot be had.
    pub fn claim(&self, service: &'static str) -> Result<Claim, ServiceError> {
        let role = self.take_role(service)?;
        let file = self.lock_file(&self.lock_path())?;
        let starting = self.starting_path(service);
        if file.try_lock().is_ok() {
            self.delete_names();
            // Nothing is left of any start that did not come to its end.
            for service in SERVICES {
                let _none = fs::remove_file(self.starting_path(service));
            }
        } else if starting.symlink_metadata().is_ok() {
            self.clear();
        }
        drop(file);
        let lock = self.lock_shared()?;
        // A start that ends in the middle leaves this behind.
        let _without_it = File::create(&starting);
        Ok(Claim { lock, starting, _role: role })
    }

    fn starting_path(&self, service: &str) -> PathBuf {
        self.runtime.join(format!("{}.{service}.starting", self.arm))
    }

    /// The right to be the one service of its kind.
    fn take_role(&self, service: &'static str) -> Result<File, ServiceError> {
        let path = self.runtime.join(format!("{}.{service}.lock", self.arm));
        let mut file = self.lock_file(&path)?;
        match file.try_lock() {
            Ok(()) => {
                let _a_hint_only = file.set_len(0).and_then(|()| write!(file, "{}", std::process::id()));
                Ok(file)
            }
            Err(TryLockError::WouldBlock) => {
                let mut pid = String::new();
                // What another process wrote is a hint for a message, so a bounded piece of it is enough.
                let _a_hint_only = file.take(16).read_to_string(&mut pid);
                let pid = pid.trim().parse().ok();
                Err(ServiceError::Served { arm: self.arm.clone(), who: service, pid })
            }
            Err(TryLockError::Error(e)) => Err(self.lock_refused(&path, &e)),
        }
    }
}

/// Held while a service opens its ports: see [`ArmFiles::opening`].
#[derive(Debug)]
pub struct Opening {
    _lock: File,
}

/// A share in the names of an arm, held until dropped or dead. The last one who leaves clears them.
#[derive(Debug)]
pub(crate) struct UsersLock {
    file: File,
    files: ArmFiles,
}

impl Drop for UsersLock {
    fn drop(&mut self) {
        let last = self.file.unlock().is_ok() && self.file.try_lock().is_ok();
        if last {
            self.files.delete_names();
        }
    }
}

/// The share of a service.
#[derive(Debug)]
pub struct Claim {
    lock: UsersLock,
    starting: PathBuf,
    /// Its lock is the right to be the one service of its kind.
    _role: File,
}

impl Claim {
    /// The services are open and at work: the next start need not clear them away.
    pub fn started(&self) {
        let _already = fs::remove_file(&self.starting);
    }

    /// The files.
    #[must_use]
    pub fn files(&self) -> &ArmFiles {
        &self.lock.files
    }
}

/// What a process's services stand on: files that must neither vanish nor be replaced while it lives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Footprint(Vec<(PathBuf, u64, u64)>);

impl Footprint {
    /// The files of a node and of the services that it has open.
    pub(crate) fn of(files: &ArmFiles, node: &str) -> Self {
        let root = files.runtime.join(ROOT);
        let (nodes, services) = (root.join("nodes"), root.join("services"));
        let mut paths = files.in_directory(&nodes.join(node));
        paths.push(files.lock_path());
        let names: Vec<String> =
            paths.iter().filter_map(|path| Some(path.file_name()?.to_str()?.to_owned())).collect();
        let of_node = format!("{}{node}.", files.prefix);
        let with_prefix = |path: &PathBuf, start: &str| {
            path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(start.as_bytes()))
        };
        paths.extend(files.in_directory(&nodes).into_iter().filter(|path| with_prefix(path, &of_node)));
        for hash in names.iter().filter_map(|name| name.strip_suffix(".service_tag")) {
            paths.push(services.join(format!("{hash}.service")));
        }
        let ports: Vec<String> = names
            .iter()
            .filter_map(|name| name.strip_suffix(".port_tag")?.strip_prefix(&files.prefix))
            .map(|port| format!("_{port}.data"))
            .collect();
        let mapped = fs::read_to_string("/proc/self/maps").unwrap_or_default();
        paths.extend(files.segments().into_iter().filter(|path| {
            let Some(name) = path.to_str() else { return false };
            let own_data = ports.iter().any(|port| name.ends_with(port));
            own_data || name.ends_with(NODE_COUNTER) || (name.ends_with(".dynamic") && mapped.contains(name))
        }));
        let identified = paths.into_iter().filter_map(|path| {
            let facts = fs::symlink_metadata(&path).ok()?;
            Some((path, facts.dev(), facts.ino()))
        });
        Self(identified.collect())
    }

    /// A file that is not there any more, or is another one.
    #[must_use]
    pub fn missing(&self) -> Option<&Path> {
        let is_there = |(path, dev, ino): &&(PathBuf, u64, u64)| {
            fs::symlink_metadata(path).is_ok_and(|facts| (facts.dev(), facts.ino()) == (*dev, *ino))
        };
        self.0.iter().find(|file| !is_there(file)).map(|(path, ..)| path.as_path())
    }

    /// How many files these are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// No file at all: nothing is known to be missing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
