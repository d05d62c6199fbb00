//! The program `cars-console`: shows a run, or a recording of one, in a browser, and sends the simulator what people request
//! there.
//!
//! The console is an observer. It forwards what the run publishes to browsers and forwards requests to the simulator,
//! which decides. A run is the same with or without it.

mod app;
mod browser;
mod decisions;
mod diagrams;
mod failed;
mod failing;
mod feed;
mod guard;
mod live;
mod opening;
mod page;
mod past;
mod playback;
mod saved_session;
mod server;

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use bus::DEFAULT_ENDPOINT;
use clap::Parser;
use protocol::RunName;
use terminal::RESUME;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::signal::unix::{Signal, SignalKind, signal};

use app::{App, Mode};
use failing::AfterFailure;
use guard::{AllowedHost, Guard};
use live::Live;
use past::RecordedEpochs;
use saved_session::SavedSession;

/// The address to serve at without `--bind`.
const DEFAULT_BIND: &str = "127.0.0.1:7007";
/// The address to serve at if the default port is in use: any free port.
const FALLBACK_BIND: &str = "127.0.0.1:0";
/// How long browsers have to close their connections when the console ends.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long to wait for threads that are blocked on a reply of the simulator.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(200);

/// The web console of the Cooperative Affective Robot Simulator.
#[derive(Debug, Parser)]
#[command(name = "cars-console", version)]
struct ConsoleArgs {
    /// The run to watch.
    #[arg(long, env = "CARS_RUN", default_value = "default")]
    run: RunName,
    /// Where its simulator listens.
    #[arg(long, env = "CARS_CONNECT", default_value = DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    connect: String,
    /// A zenoh configuration file to use instead of the built-in settings.
    #[arg(long, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// Address and port to serve at; port 0 takes a free one. The default is 127.0.0.1:7007, or a free port if that one
    /// is in use. Only browsers that open the printed URL, which contains a token, are admitted; any address but loopback
    /// also serves those on other machines, unencrypted.
    #[arg(long, env = "CARS_CONSOLE_BIND", value_name = "ADDRESS:PORT")]
    bind: Option<SocketAddr>,
    /// Show the recording in this run's folder, or this recording, instead of a run in progress.
    #[arg(long, value_name = "RUN-FOLDER")]
    recording: Option<PathBuf>,
    /// The folder of the run in progress, if it is on this machine: the page shows from it what has happened before.
    #[arg(long, value_name = "RUN-FOLDER", conflicts_with = "recording")]
    folder: Option<PathBuf>,
    /// Open the page in a browser.
    #[arg(long)]
    open: bool,
    /// With --open: how long the run waits for the browser, seconds. If none has come by then, the console begins the run.
    #[arg(long, value_name = "SECONDS", requires = "open", hide = true, value_parser = seconds)]
    begin_after: Option<Duration>,
    /// How long to wait for a reply of the simulator, seconds.
    #[arg(
        long,
        env = "CARS_CONSOLE_REPLY_TIMEOUT",
        value_name = "SECONDS",
        default_value = "5",
        value_parser = seconds
    )]
    reply_timeout: Duration,
    /// Keep address and token in this file, and take those that it has: browsers that were admitted stay so when a console that
    /// was killed is started again.
    #[arg(long, env = "CARS_CONSOLE_KEEP", value_name = "FILE")]
    keep: Option<PathBuf>,
    /// The file in which the launcher says that the run has failed: the page shows why, and the console stays while a browser
    /// shows it.
    #[arg(long, env = "CARS_CONSOLE_FAILED", value_name = "FILE", hide = true)]
    failed: Option<PathBuf>,
    /// Admit requests that name this host, too, with its port unless it is the usual one: that of a proxy, which also brings TLS.
    /// Can be given several times.
    #[arg(
        long,
        env = "CARS_CONSOLE_ALLOW_HOST",
        value_name = "HOST[:PORT]",
        value_delimiter = ','
    )]
    allow_host: Vec<AllowedHost>,
}

/// How the page is served.
struct Serving {
    bind: Option<SocketAddr>,
    /// Whether a browser is started.
    opens: bool,
    /// After how long the run begins without a browser; `None` if it does not wait for one.
    begins_after: Option<Duration>,
    keep: Option<PathBuf>,
    failed: Option<PathBuf>,
    allowed: Vec<AllowedHost>,
}

fn main() -> ExitCode {
    bus::runtime::use_one_thread();
    let args: ConsoleArgs = match terminal::arguments() {
        Ok(args) => args,
        Err(code) => return code,
    };
    terminal::print_diagnostics("warn,zenoh=error");

    match run(args) {
        Ok(AfterFailure::End) => ExitCode::SUCCESS,
        Ok(AfterFailure::Resume) => ExitCode::from(RESUME),
        Err(error) => {
            terminal::note(format_args!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}

fn run(args: ConsoleArgs) -> Result<AfterFailure, String> {
    let (mode, past) = match args.recording {
        Some(path) => open_recording(&path)?,
        None => {
            let run = args.run.clone();
            let past = args
                .folder
                .map(|folder| RecordedEpochs::growing(folder, run));
            let config = args.zenoh_config;
            let live = Live::start(args.run, args.connect, config, args.reply_timeout)?;
            (Mode::Live(live), past)
        }
    };
    let serving = Serving {
        bind: args.bind,
        opens: args.open,
        begins_after: args.begin_after,
        keep: args.keep,
        failed: args.failed,
        allowed: args.allow_host,
    };
    let runtime = build_runtime()?;

    let outcome = runtime.block_on(serve(mode, past, serving));

    // Requests that still wait for the simulator get no answer any more.
    runtime.shutdown_timeout(SHUTDOWN_TIMEOUT);
    outcome
}

/// A time on the command line, in seconds.
fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text
        .parse()
        .map_err(|_| "not a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}

fn open_recording(path: &std::path::Path) -> Result<(Mode, Option<RecordedEpochs>), String> {
    let past = RecordedEpochs::finished(path).map_err(|error| error.to_string())?;
    let last = past.last().map_err(|error| error.to_string())?;
    let run = last.run().to_owned();
    Ok((Mode::Recording(run), Some(past)))
}

fn build_runtime() -> Result<Runtime, String> {
    // The runtime panics where a thread cannot be started.
    bus::runtime::check_threads().map_err(|error| format!("no thread can be started: {error}"))?;
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|error| format!("cannot start: {error}"))
}

/// Serves until the process receives SIGTERM or SIGINT, or until a run that has failed is not looked at any more.
async fn serve(
    mode: Mode,
    past: Option<RecordedEpochs>,
    how: Serving,
) -> Result<AfterFailure, String> {
    let kept = how.keep.as_deref().and_then(SavedSession::read);
    if let Some(file) = how.keep.as_deref().filter(|_| kept.is_none()) {
        SavedSession::check_replaceable(file)?;
    }
    let listener = match &kept {
        Some(kept) => listen_again(kept.address, how.bind).await?,
        None => listen(how.bind).await?,
    };
    let address = listener
        .local_addr()
        .map_err(|error| format!("cannot serve: {error}"))?;
    let was_open = kept.is_some();
    let guard = match kept {
        Some(kept) => Guard::again(address, kept.token, &kept.path),
        None => Guard::new(address).map_err(|error| format!("cannot create a token: {error}"))?,
    };
    let guard = guard.allowing(how.allowed);
    if let Some(file) = &how.keep
        && let Err(error) = SavedSession::of(&guard).write(file)
    {
        tracing::warn!("{}: {error}", file.display());
    }
    let url = guard.url();
    let has_guide = how.opens && matches!(mode, Mode::Live(_));
    let app = Arc::new(App::new(guard, mode, past, has_guide));
    let mut terminate = handle(SignalKind::terminate())?;
    let mut interrupt = handle(SignalKind::interrupt())?;

    announce(address, &url);
    let is_opening = how.opens && !was_open && opening::open(&url, app.clone());
    if let Some(patience) = how.begins_after.filter(|_| !was_open) {
        tokio::spawn(opening::begin_without_browser(patience, app.clone()));
    }
    let failure = async {
        match &how.failed {
            Some(file) => failing::watch(file, &app, is_opening || was_open).await,
            None => std::future::pending().await,
        }
    };

    let serving = tokio::spawn(server::serve(listener, app.clone()));
    let next = tokio::select! {
        _ = terminate.recv() => AfterFailure::End,
        _ = interrupt.recv() => AfterFailure::End,
        next = failure => next,
    };

    app.end();
    if tokio::time::timeout(CLOSE_TIMEOUT, serving).await.is_err() {
        tracing::debug!("a browser did not close its connection in time");
    }
    app.close();
    Ok(next)
}

fn announce(address: SocketAddr, url: &str) {
    if !address.ip().is_loopback() {
        terminal::note(format_args!(
            "the console is open to the network at {address}; anyone with the token controls the run"
        ));
    }
    // Without a reader of the address, browsers that have it can still connect.
    if let Err(error) = terminal::print_line(format_args!("console: {url}")) {
        tracing::warn!("{error}");
    }
}

fn handle(kind: SignalKind) -> Result<Signal, String> {
    signal(kind).map_err(|error| format!("cannot listen for signals: {error}"))
}

/// Binds the requested address or fails; the default address falls back to a free port.
async fn listen(requested: Option<SocketAddr>) -> Result<TcpListener, String> {
    if let Some(address) = requested {
        return TcpListener::bind(address)
            .await
            .map_err(|error| bind_error(&address.to_string(), &error));
    }

    match TcpListener::bind(DEFAULT_BIND).await {
        Ok(listener) => Ok(listener),
        Err(error) if error.kind() == ErrorKind::AddrInUse => listen_on_free_port().await,
        Err(error) => Err(bind_error(DEFAULT_BIND, &error)),
    }
}

/// Binds the address of a console that was here before, or another one.
async fn listen_again(
    before: SocketAddr,
    requested: Option<SocketAddr>,
) -> Result<TcpListener, String> {
    match TcpListener::bind(before).await {
        Ok(listener) => Ok(listener),
        Err(_) => listen(requested).await,
    }
}

async fn listen_on_free_port() -> Result<TcpListener, String> {
    terminal::note(format_args!(
        "{DEFAULT_BIND} is in use, perhaps by another console; this one takes a free port"
    ));

    TcpListener::bind(FALLBACK_BIND)
        .await
        .map_err(|error| bind_error(FALLBACK_BIND, &error))
}

fn bind_error(address: &str, error: &std::io::Error) -> String {
    format!(
        "cannot serve at {address}: {error}; choose another address with --bind, port 0 takes a free one"
    )
}
