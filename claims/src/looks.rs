//! How many runs a comparison takes: it is looked at after n, 2n, 4n .. runs, until its word is settled.
//!
//! A group-sequential design with Bonferroni's bound over the looks (Pocock, "Group sequential methods in the design and
//! analysis of clinical trials", Biometrika 64, 1977, has the sharper one for normal data). Each look has its share of
//! the 5 %, so that no number of looks makes a word more frequent by chance. The numbers of runs were set before the runs.
use crate::claim::{Claim, Verdict};
use crate::statistics::Level;

/// The numbers of runs at which a comparison is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Looks {
    first: usize,
    count: u32,
}

impl Looks {
    /// After so many runs, and after twice as many as before until there were so many looks.
    #[must_use]
    pub const fn new(first: usize, count: u32) -> Self {
        Self { first, count }
    }

    /// Runs of the first look.
    #[must_use]
    pub const fn first(self) -> usize {
        self.first
    }

    /// Runs of the last look.
    #[must_use]
    pub fn last(self) -> usize {
        self.runs().last().unwrap_or(self.first)
    }

    /// The level of each look.
    #[must_use]
    pub fn level(self) -> Level {
        Level::FIVE_PERCENT.over(self.count as usize)
    }

    fn runs(self) -> impl Iterator<Item = usize> {
        (0..self.count).map(move |look| self.first.saturating_mul(1 << look.min(30)))
    }
}

/// Case 1 of paper 000: at the first look the interval of a gain is about ±2.5 %, at the last one half of its margin.
pub(crate) const CASE_1: Looks = Looks::new(48, 4);
/// Case 2, half a million evaluations a run, in a single look: six are the fewest of which a signed-rank test can say
/// anything, and one may end in collision.
pub(crate) const CASE_2: Looks = Looks::new(7, 1);
/// What paper 000 does not print.
pub(crate) const UNPRINTED_000: Looks = Looks::new(14, 3);
/// The functions of paper 001: what all of ten pairs agree on has p = 0.002.
pub(crate) const FUNCTIONS: Looks = Looks::new(10, 3);
/// ISMA without an addition: at the first look one of six functions needs ten pairs at least.
pub(crate) const PARTS: Looks = Looks::new(20, 2);
/// What paper 001 does not print: what all of eight pairs agree on has p = 0.008.
pub(crate) const UNPRINTED_001: Looks = Looks::new(8, 2);
/// IEPSO with and without the reward of paper 003.
pub(crate) const REWARD: Looks = Looks::new(30, 7);
/// The same at each largest error, which the paper does not print.
pub(crate) const UNPRINTED_003: Looks = Looks::new(12, 4);

/// All of them, by experiment.
pub(crate) const DESIGN: [(&str, Looks); 8] = [
    ("000, case 1", CASE_1),
    ("000, case 2", CASE_2),
    ("000, numbers that are not printed", UNPRINTED_000),
    ("001, benchmark functions at equal evaluations", FUNCTIONS),
    ("001, parts of ISMA", PARTS),
    ("001, numbers that are not printed", UNPRINTED_001),
    ("003, reward", REWARD),
    ("003, numbers that are not printed: the reward", UNPRINTED_003),
];

/// The design as text.
pub(crate) fn design() -> String {
    let one = |(name, looks): &(&str, Looks)| {
        let runs: Vec<String> = looks.runs().map(|runs| runs.to_string()).collect();
        format!("{name}: {}", runs.join(", "))
    };
    DESIGN.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// One look.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// How many runs there are by now.
    pub runs: usize,
    /// The level of its intervals.
    pub level: Level,
    /// Which claims an earlier look has settled; empty at the first one.
    settled: Vec<bool>,
}

impl Look {
    /// True for the first one.
    #[must_use]
    pub fn is_first(&self) -> bool {
        self.settled.is_empty()
    }

    /// True for a claim that no look has settled.
    #[must_use]
    pub fn is_open(&self, claim: usize) -> bool {
        !self.settled.get(claim).copied().unwrap_or(false)
    }
}

/// Looks until all claims are settled: a claim stays what the first look says that tells it apart, with the numbers of that
/// look. What none does is not told apart. The claims come in the same order at every look; what a later one says of a
/// settled claim does not count, so it needs no further runs.
///
/// # Errors
/// The first of `look`.
pub fn settle<E>(
    looks: Looks,
    mut look: impl FnMut(&Look) -> Result<Vec<Claim>, E>,
) -> Result<Vec<Claim>, E> {
    let mut claims: Vec<Claim> = Vec::new();
    let mut settled = Vec::new();
    for runs in looks.runs() {
        let now = look(&Look { runs, level: looks.level(), settled })?;
        if claims.is_empty() {
            claims = now;
        } else {
            let open = claims.iter_mut().zip(now).filter(|(claim, _)| claim.verdict == Verdict::Open);
            open.for_each(|(claim, now)| *claim = now);
        }
        settled = claims.iter().map(|claim| claim.verdict != Verdict::Open).collect();
        if settled.iter().all(|settled| *settled) {
            break;
        }
    }
    Ok(claims)
}
