//! Recordings of buses whose setpoints take turns or share frames, converted into the plain ones that the checker compares.
//!
//! It shares no encoding with the product. What the bus did not carry because it was not a servo's turn is filled in from
//! the log, but only after the turns themselves were checked: each servo is sent a target in every so many cycles.
use crate::cycle_log::Event;
use crate::setpoints::{BusFrame, Encoding, Flaw};
use std::collections::BTreeMap;
use taustream_arm::Traffic;

/// CANopen SYNC.
const SYNC: u32 = 0x080;
/// RPDO1 of node 0.
const RPDO1: u32 = 0x200;
/// RPDO2 of node 0: the identifier of a shared frame is that of the first of its two nodes.
const RPDO2: u32 = 0x300;

/// The frames of one bus as if each setpoint had come in every cycle, in a frame of its own.
///
/// # Errors
/// When a servo waited longer than `setpoint_every` cycles for a target, or a shared frame has not its eight bytes.
pub fn as_plain(
    frames: Vec<BusFrame>,
    log: &[Event],
    bus: usize,
    encodings: &[Encoding],
    traffic: Traffic,
) -> Result<Vec<BusFrame>, Flaw> {
    if traffic.setpoint_every == 1 && !traffic.packed {
        return Ok(frames);
    }
    let wanted = wanted_by_sync(log, bus);
    let mut nodes: BTreeMap<u32, Node> =
        encodings.iter().map(|e| (u32::from(e.node_id), Node::default())).collect();
    let pairs: Vec<&[Encoding]> =
        if traffic.packed { encodings.chunks_exact(2).collect() } else { Vec::new() };
    let mut plain = Vec::with_capacity(frames.len());
    let mut sync = 0;
    for frame in frames {
        let own = frame.id.checked_sub(RPDO1).filter(|node| nodes.contains_key(node));
        let shared =
            pairs.iter().find(|pair| pair.iter().take(1).any(|e| RPDO2 + u32::from(e.node_id) == frame.id));
        match (own, shared) {
            _ if frame.id == SYNC => {
                fill(&mut plain, sync, &mut nodes, (&wanted, encodings), traffic)?;
                sync += 1;
                plain.push(frame);
            }
            // A controlword alone: what a shared frame's target belongs to.
            (Some(node), None) if frame.data.len() == 2 => {
                show(&mut nodes, node, |it| it.control = frame.data);
            }
            (Some(node), None) => {
                show(&mut nodes, node, |it| {
                    it.control = frame.data.iter().take(2).copied().collect();
                    it.is_sent = true;
                });
                plain.push(frame);
            }
            (None, Some(pair)) => {
                if frame.data.len() != 8 {
                    let what = format!("a shared setpoint frame of {} bytes", frame.data.len());
                    return Err(Flaw::Bus { sync, tick: 0, what });
                }
                for (encoding, target) in pair.iter().zip(frame.data.chunks_exact(4)) {
                    let node = u32::from(encoding.node_id);
                    show(&mut nodes, node, |it| it.is_sent = true);
                    let control = nodes.get(&node).map(|it| it.control.clone()).unwrap_or_default();
                    plain.push(BusFrame { id: RPDO1 + node, data: [&control, target].concat() });
                }
            }
            _ => plain.push(frame),
        }
    }
    fill(&mut plain, sync, &mut nodes, (&wanted, encodings), traffic)?;
    Ok(plain)
}

/// Logged setpoints by the number of the SYNC that they follow, with the cycle's number.
type Wanted = BTreeMap<u64, (u64, Vec<f64>)>;

/// What was received of a node.
#[derive(Clone, Debug, Default)]
struct Node {
    /// Newest controlword.
    control: Vec<u8>,
    /// It got a target in this cycle.
    is_sent: bool,
    /// Cycles since the last one.
    waited: u32,
}

fn show(nodes: &mut BTreeMap<u32, Node>, node: u32, change: impl FnOnce(&mut Node)) {
    if let Some(node) = nodes.get_mut(&node) {
        change(node);
    }
}

fn wanted_by_sync(log: &[Event], bus: usize) -> Wanted {
    let mut wanted = BTreeMap::new();
    for event in log {
        if let Event::Cycle(cycle) = event
            && let Some(sync) = cycle.sync.get(bus)
        {
            wanted.insert(*sync, (cycle.tick, cycle.position_rad.clone()));
        }
    }
    wanted
}

/// Ends a cycle: who has waited too long is a flaw, and who had no turn gets the frame that he did not need.
fn fill(
    plain: &mut Vec<BusFrame>,
    sync: u64,
    nodes: &mut BTreeMap<u32, Node>,
    (wanted, encodings): (&Wanted, &[Encoding]),
    traffic: Traffic,
) -> Result<(), Flaw> {
    let logged = wanted.get(&sync);
    for encoding in encodings {
        let id = u32::from(encoding.node_id);
        let Some(node) = nodes.get_mut(&id) else { continue };
        node.waited = if node.is_sent { 0 } else { node.waited + 1 };
        let is_sent = std::mem::take(&mut node.is_sent);
        // Only what the log claims is filled in; a cycle beyond it stays as it was seen.
        let Some((tick, position_rad)) = logged.filter(|_| !is_sent && !node.control.is_empty()) else {
            continue;
        };
        if node.waited >= traffic.setpoint_every {
            let what = format!("node {id} had no target for {} cycles", node.waited);
            return Err(Flaw::Bus { sync, tick: *tick, what });
        }
        let counts = encoding.counts(position_rad.get(encoding.joint).copied().unwrap_or(f64::NAN));
        let data = [node.control.as_slice(), &counts.to_le_bytes()].concat();
        plain.push(BusFrame { id: RPDO1 + id, data });
    }
    Ok(())
}
