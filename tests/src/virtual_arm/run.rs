//! One run: a plan, an operator, and at the end the proof that the arm can be moved again.
use super::arms::SimulatedArm;
use super::checker::{Rule, Violation};
use super::motion::random_train;
use super::operator::{Deed, Operator};
use super::plan::Plan;
use super::random::SeededRng;
use super::world::{World, Wrap};
use anyhow::Result;
use std::fmt;
use taustream_arm::Settings;
use taustream_messages::Phase;
use taustream_motion::{JointArray, Trajectory};

/// Virtual time in which things go wrong, ms.
pub const PLAN_MS: u64 = 6_000;
/// How long the operator may take to bring the arm back, ms: drives may take the longest time-out of the settings.
const RECOVERY_MS: u64 = 20_000;
/// How long a motion to the goal may take, ms.
const MOTION_MS: u64 = 20_000;
/// Time for the joints to come to rest at the goal, ms.
const SETTLING_MS: u64 = 1_000;
/// Distance of a joint from its goal: the sag of a motor in MIT mode, which is a spring, rad.
const GOAL_RAD: f64 = 0.04;

/// What a run has shown.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The arm's name.
    pub arm: &'static str,
    /// The seed.
    pub seed: u64,
    /// Virtual time, ms.
    pub duration_ms: u64,
    /// Frames on the wires, and their digest.
    pub frames: u64,
    /// Equal for equal traffic, times included.
    pub digest: u64,
    /// Setpoints of moving joints that were compared.
    pub compared: u64,
    /// What no arm may do.
    pub violations: Vec<Violation>,
    /// What happened.
    pub story: Vec<String>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { arm, seed, .. } = self;
        writeln!(f, "arm {arm}, seed {seed}:")?;
        self.violations.iter().try_for_each(|violation| writeln!(f, "  {violation}"))?;
        writeln!(f, "what happened:")?;
        self.story.iter().try_for_each(|line| writeln!(f, "  {line}"))?;
        write!(f, "again: TAUSTREAM_SEED={seed} TAUSTREAM_ARM={arm} cargo test --test virtual_arm one_seed")
    }
}

/// One run in progress.
struct Run {
    world: World,
    operator: Operator,
    rng: SeededRng,
    home_rad: JointArray,
    /// The newest trajectory that was offered.
    offered: Option<Trajectory>,
    /// The operator is at work.
    operated: bool,
}

/// Runs a plan on an arm and checks everything.
///
/// # Errors
/// When the arm's settings are refused.
pub fn run(arm: &SimulatedArm, seed: u64, plan: &Plan, wrap: Wrap<'_>) -> Result<Outcome> {
    let settings: Settings = arm.settings()?;
    let world = World::new(settings, seed, plan, wrap)?;
    let home_rad = world.position_rad();
    let (operator, rng) = (Operator::new(seed), SeededRng::new(seed, 4));
    let mut run = Run { world, operator, rng, home_rad, offered: None, operated: true };
    run.steps(PLAN_MS, |_| false);
    run.world.make_whole();
    run.prove_recovery();
    let world = run.world;
    Ok(Outcome {
        arm: arm.name,
        seed,
        duration_ms: world.now_ms(),
        frames: world.frames(),
        digest: world.digest(),
        compared: world.checker.compared(),
        violations: world.checker.violations().to_vec(),
        story: world.story,
    })
}

impl Run {
    /// Runs until a condition holds or the time is over; true when it held.
    fn steps(&mut self, for_ms: u64, done: impl Fn(&Self) -> bool) -> bool {
        let end_ms = self.world.now_ms() + for_ms;
        while self.world.now_ms() < end_ms {
            if done(self) {
                return true;
            }
            self.step();
        }
        done(self)
    }

    fn step(&mut self) {
        let (now_ms, phase) = (self.world.now_ms(), self.world.phase());
        match self.operator.act(now_ms, phase).filter(|_| self.operated) {
            Some(Deed::Command(command)) => {
                self.world.ask(command);
            }
            Some(Deed::Trajectory) => self.offer(),
            None => {}
        }
        for answered in self.world.step() {
            self.operator.answered(answered.answer.accepted, answered.answer.why);
        }
    }

    fn offer(&mut self) {
        let Some(from_rad) = self.world.commanded_rad() else { return };
        let robot = &self.world.settings.robot;
        self.offered = random_train(&mut self.rng, robot, &self.home_rad, &from_rad);
        if let Some(trajectory) = &self.offered {
            self.world.offer(trajectory);
        }
    }

    /// After everything is whole the arm can be brought back, moved, and reaches its goal.
    fn prove_recovery(&mut self) {
        self.operator.recover();
        let ready = self.steps(RECOVERY_MS, |run| run.operator.is_ready(run.world.phase()));
        if !ready {
            let drives = self.world.drives_in_words();
            let text = format!("still {:?} after {RECOVERY_MS} ms of recovery; {drives}", self.world.phase());
            return self.report(text);
        }
        self.operated = false;
        // The report of the newest commanded pose comes a hundred times a second.
        self.steps(50, |_| false);
        self.offer();
        self.steps(5, |_| false);
        if self.world.phase() != Phase::Moving {
            let text = format!("no trajectory is accepted in {:?}", self.world.phase());
            return self.report(text);
        }
        if !self.steps(MOTION_MS, |run| run.world.phase() == Phase::Holding) {
            let text = format!("{:?} instead of holding at the goal", self.world.phase());
            return self.report(text);
        }
        self.steps(SETTLING_MS, |_| false);
        let goal_rad = self.offered.as_ref().map_or([0.0; _], Trajectory::end_rad);
        let (at_rad, joints) = (self.world.position_rad(), self.world.settings.robot.joints.len());
        let off = (0..joints).find(|joint| (at_rad[*joint] - goal_rad[*joint]).abs() > GOAL_RAD);
        if let Some(joint) = off {
            let text = format!(
                "joint {} is at {} rad, its goal at {} rad",
                joint + 1,
                at_rad[joint],
                goal_rad[joint]
            );
            self.report(text);
        }
    }

    fn report(&mut self, text: String) {
        let tick = self.world.now_ms();
        self.world.checker.report(tick, Rule::Recovery, text);
    }
}
