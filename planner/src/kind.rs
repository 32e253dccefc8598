//! Which method looks for the path, by the names that users write.
use taustream_optimizers::{METHODS, Method};

/// Which method looks for the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlannerKind {
    /// Straight line, then RRT-Connect, then an [`Improvement`] of what was found; the best verified motion wins.
    #[default]
    Auto,
    /// The straight joint-space line, or nothing.
    Straight,
    /// RRT-Connect with shortcuts.
    RrtConnect,
    /// The plain RRT with shortcuts: one tree, from the start.
    Rrt,
    /// Foraging with virtual obstacles as an escape from traps (Abdi et al. 2020), with shortcuts.
    Rbf,
    /// The same without virtual obstacles, with shortcuts.
    Bfo,
    /// A metaheuristic over three control points, started from the straight line only (the papers' way). Its best
    /// path counts only when every edge of it is proven free; otherwise there is no plan.
    Optimiser(&'static Method),
}

impl PlannerKind {
    /// Every kind; each method of the registry is one.
    pub fn all() -> impl Iterator<Item = Self> {
        let own = [Self::Auto, Self::Straight, Self::RrtConnect, Self::Rrt, Self::Rbf, Self::Bfo];
        own.into_iter().chain(METHODS.iter().map(Self::Optimiser))
    }

    /// The word that users write.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Straight => "straight",
            Self::RrtConnect => "rrt-connect",
            Self::Rrt => "rrt",
            Self::Rbf => "rbf",
            Self::Bfo => "bfo",
            Self::Optimiser(method) => method.name,
        }
    }

    /// True when it keeps constraints of poses ([`crate::constraints`]).
    #[must_use]
    pub fn keeps_constraints(self) -> bool {
        matches!(self, Self::Auto | Self::Straight | Self::RrtConnect)
    }

    /// One line for a list.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Auto => "straight line, else search, shortcuts and refinement; the best motion wins",
            Self::Straight => "straight joint-space line, or nothing",
            Self::RrtConnect => "two random trees that grow towards each other, with shortcuts",
            Self::Rrt => "one random tree from the start (LaValle 1998), with shortcuts",
            Self::Rbf => "greedy foraging, virtual obstacles where it is trapped (Abdi et al. 2020)",
            Self::Bfo => "greedy foraging, from the start again where it is trapped",
            Self::Optimiser(method) => method.about,
        }
    }

    /// The kind of a word; `None` for a word that is unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|kind| kind.name() == name)
    }

    /// Every word, for a sentence.
    #[must_use]
    pub fn names() -> String {
        Self::all().map(Self::name).collect::<Vec<_>>().join(", ")
    }
}

/// What the default planner does with its budget once a path round the obstacle is found. docs/planner.md has the
/// measurement that the default was chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Improvement {
    /// Nothing.
    Nothing,
    /// More searches, as many poses as a metaheuristic would check.
    Searches,
    /// A metaheuristic over control points, from the path and from the straight line.
    Method(&'static Method),
}

impl Default for Improvement {
    fn default() -> Self {
        Self::from_name("iwo").unwrap_or(Self::Nothing)
    }
}

impl Improvement {
    /// The improvement of a word: `none`, `searches`, or a method's name; `None` for a word that is unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "none" => Some(Self::Nothing),
            "searches" => Some(Self::Searches),
            _ => METHODS.iter().find(|m| m.name == name).map(Self::Method),
        }
    }
}
