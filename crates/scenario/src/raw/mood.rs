//! `mood.from` of a robot's parameters: the run with whose last mood the robot begins. A mood outlasts a run.

use std::path::{Path, PathBuf};

use config::{Source, bulk};
use protocol::RobotName;
use protocol::messages::Parameters;
use toml::{Table, Value};

use crate::files::{RUNS, SUMMARY};

/// Where a robot names a run.
pub(super) const FROM: [&str; 3] = ["params", "mood", "from"];
/// The state variable and the parameter with a robot's mood, and the key that takes the mood of the run.
const MOOD: &str = "mood";
const START: &str = "start";

/// The mood with which a robot with these parameters begins, if they have one.
pub(super) fn start(parameters: &Parameters) -> Option<&serde_json::Value> {
    parameters.get(MOOD)?.get(START)
}

/// Puts the mood that the robot had at the end of the run that its parameters name in the place of the name. So a record has a
/// number, and depends on no other one. The run is in the folder `runs`, or is named by its path; a scenario from outside, for which
/// there is no such folder, names none.
///
/// # Errors
/// There is no such run, it is not over, or the robot has no mood in it.
pub(super) fn carry_over(
    parameters: &mut Table,
    robot: &RobotName,
    runs: Option<&Path>,
) -> Result<(), String> {
    let Some(mood) = parameters.get_mut(MOOD).and_then(Value::as_table_mut) else {
        return Ok(());
    };
    let Some(run) = mood.remove(FROM[2]) else {
        return Ok(());
    };
    let runs = runs.ok_or(
        "mood.from of a scenario from outside names no run; write its number as mood.start",
    )?;
    let Value::String(run) = run else {
        return Err("mood.from is the name of a run, in quotation marks".to_owned());
    };

    let last = last_mood(runs, &run, robot)?;
    mood.insert(START.to_owned(), Value::Float(last));
    Ok(())
}

/// Does so for all robots of a file's content, for a file that is written from it.
pub(crate) fn carry_all_over(content: &mut Table) -> Result<(), String> {
    let robots = content.get_mut("robot").and_then(Value::as_array_mut);
    let Some(robots) = robots else {
        return Ok(());
    };
    let names_a_run = |robot: &Value| {
        let mut value = Some(robot);
        for key in FROM {
            value = value.and_then(|value| value.get(key));
        }
        value.is_some()
    };
    if !robots.iter().any(names_a_run) {
        return Ok(());
    }

    // Robots of one table had moods of their own.
    bulk::separate_all(robots);
    for robot in robots {
        let name = robot
            .get("name")
            .and_then(Value::as_str)
            .map(RobotName::new);
        let parameters = robot.get_mut(FROM[0]).and_then(Value::as_table_mut);
        if let (Some(Ok(name)), Some(parameters)) = (name, parameters) {
            carry_over(parameters, &name, Some(Path::new(RUNS)))?;
        }
    }
    Ok(())
}

/// The mood that the robot published last in a run.
fn last_mood(runs: &Path, run: &str, robot: &RobotName) -> Result<f64, String> {
    let candidates: [PathBuf; 2] = [runs.join(run), PathBuf::from(run)];
    let Some(folder) = candidates.into_iter().find(|path| path.is_dir()) else {
        return Err(format!(
            "mood.from: there is no run {run}, neither in {} nor as a folder",
            runs.display()
        ));
    };

    let file = folder.join(SUMMARY);
    if !file.is_file() {
        return Err(format!(
            "mood.from: there is no {SUMMARY} in {}: it is not a run, or one that is not over",
            folder.display()
        ));
    }
    let source = Source::read(&file).map_err(|error| format!("mood.from: {error}"))?;
    let summary: serde_json::Value = serde_json::from_str(&source.text)
        .map_err(|error| format!("mood.from: {}: {error}", file.display()))?;

    let robots = summary["robots"].as_object();
    let Some(state) = robots.and_then(|robots| robots.get(robot.as_str())) else {
        let names: Vec<&str> = robots
            .into_iter()
            .flat_map(|robots| robots.keys().map(String::as_str))
            .collect();
        return Err(format!(
            "mood.from: the run {run} has no robot called {robot}; its robots are {}",
            names.join(", ")
        ));
    };
    state["state_variables"][MOOD]
        .as_f64()
        .ok_or_else(|| format!("mood.from: {robot} has published no mood in the run {run}"))
}
