//! What one bus carried, cycle by cycle, and how much of it the log has claimed.
use crate::cycle_log::LoggedCycle;
use crate::setpoints::{BusFrame, Encoding, Flaw, may_be_off, target};

/// CANopen SYNC.
const SYNC: u32 = 0x080;
/// RPDO1 of node 0.
const RPDO1: u32 = 0x200;

/// One setpoint: node and data.
type Setpoint = (u8, Vec<u8>);

/// The setpoints of one bus behind each SYNC.
pub(crate) struct Carried<'a> {
    bus: usize,
    encodings: &'a [Encoding],
    cycles: Vec<Vec<Setpoint>>,
    claimed: Vec<bool>,
    /// SYNCs that the log claims and the recording lacks.
    missing: u64,
}

impl<'a> Carried<'a> {
    pub(crate) fn new(frames: &[BusFrame], bus: usize, encodings: &'a [Encoding]) -> Self {
        let cycles = split_at_syncs(frames, encodings);
        Self { bus, encodings, claimed: vec![false; cycles.len()], cycles, missing: 0 }
    }

    pub(crate) fn syncs(&self) -> usize {
        self.cycles.len()
    }

    /// Takes a cycle that left no trace: the next one stands in its place. No setpoint of it was compared.
    pub(crate) fn pass_over(&mut self) -> usize {
        self.missing += 1;
        0
    }

    /// Compares a cycle whose frames are all there; how many setpoints it had.
    pub(crate) fn compare_whole(&mut self, cycle: &LoggedCycle) -> Result<usize, Flaw> {
        let flaw = self.flaw_in(cycle);
        let encodings = self.encodings;
        let sent = self.claim(cycle)?;
        // Only in a fault may a drive that dropped out go without a setpoint.
        let may_miss = cycle.phase == "fault" && sent.len() < encodings.len();
        if sent.len() != encodings.len() && !may_miss {
            return Err(flaw(format!("{} setpoint frames for {} servos", sent.len(), encodings.len())));
        }
        for encoding in encodings {
            let node = encoding.node_id;
            if may_miss && sent.iter().all(|(n, _)| *n != node) {
                continue;
            }
            let mut of_node = sent.iter().filter(|(n, _)| *n == node);
            let (Some((_, data)), None) = (of_node.next(), of_node.next()) else {
                return Err(flaw(format!("node {node} has not exactly one setpoint frame")));
            };
            // A drive that is not commanded to follow gets its own position as target; that is right only outside of motion.
            if !follows_target(data) && may_be_off(&cycle.phase) {
                continue;
            }
            if !follows_target(data) {
                return Err(flaw(format!("node {node} is not commanded to follow while {}", cycle.phase)));
            }
            let got = target(data).ok_or_else(|| flaw(format!("node {node} got {} bytes", data.len())))?;
            let requested = cycle.position_rad.get(encoding.joint).copied();
            let requested =
                requested.ok_or_else(|| flaw(format!("no setpoint of joint {}", encoding.joint + 1)))?;
            let want = encoding.counts(requested);
            if got != want {
                return Err(flaw(format!("node {node} got target {got}, {requested} rad encodes to {want}")));
            }
        }
        Ok(sent.len())
    }

    /// Compares what is left of a cycle that was lost in part: its SYNC, if that left, and the setpoints behind it.
    pub(crate) fn compare_rest(&mut self, cycle: &LoggedCycle) -> Result<usize, Flaw> {
        let flaw = self.flaw_in(cycle);
        let encodings = self.encodings;
        let sent = self.claim(cycle)?;
        for (node, data) in sent.iter().filter(|(_, data)| follows_target(data)) {
            let encoding = encodings.iter().find(|e| e.node_id == *node);
            let requested = encoding.and_then(|e| Some(e.counts(*cycle.position_rad.get(e.joint)?)));
            if target(data) != requested {
                return Err(flaw(format!(
                    "node {node} got target {:?}, the setpoint encodes to {requested:?}",
                    target(data)
                )));
            }
        }
        Ok(sent.len())
    }

    /// Setpoints to follow that no cycle has claimed are a flaw.
    pub(crate) fn nothing_else(&self) -> Result<(), Flaw> {
        let is_live = |cycle: &[Setpoint]| cycle.iter().any(|(_, data)| follows_target(data));
        let mut cycles = self.cycles.iter().zip(&self.claimed);
        match cycles.position(|(cycle, claimed)| !claimed && is_live(cycle)) {
            None => Ok(()),
            Some(at) => {
                Err(Flaw::Log(format!("SYNC {} carried setpoints that the log does not know", at + 1)))
            }
        }
    }

    /// The setpoints that followed a cycle's SYNC; from now on they count as claimed.
    fn claim(&mut self, cycle: &LoggedCycle) -> Result<&[Setpoint], Flaw> {
        let sync = cycle.sync.get(self.bus).copied().unwrap_or(0);
        let at = sync.checked_sub(self.missing + 1).and_then(|at| usize::try_from(at).ok());
        let slot = at.and_then(|at| self.cycles.get(at).zip(self.claimed.get_mut(at)));
        let Some((sent, claimed)) = slot else {
            return Err(self.flaw_in(cycle)("is not on the bus".into()));
        };
        *claimed = true;
        Ok(sent)
    }

    fn flaw_in(&self, cycle: &LoggedCycle) -> impl Fn(String) -> Flaw + use<> {
        let (sync, tick) = (cycle.sync.get(self.bus).copied().unwrap_or(0), cycle.tick);
        move |what| Flaw::Bus { sync, tick, what }
    }
}

/// For each SYNC on the bus, the RPDO1 frames that came before the next one: (node id, data).
fn split_at_syncs(frames: &[BusFrame], encodings: &[Encoding]) -> Vec<Vec<Setpoint>> {
    let mut cycles: Vec<Vec<Setpoint>> = Vec::new();
    for frame in frames {
        if frame.id == SYNC {
            cycles.push(Vec::new());
            continue;
        }
        let node = encodings.iter().find(|e| RPDO1 + u32::from(e.node_id) == frame.id);
        if let (Some(encoding), Some(cycle)) = (node, cycles.last_mut()) {
            cycle.push((encoding.node_id, frame.data.clone()));
        }
    }
    cycles
}

/// The drive is commanded to follow: bit 3 of the controlword (CiA 402, "enable operation").
fn follows_target(data: &[u8]) -> bool {
    data.first().is_some_and(|low| low & 0x08 != 0)
}
