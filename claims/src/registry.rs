//! Which experiments there are. A new one is a function and a line here.
use crate::claim::Claim;
use crate::figure::Figure;
use crate::run_context::{RunContext, Stop};
use crate::table::Table;
use crate::{paper_000, paper_001, paper_002, paper_003, paper_004};

/// One of the five papers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paper {
    /// Its number.
    pub number: u8,
    /// Its file.
    pub file: &'static str,
    /// What it proposes.
    pub about: &'static str,
    /// Authors, title, year and DOI.
    pub source: &'static str,
    /// What it did, for a reader who has not read it.
    pub did: &'static str,
}

/// The five.
pub const PAPERS: [Paper; 5] = [
    Paper {
        number: 0,
        file: "000_518aefc8cd38e163",
        about: "IBFOA over control points, Tau-J* strokes",
        source: "Z. Wang, J. Peng, S. Ding: \"A bio-inspired trajectory planning method for robotic manipulators based on improved \
                 bacteria foraging optimization algorithm and tau theory\", Mathematical Biosciences and Engineering 19(1), 2022, \
                 doi:10.3934/mbe.2022029.",
        did: "A six-joint arm has to go from one pose to another among three spheres. Three control points in joint space are searched \
              for, and four segments of 6 s join them. The cost adds up the path of the tip, the joints' travel and a penalty for poses \
              near a sphere. An improved bacterial foraging algorithm (IBFOA), with an elite and decaying survivors and dispersal, is \
              compared with BFOA and BSO in 300 random scenes, and in 20 with a larger budget. Each segment follows Tau-J*, a profile \
              whose velocity, acceleration and jerk vanish at both ends.",
    },
    Paper {
        number: 1,
        file: "001_5e4af5ebec08e134",
        about: "ISMA, degree-7 B-splines, time and impact",
        source: "C. Li, H. Xing, P. Qin: \"Robotic arm trajectory planning based on improved slime mould algorithm\", Machines 13(2), \
                 79, 2025, doi:10.3390/machines13020079.",
        did: "An industrial arm has to pass eight given poses. Splines of degree seven join them, and the times between them are \
              searched for, to make time and impact (the jerk's mean square) small. The search is the slime mould algorithm with five \
              additions (ISMA): a chaotic first population, a feedback factor, a crossover, a search of bees and quadratic \
              interpolation. ISMA is compared with SMA and three others on six benchmark functions of 30 dimensions. A run on a real \
              arm is shown in pictures.",
    },
    Paper {
        number: 2,
        file: "002_3862cf3632de683b",
        about: "virtual obstacles against traps in the plane",
        source: "M. I. I. Abdi, M. U. Khan, A. Güneş, D. Mishra: \"Escaping local minima in path planning using a robust bacterial \
                 foraging algorithm\", Applied Sciences 10(21), 7905, 2020, doi:10.3390/app10217905.",
        did: "A robot in the plane sees obstacles within 13 cm and has to reach a goal. It tries random steps and takes the one of least \
              cost, where obstacles repel and the goal attracts (BFO). In an L or a U it is trapped; the robust version (RBF) goes back \
              along its trace and leaves a virtual obstacle that keeps it out. Single scenes show discs that stand and move, an L, a U, \
              and four robots that share their virtual obstacles. A potential field is compared with it where an obstacle stands \
              straight ahead.",
    },
    Paper {
        number: 3,
        file: "003_b15e0e655e3bf4df",
        about: "IEPSO, reward and punishment",
        source: "X. Lv, Z. Yu, M. Liu, G. Zhang, L. Zhang: \"Direct trajectory planning method based on IEPSO and fuzzy rewards and \
                 punishment theory for multi-degree-of freedom manipulators\", IEEE Access, 2019, doi:10.1109/ACCESS.2019.2898218.",
        did: "Angles of a five-joint arm are searched for that put its tip at a given point, without inverse kinematics. The cost is the \
              time of the joint that turns farthest, plus a punishment for errors above 0.005 mm or a reward below. The search is a \
              particle swarm with a third pull between best particles and a replacement of the worst (IEPSO). It is compared with PSO, a \
              standard PSO, a genetic algorithm and differential evolution, one run each. Errors and convergence are printed with and \
              without the reward.",
    },
    Paper {
        number: 4,
        file: "004_e19ad8423bd62d7d",
        about: "IWO, via points and least-energy cubics",
        source: "A. Sengupta, T. Chakraborti, A. Konar, A. Nagar: \"Energy efficient trajectory planning by a robot arm using invasive \
                 weed optimization technique\", Third World Congress on Nature and Biologically Inspired Computing (NaBIC), 2011 (our \
                 copy states no DOI).",
        did: "A two-link arm has to pass four spheres. Its via points are chosen one after another by invasive weed optimisation (IWO), \
              with a penalty where spheres on the arm touch an obstacle. Cubics join the via points; two coefficients of each are free, \
              and IWO chooses those of the least integral of kinetic plus potential energy. One run is shown, with and without the \
              penalty. Curves of both angles and of the least distance are the results.",
    },
];

/// What an experiment brought.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Outcome {
    /// Parameters that the paper does not give, and ours.
    pub ours: Vec<String>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Claims with results.
    pub claims: Vec<Claim>,
}

/// An experiment.
#[derive(Clone, Copy)]
pub struct Experiment {
    /// Number of the paper whose claims it checks.
    pub paper: u8,
    /// What it looks at.
    pub name: &'static str,
    /// Does it.
    pub run: fn(&RunContext) -> Result<Outcome, Stop>,
}

/// Every experiment, in the order of the papers.
pub const EXPERIMENTS: &[Experiment] = &[
    Experiment { paper: 0, name: "interpolators", run: paper_000::profiles::run },
    Experiment { paper: 0, name: "equations at their word", run: paper_000::errata::run },
    Experiment { paper: 0, name: "case 1", run: paper_000::cases::case_1 },
    Experiment { paper: 0, name: "case 2", run: paper_000::cases::case_2 },
    Experiment { paper: 0, name: "three planners", run: paper_000::planners::run },
    Experiment { paper: 0, name: "number of control points", run: paper_000::count::run },
    Experiment { paper: 0, name: "numbers that are not printed", run: paper_000::sweep::run },
    Experiment { paper: 1, name: "benchmark functions", run: paper_001::benchmarks::run },
    Experiment { paper: 1, name: "new starts on the diagonal", run: paper_001::diagonal::run },
    Experiment { paper: 1, name: "parts of ISMA", run: paper_001::parts::run },
    Experiment { paper: 1, name: "spline", run: paper_001::spline::run },
    Experiment { paper: 1, name: "numbers that are not printed", run: paper_001::sweep::run },
    Experiment { paper: 2, name: "scenes with and without traps", run: paper_002::journeys::run },
    Experiment { paper: 2, name: "numbers that are not printed", run: paper_002::sweep::run },
    Experiment { paper: 2, name: "four robots", run: paper_002::robots::run },
    Experiment { paper: 3, name: "the paper's own rows", run: paper_003::printed::run },
    Experiment { paper: 3, name: "methods", run: paper_003::methods::run },
    Experiment { paper: 3, name: "reward", run: paper_003::reward::run },
    Experiment { paper: 3, name: "numbers that are not printed", run: paper_003::sweep::run },
    Experiment { paper: 4, name: "via points", run: paper_004::via::run },
    Experiment { paper: 4, name: "energy", run: paper_004::energy::run },
    Experiment { paper: 4, name: "numbers that are not printed", run: paper_004::sweep::run },
];
