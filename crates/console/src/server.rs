//! The HTTP side: routes, connections and their limits.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, Request, State, WebSocketUpgrade};
use axum::http::header::{CACHE_CONTROL, CONNECTION, CONTENT_TYPE, LOCATION, SET_COOKIE};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use include_dir::{Dir, include_dir};
use protocol::{Epoch, Tick};
use serde::{Deserialize, Serialize};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, Semaphore};

use crate::app::{App, Ending};
use crate::browser;
use crate::decisions::ShownDecisions;
use crate::diagrams::{DiagramError, MAX_WINDOW_TICKS, WindowQuery};
use crate::guard::{ENTRANCE, HEADERS, RequestRefusal};
use crate::playback::{MAX_SAMPLED_TICKS, MAX_TICKS, RecordedEpoch, Wanted};

/// Most connections at a time; a browser uses one for its WebSocket and up to six for HTTP requests.
const MAX_CONNECTIONS: usize = 256;
/// A connection is closed if a request's header does not arrive completely within this time.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(20);
/// Pause after a failed accept.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);

/// Why there is no past of a run whose folder the console was not given.
const NO_FOLDER: &str = "this console was not told the run's folder (--folder RUN-FOLDER)";

/// The style sheet of diagrams, which is not a file: the crate that draws them has it.
const DIAGRAM_STYLE: &str = "diagram.css";

/// The files of the page.
static ASSETS: Dir = include_dir!("$CARGO_MANIFEST_DIR/assets");

fn routes(app: Arc<App>) -> Router {
    let page = app.guard.path();

    Router::new()
        .route(ENTRANCE, get(enter))
        .route(page, get(async || asset("index.html")))
        .route(
            &format!("{page}assets/{{*path}}"),
            get(async |Path(path): Path<String>| asset(&path)),
        )
        .route(&format!("{page}assets/{DIAGRAM_STYLE}"), get(diagram_style))
        .route(&format!("{page}ws"), get(socket))
        .route(&format!("{page}recording"), get(recording))
        .route(&format!("{page}recording/ticks"), get(ticks))
        .route(&format!("{page}recording/names"), get(names))
        .route(&format!("{page}recording/decisions"), get(decisions))
        .route(&format!("{page}recording/diagram"), get(diagram))
        .fallback(async || not_found())
        .layer(from_fn_with_state(app.clone(), guard))
        .with_state(app)
}

/// Connections that have not sent a complete request yet, the oldest first.
#[derive(Default)]
struct OpeningConnections(Mutex<BTreeMap<u64, Arc<Notify>>>);

/// A connection that has not sent a complete request yet; it is counted until it has, or is dropped.
struct Newcomer {
    unheard: Arc<OpeningConnections>,
    number: u64,
    /// Notified when the connection has to make room.
    evicted: Arc<Notify>,
}

impl OpeningConnections {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Arc<Notify>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a connection in. Numbers rise.
    fn admit(self: &Arc<Self>, number: u64) -> Newcomer {
        let evicted = Arc::new(Notify::new());
        self.lock().insert(number, evicted.clone());
        Newcomer {
            unheard: self.clone(),
            number,
            evicted,
        }
    }

    /// Closes the oldest connection, if there is one: it has had the most time to send something.
    fn evict(&self) {
        if let Some((_, oldest)) = self.lock().pop_first() {
            oldest.notify_one();
        }
    }
}

impl Newcomer {
    /// A complete request has arrived.
    fn is_heard(&self) {
        self.unheard.lock().remove(&self.number);
    }
}

impl Drop for Newcomer {
    fn drop(&mut self) {
        self.is_heard();
    }
}

/// Serves until the console ends and all clients are disconnected.
pub(crate) async fn serve(listener: TcpListener, app: Arc<App>) {
    let routes = routes(app.clone());
    let connections = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let unheard = Arc::new(OpeningConnections::default());
    let mut ending = app.ending();

    for number in 0.. {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = ending.reached() => break,
        };

        match accepted {
            Ok((stream, _)) => {
                // At the limit a silent connection makes room. Where there is none, clients wait in the listener's backlog.
                if connections.available_permits() == 0 {
                    unheard.evict();
                }
                let permit = tokio::select! {
                    permit = connections.clone().acquire_owned() => permit,
                    () = ending.reached() => break,
                };
                let Ok(permit) = permit else {
                    unreachable!("the semaphore is never closed")
                };
                let connection =
                    serve_connection(stream, routes.clone(), app.ending(), unheard.admit(number));
                tokio::spawn(async {
                    connection.await;
                    drop(permit);
                });
            }
            Err(error) => {
                // Too many open files, for example: a connection that closes makes room.
                tracing::warn!("a connection failed: {error}");
                tokio::time::sleep(ACCEPT_RETRY).await;
            }
        }
    }

    drop(listener);
    let _all = connections.acquire_many(MAX_CONNECTIONS as u32).await;
    // An upgraded WebSocket has given back its connection's permit, so browsers are waited for separately.
    app.browsers_left().await;
}

/// Serves one connection until it closes; a request that has been read is answered.
async fn serve_connection(
    stream: TcpStream,
    routes: Router,
    mut ending: Ending,
    newcomer: Newcomer,
) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!("a connection is closed already: {error}");
    }

    let evicted = newcomer.evicted.clone();
    let routes = TowerToHyperService::new(routes);
    let service = service_fn(move |request| {
        newcomer.is_heard();
        routes.call(request)
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(REQUEST_TIMEOUT)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    let mut connection = pin!(connection);

    let outcome = tokio::select! {
        outcome = connection.as_mut() => outcome,
        () = evicted.notified() => return,
        () = ending.reached() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };

    if let Err(error) = outcome {
        tracing::debug!("a connection ended: {error}");
    }
}

/// Every request passes the guard, and every response carries the headers that protect the page.
async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let uri = request.uri();
    let refusal = app.guard.refuse(request.headers(), uri.path(), uri.query());

    let mut response = match refusal {
        Some(refusal) => refused(refusal),
        None => next.run(request).await,
    };

    let headers = response.headers_mut();
    headers.extend(HEADERS);
    headers
        .entry(CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-store"));
    response
}

/// The response to a request that is not admitted. It closes the connection, so that clients without the token cannot keep
/// all connections of the console.
fn refused(refusal: RequestRefusal) -> Response {
    let explanation = match refusal {
        RequestRefusal::Foreign(reason) => reason.into_response(),
        RequestRefusal::NoToken => asset("token.html"),
    };

    (StatusCode::FORBIDDEN, [(CONNECTION, "close")], explanation).into_response()
}

/// Gives a browser that has shown the token its cookie, and sends it to the page, whose address has no token.
async fn enter(State(app): State<Arc<App>>) -> Response {
    app.on_entry();

    let headers = [
        (LOCATION, app.guard.path().to_owned()),
        (SET_COOKIE, app.guard.cookie()),
    ];
    (StatusCode::SEE_OTHER, headers).into_response()
}

fn asset(path: &str) -> Response {
    match ASSETS.get_file(path) {
        Some(file) => ([(CONTENT_TYPE, content_type(path))], file.contents()).into_response(),
        None => not_found(),
    }
}

fn content_type(path: &str) -> &'static str {
    let extension = path.rsplit_once('.').map_or("", |(_, extension)| extension);

    match extension {
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
    (StatusCode::NOT_FOUND, "Not found.\n").into_response()
}

async fn socket(State(app): State<Arc<App>>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(browser::MAX_BYTES)
        .max_frame_size(browser::MAX_BYTES)
        .on_upgrade(|socket| browser::serve(socket, app))
}

/// Which epoch is asked for, as a query string states it.
#[derive(Deserialize)]
struct WhichEpoch {
    /// None for the last one.
    epoch: Option<Epoch>,
}

/// What a run in progress has not recorded is no failure of a request: the page shows why.
#[derive(Serialize)]
struct Missing {
    missing: String,
}

async fn recording(
    State(app): State<Arc<App>>,
    query: Result<Query<WhichEpoch>, QueryRejection>,
) -> Response {
    let Ok(Query(WhichEpoch { epoch })) = query else {
        return bad_range();
    };
    read(app, move |app| summarize(app, epoch)).await
}

/// Reads from the recording's files; blocks.
fn summarize(app: &App, epoch: Option<Epoch>) -> Response {
    let Some(past) = &app.past else {
        return json(&Missing {
            missing: NO_FOLDER.to_owned(),
        });
    };
    match past.epoch(epoch) {
        Ok(found) => json_text(found.summary(&past.epochs())),
        Err(error) => json(&Missing {
            missing: error.to_string(),
        }),
    }
}

/// Answers a request from the recording's files, not many at a time.
async fn read(app: Arc<App>, answer: impl FnOnce(&App) -> Response + Send + 'static) -> Response {
    let Some(_permit) = app.admit_read().await else {
        return not_found();
    };

    let reader = app.clone();
    let read = tokio::task::spawn_blocking(move || answer(&reader));
    read.await.unwrap_or_else(|error| internal_error(&error))
}

/// Answers from the recording of an epoch, or that there is none.
fn with_epoch(
    app: &App,
    epoch: Option<Epoch>,
    answer: impl FnOnce(&RecordedEpoch) -> Response,
) -> Response {
    let Some(past) = &app.past else {
        return not_found();
    };
    match past.epoch(epoch) {
        Ok(recording) => answer(&recording),
        Err(error) => (StatusCode::NOT_FOUND, format!("{error}\n")).into_response(),
    }
}

/// A range of ticks, as the query string of a request states it.
#[derive(Deserialize)]
struct TickRange {
    from: Tick,
    count: u64,
    every: Option<u64>,
    epoch: Option<Epoch>,
}

async fn ticks(
    State(app): State<Arc<App>>,
    query: Result<Query<TickRange>, QueryRejection>,
) -> Response {
    let Ok(Query(TickRange {
        from,
        count,
        every,
        epoch,
    })) = query
    else {
        return bad_range();
    };

    let wanted = Wanted { from, count, every };
    if !wanted.is_valid() {
        return bad_range();
    }

    let answer = move |app: &App| with_epoch(app, epoch, |recording| read_ticks(recording, wanted));
    read(app, answer).await
}

/// Reads from the recording's files; blocks.
fn read_ticks(recording: &RecordedEpoch, wanted: Wanted) -> Response {
    match recording.range(wanted) {
        Ok(range) => json_text(range),
        Err(error) => internal_error(&error),
    }
}

async fn names(
    State(app): State<Arc<App>>,
    query: Result<Query<WhichEpoch>, QueryRejection>,
) -> Response {
    let Ok(Query(WhichEpoch { epoch })) = query else {
        return bad_range();
    };
    read(app, move |app| with_epoch(app, epoch, read_names)).await
}

/// Reads from the recording's files; blocks.
fn read_names(recording: &RecordedEpoch) -> Response {
    match recording.names() {
        Ok(names) => json_text(names),
        Err(error) => internal_error(&error),
    }
}

async fn decisions(
    State(app): State<Arc<App>>,
    query: Result<Query<WhichEpoch>, QueryRejection>,
) -> Response {
    let Ok(Query(WhichEpoch { epoch })) = query else {
        return bad_range();
    };
    // The page asks from time to time: that there is nothing yet is no failure.
    let answer = move |app: &App| {
        let found = app.past.as_ref().and_then(|past| past.decisions(epoch));
        json(&ShownDecisions::from(found.unwrap_or_default()))
    };
    read(app, answer).await
}

async fn diagram_style() -> Response {
    (
        [(CONTENT_TYPE, content_type(DIAGRAM_STYLE))],
        pictures::style(),
    )
        .into_response()
}

async fn diagram(
    State(app): State<Arc<App>>,
    query: Result<Query<WindowQuery>, QueryRejection>,
) -> Response {
    let window = match query {
        Ok(Query(window)) if window.is_valid() => window,
        _ => return bad_window(),
    };

    let answer = move |app: &App| {
        with_epoch(app, window.epoch, |recording| {
            draw_diagram(recording, window)
        })
    };
    read(app, answer).await
}

/// Reads from the recording's files; blocks.
fn draw_diagram(recording: &RecordedEpoch, window: WindowQuery) -> Response {
    match recording.diagram(window) {
        Ok(svg) => ([(CONTENT_TYPE, content_type("diagram.svg"))], svg).into_response(),
        Err(error @ DiagramError::TooMuch(_)) => {
            (StatusCode::UNPROCESSABLE_ENTITY, format!("{error}\n")).into_response()
        }
        Err(DiagramError::Unreadable(error)) => internal_error(&error),
    }
}

fn bad_window() -> Response {
    let reason = format!(
        "Request ?from=TICK&count=N&width=PX with N up to {MAX_WINDOW_TICKS} and PX from 300 to 4800.\n"
    );
    (StatusCode::BAD_REQUEST, reason).into_response()
}

fn bad_range() -> Response {
    let reason = format!(
        "Request ?from=TICK&count=N with N up to {MAX_TICKS}, or ?from=TICK&count=N&every=K with N up to {MAX_SAMPLED_TICKS}.\n"
    );
    (StatusCode::BAD_REQUEST, reason).into_response()
}

fn json(value: &impl serde::Serialize) -> Response {
    match serde_json::to_vec(value) {
        Ok(text) => json_text(text),
        Err(error) => internal_error(&error),
    }
}

fn json_text(text: Vec<u8>) -> Response {
    ([(CONTENT_TYPE, "application/json")], text).into_response()
}

fn internal_error(error: &dyn Display) -> Response {
    (StatusCode::INTERNAL_SERVER_ERROR, format!("{error}\n")).into_response()
}
