//! Stalls one thread of a process: a debugger holds it, everything else of the process continues.
use anyhow::{Context, Result};
use nix::sys::ptrace::{self, Options};
use nix::sys::wait::{WaitPidFlag, waitpid};
use nix::unistd::Pid;
use std::fs;
use std::io::Write;

/// The threads of a process that have a name, by number.
///
/// # Errors
/// When the process is gone.
pub fn threads(process: u64) -> Result<Vec<(i32, String)>> {
    let mut threads = Vec::new();
    for entry in fs::read_dir(format!("/proc/{process}/task")).context("the process is gone")? {
        let folder = entry?.path();
        let number = folder.file_name().and_then(|name| name.to_str()).and_then(|name| name.parse().ok());
        let name = fs::read_to_string(folder.join("comm"))?;
        threads.push((number.context("a thread without number")?, name.trim().to_owned()));
    }
    Ok(threads)
}

/// Holds a thread until the process is killed or this one is. Says `stalled` when it stands.
///
/// # Errors
/// When there is no such thread, or it cannot be held.
pub fn hold(process: u64, name: &str) -> Result<()> {
    let threads = threads(process)?;
    let found = threads.iter().find(|(_, thread)| thread == name);
    let thread = Pid::from_raw(found.with_context(|| format!("no thread `{name}` among {threads:?}"))?.0);
    ptrace::seize(thread, Options::empty()).context("seize")?;
    ptrace::interrupt(thread).context("interrupt")?;
    waitpid(thread, Some(WaitPidFlag::__WALL)).context("wait for the stop")?;
    writeln!(std::io::stdout(), "stalled")?;
    std::io::stdout().flush()?;
    // Its end has to be taken note of: until then a process that was killed is not gone.
    waitpid(thread, Some(WaitPidFlag::__WALL)).context("wait for the end")?;
    Ok(())
}
