//! `cars-console`: shows a run, or a recording of one, in a browser, and has its buttons.
//!
//! It watches from the outside: what it is shown, it passes on; what is asked of it, it hands to the simulator, which
//! decides. Whether it is there, and who looks at it, makes no difference to a run.

mod board;
mod browser;
mod guard;
mod live;
mod page;
mod recording;
mod server;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use bus::DEFAULT_ENDPOINT;
use clap::Parser;
use protocol::RunName;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

use guard::Guard;
use live::Live;
use recording::Recording;
use server::{App, Mode};

/// Where the console is unless told otherwise.
const DEFAULT_BIND: &str = "127.0.0.1:7007";
/// How long the browsers get to say goodbye.
const GOODBYE: Duration = Duration::from_secs(2);

/// The web console of the Cooperative Affective Robot Simulator.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    /// The run to watch.
    #[arg(long, env = "CARS_RUN", default_value = "default")]
    run: RunName,
    /// Where its simulator listens.
    #[arg(long, env = "CARS_CONNECT", default_value = DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    connect: String,
    /// A configuration file of the middleware instead of the built-in settings.
    #[arg(long, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// Address and port to serve at; port 0 takes a free one. Without it 127.0.0.1:7007, or a free port if that one is
    /// taken. Everything but loopback opens the run to the network, to those who have the token in the address printed.
    #[arg(long, env = "CARS_CONSOLE_BIND", value_name = "ADDRESS:PORT")]
    bind: Option<SocketAddr>,
    /// Show the recording in this run's folder, or this recording, instead of a run in progress.
    #[arg(long, value_name = "RUN-FOLDER")]
    recording: Option<PathBuf>,
    /// Open the page in a browser.
    #[arg(long)]
    open: bool,
}

fn main() -> ExitCode {
    bus::runtime::use_one_thread();
    let args = Args::parse();
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| "warn,zenoh=error".into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .init();
    match run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: Args) -> Result<(), String> {
    let mode = match args.recording {
        Some(path) => Mode::Recording(Recording::open(&path).map_err(|error| error.to_string())?),
        None => Mode::Live(Live::start(args.run, args.connect, args.zenoh_config)?),
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|error| format!("cannot start: {error}"))?;
    let outcome = runtime.block_on(serve(args.bind, mode, args.open));
    // Whoever still waits for an answer of the simulator waits in vain.
    runtime.shutdown_timeout(Duration::from_millis(200));
    outcome
}

/// Serves until it is told to end.
async fn serve(bind: Option<SocketAddr>, mode: Mode, opens: bool) -> Result<(), String> {
    let listener = listen(bind).await?;
    let address = listener
        .local_addr()
        .map_err(|error| format!("cannot serve: {error}"))?;
    let guard = Guard::new(address).map_err(|error| format!("cannot draw a token: {error}"))?;
    let url = guard.url();
    let app = Arc::new(App::new(guard, mode));
    let mut ended = (
        termination(SignalKind::terminate())?,
        termination(SignalKind::interrupt())?,
    );
    if !address.ip().is_loopback() {
        eprintln!(
            "the console is open to the network at {address}; whoever has the token controls the run"
        );
    }
    println!("console: {url}");
    if opens {
        open_browser(&url);
    }
    let serving = tokio::spawn(server::serve(listener, app.clone()));
    tokio::select! {
        _ = ended.0.recv() => {}
        _ = ended.1.recv() => {}
    }
    app.end();
    if tokio::time::timeout(GOODBYE, serving).await.is_err() {
        tracing::debug!("a browser did not say goodbye");
    }
    app.close();
    Ok(())
}

/// Opens the page with what the system, or the variable `BROWSER`, opens pages with. Without one the address is printed all
/// the same.
fn open_browser(url: &str) {
    let system = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let program = std::env::var("BROWSER").unwrap_or_else(|_| system.to_owned());
    let quiet = std::process::Stdio::null;
    let started = std::process::Command::new(&program)
        .arg(url)
        .stdout(quiet())
        .stderr(quiet())
        .spawn();
    if let Err(error) = started {
        eprintln!("{program} cannot be started ({error}): open the address above yourself");
    }
}

fn termination(kind: SignalKind) -> Result<tokio::signal::unix::Signal, String> {
    signal(kind).map_err(|error| format!("cannot listen for signals: {error}"))
}

/// An address that was asked for is that one or none; the default gives way.
async fn listen(bind: Option<SocketAddr>) -> Result<TcpListener, String> {
    let failed = |at: &str, error: std::io::Error| {
        format!(
            "cannot serve at {at}: {error}; choose another address with --bind, port 0 takes a free one"
        )
    };
    if let Some(address) = bind {
        return TcpListener::bind(address)
            .await
            .map_err(|error| failed(&address.to_string(), error));
    }
    match TcpListener::bind(DEFAULT_BIND).await {
        Err(error) if error.kind() == std::io::ErrorKind::AddrInUse => {
            eprintln!(
                "{DEFAULT_BIND} is taken, perhaps by another console; this one takes a free port"
            );
            TcpListener::bind("127.0.0.1:0")
                .await
                .map_err(|error| failed("127.0.0.1:0", error))
        }
        outcome => outcome.map_err(|error| failed(DEFAULT_BIND, error)),
    }
}
