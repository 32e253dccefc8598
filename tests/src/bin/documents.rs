//! Runs every command block of README and docs as printed, on the local link, without rights of any kind.
use anyhow::{Context, Result, ensure};
use clap::Parser;
use std::env;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use taustream_tests::demo_file::programs_beside;
use taustream_tests::documents::{Block, Kind, blocks};

/// Runs the command blocks of the documentation.
#[derive(Parser, Debug)]
struct Arguments {
    /// The source tree.
    #[arg(long, default_value = ".")]
    root: PathBuf,
    /// Folder of the built programs; default: where this program is.
    #[arg(long)]
    programs: Option<PathBuf>,
    /// Folder for what the commands write.
    #[arg(long, default_value = "target/documents")]
    output: PathBuf,
    /// Only files whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("documents: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<usize> {
    let root = arguments.root.canonicalize().context("the source tree")?;
    let programs = arguments.programs.clone().map_or_else(programs_beside, Ok)?.canonicalize()?;
    let mut all = Vec::new();
    for file in pages(&root)? {
        let name = file.strip_prefix(&root)?.to_owned();
        if name.to_string_lossy().contains(&arguments.only) {
            all.extend(blocks(&name, &fs::read_to_string(&file)?)?);
        }
    }
    ensure!(!all.is_empty(), "no command block in a file called `{}`", arguments.only);
    fs::create_dir_all(&arguments.output)?;
    let output = arguments.output.canonicalize()?;
    let config = unhurried_config(&root, &output)?;
    let mut failed = 0;
    for (number, block) in all.iter().enumerate() {
        let place = output.join(format!("{number:02}"));
        if place.exists() {
            fs::remove_dir_all(&place)?;
        }
        let result = match block.kind {
            Kind::Checkout => block.check_covered(),
            Kind::Run => run_block(block, &place, &programs, &config),
        };
        let title = format!("{}:{}", block.file.display(), block.line);
        match result {
            Ok(()) => println!("{title}: passed"),
            Err(error) => {
                failed += 1;
                println!("{title}: FAILED: {error:#}");
            }
        }
    }
    println!("{} passed, {failed} failed", all.len() - failed);
    Ok(failed)
}

/// README and everything in docs, decision records too.
fn pages(root: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for folder in [root.to_owned(), root.join("docs"), root.join("docs/adr")] {
        let entries =
            fs::read_dir(&folder).with_context(|| format!("{} cannot be read", folder.display()))?;
        for entry in entries {
            let path = entry?.path();
            if path.extension().is_some_and(|end| end == "md") {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// The shipped configuration with an unhurried cycle: these commands are tested, not the host's scheduling.
fn unhurried_config(root: &Path, output: &Path) -> Result<PathBuf> {
    let config = output.join("config");
    if config.exists() {
        fs::remove_dir_all(&config)?;
    }
    for folder in ["robots", "scenes", "settings", "paths"] {
        copy_tree(&root.join("config").join(folder), &config.join(folder))?;
    }
    for entry in fs::read_dir(config.join("settings"))? {
        let path = entry?.path();
        let text = fs::read_to_string(&path)?;
        // An arm of its own: services of one name and user are one arm, whatever their runtime directory.
        let own = format!("\nname = \"documents-{}\"", std::process::id());
        let slow: Vec<String> = text.lines().map(unhurried).collect();
        let slow = slow.join("\n");
        let name =
            slow.lines().find(|line| line.starts_with("name = ")).context("settings without a name")?;
        fs::write(&path, slow.replacen(&format!("\n{name}"), &own, 1))?;
    }
    Ok(config)
}

/// A line of a settings file, with its time limits wide enough for a computer that does other things.
fn unhurried(line: &str) -> String {
    const WIDE: [(&str, &str); 5] = [
        ("period_us", "5000"),
        ("stall_resume_ms", "2000"),
        ("drive_watchdog_ms", "4000"),
        ("feedback_age_s_max", "1.0"),
        ("drive_timeout_s", "30.0"),
    ];
    let key = line.split('=').next().unwrap_or("").trim();
    let wide = WIDE.iter().find(|(name, _)| *name == key);
    wide.map_or_else(|| line.to_owned(), |(name, value)| format!("{name} = {value}"))
}

fn copy_tree(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_tree(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

fn run_block(block: &Block, place: &Path, programs: &Path, config: &Path) -> Result<()> {
    // Short, because a socket's path holds 107 bytes at most.
    let runtime = env::temp_dir().join(format!("ts-documents-{}", std::process::id()));
    fs::create_dir_all(&runtime)?;
    fs::set_permissions(&runtime, fs::Permissions::from_mode(0o700))?;
    let inherited = env::var_os("PATH").unwrap_or_default();
    let path = env::join_paths(std::iter::once(programs.to_owned()).chain(env::split_paths(&inherited)))?;
    let state = place.join("state");
    let ran = block.run(
        &place.join("work"),
        &[
            ("PATH", Path::new(&path)),
            ("TAUSTREAM_CONFIG_DIR", config),
            ("TAUSTREAM_RUNTIME_DIR", &runtime),
            ("XDG_STATE_HOME", &state),
            ("HOME", place),
            ("NO_COLOR", Path::new("1")),
        ],
    );
    fs::remove_dir_all(&runtime)?;
    ran
}
