//! The settings of one arm's controller: robot, buses, servos, cycle, supervision.
use crate::axis::{self, Axis};
use crate::document::{self, Node};
use crate::feed_forward::{self, FeedForward};
use crate::neighbour::{self, Neighbour, NeighbourEntry};
use crate::protocol::{self, Protocol};
use crate::reader::{Bounds, FaultList, Table};
use crate::stopping::STOP_S_MAX;
use crate::{AfterStall, Faults, Feedback, Reaction, Robot, Scene, binding, consistency};
use std::path::{Path, PathBuf};

/// What carries frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusKind {
    /// vcan: no bit rate. Refused on any other interface.
    Virtual,
    /// Classic CAN with a bit rate. On a vcan interface the simulator models it.
    Classic {
        /// Nominal bit rate.
        bitrate_bit_s: u32,
    },
    /// CAN FD with bit rate switch. On a vcan interface the simulator models both rates.
    Fd {
        /// Bit rate of arbitration and acknowledgement.
        bitrate_bit_s: u32,
        /// Bit rate of the data phase.
        data_bitrate_bit_s: u32,
    },
}

impl BusKind {
    /// Nominal bit rate; none for a virtual bus.
    #[must_use]
    pub const fn bitrate_bit_s(self) -> Option<u32> {
        match self {
            Self::Virtual => None,
            Self::Classic { bitrate_bit_s } | Self::Fd { bitrate_bit_s, .. } => Some(bitrate_bit_s),
        }
    }
    /// Bit rate of the data phase; none but on CAN FD.
    #[must_use]
    pub const fn data_bitrate_bit_s(self) -> Option<u32> {
        match self {
            Self::Virtual | Self::Classic { .. } => None,
            Self::Fd { data_bitrate_bit_s, .. } => Some(data_bitrate_bit_s),
        }
    }
}

/// How often a bus carries setpoints and answers, and how they are put into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traffic {
    /// Each servo gets a setpoint in every so many cycles, and interpolates over as many.
    pub setpoint_every: u32,
    /// The servos are staggered within [`Self::setpoint_every`], so that each cycle carries its share of the setpoints.
    pub stagger: bool,
    /// Servos answer every so many SYNCs.
    pub feedback_every: u32,
    /// Two servos' targets share a frame; each skips the other's part.
    pub packed: bool,
}

/// Slowest setpoints that settings may ask for, in cycles. Slower, the drive would choose much of the path itself, and
/// supervision would look at one answer many times over.
pub const SETPOINT_EVERY_MAX: u32 = 10;
/// Slowest answers that settings may ask for, in SYNCs.
pub const FEEDBACK_EVERY_MAX: u32 = 10;

impl Traffic {
    /// One setpoint and one answer a servo in every cycle.
    pub const EVERY_CYCLE: Self =
        Self { setpoint_every: 1, stagger: false, feedback_every: 1, packed: false };
}

/// One bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Its name in this file.
    pub name: String,
    /// Network interface ("vcan0"); the local link uses the same word as its name.
    pub interface: String,
    /// What carries frames.
    pub kind: BusKind,
    /// How much it has to carry.
    pub traffic: Traffic,
}

impl Bus {
    /// A bus with one setpoint and one answer a servo in every cycle.
    #[must_use]
    pub fn new(name: &str, interface: &str, kind: BusKind) -> Self {
        Self { name: name.into(), interface: interface.into(), kind, traffic: Traffic::EVERY_CYCLE }
    }
}

/// One servo: the binding of a joint, or of an axis, to a node on a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    /// Its slot: index into [`Robot::joints`], and behind them the axes ([`Settings::slot`]).
    pub joint: usize,
    /// Index into [`Settings::buses`].
    pub bus: usize,
    /// Its number on the bus, as its protocol counts: 1 to 127 in CANopen, 1 to 15 of a Damiao motor (`ESC_ID`).
    pub node_id: u8,
    /// Its protocol, with what is the protocol's own.
    pub protocol: Protocol,
    /// +1.0 or -1.0: motor direction against link direction.
    pub sign: f64,
    /// Link angle where the servo says 0.
    pub zero_offset_rad: f64,
    /// What the feedback still knows after the drive was without power.
    pub feedback: Feedback,
    /// Link angles that the feedback can tell apart.
    pub feedback_range_rad: [f64; 2],
    /// What the drive does when setpoints stop coming.
    pub reaction: Reaction,
    /// True when the joint may lose torque without harm (a brake, or no load).
    pub limp_is_safe: bool,
    /// What follows a stall.
    pub after_stall: AfterStall,
    /// Its owner knows that the joint falls when commands stop, because its servo cannot hold then.
    pub limp_risk_acknowledged: bool,
}

/// The cycle and what it tolerates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleSettings {
    /// Period of the cycle.
    pub period_us: u32,
    /// Gap that the drives bridge by themselves, in periods.
    pub tolerated_gap_periods: u32,
    /// Longest stall after which the motion resumes by itself.
    pub stall_resume_ms: u32,
    /// Gap after which the drives' own watchdog has tripped.
    pub drive_watchdog_ms: u32,
    /// Time without this master's heartbeat after which the drives count it as lost (CANopen: object 0x1016).
    pub heartbeat_lost_ms: u16,
    /// `SCHED_FIFO` priority.
    pub priority: u8,
    /// CPU that the real-time thread is bound to; none: not bound.
    pub cpu: Option<usize>,
    /// Reports a second.
    pub report_rate_hz: f64,
}

/// When the arm is stopped by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supervision {
    /// Oldest feedback while energised.
    pub feedback_age_s_max: f64,
    /// Largest tracking error.
    pub tracking_error_rad_max: f64,
    /// Largest step of a measured position between two samples.
    pub position_jump_rad_max: f64,
    /// Lost cycles in a row that make a bus fault.
    pub lost_cycles_max: u32,
    /// How long drives may take for each step of bring-up and enabling.
    pub drive_timeout_s: f64,
    /// Distance from a trajectory's base at which it is still taken; the streamer lets it go along the start of the motion.
    pub base_tolerance_rad: f64,
    /// Speed override at start, in percent.
    pub first_speed_percent: f64,
    /// Longest stop of an arm that is accepted, s.
    pub stop_s_max: f64,
}

/// Checked settings of one arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Name of the arm; stands in the names of its services.
    pub name: String,
    /// The file that it was read from.
    pub file: PathBuf,
    /// The robot.
    pub robot: Robot,
    /// The scene that the planner serves.
    pub scene: Scene,
    /// The buses.
    pub buses: Vec<Bus>,
    /// Grippers, lifts: what has a servo and is no joint of the path.
    pub axes: Vec<Axis>,
    /// One servo a joint, in the order of the joints, then one an axis.
    pub servos: Vec<Servo>,
    /// The cycle.
    pub cycle: CycleSettings,
    /// Supervision.
    pub supervision: Supervision,
    /// Torque that is commanded beside the position, if any.
    pub feed_forward: Option<FeedForward>,
    /// Other arms in the same room, as this file names them.
    pub neighbour_entries: Vec<NeighbourEntry>,
    /// The same with what their files say; empty for the settings of a neighbour.
    pub neighbours: Vec<Neighbour>,
    /// The section of the simulated servos as it stands; whoever simulates checks its keys.
    pub simulator: Option<toml::Table>,
}

/// Where the file gives none. Nothing here moves an arm: what does has no default.
mod default {
    /// One late cycle is bridged by every drive that interpolates; the design's number.
    pub(super) const TOLERATED_GAP_PERIODS: i64 = 2;
    /// By how much the drives' heartbeat time is longer than their watchdog over setpoints.
    pub(super) const HEARTBEAT_BEYOND_WATCHDOG_MS: i64 = 250;
    pub(super) const STALL_RESUME_MS: i64 = 20;
    /// Below the kernel's own threads for timers, above everything ordinary.
    pub(super) const PRIORITY: i64 = 80;
    pub(super) const REPORT_RATE_HZ: f64 = 100.0;
    pub(super) const LOST_CYCLES_MAX: i64 = 3;
    pub(super) const DRIVE_TIMEOUT_S: f64 = 5.0;
    /// The first enable after start runs at reduced speed until changed.
    pub(super) const FIRST_SPEED_PERCENT: f64 = 25.0;
}

/// 0x60C2 of CiA 402 and the vendors' drives take setpoints at 1 kHz or slower; 250 us leaves room above that.
const PERIOD_US: [i64; 2] = [250, 20_000];
const RATE_HZ: Bounds = Bounds::within(1.0, 1000.0, "Hz");
const AGE_S: Bounds = Bounds::above(0.0, 1.0, "s");
const ERROR_RAD: Bounds = Bounds::above(0.0, 3.2, "rad");
const TIMEOUT_S: Bounds = Bounds::within(0.1, 60.0, "s");
/// The service manager waits 20 s for the streamer: for a stop, and for the drives and the disk after it.
const STOP_S: Bounds = Bounds::above(0.0, 5.0, "s");
/// The difference between base and commanded pose shifts the start of a verified motion, so it stays at an encoder's resolution.
const TOLERANCE_RAD: Bounds = Bounds::within(0.0, 1e-6, "rad");
const PERCENT: Bounds = Bounds::above(0.0, 100.0, "percent");
/// The arm's name stands in file names of shared memory, beside a prefix and a service's name.
const ARM_NAME_BYTES_MAX: usize = 32;

/// How the files are read that a settings file names.
#[derive(Clone, Copy)]
struct Readers {
    robot: fn(&Path) -> Result<Robot, Faults>,
    follows_neighbours: bool,
}

impl Settings {
    /// Reads and checks a settings file and the robot and scene files that it names.
    ///
    /// # Errors
    /// Every fault at once, those of the robot and scene files included.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        Self::from_toml(file, &document::read_text(file, "a settings file in TOML")?)
    }
    /// Checks the text of a settings file; the files that it names are looked up beside `file`.
    ///
    /// # Errors
    /// Every fault at once, those of the robot and scene files included.
    pub fn from_toml(file: &Path, text: &str) -> Result<Self, Faults> {
        let settings = Self::from_toml_overloaded(file, text)?;
        let fault_list = FaultList::new(file);
        consistency::check_loads(&fault_list, &settings);
        fault_list.close(Some(settings))
    }
    /// As [`Self::load`], but takes buses that are too full: for whoever shows what is wrong with them. Nothing may be
    /// run on such settings.
    ///
    /// # Errors
    /// Every other fault at once.
    pub fn load_overloaded(file: &Path) -> Result<Self, Faults> {
        Self::from_toml_overloaded(file, &document::read_text(file, "a settings file in TOML")?)
    }
    /// As [`Self::load`], with [`Robot::load_untried`]: for a process that talks to the services of the arm and plans nothing.
    ///
    /// # Errors
    /// Every other fault at once.
    pub fn load_untried(file: &Path) -> Result<Self, Faults> {
        let text = document::read_text(file, "a settings file in TOML")?;
        let readers = Readers { robot: Robot::load_untried, follows_neighbours: true };
        let settings = Self::read_with(file, &text, readers)?;
        let fault_list = FaultList::new(file);
        consistency::check_loads(&fault_list, &settings);
        fault_list.close(Some(settings))
    }
    /// The settings of a neighbour: its own neighbours are not followed.
    pub(crate) fn load_alone(file: &Path) -> Result<Self, Faults> {
        let text = document::read_text(file, "a settings file in TOML")?;
        Self::read_with(file, &text, Readers { robot: Robot::load_untried, follows_neighbours: false })
    }
    fn from_toml_overloaded(file: &Path, text: &str) -> Result<Self, Faults> {
        Self::read_with(file, text, Readers { robot: Robot::load, follows_neighbours: true })
    }
    fn read_with(file: &Path, text: &str, readers: Readers) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        let settings = Self::read(&fault_list, document::parse_toml(file, text)?, (text, readers));
        fault_list.close(settings)
    }
    /// Cycles in a row that a bus may lose. Where the others continue, the drives of the lost one must not be commanded to catch
    /// up beyond what they bridge: it has failed before.
    #[must_use]
    pub fn lost_cycles_max(&self) -> u32 {
        let stated = self.supervision.lost_cycles_max;
        if self.buses.len() > 1 { stated.min(self.cycle.tolerated_gap_periods) } else { stated }
    }
    fn read(fault_list: &FaultList, node: Node, (text, readers): (&str, Readers)) -> Option<Self> {
        let mut top = Table::top(fault_list, node)?;
        let name = read_name(&mut top);
        let robot = named_file(&mut top, "robot", readers.robot);
        let scene = named_file(&mut top, "scene", Scene::load);
        let buses = binding::read_buses(&mut top);
        let axes = axis::read(&mut top, robot.as_ref());
        let servos = binding::read_servos(&mut top, (robot.as_ref(), &axes), &buses);
        let cycle = top.table("cycle", "a table [cycle]").and_then(read_cycle);
        let supervision = top.table("supervision", "a table [supervision]").and_then(read_supervision);
        let feed_forward = feed_forward::read(&mut top, robot.as_ref(), &servos);
        let neighbour_entries = neighbour::read(&mut top);
        let simulator = read_simulator(&mut top, text);
        top.done();
        let neighbours = match &name {
            Some(name) if readers.follows_neighbours => neighbour::load(fault_list, name, &neighbour_entries),
            Some(_) | None => Vec::new(),
        };
        if let (Some(cycle), Some(supervision)) = (&cycle, &supervision) {
            consistency::check_times(fault_list, cycle, supervision);
        }
        if !fault_list.is_clean() {
            return None;
        }
        let mut settings = Self {
            name: name?,
            file: fault_list.file().to_owned(),
            robot: robot?,
            scene: scene?,
            buses: buses.into_iter().collect::<Option<Vec<Bus>>>()?,
            axes: axes.into_iter().collect::<Option<Vec<Axis>>>()?,
            servos,
            cycle: cycle?,
            supervision: supervision?,
            feed_forward: feed_forward?,
            neighbour_entries,
            neighbours,
            simulator,
        };
        if settings.feed_forward.is_some() {
            settings.robot.message_digest = settings.robot.torque_model_digest;
        }
        feed_forward::check_masses(fault_list, &settings);
        let stops = settings.robot.require_stops(settings.supervision.stop_s_max);
        for faults in [settings.robot.require_modelled(), stops].into_iter().filter_map(Result::err) {
            fault_list.merge(faults);
        }
        if let Some(joint) = settings.robot.joints.iter().find(|joint| joint.kind.is_prismatic()) {
            let expected = format!(
                "a robot of revolute joints: servos of prismatic joints ({}) are not driven; `plan`, `verify` and `check` take it by \
                 --robot",
                document::shown(&joint.name)
            );
            fault_list.add(None, "robot", &document::shown(&settings.robot.name), &expected);
        }
        consistency::check_jump(fault_list, &settings);
        axis::check_servos(fault_list, &settings);
        protocol::check_settings(fault_list, &settings);
        consistency::check_traffic(fault_list, &settings);
        consistency::check_limp_risk(fault_list, &settings);
        Some(settings)
    }
}

fn read_name(top: &mut Table<'_>) -> Option<String> {
    let name = top.name("name")?;
    if name.len() <= ARM_NAME_BYTES_MAX && !name.contains('.') {
        return Some(name);
    }
    let expected = format!("1 to {ARM_NAME_BYTES_MAX} letters, digits, '_' or '-'");
    top.fault("name", &document::shown(&name), &expected);
    None
}

/// Loads a file that this one names; its faults join this book.
fn named_file<T>(top: &mut Table<'_>, key: &'static str, load: fn(&Path) -> Result<T, Faults>) -> Option<T> {
    let named = top.text(key, &format!("the path of a {key} file, relative to this file"))?;
    let path = document::beside(top.fault_list().file(), &named);
    load(&path).map_err(|faults| top.fault_list().merge(faults)).ok()
}

fn read_cycle(mut table: Table<'_>) -> Option<CycleSettings> {
    let period_us = table.integer("period_us", PERIOD_US[0], PERIOD_US[1]);
    let gap = table.integer_or("tolerated_gap_periods", default::TOLERATED_GAP_PERIODS, 1, 100);
    let stall = table.integer_or("stall_resume_ms", default::STALL_RESUME_MS, 0, 10_000);
    let watchdog = table.integer("drive_watchdog_ms", 1, 10_000);
    let heartbeat = table.integer_if_there("heartbeat_lost_ms", 1, 60_000);
    let priority = table.integer_or("priority", default::PRIORITY, 1, 99);
    let cpu = table.integer_if_there("cpu", 0, 1023);
    let report_rate_hz = table.number_or("report_rate_hz", default::REPORT_RATE_HZ, &RATE_HZ);
    table.done();
    Some(CycleSettings {
        period_us: u32::try_from(period_us?).ok()?,
        tolerated_gap_periods: u32::try_from(gap?).ok()?,
        stall_resume_ms: u32::try_from(stall?).ok()?,
        drive_watchdog_ms: u32::try_from(watchdog?).ok()?,
        heartbeat_lost_ms: u16::try_from(
            heartbeat?.unwrap_or(watchdog?.saturating_add(default::HEARTBEAT_BEYOND_WATCHDOG_MS)),
        )
        .ok()?,
        priority: u8::try_from(priority?).ok()?,
        cpu: cpu?.and_then(|cpu| usize::try_from(cpu).ok()),
        report_rate_hz: report_rate_hz?,
    })
}

fn read_supervision(mut table: Table<'_>) -> Option<Supervision> {
    let feedback_age_s_max = table.number("feedback_age_s_max", &AGE_S);
    let tracking_error_rad_max = table.number("tracking_error_rad_max", &ERROR_RAD);
    let position_jump_rad_max = table.number("position_jump_rad_max", &ERROR_RAD);
    let lost_cycles_max = table.integer_or("lost_cycles_max", default::LOST_CYCLES_MAX, 1, 1000);
    let drive_timeout_s = table.number_or("drive_timeout_s", default::DRIVE_TIMEOUT_S, &TIMEOUT_S);
    let base_tolerance_rad = table.number("base_tolerance_rad", &TOLERANCE_RAD);
    let first_speed_percent = table.number_or("first_speed_percent", default::FIRST_SPEED_PERCENT, &PERCENT);
    let stop_s_max = table.number_or("stop_s_max", STOP_S_MAX, &STOP_S);
    table.done();
    Some(Supervision {
        feedback_age_s_max: feedback_age_s_max?,
        tracking_error_rad_max: tracking_error_rad_max?,
        position_jump_rad_max: position_jump_rad_max?,
        lost_cycles_max: u32::try_from(lost_cycles_max?).ok()?,
        drive_timeout_s: drive_timeout_s?,
        base_tolerance_rad: base_tolerance_rad?,
        first_speed_percent: first_speed_percent?,
        stop_s_max: stop_s_max?,
    })
}

/// The section as it stands; the simulator knows its keys and checks them.
fn read_simulator(top: &mut Table<'_>, text: &str) -> Option<toml::Table> {
    if !top.has("simulator") {
        return None;
    }
    top.table("simulator", "a table [simulator]")?;
    let mut whole: toml::Table = text.parse().ok()?;
    match whole.remove("simulator") {
        Some(toml::Value::Table(section)) => Some(section),
        _ => None,
    }
}
