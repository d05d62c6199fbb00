//! `cars net`: faults of real links.

use std::collections::BTreeSet;
use std::io::BufRead;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Args, Subcommand, ValueEnum};
use launch::net::{self, Flow, Order, Plan, Proxy, Shape, address};
use miette::{IntoDiagnostic, WrapErr};
use protocol::RobotName;

use crate::execution::ExecutionArgs;

/// What `cars net` does.
#[derive(Debug, Subcommand)]
pub(crate) enum NetCommand {
    /// Forward TCP from one address to another, and break it on request. Commands are read from the standard input:
    /// `cut`, `close`, `heal`, `delay 50ms [10ms]` (with jitter), `bandwidth 64000` (bits per second), `status`.
    Proxy(ProxyArgs),
    /// Launch a launch file over links of its own for each process, and play a plan of faults on them.
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
    /// Faults to play, from the first connection on.
    #[arg(long, value_name = "FILE", requires = "robot")]
    plan: Option<PathBuf>,
    /// Whose faults of the plan.
    #[arg(long, value_name = "NAME")]
    robot: Option<RobotName>,
    /// Close connections where `cut` is said, instead of holding what they carry.
    #[arg(long)]
    close: bool,
}

/// `cars net play`.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// The launch file.
    file: PathBuf,
    /// The plan of faults; its times are of the wall clock, from the moment when the clock of the run first ran. Without
    /// one, the partitions of the scenario itself are played, and not simulated in addition.
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// What the links are.
    #[arg(long)]
    via: Via,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Further options of `cars launch`, after `--`.
    #[arg(last = true)]
    launch_args: Vec<String>,
}

/// What links are made of.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Via {
    /// A TCP proxy for each process: cut, close, delay, jitter, bandwidth. Needs nothing.
    Proxy,
    /// A network namespace for each process and a virtual cable to it: cut. Needs root and `ip` (iproute2).
    Namespaces,
    /// A container for each process: cut, by `docker network disconnect`. Needs docker and the image `cars:local`.
    Compose,
}

/// Runs one of the commands.
pub(crate) fn net(command: NetCommand) -> miette::Result<ExitCode> {
    match command {
        NetCommand::Proxy(args) => proxy(args),
        NetCommand::Play(args) => play(args),
    }
}

/// Forwards until the process is ended, and does what the plan and the standard input order.
fn proxy(args: ProxyArgs) -> miette::Result<ExitCode> {
    let closes = args.close;
    let plan = match args.plan.zip(args.robot) {
        Some((file, robot)) => Some(Plan::load(&file, &BTreeSet::from([robot]))?),
        None => None,
    };
    let proxy = Proxy::start(args.listen, args.to)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot listen at {}", args.listen))?;
    println!("listening at {}, on to {}", proxy.address(), args.to);

    let proxy = Arc::new(proxy);
    if let Some(plan) = plan {
        let proxy = proxy.clone();
        std::thread::spawn(move || {
            proxy.play(&plan, |shape, at| {
                proxy.set(closing(shape, closes));
                println!("{:.3} s: {}", at.as_secs_f64(), proxy.shape());
            });
        });
    }

    for line in std::io::stdin().lock().lines() {
        let line = line.into_diagnostic()?;
        match line.parse::<Order>() {
            Ok(order) => {
                proxy.set(closing(order.apply(proxy.shape()), closes));
                println!("{}", proxy.shape());
            }
            Err(error) => eprintln!("{error}"),
        }
    }
    // No more orders can come: the last ones hold until the process is ended.
    loop {
        std::thread::park();
    }
}

fn closing(shape: Shape, closes: bool) -> Shape {
    let flow = if closes && shape.flow == Flow::Cut {
        Flow::Closed
    } else {
        shape.flow
    };
    Shape { flow, ..shape }
}

/// Plays a plan of faults on the links of a launch.
fn play(args: PlayArgs) -> miette::Result<ExitCode> {
    let play = net::Play {
        file: args.file,
        plan: args.plan,
        via: match args.via {
            Via::Proxy => net::Via::Proxy,
            Via::Namespaces => net::Via::Namespaces,
            Via::Compose => net::Via::Compose,
        },
        options: args.execution.options(),
        launch_args: args.launch_args,
    };
    let code = net::play(&play, |line| eprintln!("{line}"))?;

    Ok(ExitCode::from(code))
}
