//! The installed services under a real systemd: boots them on the host, tries them in the guest.
use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use taustream_tests::booted::Booted;
use taustream_tests::services::{checks, files, stall};
use taustream_tests::{debian, machine, slice};

/// Tries the installed services under a real systemd.
#[derive(Debug, Parser)]
#[command(name = "services")]
struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// On the host: boot a Debian with systemd as process 1 and what is installed in STAGE, and try everything there.
    Boot {
        /// What `cargo xtask install --root STAGE` has installed.
        #[arg(long)]
        stage: PathBuf,
        /// Where the Debian image is kept.
        #[arg(long)]
        cache: PathBuf,
        /// Where the journal and the reports of systemd-analyze are left.
        #[arg(long)]
        output: PathBuf,
        /// How long the trials may take, s.
        #[arg(long, default_value_t = 240)]
        limit_s: u32,
        /// Only checks whose name contains this.
        #[arg(long, default_value = "")]
        only: String,
    },
    /// In the guest: try everything.
    Check {
        /// Only checks whose name contains this.
        #[arg(default_value = "")]
        only: String,
    },
    /// In the guest: hold a thread of a process.
    Stall {
        /// The process.
        process: u64,
        /// The name of its thread.
        thread: String,
    },
}

fn main() -> ExitCode {
    match perform(Arguments::parse().what) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("services: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn perform(what: What) -> Result<usize> {
    match what {
        What::Check { only } => checks::run(&only),
        What::Stall { process, thread } => stall::hold(process, &thread).map(|()| 0),
        What::Boot { stage, cache, output, limit_s, only } => {
            let stop = Arc::new(AtomicBool::new(false));
            for number in [SIGINT, SIGTERM, SIGHUP] {
                signal_hook::flag::register(number, Arc::clone(&stop))?;
            }
            let image = debian::image(&cache)?;
            let since = Instant::now();
            // Made again: files of an earlier run must not pass a check.
            for folder in [&output, &cache.join("controller")] {
                let _not_there = std::fs::remove_dir_all(folder);
                std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
            }
            let controller = cache.join("controller");
            files::lay_out(&controller, &stage)?;
            // Inherited by the machine.
            slice::shorten();
            let booted = Booted { image: &image, files: &[&stage, &controller], output: &output, limit_s };
            let status = booted.run(&["/opt/services", "check", &only], &stop)?;
            println!("booted, tried and ended in {:.0} s", since.elapsed().as_secs_f64());
            if status == machine::TIMED_OUT {
                eprintln!("services: no end after {limit_s} s; {} has the journal", output.display());
            }
            Ok(status.into())
        }
    }
}
