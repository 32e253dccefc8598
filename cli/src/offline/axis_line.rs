//! Axes beside the path, as `check` shows them.
use serde::Serialize;
use std::fmt;
use taustream_arm::{Axis, Settings};

/// One axis, in its own unit.
#[derive(Debug, Serialize)]
pub(crate) struct AxisLine {
    name: String,
    unit: &'static str,
    unit_per_rad: f64,
    range: [f64; 2],
    open: f64,
    closed: f64,
    velocity: f64,
    acceleration: f64,
    jerk: f64,
    tracking_error_max: f64,
    contact: Option<ContactLine>,
    on_fault: &'static str,
    /// The link whose shape covers it, open and closed; null: nothing does.
    covered_by: Option<String>,
}

/// How it notices contact.
#[derive(Debug, Serialize)]
struct ContactLine {
    lag: f64,
    force_unit: &'static str,
    force_max: Option<f64>,
    time_s: f64,
    squeeze: f64,
}

impl AxisLine {
    /// Of every axis.
    pub(crate) fn all(settings: &Settings) -> Vec<Self> {
        settings.axes.iter().map(|axis| Self::of(settings, axis)).collect()
    }

    fn of(settings: &Settings, axis: &Axis) -> Self {
        let motion = axis.output.limits.motion;
        let contact = axis.contact.map(|contact| ContactLine {
            lag: axis.in_unit(contact.lag_rad),
            force_unit: axis.unit.force_word(),
            force_max: contact.torque_nm.map(|torque_nm| axis.force_of(torque_nm)),
            time_s: contact.time_s,
            squeeze: axis.in_unit(contact.squeeze_rad),
        });
        Self {
            name: axis.name().to_owned(),
            unit: axis.unit.word(),
            unit_per_rad: axis.unit_per_rad,
            range: axis.range(),
            open: axis.in_unit(axis.open_rad),
            closed: axis.in_unit(axis.closed_rad),
            velocity: axis.in_unit(motion.velocity_rad_s),
            acceleration: axis.in_unit(motion.acceleration_rad_s2),
            jerk: axis.in_unit(motion.jerk_rad_s3),
            tracking_error_max: axis.in_unit(axis.tracking_error_rad_max),
            contact,
            on_fault: axis.on_fault.word(),
            covered_by: axis.covered_by.and_then(|link| settings.robot.links.get(link).cloned()),
        }
    }
}

impl fmt::Display for AxisLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, unit, range: [low, high], open, closed, .. } = self;
        writeln!(
            f,
            "  axis {name}: {low} to {high} {unit}, open at {open}, closed at {closed}; at most {} {unit}/s, {} {unit}/s^2, {} {unit}/s^3",
            self.velocity, self.acceleration, self.jerk
        )?;
        match &self.contact {
            None => writeln!(
                f,
                "    notices no contact: {} {unit} behind its command stop the arm",
                self.tracking_error_max
            )?,
            Some(contact) => {
                let force = contact
                    .force_max
                    .map_or(String::new(), |force| format!(", or {force} {}", contact.force_unit));
                writeln!(
                    f,
                    "    contact: {} {unit} behind its command{force}, for {} s; then held with at most {} {unit} of squeeze; {} {unit} stop the arm",
                    contact.lag, contact.time_s, contact.squeeze, self.tracking_error_max
                )?;
            }
        }
        let fault = if self.on_fault == "hold" { "goes on holding" } else { "presses no longer" };
        match &self.covered_by {
            Some(link) => write!(
                f,
                "    on a fault of the arm it {fault}; in collision checks the shape of link {link} stands for it, and must cover it open and closed"
            ),
            None => write!(
                f,
                "    on a fault of the arm it {fault}; NOTHING COVERS IT: motions are not proven clear of it (covered_by = \"nothing\")"
            ),
        }
    }
}
