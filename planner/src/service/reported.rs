//! What the requester of a motion gets beside the answer.
use crate::explain::Stage;
use crate::plan::path_length_rad;
use crate::verify::LeastDistance;
use std::cell::RefCell;
use taustream_messages::plan_detail::{Nearest, PlanDetail, PlanStep};
use taustream_motion::Trajectory;

/// Collected while a request is answered.
#[derive(Debug, Default)]
pub(super) struct Reported(RefCell<PlanDetail>);

impl Reported {
    /// Another request.
    pub(super) fn begin(&self) {
        self.0.replace(PlanDetail::default());
    }

    /// The stages of a plan, or of one that was not found.
    pub(super) fn stages(&self, stages: &[Stage]) {
        let steps = stages.iter().cloned();
        let steps = steps.map(|Stage { what, took_s, motion_s }| PlanStep { what, took_s, motion_s });
        self.0.borrow_mut().steps.extend(steps);
    }

    /// One step.
    pub(super) fn step(&self, what: String, took_s: f64, motion_s: Option<f64>) {
        self.0.borrow_mut().steps.push(PlanStep { what, took_s, motion_s });
    }

    /// The motion that goes to the streamer, from an instant on.
    pub(super) fn motion(&self, (trajectory, from_s): (&Trajectory, f64), least: LeastDistance) {
        let mut detail = self.0.borrow_mut();
        detail.path_length_rad = path_length_rad(trajectory, from_s);
        let LeastDistance { at_s, between: (a, b), required_m, clearance_m } = least;
        detail.nearest = clearance_m.is_finite().then_some(Nearest { at_s, required_m, between: [a, b] });
    }

    /// Everything.
    pub(super) fn detail(&self) -> PlanDetail {
        self.0.borrow().clone()
    }
}
