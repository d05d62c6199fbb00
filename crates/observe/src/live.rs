//! The measures of a scenario, which are taken of its run while it goes on.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::condition::{TickConditionError, is_known};
use crate::expect::Expectation;
use crate::measure::{Count, MAX_MEASURES, Measure, MeasureError, MeasureSource, Measured};
use crate::probe::Probe;
use crate::{Observation, RunSetting};

/// A measure of a scenario, an entry of `[[measure]]`, and its table, which the record has as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Table", into = "toml::Table")]
pub struct ScenarioMeasure {
    table: toml::Table,
    measure: Measure,
}

impl TryFrom<toml::Table> for ScenarioMeasure {
    type Error = String;

    fn try_from(table: toml::Table) -> Result<Self, String> {
        // A measure knows where its kind stands in a text, which a table no longer has.
        let text = toml::to_string(&table).map_err(|error| error.to_string())?;
        let measure = toml::from_str(&text);
        let measure = measure.map_err(|error: toml::de::Error| error.message().to_owned())?;
        Ok(Self { table, measure })
    }
}

impl From<ScenarioMeasure> for toml::Table {
    fn from(measure: ScenarioMeasure) -> Self {
        measure.table
    }
}

impl std::ops::Deref for ScenarioMeasure {
    type Target = Measure;

    fn deref(&self) -> &Measure {
        &self.measure
    }
}

/// Which measure of a scenario is wrong, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{error}")]
pub struct WrongMeasure {
    /// Its index in the file.
    pub index: usize,
    /// What is wrong with it.
    pub error: MeasureError,
}

/// Checks the measures of a scenario together, with its expectations, whose verdicts they may count.
///
/// # Errors
/// [`WrongMeasure`], the first one.
pub fn check_measures(
    measures: &[ScenarioMeasure],
    expectations: &[Expectation],
    setting: &RunSetting,
) -> Result<(), WrongMeasure> {
    let mut before: Vec<Measure> = Vec::new();
    for (index, measure) in measures.iter().enumerate() {
        check(measure, &before, expectations, setting)
            .map_err(|error| WrongMeasure { index, error })?;
        before.push(measure.measure.clone());
    }
    Ok(())
}

fn check(
    measure: &Measure,
    before: &[Measure],
    expectations: &[Expectation],
    setting: &RunSetting,
) -> Result<(), MeasureError> {
    if before.len() == MAX_MEASURES {
        return Err(MeasureError::TooMany);
    }
    if before.iter().any(|other| other.name == measure.name) {
        return Err(MeasureError::Twice(measure.name.clone()));
    }
    for source in measure.sources() {
        match source {
            MeasureSource::Summary(_) => return Err(MeasureError::NotLive("summary")),
            MeasureSource::OfScenario(_) => return Err(MeasureError::NotOne),
            MeasureSource::Count(Count { when: Some(_), .. }) => {
                return Err(MeasureError::NotLive("when"));
            }
            _ => {}
        }
    }

    let robots = measure.robots();
    if let Some(name) = robots.iter().find(|name| !is_known(name, &setting.roster)) {
        return Err(TickConditionError::UnknownRobot((*name).to_owned()).into());
    }
    let known = |name: &str| expectations.iter().any(|one| one.name == name);
    let judged = measure.expectations();
    if let Some(name) = judged.iter().find(|name| !known(name)) {
        return Err(MeasureError::NoExpectation((*name).to_owned()));
    }
    measure.check_after(before)?;
    measure.check(setting)
}

/// The measures of a run while it goes on.
#[derive(Debug, Clone, Default)]
pub struct Measurements(Vec<(String, Probe)>);

impl Measurements {
    /// Begins to measure a run.
    #[must_use]
    pub fn new(measures: &[ScenarioMeasure], setting: &RunSetting) -> Self {
        let whole_run_s = (0.0, f64::INFINITY);
        let probes = measures.iter().map(|measure| {
            let probe = Probe::new(measure, setting, whole_run_s);
            (measure.name.clone(), probe)
        });
        Self(probes.collect())
    }

    /// Whether nothing is measured.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Takes a tick, or the end of the run, into account.
    pub fn observe(&mut self, seen: &Observation<'_>) {
        for (_, probe) in &mut self.0 {
            probe.observe(seen);
        }
    }

    /// What each measure gives, by name, if the run ends with the last tick.
    #[must_use]
    pub fn measured(&self) -> BTreeMap<String, Measured> {
        let mut measured = BTreeMap::new();
        for (name, probe) in &self.0 {
            let value = probe.measured(&Value::Null, &measured);
            measured.insert(name.clone(), value);
        }
        measured
    }

    /// The numbers that there are, by name of the measure.
    #[must_use]
    pub fn numbers(&self) -> BTreeMap<String, f64> {
        let measured = self.measured().into_iter();
        measured
            .filter_map(|(name, measured)| Some((name, measured.value()?)))
            .collect()
    }
}
