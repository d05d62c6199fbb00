//! What follows the run of a unit, and what is left at its end.

use std::collections::BTreeMap;

use lab::LabError;
use observe::Observation;
use record::Summary;

/// Follows a run tick by tick.
pub trait Follow {
    /// Takes a tick, or the end of the run, into account.
    fn observe(&mut self, observation: &Observation<'_>);
}

/// A run that has ended.
pub struct EndedRun {
    /// Digest of the run.
    pub digest: String,
    /// Its summary.
    pub summary: serde_json::Value,
    /// The verdicts about expectations, by name.
    pub verdicts: BTreeMap<String, String>,
}

impl EndedRun {
    /// The end of a run by its summary.
    ///
    /// # Errors
    /// If a number of the summary is not finite.
    pub(super) fn of(summary: &Summary) -> Result<Self, LabError> {
        let mut verdicts = BTreeMap::new();
        for (name, judged) in &summary.expectations {
            verdicts.insert(name.clone(), judged.verdict.name().to_owned());
        }
        Ok(Self {
            digest: summary.digest.clone(),
            summary: serde_json::to_value(summary).map_err(LabError::failed)?,
            verdicts,
        })
    }
}
