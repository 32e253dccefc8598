//! The CiA 402 state machine, walked through its table.
use super::bench::{Bench, START_RAD, counts, enabled, parameters};
use taustream_drivers::sim::{Disturbance, DriveParameters, PowerState};

/// Statusword of each state under the mask that tells it (CiA 402-2, table "state coding").
const CODING: [(PowerState, u16, u16); 7] = [
    (PowerState::SwitchOnDisabled, 0x4F, 0x40),
    (PowerState::ReadyToSwitchOn, 0x6F, 0x21),
    (PowerState::SwitchedOn, 0x6F, 0x23),
    (PowerState::OperationEnabled, 0x6F, 0x27),
    (PowerState::QuickStopActive, 0x6F, 0x07),
    (PowerState::FaultReactionActive, 0x4F, 0x0F),
    (PowerState::Fault, 0x4F, 0x08),
];

/// A drive in a state, at rest, quick stop option 6 (stays in quick stop active).
fn drive_in(state: PowerState) -> Bench {
    let mut bench = Bench::new(parameters());
    bench.must_write(0x605A, 0, 2, 6);
    bench.configure();
    let words: &[u16] = match state {
        PowerState::NotReadyToSwitchOn | PowerState::SwitchOnDisabled => &[],
        PowerState::ReadyToSwitchOn => &[6],
        PowerState::SwitchedOn => &[6, 7],
        PowerState::OperationEnabled => &[6, 7, 15],
        PowerState::QuickStopActive => &[6, 7, 15, 2],
        PowerState::FaultReactionActive | PowerState::Fault => {
            bench.must_write(0x2002, 0, 2, 0x1000);
            &[0]
        }
    };
    for word in words {
        bench.must_write(0x6040, 0, 2, i64::from(*word));
        bench.pass_ms(5);
    }
    bench.pass_ms(50);
    assert_eq!(bench.drive.power_state(), state);
    bench
}

/// Goal: every command in every state leads where the table says, and nowhere else.
#[test]
fn every_command_in_every_state_leads_where_the_table_says() {
    use PowerState::{
        Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
    };
    // Columns: disable voltage, quick stop, shutdown, switch on, enable operation, fault reset.
    let commands = [0x00, 0x02, 0x06, 0x07, 0x0F, 0x80];
    for (state, ends) in [
        (
            SwitchOnDisabled,
            [
                SwitchOnDisabled,
                SwitchOnDisabled,
                ReadyToSwitchOn,
                SwitchOnDisabled,
                SwitchOnDisabled,
                SwitchOnDisabled,
            ],
        ),
        (
            ReadyToSwitchOn,
            // CiA 402: "enable operation" takes transitions 3 and 4, by itself, after one write.
            [
                SwitchOnDisabled,
                SwitchOnDisabled,
                ReadyToSwitchOn,
                SwitchedOn,
                OperationEnabled,
                ReadyToSwitchOn,
            ],
        ),
        (
            SwitchedOn,
            [SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchedOn],
        ),
        (
            OperationEnabled,
            [
                SwitchOnDisabled,
                QuickStopActive,
                ReadyToSwitchOn,
                SwitchedOn,
                OperationEnabled,
                OperationEnabled,
            ],
        ),
        (
            QuickStopActive,
            [
                SwitchOnDisabled,
                QuickStopActive,
                QuickStopActive,
                QuickStopActive,
                OperationEnabled,
                QuickStopActive,
            ],
        ),
        (Fault, [Fault, Fault, Fault, Fault, Fault, SwitchOnDisabled]),
    ] {
        for (command, end) in commands.into_iter().zip(ends) {
            let mut bench = drive_in(state);
            bench.must_write(0x6040, 0, 2, command);
            bench.pass_ms(100);
            assert_eq!(bench.drive.power_state(), end, "{state:?} after {command:02X}");
            let word = bench.drive.statusword();
            let (_, mask, value) = CODING.into_iter().find(|(state, ..)| *state == end).unwrap();
            assert_eq!(word & mask, value, "statusword {word:04X} in {end:?}");
        }
    }
}

#[test]
fn fault_is_reset_by_a_rising_edge_only() {
    let mut bench = drive_in(PowerState::SwitchedOn);
    bench.must_write(0x6040, 0, 2, 0x80);
    bench.must_write(0x2002, 0, 2, 0x1000);
    bench.must_write(0x6040, 0, 2, 0x80);
    assert_eq!(bench.drive.power_state(), PowerState::Fault, "bit 7 was set all the time");
    bench.must_write(0x6040, 0, 2, 0x00);
    bench.sent.clear();
    bench.send(0x603, &[0x2B, 0x40, 0x60, 0, 0x80, 0, 0, 0]);
    assert_eq!(bench.drive.power_state(), PowerState::SwitchOnDisabled);
    assert_eq!(bench.take(0x083), [vec![0; 8]], "EMCY error reset");
}

#[test]
fn drive_without_a_mode_is_not_enabled() {
    let mut bench = drive_in(PowerState::SwitchedOn);
    bench.must_write(0x6060, 0, 1, 0);
    bench.must_write(0x6040, 0, 2, 0x0F);
    assert_eq!(bench.drive.power_state(), PowerState::SwitchedOn);
    bench.must_write(0x6060, 0, 1, 8);
    bench.must_write(0x6040, 0, 2, 0x0F);
    assert_eq!(bench.drive.power_state(), PowerState::OperationEnabled);
    assert_eq!(bench.write(0x6060, 0, 1, 0), 0x0800_0022, "mode taken from a drive in operation");
}

/// A drive at 1 rad/s, without a watchdog: what stops it is what the test does.
fn moving() -> Bench {
    let mut bench = enabled(DriveParameters { watchdog_ms: 0, ..parameters() });
    for tick in 0..400 {
        bench.cycle(0x0F, counts(START_RAD + f64::from(tick) * 1e-3));
    }
    assert!((bench.drive.velocity_rad_s() - 1.0).abs() < 0.05);
    bench
}

/// Goal: the option codes decide between coasting and a ramp, and where a stop ends.
#[test]
fn stops_end_in_the_state_and_with_the_ramp_of_their_option() {
    use PowerState::{
        Fault, FaultReactionActive, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled,
        SwitchedOn,
    };
    // Option object, its value, controlword (0 = a fault), state on the way, state at the end, ramp in ms or none.
    for (object, option, word, way, end, ramp_ms) in [
        (0x605A, 0, 0x02, SwitchOnDisabled, SwitchOnDisabled, None),
        (0x605A, 1, 0x02, QuickStopActive, SwitchOnDisabled, Some(67)),
        (0x605A, 2, 0x02, QuickStopActive, SwitchOnDisabled, Some(33)),
        (0x605A, 3, 0x02, QuickStopActive, SwitchOnDisabled, Some(8)),
        (0x605A, 5, 0x02, QuickStopActive, QuickStopActive, Some(67)),
        (0x605A, 6, 0x02, QuickStopActive, QuickStopActive, Some(33)),
        (0x605B, 0, 0x06, ReadyToSwitchOn, ReadyToSwitchOn, None),
        (0x605B, 1, 0x06, OperationEnabled, ReadyToSwitchOn, Some(67)),
        (0x605C, 0, 0x07, SwitchedOn, SwitchedOn, None),
        (0x605C, 1, 0x07, OperationEnabled, SwitchedOn, Some(67)),
        (0x605E, 0, 0x00, Fault, Fault, None),
        (0x605E, 1, 0x00, FaultReactionActive, Fault, Some(67)),
        (0x605E, 2, 0x00, FaultReactionActive, Fault, Some(33)),
    ] {
        let mut bench = moving();
        let case = format!("{object:04X} = {option}");
        bench.must_write(object, 0, 2, option);
        if word == 0 {
            bench.must_write(0x2002, 0, 2, 0x3210);
        } else {
            bench.must_write(0x6040, 0, 2, word);
        }
        assert_eq!(bench.drive.power_state(), way, "{case}");
        assert_eq!(bench.drive.statusword() & 0x1000, 0, "{case}: still follows");
        let mut slowing_ms = 0;
        while bench.drive.velocity_rad_s() > 0.1 && slowing_ms < 500 {
            bench.pass_ms(1);
            slowing_ms += 1;
        }
        if let Some(ramp_ms) = ramp_ms {
            // 90 % of the ramp, and a little for the loops to follow.
            assert!((ramp_ms * 7 / 10..=ramp_ms + 20).contains(&slowing_ms), "{case}: {slowing_ms} ms");
        }
        bench.pass_ms(700);
        assert_eq!(bench.drive.power_state(), end, "{case}");
        assert!(bench.drive.velocity_rad_s().abs() < 1e-3, "{case}: still moves");
    }
}

#[test]
fn halt_bit_stops_the_motor_and_lets_it_go_on() {
    let mut bench = moving();
    let target = counts(START_RAD + 0.6);
    for _ in 0..300 {
        bench.cycle(0x10F, target);
    }
    let at_rad = bench.drive.position_rad();
    assert!(at_rad < START_RAD + 0.5 && bench.drive.velocity_rad_s().abs() < 1e-3, "at {at_rad}");
    assert_eq!(bench.drive.statusword() & 0x1000, 0);
    for _ in 0..500 {
        bench.cycle(0x0F, target);
    }
    assert!((bench.drive.position_rad() - START_RAD - 0.6).abs() < 1e-3);
}

#[test]
fn warning_bit_is_shown_and_taken_back() {
    let mut bench = enabled(parameters());
    bench.drive.disturb(Disturbance::Warning(true), &mut Vec::new());
    assert_eq!(bench.drive.statusword() & 0x80, 0x80);
    bench.drive.disturb(Disturbance::Warning(false), &mut Vec::new());
    assert_eq!(bench.drive.statusword() & 0x80, 0);
}
