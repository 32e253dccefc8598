//! The first answer and what can be gained at once: RRT-Connect over sampled edges, shortcuts, timing, proof.
//!
//! A search looks at samples, so that now and then its path touches something between two of them. Then the proof of its motion
//! fails, and the next search looks at samples that are twice as near.
use super::{CLEARLY_LESS, Pipeline, searched};
use crate::collide::SweepRules;
use crate::constraints;
use crate::lanes::Lanes;
use crate::rng::SeededRng;
use crate::sampled::{Sampled, Sampling};
use crate::search::Searcher;
use crate::shortcut::{Effort, shorten_until_stalled};
use crate::tree::rrt_connect;
use taustream_motion::JointArray;

/// Searches that find a path; the best path of them is kept.
const SEARCHES: usize = 3;
/// How edges are sampled, the quickest first. A corner of 3 cm radius can pass between two samples nearer by the square of the spacing
/// over 8 times 3 cm: about what is kept beyond the margin. The last is what the exact edges keep.
const SAMPLINGS: [Sampling; 4] = [
    Sampling { step_m: 0.5, spacing_m: 0.03, extra_m: 2e-3 },
    Sampling { step_m: 0.35, spacing_m: 0.02, extra_m: 1e-3 },
    Sampling { step_m: 0.35, spacing_m: 0.012, extra_m: 5e-4 },
    Sampling { step_m: 0.35, spacing_m: 0.007, extra_m: SweepRules::EDGE.extra_m },
];
/// Share of the spacing after a proof has failed, and the nearest samples (m).
const NEARER: f64 = 0.5;
const SPACING_M_MIN: f64 = 4e-4;
/// Poses of the first search, after which another one begins with twice as many.
const FIRST_CHECKS: usize = 100_000;
/// Shortcuts of a path.
const SHORTCUTS: Effort = Effort { tries: 60, stalled: 12 };

/// A path and how long it may take.
struct Candidate {
    estimate_s: f64,
    path: Vec<JointArray>,
}

impl Pipeline<'_> {
    /// The best path that several searches find, until `checks_max` poses have been checked; from the first one on there is a motion.
    pub(super) fn quick(&mut self, line: &[JointArray], checks_max: usize) -> Option<Vec<JointArray>> {
        let [start, goal] = line else { return None };
        let world = self.space.world;
        let lanes = Lanes::new(world);
        let end = self.space.checks().saturating_add(checks_max);
        let (mut best, mut nodes, mut made, mut found) = (None::<Candidate>, 0, 0, 0);
        let (mut level, mut nearer) = (self.first_sampling(&lanes, [start, goal]), 1.0);
        let mut checks_a_search = FIRST_CHECKS;
        while found < SEARCHES && !(made > 0 && self.space.budget.is_over()) {
            let left = end.saturating_sub(self.space.checks()).min(checks_a_search);
            if made > 0 && left == 0 {
                break;
            }
            let mut rng = SeededRng::new(self.options.seed, 10 + made);
            made += 1;
            let Sampling { spacing_m, .. } = SAMPLINGS[level];
            let sampling =
                Sampling { spacing_m: (nearer * spacing_m).max(SPACING_M_MIN), ..SAMPLINGS[level] };
            let sampled = Sampled::new(&self.space, &lanes, [start, goal], sampling);
            let sampled = self.keeping_in(&sampled);
            let search = match sampled.rules {
                Some(rules) => constraints::search::search(rules, &sampled, [start, goal], left, &mut rng),
                None => rrt_connect(sampled.field, start, goal, left, &mut rng),
            };
            nodes += search.nodes;
            let Some(mut path) = search.path else {
                // Narrow passages need what the first samplings leave out.
                level = (level + 1).min(SAMPLINGS.len() - 1);
                checks_a_search = checks_a_search.saturating_mul(2);
                continue;
            };
            shorten_until_stalled(&sampled, &mut path, SHORTCUTS, &mut rng);
            let estimate_s = self.estimate_s(&path);
            if self.best.is_none() {
                self.round(&path, &searched(Searcher::RrtConnect), Some(&lanes));
                if self.best.is_none() {
                    nearer *= NEARER;
                    continue;
                }
            }
            found += 1;
            if best.as_ref().is_none_or(|b| estimate_s < b.estimate_s) {
                best = Some(Candidate { estimate_s, path });
            }
        }
        self.note(format!("RRT-Connect ({nodes} nodes, {found} of {made} searches)"));
        let Candidate { estimate_s, path } = best?;
        if estimate_s < CLEARLY_LESS * self.least_estimate_s {
            self.round(&path, &searched(Searcher::RrtConnect), Some(&lanes));
        }
        Some(path)
    }

    /// The quickest sampling that start and goal are free in.
    fn first_sampling(&self, lanes: &Lanes, [start, goal]: [&JointArray; 2]) -> usize {
        let is_free = |s: &Sampling| lanes.are_free(&[*start, *goal], s.extra_m);
        SAMPLINGS.iter().position(is_free).unwrap_or(SAMPLINGS.len() - 1)
    }
}
