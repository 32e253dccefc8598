//! Methods in the same scenes, run by run with the same first population.
use super::course::{Course, follow};
use super::{case_within, refused, ur5};
use crate::run_context::{RunContext, Stop};
use taustream_optimizers::Optimizer;
use taustream_optimizers::cost::CostModel;
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Centres};

/// Where they meet.
pub(super) struct Meeting {
    /// What is minimised.
    pub(super) model: CostModel,
    /// By which a scene counts as left free of collision.
    pub(super) fair: CostModel,
    /// Box of the spheres' centres (m).
    pub(super) centres_m: Centres,
    /// How many scenes.
    pub(super) runs: usize,
    /// Most evaluations.
    pub(super) budget: usize,
}

/// What came of it.
pub(super) struct Field {
    /// Method by method, run by run.
    pub(super) courses: Vec<Vec<Course>>,
    /// Cost of the straight line of each run, and whether it is free.
    pub(super) straight: Vec<(f64, bool)>,
    /// Method by method, run by run: whether its best collides by the least distance.
    pub(super) collides: Vec<Vec<bool>>,
}

impl Meeting {
    /// All runs of one method.
    pub(super) fn courses(
        &self,
        run_context: &RunContext,
        make: &(dyn Fn() -> Box<dyn Optimizer> + Sync),
    ) -> Result<Vec<Course>, Stop> {
        let robot = ur5()?;
        run_context.each(self.runs, |run| {
            let case = case_within(run_context, &robot, &self.centres_m, run)?;
            let problem = case.problem(&robot, CONTROL_POINTS, self.model).map_err(refused)?;
            follow(run_context, make().as_ref(), &problem, run_context.seed(run), self.budget)
        })
    }

    /// What is free is decided by the least distance, whatever was optimised.
    pub(super) fn field(&self, run_context: &RunContext, courses: Vec<Vec<Course>>) -> Result<Field, Stop> {
        let robot = ur5()?;
        let mut field = Field { collides: vec![Vec::new(); courses.len()], courses, straight: Vec::new() };
        for run in 0..self.runs {
            let case = case_within(run_context, &robot, &self.centres_m, run)?;
            let problem = case.problem(&robot, CONTROL_POINTS, self.fair).map_err(refused)?;
            let straight = problem.straight();
            let rated = problem.rate_exactly(&straight);
            field.straight.push(rated.map_or((f64::NAN, false), |c| (c.cost, !c.collision)));
            for (collides, courses) in field.collides.iter_mut().zip(&field.courses) {
                let rated = courses.get(run).and_then(|c| problem.rate_exactly(&c.found.x));
                collides.push(rated.is_none_or(|c| c.collision));
            }
        }
        Ok(field)
    }
}
