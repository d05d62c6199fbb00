//! `cars secure init`: certificates, keys and configuration files for a roster.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use launch::Certificates;
use protocol::{RobotName, RunName};
use terminal::OutputError;

use crate::errors::Result;

/// `cars secure`.
#[derive(Debug, Args)]
pub(crate) struct SecureArgs {
    #[command(subcommand)]
    task: SecureCommand,
}

#[derive(Debug, Subcommand)]
enum SecureCommand {
    /// Make certificates, private keys and configuration files for a roster.
    Init(SecureInitArgs),
}

/// `cars secure init`.
#[derive(Debug, Args)]
struct SecureInitArgs {
    /// The folder to make.
    folder: PathBuf,
    /// The robots that may take part, for example `Butler,Leguin`.
    #[arg(long, value_delimiter = ',', required = true, value_name = "NAMES")]
    robots: Vec<RobotName>,
    /// A further name or address of the simulator's machine, for its certificate.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// How long the certificates are valid, days.
    #[arg(long, default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
    /// The only run that the access control admits; without it any run.
    #[arg(long, value_name = "NAME")]
    run: Option<RunName>,
    /// Replace the files of an earlier call.
    #[arg(long)]
    force: bool,
}

/// Makes the certificates and configuration files of a secured run.
pub(crate) fn secure(args: SecureArgs) -> Result<ExitCode> {
    let SecureCommand::Init(init) = args.task;
    let certificates = Certificates {
        folder: init.folder,
        robots: init.robots,
        hosts: init.host,
        days: init.days,
        run: init.run,
        replaces: init.force,
    };
    let validity = certificates.make()?;
    explain(&certificates, &validity)?;

    Ok(ExitCode::SUCCESS)
}

/// Prints what was made and how it is used.
fn explain(certificates: &Certificates, validity: &str) -> Result<(), OutputError> {
    let folder = certificates.folder.display();
    let clients: Vec<&str> = certificates.clients().collect();
    let clients = clients.join(", ");
    let runs = match &certificates.run {
        Some(run) => format!("run {run}"),
        None => "any run".to_owned(),
    };

    terminal::print_line(format_args!(
        "made {folder}, for {runs}, valid until {validity}:\n\
         \x20 ca.pem             the certificate authority; its key is not kept, so it issues no more certificates\n\
         \x20 simulator/zenoh.json5  for cars-sim: its certificate and the access control\n\
         \x20 NAME/zenoh.json5       for NAME, one of {clients}; it holds a private key\n\
         \x20 NAME/cert.pem, key.pem the same as separate files"
    ))?;
    terminal::print_line(format_args!(
        "In a launch file: secure = \"{folder}\"; on the command line: `cars launch FILE --secure {folder}`;\n\
         for a single program: --zenoh-config {folder}/NAME/zenoh.json5, which is all that another machine needs.\n\
         To change the roster, or after a key is lost, run the command again with --force."
    ))
}
