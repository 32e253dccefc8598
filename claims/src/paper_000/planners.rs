//! Section 5.3: IBFOA-Tau-J*, BFOA-Tau-J and RRT on the same scenes, and what their motions ask of an arm.
use super::contenders::{BFOA, Contender, IBFOA};
use super::course::follow;
use super::paper_field::{CHECKED_RAD, STEP_RAD};
use super::path::{PathCost, TipPath};
use super::pictures::views;
use super::trees::tree;
use super::{K, SEGMENT_S, Unit, case, ours, refused, ur5};
use crate::chart::Panel;
use crate::claim::Claim;
use crate::effect::Effect;
use crate::figure::Figure;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, Summary, quantile};
use crate::table::{Cell, Table};
use taustream_arm::Robot;
use taustream_motion::profile::{Profile, TauJ, TauJStar};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::cost::CostModel;
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Case};
use taustream_optimizers::{Parameters, Reading};

const RUNS: usize = 30;
/// Scenes in which a collision is looked for until one refutes the claim: two in a hundred refute it in 99 of 100 seeds.
const COLLISION_RUNS: usize = 240;
const QUICK_EVALUATIONS: usize = 200;
/// What a jump of the jerk is at least: rounding (rad/s³).
pub(super) const LEAST: f64 = 1e-9;

/// The paper's three.
const WAYS: [&str; 3] = ["IBFOA-Tau-J*", "BFOA-Tau-J", "RRT"];

/// What the three found in one scene; a tree may find nothing.
struct Run {
    case: Case,
    found: [Option<(TipPath, PathCost)>; 3],
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let robot = ur5()?;
    let runs = run_context.runs(RUNS, 2);
    run_context.say(&format!("  IBFOA-Tau-J*, BFOA-Tau-J, RRT, {runs} scenes .."));
    let all = run_context.each(runs, |run| one(run_context, &robot, run))?;
    let mut outcome = Outcome { ours: ours(), ..Outcome::default() };
    outcome.ours.push(format!(
        "RRT: steps of {STEP_RAD} rad, poses checked every {CHECKED_RAD} rad, 5 % of the poses are the goal, as many poses \
         as the bacteria's evaluations have; its way is timed by Tau-J* strokes that share the paper's 24 s for equal peaks of the jerk"
    ));
    outcome.tables.push(table(&all));
    outcome.claims = vec![collisions(run_context, &robot, &all)?];
    outcome.claims.extend(claims(&robot, &all));
    outcome.figures = figures(&robot, &all);
    Ok(outcome)
}

fn one(run_context: &RunContext, robot: &Robot, run: usize) -> Result<Run, Stop> {
    let case = case(run_context, robot, run)?;
    let profiles: [Box<dyn Profile + Send>; 3] = [
        Box::new(TauJStar::new(K).map_err(|e| Stop::Refused(e.to_string()))?),
        Box::new(TauJ::new(K).map_err(|e| Stop::Refused(e.to_string()))?),
        Box::new(TauJStar::new(K).map_err(|e| Stop::Refused(e.to_string()))?),
    ];
    let (ibfoa, evaluations) = bacteria(run_context, robot, &case, &IBFOA, run)?;
    let (bfoa, _) = bacteria(run_context, robot, &case, &BFOA, run)?;
    let tree = tree(run_context, (robot, &case), STEP_RAD, evaluations * poses(), run)?;
    let distances = [Some(ibfoa), Some(bfoa), tree];
    let mut found = [None, None, None];
    for ((found, corners), profile) in found.iter_mut().zip(distances).zip(profiles) {
        if let Some(corners) = corners {
            let tip_path = TipPath { corners, profile };
            let worth = tip_path.worth(robot, &case.scene)?;
            *found = Some((tip_path, worth));
        }
    }
    Ok(Run { case, found })
}

/// Poses of one evaluation.
pub(super) fn poses() -> usize {
    CostModel::default().waypoints_per_segment * (CONTROL_POINTS + 1) + 1
}

/// What bacteria find in a scene, and their evaluations.
pub(super) fn bacteria(
    run_context: &RunContext,
    robot: &Robot,
    case: &Case,
    contender: &Contender,
    run: usize,
) -> Result<(Vec<JointArray>, usize), Stop> {
    let model = Unit::Metres.model(Reading::Corrected);
    let problem = case.problem(robot, CONTROL_POINTS, model).map_err(refused)?;
    let budget = run_context.choose(usize::MAX, QUICK_EVALUATIONS);
    let course = follow(
        run_context,
        (contender.make)(Parameters::CASE_1).as_ref(),
        &problem,
        run_context.seed(run),
        budget,
    )?;
    let corner = |x: &[f64]| {
        let mut corner = [0.0; MAX_JOINTS];
        corner.iter_mut().zip(x).for_each(|(c, x)| *c = *x);
        corner
    };
    let [start, goal] = case.ends_rad;
    let inner = course.found.x.chunks(robot.joints.len()).map(corner);
    let corners = std::iter::once(start).chain(inner).chain([goal]).collect();
    Ok((corners, course.found.progress.evaluations))
}

fn worths(all: &[Run], tip_path: usize) -> Vec<PathCost> {
    all.iter().filter_map(|r| r.found.get(tip_path)?.as_ref().map(|(_, w)| *w)).collect()
}

fn table(all: &[Run]) -> Table {
    let columns = [
        "",
        "free of collision",
        "path of the tip (m)",
        "joint travel (rad)",
        "clearance of the links' axes (m)",
        "peak velocity (rad/s)",
        "peak acceleration (rad/s²)",
        "peak jerk (rad/s³)",
        "jump of the jerk at a corner (rad/s³)",
    ];
    let note = format!(
        "{} scenes, median [quartiles] of what was found; clearance from the spheres' surfaces, at most 1 m; 0.1 m is asked \
         for. Between control points both strokes follow the same straight joint lines: their paths differ by what was \
         optimised only.",
        all.len()
    );
    let mut table = Table::new("Three planners", "", &note, &columns);
    for (tip_path, name) in WAYS.into_iter().enumerate() {
        let worths = worths(all, tip_path);
        let free = worths.iter().filter(|w| !w.cost.collision).count();
        let mut cells = vec![Cell::Share { count: free, of: all.len() }];
        let mut median = |figure: &dyn Fn(&PathCost) -> f64| {
            let values: Vec<f64> = worths.iter().map(figure).collect();
            cells.push(if values.is_empty() { Cell::None } else { Cell::Median(Summary::of(&values)) });
        };
        median(&|w| w.cost.path_length_m);
        median(&|w| w.cost.joint_travel_rad);
        median(&|w| w.clearance_m);
        for order in 0..4 {
            median(&|w| w.peaks[order]);
        }
        table.row(name, cells);
    }
    table
}

fn claims(robot: &Robot, all: &[Run]) -> Vec<Claim> {
    // Pairs: scenes in which both found something free.
    let compare = |other: usize, figure: fn(&PathCost) -> f64| -> Effect {
        let pairs = all.iter().filter_map(|run| {
            let of = |tip_path: usize| {
                run.found.get(tip_path)?.as_ref().map(|(_, w)| w).filter(|w| !w.cost.collision)
            };
            Some((figure(of(0)?), figure(of(other)?)))
        });
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs.unzip();
        Effect::ratio((WAYS[0], &ours), (WAYS[other], &theirs), (LEAST, Level::FIVE_PERCENT))
    };
    let against_both = |says: &str, what: &str, figure: fn(&PathCost) -> f64| {
        let rule = format!(
            "{what} is less than both others', in scenes where both are free: above 0 (holds), below 1 % (does not hold), or neither"
        );
        Claim::tested(says, &rule, [1, 2].map(|other| compare(other, figure)).to_vec())
    };
    vec![
        against_both("IBFOA-Tau-J* finds the shortest path of the tip", "its path", |w| w.cost.path_length_m),
        against_both(
            "IBFOA-Tau-J*'s motion is the most compliant: no jump of the jerk at control points",
            "its largest jump (our RRT is timed by Tau-J* too)",
            |w| w.peaks[3],
        ),
        against_both(
            "IBFOA-Tau-J*'s motion is the most compliant: lowest peak of the jerk",
            "its peak",
            |w| w.peaks[2],
        ),
        unbounded(robot, &worths(all, 0)),
        torque(robot, all),
    ]
}

/// Which of the three found a path that is free.
fn is_free(run: &Run) -> [bool; 3] {
    run.found.each_ref().map(|found| found.as_ref().is_some_and(|(_, worth)| !worth.cost.collision))
}

/// The scenes of the table, and further ones until one refutes the claim.
fn collisions(run_context: &RunContext, robot: &Robot, all: &[Run]) -> Result<Claim, Stop> {
    let mut free: Vec<[bool; 3]> = all.iter().map(is_free).collect();
    let most = if all.len() < RUNS { all.len() } else { COLLISION_RUNS };
    while free.len() < most && free.iter().flatten().all(|free| *free) {
        let runs = free.len() + RUNS;
        run_context.say(&format!("  a collision of one of the three, {runs} scenes .."));
        run_context.up_to(runs, &mut free, |run| Ok(is_free(&one(run_context, robot, run)?)))?;
    }
    let lost = |(way, name): (usize, &str)| {
        let lost = free.iter().filter(|free| !free[way]).count();
        let what = format!("{name} collides or finds nothing");
        Effect::never(&what, [lost, free.len()], Level::FIVE_PERCENT)
    };
    let rule = format!(
        "in every scene each finds a path, and it is free by the least distance of the links to the spheres; one of {most} scenes refutes it"
    );
    let effects = WAYS.into_iter().enumerate().map(lost).collect();
    Ok(Claim::tested("All three find collision-free trajectories", &rule, effects))
}

/// Figures 6 and 7 show torques and call them reasonable by design.
fn torque(robot: &Robot, all: &[Run]) -> Claim {
    let says = "Torques are reasonable by design: no constraints need to be evaluated";
    let Ok(dynamics) = robot.dynamics() else {
        return Claim::unchecked(says, "the arm states no masses", String::new());
    };
    let share = |run: &Run| {
        let (path, _) = run.found.first()?.as_ref()?;
        let (_, highest) = path.torques(robot, &dynamics);
        let shares = robot.joints.iter().zip(highest).filter_map(|(j, nm)| Some(nm / j.torque_nm_max?));
        shares.reduce(f64::max)
    };
    let shares: Vec<f64> = all.iter().filter_map(share).collect();
    let beyond = shares.iter().filter(|share| **share > 1.0).count();
    let [median, most] = [0.5, 1.0].map(|q| crate::figures(100.0 * quantile(&shares, q)));
    Claim::tested(
        says,
        "no motion of IBFOA-Tau-J* needs more than the UR5's joints have (150 Nm, wrists 28 Nm); one refutes it",
        vec![Effect::never("a torque is exceeded", [beyond, shares.len()], Level::FIVE_PERCENT)],
    )
    .beside(format!("the most loaded joint uses {median} % of its torque in the median scene, {most} % at most"))
}

/// Whether anything keeps the motions inside an arm's limits.
fn unbounded(robot: &Robot, worths: &[PathCost]) -> Claim {
    let limits = robot.limits();
    let exceeds = |w: &PathCost| {
        let of = |j: usize| &limits[j].motion;
        (0..robot.joints.len()).any(|j| {
            w.peaks[0] > of(j).velocity_rad_s
                || w.peaks[1] > of(j).acceleration_rad_s2
                || w.peaks[2] > of(j).jerk_rad_s3
        })
    };
    let beyond = worths.iter().filter(|w| exceeds(w)).count();
    let [v, j] = TauJStar::new(K).map_or([f64::NAN; 2], |star| {
        let (peaks, widest) = (star.peaks(), 2.0 * std::f64::consts::PI);
        [widest * peaks.c_v / SEGMENT_S, widest * peaks.c_j / SEGMENT_S.powi(3)]
    });
    Claim::tested(
        "Velocity, acceleration and jerk are reasonable by design: no constraints need to be evaluated",
        "no motion of IBFOA-Tau-J* exceeds the UR5's limits; one refutes it",
        vec![Effect::never("a limit is exceeded", [beyond, worths.len()], Level::FIVE_PERCENT)],
    )
    .beside(format!(
        "a step of 2π asks for {} rad/s and {} rad/s³ whatever the arm: it is T = 6 s that keeps them low, not the method",
        crate::figures(v),
        crate::figures(j)
    ))
}

fn torque_panel(robot: &Robot, name: &str, found: &TipPath) -> Panel {
    let mut panel = Panel::new("t (s)", &format!("{name}: torque (Nm)"));
    if let Ok(dynamics) = robot.dynamics() {
        let (over_time, _) = found.torques(robot, &dynamics);
        for joint in 0..robot.joints.len() {
            let points = over_time.iter().map(|(t_s, torques)| (*t_s, torques[joint])).collect();
            panel.line(&format!("joint {}", joint + 1), points);
        }
    }
    panel
}

fn tip_panel(robot: &Robot, name: &str, found: &TipPath) -> Panel {
    let mut panel = Panel::new("t (s)", &format!("{name}: tip (m)"));
    let curves: Vec<Vec<(f64, f64)>> = (0..robot.joints.len()).map(|joint| found.curve(joint, 0)).collect();
    let count = curves.first().map_or(0, Vec::len);
    let at = |i: usize| {
        let angle = |joint: usize| curves.get(joint).and_then(|c| c.get(i)).map_or(0.0, |p| p.1);
        let [.., tip] = robot.chain.frames(&std::array::from_fn(angle));
        (curves.first().and_then(|c| c.get(i)).map_or(0.0, |p| p.0), tip.translation.vector)
    };
    let tips: Vec<_> = (0..count).map(at).collect();
    for (axis, label) in ["x", "y", "z"].into_iter().enumerate() {
        panel.line(label, tips.iter().map(|(t_s, tip)| (*t_s, tip[axis])).collect());
    }
    panel
}

fn figures(robot: &Robot, all: &[Run]) -> Vec<Figure> {
    // A scene in which all three found something says most.
    let shown = all.iter().find(|r| r.found.iter().all(Option::is_some)).or(all.first());
    let Some(run) = shown else { return Vec::new() };
    let distances =
        WAYS.iter().zip(&run.found).filter_map(|(name, f)| f.as_ref().map(|(found, _)| (*name, found)));
    let paths: Vec<(&str, Vec<JointArray>)> =
        distances.clone().map(|(name, f)| (name, f.corners.clone())).collect();
    let scene = Figure::of(
        "000-paths.svg",
        "Paper 000: the tip's paths among the spheres",
        2,
        &views(robot, &run.case.scene, &paths),
    );
    let names = ["angle (rad)", "velocity (rad/s)", "acceleration (rad/s²)", "jerk (rad/s³)"];
    let mut panels = Vec::new();
    for (name, found) in distances.take(2) {
        for (order, quantity) in names.iter().enumerate() {
            let mut panel = Panel::new("t (s)", &format!("{name}: {quantity}"));
            for joint in 0..robot.joints.len() {
                panel.line(&format!("joint {}", joint + 1), found.curve(joint, order));
            }
            panels.push(panel);
        }
        panels.extend([torque_panel(robot, name, found), tip_panel(robot, name, found)]);
    }
    let motion = Figure::of("000-motions.svg", "Paper 000, figures 6 and 7: joints over time", 3, &panels);
    vec![scene, motion]
}
