//! `cars replay`: a recorded run on the keys of a run in progress.

use std::path::PathBuf;
use std::process::ExitCode;

use bus::endpoint::connectable;
use bus::{Bus, DEFAULT_ENDPOINT, Role};
use clap::Args;
use config::Speed;
use lab::folder::{find, recorded_epoch, recording};
use protocol::{Epoch, RunName};
use record::RunLock;
use record::names::ENDPOINT;
use record::{EpochFiles, RunFolder};
use recording::Recording;
use simulator::server::{KeepAlive, REPEAT_AFTER, Server, ServerOptions};
use terminal::OutputError;

use crate::errors::Result;

/// `cars replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Name of the recorded run, or its folder.
    #[arg(value_name = "RUN")]
    recorded: PathBuf,
    /// Name under which it is replayed; without it that of the recorded run.
    #[arg(long, value_name = "NAME")]
    run: Option<RunName>,
    /// The epoch; without it the last one.
    #[arg(long, value_name = "N")]
    epoch: Option<Epoch>,
    /// Simulated seconds per second, or `max` for as fast as possible.
    #[arg(long, value_name = "FACTOR|max", default_value = "1")]
    speed: Speed,
    /// Wait for `cars ctl start`, or for steps, at tick 0.
    #[arg(long)]
    paused: bool,
    /// Where to listen. Where other machines could connect, only with --insecure.
    #[arg(long, env = "CARS_LISTEN", default_value = DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    listen: String,
    /// Listen where other machines can connect. Any program that connects there can control the replay.
    #[arg(long)]
    insecure: bool,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
}

/// Replays a recorded run until it is stopped.
pub(crate) fn replay(args: &ReplayArgs) -> Result<ExitCode> {
    bus::runtime::use_router_threads();

    let folder = find(&args.out, &args.recorded)?;
    let files = recorded_epoch(&folder, args.epoch)?;
    let recording = open_recording(&files)?;
    let recorded = recording.header().run.clone();
    let last = recording.len().saturating_sub(1);

    let role = Role::Router {
        listen: args.listen.clone(),
        trusts_network: args.insecure,
    };
    let bus = Bus::open(&role, None)?;
    let run = args.run.clone().unwrap_or_else(|| recorded.clone());
    let options = ServerOptions {
        run: run.clone(),
        speed: args.speed.0,
        is_paused: args.paused,
        is_launched: false,
        stay: KeepAlive::Always,
        repeat_after: REPEAT_AFTER,
    };
    let server = Server::replay(bus, recording, options)?;
    ctrlc::set_handler(server.stopper())?;

    let endpoint = connectable(&args.listen);
    // Nothing is written through a link.
    let folder = folder.resolved_to_write().unwrap_or(folder);
    let note = note_endpoint(&folder, &run, &endpoint);
    let printed = terminal::print_line(format_args!(
        "replaying {recorded}, epoch {}, ticks 0 to {last}, as run {run} at {endpoint}",
        files.epoch
    ));
    OutputError::unless_closed(printed)?; // It is replayed also where its line is not read.
    server.run_replay();

    if note.is_some()
        && let Err(error) = std::fs::remove_file(folder.file(ENDPOINT))
    {
        tracing::debug!(%error, "the endpoint is not noted any more");
    }
    Ok(ExitCode::SUCCESS)
}

fn open_recording(files: &EpochFiles) -> Result<Recording> {
    let recording = recording(files)?;
    if !recording.is_finished() && !recording.is_empty() {
        terminal::note(format_args!(
            "{} has no end (the simulator was killed, or the run is in progress): it is replayed up to tick {}",
            files.recording.display(),
            recording.len() - 1
        ));
    }
    Ok(recording)
}

/// Notes the endpoint where `cars ctl` and others look for that of a run in progress: in the folder with the name of the run.
/// No other run can take the folder meanwhile.
fn note_endpoint(folder: &RunFolder, run: &RunName, endpoint: &str) -> Option<RunLock> {
    if !folder.name().is_ok_and(|name| name == *run) {
        return None;
    }

    let noted = folder.lock_of_launcher().and_then(|_| {
        let lock = folder.lock()?;
        folder.write_line(ENDPOINT, endpoint)?;
        Ok(lock)
    });
    match noted {
        Ok(lock) => Some(lock),
        Err(error) => {
            terminal::note(format_args!(
                "{error}; this replay is reached with --connect {endpoint}"
            ));
            None
        }
    }
}
