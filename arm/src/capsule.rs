//! Capsules as a robot file states them: the shape of a link, in the frame of its row.
use crate::reader::{Bounds, Table};
use crate::robot::LinkShape;
use crate::scene::Shape;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use taustream_motion::chain::Pose;

/// A capsule by the ends of its axis; equal ends make a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Capsule {
    pub(crate) from_m: [f64; 3],
    pub(crate) to_m: [f64; 3],
    pub(crate) radius_m: f64,
}

/// Most capsules of one link: every pair of two links' capsules is looked at.
const CAPSULES_MAX: usize = 8;
/// Arms of this project reach a few metres; more is a slip of the unit (millimetres).
const END_M: Bounds = Bounds::within(-10.0, 10.0, "m");
const RADIUS_M: Bounds = Bounds::above(0.0, 1.0, "m");

impl Capsule {
    /// Takes a list of capsules; none when the key is absent, `None` after a fault.
    pub(crate) fn read_list(table: &mut Table<'_>, key: &'static str) -> Option<Vec<Self>> {
        let is_there = table.has(key);
        let tables = table.tables(key);
        if is_there && !(1..=CAPSULES_MAX).contains(&tables.len()) {
            let expected = format!(
                "1 to {CAPSULES_MAX} capsules [{{ from_m = [x, y, z], to_m = [x, y, z], radius_m = r }}] in the frame of the link"
            );
            table.fault(key, &format!("{} capsules", tables.len()), &expected);
            return None;
        }
        let capsules: Vec<Option<Self>> = tables.into_iter().map(Self::read).collect();
        capsules.into_iter().collect()
    }

    fn read(mut table: Table<'_>) -> Option<Self> {
        let from_m = table.numbers("from_m", &END_M);
        let to_m = table.numbers("to_m", &END_M);
        let radius_m = table.number("radius_m", &RADIUS_M);
        table.done();
        Some(Self { from_m: from_m?, to_m: to_m?, radius_m: radius_m? })
    }

    /// The shape of link `link`, which is rigid with the frame of that index.
    pub(crate) fn shape(&self, link: usize) -> LinkShape {
        segment_shape(link, (Vector3::from(self.from_m), Vector3::from(self.to_m)), self.radius_m)
    }
}

/// The capsule about a segment in the frame of a link; a ball where the ends are equal.
pub(crate) fn segment_shape(
    link: usize,
    (from, to): (Vector3<f64>, Vector3<f64>),
    radius_m: f64,
) -> LinkShape {
    let along = to - from;
    let length_m = along.norm();
    let shape =
        if length_m > 0.0 { Shape::Capsule { radius_m, length_m } } else { Shape::Sphere { radius_m } };
    let pose = Pose::from_parts(Translation3::from(0.5 * (from + to)), rotation_z_to(&along));
    LinkShape { link, frame: link, pose, shape }
}

/// A rotation that takes local z to a direction; none is needed for a zero vector.
fn rotation_z_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    // There is no unique axis when the direction is opposite to z; any half turn about x or y will do.
    UnitQuaternion::rotation_between(&Vector3::z(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}
