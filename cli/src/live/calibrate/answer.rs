//! What a calibration says.
use super::held::Held;
use serde::Serialize;
use std::fmt;
use taustream_arm::Settings;
use taustream_arm::mass_fit::{Agreement, FittedBody, MassFit, PointMass, Unknown};

/// A difference that is larger than this share of the joint's largest torque is worth a look.
const LARGE_SHARE: f64 = 0.15;

/// The fit, what it was made of, and what to do.
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    arm: String,
    robot: String,
    digest: String,
    /// "links" or "payload".
    fitted: &'static str,
    joints: Vec<Joint>,
    bodies: Vec<Body>,
    notices: Vec<String>,
    held: Vec<Held>,
    /// The masses stand in a URDF.
    #[serde(skip)]
    by_urdf: bool,
}

/// How far model and drive agree at one joint.
#[derive(Debug, Serialize)]
struct Joint {
    name: String,
    torque_nm_max: f64,
    before_rms_nm: f64,
    after_rms_nm: f64,
    /// Null with too few poses.
    unseen_rms_nm: f64,
    worst_nm: f64,
    /// Number of the pose, from 1.
    worst_pose: usize,
    /// Dry friction by the difference of two approaches: the median of all poses.
    friction_nm: f64,
}

/// One body.
#[derive(Debug, Serialize)]
struct Body {
    /// What it moves with.
    joint: String,
    /// A link that moves with it; null for the payload.
    link: Option<String>,
    before: Mass,
    after: Mass,
    mass_sigma_kg: f64,
    /// Torques at rest determine it.
    determined: bool,
}

/// A mass and its centre in the frame behind the joint.
#[derive(Debug, Serialize)]
struct Mass {
    mass_kg: f64,
    center_m: [f64; 3],
}

impl From<PointMass> for Mass {
    fn from(PointMass { mass_kg, center_m }: PointMass) -> Self {
        Self { mass_kg, center_m: center_m.into() }
    }
}

impl Answer {
    /// Puts words to a fit.
    pub(super) fn of(settings: &Settings, held: &[Held], (fit, unknown): (&MassFit, Unknown)) -> Self {
        let robot = &settings.robot;
        let joints = robot.joints.iter().zip(&fit.joints).enumerate();
        let joints: Vec<Joint> = joints
            .map(|(index, (joint, agreement))| joint_of(&joint.name, (index, agreement), held))
            .collect();
        let body = |body: &FittedBody| Body {
            joint: robot.joints.get(body.joint).map_or_else(String::new, |joint| joint.name.clone()),
            link: (unknown == Unknown::Links)
                .then(|| robot.masses.iter().find(|mass| mass.frame == body.joint + 1))
                .flatten()
                .and_then(|mass| robot.links.get(mass.link).cloned()),
            before: body.before.into(),
            after: body.after.into(),
            mass_sigma_kg: body.mass_sigma_kg,
            determined: body.is_determined,
        };
        Self {
            arm: settings.name.clone(),
            robot: robot.name.clone(),
            digest: robot.digest_hex(),
            fitted: match unknown {
                Unknown::Links => "links",
                Unknown::Payload => "payload",
            },
            notices: notices(&joints),
            joints,
            bodies: fit.bodies.iter().map(body).collect(),
            held: held.to_vec(),
            by_urdf: robot.ends.is_some(),
        }
    }
}

fn joint_of(name: &str, (index, agreement): (usize, &Agreement), held: &[Held]) -> Joint {
    let mut friction: Vec<f64> =
        held.iter().filter_map(|held| held.friction_nm.get(index).copied()).collect();
    friction.sort_unstable_by(f64::total_cmp);
    Joint {
        name: name.to_owned(),
        torque_nm_max: agreement.torque_nm_max,
        before_rms_nm: agreement.before_rms_nm,
        after_rms_nm: agreement.after_rms_nm,
        unseen_rms_nm: agreement.unseen_rms_nm,
        worst_nm: agreement.worst_nm,
        worst_pose: agreement.worst_pose + 1,
        friction_nm: friction.get(friction.len() / 2).copied().unwrap_or(f64::NAN),
    }
}

/// What deserves a look.
fn notices(joints: &[Joint]) -> Vec<String> {
    let large = |joint: &&Joint| {
        let left_nm = if joint.unseen_rms_nm.is_finite() { joint.unseen_rms_nm } else { joint.after_rms_nm };
        left_nm > LARGE_SHARE * joint.torque_nm_max + joint.friction_nm
    };
    let say = |joint: &Joint| {
        format!(
            "joint {}: the fitted masses still miss {:.2} Nm (rms) of at most {:.2} Nm; look at its torque's sign and scale, at cables \
             that pull, and at pose {}, where {:.2} Nm are missing; do not use these masses before",
            joint.name, joint.after_rms_nm, joint.torque_nm_max, joint.worst_pose, joint.worst_nm
        )
    };
    joints.iter().filter(large).map(say).collect()
}

impl fmt::Display for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unseen =
            if self.unseen_rms_nm.is_finite() { format!("{:.3}", self.unseen_rms_nm) } else { "-".into() };
        write!(
            f,
            "  {:<20} {:>9.3} {:>13.3} {:>12.3} {:>16} {:>9.3} ({:>2}) {:>13.3}",
            self.name,
            self.torque_nm_max,
            self.before_rms_nm,
            self.after_rms_nm,
            unseen,
            self.worst_nm,
            self.worst_pose,
            self.friction_nm
        )
    }
}

const HEADING: &str = "  joint, torques in Nm   largest  rms: by file  by the fit  on unseen poses     worst (pose)   dry friction";

impl Body {
    /// What it is, and what of it is known.
    fn words(&self) -> String {
        let what = self.link.as_ref().map_or_else(|| "payload".to_owned(), |link| format!("link {link}"));
        let how = if self.determined {
            ""
        } else {
            " (not determined by torques at rest; nearly as the file has it)"
        };
        let (before_kg, after_kg, sigma_kg) = (self.before.mass_kg, self.after.mass_kg, self.mass_sigma_kg);
        format!("{what}: {before_kg:.3} kg before, {after_kg:.3} kg +- {sigma_kg:.3} now{how}")
    }

    /// As the file states it.
    fn entry(&self, by_urdf: bool) -> String {
        let Mass { mass_kg, center_m: [x, y, z] } = &self.after;
        let is_payload = self.link.is_none();
        if by_urdf && !is_payload {
            return format!(
                "<inertial> <origin xyz=\"{x:.4} {y:.4} {z:.4}\"/> <mass value=\"{mass_kg:.4}\"/> .. </inertial>"
            );
        }
        let link = if is_payload { "" } else { "link_" };
        format!("{link}mass_kg = {mass_kg:.4}\n    {link}center_m = [{x:.4}, {y:.4}, {z:.4}]")
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "gravity of robot {} by {} poses; fitted: {}", self.robot, self.held.len(), self.fitted)?;
        writeln!(f, "{HEADING}")?;
        self.joints.iter().try_for_each(|joint| writeln!(f, "{joint}"))?;
        for body in &self.bodies {
            writeln!(f, "{}, in the frame behind joint {}:", body.words(), body.joint)?;
            writeln!(f, "    {}", body.entry(self.by_urdf))?;
        }
        self.notices.iter().try_for_each(|notice| writeln!(f, "NOTICE: {notice}"))?;
        let place = match (self.fitted, self.by_urdf) {
            ("payload", _) => "the table [payload] of the robot file",
            (_, true) => {
                "the links of the URDF; with links that are fixed to one, the masses are those of all of them"
            }
            (_, false) => "the joints of the robot file",
        };
        write!(
            f,
            "These go into {place}. Then start streamer and planner again: both must have the same masses. Friction, a little less than \
             measured, goes to coulomb_nm of [[feed_forward.joint]]."
        )
    }
}
