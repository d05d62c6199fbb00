//! `cars net`: faults of real links. The simulated network between robots (`[network]` of a scenario) is reproducible and
//! is what experiments are made with; this is for seeing that the real one may break, too, and nothing but time is lost.

mod compose;
mod gate;
mod namespaces;
mod plan;
mod play;
mod proxy;
mod shape;

use std::process::ExitCode;

use clap::Subcommand;

/// What `cars net` does.
#[derive(Debug, Subcommand)]
pub(crate) enum NetCommand {
    /// Forward TCP from one address to another, and break it on request. Commands are read from the standard input:
    /// `cut`, `close`, `heal`, `delay 50ms [10ms]` (with jitter), `bandwidth 64000` (bits per second), `status`.
    Proxy(proxy::ProxyArgs),
    /// Launch a launch file over links of its own for each process, and play a plan of faults on them.
    Play(play::PlayArgs),
}

/// Does it.
pub(crate) fn net(command: NetCommand) -> miette::Result<ExitCode> {
    match command {
        NetCommand::Proxy(args) => proxy::run(&args),
        NetCommand::Play(args) => play::play(&args),
    }
}
