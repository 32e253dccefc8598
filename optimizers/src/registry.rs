//! Which methods there are, by name. A new one is a file beside this one and a line here.
use super::{Bfoa, Boa, Bso, BsoStep, De, Ga, Gwo, Ibfoa, Iepso, Isma, Iwo, Optimizer, Pso, Sma, Ssa};

/// Where a paper's text cannot be meant as printed: which reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// What must have been meant; each method's file says what was corrected.
    #[default]
    Corrected,
    /// The letter of the paper.
    Printed,
}

impl Reading {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Corrected, Self::Printed];

    /// The word that users write.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Corrected => "corrected",
            Self::Printed => "printed",
        }
    }

    /// One line for a list.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Corrected => "what must have been meant",
            Self::Printed => "the letter of the paper",
        }
    }

    /// The reading of a word; `None` for a word that is unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|reading| reading.name() == name)
    }
}

/// How a method is set up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Setup {
    /// Which reading of its paper.
    pub reading: Reading,
    /// Evaluations that its schedule is fitted to; `None` is the paper's own schedule.
    pub evaluations: Option<usize>,
}

/// One registered method; two of one name are the same.
#[derive(Clone, Copy)]
pub struct Method {
    /// The word that users write.
    pub name: &'static str,
    /// One line for a list.
    pub about: &'static str,
    /// Makes it.
    pub make: fn(Setup) -> Box<dyn Optimizer>,
}

impl std::fmt::Debug for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Method {}

macro_rules! method {
    ($name:literal, $about:literal, $make:expr) => {
        Method { name: $name, about: $about, make: |setup| Box::new($make(setup)) }
    };
}

/// Every method.
pub const METHODS: &[Method] = &[
    method!("ibfoa", "bacterial foraging with decay and elite (Wang et al. 2022)", Ibfoa::set_up),
    method!("bfoa", "bacterial foraging (Passino 2002)", Bfoa::set_up),
    method!("bso", "bacterial foraging along particle velocities (Korani 2008)", Bso::set_up),
    method!(
        "bso-step",
        "bacterial foraging, then a particle's step to the best (Biswas et al. 2007)",
        BsoStep::set_up
    ),
    method!("greedy-bfoa", "bacterial foraging that takes worsening steps back", Bfoa::greedy),
    method!(
        "isma",
        "slime mould with crossover, bee search, parabolas (Li, Xing and Qin 2025)",
        Isma::set_up
    ),
    method!("sma", "slime mould (Li et al. 2020)", Sma::set_up),
    method!("boa", "butterflies (Arora and Singh 2019)", Boa::set_up),
    method!("gwo", "grey wolves (Mirjalili et al. 2014)", Gwo::set_up),
    method!("ssa", "sparrow search (Xue and Shen 2020)", Ssa::set_up),
    method!("iepso", "particles with exchange and elimination (Lv et al. 2019)", Iepso::set_up),
    method!("pso", "particles of 1995, without damping (Kennedy and Eberhart)", Pso::original),
    method!("spso", "particles with constriction (Clerc and Kennedy 2002)", Pso::standard),
    method!("ga", "genetic algorithm: tournament, blend, Gaussian mutation", Ga::set_up),
    method!("de", "differential evolution, rand/1/bin (Storn and Price 1997)", De::set_up),
    method!("iwo", "invasive weeds (Mehrabian and Lucas 2006)", Iwo::set_up),
];

/// A name that is not in use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no optimiser named \"{name}\"; there are {}", names())]
pub struct Unknown {
    /// The name that was requested.
    pub name: String,
}

fn names() -> String {
    METHODS.iter().map(|m| m.name).collect::<Vec<_>>().join(", ")
}

/// The method of a name.
///
/// # Errors
/// Lists the names when this is none of them.
pub fn by_name(name: &str, setup: Setup) -> Result<Box<dyn Optimizer>, Unknown> {
    let method = METHODS.iter().find(|m| m.name == name);
    method.map(|m| (m.make)(setup)).ok_or_else(|| Unknown { name: name.chars().take(64).collect() })
}
