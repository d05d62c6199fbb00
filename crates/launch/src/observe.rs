//! The launcher as an observer of the run: it subscribes like any observer and takes no part in ticks.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Duration;

use bus::{Bus, BusError, Declared, Reply, Role};
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer, FaultOrder, LogRecord, Phase, WorldFrame};
use protocol::{RobotName, RunName, decode, encode};
use tokio::sync::mpsc::UnboundedSender;

use super::bar::RunProgress;
use super::screen::ScreenHandle;
use super::supervise::{FaultsDone, Gone, SupervisorEvent};

/// How long to try to reach the simulator; as long as robots do.
const PATIENCE: Duration = Duration::from_secs(20);
/// Wait before the simulator is told again what it has not answered.
const REPORT_AGAIN: Duration = Duration::from_millis(200);
/// How long to wait before reporting robots that have not joined.
const GATHERING: Duration = Duration::from_secs(1);

/// What to observe, and where to report it.
pub(super) struct ObserverTask {
    pub(super) run: RunName,
    pub(super) endpoint: String,
    /// The operator's configuration file for a secured run.
    pub(super) config: Option<PathBuf>,
    /// Whether to subscribe to frames, for the progress bar.
    pub(super) wants_world: bool,
    pub(super) screen: ScreenHandle,
    /// The supervisor's queue: it waits to be told that the run is observed, and carries out faults of processes, those of the
    /// scenario and those that a person wants.
    pub(super) supervisor: UnboundedSender<SupervisorEvent>,
    /// Robots without a process, from the supervisor. Closed when the launch is over.
    pub(super) gone: Receiver<Gone>,
}

/// A running observer.
pub(super) struct Observer {
    state: Arc<Mutex<ObserverPhase>>,
    /// Receives a word when the simulator's token is undeclared.
    ended: Receiver<()>,
}

/// How far an observer has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ObserverPhase {
    /// It tries to reach the simulator.
    Connecting,
    /// It observes.
    Observing,
    /// The launch is over.
    Over,
}

impl Observer {
    /// Starts to observe as soon as the simulator is reached. Connecting blocks, so it happens on a thread of its own,
    /// which ends with the process. What a launch does for its simulator, such as faults of processes, depends on it: it
    /// goes on trying for as long as the launch lasts.
    ///
    /// # Errors
    /// If the system starts no further thread.
    pub(super) fn start(watch: ObserverTask) -> std::io::Result<Self> {
        let (end, ended) = std::sync::mpsc::channel();
        let state = Arc::new(Mutex::new(ObserverPhase::Connecting));
        let observer = Self {
            state: state.clone(),
            ended,
        };
        let thread = Builder::new().name("observer".to_owned());
        thread.spawn(move || watch.observe(&state, &end))?;

        Ok(observer)
    }

    /// Waits a short time until everything that the simulator has put is shown.
    pub(super) fn finish(&self) {
        if advance(&self.state, ObserverPhase::Over) == ObserverPhase::Observing {
            let _in_time = self.ended.recv_timeout(Duration::from_millis(500));
        }
    }
}

/// Sets the state, which returns to no earlier one, and returns the one before.
fn advance(state: &Mutex<ObserverPhase>, next: ObserverPhase) -> ObserverPhase {
    let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
    let before = *state;
    if before != ObserverPhase::Over {
        *state = next;
    }
    before
}

impl ObserverTask {
    /// Observes until the launch is over.
    fn observe(self, state: &Mutex<ObserverPhase>, end: &Sender<()>) {
        while advance(state, ObserverPhase::Connecting) != ObserverPhase::Over {
            match self.open(end.clone()) {
                Ok((bus, _declared)) => {
                    // The queue is closed only when the launch is over.
                    let _over = self.supervisor.send(SupervisorEvent::Observed);
                    advance(state, ObserverPhase::Observing);
                    self.show_gathering(&bus);
                    // Until the supervisor is gone, which holds the other end.
                    for gone in &self.gone {
                        self.report(&bus, gone);
                    }
                    // The launch is over. What the simulator still puts is shown.
                    loop {
                        std::thread::park();
                    }
                }
                Err(error) => self
                    .screen
                    .notice(format!("the run cannot be observed: {error}")),
            }
        }
    }

    /// Reports robots without a process to the simulator until it answers, and to people if the run goes on.
    fn report(&self, bus: &Bus, gone: Gone) {
        let Gone { robots, because } = gone;
        let key = Keys::new(&self.run).control();
        let names: Vec<&str> = robots.iter().map(RobotName::as_str).collect();
        let text = format!("{} {because}, and no process follows", names.join(", "));
        let control = encode(&Control::ProcessEnded { robots, because });

        loop {
            match bus.get(&key, "", Some(control.clone())) {
                Ok(Some(answer)) => {
                    // After its end a run needs no robots.
                    if is_in_progress(&answer) {
                        self.screen.notice(text);
                    }
                    return;
                }
                Ok(None) => std::thread::sleep(REPORT_AGAIN),
                Err(error) => return tracing::warn!("{error}"),
            }
        }
    }

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
        declared.push(subscribe_faults(&bus, &keys, self.supervisor.clone())?);
        declared.push(watch_token(&bus, &keys, end)?);

        // The simulator takes what comes over this link in its order: when it answers, it knows of all that is declared. Its
        // frames of before do not arrive.
        self.show_status(&bus, &keys)?;
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
                Ok(frame) => screen.progress(RunProgress::from(frame)),
                Err(error) => tracing::warn!("{error}"),
            }
        })
    }

    /// Shows which robots have not joined after a while.
    fn show_gathering(&self, bus: &Bus) {
        if !self.wants_world {
            return;
        }

        std::thread::sleep(GATHERING);
        if let Err(error) = self.show_status(bus, &Keys::new(&self.run)) {
            tracing::warn!("{error}");
        }
    }

    /// Shows the progress of the run, if the simulator answers.
    fn show_status(&self, bus: &Bus, keys: &Keys) -> Result<(), BusError> {
        let answer = bus.get(&keys.control(), "", Some(encode(&Control::Status)))?;
        let Some(Reply {
            key,
            result: Ok(body),
        }) = answer
        else {
            return Ok(());
        };

        if let Ok(ControlAnswer::Done(status)) = decode(&key, "the simulator", &body) {
            self.screen.progress(RunProgress::from(*status));
        }
        Ok(())
    }
}

/// Whether the run goes on, as an answer to a control request says.
fn is_in_progress(answer: &Reply) -> bool {
    let Ok(body) = &answer.result else {
        return false;
    };
    match decode(&answer.key, "the simulator", body) {
        Ok(ControlAnswer::Done(status)) => status.phase != Phase::Ended,
        _ => false,
    }
}

/// Wakes [`Observer::finish`] when the simulator's token is undeclared.
fn watch_token(bus: &Bus, keys: &Keys, end: Sender<()>) -> Result<Declared, BusError> {
    let end = Mutex::new(end);
    bus.liveliness(&keys.alive_sim(), move |_, is_declared| {
        if !is_declared && let Ok(end) = end.lock() {
            // The launch may be over.
            let _woken = end.send(());
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
        // The supervisor calls this on its own thread when the signals have been sent.
        let done = FaultsDone(Box::new(move || get_later(session, control, answer)));

        // The queue is closed only when the launch is over.
        let _over = queue.send(SupervisorEvent::Faults(order.orders, done));
    })
}

/// Sends a control request on a thread of its own: the caller must not wait for the simulator.
fn get_later(session: Bus, key: String, control: Control) {
    let get = move || {
        if let Err(error) = session.get(&key, "", Some(encode(&control))) {
            tracing::warn!("{error}");
        }
    };
    // Without an answer the simulator repeats its order.
    if let Err(error) = Builder::new().spawn(get) {
        tracing::warn!("the simulator is not answered: {error}");
    }
}
