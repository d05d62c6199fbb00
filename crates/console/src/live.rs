//! The connection to a run in progress: what it publishes goes into the [`Feed`], requests go to the simulator.
//!
//! Two threads. The *session* thread connects to the simulator and declares the subscribers: frames and panels exactly
//! while a browser is connected, because robots and simulator publish them only if there is a subscriber. The *decoder*
//! thread decodes samples. zenoh's thread only enqueues them: a link that is read slowly would slow the simulator down.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use bus::{Bus, BusError, Declared, Role};
use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::keys::Keys;
use protocol::messages::{Command, Control, ControlAnswer, LogRecord};
use protocol::{FieldError, Message, RobotName, RunName, decode, encode};

use crate::feed::Feed;

/// A request is not carried out if a person may have sent it earlier than this: after as long without a message the page takes
/// the connection for lost, and tells people so.
pub(crate) const MAX_REQUEST_AGE: Duration = Duration::from_millis(2500);
/// How long one attempt to connect to the simulator lasts; attempts are repeated until one succeeds.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// Pause between two attempts.
const CONNECT_RETRY: Duration = Duration::from_millis(200);
/// How long to wait for the reply to `step`, which comes when its ticks are complete.
const STEP_TIMEOUT: Duration = Duration::from_secs(600);
/// After this long without a simulator it is not about to be found, and requests do not wait for it.
const SEARCH: Duration = Duration::from_secs(30);
/// How long to wait for a requested frame before it is requested again; doubled each time.
const FRAME_RETRY: Duration = Duration::from_millis(100);
/// Upper bound of the doubled [`FRAME_RETRY`].
const MAX_FRAME_RETRY: Duration = Duration::from_secs(5);
/// Samples that may wait to be decoded; further ones are dropped, because the run must not wait for the console.
const MAX_QUEUED_SAMPLES: usize = 1024;
/// Bytes of samples that may wait to be decoded.
const MAX_QUEUED_BYTES: usize = 16 << 20;

/// A received message, not decoded yet.
enum Sample {
    World(Vec<u8>),
    Log(Vec<u8>),
    /// The last lines of the log so far, if the simulator has told them.
    PastLog(Option<Vec<LogRecord>>),
    Panel {
        /// As the key names it.
        robot: String,
        payload: Vec<u8>,
    },
}

impl Sample {
    fn payload(&self) -> &[u8] {
        match self {
            Self::World(payload) | Self::Log(payload) | Self::Panel { payload, .. } => payload,
            Self::PastLog(_) => &[],
        }
    }
}

/// The run that is watched.
pub(crate) struct Live {
    run: RunName,
    connect: String,
    keys: Keys,
    feed: Feed,
    /// How long to wait for a reply of the simulator, which replies to everything but `step` at once, and before that for the
    /// simulator: both start at the same time, and a page may be open before one has found the other.
    reply_timeout: Duration,
    /// When the console began to look for the simulator.
    started_at: Instant,
    /// Set when the simulator has been reached.
    bus: OnceLock<Bus>,
    demand: Mutex<Demand>,
    /// Notified when `demand` or `feed` has changed in a way that the session thread may wait for.
    changed: Condvar,
    queue: SyncSender<Sample>,
    queued_bytes: AtomicUsize,
    /// Lines of the log that were dropped since the last one that was not.
    lost_lines: AtomicU64,
    /// Samples that were ignored.
    ignored: AtomicU64,
}

/// What the session thread has to provide.
#[derive(Default)]
struct Demand {
    viewers: usize,
    is_over: bool,
}

impl Demand {
    fn has_viewers(&self) -> bool {
        self.viewers > 0 && !self.is_over
    }
}

/// Keeps the subscribers to frames and panels declared until it is dropped.
pub(crate) struct Viewer(Arc<Live>);

impl Drop for Viewer {
    fn drop(&mut self) {
        self.0.lock().viewers -= 1;
        self.0.notify();
    }
}

impl Live {
    /// Begins to connect to the simulator of `run`, which may start later. Requests wait for its reply for `reply_timeout`.
    ///
    /// # Errors
    /// The configuration file cannot be read, or a thread cannot be started.
    pub(crate) fn start(
        run: RunName,
        connect: String,
        config: Option<PathBuf>,
        reply_timeout: Duration,
    ) -> Result<Arc<Self>, String> {
        if let Some(file) = &config {
            std::fs::metadata(file).map_err(|error| format!("{}: {error}", file.display()))?;
        }

        let (queue, samples) = sync_channel(MAX_QUEUED_SAMPLES);
        let live = Arc::new(Self::new(run, connect, reply_timeout, queue));

        let decoder = live.clone();
        spawn("decoder", move || decoder.decode_all(&samples))?;
        let session = live.clone();
        spawn("session", move || session.run_session(config.as_deref()))?;

        Ok(live)
    }

    fn new(
        run: RunName,
        connect: String,
        reply_timeout: Duration,
        queue: SyncSender<Sample>,
    ) -> Self {
        Self {
            reply_timeout,
            keys: Keys::new(&run),
            run,
            connect,
            feed: Feed::new(),
            started_at: Instant::now(),
            bus: OnceLock::new(),
            demand: Mutex::default(),
            changed: Condvar::new(),
            queue,
            queued_bytes: AtomicUsize::new(0),
            lost_lines: AtomicU64::new(0),
            ignored: AtomicU64::new(0),
        }
    }

    /// Name of the run.
    pub(crate) fn run(&self) -> &str {
        self.run.as_str()
    }

    /// Where its simulator is expected.
    pub(crate) fn endpoint(&self) -> &str {
        &self.connect
    }

    /// What the run shows.
    pub(crate) fn feed(&self) -> &Feed {
        &self.feed
    }

    /// Registers a viewer.
    pub(crate) fn viewer(self: &Arc<Self>) -> Viewer {
        // Counted before the guard exists that counts it back.
        self.lock().viewers += 1;
        self.notify();
        Viewer(self.clone())
    }

    /// Ends the session thread and closes the session.
    pub(crate) fn end(&self) {
        // Noted first: a thread that finds the session closed finds out why.
        self.lock().is_over = true;
        self.notify();

        if let Some(bus) = self.bus.get() {
            bus.close();
        }
    }

    fn lock(&self) -> MutexGuard<'_, Demand> {
        self.demand.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Wakes the session thread. The lock is held so that the notification cannot fall between its check of a condition
    /// and its wait.
    fn notify(&self) {
        let _demand = self.lock();
        self.changed.notify_all();
    }
}

/// Requests to the simulator.
impl Live {
    /// Sends a request to the simulator and waits for its answer.
    ///
    /// # Errors
    /// The request is malformed or no person's, or there is no answer.
    pub(crate) fn control(&self, control: &Control) -> Result<ControlAnswer, String> {
        if matches!(
            control,
            Control::FaultsDone { .. } | Control::ProcessEnded { .. }
        ) {
            return Err("only the launcher reports what it did with processes".to_owned());
        }

        let timeout = match control {
            Control::Status | Control::Setup | Control::Log => {
                return self.query(control, self.reply_timeout);
            }
            Control::Step { .. } => STEP_TIMEOUT,
            _ => self.reply_timeout,
        };
        self.check_attention()?;
        self.query(control, timeout)
    }

    /// Checks that the simulator answers at once. What waits in the socket of one that does not is done whenever it goes on,
    /// so nothing is sent to it.
    fn check_attention(&self) -> Result<(), String> {
        let asked_at = Instant::now();
        let answer = self.query(&Control::Status, MAX_REQUEST_AGE.min(self.reply_timeout));
        let reason = match answer {
            Ok(_) if asked_at.elapsed() < MAX_REQUEST_AGE => return Ok(()),
            Ok(_) => "the simulator answers late".to_owned(),
            Err(reason) => reason,
        };
        Err(format!(
            "{reason}; this was not sent, and is not done later"
        ))
    }

    /// Sends a person's command to a robot and waits for the simulator's answer.
    ///
    /// # Errors
    /// The command is too long, or there is no answer.
    pub(crate) fn send_command(
        &self,
        to: &RobotName,
        command: &str,
    ) -> Result<ControlAnswer, String> {
        let message = Command {
            command: command.to_owned(),
            ..Command::default()
        };
        // Checked here, because a put has no answer that could say so.
        message.check().map_err(|error| malformed(&error))?;
        let bus = self.found_simulator()?;
        self.check_attention()?;

        let key = self.keys.command(to, &RobotName::operator());
        bus.put(&key, encode(&message))
            .map_err(|error| error.to_string())?;

        // On one session the command arrives before this query: the answer means that the simulator has it.
        let answer = self.query(&Control::Status, self.reply_timeout)?;
        match &answer {
            ControlAnswer::Done(status) if status.replay_of.is_some() => {
                Err("this is a replay: its robots execute no commands".to_owned())
            }
            ControlAnswer::Done(status) if status.robots.iter().all(|robot| robot.name != *to) => {
                Err(format!("no robot of this run is called {to}"))
            }
            _ => Ok(answer),
        }
    }

    fn query(&self, control: &Control, timeout: Duration) -> Result<ControlAnswer, String> {
        control.check().map_err(|error| malformed(&error))?;
        let bus = self.found_simulator()?;
        let key = self.keys.control();

        let sent_at = Instant::now();
        let reply = bus
            .get_within(&key, "", Some(encode(control)), timeout)
            .map_err(|error| error.to_string())?
            .ok_or_else(|| self.no_reply(sent_at.elapsed(), timeout))?;

        decode(&key, "simulator", &reply.result?).map_err(|error| error.to_string())
    }

    /// The connection to the simulator; waits until the simulator has been found once.
    fn found_simulator(&self) -> Result<&Bus, String> {
        // Only at the beginning: later a request must not wait for a simulator that has ended.
        let rest_of_search = SEARCH.saturating_sub(self.started_at.elapsed());
        let timeout = self.reply_timeout.min(rest_of_search);
        let waited = self
            .changed
            .wait_timeout_while(self.lock(), timeout, |demand| {
                !demand.is_over && !self.feed.was_present()
            });
        drop(waited);

        // A session may be open to a router behind which there is no simulator yet.
        let bus = self.bus.get().filter(|_| self.feed.was_present());
        bus.ok_or_else(|| self.no_simulator())
    }

    fn no_simulator(&self) -> String {
        format!(
            "no simulator of run {} answers at {}: it is not started yet, or it has ended",
            self.run, self.connect
        )
    }

    fn no_reply(&self, elapsed: Duration, timeout: Duration) -> String {
        // A query that ends early has found no queryable.
        if elapsed < timeout {
            return self.no_simulator();
        }
        format!(
            "no answer within {:.0} s; the simulator may still be working on it",
            elapsed.as_secs_f64()
        )
    }
}

/// The decoder thread, and the queue in front of it.
impl Live {
    /// Enqueues a sample, or drops it if there is no room. Never waits.
    fn enqueue(&self, sample: Sample) {
        let is_line = matches!(sample, Sample::Log(_));
        // A frame or panel that is dropped is replaced by the next one. A line is missed for good, and
        // counted.
        if !self.try_enqueue(sample) && is_line {
            self.lost_lines.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn try_enqueue(&self, sample: Sample) -> bool {
        let len = sample.payload().len();
        if len > MAX_MESSAGE_BYTES {
            self.ignore(&format!(
                "{len} bytes, more than the {MAX_MESSAGE_BYTES} allowed"
            ));
            return false;
        }

        // Reserved before it is queued: the decoder gives the bytes back, and must not be ahead of
        // this.
        let queued_bytes = self.queued_bytes.fetch_add(len, Ordering::Relaxed) + len;
        if queued_bytes <= MAX_QUEUED_BYTES && self.queue.try_send(sample).is_ok() {
            return true;
        }

        self.queued_bytes.fetch_sub(len, Ordering::Relaxed);
        false
    }

    /// Decodes samples until the process ends: `self` owns the sender of the queue.
    fn decode_all(&self, samples: &Receiver<Sample>) {
        for sample in samples {
            let len = sample.payload().len();
            let outcome = self.decode(sample);
            self.queued_bytes.fetch_sub(len, Ordering::Relaxed);

            if let Err(reason) = outcome {
                self.ignore(&reason);
            }
        }
    }

    fn decode(&self, sample: Sample) -> Result<(), String> {
        match sample {
            Sample::World(payload) => self.decode_frame(&payload),
            Sample::Log(payload) => self.decode_line(&payload),
            Sample::PastLog(lines) => {
                self.feed.catch_up(lines);
                Ok(())
            }
            Sample::Panel { robot, payload } => self.decode_panel(&robot, &payload),
        }
    }

    fn decode_frame(&self, payload: &[u8]) -> Result<(), String> {
        let frame = decode_from(&self.keys.world(), "simulator", payload)?;

        self.feed.put_frame(frame);
        // The session thread may wait for a frame that it requested.
        self.notify();
        Ok(())
    }

    fn decode_line(&self, payload: &[u8]) -> Result<(), String> {
        let line = decode_from(&self.keys.log(), "simulator", payload)?;

        // Counted to the first line that came through after them.
        let lost = self.lost_lines.swap(0, Ordering::Relaxed);
        self.feed.add_line(line, lost);
        Ok(())
    }

    fn decode_panel(&self, robot: &str, payload: &[u8]) -> Result<(), String> {
        let name = RobotName::new(robot).map_err(|error| error.to_string())?;
        let panel = decode_from(&self.keys.panel(&name), robot, payload)?;

        self.feed.put_panel(&name, &panel)
    }

    /// Counts an ignored sample; logs the 1st, 2nd, 4th, 8th and so on.
    fn ignore(&self, reason: &str) {
        let count = self.ignored.fetch_add(1, Ordering::Relaxed) + 1;
        if count.is_power_of_two() {
            tracing::warn!(count, "ignored a message: {reason}");
        }
    }
}

/// The session thread.
impl Live {
    fn run_session(self: Arc<Self>, config: Option<&Path>) {
        let Some(bus) = self.connect(config) else {
            return;
        };

        let outcome = self
            .subscribe_always(&bus)
            .and_then(|_declared| self.follow_viewers(&bus));
        if let Err(error) = outcome {
            tracing::error!("{error}");
        }
    }

    /// Repeats attempts until the simulator is reached; `None` if the console ends before.
    fn connect(&self, config: Option<&Path>) -> Option<Bus> {
        let role = Role::Client {
            connect: self.connect.clone(),
            patience: CONNECT_TIMEOUT,
        };
        let config = config.map(Path::to_owned);
        let mut attempts: u64 = 0;

        loop {
            let error = match Bus::open(&role, config.as_ref()) {
                Ok(bus) => return Some(self.bus.get_or_init(|| bus).clone()),
                Err(error) => error,
            };
            attempts += 1;
            if attempts.is_power_of_two() {
                tracing::warn!(attempts, "{error}");
            }

            if self.pause(CONNECT_RETRY) {
                return None;
            }
        }
    }

    /// Waits for `duration`, or less if there is a notification; returns whether the console ends.
    fn pause(&self, duration: Duration) -> bool {
        let waited = self.changed.wait_timeout(self.lock(), duration);
        let (demand, _timed_out) = waited.unwrap_or_else(PoisonError::into_inner);
        demand.is_over
    }

    /// Subscribes to the simulator's liveliness token and to the log, so that a new browser gets the lines before it
    /// connected. Lines are few; `tests/tests/system/console/launched.rs` measures what they cost.
    fn subscribe_always(self: &Arc<Self>, bus: &Bus) -> Result<[Declared; 2], BusError> {
        let live = self.clone();
        let token = bus.liveliness(&self.keys.alive_sim(), move |_, is_present| {
            // Before the thread is woken that asks for frame and log.
            live.feed.set_present(is_present);
            live.notify();
        })?;

        let live = self.clone();
        let log = bus.subscribe(&self.keys.log(), move |_, payload| {
            live.enqueue(Sample::Log(payload.to_vec()));
        })?;

        Ok([token, log])
    }

    /// Subscribes to what is published only for subscribers, and says that there are viewers.
    fn subscribe_for_viewers(self: &Arc<Self>, bus: &Bus) -> Result<[Declared; 3], BusError> {
        let live = self.clone();
        let world = bus.subscribe(&self.keys.world(), move |_, payload| {
            live.enqueue(Sample::World(payload.to_vec()));
        })?;

        let live = self.clone();
        let panels = bus.subscribe(&panels_of(&self.run), move |key, payload| {
            live.enqueue(Sample::Panel {
                robot: Keys::robot_of(key).unwrap_or_default().to_owned(),
                payload: payload.to_vec(),
            });
        })?;

        // The simulator stays after the end of a run while there are viewers.
        let viewer = bus.token(&self.keys.alive_viewer())?;
        Ok([world, panels, viewer])
    }

    /// Keeps the subscribers declared while there are viewers, until the console ends.
    fn follow_viewers(self: &Arc<Self>, bus: &Bus) -> Result<(), BusError> {
        loop {
            self.wait(Demand::has_viewers);
            if self.lock().is_over {
                return Ok(());
            }

            // Dropped when the last viewer is gone: robots and simulator then put nothing for the
            // console any more.
            let _declared = self.subscribe_for_viewers(bus)?;
            self.follow_simulator();
        }
    }

    /// Requests the log so far and a frame whenever the simulator appears; returns when there are no viewers.
    fn follow_simulator(&self) {
        loop {
            self.wait(|demand| !demand.has_viewers() || self.feed.is_present());
            if !self.lock().has_viewers() {
                return;
            }

            if self.feed.lacks_lines() {
                self.request_log();
            }
            self.request_frame();
            self.wait(|demand| !demand.has_viewers() || !self.feed.is_present());
        }
    }

    /// Queries the lines of the log that were put before this console could receive them.
    fn request_log(&self) {
        let lines = match self.query(&Control::Log, self.reply_timeout) {
            Ok(ControlAnswer::Log { lines }) => Some(lines),
            other => {
                tracing::warn!("the log so far is not told: {other:?}");
                None
            }
        };

        // After the lines that arrived before the answer. The decoder ends with the process.
        if self.queue.send(Sample::PastLog(lines)).is_err() {
            tracing::error!("there is no decoder");
        }
    }

    /// Queries the status until a frame arrives. A simulator whose clock is held publishes no frames by itself, but it
    /// publishes one when it replies to a query.
    fn request_frame(&self) {
        // Any frame will do, also one that the simulator puts by itself meanwhile.
        let frames_before = self.feed.frame_count();
        let mut retry = FRAME_RETRY;

        while self.lacks_frame(&self.lock(), frames_before) {
            if let Err(error) = self.query(&Control::Status, self.reply_timeout) {
                tracing::debug!("requested a frame: {error}");
            }

            let waited = self
                .changed
                .wait_timeout_while(self.lock(), retry, |demand| {
                    self.lacks_frame(demand, frames_before)
                });
            drop(waited);
            retry = (2 * retry).min(MAX_FRAME_RETRY);
        }
    }

    fn lacks_frame(&self, demand: &Demand, frames_before: u64) -> bool {
        demand.has_viewers() && self.feed.is_present() && self.feed.frame_count() == frames_before
    }

    /// Waits until `is_met` or until the console ends.
    fn wait(&self, is_met: impl Fn(&Demand) -> bool) {
        let waited = self
            .changed
            .wait_while(self.lock(), |demand| !demand.is_over && !is_met(demand));
        drop(waited);
    }
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), String> {
    thread::Builder::new()
        .name(name.to_owned())
        .spawn(work)
        .map(drop)
        .map_err(|error| format!("cannot start a thread: {error}"))
}

fn decode_from<M: Message>(key: &str, sender: &str, payload: &[u8]) -> Result<M, String> {
    decode(key, sender, payload).map_err(|error| error.to_string())
}

/// The key expression of all robots' panels.
fn panels_of(run: &RunName) -> String {
    format!("cars/{run}/robot/*/panel")
}

fn malformed(error: &FieldError) -> String {
    format!("malformed request: {}: {}", error.field, error.reason)
}
