//! The objects in which a CiA 402 drive states its own scale, direction and range, and which of them are overruled.
//!
//! They are read before a drive is energised and compared with the settings: a drive that counts otherwise moves the
//! joint by another angle than commanded, with feedback that agrees.
use crate::document::Value;
use crate::reader::Table;

/// Object of a CiA 402 drive that is compared with the settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum ScaleObject {
    /// Position range limit: beyond it the drive's position starts again at the other end.
    PositionRange = 0x607B,
    /// Home offset: shifts the zero of the drive's positions.
    HomeOffset = 0x607C,
    /// Software position limit: beyond it the drive cuts its target off.
    SoftLimit = 0x607D,
    /// Polarity: bit 7 turns the direction of positions round.
    Polarity = 0x607E,
    /// Position encoder resolution: increments a motor revolution.
    EncoderResolution = 0x608F,
    /// Gear ratio: motor revolutions a shaft revolution.
    GearRatio = 0x6091,
    /// Feed constant: position units a shaft revolution.
    FeedConstant = 0x6092,
    /// Position factor: increments a position unit (removed in newer editions of CiA 402-2, and still in drives).
    PositionFactor = 0x6093,
}

impl ScaleObject {
    /// Every object.
    pub const ALL: [Self; 8] = [
        Self::PositionRange,
        Self::HomeOffset,
        Self::SoftLimit,
        Self::Polarity,
        Self::EncoderResolution,
        Self::GearRatio,
        Self::FeedConstant,
        Self::PositionFactor,
    ];

    /// Its index in the object dictionary.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }
    /// The object at an index.
    #[must_use]
    pub fn from_index(index: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|object| object.index() == index)
    }
    /// Its name in CiA 402.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PositionRange => "position range limit",
            Self::HomeOffset => "home offset",
            Self::SoftLimit => "software position limit",
            Self::Polarity => "polarity",
            Self::EncoderResolution => "position encoder resolution",
            Self::GearRatio => "gear ratio",
            Self::FeedConstant => "feed constant",
            Self::PositionFactor => "position factor",
        }
    }
    /// 0x607B to 0x607F are bits 11 to 15, 0x6091 to 0x6093 bits 1 to 3.
    const fn bit(self) -> u16 {
        1 << (self.index() % 16)
    }
}

/// Objects that are not compared, because the drive's are known to be wrong or to mean something else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overruled(u16);

impl Overruled {
    /// Every object is compared.
    pub const NONE: Self = Self(0);

    /// The same, with one more object.
    #[must_use]
    pub const fn with(self, object: ScaleObject) -> Self {
        Self(self.0 | object.bit())
    }
    /// Whether an object is overruled.
    #[must_use]
    pub const fn holds(self, object: ScaleObject) -> bool {
        self.0 & object.bit() != 0
    }
    /// The objects, lowest index first.
    pub fn objects(self) -> impl Iterator<Item = ScaleObject> {
        ScaleObject::ALL.into_iter().filter(move |object| self.holds(*object))
    }
}

/// Reads `overruled_objects`; `None` only after a fault.
pub(crate) fn read_overruled(table: &mut Table<'_>) -> Option<Overruled> {
    const KEY: &str = "overruled_objects";
    let Some(node) = table.take(KEY) else { return Some(Overruled::NONE) };
    let indices: Vec<String> = ScaleObject::ALL.map(|o| format!("0x{:04X} ({})", o.index(), o.name())).into();
    let expected = format!("a list, without repetition, of objects among {}", indices.join(", "));
    let Value::List(items) = &node.value else {
        table.fault(KEY, &node.to_string(), &expected);
        return None;
    };
    let mut overruled = Overruled::NONE;
    for item in items {
        let index = if let Value::Integer(index) = item.value { u16::try_from(index).ok() } else { None };
        let object = index.and_then(ScaleObject::from_index).filter(|object| !overruled.holds(*object));
        let Some(object) = object else {
            table.fault(KEY, &item.to_string(), &expected);
            return None;
        };
        overruled = overruled.with(object);
    }
    Some(overruled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overruled_objects_are_distinguished() {
        for object in ScaleObject::ALL {
            let only = Overruled::NONE.with(object);
            let fixed_joints: Vec<ScaleObject> = only.objects().collect();
            assert_eq!(fixed_joints, [object]);
            assert_eq!(ScaleObject::from_index(object.index()), Some(object));
        }
        assert_eq!(ScaleObject::from_index(0x607A), None);
    }
}
