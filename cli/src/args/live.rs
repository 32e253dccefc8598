//! Arguments of the commands that talk to the running streamer and planner.
use super::goal::GoalArgs;
use super::offline::{TrajectoryArg, planner_kind};
use super::via::ViaArgs;
use clap::Args;
use std::path::PathBuf;
use taustream_drivers::link::LinkChoice;
use taustream_messages::plan::When;
use taustream_planner::PlannerKind;

/// A command to the streamer without arguments of its own.
#[derive(Args, Debug)]
pub(crate) struct CommandArgs {
    /// Wait up to this long until the arm has done it, s; 0 returns when the streamer has accepted.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 10.0, value_parser = waiting_s)]
    pub(crate) wait_s: f64,
}

/// `taustream speed`
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  taustream speed 25      a quarter of the planned speed, on the same path\n  taustream speed 100     as planned"
)]
pub(crate) struct SpeedArgs {
    /// Override, percent of the planned speed, 0 to 100.
    #[arg(value_name = "PCT", allow_hyphen_values = true, value_parser = percent)]
    pub(crate) percent: f64,
}

/// `taustream stop`
#[derive(Args, Debug)]
pub(crate) struct StopArgs {
    /// Stop as fast as the stop limits allow; ends in a fault, which `clear-fault` clears.
    #[arg(long)]
    pub(crate) fast: bool,
    /// Waiting.
    #[command(flatten)]
    pub(crate) waiting: CommandArgs,
}

const REFERENCE_HELP: &str = "\
Examples:
  taustream reference                                       show which joints are referenced, and the possible angles
  taustream reference --joint elbow --at-rad 1.57           set the elbow to 1.57 rad, as measured at the arm
  taustream reference --confirm                             confirm the shown angles after a look at the arm

Feedback that wraps (`feedback = \"wraps\"`) leaves the multi-turn offset of a joint open; incremental feedback
(\"incremental\") leaves the whole angle open. A wrong offset looks valid and moves the joint the wrong way. Such a joint is
energised only when it is referenced: from the last pose on disk, or by this command. Look at the arm, not at the screen.
References are accepted only while nothing is energised and the arm is at rest. --at-rad must be within 0.4 periods of an
angle that the feedback allows. After a change of sign, gear, zero or drive in the settings, reference the joint again.";

/// `taustream reference`
#[derive(Args, Debug)]
#[command(after_help = REFERENCE_HELP)]
pub(crate) struct ReferenceArgs {
    /// Joint, by its name or its number from 1; without it, all.
    #[arg(long, value_name = "JOINT")]
    pub(crate) joint: Option<String>,
    /// Angle of the joint, rad, as measured at the arm.
    #[arg(long, value_name = "RAD", allow_hyphen_values = true, conflicts_with = "confirm", value_parser = angle_rad)]
    pub(crate) at_rad: Option<f64>,
    /// Confirm the shown angle; for joints whose feedback allows one angle only.
    #[arg(long)]
    pub(crate) confirm: bool,
}

const HOME_HELP: &str = "\
Examples:
  taustream home elbow                    the drive of the elbow homes itself; wait until it has
  taustream home 3 && taustream enable    joint 3, then make the arm ready
  taustream stop                          ends a homing: the drive is halted, and its joint holds, not referenced

For CiA 402 drives whose [[servo]] has a table [servo.homing] (docs/homing.md). The drive moves the joint to its switch or
index pulse by its own method and speed. NOTHING PLANS OR CHECKS THAT MOTION: see first that its path is free. It begins only
while the arm is disabled, holding or locked, and at rest; drives that are off are energised, and the other joints hold. No
motion is accepted meanwhile. Afterwards the joint is referenced, the arm holds, and `enable` makes it ready: look at its pose
first. Joints are homed one at a time. Exit code 0 means: homed, and holding.";

/// `taustream home`
#[derive(Args, Debug)]
#[command(after_help = HOME_HELP)]
pub(crate) struct HomeArgs {
    /// Joint or axis, by its name or its number from 1; axes follow the joints.
    #[arg(value_name = "JOINT")]
    pub(crate) joint: String,
    /// Wait up to this long for the end, s; without it, the settings' timeout and 15 s; 0 returns when the streamer has accepted.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = waiting_s)]
    pub(crate) wait_s: Option<f64>,
}

/// An angle: a finite number of rad, or one with its unit.
fn angle_rad(text: &str) -> Result<f64, String> {
    crate::angles::angle_rad(text.trim(), 1.0)
        .filter(|angle| angle.is_finite())
        .ok_or_else(|| "expected a finite number of rad, or one with its unit: 90deg".to_owned())
}

const REPLAN_HELP: &str = "\
Examples:
  taustream replan --goal \"1.2,-1.3,1.4,-1.6,-1.57,0\" --wait
  taustream replan --to-pose 0.4,-0.3,0.35,3.1416,0,0 --tolerance-rad 0.01,0.01,free
  taustream replan --to-position 0.4,-0.3,0.25 --linear --tip-speed-m-s 0.1 --wait
  taustream replan --to-named home --upright-deg 10 --tool-axis -z --tip-speed-m-s 0.25
  taustream replan --via \"0.4,-1.2,1.2,-1.6,-1.57,0\" --via \"0.8,-1,1,-1.6,-1.57,0\" --goal \"..\" --blend-rad 0.1
  taustream replan --goal \"..\" --after-current --deadline-ms 5000
  taustream replan --to-named home --wait-s 20
  taustream replan --goal \"..\" && taustream replan --goal \"..\" --queue && taustream replan --goal \"..\" --queue

At rest the motion starts at the commanded pose. An arm that moves, or is paused, gets a replacement of its motion: the planner
cuts the motion a little ahead of the arm, or lets it end, leads on to the goal, verifies everything from the cut on, and sends
it. The arm does not jump, and a pause stays a pause. What was rejected changes nothing. The receipt of the streamer states
whether, and from when, it runs. A motion that goes on from another one, or passes poses, rounds the corners within the blend
while that is still possible; what planned it says so.

What the tip must keep (--upright-deg, --tip-above-m, --tip-box-m, --tip-speed-m-s) is proven from the cut on, or, where the
running motion does not keep it from there, from its end on. Exit code 0 means: accepted (with --wait: executed).";

/// `taustream replan`
#[derive(Args, Debug)]
#[command(after_help = REPLAN_HELP)]
pub(crate) struct ReplanArgs {
    /// Where to go.
    #[command(flatten)]
    pub(crate) goal: GoalArgs,
    /// What to pass on the way.
    #[command(flatten)]
    pub(crate) via: ViaArgs,
    /// Leave the running motion as soon as the new one is planned (the default).
    #[arg(long, conflicts_with_all = ["after_current", "queue"])]
    at_once: bool,
    /// Start when the running motion has ended; what was to follow it is dropped.
    #[arg(long, conflicts_with = "queue")]
    after_current: bool,
    /// Go on from the end of every motion that was accepted: several goals in a row.
    ///
    /// The corner there is rounded within the blend while that is still possible; else the arm stops at it. The answer says which.
    #[arg(long)]
    queue: bool,
    /// Deadline of planning, ms, which is spent on shorter motions. Without it the answer comes after a few searches and
    /// shortcuts, mostly within milliseconds, and after 2000 ms at most.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=3_600_000))]
    pub(crate) deadline_ms: Option<u32>,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Planner.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = planner_kind())]
    pub(crate) planner: PlannerKind,
    /// Say what was tried, step by step: how long each took, and what came of it.
    #[arg(long)]
    pub(crate) explain: bool,
    /// Return only when the motion has ended.
    #[arg(long)]
    pub(crate) wait: bool,
    /// While a neighbour (`[[neighbour]]` in the settings) is in the way with a motion that will end, or its pose is not known, ask
    /// again for so many seconds.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 0.0, value_parser = wait_s)]
    pub(crate) wait_s: f64,
}

/// Longest wait for a neighbour, s.
const WAIT_S_MAX: f64 = 3_600.0;

fn wait_s(text: &str) -> Result<f64, String> {
    let seconds = text.trim().parse::<f64>().ok().filter(|s| (0.0..=WAIT_S_MAX).contains(s));
    seconds.ok_or_else(|| format!("expected 0 to {WAIT_S_MAX} s"))
}

impl ReplanArgs {
    /// When the motion starts.
    pub(crate) fn when(&self) -> When {
        match (self.after_current, self.queue) {
            (true, _) => When::AfterCurrent,
            (_, true) => When::Queue,
            (false, false) => When::AtOnce,
        }
    }
}

const CANCEL_HELP: &str = "\
Examples:
  taustream cancel --wait

The planner replaces the motion by strokes that bring the arm to rest inside its motion limits, close to its path, and verifies
them. Motions that wait are dropped. `taustream stop` needs no planner and stays on the path.";

/// `taustream cancel`
#[derive(Args, Debug)]
#[command(after_help = CANCEL_HELP)]
pub(crate) struct CancelArgs {
    /// Return only when the arm is at rest.
    #[arg(long)]
    pub(crate) wait: bool,
}

const RECOVER_HELP: &str = "\
Examples:
  taustream enable && taustream recover --wait

A joint that was pushed outside its position limits is energised there, but may only move inwards. This leads every such
joint straight to the nearest angle inside, at no more than a quarter of the planned speed; the other joints stand still.
`taustream replan` does the same before it goes on to its goal.";

/// `taustream recover`
#[derive(Args, Debug)]
#[command(after_help = RECOVER_HELP)]
pub(crate) struct RecoverArgs {
    /// How long planning may take, ms.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=3_600_000))]
    pub(crate) deadline_ms: u32,
    /// Return only when the motion has ended.
    #[arg(long)]
    pub(crate) wait: bool,
}

const RUN_HELP: &str = "\
Examples:
  taustream run move.json --wait

The file must have the digest of the streamer's robot. The motion is first verified against the robot and the scene of
the settings. The arm must be at the base pose of the motion: `taustream replan --goal BASE` moves it there.";

/// `taustream run`
#[derive(Args, Debug)]
#[command(after_help = RUN_HELP)]
pub(crate) struct RunArgs {
    /// What to execute.
    #[command(flatten)]
    pub(crate) trajectory: TrajectoryArg,
    /// Return only when the motion has ended.
    #[arg(long)]
    pub(crate) wait: bool,
    /// The file's text, when the calling process has read it.
    #[arg(skip)]
    pub(crate) text: Option<String>,
}

const WATCH_HELP: &str = "\
Examples:
  taustream watch                                     q or Ctrl-C ends the view; the arm continues
  taustream watch --rate-hz 2 > arm.log               one line every half second
  taustream watch --json | jq '.joints[2].tracking_error_rad'
  taustream watch --json --count 1                    the next report

On a terminal it shows bars against the limits of the settings (NO_COLOR disables colours), elsewhere one line per
report, with --json one object per report, as `status` prints it. When reports stop it says so and waits for new ones;
--json then prints one object with \"phase\":null and the reason.";

/// `taustream watch`
#[derive(Args, Debug)]
#[command(after_help = WATCH_HELP)]
pub(crate) struct WatchArgs {
    /// Maximum rate of pictures or lines, Hz; without it 10 on a terminal, 1 elsewhere, and every report with --json.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = rate_hz)]
    pub(crate) rate_hz: Option<f64>,
    /// End after this time, s; without it, on q or Ctrl-C.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = waiting_s)]
    pub(crate) seconds: Option<f64>,
    /// End after this many pictures or lines.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
}

const DEMO_HELP: &str = "\
Examples:
  taustream demo --output /tmp/demo
  taustream demo --config ./my-demo.toml --link local --output out

Starts taustream-servosim, taustream-streamer and taustream-planner (from the directory of this program), enables the
simulated arm, moves to every goal of the demo file, disables, and writes SVG plots. It writes only to the output
directory. Ctrl-C stops the arm first.";

/// `taustream demo`
#[derive(Args, Debug)]
#[command(after_help = DEMO_HELP)]
pub(crate) struct DemoArgs {
    /// Demo file (`settings`, `start_rad`, `goals_rad`): a path, or the name of a shipped one.
    #[arg(long, value_name = "FILE", default_value = "demo")]
    pub(crate) config: PathBuf,
    /// Directory for plots, logs and the cycle log; created if missing.
    #[arg(long, value_name = "DIR", default_value = "demo-output")]
    pub(crate) output: PathBuf,
    /// CAN link.
    #[arg(long, value_name = "LINK", default_value = "auto")]
    pub(crate) link: LinkChoice,
    /// Abort after this time, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 110.0, value_parser = waiting_s)]
    pub(crate) limit_s: f64,
}

/// A time to wait: finite, not negative, at most a day.
pub(super) fn waiting_s(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if (0.0..=86_400.0).contains(&s) => Ok(s),
        _ => Err("expected seconds from 0 to 86400".to_owned()),
    }
}

/// Pictures or lines a second.
pub(super) fn rate_hz(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(hz) if (0.001..=1_000.0).contains(&hz) => Ok(hz),
        _ => Err("expected Hz from 0.001 to 1000".to_owned()),
    }
}

/// A speed override.
fn percent(text: &str) -> Result<f64, String> {
    match text.strip_suffix('%').unwrap_or(text).parse::<f64>() {
        Ok(percent) if (0.0..=100.0).contains(&percent) => Ok(percent),
        _ => Err("expected percent of the planned speed, from 0 to 100".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_outside_0_to_100_is_refused() {
        for text in ["-1", "100.1", "nan", "inf", "", "fast", "50%%"] {
            assert!(percent(text).is_err(), "{text}");
        }
        assert_eq!(percent("50%"), Ok(50.0));
        assert_eq!(percent("0"), Ok(0.0));
    }

    #[test]
    fn waiting_time_must_be_finite_and_not_negative() {
        for text in ["-1", "nan", "inf", "86401", "1s"] {
            assert!(waiting_s(text).is_err(), "{text}");
        }
    }
}
