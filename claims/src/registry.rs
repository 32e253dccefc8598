//! Which experiments there are. A new one is a function and a line here.
use crate::claim::Claim;
use crate::figure::Figure;
use crate::run_context::{RunContext, Stop};
use crate::table::Table;
use crate::{paper_000, paper_001, paper_002, paper_003, paper_004};

/// One of the five papers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paper {
    /// Its number.
    pub number: u8,
    /// Its file.
    pub file: &'static str,
    /// What it proposes.
    pub about: &'static str,
}

/// The five.
pub const PAPERS: [Paper; 5] = [
    Paper { number: 0, file: "000_518aefc8cd38e163", about: "IBFOA over control points, Tau-J* strokes" },
    Paper { number: 1, file: "001_5e4af5ebec08e134", about: "ISMA, degree-7 B-splines, time and impact" },
    Paper { number: 2, file: "002_3862cf3632de683b", about: "virtual obstacles against traps in the plane" },
    Paper { number: 3, file: "003_b15e0e655e3bf4df", about: "IEPSO, reward and punishment" },
    Paper { number: 4, file: "004_e19ad8423bd62d7d", about: "IWO, via points and least-energy cubics" },
];

/// What an experiment brought.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Outcome {
    /// Parameters that the paper does not give, and ours.
    pub ours: Vec<String>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Claims with results.
    pub claims: Vec<Claim>,
}

/// An experiment.
#[derive(Clone, Copy)]
pub struct Experiment {
    /// Number of the paper whose claims it checks.
    pub paper: u8,
    /// What it looks at.
    pub name: &'static str,
    /// Does it.
    pub run: fn(&RunContext) -> Result<Outcome, Stop>,
}

/// Every experiment, in the order of the papers.
pub const EXPERIMENTS: &[Experiment] = &[
    Experiment { paper: 0, name: "interpolators", run: paper_000::profiles::run },
    Experiment { paper: 0, name: "equations at their word", run: paper_000::errata::run },
    Experiment { paper: 0, name: "case 1", run: paper_000::cases::case_1 },
    Experiment { paper: 0, name: "case 2", run: paper_000::cases::case_2 },
    Experiment { paper: 0, name: "three planners", run: paper_000::planners::run },
    Experiment { paper: 0, name: "number of control points", run: paper_000::count::run },
    Experiment { paper: 1, name: "benchmark functions", run: paper_001::benchmarks::run },
    Experiment { paper: 1, name: "new starts on the diagonal", run: paper_001::diagonal::run },
    Experiment { paper: 1, name: "spline", run: paper_001::spline::run },
    Experiment { paper: 2, name: "scenes with and without traps", run: paper_002::journeys::run },
    Experiment { paper: 2, name: "four robots", run: paper_002::robots::run },
    Experiment { paper: 3, name: "the paper's own rows", run: paper_003::printed::run },
    Experiment { paper: 3, name: "methods", run: paper_003::methods::run },
    Experiment { paper: 3, name: "reward", run: paper_003::reward::run },
    Experiment { paper: 4, name: "via points", run: paper_004::via::run },
    Experiment { paper: 4, name: "energy", run: paper_004::energy::run },
];
