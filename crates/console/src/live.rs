//! The bus side of live mode: what comes from the run goes onto the [`Board`], what people ask for goes to the simulator.
//!
//! Two threads of its own. The *keeper* reaches the simulator and sees to it that pictures and panels are asked for
//! exactly while somebody watches: the others paint only for those who subscribe. The *reader* decodes. The
//! middleware's thread only hands over: a link that is read slowly would slow the simulator down.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Role};
use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::keys::Keys;
use protocol::messages::{Control, ControlAnswer};
use protocol::{RobotName, RunName, decode, encode};

use crate::board::Board;

/// How long one attempt to reach the simulator lasts; there is always another one.
const ATTEMPT: Duration = Duration::from_secs(1);
/// Between two attempts.
const ATTEMPT_AGAIN: Duration = Duration::from_millis(200);
/// The simulator answers at once.
const PATIENCE: Duration = Duration::from_secs(5);
/// A step takes as long as its ticks take; who asked for more than this sees how it goes on.
const STEP_PATIENCE: Duration = Duration::from_secs(600);
/// A picture that was asked for and has not come is asked for again after this long, and twice that, and so on.
const ASK_AGAIN: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));
/// Messages, and bytes of them, that may wait to be decoded; what comes then is lost, for the run does not wait.
const QUEUE: (usize, usize) = (1024, 16 << 20);

/// A message that is not decoded yet.
enum Raw {
    World(Vec<u8>),
    Log(Vec<u8>),
    /// Of the robot in the key.
    Panel(String, Vec<u8>),
}

impl Raw {
    fn bytes(&self) -> &[u8] {
        let (Self::World(bytes) | Self::Log(bytes) | Self::Panel(_, bytes)) = self;
        bytes
    }
}

/// The run that is watched.
pub(crate) struct Live {
    run: RunName,
    connect: String,
    keys: Keys,
    board: Board,
    bus: OnceLock<Bus>,
    /// What the keeper is to see to.
    wanted: Mutex<Wanted>,
    /// The keeper has something to see to.
    wake: Condvar,
    raw: SyncSender<Raw>,
    /// Bytes that wait to be decoded.
    waiting_bytes: AtomicUsize,
    /// Lines of the log that were lost since the last one that was not.
    lost_lines: AtomicU64,
    /// Messages that changed nothing.
    ignored: AtomicU64,
}

#[derive(Default)]
struct Wanted {
    viewers: usize,
    is_over: bool,
}

/// Somebody who watches, until dropped.
pub(crate) struct Viewer(Arc<Live>);

impl Drop for Viewer {
    fn drop(&mut self) {
        self.0.lock().viewers -= 1;
        self.0.nudge();
    }
}

impl Live {
    /// Begins to look for the simulator of `run`; it need not be there yet.
    ///
    /// # Errors
    /// Why it cannot begin.
    pub(crate) fn start(
        run: RunName,
        connect: String,
        config: Option<PathBuf>,
    ) -> Result<Arc<Self>, String> {
        if let Some(file) = &config {
            std::fs::metadata(file).map_err(|error| format!("{}: {error}", file.display()))?;
        }
        let (raw, received) = sync_channel(QUEUE.0);
        let live = Arc::new(Self {
            keys: Keys::new(&run),
            run,
            connect,
            board: Board::new(),
            bus: OnceLock::new(),
            wanted: Mutex::default(),
            wake: Condvar::new(),
            raw,
            waiting_bytes: AtomicUsize::new(0),
            lost_lines: AtomicU64::new(0),
            ignored: AtomicU64::new(0),
        });
        let (reader, keeper) = (live.clone(), live.clone());
        let spawn = |name: &str, work: Box<dyn FnOnce() + Send>| {
            let thread = std::thread::Builder::new()
                .name(name.to_owned())
                .spawn(work);
            thread.map_err(|error| format!("cannot start a thread: {error}"))
        };
        spawn("reader", Box::new(move || reader.read(&received)))?;
        spawn("keeper", Box::new(move || keeper.keep(config.as_ref())))?;
        Ok(live)
    }

    /// Name of the run.
    pub(crate) fn run(&self) -> &str {
        self.run.as_str()
    }

    /// What there is to see.
    pub(crate) fn board(&self) -> &Board {
        &self.board
    }

    /// Somebody watches.
    pub(crate) fn viewer(self: &Arc<Self>) -> Viewer {
        self.lock().viewers += 1;
        self.nudge();
        Viewer(self.clone())
    }

    /// Takes leave of the run.
    pub(crate) fn end(&self) {
        self.lock().is_over = true;
        self.nudge();
        if let Some(bus) = self.bus.get() {
            bus.close();
        }
    }

    fn lock(&self) -> MutexGuard<'_, Wanted> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Something has changed that the keeper may be waiting for. Under its lock, or it might just have looked.
    fn nudge(&self) {
        let _wanted = self.lock();
        self.wake.notify_all();
    }

    /// Asks the simulator for something and waits for its answer.
    ///
    /// # Errors
    /// Why there is none.
    pub(crate) fn control(&self, control: &Control) -> Result<ControlAnswer, String> {
        let patience = if matches!(control, Control::Step { .. }) {
            STEP_PATIENCE
        } else {
            PATIENCE
        };
        self.ask(control, patience)
    }

    fn ask(&self, control: &Control, patience: Duration) -> Result<ControlAnswer, String> {
        let nobody = || {
            format!(
                "no simulator of run {} answers at {}: it is not started yet, or it has ended",
                self.run, self.connect
            )
        };
        let bus = self.bus.get().ok_or_else(nobody)?;
        let (key, asked) = (self.keys.control(), Instant::now());
        let answer = bus.get_within(&key, "", Some(encode(control)), patience);
        let answer =
            answer
                .map_err(|error| error.to_string())?
                .ok_or_else(|| match asked.elapsed() {
                    elapsed if elapsed < patience => nobody(),
                    elapsed => {
                        format!(
                            "no answer for {:.0} s; the simulator may still be at it",
                            elapsed.as_secs_f64()
                        )
                    }
                })?;
        decode(&key, "simulator", &answer.result?).map_err(|error| error.to_string())
    }

    /// A message that changes nothing: counted, and said once in a while.
    fn ignore(&self, why: &str) {
        let count = self.ignored.fetch_add(1, Ordering::Relaxed) + 1;
        if count.is_power_of_two() {
            tracing::warn!(count, "ignored a message: {why}");
        }
    }
}

/// The reader, and what feeds it.
impl Live {
    /// Hands over what came. Never waits.
    fn receive(&self, raw: Raw) {
        let (len, is_line) = (raw.bytes().len(), matches!(raw, Raw::Log(_)));
        let is_too_long = len > MAX_MESSAGE_BYTES;
        let is_full = self.waiting_bytes.fetch_add(len, Ordering::Relaxed) + len > QUEUE.1;
        if !is_too_long && !is_full && self.raw.try_send(raw).is_ok() {
            return;
        }
        self.waiting_bytes.fetch_sub(len, Ordering::Relaxed);
        self.lost_lines
            .fetch_add(u64::from(is_line), Ordering::Relaxed);
        if is_too_long {
            self.ignore(&format!(
                "{len} bytes, more than the {MAX_MESSAGE_BYTES} allowed"
            ));
        }
    }

    fn read(&self, received: &Receiver<Raw>) {
        // It ends with the process: the other end of the queue is in `self`.
        while let Ok(raw) = received.recv() {
            let outcome = match &raw {
                Raw::World(bytes) => self.read_world(bytes),
                Raw::Log(bytes) => self.read_line(bytes),
                Raw::Panel(robot, bytes) => self.read_panel(robot, bytes),
            };
            self.waiting_bytes
                .fetch_sub(raw.bytes().len(), Ordering::Relaxed);
            if let Err(why) = outcome {
                self.ignore(&why);
            }
        }
    }

    fn read_world(&self, bytes: &[u8]) -> Result<(), String> {
        let frame =
            decode(&self.keys.world(), "simulator", bytes).map_err(|error| error.to_string())?;
        self.board.show(frame);
        self.nudge();
        Ok(())
    }

    fn read_line(&self, bytes: &[u8]) -> Result<(), String> {
        let line =
            decode(&self.keys.log(), "simulator", bytes).map_err(|error| error.to_string())?;
        self.board
            .log(line, self.lost_lines.swap(0, Ordering::Relaxed));
        Ok(())
    }

    fn read_panel(&self, robot: &str, bytes: &[u8]) -> Result<(), String> {
        let name = RobotName::new(robot).map_err(|error| error.to_string())?;
        let panel =
            decode(&self.keys.panel(&name), robot, bytes).map_err(|error| error.to_string())?;
        self.board.paint(&name, &panel)
    }
}

/// The keeper.
impl Live {
    fn keep(self: Arc<Self>, config: Option<&PathBuf>) {
        let Some(bus) = self.reach(config) else {
            return;
        };
        match self.listen(&bus) {
            // Held to the end of the process.
            Ok(_declared) => self.follow_viewers(&bus),
            Err(error) => tracing::error!("{error}"),
        }
    }

    /// Tries until the simulator is reached; `None` if it is all over before.
    fn reach(&self, config: Option<&PathBuf>) -> Option<Bus> {
        let role = Role::Client {
            connect: self.connect.clone(),
            patience: ATTEMPT,
        };
        let mut attempts: u64 = 0;
        loop {
            match Bus::open(&role, config) {
                Ok(bus) => return Some(self.bus.get_or_init(|| bus).clone()),
                Err(error) => {
                    attempts += 1;
                    if attempts.is_power_of_two() {
                        tracing::warn!(attempts, "{error}");
                    }
                }
            }
            let wait = self.wake.wait_timeout(self.lock(), ATTEMPT_AGAIN);
            if wait.unwrap_or_else(PoisonError::into_inner).0.is_over {
                return None;
            }
        }
    }

    /// What is listened to always: whether the simulator is there, and the log, so that who opens the console sees
    /// what happened before. Lines are few; see `tests/tests/console.rs` for what they cost.
    fn listen(self: &Arc<Self>, bus: &Bus) -> Result<[Declared; 2], BusError> {
        let (alive, log) = (self.clone(), self.clone());
        Ok([
            bus.liveliness(&self.keys.alive_sim(), move |_, is_there| {
                alive.board.set_present(is_there);
                alive.nudge();
            })?,
            bus.subscribe(&self.keys.log(), move |_, bytes| {
                log.receive(Raw::Log(bytes.to_vec()))
            })?,
        ])
    }

    /// What is listened to while somebody watches.
    fn watch(self: &Arc<Self>, bus: &Bus) -> Result<[Declared; 2], BusError> {
        let (world, panels) = (self.clone(), self.clone());
        Ok([
            bus.subscribe(&self.keys.world(), move |_, bytes| {
                world.receive(Raw::World(bytes.to_vec()))
            })?,
            bus.subscribe(&panels_of(&self.run), move |key, bytes| {
                let robot = Keys::robot_of(key).unwrap_or_default().to_owned();
                panels.receive(Raw::Panel(robot, bytes.to_vec()));
            })?,
        ])
    }

    fn follow_viewers(self: &Arc<Self>, bus: &Bus) {
        loop {
            if !self.wait(|wanted| wanted.viewers > 0) {
                return;
            }
            match self.watch(bus) {
                Ok(_declared) => self.follow_simulator(),
                Err(error) => {
                    tracing::error!("{error}");
                    return;
                }
            }
            if self.lock().is_over {
                return;
            }
        }
    }

    /// Returns when nobody watches any more. A simulator that has nothing to do paints nothing: whenever one appears,
    /// it is asked how things stand, for then it shows it, too.
    fn follow_simulator(&self) {
        let is_wanted = |wanted: &Wanted| wanted.viewers > 0 && !wanted.is_over;
        while self.wait(|wanted| !is_wanted(wanted) || self.board.is_present())
            && is_wanted(&self.lock())
        {
            self.ask_for_picture(is_wanted);
            self.wait(|wanted| !is_wanted(wanted) || !self.board.is_present());
        }
    }

    fn ask_for_picture(&self, is_wanted: impl Fn(&Wanted) -> bool) {
        let (seen, mut patience) = (self.board.pictures(), ASK_AGAIN.0);
        let is_settled = |wanted: &Wanted| {
            !is_wanted(wanted) || !self.board.is_present() || self.board.pictures() > seen
        };
        while !is_settled(&self.lock()) {
            if let Err(error) = self.ask(&Control::Status, PATIENCE) {
                tracing::debug!("asked for a picture: {error}");
            }
            let timed = self
                .wake
                .wait_timeout_while(self.lock(), patience, |wanted| !is_settled(wanted));
            drop(timed);
            patience = (2 * patience).min(ASK_AGAIN.1);
        }
    }

    /// Waits until `is_met`; `false` if it is all over.
    fn wait(&self, is_met: impl Fn(&Wanted) -> bool) -> bool {
        let wait = self
            .wake
            .wait_while(self.lock(), |wanted| !wanted.is_over && !is_met(wanted));
        !wait.unwrap_or_else(PoisonError::into_inner).is_over
    }
}

/// The panels of all robots of a run.
fn panels_of(run: &RunName) -> String {
    format!("cars/{run}/robot/*/panel")
}
