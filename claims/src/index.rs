//! Every system, table and figure of each paper, with the experiment that has its row, or the reason for none.

/// What it is, and where it is checked.
type Entry = (&'static str, &'static str);

/// Pictures of an arm, a robot or a flowchart make no claim.
const PICTURE: &str = "none: a picture without numbers";

const PAPER_000: &[Entry] = &[
    ("Tau-J, Tau-J* (sections 3 and 4), figure 1", "interpolators"),
    ("cost J_c (eq. 3.6 to 3.9)", "equations at their word; case 1, as printed"),
    ("swarming (eq. 3.3)", "equations at their word"),
    ("BFOA, IBFOA, BSO; figures 2 and 3; table 2", "case 1, case 2"),
    ("table 1", "the parameters of case 1 and case 2, used as printed"),
    ("figures 4, 5 and 8", "three planners (000-paths.svg)"),
    ("figures 6 and 7", "three planners (000-motions.svg)"),
    (
        "time of a run, and its share in the cost",
        "none: they belong to a machine; `taustream bench cost` measures ratios here",
    ),
    ("section 6: number of control points", "number of control points"),
    (
        "parameters that are not printed: unit of L, arm, scenes, BSO's constants, RRT's step",
        "numbers that are not printed; the arm: none, it is no number",
    ),
];
const PAPER_001: &[Entry] = &[
    ("spline of degree seven (eq. 7 to 16)", "spline"),
    ("table 4, figure 8", "spline"),
    ("SMA, ISMA; tables 1 to 3; figures 4 to 6", "benchmark functions; new starts on the diagonal"),
    ("chaotic maps: figures 1 and 2", "parts of ISMA"),
    ("feedback factor: figure 3", "parts of ISMA"),
    ("the five additions, one by one", "parts of ISMA"),
    (
        "parameters that are not printed: P_t, μ, λ, those of BOA and SSA, the chains' start, limits",
        "numbers that are not printed; parts of ISMA; spline",
    ),
    ("figures 7 and 9", PICTURE),
];
const PAPER_002: &[Entry] = &[
    ("BFO, RBF, potential field; figures 2, 4, 6, 7 and 9", "scenes with and without traps"),
    ("figure 1", PICTURE),
    (
        "figure 3: moving obstacle",
        "numbers that are not printed; its instants: none, neither step nor speed is printed",
    ),
    ("figure 5: obstacle straight ahead", "scenes with and without traps, on the exact line and off it"),
    ("figure 8: distance over time", "scenes with and without traps (002-distance.svg)"),
    ("figures 10 and 11: four robots", "four robots"),
    ("parameters that are not printed", "numbers that are not printed"),
];
const PAPER_003: &[Entry] = &[
    ("arm: figure 1, table 3", "the paper's own rows"),
    ("IEPSO: figures 2 to 4 and 7 to 9, table 5", "methods; the paper's own rows"),
    ("figures 5 and 6: angles and reward over generations", "methods (003-angles.svg)"),
    ("rewards: eq. 15 to 17, table 4, figure 10", "reward"),
    ("constraints: eq. 12 to 14", "the paper's own rows"),
    ("tables 1 and 2: fuzzy rules and functions", "the paper's own rows"),
    (
        "parameters that are not printed: those of the other four methods, how many particles are replaced, e_max",
        "numbers that are not printed",
    ),
    ("figure 11", PICTURE),
    ("table 6", "none: our copy does not hold it; the text's numbers are in reward"),
];
const PAPER_004: &[Entry] = &[
    ("via points: eq. 1 to 3, table I, figures 4 to 6", "via points"),
    ("energy: eq. 12; cubics", "energy"),
    ("IWO: table II", "via points; energy"),
    (
        "parameters that are not printed: spheres of a link, when the goal is reached, gravity",
        "numbers that are not printed",
    ),
    ("figures 1 to 3", PICTURE),
];

/// The entries of a paper.
pub(crate) fn of(paper: u8) -> &'static [Entry] {
    let all = [PAPER_000, PAPER_001, PAPER_002, PAPER_003, PAPER_004];
    all.get(usize::from(paper)).copied().unwrap_or_default()
}
