//! `taustream sample`: a trajectory as a table.
use crate::args::SampleArgs;
use crate::failure::Failure;
use crate::output::{Form, SCHEMA};
use serde::Serialize;
use std::io::{self, BufWriter, Write};
use taustream_arm::TrajectoryFile;
use taustream_arm::printable::printable_json;
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointKind, Setpoint};

/// Highest rate; a bound against absurd arguments, far above any cycle.
const RATE_HZ_MAX: f64 = 1e6;

/// One line of the table in JSON.
#[derive(Debug, Serialize)]
struct Row<'a> {
    t_s: f64,
    position_rad: &'a [f64],
    velocity_rad_s: &'a [f64],
    acceleration_rad_s2: &'a [f64],
    jerk_rad_s3: &'a [f64],
}

/// Samples and writes line by line, so that a long motion takes no memory and `head` may close the pipe.
pub(crate) fn run(form: Form, args: &SampleArgs) -> Result<(), Failure> {
    let rate_hz = args.rate_hz;
    if !(rate_hz > 0.0 && rate_hz <= RATE_HZ_MAX) {
        let why = format!("--rate-hz is {rate_hz}; it must be above 0 and at most {RATE_HZ_MAX} (Hz)");
        return Err(Failure::Usage(why));
    }
    let file = TrajectoryFile::load(args.trajectory.path())?;
    let mut out = BufWriter::new(io::stdout().lock());
    let written = match &args.at {
        Some(times) => write_table(&mut out, form, &file, times.0.iter().copied()),
        None => write_table(&mut out, form, &file, grid(file.trajectory.duration_s(), rate_hz)),
    };
    written.and_then(|()| out.flush()).map_err(|e| Failure::writing("standard output", e))
}

/// 0, 1/rate, 2/rate, .. below the end, then the end itself.
fn grid(duration_s: f64, rate_hz: f64) -> impl Iterator<Item = f64> {
    // k / rate is one rounding away from the exact time; a running sum would drift.
    let grid = (0_u64..).map(move |k| {
        #[expect(clippy::cast_precision_loss, reason = "a day at 1 MHz is below 2^53 samples")]
        let k = k as f64;
        k / rate_hz
    });
    grid.take_while(move |t_s| *t_s < duration_s).chain(std::iter::once(duration_s))
}

fn write_table(
    out: &mut impl Write,
    form: Form,
    file: &TrajectoryFile,
    times: impl Iterator<Item = f64>,
) -> io::Result<()> {
    let trajectory = &file.trajectory;
    let joints = trajectory.joints();
    let mut cursor = Cursor::at_start(trajectory);
    match form {
        Form::Text => write_header(out, file.kinds.get(..joints).unwrap_or(&file.kinds))?,
        Form::Json => {
            let robot = serde_json::to_string(&file.robot)?;
            let robot = printable_json(&robot);
            write!(out, "{{\"schema\":{SCHEMA},\"robot\":{robot},\"joints\":{joints},")?;
            if file.kinds.iter().any(|kind| kind.is_prismatic()) {
                let units: Vec<&str> = file.kinds.iter().take(joints).map(|kind| kind.unit()).collect();
                write!(out, "\"units\":{},", serde_json::to_string(&units)?)?;
            }
            write!(out, "\"samples\":[")?;
        }
    }
    for (i, t_s) in times.enumerate() {
        let setpoint = cursor.sample(trajectory, t_s);
        match form {
            Form::Text => write_line(out, joints, t_s, &setpoint)?,
            Form::Json => {
                out.write_all(if i == 0 { b"" } else { b"," })?;
                serde_json::to_writer(&mut *out, &row(joints, t_s, &setpoint))?;
            }
        }
    }
    if form == Form::Json { writeln!(out, "]}}") } else { Ok(()) }
}

fn write_header(out: &mut impl Write, kinds: &[JointKind]) -> io::Result<()> {
    out.write_all(b"t_s")?;
    for (letter, rate) in [("q", ""), ("v", "_s"), ("a", "_s2"), ("j", "_s3")] {
        for (joint, kind) in kinds.iter().enumerate() {
            write!(out, ",{letter}{}_{}{rate}", joint + 1, kind.unit())?;
        }
    }
    writeln!(out)
}

/// `{}` writes the shortest decimal that reads back as the same bits.
fn write_line(out: &mut impl Write, joints: usize, t_s: f64, setpoint: &Setpoint) -> io::Result<()> {
    write!(out, "{t_s}")?;
    let row = row(joints, t_s, setpoint);
    let blocks = [row.position_rad, row.velocity_rad_s, row.acceleration_rad_s2, row.jerk_rad_s3];
    for value in blocks.into_iter().flatten() {
        write!(out, ",{value}")?;
    }
    writeln!(out)
}

fn row(joints: usize, t_s: f64, setpoint: &Setpoint) -> Row<'_> {
    Row {
        t_s,
        position_rad: used(&setpoint.position_rad, joints),
        velocity_rad_s: used(&setpoint.velocity_rad_s, joints),
        acceleration_rad_s2: used(&setpoint.acceleration_rad_s2, joints),
        jerk_rad_s3: used(&setpoint.jerk_rad_s3, joints),
    }
}

fn used(block: &[f64], joints: usize) -> &[f64] {
    block.get(..joints).unwrap_or(block)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_includes_the_end_once_whether_or_not_it_lies_on_the_grid() {
        let on: Vec<f64> = grid(1.0, 4.0).collect();
        assert_eq!(on, [0.0, 0.25, 0.5, 0.75, 1.0]);
        let off: Vec<f64> = grid(0.6, 4.0).collect();
        assert_eq!(off, [0.0, 0.25, 0.5, 0.6]);
        let nothing: Vec<f64> = grid(0.0, 4.0).collect();
        assert_eq!(nothing, [0.0]);
    }

    #[test]
    fn table_header_names_every_column_with_its_unit() {
        let mut out = Vec::new();
        write_header(&mut out, &[JointKind::Revolute; 2]).unwrap();
        let expected = "t_s,q1_rad,q2_rad,v1_rad_s,v2_rad_s,a1_rad_s2,a2_rad_s2,j1_rad_s3,j2_rad_s3\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
    }
}
