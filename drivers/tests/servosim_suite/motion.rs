//! What the motor does: tracking, steps, limits, gravity, watchdog.
use super::bench::{Bench, COUNTS_PER_RAD, START_RAD, ZERO_RAD, counts, enabled, parameters};
use taustream_arm::Reaction;
use taustream_drivers::sim::{Disturbance, DriveParameters, PlantParameters, PowerState};

#[test]
fn drive_that_is_enabled_follows_a_motion_within_a_milliradian() {
    let mut bench = enabled(parameters());
    let mut worst_rad = 0.0_f64;
    let mut targets_rad = [START_RAD; 2];
    for tick in 0..3000 {
        let t_s = f64::from(tick) * 1e-3;
        // Peaks of 2.5 rad/s and 5 rad/s^2.
        let requested_rad = START_RAD + 1.25 * (1.0 - (2.0 * t_s).cos());
        let (_, measured) = bench.cycle(0x0F, counts(requested_rad));
        // Sent in this cycle, latched at the next SYNC, reached one interpolation period later.
        let due_rad = targets_rad[0];
        targets_rad = [targets_rad[1], requested_rad];
        let measured_rad = f64::from(measured) / COUNTS_PER_RAD + ZERO_RAD;
        worst_rad = worst_rad.max((measured_rad - due_rad).abs());
    }
    assert!(worst_rad < 0.001, "tracking error {worst_rad} rad");
}

/// Angle and speed at one instant.
type Sample = (u64, f64, f64);

/// The first two samples between which a joint moved as no joint with this motor can, as text.
fn impossible(samples: &[Sample], p: &PlantParameters) -> Option<String> {
    let most_rad_s2 = (p.torque_nm_max + p.gravity_nm + p.coulomb_nm + 5.0) / p.inertia_kg_m2;
    samples.windows(2).find_map(|pair| {
        let [(from_us, from_rad, from_rad_s), (to_us, to_rad, to_rad_s)] = [pair[0], pair[1]];
        let dt_s = (to_us - from_us) as f64 * 1e-6;
        let (moved_rad, change_rad_s) = ((to_rad - from_rad).abs(), (to_rad_s - from_rad_s).abs());
        let fits = moved_rad <= 1.1 * p.speed_rad_s_max * dt_s && change_rad_s <= most_rad_s2 * dt_s;
        (!fits).then(|| format!("moved {moved_rad} rad, {change_rad_s} rad/s in {dt_s} s at {to_us} us"))
    })
}

/// Goal: a step of the setpoint gives no step of the position, whatever its size.
/// Method: between two samples the joint may move by its speed limit, and its speed change by the torque limit.
#[test]
fn step_of_the_setpoint_gives_no_step_of_the_position() {
    for step_rad in [1e-4, 0.01, 0.2, -2.0, 1e3] {
        let mut bench = enabled(parameters());
        let mut samples: Vec<Sample> = Vec::new();
        for _ in 0..200 {
            bench.cycle(0x0F, counts(START_RAD + step_rad));
            for _ in 0..3 {
                bench.now_us += 250;
                bench.drive.advance(bench.now(), &mut bench.sent);
                samples.push((bench.now_us, bench.drive.position_rad(), bench.drive.velocity_rad_s()));
            }
        }
        let plant = parameters().plant;
        assert_eq!(impossible(&samples, &plant), None, "step of {step_rad}");
        let faulted = bench.drive.power_state() == PowerState::Fault;
        assert_eq!(faulted, step_rad.abs() > 0.3, "step of {step_rad} against a window of 0.3 rad");

        // The check sees a planted step of a hundredth of a radian, and of a fifth of the speed limit.
        for (rad, rad_s) in [(0.01, 0.0), (0.0, 0.8)] {
            let mut planted = samples.clone();
            planted[300].1 += rad;
            planted[300].2 += rad_s;
            assert!(impossible(&planted, &plant).is_some(), "planted {rad} rad, {rad_s} rad/s");
        }
    }
}

#[test]
fn small_step_settles_on_its_target_without_much_overshoot() {
    let mut bench = enabled(parameters());
    let mut highest_rad = f64::MIN;
    for _ in 0..500 {
        bench.cycle(0x0F, counts(START_RAD + 0.1));
        highest_rad = highest_rad.max(bench.drive.position_rad());
    }
    let end_rad = bench.drive.position_rad();
    assert!((end_rad - START_RAD - 0.1).abs() < 5e-4, "rests at {end_rad}");
    assert!(highest_rad < START_RAD + 0.13, "overshoots to {highest_rad}");
}

/// Goal: a setpoint acts from the SYNC after it, not before.
#[test]
fn setpoint_sent_after_a_sync_waits_for_the_next() {
    let mut bench = enabled(parameters());
    let here = counts(START_RAD);
    for _ in 0..200 {
        bench.cycle(0x0F, here);
    }
    bench.cycle(0x0F, counts(START_RAD + 0.05)); // SYNC, then the new setpoint.
    let at_rad = bench.drive.reference_rad();
    bench.pass_ms(20);
    assert!((bench.drive.reference_rad() - at_rad).abs() < 1e-12, "acted without a SYNC");
    bench.send(0x080, &[]);
    bench.pass_ms(1);
    let moved_rad = bench.drive.reference_rad() - at_rad;
    assert!((moved_rad - 0.05).abs() < 1e-4, "reference moved by {moved_rad}");
}

#[test]
fn reference_runs_evenly_over_the_interpolation_period() {
    let mut bench = enabled(parameters());
    bench.must_write(0x60C2, 1, 1, 8); // 8 ms
    bench.cycle(0x0F, counts(START_RAD + 0.08));
    let at_rad = bench.drive.reference_rad();
    bench.cycle(0x0F, counts(START_RAD + 0.08)); // This SYNC begins the way there.
    let target_rad = f64::from(counts(START_RAD + 0.08)) / COUNTS_PER_RAD + ZERO_RAD;
    for ms in 1..=10_u32 {
        bench.pass_ms(1);
        let due_rad = at_rad + (target_rad - at_rad) * (f64::from(ms) / 8.0).min(1.0);
        let reference_rad = bench.drive.reference_rad();
        assert!((reference_rad - due_rad).abs() < 1e-9, "{reference_rad} not {due_rad} after {ms} ms");
    }
}

#[test]
fn setpoints_beyond_a_soft_limit_are_cut_off_and_said_so() {
    let mut parameters = parameters();
    parameters.soft_limit_rad = [0.0, 0.5];
    let mut bench = enabled(parameters);
    let mut word = 0;
    for tick in 0..1000 {
        word = bench.cycle(0x0F, counts(START_RAD + (f64::from(tick) * 1e-3).min(0.4))).0;
    }
    assert_eq!(word & 0x0800, 0x0800, "internal limit is not shown: {word:04X}");
    assert!((bench.drive.position_rad() - 0.5).abs() < 1e-3, "at {}", bench.drive.position_rad());
    assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled);
}

#[test]
fn limp_joint_falls_under_gravity_and_a_braked_one_does_not() {
    for (brake, falls) in [(false, true), (true, false)] {
        let mut parameters = parameters();
        parameters.plant.brake = brake;
        let mut bench = enabled(parameters);
        for _ in 0..300 {
            bench.cycle(0x0F, counts(START_RAD));
        }
        let hold_position_rad = bench.drive.position_rad();
        assert!((hold_position_rad - START_RAD).abs() < 0.005, "does not hold: {hold_position_rad}");
        bench.cycle(0x00, counts(START_RAD)); // Disable voltage.
        for _ in 0..500 {
            bench.cycle(0x00, counts(START_RAD));
        }
        let fallen_rad = bench.drive.position_rad() - hold_position_rad;
        // Even a brake lets it sag while it closes: 20 ms at about 18 rad/s^2.
        assert_eq!(fallen_rad > 0.5, falls, "brake {brake}: moved by {fallen_rad} rad");
        assert!(falls || fallen_rad.abs() < 0.006, "brake slipped by {fallen_rad} rad");
    }
}

#[test]
fn brake_that_is_still_closed_keeps_bit_12_back() {
    let mut parameters = parameters();
    parameters.plant.brake_delay_s = 0.1;
    let mut bench = Bench::new(parameters);
    bench.configure();
    let here = counts(START_RAD);
    for controlword in [6, 6, 7, 7, 15, 15] {
        bench.cycle(controlword, here);
    }
    let mut closed = 0;
    while bench.cycle(15, here).0 & 0x1000 == 0 {
        assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled);
        closed += 1;
        assert!(closed < 200);
    }
    assert!((90..110).contains(&closed), "followed after {closed} cycles");
}

/// Goal: each watchdog reaction, after setpoints end in the middle of a motion.
#[test]
fn watchdog_reacts_as_set_when_setpoints_end() {
    for (reaction, end, emergency) in [
        (Reaction::Ramp, PowerState::Fault, 1),
        (Reaction::Limp, PowerState::Fault, 1),
        (Reaction::Hold, PowerState::OperationEnabled, 1),
    ] {
        let mut bench = enabled(DriveParameters { reaction, ..parameters() });
        for tick in 0..300 {
            bench.cycle(0x0F, counts(START_RAD + f64::from(tick) * 1e-3));
        }
        bench.sent.clear();
        bench.pass_ms(95);
        assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled, "{reaction:?} too early");
        bench.pass_ms(400);
        assert_eq!(bench.drive.power_state(), end, "{reaction:?}");
        let emergencies = bench.take(0x083);
        assert_eq!(emergencies.len(), emergency, "{reaction:?}: {emergencies:02X?}");
        assert_eq!(emergencies[0][..2], [0x50, 0x82], "{reaction:?}");
        assert!(bench.drive.velocity_rad_s().abs() < 1e-3, "{reaction:?} still moves");
        let (word, _) = bench.cycle(0x0F, counts(bench.drive.position_rad()));
        assert_eq!(word & 0x1000, 0, "{reaction:?}: follows again before a new setpoint was applied");
        bench.cycle(0x0F, counts(bench.drive.position_rad()));
        let (word, _) = bench.cycle(0x0F, counts(bench.drive.position_rad()));
        assert_eq!(word & 0x1000 != 0, reaction == Reaction::Hold, "{reaction:?}: {word:04X}");
    }
}

#[test]
fn watchdog_trips_when_syncs_go_on_without_setpoints() {
    let mut bench = enabled(parameters());
    for _ in 0..300 {
        bench.pass_ms(1);
        bench.send(0x080, &[]);
    }
    assert_eq!(bench.drive.power_state(), PowerState::Fault);
}

#[test]
fn jammed_joint_ends_in_following_error_and_a_shifted_encoder_shows() {
    let mut bench = enabled(parameters());
    bench.drive.disturb(Disturbance::Jammed(true), &mut bench.sent);
    bench.sent.clear();
    for tick in 0..500 {
        bench.cycle(0x0F, counts(START_RAD + f64::from(tick) * 1e-3));
    }
    assert_eq!(bench.take(0x083), [vec![0x11, 0x86, 0x21, 0, 0, 0, 0, 0]]);
    assert_eq!(bench.drive.power_state(), PowerState::Fault);

    let mut bench = enabled(parameters());
    let before = bench.cycle(0x0F, counts(START_RAD)).1;
    bench.drive.disturb(Disturbance::EncoderShift(0.1), &mut bench.sent);
    let after = bench.cycle(0x0F, counts(START_RAD)).1;
    let shift_rad = f64::from(after - before) / COUNTS_PER_RAD;
    assert!((shift_rad - 0.1).abs() < 0.01, "the encoder shows {shift_rad} rad");
}
