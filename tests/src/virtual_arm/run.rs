//! One run: a plan, an operator, and at the end the proof that the arm can be moved again.
use super::arms::SimulatedArm;
use super::checker::{Rule, Violation};
use super::motion::{cruising_train, random_replacement, random_train};
use super::operator::{Deed, Operator};
use super::plan::Plan;
use super::random::SeededRng;
use super::streaming::Streaming;
use super::world::{World, Wrap};
use anyhow::Result;
use std::fmt;
use taustream_arm::Settings;
use taustream_messages::{Phase, Replaces};
use taustream_motion::cut::kept;
use taustream_motion::{JointArray, Stroke, Trajectory};

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
    /// Replacements in motion that were accepted, and refused.
    pub replacements: (u64, u64),
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
    replaces: Replacing,
    /// Moments and shapes of replacements: of their own, so that runs without them stay as they are.
    replacer: SeededRng,
    next_replacement_ms: u64,
    /// The planner that follows a stream, if one is followed.
    streaming: Option<Streaming>,
    /// The operator is at work.
    operated: bool,
}

/// What replaces motions that run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replacing {
    /// Nothing.
    Nothing,
    /// Replacements that keep the limits, at random moments; some too late, some with a changed stroke.
    Sound,
    /// A planted fault: pending strokes are dropped, and nothing brings the motion down.
    DropAlone,
    /// Targets at random moments, each led on to by the planner's follower.
    Stream,
    /// A planted fault: the same, without the part of the reference that leads on from the cut.
    StreamWithoutReference,
}

/// Runs a plan on an arm and checks everything.
///
/// # Errors
/// When the arm's settings are refused.
pub fn run(arm: &SimulatedArm, seed: u64, plan: &Plan, wrap: Wrap<'_>) -> Result<Outcome> {
    run_replacing(arm, seed, (plan, wrap), Replacing::Nothing)
}

/// Like [`run`], with replacements of motions that run.
///
/// # Errors
/// When the arm's settings are refused.
pub fn run_replacing(
    arm: &SimulatedArm,
    seed: u64,
    (plan, wrap): (&Plan, Wrap<'_>),
    replaces: Replacing,
) -> Result<Outcome> {
    let settings: Settings = arm.settings()?;
    let world = World::new(settings, seed, plan, wrap)?;
    let home_rad = world.position_rad();
    let (operator, rng) = (Operator::new(seed), SeededRng::new(seed, 4));
    let (replacer, next_replacement_ms, offered) = (SeededRng::new(seed, 5), 0, None);
    let streaming = matches!(replaces, Replacing::Stream | Replacing::StreamWithoutReference).then(|| {
        let skips_reference = replaces == Replacing::StreamWithoutReference;
        Streaming::new(&world.settings.robot, &home_rad, skips_reference)
    });
    let mut run = Run {
        world,
        operator,
        rng,
        home_rad,
        offered,
        replaces,
        replacer,
        next_replacement_ms,
        streaming,
        operated: true,
    };
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
        replacements: world.replacements(),
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
            Some(Deed::Trajectory) if self.streaming.is_none() => self.offer(),
            Some(Deed::Trajectory) | None => {}
        }
        if self.streaming.is_some() {
            if self.operated && now_ms >= self.next_replacement_ms {
                self.follow(now_ms);
            }
        } else if self.replaces != Replacing::Nothing && self.operated && now_ms >= self.next_replacement_ms {
            self.next_replacement_ms = now_ms + self.replacer.whole(2, 250);
            self.replace(phase);
        }
        for answered in self.world.step() {
            self.operator.answered(answered.answer.accepted, answered.answer.why);
        }
    }

    fn offer(&mut self) {
        let Some(from_rad) = self.world.commanded_rad() else { return };
        let robot = &self.world.settings.robot;
        let train = if self.replaces == Replacing::DropAlone { cruising_train } else { random_train };
        self.offered = train(&mut self.rng, robot, &self.home_rad, &from_rad);
        if let Some(trajectory) = &self.offered {
            self.world.offer(trajectory);
        }
    }

    /// Leads on to the next target of a stream.
    fn follow(&mut self, now_ms: u64) {
        let Some(streaming) = &mut self.streaming else { return };
        self.next_replacement_ms = now_ms + streaming.next_ms(&mut self.replacer);
        let Some(report) = self.world.report() else { return };
        let surroundings = (&self.world.settings.robot, &self.home_rad);
        let made = streaming.next_piece(&mut self.replacer, surroundings, (&report, self.world.now_ns()));
        let Some((trajectory, replaces, reference)) = made else { return };
        let id = match replaces {
            Replaces::Rest => self.world.offer(&trajectory),
            Replaces::Cut { trajectory_id, at_s } => {
                let waits_until_s = (report.successor_id != 0).then_some(report.successor_from_s);
                self.world.offer_cut(&trajectory, (trajectory_id, at_s), waits_until_s)
            }
        };
        if let Some(id) = id {
            streaming.offered(id, trajectory, reference);
        }
    }

    /// Replaces what runs, from a moment on that is a little ahead, or already over.
    fn replace(&mut self, phase: Phase) {
        if !matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused) {
            return;
        }
        let Some((id, running, s)) = self.world.running() else { return };
        let cut_s = (s + self.replacer.within(-0.01, 0.25)).clamp(0.0, running.duration_s());
        let made = match self.replaces {
            Replacing::DropAlone => {
                let kept = kept(running, cut_s, cut_s);
                let ends_s = kept.strokes.iter().map(Stroke::end_s).fold(0.0, f64::max);
                let made = Trajectory::new(running.joints(), kept.base_rad, kept.strokes).ok();
                made.filter(|_| ends_s >= cut_s)
            }
            Replacing::Sound | Replacing::Nothing | Replacing::Stream | Replacing::StreamWithoutReference => {
                let robot = &self.world.settings.robot;
                random_replacement(&mut self.replacer, robot, &self.home_rad, (running, cut_s))
            }
        };
        let Some(made) = made else { return };
        let changed = self.replaces == Replacing::Sound && self.replacer.chance(0.1);
        let offered = if changed { with_a_changed_bit(&made) } else { made };
        self.world.offer_cut(&offered, (id, cut_s), None);
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

/// The base one bit off: no streamer may take it.
fn with_a_changed_bit(trajectory: &Trajectory) -> Trajectory {
    let mut base_rad = *trajectory.base_rad();
    base_rad[0] = f64::from_bits(base_rad[0].to_bits() ^ 1);
    Trajectory::new(trajectory.joints(), base_rad, trajectory.strokes())
        .unwrap_or_else(|_| trajectory.clone())
}
