//! What must hold whatever the drives say: random statusword walks, random frames.
use super::{Bench, ENABLED, FAULT, FOLLOWS, QUICK_STOP, READY, SWITCH_ON_DISABLED, SWITCHED_ON, SeededRng};
use taustream_drivers::codec::cia402::{CountScale, counts_from_rad};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

/// What one setpoint is checked by.
#[derive(Clone, Copy)]
struct Setpoint {
    drive_target: DriveTarget,
    /// The newest statusword and position that the master was given.
    last_received: (u16, i32),
    /// The encoded command; none when it was no number.
    command: Option<i32>,
    /// Most counts between command and position for energising.
    near: i32,
    /// Target before this one.
    before: i32,
    control: u16,
    target: i32,
}

/// The rules for what may be sent to a drive; the first broken one.
fn check_value(s: Setpoint) -> Result<(), &'static str> {
    let state = s.last_received.0 & 0x6F;
    if ![0x00, 0x02, 0x06, 0x07, 0x0F, 0x80].contains(&s.control) {
        return Err("a controlword that the table does not have");
    }
    if s.drive_target == DriveTarget::TorqueOff && s.control != 0x00 && s.control != 0x80 {
        return Err("torque off was requested");
    }
    if s.control == 0x0F {
        if s.drive_target != DriveTarget::Enabled {
            return Err("enable without a request");
        }
        if state != 0x23 && state != 0x27 {
            return Err("enable to a drive that is not switched on");
        }
        if s.target != s.command.unwrap_or(s.before) {
            return Err("an energised target that is not the command");
        }
        let far = s.command.is_none_or(|command| command.abs_diff(s.last_received.1) > s.near.unsigned_abs());
        if state == 0x23 && far {
            return Err("energised far from the command");
        }
    } else if s.target != s.last_received.1 && Some(s.target) != s.command && s.target != s.before {
        return Err("a target that is neither command nor position");
    }
    Ok(())
}

const GOOD: Setpoint = Setpoint {
    drive_target: DriveTarget::Enabled,
    last_received: (SWITCHED_ON, 100),
    command: Some(110),
    near: 50,
    before: 90,
    control: 0x0F,
    target: 110,
};

#[test]
fn check_of_setpoints_finds_every_planted_fault() {
    assert_eq!(check_value(GOOD), Ok(()));
    let planted = [
        Setpoint { last_received: (READY, 100), ..GOOD },
        Setpoint { last_received: (FAULT, 100), ..GOOD },
        Setpoint { drive_target: DriveTarget::Disabled, ..GOOD },
        Setpoint { drive_target: DriveTarget::TorqueOff, ..GOOD },
        Setpoint { drive_target: DriveTarget::TorqueOff, control: 0x02, ..GOOD },
        Setpoint { control: 0x1F, ..GOOD },
        Setpoint { target: 111, ..GOOD },
        Setpoint { last_received: (SWITCHED_ON, 161), ..GOOD },
        Setpoint { command: None, ..GOOD },
        Setpoint { control: 0x06, target: 7, ..GOOD },
    ];
    for (number, setpoint) in planted.into_iter().enumerate() {
        assert!(check_value(setpoint).is_err(), "planted fault {number} passed");
    }
}

#[test]
fn random_statuswords_targets_and_commands_never_break_the_rules_of_setpoints() {
    let (mut checked, mut enables, mut reached) = (0, 0, 0);
    for seed in 0..400 {
        let mut rng = SeededRng::from_seed(seed);
        let mut bench = Bench::new(2);
        bench.until(DriveState::Disabled, 2_000);
        bench.hold();
        let mut before: Vec<i32> = (0..2).map(|drive| bench.rpdo(drive).unwrap().1).collect();
        for cycle in 0..400 {
            stir(&mut bench, &mut rng);
            let last_received = bench.last_received.clone();
            bench.step();
            reached += usize::from(bench.status(0).state == DriveState::Enabled);
            for drive in 0..2 {
                let Some((control, target)) = bench.rpdo(drive) else { continue };
                let scale = CountScale::of(&bench.settings.servos[drive]).unwrap();
                let position_rad = bench.commands[drive].position_rad;
                let command = position_rad.is_finite().then(|| counts_from_rad(&scale, position_rad));
                // 0.05 rad, the shipped position_jump_rad_max, and one count for rounding.
                let near = counts_from_rad(&scale, scale.zero_offset_rad + 0.05).abs() + 1;
                let Some(last_received) = last_received[drive] else { panic!("setpoints before feedback") };
                let (drive_target, before_it) = (bench.drive_target, before[drive]);
                let setpoint = Setpoint {
                    drive_target,
                    last_received,
                    command,
                    near,
                    before: before_it,
                    control,
                    target,
                };
                if let Err(rule) = check_value(setpoint) {
                    panic!(
                        "seed {seed}, cycle {cycle}, drive {drive}: {rule}: {control:#06x} to {last_received:?}"
                    );
                }
                before[drive] = target;
                checked += 1;
                enables += usize::from(control == 0x0F);
            }
        }
    }
    assert!(checked > 100_000 && enables > 5_000 && reached > 2_000, "{checked} {enables} {reached}");
}

/// Changes something of the world, seldom enough that sequences get somewhere.
fn stir(bench: &mut Bench, rng: &mut SeededRng) {
    let words =
        [SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED, ENABLED | FOLLOWS, QUICK_STOP, FAULT, 0x021F];
    for drive in &mut bench.drives {
        if rng.chance(0.02) {
            drive.responds = rng.chance(0.7);
            drive.status = if rng.chance(0.9) { words[rng.below(8)] } else { rng.word() };
        }
        if rng.chance(0.01) {
            drive.silent = rng.chance(0.2);
        }
        drive.position = drive.position.wrapping_add(i32::from(rng.word() >> 5) - 1_024);
    }
    if rng.chance(0.05) {
        bench.drive_target =
            [DriveTarget::Disabled, DriveTarget::Enabled, DriveTarget::Enabled, DriveTarget::TorqueOff]
                [rng.below(4)];
    }
    if rng.chance(0.02) {
        bench.driver.clear_faults();
    }
    if rng.chance(0.1) {
        bench.hold();
    }
    let command = &mut bench.commands[rng.below(2)];
    if rng.chance(0.05) {
        command.position_rad = [f64::NAN, 1e9, f64::NEG_INFINITY, 0.3][rng.below(4)];
    } else {
        command.position_rad += rng.within(-0.01, 0.01);
    }
}

#[test]
fn random_frames_in_any_stage_never_panic_nor_break_the_frame_rules_and_the_master_recovers() {
    for seed in 0..150 {
        let mut rng = SeededRng::from_seed(seed);
        let mut bench = Bench::new(3);
        bench.steps(rng.below(400) as u64);
        for _ in 0..300 {
            for _ in 0..rng.below(8) {
                let any = rng.frame();
                bench.decode(&any);
            }
            bench.step();
            // SYNC, three setpoints, NMT and SDO a node, the master's heartbeat.
            assert!(bench.sent.len() <= 1 + 3 + 3 * 2 + 1, "seed {seed}: {} frames", bench.sent.len());
            for (place, sent) in bench.sent.iter().enumerate() {
                let id = sent.id().raw();
                assert!(id != 0x080 || place == 0, "seed {seed}: SYNC is not first");
                assert!(
                    !(0x201..=0x203).contains(&id) || sent.data()[0] & 0x0F != 0x0F,
                    "seed {seed}: enabled"
                );
                let same = bench.sent.iter().filter(|other| other.id() == sent.id()).count();
                assert!(id == 0 || same == 1, "seed {seed}: {id:03X} twice in a cycle");
            }
        }
        bench.driver.clear_faults();
        for _ in 0..3 {
            bench.steps(3_000);
            bench.driver.clear_faults();
        }
        assert_eq!(bench.states(), [DriveState::Disabled; 3], "seed {seed}: the noise left a mark");
    }
}
