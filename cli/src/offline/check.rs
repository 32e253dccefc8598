//! `taustream check`: is a configuration sound, and what does it mean?
use super::axis_line::AxisLine;
use super::bus_table::BusTable;
use super::checked_robot::CheckedRobot;
use super::feed_forward_line::FeedForwardLine;
use super::neighbour_line::NeighbourLine;
use super::protocol_line::ProtocolLine;
use crate::args::CheckArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use taustream_arm::stopping::STOP_S_MAX;
use taustream_arm::text::counted;
use taustream_arm::{Faults, Reaction, Robot, Scene, Servo, Settings, TrajectoryFile};

/// Reads whatever kind of file it is, and prints what it says; every fault at once when it is not sound.
pub(crate) fn run(form: Form, args: &CheckArgs) -> Result<(), Failure> {
    let checked = arm::find_any(&args.config).and_then(|found| match found {
        arm::AnyFile::Settings(path) => check_settings(form, &path),
        arm::AnyFile::Robot(path) => check_robot(form, &path),
        arm::AnyFile::Scene(path) => form.print(&Verdict(CheckedScene::of(&Scene::load(&path)?))),
        arm::AnyFile::Empty(path) => {
            let why = "is empty, which says nothing about settings or a robot; a scene without obstacles says so by its margin: \
                       margin_m = 0.02";
            Err(Failure::Unfit { path, why: why.to_owned() })
        }
        arm::AnyFile::Trajectory(path) => {
            form.print(&Verdict(CheckedTrajectory::of(&path, &TrajectoryFile::load(&path)?)))
        }
    });
    match checked {
        Err(Failure::File(faults)) if form == Form::Text => {
            form.progress(&faults);
            let why = format!("REFUSED: {} fault(s), listed above", faults.0.len());
            Err(Failure::unfit(&args.config, why))
        }
        other => other,
    }
}

/// What was found, with the verdict as its last line.
struct Verdict<T>(T);

impl<T: Serialize> Serialize for Verdict<T> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<T: fmt::Display> fmt::Display for Verdict<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}\nno faults", self.0.to_string().trim_end())
    }
}

/// A robot that cannot stop in time is shown, and refused all the same. Settings may accept a longer stop.
fn check_robot(form: Form, path: &Path) -> Result<(), Failure> {
    let robot = Robot::load(path)?;
    let shown = CheckedRobot::of(&robot);
    let Err(faults) = robot.require_stops(STOP_S_MAX) else { return form.print(&Verdict(shown)) };
    Err(refused(form, path, &shown, faults))
}

/// Settings whose only fault is a bus that is too full are shown with its table and the remedies, and refused all the same.
fn check_settings(form: Form, path: &Path) -> Result<(), Failure> {
    let shown = CheckedSettings::of(&Settings::load_overloaded(path)?);
    let Err(faults) = Settings::load(path) else { return form.print(&Verdict(shown)) };
    Err(refused(form, path, &shown, faults))
}

/// Shows what is refused, after its faults.
fn refused(form: Form, path: &Path, shown: &(impl Serialize + fmt::Display), faults: Faults) -> Failure {
    if form == Form::Text {
        form.progress(&faults);
    }
    match form.print(shown) {
        Err(unwritten) => unwritten,
        Ok(()) if form == Form::Text => {
            Failure::unfit(path, format!("REFUSED: {} fault(s), listed first", faults.0.len()))
        }
        Ok(()) => faults.into(),
    }
}

/// A scene that is sound.
#[derive(Debug, Serialize)]
struct CheckedScene {
    kind: &'static str,
    file: String,
    margin_m: f64,
    obstacles: Vec<String>,
}

impl CheckedScene {
    fn of(scene: &Scene) -> Self {
        Self {
            kind: "scene",
            file: scene.file.display().to_string(),
            margin_m: scene.margin_m,
            obstacles: scene.obstacles.iter().map(|o| o.name.clone()).collect(),
        }
    }
}

impl fmt::Display for CheckedScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (count, names) = (self.obstacles.len(), self.obstacles.join(", "));
        write!(f, "scene {}: margin {} m, {count} obstacles", self.file, self.margin_m)?;
        if count > 0 { write!(f, ": {names}") } else { write!(f, " (an empty world)") }
    }
}

/// A trajectory file that is sound in itself.
#[derive(Debug, Serialize)]
struct CheckedTrajectory {
    kind: &'static str,
    file: String,
    robot: String,
    digest: Option<String>,
    joints: usize,
    strokes: usize,
    duration_s: f64,
}

impl CheckedTrajectory {
    fn of(path: &Path, file: &TrajectoryFile) -> Self {
        Self {
            kind: "trajectory",
            file: path.display().to_string(),
            robot: file.robot.clone(),
            digest: file.digest.clone(),
            joints: file.trajectory.joints(),
            strokes: file.trajectory.strokes().len(),
            duration_s: file.trajectory.duration_s(),
        }
    }
}

impl fmt::Display for CheckedTrajectory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, robot, joints, strokes, duration_s, .. } = self;
        write!(
            f,
            "trajectory {file}: robot {robot}, {}, {}, {duration_s:.3} s; ",
            counted(*joints, "joint"),
            counted(*strokes, "stroke")
        )?;
        match &self.digest {
            Some(digest) => write!(f, "digest {digest}; `taustream verify` checks limits and clearance"),
            None => write!(f, "no digest, so `run` will refuse it; `taustream plan` writes one"),
        }
    }
}

/// One servo's binding.
#[derive(Debug, Serialize)]
struct ServoLine {
    joint: String,
    bus: String,
    node_id: u8,
    protocol: String,
    sign: f64,
    #[serde(flatten)]
    own: ProtocolLine,
    zero_offset_rad: f64,
    limp_is_safe: bool,
    limp_risk_acknowledged: bool,
    /// What the drive does when setpoints stop coming.
    reaction: &'static str,
    /// What the feedback knows after power-up.
    feedback: &'static str,
    feedback_range_rad: [f64; 2],
}

/// Settings that are sound.
#[derive(Debug, Serialize)]
struct CheckedSettings {
    kind: &'static str,
    name: String,
    file: String,
    robot: CheckedRobot,
    scene: CheckedScene,
    period_us: u32,
    priority: u8,
    cpu: Option<usize>,
    first_speed_percent: f64,
    buses: Vec<BusTable>,
    servos: Vec<ServoLine>,
    axes: Vec<AxisLine>,
    feed_forward: Option<FeedForwardLine>,
    neighbours: Vec<NeighbourLine>,
}

impl CheckedSettings {
    fn of(settings: &Settings) -> Self {
        let line = |servo: &Servo| ServoLine {
            joint: settings.slot(servo.joint).map(|slot| slot.name.clone()).unwrap_or_default(),
            bus: settings.buses.get(servo.bus).map(|b| b.name.clone()).unwrap_or_default(),
            node_id: servo.node_id,
            protocol: servo.protocol.name().to_owned(),
            sign: servo.sign,
            own: ProtocolLine(servo.protocol.clone()),
            zero_offset_rad: servo.zero_offset_rad,
            limp_is_safe: servo.limp_is_safe,
            limp_risk_acknowledged: servo.limp_risk_acknowledged,
            reaction: servo.reaction.word(),
            feedback: servo.feedback.word(),
            feedback_range_rad: servo.feedback_range_rad,
        };
        let buses = settings.buses.iter().enumerate();
        Self {
            kind: "settings",
            name: settings.name.clone(),
            file: settings.file.display().to_string(),
            robot: CheckedRobot::of(&settings.robot),
            scene: CheckedScene::of(&settings.scene),
            period_us: settings.cycle.period_us,
            priority: settings.cycle.priority,
            cpu: settings.cycle.cpu,
            first_speed_percent: settings.supervision.first_speed_percent,
            buses: buses.filter_map(|(i, bus)| BusTable::of(settings, i, bus)).collect(),
            servos: settings.servos.iter().map(line).collect(),
            axes: AxisLine::all(settings),
            feed_forward: FeedForwardLine::of(settings),
            neighbours: NeighbourLine::all(settings),
        }
    }
}

impl fmt::Display for CheckedSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "settings {} ({})", self.name, self.file)?;
        writeln!(f, "{}", self.robot)?;
        writeln!(f, "{}", self.scene)?;
        let cpu = self.cpu.map_or_else(|| "not bound to a CPU".to_owned(), |cpu| format!("on CPU {cpu}"));
        writeln!(f, "cycle {} us at SCHED_FIFO priority {}, {cpu}", self.period_us, self.priority)?;
        for bus in &self.buses {
            writeln!(f, "{bus}")?;
        }
        writeln!(
            f,
            "  joint              bus        node  protocol  sign   zero (rad)  without torque  of the protocol"
        )?;
        for s in &self.servos {
            let limp = if s.limp_is_safe { "safe" } else { "MAY FALL" };
            writeln!(
                f,
                "  {:<18} {:<10} {:>4}  {:<8} {:>5} {:>12.6}  {limp:<14}  {}",
                s.joint, s.bus, s.node_id, s.protocol, s.sign, s.zero_offset_rad, s.own
            )?;
        }
        for axis in &self.axes {
            writeln!(f, "{axis}")?;
        }
        if let Some(feed_forward) = &self.feed_forward {
            writeln!(f, "{feed_forward}")?;
        }
        for neighbour in &self.neighbours {
            writeln!(f, "{neighbour}")?;
        }
        writeln!(f, "  when setpoints stop coming, because of a failure of streamer or bus:")?;
        for reaction in Reaction::ALL {
            let of = |s: &&ServoLine| s.reaction == reaction.word();
            let joints: Vec<&str> = self.servos.iter().filter(of).map(|s| s.joint.as_str()).collect();
            if !joints.is_empty() {
                writeln!(f, "    {}: {}: each {}", reaction.word(), joints.join(", "), reaction.sentence())?;
            }
        }
        let falls = |s: &&ServoLine| s.limp_risk_acknowledged;
        let falling: Vec<&str> = self.servos.iter().filter(falls).map(|s| s.joint.as_str()).collect();
        if !falling.is_empty() {
            writeln!(
                f,
                "  RISK ACKNOWLEDGED: {} FALL then, without a brake; each enable says so and begins at {} % speed",
                falling.join(", "),
                self.first_speed_percent
            )?;
        }
        writeln!(f, "  after power-up, the multi-turn offset of a joint is known:")?;
        for s in &self.servos {
            let [low, high] = s.feedback_range_rad;
            let how = match s.feedback {
                "multi-turn" => "from its feedback".to_owned(),
                "wraps" => format!(
                    "from the last pose on disk or the operator, unless its range allows one offset only (its feedback wraps after {:.6} rad)",
                    high - low
                ),
                _ => "from the operator only (`taustream reference`)".to_owned(),
            };
            writeln!(f, "    {:<18} {how}", s.joint)?;
        }
        let full = self.buses.iter().filter(|bus| bus.is_refused()).count();
        if full > 0 { write!(f, "{full} buses too full") } else { Ok(()) }
    }
}
