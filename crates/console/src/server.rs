//! The HTTP side: what can be asked for, by whom, and for how long.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, Request, State, WebSocketUpgrade};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rust_embed::Embed;
use serde::Deserialize;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};

use crate::browser;
use crate::guard::{Guard, HEADERS};
use crate::live::Live;
use crate::recording::{MAX_TICKS, Recording};

/// Most browsers at a time.
pub(crate) const MAX_BROWSERS: usize = 32;
/// Most connections at a time; a browser uses one for its WebSocket and up to six for everything else.
const MAX_CONNECTIONS: usize = 256;
/// Most requests, of all browsers, that may wait for the simulator's answer; each holds a thread.
const MAX_REQUESTS: usize = 64;
/// Most answers that are read from a recording at a time.
const MAX_READS: usize = 2;
/// A client that has said nothing for this long, or does not come to the end of its request, is let go.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(20);

/// The page.
#[derive(Embed)]
#[folder = "assets/"]
struct Assets;

/// What is shown.
pub(crate) enum Mode {
    /// A run in progress, or one that is still to come.
    Live(Arc<Live>),
    /// A run of the past.
    Recording(Recording),
}

/// The console.
pub(crate) struct App {
    guard: Guard,
    /// What is shown.
    pub(crate) mode: Mode,
    browsers: Arc<Semaphore>,
    requests: Arc<Semaphore>,
    reads: Semaphore,
    ending: watch::Sender<bool>,
}

impl App {
    /// A console that shows `mode` to those whom `guard` lets in.
    pub(crate) fn new(guard: Guard, mode: Mode) -> Self {
        Self {
            guard,
            mode,
            browsers: Arc::new(Semaphore::new(MAX_BROWSERS)),
            requests: Arc::new(Semaphore::new(MAX_REQUESTS)),
            reads: Semaphore::new(MAX_READS),
            ending: watch::Sender::new(false),
        }
    }

    /// Tells everybody to leave.
    pub(crate) fn end(&self) {
        self.ending.send_replace(true);
    }

    /// Turns `true` when everybody is told to leave.
    pub(crate) fn ending(&self) -> watch::Receiver<bool> {
        self.ending.subscribe()
    }

    /// Takes leave of the run.
    pub(crate) fn close(&self) {
        if let Mode::Live(live) = &self.mode {
            live.end();
        }
    }

    /// A place for a request; none if all are taken.
    pub(crate) fn request(&self) -> Option<OwnedSemaphorePermit> {
        self.requests.clone().try_acquire_owned().ok()
    }

    /// A place for a browser; none if all are taken.
    pub(crate) fn place(&self) -> Option<OwnedSemaphorePermit> {
        self.browsers.clone().try_acquire_owned().ok()
    }
}

/// Waits until everybody is told to leave.
pub(crate) async fn told_to_leave(ending: &mut watch::Receiver<bool>) {
    // Also when the console itself is gone, which is the only way in which this fails.
    let _is_ending = ending.wait_for(|is_ending| *is_ending).await;
}

fn routes(app: Arc<App>) -> Router {
    Router::new()
        .route("/", get(async || asset("index.html")))
        .route(
            "/assets/{*path}",
            get(async |Path(path): Path<String>| asset(&path)),
        )
        .route("/ws", get(socket))
        .route("/recording", get(recording))
        .route("/recording/ticks", get(ticks))
        .fallback(async || not_found())
        .layer(from_fn_with_state(app.clone(), guard))
        .with_state(app)
}

/// Serves until it is told to end, and until everybody has left.
pub(crate) async fn serve(listener: TcpListener, app: Arc<App>) {
    let (routes, connections) = (
        routes(app.clone()),
        Arc::new(Semaphore::new(MAX_CONNECTIONS)),
    );
    let mut ending = app.ending();
    loop {
        // A semaphore that nobody closes: who comes when all places are taken waits at the door.
        let Ok(place) = connections.clone().acquire_owned().await else {
            break;
        };
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = told_to_leave(&mut ending) => break,
        };
        match accepted {
            Ok((stream, _)) => {
                tokio::spawn(converse(stream, routes.clone(), app.ending(), place));
            }
            Err(error) => {
                // No file handles left, for example: it passes when somebody leaves.
                tracing::warn!("a connection failed: {error}");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
    drop(listener);
    let _everybody = connections.acquire_many(MAX_CONNECTIONS as u32).await;
    // WebSockets are no longer their connections' business.
    let _browsers = app.browsers.acquire_many(MAX_BROWSERS as u32).await;
}

/// One connection, until it ends; a request that has been read is answered.
async fn converse(
    stream: TcpStream,
    routes: Router,
    mut ending: watch::Receiver<bool>,
    _place: OwnedSemaphorePermit,
) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!("a connection is gone already: {error}");
    }
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(REQUEST_TIMEOUT)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(routes))
        .with_upgrades();
    let mut connection = std::pin::pin!(connection);
    let outcome = tokio::select! {
        outcome = connection.as_mut() => outcome,
        () = told_to_leave(&mut ending) => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = outcome {
        tracing::debug!("a connection ended: {error}");
    }
}

/// Nothing is answered that the guard has not seen, and nothing without the headers that protect the page.
async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let refused = app.guard.refuse(
        request.headers(),
        request.uri().path(),
        request.uri().query(),
    );
    let mut response = match refused {
        Some(why) => (StatusCode::FORBIDDEN, why).into_response(),
        None => next.run(request).await,
    };
    response.headers_mut().extend(HEADERS);
    response
        .headers_mut()
        .entry(CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-store"));
    response
}

fn asset(path: &str) -> Response {
    match Assets::get(path) {
        Some(file) => ([(CONTENT_TYPE, content_type(path))], file.data).into_response(),
        None => not_found(),
    }
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "woff2" => "font/woff2",
        _ => "text/plain; charset=utf-8",
    }
}

fn not_found() -> Response {
    (StatusCode::NOT_FOUND, "There is nothing here.\n").into_response()
}

async fn socket(State(app): State<Arc<App>>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(browser::MAX_BYTES)
        .max_frame_size(browser::MAX_BYTES)
        .on_upgrade(|socket| browser::serve(socket, app))
}

async fn recording(State(app): State<Arc<App>>) -> Response {
    match &app.mode {
        Mode::Recording(recording) => json(&recording.summary()),
        Mode::Live(_) => not_found(),
    }
}

/// Which ticks are asked for.
#[derive(Deserialize)]
struct Wanted {
    from: u64,
    count: u64,
}

async fn ticks(
    State(app): State<Arc<App>>,
    wanted: Result<Query<Wanted>, QueryRejection>,
) -> Response {
    let Query(Wanted { from, count }) = match wanted {
        Ok(wanted) if wanted.count <= MAX_TICKS => wanted,
        _ => {
            let why = format!("Ask for ?from=TICK&count=N with N up to {MAX_TICKS}.\n");
            return (StatusCode::BAD_REQUEST, why).into_response();
        }
    };
    if matches!(app.mode, Mode::Live(_)) {
        return not_found();
    }
    let Ok(_turn) = app.reads.acquire().await else {
        return not_found();
    };
    let reader = app.clone();
    let range = tokio::task::spawn_blocking(move || match &reader.mode {
        Mode::Recording(recording) => recording.range(from, count).map(|range| json(&range)),
        Mode::Live(_) => Ok(not_found()),
    });
    let failed = |error: &dyn std::fmt::Display| {
        (StatusCode::INTERNAL_SERVER_ERROR, format!("{error}\n")).into_response()
    };
    match range.await {
        Ok(Ok(response)) => response,
        Ok(Err(error)) => failed(&error),
        Err(error) => failed(&error),
    }
}

fn json(value: &impl serde::Serialize) -> Response {
    match serde_json::to_vec(value) {
        Ok(text) => ([(CONTENT_TYPE, "application/json")], text).into_response(),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, format!("{error}\n")).into_response(),
    }
}
