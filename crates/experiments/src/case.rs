//! An arm under a condition, and which of its changes is at fault where the scenario or a robot refuses them.

use config::{Changes, FileError, Override};
use lab::LabError;
use scenario::Scenario;

use super::condition::Condition;
use super::file::{Arm, Experiment};
use super::setting::Setting;

/// An arm under a condition.
#[derive(Debug, Clone)]
pub(super) struct Case<'a> {
    experiment: &'a Experiment,
    /// Names the arm and the condition, for people.
    name: String,
    /// All changes, in the order in which they are made.
    settings: Vec<Setting>,
}

impl<'a> Case<'a> {
    /// The case of an experiment, with the changes of the command line.
    ///
    /// # Errors
    /// If the duration cannot be written into a scenario.
    pub(super) fn new(
        experiment: &'a Experiment,
        options: &[Override],
        condition: &Condition,
        arm: &Arm,
    ) -> Result<Self, LabError> {
        let duration = format!("duration=\"{} s\"", experiment.duration_s);
        let mut settings = vec![Setting {
            change: duration.parse().map_err(LabError::refused)?,
            span: experiment.duration_span.clone(),
        }];
        for option in options {
            settings.push(Setting {
                change: option.clone(),
                span: None,
            });
        }
        settings.extend_from_slice(&arm.set);
        settings.extend_from_slice(&condition.set);

        Ok(Self {
            experiment,
            name: format!("arm \"{}\", condition \"{}\"", arm.name, condition.name),
            settings,
        })
    }

    /// The scenario with all changes and the first seed.
    ///
    /// # Errors
    /// [`FileError`] at the change that the scenario refuses; that of the scenario, if it cannot be used without them.
    pub(super) fn scenario(&self) -> Result<Scenario, FileError> {
        let all = self.settings.len();
        self.scenario_with(all).map_err(|error| {
            let reason = error.reason().to_owned();
            let attempt = |count| match self.scenario_with(count) {
                Ok(_) => None,
                Err(error) => Some(error.reason().to_owned()),
            };
            let blamed = self.blame(&reason, attempt);
            blamed
                .or_else(|| self.scenario_with(0).err())
                .unwrap_or(error)
        })
    }

    /// The error of a case that cannot be played for this reason, at the change from which on `attempt`, given the scenario,
    /// finds the same reason.
    pub(super) fn refused(
        &self,
        reason: &str,
        attempt: impl Fn(Scenario) -> Option<String>,
    ) -> FileError {
        let attempt = |count| attempt(self.scenario_with(count).ok()?);
        self.blame(reason, attempt).unwrap_or_else(|| {
            let file = &self.experiment.source().name;
            FileError::new(format!("{file}: {}: {reason}", self.name))
        })
    }

    /// The error at a change, if there is one with which the reason begins: `attempt` has it with the change and not without, of
    /// the changes before it.
    fn blame(&self, reason: &str, attempt: impl Fn(usize) -> Option<String>) -> Option<FileError> {
        let fails = |count| attempt(count).is_some_and(|found| found == reason);
        if !fails(self.settings.len()) || fails(0) {
            return None;
        }

        let last = (0..self.settings.len())
            .rev()
            .find(|count| !fails(*count))?;
        let setting = &self.settings[last];
        let change = &setting.change;
        let label = format!("{}, with {change}: {reason}", self.name);
        Some(match &setting.span {
            Some(span) => FileError::at(self.experiment.source(), Some(span.clone()), &label),
            None => FileError::new(format!(
                "the command line's {change}: {}: {reason}",
                self.name
            )),
        })
    }

    /// The scenario with the first changes.
    fn scenario_with(&self, count: usize) -> Result<Scenario, FileError> {
        let mut set = Vec::new();
        for setting in &self.settings[..count] {
            set.push(setting.change.clone());
        }
        // Nothing at all is changed where there are no changes, so that errors show the scenario's own lines.
        let seed = self.experiment.seeds.first().copied();
        let changes = Changes {
            seed: seed.filter(|_| count > 0),
            set,
            ..Changes::default()
        };
        Scenario::load(&self.experiment.scenario, &changes)
    }
}
