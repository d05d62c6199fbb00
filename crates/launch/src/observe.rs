//! The launcher as an observer of the run: it watches as anybody could, and takes part in nothing.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use bus::{Bus, BusError, Declared, Role};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer, FaultOrder, LogRecord, Phase, WorldFrame};
use protocol::{RunName, decode, encode};
use tokio::sync::mpsc::UnboundedSender;

use super::bar::Progress;
use super::screen::Tell;
use super::supervise::{self, Done};

/// How long to try to reach the simulator: as long as a robot does.
const PATIENCE: Duration = Duration::from_secs(20);
/// Robots that are not there this long after the start are worth a word.
const GATHERING: Duration = Duration::from_secs(1);

/// What to watch.
pub(super) struct Watch {
    pub(super) run: RunName,
    pub(super) endpoint: String,
    /// How an operator is let into a secured run.
    pub(super) config: Option<PathBuf>,
    /// Whether pictures of the field are wanted, for the progress bar.
    pub(super) wants_world: bool,
    pub(super) tell: Tell,
    /// Where the faults that the scenario has in store for processes are handed over; `None` if it has none.
    pub(super) faults: Option<UnboundedSender<supervise::Event>>,
}

/// An observer at work.
pub(super) struct Observer {
    /// Closed when the simulator's last words have come, or the observer never came to hear any.
    ended: Receiver<()>,
}

impl Observer {
    /// Begins to watch, as soon as the simulator is there. The bus has threads of its own, and reaching it takes
    /// time: so this has, too. It ends with the process.
    pub(super) fn start(watch: Watch) -> Self {
        let (end, ended) = std::sync::mpsc::channel();
        std::thread::spawn(move || match watch.open(end) {
            Ok(_watching) => loop {
                std::thread::park();
            },
            Err(error) => watch
                .tell
                .notice(format!("the run cannot be watched: {error}")),
        });

        Self { ended }
    }

    /// Waits until everything that the simulator said has been shown, but not for long.
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
        let tell = self.tell.clone();
        let mut declared = vec![bus.subscribe(&keys.log(), move |key, bytes| {
            match decode::<LogRecord>(key, "the simulator", bytes) {
                Ok(record) => tell.log(record),
                Err(error) => tracing::warn!("{error}"),
            }
        })?];

        if self.wants_world {
            let tell = self.tell.clone();
            declared.push(bus.subscribe(&keys.world(), move |key, bytes| {
                match decode::<WorldFrame>(key, "the simulator", bytes) {
                    Ok(frame) => tell.progress(Progress::from(frame)),
                    Err(error) => tracing::warn!("{error}"),
                }
            })?);
        }

        declared.extend(
            self.faults
                .as_ref()
                .map(|queue| hear_faults(&bus, &keys, queue.clone()))
                .transpose()?,
        );

        // Dropping the sender is the message.
        let end = std::sync::Mutex::new(Some(end));
        declared.push(bus.liveliness(&keys.alive_sim(), move |_, is_there| {
            if !is_there && let Ok(mut end) = end.lock() {
                end.take();
            }
        })?);

        if self.wants_world {
            self.catch_up(&bus, &keys)?;
        }

        Ok((bus, declared))
    }

    /// Asks how things stand: what was said before this observer came is not said again.
    fn catch_up(&self, bus: &Bus, keys: &Keys) -> Result<(), BusError> {
        if self.ask(bus, keys)? == Some(Phase::Gathering) {
            std::thread::sleep(GATHERING);
            self.ask(bus, keys)?;
        }
        Ok(())
    }

    fn ask(&self, bus: &Bus, keys: &Keys) -> Result<Option<Phase>, BusError> {
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
        self.tell.progress(Progress::from(*status));

        Ok(Some(phase))
    }
}

/// Hands over what the scenario has in store for processes, and answers when it has been done.
fn hear_faults(
    bus: &Bus,
    keys: &Keys,
    queue: UnboundedSender<supervise::Event>,
) -> Result<Declared, BusError> {
    let (asking, control) = (bus.clone(), keys.control());
    bus.subscribe(&keys.faults(), move |key, bytes| {
        let order = match decode::<FaultOrder>(key, "the simulator", bytes) {
            Ok(order) => order,
            Err(error) => return tracing::warn!("{error}"),
        };
        let (asking, control) = (asking.clone(), control.clone());
        let done = move || {
            let done = Control::FaultsDone {
                epoch: order.epoch,
                tick: order.tick,
            };
            // On a thread of its own: the answer takes as long as the simulator takes.
            std::thread::spawn(move || {
                if let Err(error) = asking.get(&control, "", Some(encode(&done))) {
                    tracing::warn!("{error}");
                }
            });
        };
        // The supervisor is gone only when the launch is over.
        let _over = queue.send(supervise::Event::Faults(order.orders, Done(Box::new(done))));
    })
}
