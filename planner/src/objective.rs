//! What makes one verified motion better than another, by the names that users write.
use crate::collide::{Course, Motion};
use crate::energy::Energy;
use crate::verify::Proof;
use taustream_arm::{NoMasses, Robot};
use taustream_motion::{JointArray, Trajectory};
use taustream_optimizers::cost::CostModel;

/// What makes one verified motion better than another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Objective {
    /// It is shorter in time.
    #[default]
    Time,
    /// It is cheaper by the cost of Wang et al. (2022), whose penalty is nothing for a motion that touches nothing.
    Cost,
    /// Its joints do less work.
    Energy,
}

impl Objective {
    /// Every objective.
    pub const ALL: [Self; 3] = [Self::Time, Self::Cost, Self::Energy];

    /// The word that users write.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Cost => "cost",
            Self::Energy => "energy",
        }
    }

    /// One line for a list.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Time => "shortest in time",
            Self::Cost => "least path length of tip and joints, weighted as in Wang et al. (2022)",
            Self::Energy => "least mechanical work of the joints; needs masses in the robot file",
        }
    }

    /// The objective of a word; `None` for a word that is unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|objective| objective.name() == name)
    }
}

/// Samples of a motion's path.
const SAMPLES: u32 = 1_000;

/// Compares verified motions.
pub struct Evaluator<'a> {
    /// What counts.
    pub objective: Objective,
    robot: &'a Robot,
    energy: Result<Energy, NoMasses>,
}

impl<'a> Evaluator<'a> {
    /// Compares motions of one arm.
    ///
    /// # Errors
    /// When energy counts and the robot states no masses.
    pub fn new(objective: Objective, robot: &'a Robot) -> Result<Self, NoMasses> {
        let energy = Energy::of(robot);
        match (objective, energy) {
            (Objective::Energy, Err(none)) => Err(none),
            (_, energy) => Ok(Self { objective, robot, energy }),
        }
    }

    /// What computes energies, when energy counts.
    #[must_use]
    pub fn energy(&self) -> Option<&Energy> {
        self.energy.as_ref().ok().filter(|_| self.objective == Objective::Energy)
    }

    /// Energy of a motion in J, whatever counts; `None` without masses.
    #[must_use]
    pub fn energy_j(&self, motion: &Trajectory) -> Option<f64> {
        self.energy.as_ref().ok().map(|energy| energy.spent_j(motion))
    }

    /// Less is better.
    #[must_use]
    pub fn score(&self, motion: &Trajectory, proof: &Proof) -> f64 {
        match self.objective {
            Objective::Time => proof.duration_s,
            Objective::Cost => self.distance_cost(motion),
            Objective::Energy => self.energy_j(motion).unwrap_or(f64::INFINITY),
        }
    }

    /// The paper's cost of a path without contact: its weighted length in space and in joints.
    fn distance_cost(&self, motion: &Trajectory) -> f64 {
        let [length, travel, _] = CostModel::default().weights;
        let (course, duration_s) = (Course::new(motion), motion.duration_s());
        let at = |i: u32| course.at(duration_s * f64::from(i) / f64::from(SAMPLES));
        let frames = |q: &JointArray| self.robot.chain.frames(q);
        let mut last = at(0);
        let mut cost = 0.0;
        for i in 1..=SAMPLES {
            let here = at(i);
            let turned: f64 = here.iter().zip(&last).map(|(a, b)| (a - b).abs()).sum();
            let (here_at, last_at) = (frames(&here), frames(&last));
            let moved_m = |tip: &usize| {
                let [here, last] =
                    [here_at.get(*tip), last_at.get(*tip)].map(|f| f.copied().unwrap_or_default());
                (here.translation.vector - last.translation.vector).norm()
            };
            cost += travel * turned + length * self.robot.chain.tips().iter().map(moved_m).sum::<f64>();
            last = here;
        }
        cost
    }
}
