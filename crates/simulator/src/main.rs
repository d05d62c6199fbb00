//! The program `cars-sim`: the simulator process of one run.

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use bus::endpoint::connectable;
use bus::{Bus, DEFAULT_ENDPOINT, Role, check_exposure, check_run};
use clap::{Parser, ValueEnum};
use config::units::Time;
use config::{Speed, shipped};
use protocol::RunName;
use protocol::messages::End;
use record::names::{ENDPOINT, OPERATOR_CONFIG};
use record::{IfTaken, RecordError, RunFolder, RunLock, Summary};
use scenario::{Changes, Override, Scenario};
use simulator::server::{KeepAlive, REPEAT_AFTER, ReplayLog, Server, ServerOptions};
use terminal::ADDRESS_TAKEN;

/// The simulator of the Cooperative Affective Robot Simulator: owns the environment and the clock of one run.
#[derive(Debug, Parser)]
#[command(name = "cars-sim", version)]
struct SimulatorArgs {
    /// The scenario file, or the name of one that comes with the programs.
    scenario: PathBuf,
    /// Name of the run; its robots must name it, too.
    #[arg(long, env = "CARS_RUN", default_value = "default")]
    run: RunName,
    /// Where to listen. Where other machines could connect, only with certificates, or with --insecure.
    #[arg(long, env = "CARS_LISTEN", default_value = DEFAULT_ENDPOINT, value_name = "ENDPOINT")]
    listen: String,
    /// Where run folders are made.
    #[arg(long, default_value = "runs", value_name = "DIR")]
    out: PathBuf,
    /// Seed, instead of the scenario's.
    #[arg(long)]
    seed: Option<u64>,
    /// Simulated time, instead of the scenario's, for example "600 s".
    #[arg(long)]
    duration: Option<Time>,
    /// Simulated seconds per second, or `max`.
    #[arg(long, default_value = "max")]
    speed: Speed,
    /// Changes of the scenario, for example `guests.count=50`.
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<Override>,
    /// Wait for `start` once all robots have joined.
    #[arg(long)]
    paused: bool,
    /// A configuration file of the middleware instead of the built-in settings.
    #[arg(long, env = "CARS_ZENOH_CONFIG", value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
    /// The operator's configuration file of a secured run: `cars ctl` and others find it by the run's folder.
    #[arg(long, value_name = "FILE")]
    operator_config: Option<PathBuf>,
    /// Listen where other machines can connect, without certificates. Any program that connects there can control the run
    /// and take the place of any robot.
    #[arg(long)]
    insecure: bool,
    /// Resume the run in its folder, whose simulator was killed: the run is executed again up to the last tick of its record,
    /// and compared with it, and goes on from there.
    #[arg(long, conflicts_with_all = ["seed", "duration", "set"])]
    resume: bool,
    /// Replace the run with this name, if it is over. Without it, a name that is taken is an error: robots know the run by it.
    #[arg(long, conflicts_with_all = ["resume", "prepared"])]
    replace: bool,
    /// The launcher has made the folder of the run.
    #[arg(long, hide = true, conflicts_with = "resume")]
    prepared: bool,
    /// Stay when the run ends without being stopped, so that `init` begins the next one with the same processes: always,
    /// or while a browser shows the run in a console.
    #[arg(long, value_name = "WHEN", num_args = 0..=1, default_missing_value = "always")]
    stay: Option<StayMode>,
    /// Exit with 0 where the run is over, whatever the verdict on it. Without it a failed expectation is exit status 1, and an
    /// undecided one 2.
    #[arg(long)]
    no_verdict: bool,
}

/// When the process stays after the end of a run.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum StayMode {
    /// Until it is stopped.
    Always,
    /// While a browser shows the run in a console.
    Viewed,
}

impl From<StayMode> for KeepAlive {
    fn from(mode: StayMode) -> Self {
        match mode {
            StayMode::Viewed => Self::Viewed,
            StayMode::Always => Self::Always,
        }
    }
}

fn main() -> ExitCode {
    let args: SimulatorArgs = match terminal::arguments() {
        Ok(args) => args,
        Err(code) => return code,
    };
    bus::runtime::use_router_threads();
    terminal::print_diagnostics("warn,zenoh=error");

    terminal::conclude(run(&args), |error| {
        let record = error.downcast_ref::<RecordError>();
        config::render(error, record.and_then(RecordError::help))
    })
}

fn exit_code(summary: &Summary, no_verdict: bool) -> ExitCode {
    if summary.end == Some(End::Aborted) {
        ExitCode::FAILURE
    } else if no_verdict {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(summary.verdict().exit_status())
    }
}

fn run(args: &SimulatorArgs) -> Result<ExitCode, Box<dyn Error + Send + Sync>> {
    let duration_s = args.duration.map(|duration| duration.0);
    let scenario = Scenario::load(
        &shipped::find(&args.scenario, &[shipped::SCENARIOS]),
        &Changes {
            seed: args.seed,
            duration_s,
            set: args.set.clone(),
            runs: Some(args.out.clone()),
        },
    )?;

    // Before anything is made: a refusal leaves nothing behind.
    check_exposure(&args.listen, args.zenoh_config.as_ref(), args.insecure)?;
    if let Some(config) = &args.zenoh_config {
        check_run(config, &args.run)?;
    }
    let role = Role::Router {
        listen: args.listen.clone(),
        trusts_network: args.insecure,
    };
    let bus = match Bus::open(&role, args.zenoh_config.as_ref()) {
        Err(error) if error.is_address_taken() => {
            terminal::note(format_args!("Error: {error}"));
            return Ok(ExitCode::from(ADDRESS_TAKEN));
        }
        bus => bus?,
    };
    let folder = RunFolder::new(&args.out, &args.run);
    let (_lock, past) = open_folder(&folder, &scenario, args)?;
    let summary = serve(bus, scenario, &folder, past, args);
    // A launcher does so itself, when all processes have ended.
    if args.replace {
        folder.restore_replaced()?;
    }
    Ok(exit_code(&summary?, args.no_verdict))
}

/// Runs the server of a run to its end, which others find by the run's folder meanwhile.
fn serve(
    bus: Bus,
    scenario: Scenario,
    folder: &RunFolder,
    past: Option<ReplayLog>,
    args: &SimulatorArgs,
) -> Result<Summary, Box<dyn Error + Send + Sync>> {
    let options = ServerOptions {
        run: args.run.clone(),
        speed: args.speed.0,
        is_paused: args.paused,
        is_launched: args.prepared || args.resume,
        stay: args.stay.map_or(KeepAlive::Never, KeepAlive::from),
        repeat_after: REPEAT_AFTER,
    };
    let server = Server::open(bus, scenario, options, folder, past)?;
    ctrlc::set_handler(server.stopper())?;

    if let Some(file) = &args.operator_config {
        let path = std::path::absolute(file)?;
        folder.write_line(OPERATOR_CONFIG, &path.display().to_string())?;
    }

    folder.write_line(ENDPOINT, &connectable(&args.listen))?;
    let summary = server.run();

    for name in [ENDPOINT, OPERATOR_CONFIG]
        .map(|name| folder.file(name))
        .iter()
        .filter(|file| file.exists())
    {
        if let Err(error) = std::fs::remove_file(name) {
            tracing::debug!(%error, "{} is gone already", name.display());
        }
    }

    Ok(summary?)
}

/// Makes the folder of a new run, or takes the one that the launcher made, or opens that of a run to resume, with its record.
fn open_folder(
    folder: &RunFolder,
    scenario: &Scenario,
    args: &SimulatorArgs,
) -> Result<(RunLock, Option<ReplayLog>), RecordError> {
    if args.resume {
        let (lock, files) = folder.reopen()?;
        return Ok((lock, Some(ReplayLog::open(&files)?)));
    }

    let if_taken = match (args.prepared, args.replace) {
        (true, _) => IfTaken::Reserved,
        (false, true) => IfTaken::Replace,
        (false, false) => IfTaken::Refuse,
    };
    let made = RunFolder::make(&args.out, &args.run, if_taken)?;
    folder.fill(scenario)?;
    Ok((made.lock, None))
}
