//! The methods that the paper's tables hold against each other, and the variants that say why they differ.
use taustream_optimizers::{
    Bfoa, Bso, BsoStep, Exempt, Ibfoa, Optimizer, Parameters, Sampling, Schedule, Setup,
};

/// One of them.
pub(super) struct Contender {
    pub(super) name: &'static str,
    /// With the paper's numbers of a case.
    pub(super) make: fn(Parameters) -> Box<dyn Optimizer>,
}

pub(super) const BFOA: Contender = Contender {
    name: "BFOA",
    make: |parameters| Box::new(Bfoa { parameters, exempt: Exempt::Nobody, greedy: false }),
};
pub(super) const IBFOA: Contender =
    Contender { name: "IBFOA", make: |parameters| Box::new(Ibfoa { parameters, elite: Exempt::Healthiest }) };
pub(super) const BSO: Contender = Contender {
    name: "BSO",
    make: |parameters| Box::new(Bso { parameters, ..Bso::set_up(Setup::default()) }),
};
const BSO_STEP: Contender = Contender {
    name: "BSO of 2007",
    make: |parameters| Box::new(BsoStep { parameters, ..BsoStep::set_up(Setup::default()) }),
};
const BFOA_ELITE: Contender = Contender {
    name: "BFOA with the printed elite, no decay",
    make: |parameters| Box::new(Bfoa { parameters, exempt: Exempt::Healthiest, greedy: false }),
};
const IBFOA_BEST: Contender = Contender {
    name: "IBFOA, elite is the best now",
    make: |parameters| Box::new(Ibfoa { parameters, elite: Exempt::Best }),
};
pub(super) const GREEDY: Contender = Contender {
    name: "greedy BFOA",
    make: |parameters| Box::new(Bfoa { parameters, ..Bfoa::greedy(Setup::default()) }),
};
/// As many points as bacteria evaluate that tumble and never swim.
const SAMPLING: Contender = Contender {
    name: "random sampling",
    make: |p| {
        let iterations = p.tumbles * p.reproductions * p.dispersals;
        Box::new(Sampling { schedule: Schedule { population: 2 * p.population, iterations } })
    },
};

/// The paper's three: the order of its table 2 is IBFOA, BFOA, BSO.
pub(super) const PAPERS_OWN: [Contender; 3] = [BFOA, IBFOA, BSO];
/// All; those after the first [`WITH_A_CLAIM`] stand in tables only.
pub(super) const ALL: [Contender; 8] = [BFOA, IBFOA, BSO, BFOA_ELITE, GREEDY, BSO_STEP, IBFOA_BEST, SAMPLING];
/// How many of [`ALL`] some claim looks at.
pub(super) const WITH_A_CLAIM: usize = 5;
/// The paper's three and what is better.
pub(super) const GREEDY_TOO: [Contender; 4] = [BFOA, IBFOA, BSO, GREEDY];
