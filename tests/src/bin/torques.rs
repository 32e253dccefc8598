//! What torques an arm's motion needs: for every line of angles, speeds and accelerations on the input, one of torques in Nm.
//!
//! For `tests/peers/torques.py`, which holds the answers against an independent library. The first line of the output names
//! the joints, the second is gravity in the base's frame.
use anyhow::{Context, Result, ensure};
use std::io::{BufRead, BufWriter, Write, stdin, stdout};
use std::path::PathBuf;
use taustream_arm::Robot;
use taustream_motion::{JointArray, MAX_JOINTS};

fn main() -> Result<()> {
    let file = std::env::args_os().nth(1).map(PathBuf::from).context("usage: torques ROBOT.toml < states")?;
    let robot = Robot::load(&file)?;
    let dynamics = robot.dynamics()?;
    let mut out = BufWriter::new(stdout().lock());
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    writeln!(out, "{}\n{}", joints.join(" "), words(robot.gravity_m_s2.as_slice()))?;
    for line in stdin().lock().lines() {
        let numbers = line?.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let expected = 3 * joints.len();
        ensure!(numbers.len() == expected, "{} numbers, {expected} expected", numbers.len());
        let mut state: [JointArray; 3] = [[0.0; MAX_JOINTS]; 3];
        for (slots, part) in state.iter_mut().zip(numbers.chunks(joints.len())) {
            slots.iter_mut().zip(part).for_each(|(slot, number)| *slot = *number);
        }
        let [q, v, a] = &state;
        let torques = dynamics.torques_nm(q, v, a);
        writeln!(out, "{}", words(torques.get(..joints.len()).unwrap_or(&torques)))?;
    }
    Ok(())
}

fn words(numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(|number| format!("{number:e}")).collect();
    words.join(" ")
}
