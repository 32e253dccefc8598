//! Events of a service: whoever sends a message notifies, and whoever waits for messages wakes up at once.
//!
//! An event carries nothing. It is only a reason to look earlier, so that a lost event, a flood of them, and a host on which
//! there are none cost time and nothing else: every wait ends by itself, and without a listener it is a short sleep.
use crate::service::{NODES_MAX, Wire};
use iceoryx2::port::{listener::Listener, notifier::Notifier};
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::event::PortFactory;
use std::thread;
use std::time::{Duration, Instant};

/// How often messages are looked for where there are no events.
const POLL: Duration = Duration::from_millis(2);
/// Two waits end at least this far apart: a flood of events occupies no processor.
const APART: Duration = Duration::from_micros(100);

/// Which messages an event is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Requests to the planner, and its answers.
    Plan,
    /// Trajectories to the streamer, and its receipts.
    Trajectory,
    /// Commands to the streamer, and its answers.
    Command,
}

impl Topic {
    const fn name(self) -> &'static str {
        match self {
            Self::Plan => "plan event",
            Self::Trajectory => "trajectory event",
            Self::Command => "command event",
        }
    }
}

/// One process's end of the events of a topic: it notifies the others, and waits for them.
#[derive(Debug)]
pub struct Events {
    notifier: Option<Notifier<ipc::Service>>,
    listener: Option<Listener<ipc::Service>>,
    woken: Option<Instant>,
}

impl Events {
    /// False where waits are short sleeps.
    #[must_use]
    pub fn are_there(&self) -> bool {
        self.notifier.is_some() && self.listener.is_some()
    }

    /// Wakes everybody who waits for messages of this topic. Never waits.
    pub fn notify(&self) {
        // Who is not reached looks by itself, a little later.
        let _not_reached = self.notifier.as_ref().map(Notifier::notify);
    }

    /// Waits until somebody notifies, `at_most` so long.
    pub fn wait(&mut self, at_most: Duration) {
        let Some(listener) = &self.listener else { return thread::sleep(at_most.min(POLL)) };
        if let Some(early) = self.woken.and_then(|woken| APART.checked_sub(woken.elapsed())) {
            thread::sleep(early);
        }
        if listener.timed_wait(|_| {}, at_most).is_err() {
            thread::sleep(at_most.min(POLL));
        }
        self.woken = Some(Instant::now());
    }
}

impl Wire {
    /// The events of a topic. Where they are not to be had, for instance because the path of the runtime directory is too long for
    /// a socket, waits are short sleeps.
    #[must_use]
    pub fn events(&self, topic: Topic) -> Events {
        let service = self.event_service(topic);
        let port = service.as_ref();
        Events {
            notifier: port.and_then(|service| service.notifier_builder().create().ok()),
            listener: port.and_then(|service| service.listener_builder().create().ok()),
            woken: None,
        }
    }

    fn event_service(&self, topic: Topic) -> Option<PortFactory<ipc::Service>> {
        let name = topic.name().try_into().ok()?;
        self.node()
            .service_builder(&name)
            .event()
            .max_notifiers(NODES_MAX)
            .max_listeners(NODES_MAX)
            .max_nodes(NODES_MAX)
            .event_id_max_value(0)
            .open_or_create()
            .ok()
    }
}
