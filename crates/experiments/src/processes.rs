//! Plays a run with its robots as processes, and reads what is observed of it from its record.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use config::FileError;
use observe::Observation;
use protocol::Event;
use protocol::messages::End;
use record::RunFolder;
use record::names::RECORDING;
use recording::{Recording, Ticks};
use scenario::Scenario;
use toml::{Table, Value};

use super::follow::{EndedRun, Follow};
use super::plan::LaunchText;
use export::draft::unwritable;
use lab::LabError;
use lab::folder::read_summary;
use lab::scratch::Scratch;
use lab::states::LastStates;

/// Name of the run of a unit, and of its folder.
const RUN: &str = "unit";
/// Longest part of the output of a launch that is kept as the reason of its failure, bytes.
const MAX_REASON: usize = 2000;

/// Makes the command `cars`, whose process ends with this one.
pub type Launcher<'a> = &'a (dyn Fn() -> Command + Sync);

/// Launches a scenario and shows its record to a follower. Without a launch file the robots are the programs of the project.
///
/// # Errors
/// If the launch fails, or its record cannot be read to its end.
pub(super) fn follow(
    mut scenario: Scenario,
    launch: Option<&LaunchText>,
    launcher: Launcher<'_>,
    follower: &mut impl Follow,
) -> Result<EndedRun, LabError> {
    let folder = Scratch::new().map_err(LabError::failed)?;
    scenario.record.frames = true;
    scenario.record.panels = false;
    scenario.record.log = false;
    let file = write_launch(&scenario, launch, folder.path())?;

    let mut command = launcher();
    command
        .arg("launch")
        .arg(file)
        .arg("--out")
        .arg(folder.path())
        .args(["--run", RUN, "--speed", "max", "--no-console", "--quiet"])
        .stdin(Stdio::null());
    let output = command.output().map_err(LabError::failed)?;
    let run = RunFolder::at(folder.path().join(RUN));
    // A launch that failed says why, and its record, which may be damaged, does not. Verdicts are exit statuses, too, and say
    // nothing against it.
    let summary = read_summary(&run).ok().flatten();
    let summary = summary.filter(|summary| {
        let is_judged = summary.verdict().exit_status() != 0;
        summary.end == Some(End::Finished) && (output.status.success() || is_judged)
    });
    let Some(summary) = summary else {
        return Err(failed(&output, folder.path()));
    };

    read(&scenario, &run, follower)?;
    EndedRun::of(&summary)
}

/// The failure of a launch, with what it printed.
fn failed(output: &Output, folder: &Path) -> LabError {
    let printed = String::from_utf8_lossy(&output.stderr);
    // The name of the folder is drawn at random.
    let printed = printed.replace(&folder.display().to_string(), "");
    let mut end = printed.len().min(MAX_REASON);
    while !printed.is_char_boundary(end) {
        end -= 1;
    }
    LabError::failed(format!("the launch failed: {}", printed[..end].trim()))
}

/// Writes the scenario and a launch file for it; returns the launch file.
///
/// # Errors
/// If the launch file of the experiment cannot be used, or a file cannot be written.
pub fn write_launch(
    scenario: &Scenario,
    launch: Option<&LaunchText>,
    folder: &Path,
) -> Result<PathBuf, LabError> {
    let path = folder.join("scenario.toml");
    write(&path, &scenario.to_toml()?)?;

    let mut table = match launch {
        Some(launch) => relocated(launch)?,
        None => programs_of(scenario),
    };
    table.insert("scenario".to_owned(), text(&path));
    let path = folder.join("launch.toml");
    write(&path, &toml::to_string(&table).map_err(LabError::failed)?)?;
    Ok(path)
}

/// A launch file with one process for each robot: the program of its class.
fn programs_of(scenario: &Scenario) -> Table {
    let mut processes = Vec::new();
    for (name, spec) in &scenario.robots {
        let program = Value::String(format!("cars-{}", spec.class.to_lowercase()));
        let mut process = Table::new();
        process.insert("name".to_owned(), Value::String(name.to_string()));
        process.insert("command".to_owned(), Value::Array(vec![program]));
        processes.push(Value::Table(process));
    }
    Table::from_iter([("process".to_owned(), Value::Array(processes))])
}

/// A launch file whose relative paths hold in another folder.
fn relocated(launch: &LaunchText) -> Result<Table, LabError> {
    let mut table: Table = toml::from_str(&launch.text).map_err(LabError::failed)?;

    if let Some(Value::String(secure)) = table.get_mut("secure") {
        *secure = launch.folder.join(&*secure).display().to_string();
    }

    if let Some(command) = table
        .get_mut("simulator")
        .and_then(|part| part.get_mut("command"))
    {
        relocate(command, &launch.folder);
    }

    let processes = table.get_mut("process").and_then(Value::as_array_mut);
    for process in processes.into_iter().flatten() {
        if let Some(command) = process.get_mut("command") {
            relocate(command, &launch.folder);
        }
    }

    Ok(table)
}

/// Makes the paths of a command absolute: its program, and a program after `--`.
fn relocate(command: &mut Value, folder: &Path) {
    let Some(parts) = command.as_array_mut() else {
        return;
    };

    let inner = parts.iter().position(|part| part.as_str() == Some("--"));
    for place in [Some(0), inner.map(|place| place + 1)]
        .into_iter()
        .flatten()
    {
        if let Some(Value::String(program)) = parts.get_mut(place)
            && program.contains('/')
        {
            *program = folder.join(&*program).display().to_string();
        }
    }
}

fn text(path: &Path) -> Value {
    Value::String(path.display().to_string())
}

fn write(path: &Path, text: &str) -> Result<(), FileError> {
    std::fs::write(path, text).map_err(|error| unwritable(path, &error))
}

/// Shows a recorded run to a follower.
fn read(scenario: &Scenario, run: &RunFolder, follower: &mut impl Follow) -> Result<(), LabError> {
    let recording = Recording::open(&run.file(RECORDING))?;
    let mut ticks = Ticks::of(recording);
    let mut states = LastStates::default();
    while let Some(tick) = ticks.next_tick()? {
        let number = tick.tick();
        let mut events = tick.events;
        // The end of the run is observed by itself, as it is where robots run in this process.
        let end = events.pop_if(|event| matches!(event, Event::End { .. }));
        states.note(tick.reports, tick.frame.robots);

        let has_ended = end.is_some();
        for events in [Some(events), end.map(|end| vec![end])]
            .into_iter()
            .flatten()
        {
            follower.observe(&Observation {
                tick: number,
                tick_s: scenario.tick_s,
                events: &events,
                state: &|robot| states.of(robot),
            });
        }
        if has_ended {
            return Ok(());
        }
    }
    Err(LabError::record("the record of the run has no end"))
}
