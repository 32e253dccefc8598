//! Own frames that do not come back: a bus that nobody acknowledges, or a computer that reads too slowly.
use crate::harness::CycleHarness;
use taustream_drivers::LinkFault;
use taustream_messages::{BusFault, Cause, Command, FaultReason, Phase};

fn bus_fault(cause: Option<Cause>) -> Option<BusFault> {
    cause.and_then(|cause| BusFault::from_code(cause.code))
}

/// Goal: own frames whose echo was lost, however many and whenever, never make a bus fail that carries frames. Lost are 448
/// during bring-up and 910 in motion, on interfaces with and without an echo of their own. The count is right again: the
/// fault that is planted then is found.
#[test]
fn echoes_lost_in_receiving_are_not_counted_and_later_ones_are_checked_as_before() {
    for from_wire in [false, true] {
        let mut harness = CycleHarness::new();
        harness.script(|w| w.from_wire = from_wire);
        harness.script(|w| w.confirms = false);
        harness.run(64);
        harness.script(|w| (w.confirms, w.echoes_lost) = (true, 448));
        harness.move_it();
        harness.run(100);
        for _ in 0..26 {
            for _ in 0..5 {
                harness.script(|w| (w.echoes_lost, w.overflowed) = (w.echoes_lost + 7, w.overflowed + 20));
                harness.run(1);
            }
            harness.run(30);
        }
        assert_eq!(harness.cause(), None, "from the wire: {from_wire}");
        harness.run(50);
        let report = harness.report.unwrap().buses[0];
        // Fewer than are sent in the time that they may take are not distinguished from those that are on their way.
        assert!(report.in_flight <= 70, "from the wire: {from_wire}, {} in flight", report.in_flight);
        assert_eq!(
            u64::from(report.in_flight) + report.echoes_missing,
            448 + 910,
            "from the wire: {from_wire}"
        );
        assert_eq!(report.receive_lost, 2_600, "from the wire: {from_wire}");
        if from_wire {
            harness.script(|w| w.confirms = false);
            harness.run(12);
            assert_eq!(bus_fault(harness.cause()), Some(BusFault::Unconfirmed));
        }
    }
}

/// Goal: echoes that were written off and come after all do not hide later ones that stay away.
#[test]
fn echoes_that_come_after_they_were_written_off_do_not_hide_a_bus_that_stops_acknowledging() {
    let mut harness = CycleHarness::new();
    harness.script(|w| w.from_wire = false);
    harness.move_it();
    harness.script(|w| w.confirms = false);
    harness.run(50);
    harness.script(|w| w.confirms = true);
    harness.run(1);
    assert_eq!((harness.cause(), harness.phase()), (None, Phase::Moving));
    harness.script(|w| (w.from_wire, w.confirms) = (true, false));
    harness.run(12);
    assert_eq!(bus_fault(harness.cause()), Some(BusFault::Unconfirmed));
}

/// Goal: a queue that drains too slowly is reported, though frames do come back all the while.
#[test]
fn frames_that_wait_in_the_interface_are_not_acknowledged_even_while_older_ones_come_back() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(100);
    harness.script(|w| w.queued = true);
    for _ in 0..40 {
        // One frame of a cycle's seven is on the wire in time.
        harness.script(|w| w.echoes_lost += 6);
        harness.run(1);
    }
    assert_eq!(bus_fault(harness.cause()), Some(BusFault::Unconfirmed));
}

/// Goal: feedback of every joint is late because this computer is behind: that is said, and neither a drive nor the bus is
/// blamed; the bus is not silent, and the arm stops on its path. A single silent drive is blamed all the same.
#[test]
fn feedback_late_from_all_joints_while_the_receive_path_is_behind_blames_this_computer() {
    type Plant = fn(&mut CycleHarness);
    let plants: [(Plant, bool); 3] = [
        (|harness| harness.script(|w| w.flooded = true), true),
        (|harness| harness.script(|w| (w.link_fault, w.link_takes, w.overflowed) = (None, 0, 9)), false),
        (|harness| harness.script(|w| (w.silent, w.overflowed) = (Some(2), 9)), false),
    ];
    for (row, (plant, computer)) in plants.into_iter().enumerate() {
        let mut harness = CycleHarness::new();
        harness.move_it();
        harness.run(300);
        plant(&mut harness);
        harness.run(40);
        let cause = harness.cause();
        if computer {
            assert_eq!(bus_fault(cause), Some(BusFault::ReceiveBehind), "row {row}: {cause:?}");
            harness.run_until(Phase::Fault, 1_500);
            assert_eq!(harness.report.unwrap().buses[0].silent, 0, "row {row}");
            harness.script(|w| w.flooded = false);
            harness.run(60);
            harness.accept(Command::ClearFault);
        } else if row == 2 {
            let found = cause.map(|c| (c.reason, c.joint));
            assert_eq!(found, Some((FaultReason::FeedbackLate, Some(2))), "row {row}");
        } else {
            assert_eq!(cause, None, "row {row}: frames were lost, and nothing was missed");
        }
    }
}

/// Goal: what was in flight when a link failed does not count against its successor.
#[test]
fn echoes_of_a_link_from_before_it_was_started_over_are_not_waited_for() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.script(|w| w.confirms = false);
    harness.run(5);
    harness.script(|w| w.link_fault = Some(LinkFault::Down));
    harness.run_until(Phase::Fault, 40);
    harness.script(|w| (w.link_fault, w.confirms) = (None, true));
    assert!(harness.queue_request(Command::ClearFault).is_none());
    assert!(harness.restore_buses());
    assert!(harness.step_to_answer().accepted);
    harness.enable();
    harness.run(100);
    assert_eq!((harness.cause(), harness.report.unwrap().buses[0].in_flight), (None, 0));
}
