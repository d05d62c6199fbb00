//! The tables `[[expect]]` and `[[measure]]` and the key `end_when` as written in the file.

use config::{FileError, Source};
use observe::expect::check_all;
use observe::{Expectation, RunSetting, ScenarioMeasure, TickCondition};
use serde::Deserialize;
use toml::Spanned;

/// Checks the expectations of a scenario.
pub(super) fn check(
    raw: Vec<Spanned<Expectation>>,
    setting: &RunSetting,
    source: &Source,
) -> Result<Vec<Expectation>, FileError> {
    let mut expectations = Vec::new();
    let mut spans = Vec::new();
    for entry in raw {
        spans.push(entry.span());
        expectations.push(entry.into_inner());
    }

    check_all(&expectations, setting).map_err(|error| {
        let span = spans.get(error.index).cloned();
        FileError::at(source, span, &error.error.to_string())
    })?;
    Ok(expectations)
}

/// Checks the measures of a scenario with these expectations.
pub(super) fn check_measures(
    raw: Vec<Spanned<ScenarioMeasure>>,
    expectations: &[Expectation],
    setting: &RunSetting,
    source: &Source,
) -> Result<Vec<ScenarioMeasure>, FileError> {
    let mut measures = Vec::new();
    let mut spans = Vec::new();
    for entry in raw {
        spans.push(entry.span());
        measures.push(entry.into_inner());
    }

    observe::check_measures(&measures, expectations, setting).map_err(|wrong| {
        let span = spans.get(wrong.index).cloned();
        FileError::at(source, span, &wrong.to_string())
    })?;
    Ok(measures)
}

/// Checks when the run of a scenario ends.
pub(super) fn check_end(
    raw: Option<Spanned<TickCondition>>,
    setting: &RunSetting,
    source: &Source,
) -> Result<Option<TickCondition>, FileError> {
    let Some(raw) = raw else {
        return Ok(None);
    };
    raw.get_ref()
        .check_end(setting)
        .map_err(|error| FileError::at(source, Some(raw.span()), &error.to_string()))?;
    Ok(Some(raw.into_inner()))
}

/// The expectations of any file.
#[derive(Debug, Deserialize)]
pub(crate) struct Expectations {
    #[serde(default, rename = "expect")]
    entries: Vec<Spanned<Expectation>>,
}

impl Expectations {
    pub(crate) fn check(
        self,
        source: &Source,
        setting: &RunSetting,
    ) -> Result<Vec<Expectation>, FileError> {
        check(self.entries, setting, source)
    }
}
