//! A robot as `taustream check` shows it: joints, solid links, and everything that is let through.
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use taustream_arm::text::counted;
use taustream_arm::{Group, Robot, RobotJoint, Shape};
use taustream_motion::JointKind;
use taustream_motion::stopping::StopRules;
use taustream_planner::torque::TorqueLimits;

/// One joint's limits.
#[derive(Debug, Serialize)]
struct JointLine {
    name: String,
    /// "revolute" or "prismatic".
    kind: &'static str,
    #[serde(flatten)]
    limits: LimitsLine,
}

/// Limits in the unit of the joint. Torque or force: of the file, or the effort of the URDF; null when neither states one.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum LimitsLine {
    Revolute {
        position_rad: [f64; 2],
        velocity_rad_s: f64,
        acceleration_rad_s2: f64,
        jerk_rad_s3: f64,
        stop_acceleration_rad_s2: f64,
        stop_jerk_rad_s3: f64,
        torque_nm_max: Option<f64>,
    },
    Prismatic {
        position_m: [f64; 2],
        velocity_m_s: f64,
        acceleration_m_s2: f64,
        jerk_m_s3: f64,
        stop_acceleration_m_s2: f64,
        stop_jerk_m_s3: f64,
        force_n_max: Option<f64>,
    },
}

impl JointLine {
    fn of(joint: &RobotJoint) -> Self {
        let (position, motion, stop) = (joint.limits.position_rad, joint.limits.motion, joint.limits.stop);
        let limits = match joint.kind {
            JointKind::Revolute => LimitsLine::Revolute {
                position_rad: position,
                velocity_rad_s: motion.velocity_rad_s,
                acceleration_rad_s2: motion.acceleration_rad_s2,
                jerk_rad_s3: motion.jerk_rad_s3,
                stop_acceleration_rad_s2: stop.acceleration_rad_s2,
                stop_jerk_rad_s3: stop.jerk_rad_s3,
                torque_nm_max: joint.torque_nm_max,
            },
            JointKind::Prismatic => LimitsLine::Prismatic {
                position_m: position,
                velocity_m_s: motion.velocity_rad_s,
                acceleration_m_s2: motion.acceleration_rad_s2,
                jerk_m_s3: motion.jerk_rad_s3,
                stop_acceleration_m_s2: stop.acceleration_rad_s2,
                stop_jerk_m_s3: stop.jerk_rad_s3,
                force_n_max: joint.torque_nm_max,
            },
        };
        Self { name: joint.name.clone(), kind: joint.kind.word(), limits }
    }
    /// The greatest torque or force with its unit.
    fn force(&self) -> Option<String> {
        match self.limits {
            LimitsLine::Revolute { torque_nm_max, .. } => torque_nm_max.map(|nm| format!("{nm} Nm")),
            LimitsLine::Prismatic { force_n_max, .. } => force_n_max.map(|n| format!("{n} N")),
        }
    }
}

impl fmt::Display for JointLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &self.name;
        match self.limits {
            LimitsLine::Revolute {
                position_rad: [low, high],
                velocity_rad_s: v,
                acceleration_rad_s2: a,
                jerk_rad_s3: j,
                stop_acceleration_rad_s2,
                stop_jerk_rad_s3,
                torque_nm_max: _,
            } => write!(
                f,
                "  {name:<18} {low:>8.4} .. {high:>8.4} {v:>8} rad/s {a:>8} rad/s2 {j:>8} rad/s3; {stop_acceleration_rad_s2}, {stop_jerk_rad_s3}"
            ),
            LimitsLine::Prismatic {
                position_m: [low, high],
                velocity_m_s: v,
                acceleration_m_s2: a,
                jerk_m_s3: j,
                stop_acceleration_m_s2,
                stop_jerk_m_s3,
                force_n_max: _,
            } => write!(
                f,
                "  {name:<18} {low:>8.4} .. {high:>8.4} {v:>8} m/s   {a:>8} m/s2   {j:>8} m/s3;   {stop_acceleration_m_s2}, {stop_jerk_m_s3} (prismatic: all in m)"
            ),
        }
    }
}

/// A pair of links with a margin of its own.
#[derive(Debug, Serialize)]
struct MarginLine {
    links: [String; 2],
    margin_m: f64,
}

/// One link that has shapes.
#[derive(Debug, Serialize)]
struct LinkLine {
    name: String,
    /// The joint that moves it; null for a fixed part.
    moved_by: Option<String>,
    /// How many of each kind: "2 spheres, 1 hull".
    shapes: String,
}

impl LinkLine {
    fn all(robot: &Robot) -> Vec<Self> {
        let mut lines = Vec::new();
        for (link, name) in robot.links.iter().enumerate() {
            let shapes = || robot.shapes.iter().filter(|shape| shape.link == link);
            let Some(first) = shapes().next() else { continue };
            let before = first.frame.checked_sub(1).and_then(|joint| robot.joints.get(joint));
            let shapes = KINDS.iter().filter_map(|kind| {
                let count = shapes().filter(|shape| kind_of(&shape.shape) == *kind).count();
                (count > 0).then(|| counted(count, kind))
            });
            lines.push(Self {
                name: name.clone(),
                moved_by: before.map(|joint| joint.name.clone()),
                shapes: shapes.collect::<Vec<_>>().join(", "),
            });
        }
        lines
    }
}

const KINDS: [&str; 7] = ["sphere", "box", "cylinder", "capsule", "mesh", "hull", "cloud"];

fn kind_of(shape: &Shape) -> &'static str {
    match shape {
        Shape::Sphere { .. } => "sphere",
        Shape::Box { .. } => "box",
        Shape::Cylinder { .. } => "cylinder",
        Shape::Capsule { .. } => "capsule",
        Shape::Mesh { .. } => "mesh",
        Shape::Hull { .. } => "hull",
        Shape::Cloud(_) => "cloud",
    }
}

/// Joints that belong together.
#[derive(Debug, Serialize)]
struct GroupLine {
    name: String,
    /// Null where the group leads no tip of its own.
    tip: Option<String>,
    joints: Vec<String>,
}

impl GroupLine {
    fn of(robot: &Robot, group: &Group) -> Self {
        let name = |joint: &usize| robot.joints.get(*joint).map(|joint| joint.name.clone());
        Self {
            name: group.name.clone(),
            tip: group.tip.and_then(|tip| robot.tips.get(tip)).map(|tip| tip.name.clone()),
            joints: group.joints.iter().filter_map(name).collect(),
        }
    }
}

/// Links of two groups against each other.
#[derive(Debug, Serialize)]
struct AcrossLine {
    groups: [String; 2],
    /// Pairs of links that are kept apart.
    pairs: usize,
    may_touch: usize,
}

impl AcrossLine {
    fn all(robot: &Robot) -> Vec<Self> {
        // Links with shapes that some joint of a group moves.
        let links = |group: &Group| -> BTreeSet<usize> {
            let moves = |frame: usize| group.joints.iter().any(|joint| robot.chain.moves(*joint, frame));
            robot.shapes.iter().filter(|shape| moves(shape.frame)).map(|shape| shape.link).collect()
        };
        let mut lines = Vec::new();
        for (i, a) in robot.groups.iter().enumerate() {
            for b in robot.groups.iter().skip(i + 1) {
                let (of_a, of_b) = (links(a), links(b));
                let pairs = || of_a.iter().flat_map(|a| of_b.iter().map(move |b| (*a, *b)));
                let may_touch = pairs().filter(|(a, b)| robot.may_touch(*a, *b)).count();
                let groups = [a.name.clone(), b.name.clone()];
                lines.push(Self { groups, pairs: pairs().count() - may_touch, may_touch });
            }
        }
        lines
    }
}

/// A pair of links that touches in most random poses, and their share.
#[derive(Debug, Serialize)]
struct OftenTouching {
    links: [String; 2],
    share: f64,
}

fn often_touching(robot: &Robot) -> Vec<OftenTouching> {
    let name = |link: usize| robot.links.get(link).cloned().unwrap_or_default();
    let pairs = robot.often_touching().into_iter();
    pairs.map(|((a, b), share)| OftenTouching { links: [name(a), name(b)], share }).collect()
}

/// A robot that is sound.
#[derive(Debug, Serialize)]
pub(super) struct CheckedRobot {
    kind: &'static str,
    name: String,
    file: String,
    digest: String,
    joints: Vec<JointLine>,
    /// Links whose frames are base and tip; null for Denavit-Hartenberg rows.
    base_and_tip: Option<[String; 2]>,
    /// What is led somewhere: one link in a serial arm.
    tips: Vec<String>,
    groups: Vec<GroupLine>,
    /// Each two groups.
    across_groups: Vec<AcrossLine>,
    shapes: usize,
    links: Vec<LinkLine>,
    /// Nothing keeps these from being hit.
    links_without_shape: Vec<String>,
    /// Those of them that the robot file acknowledges; summaries of plans and proofs name them.
    unmodelled_links: Vec<String>,
    /// Those that move and are not acknowledged: nothing is planned or run for this robot.
    refused_links: Vec<String>,
    /// What was left out of a URDF, or deserves a look.
    notices: Vec<String>,
    /// Of the links that state a mass, and of the payload; null when none does.
    mass_kg: Option<f64>,
    /// Why energies and torques by these masses are too low; null where they may be right.
    mass_doubt: Option<String>,
    /// Why the torques of motions are not checked; null where they are.
    torque_unchecked: Option<String>,
    may_touch_by_rule: Vec<[String; 2]>,
    may_touch_by_file: Vec<[String; 2]>,
    may_touch_by_srdf: Vec<[String; 2]>,
    /// Pairs that may not touch and do so in most random poses.
    often_touching: Vec<OftenTouching>,
    /// What links that may not touch keep from each other.
    link_margin_m: f64,
    /// Pairs that keep another distance.
    link_margins: Vec<MarginLine>,
    /// Pairs that are never further apart than their margin; they keep more than 0 m.
    always_close: Vec<[String; 2]>,
    /// No pause or stop from a constant speed takes longer.
    pause_s: f64,
    /// No stop takes longer, even on top of a change of speed.
    longest_stop_s: f64,
}

impl CheckedRobot {
    pub(super) fn of(robot: &Robot) -> Self {
        let link = |i: usize| robot.links.get(i).cloned().unwrap_or_else(|| format!("link{i}"));
        let names = |pairs: &[(usize, usize)]| pairs.iter().map(|(a, b)| [link(*a), link(*b)]).collect();
        let joints = robot.joints.iter().map(JointLine::of);
        Self {
            kind: "robot",
            name: robot.name.clone(),
            file: robot.file.display().to_string(),
            digest: robot.digest_hex(),
            joints: joints.collect(),
            base_and_tip: robot.ends.clone(),
            tips: robot.tips.iter().map(|tip| tip.name.clone()).collect(),
            groups: robot.groups.iter().map(|group| GroupLine::of(robot, group)).collect(),
            across_groups: AcrossLine::all(robot),
            shapes: robot.shapes.len(),
            links: LinkLine::all(robot),
            links_without_shape: robot.bare_links.clone(),
            unmodelled_links: robot.unmodelled_links.clone(),
            refused_links: robot.unlisted_links.clone(),
            notices: robot.notices.clone(),
            mass_kg: (!robot.masses.is_empty()).then(|| robot.masses.iter().map(|mass| mass.mass_kg).sum()),
            mass_doubt: robot.mass_doubt(),
            torque_unchecked: TorqueLimits::of(robot).err().map(|why| why.to_string()),
            may_touch_by_rule: names(&robot.allowed_by_rule),
            may_touch_by_file: names(&robot.allowed_by_file),
            may_touch_by_srdf: names(&robot.allowed_by_srdf),
            often_touching: often_touching(robot),
            link_margin_m: robot.margins.all_m,
            link_margins: robot
                .margins
                .pairs
                .iter()
                .map(|((a, b), margin_m)| MarginLine { links: [link(*a), link(*b)], margin_m: *margin_m })
                .collect(),
            always_close: names(&robot.close_by_rule),
            pause_s: robot.stop_s(),
            // Of an arm that is refused, the longest ramp that a time scale takes says nothing.
            longest_stop_s: StopRules::new(&robot.limits(), robot.joints.len())
                .longest_stop_s()
                .max(robot.stop_s()),
        }
    }
}

impl fmt::Display for CheckedRobot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "robot {} ({}): {}, {}",
            self.name,
            self.file,
            counted(self.joints.len(), "joint"),
            counted(self.shapes, "collision shape")
        )?;
        writeln!(f, "  digest {}", self.digest)?;
        writeln!(
            f,
            "  joint               position (rad)         velocity   acceleration  jerk; stop: acceleration, jerk"
        )?;
        for j in &self.joints {
            writeln!(f, "{j}")?;
        }
        self.geometry(f)?;
        contacts(
            f,
            "links that MAY TOUCH by the contact rule (neighbours, and pairs that touch in every pose)",
            &self.may_touch_by_rule,
        )?;
        contacts(f, "links that MAY TOUCH by the robot file", &self.may_touch_by_file)?;
        contacts(f, "links that MAY TOUCH by the SRDF", &self.may_touch_by_srdf)?;
        for OftenTouching { links: [a, b], share } in &self.often_touching {
            writeln!(
                f,
                "  {a} and {b} touch in {:.0} % of random poses, so that few plans will succeed. Tighten their shapes, or, if the real ones \
                 cannot meet: allowed_contacts = [[{a:?}, {b:?}]]",
                100.0 * share
            )?;
        }
        self.margins(f)?;
        write!(
            f,
            "  a pause or stop from full speed takes at most {:.3} s, on the path, inside the stop limits; on top of a change of speed at \
             most {:.3} s. What runs decides how much less: a fast stop uses all of the stop limits, a pause or stop half of what they \
             leave above the motion limits",
            self.pause_s, self.longest_stop_s
        )
    }
}

impl CheckedRobot {
    /// Tips, groups, and what is kept apart between them.
    fn tree(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [_, _, ..] = self.tips.as_slice() {
            writeln!(f, "  {} tips: {}", self.tips.len(), self.tips.join(", "))?;
        }
        for GroupLine { name, tip, joints } in &self.groups {
            let tip = tip.as_ref().map_or(String::new(), |tip| format!(", leads {tip}"));
            writeln!(f, "  group {name}{tip}: {}", joints.join(", "))?;
        }
        for AcrossLine { groups: [a, b], pairs, may_touch } in &self.across_groups {
            let kept = counted(*pairs, "pair");
            writeln!(f, "  groups {a} and {b}: {kept} of links are kept apart, {may_touch} may touch")?;
        }
        Ok(())
    }

    /// What the drives can bear, and whether motions are held to it.
    fn torques(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stated = self.joints.iter().filter_map(|j| Some(format!("{} {}", j.name, j.force()?)));
        let stated: Vec<String> = stated.collect();
        if !stated.is_empty() {
            writeln!(f, "  torques of the drives at most {}", stated.join(", "))?;
        }
        match &self.torque_unchecked {
            Some(_) if stated.is_empty() => Ok(()),
            Some(_) if self.mass_doubt.is_some() => writeln!(f, "  torques are not checked with such masses"),
            Some(why) => writeln!(f, "  {why}"),
            None => {
                writeln!(f, "  motions beyond them are refused by verify and run, and timed slower by plan")
            }
        }
    }

    /// What links keep from each other.
    fn margins(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "  other links keep more than {} m from each other (link_margin_m)", self.link_margin_m)?;
        for MarginLine { links: [a, b], margin_m } in &self.link_margins {
            let zero = if *margin_m > 0.0 { "" } else { ": they may come as near as touching" };
            writeln!(f, "  {a}-{b} keep more than {margin_m} m{zero}")?;
        }
        contacts(
            f,
            "of these, links that are NEVER further apart than their margin (a [[link_margin]] of their own would say so)",
            &self.always_close,
        )
    }

    /// What is solid, and what is not.
    fn geometry(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some([base, tip]) = &self.base_and_tip {
            writeln!(f, "  base link {base}, tip link {tip}")?;
        }
        self.tree(f)?;
        if let Some(mass_kg) = self.mass_kg {
            writeln!(
                f,
                "  {mass_kg:.3} kg by the links that state a mass (for torques and energies of motions)"
            )?;
        }
        if let Some(doubt) = &self.mass_doubt {
            writeln!(f, "  WARNING: {doubt}")?;
        }
        self.torques(f)?;
        for link in &self.links {
            match &link.moved_by {
                Some(joint) => writeln!(f, "  {:<26} moves with {joint}: {}", link.name, link.shapes)?,
                // Planning could not change whether it meets an obstacle, so it is not compared with any.
                None => writeln!(
                    f,
                    "  {:<26} is fixed: {} (checked against the arm, not against obstacles)",
                    link.name, link.shapes
                )?,
            }
        }
        if !self.links_without_shape.is_empty() {
            writeln!(f, "  links WITHOUT collision geometry: {}", self.links_without_shape.join(", "))?;
        }
        if !self.unmodelled_links.is_empty() {
            writeln!(
                f,
                "  links that the file lists in unmodelled_links: {}",
                self.unmodelled_links.join(", ")
            )?;
        }
        if !self.refused_links.is_empty() {
            let names: Vec<String> = self.refused_links.iter().map(|name| format!("{name:?}")).collect();
            let names = names.join(", ");
            writeln!(
                f,
                "  REFUSED by plan, verify, run and the services: these links move and have no shape: {names}. Give them shapes, or \
                 acknowledge it: unmodelled_links = [{names}]"
            )?;
        }
        for notice in &self.notices {
            writeln!(f, "  note: {notice}")?;
        }
        Ok(())
    }
}

/// Contacts that nothing will warn about: printed.
fn contacts(f: &mut fmt::Formatter<'_>, title: &str, pairs: &[[String; 2]]) -> fmt::Result {
    if pairs.is_empty() {
        return Ok(());
    }
    let list: Vec<String> = pairs.iter().map(|[a, b]| format!("{a}-{b}")).collect();
    writeln!(f, "  {title}: {}", list.join(", "))
}
