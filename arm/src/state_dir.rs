//! The few operations on files that a durable record needs, behind traits so that tests can let each of them fail and cut
//! the power between any two.
//!
//! A file is replaced as a whole: written beside, synced, renamed, and the directory synced. Names are single components
//! below an open directory, and no link is followed: neither the directory nor a file in it may be a symbolic link.
use rustix::fs::{AtFlags, FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use std::fs::{DirBuilder, File};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::Path;
use std::time::{Duration, Instant};

/// Largest file that is read.
const BYTES_MAX: u64 = 256 * 1024;
/// Longest wait for a lock that another process holds.
const LOCK_MAX: Duration = Duration::from_secs(1);
const LOCK_POLL: Duration = Duration::from_millis(5);

/// What failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Step {
    /// The directory cannot be made or opened.
    Directory = 1,
    /// The directory is a symbolic link, or no directory.
    Link,
    /// The directory or file belongs to another user.
    Owner,
    /// Others may write to the directory or file.
    Mode,
    /// Another process holds the lock.
    Lock,
    /// Reading.
    Read,
    /// It is no regular file.
    NotFile,
    /// The user has no home directory in /etc/passwd.
    Home,
    /// Random numbers.
    Random,
    /// Making the new file.
    Create,
    /// Writing the new file.
    Write,
    /// Syncing the new file.
    Sync,
    /// Putting the new file in the old one's place.
    Rename,
    /// Syncing the directory.
    SyncDirectory,
}

impl Step {
    const ALL: [Self; 14] = [
        Self::Directory,
        Self::Link,
        Self::Owner,
        Self::Mode,
        Self::Lock,
        Self::Read,
        Self::NotFile,
        Self::Home,
        Self::Random,
        Self::Create,
        Self::Write,
        Self::Sync,
        Self::Rename,
        Self::SyncDirectory,
    ];
}

/// Why a file was not read or written: small enough to be handed through an atomic number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiskFault {
    /// What failed.
    pub step: Step,
    /// The kernel's error number; 0 where the kernel has none.
    pub errno: u16,
}

impl DiskFault {
    /// A fault that the kernel reported.
    #[must_use]
    pub fn new(step: Step, error: &io::Error) -> Self {
        let errno = error.raw_os_error().and_then(|number| u16::try_from(number).ok()).unwrap_or(0);
        Self { step, errno }
    }
    fn plain(step: Step) -> Self {
        Self { step, errno: 0 }
    }
    /// A number from which [`DiskFault::from_code`] makes the fault again; never 0.
    #[must_use]
    pub fn code(self) -> u32 {
        u32::from(self.step as u8) << 16 | u32::from(self.errno)
    }
    /// The fault of a code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        let step = Step::ALL.into_iter().find(|step| u32::from(*step as u8) == code >> 16)?;
        let errno = u16::try_from(code & 0xFFFF).unwrap_or(0);
        Some(Self { step, errno })
    }
    /// What happened to `directory`, and what to do.
    #[must_use]
    pub fn sentence(self, directory: &str) -> String {
        let kernel = || match self.errno {
            0 => "refused".to_owned(),
            number => io::Error::from_raw_os_error(i32::from(number)).to_string(),
        };
        let doing = match self.step {
            Step::Directory => "cannot be made or opened",
            Step::Link => {
                return format!("{directory} is a symbolic link or no directory; name the directory itself");
            }
            Step::Owner => {
                return format!(
                    "{directory}, or a file in it, belongs to another user; give it to the streamer's user (chown), or \
                     name another with --state-dir"
                );
            }
            Step::Mode => {
                return format!("others may write to {directory} or a file in it; chmod -R go-w {directory}");
            }
            Step::NotFile => {
                return format!(
                    "{directory} holds something that is no regular file under the record's name; remove it"
                );
            }
            Step::Home => {
                return format!(
                    "{directory}: the streamer's user has no home directory in /etc/passwd; run the streamer as the \
                     services' user or as root"
                );
            }
            Step::Lock => "is locked by another process",
            Step::Read => "cannot be read",
            Step::Random => "needs a random number",
            Step::Create => "does not take a new file",
            Step::Write => "does not take the bytes",
            Step::Sync => "cannot be synced (file)",
            Step::Rename => "does not let a file be renamed",
            Step::SyncDirectory => "cannot be synced (directory)",
        };
        format!("{directory} {doing}: {}", kernel())
    }
}

/// Opens directories.
pub trait Disk: Send {
    /// Opens a directory; makes it, mode 0700, when it is missing and `make` says so.
    ///
    /// # Errors
    /// Why not; with `errno` of `ENOENT` when it is missing.
    fn open(&self, directory: &Path, make: bool) -> Result<Box<dyn Directory>, DiskFault>;
}

/// An open directory.
pub trait Directory {
    /// Takes an exclusive lock that lasts as long as the directory is open.
    ///
    /// # Errors
    /// When another process holds it for too long.
    fn lock(&mut self, name: &str) -> Result<(), DiskFault>;
    /// The bytes of a file; `None` when there is none.
    ///
    /// # Errors
    /// When it cannot be read or is not to be trusted.
    fn read(&mut self, name: &str) -> Result<Option<Vec<u8>>, DiskFault>;
    /// Makes a new file in place of any of this name.
    ///
    /// # Errors
    /// When the disk refuses.
    fn create(&mut self, name: &str) -> io::Result<()>;
    /// Writes to the file that was made last.
    ///
    /// # Errors
    /// When the disk refuses.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// Waits until the bytes of the file that was made last are on the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    fn sync(&mut self) -> io::Result<()>;
    /// Puts one file in another's place.
    ///
    /// # Errors
    /// When the disk refuses.
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()>;
    /// Waits until the names are on the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    fn sync_directory(&mut self) -> io::Result<()>;
}

/// Replaces a file as a whole or not at all, and returns when the new one is on the disk.
///
/// # Errors
/// The step that failed. Whether the old or the new file is there after a power cut is then not known.
pub fn replace(directory: &mut dyn Directory, name: &str, text: &str) -> Result<(), DiskFault> {
    let beside = format!("{name}.new");
    let at = |step| move |error: io::Error| DiskFault::new(step, &error);
    directory.create(&beside).map_err(at(Step::Create))?;
    directory.write(text.as_bytes()).map_err(at(Step::Write))?;
    directory.sync().map_err(at(Step::Sync))?;
    directory.rename(&beside, name).map_err(at(Step::Rename))?;
    directory.sync_directory().map_err(at(Step::SyncDirectory))
}

/// The computer's own disk.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemDisk {
    /// A second owner whose directories and files are trusted; what root makes there is given to it.
    pub services_user: Option<u32>,
}

impl Disk for SystemDisk {
    fn open(&self, directory: &Path, make: bool) -> Result<Box<dyn Directory>, DiskFault> {
        if make {
            let made = DirBuilder::new().recursive(true).mode(0o700).create(directory);
            made.map_err(|e| DiskFault::new(Step::Directory, &e))?;
        }
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let opened = rustix::fs::open(directory, flags, Mode::empty());
        let handle = opened.map(File::from).map_err(|errno| match errno {
            Errno::LOOP | Errno::NOTDIR => DiskFault::plain(Step::Link),
            _ => DiskFault::new(Step::Directory, &errno.into()),
        })?;
        let info = handle.metadata().map_err(|e| DiskFault::new(Step::Directory, &e))?;
        let me = rustix::process::geteuid().as_raw();
        let trusted = |uid: u32| uid == me || self.services_user == Some(uid);
        check(&info, trusted)?;
        let give_to = (info.uid() != me).then_some(info.uid());
        let owners = [Some(me), self.services_user];
        Ok(Box::new(SystemDirectory { handle, owners, give_to, locked: None, newest: None }))
    }
}

/// Refuses what others own or may write to.
fn check(info: &std::fs::Metadata, trusted: impl Fn(u32) -> bool) -> Result<(), DiskFault> {
    if !trusted(info.uid()) {
        Err(DiskFault::plain(Step::Owner))
    } else if info.mode() & 0o022 != 0 {
        Err(DiskFault::plain(Step::Mode))
    } else {
        Ok(())
    }
}

struct SystemDirectory {
    handle: File,
    owners: [Option<u32>; 2],
    give_to: Option<u32>,
    locked: Option<File>,
    newest: Option<File>,
}

impl SystemDirectory {
    fn make(&self, name: &str, flags: OFlags) -> io::Result<File> {
        let flags = flags | OFlags::CREATE | OFlags::NOFOLLOW | OFlags::CLOEXEC | OFlags::NONBLOCK;
        let file = File::from(rustix::fs::openat(&self.handle, name, flags, Mode::from_raw_mode(0o600))?);
        if let Some(uid) = self.give_to {
            std::os::unix::fs::fchown(&file, Some(uid), None)?;
        }
        Ok(file)
    }

    fn newest(&mut self) -> io::Result<&mut File> {
        self.newest.as_mut().ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))
    }
}

impl Directory for SystemDirectory {
    fn lock(&mut self, name: &str) -> Result<(), DiskFault> {
        let file = self.make(name, OFlags::RDWR).map_err(|e| DiskFault::new(Step::Lock, &e))?;
        let begun = Instant::now();
        loop {
            match rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => break,
                Err(Errno::WOULDBLOCK) if begun.elapsed() < LOCK_MAX => std::thread::sleep(LOCK_POLL),
                Err(errno) => return Err(DiskFault::new(Step::Lock, &errno.into())),
            }
        }
        self.locked = Some(file);
        Ok(())
    }

    fn read(&mut self, name: &str) -> Result<Option<Vec<u8>>, DiskFault> {
        let at = |error: &io::Error| DiskFault::new(Step::Read, error);
        // A pipe would keep the reader waiting.
        let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = match rustix::fs::openat(&self.handle, name, flags, Mode::empty()) {
            Ok(file) => File::from(file),
            Err(Errno::NOENT) => return Ok(None),
            Err(errno) => return Err(at(&errno.into())),
        };
        let info = file.metadata().map_err(|e| at(&e))?;
        if !info.is_file() {
            return Err(DiskFault::plain(Step::NotFile));
        }
        check(&info, |uid| self.owners.contains(&Some(uid)))?;
        let mut bytes = Vec::new();
        file.take(BYTES_MAX).read_to_end(&mut bytes).map_err(|e| at(&e))?;
        Ok(Some(bytes))
    }

    fn create(&mut self, name: &str) -> io::Result<()> {
        match rustix::fs::unlinkat(&self.handle, name, AtFlags::empty()) {
            Ok(()) | Err(Errno::NOENT) => {}
            Err(errno) => return Err(errno.into()),
        }
        self.newest = Some(self.make(name, OFlags::WRONLY | OFlags::EXCL)?);
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.newest()?.write_all(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.newest()?.sync_all()
    }

    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        Ok(rustix::fs::renameat(&self.handle, from, &self.handle, to)?)
    }

    fn sync_directory(&mut self) -> io::Result<()> {
        self.handle.sync_all()
    }
}
