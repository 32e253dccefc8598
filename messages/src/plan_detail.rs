//! What a planner says beside its answer: what it tried, and where the motion is nearest to something.
use crate::Text;
use iceoryx2::prelude::ZeroCopySend;

/// Most steps in a message; what was done after them is counted in the last.
pub const STEPS_MAX: usize = 16;

/// One step of planning.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanStep {
    /// What was tried, and what came of it.
    pub what: String,
    /// How long it took.
    pub took_s: f64,
    /// Duration of the best verified motion after it; `None` while there is none.
    pub motion_s: Option<f64>,
}

/// Where a motion is nearest to something.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// When, in trajectory time.
    pub at_s: f64,
    /// What the two must keep.
    pub required_m: f64,
    /// Link, and obstacle or link.
    pub between: [String; 2],
}

/// The detail of an answer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanDetail {
    /// Length of the path in joint space from where the motion begins to run, rad; 0 without a motion.
    pub path_length_rad: f64,
    /// Where it is nearest to something; `None` without a motion, or when nothing can collide.
    pub nearest: Option<Nearest>,
    /// What was done, in its order.
    pub steps: Vec<PlanStep>,
}

#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
struct WireStep {
    took_s: f64,
    /// Not finite without a motion.
    motion_s: f64,
    what: Text,
}

/// The same on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub(crate) struct WireDetail {
    path_length_rad: f64,
    at_s: f64,
    required_m: f64,
    has_nearest: u32,
    steps: u32,
    between: [Text; 2],
    step: [WireStep; STEPS_MAX],
}

impl Default for WireDetail {
    fn default() -> Self {
        Self::new(&PlanDetail::default())
    }
}

impl WireDetail {
    pub(crate) fn new(detail: &PlanDetail) -> Self {
        let nothing = WireStep { took_s: 0.0, motion_s: f64::INFINITY, what: Text::default() };
        let mut step = [nothing; STEPS_MAX];
        for (slot, PlanStep { what, took_s, motion_s }) in step.iter_mut().zip(&detail.steps) {
            let motion_s = motion_s.unwrap_or(f64::INFINITY);
            *slot = WireStep { took_s: *took_s, motion_s, what: Text::new(what) };
        }
        if let (Some(last), Some(more)) = (step.last_mut(), detail.steps.len().checked_sub(STEPS_MAX))
            && more > 0
        {
            let rest = detail.steps.iter().skip(STEPS_MAX - 1);
            last.took_s = rest.clone().map(|step| step.took_s).sum();
            last.motion_s = rest.filter_map(|step| step.motion_s).next_back().unwrap_or(f64::INFINITY);
            last.what = Text::new(&format!("{} more steps", more + 1));
        }
        let nearest = detail.nearest.as_ref();
        let name = |i: usize| nearest.and_then(|n| n.between.get(i)).map_or("", String::as_str);
        Self {
            path_length_rad: detail.path_length_rad,
            at_s: nearest.map_or(0.0, |n| n.at_s),
            required_m: nearest.map_or(0.0, |n| n.required_m),
            has_nearest: u32::from(nearest.is_some()),
            steps: u32::try_from(detail.steps.len().min(STEPS_MAX)).unwrap_or(0),
            between: [Text::new(name(0)), Text::new(name(1))],
            step,
        }
    }

    /// The detail; numbers that are not finite count as nothing, because the message may be hostile.
    pub(crate) fn read(&self) -> PlanDetail {
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        let count = usize::try_from(self.steps).unwrap_or(0);
        let step = |step: &WireStep| PlanStep {
            what: step.what.read(),
            took_s: finite(step.took_s),
            motion_s: Some(step.motion_s).filter(|s| s.is_finite()),
        };
        PlanDetail {
            path_length_rad: finite(self.path_length_rad),
            nearest: (self.has_nearest == 1).then(|| Nearest {
                at_s: finite(self.at_s),
                required_m: finite(self.required_m),
                between: self.between.map(|name| name.read()),
            }),
            steps: self.step.iter().take(count).map(step).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(i: usize) -> PlanStep {
        PlanStep { what: format!("step {i}"), took_s: 0.5, motion_s: (i > 3).then_some(i as f64) }
    }

    #[test]
    fn detail_comes_back_and_steps_beyond_the_message_are_counted() {
        let nearest =
            Nearest { at_s: 0.25, required_m: 0.02, between: ["link3".to_owned(), "shelf".to_owned()] };
        let mut detail =
            PlanDetail { path_length_rad: 2.5, nearest: Some(nearest), steps: (0..5).map(step).collect() };
        assert_eq!(WireDetail::new(&detail).read(), detail);
        assert_eq!(WireDetail::default().read(), PlanDetail::default());
        detail.steps = (0..20).map(step).collect();
        let steps = WireDetail::new(&detail).read().steps;
        assert_eq!((steps.len(), &steps[14]), (STEPS_MAX, &step(14)));
        let rest = PlanStep { what: "5 more steps".to_owned(), took_s: 2.5, motion_s: Some(19.0) };
        assert_eq!(steps.last(), Some(&rest));
    }

    #[test]
    fn hostile_numbers_are_nothing() {
        let hostile = WireDetail {
            path_length_rad: f64::NAN,
            steps: u32::MAX,
            has_nearest: 7,
            ..WireDetail::default()
        };
        let read = hostile.read();
        assert_eq!((read.path_length_rad.to_bits(), read.nearest, read.steps.len()), (0, None, STEPS_MAX));
    }
}
