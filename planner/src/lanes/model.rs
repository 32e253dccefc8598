//! The world as constants for the kernel: the chain with its axes along z, spheres by link, obstacles.
use super::cover::{Ball, ITERATED_M, balls};
use super::grid::{Bounds, Tree};
use super::rounding::{down, tolerance_m, up};
use crate::world::{Other, World};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose, Vector};
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;
use taustream_arm::body::{Body, Core, Posed};
use taustream_arm::cloud::Cloud;
use taustream_motion::JointKind;

/// Entries of a rotation below this are 0, far below the rounding of f32.
const NOTHING: f64 = 1e-12;

/// Fewer obstacles than this are looked at one by one.
const TREE_MIN: usize = 24;

/// From one joint to the next: a fixed motion, then a rotation about z or a translation along it.
pub(super) struct Joint {
    pub(super) kind: JointKind,
    /// The frame that it stands in.
    pub(super) parent: usize,
    /// Columns of the rotation.
    pub(super) columns: [[f32; 3]; 3],
    pub(super) shift: [f32; 3],
    /// Added to the joint's position, half revolutions or metres.
    pub(super) offset: f64,
}

/// The bodies that are rigid with one frame.
pub(super) struct Group {
    /// 0 for the base, which stands still.
    pub(super) frame: usize,
    pub(super) bodies: Range<usize>,
    pub(super) spheres: Range<usize>,
    /// Around all of them, in the axes of the joint.
    pub(super) centre: [f32; 3],
    pub(super) radius: f32,
}

/// A body of a link.
pub(super) struct Cover {
    /// Index into the world's link bodies.
    pub(super) link: usize,
    pub(super) spheres: Range<usize>,
}

/// A sphere in the axes of its joint.
pub(super) struct Sphere {
    pub(super) centre: [f32; 3],
    pub(super) outer: f32,
    pub(super) inner: f32,
}

/// What an obstacle's distance to a point is made of.
pub(super) enum Form {
    /// Half edges.
    Box([f32; 3]),
    /// Half edges of a box along the axes of space.
    AlignedBox([f32; 3]),
    /// Half of its length, along the first row; its radius.
    Cylinder([f32; 2]),
    /// From the centre: a half of the segment, and 1 / its length squared.
    Segment([f32; 3], f32),
    /// Points, asked for each lane.
    Cloud(Arc<Cloud>),
}

/// An obstacle.
pub(super) struct Obstacle {
    pub(super) form: Form,
    pub(super) centre: [f32; 3],
    /// Its axes as rows.
    pub(super) rows: [[f32; 3]; 3],
    /// Around the core.
    pub(super) radius: f32,
    /// What the distance can be wrong by.
    pub(super) tolerance: f32,
    /// The form only contains the shape.
    pub(super) is_coarse: bool,
}

/// Two bodies of links.
pub(super) struct BodyPair {
    pub(super) covers: [usize; 2],
    pub(super) required: f32,
    /// Index into the world's pairs.
    pub(super) pair: usize,
}

/// Two groups of which some bodies must keep apart.
pub(super) struct GroupPair {
    pub(super) groups: [usize; 2],
    /// The last frame that carries both.
    pub(super) common: usize,
    pub(super) required: f32,
    pub(super) bodies: Vec<BodyPair>,
    /// Each sphere of the first group, with those of the second that it must keep apart from, and how far their centres.
    pub(super) spheres: Vec<(usize, Vec<(usize, f32)>)>,
}

/// The world.
pub(crate) struct Model {
    pub(super) joints: Vec<Joint>,
    pub(super) groups: Vec<Group>,
    pub(super) covers: Vec<Cover>,
    pub(super) spheres: Vec<Sphere>,
    pub(super) obstacles: Vec<Obstacle>,
    /// Where there are many.
    pub(super) tree: Option<Tree>,
    /// What links keep from obstacles, at most.
    pub(super) margin: f32,
    /// The same, rounded down.
    margin_down: f32,
    /// Body and obstacle that need not keep as much.
    pub(super) exceptions: HashMap<(usize, usize), f64>,
    pub(super) group_pairs: Vec<GroupPair>,
    /// What the distance of two links can be wrong by.
    pub(super) tolerance: f32,
}

impl Model {
    /// Takes the constants from a world.
    pub(crate) fn new(world: &World) -> Self {
        let aligned = aligned(world);
        let reach_m = world.extent_m();
        let mut model = Self {
            joints: joints(world, &aligned),
            groups: Vec::new(),
            covers: Vec::new(),
            spheres: Vec::new(),
            obstacles: world
                .obstacle_bodies()
                .map(|(b, at)| obstacle(b, at, (aligned.len(), reach_m)))
                .collect(),
            tree: None,
            margin: up(world.margin_m()),
            margin_down: down(world.margin_m()),
            exceptions: HashMap::new(),
            group_pairs: Vec::new(),
            tolerance: tolerance_m(aligned.len(), reach_m),
        };
        for frame in 0..=aligned.len() {
            model.add_group(world, frame, &aligned);
        }
        if model.obstacles.len() >= TREE_MIN {
            let obstacles = world.obstacle_bodies().zip(&model.obstacles);
            let keep = |of: &Obstacle| (world.margin_m(), f64::from(of.tolerance));
            let around = obstacles.map(|((body, at), of)| bounds(body, at, keep(of)));
            model.tree = Some(Tree::new(around.collect()));
        }
        model.add_pairs(world);
        model
    }

    /// What a body keeps from an obstacle, rounded down.
    pub(super) fn least_margin(&self, pair: (usize, usize)) -> f32 {
        let exception = if self.exceptions.is_empty() { None } else { self.exceptions.get(&pair) };
        exception.map_or(self.margin_down, |margin_m| down(*margin_m))
    }

    fn add_group(&mut self, world: &World, frame: usize, aligned: &[Aligned]) {
        let (first_body, first_sphere) = (self.covers.len(), self.spheres.len());
        let (mut low, mut high) = (Vector::splat(f64::INFINITY), Vector::splat(f64::NEG_INFINITY));
        let mut all = Vec::new();
        for (link, (_, body)) in world.link_bodies().enumerate().filter(|(_, (of, _))| *of == frame) {
            let local =
                frame.checked_sub(1).and_then(|j| aligned.get(j)).map_or(Pose::identity(), |a| a.to_frame);
            let begin = self.spheres.len();
            for Ball { centre, outer_m, inner_m } in balls(body) {
                let at = local.transform_point(body.local().transform_point(centre));
                (low, high) = (low.min(at - Vector::splat(outer_m)), high.max(at + Vector::splat(outer_m)));
                all.push((at, outer_m));
                #[expect(clippy::cast_possible_truncation, reason = "counted in the tolerance")]
                let centre = at.to_array().map(|x| x as f32);
                self.spheres.push(Sphere { centre, outer: up(outer_m), inner: -up(-inner_m) });
            }
            self.covers.push(Cover { link, spheres: begin..self.spheres.len() });
        }
        if all.is_empty() {
            return;
        }
        let middle = 0.5 * (low + high);
        let radius_m = all.iter().map(|(at, r)| (*at - middle).length() + r).fold(0.0, f64::max);
        #[expect(clippy::cast_possible_truncation, reason = "counted in the tolerance")]
        let centre = middle.to_array().map(|x| x as f32);
        let (bodies, spheres) = (first_body..self.covers.len(), first_sphere..self.spheres.len());
        self.groups.push(Group { frame, bodies, spheres, centre, radius: up(radius_m) });
    }

    /// The pairs of links, and the obstacles that need not be kept away from as far as the others.
    fn add_pairs(&mut self, world: &World) {
        let cover_of: HashMap<usize, usize> =
            self.covers.iter().enumerate().map(|(i, c)| (c.link, i)).collect();
        let group_of = |cover: usize| self.groups.iter().position(|g| g.bodies.contains(&cover));
        let mut by_groups: HashMap<[usize; 2], Vec<BodyPair>> = HashMap::new();
        for (index, pair) in world.pairs().iter().enumerate() {
            match pair.other {
                Other::Obstacle(obstacle) => {
                    if pair.required_m < world.margin_m() {
                        self.exceptions.insert((pair.link, obstacle), pair.required_m);
                    }
                }
                Other::Link(other) => {
                    let (Some(&a), Some(&b)) = (cover_of.get(&pair.link), cover_of.get(&other)) else {
                        continue;
                    };
                    let (Some(of_a), Some(of_b)) = (group_of(a), group_of(b)) else { continue };
                    let required = up(pair.required_m);
                    by_groups.entry([of_a, of_b]).or_default().push(BodyPair {
                        covers: [a, b],
                        required,
                        pair: index,
                    });
                }
            }
        }
        let mut pairs: Vec<GroupPair> = by_groups
            .into_iter()
            .map(|(groups, bodies)| {
                let required = bodies.iter().map(|b| b.required).fold(0.0, f32::max);
                let spheres = self.sphere_pairs(&bodies);
                let [a, b] = groups.map(|group| self.groups[group].frame);
                let common = world.robot().chain.common_frame(a, b);
                GroupPair { groups, common, required, bodies, spheres }
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| pair.groups);
        self.group_pairs = pairs;
    }

    fn sphere_pairs(&self, bodies: &[BodyPair]) -> Vec<(usize, Vec<(usize, f32)>)> {
        let mut by_sphere: BTreeMap<usize, Vec<(usize, f32)>> = BTreeMap::new();
        for pair in bodies {
            let [a, b] = pair.covers.map(|cover| self.covers[cover].spheres.clone());
            for i in a {
                let keep = |j: usize| {
                    let radii = f64::from(self.spheres[i].outer) + f64::from(self.spheres[j].outer);
                    up(radii + f64::from(pair.required))
                };
                by_sphere.entry(i).or_default().extend(b.clone().map(|j| (j, keep(j))));
            }
        }
        by_sphere.into_iter().collect()
    }
}

/// A joint whose axis is z.
struct Aligned {
    kind: JointKind,
    /// The frame that it stands in.
    parent: usize,
    /// From the axes of that frame's joint, or from the base.
    before: Isometry3<f64>,
    /// rad, or m.
    offset: f64,
    /// From the joint's axes, moved, to the frame behind it.
    to_frame: Pose,
}

fn aligned(world: &World) -> Vec<Aligned> {
    let chain = &world.robot().chain;
    // From the axes of each joint to the frame behind it; the base has none.
    let mut behind = vec![Isometry3::identity()];
    (0..world.joints())
        .filter_map(|index| {
            let joint = chain.joint(index)?;
            let axis = joint.axis.into_inner();
            let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_else(half_turn);
            let align = Isometry3::from_parts(Translation3::identity(), turn);
            let parent = chain.parent_frame(index);
            let before = behind.get(parent)? * joint.pre * align;
            let to_frame = align.inverse() * joint.post;
            behind.push(to_frame);
            Some(Aligned {
                kind: joint.kind,
                parent,
                before,
                offset: joint.offset,
                to_frame: taustream_arm::body::to_parry(&to_frame),
            })
        })
        .collect()
}

#[expect(clippy::cast_possible_truncation, reason = "counted in the tolerance")]
fn joints(world: &World, aligned: &[Aligned]) -> Vec<Joint> {
    debug_assert_eq!(world.joints(), aligned.len());
    let one = |a: &Aligned| {
        let (turn, shift) = (a.before.rotation.to_rotation_matrix(), a.before.translation.vector);
        // What a quaternion's rounding leaves of a right angle is none: the kernel leaves out what is 0.
        let entry = |row: usize, column: usize| {
            let entry = turn[(row, column)];
            if entry.abs() < NOTHING { 0.0 } else { entry as f32 }
        };
        Joint {
            parent: a.parent,
            columns: std::array::from_fn(|column| std::array::from_fn(|row| entry(row, column))),
            shift: [shift.x as f32, shift.y as f32, shift.z as f32],
            kind: a.kind,
            offset: match a.kind {
                JointKind::Revolute => a.offset / PI,
                JointKind::Prismatic => a.offset,
            },
        }
    };
    aligned.iter().map(one).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "counted in the tolerance")]
fn obstacle(body: &Body, at: &Posed, (joints, reach_m): (usize, f64)) -> Obstacle {
    let single = |v: Vector| v.to_array().map(|x| x as f32);
    let axes = [Vector::X, Vector::Y, Vector::Z].map(|axis| at.pose.rotation * axis);
    let origin = at.pose.translation;
    let is_aligned = |half: Vector| -> Option<Vector> {
        let sizes = axes.map(Vector::abs);
        // Of numbers from 0 to 1 only these two are whole.
        let exact = sizes.iter().all(|a| a.to_array().iter().all(|x| x.fract() == 0.0));
        exact.then(|| sizes[0] * half.x + sizes[1] * half.y + sizes[2] * half.z)
    };
    let of_box = |half: Vector| match is_aligned(half) {
        Some(half) => Form::AlignedBox(half.to_array().map(up)),
        None => Form::Box(half.to_array().map(up)),
    };
    let (form, centre, axis, is_coarse) = match body.core() {
        Core::Segment(a, b) => {
            let (a, b) = (at.pose.transform_point(*a), at.pose.transform_point(*b));
            let half = 0.5 * (b - a);
            let per_length2 = if half.length() > 0.0 { 1.0 / half.length_squared() } else { 0.0 };
            (Form::Segment(single(half), per_length2 as f32), 0.5 * (a + b), None, false)
        }
        Core::Box(half) => (of_box(*half), origin, None, false),
        Core::Cylinder { half_m, radius_m } => {
            (Form::Cylinder([up(*half_m), up(*radius_m)]), origin, Some(axes[1]), false)
        }
        Core::Cloud(cloud) => (Form::Cloud(cloud.clone()), origin, None, false),
        Core::Convex | Core::Mesh(_) => {
            let (middle, half) = body.core_bounds();
            (of_box(half), at.pose.transform_point(middle), None, true)
        }
    };
    let rows = match axis {
        Some(axis) => [single(axis), [0.0; 3], [0.0; 3]],
        None => axes.map(single),
    };
    let iterated_m = match body.core() {
        Core::Segment(..) | Core::Box(_) | Core::Cloud(_) => 0.0,
        Core::Cylinder { .. } | Core::Convex | Core::Mesh(_) => ITERATED_M,
    };
    let away_m = centre.length() + body.bound_m();
    Obstacle {
        form,
        centre: single(centre),
        rows,
        radius: up(body.radius_m()),
        tolerance: tolerance_m(joints, reach_m + away_m) + up(iterated_m),
        is_coarse,
    }
}

/// A box around an obstacle, larger by the margin and by what its distance can be wrong by.
fn bounds(body: &Body, at: &Posed, (margin_m, more_m): (f64, f64)) -> Bounds {
    let (middle, half) = body.core_bounds();
    let axes = [Vector::X, Vector::Y, Vector::Z].map(|axis| (at.pose.rotation * axis).abs());
    let half = axes[0] * half.x + axes[1] * half.y + axes[2] * half.z;
    let larger = Vector::splat(body.radius_m() + margin_m + ITERATED_M + more_m);
    Bounds::around(at.pose.transform_point(middle), half + larger)
}
