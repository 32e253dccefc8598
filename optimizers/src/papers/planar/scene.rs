//! Obstacles, starts and goals.
use super::{Place, distance_cm};

/// The outline of an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanarShape {
    /// A disc.
    Disc {
        /// Its centre.
        centre_cm: Place,
        /// Its radius.
        radius_cm: f64,
    },
    /// Walls without thickness from corner to corner: an L has three, a U four.
    Walls {
        /// The corners in order.
        corners_cm: Vec<Place>,
    },
}

/// An obstacle, which may move evenly.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Its outline at the start.
    pub shape: PlanarShape,
    /// Its speed.
    pub velocity_cm_s: Place,
}

impl Obstacle {
    /// A disc that stands still.
    #[must_use]
    pub fn disc(centre_cm: Place, radius_cm: f64) -> Self {
        Self { shape: PlanarShape::Disc { centre_cm, radius_cm }, velocity_cm_s: [0.0; 2] }
    }

    /// Walls that stand still.
    #[must_use]
    pub fn walls(corners_cm: &[Place]) -> Self {
        Self { shape: PlanarShape::Walls { corners_cm: corners_cm.to_vec() }, velocity_cm_s: [0.0; 2] }
    }

    /// The nearest point of the obstacle and how far it is; inside a disc, the place itself at a distance of nothing.
    #[must_use]
    pub fn nearest(&self, place_cm: Place, time_s: f64) -> (Place, f64) {
        let [dx, dy] = self.velocity_cm_s.map(|v| v * time_s);
        // The obstacle's movement is the robot's the other way.
        let seen = [place_cm[0] - dx, place_cm[1] - dy];
        let point = match &self.shape {
            PlanarShape::Disc { centre_cm, radius_cm } => {
                let away = distance_cm(seen, *centre_cm);
                let share = if away > *radius_cm { radius_cm / away } else { 1.0 };
                std::array::from_fn(|i| centre_cm[i] + share * (seen[i] - centre_cm[i]))
            }
            PlanarShape::Walls { corners_cm } => nearest_of_walls(corners_cm, seen),
        };
        ([point[0] + dx, point[1] + dy], distance_cm(seen, point))
    }
}

fn nearest_of_walls(corners_cm: &[Place], place: Place) -> Place {
    let on_wall = |pair: &[Place]| {
        let [a, b] = pair else { return place };
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [place[0] - a[0], place[1] - a[1]]);
        let length2 = along[0] * along[0] + along[1] * along[1];
        let dot = along[0] * to[0] + along[1] * to[1];
        let share = if length2 > 0.0 { (dot / length2).clamp(0.0, 1.0) } else { 0.0 };
        [a[0] + share * along[0], a[1] + share * along[1]]
    };
    let nearer = |p: &Place, q: &Place| distance_cm(*p, place).total_cmp(&distance_cm(*q, place));
    // A single corner is a post; no corner is nowhere.
    let post = corners_cm.first().copied().unwrap_or([f64::INFINITY; 2]);
    corners_cm.windows(2).map(on_wall).min_by(nearer).unwrap_or(post)
}

/// Where robots start and have to go, and what is in their way.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarScene {
    /// Its name.
    pub name: &'static str,
    /// Start and goal of every robot.
    pub robots: Vec<[Place; 2]>,
    /// The obstacles.
    pub obstacles: Vec<Obstacle>,
}

/// The paper's start and goal.
const DISTANCE: [Place; 2] = [[50.0, -90.0], [-20.0, 90.0]];
/// Where the straight way between them is half done.
const MIDDLE: Place = [15.0, 0.0];

impl PlanarScene {
    /// The paper's kinds of scene. Start, goal and the two discs' centres are printed; every size is ours.
    #[must_use]
    pub fn paper_002() -> Vec<Self> {
        let one = |name, obstacles| Self { name, robots: vec![DISTANCE], obstacles };
        let crossing = Obstacle { velocity_cm_s: [5.217, 0.0], ..Obstacle::disc([-35.0, 0.0], 9.5) };
        let three = [[-1.0, -4.0], [15.0, 2.0], [31.0, 8.0]].map(|c| Obstacle::disc(c, 7.0));
        vec![
            one("static", vec![Obstacle::disc(MIDDLE, 9.5)]),
            one("moving", vec![crossing]),
            one("three", three.to_vec()),
            one("two-discs", vec![Obstacle::disc([10.0, 50.0], 9.5), Obstacle::disc([-10.0, 50.0], 9.5)]),
            one("l", vec![trap(&[[12.0, -30.0], [12.0, 0.0], [-33.0, 0.0]], MIDDLE)]),
            one("u", vec![trap(&[[-15.0, -20.0], [-15.0, 0.0], [15.0, 0.0], [15.0, -20.0]], MIDDLE)]),
            one("wide-u", vec![trap(&[[-25.0, -40.0], [-25.0, 0.0], [25.0, 0.0], [25.0, -40.0]], MIDDLE)]),
            four_robots(),
        ]
    }

    /// The scene of a name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::paper_002().into_iter().find(|scene| scene.name == name)
    }
}

/// Corners given with the way ahead as y, turned so that the paper's way runs into them, and put at a place.
fn trap(corners: &[Place], at: Place) -> Obstacle {
    let [start, goal] = DISTANCE;
    let length = distance_cm(start, goal);
    let ahead = [(goal[0] - start[0]) / length, (goal[1] - start[1]) / length];
    let turned: Vec<Place> = corners
        .iter()
        .map(|[x, y]| [at[0] + x * ahead[1] + y * ahead[0], at[1] - x * ahead[0] + y * ahead[1]])
        .collect();
    Obstacle::walls(&turned)
}

/// Four robots whose ways cross, three of them through traps.
fn four_robots() -> PlanarScene {
    let robots = vec![
        [[-80.0, -90.0], [-80.0, 90.0]],
        [[-20.0, -90.0], [-20.0, 90.0]],
        [[40.0, -90.0], [20.0, 90.0]],
        [[90.0, -90.0], [60.0, 90.0]],
    ];
    let cup = |x: f64, y: f64| {
        Obstacle::walls(&[[x - 14.0, y - 16.0], [x - 14.0, y], [x + 14.0, y], [x + 14.0, y - 16.0]])
    };
    let obstacles =
        vec![cup(-80.0, 0.0), Obstacle::disc([-20.0, 10.0], 9.5), cup(31.0, -10.0), cup(75.0, 10.0)];
    PlanarScene { name: "four-robots", robots, obstacles }
}
