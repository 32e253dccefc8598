//! One row a joint, in as many columns as the terminal is wide enough for.
use super::bar::{Ink, position, signed};
use super::picture::Scale;
use super::{Line, Span, Tone};
use crate::arm::ArmName;
use taustream_messages::Report;

/// A column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Name,
    Commanded,
    Measured,
    PositionBar,
    Error,
    ErrorBar,
    Velocity,
    VelocityBar,
    Drive,
}

impl Column {
    const ALL: [Self; 9] = [
        Self::Name,
        Self::Commanded,
        Self::Measured,
        Self::PositionBar,
        Self::Error,
        Self::ErrorBar,
        Self::Velocity,
        Self::VelocityBar,
        Self::Drive,
    ];
    /// In this order columns are left out where there is no room.
    const DISPENSABLE: [Self; 7] = [
        Self::ErrorBar,
        Self::VelocityBar,
        Self::PositionBar,
        Self::Drive,
        Self::Velocity,
        Self::Commanded,
        Self::Error,
    ];

    fn width(self) -> usize {
        match self {
            Self::Name | Self::PositionBar => 15,
            Self::Drive => 26,
            Self::Commanded | Self::Measured | Self::Velocity => 10,
            Self::Error => 12,
            Self::ErrorBar => 9,
            Self::VelocityBar => 13,
        }
    }

    fn heading(self) -> &'static str {
        match self {
            Self::Name => "joint",
            Self::Commanded => "command",
            Self::Measured => "measured",
            Self::PositionBar => "in its range",
            Self::Error => "error (mrad)",
            Self::ErrorBar | Self::VelocityBar => "of limit",
            Self::Velocity => "(rad/s)",
            Self::Drive => "drive",
        }
    }

    fn cell(self, row: &Row<'_>) -> Span {
        let number = |value: f64| {
            let tone = if value.is_finite() { Tone::Plain } else { Tone::Quiet };
            Span::new(format!("{value:+.4}"), tone)
        };
        let cells = self.width();
        match self {
            Self::Name => Span::plain(row.name.clone()),
            Self::Commanded => number(row.command_rad),
            Self::Measured => number(row.measured_rad),
            Self::Error => Span::plain(format!("{:+.3}", row.error_rad * 1e3)),
            Self::Velocity => Span::plain(format!("{:+.3}", row.velocity_rad_s)),
            Self::PositionBar => row.scaled(|s| position(row.measured_rad, s.position_rad, cells, row.ink)),
            Self::ErrorBar => row.scaled(|s| signed(row.error_rad, s.error_rad_max, cells, row.ink)),
            Self::VelocityBar => row.scaled(|s| signed(row.velocity_rad_s, s.velocity_rad_s, cells, row.ink)),
            // What the error is stands below the table.
            Self::Drive => {
                let tone = if row.has_error { Tone::Bad } else { Tone::Quiet };
                Span::new(row.drive_status.clone(), tone)
            }
        }
    }

    /// Numbers stand right, words and bars left.
    fn is_number(self) -> bool {
        matches!(self, Self::Commanded | Self::Measured | Self::Error | Self::Velocity)
    }

    fn fit(self, text: &str) -> String {
        let width = self.width();
        let text: String = text.chars().take(width).collect();
        if self.is_number() { format!("{text:>width$}  ") } else { format!("{text:<width$}  ") }
    }
}

/// The limits of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointScale {
    /// Lowest and highest angle.
    pub(super) position_rad: [f64; 2],
    /// Of the motion limits.
    pub(super) velocity_rad_s: f64,
    /// Tracking error that stops the arm.
    pub(super) error_rad_max: f64,
}

/// What one row shows.
struct Row<'a> {
    name: String,
    command_rad: f64,
    measured_rad: f64,
    error_rad: f64,
    velocity_rad_s: f64,
    drive_status: String,
    has_error: bool,
    scale: Option<&'a JointScale>,
    ink: Ink,
}

impl Row<'_> {
    /// A bar, where limits are known.
    fn scaled(&self, bar: impl FnOnce(&JointScale) -> Span) -> Span {
        self.scale.map_or_else(|| Span::plain(""), bar)
    }
}

/// Heading and rows.
pub(super) fn table(r: &Report, arm: &ArmName, scale: Option<&Scale>, columns: usize, ink: Ink) -> Vec<Line> {
    let shown = shown(columns, scale.is_some());
    let heading: String = shown.iter().map(|c| c.fit(c.heading())).collect();
    let mut lines = vec![Line::of(format!("  {heading}"), Tone::Quiet)];
    let names = arm.names_in(r);
    for joint in 0..r.joints() {
        let at = |array: &[f64]| array.get(joint).copied().unwrap_or(f64::NAN);
        let word = |array: &[u32]| array.get(joint).copied().unwrap_or(0);
        let row = Row {
            name: arm.joints.get(joint).cloned().unwrap_or_else(|| format!("joint {}", joint + 1)),
            command_rad: at(&r.command_rad),
            measured_rad: at(&r.measured_rad),
            error_rad: at(&r.tracking_error_rad),
            velocity_rad_s: at(&r.command_velocity_rad_s),
            drive_status: names.status_word(joint, word(&r.drive_status)),
            has_error: word(&r.drive_error) != 0,
            scale: scale.and_then(|s| s.joints.get(joint)),
            ink,
        };
        let cells = shown.iter().map(|column| {
            let cell = column.cell(&row);
            Span::new(column.fit(&cell.text), cell.tone)
        });
        lines.push(Line(std::iter::once(Span::plain("  ")).chain(cells).collect()));
    }
    lines
}

/// The columns that fit; bars only where there are limits to hold against.
fn shown(columns: usize, with_bars: bool) -> Vec<Column> {
    let is_bar = |c: &Column| matches!(c, Column::PositionBar | Column::ErrorBar | Column::VelocityBar);
    let mut shown: Vec<Column> = Column::ALL.into_iter().filter(|c| with_bars || !is_bar(c)).collect();
    let width = |shown: &[Column]| 2 + shown.iter().map(|c| c.width() + 2).sum::<usize>();
    for dispensable in Column::DISPENSABLE {
        if width(&shown) <= columns {
            break;
        }
        shown.retain(|c| *c != dispensable);
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_do_not_fit_are_left_out_and_the_measured_angle_stays() {
        assert_eq!(shown(200, true).len(), Column::ALL.len());
        assert_eq!(shown(1, true), [Column::Name, Column::Measured]);
        for columns in 31..200 {
            let width: usize = shown(columns, true).iter().map(|c| c.width() + 2).sum();
            assert!(width + 2 <= columns, "{columns}: {:?}", shown(columns, true));
        }
    }
}
