//! The launch file: which processes run together. It is read as it is written, then checked and turned into what it
//! means; what is wrong is shown where it stands.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use config::speed::SpeedError;
use config::units::Time;
use config::{Changes, FileError, Source, Speed};
use protocol::RobotName;
use serde::Deserialize;
use simulator::Scenario;
use toml::Spanned;

use super::restart::Restart;

/// Name under which the simulator's process is known; no other process may have it.
pub(crate) const SIMULATOR: &str = "simulator";
/// Name under which the console's process is known; no other process may have it.
pub(crate) const CONSOLE: &str = "console";
/// Program of the console.
const CONSOLE_PROGRAM: &str = "cars-console";
/// Program of the simulator, unless the file says otherwise.
const SIMULATOR_PROGRAM: &str = "cars-sim";
/// First wait before a restart, unless the file says otherwise.
const BACKOFF: Duration = Duration::from_secs(1);

/// A launch file, checked.
#[derive(Debug, Clone)]
pub struct LaunchFile {
    /// The text, to show where something stands.
    pub source: Source,
    /// Folder that relative paths are relative to.
    pub folder: PathBuf,
    /// The scenario file, found from the current directory.
    pub scenario: PathBuf,
    scenario_span: Option<Range<usize>>,
    /// How fast the clock goes.
    pub speed: Option<Speed>,
    /// The folder of certificates that secures the run, found from the current directory.
    pub secure: Option<PathBuf>,
    /// The simulator's own process.
    pub simulator: Process,
    /// The console's process, unless it is not wanted.
    pub console: Option<Process>,
    /// The robots' processes, in the order of the file.
    pub processes: Vec<Process>,
}

/// Whether this is a launch file: it names its scenario, and a scenario file does not.
///
/// # Errors
/// [`FileError`] if it cannot be read, or is not TOML.
pub fn is_launch_file(path: &Path) -> Result<bool, FileError> {
    Ok(Source::read(path)?
        .parse::<toml::Table>()?
        .contains_key("scenario"))
}

/// The scenario that a file is about: that of a launch file, or the file itself.
///
/// # Errors
/// [`FileError`] if it cannot be read, or is a launch file with an error.
pub fn scenario_file(path: &Path) -> Result<PathBuf, FileError> {
    if is_launch_file(path)? {
        Ok(LaunchFile::load(path)?.scenario)
    } else {
        Ok(path.to_owned())
    }
}

/// One process of a launch file.
#[derive(Debug, Clone)]
pub struct Process {
    /// Name on the terminal and of its log.
    pub name: String,
    /// Program and its first arguments; never empty.
    pub command: Vec<String>,
    /// Where the command stands in the file.
    pub span: Option<Range<usize>>,
    /// The robots that it runs.
    pub robots: Vec<RobotName>,
    robots_span: Option<Range<usize>>,
    /// Environment in addition to the launcher's.
    pub env: BTreeMap<String, String>,
    /// What to do when it ends before the run does.
    pub restart: Restart,
    /// Wait before the first restart; it doubles from there.
    pub backoff: Duration,
    /// Whether its failure ends the run.
    pub is_required: bool,
    /// Whether somebody else starts it.
    pub is_extern: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    scenario: Spanned<PathBuf>,
    speed: Option<Spanned<RawSpeed>>,
    secure: Option<PathBuf>,
    #[serde(default)]
    simulator: RawSimulator,
    #[serde(default)]
    console: RawConsole,
    #[serde(default, rename = "process")]
    processes: Vec<RawProcess>,
}

/// As people write it: a number, or `"max"`.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "a speed is a number above zero, or \"max\"")]
enum RawSpeed {
    Factor(f64),
    Text(String),
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSimulator {
    command: Option<Spanned<Vec<String>>>,
    #[serde(default)]
    env: BTreeMap<String, String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawConsole {
    #[serde(default = "yes")]
    enabled: bool,
    bind: Option<String>,
    #[serde(default)]
    env: BTreeMap<String, String>,
}

impl Default for RawConsole {
    fn default() -> Self {
        Self {
            enabled: true,
            bind: None,
            env: BTreeMap::new(),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawProcess {
    name: Spanned<String>,
    command: Spanned<Vec<String>>,
    robots: Option<Spanned<Vec<RobotName>>>,
    #[serde(default)]
    env: BTreeMap<String, String>,
    #[serde(default)]
    restart: Restart,
    backoff: Option<Spanned<Time>>,
    #[serde(default = "yes")]
    required: bool,
    #[serde(default)]
    r#extern: bool,
}

fn yes() -> bool {
    true
}

impl LaunchFile {
    /// Reads a launch file.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(Source::read(path)?, folder)
    }

    /// Reads the text of a launch file; `folder` is where its relative paths begin.
    pub(crate) fn parse(source: Source, folder: &Path) -> Result<Self, FileError> {
        let raw: RawFile = source.parse()?;
        let speed = raw
            .speed
            .map(|speed| check_speed(&source, &speed))
            .transpose()?;
        let simulator = check_simulator(&source, raw.simulator)?;
        let console = raw.console.enabled.then(|| console(raw.console));
        let mut names = BTreeSet::from([SIMULATOR, CONSOLE].map(str::to_owned));
        let mut processes = Vec::new();
        for process in raw.processes {
            let (span, process) = (process.name.span(), check_process(&source, process)?);
            if !names.insert(process.name.clone()) {
                return Err(second_process(&source, span, &process.name));
            }
            processes.push(process);
        }

        let scenario_span = Some(raw.scenario.span());
        let scenario = tidy(&folder.join(raw.scenario.into_inner()));
        let secure = raw.secure.map(|secure| tidy(&folder.join(secure)));
        let folder = folder.to_owned();

        Ok(Self {
            source,
            folder,
            scenario,
            scenario_span,
            speed,
            secure,
            simulator,
            console,
            processes,
        })
    }

    /// What a plain roster means: one process for each robot, its program called after its class.
    pub(crate) fn of_roster(roster: &Path, source: Source, scenario: &Scenario) -> Self {
        let process = |(name, spec): (&RobotName, &simulator::scenario::RobotSpec)| Process {
            robots: vec![name.clone()],
            ..Process::new(
                name.as_str(),
                vec![format!("cars-{}", spec.class.to_lowercase())],
            )
        };

        Self {
            source,
            folder: roster.parent().unwrap_or(Path::new("")).to_owned(),
            scenario: roster.to_owned(),
            scenario_span: None,
            speed: None,
            secure: None,
            simulator: Process::new(SIMULATOR, vec![SIMULATOR_PROGRAM.to_owned()]),
            console: Some(console(RawConsole::default())),
            processes: scenario.robots.iter().map(process).collect(),
        }
    }

    /// The scenario, with changes.
    ///
    /// # Errors
    /// [`FileError`] of the scenario file, which also names this one.
    pub fn load_scenario(&self, changes: &Changes) -> Result<Scenario, FileError> {
        Scenario::load(&self.scenario, changes).map_err(|error| error.named_by(&self.source.name))
    }

    /// Checks the file against its scenario: every robot is run by exactly one process.
    ///
    /// # Errors
    /// [`FileError`] at the process, or at the scenario, that has to change.
    pub fn check_robots(&self, scenario: &Scenario) -> Result<(), FileError> {
        let mut run_by: BTreeMap<&RobotName, &str> = BTreeMap::new();
        for process in &self.processes {
            for robot in &process.robots {
                let refuse =
                    |reason: &str| FileError::at(&self.source, process.robots_span.clone(), reason);
                if !scenario.robots.contains_key(robot) {
                    return Err(refuse(&format!("the scenario has no robot {robot}"))
                        .with_help(roster(scenario)));
                }
                if let Some(other) = run_by.insert(robot, &process.name) {
                    let text = format!("robot {robot} is run by process {other} already");
                    return Err(
                        refuse(&text).with_help("every robot is run by exactly one process")
                    );
                }
            }
        }

        match scenario
            .robots
            .keys()
            .find(|robot| !run_by.contains_key(robot))
        {
            None => Ok(()),
            Some(robot) => Err(self.nobody_runs(robot, &scenario.robots[robot].class)),
        }
    }

    /// Checks that every process of a secured run can show who it is.
    pub(crate) fn check_certificates(&self) -> Result<(), FileError> {
        match self
            .processes
            .iter()
            .find(|process| process.robots.len() > 1)
        {
            None => Ok(()),
            Some(process) => {
                let text = "several robots in one process cannot take part in a secured run";
                let help = "a certificate is that of one robot: give each a process of its own";
                Err(FileError::at(&self.source, process.robots_span.clone(), text).with_help(help))
            }
        }
    }

    fn nobody_runs(&self, robot: &RobotName, class: &str) -> FileError {
        let text = format!("robot {robot} of this scenario is run by no process");
        let program = class.to_lowercase();
        FileError::at(&self.source, self.scenario_span.clone(), &text).with_help(format!(
            "add, for example:\n\n[[process]]\nname = \"{robot}\"\ncommand = [\"cars-{program}\"]"
        ))
    }
}

impl Process {
    fn new(name: &str, command: Vec<String>) -> Self {
        Self {
            name: name.to_owned(),
            command,
            span: None,
            robots: Vec::new(),
            robots_span: None,
            env: BTreeMap::new(),
            restart: Restart::Never,
            backoff: BACKOFF,
            is_required: true,
            is_extern: false,
        }
    }
}

fn roster(scenario: &Scenario) -> String {
    let names: Vec<&str> = scenario.robots.keys().map(RobotName::as_str).collect();
    if names.is_empty() {
        "it has no robots".to_owned()
    } else {
        format!("its robots are {}", names.join(", "))
    }
}

fn second_process(source: &Source, span: Range<usize>, name: &str) -> FileError {
    if name == SIMULATOR {
        return FileError::at(source, Some(span), "this name is the simulator's own")
            .with_help("to change how the simulator starts, write a table [simulator]");
    }

    if name == CONSOLE {
        return FileError::at(source, Some(span), "this name is the console's own")
            .with_help("to change how the console starts, write a table [console]");
    }

    FileError::at(
        source,
        Some(span),
        &format!("a second process called {name}"),
    )
    .with_help("each process has a name of its own: its log is called after it")
}

fn check_simulator(source: &Source, raw: RawSimulator) -> Result<Process, FileError> {
    let span = raw.command.as_ref().map(Spanned::span);
    let command = match raw.command {
        Some(command) => check_command(source, command)?,
        None => vec![SIMULATOR_PROGRAM.to_owned()],
    };

    Ok(Process {
        span,
        env: raw.env,
        ..Process::new(SIMULATOR, command)
    })
}

fn console(raw: RawConsole) -> Process {
    let mut command = vec![CONSOLE_PROGRAM.to_owned()];
    command.extend(raw.bind.map(|bind| format!("--bind={bind}")));
    Process {
        env: raw.env,
        is_required: false,
        ..Process::new(CONSOLE, command)
    }
}

fn check_process(source: &Source, raw: RawProcess) -> Result<Process, FileError> {
    let span = raw.name.span();

    // A process is named like a robot, and mostly as its robot: the name is that of a file, too.
    let name = RobotName::new(raw.name.get_ref());
    let name =
        name.map_err(|error| FileError::at(source, Some(span.clone()), &error.to_string()))?;
    let robots_span = Some(raw.robots.as_ref().map_or(span, Spanned::span));
    let backoff = raw
        .backoff
        .map(|backoff| check_backoff(source, &backoff))
        .transpose()?;
    let command_span = raw.command.span();

    Ok(Process {
        span: Some(command_span),
        robots: raw
            .robots
            .map_or_else(|| vec![name.clone()], Spanned::into_inner),
        robots_span,
        env: raw.env,
        restart: raw.restart,
        backoff: backoff.unwrap_or(BACKOFF),
        is_required: raw.required,
        is_extern: raw.r#extern,
        ..Process::new(name.as_str(), check_command(source, raw.command)?)
    })
}

fn check_command(source: &Source, command: Spanned<Vec<String>>) -> Result<Vec<String>, FileError> {
    if command.get_ref().first().is_none_or(String::is_empty) {
        return Err(FileError::at(
            source,
            Some(command.span()),
            "a command names at least a program",
        )
        .with_help("for example: command = [\"cars-butler\"]"));
    }
    Ok(command.into_inner())
}

fn check_speed(source: &Source, speed: &Spanned<RawSpeed>) -> Result<Speed, FileError> {
    let text = match speed.get_ref() {
        RawSpeed::Factor(factor) => factor.to_string(),
        RawSpeed::Text(text) => text.clone(),
    };
    text.parse()
        .map_err(|error: SpeedError| FileError::at(source, Some(speed.span()), &error.to_string()))
}

fn check_backoff(source: &Source, backoff: &Spanned<Time>) -> Result<Duration, FileError> {
    let time = Duration::try_from_secs_f64(backoff.get_ref().0)
        .ok()
        .filter(|time| !time.is_zero());
    time.ok_or_else(|| FileError::at(source, Some(backoff.span()), "a back-off is more than zero"))
}

/// The same path without detours: `launch/../configs/x` is `configs/x`.
fn tidy(path: &Path) -> PathBuf {
    use std::path::Component;

    let mut tidied = PathBuf::new();
    for part in path.components() {
        let is_below = matches!(tidied.components().next_back(), Some(Component::Normal(_)));
        // Where a folder is a link, `..` leads elsewhere than it looks.
        if part == Component::ParentDir && is_below && !tidied.is_symlink() {
            tidied.pop();
        } else if part != Component::CurDir {
            tidied.push(part);
        }
    }

    tidied
}

#[cfg(test)]
mod tests;
