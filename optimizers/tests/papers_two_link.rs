//! Sengupta et al. (2011): its arm and its price against an independent program, its walk and its cubics.
use taustream_optimizers::papers::two_link::{Moving, TwoLink};
use taustream_optimizers::papers::two_link_energy::{CubicSearch, Cubics, PieceEnergy, moving};
use taustream_optimizers::papers::two_link_via::{REACHED_RAD, STEP_RAD, ViaTask};
use taustream_optimizers::{Iwo, Optimizer, Problem, Progress, Reading, Run, Setup, by_name};

fn close(what: &str, ours: f64, theirs: f64, tolerance: f64) {
    assert!((ours - theirs).abs() <= tolerance * theirs.abs().max(1.0), "{what}: {ours}, expected {theirs}");
}

#[test]
fn two_link_energy_is_that_of_point_masses_along_the_links() {
    // What `oracles/two_link.py` prints.
    let cases = [
        ([0.3, 0.8, 1.2, -0.7, std::f64::consts::FRAC_PI_2], [19.052_978_579_3, 462.688_882_187]),
        ([1.1, 2.5, -0.4, 2.0, 0.6], [23.625_713_828_1, 425.773_334_634]),
    ];
    for ([theta, phi, v, w, azimuth_rad], theirs) in cases {
        let arm = TwoLink { azimuth_rad, ..TwoLink::PAPER_004 };
        let at = Moving { angle_rad: [theta, phi], speed_rad_s: [v, w], ..Moving::default() };
        for (ours, theirs) in arm.energy(&at).into_iter().zip(theirs) {
            close("energy", ours, theirs, 1e-10);
        }
        // As printed the arm hangs: the part of the height changes sign, that of the base does not.
        let printed = TwoLink { reading: Reading::Printed, ..arm };
        let sum = arm.energy(&at)[1] + printed.energy(&at)[1];
        close("both readings of the potential energy", sum, 2.0 * 9.81 * 20.0 * 2.0, 1e-12);
    }
}

/// Goal: torques are those of the energy. Method: the power that they do is the change of the energy, by differences,
/// along a motion in which everything changes, and each torque's own share by Lagrange's equation.
#[test]
fn two_link_torques_change_the_energy_by_the_work_they_do() {
    for reading in [Reading::Corrected, Reading::Printed] {
        for azimuth_rad in [std::f64::consts::FRAC_PI_2, 0.4] {
            let arm = TwoLink {
                azimuth_rad,
                reading,
                masses: [1.3, 0.7],
                lengths: [5.0, 4.0],
                ..TwoLink::PAPER_004
            };
            let piece = [[0.2, 0.5, 0.3, -0.2], [1.4, -0.6, 0.1, 0.35]];
            for t in [0.0, 0.3, 0.9] {
                let at = moving(&piece, t);
                let total = |t: f64| arm.energy(&moving(&piece, t)).iter().sum::<f64>();
                let change = (total(t + 1e-5) - total(t - 1e-5)) / 2e-5;
                let torques = arm.torques(&at);
                let power = torques[0] * at.speed_rad_s[0] + torques[1] * at.speed_rad_s[1];
                close("power", power, change, 1e-7);
                for (j, torque) in torques.into_iter().enumerate() {
                    close("torque", torque, lagrange(&arm, &piece, t, j), 1e-5);
                }
            }
        }
    }
}

/// d/dt (dL/dq') - dL/dq by differences.
fn lagrange(arm: &TwoLink, piece: &[[f64; 4]; 2], t: f64, j: usize) -> f64 {
    let h = 1e-4;
    let l = |t: f64, dq: f64, dv: f64| {
        let mut at = moving(piece, t);
        at.angle_rad[j] += dq;
        at.speed_rad_s[j] += dv;
        let [kinetic, potential] = arm.energy(&at);
        kinetic - potential
    };
    let momentum = |t: f64| (l(t, 0.0, h) - l(t, 0.0, -h)) / (2.0 * h);
    (momentum(t + h) - momentum(t - h)) / (2.0 * h) - (l(t, h, 0.0) - l(t, -h, 0.0)) / (2.0 * h)
}

#[test]
fn two_link_price_agrees_with_the_python_program_in_radians_and_degrees() {
    let cases = [
        ([0.0, 0.0], [31.415_926_535_9, 1_800.0]),
        ([0.9, 1.0], [165.991_875_228, 864.956_137_943]),
        ([0.8, 0.9], [117.605_025_716, 929.160_847_458]),
        ([1.6, -0.1], [20_017.0, 20_974.028_251_7]),
    ];
    for (at, theirs) in cases {
        for (reading, theirs) in [Reading::Corrected, Reading::Printed].into_iter().zip(theirs) {
            close("price", ViaTask::paper_004(reading).price(at), theirs, 1e-10);
        }
    }
}

/// Goal: as an independent implementation showed, in radians the via points stand clear and the walk backs off; in
/// degrees it goes straight through the obstacles, in six points, whatever the penalty.
#[test]
fn two_link_walks_round_in_radians_and_straight_through_in_degrees() {
    let iwo = Iwo::PAPER_004;
    for seed in 0..5 {
        let task = ViaTask::paper_004(Reading::Corrected);
        let path = task.walk(&iwo, 4_000, seed).expect("sane");
        let nearest = path.via_rad.iter().map(|p| task.distance(*p)).fold(f64::INFINITY, f64::min);
        assert!(path.reached && (6..=10).contains(&path.via_rad.len()), "seed {seed}: {path:?}");
        assert!((1.785..1.85).contains(&nearest), "seed {seed}: nearest {nearest}, contact is at 1.799");

        let printed = ViaTask::paper_004(Reading::Printed);
        let straight = printed.walk(&iwo, 4_000, seed).expect("sane");
        let nearest = straight.via_rad.iter().map(|p| task.distance(*p)).fold(f64::INFINITY, f64::min);
        assert!(straight.reached && straight.via_rad.len() == 6, "seed {seed}: {straight:?}");
        assert!((nearest - 0.930).abs() < 0.02, "seed {seed}: nearest {nearest}");
        for pair in path.via_rad.windows(2) {
            assert!((0..2).all(|j| (pair[1][j] - pair[0][j]).abs() <= STEP_RAD + 1e-12));
        }
    }
}

/// Goal: the pieces between clear via points are not clear, which is why whatever uses them checks the motion.
#[test]
fn two_link_via_points_stand_clear_but_the_lines_between_them_do_not() {
    let task = ViaTask::paper_004(Reading::Corrected);
    let path = task.walk(&Iwo::PAPER_004, 4_000, 3).expect("sane");
    let between = path.via_rad.windows(2).flat_map(|p| {
        (0..=20).map(move |i| std::array::from_fn(|j| p[0][j] + (p[1][j] - p[0][j]) * f64::from(i) / 20.0))
    });
    let nearest = between.map(|p| task.distance(p)).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1.785, "nearest {nearest}");
}

/// Goal: a number of spheres puts them in the middles of equal parts; more of them see more of a link, and none nothing.
#[test]
fn two_link_spheres_stand_in_the_middles_of_equal_parts() {
    let task = ViaTask::paper_004(Reading::Corrected);
    let with = |spheres: u32| ViaTask { obstacles: vec![[0.0, 0.0, 2.5]], spheres, ..task.clone() };
    // The first link stands upright, from 0 to 5.
    for (spheres, nearest) in [(1, 0.0), (2, 1.25), (5, 0.0), (10, 0.25)] {
        close("nearest", with(spheres).distance([0.0, 0.0]), nearest, 1e-12);
    }
    assert!(with(0).distance([0.0, 0.0]).is_infinite());
    let near = ViaTask { reached_rad: 0.05, ..task.clone() };
    let [exactly, roughly] =
        [task, near].map(|task| task.walk(&Iwo::PAPER_004, 4_000, 3).expect("sane").via_rad.len());
    assert!(roughly <= exactly, "{roughly} via points within 0.05 rad, {exactly} within 0.01");
}

#[test]
fn two_link_walk_that_cannot_arrive_ends_and_says_so() {
    let mut task = ViaTask::paper_004(Reading::Corrected);
    task.obstacles = vec![[0.0, 5.0, 0.0]];
    task.radii = [0.5, 4.0];
    let path = task.walk(&Iwo::PAPER_004, 300, 1).expect("sane");
    assert!(!path.reached && path.via_rad.len() == 201);
    let none = ViaTask::paper_004(Reading::Corrected).walk(&Iwo::PAPER_004, 0, 1).expect("sane");
    assert_eq!((none.reached, none.via_rad.len()), (false, 1));
    let there = ViaTask { goal_rad: [REACHED_RAD, 0.0], ..task };
    assert!(there.walk(&Iwo::PAPER_004, 300, 1).expect("sane").reached);
}

fn search(arm: TwoLink, optimizer: &dyn Optimizer, reading: Reading) -> CubicSearch<'_> {
    CubicSearch { arm, piece_s: 1.0, optimizer, evaluations_max: 4_000, seed: 1, reading }
}

/// Goal: without gravity and coupling the optimum is known: v(i+1) = (3 way/T + v(i))/4, from the derivative of the
/// integral of the squared speed of a cubic.
#[test]
fn two_link_cubics_without_gravity_and_coupling_have_the_speeds_of_the_closed_form() {
    // A second link of no length feels no coupling and costs no energy in φ: only θ is compared.
    let arm = TwoLink { gravity: 0.0, lengths: [5.0, 0.0], ..TwoLink::PAPER_004 };
    let via = [[0.0, 0.0], [0.4, 0.1], [0.5, 0.6], [1.2, 0.7]];
    let cubics = search(arm, &Iwo::PAPER_004, Reading::Printed).through(&via).expect("sane");
    let mut v = 0.0;
    for (i, piece) in cubics.pieces.iter().enumerate() {
        v = (3.0 * (via[i + 1][0] - via[i][0]) + v) / 4.0;
        close("speed at the end of a piece", moving(piece, 1.0).speed_rad_s[0], v, 1e-4);
    }
}

#[test]
fn two_link_cubics_pass_their_points_with_continuous_speed_and_stop_at_the_goal_unless_printed() {
    let via = [[0.0, 0.0], [0.35, 0.35], [0.7, 0.7], [1.0, 1.05], [1.57, 1.57]];
    for reading in [Reading::Corrected, Reading::Printed] {
        let cubics = search(TwoLink::PAPER_004, &Iwo::PAPER_004, reading).through(&via).expect("sane");
        let mut speed = [0.0; 2];
        for (pair, piece) in via.windows(2).zip(&cubics.pieces) {
            let [start, end] = [0.0, 1.0].map(|t| moving(piece, t));
            for j in 0..2 {
                close("start", start.angle_rad[j], pair[0][j], 1e-12);
                close("end", end.angle_rad[j], pair[1][j], 1e-12);
                close("speed", start.speed_rad_s[j], speed[j], 1e-12);
            }
            speed = end.speed_rad_s;
        }
        let rests = speed.iter().all(|v| v.abs() < 1e-12);
        assert_eq!(rests, reading == Reading::Corrected, "end speed {speed:?}");
        assert_eq!(cubics.at(9.0), cubics.at(4.0));
        assert!(cubics.work(&TwoLink::PAPER_004) > 0.0 && cubics.action(&TwoLink::PAPER_004).is_finite());
    }
    assert_eq!(Cubics { pieces: vec![], piece_s: 1.0 }.at(0.0), None);
}

#[test]
fn two_link_cubics_refuse_times_and_points_that_are_none() {
    let iwo = Iwo::PAPER_004;
    for piece_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let search = CubicSearch { piece_s, ..search(TwoLink::PAPER_004, &iwo, Reading::Corrected) };
        let refusal = search.through(&[[0.0; 2], [1.0; 2]]).expect_err("no time").to_string();
        assert!(refusal.contains("the time of a piece"), "{refusal}");
    }
    let sane = search(TwoLink::PAPER_004, &iwo, Reading::Corrected);
    let refusal = sane.through(&[[0.0; 2], [1.0, f64::NAN]]).expect_err("no point").to_string();
    assert!(refusal.contains("a via point is NaN"), "{refusal}");
    assert!(sane.through(&[]).is_ok_and(|c| c.pieces.is_empty()));
}

/// Goal: the paper's method finds the same least energy as another one.
#[test]
fn two_link_piece_of_least_energy_is_the_same_for_weeds_and_for_differences() {
    let problem = PieceEnergy {
        arm: TwoLink::PAPER_004,
        angles_rad: [[0.3, 0.2], [0.6, 0.5]],
        speed_rad_s: [0.2, -0.1],
        piece_s: 1.0,
        bounds: [[-20.0, 20.0]; 2],
    };
    let costs = ["iwo", "de"].map(|name| {
        let optimizer =
            by_name(name, Setup { evaluations: Some(6_000), ..Setup::default() }).expect("registered");
        let (is_over, mut watch) = (|| false, |_: &Progress| ());
        let run = Run { seed: 1, evaluations_max: 9_000, guesses: &[], is_over: &is_over, watch: &mut watch };
        optimizer.minimise(&problem, run).expect("sane").cost
    });
    close("least energy", costs[0], costs[1], 1e-8);
    assert!(problem.cost(&problem.to_rest()) > costs[1] && problem.cost(&[0.0]).is_infinite());
}
