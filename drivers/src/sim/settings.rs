//! The `[simulator]` section of a settings file: what the simulated drives and their mechanics are made of.
//!
//! Every key has a default, because nothing here moves an arm. A key for joints takes one value for all of them or one
//! a joint, base to tip. Every fault of the section is reported at once.
use super::controller::LoopParameters;
use super::model::ModelParameters;
use super::plant::PlantParameters;
use super::planted::{self, PlantedObject};
use crate::protocols::REGISTRY;
use std::any::Any;
use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use taustream_arm::{BusKind, Fault, Faults, MitGains, Servo, Settings};
use taustream_motion::JointLimits;
use taustream_motion::dynamics::Dynamics;
use toml::{Table, Value};

/// One servo and the joint that it moves.
#[derive(Debug)]
pub struct DriveSetup {
    /// The joint's name.
    pub joint: String,
    /// Index of its bus in [`Settings::buses`].
    pub bus: usize,
    /// The servo.
    pub parameters: Box<dyn ModelParameters>,
    /// Objects of its drive that hold something else than the parameters make.
    pub objects: Vec<PlantedObject>,
}

/// Drives of all joints, base to tip, as the settings describe them. `start_rad` replaces the section's key.
///
/// # Errors
/// Every fault of the section at once.
pub fn drives(settings: &Settings, start_rad: Option<&[f64]>) -> Result<Vec<DriveSetup>, Faults> {
    let empty = Table::new();
    let table = settings.simulator.as_ref().unwrap_or(&empty);
    let section = Section::new(settings, table);
    let mut setups: Vec<DriveSetup> =
        settings.servos.iter().filter_map(|servo| section.setup(settings, servo)).collect();
    setups.sort_by_key(|setup| settings.all_slots().position(|slot| slot.name == setup.joint));
    section.plant_objects(&mut setups);
    section.masses(settings);
    section.unknown_keys();
    let faults = section.faults.into_inner();
    if !faults.is_empty() {
        return Err(Faults(faults));
    }
    for (setup, start_rad) in setups.iter_mut().zip(start_rad.unwrap_or(&[])) {
        *setup.parameters.start_rad_mut() = *start_rad;
    }
    Ok(setups)
}

/// Frames that the master's side of a simulated bus with a bit rate holds, from the section's `bus_queue_frames`.
///
/// # Errors
/// When it is no whole number from 1 to 4096.
pub fn queue_frames(settings: &Settings) -> Result<usize, Faults> {
    let empty = Table::new();
    let table = settings.simulator.as_ref().unwrap_or(&empty);
    let section = Section::new(settings, table);
    let frames: u32 = section.whole("bus_queue_frames", 0, QUEUE_FRAMES, 1..=4096);
    let faults = section.faults.into_inner();
    if faults.is_empty() { Ok(frames as usize) } else { Err(Faults(faults)) }
}

/// The masses whose weight acts on the simulated joints, where the section says `gravity_of_masses = true`.
///
/// # Errors
/// When the key is no flag, stands beside `gravity_nm`, or the robot file states no masses.
pub fn masses(settings: &Settings) -> Result<Option<Dynamics>, Faults> {
    let empty = Table::new();
    let table = settings.simulator.as_ref().unwrap_or(&empty);
    let section = Section::new(settings, table);
    let dynamics = section.masses(settings);
    let faults = section.faults.into_inner();
    if faults.is_empty() { Ok(dynamics) } else { Err(Faults(faults)) }
}

const GRAVITY_OF_MASSES: &str = "gravity_of_masses";

/// A few cycles of a six-joint arm: enough for a burst, and an overload shows within a tenth of a second.
const QUEUE_FRAMES: u32 = 64;

/// Keys of every servo and of the buses; those of each protocol come beside them.
const KEYS: [&str; 19] = [
    "bus_queue_frames",
    "start_rad",
    "inertia_kg_m2",
    "viscous_nm_s_rad",
    "coulomb_nm",
    "gravity_nm",
    "gravity_level_rad",
    GRAVITY_OF_MASSES,
    "torque_nm_max",
    "speed_rad_s_max",
    "brake",
    "brake_delay_ms",
    "position_gain_1_s",
    "velocity_bandwidth_rad_s",
    "integral_time_ms",
    "torque_lag_ms",
    "extrapolation_ms",
    "boot_ms",
    "step_us",
];

/// What a joint is by default.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Load {
    inertia_kg_m2: f64,
    viscous_nm_s_rad: f64,
    coulomb_nm: f64,
    gravity_nm: f64,
}

impl Load {
    /// A joint of an arm of some 20 kg, as a geared drive moves it.
    pub(crate) const LARGE: Self =
        Self { inertia_kg_m2: 1.0, viscous_nm_s_rad: 1.0, coulomb_nm: 1.0, gravity_nm: 10.0 };
}

/// The section while it is being read.
struct Section<'a> {
    table: &'a Table,
    file: &'a Path,
    joints: usize,
    faults: RefCell<Vec<Fault>>,
    /// What servos of one controller have in common, by bus.
    shared: RefCell<Vec<(usize, Arc<dyn Any + Send + Sync>)>>,
}

/// One joint's part of the section while it is being read.
pub(crate) struct SimulatedJoint<'a> {
    section: &'a Section<'a>,
    /// Of the arm.
    pub(crate) settings: &'a Settings,
    /// Its servo.
    pub(crate) servo: &'a Servo,
    /// Of the joint.
    pub(crate) limits: JointLimits,
}

impl SimulatedJoint<'_> {
    /// A number, or `default`.
    pub(crate) fn number(
        &self,
        key: &'static str,
        default: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> f64 {
        self.section.number(key, self.servo.joint, default, range)
    }

    /// A whole number, or `default`.
    pub(crate) fn whole<T>(&self, key: &'static str, default: u32, range: std::ops::RangeInclusive<u32>) -> T
    where
        T: TryFrom<u32> + Default,
    {
        self.section.whole(key, self.servo.joint, default, range)
    }

    /// True or false, or `default`.
    pub(crate) fn flag(&self, key: &'static str, default: bool) -> bool {
        self.section.flag(key, self.servo.joint, default)
    }

    /// What all servos of one controller on this bus have in common: the same for each of them.
    pub(crate) fn shared<T: Any + Send + Sync + Default>(&self) -> Arc<T> {
        let mut shared = self.section.shared.borrow_mut();
        let mut on_bus = shared.iter().filter(|(bus, _)| *bus == self.servo.bus);
        let found = on_bus.find_map(|(_, any)| Arc::clone(any).downcast().ok());
        found.unwrap_or_else(|| {
            let new = Arc::<T>::default();
            shared.push((self.servo.bus, new.clone()));
            new
        })
    }

    /// A text, if there is one.
    pub(crate) fn text(&self, key: &'static str) -> Option<String> {
        let value = self.section.of_joint(key, self.servo.joint)?;
        let text = value.as_str().map(str::to_owned);
        if text.is_none() {
            self.section.fault(&self.section.path(key, self.servo.joint), &value.to_string(), "a text");
        }
        text
    }

    /// Kind of its bus.
    pub(crate) fn bus_kind(&self) -> Option<BusKind> {
        self.settings.buses.get(self.servo.bus).map(|bus| bus.kind)
    }

    /// Link angle at power-up.
    pub(crate) fn start_rad(&self) -> f64 {
        let [low_rad, high_rad] = self.limits.position_rad;
        self.number("start_rad", 0.0_f64.clamp(low_rad, high_rad), low_rad..=high_rad)
    }

    /// Time from power-up to the first answer.
    pub(crate) fn boot_s(&self) -> f64 {
        self.number("boot_ms", 20.0, 0.0..=60_000.0) * 1e-3
    }

    /// Step of the mechanics.
    pub(crate) fn step_ns(&self) -> u64 {
        u64::from(self.whole::<u32>("step_us", 250, 10..=1000)) * 1000
    }

    /// A joint that a motor of this torque can carry and its gains, if it has any, can hold: damped by 0.7 as a spring, so light
    /// that the motor accelerates it as the limits allow, and out of its place by a tenth of the tracking error that stops the
    /// arm, at most.
    pub(crate) fn load_for(&self, torque_nm: f64, gains: Option<MitGains>) -> Load {
        const DAMPING_RATIO: f64 = 0.7;
        let large = Load::LARGE;
        let tracking_rad = self.settings.supervision.tracking_error_rad_max;
        let moved_kg_m2 = 0.3 * torque_nm / self.limits.stop.acceleration_rad_s2.max(1e-3);
        let (damped_kg_m2, held_nm, damping_nm_s_rad) = match gains {
            Some(MitGains { stiffness_nm_rad, damping_nm_s_rad, .. }) => (
                damping_nm_s_rad.powi(2) / (4.0 * DAMPING_RATIO.powi(2) * stiffness_nm_rad),
                0.1 * tracking_rad * stiffness_nm_rad,
                damping_nm_s_rad,
            ),
            None => (f64::INFINITY, f64::INFINITY, f64::INFINITY),
        };
        let inertia_kg_m2 = damped_kg_m2.min(moved_kg_m2).clamp(1e-4, large.inertia_kg_m2);
        // It falls while the gains rise: no faster than a long link.
        let falling_nm = 20.0 * inertia_kg_m2;
        Load {
            inertia_kg_m2,
            viscous_nm_s_rad: large.viscous_nm_s_rad.min(0.1 * damping_nm_s_rad).min(0.01 * torque_nm),
            coulomb_nm: large.coulomb_nm.min(0.01 * torque_nm).min(held_nm),
            gravity_nm: large.gravity_nm.min(0.05 * torque_nm).min(held_nm).min(falling_nm),
        }
    }

    /// Mechanics; torque and speed that the motor has by default suffice for the joint's stop limits.
    pub(crate) fn plant(&self, load: Load) -> PlantParameters {
        let limits = &self.limits;
        let inertia_kg_m2 = self.number("inertia_kg_m2", load.inertia_kg_m2, 1e-4..=1e4);
        let viscous_nm_s_rad = self.number("viscous_nm_s_rad", load.viscous_nm_s_rad, 0.0..=1e4);
        let coulomb_nm = self.number("coulomb_nm", load.coulomb_nm, 0.0..=1e4);
        let gravity_nm = self.number("gravity_nm", load.gravity_nm, -1e4..=1e4);
        let speed_rad_s = limits.motion.velocity_rad_s.max(1e-3);
        let load_nm = gravity_nm.abs() + coulomb_nm + viscous_nm_s_rad * speed_rad_s;
        let enough_nm = 1.5 * (load_nm + inertia_kg_m2 * limits.stop.acceleration_rad_s2);
        PlantParameters {
            inertia_kg_m2,
            viscous_nm_s_rad,
            coulomb_nm,
            gravity_nm,
            gravity_level_rad: self.number("gravity_level_rad", 0.0, -100.0..=100.0),
            torque_nm_max: self.number("torque_nm_max", enough_nm.max(1e-3), 1e-3..=1e6),
            speed_rad_s_max: self.number("speed_rad_s_max", 1.25 * speed_rad_s, 1e-3..=1e3),
            brake: self.flag("brake", self.servo.limp_is_safe),
            brake_delay_s: self.number("brake_delay_ms", 20.0, 0.0..=5000.0) * 1e-3,
        }
    }

    /// Control loops. The bounds keep the fastest of them stable at the largest step of the mechanics.
    pub(crate) fn loops(&self) -> LoopParameters {
        LoopParameters {
            position_gain_1_s: self.number("position_gain_1_s", 60.0, 1.0..=150.0),
            velocity_bandwidth_rad_s: self.number("velocity_bandwidth_rad_s", 400.0, 10.0..=600.0),
            integral_time_s: self.number("integral_time_ms", 20.0, 5.0..=1000.0) * 1e-3,
            torque_lag_s: self.number("torque_lag_ms", 0.3, 0.0..=0.5) * 1e-3,
            extrapolation_s: self.number("extrapolation_ms", 0.0, 0.0..=1000.0) * 1e-3,
        }
    }
}

impl<'a> Section<'a> {
    fn new(settings: &'a Settings, table: &'a Table) -> Self {
        Self {
            table,
            file: &settings.file,
            joints: settings.slots(),
            faults: RefCell::default(),
            shared: RefCell::default(),
        }
    }
}

impl Section<'_> {
    fn setup(&self, settings: &Settings, servo: &Servo) -> Option<DriveSetup> {
        let joint = settings.slot(servo.joint);
        let limits = joint.map(|joint| joint.limits).unwrap_or_default();
        let name = joint.map_or_else(|| format!("joint {}", servo.joint + 1), |joint| joint.name.clone());
        let known = REGISTRY.iter().find(|known| known.name == servo.protocol.name())?;
        let simulated = SimulatedJoint { section: self, settings, servo, limits };
        let parameters = (known.simulate)(&simulated);
        Some(DriveSetup { joint: name, bus: servo.bus, parameters, objects: Vec::new() })
    }

    /// The masses whose weight acts on the joints, if it does.
    fn masses(&self, settings: &Settings) -> Option<Dynamics> {
        if !self.flag(GRAVITY_OF_MASSES, 0, false) {
            return None;
        }
        if let Some(pendulum) = self.table.get("gravity_nm") {
            self.fault("gravity_nm", &pendulum.to_string(), "one of gravity_nm and gravity_of_masses");
        }
        let dynamics = settings.robot.dynamics();
        if dynamics.is_err() {
            let expected = format!("false: robot {} states no masses", settings.robot.name);
            self.fault(GRAVITY_OF_MASSES, "true", &expected);
        }
        dynamics.ok()
    }

    /// Objects of drives that hold something else than the parameters make.
    fn plant_objects(&self, setups: &mut [DriveSetup]) {
        let texts = match self.table.get("objects") {
            None => return,
            Some(Value::Array(texts)) => texts,
            Some(other) => {
                let expected = "a list of texts, for example [\"joint=3,object=0x6091:01,value=50\"]";
                return self.fault("objects", &other.to_string(), expected);
            }
        };
        for (at, value) in texts.iter().enumerate() {
            let planted = match value.as_str() {
                Some(text) => planted::plant(text, setups).map_err(|error| error.to_string()),
                None => Err("a text, for example \"joint=3,object=0x6091:01,value=50\"".to_owned()),
            };
            if let Err(expected) = planted {
                self.fault(&format!("objects[{at}]"), &value.to_string(), &expected);
            }
        }
    }

    /// A joint's number, or `default`.
    fn number(
        &self,
        key: &'static str,
        at: usize,
        default: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> f64 {
        let Some(value) = self.of_joint(key, at) else { return default };
        #[expect(clippy::cast_precision_loss, reason = "no range reaches 2^53")]
        let number = match value {
            Value::Float(number) => Some(*number),
            Value::Integer(number) => Some(*number as f64),
            Value::String(_) | Value::Boolean(_) | Value::Datetime(_) | Value::Array(_) | Value::Table(_) => {
                None
            }
        };
        number.filter(|number| range.contains(number)).unwrap_or_else(|| {
            let expected = format!("a number from {} to {}", range.start(), range.end());
            self.fault(&self.path(key, at), &value.to_string(), &expected);
            default
        })
    }

    /// A joint's whole number, or `default`.
    fn whole<T>(&self, key: &'static str, at: usize, default: u32, range: std::ops::RangeInclusive<u32>) -> T
    where
        T: TryFrom<u32> + Default,
    {
        let number = match self.of_joint(key, at) {
            None => default.min(*range.end()),
            Some(value) => {
                let number = value.as_integer().and_then(|number| u32::try_from(number).ok());
                number.filter(|number| range.contains(number)).unwrap_or_else(|| {
                    let expected = format!("a whole number from {} to {}", range.start(), range.end());
                    self.fault(&self.path(key, at), &value.to_string(), &expected);
                    default
                })
            }
        };
        T::try_from(number).unwrap_or_default()
    }

    fn flag(&self, key: &'static str, at: usize, default: bool) -> bool {
        match self.of_joint(key, at) {
            None => default,
            Some(Value::Boolean(flag)) => *flag,
            Some(other) => {
                self.fault(&self.path(key, at), &other.to_string(), "true or false");
                default
            }
        }
    }

    /// The value of a key for joint `at`; a list of another length than the arm is a fault.
    fn of_joint(&self, key: &'static str, at: usize) -> Option<&Value> {
        let value = self.table.get(key)?;
        let Value::Array(list) = value else { return Some(value) };
        if list.len() != self.joints {
            let expected = format!("one value for all, or {}: joints, then axes", self.joints);
            self.fault(key, &format!("a list of {}", list.len()), &expected);
            return None;
        }
        list.get(at)
    }

    fn path(&self, key: &str, at: usize) -> String {
        if matches!(self.table.get(key), Some(Value::Array(_))) { format!("{key}[{at}]") } else { key.into() }
    }

    fn unknown_keys(&self) {
        let of_protocols = REGISTRY.iter().flat_map(|known| known.simulator_keys);
        let keys: Vec<&str> = KEYS.iter().chain(of_protocols).copied().collect();
        for (key, value) in self.table {
            if !keys.contains(&key.as_str()) {
                self.fault(key, &value.to_string(), &format!("one of the keys {}", keys.join(", ")));
            }
        }
    }

    /// Notes a fault, once: a value for all joints is read for each of them.
    fn fault(&self, key: &str, value: &str, expected: &str) {
        let fault = Fault {
            file: self.file.to_path_buf(),
            line: None,
            key: format!("simulator.{key}"),
            value: value.to_owned(),
            expected: expected.to_owned(),
        };
        let mut faults = self.faults.borrow_mut();
        if !faults.contains(&fault) {
            faults.push(fault);
        }
    }
}
