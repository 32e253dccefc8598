//! `taustream cost`: the paper's cost of a motion, in the paper's own model.
use crate::args::CostArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use taustream_arm::text::counted;
use taustream_optimizers::cost::{CostError, CostModel, paper_cost};
use taustream_planner::energy::Energy;

/// The cost and its parts.
#[derive(Debug, Serialize)]
struct Answer {
    path_length_m: f64,
    joint_travel_rad: f64,
    penalty: f64,
    collision: u8,
    cost: f64,
    /// Left out for a robot that states no masses.
    #[serde(rename = "energy_J", skip_serializing_if = "Option::is_none")]
    energy_j: Option<f64>,
    /// Why that energy is too low; null where the masses may be right.
    mass_doubt: Option<String>,
    poses: usize,
    waypoints_per_segment: usize,
    expansion_m: f64,
    weights: [f64; 3],
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "path_length_m     {}", self.path_length_m)?;
        writeln!(f, "joint_travel_rad  {}", self.joint_travel_rad)?;
        writeln!(f, "penalty           {}", self.penalty)?;
        writeln!(f, "collision         {}", self.collision)?;
        writeln!(f, "cost              {}", self.cost)?;
        if let Some(energy_j) = self.energy_j {
            writeln!(f, "energy_J          {energy_j}")?;
        }
        if let Some(doubt) = &self.mass_doubt {
            writeln!(f, "WARNING           {doubt}")?;
        }
        write!(
            f,
            "({} in the model of Wang et al. (2022); `taustream verify` proves whether it may move)",
            counted(self.poses, "pose")
        )
    }
}

/// Rates and prints.
pub(crate) fn run(form: Form, args: &CostArgs) -> Result<(), Failure> {
    let model = CostModel {
        waypoints_per_segment: args.waypoints_per_segment,
        expansion_m: args.expansion_m,
        weights: args.weights.0,
        ..CostModel::default()
    };
    let path = args.motion.trajectory.path();
    let scene = arm::scene(&args.motion.scene)?;
    let (robot, file) = arm::motion_of(args.motion.robot.as_deref(), path)?;
    let cost = paper_cost(&robot, &scene, &file.trajectory, &model).map_err(|error| match error {
        CostError::Model { .. } => Failure::Usage(error.to_string()),
        CostError::NotSpheres { .. } => Failure::unfit(&scene.file, error.to_string()),
        CostError::Overlap { .. } | CostError::Joints { .. } => Failure::unfit(path, error.to_string()),
    })?;
    form.print(&Answer {
        path_length_m: cost.path_length_m,
        joint_travel_rad: cost.joint_travel_rad,
        penalty: cost.penalty,
        collision: u8::from(cost.collision),
        cost: cost.cost,
        energy_j: Energy::of(&robot).ok().map(|energy| energy.spent_j(&file.trajectory)),
        mass_doubt: robot.mass_doubt(),
        poses: cost.poses,
        waypoints_per_segment: model.waypoints_per_segment,
        expansion_m: model.expansion_m,
        weights: model.weights,
    })
}
