//! A bus that fails: silent from then on, and brought back by command alone.
use crate::harness::CycleHarness;
use crate::{arrived, assert_on_path};
use taustream_drivers::{CanId, DriveState, DriveTarget, LinkFault};
use taustream_messages::{BusFault, Command, FaultReason, Phase};
use taustream_streamer::answer::AnswerReason;
use taustream_streamer::names::Names;

/// Plants a fault in a moving arm.
type Plant = fn(&mut CycleHarness);

/// What plants each fault.
const BUS_FAULTS: [(BusFault, Plant); 7] = [
    (BusFault::QueueFull, |harness| harness.script(|w| w.link_fault = Some(LinkFault::QueueFull))),
    (BusFault::System, |harness| harness.script(|w| w.link_fault = Some(LinkFault::Os(22)))),
    (BusFault::Down, |harness| harness.script(|w| w.link_fault = Some(LinkFault::Down))),
    (BusFault::Gone, |harness| harness.script(|w| w.link_fault = Some(LinkFault::Gone))),
    (BusFault::Unconfirmed, |harness| harness.script(|w| w.confirms = false)),
    (BusFault::BusOff, |harness| harness.script(|w| w.error_frame = Some(0x040))),
    (BusFault::Restarted, |harness| harness.script(|w| w.error_frame = Some(0x100))),
];

/// Removes the fault, as a repair of the bus does.
fn fix(harness: &CycleHarness) {
    harness.script(|w| (w.link_fault, w.error_frame, w.confirms) = (None, None, true));
}

/// Goal: whatever makes the bus fail, the arm's pose is the last that left, nothing leaves any more even when the bus is
/// well again, and the way back is clear-fault, enable, a new plan.
#[test]
fn bus_fault_of_any_kind_stops_sending_until_the_bus_is_restarted_on_command() {
    for (bus_fault, plant) in BUS_FAULTS {
        let mut harness = CycleHarness::new();
        let trajectory = harness.move_it();
        harness.run(600);
        plant(&mut harness);
        harness.run_until(Phase::Fault, 40);
        let cause = harness.cause().unwrap();
        assert_eq!((cause.reason, cause.bus), (FaultReason::BusFault, Some(0)), "{bus_fault:?}");
        assert_eq!(BusFault::from_code(cause.code), Some(bus_fault));
        let (held, frames) = (arrived(&harness), harness.world.lock().unwrap().frames);
        fix(&harness);
        harness.run(300);
        assert_eq!(harness.phase(), Phase::Fault, "{bus_fault:?}: it resumes by itself");
        assert_eq!(
            harness.world.lock().unwrap().frames,
            frames,
            "{bus_fault:?}: a frame left on the failed bus"
        );
        assert_eq!(arrived(&harness), held);
        assert_on_path(&harness, &trajectory);
        assert_eq!(harness.ask(Command::Disable).why, AnswerReason::Unreachable { bus: 0 });
        assert!(matches!(harness.ask(Command::Enable).why, AnswerReason::ClearFirst { .. }));

        assert!(
            harness.queue_request(Command::ClearFault).is_none(),
            "{bus_fault:?}: answered before the bus was there"
        );
        assert!(harness.restore_buses(), "{bus_fault:?}");
        let answer = harness.step_to_answer();
        assert!(answer.accepted && answer.why == AnswerReason::BusRestored, "{bus_fault:?}: {answer:?}");
        let started_over = harness.world.lock().unwrap().start_overs;
        assert_eq!(started_over, 1, "{bus_fault:?}: drives are not looked at anew");
        harness.run(100);
        assert_eq!(
            harness.world.lock().unwrap().drive_target,
            Some(DriveTarget::Disabled),
            "{bus_fault:?}: energised by itself"
        );
        assert!(
            matches!(harness.phase(), Phase::Configuring | Phase::Disabled),
            "{bus_fault:?}: {:?}",
            harness.phase()
        );
        harness.enable();
        harness.run(20);
        assert_eq!(harness.phase(), Phase::Holding, "{bus_fault:?}: the old motion went on");
        assert_eq!(arrived(&harness), held, "{bus_fault:?}: enabling moved the arm");
    }
}

/// Goal: a bus that is not fixed is not cleared; the answer has the reason, and the command may be repeated.
#[test]
fn bus_fault_whose_link_cannot_be_reopened_stays_and_can_be_asked_again() {
    let mut harness = CycleHarness::new();
    harness.enable();
    harness.script(|w| (w.link_fault, w.reopens) = (Some(LinkFault::Gone), false));
    harness.run_until(Phase::Fault, 20);
    for _ in 0..3 {
        assert!(harness.queue_request(Command::ClearFault).is_none());
        assert_eq!(
            harness.ask(Command::ClearFault).why,
            AnswerReason::Wait,
            "asked again while it is being reopened"
        );
        assert!(!harness.restore_buses());
        harness.run(5);
        assert_eq!(harness.phase(), Phase::Fault);
        assert!(
            harness.command_queue.commands.answer().is_none(),
            "the service thread has answered in the link's words"
        );
    }
    fix(&harness);
    harness.script(|w| w.reopens = true);
    assert!(harness.queue_request(Command::ClearFault).is_none());
    assert!(harness.restore_buses());
    assert!(harness.step_to_answer().accepted);
    harness.enable();
}

/// Goal: an arm that is off notices that its bus is lost, too, and needs the same way back; drives that are not powered
/// yet, and so take no frames, are waited for.
#[test]
fn bus_lost_while_disabled_is_a_fault_and_a_full_queue_is_not() {
    for fault in [LinkFault::Down, LinkFault::Gone] {
        let mut harness = CycleHarness::new();
        harness.run_until(Phase::Disabled, 60);
        harness.script(|w| w.link_fault = Some(fault));
        harness.run_until(Phase::Fault, 5);
        assert_eq!(harness.cause().unwrap().reason, FaultReason::BusFault, "{fault:?}");
        fix(&harness);
        assert!(harness.queue_request(Command::ClearFault).is_none());
        assert!(harness.restore_buses());
        assert!(harness.step_to_answer().accepted);
        harness.run_until(Phase::Disabled, 60);
    }
    let mut harness = CycleHarness::new();
    harness.run_until(Phase::Disabled, 60);
    harness.script(|w| (w.link_fault, w.confirms) = (Some(LinkFault::QueueFull), false));
    harness.run(200);
    assert_eq!(harness.cause(), None);
}

/// Goal: torque off is the one target that is sent on a failed bus, and does not bring setpoints back.
#[test]
fn torque_off_is_tried_on_a_failed_bus() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(300);
    harness.script(|w| w.error_frame = Some(0x040));
    harness.run_until(Phase::Fault, 40);
    fix(&harness);
    let (held, frames) = (arrived(&harness), harness.world.lock().unwrap().frames);
    harness.accept(Command::TorqueOff);
    harness.run(20);
    let world = harness.world.lock().unwrap();
    assert!(world.frames > frames, "nothing was tried");
    assert_eq!(world.drive_target, Some(DriveTarget::TorqueOff));
    assert_eq!(world.arrived.last().unwrap().1, held);
}

/// Goal: an error-passive controller still carries frames: the arm stops on its path and holds, and is not cleared before
/// the controller has recovered.
#[test]
fn controller_that_is_error_passive_stops_the_arm_on_the_path_and_holds() {
    let mut harness = CycleHarness::new();
    let trajectory = harness.move_it();
    harness.run(600);
    harness.script(|w| (w.error_frame, w.error_state) = (Some(0x004), 0x20));
    harness.run_until(Phase::FastStopping, 5);
    harness.run_until(Phase::Fault, 1_500);
    assert_on_path(&harness, &trajectory);
    assert_eq!(BusFault::from_code(harness.cause().unwrap().code), Some(BusFault::ErrorPassive));
    let before = harness.world.lock().unwrap().arrived.len();
    harness.script(|w| w.error_frame = None);
    harness.run(20);
    assert!(
        harness.world.lock().unwrap().arrived.len() >= before + 20,
        "the drives get no setpoints to hold by"
    );
    assert_eq!(harness.ask(Command::ClearFault).why, AnswerReason::BusPassive { bus: 0 });
    harness.script(|w| (w.error_frame, w.error_state) = (Some(0x004), 0x40));
    harness.run(1);
    harness.script(|w| w.error_frame = None);
    harness.accept(Command::ClearFault);
    assert_eq!(harness.phase(), Phase::Locked);
}

/// Goal: acknowledgements that come late, but come, are no fault; ones that stay away for half as long as feedback may,
/// 10 cycles here, are.
#[test]
fn frames_confirmed_late_but_within_tolerance_are_no_fault() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.run(300);
    for late in [9, 1, 9] {
        harness.script(|w| w.confirms = false);
        harness.run(late);
        harness.script(|w| w.confirms = true);
        harness.run(3);
    }
    assert_eq!((harness.phase(), harness.cause()), (Phase::Moving, None));
    harness.script(|w| w.confirms = false);
    harness.run(10);
    assert_eq!(harness.cause(), None);
    harness.run(2);
    assert_eq!(harness.cause().map(|c| c.code), Some(BusFault::Unconfirmed.code()));
}

/// Goal: another master that commands the drives, in motion or while they hold, stops the arm on its path and is named by
/// its frame; the fault comes back while it continues.
#[test]
fn another_master_in_operation_stops_the_arm_on_the_path_and_is_named() {
    for moving in [true, false] {
        let mut harness = CycleHarness::new();
        let trajectory = moving.then(|| harness.move_it());
        if !moving {
            harness.enable();
        }
        harness.run(300);
        harness.script(|w| w.other_master = Some(CanId::standard(0x203)));
        harness.run(1);
        let cause = harness.cause().unwrap();
        assert_eq!(BusFault::from_code(cause.code), Some(BusFault::OtherMaster));
        let sentence = Names::default().fault(&cause);
        assert!(sentence.contains("another master") && sentence.contains("0x203"), "{sentence}");
        harness.run_until(Phase::Fault, 1_500);
        if let Some(trajectory) = &trajectory {
            assert_on_path(&harness, trajectory);
        }
        harness.accept(Command::ClearFault);
        harness.run_until(Phase::Fault, 3);
        harness.script(|w| w.other_master = None);
        harness.accept(Command::ClearFault);
        harness.run(50);
        assert_eq!((harness.phase(), harness.cause()), (Phase::Locked, None));
    }
}

/// Goal: after the bus is back the drives are what they say they are: one that was found energised is no licence to move.
#[test]
fn drive_found_energised_after_a_bus_fault_is_reported_and_left_alone() {
    let mut harness = CycleHarness::new();
    harness.enable();
    harness.script(|w| w.link_fault = Some(LinkFault::Down));
    harness.run_until(Phase::Fault, 20);
    fix(&harness);
    assert!(harness.queue_request(Command::ClearFault).is_none());
    assert!(harness.restore_buses());
    harness.script(|w| w.forced[4] = Some(DriveState::EnergisedUnowned));
    assert!(harness.step_to_answer().accepted);
    harness.run(5);
    let cause = harness.cause().unwrap();
    assert_eq!(
        (harness.phase(), cause.reason, cause.joint),
        (Phase::Fault, FaultReason::EnergisedUnowned, Some(4))
    );
}

/// Goal: whoever floods the bus with error frames, the same or ever new ones, does not flood the log; and what does not
/// concern the course (overflow, warnings, a missing acknowledge) stops nothing.
#[test]
fn flood_of_error_frames_is_logged_a_few_times_a_second_and_stops_nothing() {
    let mut harness = CycleHarness::new();
    harness.move_it();
    harness.script(|w| (w.error_frame, w.error_state) = (Some(0x004), 0x01));
    harness.run(1_000);
    assert!((1..=2).contains(&harness.error_notes), "{} notes of the same in a second", harness.error_notes);
    harness.error_notes = 0;
    for round in 0..1_000_u32 {
        harness.script(|w| w.error_frame = Some([0x020, 0x008, 0x010][round as usize % 3]));
        harness.step_after(1);
    }
    assert!(
        (2..=11).contains(&harness.error_notes),
        "{} notes of different ones in a second",
        harness.error_notes
    );
    assert_eq!(harness.cause(), None);
}
