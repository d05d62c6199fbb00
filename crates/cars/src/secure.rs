//! `cars secure init`: certificates, keys and configuration files for a roster.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use launch::Certificates;
use protocol::{RobotName, RunName};

/// `cars secure`.
#[derive(Debug, Args)]
pub(crate) struct SecureArgs {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Make certificates, private keys and configuration files for a roster.
    Init(InitArgs),
}

/// `cars secure init`.
#[derive(Debug, Args)]
struct InitArgs {
    /// The folder to make.
    folder: PathBuf,
    /// The robots that may take part, for example `Butler,Leguin`.
    #[arg(long, value_delimiter = ',', required = true, value_name = "NAMES")]
    robots: Vec<RobotName>,
    /// A further name or address by which the simulator's machine is reached.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// How long the certificates are valid, days.
    #[arg(long, default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
    /// The one run that they are for; without it any run.
    #[arg(long, value_name = "NAME")]
    run: Option<RunName>,
    /// Replace what an earlier call made there.
    #[arg(long)]
    force: bool,
}

/// Makes what a secured run needs.
pub(crate) fn secure(args: SecureArgs) -> miette::Result<ExitCode> {
    let Task::Init(init) = args.task;
    let certificates = Certificates {
        folder: init.folder,
        robots: init.robots,
        hosts: init.host,
        days: init.days,
        run: init.run,
        replaces: init.force,
    };
    let validity = certificates.make()?;
    explain(&certificates, &validity);

    Ok(ExitCode::SUCCESS)
}

fn explain(certificates: &Certificates, validity: &str) {
    let folder = certificates.folder.display();
    let clients: Vec<&str> = certificates.clients().collect();
    let runs = match &certificates.run {
        Some(run) => format!("run {run}"),
        None => "any run".to_owned(),
    };
    println!(
        "made {folder}, for {runs}, valid until {validity}:\n\
         \x20 ca.pem             whose certificates are believed; its key is not kept, so there will be no more\n\
         \x20 simulator/zenoh.json5  for cars-sim: its certificate, and who may say what\n\
         \x20 NAME/zenoh.json5       all that NAME needs, one of {}; it holds a private key\n\
         \x20 NAME/cert.pem, key.pem the same, apart\n\
         use it by one line of a launch file, secure = \"{folder}\", or by `cars launch FILE --secure {folder}`;\n\
         by hand with --zenoh-config {folder}/NAME/zenoh.json5. On another machine a participant needs its own\n\
         zenoh.json5 and nothing else. To change the roster, or should a key be lost: the same again with --force.",
        clients.join(", ")
    );
}
