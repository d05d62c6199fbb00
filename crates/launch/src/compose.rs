//! Exports a launch as a compose file: one service for each process.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use bus::runtime::{ONE_THREAD, RUNTIME_VARIABLE};
use config::FileError;
use protocol::RunName;
use record::IfTaken;

use super::file::{CONSOLE, LaunchFile, Process, SIMULATOR};
use super::plan::{name_args, with_own_args};
use super::restart::Restart;
use config::Speed;

/// Image of all services.
const IMAGE: &str = "cars:local";
/// Prefix of the addresses in the private network. They are fixed, because looking up names would delay the detection of a
/// failure, and the reconnection, by ten seconds.
const NETWORK: &str = "172.30.77";
/// Host number of the simulator; those of the other services follow.
const FIRST_HOST: usize = 10;
/// Most services with an address in the network.
const MAX_SERVICES: usize = 240;
const PORT: u16 = 7447;
/// Port of the console.
const CONSOLE_PORT: u16 = 7007;

/// Comment at the beginning of the file.
const HEAD: &str = "\
# Made by `cars launch --export compose`: one service for each process of a launch file.
#
# The image has the binaries that are built here, see docker/Dockerfile. Then
#     docker-compose up --exit-code-from simulator
# plays the run and leaves its folder in ./runs, where it replaces an earlier run of this file that is over. The network of the
# services is private; only the console can be reached, by a browser on this machine at the address in the console's log.
";

/// The compose file of a launch file. Its paths are relative to the current folder, where it has to be written.
pub(super) fn export(
    file: &LaunchFile,
    run: &RunName,
    if_taken: IfTaken,
    speed: Speed,
) -> Result<String, FileError> {
    if file.processes.len() > MAX_SERVICES {
        return Err(FileError::new(format!(
            "more than {MAX_SERVICES} processes do not fit into one network"
        )));
    }

    let mut text = format!("{HEAD}\nservices:\n");
    simulator_service(&mut text, file, run, if_taken, speed)?;

    for (index, process) in file.processes.iter().enumerate() {
        robot_service(&mut text, process, run, FIRST_HOST + 1 + index);
    }

    if let Some(console) = &file.console {
        let host = FIRST_HOST + 1 + file.processes.len();
        console_service(&mut text, console, run, host);
    }

    text += &format!(
        "networks:\n  cars:\n    internal: true\n    ipam:\n      config:\n        - subnet: {NETWORK}.0/24\n"
    );
    if file.console.is_some() {
        // An internal network publishes no ports; the browser connects through another one.
        text += "  browser: {}\n";
    }

    Ok(text)
}

fn simulator_service(
    text: &mut String,
    file: &LaunchFile,
    run: &RunName,
    if_taken: IfTaken,
    speed: Speed,
) -> Result<(), FileError> {
    let path = &file.scenario;
    let scenario = path.file_name().and_then(|name| name.to_str());
    let scenario = scenario
        .ok_or_else(|| FileError::new(format!("{} is not the path of a file", path.display())))?;

    let mut command = file.simulator.command.clone();
    command.extend([
        format!("/configs/{scenario}"),
        format!("--run={run}"),
        // All services know the run by its name.
        match if_taken {
            IfTaken::Reserved => "--prepared".to_owned(),
            IfTaken::Number | IfTaken::Replace | IfTaken::Refuse => "--replace".to_owned(),
        },
        format!("--listen=tcp/0.0.0.0:{PORT}"),
        // Only the services of this file are in the private network.
        "--insecure".to_owned(),
        "--out=/runs".to_owned(),
        format!("--speed={speed}"),
    ]);

    let mut env = file.simulator.env.clone();
    env.entry(RUNTIME_VARIABLE.to_owned())
        .or_insert_with(|| ONE_THREAD.to_owned());
    let mut service = Service::begin(text, SIMULATOR, &command);
    service.map("environment", env.iter());
    let configs = here(path.parent().unwrap_or(Path::new("")));
    let volumes = [format!("{configs}:/configs:ro"), "./runs:/runs".to_owned()];
    service.list("volumes", &volumes);
    service.end(FIRST_HOST);
    Ok(())
}

/// The console, for a browser on the same machine. In its container it listens at all interfaces; the log of the service
/// shows its address with the token.
fn console_service(text: &mut String, process: &Process, run: &RunName, host: usize) {
    let mut command = process.command.clone();
    command.retain(|word| !word.starts_with("--bind"));
    command.push(format!("--bind=0.0.0.0:{CONSOLE_PORT}"));
    let mut service = Service::begin(text, CONSOLE, &command);
    service.map("environment", guest_env(process, run).iter());
    service.list("depends_on", &[SIMULATOR.to_owned()]);
    let port = format!("127.0.0.1:{CONSOLE_PORT}:{CONSOLE_PORT}");
    service.list("ports", &[port]);
    service.end_in(host, "      browser: {}\n");
}

/// Environment of a service that connects to the simulator.
fn guest_env(process: &Process, run: &RunName) -> BTreeMap<String, String> {
    let mut env = process.env.clone();
    let endpoint = format!("tcp/{NETWORK}.{FIRST_HOST}:{PORT}");
    env.insert("CARS_RUN".to_owned(), run.to_string());
    env.insert("CARS_CONNECT".to_owned(), endpoint);
    env.entry(RUNTIME_VARIABLE.to_owned())
        .or_insert_with(|| ONE_THREAD.to_owned());
    env
}

fn robot_service(text: &mut String, process: &Process, run: &RunName, host: usize) {
    let command = with_own_args(&process.command, name_args(&process.robots));
    let mut service = Service::begin(text, &process.name.to_lowercase(), &command);
    service.map("environment", guest_env(process, run).iter());
    service.list("depends_on", &[SIMULATOR.to_owned()]);

    match process.restart {
        Restart::Never => {}
        Restart::OnFailure => service.line("restart: on-failure:5"),
        Restart::Always => service.line("restart: unless-stopped"),
    }

    if process.is_extern {
        // Started only by `docker-compose --profile extern up`.
        service.list("profiles", &["extern".to_owned()]);
    }

    service.end(host);
}

/// A folder for compose, which would take a relative path without `./` for the name of a volume.
fn here(folder: &Path) -> String {
    let begins_above = folder.components().next() == Some(Component::ParentDir);
    let path = if folder.is_absolute() || begins_above {
        folder.to_owned()
    } else {
        PathBuf::from(".").join(folder)
    };
    path.display().to_string().trim_end_matches('/').to_owned()
}

/// One service of the file.
struct Service<'a> {
    text: &'a mut String,
}

impl<'a> Service<'a> {
    fn begin(text: &'a mut String, name: &str, command: &[String]) -> Self {
        let words: Vec<String> = command.iter().map(|word| quote(word)).collect();
        let words = words.join(", ");
        *text += &format!("  {name}:\n    image: {IMAGE}\n");
        *text += &format!("    command: [{words}]\n    init: true\n");
        Self { text }
    }

    fn line(&mut self, line: &str) {
        *self.text += &format!("    {line}\n");
    }

    fn list(&mut self, key: &str, values: &[String]) {
        self.line(&format!("{key}:"));
        for value in values {
            *self.text += &format!("      - {}\n", quote(value));
        }
    }

    fn map<'b>(&mut self, key: &str, values: impl Iterator<Item = (&'b String, &'b String)>) {
        self.line(&format!("{key}:"));
        for (name, value) in values {
            *self.text += &format!("      {name}: {}\n", quote(value));
        }
    }

    fn end(self, host: usize) {
        self.end_in(host, "");
    }

    /// Ends a service that is also in other networks.
    fn end_in(self, host: usize, others: &str) {
        let own = format!("      cars:\n        ipv4_address: {NETWORK}.{host}\n");
        *self.text += &format!("    networks:\n{own}{others}\n");
    }
}

/// Words that YAML does not read as texts.
const LITERALS: [&str; 9] = ["yes", "no", "true", "false", "on", "off", "null", "y", "n"];

/// Quotes a text for YAML if necessary. `$` is doubled, because it begins a variable in compose files.
fn quote(word: &str) -> String {
    let mut characters = word.chars();
    let is_plain = characters.all(|c| c.is_ascii_alphanumeric() || "-_./=".contains(c));
    let is_word = word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '/' || c == '.');
    let is_literal = LITERALS.contains(&word.to_lowercase().as_str());
    if is_plain && is_word && !is_literal {
        return word.to_owned();
    }

    let escaped = serde_json::Value::from(word.replace('$', "$$"));
    escaped.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_the_default_launch_is_the_one_that_is_kept() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let path = root.join("launch/hors_doeuvres.toml");
        let source = config::Source::read(&path).unwrap();
        let file = LaunchFile::parse(source, Path::new("launch")).unwrap();
        let run = RunName::new("hors_doeuvres").unwrap();
        let text = export(&file, &run, IfTaken::Number, file.speed.unwrap()).unwrap();
        let kept = include_str!("compose.yml");
        let how = "cars launch launch/hors_doeuvres.toml --export compose > crates/launch/src/compose.yml";

        assert_eq!(text, kept, "make it anew, at the top of the project: {how}");
    }

    #[test]
    fn words_are_safe_in_yaml() {
        assert_eq!(quote("cars-sim"), "cars-sim");
        for (word, quoted) in [
            ("--run=x", r#""--run=x""#),
            ("on", r#""on""#),
            ("a: b", r#""a: b""#),
            ("$HOME", r#""$$HOME""#),
            ("", r#""""#),
            ("1.5", r#""1.5""#),
        ] {
            assert_eq!(quote(word), quoted);
        }
    }

    #[test]
    fn folders_are_no_volumes() {
        assert_eq!(here(Path::new("configs")), "./configs");
        assert_eq!(here(Path::new("")), ".");
        assert_eq!(here(Path::new("../lab/configs")), "../lab/configs");
    }
}
