//! Finds a shipped file by its name, so that `--robot ur5` works wherever the command is called.
use crate::{Fault, Faults};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// What kind of file is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A robot file.
    Robot,
    /// A scene file.
    Scene,
    /// A settings file.
    Settings,
    /// A path file.
    Path,
}

impl Kind {
    /// The folder below a configuration directory.
    #[must_use]
    pub fn folder(self) -> &'static str {
        match self {
            Self::Robot => "robots",
            Self::Scene => "scenes",
            Self::Settings => "settings",
            Self::Path => "paths",
        }
    }
    fn word(self) -> &'static str {
        match self {
            Self::Robot => "robot",
            Self::Scene => "scene",
            Self::Settings => "settings",
            Self::Path => "path",
        }
    }
}

/// Directories that are searched after `$TAUSTREAM_CONFIG_DIR`, in this order.
const DIRECTORIES: [&str; 3] = ["config", "/etc/taustream", "/usr/share/taustream"];

/// The file of a path, or of a name: a path is taken if it exists, otherwise `NAME.toml` is looked for in the folder
/// of its kind under `$TAUSTREAM_CONFIG_DIR`, `./config`, `/etc/taustream` and `/usr/share/taustream`.
///
/// # Errors
/// One fault that names every place that was looked at.
pub fn find(kind: Kind, name_or_path: &str) -> Result<PathBuf, Faults> {
    let own = std::env::var_os("TAUSTREAM_CONFIG_DIR");
    let own = own.as_deref().filter(|directory| !directory.is_empty());
    let directories: Vec<&Path> =
        own.into_iter().chain(DIRECTORIES.iter().map(OsStr::new)).map(Path::new).collect();
    find_in(&directories, kind, name_or_path)
}

fn find_in(directories: &[&Path], kind: Kind, name_or_path: &str) -> Result<PathBuf, Faults> {
    let path = Path::new(name_or_path);
    if path.is_file() {
        return Ok(path.to_owned());
    }
    let word = kind.word();
    // A name with a slash or an ending is meant as a path: looking for it elsewhere would only confuse.
    let is_name = !name_or_path.is_empty() && !name_or_path.contains('/') && path.extension().is_none();
    let places = if is_name { directories } else { &[] };
    let mut looked = Vec::new();
    for directory in places {
        let file = directory.join(kind.folder()).join(format!("{name_or_path}.toml"));
        if file.is_file() {
            return Ok(file);
        }
        looked.push(file.display().to_string());
    }
    let expected = if looked.is_empty() {
        format!("the path of a {word} file, or the name of a shipped one")
    } else {
        format!("the path of a {word} file, or a name found at one of {}", looked.join(", "))
    };
    Err(Faults(vec![Fault::new(path, "", "no such file", &expected)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_is_found_in_its_folder_and_path_is_taken_as_it_is() {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
        let nowhere = Path::new("/nonexistent");
        let found = find_in(&[nowhere, &config], Kind::Robot, "ur5").unwrap();
        assert_eq!(found, config.join("robots/ur5.toml"));
        assert_eq!(find_in(&[], Kind::Scene, &found.display().to_string()).unwrap(), found);
    }

    #[test]
    fn unknown_name_is_refused_with_every_place_looked_at() {
        let places = [Path::new("/a"), Path::new("/b")];
        let said = find_in(&places, Kind::Settings, "ur7").unwrap_err().to_string();
        assert!(said.contains("/a/settings/ur7.toml, /b/settings/ur7.toml"), "{said}");
        for path in ["x/ur7", "ur7.toml", ""] {
            let said = find_in(&places, Kind::Settings, path).unwrap_err().to_string();
            assert!(said.contains("no such file") && !said.contains("/a/"), "{said}");
        }
    }
}
