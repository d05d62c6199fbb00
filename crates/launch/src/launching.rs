//! One launch, from its file to the end of its processes.

use std::path::{Path, PathBuf};
use std::time::Duration;

use bus::check_exposure;
use bus::endpoint::connectable;
use config::units::Time;
use config::{Changes, FileError, Source, Speed};
use miette::{IntoDiagnostic, WrapErr, miette};
use protocol::{RobotName, RunName};
use simulator::recorder::LOGS;
use simulator::{RunFolder, Scenario, roster};

use super::compose;
use super::endpoint;
use super::file::{self, LaunchFile};
use super::link::Link;
use super::observe::{Observer, Watch};
use super::options::RunOptions;
use super::plan::{self, Execution, Planned};
use super::screen::{Look, Screen};
use super::secure::Secured;
use super::signals;
use super::supervise::{Outcome, Supervisor};

/// Ports that are tried, where another process is faster to listen at a free one.
const PORTS: usize = 3;

/// What is launched.
#[derive(Debug, Clone)]
pub enum What {
    /// A launch file.
    File(PathBuf),
    /// A plain list of robots, one class a line.
    Roster(PathBuf),
}

/// How it is launched.
#[derive(Debug, Clone)]
pub struct LaunchOptions {
    /// Options of the execution.
    pub run: RunOptions,
    /// Whether the clock waits for `cars ctl start` once all robots have joined.
    pub is_paused: bool,
    /// Whether the console opens in a browser.
    pub opens_browser: bool,
    /// Whether the console is started.
    pub has_console: bool,
    /// Whether only warnings and errors are shown.
    pub is_quiet: bool,
    /// Port of the loopback interface at which the simulator listens; without it a free one.
    pub connect_port: Option<u16>,
    /// Where the simulator listens, instead of at the loopback interface.
    pub listen: Option<String>,
    /// How single processes reach the simulator, if not directly.
    pub links: Vec<Link>,
    /// Folder of certificates, instead of the launch file's.
    pub secure: Option<PathBuf>,
    /// Whether every process that can reach the simulator is trusted.
    pub is_insecure: bool,
    /// How long a process has to end by itself before it is killed.
    pub grace: Time,
}

/// What is launched.
pub struct Launch {
    what: What,
    options: LaunchOptions,
    file: LaunchFile,
    /// With the command line's changes.
    scenario: Scenario,
    run: RunName,
    secured: Option<Secured>,
}

impl What {
    fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Roster(path) => path,
        }
    }
}

impl Launch {
    /// Reads what is to be launched, and checks it.
    ///
    /// # Errors
    /// [`FileError`] of the file or its scenario, and what is missing for a secured run.
    pub fn load(what: What, options: LaunchOptions) -> miette::Result<Self> {
        let changes = options.run.changes();
        let file;
        let scenario;
        match &what {
            What::Roster(path) => {
                let source = Source::read(path)?;
                scenario = roster_scenario(&source, &changes)?;
                file = LaunchFile::of_roster(path, source, &scenario);
            }
            What::File(path) => {
                file = LaunchFile::load(path)?;
                scenario = file.load_scenario(&changes)?;
            }
        }
        file.check_robots(&scenario)?;

        let run = options.run.run_name(what.path()).into_diagnostic()?;
        let secured = secured(&options, &file)?;
        Ok(Self {
            what,
            options,
            file,
            scenario,
            run,
            secured,
        })
    }

    /// The launch as a compose file.
    ///
    /// # Errors
    /// If containers cannot play it.
    pub fn export(&self) -> miette::Result<String> {
        if let What::Roster(roster) = &self.what {
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

        Ok(compose::export(&self.file, &self.run, self.speed())?)
    }

    /// What would be started.
    ///
    /// # Errors
    /// If there is no endpoint for the simulator, or a program is not found.
    pub fn planned(&self) -> miette::Result<Vec<Planned>> {
        Ok(self.plan(&self.endpoint()?)?)
    }

    fn plan(&self, endpoint: &str) -> Result<Vec<Planned>, FileError> {
        let execution = Execution {
            run: &self.run,
            endpoint,
            secured: self.secured.as_ref(),
            is_insecure: self.options.is_insecure,
            out: &self.options.run.out,
            speed: self.speed(),
            is_paused: self.options.is_paused,
            has_console: self.options.has_console,
            opens_browser: self.options.opens_browser,
        };
        let mut planned = plan::plan(&self.file, &execution)?;
        self.options
            .links
            .iter()
            .try_for_each(|link| link.lay(&mut planned))?;

        Ok(planned)
    }

    fn speed(&self) -> Speed {
        self.options
            .run
            .speed
            .or(self.file.speed)
            .unwrap_or(Speed(None))
    }

    /// Where the simulator is to listen.
    fn endpoint(&self) -> miette::Result<String> {
        if let Some(endpoint) = &self.options.listen {
            let config = self.simulator_config();
            check_exposure(endpoint, config.as_ref(), self.options.is_insecure)
                .into_diagnostic()?;
            return Ok(endpoint.clone());
        }

        let free = || {
            endpoint::free_port()
                .into_diagnostic()
                .wrap_err("no free port of the loopback interface")
        };
        let port = self.options.connect_port.map_or_else(free, Ok)?;
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

    /// Plays the run to its end. `notice` receives what happens before the processes start.
    ///
    /// # Errors
    /// If the run's folder cannot be made, or the processes cannot be supervised. That a process failed is part of the
    /// outcome.
    pub fn play(&self, mut notice: impl FnMut(&str)) -> miette::Result<(Outcome, RunFolder)> {
        // A port that was free may be taken when the simulator comes to it.
        let may_choose = self.options.listen.is_none() && self.options.connect_port.is_none();
        let mut ports_left = if may_choose { PORTS } else { 1 };
        loop {
            let endpoint = self.endpoint()?;
            let planned = self.plan(&endpoint)?;
            // The simulator takes the lock over.
            let (folder, lock) = self.options.run.folder(&self.run, &self.scenario)?;
            drop(lock);
            clear_logs(&folder);
            if !self.options.is_quiet {
                self.announce(&endpoint, &folder, &mut notice);
            }
            let outcome = self.supervise(planned, &endpoint, &folder)?;
            ports_left -= 1;
            if ports_left == 0 || outcome.failure.is_none() || !endpoint::is_taken(&endpoint) {
                return Ok((outcome, folder));
            }
            notice(&format!(
                "somebody else listens at {endpoint}: trying another port"
            ));
        }
    }

    fn announce(&self, endpoint: &str, folder: &RunFolder, notice: &mut impl FnMut(&str)) {
        if let What::Roster(roster) = &self.what {
            let mut robots = Vec::new();
            for process in &self.file.processes {
                robots.push(format!("{} ({})", process.name, process.command.join(" ")));
            }
            notice(&format!(
                "{}: {}, in the hall of the first experiment",
                roster.display(),
                robots.join(", ")
            ));
        }

        notice(&format!(
            "run {} at {endpoint}, recorded in {}",
            self.run,
            folder.path().display()
        ));
    }

    /// Runs the processes to their end, with an observer beside them.
    fn supervise(
        &self,
        planned: Vec<Planned>,
        endpoint: &str,
        folder: &RunFolder,
    ) -> miette::Result<Outcome> {
        let grace = Duration::try_from_secs_f64(self.options.grace.0)
            .into_diagnostic()
            .wrap_err("--grace")?;
        let look = Look::here(
            planned.iter().map(|planned| planned.name.clone()).collect(),
            self.options.is_quiet,
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
        let is_needed = !self.options.is_quiet || faults.is_some();
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
fn secured(options: &LaunchOptions, file: &LaunchFile) -> miette::Result<Option<Secured>> {
    let Some(folder) = options.secure.as_ref().or(file.secure.as_ref()) else {
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

/// The scenario of a roster with the command line's changes.
fn roster_scenario(roster: &Source, changes: &Changes) -> Result<Scenario, FileError> {
    let text = roster::scenario_of(roster)?;
    // It names no files, so there is no folder to look for them in.
    let folder = Path::new("");
    if changes.is_empty() {
        Scenario::parse(&text, folder)
    } else {
        Scenario::parse(&changes.apply(&text)?, folder)
    }
}
