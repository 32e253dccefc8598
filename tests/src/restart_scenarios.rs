//! A streamer that is killed while its drives hold, and the next one, checked by what was on the bus.
//!
//! The recording of the test bench continues over the kill; the check of setpoints does not, because a log ends with its streamer.
use crate::candump;
use crate::retry::Failed;
use crate::scenarios::{Goals, set_off};
use crate::test_bench::{Place, TestBench};
use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use taustream_messages::Phase;

/// What the next streamer may have moved the arm by before `enable`: the joints' own settling.
const STILL_RAD: f64 = 2e-3;

/// One restart: when the streamer is killed.
#[derive(Clone, Copy, Debug)]
pub struct Restart {
    /// Area, event, condition.
    pub name: &'static str,
    mid_motion: bool,
}

/// Every restart.
pub const ALL: &[Restart] = &[
    Restart { name: "streamer_killed_in_hold_next_one_adopts", mid_motion: false },
    Restart { name: "streamer_killed_mid_motion_next_one_adopts", mid_motion: true },
];

/// The shipped settings with drives that hold without a streamer, beside them.
fn holding_settings(place: &Place) -> Result<PathBuf> {
    let text = fs::read_to_string(&place.settings)?;
    ensure!(text.contains("reaction = \"ramp\""), "the shipped settings have no reaction to replace");
    let file = place.settings.with_file_name("hold6.toml");
    let text = text
        .replace("reaction = \"ramp\"", "reaction = \"hold\"")
        .replace("name = \"vcan6\"", "name = \"hold6\"");
    fs::write(&file, text)?;
    Ok(file)
}

/// Runs one restart; says what was seen.
///
/// # Errors
/// What did not hold.
pub fn perform(restart: &Restart, place: &Place, goals: &Goals, attempt: usize) -> Result<String, Failed> {
    let settings = holding_settings(place)?;
    let place = Place { settings: settings.clone(), ..place.clone() };
    let mut bench = TestBench::open(&place, &format!("{}-{attempt}", restart.name))?;
    let outcome = kill_and_restart(restart, &mut bench, goals);
    fs::remove_file(&settings).context("the settings of this scenario cannot be removed")?;
    outcome.map_err(|error| bench.failed(error))
}

fn kill_and_restart(restart: &Restart, bench: &mut TestBench, goals: &Goals) -> Result<String> {
    bench.cli_done(&["enable"])?;
    bench.await_phase(Phase::Holding)?;
    if restart.mid_motion {
        set_off(bench, goals, 0, 0.2)?;
    }
    bench.streamer.signal(Signal::KILL)?;
    bench.streamer.await_end()?;
    // Longer than the drives wait for the master's heartbeat: they have stopped quickly, and hold.
    std::thread::sleep(Duration::from_millis(1500));
    let restarted_us = SystemTime::now().duration_since(UNIX_EPOCH)?.as_micros();
    bench.restart_streamer()?;
    let locked = bench.await_report("the adopted hold", |report, phase| {
        phase == Phase::Locked && report.adopted == 1 && report.measured_rad[0].is_finite()
    })?;
    ensure!(locked.energised == 1, "the drives are not energised");
    bench.cli_refused(&["replan", "--goal", &goals.text(1)?], "locked")?;
    std::thread::sleep(Duration::from_millis(500));
    let still = bench.report()?.0;
    for joint in 0..still.joints() {
        let moved_rad = (still.measured_rad[joint] - locked.measured_rad[joint]).abs();
        ensure!(moved_rad < STILL_RAD, "joint {} moved by {moved_rad} rad before enable", joint + 1);
        ensure!(
            (still.command_rad[joint] - locked.command_rad[joint]).abs() < 1e-9,
            "the commanded pose of joint {} moved before enable",
            joint + 1
        );
    }
    let holds = only_keeping(&bench.recorded()?, restarted_us)?;
    bench.cli_done(&["enable"])?;
    bench.await_phase(Phase::Holding)?;
    bench.cli_done(&["speed", "100"])?;
    let motion = bench.replan(&goals.text(1)?)?;
    bench.await_end_of(motion)?;
    Ok(format!("{holds} setpoints before enable, all of them the hold"))
}

/// Frames of a restart before `enable`, decoded here: reads, the master's heartbeat, SYNC, NMT start, and setpoints that
/// keep each drive as it is. How many setpoints there were.
fn only_keeping(recording: &str, since_us: u128) -> Result<usize> {
    let mut holds = 0;
    let mut targets = [const { None::<Vec<u8>> }; 128];
    let records = candump::parse(recording)?;
    for record in records.iter().filter(|record| u128::from(record.time_us) >= since_us) {
        let (id, data) = (record.frame.id().raw(), record.frame.data());
        match (id, data) {
            (0x000, [command, node]) => ensure!(*command == 0x01, "NMT {command:#04x} to node {node}"),
            (0x601..=0x67F, [command, ..]) => ensure!(*command == 0x40, "SDO write: {id:03X} {data:02X?}"),
            (0x201..=0x27F, [low, high, target @ ..]) => {
                ensure!(
                    matches!((low, high), (0x02 | 0x0F, 0)),
                    "controlword {high:02X}{low:02X} to {id:03X}"
                );
                let slot = targets.get_mut(id as usize - 0x200).context("a node beyond 127")?;
                let before = slot.get_or_insert_with(|| target.to_vec());
                ensure!(
                    before.as_slice() == target,
                    "the target of {id:03X} went from {before:02X?} to {target:02X?}"
                );
                holds += 1;
            }
            _ => {}
        }
    }
    ensure!(holds > 100, "only {holds} setpoints were seen: nothing was kept");
    Ok(holds)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(lines: &[&str]) -> String {
        let kept = "(1.000000) vcan0 201#0200E8030000".to_owned();
        let mut all = vec![kept; 200];
        all.extend(lines.iter().map(|line| format!("(1.000000) vcan0 {line}")));
        // What came before the restart does not count.
        all.insert(0, "(0.000009) vcan0 000#8201".to_owned());
        all.join("\n") + "\n"
    }

    #[test]
    fn restart_that_only_reads_and_keeps_passes_and_each_planted_fault_fails() {
        let good =
            ["000#0101", "080#", "601#4041600000000000", "77F#05", "201#0200E8030000", "181#170200000000"];
        assert_eq!(only_keeping(&recording(&good), 10).unwrap(), 201);
        for fault in [
            "000#8101",
            "000#8201",
            "000#8001",
            "601#2B40600000000000",
            "601#2F00160000000000",
            "201#0000E8030000",
            "201#0600E8030000",
            "201#0700E8030000",
            "201#0200E9030000",
        ] {
            assert!(only_keeping(&recording(&[fault]), 10).is_err(), "{fault} passes");
        }
        assert!(only_keeping("(1.000000) vcan0 080#\n", 10).is_err(), "a silent restart passes");
    }
}
