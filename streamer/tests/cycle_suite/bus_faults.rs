//! A bus that fails: silent from then on, and brought back by command alone.
use crate::rig::Rig;
use crate::{arrived, assert_on_path};
use taustream_drivers::{DriveState, DriveWish, LinkFault};
use taustream_messages::{BusTrouble, Command, FaultReason, Phase};
use taustream_streamer::words::Why;

/// Plants a trouble in a moving arm.
type Plant = fn(&mut Rig);

/// What plants each trouble.
const TROUBLES: [(BusTrouble, Plant); 7] = [
    (BusTrouble::QueueFull, |rig| rig.script(|w| w.link_fault = Some(LinkFault::QueueFull))),
    (BusTrouble::System, |rig| rig.script(|w| w.link_fault = Some(LinkFault::Os(22)))),
    (BusTrouble::Down, |rig| rig.script(|w| w.link_fault = Some(LinkFault::Down))),
    (BusTrouble::Gone, |rig| rig.script(|w| w.link_fault = Some(LinkFault::Gone))),
    (BusTrouble::Unconfirmed, |rig| rig.script(|w| w.confirms = false)),
    (BusTrouble::BusOff, |rig| rig.script(|w| w.error_frame = Some(0x040))),
    (BusTrouble::Restarted, |rig| rig.script(|w| w.error_frame = Some(0x100))),
];

/// Takes the trouble away, as whoever mends the bus does.
fn mend(rig: &Rig) {
    rig.script(|w| (w.link_fault, w.error_frame, w.confirms) = (None, None, true));
}

/// Goal: whatever makes the bus fail, the arm's pose is the last that left, nothing leaves any more even when the bus is
/// well again, and the way back is clear-fault, enable, a new plan.
#[test]
fn bus_fault_of_any_kind_silences_the_bus_until_it_is_started_over_on_command() {
    for (trouble, plant) in TROUBLES {
        let mut rig = Rig::new();
        let trajectory = rig.move_it();
        rig.run(600);
        plant(&mut rig);
        rig.run_until(Phase::Fault, 40);
        let cause = rig.cause().unwrap();
        assert_eq!((cause.reason, cause.bus), (FaultReason::BusFault, Some(0)), "{trouble:?}");
        assert_eq!(BusTrouble::from_code(cause.code), Some(trouble));
        let (held, frames) = (arrived(&rig), rig.world.lock().unwrap().frames);
        mend(&rig);
        rig.run(300);
        assert_eq!(rig.phase(), Phase::Fault, "{trouble:?}: it resumes by itself");
        assert_eq!(rig.world.lock().unwrap().frames, frames, "{trouble:?}: a frame left on the failed bus");
        assert_eq!(arrived(&rig), held);
        assert_on_path(&rig, &trajectory);
        assert_eq!(rig.ask(Command::Disable).why, Why::OutOfReach { bus: 0 });
        assert_eq!(rig.ask(Command::Enable).why, Why::ClearFirst);

        assert!(
            rig.ask_for_later(Command::ClearFault).is_none(),
            "{trouble:?}: answered before the bus was there"
        );
        assert!(rig.restore_buses(), "{trouble:?}");
        let answer = rig.step_to_answer();
        assert!(answer.accepted && answer.why == Why::BusRestored, "{trouble:?}: {answer:?}");
        let started_over = rig.world.lock().unwrap().start_overs;
        assert_eq!(started_over, 1, "{trouble:?}: drives are not looked at anew");
        rig.run(100);
        assert_eq!(
            rig.world.lock().unwrap().wish,
            Some(DriveWish::Disabled),
            "{trouble:?}: energised by itself"
        );
        assert!(
            matches!(rig.phase(), Phase::Configuring | Phase::Disabled),
            "{trouble:?}: {:?}",
            rig.phase()
        );
        rig.enable();
        rig.run(20);
        assert_eq!(rig.phase(), Phase::Holding, "{trouble:?}: the old motion went on");
        assert_eq!(arrived(&rig), held, "{trouble:?}: enabling moved the arm");
    }
}

/// Goal: a bus that is not mended is not cleared; the asker hears why from the link, and may ask again.
#[test]
fn bus_fault_whose_link_cannot_be_reopened_stays_and_can_be_asked_again() {
    let mut rig = Rig::new();
    rig.enable();
    rig.script(|w| (w.link_fault, w.reopens) = (Some(LinkFault::Gone), false));
    rig.run_until(Phase::Fault, 20);
    for _ in 0..3 {
        assert!(rig.ask_for_later(Command::ClearFault).is_none());
        assert_eq!(rig.ask(Command::ClearFault).why, Why::Wait, "asked again while it is being reopened");
        assert!(!rig.restore_buses());
        rig.run(5);
        assert_eq!(rig.phase(), Phase::Fault);
        assert!(rig.desk.answer().is_none(), "the service thread has answered in the link's words");
    }
    mend(&rig);
    rig.script(|w| w.reopens = true);
    assert!(rig.ask_for_later(Command::ClearFault).is_none());
    assert!(rig.restore_buses());
    assert!(rig.step_to_answer().accepted);
    rig.enable();
}

/// Goal: an arm that is off notices that its bus is lost, too, and needs the same way back; drives that are not powered
/// yet, and so take no frames, are waited for.
#[test]
fn bus_lost_while_disabled_is_a_fault_and_a_full_queue_is_not() {
    for fault in [LinkFault::Down, LinkFault::Gone] {
        let mut rig = Rig::new();
        rig.run_until(Phase::Disabled, 60);
        rig.script(|w| w.link_fault = Some(fault));
        rig.run_until(Phase::Fault, 5);
        assert_eq!(rig.cause().unwrap().reason, FaultReason::BusFault, "{fault:?}");
        mend(&rig);
        assert!(rig.ask_for_later(Command::ClearFault).is_none());
        assert!(rig.restore_buses());
        assert!(rig.step_to_answer().accepted);
        rig.run_until(Phase::Disabled, 60);
    }
    let mut rig = Rig::new();
    rig.run_until(Phase::Disabled, 60);
    rig.script(|w| (w.link_fault, w.confirms) = (Some(LinkFault::QueueFull), false));
    rig.run(200);
    assert_eq!(rig.cause(), None);
}

/// Goal: torque off is the one wish that is tried on a failed bus, and does not bring setpoints back.
#[test]
fn torque_off_is_tried_on_a_failed_bus() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(300);
    rig.script(|w| w.error_frame = Some(0x040));
    rig.run_until(Phase::Fault, 40);
    mend(&rig);
    let (held, frames) = (arrived(&rig), rig.world.lock().unwrap().frames);
    rig.accept(Command::TorqueOff);
    rig.run(20);
    let world = rig.world.lock().unwrap();
    assert!(world.frames > frames, "nothing was tried");
    assert_eq!(world.wish, Some(DriveWish::TorqueOff));
    assert_eq!(world.arrived.last().unwrap().1, held);
}

/// Goal: an error-passive controller still carries frames: the arm stops on its path and holds, and is not cleared before
/// the controller has recovered.
#[test]
fn controller_that_is_error_passive_stops_the_arm_on_the_path_and_holds() {
    let mut rig = Rig::new();
    let trajectory = rig.move_it();
    rig.run(600);
    rig.script(|w| (w.error_frame, w.error_state) = (Some(0x004), 0x20));
    rig.run_until(Phase::FastStopping, 5);
    rig.run_until(Phase::Fault, 1_500);
    assert_on_path(&rig, &trajectory);
    assert_eq!(BusTrouble::from_code(rig.cause().unwrap().code), Some(BusTrouble::ErrorPassive));
    let before = rig.world.lock().unwrap().arrived.len();
    rig.script(|w| w.error_frame = None);
    rig.run(20);
    assert!(rig.world.lock().unwrap().arrived.len() >= before + 20, "the drives get no setpoints to hold by");
    assert_eq!(rig.ask(Command::ClearFault).why, Why::BusPassive { bus: 0 });
    rig.script(|w| (w.error_frame, w.error_state) = (Some(0x004), 0x40));
    rig.run(1);
    rig.script(|w| w.error_frame = None);
    rig.accept(Command::ClearFault);
    assert_eq!(rig.phase(), Phase::Locked);
}

/// Goal: acknowledgements that come late, but come, are no fault; ones that stay away for half as long as feedback may,
/// 10 cycles here, are.
#[test]
fn frames_confirmed_late_but_within_tolerance_are_no_fault() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.run(300);
    for late in [9, 1, 9] {
        rig.script(|w| w.confirms = false);
        rig.run(late);
        rig.script(|w| w.confirms = true);
        rig.run(3);
    }
    assert_eq!((rig.phase(), rig.cause()), (Phase::Moving, None));
    rig.script(|w| w.confirms = false);
    rig.run(10);
    assert_eq!(rig.cause(), None);
    rig.run(2);
    assert_eq!(rig.cause().map(|c| c.code), Some(BusTrouble::Unconfirmed.code()));
}

/// Goal: after the bus is back the drives are what they say they are: one that was found energised is no licence to move.
#[test]
fn drive_found_energised_after_a_bus_fault_is_reported_and_left_alone() {
    let mut rig = Rig::new();
    rig.enable();
    rig.script(|w| w.link_fault = Some(LinkFault::Down));
    rig.run_until(Phase::Fault, 20);
    mend(&rig);
    assert!(rig.ask_for_later(Command::ClearFault).is_none());
    assert!(rig.restore_buses());
    rig.script(|w| w.forced[4] = Some(DriveState::EnergisedUnowned));
    assert!(rig.step_to_answer().accepted);
    rig.run(5);
    let cause = rig.cause().unwrap();
    assert_eq!(
        (rig.phase(), cause.reason, cause.joint),
        (Phase::Fault, FaultReason::EnergisedUnowned, Some(4))
    );
}

/// Goal: whoever floods the bus with error frames, the same or ever new ones, does not flood the log; and what does not
/// concern the course (overflow, warnings, a missing acknowledge) stops nobody.
#[test]
fn flood_of_error_frames_is_told_a_few_times_a_second_and_stops_nobody() {
    let mut rig = Rig::new();
    rig.move_it();
    rig.script(|w| (w.error_frame, w.error_state) = (Some(0x004), 0x01));
    rig.run(1_000);
    assert!((1..=2).contains(&rig.error_notes), "{} notes of the same in a second", rig.error_notes);
    rig.error_notes = 0;
    for round in 0..1_000_u32 {
        rig.script(|w| w.error_frame = Some([0x020, 0x008, 0x010][round as usize % 3]));
        rig.step_after(1);
    }
    assert!((2..=11).contains(&rig.error_notes), "{} notes of different ones in a second", rig.error_notes);
    assert_eq!(rig.cause(), None);
}
