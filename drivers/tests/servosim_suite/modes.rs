//! What common masters ask of a drive beside cyclic synchronous position: profiles, homing, block upload, layer settings.
use super::bench::{Bench, COUNTS_PER_RAD, NODE, START_RAD, counts, frame, parameters};
use taustream_drivers::CanId;
use taustream_drivers::sim::PowerState;

/// Enables by SDO alone, in a mode.
fn enabled_in(mode: i64) -> Bench {
    let mut bench = Bench::new(parameters());
    bench.must_write(0x6060, 0, 1, mode);
    for word in [0x06, 0x07, 0x0F] {
        bench.must_write(0x6040, 0, 2, word);
        bench.pass_ms(5);
    }
    assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled);
    assert_eq!(bench.read(0x6061, 0), mode);
    // The brake opens, and the load is caught.
    bench.pass_ms(500);
    bench
}

fn status(bench: &mut Bench) -> i64 {
    bench.read(0x6041, 0)
}

/// Goal: a setpoint is taken by its handshake, reached by a trapezoid of the stated speed, and said to be reached.
#[test]
fn profile_position_takes_a_setpoint_and_reaches_it_at_the_stated_speed() {
    let mut bench = enabled_in(1);
    let speed = 0.5 * COUNTS_PER_RAD.abs();
    bench.must_write(0x6081, 0, 4, speed as i64);
    let target = counts(START_RAD + 0.5);
    bench.must_write(0x607A, 0, 4, i64::from(target));
    bench.must_write(0x6040, 0, 2, 0x1F);
    assert_ne!(status(&mut bench) & 0x1000, 0, "the setpoint is acknowledged");
    bench.must_write(0x6040, 0, 2, 0x0F);
    assert_eq!(status(&mut bench) & 0x1400, 0, "ready for the next, and under way");
    let mut fastest_rad_s = 0.0_f64;
    let mut ms = 0;
    while status(&mut bench) & 0x400 == 0 {
        bench.pass_ms(1);
        fastest_rad_s = fastest_rad_s.max(bench.drive.velocity_rad_s().abs());
        ms += 1;
        assert!(ms < 3_000, "not reached: {} rad", bench.drive.position_rad());
    }
    // 0.5 rad at 0.5 rad/s, and 33 ms for the ramps of 15 rad/s^2.
    assert!((1_000..1_200).contains(&ms), "took {ms} ms");
    assert!((0.45..0.55).contains(&fastest_rad_s), "{fastest_rad_s} rad/s");
    assert!((bench.drive.position_rad() - START_RAD - 0.5).abs() < 0.002);
}

/// Goal: a setpoint given under way waits for the first to be reached, or replaces it with "change at once"; halt stops.
#[test]
fn profile_position_buffers_replaces_and_halts() {
    let give = |bench: &mut Bench, at_rad: f64, word: i64| {
        bench.must_write(0x607A, 0, 4, i64::from(counts(at_rad)));
        bench.must_write(0x6040, 0, 2, word | 0x10);
        bench.must_write(0x6040, 0, 2, word);
    };
    let mut bench = enabled_in(1);
    give(&mut bench, START_RAD + 0.3, 0x0F);
    bench.pass_ms(20);
    give(&mut bench, START_RAD - 0.1, 0x0F);
    assert_ne!(status(&mut bench) & 0x1000, 0, "the buffer is full");
    let mut highest_rad = 0.0_f64;
    for _ in 0..2_000 {
        bench.pass_ms(1);
        highest_rad = highest_rad.max(bench.drive.position_rad());
    }
    assert!((highest_rad - START_RAD - 0.3).abs() < 0.01, "the first was passed over: {highest_rad}");
    assert!((bench.drive.position_rad() - START_RAD + 0.1).abs() < 0.002);

    let mut bench = enabled_in(1);
    give(&mut bench, START_RAD + 0.6, 0x2F);
    bench.pass_ms(60);
    give(&mut bench, START_RAD, 0x2F);
    let mut highest_rad = 0.0_f64;
    for _ in 0..1_500 {
        bench.pass_ms(1);
        highest_rad = highest_rad.max(bench.drive.position_rad());
    }
    assert!(highest_rad < START_RAD + 0.4, "{highest_rad} rad: it was not replaced");
    assert!((bench.drive.position_rad() - START_RAD).abs() < 0.002);

    give(&mut bench, START_RAD + 1.0, 0x2F);
    bench.pass_ms(100);
    bench.must_write(0x6040, 0, 2, 0x10F);
    bench.pass_ms(600);
    assert!(bench.drive.velocity_rad_s().abs() < 0.01);
    assert!(bench.drive.position_rad() < START_RAD + 0.8, "{} rad", bench.drive.position_rad());
    bench.must_write(0x6040, 0, 2, 0x0F);
    bench.pass_ms(1_500);
    assert!((bench.drive.position_rad() - START_RAD - 1.0).abs() < 0.002, "it does not go on after the halt");
}

#[test]
fn profile_velocity_reaches_and_keeps_its_velocity() {
    let mut bench = enabled_in(3);
    assert_ne!(status(&mut bench) & 0x1000, 0, "speed 0 is said");
    bench.must_write(0x60FF, 0, 4, (0.4 * COUNTS_PER_RAD) as i64 & 0xFFFF_FFFF);
    bench.pass_ms(400);
    assert!((bench.drive.velocity_rad_s() - 0.4).abs() < 0.01, "{} rad/s", bench.drive.velocity_rad_s());
    assert_eq!(status(&mut bench) & 0x1400, 0x400);
    assert_eq!(bench.write(0x6060, 0, 1, 8), 0x0800_0022, "a mode is taken from a motor that moves");
    bench.must_write(0x60FF, 0, 4, 0);
    bench.pass_ms(400);
    assert!(bench.drive.velocity_rad_s().abs() < 0.005);
    bench.must_write(0x6060, 0, 1, 8);
}

/// Goal: homing ends where its method says, with the home offset as the position there, and can be interrupted.
#[test]
fn homing_sets_the_position_where_its_method_says() {
    // The drive counts against the link: its negative limit switch is the joint's upper one.
    for (method, at_rad) in [(37, START_RAD), (35, START_RAD), (17, 3.0), (18, -3.0)] {
        let mut bench = enabled_in(6);
        bench.must_write(0x6098, 0, 1, method);
        bench.must_write(0x607C, 0, 4, 1234);
        bench.must_write(0x6099, 1, 4, (1.0 * COUNTS_PER_RAD.abs()) as i64);
        assert_eq!(status(&mut bench) & 0x3400, 0x400, "not homed, at rest");
        bench.must_write(0x6040, 0, 2, 0x1F);
        let mut ms = 0;
        while status(&mut bench) & 0x1400 != 0x1400 {
            bench.pass_ms(10);
            ms += 10;
            assert!(ms < 10_000, "method {method}: at {} rad", bench.drive.position_rad());
        }
        assert!(
            (bench.drive.position_rad() - at_rad).abs() < 0.02,
            "method {method}: {}",
            bench.drive.position_rad()
        );
        let position = bench.read(0x6064, 0) as u32 as i32;
        assert!((position - 1234).abs() < 200, "method {method}: {position}");
    }
    let mut bench = enabled_in(6);
    bench.must_write(0x6098, 0, 1, 18);
    bench.must_write(0x6040, 0, 2, 0x1F);
    bench.pass_ms(200);
    bench.must_write(0x6040, 0, 2, 0x0F);
    bench.pass_ms(200);
    assert_eq!(status(&mut bench) & 0x3400, 0x400, "interrupted");
    assert_eq!(bench.write(0x6098, 0, 1, 3), 0x0609_0030, "a method that there is not");
}

/// Index pulses lie a motor revolution apart: a hundredth of the link's.
#[test]
fn homing_on_the_index_pulse_ends_within_a_motor_revolution() {
    for method in [33, 34] {
        let mut bench = enabled_in(6);
        bench.must_write(0x6098, 0, 1, method);
        bench.must_write(0x6099, 2, 4, (0.2 * COUNTS_PER_RAD.abs()) as i64);
        bench.must_write(0x6040, 0, 2, 0x1F);
        bench.pass_ms(1_000);
        assert_eq!(status(&mut bench) & 0x1400, 0x1400);
        let moved_rad = bench.drive.position_rad() - START_RAD;
        assert!(moved_rad.abs() < std::f64::consts::TAU / 100.0 + 0.005, "{moved_rad} rad");
        assert_eq!(moved_rad > 0.0, method == 33, "this drive counts against the link");
    }
}

#[test]
fn torque_limit_bounds_the_torque() {
    let mut bench = enabled_in(1);
    bench.must_write(0x6072, 0, 2, 100);
    // A tenth of 120 Nm does not hold 20 Nm of gravity.
    bench.pass_ms(300);
    let torque = bench.read(0x6077, 0) as u16 as i16;
    assert!(torque.unsigned_abs() <= 101, "{torque} per mille");
    assert!((bench.drive.position_rad() - START_RAD).abs() > 0.01, "it holds more than it may");
}

/// Goal: a long value comes in blocks, with lost segments repeated and the check sum right.
#[test]
fn block_upload_sends_the_name_and_repeats_what_was_lost() {
    let mut bench = Bench::new(parameters());
    let node = u16::from(NODE);
    let answer = bench.sdo([0xA4, 0x08, 0x10, 0, 2, 0, 0, 0]);
    assert_eq!(answer, [0xC6, 0x08, 0x10, 0, 25, 0, 0, 0]);
    let segments = |bench: &mut Bench, request: [u8; 8]| {
        bench.sent.clear();
        bench.send(0x600 + node, &request);
        bench.take(0x580 + node)
    };
    let first = segments(&mut bench, [0xA3, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(first, [b"\x01taustre".to_vec(), b"\x02am simu".to_vec()]);
    // The second was lost; from now on four a block.
    let rest = segments(&mut bench, [0xA2, 1, 4, 0, 0, 0, 0, 0]);
    let expected: [&[u8]; 3] = [b"\x01am simu", b"\x02lated d", b"\x83rive\0\0\0"];
    assert_eq!(rest, expected.map(<[u8]>::to_vec));
    let end = segments(&mut bench, [0xA2, 3, 4, 0, 0, 0, 0, 0]);
    let sum = crc(b"taustream simulated drive").to_le_bytes();
    assert_eq!(end, [vec![0xC1 | 3 << 2, sum[0], sum[1], 0, 0, 0, 0, 0]]);
    assert_eq!(segments(&mut bench, [0xA1, 0, 0, 0, 0, 0, 0, 0]), Vec::<Vec<u8>>::new());

    // Out of order, beyond the block, of nothing: refused.
    assert_eq!(bench.abort([0xA2, 1, 4, 0, 0, 0, 0, 0]), 0x0504_0001);
    assert_eq!(bench.abort([0xA4, 0x34, 0x12, 0, 4, 0, 0, 0]), 0x0602_0000);
    bench.sdo([0xA4, 0x08, 0x10, 0, 2, 0, 0, 0]);
    bench.send(0x600 + node, &[0xA3, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.abort([0xA2, 9, 4, 0, 0, 0, 0, 0]), 0x0504_0003);
    // One whose client goes quiet ends by itself.
    bench.sdo([0xA4, 0x08, 0x10, 0, 2, 0, 0, 0]);
    bench.pass_ms(1_100);
    assert_eq!(bench.take(0x580 + node), [vec![0x80, 0x08, 0x10, 0, 0, 0, 4, 5]]);
}

fn crc(bytes: &[u8]) -> u16 {
    let mut sum = 0_u16;
    for byte in bytes {
        for bit in (0..8).rev() {
            let carry = (sum >> 15) ^ u16::from(byte >> bit & 1);
            sum = sum << 1 ^ if carry == 1 { 0x1021 } else { 0 };
        }
    }
    sum
}

/// Goal: layer setting services find the drive by its identity, say what it is, and give it another node id.
#[test]
fn layer_setting_services_select_inquire_and_set_the_node_id() {
    let mut bench = Bench::new(parameters());
    let ask = |bench: &mut Bench, command: u8, number: u32| {
        let [a, b, c, d] = number.to_le_bytes();
        bench.sent.clear();
        bench.send(0x7E5, &[command, a, b, c, d, 0, 0, 0]);
        bench.take(0x7E4)
    };
    assert_eq!(ask(&mut bench, 0x5E, 0), Vec::<Vec<u8>>::new(), "it waits, and does not answer");
    let identity = [1, 2, 3, 4].map(|sub| bench.read(0x1018, sub) as u32);
    for (at, number) in (0x40..).zip(identity) {
        let answers = ask(&mut bench, at, number);
        assert_eq!(answers.is_empty(), at < 0x43, "{at:02X}");
    }
    assert_eq!(
        ask(&mut bench, 0x5B, 0),
        [[vec![0x5B], identity[1].to_le_bytes().to_vec(), vec![0; 3]].concat()]
    );
    assert_eq!(ask(&mut bench, 0x5E, 0), [vec![0x5E, NODE, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(ask(&mut bench, 0x11, 200), [vec![0x11, 1, 0, 0, 0, 0, 0, 0]], "no node id");
    assert_eq!(ask(&mut bench, 0x11, 9), [vec![0x11, 0, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(ask(&mut bench, 0x04, 0), Vec::<Vec<u8>>::new());
    assert_eq!(ask(&mut bench, 0x5E, 0), Vec::<Vec<u8>>::new(), "back to waiting");
    assert_eq!(bench.read(0x1014, 0), 0x83, "not before the reset");
    bench.send(0x000, &[0x82, NODE]);
    bench.pass_ms(30);
    assert_eq!(bench.take(0x709), [vec![0]], "boot-up under the new id");
    bench.send(0x609, &[0x40, 0x00, 0x14, 1, 0, 0, 0, 0]);
    let answer = bench.sent.iter().find(|sent| sent.id() == CanId::standard(0x589)).unwrap();
    assert_eq!(answer.data()[4..], [0x09, 0x02, 0, 0]);
    bench.sent.clear();
    bench.drive.receive(bench.now(), &frame(0x603, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]), &mut bench.sent);
    assert!(bench.sent.is_empty(), "it still answers under the old id");
}
