//! What the report of an experiment shows: the table `[report]` of its file. It changes no run and no result.

use std::ops::Range;

use config::{FileError, Source};
use observe::Measure;
use serde::Deserialize;
use toml::Spanned;

use super::condition::{Conditions, FactorValue};

/// Most example runs.
const MAX_RUNS: usize = 8;

/// What a report shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Presentation {
    /// Names of the measures that have a section, in their order.
    pub measures: Vec<String>,
    /// Name of the factor on the horizontal axis, if the file names one.
    pub x: Option<String>,
    /// The parts.
    pub parts: Vec<Shown>,
    /// The example runs, in their order.
    pub runs: Vec<Example>,
    /// Places of the example runs in the file, bytes; none if the file names none.
    run_spans: Vec<Range<usize>>,
}

/// A part of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shown {
    /// Estimates of the arms under each condition.
    Estimates,
    /// Estimates over two factors.
    #[serde(rename = "heat maps")]
    HeatMaps,
    /// Survival curves of times.
    Survival,
    /// Differences to the baseline under each condition.
    Differences,
    /// Distributions of numbers.
    Distributions,
    /// Verdicts about expectations.
    Expectations,
    /// Emotions and space-time diagrams of the example runs.
    Runs,
    /// How often one state followed another in the example runs.
    Transitions,
    /// Where the robots of the example runs were.
    Floor,
}

/// A run that a report shows as an example.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Example {
    /// The run of the baseline that is nearest to its median.
    Typical,
    /// The run that fails most expectations.
    Worst,
    /// The unit of this number.
    Unit(usize),
}

/// The table as written.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPresentation {
    measures: Option<Vec<Spanned<String>>>,
    x: Option<Spanned<String>>,
    show: Option<Vec<Spanned<Shown>>>,
    runs: Option<Vec<Spanned<toml::Value>>>,
}

impl Shown {
    /// All parts, in the order of the page.
    const ALL: [Self; 9] = [
        Self::Estimates,
        Self::HeatMaps,
        Self::Survival,
        Self::Differences,
        Self::Distributions,
        Self::Expectations,
        Self::Runs,
        Self::Transitions,
        Self::Floor,
    ];
}

impl Presentation {
    /// Whether the report has a part.
    #[must_use]
    pub fn shows(&self, part: Shown) -> bool {
        self.parts.contains(&part)
    }

    /// Checks that the units that are examples are among so many, which options of the command line may have changed.
    ///
    /// # Errors
    /// [`FileError`] at a unit that there is not.
    pub(super) fn check_units(&self, source: &Source, units: usize) -> Result<(), FileError> {
        for (run, span) in self.runs.iter().zip(&self.run_spans) {
            if let Example::Unit(number) = run
                && *number >= units
            {
                let reason = format!(
                    "there is no unit {number}: the {units} units of the experiment have the numbers 0 to {}",
                    units - 1
                );
                return Err(FileError::at(source, Some(span.clone()), &reason));
            }
        }
        Ok(())
    }
}

impl RawPresentation {
    /// Checks what is named against the measures and the factors of the experiment.
    pub(super) fn check(
        self,
        source: &Source,
        measures: &[Measure],
        conditions: &Conditions,
    ) -> Result<Presentation, FileError> {
        let all: Vec<String> = measures
            .iter()
            .map(|measure| measure.name.clone())
            .collect();
        let measures = match self.measures {
            Some(named) => {
                for name in &named {
                    if !all.contains(name.get_ref()) {
                        let reason = format!(
                            "there is no measure \"{}\"; there are {}",
                            name.get_ref(),
                            all.join(", ")
                        );
                        return Err(FileError::at(source, Some(name.span()), &reason));
                    }
                }
                each_once(source, named)?
            }
            None => all,
        };

        if let Some(x) = &self.x {
            check_axis(x.get_ref(), conditions)
                .map_err(|reason| FileError::at(source, Some(x.span()), &reason))?;
        }
        let parts = match self.show {
            Some(parts) => each_once(source, parts)?,
            None => Shown::ALL.to_vec(),
        };

        let mut run_spans = Vec::new();
        let runs = match self.runs {
            Some(named) => {
                let mut runs = Vec::new();
                for run in named {
                    let span = run.span();
                    if run_spans.len() == MAX_RUNS {
                        let reason = format!("a report shows at most {MAX_RUNS} runs");
                        return Err(FileError::at(source, Some(span), &reason));
                    }
                    let Some(run) = example(run.get_ref()) else {
                        let reason = "a run is \"typical\", \"worst\", or the number of a unit";
                        return Err(FileError::at(source, Some(span), reason));
                    };
                    run_spans.push(span.clone());
                    runs.push(Spanned::new(span, run));
                }
                each_once(source, runs)?
            }
            None => vec![Example::Typical, Example::Worst],
        };
        Ok(Presentation {
            measures,
            x: self.x.map(Spanned::into_inner),
            parts,
            runs,
            run_spans,
        })
    }
}

/// An example run as written.
fn example(value: &toml::Value) -> Option<Example> {
    match value {
        toml::Value::String(name) if name == "typical" => Some(Example::Typical),
        toml::Value::String(name) if name == "worst" => Some(Example::Worst),
        toml::Value::Integer(number) => Some(Example::Unit(usize::try_from(*number).ok()?)),
        _ => None,
    }
}

/// The values without their places, if none of them is there twice.
fn each_once<T: PartialEq>(source: &Source, values: Vec<Spanned<T>>) -> Result<Vec<T>, FileError> {
    let mut once = Vec::new();
    for value in values {
        let span = value.span();
        let value = value.into_inner();
        if once.contains(&value) {
            let reason = "a report shows it once, and it is there twice";
            return Err(FileError::at(source, Some(span), reason));
        }
        once.push(value);
    }
    Ok(once)
}

/// Checks that a factor can be a horizontal axis.
fn check_axis(name: &str, conditions: &Conditions) -> Result<(), String> {
    let mut factors = conditions.factors.iter();
    let Some(factor) = factors.find(|factor| factor.name == name) else {
        return Err(format!("there is no factor \"{name}\""));
    };

    let are_numbers = factor.values.iter().all(|value| match value {
        FactorValue::Integer(_) | FactorValue::Number(_) | FactorValue::Time(_) => true,
        FactorValue::Flag(_) | FactorValue::Text(_) => false,
    });
    if !are_numbers || factor.values.len() < 2 {
        return Err(format!(
            "a horizontal axis needs at least two numbers or times, and \"{name}\" does not have them"
        ));
    }
    Ok(())
}
