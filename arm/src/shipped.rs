//! The shipped files, carried inside the program: robots, scenes, settings and paths that are there wherever it is called.
//!
//! They go by paths that no file system has: `builtin:/robots/ur5.toml`. What such a file names beside itself is found the
//! same way.
use crate::{Faults, document};
use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

mod list {
    include!(concat!(env!("OUT_DIR"), "/shipped_files.rs"));
}

/// Begins the path of every shipped file.
pub const ROOT: &str = "builtin:";

/// The path of a shipped file by its name below `config/`, if there is one.
#[must_use]
pub fn path(name: &Path) -> Option<PathBuf> {
    let path = Path::new(ROOT).join(name);
    bytes(&path).map(|_| path)
}

/// The bytes of a shipped file by its path; `None` for a path of the file system, or of no shipped file.
#[must_use]
pub fn bytes(path: &Path) -> Option<&'static [u8]> {
    let name = path.strip_prefix(ROOT).ok()?;
    let mut parts: Vec<Cow<'_, str>> = Vec::new();
    for component in name.components() {
        match component {
            Component::Normal(part) => parts.push(part.to_string_lossy()),
            Component::ParentDir => drop(parts.pop()?),
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    let name = parts.join("/");
    list::FILES.iter().find(|(known, _)| *known == name).map(|(_, bytes)| *bytes)
}

/// There is a file at the path: a shipped one, or a regular file.
#[must_use]
pub fn is_file(path: &Path) -> bool {
    bytes(path).is_some() || path.is_file()
}

/// The text of a file, shipped or not, whose contents somebody else checks. A byte order mark is dropped.
///
/// # Errors
/// When it cannot be read, is too long for a configuration, or is no UTF-8 text.
pub fn read_text(path: &Path) -> Result<String, Faults> {
    document::read_text(path, "a text file")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Robot, Scene, Settings};

    /// Every file of `config/` is carried, bit by bit, and no other.
    #[test]
    fn carried_files_are_those_of_the_source_tree() {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
        for (name, bytes) in list::FILES {
            assert_eq!(std::fs::read(config.join(name)).unwrap(), *bytes, "{name}");
        }
        for folder in ["robots", "scenes", "settings", "paths"] {
            for entry in std::fs::read_dir(config.join(folder)).unwrap() {
                let name = Path::new(folder).join(entry.unwrap().file_name());
                assert!(config.join(&name).is_dir() || path(&name).is_some(), "{}", name.display());
            }
        }
    }

    #[test]
    fn carried_files_are_read_with_all_that_they_name() {
        for (name, _) in list::FILES {
            let path = path(Path::new(name)).unwrap();
            match name.split_once('/') {
                Some(("settings", _)) => drop(Settings::load(&path).unwrap()),
                Some(("robots", file)) if file.ends_with(".toml") => drop(Robot::load(&path).unwrap()),
                Some(("scenes", file)) if file.ends_with(".toml") => drop(Scene::load(&path).unwrap()),
                _ => {}
            }
        }
    }

    #[test]
    fn paths_outside_of_the_carried_files_are_none() {
        for path in [
            "builtin:/../etc/passwd",
            "builtin:/robots/../../x",
            "builtin:",
            "builtin:/robots",
            "robots/ur5.toml",
            "/etc/passwd",
        ] {
            assert!(bytes(Path::new(path)).is_none(), "{path}");
        }
        assert!(bytes(Path::new("builtin:/settings/../robots/./ur5.toml")).is_some());
        assert!(Robot::load(Path::new("builtin:/robots/none.toml")).is_err());
    }
}
