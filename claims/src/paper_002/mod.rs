//! Abdi et al. (2020): robots in the plane, their traps, and virtual obstacles as an escape.
pub(crate) mod journeys;
mod pictures;
pub(crate) mod robots;
pub(crate) mod sweep;

use crate::run_context::{RunContext, Stop};
use taustream_optimizers::Reading;
use taustream_optimizers::papers::planar::{
    Journey, Numbers, Obstacle, PlanarDrive, PlanarScene, Rule, drive,
};

/// Runs of everything; the paper shows one of each.
const RUNS: usize = 30;
const QUICK: usize = 4;
/// Steps until a journey is given up; the straight line takes about 95.
const STEPS_MAX: usize = 4_000;
const STEPS_QUICK: usize = 1_500;

/// What a robot goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    Field,
    Plain,
    Robust,
    RobustPrinted,
}

impl Method {
    const ALL: [Self; 4] = [Self::Field, Self::Plain, Self::Robust, Self::RobustPrinted];

    fn name(self) -> &'static str {
        match self {
            Self::Field => "potential field",
            Self::Plain => "BFO",
            Self::Robust => "RBF, corrected",
            Self::RobustPrinted => "RBF, eq. 15 as printed",
        }
    }

    fn rule(self) -> Rule {
        match self {
            Self::Field => Rule::Potential,
            Self::Plain => Rule::Bacteria,
            Self::Robust | Self::RobustPrinted => Rule::RobustBacteria,
        }
    }

    fn reading(self) -> Reading {
        if self == Self::RobustPrinted { Reading::Printed } else { Reading::Corrected }
    }

    /// The journeys of all runs. A field has nothing random: one run says it all.
    fn journeys(
        self,
        run_context: &RunContext,
        scene: &PlanarScene,
        shared: bool,
    ) -> Result<Vec<Journey>, Stop> {
        let steps_max = run_context.choose(STEPS_MAX, STEPS_QUICK);
        let numbers = Numbers { steps_max, ..Numbers::OURS };
        self.drive(run_context, (scene, shared), numbers, run_context.runs(RUNS, QUICK))
    }

    /// The same with other numbers; robots share their virtual obstacles.
    fn journeys_with(
        self,
        run_context: &RunContext,
        scene: &PlanarScene,
        numbers: Numbers,
        runs: usize,
    ) -> Result<Vec<Journey>, Stop> {
        self.drive(run_context, (scene, true), numbers, runs)
    }

    fn drive(
        self,
        run_context: &RunContext,
        (scene, shared): (&PlanarScene, bool),
        numbers: Numbers,
        runs: usize,
    ) -> Result<Vec<Journey>, Stop> {
        let runs = if self == Self::Field { 1 } else { runs };
        let numbers = Numbers { reading: self.reading(), ..numbers };
        let go = |seed| Ok(drive(scene, &PlanarDrive { rule: self.rule(), numbers, shared, seed })?);
        run_context.each(runs, |run| go(run_context.seed(run)))
    }
}

/// What the paper leaves open, for the report.
fn ours() -> String {
    let n = Numbers::OURS;
    let ([ho, wo], [hg, wg], [ha, wa]) = (n.obstacle, n.goal, n.virtual_obstacle);
    format!(
        "{} bacteria, steps of {} cm, clearance {} cm, H_o = {ho}, W_o = {wo}, H_g = {hg}, W_g = {wg}, H_add = {ha}, \
         W_add = {wa}, d_min = {} cm, dis = {} cm, k = {}; every size of an obstacle; at most {} virtual obstacles",
        n.bacteria, n.step_cm, n.clearance_cm, n.arrived_cm, n.retreat_cm, n.observed, n.virtual_max
    )
}

/// The paper's scenes, and the two that it calls hopeless.
fn scenes() -> Vec<PlanarScene> {
    let room = [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0], [-20.0, -20.0]];
    let cup = [[-15.0, -4.0], [-15.0, 5.0], [15.0, 5.0], [15.0, -4.0]];
    let alone = |name, start, corners: &[[f64; 2]]| PlanarScene {
        name,
        robots: vec![[start, [0.0, 90.0]]],
        obstacles: vec![Obstacle::walls(corners)],
    };
    let mut scenes = PlanarScene::paper_002();
    let on_the_line = |name, off_cm| PlanarScene {
        name,
        robots: vec![[[off_cm, -90.0], [0.0, 90.0]]],
        obstacles: vec![Obstacle::disc([0.0, 0.0], 9.5)],
    };
    scenes.push(on_the_line("disc on the line", 0.0));
    scenes.push(on_the_line("disc 1e-12 cm off the line", 1e-12));
    scenes.push(alone("start in a trap", [0.0, 0.0], &cup));
    scenes.push(alone("closed room", [0.0, 0.0], &room));
    scenes
}

fn has_arrived(journey: &Journey) -> bool {
    journey.arrived.iter().all(|a| *a)
}

fn arrived(journeys: &[Journey]) -> usize {
    journeys.iter().filter(|j| has_arrived(j)).count()
}

fn virtuals(journeys: &[Journey]) -> Vec<f64> {
    journeys.iter().map(|j| j.virtuals.len() as f64).collect()
}
