//! Experiments that check the claims of five papers (papers.md) and show our numbers beside the printed ones.
//!
//! An [`Experiment`] runs the planner's methods on the papers' problems ([`taustream_optimizers::papers`]) and answers
//! with tables, pictures and claims. The papers' own values are the only constants in them ([`Cell::Paper`]);
//! everything else was measured in this run, and a verdict follows from those numbers by a rule that stands beside
//! it. One seed gives one answer on any number of threads. Nothing here plans for a real arm, and no time is measured
//! but as a ratio.
//!
//! `taustream bench papers` runs them; papers.md holds what a full run said.
#![forbid(unsafe_code)]

pub mod chart;
mod claim;
mod effect;
mod figure;
mod index;
mod looks;
mod number;
mod paper_000;
mod paper_001;
mod paper_002;
mod paper_003;
mod paper_004;
pub mod planners;
mod registry;
mod report;
mod run_context;
pub mod statistics;
mod swept;
mod table;
mod trial;
mod wrap;

pub use claim::{Claim, Verdict, agrees};
pub use effect::{Claimed, Effect};
pub use figure::Figure;
pub use looks::{Look, Looks, settle};
pub use number::figures;
pub use registry::{EXPERIMENTS, Experiment, Outcome, PAPERS, Paper};
pub use report::{Chapter, Report, Selection, run};
pub use run_context::{Effort, RunContext, Stop};
pub use table::{Cell, Row, Table};
pub use trial::{Sample, Trial, convergence, minimise};
