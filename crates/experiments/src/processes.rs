//! Files of a run whose robots are processes: the launch file that it is played by, and its record.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use config::FileError;
use observe::{Observation, SiteStates};
use protocol::Event;
use record::RunFolder;
use record::names::RECORDING;
use recording::{Recording, Ticks};
use scenario::Scenario;
use toml::{Table, Value};

use super::follow::Follow;
use super::plan::LaunchText;
use export::draft::unwritable;
use lab::LabError;
use lab::states::LastStates;

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
pub(super) fn read(
    scenario: &Scenario,
    run: &RunFolder,
    follower: &mut impl Follow,
) -> Result<(), LabError> {
    let recording = Recording::open(&run.file(RECORDING))?;
    let mut ticks = Ticks::of(recording);
    let mut states = LastStates::new(scenario);
    let mut sites = SiteStates::new(&scenario.setting());
    while let Some(tick) = ticks.next_tick()? {
        let number = tick.tick();
        let mut events = Arc::unwrap_or_clone(tick.events);
        // The end of the run is observed by itself, as it is where robots run in this process.
        let end = events.pop_if(|event| matches!(event, Event::End { .. }));
        states.note(number, tick.reports, tick.frame.robots);
        sites.note(&events);

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
                site: &|site| sites.of(site),
                layer: &|layer| states.layer(layer),
            });
        }
        if has_ended {
            return Ok(());
        }
    }
    Err(LabError::record("the record of the run has no end"))
}
