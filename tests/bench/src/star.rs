//! The floor over zenoh: the router puts a clock, each client puts a report in its subscriber callback, and the router puts
//! the next clock in the callback that receives the last report. It has no queue, no thread of its own and no message to
//! encode, so no lock-step over zenoh with the same settings is faster. With [`Content::Messages`] both sides encode and decode
//! the messages of the protocol, and do nothing else with them.

use std::process::{ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use bus::{Bus, Publisher, Role};
use clap::Args;
use miette::{IntoDiagnostic, WrapErr, miette};
use protocol::messages::{Clock, End, Point, Report, StateVariables};
use protocol::{Tick, decode, encode};

use crate::programs::{Processes, free_endpoint, own_command};
use crate::subject::Content;
use crate::workload::{CLOCK_BYTES, REPORT_BYTES};

const CLOCK: &str = "cars/star/clock";
const REPORTS: &str = "cars/star/robot/*/report";
const TOKENS: &str = "cars/star/alive/robot/*";

/// First byte of a clock that asks for a report.
const TICK: u8 = 1;
/// First byte of the last clock.
const END: u8 = 0;
/// Any byte of a report.
const REPORT: u8 = 2;

/// How long a process of the star waits for the others; far longer than any measurement takes.
const PATIENCE: Duration = Duration::from_secs(600);

/// `cars-bench star`: the router in the middle.
#[derive(Debug, Args)]
pub(crate) struct StarArgs {
    /// Where clients connect.
    #[arg(long)]
    listen: String,
    /// Number of clients to wait for.
    #[arg(long)]
    clients: u64,
    /// Number of clocks to put.
    #[arg(long)]
    ticks: u64,
    /// What is exchanged.
    #[arg(long)]
    content: Content,
}

/// `cars-bench star-client`: one of the robots.
#[derive(Debug, Args)]
pub(crate) struct ClientArgs {
    /// Where the router listens.
    #[arg(long)]
    connect: String,
    /// Number of this client, from 0.
    #[arg(long)]
    number: usize,
    /// What is exchanged.
    #[arg(long)]
    content: Content,
}

/// Ticks per second of a star with this number of clients.
pub(crate) fn measure(clients: usize, content: Content, ticks: u64) -> miette::Result<f64> {
    let printed = run_star(clients, content, ticks)?;
    let rate = printed.trim().parse();
    rate.into_diagnostic()
        .wrap_err_with(|| format!("the star printed {printed:?}"))
}

/// Runs a star to its end; returns what its router printed.
fn run_star(clients: usize, content: Content, ticks: u64) -> miette::Result<String> {
    let content = content.to_string();
    let endpoint = free_endpoint(false)?;
    let mut router = own_command()?;
    router
        .args(["star", "--listen", &endpoint])
        .args(["--clients", &clients.to_string()])
        .args(["--ticks", &ticks.to_string()])
        .args(["--content", &content])
        .stdout(Stdio::piped());
    let mut processes = Processes::default();
    processes.start(&mut router)?;
    for number in 0..clients {
        let mut client = own_command()?;
        client
            .args(["star-client", "--connect", &endpoint])
            .args(["--number", &number.to_string()])
            .args(["--content", &content]);
        processes.start(&mut client)?;
    }
    processes.wait()?;

    processes.output_of_first()
}

/// The center of the star: counts reports and puts clocks.
struct Center {
    content: Content,
    clock: Publisher,
    clients: u64,
    ticks: u64,
    reports: AtomicU64,
    outcome: Sender<miette::Result<Instant>>,
}

impl Center {
    fn put_clock(&self, tick: Tick, end: Option<End>) -> miette::Result<()> {
        let clock = match self.content {
            Content::Bytes => vec![if end.is_some() { END } else { TICK }; CLOCK_BYTES],
            Content::Messages => encode(&Clock {
                epoch: 1,
                tick,
                end,
                ..Clock::default()
            }),
        };

        self.clock.put(clock).into_diagnostic()
    }

    /// Reads and counts a report. The counter returns each number to one caller only, so each clock is put once even if zenoh
    /// calls from several threads.
    fn on_report(&self, key: &str, bytes: &[u8]) {
        if self.content == Content::Messages
            && let Err(error) = decode::<Report>(key, "client", bytes)
        {
            self.end(Err(error).into_diagnostic());
            return;
        }

        let reports = self.reports.fetch_add(1, Ordering::SeqCst) + 1;
        if !reports.is_multiple_of(self.clients) {
            return;
        }

        let ticks = reports / self.clients;
        if ticks == self.ticks {
            self.end(Ok(Instant::now()));
        } else if let Err(error) = self.put_clock(ticks, None) {
            self.end(Err(error));
        }
    }

    fn end(&self, outcome: miette::Result<Instant>) {
        // The receiver is dropped only when the measurement has failed already.
        let _failed_already = self.outcome.send(outcome);
    }
}

/// Runs the router and prints ticks per second.
pub(crate) fn router(args: &StarArgs) -> miette::Result<ExitCode> {
    let role = Role::Router {
        listen: args.listen.clone(),
        trusts_network: false,
    };
    let bus = Bus::open(&role, None).into_diagnostic()?;
    let (outcome, finished) = channel();
    let center = Arc::new(Center {
        content: args.content,
        clock: bus.publisher(CLOCK).into_diagnostic()?,
        clients: args.clients,
        ticks: args.ticks,
        reports: AtomicU64::new(0),
        outcome,
    });
    let counter = center.clone();
    let _reports = bus
        .subscribe(REPORTS, move |key, bytes| counter.on_report(key, bytes))
        .into_diagnostic()?;
    wait_for_clients(&bus, args.clients)?;

    let begun = Instant::now();
    center.put_clock(0, None)?;
    let ended = wait(&finished)??;
    center.put_clock(args.ticks, Some(End::Finished))?;
    bus.close();

    let rate = args.ticks as f64 / (ended - begun).as_secs_f64();
    terminal::print_line(rate).into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}

/// Waits until all clients have declared their tokens, and so their subscribers.
fn wait_for_clients(bus: &Bus, clients: u64) -> miette::Result<()> {
    let (sender, arrivals) = channel();
    let _tokens = bus
        .liveliness(TOKENS, move |_, is_there| {
            if is_there {
                // The receiver is dropped once all tokens are declared.
                let _all_are_there = sender.send(());
            }
        })
        .into_diagnostic()?;

    for _ in 0..clients {
        wait(&arrivals)?;
    }

    Ok(())
}

/// Answers clocks until the last one.
pub(crate) fn client(args: &ClientArgs) -> miette::Result<ExitCode> {
    let role = Role::Client {
        connect: args.connect.clone(),
        patience: PATIENCE,
    };
    let bus = Bus::open(&role, None).into_diagnostic()?;
    let report = bus
        .publisher(&format!("cars/star/robot/r{}/report", args.number))
        .into_diagnostic()?;
    let content = args.content;
    let (sender, finished) = channel();
    let _clock = bus
        .subscribe(CLOCK, move |_, clock| {
            if let Some(outcome) = answer(content, clock, &report).transpose() {
                // The receiver is dropped only when this client has ended already.
                let _ended_already = sender.send(outcome);
            }
        })
        .into_diagnostic()?;
    let _token = bus
        .token(&format!("cars/star/alive/robot/r{}", args.number))
        .into_diagnostic()?;

    wait(&finished)??;
    bus.close();
    Ok(ExitCode::SUCCESS)
}

/// Puts a report, unless it is the last clock. Returns whether it was.
fn answer(content: Content, clock: &[u8], report: &Publisher) -> miette::Result<Option<()>> {
    let message = match content {
        Content::Bytes if clock.first() == Some(&END) => return Ok(Some(())),
        Content::Bytes => vec![REPORT; REPORT_BYTES],
        Content::Messages => {
            let clock: Clock = decode(CLOCK, "router", clock).into_diagnostic()?;
            if clock.end.is_some() {
                return Ok(Some(()));
            }
            encode(&report_of(clock))
        }
    };

    report.put(message).into_diagnostic()?;
    Ok(None)
}

/// The report of an idle robot.
fn report_of(clock: Clock) -> Report {
    Report {
        epoch: clock.epoch,
        tick: clock.tick,
        generation: 1,
        proposal: Point::new(3.0, 3.0),
        speed_mps: 0.0,
        direction_rad: 0.0,
        emotion_state: "CALM".to_owned(),
        behavior_state: "IDLE".to_owned(),
        state_variables: StateVariables::default(),
        commands: 0,
        log: Vec::new(),
        site_actions: Vec::new(),
        layer_actions: Vec::new(),
        velocity: None,
    }
}

fn wait<T>(receiver: &Receiver<T>) -> miette::Result<T> {
    receiver
        .recv_timeout(PATIENCE)
        .map_err(|_| miette!("the star did not finish within {PATIENCE:?}"))
}
