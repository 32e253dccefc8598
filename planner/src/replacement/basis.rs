//! The strokes that a replacement may use, and what each of them adds to velocity, acceleration and jerk.
//!
//! Widths grow from the cut on and shrink towards the end: narrow strokes cancel what the kept ones do and end the motion
//! crisply, wide ones carry it. The spacing is a fixed part of the width, so that the ripple of the sum stays small.
use taustream_motion::Stroke;
use taustream_motion::stroke::{DURATION_S_MIN, Phi};

/// Exponent of the new strokes.
pub(super) const EXPONENT: u32 = 10;
/// Strokes that start within the width of one.
const PER_KERNEL: f64 = 12.0;
/// How much wider strokes may be for each second from either end (1).
const GROWTH: f64 = 0.6;
/// Instants a spacing at which weights are fitted; a stroke starts at every second of them.
const INSTANTS: u32 = 2;
/// Instants that are checked for each of these.
const CHECKED: u32 = 6;
/// Dropped strokes are continued that start within this part of the first one's width ..
const CONTINUED: f64 = 1.0;
/// .. unless fewer than this start within the width of one; of more than `DENSE` some are left out.
const SPARSE: f64 = 9.0;
/// See `SPARSE`.
const DENSE: f64 = 18.0;
/// More strokes than this are never useful.
const STROKES_MAX: usize = 256;

/// Widths of the strokes of a motion of a certain duration (s).
#[derive(Clone, Copy, Debug)]
pub(super) struct Widths {
    /// When the last stroke ends, after the cut.
    pub duration_s: f64,
    /// Of the first stroke.
    pub first_s: f64,
    /// Of the widest strokes.
    pub middle_s: f64,
    /// Of the last stroke.
    pub last_s: f64,
}

/// One stroke, after the cut (s).
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub start_s: f64,
    pub width_s: f64,
    /// Exponent.
    pub n: u32,
}

impl Slot {
    fn end_s(self) -> f64 {
        self.start_s + self.width_s
    }
}

/// The dropped strokes whose places the new ones take at first, so that whatever pattern the kept ones are a part of can be
/// completed: those that start within the width of the first. Nothing when they are too far apart for that.
pub(super) fn continued(dropped: &[Stroke], cut_s: f64, duration_s: f64) -> Vec<Slot> {
    let mut slots: Vec<Slot> = Vec::new();
    let window_s = dropped.first().map_or(0.0, |first| CONTINUED * first.duration_s);
    for stroke in dropped.iter().take_while(|stroke| stroke.start_s - cut_s < window_s) {
        let slot = Slot { start_s: stroke.start_s - cut_s, width_s: stroke.duration_s, n: stroke.n };
        let before = slots.last().copied().unwrap_or(Slot { start_s: 0.0, width_s: 0.0, n: 0 });
        let too_late = slot.end_s() > duration_s || slots.len() >= STROKES_MAX;
        if too_late || slot.start_s - before.start_s > slot.width_s / SPARSE {
            break;
        }
        // Two at once are one; ends have to rise.
        if slots.is_empty()
            || (slot.start_s > before.start_s + slot.width_s / DENSE && slot.end_s() > before.end_s())
        {
            slots.push(slot);
        }
    }
    slots
}

/// Continues slots for these widths up to the end of the motion: starts and ends rise. Nothing when there would be too many.
pub(super) fn slots(mut slots: Vec<Slot>, widths: &Widths) -> Option<Vec<Slot>> {
    let continued = slots.len();
    let (from_s, from_width_s) =
        slots.last().map_or((0.0, widths.first_s), |last| (last.start_s, last.width_s));
    let mut start_s = slots.last().map_or(0.0, |last| last.start_s + last.width_s / PER_KERNEL);
    let mut end_s = slots.last().map_or(0.0, |last| last.end_s());
    loop {
        let rising = from_width_s + GROWTH * (start_s - from_s);
        // A stroke ends before the end of the motion, and its width counts from there.
        let falling = (widths.last_s + GROWTH * (widths.duration_s - start_s)) / (1.0 + GROWTH);
        let width_s = rising.min(falling).min(widths.middle_s).max((end_s - start_s) * (1.0 + 1e-6));
        if start_s + width_s > widths.duration_s * (1.0 + 1e-12) {
            break;
        }
        if slots.len() >= STROKES_MAX {
            return None;
        }
        slots.push(Slot { start_s, width_s, n: EXPONENT });
        end_s = start_s + width_s;
        start_s += width_s / PER_KERNEL;
    }
    // The last stroke ends with the motion: those that do not continue are stretched a little.
    let stretch = (widths.duration_s - from_s) / (slots.last()?.end_s() - from_s);
    for slot in slots.iter_mut().skip(continued) {
        slot.start_s = from_s + (slot.start_s - from_s) * stretch;
        slot.width_s = (slot.width_s * stretch).max(DURATION_S_MIN);
    }
    Some(slots)
}

/// Instants after the cut, and what a stroke adds to velocity, acceleration and jerk at each of them.
pub(super) struct Instants {
    pub times_s: Vec<f64>,
    /// Index of the first stroke that runs at an instant, and of its first share. One more than there are instants.
    running: Vec<(usize, usize)>,
    /// For each radian of the stroke.
    shares: Vec<[f64; 3]>,
    /// Of instants that are checked: the last fitted one that is not later.
    pub nearest: Vec<usize>,
    /// Most strokes that run at once.
    pub most_running: usize,
}

impl Instants {
    /// The instants at which weights are fitted.
    pub(super) fn fitted(slots: &[Slot]) -> Self {
        let mut times_s = Vec::new();
        if let Some(first) = slots.first().filter(|first| first.start_s > 0.0) {
            divide(&mut times_s, 0.0, first.start_s, INSTANTS);
        }
        for pair in slots.windows(2) {
            if let [a, b] = pair {
                divide(&mut times_s, a.start_s, b.start_s, INSTANTS);
            }
        }
        if let Some(last) = slots.last() {
            // PER_KERNEL spacings.
            divide(&mut times_s, last.start_s, last.end_s(), 12 * INSTANTS);
        }
        Self::new(slots, times_s)
    }

    /// These instants, and more between them: [`CHECKED`] for each, and twice as many until `fine_until_s`.
    pub(super) fn checked(&self, slots: &[Slot], end_s: f64, fine_until_s: f64) -> Self {
        let (mut times_s, mut nearest) = (Vec::new(), Vec::new());
        let next_s = self.times_s.iter().skip(1).chain(std::iter::once(&end_s));
        for (instant, (from_s, to_s)) in self.times_s.iter().zip(next_s).enumerate() {
            let parts = if *from_s < fine_until_s { 2 * CHECKED } else { CHECKED };
            divide(&mut times_s, *from_s, *to_s, parts);
            nearest.extend((0..parts).map(|_| instant));
        }
        Self { nearest, ..Self::new(slots, times_s) }
    }

    fn new(slots: &[Slot], times_s: Vec<f64>) -> Self {
        let mut running = Vec::with_capacity(times_s.len() + 1);
        let mut shares: Vec<[f64; 3]> = Vec::new();
        let mut most_running = 0;
        let mut first = 0;
        for t_s in &times_s {
            while slots.get(first).is_some_and(|slot| slot.end_s() <= *t_s) {
                first += 1;
            }
            running.push((first, shares.len()));
            for slot in slots.iter().skip(first).take_while(|slot| slot.start_s < *t_s) {
                let rate = 1.0 / slot.width_s;
                let phi = Phi::at(slot.n, ((t_s - slot.start_s) * rate).min(1.0));
                shares.push([phi.d1 * rate, phi.d2 * rate * rate, phi.d3 * rate * rate * rate]);
            }
            most_running = most_running.max(shares.len() - running[running.len() - 1].1);
        }
        running.push((0, shares.len()));
        Self { times_s, running, shares, nearest: Vec::new(), most_running }
    }

    /// Index of the first stroke that runs at an instant, and the shares of those that run.
    #[inline(always)]
    pub(super) fn shares(&self, instant: usize) -> (usize, &[[f64; 3]]) {
        let (first, from) = self.running[instant];
        let (_, to) = self.running[instant + 1];
        (first, &self.shares[from..to])
    }
}

fn divide(times_s: &mut Vec<f64>, from_s: f64, to_s: f64, parts: u32) {
    let step_s = (to_s - from_s) / f64::from(parts);
    times_s.extend((0..parts).map(|part| from_s + f64::from(part) * step_s));
}
