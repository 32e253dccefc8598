//! The directory where the processes of one user meet: sockets of local links, files of shared memory.
//!
//! Every process of an arm has to choose the same one, so the rule stands here only.
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

/// The runtime directory cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("runtime directory {}: {why}", path.display())]
pub struct RuntimeError {
    /// The directory.
    pub path: PathBuf,
    /// What is wrong with it, and what to do.
    pub why: String,
}

/// The system's runtime directory, which the installed services share.
const SYSTEM: &str = "/run/taustream";

/// The user of the installed services: whose `/run/taustream` is, unless it is root's own.
#[must_use]
pub fn user_of_services() -> Option<u32> {
    let metadata = fs::symlink_metadata(SYSTEM).ok()?;
    (metadata.is_dir() && metadata.uid() != 0).then(|| metadata.uid())
}

/// The runtime directory, made (mode 0700) when it is missing and refused when it belongs to another user:
/// `$TAUSTREAM_RUNTIME_DIR`, else `/run/taustream` (its owner, or root where it has no owner yet), else `/run/user/UID/taustream`,
/// else `/tmp/taustream-UID`.
///
/// # Errors
/// When it cannot be made or is not this user's.
pub fn directory() -> Result<PathBuf, RuntimeError> {
    let uid = rustix::process::geteuid().as_raw();
    let requested = std::env::var_os("TAUSTREAM_RUNTIME_DIR");
    prepare(choose(requested, uid, Path::new("/run")), uid)
}

/// Where [`directory`] would be for a user, below `run` (`/run`); nothing is made or refused.
#[must_use]
pub fn expected(uid: u32, run: &Path) -> PathBuf {
    choose(std::env::var_os("TAUSTREAM_RUNTIME_DIR"), uid, run)
}

/// Chooses below `run` (`/run`); nothing is made.
fn choose(requested: Option<OsString>, uid: u32, run: &Path) -> PathBuf {
    if let Some(path) = requested.filter(|path| !path.is_empty()) {
        return PathBuf::from(path);
    }
    let system = run.join("taustream");
    // Root may own services of its own beside those of their user.
    let owned = fs::symlink_metadata(&system).map_or(uid == 0, |metadata| metadata.uid() == uid);
    let user = run.join(format!("user/{uid}"));
    if owned {
        system
    } else if user.is_dir() {
        user.join("taustream")
    } else {
        PathBuf::from(format!("/tmp/taustream-{uid}"))
    }
}

fn prepare(path: PathBuf, uid: u32) -> Result<PathBuf, RuntimeError> {
    if let Err(e) = fs::DirBuilder::new().recursive(true).mode(0o700).create(&path) {
        let why = format!("cannot be made: {e}; set TAUSTREAM_RUNTIME_DIR to a directory of your own");
        return Err(RuntimeError { path, why });
    }
    // Not through a link: in /tmp anybody can lay one.
    match fs::symlink_metadata(&path) {
        Ok(metadata) if metadata.is_dir() && metadata.uid() == uid => Ok(path),
        Ok(metadata) if metadata.is_dir() => {
            let owner = metadata.uid();
            let whose = if owner == 0 { " (root)" } else { "" };
            let why = format!(
                "belongs to uid {owner}{whose}, and this is uid {uid}: services there are that user's; act as that user, or set \
                 TAUSTREAM_RUNTIME_DIR to a directory of your own"
            );
            Err(RuntimeError { path, why })
        }
        Ok(metadata) => {
            let owner = metadata.uid();
            let why = format!(
                "is no directory (it is of uid {owner}); delete it if it is yours, or set TAUSTREAM_RUNTIME_DIR to a directory"
            );
            Err(RuntimeError { path, why })
        }
        Err(e) => Err(RuntimeError { path, why: e.to_string() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A directory of its own, gone after the test.
    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("taustream-runtime-{name}-{}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Self(path)
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _left_behind = fs::remove_dir_all(&self.0);
        }
    }

    fn own_uid() -> u32 {
        rustix::process::geteuid().as_raw()
    }

    #[test]
    fn runtime_directory_is_the_asked_then_the_systems_then_the_users_then_a_temporary_one() {
        let scratch = Scratch::new("choose");
        let run = scratch.0.as_path();
        // No user has this uid, and what the test makes does not belong to it.
        let stranger = own_uid() + 4_242;
        assert_eq!(choose(Some("/x/y".into()), stranger, run), Path::new("/x/y"));
        let temporary = PathBuf::from(format!("/tmp/taustream-{stranger}"));
        assert_eq!(choose(None, stranger, run), temporary);
        assert_eq!(choose(Some(OsString::new()), stranger, run), temporary, "empty is not asked");
        fs::create_dir_all(run.join(format!("user/{stranger}"))).unwrap();
        assert_eq!(choose(None, stranger, run), run.join(format!("user/{stranger}/taustream")));
        assert_eq!(choose(None, 0, run), run.join("taustream"));
        fs::create_dir(run.join("taustream")).unwrap();
        assert_eq!(choose(None, own_uid(), run), run.join("taustream"), "its owner uses it");
        assert_ne!(choose(None, stranger, run), run.join("taustream"), "others do not");
        assert_eq!(choose(None, 0, run) == run.join("taustream"), own_uid() == 0, "not even root");
    }

    #[test]
    fn runtime_directory_is_made_for_its_user_alone() {
        let scratch = Scratch::new("make");
        let made = prepare(scratch.0.join("a/b"), own_uid()).unwrap();
        assert_eq!(fs::metadata(&made).unwrap().mode() & 0o777, 0o700);
        assert_eq!(prepare(made.clone(), own_uid()), Ok(made));
    }

    #[test]
    fn runtime_directory_of_another_user_or_behind_a_link_is_refused_with_the_remedy() {
        let scratch = Scratch::new("refuse");
        let link = scratch.0.join("link");
        std::os::unix::fs::symlink(&scratch.0, &link).unwrap();
        let file = scratch.0.join("file");
        fs::write(&file, "").unwrap();
        let refused = [
            prepare(scratch.0.clone(), own_uid() + 1),
            prepare(link, own_uid()),
            prepare(file.clone(), own_uid()),
            prepare(file.join("below"), own_uid()),
        ];
        for outcome in refused {
            let sentence = outcome.unwrap_err().to_string();
            assert!(sentence.contains("TAUSTREAM_RUNTIME_DIR"), "{sentence}");
        }
    }
}
