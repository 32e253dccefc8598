//! The contest of the planners: fair problems, the same answer anywhere, and files from outside that are not trusted.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_claims::planners::{Contest, Entrant, ProblemSet, Standings, Surroundings, compare, published};
use taustream_claims::{Cell, Effort, RunContext, Stop};
use taustream_planner::budget::Budget;
use taustream_planner::tree::Space;
use taustream_planner::world::World;

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").join(name)
}

fn robot(name: &str) -> Robot {
    Robot::load(&config(&format!("robots/{name}.toml"))).expect("shipped")
}

fn every_kind() -> [(&'static str, Surroundings); 3] {
    let shelf = Scene::load(&config("scenes/shelf.toml")).expect("shipped");
    let given = Surroundings::Given(Box::new(shelf));
    [("shelf", given), ("clutter", Surroundings::Clutter), ("cup", Surroundings::Cup)]
}

fn contest(names: &[&str], count: usize) -> Contest {
    let robot = robot("ur5");
    let random_problems = |(name, kind): &(&str, Surroundings)| {
        ProblemSet::random(name, &robot, kind, count, 3).expect("shapes that can be built")
    };
    let entrants = names.iter().map(|n| Entrant::from_name(n).expect("known")).collect();
    let sets = every_kind().iter().map(random_problems).collect();
    Contest { sets, entrants, deadline: Duration::from_millis(60), remarks: vec!["a remark".to_owned()] }
}

fn standings(contest: &Contest, jobs: usize) -> Result<Standings, Stop> {
    let effort = Effort { runs: None, quick: true, seed: 1, jobs };
    compare(&RunContext::new(effort, &|_| (), &|| false), contest)
}

/// Goal: a problem asks for a way round something, from a clear pose to a clear pose, for arms of any kind; and another
/// seed asks another one.
#[test]
fn problems_are_clear_at_both_ends_and_blocked_between() {
    for name in ["ur5", "piper"] {
        let robot = robot(name);
        for (kind, surroundings) in every_kind() {
            let random_problems =
                |seed| ProblemSet::random(kind, &robot, &surroundings, 5, seed).expect("builds");
            let set = random_problems(3);
            assert_eq!(set.problems.len(), 5, "{name}, {kind}: {}", set.left_out);
            for problem in &set.problems {
                let world = World::new(&robot, &problem.scene).expect("builds");
                let budget = Budget::unbounded();
                let ends = [problem.start_rad, problem.goal_rad];
                assert!(ends.iter().all(|pose| world.contact(pose).is_none()), "{name}, {kind}");
                assert!(!Space::new(&world, &budget).is_edge_free(&ends[0], &ends[1]), "{name}, {kind}");
            }
            assert_eq!(set.problems, random_problems(3).problems, "{name}, {kind}: one seed, two problems");
            assert_ne!(set.problems, random_problems(4).problems, "{name}, {kind}: two seeds, one problem");
        }
    }
}

/// An arm that cannot be clear anywhere gets no problems, and the set says so.
#[test]
fn scene_without_room_has_no_problems_and_says_so() {
    let mut scene = Scene::load(&config("scenes/open.toml")).expect("shipped");
    scene.obstacles[0].shape = taustream_arm::Shape::Box { size_m: [4.0; 3] };
    let set = ProblemSet::random("full", &robot("ur5"), &Surroundings::Given(Box::new(scene)), 2, 1);
    let set = set.expect("builds");
    assert!(set.problems.is_empty() && set.left_out.starts_with("2 problems"), "{}", set.left_out);
    let contest = Contest { sets: vec![set], ..contest(&["auto", "rbf"], 1) };
    let standings = standings(&contest, 1).expect("nothing to do");
    assert!(finite(&standings), "an empty table has no NaN: {standings}");
}

fn finite(standings: &Standings) -> bool {
    let cells = standings.tables.iter().flat_map(|t| &t.rows).flat_map(|r| &r.cells);
    cells.into_iter().all(Cell::is_finite)
}

/// Times aside, the tables are the same on any number of threads.
#[test]
fn standings_are_finite_and_do_not_depend_on_threads() {
    const TIMES: [usize; 3] = [1, 2, 3];
    let contest = contest(&["auto+none", "straight", "rbf", "de"], 2);
    let untimed = |jobs| {
        let mut standings = standings(&contest, jobs).expect("runs");
        assert!(finite(&standings), "{standings}");
        for row in &mut standings.tables[0].rows {
            for i in TIMES {
                row.cells[i] = Cell::None;
            }
        }
        standings
    };
    let one = untimed(1);
    assert_eq!(one, untimed(3));
    let found = |row: usize| one.tables[0].rows[row].cells[0].clone();
    assert_eq!(found(1), Cell::Share { count: 0, of: 6 }, "a straight line is blocked by construction");
    let Cell::Share { count, of: 6 } = found(0) else { panic!("{:?}", found(0)) };
    assert!(count >= 5, "the default finds what has a solution: {count} of 6");
    assert!(one.markdown().contains("a remark") && one.to_string().contains("cup"));
}

#[test]
fn interrupted_contest_has_no_standings() {
    let effort = Effort { runs: None, quick: true, seed: 1, jobs: 1 };
    let run_context = RunContext::new(effort, &|_| (), &|| true);
    assert_eq!(compare(&run_context, &contest(&["auto"], 1)), Err(Stop::Interrupted));
}

const URDF: &str = r#"<robot name="two">
<link name="base"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
<link name="upper"><collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.03"/></geometry></collision></link>
<link name="fore"><collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.03"/></geometry></collision></link>
<link name="ee_link"/>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="end" type="fixed"><parent link="fore"/><child link="ee_link"/><origin xyz="0.4 0 0"/></joint>
</robot>"#;
const SRDF: &str = r#"<robot name="two"></robot>"#;
const PROBLEMS: &str = r#"{"robot": "two", "joints": ["a", "b"], "sets": {
"first": [
 {"id": 1, "start": [-1, 0], "goal": [1, 0], "obstacles":
  [{"name": "post", "type": "cylinder", "p": [0.6, 0, 0], "q": [0, 0, 0, 1], "length": 1, "radius": 0.05}]},
 {"id": 2, "start": [-1, 0], "goal": [1, 0], "obstacles": []}],
"second": [
 {"id": 7, "start": [0, 0], "goal": [1, 0], "obstacles":
  [{"name": "wall", "type": "box", "p": [0.6, 0, 0], "q": [0, 0, 0, 1], "size": [0.1, 0.1, 1]}]}]}}"#;

/// A directory with one file of problems for an arm of two joints.
fn directory(name: &str, problems: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("taustream-claims-{name}-{}", std::process::id()));
    fs::create_dir_all(&path).expect("a directory");
    for (file, text) in [("two_spherized.urdf", URDF), ("two.srdf", SRDF), ("set.json", problems)] {
        fs::write(path.join(file), text).expect("a file");
    }
    path
}

#[test]
fn published_problems_are_read_and_what_is_no_problem_is_counted() {
    let path = directory("sound", PROBLEMS);
    let sets = published(&path, 5);
    fs::remove_dir_all(&path).expect("was made");
    let set = &sets.expect("sound")[0];
    assert_eq!((set.name.as_str(), set.problems.len(), set.free_lines), ("set", 1, 1));
    assert!(set.left_out.starts_with("1 more because"), "{}", set.left_out);
    assert_eq!(set.problems[0].start_rad[..2], [-1.0, 0.0]);
}

/// Published sets have problems whose ends are out of a joint's range; they count as invalid, and the others are planned.
#[test]
fn published_problem_with_an_end_out_of_range_is_left_out() {
    let path = directory("far", &PROBLEMS.replacen("[-1, 0]", "[-4, 0]", 1));
    let sets = published(&path, 5);
    fs::remove_dir_all(&path).expect("was made");
    let set = &sets.expect("sound")[0];
    assert!(
        set.left_out.starts_with("2 more because") && set.left_out.contains("out of range"),
        "{}",
        set.left_out
    );
}

#[test]
fn published_files_that_are_at_fault_are_refused_with_the_reason() {
    for (name, from, to, why) in [
        ("text", PROBLEMS, "no JSON", "expected"),
        ("robot", r#""robot": "two""#, r#""robot": "../two""#, "no name of a robot"),
        ("joint", r#"["a", "b"]"#, r#"["a", "c\"\n]"]"#, "c"),
        ("few", "[-1, 0]", "[-1]", "1 joint values"),
        ("turn", "[0, 0, 0, 1]", "[0, 0, 0, 0]", "its pose is none"),
        ("flat", r#""length": 1"#, r#""length": 0"#, "its size is"),
        ("kind", "cylinder", "torus", "torus"),
    ] {
        let path = directory(name, &PROBLEMS.replacen(from, to, 1));
        let refused = published(&path, 5);
        fs::remove_dir_all(&path).expect("was made");
        let words = refused.expect_err(name);
        assert!(words.contains("set.json") && words.contains(why), "{name}: {words}");
    }
    let nowhere = published(Path::new("/nowhere/at/all"), 5).expect_err("nowhere");
    assert!(nowhere.contains("/nowhere/at/all"), "{nowhere}");
}
