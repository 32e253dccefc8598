//! A whole journey: robots take turns, see what is in range, share their virtual obstacles.
use super::field::Numbers;
use super::robot::{PlanarRobot, Rule, Senses, VirtualObstacle};
use super::{Place, PlanarScene, distance_cm};
use crate::Refusal;
use taustream_arm::rng::SeededRng;

/// How to drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarDrive {
    /// How steps are chosen.
    pub rule: Rule,
    /// The numbers.
    pub numbers: Numbers,
    /// True when every robot knows every robot's virtual obstacles, as the paper has it; otherwise its own only.
    pub shared: bool,
    /// Seed; robot `i` draws from its stream `i`.
    pub seed: u64,
}

/// What became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Journey {
    /// Every place of every robot, a step or nothing apart, its retreats included.
    pub paths_cm: Vec<Vec<Place>>,
    /// Which robots arrived.
    pub arrived: Vec<bool>,
    /// The virtual obstacles in the order in which they were made.
    pub virtuals: Vec<VirtualObstacle>,
    /// Least distance of any robot to any obstacle or other robot.
    pub nearest_cm: f64,
    /// Steps of the robot that took most.
    pub steps: usize,
}

/// Drives every robot of a scene until it arrives or the steps are used up.
///
/// # Errors
/// When the numbers make no sense.
pub fn drive(scene: &PlanarScene, how: &PlanarDrive) -> Result<Journey, Refusal> {
    how.numbers.check()?;
    let starts = scene.robots.iter().enumerate();
    let robots =
        starts.map(|(i, [start, goal])| PlanarRobot::new(*start, *goal, SeededRng::new(how.seed, i as u64)));
    let mut fleet =
        Fleet { scene, how, robots: robots.collect(), virtuals: Vec::new(), nearest_cm: f64::INFINITY };
    let mut steps = 0;
    while steps < how.numbers.steps_max && fleet.robots.iter().any(|r| !r.has_arrived(&how.numbers)) {
        let time_s = steps as f64 * how.numbers.step_cm / how.numbers.speed_cm_s;
        for i in 0..fleet.robots.len() {
            fleet.turn(i, time_s);
        }
        steps += 1;
    }
    let arrived = fleet.robots.iter().map(|r| r.has_arrived(&how.numbers)).collect();
    let paths_cm = fleet.robots.into_iter().map(|r| r.path).collect();
    let (virtuals, nearest_cm) = (fleet.virtuals, fleet.nearest_cm);
    Ok(Journey { paths_cm, arrived, virtuals, nearest_cm, steps })
}

struct Fleet<'a> {
    scene: &'a PlanarScene,
    how: &'a PlanarDrive,
    robots: Vec<PlanarRobot>,
    virtuals: Vec<VirtualObstacle>,
    nearest_cm: f64,
}

impl Fleet<'_> {
    fn turn(&mut self, i: usize, time_s: f64) {
        let numbers = &self.how.numbers;
        if self.robots[i].has_arrived(numbers) {
            return;
        }
        let here = self.robots[i].place();
        let others: Vec<Place> = self.others(i);
        let nearest = self.nearest(here, &others, time_s);
        let sensed: Vec<Place> = nearest.filter(|(_, d)| *d <= numbers.range_cm).map(|(p, _)| p).collect();
        let own = |v: &&VirtualObstacle| self.how.shared || v.robot == i;
        let virtuals: Vec<VirtualObstacle> = self.virtuals.iter().filter(own).copied().collect();
        // A place is clear when it keeps the clearance, or, for a robot that something has come too near, widens it.
        let clearance =
            |place: Place| self.nearest(place, &others, time_s).map(|n| n.1).fold(f64::INFINITY, f64::min);
        let kept = clearance(here).min(numbers.clearance_cm);
        let is_clear = |place: Place| clearance(place) >= kept;
        let senses = Senses { numbers, sensed: &sensed, virtuals: &virtuals, is_clear: &is_clear };

        let mut robot = self.robots[i].clone();
        robot.step(self.how.rule, &senses);
        self.nearest_cm = self.nearest_cm.min(clearance(robot.place()));
        let is_robust = self.how.rule == Rule::RobustBacteria;
        if is_robust && robot.is_trapped(numbers) && self.virtuals.len() < numbers.virtual_max {
            let centre_cm = robot.retreat(numbers);
            self.virtuals.push(VirtualObstacle { centre_cm, robot: i });
        }
        self.robots[i] = robot;
    }

    fn others(&self, i: usize) -> Vec<Place> {
        let others = self.robots.iter().enumerate().filter(|(k, _)| *k != i);
        others.map(|(_, r)| r.place()).collect()
    }

    /// Nearest point and distance of every obstacle and every other robot.
    fn nearest<'s>(
        &'s self,
        place: Place,
        others: &'s [Place],
        time_s: f64,
    ) -> impl Iterator<Item = (Place, f64)> + 's {
        let obstacles = self.scene.obstacles.iter().map(move |o| o.nearest(place, time_s));
        obstacles.chain(others.iter().map(move |o| (*o, distance_cm(*o, place))))
    }
}
