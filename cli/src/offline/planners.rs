//! `taustream bench planners`: the planners by name on the same problems.
use crate::args::PlannersArgs;
use crate::arm;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{Form, write_whole};
use serde::Serialize;
use std::fmt;
use std::fs;
use std::time::Duration;
use taustream_arm::Robot;
use taustream_claims::planners::{Contest, ProblemSet, Standings, Surroundings, compare, published};
use taustream_claims::{RunContext, Stop};

/// Problems a set and deadline of a quick run.
const QUICK: (usize, u32) = (2, 100);

/// The comparison, for people and programs.
#[derive(Serialize)]
struct Answer {
    command: String,
    robot: String,
    #[serde(flatten)]
    standings: Standings,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.standings)
    }
}

/// Compares, prints, and writes files where they are requested.
pub(super) fn run(form: Form, args: &PlannersArgs) -> Result<(), Failure> {
    interrupt::watch()?;
    let contest = contest(form, args)?;
    if let Some(directory) = &args.output {
        // Before the work, which may take hours.
        fs::create_dir_all(directory).map_err(|e| Failure::writing(directory.display().to_string(), e))?;
    }
    let say = |text: &str| form.progress(text);
    let run_context = RunContext::new(args.effort(), &say, &interrupt::has_come);
    let standings = compare(&run_context, &contest).map_err(|stop| match stop {
        Stop::Interrupted => Failure::Interrupted(format!("{stop}; nothing was written")),
        Stop::Refused(_) => Failure::Failed(stop.to_string()),
    })?;
    let answer = Answer { command: command(args), robot: args.robot.display().to_string(), standings };
    if let Some(directory) = &args.output {
        let json = serde_json::to_string_pretty(&answer)
            .map_err(|e| Failure::Failed(format!("the tables do not fit into JSON: {e}")))?;
        let text = format!("Made by `{}`.\n\n{}", answer.command, answer.standings.markdown());
        write_whole(&directory.join("planners.md"), &text)?;
        write_whole(&directory.join("planners.json"), &json)?;
    }
    form.print(&answer)
}

/// How much a plan may do, and on how many problems.
fn extent(args: &PlannersArgs) -> (usize, u32) {
    if args.quick { QUICK } else { (args.problems, args.deadline_ms) }
}

fn contest(form: Form, args: &PlannersArgs) -> Result<Contest, Failure> {
    let entrants = args.entrants().map_err(Failure::Usage)?;
    let robot = arm::modelled_robot(&args.robot)?;
    let (count, deadline_ms) = extent(args);
    let mut kinds = Vec::new();
    for path in &args.scene {
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        kinds.push((name, Surroundings::Given(Box::new(arm::scene(path)?))));
    }
    kinds.push(("clutter".to_owned(), Surroundings::Clutter));
    kinds.push(("cup".to_owned(), Surroundings::Cup));
    let mut remarks = Vec::new();
    let outside = if let Some(directory) = args.published() {
        published(&directory, count).map_err(Failure::Usage)?
    } else {
        let how = "name their directory with --published or TAUSTREAM_MBM_DIR";
        remarks.push(format!("published problems: NOT measured; {how}"));
        Vec::new()
    };
    form.progress("drawing problems ..");
    let sets = kinds
        .iter()
        .map(|(name, surroundings)| random_problems(name, &robot, surroundings, (count, args.seed)));
    let mut sets = sets.collect::<Result<Vec<_>, Failure>>()?;
    sets.extend(outside);
    Ok(Contest { sets, entrants, deadline: Duration::from_millis(deadline_ms.into()), remarks })
}

fn random_problems(
    name: &str,
    robot: &Robot,
    surroundings: &Surroundings,
    (count, seed): (usize, u64),
) -> Result<ProblemSet, Failure> {
    ProblemSet::random(name, robot, surroundings, count, seed).map_err(|shape| {
        Failure::Failed(format!("{shape}: its mesh has no usable triangles; correct the file"))
    })
}

/// The command that repeats it.
fn command(args: &PlannersArgs) -> String {
    let scenes: Vec<String> = args.scene.iter().map(|s| s.display().to_string()).collect();
    let (robot, scenes, planners) = (args.robot.display(), scenes.join(" "), args.planners.join(","));
    let (problems, deadline_ms) = extent(args);
    let quick = if args.quick { " --quick" } else { "" };
    let published = args.published().map_or("", |_| "TAUSTREAM_MBM_DIR=.. ");
    format!(
        "{published}taustream bench planners --robot {robot} --scene {scenes} --problems {problems} --planners {planners} \
         --deadline-ms {deadline_ms} --seed {}{quick}",
        args.seed
    )
}
