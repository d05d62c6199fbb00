//! What is started: the launch file with every program found and every argument in place.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bus::endpoint::connectable;
use config::FileError;
use protocol::{RobotName, RunName};
use simulator::RunFolder;
use simulator::recorder::SCENARIO;

use super::file::{CONSOLE, LaunchFile, Process, SIMULATOR};
use super::program::{NotFound, Places};
use super::restart::Restart;
use crate::secure::Secured;
use config::Speed;

/// Variable that tells every program of the project a configuration file of the middleware.
pub(super) const ZENOH_CONFIG: &str = "CARS_ZENOH_CONFIG";

/// A command line with its environment.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandLine {
    /// The program's path.
    pub program: PathBuf,
    /// Its arguments.
    pub args: Vec<String>,
    /// In addition to the launcher's own.
    pub env: BTreeMap<String, String>,
}

/// One process to run.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Name on the terminal and of its log.
    pub name: String,
    /// What is started.
    pub command: CommandLine,
    /// What happens when it ends before the run does.
    pub restart: Restart,
    /// Wait before the first restart; it doubles from there.
    pub backoff: Duration,
    /// Whether its failure ends the run.
    pub is_required: bool,
    /// Whether somebody else starts it.
    pub is_extern: bool,
    /// What it is for.
    pub part: Part,
    /// The robots that it runs.
    pub robots: Vec<RobotName>,
}

/// What a process is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The run is over when it is.
    Simulator,
    /// It runs robots, and leaves when it hears that the run is over.
    Robots,
    /// It watches, and is told to end when the run is over.
    Observer,
}

/// What a run is called and where it happens.
#[derive(Debug, Clone)]
pub(super) struct Execution<'a> {
    pub(super) run: &'a RunName,
    /// Where the simulator listens.
    pub(super) endpoint: &'a str,
    /// Certificates, for a secured run.
    pub(super) secured: Option<&'a Secured>,
    /// Whether everybody who can reach the simulator is trusted.
    pub(super) is_insecure: bool,
    /// Where run folders are made.
    pub(super) out: &'a Path,
    pub(super) speed: Speed,
    pub(super) is_paused: bool,
    /// Whether the console is wanted.
    pub(super) has_console: bool,
    /// Whether it is to open a browser.
    pub(super) opens_browser: bool,
}

/// All processes of a launch file, the simulator first.
pub(super) fn plan(file: &LaunchFile, execution: &Execution) -> Result<Vec<Planned>, FileError> {
    let places = Places::new(&file.folder);
    let mut planned = vec![simulator(file, execution, &places)?];
    for process in &file.processes {
        let command = guest(
            file,
            process,
            name_args(&process.robots),
            execution,
            &places,
        )?;
        planned.push(prepare(process, command));
    }

    if let Some(process) = file.console.as_ref().filter(|_| execution.has_console) {
        let args = execution
            .opens_browser
            .then(|| "--open".to_owned())
            .into_iter()
            .collect();
        let command = guest(file, process, args, execution, &places)?;
        planned.push(Planned {
            part: Part::Observer,
            ..prepare(process, command)
        });
    }

    Ok(planned)
}

/// The command line of a process that connects to the simulator.
fn guest(
    file: &LaunchFile,
    process: &Process,
    args: Vec<String>,
    execution: &Execution,
    places: &Places,
) -> Result<CommandLine, FileError> {
    let mut env = process.env.clone();
    env.insert("CARS_RUN".to_owned(), execution.run.to_string());
    env.insert("CARS_CONNECT".to_owned(), connectable(execution.endpoint));

    // A process is let in as its robot; only the console is none.
    let name = if process.name == CONSOLE {
        Some(CONSOLE)
    } else {
        process.robots.first().map(RobotName::as_str)
    };

    if let (Some(secured), Some(name)) = (execution.secured, name) {
        env.entry(ZENOH_CONFIG.to_owned())
            .or_insert_with(|| secured.config_of(name).display().to_string());
    }

    let program = program(file, process, &process.command[0], places)?;
    let args = with_own_args(&process.command[1..], args);
    let args = locate_inner(file, process, args, places)?;

    Ok(CommandLine { program, args, env })
}

/// The arguments of a process with those that the launcher adds: what stands after a `--` is not the process's own.
pub(super) fn with_own_args(command: &[String], own: Vec<String>) -> Vec<String> {
    let end = command
        .iter()
        .position(|arg| arg == "--")
        .unwrap_or(command.len());
    command[..end]
        .iter()
        .cloned()
        .chain(own)
        .chain(command[end..].iter().cloned())
        .collect()
}

/// A program after a `--`, as in `cars exec -- ./robot.sh`, is a path from the launch file's folder if it has a `/`, as
/// the process's own program is.
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

/// How a program is told which robots it runs.
pub(super) fn name_args(robots: &[RobotName]) -> Vec<String> {
    robots
        .iter()
        .flat_map(|robot| ["--name".to_owned(), robot.to_string()])
        .collect()
}

fn simulator(
    file: &LaunchFile,
    execution: &Execution,
    places: &Places,
) -> Result<Planned, FileError> {
    let process = &file.simulator;
    let scenario = RunFolder::new(execution.out, execution.run).file(SCENARIO);
    let mut args: Vec<String> = process.command.iter().skip(1).cloned().collect();
    args.extend([
        scenario.display().to_string(),
        format!("--run={}", execution.run),
        format!("--listen={}", execution.endpoint),
        format!("--out={}", execution.out.display()),
        format!("--speed={}", execution.speed),
    ]);

    args.extend(execution.is_paused.then(|| "--paused".to_owned()));
    args.extend(execution.is_insecure.then(|| "--insecure".to_owned()));
    let mut env = process.env.clone();
    if let Some(secured) = execution.secured {
        env.insert(
            ZENOH_CONFIG.to_owned(),
            secured.config_of(SIMULATOR).display().to_string(),
        );
        args.push(format!(
            "--operator-config={}",
            secured.operator().display()
        ));
    }

    let program = program(file, process, &process.command[0], places)?;
    let command = CommandLine { program, args, env };

    Ok(Planned {
        part: Part::Simulator,
        ..prepare(process, command)
    })
}

fn prepare(process: &Process, mut command: CommandLine) -> Planned {
    let runtime = bus::runtime::RUNTIME_VARIABLE;
    let chosen = std::env::var(runtime).unwrap_or_else(|_| bus::runtime::ONE_THREAD.to_owned());
    command.env.entry(runtime.to_owned()).or_insert(chosen);

    if !process.is_extern {
        // Its output goes into a file, too, and files have no colors.
        command
            .env
            .entry("NO_COLOR".to_owned())
            .or_insert_with(|| "1".to_owned());
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

/// The program of a process. What somebody else starts need not be here.
fn program(
    file: &LaunchFile,
    process: &Process,
    name: &str,
    places: &Places,
) -> Result<PathBuf, FileError> {
    match places.find(name) {
        Ok(program) => Ok(program),
        Err(_) if process.is_extern => Ok(PathBuf::from(name)),
        Err(NotFound(searched)) => {
            let help = format!(
                "looked for {}\nthe programs of this project are built by `cargo build --release`",
                searched.join(",\nand ")
            );
            let text = format!("there is no program {name}");
            Err(match process.span.clone() {
                None if process.name == SIMULATOR => FileError::new(text),
                None => FileError::new(format!("{text}, which process {} is to run", process.name)),
                span => FileError::at(&file.source, span, &text),
            }
            .with_help(help))
        }
    }
}

impl std::fmt::Display for CommandLine {
    /// As a line for a shell.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (name, value) in &self.env {
            write!(f, "{name}={} ", quote(value))?;
        }
        f.write_str(&quote(&self.program.display().to_string()))?;
        self.args
            .iter()
            .try_for_each(|arg| write!(f, " {}", quote(arg)))
    }
}

/// A word for a shell.
fn quote(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use config::Source;

    use super::*;

    #[test]
    fn what_stands_after_two_dashes_is_not_told_the_robots_name() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
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
        let file = |text: &str| {
            let source = Source {
                name: "launch.toml".to_owned(),
                text: text.to_owned(),
            };
            LaunchFile::parse(source, Path::new("/usr/../bin")).unwrap()
        };
        let located = |file: &LaunchFile| {
            let (process, places) = (&file.processes[0], Places::new(&file.folder));
            locate_inner(file, process, process.command[1..].to_vec(), &places)
        };
        assert_eq!(
            located(&file(text)).unwrap(),
            ["-c", "./sh", "--", "/usr/../bin/sh", "./sh"]
        );

        let wrong = located(&file(
            &text.replace("\"--\", \"./sh\"", "\"--\", \"./nobody\""),
        ))
        .unwrap_err();
        let wrong = format!("{:?}", miette::Report::from(wrong));
        assert!(wrong.contains("there is no program ./nobody"), "{wrong}");
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
