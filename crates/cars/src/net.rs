//! `cars net`: plays faults on real links.

use std::fmt::Display;
use std::io::BufRead;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Args, Subcommand, ValueEnum};
use netem::{FaultPlan, Flow, LinkOrder, LinkShape, Proxy, address};
use protocol::RobotName;
use terminal::OutputError;

use crate::errors::{Context, Result};
use crate::execution::ExecutionArgs;
use crate::{named, siblings};

/// Subcommands of `cars net`.
#[derive(Debug, Subcommand)]
pub(crate) enum NetCommand {
    /// Forward TCP from one address to another, with faults on request. Orders are read from the standard input: `cut`,
    /// `close`, `heal`, `delay 50ms [10ms]` (with jitter), `bandwidth 64000` (bits per second), `status`.
    Proxy(ProxyArgs),
    /// Launch a launch file with a link of its own for each process, and play a plan of faults on the links.
    Play(PlayArgs),
}

/// `cars net proxy`.
#[derive(Debug, Args)]
pub(crate) struct ProxyArgs {
    /// Where robots connect, for example `tcp/127.0.0.1:7500`.
    #[arg(long, value_name = "ENDPOINT", value_parser = address)]
    listen: SocketAddr,
    /// Where the simulator listens, for example `tcp/127.0.0.1:7447`.
    #[arg(long, value_name = "ENDPOINT", value_parser = address)]
    to: SocketAddr,
    /// Plan of faults; its times begin with the first connection.
    #[arg(long, value_name = "FILE", requires = "robot", value_parser = named::links())]
    plan: Option<PathBuf>,
    /// Robot of the plan whose faults are played.
    #[arg(long, value_name = "NAME")]
    robot: Option<RobotName>,
    /// Close connections at a cut instead of holding their bytes.
    #[arg(long)]
    close: bool,
}

/// `cars net play`.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// The launch file, or the name of one that comes with the programs.
    #[arg(value_parser = named::launch())]
    file: PathBuf,
    /// Plan of faults; its times are wall clock, from the first tick of the run. Without one, the partitions of the
    /// scenario are played on the links instead of being simulated.
    #[arg(long, value_name = "FILE", value_parser = named::links())]
    plan: Option<PathBuf>,
    /// Kind of link.
    #[arg(long)]
    via: LinkKind,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Further options of `cars launch`, after `--`.
    #[arg(last = true)]
    launch_args: Vec<String>,
}

/// Kinds of links.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum LinkKind {
    /// A TCP proxy for each process: cut, close, delay, jitter, bandwidth. Needs no privileges.
    Proxy,
    /// A network namespace for each process, connected by a veth pair: cut. Needs root and `ip` (iproute2).
    Namespaces,
    /// A container for each process: cut, by `docker network disconnect`. Needs docker and the image `cars:local`.
    Compose,
}

/// Runs a subcommand.
pub(crate) fn net(command: NetCommand) -> Result<ExitCode> {
    match command {
        NetCommand::Proxy(args) => proxy(args),
        NetCommand::Play(args) => play(args),
    }
}

/// Forwards until the process is killed; carries out the plan and the orders of the standard input.
fn proxy(args: ProxyArgs) -> Result<ExitCode> {
    let closes = args.close;
    let plan = match args.plan.zip(args.robot) {
        Some((file, robot)) => Some(FaultPlan::load_of(&file, &robot)?),
        None => None,
    };

    let proxy =
        Proxy::start(args.listen, args.to).context(format!("cannot listen at {}", args.listen))?;
    let proxy = Arc::new(proxy);
    show(format_args!(
        "listening at {}, on to {}",
        proxy.address(),
        args.to
    ))?;

    if let Some(plan) = plan {
        let proxy = proxy.clone();
        std::thread::Builder::new()
            .spawn(move || play_plan(&proxy, &plan, closes))
            .context("no thread can be started for the plan")?;
    }
    obey_input(&proxy, closes)?;

    // The standard input has ended; the shape stays as it is until the process is killed.
    loop {
        std::thread::park();
    }
}

/// Prints a line. The proxy forwards also where its lines are not read.
fn show(line: impl Display) -> Result<(), OutputError> {
    OutputError::unless_closed(terminal::print_line(line))
}

fn play_plan(proxy: &Proxy, plan: &FaultPlan, closes: bool) {
    proxy.play(plan, |shape, at| {
        proxy.set(closing(shape, closes));
        let line = format!("{:.3} s: {}", at.as_secs_f64(), proxy.shape());
        // The plan is played to its end also where its lines cannot be shown.
        if let Err(error) = show(line) {
            tracing::warn!("{error}");
        }
    });
}

/// Carries out the orders of the standard input to its end.
fn obey_input(proxy: &Proxy, closes: bool) -> Result<()> {
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        match line.parse::<LinkOrder>() {
            Ok(order) => {
                proxy.set(closing(order.apply(proxy.shape()), closes));
                show(proxy.shape())?;
            }
            Err(error) => terminal::note(error),
        }
    }
    Ok(())
}

/// The shape with a cut turned into closed connections if `closes`.
fn closing(shape: LinkShape, closes: bool) -> LinkShape {
    let flow = if closes && shape.flow == Flow::Cut {
        Flow::Closed
    } else {
        shape.flow
    };
    LinkShape { flow, ..shape }
}

/// Plays a plan of faults on the links of a launch.
fn play(args: PlayArgs) -> Result<ExitCode> {
    siblings::build()?;

    let via = match args.via {
        LinkKind::Proxy => netem::Via::Proxy,
        LinkKind::Namespaces => netem::Via::Namespaces,
        LinkKind::Compose => netem::Via::Compose,
    };
    let play = netem::Play {
        file: args.file,
        plan: args.plan,
        via,
        options: args.execution.options(),
        launch_args: args.launch_args,
    };
    let code = netem::play(&play, terminal::note)?;

    Ok(ExitCode::from(code))
}
