//! Point clouds for the planner's scene (request-response): what a camera saw, as one obstacle.
use crate::LAYOUT_VERSION;
use crate::scene::{ObjectPose, What, WireName};
use iceoryx2::prelude::ZeroCopySend;

/// Most points of a message; a larger cloud goes in several, each with a name of its own.
pub const CLOUD_POINTS_MAX: usize = 16_384;
/// Largest radius of the ball around a point.
const RADIUS_M_MAX: f64 = 1.0;

/// A cloud on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct CloudRequest {
    layout_version: u32,
    count: u32,
    replaces: u32,
    name: WireName,
    reserved: u32,
    position_m: [f64; 3],
    quaternion_xyzw: [f64; 4],
    point_radius_m: f64,
    points_m: [[f32; 3]; CLOUD_POINTS_MAX],
}

/// A cloud, read.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedCloud {
    /// Its name in the scene.
    pub name: String,
    /// Where the points' frame is, in the frame of the base.
    pub pose: ObjectPose,
    /// Radius of the ball around each point.
    pub point_radius_m: f64,
    /// Points in their frame, up to [`CLOUD_POINTS_MAX`]; those that are not finite are places without a measurement.
    pub points_m: Vec<[f64; 3]>,
    /// True to take the place of an object of this name, false to refuse if there is one.
    pub replaces: bool,
}

/// Why a cloud is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CloudRequestError {
    /// Another release.
    #[error("layout version {got}, expected {LAYOUT_VERSION}; use programs of one release")]
    Layout {
        /// The version in the message.
        got: u32,
    },
    /// No points, or more than fit.
    #[error("{got} points; a message has 1 to {CLOUD_POINTS_MAX}; send a larger cloud as several objects")]
    Count {
        /// The count in the message.
        got: u32,
    },
    /// The balls have no size, or one that fills the room.
    #[error("point radius {value_m} m; above 0 and up to {RADIUS_M_MAX} m")]
    Radius {
        /// The radius.
        value_m: f64,
    },
    /// Name or pose.
    #[error("cloud: {0}")]
    Object(What),
}

impl CloudRequest {
    /// A cloud as a message, in the heap: it has some 200 kB. Points beyond [`CLOUD_POINTS_MAX`] are counted and not carried, so that the
    /// reader refuses them.
    #[must_use]
    pub fn new(cloud: &CheckedCloud) -> Box<Self> {
        let mut request = Box::new(Self {
            layout_version: LAYOUT_VERSION,
            count: u32::try_from(cloud.points_m.len()).unwrap_or(u32::MAX),
            replaces: u32::from(cloud.replaces),
            name: WireName::new(&cloud.name),
            reserved: 0,
            position_m: cloud.pose.position_m,
            quaternion_xyzw: cloud.pose.quaternion_xyzw,
            point_radius_m: cloud.point_radius_m,
            points_m: [[0.0; 3]; CLOUD_POINTS_MAX],
        });
        for (slot, point) in request.points_m.iter_mut().zip(&cloud.points_m) {
            #[expect(clippy::cast_possible_truncation, reason = "cameras measure no finer")]
            let point = point.map(|x| x as f32);
            *slot = point;
        }
        request
    }
}

impl TryFrom<&CloudRequest> for CheckedCloud {
    type Error = CloudRequestError;

    /// Takes every field once before it is checked, so that the message itself can be handed over: a copy of it is much for a stack.
    fn try_from(r: &CloudRequest) -> Result<Self, CloudRequestError> {
        let &CloudRequest { layout_version, count: got, replaces, name, .. } = r;
        let &CloudRequest { position_m, quaternion_xyzw, point_radius_m: value_m, .. } = r;
        if layout_version != LAYOUT_VERSION {
            return Err(CloudRequestError::Layout { got: layout_version });
        }
        let count = usize::try_from(got).unwrap_or(usize::MAX);
        let points = r.points_m.get(..count).filter(|points| !points.is_empty());
        let points = points.ok_or(CloudRequestError::Count { got })?;
        if !(value_m > 0.0 && value_m <= RADIUS_M_MAX) {
            return Err(CloudRequestError::Radius { value_m });
        }
        let name = name.read().ok_or(CloudRequestError::Object(What::Name))?;
        let pose = ObjectPose { position_m, quaternion_xyzw };
        Ok(Self {
            name,
            pose: pose.check().map_err(CloudRequestError::Object)?,
            point_radius_m: value_m,
            points_m: points.iter().map(|point| point.map(f64::from)).collect(),
            replaces: replaces == 1,
        })
    }
}

const _: () = assert!(size_of::<CloudRequest>() == 84 + 4 + 64 + 12 * CLOUD_POINTS_MAX);

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> CheckedCloud {
        CheckedCloud {
            name: "bin".to_owned(),
            pose: ObjectPose { position_m: [0.5, 0.0, 0.1], quaternion_xyzw: [0.0, 0.0, 0.0, 1.0] },
            point_radius_m: 0.005,
            points_m: vec![[0.5, -0.25, 1.0], [0.0; 3]],
            replaces: true,
        }
    }

    #[test]
    fn cloud_comes_back_from_its_message() {
        assert_eq!(CheckedCloud::try_from(&*CloudRequest::new(&cloud())), Ok(cloud()));
    }

    #[test]
    fn hostile_clouds_are_refused_by_name() {
        let refused = |doctor: fn(&mut CloudRequest)| {
            let mut request = CloudRequest::new(&cloud());
            doctor(&mut request);
            CheckedCloud::try_from(&*request).expect_err("refused").to_string()
        };
        assert!(refused(|r| r.layout_version = 1).contains("expected"));
        assert!(refused(|r| r.count = 0).contains("0 points"));
        assert!(refused(|r| r.count = u32::MAX).contains("4294967295 points"));
        assert!(refused(|r| r.point_radius_m = f64::NAN).contains("NaN"));
        assert!(refused(|r| r.name = WireName::new("a b")).contains("name"));
        assert!(refused(|r| r.quaternion_xyzw = [0.0; 4]).contains("quaternion"));
        assert!(refused(|r| r.position_m[1] = f64::INFINITY).contains("inf"));
    }
}
