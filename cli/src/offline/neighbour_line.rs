//! Another arm in the room, as `taustream check` prints it.
use serde::Serialize;
use std::fmt;
use taustream_arm::neighbour::words;
use taustream_arm::{Neighbour, Scene, Settings};
use taustream_planner::world::World;

/// One neighbour.
#[derive(Debug, Serialize)]
pub(crate) struct NeighbourLine {
    name: String,
    file: String,
    robot: String,
    position_m: [f64; 3],
    quaternion_xyzw: [f64; 4],
    margin_m: f64,
    tracking_error_rad_max: f64,
    /// How far one joint at its largest tracking error leads a point of the arm off its path.
    off_m_max: f64,
    #[serde(skip)]
    base: String,
}

impl NeighbourLine {
    pub(crate) fn all(settings: &Settings) -> Vec<Self> {
        settings.neighbours.iter().map(Self::of).collect()
    }

    fn of(neighbour: &Neighbour) -> Self {
        let Neighbour { name, file, robot, base, margin_m, tracking_error_rad_max, .. } = neighbour;
        let reach_m = World::new(robot, &Scene::default())
            .map_or(f64::INFINITY, |world| world.reach_m().iter().copied().fold(0.0, f64::max));
        Self {
            name: name.clone(),
            file: file.display().to_string(),
            robot: robot.name.clone(),
            position_m: base.translation.vector.into(),
            quaternion_xyzw: base.rotation.coords.into(),
            margin_m: *margin_m,
            tracking_error_rad_max: *tracking_error_rad_max,
            off_m_max: reach_m * tracking_error_rad_max,
            base: words(base),
        }
    }
}

impl fmt::Display for NeighbourLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, file, robot, base, margin_m, tracking_error_rad_max, off_m_max, .. } = self;
        write!(
            f,
            "  neighbour {name} ({file}, robot {robot}): base at {base}; plans keep {margin_m} m from where it is and may come to. \
             One joint at its tracking_error_rad_max of {tracking_error_rad_max} rad is up to {off_m_max:.3} m off its path"
        )
    }
}
