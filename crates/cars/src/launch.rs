//! `cars launch`: the processes of a launch file, from their start to their end.

mod bar;
mod compose;
pub(crate) mod ending;
pub(crate) mod endpoint;
pub(crate) mod file;
pub(crate) mod lines;
pub(crate) mod link;
mod observe;
mod plan;
pub(crate) mod process;
mod program;
mod restart;
mod screen;
mod signals;
mod supervise;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use bus::check_exposure;
use bus::endpoint::connectable;
use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic, WrapErr, miette};
use protocol::{RobotName, RunName};
use simulator::diagnostic::{FileError, Source};
use simulator::recorder::{LOGS, SUMMARY};
use simulator::scenario::Changes;
use simulator::units::Time;
use simulator::{RunFolder, Scenario, Summary, roster};

use crate::common::{ExecutionArgs, Speed};
use crate::secure::Secured;
use crate::table;

use file::LaunchFile;
use link::Link;
use observe::{Observer, Watch};
use plan::{Execution, Planned};
use screen::{Look, Screen};
use supervise::{Outcome, Supervisor};

/// Ports that are tried, where somebody else is faster to listen at a free one.
const PORTS: usize = 3;

/// `cars launch`.
#[derive(Debug, Args)]
pub(crate) struct LaunchArgs {
    /// The launch file.
    #[arg(required_unless_present = "roster")]
    file: Option<PathBuf>,
    /// A plain list of robots instead, one class a line, as the CARSConfig.txt of the first CARS.
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    roster: Option<PathBuf>,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Print what would be started, and start nothing.
    #[arg(long)]
    dry_run: bool,
    /// Print the launch as a file for another launcher.
    #[arg(long, value_name = "FORMAT", conflicts_with = "dry_run")]
    export: Option<Format>,
    /// Wait for `cars ctl start` once everybody is there.
    #[arg(long)]
    paused: bool,
    /// Open the console in a browser.
    #[arg(long, conflicts_with = "no_console")]
    open: bool,
    /// Start no console.
    #[arg(long)]
    no_console: bool,
    /// Print nothing but warnings and errors.
    #[arg(long, short)]
    quiet: bool,
    /// Port of the loopback interface at which the simulator listens; without it a free one.
    #[arg(long, value_name = "PORT", conflicts_with = "listen")]
    connect_port: Option<u16>,
    /// Where the simulator listens. Where other machines could connect, only secured, or with --insecure.
    #[arg(long, value_name = "ENDPOINT")]
    listen: Option<String>,
    /// How a process of the file reaches the simulator, if not directly: by another endpoint, and from within a network
    /// namespace. `cars net play` says it.
    #[arg(long = "link", value_name = "PROCESS=ENDPOINT[@NAMESPACE]")]
    links: Vec<Link>,
    /// Folder of certificates that `cars secure init` made, instead of the launch file's.
    #[arg(long, value_name = "DIR")]
    secure: Option<PathBuf>,
    /// Listen where other machines can connect, without certificates: whoever reaches that address may control the run
    /// and pose as any robot.
    #[arg(long, conflicts_with = "secure")]
    insecure: bool,
    /// How long a process has to end by itself before it is killed.
    #[arg(long, value_name = "TIME", default_value = "3 s")]
    grace: Time,
}

/// Other launchers that can be written for.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// A docker-compose.yml with one service for each process.
    Compose,
}

/// Launches a launch file or a roster.
pub(crate) fn launch(args: LaunchArgs) -> miette::Result<ExitCode> {
    // The observer is on the bus, too; and what is chosen here goes for all processes.
    bus::runtime::use_one_thread();
    let launch = Launch::load(args)?;
    match (launch.args.export, launch.args.dry_run) {
        (Some(Format::Compose), _) => launch.export(),
        (None, true) => launch.print_plan(),
        (None, false) => launch.play(),
    }
}

/// The scenario that a file is about: that of a launch file, or the file itself.
pub(crate) fn scenario_file(path: &Path) -> miette::Result<PathBuf> {
    Ok(if is_launch_file(path)? {
        LaunchFile::load(path)?.scenario
    } else {
        path.to_owned()
    })
}

/// Whether this is a launch file: it names its scenario, and a scenario file does not.
pub(crate) fn is_launch_file(path: &Path) -> Result<bool, FileError> {
    Ok(Source::read(path)?
        .parse::<toml::Table>()?
        .contains_key("scenario"))
}

/// What is launched.
struct Launch {
    args: LaunchArgs,
    file: LaunchFile,
    /// With the command line's changes.
    scenario: Scenario,
    run: RunName,
    secured: Option<Secured>,
}

impl Launch {
    fn load(args: LaunchArgs) -> miette::Result<Self> {
        let path = args
            .roster
            .as_ref()
            .or(args.file.as_ref())
            .ok_or_else(|| miette!("no file is given"))?;
        let changes = args.execution.changes();
        let (file, scenario) = if args.roster.is_some() {
            let source = Source::read(path)?;
            let scenario = roster_scenario(&roster::scenario_of(&source)?, &changes)?;
            (LaunchFile::of_roster(path, source, &scenario), scenario)
        } else {
            let file = LaunchFile::load(path)?;
            let scenario = file.load_scenario(&changes)?;
            (file, scenario)
        };
        file.check_robots(&scenario)?;
        let run = args.execution.run_name(path)?;
        let secured = secured(&args, &file)?;
        Ok(Self {
            args,
            file,
            scenario,
            run,
            secured,
        })
    }

    fn export(&self) -> miette::Result<ExitCode> {
        if let Some(roster) = &self.args.roster {
            let help = "write a launch file, with a scenario that the containers can read";
            return Err(miette!(
                help = help,
                "{} cannot be exported",
                roster.display()
            ));
        }
        if self.secured.is_some() {
            let help = "export it without `secure`: the containers have a network of their own";
            return Err(miette!(help = help, "a secured launch cannot be exported"));
        }
        print!("{}", compose::export(&self.file, &self.run, self.speed())?);
        Ok(ExitCode::SUCCESS)
    }

    fn print_plan(&self) -> miette::Result<ExitCode> {
        for Planned {
            name,
            command,
            is_extern,
            ..
        } in self.plan(&self.endpoint()?)?
        {
            let note = if is_extern {
                " (to be started by you)"
            } else {
                ""
            };
            println!("# {name}{note}\n{command}");
        }
        Ok(ExitCode::SUCCESS)
    }

    fn plan(&self, endpoint: &str) -> Result<Vec<Planned>, FileError> {
        let (run, out) = (&self.run, self.args.execution.out.as_path());
        let execution = Execution {
            run,
            endpoint,
            secured: self.secured.as_ref(),
            is_insecure: self.args.insecure,
            out,
            speed: self.speed(),
            is_paused: self.args.paused,
            has_console: !self.args.no_console,
            opens_browser: self.args.open,
        };
        let mut planned = plan::plan(&self.file, &execution)?;
        self.args
            .links
            .iter()
            .try_for_each(|link| link.lay(&mut planned))?;
        Ok(planned)
    }

    fn speed(&self) -> Speed {
        self.args
            .execution
            .speed
            .or(self.file.speed)
            .unwrap_or(Speed(None))
    }

    /// Where the simulator is to listen.
    fn endpoint(&self) -> miette::Result<String> {
        if let Some(endpoint) = &self.args.listen {
            let config = self.simulator_config();
            check_exposure(endpoint, config.as_ref(), self.args.insecure).into_diagnostic()?;
            return Ok(endpoint.clone());
        }
        let free = || {
            endpoint::free_port()
                .into_diagnostic()
                .wrap_err("no free port of the loopback interface")
        };
        let port = self.args.connect_port.map_or_else(free, Ok)?;
        Ok(endpoint::loopback(port, self.secured.is_some()))
    }

    /// The configuration file that the simulator gets: that of a secured run, or what the environment says.
    fn simulator_config(&self) -> Option<PathBuf> {
        let secured = self
            .secured
            .as_ref()
            .map(|secured| secured.config_of(file::SIMULATOR));
        secured
            .or_else(|| {
                self.file
                    .simulator
                    .env
                    .get(plan::ZENOH_CONFIG)
                    .map(PathBuf::from)
            })
            .or_else(inherited)
    }

    /// The configuration file that the launcher itself uses to watch.
    fn observer_config(&self) -> Option<PathBuf> {
        self.secured
            .as_ref()
            .map(Secured::operator)
            .or_else(inherited)
    }

    /// Plays the run, and says what came of it.
    fn play(&self) -> miette::Result<ExitCode> {
        // A port that was free may be taken when the simulator comes to it.
        let may_choose = self.args.listen.is_none() && self.args.connect_port.is_none();
        let mut ports_left = if may_choose { PORTS } else { 1 };
        loop {
            let endpoint = self.endpoint()?;
            let planned = self.plan(&endpoint)?;
            // The simulator takes the lock over.
            let (folder, lock) = self.args.execution.folder(&self.run, &self.scenario)?;
            drop(lock);
            clear_logs(&folder);
            self.announce(&endpoint, &folder);
            let outcome = self.supervise(planned, &endpoint, &folder)?;
            ports_left -= 1;
            if ports_left == 0 || outcome.failure.is_none() || !endpoint::is_taken(&endpoint) {
                return conclude(&outcome, &folder, self.args.quiet);
            }
            eprintln!("somebody else listens at {endpoint}: trying another port");
        }
    }

    fn announce(&self, endpoint: &str, folder: &RunFolder) {
        if self.args.quiet {
            return;
        }
        if let Some(roster) = &self.args.roster {
            let robot = |process: &file::Process| {
                format!("{} ({})", process.name, process.command.join(" "))
            };
            let robots: Vec<String> = self.file.processes.iter().map(robot).collect();
            eprintln!(
                "{}: {}, in the hall of the first experiment",
                roster.display(),
                robots.join(", ")
            );
        }
        eprintln!(
            "run {} at {endpoint}, recorded in {}",
            self.run,
            folder.path().display()
        );
    }

    /// Runs the processes to their end, with an observer beside them.
    fn supervise(
        &self,
        planned: Vec<Planned>,
        endpoint: &str,
        folder: &RunFolder,
    ) -> miette::Result<Outcome> {
        let grace = Duration::try_from_secs_f64(self.args.grace.0)
            .into_diagnostic()
            .wrap_err("--grace")?;
        let look = Look::here(
            planned.iter().map(|planned| planned.name.clone()).collect(),
            self.args.quiet,
        );
        let wants_world = look.has_bar;
        let screen = Screen::open(look);
        let (run, tell) = (self.run.clone(), screen.tell());
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .into_diagnostic()?;
        let supervisor = Supervisor::new(planned, &folder.file(LOGS), grace, screen.tell());
        let faults = (!self.scenario.faults.is_empty()).then(|| supervisor.queue());
        let is_needed = !self.args.quiet || faults.is_some();
        let (endpoint, config) = (connectable(endpoint), self.observer_config());
        let watch = || Watch {
            run,
            endpoint,
            config,
            wants_world,
            tell,
            faults,
        };
        let observer = is_needed.then(|| Observer::start(watch()));
        let running = async {
            signals::listen(&supervisor.queue())?;
            std::io::Result::Ok(supervisor.run().await)
        };
        let outcome = runtime.block_on(running).into_diagnostic()?;
        if let Some(observer) = observer {
            observer.finish();
        }
        screen.finish();
        Ok(outcome)
    }
}

/// The certificates with which a launch is secured, if it is: those of the command line, or of the file.
fn secured(args: &LaunchArgs, file: &LaunchFile) -> miette::Result<Option<Secured>> {
    let Some(folder) = args.secure.as_ref().or(file.secure.as_ref()) else {
        return Ok(None);
    };
    file.check_certificates()?;
    let robots = file
        .processes
        .iter()
        .flat_map(|process| process.robots.iter().map(RobotName::as_str));
    let console = file.console.iter().map(|_| file::CONSOLE);
    Secured::find(folder, robots.chain(console)).map(Some)
}

/// What the environment says to every program of the project.
fn inherited() -> Option<PathBuf> {
    std::env::var_os(plan::ZENOH_CONFIG).map(PathBuf::from)
}

/// Reads a roster's scenario with the command line's changes, by way of a file: changes are made to files.
fn roster_scenario(text: &Source, changes: &Changes) -> miette::Result<Scenario> {
    let file = std::env::temp_dir().join(format!("cars-roster-{}.toml", std::process::id()));
    std::fs::write(&file, &text.text)
        .into_diagnostic()
        .wrap_err_with(|| format!("writing {}", file.display()))?;
    let scenario = Scenario::load(&file, changes);
    std::fs::remove_file(&file).into_diagnostic()?;
    Ok(scenario?)
}

/// Logs of an earlier run with this name; a log that cannot be removed is added to.
fn clear_logs(folder: &RunFolder) {
    for log in std::fs::read_dir(folder.file(LOGS))
        .into_iter()
        .flatten()
        .flatten()
    {
        let _kept = std::fs::remove_file(log.path());
    }
}

/// Prints what came of the run; returns the exit status that says it.
fn conclude(outcome: &Outcome, folder: &RunFolder, is_quiet: bool) -> miette::Result<ExitCode> {
    if !is_quiet && let Some(summary) = read_summary(folder)? {
        table::print(&summary, folder.path());
    }
    if let Some(failure) = &outcome.failure {
        eprintln!("{failure}");
        return Ok(ExitCode::from(failure.code));
    }
    Ok(outcome.asked.map_or(ExitCode::SUCCESS, |signal| {
        ExitCode::from(ending::code_of(signal))
    }))
}

/// The summary, if the simulator came to write one.
fn read_summary(folder: &RunFolder) -> miette::Result<Option<Summary>> {
    let path = folder.file(SUMMARY);
    if !path.exists() {
        return Ok(None);
    }
    let text =
        std::fs::read_to_string(&path).map_err(|error| FileError::unreadable(&path, &error))?;
    let summary = serde_json::from_str(&text).into_diagnostic();
    summary
        .map(Some)
        .wrap_err_with(|| format!("{} is not what the simulator writes", path.display()))
}
