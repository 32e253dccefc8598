//! Which links may touch by default.
//!
//! Neighbouring links meet at their joint, and shapes round short wrist links overlap in every pose; neither is a
//! collision. As set-up assistants do it, a pair that touches in every one of many random poses may touch. The draw
//! is seeded and of our own making, so that an arm has the same list on every machine and in every version.
use crate::body::{Body, Posed, to_parry};
use crate::link_margin::LinkMargins;
use crate::rng::SeededRng;
use crate::robot::{LinkShape, Robot};
use std::collections::{BTreeMap, BTreeSet};
use taustream_motion::chain::Chain;
use taustream_motion::{JointLimits, MAX_JOINTS};

/// Poses that a pair must touch in. A pair that parts in one pose of ten thousand has a chance of about a third
/// (1/e) to be taken for one that never does; `check` lists every allowed pair, for a person to look at.
pub(crate) const POSES: usize = 10_000;

/// Two links, the lower index first.
type LinkPair = (usize, usize);

const SEED: u64 = 0x7461_7573_7472_6561;

/// What is known of the pairs before the rule.
pub(crate) struct ContactRule<'a> {
    /// Links that meet at a joint: they may touch.
    pub(crate) neighbours: &'a [LinkPair],
    /// Pairs that may touch because a file says so; they are not tried.
    pub(crate) allowed: &'a [LinkPair],
    /// What the other pairs keep.
    pub(crate) margins: &'a LinkMargins,
}

/// What the rule says; lower index first, sorted, each once.
#[derive(Debug, Default)]
pub(crate) struct Ruled {
    /// The neighbours, and pairs that touch in every one of [`POSES`] poses drawn uniformly inside the joint limits.
    pub(crate) allowed: Vec<LinkPair>,
    /// Pairs that are never further apart than their margin, and do not always touch: no pose at all would keep it.
    pub(crate) close: Vec<LinkPair>,
}

impl ContactRule<'_> {
    /// Tries every pair that is not known.
    ///
    /// # Errors
    /// The index of a shape that cannot be built.
    pub(crate) fn apply(
        &self,
        chain: &Chain,
        shapes: &[LinkShape],
        limits: &[JointLimits],
    ) -> Result<Ruled, usize> {
        let mut solid = Vec::new();
        for (i, shape) in shapes.iter().enumerate() {
            let body = Body::new(&shape.shape, &shape.pose).ok_or(i)?;
            solid.push(Solid { link: shape.link, frame: shape.frame.min(chain.joints()), body });
        }
        let mut ruled = self.sample(chain, &solid, limits);
        ruled.allowed.extend_from_slice(self.neighbours);
        ruled.allowed.sort_unstable();
        ruled.allowed.dedup();
        Ok(ruled)
    }
}

/// A shape of a link.
struct Solid {
    link: usize,
    frame: usize,
    body: Body,
}

/// The shapes of a pair of links, and how it was found so far.
#[derive(Debug, Default)]
struct Tried {
    shapes: Vec<(usize, usize)>,
    /// In one pose at least it did not touch.
    parted: bool,
}

impl ContactRule<'_> {
    fn pairs(&self, solid: &[Solid]) -> BTreeMap<LinkPair, Tried> {
        let known = |pair: &LinkPair| self.neighbours.contains(pair) || self.allowed.contains(pair);
        // Shapes in one frame are rigid with each other.
        let mut pairs: BTreeMap<LinkPair, Tried> = BTreeMap::new();
        for (i, a) in solid.iter().enumerate() {
            for (j, b) in solid.iter().enumerate().skip(i + 1).filter(|(_, b)| a.frame != b.frame) {
                let links = (a.link.min(b.link), a.link.max(b.link));
                if a.link != b.link && !known(&links) {
                    pairs.entry(links).or_default().shapes.push((i, j));
                }
            }
        }
        pairs
    }

    fn sample(&self, chain: &Chain, solid: &[Solid], limits: &[JointLimits]) -> Ruled {
        let mut pairs = self.pairs(solid);
        let mut rng = SeededRng::new(SEED, 0);
        let mut placed: Vec<Posed> = Vec::new();
        for _ in 0..POSES {
            // Every pose takes its numbers, so that the list does not depend on when a pair drops out.
            let position_rad = uniform_pose(&mut rng, limits);
            if pairs.is_empty() {
                break;
            }
            let frames = chain.frames(&position_rad).map(|frame| to_parry(&frame));
            placed.clear();
            placed.extend(solid.iter().filter_map(|s| Some(s.body.placed(frames.get(s.frame)?))));
            let within = |(i, j): &(usize, usize), keep_m: f64| {
                let sides = (solid.get(*i), placed.get(*i), solid.get(*j), placed.get(*j));
                let (Some(a), Some(a_at), Some(b), Some(b_at)) = sides else { return false };
                let apart_m = (a_at.centre - b_at.centre).length() - a.body.bound_m() - b.body.bound_m();
                apart_m <= keep_m && a.body.distance_m(a_at, &b.body, b_at) <= keep_m
            };
            // Pairs that have kept their margin once are out; most are after a few poses, so the rest costs little.
            pairs.retain(|links, tried| {
                let touch = tried.shapes.iter().any(|shapes| within(shapes, 0.0));
                tried.parted |= !touch;
                let margin_m = self.margins.of(links.0, links.1);
                touch || tried.shapes.iter().any(|shapes| within(shapes, margin_m))
            });
        }
        let (close, allowed): (Vec<_>, Vec<_>) = pairs.into_iter().partition(|(_, tried)| tried.parted);
        let links = |pairs: Vec<(LinkPair, Tried)>| pairs.into_iter().map(|(links, _)| links).collect();
        Ruled { allowed: links(allowed), close: links(close) }
    }
}

/// Poses that [`Robot::often_touching`] looks at.
const LOOKS: u32 = 400;
/// Share of them from which a pair is worth a look: such an arm can hardly be planned for.
const OFTEN: f64 = 0.5;

impl Robot {
    /// Pairs of links that may not touch, and do so in at least half of 400 seeded random poses, with that share: either their shapes
    /// are too wide, or they belong into `allowed_contacts`. Costs far more than reading the robot.
    #[must_use]
    pub fn often_touching(&self) -> Vec<(LinkPair, f64)> {
        let build = |shape: &LinkShape| {
            let body = Body::new(&shape.shape, &shape.pose)?;
            Some(Solid { link: shape.link, frame: shape.frame.min(self.joints.len()), body })
        };
        let solid: Vec<Solid> = self.shapes.iter().filter_map(build).collect();
        let limits: Vec<JointLimits> = self.joints.iter().map(|joint| joint.limits).collect();
        let mut touches: BTreeMap<LinkPair, u32> = BTreeMap::new();
        let mut rng = SeededRng::new(SEED, 1);
        for _ in 0..LOOKS {
            let frames = self.chain.frames(&uniform_pose(&mut rng, &limits)).map(|frame| to_parry(&frame));
            let placed: Vec<(&Solid, Posed)> =
                solid.iter().filter_map(|s| Some((s, s.body.placed(frames.get(s.frame)?)))).collect();
            let mut now: BTreeSet<LinkPair> = BTreeSet::new();
            for (i, (a, a_at)) in placed.iter().enumerate() {
                for (b, b_at) in placed.iter().skip(i + 1) {
                    let pair = (a.link.min(b.link), a.link.max(b.link));
                    let may_part =
                        a.frame != b.frame && !self.may_touch(a.link, b.link) && !now.contains(&pair);
                    if may_part && are_touching((a, a_at), (b, b_at)) {
                        now.insert(pair);
                    }
                }
            }
            for pair in now {
                *touches.entry(pair).or_default() += 1;
            }
        }
        let share = |(pair, count): (LinkPair, u32)| (pair, f64::from(count) / f64::from(LOOKS));
        touches.into_iter().map(share).filter(|(_, share)| *share >= OFTEN).collect()
    }
}

fn are_touching((a, a_at): (&Solid, &Posed), (b, b_at): (&Solid, &Posed)) -> bool {
    let apart_m = (a_at.centre - b_at.centre).length() - a.body.bound_m() - b.body.bound_m();
    apart_m <= 0.0 && a.body.distance_m(a_at, &b.body, b_at) <= 0.0
}

fn uniform_pose(rng: &mut SeededRng, limits: &[JointLimits]) -> [f64; MAX_JOINTS] {
    let mut position_rad = [0.0; MAX_JOINTS];
    for (slot, joint) in position_rad.iter_mut().zip(limits) {
        let [low, high] = joint.position_rad;
        *slot = rng.within(low, high);
    }
    position_rad
}
