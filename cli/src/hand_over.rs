//! Commands to the installed services, by people who are not the services' user.
//!
//! Shared memory belongs to the services' user alone, so a command of another user has to run as that user. The packaged
//! sudo rule permits one thing, `taustream handed-over` without any further argument: the words of the command travel on
//! its standard input, where they are parsed again and only commands to running services are taken. So a member of the
//! group can neither read nor write a file as the services' user: a trajectory file is read by the caller, and settings
//! are named, not pathed.
use crate::args::{Action, Cli};
use crate::arm;
use crate::failure::Failure;
use rustix::fs::{MemfdFlags, memfd_create};
use serde::{Deserialize, Serialize};
use std::env;
use std::ffi::OsString;
use std::fs::File;
use std::io::{Read, Seek, Write, stdin};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use taustream_arm::runtime::user_of_services;
use taustream_messages::service::users_of;

/// The programs by their full paths: what PATH says is the caller's affair, not ours.
const SUDO: &str = "/usr/bin/sudo";
const OURSELVES: &str = "/usr/bin/taustream";
/// As systemd/sysusers.conf and systemd/sudoers have them.
const USER: &str = "taustream";
const GROUP: &str = "taustream-operators";
const COMMAND: &str = "handed-over";
/// The one version of [`Order`] there is.
const VERSION: u32 = 1;
/// The largest order: a trajectory file of all strokes is a tenth of it.
const ORDER_BYTES_MAX: u64 = 4 << 20;

/// What travels on the standard input.
#[derive(Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
struct Order {
    version: u32,
    /// The words of the command line behind `taustream`.
    words: Vec<String>,
    /// The text of the trajectory file of `run`.
    trajectory: Option<String>,
}

/// Replaces this process by one of the services' user, if the command is for installed services that are another user's.
/// Returns when it is to be carried out here.
///
/// # Errors
/// When it should be handed over and cannot be, with what to do.
pub(crate) fn to_services(cli: &Cli) -> Result<(), Failure> {
    let own = rustix::process::geteuid().as_raw();
    let elsewhere = env::var_os("TAUSTREAM_RUNTIME_DIR").is_some_and(|directory| !directory.is_empty());
    let theirs = user_of_services().is_some_and(|user| user != own);
    if !is_for_services(&cli.action) || elsewhere || !theirs {
        return Ok(());
    }
    // Settings that cannot be read are reported by the command itself.
    let Some(arm) = arm::name_at_a_glance(cli.settings.as_deref()) else { return Ok(()) };
    if users_of(&arm).contains(&own) {
        // Services of one's own, in a session of one's own, come first.
        return Ok(());
    }
    let order = order(cli, env::args_os().skip(1).map(OsString::into_string))?;
    may_hand_over()?;
    let mut sudo = sudo();
    sudo.args(["--", OURSELVES, COMMAND]).stdin(paper(&order)?);
    Err(Failure::Failed(format!("{SUDO} cannot be started: {}", sudo.exec())))
}

/// The order of the caller's command line.
fn order(cli: &Cli, words: impl Iterator<Item = Result<String, OsString>>) -> Result<Order, Failure> {
    let words: Result<Vec<String>, _> = words.collect();
    let mut words = words.map_err(|word| {
        Failure::Usage(format!("{} is not UTF-8 and cannot be handed to the services", word.display()))
    })?;
    if let (None, Ok(named)) = (&cli.settings, env::var("TAUSTREAM_SETTINGS"))
        && !named.is_empty()
    {
        words.extend(["--settings".to_owned(), named]);
    }
    let trajectory =
        if let Action::Run(args) = &cli.action { Some(read_text(args.trajectory.path())?) } else { None };
    Ok(Order { version: VERSION, words, trajectory })
}

/// Read as the caller, who may read it; the services' user may not.
fn read_text(path: &Path) -> Result<String, Failure> {
    let mut text = String::new();
    let read = File::open(path).and_then(|file| file.take(ORDER_BYTES_MAX).read_to_string(&mut text));
    read.map_err(|e| Failure::unfit(path, format!("cannot be read: {e}")))?;
    Ok(text)
}

/// Asks sudo beforehand: its own refusal would look like a failure of the command.
fn may_hand_over() -> Result<(), Failure> {
    let remedy = format!(
        "ask the administrator for `usermod -aG {GROUP} {}` (then log in again); the rule for that group is \
         /etc/sudoers.d/taustream, which comes with the installation",
        env::var("USER").unwrap_or_else(|_| "YOU".to_owned())
    );
    let refused = |why: &str| {
        Failure::Refused(format!("the arm's services belong to user `{USER}`, and {why}; {remedy}"))
    };
    if !Path::new(SUDO).exists() {
        return Err(refused("sudo is not installed, by which you could act as that user"));
    }
    let mut question = sudo();
    question.args(["-l", "--", OURSELVES, COMMAND]);
    question.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match question.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(refused("sudo does not let you act as that user")),
        Err(e) => Err(refused(&format!("{SUDO} cannot be started: {e}"))),
    }
}

/// sudo that never asks for a password, with nothing of the caller's environment but what a terminal needs.
fn sudo() -> Command {
    let mut command = Command::new(SUDO);
    command.env_clear().args(["-n", "-u", USER]);
    for name in ["TERM", "LANG", "LC_ALL"] {
        command.envs(env::var_os(name).map(|value| (name, value)));
    }
    command
}

/// The order as a standard input. A pipe would hold 64 KiB and need a writer.
fn paper(order: &Order) -> Result<Stdio, Failure> {
    let failed =
        |e: &dyn std::fmt::Display| Failure::Failed(format!("the command cannot be handed over: {e}"));
    let text = serde_json::to_vec(order).map_err(|e| failed(&e))?;
    let mut file = File::from(memfd_create("taustream", MemfdFlags::CLOEXEC).map_err(|e| failed(&e))?);
    file.write_all(&text).and_then(|()| file.rewind()).map_err(|e| failed(&e))?;
    Ok(file.into())
}

/// The other side: what stands on the standard input, parsed, and fit to be carried out as the services' user.
///
/// # Errors
/// When this is not the services' user, or the order is none that may be handed over. `Ok(Err(_))`: words that clap
/// does not take.
pub(crate) fn taken() -> Result<Result<Cli, clap::Error>, Failure> {
    let own = rustix::process::geteuid().as_raw();
    if user_of_services() != Some(own) {
        let what = "is started by sudo as the services' user; run the command itself instead";
        return Err(Failure::Usage(format!("`{COMMAND}` {what}")));
    }
    // Whatever is relative would mean the caller's directory.
    env::set_current_dir("/").map_err(|e| Failure::Failed(format!("cannot leave for /: {e}")))?;
    let mut text = String::new();
    let read = stdin().lock().take(ORDER_BYTES_MAX).read_to_string(&mut text);
    read.map_err(|e| Failure::Usage(format!("the handed-over command cannot be read: {e}")))?;
    understood(&text)
}

fn understood(text: &str) -> Result<Result<Cli, clap::Error>, Failure> {
    let bad = |why: String| Failure::Usage(format!("the handed-over command is refused: {why}"));
    let order: Order = serde_json::from_str(text).map_err(|e| bad(e.to_string()))?;
    if order.version != VERSION {
        let got = order.version;
        return Err(bad(format!("its version is {got}, not {VERSION}; use the taustream that is installed")));
    }
    let mut cli = match Cli::from_words(std::iter::once("taustream".to_owned()).chain(order.words)) {
        Ok(cli) => cli,
        Err(error) => return Ok(Err(error)),
    };
    if !is_for_services(&cli.action) {
        return Err(bad("it is no command to the services".to_owned()));
    }
    if let Some(path) = cli.settings.as_deref().filter(|given| !is_name(given)) {
        return Err(bad(format!(
            "--settings {}: the services' user reads no file of yours; put it into /etc/taustream/settings and name it",
            path.display()
        )));
    }
    if let Action::Run(args) = &mut cli.action {
        args.text = Some(
            order.trajectory.ok_or_else(|| bad("it runs a trajectory that it does not hold".to_owned()))?,
        );
    }
    Ok(Ok(cli))
}

/// Whether a word can only be found as a name in the configuration directories.
fn is_name(given: &Path) -> bool {
    given.to_str().is_some_and(taustream_messages::service::is_arm_name)
}

/// Commands that talk to running services and touch no file of the caller's but what is handed over. Everything else is
/// carried out by whoever types it.
fn is_for_services(action: &Action) -> bool {
    match action {
        Action::Replan(_)
        | Action::Cancel(_)
        | Action::Follow(_)
        | Action::Jog(_)
        | Action::Recover(_)
        | Action::Run(_)
        | Action::Enable(_)
        | Action::Disable(_)
        | Action::Pause(_)
        | Action::Resume(_)
        | Action::Speed(_)
        | Action::Stop(_)
        | Action::TorqueOff(_)
        | Action::ClearFault(_)
        | Action::Axis(_)
        | Action::Home(_)
        | Action::Reference(_)
        | Action::Status
        | Action::Watch(_) => true,
        Action::Scene(args) => !args.reads_a_file(),
        Action::Calibrate(args) => !args.touches_a_file(),
        Action::Plan(_)
        | Action::Import(_)
        | Action::Sample(_)
        | Action::Plot(_)
        | Action::Cost(_)
        | Action::Verify(_)
        | Action::Check(_)
        | Action::Doctor(_)
        | Action::Bench(_)
        | Action::Demo(_)
        | Action::Completions { .. }
        | Action::Man(_)
        | Action::HandedOver => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(words: &[&str], trajectory: Option<&str>) -> String {
        let words = words.iter().map(|word| (*word).to_owned()).collect();
        let trajectory = trajectory.map(str::to_owned);
        serde_json::to_string(&Order { version: VERSION, words, trajectory }).unwrap()
    }

    #[test]
    fn commands_to_services_are_taken_with_their_words() {
        let cli =
            understood(&text(&["--settings", "vcan6", "speed", "50", "--json"], None)).unwrap().unwrap();
        assert!(matches!(cli.action, Action::Speed(_)) && cli.json);
        assert_eq!(cli.settings.as_deref(), Some(Path::new("vcan6")));
        let cli = understood(&text(&["run", "/etc/secret.json"], Some("{}"))).unwrap().unwrap();
        let Action::Run(args) = cli.action else { panic!() };
        assert_eq!(args.text.as_deref(), Some("{}"), "the text that came along, not the file");
    }

    #[test]
    fn nothing_that_touches_files_or_goes_round_in_a_circle_is_taken() {
        for words in [
            &["handed-over"][..],
            &[
                "plan",
                "--robot",
                "ur5",
                "--scene",
                "open",
                "--start",
                "0",
                "--goal",
                "0",
                "-o",
                "/var/lib/taustream/x",
            ],
            &["demo", "--output", "/var/lib/taustream"],
            &["check", "/etc/shadow"],
            &["run", "/var/lib/taustream/x"],
            &["status", "--settings", "/etc/shadow"],
            &["status", "--settings", "../settings"],
            &["status", "--settings", "x.toml"],
            &["scene", "add", "--file", "/etc/shadow"],
            &["calibrate", "gravity", "--from", "/etc/shadow"],
            &["calibrate", "gravity", "-o", "/var/lib/taustream/x"],
        ] {
            let refused = understood(&text(words, None));
            assert!(matches!(refused, Err(Failure::Usage(_))), "{words:?}: {refused:?}");
        }
    }

    #[test]
    fn hostile_requests_are_refused_with_a_reason() {
        let newer = text(&["status"], None).replace("\"version\":1", "\"version\":2");
        let more = text(&["status"], None).replace("{\"version\"", "{\"env\":{},\"version\"");
        for bad in ["", "null", "[]", "{\"version\":1}", newer.as_str(), more.as_str()] {
            assert!(matches!(understood(bad), Err(Failure::Usage(_))), "{bad}");
        }
        assert!(understood(&text(&["stop", "--no-such-option"], None)).unwrap().is_err());
        assert!(understood(&text(&[], None)).unwrap().is_err());
        assert!(understood(&text(&["status", "--settings", ""], None)).unwrap().is_err());
    }
}
