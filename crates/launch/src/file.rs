//! The launch file: the processes of a run. It is read as written, then checked and converted. Errors show the place in the
//! file.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use config::speed::SpeedError;
use config::units::Time;
use config::{Changes, FileError, Source, Speed};
use protocol::{RobotName, RobotPattern, RunName};
use scenario::{Interruption, OnLate, Scenario};
use serde::Deserialize;
use toml::Spanned;

use super::restart::Restart;

/// Name of the simulator's process, reserved for it.
pub(crate) const SIMULATOR: &str = "simulator";
/// Name of the console's process, reserved for it.
pub(crate) const CONSOLE: &str = "console";
/// Program of the console.
const CONSOLE_PROGRAM: &str = "cars-console";
/// Program of the simulator, unless the file names another one.
const SIMULATOR_PROGRAM: &str = "cars-sim";
/// Class of a robot that is played from its record.
const REPLAYED: &str = "Replayed";
/// Most robots of a process, those of the largest scenario.
const MAX_PER_PROCESS: usize = 1024;
/// First wait before a restart, unless the file has another one.
const BACKOFF: Duration = Duration::from_secs(1);

/// A launch file, checked.
#[derive(Debug, Clone)]
pub struct LaunchFile {
    /// The text, for errors that show a place in it.
    pub source: Source,
    /// Folder to which paths are relative.
    pub folder: PathBuf,
    /// The scenario file, relative to the current directory.
    pub scenario: PathBuf,
    scenario_span: Option<Range<usize>>,
    /// Name of its runs, unless another one is given; without it the name of the file.
    pub run: Option<RunName>,
    /// Speed of the clock.
    pub speed: Option<Speed>,
    /// The folder of certificates of a secured run, relative to the current directory.
    pub secure: Option<PathBuf>,
    /// The simulator's process.
    pub simulator: Process,
    /// The console's process, if it is enabled.
    pub console: Option<Process>,
    /// The robots' processes in the order of the file.
    pub processes: Vec<Process>,
}

/// Whether this is a launch file and not a scenario file: only a launch file has the key `scenario`.
///
/// # Errors
/// [`FileError`] if it cannot be read, or is not TOML.
pub fn is_launch_file(path: &Path) -> Result<bool, FileError> {
    let table: toml::Table = Source::read(path)?.parse()?;
    Ok(table.contains_key("scenario"))
}

/// The scenario file of a launch file, or the file itself if it is a scenario.
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
    /// Place of the command in the file.
    pub span: Option<Range<usize>>,
    /// The robots that it runs; those of patterns from [`LaunchFile::assign_robots`] on.
    pub robots: Vec<RobotName>,
    /// The robots as they are written.
    written: WrittenRobots,
    robots_span: Option<Range<usize>>,
    /// Environment in addition to the launcher's.
    pub env: BTreeMap<String, String>,
    /// Most robots of one process, where the entry of the file is as many processes as it takes.
    per_process: Option<usize>,
    /// Whether it is restarted when it exits before the end of the run.
    pub restart: Restart,
    /// Wait before the first restart; each further wait is twice as long.
    pub backoff: Duration,
    /// Whether its failure ends the run.
    pub is_required: bool,
    /// Place of `required` in the file.
    required_span: Option<Range<usize>>,
    /// Whether the user starts it, instead of the launcher.
    pub is_extern: bool,
}

/// The robots of a process as they are written in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
enum WrittenRobots {
    /// All that match run in one process.
    Together(Vec<RobotPattern>),
    /// Each that matches has a process of its own, which has its name.
    Each(RobotPattern),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    scenario: Spanned<PathBuf>,
    run: Option<Spanned<String>>,
    speed: Option<Spanned<RawSpeed>>,
    secure: Option<PathBuf>,
    #[serde(default)]
    simulator: RawSimulator,
    #[serde(default)]
    console: RawConsole,
    #[serde(default, rename = "process")]
    processes: Vec<RawProcess>,
}

/// A speed as written in the file.
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
    robots: Option<Spanned<RawRobots>>,
    per_process: Option<Spanned<usize>>,
    #[serde(default)]
    env: BTreeMap<String, String>,
    #[serde(default)]
    restart: Restart,
    backoff: Option<Spanned<Time>>,
    required: Option<Spanned<bool>>,
    #[serde(default)]
    r#extern: bool,
}

/// The robots of a process as written in the file.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "robots are a name or a pattern such as \"S*\", or a list of them"
)]
enum RawRobots {
    One(RobotPattern),
    Several(Vec<RobotPattern>),
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

    /// Reads a launch file and its scenario, with changes, and gives each process its robots.
    ///
    /// # Errors
    /// [`FileError`] of one of them.
    pub fn load_with_scenario(
        path: &Path,
        changes: &Changes,
    ) -> Result<(Self, Scenario), FileError> {
        let mut file = Self::load(path)?;
        let scenario = file.load_scenario(changes)?;
        file.assign_robots(&scenario)?;
        Ok((file, scenario))
    }

    /// Reads the text of a launch file; `folder` is where its relative paths begin.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn parse(source: Source, folder: &Path) -> Result<Self, FileError> {
        let raw: RawFile = source.parse()?;
        let mut speed = None;
        if let Some(raw) = raw.speed {
            speed = Some(check_speed(&source, &raw)?);
        }
        let mut run = None;
        if let Some(raw) = raw.run {
            let name = RunName::new(raw.get_ref());
            let name =
                name.map_err(|error| FileError::at(&source, Some(raw.span()), &error.to_string()))?;
            run = Some(name);
        }
        let simulator = check_simulator(&source, raw.simulator)?;
        let console = raw.console.enabled.then(|| console(raw.console));
        let processes = check_processes(&source, raw.processes)?;

        Ok(Self {
            source,
            folder: folder.to_owned(),
            scenario_span: Some(raw.scenario.span()),
            scenario: tidy(&folder.join(raw.scenario.into_inner())),
            run,
            speed,
            secure: raw.secure.map(|secure| tidy(&folder.join(secure))),
            simulator,
            console,
            processes,
        })
    }

    /// The launch of a roster: one process for each robot, with the program of its class.
    pub(crate) fn of_roster(roster: &Path, source: Source, scenario: &Scenario) -> Self {
        let mut processes = Vec::new();
        for (name, spec) in &scenario.robots {
            let program = format!("cars-{}", spec.class.to_lowercase());
            processes.push(Process {
                robots: vec![name.clone()],
                written: WrittenRobots::Together(vec![name.clone().into()]),
                ..Process::new(name.as_str(), vec![program])
            });
        }

        Self {
            source,
            folder: roster.parent().unwrap_or(Path::new("")).to_owned(),
            scenario: roster.to_owned(),
            scenario_span: None,
            run: None,
            speed: None,
            secure: None,
            simulator: Process::new(SIMULATOR, vec![SIMULATOR_PROGRAM.to_owned()]),
            console: Some(console(RawConsole::default())),
            processes,
        }
    }

    /// Reads the scenario, with changes.
    ///
    /// # Errors
    /// [`FileError`] of the scenario file, which also names the launch file.
    fn load_scenario(&self, changes: &Changes) -> Result<Scenario, FileError> {
        if let Some(span) = &self.scenario_span {
            self.source.check_named(span.clone(), &self.scenario)?;
        }
        Scenario::load(&self.scenario, changes).map_err(|error| error.named_by(&self.source.name))
    }

    /// Replaces the programs of robots by players of their records, which are in the folders of recorded runs.
    ///
    /// # Errors
    /// [`FileError`] if there is no such robot, or it shares its process with others.
    pub(crate) fn replay(
        &mut self,
        replayed: &BTreeMap<RobotName, PathBuf>,
        scenario: &mut Scenario,
    ) -> Result<(), FileError> {
        for (robot, record) in replayed {
            let mut processes = self.processes.iter_mut();
            let process = processes.find(|process| process.robots.contains(robot));
            let (Some(process), Some(spec)) = (process, scenario.robots.get_mut(robot)) else {
                let text = format!("there is no robot {robot} to be played from a record");
                return Err(FileError::new(text).with_help(roster(scenario)));
            };
            if process.robots.len() > 1 {
                return Err(FileError::new(format!(
                    "{robot} shares the process {} with other robots, and only a whole process can be played from a record",
                    process.name
                )));
            }

            let record = record.display().to_string();
            let player = ["cars", "replay-robot", "--record", &record];
            process.command = player.map(str::to_owned).to_vec();
            process.is_extern = false;
            REPLAYED.clone_into(&mut spec.class);
        }
        Ok(())
    }

    /// Gives each process its robots: those of the scenario that match its patterns.
    ///
    /// # Errors
    /// [`FileError`] at the process or at the scenario, unless every robot of the scenario is run by exactly one process.
    pub fn assign_robots(&mut self, scenario: &Scenario) -> Result<(), FileError> {
        let mut processes = Vec::new();
        for process in &self.processes {
            processes.extend(self.processes_of(process, scenario)?);
        }
        self.processes = processes;
        self.check_robots(scenario)
    }

    /// The processes that an entry of the file is.
    fn processes_of(
        &self,
        process: &Process,
        scenario: &Scenario,
    ) -> Result<Vec<Process>, FileError> {
        let matching = |pattern: &RobotPattern| {
            let robots = scenario.robots.keys();
            let found: Vec<RobotName> = robots
                .filter(|robot| pattern.matches(robot))
                .cloned()
                .collect();
            if found.is_empty() && pattern.is_open() {
                let text = format!("the scenario has no robot whose name matches {pattern}");
                return Err(self.refuse(process, &text, &roster(scenario)));
            }
            Ok(found)
        };

        match &process.written {
            WrittenRobots::Each(pattern) => {
                let robots = matching(pattern)?;
                let of_robot = |robot: RobotName| Process {
                    name: robot.to_string(),
                    written: WrittenRobots::Together(vec![robot.clone().into()]),
                    robots: vec![robot],
                    ..process.clone()
                };
                Ok(robots.into_iter().map(of_robot).collect())
            }
            WrittenRobots::Together(patterns) => {
                let mut process = process.clone();
                process.robots = named(patterns);
                for pattern in patterns.iter().filter(|pattern| pattern.is_open()) {
                    process.robots.extend(matching(pattern)?);
                }
                Ok(divided(process))
            }
        }
    }

    /// Checks that every robot of the scenario is run by exactly one process.
    fn check_robots(&self, scenario: &Scenario) -> Result<(), FileError> {
        let mut run_by: BTreeMap<&RobotName, &str> = BTreeMap::new();
        for process in &self.processes {
            for robot in &process.robots {
                if !scenario.robots.contains_key(robot) {
                    let text = format!("the scenario has no robot {robot}");
                    return Err(self.refuse(process, &text, &roster(scenario)));
                }
                if let Some(other) = run_by.insert(robot, &process.name) {
                    let text = format!("robot {robot} is run by process {other} already");
                    let help = "every robot is run by exactly one process";
                    return Err(self.refuse(process, &text, help));
                }
            }
        }

        let mut names = BTreeSet::from([SIMULATOR, CONSOLE]);
        for process in &self.processes {
            if !names.insert(&process.name) {
                let text = format!("a second process called {}", process.name);
                let help = "with `per_process` the name and a number are those of its processes: give one of them another name";
                return Err(self.refuse(process, &text, help));
            }
        }

        for (robot, spec) in &scenario.robots {
            if !run_by.contains_key(robot) {
                return Err(self.not_run(robot, &spec.class));
            }
        }
        self.check_shared(scenario)
    }

    /// Checks that what ends the process of a robot is meant for all robots of the process: otherwise the run would be another one than
    /// that of the scenario, in which each robot is by itself.
    fn check_shared(&self, scenario: &Scenario) -> Result<(), FileError> {
        for process in &self.processes {
            let [first, others @ ..] = &process.robots[..] else {
                continue;
            };
            let of_first = scenario.interruptions(first);
            for other in others {
                let of_other = scenario.interruptions(other);
                if of_first == of_other {
                    continue;
                }

                let of_one = |interruptions: &[Interruption], others: &[Interruption]| {
                    let mut alone = interruptions.iter().filter(|one| !others.contains(one));
                    alone.next().map(|interruption| interruption.at)
                };
                let (robot, spared, at) = match of_one(&of_first, &of_other) {
                    Some(at) => (first, other, at),
                    None => (
                        other,
                        first,
                        of_one(&of_other, &of_first).unwrap_or_default(),
                    ),
                };
                let at_s = at as f64 * scenario.tick_s;
                let text = format!(
                    "at {at_s} s the scenario stops or restarts {robot} and not {spared}, and both are in this process"
                );
                let help = format!(
                    "a fault of a robot and a change of its parameters end its process: give {robot} a process of its own, or let \
                     the scenario name all robots of the process"
                );
                return Err(self.refuse(process, &text, &help));
            }
        }
        Ok(())
    }

    /// What people may want to know of a launch file that can be used: processes that are not required, and for which the clock
    /// waits all the same.
    #[must_use]
    pub fn remarks(&self, scenario: &Scenario) -> Vec<FileError> {
        let mut remarks = Vec::new();
        for process in self.processes.iter().filter(|process| !process.is_required) {
            let robots = process.robots.iter();
            let mut awaited = robots.filter(|robot| scenario.lateness.of(robot) == OnLate::Wait);
            if let Some(robot) = awaited.next() {
                let text = format!(
                    "the clock waits for {robot}: when this process has ended for good, the run ends"
                );
                let remark = FileError::warning(&self.source, process.required_span.clone(), &text);
                remarks.push(remark.with_help(format!(
                    "to let the run go on without it, say on_late = \"continue\" in the scenario, for all robots or for {robot}"
                )));
            }
        }
        remarks
    }

    /// Checks that no process of a secured run has several robots: each robot has a certificate of its own.
    pub(crate) fn check_certificates(&self) -> Result<(), FileError> {
        for process in &self.processes {
            if process.robots.len() > 1 {
                let text = "several robots in one process cannot take part in a secured run";
                let help = "each robot has a certificate of its own: give each one a process";
                return Err(self.refuse(process, text, help));
            }
        }
        Ok(())
    }

    /// An error at the robots of a process.
    fn refuse(&self, process: &Process, text: &str, help: &str) -> FileError {
        let span = process.robots_span.clone();
        FileError::at(&self.source, span, text).with_help(help)
    }

    fn not_run(&self, robot: &RobotName, class: &str) -> FileError {
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
            written: WrittenRobots::Together(Vec::new()),
            robots_span: None,
            per_process: None,
            env: BTreeMap::new(),
            restart: Restart::Never,
            backoff: BACKOFF,
            is_required: true,
            required_span: None,
            is_extern: false,
        }
    }
}

/// The processes that share the robots of one entry, called as the entry and a number from 1.
fn divided(process: Process) -> Vec<Process> {
    let Some(per_process) = process.per_process else {
        return vec![process];
    };
    let mut processes = Vec::new();
    for (index, robots) in process.robots.chunks(per_process).enumerate() {
        let names = robots.iter().cloned().map(RobotPattern::from);
        processes.push(Process {
            name: format!("{}{}", process.name, index + 1),
            written: WrittenRobots::Together(names.collect()),
            robots: robots.to_vec(),
            per_process: None,
            ..process.clone()
        });
    }
    processes
}

/// The robots among these patterns that are called by their names.
fn named(patterns: &[RobotPattern]) -> Vec<RobotName> {
    let names = patterns.iter().filter(|pattern| !pattern.is_open());
    names
        .filter_map(|pattern| RobotName::new(pattern.as_str()).ok())
        .collect()
}

fn roster(scenario: &Scenario) -> String {
    let names: Vec<&str> = scenario.robots.keys().map(RobotName::as_str).collect();
    if names.is_empty() {
        "it has no robots".to_owned()
    } else {
        format!("its robots are {}", names.join(", "))
    }
}

fn check_processes(source: &Source, raw: Vec<RawProcess>) -> Result<Vec<Process>, FileError> {
    let mut names = BTreeSet::from([SIMULATOR, CONSOLE].map(str::to_owned));
    let mut processes = Vec::new();
    for process in raw {
        let span = process.name.span();
        let process = check_process(source, process)?;
        if !names.insert(process.name.clone()) {
            return Err(second_process(source, span, &process.name));
        }
        processes.push(process);
    }
    Ok(processes)
}

fn second_process(source: &Source, span: Range<usize>, name: &str) -> FileError {
    let (text, help) = match name {
        SIMULATOR => (
            "this name is the simulator's own".to_owned(),
            "to change how the simulator starts, write a table [simulator]",
        ),
        CONSOLE => (
            "this name is the console's own".to_owned(),
            "to change how the console starts, write a table [console]",
        ),
        name => (
            format!("a second process called {name}"),
            "each process has its own name, which its log has, too",
        ),
    };

    FileError::at(source, Some(span), &text).with_help(help)
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
        restart: Restart::OnFailure,
        ..Process::new(CONSOLE, command)
    }
}

fn check_process(source: &Source, raw: RawProcess) -> Result<Process, FileError> {
    let name_span = raw.name.span();

    // The rules of robot names make the name of a process fit for its log file.
    let name = RobotPattern::new(raw.name.get_ref())
        .map_err(|error| FileError::at(source, Some(name_span.clone()), &error.to_string()))?;
    let robots_span = raw.robots.as_ref().map_or(name_span.clone(), Spanned::span);
    let written = match raw.robots {
        Some(_) if name.is_open() => {
            let text = "a process whose name is a pattern is one for each robot that matches";
            let help = "name the process, or leave `robots` out";
            return Err(FileError::at(source, Some(name_span), text).with_help(help));
        }
        Some(robots) => WrittenRobots::Together(match robots.into_inner() {
            RawRobots::One(pattern) => vec![pattern],
            RawRobots::Several(patterns) => patterns,
        }),
        None if name.is_open() => WrittenRobots::Each(name.clone()),
        None => WrittenRobots::Together(vec![name.clone()]),
    };
    let robots = match &written {
        WrittenRobots::Together(patterns) => named(patterns),
        WrittenRobots::Each(_) => Vec::new(),
    };
    let per_process = match &raw.per_process {
        Some(per_process) => Some(check_per_process(source, per_process, &written)?),
        None => None,
    };
    let backoff = match raw.backoff {
        Some(backoff) => check_backoff(source, &backoff)?,
        None => BACKOFF,
    };

    Ok(Process {
        span: Some(raw.command.span()),
        robots,
        written,
        robots_span: Some(robots_span),
        per_process,
        env: raw.env,
        restart: raw.restart,
        backoff,
        required_span: raw.required.as_ref().map(Spanned::span),
        is_required: raw.required.is_none_or(Spanned::into_inner),
        is_extern: raw.r#extern,
        ..Process::new(name.as_str(), check_command(source, raw.command)?)
    })
}

fn check_per_process(
    source: &Source,
    per_process: &Spanned<usize>,
    written: &WrittenRobots,
) -> Result<usize, FileError> {
    let refuse = |text: &str, help: &str| {
        FileError::at(source, Some(per_process.span()), text).with_help(help)
    };
    if matches!(written, WrittenRobots::Each(_)) {
        let text = "a process whose name is a pattern has one robot";
        let help = "name the process, and give it `robots` as a pattern";
        return Err(refuse(text, help));
    }
    let count = *per_process.get_ref();
    if !(1..=MAX_PER_PROCESS).contains(&count) {
        let text = format!("a process has 1 to {MAX_PER_PROCESS} robots");
        return Err(refuse(&text, "for example: per_process = 64"));
    }
    Ok(count)
}

fn check_command(source: &Source, command: Spanned<Vec<String>>) -> Result<Vec<String>, FileError> {
    if command.get_ref().first().is_none_or(String::is_empty) {
        let text = "a command names at least a program";
        let help = "for example: command = [\"cars-butler\"]";
        return Err(FileError::at(source, Some(command.span()), text).with_help(help));
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
    match Duration::try_from_secs_f64(backoff.get_ref().0) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => {
            let span = Some(backoff.span());
            Err(FileError::at(source, span, "a back-off is more than zero"))
        }
    }
}

/// Removes `.` and `..` where possible: `launch/../configs/x` becomes `configs/x`.
fn tidy(path: &Path) -> PathBuf {
    use std::path::Component;

    let mut tidied = PathBuf::new();
    for part in path.components() {
        let is_below = matches!(tidied.components().next_back(), Some(Component::Normal(_)));
        // The parent of a symbolic link is not the folder that contains the link.
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
