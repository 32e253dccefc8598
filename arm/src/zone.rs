//! A zone of a scene: a box in which the tips of the arm have a speed limit. It is no obstacle.
use crate::reader::{Bounds, Table};
use crate::scene::{CENTER_M, RPY_RAD, SIZE_M, pose};
use nalgebra::{Point3, Vector3};
use taustream_motion::chain::Pose;

/// A speed limit of every tip inside a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    /// Its name, for messages.
    pub name: String,
    /// Pose of the box's centre in the base frame.
    pub pose: Pose,
    /// Full edge lengths.
    pub size_m: [f64; 3],
    /// Highest speed of a tip's origin inside.
    pub speed_m_s: f64,
}

/// Most zones in a scene.
pub const ZONES_MAX: usize = 64;

/// Slower motions would last for hours.
const SPEED_M_S: Bounds = Bounds::within(1e-4, 100.0, "m/s");

impl Zone {
    /// Distance of a point to the box, m: 0 inside.
    #[must_use]
    pub fn distance_m(&self, point_m: &Vector3<f64>) -> f64 {
        let local = self.pose.inverse_transform_point(&Point3::from(*point_m));
        let beyond = |axis: usize| (local[axis].abs() - 0.5 * self.size_m[axis]).max(0.0);
        Vector3::from_fn(|axis, _| beyond(axis)).norm()
    }
}

/// Reads a `[[zone]]` table.
pub(crate) fn read_zone(mut table: Table<'_>, default_name: String) -> Option<Zone> {
    let name = table.name_or("name", default_name);
    let center_m = table.numbers::<3>("center_m", &CENTER_M);
    let rpy_rad = table.numbers_or("rpy_rad", [0.0; 3], &RPY_RAD);
    let size_m = table.numbers("size_m", &SIZE_M);
    let speed_m_s = table.number("speed_m_s", &SPEED_M_S);
    table.done();
    let pose = pose(center_m?, rpy_rad?);
    Some(Zone { name: name?, pose, size_m: size_m?, speed_m_s: speed_m_s? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use std::path::Path;

    #[test]
    fn zones_are_read_and_bad_ones_are_refused_with_their_key() {
        let text = "[[zone]]\nname = \"bench\"\ncenter_m = [0.5, 0, 0.2]\nsize_m = [0.4, 0.6, 0.2]\nspeed_m_s = 0.1\n\
                    rpy_rad = [0, 0, 1.5707963267948966]\n";
        let scene = Scene::from_toml(Path::new("s.toml"), text).unwrap();
        let [zone] = scene.zones.as_slice() else { panic!("{:?}", scene.zones) };
        assert_eq!((zone.name.as_str(), zone.speed_m_s.to_bits()), ("bench", 0.1_f64.to_bits()));
        // Turned by a quarter: 0.6 m along x now.
        for (point, expected) in [
            ([0.79, 0.0, 0.2], 0.0),
            ([0.9, 0.0, 0.2], 0.1),
            ([0.5, 0.5, 0.2], 0.3),
            ([0.83, 0.24, 0.2], 0.05),
        ] {
            assert!((zone.distance_m(&Vector3::from(point)) - expected).abs() < 1e-12, "{point:?}");
        }
        for (from, to, key) in [
            ("speed_m_s = 0.1", "speed_m_s = 0", "speed_m_s"),
            ("speed_m_s = 0.1", "speed_m_s = nan", "speed_m_s"),
            ("size_m = [0.4, 0.6, 0.2]", "size_m = [0.4, 0, 0.2]", "size_m"),
            ("speed_m_s = 0.1", "speed_m_s = 0.1\nlimit = 1", "limit"),
        ] {
            let error =
                Scene::from_toml(Path::new("s.toml"), &text.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains("zone[0]") && error.contains(key), "{error}");
        }
    }
}
