//! Table 5 by itself: do the printed angles reach the target, and do they cost what is printed?
use crate::claim::Claim;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::table::{Cell, Table};
use taustream_optimizers::Reading;
use taustream_optimizers::papers::reach::{FiveJointArm, Reach};

/// A row of table 5: angles in radians, F, error in millimetres. IEPSO's error is printed "6.96-14".
pub(super) struct Printed {
    pub(super) name: &'static str,
    pub(super) angles_rad: [f64; 4],
    pub(super) cost: f64,
    pub(super) error_mm: f64,
}

pub(super) const TABLE_5: [Printed; 5] = [
    Printed { name: "pso", angles_rad: [-2.24, -1.31, 1.06, -1.11], cost: 8.71e4, error_mm: 10.41 },
    Printed { name: "spso", angles_rad: [0.89, 0.12, 1.47, -0.67], cost: 5.52e2, error_mm: 5.46 },
    Printed { name: "iepso", angles_rad: [0.9, 1.49, -0.23, 1.17], cost: -16.56, error_mm: 6.96e-14 },
    Printed { name: "ga", angles_rad: [0.9, 0.92, 0.84, -1.54], cost: -3.59, error_mm: 3.06e-4 },
    Printed { name: "de", angles_rad: [0.9, 0.09, 1.13, -0.09], cost: -2.57, error_mm: 0.12 },
];
/// Errors in the text of section VI, where they differ: GA, DE.
const IN_THE_TEXT_MM: [(&str, f64); 2] = [("ga", 3.59e-4), ("de", 5.47e-3)];
/// Distances from the base of the target and of the start, in table 4.
const DISTANCES_MM: [f64; 2] = [301.0, 337.0];
/// Half of the last printed digit of an angle.
const ROUNDING_RAD: f64 = 0.005;
/// What the printed cost may be off by rounding: half a digit of the farthest angle over ω, and of the cost.
const COST_ROUNDING: f64 = 0.05;

/// What forward kinematics says of angles.
struct Checked {
    miss_mm: f64,
    /// How far the tip moves at most when every angle is off by half a digit, to first order.
    rounding_mm: f64,
}

fn check(task: &Reach, angles_rad: [f64; 4]) -> Checked {
    let tip = (task.position_m)(&angles_rad);
    let moved = |j: usize| {
        let mut other = angles_rad;
        other[j] += ROUNDING_RAD;
        let squares = (task.position_m)(&other).iter().zip(tip).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        squares.sqrt()
    };
    Checked { miss_mm: 1e3 * task.error_m(&angles_rad), rounding_mm: 1e3 * (0..4).map(moved).sum::<f64>() }
}

/// The angles as Denavit and Hartenberg's variables instead of from the upright pose.
fn raw([a, b, c, d]: [f64; 4]) -> [f64; 4] {
    let quarter = std::f64::consts::FRAC_PI_2;
    [a, b + quarter, c, d - quarter]
}

/// Checks them.
pub(crate) fn run(_run_context: &RunContext) -> Result<Outcome, Stop> {
    let task = FiveJointArm::task(Reading::Corrected);
    let mut outcome = Outcome::default();
    outcome.ours.push(format!(
        "largest error e_max {} mm (twice the arm's reach)",
        figures(1e3 * task.reward.error_max_m)
    ));
    let columns = [
        "",
        "paper, F",
        "F of its angles and error",
        "paper, error (mm)",
        "tip misses by (mm)",
        "of which rounding explains (mm)",
        "misses by with raw DH angles (mm)",
    ];
    let note = "the printed joint angles through forward kinematics; rounding: every angle off by 0.005 rad";
    let mut table = Table::new("Table 5, its own rows", "", note, &columns);
    let (mut missing, mut impossible) = (Vec::new(), Vec::new());
    for row in &TABLE_5 {
        let checked = check(&task, row.angles_rad);
        if checked.miss_mm > row.error_mm + checked.rounding_mm {
            missing.push(format!("{} by {} mm", row.name, figures(checked.miss_mm)));
        }
        let cost = task.time_s(&row.angles_rad) + task.reward.of(1e-3 * row.error_mm);
        if !is_possible(&task, row, cost) {
            impossible.push(format!("{} {} (would be {})", row.name, figures(row.cost), figures(cost)));
        }
        table.row(row.name, cells(&task, row, &checked, cost));
        if row.name == "iepso" {
            let [a, b, c, d] = row.angles_rad;
            let corrected = Printed { angles_rad: [a, b, c, -d], ..*row };
            table.row(
                "iepso, sign of joint 4 turned",
                cells(&task, &corrected, &check(&task, corrected.angles_rad), cost),
            );
        }
    }
    outcome.claims.push(Claim::exact(
        "Table 5's angles bring the tip to the target, within the printed errors",
        "forward kinematics: no row misses by more than its printed error and the rounding of its angles",
        missing.is_empty(),
        format!("missing: {}", missing.join(", ")),
    ));
    outcome.claims.push(Claim::exact(
        "Table 5's costs F belong to its angles and errors",
        "within the threshold F is R + S to 0.05; beyond it F lies between R + K/e^5 and R + K, whatever e_max is",
        impossible.is_empty(),
        format!("impossible: {}", impossible.join(", ")),
    ));
    outcome.claims.push(errors_in_the_text());
    outcome.claims.push(distances(&task));
    outcome.claims.extend([swept(&task), linear()]);
    outcome.tables.push(table);
    Ok(outcome)
}

fn cells(task: &Reach, row: &Printed, checked: &Checked, cost: f64) -> Vec<Cell> {
    vec![
        Cell::Paper(row.cost),
        Cell::number(cost),
        Cell::Paper(row.error_mm),
        Cell::number(checked.miss_mm),
        Cell::number(checked.rounding_mm),
        Cell::number(1e3 * task.error_m(&raw(row.angles_rad))),
    ]
}

fn is_possible(task: &Reach, row: &Printed, cost: f64) -> bool {
    let time_s = task.time_s(&row.angles_rad);
    let highest = task.reward.punishment;
    if 1e-3 * row.error_mm <= task.reward.threshold_m {
        return (row.cost - cost).abs() <= COST_ROUNDING;
    }
    row.cost >= time_s + highest * (-5.0_f64).exp() - COST_ROUNDING
        && row.cost <= time_s + highest + COST_ROUNDING
}

fn errors_in_the_text() -> Claim {
    let differs = |(name, text): &(&str, f64)| {
        let row = TABLE_5.iter().find(|row| row.name == *name)?;
        let away = (row.error_mm - text).abs() > 1e-9 * text;
        away.then(|| format!("{name}: {} in table 5, {} in the text", figures(row.error_mm), figures(*text)))
    };
    let differing: Vec<String> = IN_THE_TEXT_MM.iter().filter_map(differs).collect();
    Claim::exact(
        "The errors of GA and DE are those of table 5",
        "table and text print the same numbers",
        differing.is_empty(),
        differing.join("; "),
    )
}

/// Eq. 12 and 13: the angles of joints 2 to 4 add up to the angle between the upright axis and the target's direction.
fn swept(task: &Reach) -> Claim {
    let [x, y, z] = task.target_m;
    let wanted = (z / (x * x + y * y + z * z).sqrt()).acos().to_degrees();
    let sums = TABLE_5.iter().map(|row| (row.name, row.angles_rad[1..].iter().sum::<f64>().to_degrees()));
    let sums: Vec<(&str, f64)> = sums.collect();
    // Three angles, each off by half a digit.
    let rounding = (3.0 * ROUNDING_RAD).to_degrees();
    let text: Vec<String> = sums.iter().map(|(name, sum)| format!("{name} {}", figures(*sum))).collect();
    Claim::exact(
        "The angles of table 5 keep the constraint of eq. 12 and 13",
        "θ2 + θ3 + θ4 is the angle between the upright axis and the target, but for rounding, in every row",
        sums.iter().all(|(_, sum)| (sum - wanted).abs() <= rounding),
        format!(
            "{} degrees asked for; {}; for this arm eq. 12 alone is the definition of the tool's angle, and keeps nothing",
            figures(wanted),
            text.join(", ")
        ),
    )
}

/// Table 2's linear function is printed without brackets.
fn linear() -> Claim {
    let (a, b) = (0.2, 1.0);
    let printed = |x: f64| x - a / b - a;
    let meant = |x: f64| (x - a) / (b - a);
    Claim::exact(
        "Table 2's linear function rises from 0 at a to 1 at b",
        "as printed, x - a/b - a, for a = 0.2 and b = 1",
        printed(a).abs() < 1e-12 && (printed(b) - 1.0).abs() < 1e-12,
        format!(
            "from {} to {}; with brackets from {} to {}; neither table 2 nor the 24 rules of table 1 stand in eq. 15 to 17",
            figures(printed(a)),
            figures(printed(b)),
            figures(meant(a)),
            figures(meant(b))
        ),
    )
}

fn distances(task: &Reach) -> Claim {
    let from_base = |p: [f64; 3]| 1e3 * p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let ours = [from_base(task.target_m), from_base((task.position_m)(&[0.0; 4]))];
    let is_same = ours.iter().zip(DISTANCES_MM).all(|(a, b)| (a - b).abs() <= 0.5);
    Claim::exact(
        "Target and start are 301 and 337 mm from the base (table 4, for the constraint of eq. 14)",
        "the distances of the printed coordinates and of the upright pose agree to half a millimetre",
        is_same,
        format!("{} and {} mm", figures(ours[0]), figures(ours[1])),
    )
}
