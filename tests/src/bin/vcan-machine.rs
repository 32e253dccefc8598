//! Boots the vcan machine and runs one command in it.
use clap::Parser;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use taustream_tests::machine::Machine;
use taustream_tests::slice;

/// The machine itself failed, as opposed to the command.
const FAILED: u8 = 125;

/// Run a command in a machine whose kernel has CAN.
///
/// Boots user-mode Linux on this host's own files, brings vcan0 and vcan1 up, runs COMMAND there as root in the same
/// directory with the same environment (and TAUSTREAM_VCAN=1), passes its output through and returns its status.
/// What the command writes stays in memory and is lost, except in --writable directories. Needs the Debian packages
/// user-mode-linux, iproute2, can-utils and kmod; needs no CAN in the host's kernel.
///
/// Example: vcan-machine --limit-s 60 -- cargo-built-test --nocapture
///
/// Exit status: the command's; 124 it ran out of time; 125 the machine itself failed; 128 + n ended by signal n.
#[derive(Debug, Parser)]
#[expect(clippy::doc_markdown, reason = "these lines are the help text, which is plain")]
#[command(name = "vcan-machine", version)]
struct Arguments {
    /// Seconds that the command may take.
    #[arg(long, value_name = "S", default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..))]
    limit_s: u32,
    /// Memory of the guest in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(128..))]
    memory: u32,
    /// Directory that stays writable through to the host (repeatable).
    #[arg(long, value_name = "DIR")]
    writable: Vec<PathBuf>,
    /// Nice value of the machine on the host, if that is permitted.
    #[arg(long, value_name = "N", default_value_t = -20, allow_hyphen_values = true, value_parser = clap::value_parser!(i8).range(-20..=19))]
    nice: i8,
    /// Run the machine at this SCHED_FIFO priority of the host instead, if that is permitted. Only for commands that
    /// sleep most of the time: the host stops busy real-time processes for 50 ms of every second.
    #[arg(long, value_name = "PRIO", value_parser = clap::value_parser!(u8).range(1..=99))]
    realtime: Option<u8>,
    /// CPU of the host to bind the machine to [default: the last].
    #[arg(long, value_name = "CPU")]
    cpu: Option<usize>,
    /// How many vcan interfaces.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=32))]
    interfaces: u32,
    /// The command and its arguments.
    #[arg(required = true, trailing_var_arg = true, allow_hyphen_values = true)]
    command: Vec<OsString>,
}

fn main() -> anyhow::Result<ExitCode> {
    let arguments = Arguments::try_parse().unwrap_or_else(|error| error.exit());
    let stop = Arc::new(AtomicBool::new(false));
    let signal = Arc::new(AtomicUsize::new(0));
    for number in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register_usize(number, Arc::clone(&signal), usize::try_from(number)?)?;
        signal_hook::flag::register(number, Arc::clone(&stop))?;
    }
    let mut machine = Machine::new()
        .limit_s(arguments.limit_s)
        .memory_mib(arguments.memory)
        .interfaces(arguments.interfaces)
        .nice(arguments.nice)
        .realtime(arguments.realtime);
    if arguments.cpu.is_some() {
        machine = machine.cpu(arguments.cpu);
    }
    for directory in arguments.writable {
        machine = machine.writable(directory);
    }
    // Inherited by what it starts.
    slice::shorten();
    match machine.run(&arguments.command, &stop) {
        Ok(status) => Ok(ExitCode::from(status)),
        Err(error) => {
            eprintln!("vcan-machine: {error}");
            let by_signal = u8::try_from(signal.load(Ordering::Relaxed)).ok().filter(|number| *number != 0);
            Ok(ExitCode::from(by_signal.map_or(FAILED, |number| number.saturating_add(128))))
        }
    }
}
