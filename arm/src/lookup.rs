//! Finds a shipped file by its name, so that `--robot ur5` works wherever the command is called.
use crate::{Fault, Faults, shipped};
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
    /// A demo file.
    Demo,
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
            Self::Demo => "",
        }
    }
    fn word(self) -> &'static str {
        match self {
            Self::Robot => "robot",
            Self::Scene => "scene",
            Self::Settings => "settings",
            Self::Path => "path",
            Self::Demo => "demo",
        }
    }
}

/// The directory of the machine's own files.
const MACHINE: &str = "/etc/taustream";
/// Where installed programs have their shared files when nothing tells another place.
const SHARE: &str = "/usr/share/taustream";

/// The order of search, for help texts.
pub const ORDER: &str = "\
A name is looked for in $TAUSTREAM_CONFIG_DIR, then /etc/taustream, then share/taustream of the installation (beside the
program's bin folder, else /usr/share/taustream), then among the files that the program carries. The working directory is
not searched: a file there is given by its path (./ur5.toml).";

/// The file of a path, or of a name: `NAME.toml` in the folder of its kind, in the order of [`ORDER`]. A name is a word
/// without slash and ending; anything else is a path.
///
/// # Errors
/// One fault that names every place that was looked at.
pub fn find(kind: Kind, name_or_path: &str) -> Result<PathBuf, Faults> {
    let own = std::env::var_os("TAUSTREAM_CONFIG_DIR").filter(|directory| !directory.is_empty());
    let mut directories: Vec<PathBuf> = own.map(PathBuf::from).into_iter().collect();
    directories.push(PathBuf::from(MACHINE));
    let beside = std::env::current_exe().ok().and_then(|program| share_of(&program));
    directories.extend(beside.filter(|share| share != Path::new(SHARE)));
    directories.push(PathBuf::from(SHARE));
    find_in(&directories, kind, name_or_path)
}

/// `PREFIX/share/taustream` of a program `PREFIX/bin/NAME`.
fn share_of(program: &Path) -> Option<PathBuf> {
    let folder = program.parent()?;
    (folder.file_name()? == "bin").then(|| folder.with_file_name("share/taustream"))
}

fn find_in(directories: &[PathBuf], kind: Kind, name_or_path: &str) -> Result<PathBuf, Faults> {
    let path = Path::new(name_or_path);
    let word = kind.word();
    // A name with a slash or an ending is meant as a path: looking for it elsewhere would only confuse.
    let is_name = !name_or_path.is_empty() && !name_or_path.contains('/') && path.extension().is_none();
    if !is_name && shipped::is_file(path) {
        return Ok(path.to_owned());
    }
    let places = if is_name { directories } else { &[] };
    let mut looked = Vec::new();
    let name = Path::new(kind.folder()).join(format!("{name_or_path}.toml"));
    for directory in places {
        let file = directory.join(&name);
        if file.is_file() {
            return Ok(file);
        }
        looked.push(file.display().to_string());
    }
    if let Some(carried) = shipped::path(&name).filter(|_| is_name) {
        return Ok(carried);
    }
    let expected = if looked.is_empty() {
        format!("the path of a {word} file, or the name of a shipped one")
    } else {
        format!(
            "the path of a {word} file with its ending or a slash, or a name found at one of {}, or among those that the program carries",
            looked.join(", ")
        )
    };
    Err(Faults(vec![Fault::new(path, "", "no such file", &expected)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_is_found_in_its_folder_and_path_is_taken_as_it_is() {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
        let nowhere = PathBuf::from("/nonexistent");
        let found = find_in(&[nowhere.clone(), config.clone()], Kind::Robot, "ur5").unwrap();
        assert_eq!(
            found,
            config.join("robots/ur5.toml"),
            "a directory comes before what the program carries"
        );
        assert_eq!(find_in(&[], Kind::Scene, &found.display().to_string()).unwrap(), found);
        let carried = find_in(&[nowhere], Kind::Robot, "ur5").unwrap();
        assert_eq!(carried, Path::new("builtin:/robots/ur5.toml"));
        assert_eq!(find_in(&[], Kind::Robot, "builtin:/robots/ur5.toml").unwrap(), carried);
        assert!(find_in(&[], Kind::Demo, "demo").is_ok());
        assert_eq!(share_of(Path::new("/opt/ts/bin/taustream")), Some("/opt/ts/share/taustream".into()));
        assert_eq!(share_of(Path::new("/src/target/debug/taustream")), None);
    }

    #[test]
    fn unknown_name_is_refused_with_every_place_looked_at() {
        let places = ["/a", "/b"].map(PathBuf::from);
        let said = find_in(&places, Kind::Settings, "ur7").unwrap_err().to_string();
        assert!(said.contains("/a/settings/ur7.toml, /b/settings/ur7.toml"), "{said}");
        for path in ["x/ur7", "ur7.toml", ""] {
            let said = find_in(&places, Kind::Settings, path).unwrap_err().to_string();
            assert!(said.contains("no such file") && !said.contains("/a/"), "{said}");
        }
    }
}
