//! A drive's own limits of speed and acceleration, against what the streamer may command.
//!
//! No setpoint leaves the stop limits of its joint. A drive that cuts off below them lags behind its setpoints. Limits that
//! cut off are written with a margin above the stop limits: setpoints are whole counts, and a drive that differentiates them sees more
//! than was commanded. Ramps of the drive's own are written as they are: of a quick stop the stop limit, of its profile the
//! motion limit.
//!
//! Sources: CiA 402-2, "Profile position mode"; 0x6080 is in revolutions of the motor a minute.
use crate::bring_up::steps::{Check, Need, Steps};
use crate::codec::object::{self, Address};
use crate::codec::sdo::SdoBytes;
use std::f64::consts::TAU;
use taustream_arm::{
    AbsentObjects, Cia402, LimitUse, OptionalObject, ProfileLimits, RobotJoint, Servo, VelocityUnit,
};
use taustream_motion::digits::Decimals;

/// A limit that cuts off is written so many times the stop limit.
const MARGIN: f64 = 1.2;
/// Relative rounding that is no difference.
const SAME: f64 = 1e-6;
/// Counts by which rounding alone changes the distance between two setpoints, and the difference of two such distances.
const ROUNDING_COUNTS: [f64; 2] = [1.0, 2.0];

/// What a limit is about.
#[derive(Clone, Copy, PartialEq, Eq)]
enum LimitKind {
    /// It cuts speeds off.
    Speed,
    /// It cuts accelerations off.
    Acceleration,
    /// The ramp of a quick stop.
    QuickStop,
    /// A ramp of the drive's own profiles.
    Profile,
}

const OBJECTS: [(OptionalObject, Address, LimitKind); 7] = [
    (OptionalObject::MaxProfileVelocity, object::MAX_PROFILE_VELOCITY, LimitKind::Speed),
    (OptionalObject::MaxMotorSpeed, object::MAX_MOTOR_SPEED, LimitKind::Speed),
    (OptionalObject::ProfileAcceleration, object::PROFILE_ACCELERATION, LimitKind::Profile),
    (OptionalObject::ProfileDeceleration, object::PROFILE_DECELERATION, LimitKind::Profile),
    (OptionalObject::QuickStopDeceleration, object::QUICK_STOP_DECELERATION, LimitKind::QuickStop),
    (OptionalObject::MaxAcceleration, object::MAX_ACCELERATION, LimitKind::Acceleration),
    (OptionalObject::MaxDeceleration, object::MAX_DECELERATION, LimitKind::Acceleration),
];

/// What the limits of one drive are compared with, or set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfilePlan {
    limits: ProfileLimits,
    gear_ratio: f64,
    counts_per_rev: f64,
    /// Largest velocity of a setpoint.
    velocity_rad_s: f64,
    /// Largest acceleration of a setpoint.
    acceleration_rad_s2: f64,
    /// That of a planned motion.
    motion_rad_s2: f64,
    /// Time between two setpoints.
    setpoint_s: f64,
}

impl ProfilePlan {
    /// Of a servo and its joint, with a setpoint every `setpoint_us`; none where the settings do not ask for it.
    #[must_use]
    pub fn of(servo: &Servo, joint: &RobotJoint, setpoint_us: u32) -> Option<Self> {
        let cia402 = servo.protocol.get::<Cia402>()?;
        let stop = joint.limits.stop;
        Some(Self {
            limits: cia402.features.profile_limits?,
            gear_ratio: cia402.gear_ratio,
            counts_per_rev: cia402.counts_per_rev,
            velocity_rad_s: stop.velocity_rad_s,
            acceleration_rad_s2: stop.acceleration_rad_s2,
            motion_rad_s2: joint.limits.motion.acceleration_rad_s2,
            setpoint_s: f64::from(setpoint_us) * 1e-6,
        })
    }

    /// Adds the steps for every object that the drive has.
    pub(super) fn steps(&self, absent: AbsentObjects, steps: &mut Steps) {
        for (_, address, kind) in OBJECTS.into_iter().filter(|(object, ..)| !absent.holds(*object)) {
            match self.limits.apply {
                LimitUse::Compare => {
                    let least = self.in_drive(address, self.commanded(kind) * (1.0 - SAME));
                    steps.read_if_there(address, 4, Check::AtLeast(least));
                }
                LimitUse::Write => {
                    let bytes = SdoBytes::from_u32(self.in_drive(address, self.written(kind)));
                    steps.set(address, bytes, Need::Demanded);
                }
            }
        }
    }

    /// What the drive states of an object and what the streamer may command, in rad/s or rad/s^2 of the joint.
    pub(super) fn numbers(&self, address: Address, stated: u32) -> [f64; 2] {
        let found = OBJECTS.into_iter().find(|(_, other, _)| *other == address);
        found.map_or([f64::NAN; 2], |(.., kind)| {
            let unit = self.unit(address);
            let stated = unit.to_rad_s(f64::from(stated), self.gear_ratio, self.counts_per_rev);
            [stated, self.commanded(kind)]
        })
    }

    /// rad/s or rad/s^2.
    fn commanded(&self, kind: LimitKind) -> f64 {
        match kind {
            LimitKind::Speed => self.velocity_rad_s,
            LimitKind::Profile => self.motion_rad_s2,
            LimitKind::Acceleration | LimitKind::QuickStop => self.acceleration_rad_s2,
        }
    }

    /// rad/s or rad/s^2.
    fn written(&self, kind: LimitKind) -> f64 {
        let commanded = self.commanded(kind);
        let count_rad = TAU / (self.gear_ratio * self.counts_per_rev);
        match kind {
            LimitKind::Speed => commanded * MARGIN + ROUNDING_COUNTS[0] * count_rad / self.setpoint_s,
            LimitKind::Acceleration => {
                commanded * MARGIN + ROUNDING_COUNTS[1] * count_rad / (self.setpoint_s * self.setpoint_s)
            }
            LimitKind::QuickStop | LimitKind::Profile => commanded,
        }
    }

    /// A speed or acceleration of the joint in the unit of its object, rounded up.
    fn in_drive(&self, address: Address, value: f64) -> u32 {
        let exact = self.unit(address).of_rad_s(value, self.gear_ratio, self.counts_per_rev).ceil();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let whole = exact.clamp(1.0, f64::from(u32::MAX)) as u32;
        whole
    }

    fn unit(&self, address: Address) -> VelocityUnit {
        if address == object::MAX_MOTOR_SPEED { VelocityUnit::Rpm } else { self.limits.velocity_unit }
    }
}

/// What a limit that is too low means and what to do, by the packed address of its object; `None` for any other object.
#[must_use]
pub fn sentence(packed: u32, stated: f64, commanded: f64) -> Option<String> {
    let index = u16::try_from(packed >> 8).ok()?;
    let (object, _, kind) = OBJECTS.into_iter().find(|(object, ..)| object.index() == index)?;
    let (unit, key, of) = match kind {
        LimitKind::Speed => ("rad/s", "velocity", "stop"),
        LimitKind::Acceleration | LimitKind::QuickStop => ("rad/s^2", "acceleration", "stop"),
        LimitKind::Profile => ("rad/s^2", "acceleration", "motion"),
    };
    let effect = if kind == LimitKind::QuickStop {
        "a quick stop of the drive would carry the joint farther"
    } else {
        "the drive would lag behind its setpoints or cut them off there"
    };
    let decimals = Decimals::apart(&[stated, commanded], 3);
    let (stated, commanded) = (decimals.show(stated), decimals.show(commanded));
    let name = object.name();
    Some(format!(
        "object 0x{index:04X} ({name}) of the drive is {stated} {unit} of the joint, and the streamer may command {commanded} {unit}, its \
         {of} limit: {effect}; raise it in the drive and save it, lower the joint's {of} {key}, correct velocity_unit, or state \
         apply = \"write\" in [servo.profile_limits]; if the object means something else, state absent_objects = [0x{index:04X}]"
    ))
}
