//! The numbers of the method.
use taustream_optimizers::Refusal;

/// The numbers of the method. Lengths in joint space are metres of weighted distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    /// Bacteria a step, `N_s`: random poses a step away, the best free one of which is the next.
    pub bacteria: usize,
    /// Length of a step, R.
    pub step_m: f64,
    /// Range of the sensor, β: pairs of bodies that keep more than this beyond what they must are not felt.
    pub range_m: f64,
    /// Height `H_o` and width `W_o` (1/m²) of the cost of a pair that is felt, over what it keeps beyond what it must.
    pub obstacle: [f64; 2],
    /// Depth of the goal's cost, `H_g`. Its width `W_g` is 1/D² for a way of the length D: a narrower one would be flat at
    /// the start.
    pub goal_depth: f64,
    /// Height `H_add` and width `W_add` (1/m²) of the cost of a virtual obstacle.
    pub virtual_obstacle: [f64; 2],
    /// From here on the straight edge to the goal is tried, `d_min`.
    pub arrived_m: f64,
    /// How far the search goes back from a trap, dis.
    pub retreat_m: f64,
    /// Steps within which a search that has not got away by a step is trapped, k.
    pub observed: usize,
    /// Most virtual obstacles; a search that is trapped once more forgets them and begins again at the start.
    pub virtual_max: usize,
    /// Longest trace, in steps; a search that walks further begins again as well.
    pub trace_max: usize,
}

impl Numbers {
    /// Robust foraging. The paper prints none of these numbers for an arm; ours were chosen on other problems than
    /// those of docs/planner.md.
    pub const ROBUST: Self = Self {
        bacteria: 16,
        step_m: 0.3,
        range_m: 0.1,
        obstacle: [0.1, 400.0],
        goal_depth: 20.0,
        virtual_obstacle: [1.0, 4.0],
        arrived_m: 1.0,
        retreat_m: 0.75,
        observed: 10,
        virtual_max: 200,
        trace_max: 4_000,
    };

    /// Plain bacterial foraging: the same without virtual obstacles, from the start again when it is trapped.
    pub const PLAIN: Self = Self { virtual_max: 0, ..Self::ROBUST };

    /// Refuses numbers that make no sense.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let (within, method) = (Refusal::check_number, "foraging");
        let most = "from 1 to 100000 is possible";
        for (what, count) in [
            ("the bacteria", self.bacteria),
            ("the observed steps", self.observed),
            ("the longest trace", self.trace_max),
        ] {
            within(method, what, count as f64, [1.0, 1e5], most)?;
        }
        within(
            method,
            "the virtual obstacles",
            self.virtual_max as f64,
            [0.0, 1e5],
            "at most 100000 are possible",
        )?;
        within(method, "the step", self.step_m, [1e-3, 1e3], "from 1 mm to 1 km is possible")?;
        let [(a, b), (c, d)] = [self.obstacle, self.virtual_obstacle].map(|[height, width]| (height, width));
        let rest = [a, b, c, d, self.goal_depth, self.range_m, self.arrived_m, self.retreat_m];
        let least = rest.into_iter().fold(0.0, |least: f64, x| if x >= least { least } else { x });
        within(method, "a length, height, depth or width", least, [0.0, f64::MAX], "0 or more is possible")?;
        Refusal::check_finite(method, "a length, height, depth or width", &rest)
    }
}
