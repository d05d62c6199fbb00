//! A launch: from its file to the exit of its processes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bus::endpoint::connectable;
use bus::{check_exposure, check_run};
use config::units::Time;
use config::{Changes, FileError, Source, Speed};
use protocol::{RobotName, RunName};
use record::folder::FAILED;
use record::names::{LOGS, SCENARIO};
use record::{IfTaken, RunFolder, RunLock};
use scenario::{Scenario, roster};

use super::compose;
use super::endpoint;
use super::error::LaunchError;
use super::failure::Failure;
use super::file::{self, LaunchFile};
use super::launched::Launched;
use super::leftovers::Leftovers;
use super::link::ProcessLink;
use super::observe::{Observer, ObserverTask};
use super::options::RunOptions;
use super::plan::{self, Execution, Part, Planned};
use super::screen::{Screen, ScreenOptions};
use super::secure::Secured;
use super::signals;
use super::supervise::{LaunchOutcome, Supervisor};

/// Number of ports to try: another process may bind a free port before the simulator does.
const PORTS: usize = 3;
/// Name of a run that is launched again from a folder that is not named like a run.
const AGAIN: &str = "again";

/// Speed of a run that is opened in a browser, unless the command line states another one.
const WATCHED: Speed = Speed(Some(5.0));

/// Where the processes of a launch are listed.
#[derive(Debug, Clone)]
pub enum What {
    /// A launch file.
    File(PathBuf),
    /// A list of robots, one class a line.
    Roster(PathBuf),
}

/// Options of a launch.
#[derive(Debug, Clone)]
pub struct LaunchOptions {
    /// Options of the execution.
    pub run: RunOptions,
    /// Whether the clock waits for `cars ctl start` once all robots have joined.
    pub is_paused: bool,
    /// Whether the console opens in a browser. The run waits for a person to start it there, and goes at a speed to look at.
    pub opens_browser: bool,
    /// Whether the console is started.
    pub has_console: bool,
    /// Whether only warnings and errors are shown.
    pub is_quiet: bool,
    /// Port of the loopback interface at which the simulator listens; without it a free one.
    pub connect_port: Option<u16>,
    /// Endpoint of the simulator, instead of a port of the loopback interface.
    pub listen: Option<String>,
    /// Links of single processes to the simulator, if not direct.
    pub links: Vec<ProcessLink>,
    /// Folder of certificates, instead of the launch file's.
    pub secure: Option<PathBuf>,
    /// Whether the simulator may listen without certificates where other machines can connect.
    pub is_insecure: bool,
    /// How long a process may take to exit before it is killed.
    pub grace: Time,
    /// Robots that are played from their records, with the folders of the recorded runs.
    pub replayed: BTreeMap<RobotName, PathBuf>,
    /// Whether the processes are kept when the run is over, also while no browser shows it.
    pub stays: bool,
}

/// A launch that has been read and checked.
pub struct Launch {
    what: What,
    options: LaunchOptions,
    file: LaunchFile,
    /// The scenario with the changes of the command line.
    scenario: Scenario,
    run: RunName,
    secured: Option<Secured>,
    /// Whether the run in the folder is resumed.
    is_resumed: bool,
}

impl What {
    fn load(&self, changes: &Changes) -> Result<(LaunchFile, Scenario), FileError> {
        match self {
            Self::Roster(path) => {
                let source = Source::read(path)?;
                let scenario = roster_scenario(&source, changes)?;
                let file = LaunchFile::of_roster(path, source, &scenario);
                Ok((file, scenario))
            }
            Self::File(path) => LaunchFile::load_with_scenario(path, changes),
        }
    }

    fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Roster(path) => path,
        }
    }
}

impl Launch {
    /// Reads and checks the file and its scenario.
    ///
    /// # Errors
    /// [`FileError`] of the file or its scenario; a missing certificate of a secured run.
    pub fn load(what: What, options: LaunchOptions) -> Result<Self, LaunchError> {
        let (mut file, mut scenario) = what.load(&options.run.changes())?;
        let run = options.run.run_name(what.path())?;
        file.replay(&options.replayed, &mut scenario)?;
        if options.run.if_taken == IfTaken::Replace {
            check_not_overwritten(&options.run.out.join(run.as_str()), &options.replayed)?;
        }
        Self::of(what, file, scenario, run, options)
    }

    /// A launch of which everything has been read.
    fn of(
        what: What,
        file: LaunchFile,
        scenario: Scenario,
        run: RunName,
        options: LaunchOptions,
    ) -> Result<Self, LaunchError> {
        check_texts(what.path(), &options)?;
        let secured = secured(&options, &file)?;
        if let Some(secured) = &secured {
            check_run(&secured.config_of(file::SIMULATOR), &run)?;
        }

        Ok(Self {
            what,
            options,
            file,
            scenario,
            run,
            secured,
            is_resumed: false,
        })
    }

    /// Reads how the run in a folder was launched, to resume it: its scenario and its launch file are those of the folder, and
    /// so is what the options leave open.
    ///
    /// # Errors
    /// [`FileError`] if it is not the folder of a run that was launched, or the run is in progress or has ended; a missing
    /// certificate of a secured run.
    pub fn resume(folder: &Path, mut options: LaunchOptions) -> Result<Self, LaunchError> {
        let folder = RunFolder::at(folder.to_owned()).resolved_to_write()?;
        // The simulator takes the lock and reads the record.
        folder.lock_of_launcher()?;
        folder.reopen()?;
        folder.name()?;
        let out = folder.path().parent().unwrap_or(Path::new(""));
        options.run.out = out.to_owned();

        let mut launch = Self::again(folder.path(), options)?;
        launch.is_resumed = true;
        Ok(launch)
    }

    /// Reads how the run in a folder was launched, to launch it once more from the beginning, under the folder that the options
    /// name.
    ///
    /// # Errors
    /// [`FileError`] if it is not the folder of a run that was launched; a missing certificate of a secured run.
    pub fn again(folder: &Path, mut options: LaunchOptions) -> Result<Self, LaunchError> {
        let folder = RunFolder::at(folder.to_owned());
        let launched = Launched::read(&folder)?;
        let mut scenario = Scenario::load(&folder.file(SCENARIO), &Changes::default())?;
        let mut file = launched.launch_file(&scenario)?;
        file.replay(&launched.replayed, &mut scenario)?;
        options.replayed = launched.replayed;

        // A copy may have any name.
        let run = folder
            .name()
            .or_else(|_| RunName::new(AGAIN))
            .map_err(|error| LaunchError::refused(error.to_string()))?;
        if options.run.speed.is_none() {
            options.run.speed = Some(Speed(launched.speed));
        }
        options.secure = options.secure.or(launched.secure);
        options.is_insecure |= launched.is_insecure;
        let what = if launched.is_roster {
            What::Roster(launched.file)
        } else {
            What::File(launched.file)
        };
        Self::of(what, file, scenario, run, options)
    }

    /// The launch that resumes this one, which has failed.
    ///
    /// # Errors
    /// As for [`Self::resume`].
    pub fn resumed(&self, folder: &RunFolder) -> Result<Self, LaunchError> {
        let mut options = self.options.clone();
        // The page that asked for it is still open.
        options.opens_browser = false;
        Self::resume(folder.path(), options)
    }

    /// Makes the folder of a new run and notes how it is launched, or takes that of the run to resume. From then on the run has
    /// the name of the folder. While the lock is held, no other launch takes the folder.
    fn take_folder(
        &mut self,
        notice: &mut impl FnMut(&str),
    ) -> Result<(RunFolder, Option<RunLock>), LaunchError> {
        if self.is_resumed {
            let folder = RunFolder::new(&self.options.run.out, &self.run);
            let lock = folder.lock_of_launcher()?;
            let _is_gone = std::fs::remove_file(folder.file(LOGS).join(FAILED));
            return Ok((folder, lock));
        }

        let mut options = self.options.run.clone();
        if options.if_taken == IfTaken::Number && self.is_bound_to_run() {
            options.if_taken = IfTaken::Refuse;
        }
        let made = options.folder(&self.run, &self.scenario)?;
        if let Some(text) = &made.notice {
            notice(text);
        }
        self.run = made.run;

        let secure = self.options.secure.as_deref();
        let launched = Launched {
            file: absolute(self.what.path())?,
            is_roster: matches!(self.what, What::Roster(_)),
            text: self.file.source.text.clone(),
            speed: self.speed().0,
            secure: secure.map(absolute).transpose()?,
            is_insecure: self.options.is_insecure,
            replayed: self.options.replayed.clone(),
        };
        launched.write(&made.folder)?;
        let lock = made.folder.lock_of_launcher()?;
        drop(made.lock); // The simulator takes it.
        Ok((made.folder, lock))
    }

    /// Whether the certificates admit no run with another name.
    fn is_bound_to_run(&self) -> bool {
        let secured = self.secured.as_ref();
        secured.is_some_and(|secured| secured.is_bound_to(&self.run))
    }

    /// The launch as a compose file.
    ///
    /// # Errors
    /// If the launch is secured, or is a roster.
    pub fn export(&self) -> Result<String, LaunchError> {
        if let What::Roster(roster) = &self.what {
            let help = "write a launch file, with a scenario that the containers can read";
            let reason = format!("{} cannot be exported", roster.display());
            return Err(LaunchError::refused_with_help(reason, help));
        }

        if self.secured.is_some() {
            let help = "export it without `secure`: the containers have a private network";
            let reason = "a secured launch cannot be exported";
            return Err(LaunchError::refused_with_help(reason, help));
        }

        Ok(compose::export(
            &self.file,
            &self.run,
            self.options.run.if_taken,
            self.speed(),
        )?)
    }

    /// The processes with their command lines.
    ///
    /// # Errors
    /// If there is no endpoint for the simulator, or a program is not found.
    pub fn planned(&mut self) -> Result<Vec<Planned>, LaunchError> {
        let options = &self.options.run;
        self.run = RunFolder::next_name(&options.out, &self.run, options.if_taken);
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
            is_resumed: self.is_resumed,
            stays: self.options.stays,
            has_console: self.options.has_console,
            opens_browser: self.options.opens_browser,
        };

        let mut planned = plan::plan(&self.file, &execution)?;
        for link in &self.options.links {
            link.apply(&mut planned)?;
        }

        Ok(planned)
    }

    fn speed(&self) -> Speed {
        // A person who opens the page wants to see what happens.
        let watched = self.options.opens_browser.then_some(WATCHED);
        let speed = self.options.run.speed.or(watched).or(self.file.speed);
        speed.unwrap_or(Speed(None))
    }

    /// The endpoint at which the simulator will listen.
    fn endpoint(&self) -> Result<String, LaunchError> {
        if let Some(endpoint) = &self.options.listen {
            let config = self.simulator_config();
            check_exposure(endpoint, config.as_ref(), self.options.is_insecure)?;
            return Ok(endpoint.clone());
        }

        // Port 0 is any free one, as for other programs.
        let port = match self.options.connect_port.filter(|port| *port != 0) {
            Some(port) => port,
            None => endpoint::free_port()?,
        };
        Ok(endpoint::loopback(port, self.secured.is_some()))
    }

    /// The configuration file of the simulator: that of a secured run, or the one in its environment.
    fn simulator_config(&self) -> Option<PathBuf> {
        if let Some(secured) = &self.secured {
            return Some(secured.config_of(file::SIMULATOR));
        }

        let own = self.file.simulator.env.get(plan::ZENOH_CONFIG);
        own.map(PathBuf::from).or_else(inherited_config)
    }

    /// The configuration file of the launcher's own session.
    fn observer_config(&self) -> Option<PathBuf> {
        match &self.secured {
            Some(secured) => Some(secured.operator()),
            None => inherited_config(),
        }
    }

    /// Plays the run to its end. `notice` receives lines for people before the processes start.
    ///
    /// # Errors
    /// If the run's folder cannot be made, or the processes cannot be supervised. The failure of a process is part of the
    /// outcome.
    pub fn play(
        &mut self,
        mut notice: impl FnMut(&str),
    ) -> Result<(LaunchOutcome, RunFolder), LaunchError> {
        // A free port may be taken before the simulator binds it, if only by a connection that has ended since.
        let is_chosen = self.options.connect_port.is_some_and(|port| port != 0);
        let may_choose = self.options.listen.is_none() && !is_chosen;
        let mut ports_left = if may_choose { PORTS } else { 1 };
        let mut endpoint = self.endpoint()?;
        // What cannot be launched leaves no folder.
        self.plan(&endpoint)?;
        let (folder, _in_use) = self.take_folder(&mut notice)?;
        let mut play = || loop {
            let planned = self.plan(&endpoint)?;
            if !self.options.is_quiet {
                self.announce(&endpoint, &folder, &mut notice);
            }

            let outcome = self.supervise(planned, &endpoint, &folder)?;
            ports_left -= 1;
            if ports_left == 0 || !is_port_taken(&outcome) {
                return Ok(outcome);
            }
            notice(&format!("{endpoint} is taken: trying another port"));
            endpoint = self.endpoint()?;
        };

        let played: Result<LaunchOutcome, LaunchError> = play();
        let keeps_replaced = folder.restore_replaced()?;
        let mut outcome = played?;
        outcome.keeps_replaced = keeps_replaced;
        if let Some(failure) = outcome.failure.as_mut().filter(|_| keeps_replaced) {
            failure.log = None; // Another one is in its place.
        }
        Ok((outcome, folder))
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

        let is_resumed = if self.is_resumed { ", resumed" } else { "" };
        notice(&format!(
            "run {}{is_resumed} at {endpoint}, recorded in {}",
            self.run,
            folder.path().display()
        ));
    }

    /// Runs the processes to their end, with an observer that feeds the terminal and the supervisor. They are started on this
    /// thread, and end with it.
    fn supervise(
        &self,
        mut planned: Vec<Planned>,
        endpoint: &str,
        folder: &RunFolder,
    ) -> Result<LaunchOutcome, LaunchError> {
        let leftovers = Leftovers::guarded();
        for process in planned.iter_mut().filter(|process| !process.is_extern) {
            if process.part == Part::Robots {
                process.command.env.extend([leftovers.mark(&process.name)]);
            }
            process.tie();
        }

        let grace = Duration::try_from_secs_f64(self.options.grace.0)
            .map_err(|error| LaunchError::refused(format!("--grace: {error}")))?;
        let names = planned.iter().map(|planned| planned.name.clone()).collect();
        let look = ScreenOptions::here(names, self.options.is_quiet);
        let wants_world = look.has_bar;
        let screen =
            Screen::open(look).map_err(LaunchError::system("no thread for the terminal"))?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(LaunchError::system("processes cannot be supervised"))?;

        let (gone_sender, gone) = std::sync::mpsc::channel();
        let supervisor = Supervisor::new(
            planned,
            &folder.file(LOGS),
            grace,
            screen.handle(),
            leftovers,
            gone_sender,
        );
        let watch = ObserverTask {
            run: self.run.clone(),
            endpoint: connectable(endpoint),
            config: self.observer_config(),
            wants_world,
            screen: screen.handle(),
            supervisor: supervisor.queue(),
            gone,
        };
        let observer =
            Observer::start(watch).map_err(LaunchError::system("the run cannot be observed"))?;
        let outcome = runtime
            .block_on(async {
                signals::listen(&supervisor.queue())?;
                std::io::Result::Ok(supervisor.run().await)
            })
            .map_err(LaunchError::system("signals cannot be received"))?;

        observer.finish();
        screen.finish();
        Ok(outcome)
    }
}

/// Whether the run failed because the simulator could not listen where another process does.
fn is_port_taken(outcome: &LaunchOutcome) -> bool {
    let failure = outcome.failure.as_ref();
    failure.is_some_and(Failure::is_port_taken)
}

/// A path that holds in any folder: the run may be resumed from another one.
fn absolute(path: &Path) -> Result<PathBuf, FileError> {
    std::path::absolute(path).map_err(|error| FileError::unreadable(path, &error))
}

/// Checks that no record from which a robot is played is in the folder of the new run.
fn check_not_overwritten(
    folder: &Path,
    replayed: &BTreeMap<RobotName, PathBuf>,
) -> Result<(), FileError> {
    let Ok(folder) = folder.canonicalize() else {
        return Ok(());
    };
    if replayed.values().any(|record| *record == folder) {
        let text = format!("the launch would overwrite {}", folder.display());
        return Err(FileError::new(text).with_help("give it another name by --run"));
    }
    Ok(())
}

/// The certificates of a secured launch: those of the command line, or of the file.
fn secured(options: &LaunchOptions, file: &LaunchFile) -> Result<Option<Secured>, LaunchError> {
    let Some(folder) = options.secure.as_ref().or(file.secure.as_ref()) else {
        return Ok(None);
    };

    file.check_certificates()?;
    let robots = file.processes.iter().flat_map(|process| &process.robots);
    let robots = robots.map(RobotName::as_str);
    let console = file.console.iter().map(|_| file::CONSOLE);
    Secured::find(folder, robots.chain(console)).map(Some)
}

/// The configuration file in the environment, which every program of the project reads.
fn inherited_config() -> Option<PathBuf> {
    std::env::var_os(plan::ZENOH_CONFIG).map(PathBuf::from)
}

/// Checks that the paths with which processes are launched are texts.
fn check_texts(file: &Path, options: &LaunchOptions) -> Result<(), FileError> {
    let mut paths = vec![absolute(file)?, options.run.out.clone()];
    if let Some(secure) = &options.secure {
        paths.push(absolute(secure)?);
    }
    paths.extend(options.replayed.values().cloned());

    match paths.iter().find(|path| path.to_str().is_none()) {
        None => Ok(()),
        Some(path) => {
            let place = path.display();
            let error = FileError::new(format!("{place}: this path is not UTF-8"));
            Err(error.with_help("rename it; `cars run` takes such paths, too"))
        }
    }
}

/// The scenario of a roster with the changes of the command line.
fn roster_scenario(roster: &Source, changes: &Changes) -> Result<Scenario, FileError> {
    let text = roster::scenario_of(roster)?;
    // A roster names no files, so no folder is needed.
    let folder = Path::new("");
    if changes.is_empty() {
        Scenario::parse(&text, folder)
    } else {
        Scenario::parse(&changes.apply(&text)?, folder)
    }
}
