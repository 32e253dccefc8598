//! What a CiA 402 drive states about its own scale, direction and range, against what the settings say.
//!
//! A position unit of the drive (0x6064, 0x607A) is, by CiA 402, `encoder resolution x gear ratio / feed constant` of an
//! encoder increment; without a feed constant it is the increment itself. The settings say how many units a motor
//! revolution has (`counts_per_rev`) and how many motor revolutions the joint (`gear_ratio`). So each object that the
//! drive has must agree with the settings: one that does not would move the joint by another angle than commanded, with
//! feedback that agrees. An object that the drive does not have says nothing.
//!
//! The position factor (0x6093) is the increments of a position unit. Units that are not increments have another number of
//! them in a motor revolution than the encoder resolution says, so it must be 1 as long as that must be `counts_per_rev`.
//! The home offset (0x607C) shifts the drive's zero. When a drive applies it is its own affair: by CiA 402 at the end of
//! homing; drives with absolute encoders apply a stored one at power-up, or at once. So nothing can be computed from it,
//! and it must be what it was when the joint's zero was determined.
//!
//! Sources: CiA 402-2, "Factor group", "Position control function" and "Homing mode".
use crate::codec::cia402_words::{CountScale, counts_from_rad};
use crate::codec::object::{self, Address};
use std::f64::consts::TAU;
use taustream_arm::{Cia402, Feedback, Overruled, RobotJoint, ScaleObject, Servo};

/// Relative difference up to which two ratios are the same: a decimal fraction of the settings has its digits.
const SAME: f64 = 1e-6;
/// Rounding of a joint's end to counts, and the drive's own.
const ROUNDING_COUNTS: i64 = 1;
/// Bit of 0x607E that turns the direction of positions round.
const POLARITY_POSITION: u32 = 1 << 7;

/// What the settings say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedScale {
    /// Position units a motor revolution.
    pub counts_per_rev: f64,
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Lowest and highest target of the joint, in counts.
    pub range_counts: [i32; 2],
    /// The home offset with which the joint's zero was determined, in counts.
    pub home_offset_counts: i32,
    /// Objects that are not read.
    pub overruled: Overruled,
}

impl ExpectedScale {
    /// Of a servo and its joint; none for a servo of another protocol.
    #[must_use]
    pub fn of(servo: &Servo, joint: &RobotJoint) -> Option<Self> {
        let cia402 = servo.protocol.get::<Cia402>()?;
        let scale = CountScale::of(servo)?;
        let [low, high] = joint.limits.position_rad.map(|end_rad| counts_from_rad(&scale, end_rad));
        Some(Self {
            counts_per_rev: cia402.counts_per_rev,
            gear_ratio: cia402.gear_ratio,
            range_counts: [low.min(high), low.max(high)],
            home_offset_counts: cia402.home_offset_counts,
            overruled: overruled(servo, cia402),
        })
    }

    /// A distance of the joint in counts, at least one.
    #[must_use]
    pub fn counts_of(&self, distance_rad: f64) -> u32 {
        let exact = (distance_rad * self.gear_ratio * self.counts_per_rev / TAU).round();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let counts = exact.clamp(1.0, f64::from(u32::MAX - 1)) as u32;
        counts
    }

    /// The objects to read, in the order in which [`StatedScale`] takes them.
    pub fn addresses(self) -> impl Iterator<Item = Address> {
        let read = move |address: &Address| {
            ScaleObject::from_index(address.index).is_some_and(|object| !self.overruled.holds(object))
        };
        ADDRESSES.into_iter().filter(read)
    }
}

/// Objects that are not compared: by their owner's word, or because they are written.
fn overruled(servo: &Servo, cia402: &Cia402) -> Overruled {
    let mut overruled = cia402.overruled;
    if cia402.features.limits.soft_limits {
        overruled = overruled.with(ScaleObject::SoftLimit);
    }
    // Before its homing an incremental position means nothing, and homing writes the offset.
    if cia402.homing.is_some() && servo.feedback == Feedback::Incremental {
        overruled = overruled.with(ScaleObject::HomeOffset);
    }
    overruled
}

/// The gear ratio before the feed constant, whose meaning depends on it.
const ADDRESSES: [Address; 14] = [
    object::ENCODER_INCREMENTS,
    object::ENCODER_REVOLUTIONS,
    object::GEAR_MOTOR_REVOLUTIONS,
    object::GEAR_SHAFT_REVOLUTIONS,
    object::FEED,
    object::FEED_SHAFT_REVOLUTIONS,
    object::FACTOR_INCREMENTS,
    object::FACTOR_UNITS,
    object::HOME_OFFSET,
    object::POLARITY,
    object::SOFT_LIMIT_MIN,
    object::SOFT_LIMIT_MAX,
    object::POSITION_RANGE_MIN,
    object::POSITION_RANGE_MAX,
];

/// An object of the drive that contradicts the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contradiction {
    /// The object.
    pub object: Address,
    /// What the drive states: a ratio, counts, or the bits of the polarity; not finite for a ratio with a zero in it.
    pub stated: f64,
    /// What the settings say, alike.
    pub expected: f64,
}

/// What the drive has stated so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct StatedScale {
    /// The value of subindex 1 of the object that is being read; none when the drive does not have it.
    first: Option<u32>,
    gear_ratio: Option<f64>,
}

impl StatedScale {
    /// Takes the value of an object of [`ExpectedScale::addresses`], none where the drive does not have it.
    ///
    /// # Errors
    /// When it contradicts the settings.
    ///
    /// Real time: arithmetic only.
    pub fn take(
        &mut self,
        address: Address,
        value: Option<u32>,
        expected: &ExpectedScale,
    ) -> Result<(), Contradiction> {
        if address == object::GEAR_MOTOR_REVOLUTIONS {
            self.gear_ratio = None;
        }
        if address.sub == 1 {
            self.first = value;
            return Ok(());
        }
        let gear_ratio = expected.gear_ratio;
        match address {
            object::ENCODER_REVOLUTIONS => {
                self.ratio(object::ENCODER_INCREMENTS, value, &[expected.counts_per_rev]).map(drop)
            }
            object::GEAR_SHAFT_REVOLUTIONS => {
                self.gear_ratio = self.ratio(object::GEAR_MOTOR_REVOLUTIONS, value, &[gear_ratio])?;
                Ok(())
            }
            object::FEED_SHAFT_REVOLUTIONS => {
                // A drive that states no gear counts on its motor shaft, or has the gear built in.
                let wanted = [expected.counts_per_rev * gear_ratio, expected.counts_per_rev];
                let meant = if self.gear_ratio.is_some() { &wanted[..1] } else { &wanted[..] };
                self.ratio(object::FEED, value, meant).map(drop)
            }
            object::FACTOR_UNITS => self.ratio(object::FACTOR_INCREMENTS, value, &[1.0]).map(drop),
            object::HOME_OFFSET => match value.map(u32::cast_signed) {
                Some(stated) if stated != expected.home_offset_counts => Err(Contradiction {
                    object: address,
                    stated: f64::from(stated),
                    expected: f64::from(expected.home_offset_counts),
                }),
                Some(_) | None => Ok(()),
            },
            object::POLARITY => match value {
                Some(bits) if bits & POLARITY_POSITION != 0 => {
                    Err(Contradiction { object: address, stated: f64::from(bits), expected: 0.0 })
                }
                Some(_) | None => Ok(()),
            },
            object::SOFT_LIMIT_MAX | object::POSITION_RANGE_MAX => {
                self.limits(address, value, expected.range_counts)
            }
            _ => Ok(()),
        }
    }

    /// The ratio of both subindices, if the drive has it and it is one of those expected; the first of them is shown.
    fn ratio(
        &self,
        object: Address,
        second: Option<u32>,
        expected: &[f64],
    ) -> Result<Option<f64>, Contradiction> {
        let Some(first) = self.first else { return Ok(None) };
        // Without the second subindex the first stands for itself.
        let second = second.unwrap_or(1);
        let stated = f64::from(first) / f64::from(second);
        let same = |wanted: &f64| (stated - wanted).abs() <= SAME * wanted;
        if expected.iter().any(same) {
            return Ok(Some(stated));
        }
        Err(Contradiction { object, stated, expected: expected.first().copied().unwrap_or(f64::NAN) })
    }

    /// Limits hold the joint's whole range, or are switched off: both zero (so the drives' manuals).
    fn limits(&self, max: Address, high: Option<u32>, range: [i32; 2]) -> Result<(), Contradiction> {
        let low = self.first.map(u32::cast_signed);
        let high = high.map(u32::cast_signed);
        if low.unwrap_or(0) == 0 && high.unwrap_or(0) == 0 {
            return Ok(());
        }
        let min = Address::new(max.index, 1);
        let at = |object, stated: i32, expected: i32| Contradiction {
            object,
            stated: f64::from(stated),
            expected: f64::from(expected),
        };
        let beyond = |a: i32, b: i32| i64::from(a) - i64::from(b) > ROUNDING_COUNTS;
        match (low, high) {
            (Some(low), _) if beyond(low, range[0]) => Err(at(min, low, range[0])),
            (_, Some(high)) if beyond(range[1], high) => Err(at(max, high, range[1])),
            _ => Ok(()),
        }
    }
}

/// What a contradiction means and what to do, by the packed address of its object; `None` for any other object.
#[must_use]
pub fn sentence(packed: u32, stated: f64, expected: f64) -> Option<String> {
    let (index, sub) = (u16::try_from(packed >> 8).ok()?, packed & 0xFF);
    let object = ScaleObject::from_index(index)?;
    let name = object.name();
    let overrule = format!(
        "or, if the settings are right and the object is not, state overruled_objects = [0x{index:04X}] for this servo"
    );
    let ratio = |what: &str, keys: &str| {
        if !stated.is_normal() {
            return format!(
                "object 0x{index:04X} ({name}) of the drive has a zero in it, so it states no ratio, and the settings say \
                 {expected} {what} ({keys}); set it in the drive and save it, {overrule}"
            );
        }
        format!(
            "object 0x{index:04X} ({name}) of the drive says {stated} {what}, the settings say {expected} ({keys}): the joint \
             would move by {:.6} times the commanded angle; correct the one that is wrong, {overrule}",
            expected / stated
        )
    };
    Some(match object {
        ScaleObject::EncoderResolution => ratio("increments a motor revolution", "counts_per_rev"),
        ScaleObject::GearRatio => ratio("motor revolutions a shaft revolution", "gear_ratio"),
        ScaleObject::FeedConstant => {
            ratio("position units a shaft revolution", "counts_per_rev x gear_ratio")
        }
        ScaleObject::PositionFactor if stated.is_normal() => format!(
            "object 0x{index:04X} ({name}) of the drive says {stated} increments a position unit, and by the settings a unit is \
             an increment, with counts_per_rev of them in a motor revolution: the joint would move by {stated:.6} times the \
             commanded angle; set it to 1 in the drive and save it, {overrule}"
        ),
        ScaleObject::PositionFactor => ratio("increments a position unit", "a unit is an increment"),
        ScaleObject::HomeOffset => format!(
            "object 0x{index:04X} ({name}) of the drive is {stated} counts, and zero_offset_rad belongs to {expected} \
             (home_offset_counts): the drive's zero may have been shifted by the difference; compare the joint's angle with \
             the arm, then correct zero_offset_rad and state home_offset_counts = {stated}, or set the object back and save \
             it, {overrule}"
        ),
        ScaleObject::Polarity => format!(
            "object 0x{index:04X} ({name}) of the drive is {stated}: bit 7 turns the direction of its positions round, and the \
             settings expect 0, with the direction in `sign`; clear the bit in the drive and save it, {overrule}"
        ),
        ScaleObject::SoftLimit | ScaleObject::PositionRange => {
            let (end, than) = if sub == 1 { ("lowest", "most") } else { ("highest", "least") };
            let effect = if object == ScaleObject::SoftLimit {
                "the drive would cut targets off there without a word"
            } else {
                "the drive's position would start again at the other end there"
            };
            format!(
                "object 0x{index:04X}:{sub:02} ({name}, {end}) of the drive is {stated} counts, inside the joint's range, which \
                 needs at {than} {expected} counts: {effect}; widen it in the drive and save it (0 and 0 switch it off), narrow \
                 the joint's position_rad, {overrule}"
            )
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXPECTED: ExpectedScale = ExpectedScale {
        counts_per_rev: 131_072.0,
        gear_ratio: 101.0,
        range_counts: [-6_000_000, 6_000_000],
        home_offset_counts: -500,
        overruled: Overruled::NONE,
    };

    /// Gives a drive's objects to the comparison, those that are not listed as absent.
    fn compare(has: &[(u16, u8, u32)]) -> Result<(), Contradiction> {
        let mut stated = StatedScale::default();
        EXPECTED.addresses().try_for_each(|address| {
            let value = has.iter().find(|(index, sub, _)| (*index, *sub) == (address.index, address.sub));
            stated.take(address, value.map(|(.., value)| *value), &EXPECTED)
        })
    }

    #[test]
    fn drives_that_agree_or_have_no_such_objects_are_taken() {
        let fits: [&[(u16, u8, u32)]; 11] = [
            &[],
            &[(0x608F, 1, 131_072), (0x608F, 2, 1)],
            &[(0x608F, 1, 262_144), (0x608F, 2, 2), (0x6091, 1, 202), (0x6091, 2, 2)],
            &[(0x6091, 1, 101), (0x6091, 2, 1), (0x6092, 1, 131_072 * 101), (0x6092, 2, 1)],
            // Without a gear of its own the drive's shaft is the motor's.
            &[(0x6092, 1, 131_072), (0x6092, 2, 1)],
            &[(0x608F, 1, 131_072)],
            // Bit 6 concerns velocities alone.
            &[(0x607E, 0, 0x40)],
            &[(0x607D, 1, 0), (0x607D, 2, 0), (0x607B, 1, 0), (0x607B, 2, 0)],
            &[(0x6093, 1, 7), (0x6093, 2, 7)],
            &[(0x607C, 0, (-500_i32).cast_unsigned())],
            &[(0x607D, 1, (-6_000_000_i32).cast_unsigned()), (0x607D, 2, 6_000_000)],
        ];
        for has in fits {
            assert_eq!(compare(has), Ok(()), "{has:X?}");
        }
    }

    /// Objects of the drive, and the object that is named.
    type Case<'c> = (&'c [(u16, u8, u32)], (u16, u8));

    #[test]
    fn drives_that_contradict_the_settings_are_refused_by_object_and_numbers() {
        let minus = |counts: i32| (-counts).cast_unsigned();
        let cases: [Case<'_>; 18] = [
            (&[(0x608F, 1, 65_536), (0x608F, 2, 1)], (0x608F, 1)),
            (&[(0x608F, 1, 131_072), (0x608F, 2, 4)], (0x608F, 1)),
            (&[(0x608F, 1, 131_072), (0x608F, 2, 0)], (0x608F, 1)),
            (&[(0x608F, 1, 0), (0x608F, 2, 0)], (0x608F, 1)),
            (&[(0x6091, 1, 50), (0x6091, 2, 1)], (0x6091, 1)),
            (&[(0x6091, 1, 1), (0x6091, 2, 1)], (0x6091, 1)),
            (&[(0x6092, 1, 360_000), (0x6092, 2, 1)], (0x6092, 1)),
            // With the gear in the drive, its shaft is the link's.
            (&[(0x6091, 1, 101), (0x6091, 2, 1), (0x6092, 1, 131_072), (0x6092, 2, 1)], (0x6092, 1)),
            (&[(0x6093, 1, 2), (0x6093, 2, 1)], (0x6093, 1)),
            (&[(0x6093, 1, 131_072), (0x6093, 2, 360_000)], (0x6093, 1)),
            (&[(0x6093, 1, 0), (0x6093, 2, 1)], (0x6093, 1)),
            (&[(0x607C, 0, 0)], (0x607C, 0)),
            (&[(0x607C, 0, 500)], (0x607C, 0)),
            (&[(0x607C, 0, minus(501))], (0x607C, 0)),
            (&[(0x607E, 0, 0x80)], (0x607E, 0)),
            (&[(0x607D, 1, minus(5_999_998)), (0x607D, 2, 6_000_000)], (0x607D, 1)),
            (&[(0x607D, 1, minus(6_000_000)), (0x607D, 2, 0)], (0x607D, 2)),
            (&[(0x607B, 1, 0), (0x607B, 2, 131_071)], (0x607B, 1)),
        ];
        for (has, (index, sub)) in cases {
            let found = compare(has).unwrap_err();
            assert_eq!(found.object, Address::new(index, sub), "{has:X?}");
            let words = sentence(found.object.packed(), found.stated, found.expected).unwrap();
            for part in [format!("0x{index:04X}"), format!("overruled_objects = [0x{index:04X}]")] {
                assert!(words.contains(&part), "no {part} in: {words}");
            }
            if found.stated.is_normal() {
                assert!(words.contains(&found.stated.to_string()), "{words}");
            }
            assert!(words.contains(&found.expected.to_string()), "{words}");
        }
    }

    #[test]
    fn overruled_objects_are_not_read() {
        let expected = ExpectedScale { overruled: Overruled::NONE.with(ScaleObject::GearRatio), ..EXPECTED };
        assert!(expected.addresses().all(|address| address.index != 0x6091));
        assert_eq!(expected.addresses().count(), ADDRESSES.len() - 2);
    }

    /// A gear ratio of a drive that was looked at before says nothing about the one that stands there now.
    #[test]
    fn second_look_forgets_the_gear_of_the_first() {
        let mut stated = StatedScale::default();
        let give = |stated: &mut StatedScale, has: [Option<u32>; 4]| {
            let at = [
                object::GEAR_MOTOR_REVOLUTIONS,
                object::GEAR_SHAFT_REVOLUTIONS,
                object::FEED,
                object::FEED_SHAFT_REVOLUTIONS,
            ];
            at.into_iter().zip(has).try_for_each(|(address, value)| stated.take(address, value, &EXPECTED))
        };
        assert!(give(&mut stated, [Some(101), Some(1), Some(131_072), Some(1)]).is_err());
        assert!(give(&mut stated, [None, None, Some(131_072), Some(1)]).is_ok());
    }
}
