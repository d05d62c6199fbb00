//! `cars router`: forwards between a simulator and robots on different machines. It is the equivalent of `zenohd` with
//! `configs/zenoh/router.json5`, for machines without `zenohd`.

use std::path::PathBuf;
use std::process::ExitCode;

use bus::{Bus, Role};
use clap::Args;
use terminal::OutputError;

use crate::errors::{Context, Result};

/// `cars router`.
#[derive(Debug, Args)]
pub(crate) struct RouterArgs {
    /// Where the simulator, robots and other routers connect, for example `tcp/192.0.2.1:7447`.
    #[arg(
        long,
        value_name = "ENDPOINT",
        required_unless_present = "zenoh_config"
    )]
    listen: Vec<String>,
    /// Another router to connect to.
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// A configuration file of the middleware instead of the built-in settings.
    #[arg(long, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// Listen where other machines can connect, without certificates. Any program that connects there can control the runs
    /// behind it and take the place of any robot.
    #[arg(long)]
    insecure: bool,
}

/// Forwards until a signal ends it.
pub(crate) fn router(args: &RouterArgs) -> Result<ExitCode> {
    bus::runtime::use_router_threads();
    bus::runtime::check_threads().context("no thread can be started")?;

    let (end, ended) = std::sync::mpsc::sync_channel(1);
    ctrlc::set_handler(move || {
        // A second signal finds the queue full and changes nothing.
        let _asked_already = end.try_send(());
    })?;

    let role = Role::Relay {
        listen: args.listen.clone(),
        connect: args.connect.clone(),
        trusts_network: args.insecure,
    };
    let bus = Bus::open(&role, args.zenoh_config.as_ref())?;
    let endpoints = if args.listen.is_empty() {
        "the endpoints of the configuration file".to_owned()
    } else {
        args.listen.join(", ")
    };
    let printed = terminal::print_line(format_args!("forwarding at {endpoints}"));
    OutputError::unless_closed(printed)?; // It forwards also where its line is not read.
    ended.recv()?;
    bus.close();

    Ok(ExitCode::SUCCESS)
}
