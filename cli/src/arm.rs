//! Which arm a command talks to, and which files it reads.
use crate::failure::Failure;
use crate::output::note;
use std::path::{Path, PathBuf};
use std::{env, fs};
use taustream_arm::{Kind, PathFile, Robot, Scene, Settings, TrajectoryFile, shipped};
use taustream_messages::Report;
use taustream_messages::service::is_arm_name;
use taustream_motion::JointKind;
use taustream_streamer::names::{AxisName, BusName, Names, ServoName};

/// Where a controller keeps the settings of its one arm.
const INSTALLED: &str = "/etc/taustream/settings.toml";
/// Where it keeps those of several.
const INSTALLED_DIRECTORY: &str = "/etc/taustream/settings";
/// The shipped settings that serve when nothing else is named.
const SHIPPED: &str = "vcan6";

/// Name of an arm and of its joints: all that commands and status need.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ArmName {
    /// Names its services.
    pub(crate) name: String,
    /// Names of the joints, base to tip; empty when the robot file could not be read.
    pub(crate) joints: Vec<String>,
    /// Which joints slide; those beyond the list turn.
    pub(crate) kinds: Vec<JointKind>,
    /// The axes beside the path; empty when the settings could not be read.
    pub(crate) axes: Vec<AxisName>,
    /// Names of the buses; empty when the settings could not be read.
    pub(crate) buses: Vec<BusName>,
    /// The servos, base to tip; empty when the settings could not be read.
    pub(crate) servos: Vec<ServoName>,
    /// Links that move and have no shape, as the robot file acknowledges.
    pub(crate) unmodelled_links: Vec<String>,
}

impl ArmName {
    /// A joint as text, by its zero-based index.
    pub(crate) fn joint(&self, joint: usize) -> String {
        self.names().joint(joint)
    }

    /// The names, for sentences about joints and buses.
    pub(crate) fn names(&self) -> Names {
        let Self { joints, kinds, axes, buses, servos, .. } = self.clone();
        Names { joints, kinds, axes, buses, servos, ..Names::default() }
    }

    /// The names where the buses are those of this report: local links have no cable to look at.
    pub(crate) fn names_in(&self, report: &Report) -> Names {
        self.names().with_local(report.buses().iter().map(|bus| bus.local != 0))
    }

    /// The arm of settings that were read as a whole.
    pub(crate) fn of(settings: &Settings) -> Self {
        let Names { joints, kinds, axes, buses, servos, .. } = Names::of(settings);
        let unmodelled_links = settings.robot.unmodelled_links.clone();
        Self { name: settings.name.clone(), joints, kinds, axes, buses, servos, unmodelled_links }
    }

    /// The arm that settings name. A fault elsewhere in them must not keep anybody from stopping the arm: the name
    /// is all that counts then, and the fault is only mentioned.
    pub(crate) fn read(given: Option<&Path>) -> Result<Self, Failure> {
        let path = settings_path(given)?;
        match Settings::load_untried(&path) {
            Ok(settings) => Ok(Self::of(&settings)),
            Err(faults) => {
                let Some(name) = name_alone(&path) else { return Err(faults.into()) };
                note(format_args!(
                    "note: {} has faults (`taustream check` shows them); using only its name `{name}`",
                    path.display()
                ));
                Ok(Self { name, ..Self::default() })
            }
        }
    }
}

/// The `name` of a settings file whatever else stands in it.
fn name_alone(path: &Path) -> Option<String> {
    let table: toml::Table = shipped::read_text(path).ok()?.parse().ok()?;
    let name = table.get("name")?.as_str()?;
    is_arm_name(name).then(|| name.to_owned())
}

/// The settings file: as given, else by environment, else as installed, else as shipped.
pub(crate) fn settings_path(given: Option<&Path>) -> Result<PathBuf, Failure> {
    if let Some(given) = given {
        return find(Kind::Settings, given);
    }
    if let Some(named) = env::var_os("TAUSTREAM_SETTINGS").filter(|v| !v.is_empty()) {
        return find(Kind::Settings, Path::new(&named));
    }
    let installed = Path::new(INSTALLED);
    if installed.exists() {
        return Ok(installed.to_owned());
    }
    match only_file(Path::new(INSTALLED_DIRECTORY))? {
        Some(only) => Ok(only),
        None => find(Kind::Settings, Path::new(SHIPPED)),
    }
}

/// The only settings file of a directory; none if it has none.
fn only_file(directory: &Path) -> Result<Option<PathBuf>, Failure> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort_unstable();
    match files.as_slice() {
        [] | [_] => Ok(files.pop()),
        several => {
            let names: Vec<String> = several
                .iter()
                .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
                .collect();
            let list = names.join(", ");
            Err(Failure::Usage(format!("this machine has several arms; name one with --settings: {list}")))
        }
    }
}

/// The name of the arm that would be talked to, as far as its settings can be read; nothing is said about faults.
pub(crate) fn name_at_a_glance(given: Option<&Path>) -> Option<String> {
    name_alone(&settings_path(given).ok()?)
}

/// Settings as a whole, for commands that need robot and scene too.
pub(crate) fn settings(given: Option<&Path>) -> Result<Settings, Failure> {
    Ok(Settings::load(&settings_path(given)?)?)
}

/// The same for a command that leaves planning to the planner.
pub(crate) fn settings_to_talk(given: Option<&Path>) -> Result<Settings, Failure> {
    Ok(Settings::load_untried(&settings_path(given)?)?)
}

/// A robot by path or shipped name.
pub(crate) fn robot(given: &Path) -> Result<Robot, Failure> {
    Ok(Robot::load(&find(Kind::Robot, given)?)?)
}

/// A robot to plan for or to prove something of: each of its links that move has a shape, or is acknowledged to have none.
pub(crate) fn modelled_robot(given: &Path) -> Result<Robot, Failure> {
    let robot = robot(given)?;
    robot.require_modelled()?;
    Ok(robot)
}

/// A scene by path or shipped name.
pub(crate) fn scene(given: &Path) -> Result<Scene, Failure> {
    Ok(Scene::load(&find(Kind::Scene, given)?)?)
}

/// A path by path or shipped name.
pub(crate) fn path(given: &Path) -> Result<PathFile, Failure> {
    Ok(PathFile::load(&find(Kind::Path, given)?)?)
}

/// A demo file by path or shipped name.
pub(crate) fn demo(given: &Path) -> Result<PathBuf, Failure> {
    find(Kind::Demo, given)
}

/// The robot of a trajectory: as given, else the one that the file names.
pub(crate) fn robot_of(given: Option<&Path>, path: &Path, file: &TrajectoryFile) -> Result<Robot, Failure> {
    if let Some(given) = given {
        return robot(given);
    }
    // The file names a robot, never a path: what it could point to is not its choice.
    let is_name =
        |name: &str| !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "_-".contains(c));
    if !is_name(&file.robot) {
        let why = format!(
            "its robot {:?} is no name of a shipped robot; name the robot file with --robot",
            file.robot
        );
        return Err(Failure::unfit(path, why));
    }
    robot(Path::new(&file.robot)).map_err(|why| {
        Failure::unfit(
            path,
            format!("its robot {:?} is not found; name the robot file with --robot ({why})", file.robot),
        )
    })
}

/// A trajectory file and the robot that it is for: as given, else the one that the file names.
pub(crate) fn motion_of(given: Option<&Path>, path: &Path) -> Result<(Robot, TrajectoryFile), Failure> {
    let file = TrajectoryFile::load(path)?;
    let robot = robot_of(given, path, &file)?;
    fitting(path, &file, &robot)?;
    Ok((robot, file))
}

/// A trajectory file that fits a robot: same number of joints, and the same digest where the file has one.
pub(crate) fn trajectory_for(path: &Path, robot: &Robot) -> Result<TrajectoryFile, Failure> {
    let file = TrajectoryFile::load(path)?;
    fitting(path, &file, robot).map(|()| file)
}

/// As [`trajectory_for`], for a file whose text came with the command.
pub(crate) fn trajectory_from(path: &Path, text: &str, robot: &Robot) -> Result<TrajectoryFile, Failure> {
    let file = TrajectoryFile::from_json(path, text)?;
    fitting(path, &file, robot).map(|()| file)
}

/// Whether a trajectory file fits a robot.
pub(crate) fn fitting(path: &Path, file: &TrajectoryFile, robot: &Robot) -> Result<(), Failure> {
    let (got, joints) = (file.trajectory.joints(), robot.joints.len());
    if got != joints {
        return Err(Failure::unfit(
            path,
            format!(
                "made for {got} joints, but robot `{}` has {joints}; name the robot it was made for",
                robot.name
            ),
        ));
    }
    match &file.digest {
        Some(digest) if !digest.eq_ignore_ascii_case(&robot.digest_hex()) => Err(Failure::unfit(
            path,
            format!(
                "made for another description of robot `{}` (digest {}.., {} has {}..); plan again with this robot file",
                file.robot,
                digest.get(..12).unwrap_or(digest),
                robot.file.display(),
                robot.digest_hex().get(..12).unwrap_or_default()
            ),
        )),
        _ => Ok(()),
    }
}

fn find(kind: Kind, given: &Path) -> Result<PathBuf, Failure> {
    // Names of shipped files are text; a path that is none can only be opened as it stands.
    match given.to_str() {
        Some(text) => Ok(taustream_arm::find(kind, text)?),
        None => Ok(given.to_owned()),
    }
}

/// A file of whatever kind.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum AnyFile {
    /// Settings of an arm.
    Settings(PathBuf),
    /// A robot.
    Robot(PathBuf),
    /// A scene.
    Scene(PathBuf),
    /// A trajectory.
    Trajectory(PathBuf),
    /// Nothing stands in it, which could be meant for any kind.
    Empty(PathBuf),
}

/// Finds a file by path or shipped name, and tells its kind by what stands in it.
pub(crate) fn find_any(given: &Path) -> Result<AnyFile, Failure> {
    // A word without slash and ending is a name, whatever the working directory holds.
    let is_path = given.to_str().is_none_or(|text| text.contains('/')) || given.extension().is_some();
    if is_path && (given.exists() || shipped::is_file(given)) {
        return Ok(kind_of(given));
    }
    let robot = || find(Kind::Robot, given).map(AnyFile::Robot);
    let scene = || find(Kind::Scene, given).map(AnyFile::Scene);
    let settings = find(Kind::Settings, given).map(AnyFile::Settings);
    // When there is nothing at all, the first search says where it looked.
    settings.or_else(|nothing| robot().or_else(|_| scene()).map_err(|_| nothing))
}

/// Trajectories are JSON; settings name a robot, robots have joints, and everything else is a scene. A file that
/// cannot be parsed is read as settings, whose reader then says what is wrong with it.
fn kind_of(path: &Path) -> AnyFile {
    let owned = path.to_owned();
    if path.extension().is_some_and(|e| e == "json") {
        return AnyFile::Trajectory(owned);
    }
    // Named directly, it is refused by the reader that knows how a robot file names it.
    if path.extension().is_some_and(|e| e == "urdf" || e == "srdf" || e == "xacro") {
        return AnyFile::Robot(owned);
    }
    let table = shipped::read_text(path).ok().and_then(|text| text.parse::<toml::Table>().ok());
    match table {
        Some(t) if t.contains_key("joint") || t.contains_key("urdf") => AnyFile::Robot(owned),
        Some(t) if ["robot", "bus", "servo", "cycle"].iter().any(|k| t.contains_key(*k)) => {
            AnyFile::Settings(owned)
        }
        Some(t) if t.is_empty() => AnyFile::Empty(owned),
        Some(_) => AnyFile::Scene(owned),
        None => AnyFile::Settings(owned),
    }
}
