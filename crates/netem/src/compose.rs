//! Links of containers: the exported compose file, cut by `docker network disconnect`.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use launch::LaunchError;
use launch::child::{self, AtExit};
use tempfile::NamedTempFile;

use super::links::{Links, Start, own_path};
use super::shape::{Flow, LinkShape};

/// The network of the compose file that connects the processes.
const NETWORK: &str = "cars";

/// The containers of a launch, which are one project of compose.
#[derive(Debug)]
pub(super) struct Compose {
    /// `docker-compose`, or `docker compose`.
    tool: &'static [&'static str],
    project: String,
    /// The compose file, removed on drop.
    file: NamedTempFile,
    /// Disconnected containers with their addresses, by process.
    away: BTreeMap<String, Away>,
}

#[derive(Debug)]
struct Away {
    container: String,
    address: String,
}

impl Compose {
    pub(super) fn new(start: &Start) -> Result<Self, LaunchError> {
        let is_unchanged = start.options.changes().is_empty();
        if !is_unchanged || start.options.out != Path::new("runs") || !start.more.is_empty() {
            let help = "containers read the scenario file itself: change it there; runs are kept in ./runs";
            return Err(LaunchError::refused_with_help(
                "with --via compose only --run and --speed can be chosen",
                help,
            ));
        }

        let project = format!("carsnet{}", std::process::id());
        let mut export = Command::new(own_path()?);
        export.args(start.args(&[])).args(["--export", "compose"]);
        let text = output(&mut export)?;

        let temporary = std::env::temp_dir();
        // A new file with a random name: an existing symbolic link is not followed.
        let mut file = tempfile::Builder::new()
            .prefix(&project)
            .suffix(".yml")
            .tempfile()
            .map_err(LaunchError::path("make a compose file in", &temporary))?;

        file.write_all(text.as_bytes())
            .map_err(LaunchError::path("write", file.path()))?;

        Ok(Self {
            tool: tool()?,
            project,
            file,
            away: BTreeMap::new(),
        })
    }

    /// A command of compose for this project. Paths in the compose file are relative to the current folder.
    fn compose(&self, args: &[&str]) -> Command {
        let mut command = Command::new(self.tool[0]);
        command
            .args(&self.tool[1..])
            .args(["--project-name", &self.project])
            .args(["--project-directory", "."])
            .arg("--file")
            .arg(self.file.path())
            .args(args);
        command
    }

    fn disconnect(&mut self, process: &str) -> Result<(), LaunchError> {
        let network = self.network();
        let container = output(&mut self.compose(&["ps", "-q", &process.to_lowercase()]))?;
        let format = format!("{{{{(index .NetworkSettings.Networks {network:?}).IPAddress}}}}");
        let address = output(Command::new("docker").args(["inspect", "-f", &format, &container]))?;
        // The address is noted before: without it the container would get another one, and its peers
        // would not find it.
        docker_network(&["disconnect", &network, &container])?;

        self.away
            .insert(process.to_owned(), Away { container, address });
        Ok(())
    }

    /// Connects a container with the address that it had before.
    fn connect(&mut self, process: &str) -> Result<(), LaunchError> {
        let Some(Away { container, address }) = self.away.remove(process) else {
            return Ok(());
        };
        let network = self.network();
        docker_network(&["connect", "--ip", &address, &network, &container])
    }

    fn network(&self) -> String {
        format!("{}_{NETWORK}", self.project)
    }
}

impl Drop for Compose {
    fn drop(&mut self) {
        // Before the file is removed, which compose needs for this.
        if let Err(error) = output(&mut self.compose(&["down", "--volumes", "--timeout", "1"])) {
            terminal::note(format_args!("containers may be left over: {error}"));
        }
    }
}

impl Links for Compose {
    fn command(&self, _: &Start) -> Result<Command, LaunchError> {
        let up = self.compose(&["up", "--no-color", "--exit-code-from", "simulator"]);

        // It ends with this process, and the containers with it.
        let mut command = child::command(AtExit::Terminate, up.get_program());
        command.args(up.get_args());
        Ok(command)
    }

    fn set(&mut self, process: &str, shape: LinkShape) -> Result<(), LaunchError> {
        if shape.flow == Flow::Open {
            self.connect(process)
        } else {
            self.disconnect(process)
        }
    }
}

/// The command of compose on this machine.
fn tool() -> Result<&'static [&'static str], LaunchError> {
    let tools: [&[&str]; 2] = [&["docker-compose"], &["docker", "compose"]];
    let found = tools.into_iter().find(|tool| is_installed(tool));
    found.ok_or_else(|| {
        let help =
            "install docker and docker-compose (Debian: apt install docker.io docker-compose)";
        failed("docker-compose is not installed".to_owned(), Some(help))
    })
}

fn is_installed(tool: &[&str]) -> bool {
    let mut command = Command::new(tool[0]);
    command
        .args(&tool[1..])
        .arg("version")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

fn docker_network(args: &[&str]) -> Result<(), LaunchError> {
    let mut command = Command::new("docker");
    command.arg("network").args(args);
    output(&mut command).map(drop)
}

fn failed(reason: String, help: Option<&'static str>) -> LaunchError {
    LaunchError::Tool { reason, help }
}

/// Runs a command, which must succeed, and returns its output.
fn output(command: &mut Command) -> Result<String, LaunchError> {
    let line = format!("{command:?}");
    let output = command
        .stdin(Stdio::null())
        .output()
        .map_err(|error| failed(format!("{line}: {error}"), None))?;

    if !output.status.success() {
        let error = String::from_utf8_lossy(&output.stderr);
        return Err(failed(format!("{line}: {}", error.trim()), None));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(text.trim_end().to_owned())
}
