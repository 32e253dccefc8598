//! `taustream jog`: moves one joint, or the tip along an axis, while a key is held.
//!
//! A jog is a stream of chunks to the planner. Each leads from the jog's own setpoint at constant speed to where it may be when
//! the dead man's time is over, and what is committed ends at rest. So the arm stops whatever happens to this process.
use super::client::{Client, Limit};
use super::jog_keys::{Key, Keys};
use super::jog_path::{JogPath, Jogged};
use super::target_port::TargetPort;
use crate::args::{Axis, JogArgs, group_of, tip_of};
use crate::arm;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use nalgebra::Vector3;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_messages::Phase;
use taustream_messages::target::{Target, TargetOutcome};
use taustream_motion::JointArray;

/// How often a chunk is sent while a key is held.
const EVERY: Duration = Duration::from_millis(25);
/// Targets of a chunk.
const TARGETS: u32 = 8;
/// The jog's setpoint leads the arm's by no more than what its speed makes in this time, s.
const AHEAD_S_MAX: f64 = 0.6;
/// The same for the tip, whose joints have no one speed, rad.
const AHEAD_RAD_MAX: f64 = 0.3;
/// How long the arm may take to rest at the end, s.
const SETTLE_S_MAX: f64 = 2.0;
/// How often something is said to people, at most.
const SAY_EVERY: Duration = Duration::from_secs(1);

/// What a jog has done.
#[derive(Default, Serialize)]
struct Summary {
    arm: String,
    moved_rad: Vec<f64>,
    sent: u64,
    taken: u64,
    refused: u64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let moved: Vec<String> = self.moved_rad.iter().map(|q| format!("{q:.4}")).collect();
        write!(f, "{}: joints moved by {} rad", self.arm, moved.join(", "))
    }
}

struct Jog<'a> {
    form: Form,
    client: &'a Client,
    port: TargetPort<'a>,
    robot: &'a Robot,
    jogged: Jogged,
    speed: f64,
    dead_man: Duration,
    command_rad: JointArray,
    phase: Phase,
    summary: Summary,
    said: Option<Instant>,
}

/// A key that is held.
struct Held<'a> {
    direction: f64,
    refreshed: Instant,
    path: JogPath<'a>,
    /// The instant for which the path's pose is meant.
    at: Instant,
}

/// Jogs until the user leaves, or standard input ends.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &JogArgs) -> Result<(), Failure> {
    let settings = arm::settings(settings)?;
    let robot = &settings.robot;
    let (jogged, speed) = jogged(args, robot)?;
    let dead_man = Duration::from_millis(args.dead_man_ms.into());
    let client = Client::join(&settings.name)?;
    let (report, phase) = client.report()?;
    let mut jog = Jog {
        form,
        client: &client,
        // A planner that hangs moves nothing once the dead man's time is over.
        port: TargetPort::open(&client, robot.joints.len(), dead_man.as_secs_f64())?,
        robot,
        jogged,
        speed,
        dead_man,
        command_rad: report.command_rad,
        phase,
        summary: Summary { arm: settings.name.clone(), ..Summary::default() },
        said: None,
    };
    form.progress("hold Right or + to move forwards, Left or - to move back; q ends");
    {
        // The terminal is set back before anything is printed.
        let keys = Keys::open()?;
        jog.until_left(&keys)?;
    }
    jog.settle()?;
    let moved = jog.command_rad.iter().zip(&report.command_rad).take(robot.joints.len());
    jog.summary.moved_rad = moved.map(|(to, from)| to - from).collect();
    form.print(&jog.summary)
}

fn jogged(args: &JogArgs, robot: &Robot) -> Result<(Jogged, f64), Failure> {
    if let Some(axis) = args.axis {
        let axis = match axis {
            Axis::X => Vector3::x_axis(),
            Axis::Y => Vector3::y_axis(),
            Axis::Z => Vector3::z_axis(),
        };
        let tip = tip_of(robot, group_of(robot, args.group.as_deref())?)?;
        let frame = robot.tips.get(tip).map_or(robot.chain.tip_frame(), |tip| tip.frame);
        return Ok((Jogged::Tip { axis, is_tools: args.tool, frame }, args.speed_m_s));
    }
    let given = args.joint.as_deref().unwrap_or_default();
    let by_name = robot.joints.iter().position(|joint| joint.name == given);
    let by_number = || given.parse().ok().filter(|number| (1..=robot.joints.len()).contains(number));
    let joint = by_name.or_else(|| by_number().map(|number: usize| number - 1)).ok_or_else(|| {
        let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
        Failure::Usage(format!(
            "--joint {given}: no joint of {}; use {}, or its number",
            robot.name,
            names.join(", ")
        ))
    })?;
    Ok((Jogged::Joint(joint), args.speed_rad_s))
}

impl<'a> Jog<'a> {
    fn until_left(&mut self, keys: &Keys) -> Result<(), Failure> {
        let mut held: Option<Held<'a>> = None;
        let mut next = Instant::now();
        while !interrupt::has_come() {
            let wait = next.saturating_duration_since(Instant::now());
            match keys.next(wait.clamp(Duration::from_millis(1), EVERY)) {
                Some(Key::Leave) => return Ok(()),
                Some(Key::Stop) => held = None,
                Some(Key::Held(direction)) => self.hold(&mut held, direction),
                None => {}
            }
            if Instant::now() >= next {
                next = Instant::now() + EVERY;
                self.turn(&mut held)?;
            }
        }
        Ok(())
    }

    /// Refreshes what is held, or begins anew from the commanded pose.
    fn hold(&self, held: &mut Option<Held<'a>>, direction: f64) {
        let now = Instant::now();
        match held {
            Some(held) if held.direction * direction > 0.0 => held.refreshed = now,
            Some(_) | None => {
                let path = JogPath::new(self.robot, self.jogged, &self.command_rad);
                *held = Some(Held { direction, refreshed: now, path, at: now });
            }
        }
    }

    /// Sends the next chunk while a key is held.
    fn turn(&mut self, held: &mut Option<Held<'a>>) -> Result<(), Failure> {
        self.look()?;
        for (_, outcome) in self.port.answers()? {
            self.note(&outcome);
        }
        let Some(holding) = held else { return Ok(()) };
        let now = Instant::now();
        let left = (holding.refreshed + self.dead_man).saturating_duration_since(now);
        if left.is_zero() {
            *held = None;
            return Ok(());
        }
        if !self.port.is_free() {
            return Ok(());
        }
        let led_s = now.saturating_duration_since(holding.at).as_secs_f64();
        holding.at = now;
        let ahead_rad = holding.path.at_rad().iter().zip(&self.command_rad).map(|(a, b)| (a - b).abs());
        let farthest_rad = ahead_rad.fold(0.0, f64::max);
        // An arm that does not follow, for what reason ever, is not to catch up with a leap.
        if farthest_rad <= self.ahead_rad_max() && !holding.path.lead(holding.direction * self.speed * led_s)
        {
            self.say("the end of the way: a limit, the reach of the arm, or a singular pose");
        }
        let step_s = left.as_secs_f64() / f64::from(TARGETS);
        let mut ahead = holding.path;
        let mut targets = vec![target(0.0, &ahead)];
        for k in 1..=TARGETS {
            if ahead.lead(holding.direction * self.speed * step_s) {
                targets.push(target(f64::from(k) * step_s, &ahead));
            }
        }
        self.summary.sent += 1;
        self.port.send(targets)
    }

    /// Waits until what was sent has come to rest.
    fn settle(&mut self) -> Result<(), Failure> {
        let limit = Limit::after_s(SETTLE_S_MAX);
        while !limit.is_over() && !interrupt::has_come() {
            for (_, outcome) in self.port.answers()? {
                self.note(&outcome);
            }
            self.look()?;
            if self.port.is_idle() && self.phase != Phase::Moving {
                break;
            }
            thread::sleep(EVERY);
        }
        Ok(())
    }

    /// How far the jog's setpoint may be ahead of the arm's, rad.
    fn ahead_rad_max(&self) -> f64 {
        match self.jogged {
            Jogged::Joint(_) => self.speed * AHEAD_S_MAX,
            Jogged::Tip { .. } => AHEAD_RAD_MAX,
        }
    }

    fn look(&mut self) -> Result<(), Failure> {
        if let Some((report, phase)) = self.client.newest_report()? {
            (self.command_rad, self.phase) = (report.command_rad, phase);
        }
        Ok(())
    }

    fn note(&mut self, outcome: &TargetOutcome) {
        match outcome {
            TargetOutcome::Superseded => {}
            TargetOutcome::Taken { note, .. } => {
                self.summary.taken += 1;
                if !note.is_empty() {
                    self.say(note);
                }
            }
            TargetOutcome::Refused { reason } => {
                self.summary.refused += 1;
                self.say(reason);
            }
        }
    }

    /// Says something to people, once a second at most.
    fn say(&mut self, text: &str) {
        if self.said.is_none_or(|said| said.elapsed() >= SAY_EVERY) {
            self.said = Some(Instant::now());
            // In raw mode a new line alone does not go back to the first column.
            self.form.progress(format_args!("{text}\r"));
        }
    }
}

fn target(due_s: f64, path: &JogPath) -> Target {
    Target { due_s, position_rad: *path.at_rad(), velocity_rad_s: None }
}
