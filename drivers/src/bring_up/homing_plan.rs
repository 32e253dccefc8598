//! What is written into a drive before it homes itself, and how long that may take.
use crate::bring_up::plan::NodePlan;
use crate::bring_up::timing::nanos;
use crate::codec::object::{self, Address};
use crate::codec::sdo::SdoBytes;
use crate::servo::Nanos;
use taustream_arm::{HomingSettings, OptionalObject};

/// A joint that moves less than this within a tenth of a second stands.
const STILL_RAD: f64 = 0.001;
/// Objects that are written at most.
const PARAMETERS_MAX: usize = 5;

/// What a drive needs for its homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingPlan {
    /// Objects that are written, and read back.
    pub(super) parameters: [Option<(Address, SdoBytes)>; PARAMETERS_MAX],
    pub(super) timeout: Nanos,
    /// The joint moves.
    pub(super) moves: bool,
    /// Movement within a tenth of a second that is rest, in counts.
    pub(super) still_counts: u32,
}

impl HomingPlan {
    /// Of the settings; `None` where they have no homing.
    #[must_use]
    pub fn of(homing: &HomingSettings, plan: &NodePlan) -> Self {
        let scale = &plan.scale;
        let unit = |value: f64| {
            let exact = homing.velocity_unit.of_rad_s(value, scale.gear_ratio, scale.counts_per_rev).round();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let whole = exact.clamp(1.0, f64::from(u32::MAX)) as u32;
            SdoBytes::from_u32(whole)
        };
        let all = [
            (OptionalObject::HomeOffset, object::HOME_OFFSET, SdoBytes::from_i32(scale.home_offset_counts)),
            (OptionalObject::HomingMethod, object::HOMING_METHOD, SdoBytes::from_i8(homing.method)),
            (OptionalObject::HomingSpeeds, object::HOMING_SWITCH_SPEED, unit(homing.switch_speed_rad_s)),
            (OptionalObject::HomingSpeeds, object::HOMING_ZERO_SPEED, unit(homing.zero_speed_rad_s)),
            (
                OptionalObject::HomingAcceleration,
                object::HOMING_ACCELERATION,
                unit(homing.acceleration_rad_s2),
            ),
        ];
        let absent = plan.features.absent;
        Self {
            parameters: all.map(|(of, address, bytes)| (!absent.holds(of)).then_some((address, bytes))),
            timeout: nanos(homing.timeout_s).unwrap_or(Nanos(0)),
            moves: homing.moves(),
            still_counts: scale.counts_of(STILL_RAD),
        }
    }
}
