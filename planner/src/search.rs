//! What looks for a path round what blocks the straight line.
//!
//! Every searcher takes the same question and the same budget, in poses checked, and answers with proven edges, so that
//! the pipeline treats them alike and they can be compared.
use crate::foraging::{Foraged, Numbers, forage};
use crate::rng::SeededRng;
use crate::tree::{Search, Space, rrt, rrt_connect};
use taustream_motion::JointArray;

/// A method that searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Searcher {
    /// Two trees that grow towards each other.
    RrtConnect,
    /// One tree, from the start.
    Rrt,
    /// Foraging with virtual obstacles.
    Rbf,
    /// Foraging without.
    Bfo,
}

impl Searcher {
    /// What users read.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::RrtConnect => "RRT-Connect",
            Self::Rrt => "RRT",
            Self::Rbf => "RBF",
            Self::Bfo => "BFO",
        }
    }

    /// What its work is counted in.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::RrtConnect | Self::Rrt => "nodes",
            Self::Rbf | Self::Bfo => "steps",
        }
    }

    /// Looks for a path between two free poses until `checks_max` poses have been checked.
    pub fn search(
        self,
        space: &Space,
        ends: [&JointArray; 2],
        checks_max: usize,
        rng: &mut SeededRng,
    ) -> Search {
        let numbers = match self {
            Self::RrtConnect => return rrt_connect(space, ends[0], ends[1], checks_max, rng),
            Self::Rrt => return rrt(space, ends[0], ends[1], checks_max, rng),
            Self::Rbf => &Numbers::ROBUST,
            Self::Bfo => &Numbers::PLAIN,
        };
        // Our own numbers are not refused; if they were, there would be no path.
        let Foraged { path, steps, .. } = forage(space, ends, numbers, checks_max, rng).unwrap_or_default();
        Search { path, nodes: steps }
    }
}
