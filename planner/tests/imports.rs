//! Imported motions: near the original, inside of the limits, or refused with a reason.
mod common;
use common::{config, pose, scene, ur5, ur5_origins_m};
use nalgebra::Vector3;
use std::path::Path;
use std::time::Duration;
use taustream_arm::rng::SeededRng;
use taustream_arm::{MotionTable, PathFile, PathPoint, Robot, Scene};
use taustream_motion::limits::check_motion;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::import::{
    ImportError, Imported, Reference, TOLERANCE_RAD_DEFAULT, TimedBy, Via, ViaProfile, fitted_durations_s,
    import, import_strokes, optimised_durations_s, poses_of,
};

const HOME_RAD: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

/// A table of rows of joint angles every `every_s`.
fn table(every_s: f64, rows: usize, at: impl Fn(f64) -> JointArray) -> MotionTable {
    let t_s: Vec<f64> = (0..rows).map(|i| i as f64 * every_s).collect();
    let position_rad = t_s.iter().map(|t| at(*t)).collect();
    MotionTable {
        joints: 6,
        t_s,
        position_rad,
        velocity_rad_s: None,
        acceleration_rad_s2: None,
        began_s: 0.0,
        ignored: Vec::new(),
    }
}

/// The largest difference to the original at instants that the import does not know, by its own account of delay and scale.
fn measured_rad(imported: &Imported, reference: &Reference, seed: u64) -> f64 {
    let delay_s = imported.kernel.map_or(0.0, |kernel| kernel.delay_s);
    let mut rng = SeededRng::new(seed, 9);
    let mut most: f64 = 0.0;
    for _ in 0..20_000 {
        let at_s = rng.within(-0.1, reference.duration_s() + 0.1);
        let q = imported.trajectory.sample(at_s * imported.time_scale + delay_s).position_rad;
        let r = reference.at(at_s);
        most = q.iter().zip(&r).map(|(q, r)| (q - r).abs()).fold(most, f64::max);
    }
    most
}

fn far_and_safe(imported: &Imported, reference: &Reference, robot: &Robot, seed: u64) {
    let measured = measured_rad(imported, reference, seed);
    let reported = imported.deviation.rad;
    assert!(measured <= reported + 1e-12, "seed {seed}: {measured} measured, {reported} reported");
    assert!(reported <= TOLERANCE_RAD_DEFAULT, "seed {seed}: {reported}");
    let proof = check_motion(&imported.trajectory, &robot.limits());
    assert!(proof.is_ok(), "seed {seed}: {proof:?}");
    let end = imported.trajectory.end_rad();
    let last = reference.at(f64::INFINITY);
    let gap = end.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(gap < 1e-9, "seed {seed}: ends {gap} rad from the original's end");
}

/// Goal: whatever points and profile, the import is near, inside of the limits and says truly how near, or is refused; never
/// a panic. Method: random points, some of them equal, with fitted and with random durations.
#[test]
fn random_points_by_any_profile_are_imported_truly_or_refused() {
    let (robot, scene) = (ur5(), Scene::default());
    let (mut imported_count, mut by_profile) = (0, [0; 7]);
    for seed in 0..84 {
        let mut rng = SeededRng::new(seed, 0);
        let which = (seed % 7) as usize;
        let k = (which < 2).then(|| rng.within(0.02, 0.33));
        let profile = ViaProfile::from_name(ViaProfile::NAMES[which], k).expect("a profile");
        let mut points_rad = vec![pose(HOME_RAD)];
        for _ in 0..1 + rng.index(5) {
            let last = points_rad[points_rad.len() - 1];
            let reach = if rng.index(6) == 0 { 0.0 } else { rng.within(0.01, 0.8) };
            points_rad
                .push(std::array::from_fn(|j| if j < 6 { last[j] + rng.within(-reach, reach) } else { 0.0 }));
        }
        let fitted = match fitted_durations_s(&points_rad, 6, profile, &robot.limits()) {
            Ok(fitted) => fitted,
            Err(ImportError::Still) => continue,
            Err(other) => panic!("seed {seed}: {other}"),
        };
        let hurry = if seed % 3 == 0 { rng.within(0.4, 3.0) } else { 1.0 };
        let durations_s: Vec<f64> = fitted.iter().map(|s| (s * hurry).max(0.001)).collect();
        let via = Via { points_rad: &points_rad, joints: 6, profile, durations_s: &durations_s };
        let reference = match Reference::through(&via) {
            Ok(reference) => reference,
            Err(ImportError::Still) => continue,
            Err(other) => panic!("seed {seed}: {other}"),
        };
        match import(&robot, &scene, &reference, TOLERANCE_RAD_DEFAULT) {
            Ok(imported) => {
                far_and_safe(&imported, &reference, &robot, seed);
                imported_count += 1;
                by_profile[which] += 1;
            }
            // Random points may well run the arm into itself; everything else would be our fault.
            Err(ImportError::Unproven { .. } | ImportError::OutsideLimits { .. }) => {}
            // A not-a-knot spline sets out at any speed, which from rest cannot always be come near to.
            Err(ImportError::TooFar { .. }) if profile == ViaProfile::NotAKnot => {}
            Err(other) => panic!("seed {seed}, {profile:?}: {other}"),
        }
    }
    assert!(imported_count > 30 && by_profile.iter().all(|n| *n > 0), "{imported_count}: {by_profile:?}");
}

/// Goal: a Tau-J* whose 1/k is whole is not approximated. Method: the strokes written down by hand give the same bits.
#[test]
fn tau_j_star_of_a_whole_number_is_the_stroke_itself() {
    let (robot, scene) = (ur5(), Scene::default());
    let points_rad =
        [pose(HOME_RAD), pose([0.4, -1.4, 1.5, -1.57, -1.5, 0.2]), pose([0.9, -1.3, 1.2, -1.5, -1.4, 0.0])];
    for n in 4..=64_u32 {
        let profile = ViaProfile::TauJStar { k: 1.0 / f64::from(n) };
        let durations_s = [2.5, 3.25];
        let via = Via { points_rad: &points_rad, joints: 6, profile, durations_s: &durations_s };
        assert_eq!(profile.stroke_n(), Some(n));
        let imported = import_strokes(&robot, &scene, &via, n).expect("a motion");
        let stroke = |i: usize, start_s: f64| Stroke {
            start_s,
            duration_s: durations_s[i],
            n,
            delta_rad: std::array::from_fn(|j| points_rad[i + 1][j] - points_rad[i][j]),
        };
        let by_hand = Trajectory::new(6, points_rad[0], &[stroke(0, 0.0), stroke(1, 2.5)]).expect("strokes");
        assert_eq!((imported.time_scale, imported.kernel, imported.deviation.rad), (1.0, None, 0.0));
        for i in 0..=5_750 {
            let t_s = f64::from(i) * 1e-3;
            assert_eq!(imported.trajectory.sample(t_s), by_hand.sample(t_s), "n {n} at {t_s} s");
        }
    }
    // Too fast, it is slowed down and says so.
    let hurried = [0.2, 0.2];
    let via = Via {
        points_rad: &points_rad,
        joints: 6,
        profile: ViaProfile::TauJStar { k: 0.1 },
        durations_s: &hurried,
    };
    let imported = import_strokes(&robot, &scene, &via, 10).expect("a motion");
    assert!(imported.time_scale > 2.0 && check_motion(&imported.trajectory, &robot.limits()).is_ok());
}

/// Goal: a table of a motion of strokes becomes that motion again, nearly.
#[test]
fn table_of_a_verified_motion_is_imported_at_its_own_speed() {
    let robot = ur5();
    let points_rad = [pose(HOME_RAD), pose([0.8, -1.3, 1.2, -1.5, -1.4, 0.3])];
    let profile = ViaProfile::TauJStar { k: 0.1 };
    let durations_s = fitted_durations_s(&points_rad, 6, profile, &robot.limits()).expect("durations");
    let via = Via { points_rad: &points_rad, joints: 6, profile, durations_s: &durations_s };
    let original = Reference::through(&via).expect("a motion");
    let reference =
        Reference::of_table(table(1e-3, 3_000, |t| original.at(t)), &robot.limits()).expect("a table");
    let imported = import(&robot, &scene("open"), &reference, TOLERANCE_RAD_DEFAULT).expect("a motion");
    far_and_safe(&imported, &reference, &robot, 1);
    let late_s = imported.trajectory.duration_s() - original.duration_s();
    assert!(imported.time_scale < 1.05 && late_s < 0.25, "{late_s} s, {}", imported.time_scale);
}

/// Goal: a table with few rows costs little time: by its own velocities and accelerations it is the motion itself, and
/// without them a spline does nearly as well, where straight lines made it three times slower.
#[test]
fn coarse_table_of_a_verified_motion_is_imported_nearly_at_its_own_speed() {
    let robot = ur5();
    let limits = robot.limits();
    let points_rad = [pose(HOME_RAD), pose([1.2, -1.3, 1.4, -1.6, -1.57, 0.0])];
    let profile = ViaProfile::TauJStar { k: 0.1 };
    let durations_s = fitted_durations_s(&points_rad, 6, profile, &limits).expect("durations");
    let via = Via { points_rad: &points_rad, joints: 6, profile, durations_s: &durations_s };
    let original = import_strokes(&robot, &scene("open"), &via, 10).expect("strokes").trajectory;
    let at = |t: f64| original.sample(t);
    let rows = 2 + usize::try_from(Duration::from_secs_f64(original.duration_s()).as_millis() / 100)
        .expect("a short motion");
    for order in 0..3 {
        let mut coarse = table(0.1, rows, |t| at(t).position_rad);
        let column =
            |f: &dyn Fn(f64) -> JointArray| Some(coarse.t_s.iter().map(|t| f(*t)).collect::<Vec<_>>());
        let velocity = column(&|t| at(t).velocity_rad_s).filter(|_| order >= 1);
        let acceleration = column(&|t| at(t).acceleration_rad_s2).filter(|_| order >= 2);
        (coarse.velocity_rad_s, coarse.acceleration_rad_s2) = (velocity, acceleration);
        let reference = Reference::of_table(coarse, &limits).expect("a table");
        assert_eq!(reference.note(), None);
        let off_rad = (0..1000).map(|i| {
            let t = f64::from(i) * 1e-3 * original.duration_s();
            let (q, r) = (at(t).position_rad, reference.at(t));
            q.iter().zip(r).map(|(q, r)| (q - r).abs()).fold(0.0, f64::max)
        });
        let off_rad = off_rad.fold(0.0, f64::max);
        assert!(off_rad < [0.02, 0.01, 0.002][order], "order {order}: {off_rad} rad from the motion");
        let imported = import(&robot, &scene("open"), &reference, TOLERANCE_RAD_DEFAULT).expect("a motion");
        far_and_safe(&imported, &reference, &robot, order as u64);
        let factor = imported.trajectory.duration_s() / original.duration_s();
        assert!(factor < [1.6, 1.5, 1.4][order], "order {order}: {factor} times as long");
    }
}

/// Goal: columns of velocity and acceleration make a Hermite spline. Method: a cubic, which the rows alone do not give back.
#[test]
fn cubic_is_given_back_by_its_velocities_and_accelerations_alone() {
    let cubic = |t: f64| [0.1 * t * t * t, 0.3 * t * t, 0.6 * t];
    let column = |order: usize, t: f64| {
        let mut column = JointArray::default();
        column[0] = cubic(t)[order];
        column
    };
    for order in 0..3 {
        let mut rows = table(1.0, 3, |t| column(0, t));
        let columns = |order| Some([0.0, 1.0, 2.0].map(|t| column(order, t)).to_vec());
        rows.velocity_rad_s = columns(1).filter(|_| order >= 1);
        rows.acceleration_rad_s2 = columns(2).filter(|_| order >= 2);
        let reference = Reference::of_table(rows, &ur5().limits()).expect("a table");
        let off_rad = [0.25, 0.5, 1.25, 1.75].map(|t: f64| (reference.at(t)[0] - cubic(t)[0]).abs());
        let off_rad = off_rad.into_iter().fold(0.0, f64::max);
        assert_eq!(off_rad < 1e-12, order >= 1, "order {order}: {off_rad} rad off");
    }
}

/// Velocities of another unit or joint are found out by the rows themselves, and left out with a message.
#[test]
fn velocities_that_do_not_fit_their_rows_are_not_used() {
    let robot = ur5();
    let made = |factor: f64| {
        let mut made = table(0.05, 41, |t| {
            let mut q = pose(HOME_RAD);
            q[0] = 0.4 * (1.0 - (3.0 * t).cos());
            q
        });
        let velocity = |t: &f64| {
            let mut v = [0.0; MAX_JOINTS];
            v[0] = factor * 1.2 * (3.0 * t).sin();
            v
        };
        made.velocity_rad_s = Some(made.t_s.iter().map(velocity).collect());
        Reference::of_table(made, &robot.limits()).expect("a table")
    };
    assert_eq!(made(1.0).note(), None);
    let degrees = made(57.29578);
    let note = degrees.note().expect("a note");
    assert!(note.contains("joint 1") && note.contains("not used"), "{note}");
    let beside = (degrees.at(0.525)[0] - made(1.0).at(0.525)[0]).abs();
    assert!(beside < 1e-3, "{beside}");
}

/// A curve through rows stays between the limits, stands still where rows do, and meets every row.
#[test]
fn curve_through_random_rows_stays_inside_the_range_and_rests_where_they_rest() {
    let robot = ur5();
    let limits = robot.limits();
    let [_, limit_rad] = limits[0].position_rad;
    for seed in 0..300 {
        let mut rng = SeededRng::new(seed, 4);
        let mut values: Vec<f64> = Vec::new();
        while values.len() < 12 {
            let value = rng.within(-limit_rad, limit_rad).clamp(-3.1, 3.1);
            values.extend(std::iter::repeat_n(
                if rng.index(4) == 0 { limit_rad } else { value },
                1 + rng.index(3),
            ));
        }
        let mut t_s = vec![0.0];
        for _ in 1..values.len() {
            t_s.push(t_s[t_s.len() - 1] + 10_f64.powf(rng.within(-2.0, 0.0)));
        }
        let mut made = table(1.0, values.len(), |_| pose(HOME_RAD));
        made.t_s = t_s.clone();
        made.position_rad.iter_mut().zip(&values).for_each(|(row, value)| row[0] = *value);
        made.position_rad.push(pose(HOME_RAD));
        made.t_s.push(t_s[t_s.len() - 1] + 1.0);
        let reference = Reference::of_table(made, &limits).expect("a table");
        for (row, pair) in t_s.windows(2).enumerate() {
            assert_eq!(reference.at(pair[0])[0].to_bits(), values[row].to_bits(), "seed {seed}");
            for i in 0..=20 {
                let q = reference.at(pair[0] + (pair[1] - pair[0]) * f64::from(i) / 20.0)[0];
                assert!(q.abs() <= limit_rad + 1e-12, "seed {seed}: {q} rad in row {row}");
                let rests = values[row].to_bits() == values[row + 1].to_bits();
                assert!(!rests || (q - values[row]).abs() < 1e-12, "seed {seed}: it moves in row {row}");
            }
        }
    }
}

/// Goal: nothing is asked of a table but rising times: corners, tears below a jump, a start at full speed, long rests.
#[test]
fn tables_of_rough_motions_are_imported_from_rest_to_rest() {
    let (robot, scene) = (ur5(), Scene::default());
    let home = pose(HOME_RAD);
    let moved = |by: f64| {
        let mut q = home;
        q[0] += by;
        q
    };
    let rough: [(&str, MotionTable); 4] = [
        ("starts and ends at speed", table(0.01, 101, |t| moved(0.5 * t))),
        ("sharp corners", table(0.01, 201, |t| moved(0.4 * (t % 1.0 - 0.5).abs()))),
        ("few rows", table(1.0, 6, |t| moved(0.1 * t * (5.0 - t)))),
        ("rests for an hour", table(0.5, 7_201, |t| moved((t - 1_800.0).clamp(0.0, 1.0) * 0.3))),
    ];
    for (i, (what, table)) in rough.into_iter().enumerate() {
        let reference = Reference::of_table(table, &robot.limits()).expect(what);
        let imported = import(&robot, &scene, &reference, TOLERANCE_RAD_DEFAULT)
            .unwrap_or_else(|e| panic!("{what}: {e}"));
        far_and_safe(&imported, &reference, &robot, i as u64);
        let ends =
            [0.0, imported.trajectory.duration_s()].map(|t| imported.trajectory.sample(t).velocity_rad_s);
        assert!(ends.iter().flatten().all(|v| *v == 0.0), "{what}");
    }
}

#[test]
fn motions_that_cannot_be_followed_are_refused_with_joint_time_and_size() {
    let (robot, scene) = (ur5(), scene("open"));
    let home = pose(HOME_RAD);
    let moved = |joint: usize, by: f64| {
        let mut q = home;
        q[joint] += by;
        q
    };
    let said = |table: MotionTable, tolerance_rad: f64| {
        let reference = match Reference::of_table(table, &robot.limits()) {
            Ok(r) => r,
            Err(e) => return e.to_string(),
        };
        import(&robot, &scene, &reference, tolerance_rad).expect_err("a refusal").to_string()
    };
    let jump = said(table(0.01, 100, |t| moved(2, if t < 0.5 { 0.0 } else { 0.9 })), 0.005);
    for word in ["joint 3 (elbow)", "jumps by 0.9000 rad", "t = 0.500 s", "29 times", "correct the table"] {
        assert!(jump.contains(word), "{jump}");
    }
    let turn = said(table(0.01, 100, |t| moved(5, if t < 0.5 { -3.1 } else { 3.1 })), 0.005);
    assert!(turn.contains("unwrap"), "{turn}");
    let outside = said(table(0.01, 400, |t| moved(0, t)), 0.005);
    assert!(
        outside.contains("joint 1 (shoulder_pan)") && outside.contains("outside [-3.1416, 3.1416]"),
        "{outside}"
    );
    let still = said(table(0.01, 100, |_| home), 0.005);
    assert!(still.contains("nothing moves"), "{still}");
    let near = said(table(0.01, 2_000, |t| moved(0, 0.5 * (3.0 * t).sin())), 1e-9);
    assert!(near.contains("512 strokes come as near as 0.0"), "{near}");
    let hit = said(table(0.01, 200, |t| moved(1, 0.9 * t)), 0.005);
    assert!(hit.contains("is not safe") && hit.contains("table"), "{hit}");
    let mut seven = table(0.01, 100, |t| moved(0, t));
    seven.joints = 7;
    assert!(said(seven, 0.005).contains("7 joints, the robot has 6"));
}

/// Goal: what is read of a file and what is imported fit together, hundreds of broken files included.
#[test]
fn mutated_tables_never_panic_and_never_pass_unverified() {
    let (robot, scene) = (ur5(), Scene::default());
    let mut text = String::from("t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad\n");
    for i in 0..40 {
        let q = 0.1 * (f64::from(i) * 0.15).sin();
        text.push_str(&format!("{},{q},-1.57,1.57,-1.57,-1.57,0\n", f64::from(i) * 0.05));
    }
    let mut passed = 0;
    for seed in 0..300 {
        let mut rng = SeededRng::new(seed, 1);
        let mut bytes = text.clone().into_bytes();
        for _ in 0..1 + rng.index(3) {
            let at = rng.index(bytes.len());
            match rng.index(4) {
                0 => bytes[at] = b"0123456789.-e,\n"[rng.index(15)],
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, b"019-.,eN\n"[rng.index(9)]),
                _ => bytes.truncate(at.max(60)),
            }
        }
        let Ok(table) = MotionTable::read(Path::new("m.csv"), bytes.as_slice(), &[]) else { continue };
        let Ok(reference) = Reference::of_table(table, &robot.limits()) else { continue };
        if let Ok(imported) = import(&robot, &scene, &reference, TOLERANCE_RAD_DEFAULT) {
            check_motion(&imported.trajectory, &robot.limits())
                .unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            passed += 1;
        }
    }
    assert!(passed > 15, "only {passed} got that far");
}

/// Goal: the paper's eight points, on another arm, from the file to a verified motion whose tip passes them. Method: forward
/// kinematics by plain matrices that know nothing of the chain; a point moved by a centimetre must be noticed.
#[test]
fn eight_points_of_paper_001_are_passed_by_a_ur5() {
    const TOLERANCE_M: f64 = 0.003;
    let (robot, scene) = (ur5(), scene("open"));
    let path = PathFile::load(&config("paths/eight_points.toml")).expect("shipped");
    let places: Vec<Vector3<f64>> = path
        .points
        .iter()
        .map(|point| if let PathPoint::Place(place) = point { *place } else { panic!("{point:?}") })
        .collect();
    let poses_rad = poses_of(&robot, &path).expect("within reach");
    assert_eq!(poses_rad.len(), 8);
    let by = TimedBy { method: "isma", seed: 1, evaluations: 300 };
    let (durations_s, cost) = optimised_durations_s(&poses_rad, &robot, &by).expect("durations");
    assert_eq!(cost.broken, 0, "{cost:?}");
    let via =
        Via { points_rad: &poses_rad, joints: 6, profile: ViaProfile::BSpline7, durations_s: &durations_s };
    let reference = Reference::through(&via).expect("a spline");
    let imported = import(&robot, &scene, &reference, 0.002).expect("a motion");
    let delay_s = imported.kernel.expect("smoothed").delay_s;
    let off_m = |place: &Vector3<f64>, at_s: f64| {
        let q = imported.trajectory.sample(at_s * imported.time_scale + delay_s).position_rad;
        let tip = ur5_origins_m(&q)[6];
        (Vector3::from(tip) - place).norm()
    };
    for (place, at_s) in places.iter().zip(reference.joins_s()) {
        let off = off_m(place, at_s);
        assert!(off < TOLERANCE_M, "{place} is missed by {off} m");
        assert!(off_m(&(place + Vector3::new(0.01, 0.0, 0.0)), at_s) > TOLERANCE_M, "anything would pass");
    }
}

#[test]
fn path_that_leads_out_of_reach_or_says_too_little_is_refused_by_its_point() {
    let robot = ur5();
    let said = |head: &str, place: &str| {
        let text =
            format!("{head}\n[[point]]\nposition_m = [0.3, -0.2, 0.5]\n[[point]]\nposition_m = {place}\n");
        let path = PathFile::from_toml(Path::new("p.toml"), &text).expect("a path");
        poses_of(&robot, &path).map_or_else(|e| e.to_string(), |_| String::new())
    };
    let near = "near_rad = [2.8, -1.57, 1.57, -1.57, -1.57, 0.0]";
    assert_eq!(said(near, "[0.3, -0.3, 0.5]"), "");
    assert!(
        said(near, "[2.0, 0.0, 0.5]").contains("point 2 is not reached"),
        "{}",
        said(near, "[2.0, 0.0, 0.5]")
    );
    assert!(said("", "[0.3, -0.3, 0.5]").contains("near_rad"));
    assert!(said("near_rad = [0.0]", "[0.3, -0.3, 0.5]").contains("1 joints, the robot has 6"));
}
