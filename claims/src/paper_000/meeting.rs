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
    /// Most evaluations.
    pub(super) budget: usize,
}

/// What came of it. A method may have met fewer scenes than another.
pub(super) struct Field {
    /// Method by method, run by run.
    pub(super) courses: Vec<Vec<Course>>,
    /// Cost of the straight line of each run, and whether it is free.
    pub(super) straight: Vec<(f64, bool)>,
    /// Method by method, run by run: whether its best collides by the least distance.
    pub(super) collides: Vec<Vec<bool>>,
}

impl Field {
    /// Nothing yet, of so many methods.
    pub(super) fn new(methods: usize) -> Self {
        Self {
            courses: (0..methods).map(|_| Vec::new()).collect(),
            straight: Vec::new(),
            collides: vec![Vec::new(); methods],
        }
    }
}

impl Meeting {
    /// Runs one method in every scene below `runs` that it has not met. What is free is decided by the least distance,
    /// whatever was optimised.
    pub(super) fn run(
        &self,
        run_context: &RunContext,
        (field, method): (&mut Field, usize),
        make: &(dyn Fn() -> Box<dyn Optimizer> + Sync),
        runs: usize,
    ) -> Result<(), Stop> {
        let robot = ur5()?;
        let (Some(courses), Some(collides)) = (field.courses.get_mut(method), field.collides.get_mut(method))
        else {
            return Ok(());
        };
        run_context.up_to(runs, courses, |run| {
            let case = case_within(run_context, &robot, &self.centres_m, run)?;
            let problem = case.problem(&robot, CONTROL_POINTS, self.model).map_err(refused)?;
            follow(run_context, make().as_ref(), &problem, run_context.seed(run), self.budget)
        })?;
        for (run, course) in courses.iter().enumerate().skip(collides.len()) {
            let case = case_within(run_context, &robot, &self.centres_m, run)?;
            let problem = case.problem(&robot, CONTROL_POINTS, self.fair).map_err(refused)?;
            collides.push(problem.rate_exactly(&course.found.x).is_none_or(|c| c.collision));
            if run == field.straight.len() {
                let rated = problem.rate_exactly(&problem.straight());
                field.straight.push(rated.map_or((f64::NAN, false), |c| (c.cost, !c.collision)));
            }
        }
        Ok(())
    }
}
