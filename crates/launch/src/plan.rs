//! Command lines of a launch: every program is located and every argument added.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bus::endpoint::connectable;
use config::FileError;
use protocol::{RobotName, RunName};
use record::RunFolder;
use record::folder::{CONSOLE_KEPT, FAILED};
use record::names::{LOGS, SCENARIO};

use super::child::{self, AtExit};
use super::file::{CONSOLE, LaunchFile, Process, SIMULATOR};
use super::program::{NotFound, Places, how_to_install};
use super::restart::Restart;
use crate::secure::Secured;
use config::Speed;

/// Environment variable with a zenoh configuration file; every program of the project reads it.
pub(super) const ZENOH_CONFIG: &str = "CARS_ZENOH_CONFIG";

/// Environment variable with the file in which the console keeps its address and its token, so that browsers find it again when
/// it was killed and is started again.
const KEEP_VARIABLE: &str = "CARS_CONSOLE_KEEP";
/// Environment variable with the file in which the launcher says why the run has failed.
const FAILED_VARIABLE: &str = "CARS_CONSOLE_FAILED";

/// Environment variable with the time for which a robot tries to reach the simulator and to join, seconds.
const PATIENCE_VARIABLE: &str = "CARS_PATIENCE_S";
/// How long a run waits for the browser that is started for it, seconds, instead of [`BROWSER_PATIENCE_S`].
const BROWSER_PATIENCE_VARIABLE: &str = "CARS_BROWSER_PATIENCE_S";
/// A browser that was not running takes some seconds.
const BROWSER_PATIENCE_S: &str = "30";
/// Its default. All robots of a launch are started at the same time: of more robots than this, each adds a second.
const PATIENCE_S: usize = 20;

/// A command line with its environment.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandLine {
    /// Path of the program.
    pub program: PathBuf,
    /// Arguments of the program.
    pub args: Vec<String>,
    /// Environment in addition to the launcher's.
    pub env: BTreeMap<String, String>,
}

/// One process to run.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Name on the terminal and of its log.
    pub name: String,
    /// Command line and environment.
    pub command: CommandLine,
    /// Whether it is restarted when it exits before the end of the run.
    pub restart: Restart,
    /// Wait before the first restart; each further wait is twice as long.
    pub backoff: Duration,
    /// Whether its failure ends the run.
    pub is_required: bool,
    /// Whether the user starts it, instead of the launcher.
    pub is_extern: bool,
    /// Its part in the run.
    pub part: Part,
    /// The robots that it runs.
    pub robots: Vec<RobotName>,
}

impl Planned {
    /// Changes the command line so that the process ends with this one. The simulator ends the run in order.
    pub(super) fn tie(&mut self) {
        let at_exit = if self.part == Part::Simulator {
            AtExit::Terminate
        } else {
            AtExit::Kill
        };
        let own = child::own_program();
        let program = std::mem::replace(&mut self.command.program, own);

        let mut prefix = child::prefix(at_exit);
        prefix.push(program.display().to_string());
        self.command.args.splice(0..0, prefix);
    }
}

/// The part of a process in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The run ends with it.
    Simulator,
    /// It runs robots, and exits when the run is over.
    Robots,
    /// It observes, and receives SIGTERM when the run is over.
    Observer,
}

/// Name, endpoint and folders of a run.
#[derive(Debug, Clone)]
pub(super) struct Execution<'a> {
    pub(super) run: &'a RunName,
    /// Endpoint of the simulator.
    pub(super) endpoint: &'a str,
    /// Certificates of a secured run.
    pub(super) secured: Option<&'a Secured>,
    /// Whether the simulator may listen without certificates where other machines can connect.
    pub(super) is_insecure: bool,
    /// Where run folders are made.
    pub(super) out: &'a Path,
    pub(super) speed: Speed,
    pub(super) is_paused: bool,
    /// Whether the run in the folder is resumed.
    pub(super) is_resumed: bool,
    /// Whether the simulator stays when the run is over, also while no browser shows it.
    pub(super) stays: bool,
    /// Whether the console is started.
    pub(super) has_console: bool,
    /// Whether the console opens a browser.
    pub(super) opens_browser: bool,
}

impl Execution<'_> {
    /// The folder of the run.
    fn folder(&self) -> RunFolder {
        RunFolder::new(self.out, self.run)
    }
}

/// All processes of a launch file, the simulator first.
pub(super) fn plan(file: &LaunchFile, execution: &Execution) -> Result<Vec<Planned>, FileError> {
    let places = Places::new(&file.folder);
    let mut planned = vec![simulator(file, execution, &places)?];
    for process in &file.processes {
        let args = name_args(&process.robots);
        let command = client(file, process, args, execution, &places)?;
        planned.push(prepare(process, command));
    }

    if let Some(process) = file.console.as_ref().filter(|_| execution.has_console) {
        // What has happened before a page was opened is in the folder.
        let folder = RunFolder::new(execution.out, execution.run);
        let mut args = vec![format!("--folder={}", folder.path().display())];
        if execution.opens_browser {
            args.push("--open".to_owned());
            if !execution.is_paused {
                let patience_s = std::env::var(BROWSER_PATIENCE_VARIABLE);
                let patience_s = patience_s.unwrap_or_else(|_| BROWSER_PATIENCE_S.to_owned());
                args.push(format!("--begin-after={patience_s}"));
            }
        }
        let mut command = client(file, process, args, execution, &places)?;
        let logs = execution.folder().file(LOGS);
        let kept = logs.join(CONSOLE_KEPT).display().to_string();
        command.env.entry(KEEP_VARIABLE.to_owned()).or_insert(kept);
        let failed = logs.join(FAILED).display().to_string();
        command.env.insert(FAILED_VARIABLE.to_owned(), failed);
        planned.push(Planned {
            part: Part::Observer,
            ..prepare(process, command)
        });
    }

    Ok(planned)
}

/// The command line of a process that connects to the simulator.
fn client(
    file: &LaunchFile,
    process: &Process,
    args: Vec<String>,
    execution: &Execution,
    places: &Places,
) -> Result<CommandLine, FileError> {
    let mut env = process.env.clone();
    env.insert("CARS_RUN".to_owned(), execution.run.to_string());
    env.insert("CARS_CONNECT".to_owned(), connectable(execution.endpoint));

    let robots = file.processes.iter().map(|process| process.robots.len());
    let robots: usize = robots.sum();
    if robots > PATIENCE_S && std::env::var_os(PATIENCE_VARIABLE).is_none() {
        let patience = env.entry(PATIENCE_VARIABLE.to_owned());
        patience.or_insert_with(|| robots.to_string());
    }

    // A process has the certificate of its robot; the console has one of its own.
    let name = if process.name == CONSOLE {
        Some(CONSOLE)
    } else {
        process.robots.first().map(RobotName::as_str)
    };

    if let Some(secured) = execution.secured
        && let Some(name) = name
    {
        let config = secured.config_of(name).display().to_string();
        env.entry(ZENOH_CONFIG.to_owned()).or_insert(config);
    }
    let program = program(file, process, &process.command[0], places)?;
    let args = with_own_args(&process.command[1..], args);
    let args = locate_inner(file, process, args, places)?;

    Ok(CommandLine { program, args, env })
}

/// Adds arguments of the launcher to those of a process, before a `--`: what follows belongs to another program.
pub(super) fn with_own_args(command: &[String], own: Vec<String>) -> Vec<String> {
    let end = command.iter().position(|arg| arg == "--");
    let end = end.unwrap_or(command.len());
    let mut args = command.to_vec();
    args.splice(end..end, own);
    args
}

/// Locates a program after a `--`, as in `cars exec -- ./robot.sh`. Like the process's own program, it is relative to the
/// launch file's folder if it contains a `/`.
fn locate_inner(
    file: &LaunchFile,
    process: &Process,
    mut args: Vec<String>,
    places: &Places,
) -> Result<Vec<String>, FileError> {
    let inner = args.iter_mut().skip_while(|arg| *arg != "--").nth(1);
    if let Some(inner) = inner.filter(|inner| inner.contains('/')) {
        *inner = program(file, process, inner, places)?.display().to_string();
    }

    Ok(args)
}

/// Arguments with the names of a process's robots.
pub(super) fn name_args(robots: &[RobotName]) -> Vec<String> {
    let mut args = Vec::new();
    for robot in robots {
        args.push("--name".to_owned());
        args.push(robot.to_string());
    }
    args
}

fn simulator(
    file: &LaunchFile,
    execution: &Execution,
    places: &Places,
) -> Result<Planned, FileError> {
    let process = &file.simulator;
    let scenario = execution.folder().file(SCENARIO);
    let mut args = process.command[1..].to_vec();
    args.extend([
        scenario.display().to_string(),
        format!("--run={}", execution.run),
        format!("--listen={}", execution.endpoint),
        format!("--out={}", execution.out.display()),
        format!("--speed={}", execution.speed),
        // A failed expectation is not a failure of the process. The summary has the verdict.
        "--no-verdict".to_owned(),
    ]);

    // The run begins when a person at the page wants it to.
    let waits_for_browser =
        execution.opens_browser && execution.has_console && file.console.is_some();
    if execution.is_paused || waits_for_browser {
        args.push("--paused".to_owned());
    }
    let taking = if execution.is_resumed {
        "--resume"
    } else {
        "--prepared"
    };
    args.push(taking.to_owned());
    if execution.stays {
        args.push("--stay=always".to_owned());
    } else if execution.has_console && file.console.is_some() {
        args.push("--stay=viewed".to_owned());
    }
    args.extend(execution.is_insecure.then(|| "--insecure".to_owned()));

    let mut env = process.env.clone();
    if let Some(secured) = execution.secured {
        let config = secured.config_of(SIMULATOR).display().to_string();
        env.insert(ZENOH_CONFIG.to_owned(), config);
        let operator = secured.operator();
        args.push(format!("--operator-config={}", operator.display()));
    }
    let program = program(file, process, &process.command[0], places)?;
    let command = CommandLine { program, args, env };

    Ok(Planned {
        part: Part::Simulator,
        ..prepare(process, command)
    })
}

/// A planned process that runs robots.
fn prepare(process: &Process, mut command: CommandLine) -> Planned {
    let runtime = bus::runtime::RUNTIME_VARIABLE;
    let chosen = std::env::var(runtime).unwrap_or_else(|_| bus::runtime::ONE_THREAD.to_owned());
    command.env.entry(runtime.to_owned()).or_insert(chosen);

    if !process.is_extern {
        // The output goes to a log file, too.
        let no_color = command.env.entry("NO_COLOR".to_owned());
        no_color.or_insert_with(|| "1".to_owned());
    }

    Planned {
        name: process.name.clone(),
        command,
        restart: process.restart,
        backoff: process.backoff,
        is_required: process.is_required,
        is_extern: process.is_extern,
        part: Part::Robots,
        robots: process.robots.clone(),
    }
}

/// Locates a program of a process. A program that the user starts need not exist here.
fn program(
    file: &LaunchFile,
    process: &Process,
    name: &str,
    places: &Places,
) -> Result<PathBuf, FileError> {
    match places.find(name) {
        Ok(program) => Ok(program),
        Err(_) if process.is_extern => Ok(PathBuf::from(name)),
        Err(not_found) => Err(missing_program(file, process, name, &not_found)),
    }
}

fn missing_program(
    file: &LaunchFile,
    process: &Process,
    name: &str,
    NotFound(searched): &NotFound,
) -> FileError {
    let text = format!("there is no program {name}");
    let error = match process.span.clone() {
        None if process.name == SIMULATOR => FileError::new(text),
        None => FileError::new(format!("{text} for process {}", process.name)),
        span => FileError::at(&file.source, span, &text),
    };

    let searched = searched.join(",\nand ");
    let how = how_to_install(name);
    error.with_help(format!("looked for it {searched}\n{how}"))
}

impl std::fmt::Display for CommandLine {
    /// The command line for a shell.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (name, value) in &self.env {
            write!(f, "{name}={} ", quote(value))?;
        }
        f.write_str(&quote(&self.program.display().to_string()))?;
        for arg in &self.args {
            write!(f, " {}", quote(arg))?;
        }
        Ok(())
    }
}

/// Quotes a word for a shell if necessary.
pub(super) fn quote(word: &str) -> String {
    let mut characters = word.chars();
    let is_plain = characters.all(|c| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c));
    if is_plain && !word.is_empty() {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use config::Source;

    use super::*;

    fn words(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    fn parse(text: &str) -> LaunchFile {
        let source = Source {
            name: "launch.toml".to_owned(),
            text: text.to_owned(),
        };
        LaunchFile::parse(source, Path::new("/usr/../bin")).unwrap()
    }

    /// Arguments of the first process.
    fn located(file: &LaunchFile) -> Result<Vec<String>, FileError> {
        let process = &file.processes[0];
        let args = process.command[1..].to_vec();
        locate_inner(file, process, args, &Places::new(&file.folder))
    }

    #[test]
    fn arguments_of_the_launcher_precede_two_dashes() {
        let with_name = |text| with_own_args(&words(text), words("--name Rosie")).join(" ");
        assert_eq!(
            with_name("exec -- ./robot.sh -- -v"),
            "exec --name Rosie -- ./robot.sh -- -v"
        );
        assert_eq!(with_name("--loud"), "--loud --name Rosie");
    }

    #[test]
    fn a_program_after_two_dashes_is_found_from_the_launch_file() {
        let text = "scenario = \"x.toml\"\n[[process]]\nname = \"Rosie\"\n\
                    command = [\"sh\", \"-c\", \"./sh\", \"--\", \"./sh\", \"./sh\"]";
        assert_eq!(
            located(&parse(text)).unwrap(),
            ["-c", "./sh", "--", "/usr/../bin/sh", "./sh"]
        );

        let text = text.replace("\"--\", \"./sh\"", "\"--\", \"./none\"");
        let wrong = located(&parse(&text)).unwrap_err();
        let wrong = config::render_plain(&wrong, None, 200);
        assert!(wrong.contains("there is no program ./none"), "{wrong}");
    }

    #[test]
    fn a_command_line_can_be_pasted_into_a_shell() {
        let command = CommandLine {
            program: "/opt/my robots/butler".into(),
            args: ["--name", "Butler", "it's", ""].map(str::to_owned).to_vec(),
            env: BTreeMap::from([("ZENOH_RUNTIME".to_owned(), "(rx:1)".to_owned())]),
        };
        let line = r"ZENOH_RUNTIME='(rx:1)' '/opt/my robots/butler' --name Butler 'it'\''s' ''";
        assert_eq!(command.to_string(), line);
    }
}
