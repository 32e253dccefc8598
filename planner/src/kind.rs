//! Which method looks for the path, by the words that users write.
use crate::optimize::{METHODS, Method};

/// Which method looks for the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlannerKind {
    /// Straight line, then RRT-Connect, then IBFOA refinement of what was found; the best verified motion wins.
    #[default]
    Auto,
    /// The straight joint-space line, or nothing.
    Straight,
    /// RRT-Connect with shortcuts.
    RrtConnect,
    /// The plain RRT with shortcuts: one tree, from the start.
    Rrt,
    /// A metaheuristic over three control points, started from the straight line only (the papers' way). Its best
    /// path counts only when every edge of it is proven free; otherwise there is no plan.
    Optimiser(&'static Method),
}

impl PlannerKind {
    /// Every kind; each method of the registry is one.
    pub fn all() -> impl Iterator<Item = Self> {
        let own = [Self::Auto, Self::Straight, Self::RrtConnect, Self::Rrt];
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
            Self::Optimiser(method) => method.name,
        }
    }

    /// One line for a list.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Auto => "straight line, else search, shortcuts and refinement; the best motion wins",
            Self::Straight => "straight joint-space line, or nothing",
            Self::RrtConnect => "two random trees that grow towards each other, with shortcuts",
            Self::Rrt => "one random tree from the start (LaValle 1998), with shortcuts",
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
