//! Links of every shape on chains of every kind: how far their points move, and what a sweep proves about them.
//!
//! The verification rests on one bound: no point of a link moves further than the sum over the joints of turn times lever.
//! It must hold for a URDF's links (boxes, cylinders, hulls of meshes, beside their joint) as for capsules along rows.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::ur5;
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::body::{Body, to_parry};
use taustream_arm::scene::Shape;
use taustream_arm::{LinkShape, Obstacle, Robot, Scene};
use taustream_motion::chain::{Chain, ChainJoint, Pose};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS};
use taustream_planner::budget::Budget;
use taustream_planner::collide::{Clearance, StraightEdge, SweepRules, sweep};
use taustream_planner::rng::SeededRng;
use taustream_planner::world::{Other, Snapshot, World};

const KINDS: usize = 6;

fn vector(rng: &mut SeededRng, span: f64) -> Vector3<f64> {
    Vector3::new(rng.within(-span, span), rng.within(-span, span), rng.within(-span, span))
}

fn pose(rng: &mut SeededRng, span_m: f64) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(vector(rng, 3.0));
    Isometry3::from_parts(Translation3::from(vector(rng, span_m)), turn)
}

/// A tetrahedron askew: corners and faces, outwards.
fn tetrahedron(rng: &mut SeededRng) -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
    let size = || [1.0, 1.0, 1.0];
    let [x, y, z] = size().map(|_| rng.within(0.03, 0.2));
    let at = Point3::from(vector(rng, 0.1));
    let corner = |x, y, z| at + Vector3::new(x, y, z);
    let corners = vec![at, corner(x, 0.0, 0.0), corner(0.0, y, 0.0), corner(0.02, 0.02, z)];
    (corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
}

fn shape(rng: &mut SeededRng, kind: usize) -> Shape {
    let (radius_m, length_m) = (rng.within(0.01, 0.1), rng.within(0.02, 0.3));
    match kind {
        0 => Shape::Sphere { radius_m },
        1 => Shape::Capsule { radius_m, length_m },
        2 => Shape::Cylinder { radius_m, length_m },
        3 => Shape::Box { size_m: [radius_m, length_m, rng.within(0.02, 0.3)] },
        kind => {
            let (vertices_m, triangles) = tetrahedron(rng);
            if kind == 4 {
                Shape::Mesh { vertices_m, triangles }
            } else {
                Shape::Hull { vertices_m, triangles, rounding_m: rng.within(0.0, 0.02) }
            }
        }
    }
}

/// Points of a shape, its outermost ones among them: of the whole shape, or of its core, which distances are taken between.
fn points(rng: &mut SeededRng, shape: &Shape, of_core: bool) -> Vec<Point3<f64>> {
    let around = if of_core { 0.0 } else { 1.0 };
    let mut direction = || vector(rng, 1.0).normalize();
    let balls = |centres: &[Point3<f64>], radius_m: f64, direction: &mut dyn FnMut() -> Vector3<f64>| {
        let around_each = centres.iter().flat_map(|c| (0..8).map(move |_| *c));
        around_each.map(|c| c + direction() * (around * radius_m)).collect()
    };
    match shape {
        Shape::Sphere { radius_m } => balls(&[Point3::origin()], *radius_m, &mut direction),
        Shape::Capsule { radius_m, length_m } => {
            let ends = [-0.5, 0.5].map(|s| Point3::new(0.0, 0.0, s * length_m));
            balls(&ends, *radius_m, &mut direction)
        }
        Shape::Cylinder { radius_m, length_m } => (0..24)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos();
                Point3::new(radius_m * cos, radius_m * sin, if i % 2 == 0 { 0.5 } else { -0.5 } * length_m)
            })
            .collect(),
        Shape::Box { size_m: [x, y, z] } => (0..8)
            .map(|i| {
                let side = |bit: i32, size: f64| if i & (1 << bit) == 0 { -0.5 * size } else { 0.5 * size };
                Point3::new(side(0, *x), side(1, *y), side(2, *z))
            })
            .collect(),
        Shape::Mesh { vertices_m, .. } => vertices_m.clone(),
        Shape::Hull { vertices_m, rounding_m, .. } => balls(vertices_m, *rounding_m, &mut direction),
        Shape::Cloud(_) => Vec::new(),
    }
}

/// A robot of any number of joints with origins and axes anywhere, and two shapes a link; every other one is a tree.
fn robot(template: &Robot, seed: u64) -> Robot {
    let mut rng = SeededRng::new(seed, 30);
    let count = 1 + rng.index(MAX_JOINTS);
    let joints: Vec<ChainJoint> = (0..count)
        .map(|i| ChainJoint {
            kind: if rng.unit() < 0.3 { JointKind::Prismatic } else { JointKind::Revolute },
            pre: pose(&mut rng, 0.2),
            axis: Unit::new_normalize(vector(&mut rng, 1.0)),
            offset: rng.within(-3.0, 3.0),
            // A URDF has something behind the last joint only; the bound holds wherever it is.
            post: if i + 1 == count || rng.unit() < 0.3 { pose(&mut rng, 0.2) } else { Pose::identity() },
        })
        .collect();
    let mut shapes = Vec::new();
    for frame in 0..=count {
        for _ in 0..2 {
            let kind = rng.index(KINDS);
            let shape = shape(&mut rng, kind);
            shapes.push(LinkShape { link: frame, frame, pose: pose(&mut rng, 0.1), shape });
        }
    }
    let parents: Vec<usize> =
        (0..count).map(|joint| if seed.is_multiple_of(2) { joint } else { rng.index(joint + 1) }).collect();
    let joint = template.joints[0].clone();
    let mut robot = template.clone();
    robot.joints = vec![joint; count];
    robot.chain = Chain::tree(&joints, &parents, &[count]).expect("a tree");
    robot.links = (0..=count).map(|i| format!("l{i}")).collect();
    robot.shapes = shapes;
    robot.allowed_by_rule = Vec::new();
    robot
}

fn kind(shape: &Shape) -> usize {
    match shape {
        Shape::Sphere { .. } => 0,
        Shape::Capsule { .. } => 1,
        Shape::Cylinder { .. } => 2,
        Shape::Box { .. } => 3,
        Shape::Mesh { .. } => 4,
        Shape::Hull { .. } => 5,
        // No part of a robot.
        Shape::Cloud(_) => KINDS,
    }
}

fn empty() -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: Vec::new(), zones: Vec::new() }
}

/// Goal: no point of any shape's core moves further than `moves_m` says, seen from the base and from any link before it, nor is any of the
/// whole shape further from an axis than `reach_m`.
/// Method: random robots, poses and turns; points by plain kinematics. Of each kind of shape some points must come near the
/// bound, or it would be too weak to show anything.
#[test]
fn no_point_of_any_shape_moves_further_than_its_bound() {
    let (mut snapshot, mut moves_m) = (Snapshot::default(), Vec::new());
    let mut nearest = [0.0_f64; KINDS];
    let template = ur5();
    for seed in 0..2_000 {
        let robot = robot(&template, seed);
        let scene = empty();
        let world = World::new(&robot, &scene).expect("builds");
        let mut rng = SeededRng::new(seed, 31);
        let (mut q, mut turn, mut there): (JointArray, JointArray, JointArray) = Default::default();
        for j in 0..robot.joints.len() {
            q[j] = rng.within(-3.0, 3.0);
            // Often one joint alone, by a little: there the bound is nearly exact.
            turn[j] = if rng.unit() < 0.6 { 0.0 } else { rng.within(0.0, 0.3) };
            there[j] = q[j] + turn[j] * if rng.unit() < 0.5 { 1.0 } else { rng.within(-1.0, 1.0) };
        }
        world.place(&q, &mut snapshot);
        world.moves_m((&snapshot, &world.every_body()), &turn, &mut moves_m);
        let (before, after) = (robot.chain.frames(&q), robot.chain.frames(&there));
        assert_pairs_move_no_further(&world, &moves_m, (&before, &after), &mut rng);
        for (body, shape) in robot.shapes.iter().enumerate() {
            for point in points(&mut rng, &shape.shape, true) {
                let at = |frames: &[Pose]| frames[shape.frame] * shape.pose * point;
                for from in 0..shape.frame {
                    let seen = |frames: &[Pose]| frames[from].inverse() * at(frames);
                    let (moved_m, bound_m) = ((seen(&after) - seen(&before)).norm(), moves_m[body][from]);
                    let name = format!("seed {seed}, shape {body} ({:?}) seen from {from}", shape.shape);
                    assert!(moved_m <= bound_m + 1e-12, "{name}: {moved_m} above {bound_m}");
                    let closest = &mut nearest[kind(&shape.shape)];
                    if bound_m > 1e-3 {
                        *closest = closest.max(moved_m / bound_m);
                    }
                }
            }
            for point in points(&mut rng, &shape.shape, false) {
                for joint in robot.chain.movers(shape.frame) {
                    let axis = robot.chain.joint(joint).expect("a joint");
                    let base = before[robot.chain.parent_frame(joint)] * axis.pre;
                    let seen = base.inverse() * before[shape.frame] * shape.pose * point;
                    let lever_m = match axis.kind {
                        JointKind::Revolute => seen.coords.cross(&axis.axis).norm(),
                        // Metres a metre.
                        JointKind::Prismatic => 1.0,
                    };
                    assert!(lever_m <= world.reach_m()[joint] + 1e-12, "seed {seed}: reach of joint {joint}");
                }
            }
        }
    }
    for (kind, share) in nearest.iter().enumerate() {
        assert!(*share > 0.9, "kind {kind}: no point came nearer than {share} to its bound");
    }
}

/// The bound that a sweep takes for a pair of links: distances between points of the two, and where one carries the other, points of
/// that one seen from the other.
fn assert_pairs_move_no_further(
    world: &World,
    moves_m: &[[f64; MAX_JOINTS + 1]],
    (before, after): (&[Pose], &[Pose]),
    rng: &mut SeededRng,
) {
    let shapes = &world.robot().shapes;
    for pair in world.pairs() {
        let Other::Link(other) = pair.other else { continue };
        let (shape, from) = (&shapes[pair.link], shapes[other].frame);
        let bound_m = world.pair_moves_m(pair, moves_m);
        let at = |frames: &[Pose], shape: &LinkShape, point: &Point3<f64>| {
            frames[shape.frame] * shape.pose * point
        };
        let others = points(rng, &shapes[other].shape, true);
        for (point, beside) in points(rng, &shape.shape, true).iter().zip(&others) {
            let apart_m =
                |frames: &[Pose]| (at(frames, shape, point) - at(frames, &shapes[other], beside)).norm();
            let moved_m = (apart_m(after) - apart_m(before)).abs();
            assert!(moved_m <= bound_m + 1e-12, "{pair:?}: {moved_m} above {bound_m}");
        }
        if world.robot().chain.common_frame(shape.frame, from) != from {
            continue;
        }
        for point in points(rng, &shape.shape, true) {
            let seen = |frames: &[Pose]| frames[from].inverse() * frames[shape.frame] * shape.pose * point;
            let moved_m = (seen(after) - seen(before)).norm();
            assert!(moved_m <= bound_m + 1e-12, "{pair:?}: {moved_m} above {bound_m}");
        }
    }
}

/// Goal: what a sweep proves about the links among themselves holds at every instant, for every pair that may not touch.
/// Method: random robots and edges; the pairs that are near at the start are let touch. Dense poses, and distances of all
/// shapes of different links, chosen and measured without the world.
#[test]
fn clearance_between_links_that_a_sweep_proves_holds_at_every_pose_between() {
    let (mut proven, mut refused) = (0, 0);
    let template = ur5();
    for seed in 0..1_500 {
        let mut robot = robot(&template, seed);
        let bodies: Vec<Body> =
            robot.shapes.iter().map(|s| Body::new(&s.shape, &s.pose).expect("a body")).collect();
        let mut rng = SeededRng::new(seed, 33);
        let mut ends: [JointArray; 2] = Default::default();
        for end in &mut ends {
            (0..robot.joints.len()).for_each(|j| end[j] = rng.within(-0.8, 0.8));
        }
        let at = |t: f64| std::array::from_fn(|j| ends[0][j] + (ends[1][j] - ends[0][j]) * t);
        let apart = |robot: &Robot, t: f64| -> Vec<((usize, usize), f64)> {
            let frames = robot.chain.frames(&at(t));
            let placed: Vec<_> = robot
                .shapes
                .iter()
                .zip(&bodies)
                .map(|(s, body)| body.placed(&to_parry(&frames[s.frame])))
                .collect();
            let mut pairs = Vec::new();
            for (i, a) in robot.shapes.iter().enumerate() {
                for (j, b) in robot.shapes.iter().enumerate().skip(i + 1) {
                    if a.link != b.link && !robot.may_touch(a.link, b.link) {
                        let d = bodies[i].distance_m(&placed[i], &bodies[j], &placed[j]);
                        pairs.push(((a.link.min(b.link), a.link.max(b.link)), d));
                    }
                }
            }
            pairs
        };
        let near = apart(&robot, 0.0).into_iter().filter(|(_, d)| *d < 0.004).map(|(links, _)| links);
        robot.allowed_by_file = near.collect();
        if apart(&robot, 0.0).is_empty() {
            continue;
        }
        let scene = empty();
        let world = World::new(&robot, &scene).expect("builds");
        let edge = StraightEdge { from_rad: &ends[0], to_rad: &ends[1] };
        let swept = sweep(&world, &edge, [0.0, 1.0], &SweepRules::LEAST_DISTANCE, &Budget::unbounded());
        let Ok(clearance) = swept else {
            refused += 1;
            continue;
        };
        proven += 1;
        for step in 0..=300 {
            for (links, distance_m) in apart(&robot, f64::from(step) / 300.0) {
                let least_m = clearance.proven_m.max(robot.margins.of(links.0, links.1));
                assert!(distance_m >= least_m - 1e-9, "seed {seed}, {links:?}: {distance_m} below {least_m}");
            }
        }
    }
    assert!(proven > 200 && refused > 100, "{proven} proven, {refused} refused");
}

/// A sweep that is asked for more than the least distance is blocked by that distance, one that is asked for less is not, and one that may
/// look at one pose less, or has no time, is not proven.
fn assert_rules_are_kept((world, edge): (&World, &StraightEdge), clearance: &Clearance, seed: u64) {
    let sweep = |rules: &SweepRules, budget: &Budget| sweep(world, edge, [0.0, 1.0], rules, budget);
    let Some(pair) = clearance.pair else { return };
    let extra = |extra_m: f64| SweepRules { extra_m, ..SweepRules::LEAST_DISTANCE };
    let beyond_m = clearance.sampled_m - pair.required_m;
    let blocked = sweep(&extra(beyond_m + 1e-4), &Budget::unbounded()).expect_err("asked for too much");
    let (_, distance_m) = blocked.pair.expect("what is too close");
    let most_m = clearance.sampled_m + 1e-4 + SweepRules::LEAST_DISTANCE.resolution_m;
    assert!(distance_m <= most_m, "seed {seed}: {distance_m} is not too close, {most_m} is");
    let less_m = clearance.proven_m - pair.required_m - 1e-4;
    assert!(sweep(&extra(less_m), &Budget::unbounded()).is_ok(), "seed {seed}: {clearance:?}");

    let hurried = SweepRules { checks_max: clearance.checks - 1, ..SweepRules::LEAST_DISTANCE };
    let cut = sweep(&hurried, &Budget::unbounded()).expect_err("one pose less than it takes");
    assert!(cut.pair.is_none() && cut.checks == hurried.checks_max, "seed {seed}: {cut:?}");
    let late = sweep(&SweepRules::LEAST_DISTANCE, &Budget::until(Duration::ZERO, None)).expect_err("no time");
    assert!(late.pair.is_none(), "seed {seed}: {late:?}");
}

/// Goal: what a sweep proves about a whole motion holds at every instant of it, for all shapes against all.
/// Method: dense poses of random edges among random obstacles, each shape's distance as the world measures it there.
#[test]
fn clearance_that_a_sweep_proves_holds_at_every_pose_between() {
    let mut proven = 0;
    let template = ur5();
    for seed in 0..800 {
        let mut robot = robot(&template, seed);
        // Its own links overlap in nearly every pose; here the obstacles count.
        robot.allowed_by_file =
            (0..robot.links.len()).flat_map(|a| (a..robot.links.len()).map(move |b| (a, b))).collect();
        let mut rng = SeededRng::new(seed, 32);
        let obstacle = |i: usize, rng: &mut SeededRng| {
            let kind = rng.index(KINDS);
            Obstacle { name: format!("o{i}"), pose: pose(rng, 1.0), shape: shape(rng, kind) }
        };
        let obstacles = (0..3).map(|i| obstacle(i, &mut rng)).collect();
        let scene = Scene { obstacles, ..empty() };
        let world = World::new(&robot, &scene).expect("builds");
        let mut ends: [JointArray; 2] = Default::default();
        for end in &mut ends {
            (0..robot.joints.len()).for_each(|j| end[j] = rng.within(-1.0, 1.0));
        }
        let edge = StraightEdge { from_rad: &ends[0], to_rad: &ends[1] };
        let Ok(clearance) =
            sweep(&world, &edge, [0.0, 1.0], &SweepRules::LEAST_DISTANCE, &Budget::unbounded())
        else {
            continue;
        };
        proven += 1;
        assert_rules_are_kept((&world, &edge), &clearance, seed);
        let mut snapshot = Snapshot::default();
        for step in 0..=200 {
            let t = f64::from(step) / 200.0;
            let q: JointArray = std::array::from_fn(|j| ends[0][j] + (ends[1][j] - ends[0][j]) * t);
            world.place(&q, &mut snapshot);
            for pair in world.pairs() {
                let distance_m = world.distance_m(pair, &snapshot);
                let least_m = clearance.proven_m;
                assert!(
                    distance_m >= least_m - 1e-9,
                    "seed {seed}, t {t}: {distance_m} below the proven {least_m}"
                );
            }
        }
    }
    assert!(proven > 150, "only {proven} motions were free");
}
