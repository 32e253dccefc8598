//! Who may what: users, files and modes, and the way of operators to the services.
use super::guest::{as_user, done, run};
use super::{ARM, OPERATOR, STRANGER, arm};
use anyhow::{Result, ensure};
use std::fs;

/// Path, mode, owner and group of what the services stand on.
const OWNERS: [(&str, &str); 8] = [
    ("/run/taustream", "700 taustream taustream"),
    ("/var/lib/taustream", "700 taustream taustream"),
    ("/var/lib/taustream/arm1", "700 taustream taustream"),
    ("/etc/taustream", "755 root root"),
    ("/etc/taustream/settings", "755 root root"),
    ("/etc/sudoers.d/taustream", "440 root root"),
    ("/usr/bin/taustream", "755 root root"),
    ("/usr/lib/systemd/system/taustream-streamer@.service", "644 root root"),
];

/// The user, the group, the files.
///
/// # Errors
/// What is not as it should be.
pub fn files() -> Result<String> {
    for (path, expected) in OWNERS {
        let got = done(&["stat", "--format", "%a %U %G", path])?;
        ensure!(got.trim() == expected, "{path} is {}, not {expected}", got.trim());
    }
    done(&["getent", "group", "taustream-operators"])?;
    let shell = done(&["getent", "passwd", "taustream"])?;
    ensure!(shell.trim().ends_with("nologin"), "the services' user can log in: {shell}");
    for line in
        done(&["find", "/dev/shm", "/run/taustream", "-name", "*taustream*", "-printf", "%u %m %p\n"])?
            .lines()
    {
        let ours = line.starts_with("taustream ");
        ensure!(ours && !line.contains(" 644 ") && !line.contains(" 666 "), "shared memory is open: {line}");
    }
    done(&["visudo", "-c", "-q"])?;
    Ok(format!("{} places", OWNERS.len()))
}

/// Makes the people of this machine.
///
/// # Errors
/// When they cannot be made.
pub fn make_people() -> Result<()> {
    for name in [OPERATOR, STRANGER] {
        done(&["useradd", "--create-home", "--shell", "/bin/bash", name])?;
        done(&["chmod", "700", &format!("/home/{name}")])?;
    }
    done(&["usermod", "-aG", "taustream-operators", OPERATOR])?;
    Ok(())
}

/// The arm moves by `replan` and by `run` of a file that only the operator can read.
///
/// # Errors
/// When it does not.
pub fn operator() -> Result<String> {
    let how = arm::make_ready()?;
    arm::go_to(&arm::GOALS[0])?;
    let text = |goal: &[f64]| goal.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let (start, goal) = (text(&arm::GOALS[0]), text(&arm::GOALS[1]));
    let plan = arm::taustream(&[
        "plan",
        "--robot",
        "ur5",
        "--scene",
        "open",
        "--start",
        &start,
        "--goal",
        &goal,
        "-o",
        "move.json",
    ])?;
    ensure!(plan.status == Some(0), "plan: {}", plan.err);
    done(&["chmod", "600", &format!("/home/{OPERATOR}/move.json")])?;
    let ran = arm::taustream(&["run", "move.json"])?;
    ensure!(ran.status == Some(0), "run ended with {:?}: {}", ran.status, ran.err);
    arm::wait_at(&arm::GOALS[1])?;
    let missing = arm::taustream(&["run", "none.json"])?;
    ensure!(missing.status == Some(2), "run of no file ended with {:?}", missing.status);
    Ok(format!("{how:?}, replan and run"))
}

/// Another user gets the remedy, and no access.
///
/// # Errors
/// When the arm listens.
pub fn stranger() -> Result<String> {
    let answer = as_user(STRANGER, &["taustream", "status"])?;
    let has_remedy = answer.err.contains("usermod -aG taustream-operators stan");
    ensure!(answer.status == Some(1) && has_remedy, "another user got {answer:?}");
    let by_settings = as_user(STRANGER, &["taustream", "status", "--settings", ARM, "--json"])?;
    ensure!(by_settings.status == Some(1) && by_settings.err.starts_with("{\"error\""), "{by_settings:?}");
    Ok(answer.err.trim().to_owned())
}

/// The sudo rule lets an operator do nothing else as the services' user.
///
/// # Errors
/// What it lets through.
pub fn sudo_rule() -> Result<String> {
    let sudo = ["/usr/bin/sudo", "-n", "-u", "taustream"];
    let refused: [&[&str]; 8] = [
        &["/usr/bin/taustream", "status"],
        &["/usr/bin/taustream", "handed-over", "--json"],
        &["/usr/bin/taustream", "--json", "handed-over"],
        &["/usr/bin/taustream"],
        &["/bin/sh", "-c", "true"],
        &["TAUSTREAM_CONFIG_DIR=/home/olga", "/usr/bin/taustream", "handed-over"],
        &["-E", "/usr/bin/taustream", "handed-over"],
        &["-s"],
    ];
    for words in refused {
        let answer = as_user(OPERATOR, &[&sudo[..], words].concat())?;
        ensure!(
            answer.status == Some(1) && answer.err.contains("sudo: "),
            "sudo let {words:?} through: {answer:?}"
        );
    }
    let root = as_user(OPERATOR, &["/usr/bin/sudo", "-n", "/usr/bin/taustream", "handed-over"])?;
    ensure!(root.status == Some(1), "sudo gives root away: {root:?}");
    orders(&sudo)?;
    path()?;
    Ok(format!("{} ways refused", refused.len() + 1))
}

/// What may run takes no order that touches a file.
fn orders(sudo: &[&str]) -> Result<()> {
    let command = format!("{} /usr/bin/taustream handed-over", sudo.join(" "));
    for words in [
        r#"["check","/var/lib/taustream/arm1"]"#,
        r#"["plan","--robot","ur5","--scene","open","--start","0","--goal","0","-o","/var/lib/taustream/x"]"#,
        r#"["status","--settings","/home/olga/own.toml"]"#,
        r#"["handed-over"]"#,
    ] {
        let order = format!(r#"{{"version":1,"words":{words},"trajectory":null}}"#);
        let line = format!("printf %s '{order}' | {command}");
        let answer = as_user(OPERATOR, &["bash", "-c", &line])?;
        ensure!(answer.status == Some(2) && answer.err.contains("refused"), "{words} gave {answer:?}");
    }
    let own = run(&["/usr/bin/taustream", "handed-over"])?;
    ensure!(own.status == Some(2), "root took an order as the services' user: {own:?}");
    Ok(())
}

/// A `sudo` and a `taustream` of the caller's own are not called.
fn path() -> Result<()> {
    let folder = format!("/home/{OPERATOR}/bin");
    fs::create_dir_all(&folder)?;
    for name in ["sudo", "taustream"] {
        fs::write(format!("{folder}/{name}"), "#!/bin/sh\ntouch /tmp/called\n")?;
        done(&["chmod", "755", &format!("{folder}/{name}")])?;
    }
    let answer =
        as_user(OPERATOR, &["env", &format!("PATH={folder}:/usr/bin:/bin"), "/usr/bin/taustream", "status"])?;
    ensure!(answer.status == Some(0), "with a PATH of one's own: {}", answer.err);
    ensure!(!fs::exists("/tmp/called")?, "a program of the caller's PATH was started");
    fs::remove_dir_all(folder)?;
    Ok(())
}
