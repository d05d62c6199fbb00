//! `cars launch`: starts the processes of a launch file and supervises them to their end.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use config::units::Time;
use launch::{Launch, LaunchOptions, LaunchOutcome, Planned, ProcessLink, What, code_of};
use protocol::RobotName;
use protocol::messages::Verdict;
use record::RunFolder;
use terminal::OutputError;

use crate::errors::{Result, refusal};
use crate::execution::ExecutionArgs;
use crate::replay_robot::open;
use crate::{named, remarks, siblings, table};

/// `cars launch`.
#[derive(Debug, Args)]
pub(crate) struct LaunchArgs {
    /// The launch file, or the name of one that comes with the programs, such as `hors_doeuvres`.
    #[arg(required_unless_present_any = ["roster", "resume"], value_parser = named::launch())]
    file: Option<PathBuf>,
    /// A run, or its folder, to go on with where its simulator was killed. It is executed again up to the last tick of its
    /// record, and compared with it.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["file", "roster", "run", "replace", "seed", "duration", "set", "export"])]
    resume: Option<PathBuf>,
    /// A list of robots instead of a launch file, one class a line, as in CARSConfig.txt of the first CARS, and behind it a name
    /// where it differs.
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    roster: Option<PathBuf>,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Print the commands without starting them.
    #[arg(long)]
    dry_run: bool,
    /// Print a file for another launcher.
    #[arg(long, value_name = "FORMAT", conflicts_with = "dry_run")]
    export: Option<LauncherFormat>,
    /// Wait for `cars ctl start` once all robots have joined.
    #[arg(long)]
    paused: bool,
    /// Open the console in a browser. The run waits until it is started there, and goes on at 5 simulated seconds a second unless
    /// --speed says otherwise. If no browser has come after 30 s, it begins by itself.
    #[arg(long, conflicts_with = "no_console")]
    open: bool,
    /// Keep the processes when the run is over, so that `init` begins the next one. While a browser shows the run they are kept
    /// anyway. Ctrl-C or `stop` ends them.
    #[arg(long)]
    stay: bool,
    /// Start no console.
    #[arg(long)]
    no_console: bool,
    /// Print nothing but warnings and errors.
    #[arg(long, short)]
    quiet: bool,
    /// Port of the loopback interface at which the simulator listens; without it, or with 0, a free one.
    #[arg(long, value_name = "PORT", conflicts_with = "listen")]
    connect_port: Option<u16>,
    /// Where the simulator listens. An address that other machines can reach needs --secure or --insecure.
    #[arg(long, value_name = "ENDPOINT")]
    listen: Option<String>,
    /// Endpoint by which a process reaches the simulator, and the network namespace in which it runs. Set by `cars net
    /// play`.
    #[arg(long = "link", value_name = "PROCESS=ENDPOINT[@NAMESPACE]")]
    links: Vec<ProcessLink>,
    /// Folder of certificates that `cars secure init` made, instead of the launch file's.
    #[arg(long, value_name = "DIR")]
    secure: Option<PathBuf>,
    /// Listen where other machines can connect, without certificates. Any program that connects there can control the run
    /// and take the place of any robot.
    #[arg(long, conflicts_with = "secure")]
    insecure: bool,
    /// How long a process may take to exit before it is killed.
    #[arg(long, value_name = "TIME", default_value = "3 s")]
    grace: Time,
    /// A robot that is not started, but played from the record of a run, for example `Leguin=latest`: it repeats what it did
    /// then, while the others live.
    #[arg(long = "replay-robot", value_name = "ROBOT=RUN", conflicts_with_all = ["export", "resume"])]
    replayed: Vec<ReplayArg>,
}

/// A robot and the recorded run from which it is played.
#[derive(Debug, Clone)]
struct ReplayArg {
    robot: RobotName,
    run: PathBuf,
}

impl FromStr for ReplayArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (robot, run) = text
            .split_once('=')
            .ok_or_else(|| format!("{text:?} is not of the form ROBOT=RUN"))?;
        let robot = RobotName::new(robot).map_err(|error| error.to_string())?;
        Ok(Self {
            robot,
            run: PathBuf::from(run),
        })
    }
}

/// Launchers that `--export` writes for.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum LauncherFormat {
    /// A docker-compose.yml with one service for each process.
    Compose,
}

/// Launches a launch file or a roster.
pub(crate) fn launch(args: LaunchArgs) -> Result<ExitCode> {
    // Before the observer opens its session. The launched processes inherit the setting.
    bus::runtime::use_one_thread();
    siblings::build()?;

    let is_dry_run = args.dry_run;
    let export = args.export;
    let is_quiet = args.quiet;
    let mut launch = args.load()?;
    match export {
        Some(LauncherFormat::Compose) => {
            terminal::data(launch.export()?)?;
            Ok(ExitCode::SUCCESS)
        }
        None if is_dry_run => {
            print_plan(launch.planned()?)?;
            Ok(ExitCode::SUCCESS)
        }
        None => {
            let (mut outcome, mut folder) = launch.play(|text| terminal::note(text))?;
            while outcome.is_to_resume && !outcome.keeps_replaced {
                terminal::note(
                    outcome
                        .failure
                        .iter()
                        .map(ToString::to_string)
                        .collect::<String>(),
                );
                let mut resumed = launch.resumed(&folder)?;
                (outcome, folder) = resumed.play(|text| terminal::note(text))?;
            }
            conclude(&outcome, &folder, is_quiet)
        }
    }
}

impl LaunchArgs {
    fn load(self) -> Result<Launch> {
        let replayed = self.replayed()?;
        let options = LaunchOptions {
            run: self.execution.options(),
            is_paused: self.paused,
            opens_browser: self.open,
            has_console: !self.no_console,
            is_quiet: self.quiet,
            connect_port: self.connect_port,
            listen: self.listen,
            links: self.links,
            secure: self.secure,
            is_insecure: self.insecure,
            grace: self.grace,
            replayed,
            stays: self.stay,
        };

        match (self.resume, self.roster, self.file) {
            (Some(run), ..) => {
                let folder = lab::folder::find(&options.run.out, &run)?;
                Ok(Launch::resume(folder.path(), options)?)
            }
            (None, Some(roster), _) => Ok(Launch::load(What::Roster(roster), options)?),
            (None, None, Some(file)) => {
                let changes = options.run.changes();
                let scenario = launch::scenario_file(&file)?;
                let launch = Launch::load(What::File(file), options)?;
                remarks::show(&scenario, &changes);
                Ok(launch)
            }
            (None, None, None) => Err(refusal!("no file is given")),
        }
    }
}

impl LaunchArgs {
    /// The robots that are played from records, with the folders of these; they are looked into before anything starts.
    fn replayed(&self) -> Result<BTreeMap<RobotName, PathBuf>> {
        let mut replayed = BTreeMap::new();
        for ReplayArg { robot, run } in &self.replayed {
            let folder = lab::folder::find(&self.execution.out, run)?;
            let folder = folder.resolved()?;
            open(folder.path(), robot)?;
            replayed.insert(robot.clone(), folder.path().to_owned());
        }
        Ok(replayed)
    }
}

fn print_plan(planned: Vec<Planned>) -> Result<(), OutputError> {
    for process in planned {
        let note = if process.is_extern {
            " (to be started by you)"
        } else {
            ""
        };
        terminal::print_line(format_args!(
            "# {}{note}\n{}",
            process.name, process.command
        ))?;
    }
    Ok(())
}

/// Prints the summary of the run, or its failure; returns the exit status.
fn conclude(outcome: &LaunchOutcome, folder: &RunFolder, is_quiet: bool) -> Result<ExitCode> {
    let mut summary = None;
    if outcome.keeps_replaced {
        let place = folder.path().display();
        terminal::note(format_args!(
            "the run has not begun: {place} has the record that it was to replace"
        ));
    } else {
        summary = lab::folder::read_summary(folder)?;
    }
    if let Some(summary) = &summary
        && !is_quiet
    {
        // A reader that has seen enough does not change how the run ended.
        OutputError::unless_closed(table::print(summary, folder.path()))?;
    }

    if let Some(failure) = &outcome.failure {
        terminal::note(failure);
        return Ok(ExitCode::from(failure.code));
    }

    match outcome.asked {
        Some(signal) => Ok(ExitCode::from(code_of(signal))),
        None => {
            let verdict = summary.map_or(Verdict::Pass, |summary| summary.verdict());
            Ok(ExitCode::from(verdict.exit_status()))
        }
    }
}
