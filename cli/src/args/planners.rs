//! Arguments of `taustream bench planners`.
use clap::Args;
use std::env;
use std::path::PathBuf;
use taustream_claims::Effort;
use taustream_claims::planners::Entrant;

const PLANNERS_HELP: &str = "\
Examples:
  taustream bench planners --quick                            every planner on a few problems; proves nothing
  taustream bench planners --planners auto,rrt-connect,rbf    these three, on 20 problems a set
  taustream bench planners --planners improvements            the improvements of the default planner
  taustream bench planners --robot piper --scene my-cell.toml --problems 50 -o my-cell
  TAUSTREAM_MBM_DIR=../mbm taustream bench planners           with published problems, read from that directory

Start and goal are random, clear, and joined by a path by construction; the straight line between them is blocked.
Sets: the scenes given (shelf and pillars, if none), clutter (other obstacles for every problem), cup (three walls
between start and goal), and the published problems.

The deadline sets the budget and the clock does not abort, so all numbers except the times are the same on any machine,
with any --jobs. Times are processor time; compare them only as ratios to the first planner of the same run.
Names: those of `taustream plan --planner`; auto+none, auto+searches and auto+METHOD are the default planner with
another improvement; `all` and `improvements` are lists of them. docs/planner.md has a full run.";

/// `taustream bench planners`
#[derive(Args, Debug)]
#[command(after_help = PLANNERS_HELP)]
pub(crate) struct PlannersArgs {
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE", default_value = "ur5")]
    pub(crate) robot: PathBuf,
    /// Scenes: paths, or names of shipped scenes.
    #[arg(long, value_name = "FILE", num_args = 1.., default_values = ["shelf", "pillars"])]
    pub(crate) scene: Vec<PathBuf>,
    /// Problems per set.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 20, value_parser = count)]
    pub(crate) problems: usize,
    /// Planners; the first one is the reference.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', default_value = "all")]
    pub(crate) planners: Vec<String>,
    /// Deadline that sets the budget of each plan, ms.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) deadline_ms: u32,
    /// Directory of published problems (see docs/planner.md); without it, `TAUSTREAM_MBM_DIR`.
    #[arg(long, value_name = "DIR")]
    pub(crate) published: Option<PathBuf>,
    /// Do two problems per set with a small budget, whatever the other options say.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Threads; times are valid with one thread only.
    #[arg(long, value_name = "J", allow_negative_numbers = true, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) jobs: u16,
    /// Directory to write planners.md and planners.json into; created if missing.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

impl PlannersArgs {
    /// The extent of the experiments.
    pub(crate) fn effort(&self) -> Effort {
        Effort { runs: None, quick: self.quick, seed: self.seed, jobs: self.jobs.into() }
    }

    /// Where published problems are.
    pub(crate) fn published(&self) -> Option<PathBuf> {
        let named = || env::var_os("TAUSTREAM_MBM_DIR").filter(|v| !v.is_empty()).map(PathBuf::from);
        self.published.clone().or_else(named)
    }

    /// The planners to compare.
    pub(crate) fn entrants(&self) -> Result<Vec<Entrant>, String> {
        let mut entrants: Vec<Entrant> = Vec::new();
        for name in &self.planners {
            let named = match name.trim() {
                "all" => Entrant::all(),
                "improvements" => Entrant::improvements(),
                name => vec![Entrant::from_name(name)?],
            };
            for entrant in named {
                // Once is enough, wherever a list repeats it.
                if !entrants.contains(&entrant) {
                    entrants.push(entrant);
                }
            }
        }
        Ok(entrants)
    }
}

fn count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(number) if (1..=10_000).contains(&number) => Ok(number),
        _ => Err("expected a whole number from 1 to 10000".to_owned()),
    }
}
