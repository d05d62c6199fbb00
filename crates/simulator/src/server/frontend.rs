//! What a run is to those that observe and control it, wherever its ticks come from: its keys, its publishers and its pace.

use bus::{Bus, BusError, Declared, Inbox, OnArrival, Query};
use protocol::keys::Keys;
use protocol::messages::ControlAnswer;
use protocol::{Message, RunName, decode, encode};

use super::event::ServerEvent;
use super::observers::Observers;
use super::pace::Pace;

/// The side of a server that speaks to the bus.
pub(super) struct Frontend {
    pub(super) run: RunName,
    pub(super) bus: Bus,
    pub(super) keys: Keys,
    pub(super) inbox: Inbox<ServerEvent>,
    pub(super) observers: Observers,
    pub(super) pace: Pace,
    /// The client that has stopped the run.
    pub(super) stopping: Option<Query>,
    declared: Vec<Declared>,
}

impl Frontend {
    pub(super) fn new(
        bus: Bus,
        run: RunName,
        speed: Option<f64>,
        is_paused: bool,
    ) -> Result<Self, BusError> {
        let keys = Keys::new(&run);
        // Only where the process stays connected while it works on the middleware's thread.
        let on_arrival = if bus::runtime::has_own_sender() {
            OnArrival::Work
        } else {
            OnArrival::Wake
        };

        Ok(Self {
            run,
            observers: Observers::new(&bus, &keys)?,
            bus,
            keys,
            inbox: Inbox::new(on_arrival),
            pace: Pace::new(speed, is_paused),
            stopping: None,
            declared: Vec::new(),
        })
    }

    /// A declaration that lasts as long as the session.
    pub(super) fn keep(&mut self, declared: Declared) {
        self.declared.push(declared);
    }

    /// Subscribes to what robots put on keys that name them.
    pub(super) fn subscribe<M: Message + 'static>(
        &self,
        keys: &str,
        event: fn(String, M) -> ServerEvent,
    ) -> Result<Declared, BusError> {
        let inbox = self.inbox.clone();
        self.bus.subscribe(keys, move |key, bytes| {
            let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
            // Decoded where it arrives. The state of the server is changed only by the thread that
            // works.
            inbox.send_and_work(match decode(key, &robot, bytes) {
                Ok(message) => event(robot, message),
                Err(error) => ServerEvent::Malformed(error),
            });
        })
    }

    /// Declares a queryable, which is answered by the server.
    pub(super) fn declare_queryable(
        &mut self,
        key: &str,
        event: impl Fn(Query) -> ServerEvent + Send + Sync + 'static,
    ) -> Result<(), BusError> {
        let inbox = self.inbox.clone();
        let queryable = self
            .bus
            .queryable(key, move |query| inbox.send(event(query)))?;
        self.keep(queryable);
        Ok(())
    }

    /// Declares where robots join and where control is answered, and then the simulator's token: when that is seen, everything
    /// declared before is in effect.
    pub(super) fn declare_simulator(&mut self) -> Result<(), BusError> {
        self.declare_queryable(&self.keys.join(), ServerEvent::Join)?;
        self.declare_queryable(&self.keys.joins(), ServerEvent::Join)?;
        self.declare_queryable(&self.keys.control(), ServerEvent::Control)?;
        // Last, for the same reason as a robot's token: a robot that sees it can ask at once.
        let token = self.bus.token(&self.keys.alive_sim())?;
        self.keep(token);
        Ok(())
    }

    /// Ends this side of the contract.
    pub(super) fn close(mut self) {
        self.declared.clear();
        self.bus.close();
    }
}

/// The answer to a request that is not done, for this reason.
pub(super) fn refused(explanation: String) -> ControlAnswer {
    ControlAnswer::Refused {
        explanation,
        fields: Vec::new(),
    }
}

/// Refuses a request with the reason.
pub(super) fn refuse(query: &Query, explanation: &str) {
    answer(query, &refused(explanation.to_owned()));
}

pub(super) fn answer(query: &Query, answer: &ControlAnswer) {
    query.reply(query.key(), encode(answer));
}
