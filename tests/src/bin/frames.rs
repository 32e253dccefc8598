//! Where an arm is: for every pose on the input, the tip's pose and the places of all collision shapes.
//!
//! For `tests/peers/kinematics.py`, which holds the answers against an independent library. The first line of the output names
//! the joints, the second the shapes' links; then one line a pose: the tip's rotation matrix by rows, its place, and the
//! centre of each shape, all in the base frame, in metres.
use anyhow::{Context, Result, ensure};
use std::io::{BufRead, BufWriter, Write, stdin, stdout};
use std::path::PathBuf;
use taustream_arm::Robot;
use taustream_motion::MAX_JOINTS;

fn main() -> Result<()> {
    let file = std::env::args_os().nth(1).map(PathBuf::from).context("usage: frames ROBOT.toml < poses")?;
    let robot = Robot::load(&file)?;
    let mut out = BufWriter::new(stdout().lock());
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let links: Vec<&str> =
        robot.shapes.iter().filter_map(|shape| robot.links.get(shape.link).map(String::as_str)).collect();
    writeln!(out, "{}\n{}", joints.join(" "), links.join(" "))?;
    for line in stdin().lock().lines() {
        let angles = line?.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        ensure!(angles.len() == joints.len(), "{} angles for {} joints", angles.len(), joints.len());
        let mut position_rad = [0.0; MAX_JOINTS];
        position_rad.iter_mut().zip(&angles).for_each(|(slot, angle)| *slot = *angle);
        let frames = robot.chain.frames(&position_rad);
        let tip = frames.last().copied().unwrap_or_default();
        let rotation = tip.rotation.to_rotation_matrix();
        let mut numbers: Vec<f64> = rotation.matrix().transpose().iter().copied().collect();
        numbers.extend(tip.translation.vector.iter());
        for shape in &robot.shapes {
            let frame = frames.get(shape.frame).copied().unwrap_or_default();
            numbers.extend((frame * shape.pose).translation.vector.iter());
        }
        let words: Vec<String> = numbers.iter().map(|number| format!("{number:e}")).collect();
        writeln!(out, "{}", words.join(" "))?;
    }
    Ok(())
}
