//! Requests of targets on their way to the planner, and its answers.
use super::client::{Client, PLANNER};
use crate::failure::Failure;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::prelude::ipc;
use taustream_messages::clock::now_ns;
use taustream_messages::service::TargetClient;
use taustream_messages::target::{CheckedTargets, Target, TargetOutcome, TargetReply, TargetRequest};

/// Requests on their way at one time.
const PENDING_MAX: usize = 2;

type Pending = PendingResponse<ipc::Service, TargetRequest, (), TargetReply, ()>;

/// Sends targets and takes the answers.
pub(super) struct TargetPort<'a> {
    // Ports go before their node.
    pending: Vec<(u64, Pending)>,
    targets: TargetClient,
    client: &'a Client,
    joints: usize,
    valid_s: f64,
    sequence: u64,
}

impl<'a> TargetPort<'a> {
    /// `valid_s`: after this time a request moves the arm no more.
    pub(super) fn open(client: &'a Client, joints: usize, valid_s: f64) -> Result<Self, Failure> {
        Ok(Self {
            pending: Vec::new(),
            targets: client.wire().target_client()?,
            client,
            joints,
            valid_s,
            sequence: 0,
        })
    }

    /// False while as many requests as may be are not answered yet.
    pub(super) fn is_free(&self) -> bool {
        self.pending.len() < PENDING_MAX
    }

    /// True when every request has its answer.
    pub(super) fn is_idle(&self) -> bool {
        self.pending.is_empty()
    }

    /// Sends one target or a chunk.
    pub(super) fn send(&mut self, targets: Vec<Target>) -> Result<(), Failure> {
        self.sequence += 1;
        let (joints, sequence, sent_ns, valid_s) = (self.joints, self.sequence, now_ns(), self.valid_s);
        let request = TargetRequest::new(&CheckedTargets { joints, sequence, sent_ns, valid_s, targets });
        let pending =
            self.targets.send_copy(request).map_err(|e| self.client.refused("send a target", &e))?;
        if pending.number_of_server_connections() == 0 {
            return Err(self.client.wire().not_running(PLANNER).into());
        }
        self.pending.push((sequence, pending));
        Ok(())
    }

    /// The answers that have come, with the numbers of their requests.
    pub(super) fn answers(&mut self) -> Result<Vec<(u64, TargetOutcome)>, Failure> {
        let (mut answers, mut waiting) = (Vec::new(), Vec::new());
        for (sequence, pending) in std::mem::take(&mut self.pending) {
            // Asked first: an answer may come, and the request end, between the two.
            let is_served = pending.is_connected();
            let reply = pending.receive().map_err(|e| self.client.refused("receive an answer", &e))?;
            match reply.map(|reply| reply.payload().outcome()) {
                Some(outcome) => answers.push((sequence, outcome)),
                None if is_served => waiting.push((sequence, pending)),
                None => {
                    let reason = "the planner has ended without an answer; the arm comes to rest".to_owned();
                    answers.push((sequence, TargetOutcome::Refused { reason }));
                }
            }
        }
        self.pending = waiting;
        Ok(answers)
    }
}
