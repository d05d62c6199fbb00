//! Yoked control: the emotions of one run, as the parameter `script` of the same robots in another run. So a robot shows and
//! acts by emotions that are as frequent and as strong, and that have nothing to do with what happens to it.

use std::collections::BTreeMap;

use config::Override;
use observe::Observation;
use protocol::{Event, RobotName};
use toml::{Table, Value};

use super::follow::Follow;

/// Parameter of a robot that replaces its own emotions.
const PARAMETER: &str = "script";
/// State variable with the urgency of the current emotion.
const URGENCY: &str = "urgency";

/// The emotions that robots have shown.
#[derive(Debug, Default)]
pub(super) struct EmotionScript {
    robots: BTreeMap<RobotName, Vec<Value>>,
}

impl Follow for EmotionScript {
    /// Notes the emotions that begin in a tick, with their urgencies.
    fn observe(&mut self, observation: &Observation<'_>) {
        for event in observation.events {
            let Event::Emotion { robot, to, .. } = event else {
                continue;
            };
            let state = (observation.state)(robot);
            let urgency = state.and_then(|state| state.state_variables.get(URGENCY)?.as_f64());

            let mut shown = Table::new();
            shown.insert("at_s".to_owned(), observation.time_s().into());
            shown.insert("emotion".to_owned(), to.clone().into());
            shown.insert(URGENCY.to_owned(), urgency.unwrap_or(0.0).into());
            let entries = self.robots.entry(robot.clone()).or_default();
            entries.push(Value::Table(shown));
        }
    }
}

impl EmotionScript {
    /// The changes of a scenario that make its robots show these emotions.
    ///
    /// # Errors
    /// If the name of a robot cannot be part of a path.
    pub(super) fn changes(&self) -> Result<Vec<Override>, String> {
        let mut changes = Vec::new();
        for (robot, shown) in &self.robots {
            let shown = Value::Array(shown.clone());
            changes.push(change(robot, &shown.to_string())?);
        }
        Ok(changes)
    }
}

/// The change of a scenario that makes a robot show these emotions, a list in TOML.
///
/// # Errors
/// If the name of the robot cannot be part of a path.
pub(super) fn change(robot: &RobotName, shown: &str) -> Result<Override, String> {
    format!("robot.{robot}.params.{PARAMETER}={shown}").parse()
}
