//! The launcher as an observer of the run: it subscribes like any observer and takes no part in ticks.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use bus::{Bus, BusError, Declared, Role};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer, FaultOrder, LogRecord, Phase, WorldFrame};
use protocol::{RunName, decode, encode};
use tokio::sync::mpsc::UnboundedSender;

use super::bar::Progress;
use super::screen::ScreenHandle;
use super::supervise::{FaultsDone, SupervisorEvent};

/// How long to try to reach the simulator; as long as robots do.
const PATIENCE: Duration = Duration::from_secs(20);
/// How long to wait before reporting robots that have not joined.
const GATHERING: Duration = Duration::from_secs(1);

/// What to observe, and where to report it.
pub(super) struct Watch {
    pub(super) run: RunName,
    pub(super) endpoint: String,
    /// The operator's configuration file for a secured run.
    pub(super) config: Option<PathBuf>,
    /// Whether to subscribe to frames, for the progress bar.
    pub(super) wants_world: bool,
    pub(super) screen: ScreenHandle,
    /// The supervisor's queue, for faults of processes: those of the scenario, and those that a person wants.
    pub(super) faults: UnboundedSender<SupervisorEvent>,
}

/// A running observer.
pub(super) struct Observer {
    /// Closed when the simulator's token is undeclared, or the observer could not connect.
    ended: Receiver<()>,
}

impl Observer {
    /// Starts to observe as soon as the simulator is reached. Connecting blocks, so it happens on a thread of its own,
    /// which ends with the process.
    pub(super) fn start(watch: Watch) -> Self {
        let (end, ended) = std::sync::mpsc::channel();
        std::thread::spawn(move || match watch.open(end) {
            Ok(_watching) => loop {
                std::thread::park();
            },
            Err(error) => watch
                .screen
                .notice(format!("the run cannot be observed: {error}")),
        });

        Self { ended }
    }

    /// Waits a short time until everything that the simulator has put is shown.
    pub(super) fn finish(&self) {
        let _in_time = self.ended.recv_timeout(Duration::from_millis(500));
    }
}

impl Watch {
    fn open(&self, end: Sender<()>) -> Result<(Bus, Vec<Declared>), BusError> {
        let role = Role::Client {
            connect: self.endpoint.clone(),
            patience: PATIENCE,
        };
        let bus = Bus::open(&role, self.config.as_ref())?;
        let keys = Keys::new(&self.run);
        let mut declared = vec![self.subscribe_log(&bus, &keys)?];
        if self.wants_world {
            declared.push(self.subscribe_world(&bus, &keys)?);
        }
        declared.push(subscribe_faults(&bus, &keys, self.faults.clone())?);
        declared.push(watch_token(&bus, &keys, end)?);

        if self.wants_world {
            self.catch_up(&bus, &keys)?;
        }
        Ok((bus, declared))
    }

    fn subscribe_log(&self, bus: &Bus, keys: &Keys) -> Result<Declared, BusError> {
        let screen = self.screen.clone();
        bus.subscribe(&keys.log(), move |key, bytes| {
            match decode::<LogRecord>(key, "the simulator", bytes) {
                Ok(record) => screen.log(record),
                Err(error) => tracing::warn!("{error}"),
            }
        })
    }

    fn subscribe_world(&self, bus: &Bus, keys: &Keys) -> Result<Declared, BusError> {
        let screen = self.screen.clone();
        bus.subscribe(&keys.world(), move |key, bytes| {
            match decode::<WorldFrame>(key, "the simulator", bytes) {
                Ok(frame) => screen.progress(Progress::from(frame)),
                Err(error) => tracing::warn!("{error}"),
            }
        })
    }

    /// Gets the status, because frames put before this observer subscribed do not arrive.
    fn catch_up(&self, bus: &Bus, keys: &Keys) -> Result<(), BusError> {
        if self.show_status(bus, keys)? == Some(Phase::Gathering) {
            std::thread::sleep(GATHERING);
            self.show_status(bus, keys)?;
        }
        Ok(())
    }

    /// Shows the progress of the run; returns its phase if the simulator answers.
    fn show_status(&self, bus: &Bus, keys: &Keys) -> Result<Option<Phase>, BusError> {
        let Some(answer) = bus.get(&keys.control(), "", Some(encode(&Control::Status)))? else {
            return Ok(None);
        };

        let Ok(body) = answer.result else {
            return Ok(None);
        };
        let Ok(ControlAnswer::Done(status)) = decode(&answer.key, "the simulator", &body) else {
            return Ok(None);
        };

        let phase = status.phase;
        self.screen.progress(Progress::from(*status));

        Ok(Some(phase))
    }
}

/// Drops `end` when the simulator's token is undeclared, which wakes [`Observer::finish`].
fn watch_token(bus: &Bus, keys: &Keys, end: Sender<()>) -> Result<Declared, BusError> {
    let end = Mutex::new(Some(end));
    bus.liveliness(&keys.alive_sim(), move |_, is_declared| {
        if !is_declared && let Ok(mut end) = end.lock() {
            end.take();
        }
    })
}

/// Queues the faults of processes for the supervisor, and answers the simulator when they have been carried out.
fn subscribe_faults(
    bus: &Bus,
    keys: &Keys,
    queue: UnboundedSender<SupervisorEvent>,
) -> Result<Declared, BusError> {
    let session = bus.clone();
    let control = keys.control();
    bus.subscribe(&keys.faults(), move |key, bytes| {
        let order = match decode::<FaultOrder>(key, "the simulator", bytes) {
            Ok(order) => order,
            Err(error) => return tracing::warn!("{error}"),
        };

        let answer = Control::FaultsDone {
            epoch: order.epoch,
            tick: order.tick,
        };
        let session = session.clone();
        let control = control.clone();
        let done = FaultsDone(Box::new(move || get_later(session, control, answer)));

        // The queue is closed only when the launch is over.
        let _over = queue.send(SupervisorEvent::Faults(order.orders, done));
    })
}

/// Sends a control request on a thread of its own: the caller must not wait for the simulator.
fn get_later(session: Bus, key: String, control: Control) {
    std::thread::spawn(move || {
        if let Err(error) = session.get(&key, "", Some(encode(&control))) {
            tracing::warn!("{error}");
        }
    });
}
