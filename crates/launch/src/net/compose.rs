//! Links of containers: the compose file of the launch, and `docker network disconnect`.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use miette::{IntoDiagnostic, WrapErr, miette};
use tempfile::NamedTempFile;

use super::links::{Links, Start};
use super::shape::{Flow, Shape};

/// The network of the compose file that the processes are in.
const NETWORK: &str = "cars";

/// Containers of a launch, as one project of compose.
#[derive(Debug)]
pub(super) struct Compose {
    /// `docker-compose`, or `docker compose`.
    tool: &'static [&'static str],
    project: String,
    /// Removed when it is dropped.
    file: NamedTempFile,
    /// Containers that are disconnected, with the addresses to give them back.
    away: BTreeMap<String, Away>,
}

#[derive(Debug)]
struct Away {
    container: String,
    address: String,
}

impl Compose {
    pub(super) fn new(start: &Start) -> miette::Result<Self> {
        let is_as_it_is = start.options.changes().is_empty();
        if !is_as_it_is || start.options.out != Path::new("runs") || !start.more.is_empty() {
            let help = "containers read the scenario file as it is: change it there; runs are kept in ./runs";
            return Err(miette!(
                help = help,
                "with --via compose only --run and --speed can be chosen"
            ));
        }

        let project = format!("carsnet{}", std::process::id());
        let own = std::env::current_exe().into_diagnostic()?;
        let text = output(
            Command::new(own)
                .args(start.args(&[]))
                .args(["--export", "compose"]),
        )?;

        // Made anew under a name that cannot be foreseen: a link that waits there is not followed.
        let mut file = tempfile::Builder::new()
            .prefix(&project)
            .suffix(".yml")
            .tempfile()
            .into_diagnostic()
            .wrap_err("making a compose file")?;

        file.write_all(text.as_bytes())
            .into_diagnostic()
            .wrap_err_with(|| file.path().display().to_string())?;

        Ok(Self {
            tool: tool()?,
            project,
            file,
            away: BTreeMap::new(),
        })
    }

    /// Compose, for this project; paths in the file are relative to the current folder.
    fn compose(&self, args: &[&str]) -> Command {
        let mut command = Command::new(self.tool[0]);
        command.args(&self.tool[1..]).args([
            "--project-name",
            &self.project,
            "--project-directory",
            ".",
        ]);
        command.arg("--file").arg(self.file.path()).args(args);
        command
    }

    fn network(&self) -> String {
        format!("{}_{NETWORK}", self.project)
    }
}

impl Drop for Compose {
    fn drop(&mut self) {
        if let Err(error) = output(&mut self.compose(&["down", "--volumes", "--timeout", "1"])) {
            eprintln!("containers may be left over: {error}");
        }
    }
}

impl Links for Compose {
    fn command(&self, _: &Start) -> miette::Result<Command> {
        Ok(self.compose(&["up", "--no-color", "--exit-code-from", "simulator"]))
    }

    fn set(&mut self, process: &str, shape: Shape) -> miette::Result<()> {
        let network = self.network();
        let mut docker = Command::new("docker");
        docker.arg("network");

        if shape.flow == Flow::Open {
            let Some(Away { container, address }) = self.away.remove(process) else {
                return Ok(());
            };
            output(docker.args(["connect", "--ip", &address, &network, &container]))?;
        } else {
            let container = output(&mut self.compose(&["ps", "-q", &process.to_lowercase()]))?;
            let format = format!("{{{{(index .NetworkSettings.Networks {network:?}).IPAddress}}}}");
            let address =
                output(Command::new("docker").args(["inspect", "-f", &format, &container]))?;
            output(docker.args(["disconnect", &network, &container]))?;
            self.away
                .insert(process.to_owned(), Away { container, address });
        }

        Ok(())
    }
}

/// Compose, under whichever name it is there.
fn tool() -> miette::Result<&'static [&'static str]> {
    let tools: [&[&str]; 2] = [&["docker-compose"], &["docker", "compose"]];
    let is_there = |tool: &&&[&str]| {
        let mut command = Command::new(tool[0]);
        command
            .args(&tool[1..])
            .arg("version")
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    let help = "install docker and docker-compose (Debian: apt install docker.io docker-compose)";

    tools
        .iter()
        .find(is_there)
        .copied()
        .ok_or_else(|| miette!(help = help, "there is no docker-compose here"))
}

/// What a command prints; it must succeed.
fn output(command: &mut Command) -> miette::Result<String> {
    let said = format!("{command:?}");
    let output = command
        .stdin(Stdio::null())
        .output()
        .into_diagnostic()
        .wrap_err_with(|| said.clone())?;

    if !output.status.success() {
        return Err(miette!(
            "{said}: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        ));
    }

    Ok(String::from_utf8_lossy(&output.stdout)
        .trim_end()
        .to_owned())
}
