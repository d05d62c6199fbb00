//! One browser: a WebSocket, served at the pace at which it is read.
//!
//! A socket takes in megabytes before it says that nobody reads, which would be minutes of old pictures. So every
//! portion of news ends with a ping, and there is another portion only when the browser has answered all but the last
//! few. That is what makes the newest picture win all the way, and a stuck browser cost nothing.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, close_code};
use protocol::Message as _;
use protocol::messages::{Control, ControlAnswer};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, watch};
use tokio::time::{Instant, sleep_until, timeout};

use crate::board::Cursor;
use crate::live::{Live, Viewer};
use crate::page::{FromPage, Numbered, ToPage};
use crate::server::{App, MAX_BROWSERS, Mode, told_to_leave};

/// Largest message of a page, bytes: a whole scenario, and what is around it.
pub(crate) const MAX_BYTES: usize = (1 << 20) + 1024;
/// Largest message that brings no scenario or set-up, bytes.
const MAX_PLAIN_BYTES: usize = 64 << 10;
/// A browser that has said nothing for this long, not even that it is there, is let go; and so is one that does not
/// take what it is sent.
const PATIENCE: Duration = Duration::from_secs(30);
/// It is asked this often whether it is there.
const PING_INTERVAL: Duration = Duration::from_secs(5);
/// How long a browser may take to say goodbye.
const GOODBYE: Duration = Duration::from_secs(1);
/// Portions of news that may be on their way to a browser.
const MAX_UNSEEN: u64 = 3;
/// Between two portions: eyes see no more.
const NEWS_INTERVAL: Duration = Duration::from_millis(20);
/// Between two requests: hands do no more.
const REQUEST_INTERVAL: Duration = Duration::from_millis(10);
/// Requests of one browser that may wait for the simulator's answer.
const MAX_REQUESTS: usize = 8;

/// Serves a browser until it leaves, is stuck, or the console ends.
pub(crate) async fn serve(mut socket: WebSocket, app: Arc<App>) {
    let Some(_place) = app.place() else {
        let why = format!("{MAX_BROWSERS} browsers watch already; close one of them");
        return say_goodbye(&mut socket, close_code::AGAIN, &why).await;
    };
    let mut browser = Browser::new(socket, app);
    match browser.converse().await {
        Farewell::Gone => {}
        Farewell::Stuck => {
            tracing::info!("a browser has taken nothing for {PATIENCE:?} and is let go")
        }
        Farewell::Dismissed(code, why) => say_goodbye(&mut browser.socket, code, &why).await,
    }
}

/// How a conversation ends.
enum Farewell {
    /// It has left.
    Gone,
    /// It does not read.
    Stuck,
    /// It is told to leave: WebSocket close code, and why.
    Dismissed(u16, String),
}

struct Browser {
    socket: WebSocket,
    app: Arc<App>,
    ending: watch::Receiver<bool>,
    /// What it sees of a run in progress.
    sight: Option<Sight>,
    answers: (mpsc::Sender<Utf8Bytes>, mpsc::Receiver<Utf8Bytes>),
    requests: Arc<Semaphore>,
    /// Portions of news sent, and of those the last that it has answered.
    portions: (u64, u64),
    heard: Instant,
    next_news: Instant,
    next_request: Instant,
    next_ping: Instant,
}

/// What a browser sees of a run in progress.
struct Sight {
    live: Arc<Live>,
    cursor: Cursor,
    changes: watch::Receiver<()>,
    /// As long as it is there, pictures are painted.
    _viewer: Viewer,
}

impl Sight {
    fn new(live: &Arc<Live>) -> Self {
        let mut changes = live.board().changes();
        changes.mark_changed();
        Self {
            live: live.clone(),
            cursor: Cursor::default(),
            changes,
            _viewer: live.viewer(),
        }
    }

    /// Waits until there may be something new to see.
    async fn news(sight: &mut Option<Self>, from: Instant) {
        sleep_until(from).await;
        match sight {
            // It cannot fail: the other end is in `live`.
            Some(sight) => drop(sight.changes.changed().await),
            None => std::future::pending().await,
        }
    }
}

impl Browser {
    fn new(socket: WebSocket, app: Arc<App>) -> Self {
        let now = Instant::now();
        let sight = match &app.mode {
            Mode::Live(live) => Some(Sight::new(live)),
            Mode::Recording(_) => None,
        };
        Self {
            socket,
            ending: app.ending(),
            app,
            sight,
            answers: mpsc::channel(MAX_REQUESTS),
            requests: Arc::new(Semaphore::new(MAX_REQUESTS)),
            portions: (0, 0),
            heard: now,
            next_news: now,
            next_request: now,
            next_ping: now + PING_INTERVAL,
        }
    }

    async fn converse(&mut self) -> Farewell {
        let outcome = match self.greet().await {
            Ok(()) => self.serve().await,
            Err(farewell) => Err(farewell),
        };
        match outcome {
            Ok(never) => match never {},
            Err(farewell) => farewell,
        }
    }

    async fn greet(&mut self) -> Result<(), Farewell> {
        let (mode, run) = match &self.app.mode {
            Mode::Live(live) => ("live", live.run()),
            Mode::Recording(recording) => ("recording", recording.run()),
        };
        let hello = ToPage::Hello {
            mode,
            run,
            version: env!("CARGO_PKG_VERSION"),
        }
        .text();
        self.send(Message::Text(hello)).await
    }

    async fn serve(&mut self) -> Result<std::convert::Infallible, Farewell> {
        loop {
            let may_see_more = self.portions.0 - self.portions.1 < MAX_UNSEEN;
            tokio::select! {
                message = receive(&mut self.socket, self.next_request) => self.on_message(message).await?,
                Some(answer) = self.answers.1.recv() => self.send(Message::Text(answer)).await?,
                () = Sight::news(&mut self.sight, self.next_news), if may_see_more => self.send_news().await?,
                () = sleep_until(self.next_ping) => self.look_after().await?,
                () = told_to_leave(&mut self.ending) => {
                    return Err(Farewell::Dismissed(close_code::AWAY, "the console ends".to_owned()));
                }
            }
        }
    }

    async fn send(&mut self, message: Message) -> Result<(), Farewell> {
        match timeout(PATIENCE, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(Farewell::Gone),
            Err(_) => Err(Farewell::Stuck),
        }
    }

    async fn send_news(&mut self) -> Result<(), Farewell> {
        let Some(sight) = &mut self.sight else {
            return Ok(());
        };
        let news = sight.live.board().news(&mut sight.cursor);
        if news.is_empty() {
            return Ok(());
        }
        // There may be more than fits into one portion.
        sight.changes.mark_changed();
        for text in news {
            self.send(Message::Text(text)).await?;
        }
        self.portions.0 += 1;
        self.next_news = Instant::now() + NEWS_INTERVAL;
        self.ping().await
    }

    async fn ping(&mut self) -> Result<(), Farewell> {
        self.next_ping = Instant::now() + PING_INTERVAL;
        self.send(Message::Ping(Bytes::copy_from_slice(
            &self.portions.0.to_be_bytes(),
        )))
        .await
    }

    /// Nothing was sent for a while: is it still there?
    async fn look_after(&mut self) -> Result<(), Farewell> {
        if self.heard.elapsed() > PATIENCE {
            Err(Farewell::Stuck)
        } else {
            self.ping().await
        }
    }

    async fn on_message(
        &mut self,
        message: Option<Result<Message, axum::Error>>,
    ) -> Result<(), Farewell> {
        self.heard = Instant::now();
        match message {
            Some(Ok(Message::Text(text))) => {
                self.next_request = self.heard + REQUEST_INTERVAL;
                self.on_text(&text).await
            }
            Some(Ok(Message::Pong(number))) => {
                let number = number.as_ref().try_into().map_or(0, u64::from_be_bytes);
                self.portions.1 = self.portions.1.max(number.min(self.portions.0));
                Ok(())
            }
            Some(Ok(Message::Ping(_))) => Ok(()), // It has been answered.
            Some(Ok(Message::Binary(_))) => Err(Farewell::Dismissed(
                close_code::UNSUPPORTED,
                "messages are text here".to_owned(),
            )),
            Some(Err(error)) => Err(Farewell::Dismissed(close_code::POLICY, error.to_string())),
            Some(Ok(Message::Close(_))) | None => Err(Farewell::Gone),
        }
    }

    async fn on_text(&mut self, text: &str) -> Result<(), Farewell> {
        let (id, control) = match serde_json::from_str(text) {
            Ok(FromPage::Control { id, control }) => (id, control),
            Err(error) => {
                let id = serde_json::from_str::<Numbered>(text)
                    .unwrap_or_default()
                    .id;
                return self
                    .decline(id, format!("malformed request: {error}"))
                    .await;
            }
        };
        if text.len() > MAX_PLAIN_BYTES
            && !matches!(control, Control::Load { .. } | Control::Init { .. })
        {
            let why = format!(
                "{} bytes, more than the {MAX_PLAIN_BYTES} allowed",
                text.len()
            );
            return Err(Farewell::Dismissed(close_code::SIZE, why));
        }
        if let Err((field, reason)) = control.check() {
            return self
                .decline(Some(id), format!("malformed request: {field}: {reason}"))
                .await;
        }
        let Some(sight) = &self.sight else {
            return self
                .decline(
                    Some(id),
                    "this is a recording: it can be played, not changed".to_owned(),
                )
                .await;
        };
        match (
            self.requests.clone().try_acquire_owned(),
            self.app.request(),
        ) {
            (Ok(own), Some(all)) => {
                tokio::spawn(request(
                    sight.live.clone(),
                    id,
                    control,
                    self.answers.0.clone(),
                    (own, all),
                ));
                Ok(())
            }
            _ => {
                self.decline(
                    Some(id),
                    "too many requests wait for an answer already".to_owned(),
                )
                .await
            }
        }
    }

    async fn decline(&mut self, id: Option<u64>, why: String) -> Result<(), Farewell> {
        self.send(Message::Text(ToPage::answer(id, Err(why)).text()))
            .await
    }
}

/// The next message, but none before `from`.
async fn receive(socket: &mut WebSocket, from: Instant) -> Option<Result<Message, axum::Error>> {
    sleep_until(from).await;
    socket.recv().await
}

/// Asks the simulator. `_places` are free again when its answer is on the way.
async fn request(
    live: Arc<Live>,
    id: u64,
    control: Control,
    answers: mpsc::Sender<Utf8Bytes>,
    _places: (OwnedSemaphorePermit, OwnedSemaphorePermit),
) {
    let asked = tokio::task::spawn_blocking(move || live.control(&control)).await;
    let outcome: Result<ControlAnswer, String> =
        asked.unwrap_or_else(|error| Err(error.to_string()));
    if answers
        .send(ToPage::answer(Some(id), outcome).text())
        .await
        .is_err()
    {
        tracing::debug!("a browser left before its answer came");
    }
}

async fn say_goodbye(socket: &mut WebSocket, code: u16, why: &str) {
    // A control frame has room for 125 bytes, two of them for the code.
    let reason: String = why.chars().filter(char::is_ascii).take(120).collect();
    let goodbye = Message::Close(Some(CloseFrame {
        code,
        reason: reason.into(),
    }));
    let both = async {
        socket.send(goodbye).await?;
        while socket.recv().await.transpose()?.is_some() {}
        Ok::<(), axum::Error>(())
    };
    if !matches!(timeout(GOODBYE, both).await, Ok(Ok(()))) {
        tracing::debug!("a browser left without a goodbye");
    }
}
