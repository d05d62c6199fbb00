//! One browser: a WebSocket, served at the pace at which the browser reads.
//!
//! The socket's buffers hold megabytes, which is minutes of outdated frames for a browser that stops reading. Therefore
//! every batch of new messages ends with a ping, and the next batch is sent only if all but the last few pings have been
//! answered. So a slow browser always gets the newest frame, and a stalled one needs no memory here.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, close_code};
use protocol::messages::ControlAnswer;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, watch};
use tokio::time::{Instant, sleep_until, timeout};

use crate::app::{App, Ending, MAX_BROWSERS, Mode};
use crate::failed::Failed;
use crate::feed::Cursor;
use crate::live::{Live, MAX_REQUEST_AGE, Viewer};
use crate::page::{PageMessage, RequestHead, ServerMessage};

/// Largest message of a page, bytes: a scenario of 1 MiB, and the JSON around it.
pub(crate) const MAX_BYTES: usize = (1 << 20) + 1024;
/// Largest message without a scenario or set-up, bytes.
const MAX_PLAIN_BYTES: usize = 64 << 10;
/// A browser is disconnected if it sends nothing, not even a pong, or accepts no message for this long.
const STALL_TIMEOUT: Duration = Duration::from_secs(30);
/// Time without a ping after which one is sent.
const PING_INTERVAL: Duration = Duration::from_secs(5);
/// Time between two beats. `connection.js` expects a message within [`MAX_REQUEST_AGE`].
const BEAT_INTERVAL: Duration = Duration::from_millis(500);
/// How long to wait for a browser's close frame.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);
/// Batches that may be sent before the browser answers the ping of the first one.
const MAX_UNACKNOWLEDGED: u64 = 3;
/// Least time between two batches: 50 frames per second.
const BATCH_INTERVAL: Duration = Duration::from_millis(20);
/// Least time between two requests of one browser.
const REQUEST_INTERVAL: Duration = Duration::from_millis(10);
/// Requests of one browser that may wait for the simulator's answer.
const MAX_REQUESTS: usize = 8;

/// Serves a browser until it disconnects, stalls, or the console ends.
pub(crate) async fn serve(mut socket: WebSocket, app: Arc<App>) {
    let Some(_permit) = app.admit_browser() else {
        let reason = format!("{MAX_BROWSERS} browsers are connected already; close one of them");
        close(&mut socket, close_code::AGAIN, &reason).await;
        return;
    };

    let mut browser = Browser::new(socket, app);
    match browser.run().await {
        Disconnect::Left => {}
        Disconnect::Stalled => {
            tracing::info!("disconnected a browser that was stalled for {STALL_TIMEOUT:?}");
        }
        Disconnect::Closed { code, reason } => close(&mut browser.socket, code, &reason).await,
    }
}

/// Why a browser is no longer served.
enum Disconnect {
    /// It closed the connection.
    Left,
    /// It did not read or send anything for [`STALL_TIMEOUT`].
    Stalled,
    /// The server closes the connection.
    Closed {
        /// WebSocket close code.
        code: u16,
        /// For the close frame.
        reason: String,
    },
}

impl Disconnect {
    fn closed(code: u16, reason: impl Into<String>) -> Self {
        Self::Closed {
            code,
            reason: reason.into(),
        }
    }
}

/// A connected browser.
struct Browser {
    socket: WebSocket,
    app: Arc<App>,
    ending: Ending,
    failed: watch::Receiver<Option<Arc<Failed>>>,
    /// `None` while a recording is shown.
    view: Option<LiveView>,
    answer_sender: mpsc::Sender<Utf8Bytes>,
    answers: mpsc::Receiver<Utf8Bytes>,
    requests: Arc<Semaphore>,
    /// Number of the last batch that was sent, from 1.
    batches_sent: u64,
    /// Number of the last batch whose ping was answered.
    batches_acknowledged: u64,
    opened_at: Instant,
    last_received: Instant,
    next_batch: Instant,
    next_request: Instant,
    next_ping: Instant,
    next_beat: Instant,
}

/// A browser's view of a run in progress.
struct LiveView {
    live: Arc<Live>,
    cursor: Cursor,
    changes: watch::Receiver<()>,
    /// Keeps the subscription to frames and panels declared.
    _viewer: Viewer,
}

impl LiveView {
    fn new(live: &Arc<Live>) -> Self {
        let mut changes = live.feed().changes();
        changes.mark_changed();

        Self {
            live: live.clone(),
            cursor: Cursor::default(),
            changes,
            _viewer: live.viewer(),
        }
    }

    /// Waits until the feed has changed, and at least until `earliest`. Never returns without a view.
    async fn changed(view: &mut Option<Self>, earliest: Instant) {
        sleep_until(earliest).await;

        match view {
            // It cannot fail: `live` owns the sender.
            Some(view) => drop(view.changes.changed().await),
            None => std::future::pending().await,
        }
    }
}

impl Browser {
    fn new(socket: WebSocket, app: Arc<App>) -> Self {
        let now = Instant::now();
        let view = match &app.mode {
            Mode::Live(live) => Some(LiveView::new(live)),
            Mode::Recording(_) => None,
        };
        let (answer_sender, answers) = mpsc::channel(MAX_REQUESTS);

        Self {
            socket,
            ending: app.ending(),
            failed: new_failure(&app),
            app,
            view,
            answer_sender,
            answers,
            requests: Arc::new(Semaphore::new(MAX_REQUESTS)),
            batches_sent: 0,
            batches_acknowledged: 0,
            opened_at: now,
            last_received: now,
            next_batch: now,
            next_request: now,
            next_ping: now + PING_INTERVAL,
            next_beat: now,
        }
    }

    async fn run(&mut self) -> Disconnect {
        match self.serve().await {
            Ok(never) => match never {},
            Err(disconnect) => disconnect,
        }
    }

    async fn serve(&mut self) -> Result<Infallible, Disconnect> {
        self.send_hello().await?;

        loop {
            let unacknowledged = self.batches_sent - self.batches_acknowledged;
            tokio::select! {
                message = receive(&mut self.socket, self.next_request) => self.on_message(message).await?,
                Some(answer) = self.answers.recv() => self.send_text(answer).await?,
                () = LiveView::changed(&mut self.view, self.next_batch),
                    if unacknowledged < MAX_UNACKNOWLEDGED => self.send_batch().await?,
                failed = next_failure(&mut self.failed) => {
                    let text = ServerMessage::Failed { failed: &failed }.text();
                    self.send_text(text).await?;
                }
                () = sleep_until(self.next_ping) => self.check_liveness().await?,
                () = sleep_until(self.next_beat) => self.beat().await?,
                () = self.ending.reached() => {
                    return Err(Disconnect::closed(close_code::AWAY, "the console ends"));
                }
            }
        }
    }

    async fn send_hello(&mut self) -> Result<(), Disconnect> {
        let (mode, run, endpoint) = match &self.app.mode {
            Mode::Live(live) => ("live", live.run(), Some(live.endpoint())),
            Mode::Recording(run) => ("recording", run.as_str(), None),
        };
        let hello = ServerMessage::Hello {
            mode,
            run,
            endpoint,
            version: env!("CARGO_PKG_VERSION"),
            has_guide: self.app.has_guide,
        };

        let text = hello.text();
        self.send_text(text).await
    }

    async fn send_text(&mut self, text: Utf8Bytes) -> Result<(), Disconnect> {
        self.send(Message::Text(text)).await
    }

    async fn send(&mut self, message: Message) -> Result<(), Disconnect> {
        match timeout(STALL_TIMEOUT, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(Disconnect::Left),
            Err(_) => Err(Disconnect::Stalled),
        }
    }

    async fn send_batch(&mut self) -> Result<(), Disconnect> {
        let Some(view) = &mut self.view else {
            return Ok(());
        };
        let batch = view.live.feed().take_new(&mut view.cursor);
        if batch.is_empty() {
            return Ok(());
        }

        // One batch has a limited number of log lines: there may be more.
        view.changes.mark_changed();
        for text in batch {
            self.send_text(text).await?;
        }

        self.batches_sent += 1;
        self.next_batch = Instant::now() + BATCH_INTERVAL;
        self.ping().await
    }

    /// Sends a ping; its pong acknowledges all batches so far.
    async fn ping(&mut self) -> Result<(), Disconnect> {
        self.next_ping = Instant::now() + PING_INTERVAL;
        let payload = Bytes::copy_from_slice(&self.batches_sent.to_be_bytes());
        self.send(Message::Ping(payload)).await
    }

    async fn beat(&mut self) -> Result<(), Disconnect> {
        self.next_beat = Instant::now() + BEAT_INTERVAL;
        let at_ms = u64::try_from(self.opened_at.elapsed().as_millis()).unwrap_or(u64::MAX);
        let text = ServerMessage::Beat { at_ms }.text();
        self.send_text(text).await
    }

    async fn check_liveness(&mut self) -> Result<(), Disconnect> {
        if self.last_received.elapsed() > STALL_TIMEOUT {
            return Err(Disconnect::Stalled);
        }
        self.ping().await
    }

    async fn on_message(
        &mut self,
        message: Option<Result<Message, axum::Error>>,
    ) -> Result<(), Disconnect> {
        self.last_received = Instant::now();

        match message {
            Some(Ok(Message::Text(text))) => {
                self.next_request = self.last_received + REQUEST_INTERVAL;
                self.on_text(&text).await
            }
            Some(Ok(Message::Pong(payload))) => {
                self.on_pong(&payload);
                Ok(())
            }
            // axum has answered it.
            Some(Ok(Message::Ping(_))) => Ok(()),
            Some(Ok(Message::Binary(_))) => Err(Disconnect::closed(
                close_code::UNSUPPORTED,
                "binary messages are not supported",
            )),
            Some(Ok(Message::Close(_))) | None => Err(Disconnect::Left),
            Some(Err(error)) => Err(Disconnect::closed(close_code::POLICY, error.to_string())),
        }
    }

    fn on_pong(&mut self, payload: &[u8]) {
        let batch = payload.try_into().map_or(0, u64::from_be_bytes);
        let batch = batch.min(self.batches_sent);
        self.batches_acknowledged = self.batches_acknowledged.max(batch);
    }

    async fn on_text(&mut self, text: &str) -> Result<(), Disconnect> {
        let head: RequestHead = serde_json::from_str(text).unwrap_or_default();
        // The time is this process's own, which goes on also while the process is stopped.
        let heard_at = head.heard_ms.map(Duration::from_millis);
        let age = heard_at.map(|heard_at| self.opened_at.elapsed().saturating_sub(heard_at));
        if let Some(age) = age.filter(|age| *age > MAX_REQUEST_AGE) {
            return self.decline(head.id, too_old(age)).await;
        }
        let message: PageMessage = match serde_json::from_str(text) {
            Ok(message) => message,
            Err(error) => {
                return self
                    .decline(head.id, format!("malformed request: {error}"))
                    .await;
            }
        };
        if text.len() > MAX_PLAIN_BYTES && !message.carries_scenario() {
            return Err(too_large(text.len()));
        }

        let id = message.id();
        match self.start_request(message) {
            Ok(()) => Ok(()),
            Err(reason) => self.decline(Some(id), reason.to_owned()).await,
        }
    }

    /// Starts a request to the simulator; `answers` receives its outcome.
    fn start_request(&self, message: PageMessage) -> Result<(), &'static str> {
        if matches!(message, PageMessage::Resume { .. }) {
            let has_failed = self.app.on_resume();
            return has_failed.then_some(()).ok_or("the run has not failed");
        }
        let view = self
            .view
            .as_ref()
            .ok_or("this is a recording: it can be played, not changed")?;
        let permits = self
            .request_permits()
            .ok_or("too many requests wait for an answer already")?;

        let live = view.live.clone();
        let answers = self.answer_sender.clone();
        tokio::spawn(request(live, message, answers, permits));
        Ok(())
    }

    /// `None` if this browser, or all browsers together, have too many requests that wait for an answer.
    fn request_permits(&self) -> Option<[OwnedSemaphorePermit; 2]> {
        let own = self.requests.clone().try_acquire_owned().ok()?;
        let shared = self.app.admit_request()?;
        Some([own, shared])
    }

    async fn decline(&mut self, id: Option<u64>, reason: String) -> Result<(), Disconnect> {
        let text = ServerMessage::answer(id, Err(reason)).text();
        self.send_text(text).await
    }
}

/// What a browser is told of a failure: also of one that was before it came.
fn new_failure(app: &App) -> watch::Receiver<Option<Arc<Failed>>> {
    let mut failed = app.failed();
    failed.mark_changed();
    failed
}

/// Waits for a failure that the browser has not been told of. Never returns where none can come any more.
async fn next_failure(failed: &mut watch::Receiver<Option<Arc<Failed>>>) -> Arc<Failed> {
    while failed.changed().await.is_ok() {
        let newest = failed.borrow_and_update().clone();
        if let Some(newest) = newest {
            return newest;
        }
    }
    std::future::pending().await
}

fn too_old(age: Duration) -> String {
    let age_s = age.as_secs_f64();
    format!("the request was up to {age_s:.1} s on its way, and was not carried out: ask again")
}

fn too_large(len: usize) -> Disconnect {
    let reason = format!("{len} bytes, more than the {MAX_PLAIN_BYTES} allowed");
    Disconnect::closed(close_code::SIZE, reason)
}

/// The next message, but not before `earliest`.
async fn receive(
    socket: &mut WebSocket,
    earliest: Instant,
) -> Option<Result<Message, axum::Error>> {
    sleep_until(earliest).await;
    socket.recv().await
}

/// Sends a request to the simulator and passes on its answer. `_permits` are released afterwards.
async fn request(
    live: Arc<Live>,
    message: PageMessage,
    answers: mpsc::Sender<Utf8Bytes>,
    _permits: [OwnedSemaphorePermit; 2],
) {
    let id = message.id();
    let outcome = tokio::task::spawn_blocking(move || execute(&live, &message))
        .await
        .unwrap_or_else(|error| Err(error.to_string()));

    let text = ServerMessage::answer(Some(id), outcome).text();
    if answers.send(text).await.is_err() {
        tracing::debug!("a browser disconnected before its answer arrived");
    }
}

/// Blocks until the simulator has answered.
fn execute(live: &Live, message: &PageMessage) -> Result<ControlAnswer, String> {
    match message {
        PageMessage::Control { control, .. } => live.control(control),
        PageMessage::Command { to, command, .. } => live.send_command(to, command),
        PageMessage::Resume { .. } => unreachable!("it is not for the simulator"),
    }
}

/// Sends a close frame and waits for the browser's.
async fn close(socket: &mut WebSocket, code: u16, reason: &str) {
    // A control frame has room for 125 bytes, two of them for the code.
    let reason: String = reason.chars().filter(char::is_ascii).take(120).collect();
    let frame = CloseFrame {
        code,
        reason: reason.into(),
    };

    if !matches!(
        timeout(CLOSE_TIMEOUT, exchange_close(socket, frame)).await,
        Ok(Ok(()))
    ) {
        tracing::debug!("a browser disconnected without a close frame");
    }
}

async fn exchange_close(socket: &mut WebSocket, frame: CloseFrame) -> Result<(), axum::Error> {
    socket.send(Message::Close(Some(frame))).await?;
    while socket.recv().await.transpose()?.is_some() {}
    Ok(())
}
