//! Conditions and measures as they are written, over a run that a test shows.

use std::collections::BTreeMap;

use observe::{Evaluation, Measure, Measured, Observation, Probe, RunSetting, TickCondition};
use serde::{Deserialize, Serialize};
use serde_json::Value;

#[derive(Debug, Serialize, Deserialize)]
struct File {
    c: TickCondition,
}

/// A condition, checked.
pub(crate) fn condition(text: &str, setting: &RunSetting) -> Result<TickCondition, String> {
    let file: Result<File, _> = toml::from_str(&format!("c = {text}"));
    let condition = file.map_err(|error| error.message().to_owned())?.c;
    condition
        .check(setting)
        .map_err(|error| error.to_string())?;
    Ok(condition)
}

/// The ticks in which a condition holds, and why it holds in the first of them. It is the same when it is written and read again.
pub(crate) fn holds_in(
    text: &str,
    setting: &RunSetting,
    show: impl FnOnce(&mut dyn FnMut(&Observation<'_>)),
) -> (Vec<u64>, String) {
    let condition = condition(text, setting).unwrap();
    let written = toml::to_string(&File {
        c: condition.clone(),
    });
    let read: File = toml::from_str(&written.unwrap()).unwrap();
    assert_eq!(read.c, condition, "{text}");

    let mut evaluation = Evaluation::new(&condition, setting);
    let mut held = Vec::new();
    let mut because = String::new();
    show(&mut |seen| {
        if let Some(reason) = evaluation.holds(seen)
            && held.last() != Some(&seen.tick)
        {
            if held.is_empty() {
                because = reason;
            }
            held.push(seen.tick);
        }
    });
    (held, because)
}

/// A measure, checked.
pub(crate) fn measure(text: &str, setting: &RunSetting) -> Result<Measure, String> {
    let measure: Result<Measure, _> = toml::from_str(&format!("name = 'x'\n{text}"));
    let measure = measure.map_err(|error| error.message().to_owned())?;
    measure.check(setting).map_err(|error| error.to_string())?;
    Ok(measure)
}

/// What a measure gives.
pub(crate) fn measured(
    text: &str,
    setting: &RunSetting,
    show: impl FnOnce(&mut dyn FnMut(&Observation<'_>)),
) -> Measured {
    let measure = measure(text, setting).unwrap();
    let mut probe = Probe::new(&measure, setting, (0.0, 1.0));
    show(&mut |seen| probe.observe(seen));
    probe.measured(&Value::Null, &BTreeMap::new())
}
