//! The constants of the kernel: a skeleton, spheres and links rounded to f32, and which steps can be left out.
use super::Point;
use super::skeleton::{LinkSegment, NOTHING, Skeleton};
use nalgebra::Vector3;

/// One joint, as the kernel needs it.
#[derive(Clone, Debug)]
pub(super) struct FlatSegment {
    /// Added to the joint's position.
    pub(super) offset_rad: f64,
    /// The first joint of the parallel ones up to here: the angles from there on add up.
    pub(super) group: usize,
    /// The frame's origin.
    pub(super) origin: [f32; 3],
    /// The next joint, where it is elsewhere.
    pub(super) next: Option<[f32; 3]>,
    /// True when a shift leaves the axis, so that the angle moves a point.
    pub(super) swings: bool,
    /// True when the angle matters to anything.
    pub(super) turns: bool,
    /// Cosine and sine of the tilt to the next axis.
    pub(super) tilt: Option<[f32; 2]>,
    /// Which directions are needed behind the tilt: x and y, and z.
    pub(super) wants: [bool; 2],
    /// Furthest that anything that the joint turns can be from it (m).
    pub(super) reach_m: f64,
}

/// A link: the segment between the origins of two frames that follow each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlatLink {
    /// The frame in front of it.
    pub(super) from: usize,
    /// 1 / length^2, where the length is the same in every pose.
    pub(super) per_length2: Option<f32>,
}

/// An obstacle.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlatSphere {
    /// Its centre, seen from the first joint.
    pub(super) center: [f32; 3],
    /// The centre's distance from the first joint (m).
    pub(super) away_m: f64,
    /// Radius and expansion (m).
    pub(super) limit_m: f64,
    /// Its distance from the first link, where that one is fixed and left out (m).
    pub(super) still_m: Option<f64>,
}

/// An arm and its spheres.
#[derive(Clone, Debug)]
pub(super) struct Flat {
    /// The first joint, whose turn moves the spheres instead of the arm.
    pub(super) first: FlatSegment,
    /// The other joints.
    pub(super) others: Vec<FlatSegment>,
    /// The base frame's origin, seen from the first joint.
    pub(super) base: [f32; 3],
    /// True when the base frame's origin lies on the first joint's axis.
    pub(super) base_is_on_axis: bool,
    /// The links that move and are not points.
    pub(super) links: Vec<FlatLink>,
    /// The obstacles.
    pub(super) spheres: Vec<FlatSphere>,
    /// Furthest that anything of the arm can be from the first joint.
    pub(super) reach_m: f64,
}

impl Flat {
    /// Flattens an arm; `None` for one without any extent, or beyond all measure. `sums`: distances are summed over
    /// the links, as printed.
    pub(super) fn new(
        skeleton: &Skeleton,
        spheres: &[(Point, f64)],
        expansion_m: f64,
        sums: bool,
    ) -> Option<Self> {
        const SIZE_M_MAX: f64 = 1e4;
        /// Beyond f64's rounding.
        const CLEAR_M: f64 = 1e-6;
        let (base_m, reach_m) = (skeleton.base_m(), skeleton.reach_m());
        let base_is_on_axis = is_on_axis(&base_m);
        let first_m = skeleton.link_segments.first()?.origin_m;
        let still = (base_is_on_axis && is_on_axis(&first_m)).then_some((base_m, first_m));
        let sphere = |(center, radius_m): &(Point, f64)| {
            let center_m = skeleton.root.inverse_transform_point(center);
            FlatSphere {
                center: narrow(&center_m.coords),
                away_m: center_m.coords.norm(),
                limit_m: radius_m + expansion_m,
                still_m: still.map(|(a, b)| super::distance_to_segment_m(&center_m, &a.into(), &b.into())),
            }
        };
        let mut spheres: Vec<FlatSphere> = spheres.iter().map(sphere).collect();
        // A fixed first link is the same in every pose: it is left out, unless it touches.
        let clears = |s: &FlatSphere| s.still_m.is_some_and(|d| sums || d > s.limit_m + CLEAR_M);
        let stands_still = still.is_some() && spheres.iter().all(clears);
        if !stands_still {
            spheres.iter_mut().for_each(|s| s.still_m = None);
        }
        let mut others = flat_segments(skeleton);
        let first = others.remove(0);
        let links = flat_links(skeleton, stands_still);
        let size_m = spheres.iter().map(|s| s.away_m + s.limit_m).fold(reach_m, f64::max);
        let fits = size_m < SIZE_M_MAX && !links.is_empty();
        fits.then(|| Self { first, others, base: narrow(&base_m), base_is_on_axis, links, spheres, reach_m })
    }
}

impl Flat {
    /// Every joint, base to tip.
    pub(super) fn link_segments(&self) -> impl Iterator<Item = &FlatSegment> {
        std::iter::once(&self.first).chain(&self.others)
    }
}

/// Rounds to f32; the bound on the error counts it.
#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
pub(super) fn narrow(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

fn is_on_axis(v: &Vector3<f64>) -> bool {
    v.x == 0.0 && v.y == 0.0
}

fn flat_segments(skeleton: &Skeleton) -> Vec<FlatSegment> {
    let mut group = 0;
    let mut link_segments = Vec::with_capacity(skeleton.link_segments.len());
    for (i, link_segment) in skeleton.link_segments.iter().enumerate() {
        // The first joint turns the spheres and not the arm, so that a group begins behind it, too.
        let begins = i < 2 || skeleton.link_segments.get(i - 1).is_none_or(|b| b.tilt.is_some());
        group = if begins { i } else { group };
        let is_shared = (link_segment.next_m - link_segment.origin_m).norm() < NOTHING;
        link_segments.push(FlatSegment {
            offset_rad: link_segment.offset_rad,
            group,
            origin: narrow(&link_segment.origin_m),
            next: (!is_shared).then(|| narrow(&link_segment.next_m)),
            swings: !(is_on_axis(&link_segment.origin_m) && is_on_axis(&link_segment.next_m)),
            turns: false,
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            tilt: link_segment.tilt.map(|[cos, sin]| [cos as f32, sin as f32]),
            wants: [false; 2],
            reach_m: skeleton.link_segments.iter().skip(i).map(LinkSegment::length_m).sum(),
        });
    }
    // From the tip back: what is asked of the directions behind each joint.
    let (mut wants_xy, mut wants_z) = (false, false);
    for link_segment in link_segments.iter_mut().rev() {
        link_segment.wants = [wants_xy, wants_z];
        if let Some([cos, sin]) = link_segment.tilt {
            let (y, z) =
                (wants_xy || (wants_z && sin != 0.0), wants_z && cos != 0.0 || wants_xy && sin != 0.0);
            link_segment.turns = y;
            (wants_xy, wants_z) = (y, z);
        }
        link_segment.turns |= link_segment.swings;
        wants_xy |= link_segment.swings;
        wants_z |= link_segment.origin[2] != 0.0 || link_segment.next.is_some_and(|n| n[2] != 0.0);
    }
    link_segments
}

fn flat_links(skeleton: &Skeleton, stands_still: bool) -> Vec<FlatLink> {
    let mut links = Vec::new();
    let (mut before_m, mut tilt) = (-skeleton.base_m(), None);
    for (from, link_segment) in skeleton.link_segments.iter().enumerate() {
        // From the origin in front of the joint to the joint, seen from the joint, and on to the origin behind it.
        let [cos, sin] = tilt.unwrap_or([1.0, 0.0]);
        let (y, z) = (before_m.y, before_m.z);
        let first_m = Vector3::new(before_m.x, cos * y + sin * z, cos * z - sin * y);
        let is_rigid = off_axis_m(&first_m) < NOTHING || is_on_axis(&link_segment.origin_m);
        let length_m = (first_m + link_segment.origin_m).norm();
        let is_point = is_rigid && length_m < NOTHING;
        let is_seen = !is_point && (from > 0 || !stands_still);
        if is_seen {
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let per_length2 = is_rigid.then(|| (1.0 / (length_m * length_m)) as f32);
            links.push(FlatLink { from, per_length2: per_length2.filter(|p| p.is_finite()) });
        }
        (before_m, tilt) = (link_segment.next_m - link_segment.origin_m, link_segment.tilt);
    }
    links
}

fn off_axis_m(v: &Vector3<f64>) -> f64 {
    v.x.hypot(v.y)
}
