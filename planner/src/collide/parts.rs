//! The proof that a whole motion keeps every distance, for many parts of it at once.
//!
//! A motion is cut into parts, and lanes ([`Lanes::keep`]) bound what each keeps. Parts whose bound does not suffice are cut again. What is open in the
//! end, because shapes are only covered by spheres there or something is as near as it may be, is left to the exact [`super::sweep()`], in the order of
//! time. So the answer is that of the exact sweep, up to the resolution of either.
use super::sweep::{Blocked, Clearance, Motion, SweepRules, sweep_knowing};
use crate::budget::Budget;
use crate::lanes::{Kept, Lanes};
use crate::world::World;
use taustream_motion::JointArray;

/// How far a point of the arm can move within a part at first, about (m).
const PART_M: f64 = 0.04;
/// Fewest and most parts at first.
const PARTS: [f64; 2] = [16.0, 1024.0];
/// Into how many parts one is cut that is still open.
const CUTS: u32 = 4;
/// How often.
const ROUNDS: usize = 4;
/// Share of the parts that may be open for another round to be worth it.
const WORTH: f64 = 0.6;
/// Larger distances are not distinguished where the least one is not looked for (m).
const ENOUGH_M: f64 = 0.02;

/// Proves that a motion keeps every distance from `from` to `to`, as [`super::sweep()`] does.
///
/// # Errors
/// The first parameter (to the rules' resolution) at which a distance is not proven, or where the work ended.
pub fn sweep_in_parts(
    world: &World,
    motion: &dyn Motion,
    span: [f64; 2],
    rules: &SweepRules,
    budget: &Budget,
) -> Result<Clearance, Blocked> {
    let lanes = Lanes::new(world);
    let looks_for_least = rules.bracket_m.is_finite();
    let enough_m = if looks_for_least { f64::INFINITY } else { ENOUGH_M };
    let mut found =
        Clearance { proven_m: f64::INFINITY, sampled_m: f64::INFINITY, at: span[0], pair: None, checks: 0 };
    let mut parts = first_parts(world, motion, span);
    let (mut poses_rad, mut turns_rad, mut kept) = (Vec::new(), Vec::new(), Vec::new());
    for round in 0..=ROUNDS {
        if budget.is_over_after(parts.len()) {
            let at = parts.first().map_or(span[0], |part| part[0]);
            return Err(Blocked { at, pair: None, checks: found.checks });
        }
        found.checks += parts.len();
        poses_rad.clear();
        turns_rad.clear();
        for [from, to] in &parts {
            let middle = 0.5 * (from + to);
            let (before, after) = (motion.travel_rad(*from, middle), motion.travel_rad(middle, *to));
            poses_rad.push(motion.at(middle));
            turns_rad.push(std::array::from_fn(|j| before[j].max(after[j])));
        }
        lanes.keep((&poses_rad, &turns_rad), enough_m, &mut kept);
        if looks_for_least {
            meet(&mut found, world, (&parts, &poses_rad, &kept));
        }
        let bracket_m = found.bracket_from_m(rules);
        let mut open = Vec::new();
        for (part, kept) in parts.iter().zip(&kept) {
            let least_m = f64::from(kept.least_m);
            if f64::from(kept.spare_m) > rules.extra_m && least_m >= bracket_m {
                found.proven_m = found.proven_m.min(least_m);
            } else {
                open.push(*part);
            }
        }
        if open.is_empty() {
            return Ok(found);
        }
        let is_worth = (open.len() as f64) < WORTH * parts.len() as f64;
        if round == ROUNDS || !is_worth && round > 0 {
            parts = open;
            break;
        }
        parts = open.into_iter().flat_map(cut).collect();
    }
    for part in joined(&parts) {
        found = sweep_knowing(found, (world, motion), part, rules, budget)?;
    }
    Ok(found)
}

/// Parts of about the same length in time.
fn first_parts(world: &World, motion: &dyn Motion, [from, to]: [f64; 2]) -> Vec<[f64; 2]> {
    let reach_m = world.reach_m().iter().zip(motion.travel_rad(from, to));
    let moves_m: f64 = reach_m.map(|(reach_m, travel_rad)| reach_m * travel_rad).sum();
    let [least, most] = PARTS;
    // What is no number becomes the least.
    let count = (moves_m / PART_M).ceil().max(least).min(most);
    let at = |i: f64| if i < count { from + (to - from) * (i / count) } else { to };
    let mut parts = Vec::new();
    let mut i = 0.0;
    while i < count {
        parts.push([at(i), at(i + 1.0)]);
        i += 1.0;
    }
    parts
}

fn cut([from, to]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let at = move |i: u32| if i < CUTS { from + (to - from) * (f64::from(i) / f64::from(CUTS)) } else { to };
    (0..CUTS).map(move |i| [at(i), at(i + 1)])
}

/// Neighbouring parts as one.
fn joined(parts: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut joined: Vec<[f64; 2]> = Vec::new();
    for [from, to] in parts {
        match joined.last_mut() {
            // A part begins with the very number that the one before ends with.
            Some(last) if last[1].to_bits() == from.to_bits() => last[1] = *to,
            Some(_) | None => joined.push([*from, *to]),
        }
    }
    joined
}

/// Measures the pose in the middle of the part that may be nearest to something.
fn meet(
    found: &mut Clearance,
    world: &World,
    (parts, poses_rad, kept): (&[[f64; 2]], &[JointArray], &[Kept]),
) {
    let nearest = (0..kept.len()).min_by(|i, j| kept[*i].least_m.total_cmp(&kept[*j].least_m));
    let Some(i) = nearest else { return };
    if let Some((pair, distance_m)) = world.nearest(&poses_rad[i])
        && distance_m < found.sampled_m
    {
        let [from, to] = parts[i];
        (found.sampled_m, found.at, found.pair) = (distance_m, 0.5 * (from + to), Some(pair));
    }
}
