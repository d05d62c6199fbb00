//! The table `[[reseed]]` as written in the file.

use std::collections::BTreeMap;

use config::units::Time;
use config::{FileError, Source, seed};
use protocol::RobotName;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::checked::RobotSpec;
use super::super::network::ticks;
use super::super::reseed::{ChanceKind, Reseed};
use super::times::Times;
use super::unplaced::unplaced;

/// Most times that a scenario re-seeds its run: each is in the welcome of each robot.
const MAX_RESEEDS: usize = 1000;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReseedTable {
    at: Spanned<Time>,
    seed: Spanned<u64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    of: Vec<Spanned<String>>,
}

/// Checks where a run is re-seeded; returns it in the order of ticks.
pub(super) fn check(
    raw: Vec<Spanned<ReseedTable>>,
    robots: &BTreeMap<RobotName, RobotSpec>,
    tick_s: f64,
    source: &Source,
) -> Result<Vec<Reseed>, FileError> {
    if let Some(extra) = raw.get(MAX_RESEEDS) {
        return Err(FileError::at(
            source,
            Some(extra.span()),
            "more than 1000 [[reseed]]",
        ));
    }

    let mut reseeds = Vec::new();
    for entry in raw {
        let table = entry.into_inner();
        let at = ticks(table.at.get_ref().0, tick_s);
        if at < 1 {
            let reason =
                "a run is re-seeded from the first tick on or later; before, that is its `seed`";
            return Err(FileError::at(source, Some(table.at.span()), reason));
        }
        let seed = seed::check(*table.seed.get_ref())
            .map_err(|error| FileError::at(source, Some(table.seed.span()), &error.to_string()))?;

        let mut of = Vec::new();
        for text in &table.of {
            let refuse = |reason: &str| FileError::at(source, Some(text.span()), reason);
            let kind: ChanceKind = text
                .get_ref()
                .parse()
                .map_err(|reason: String| refuse(&reason))?;
            if let ChanceKind::Robot(pattern) = &kind
                && !robots.keys().any(|name| pattern.matches(name))
            {
                return Err(refuse(&format!("no robot is called {}", pattern.as_str())));
            }
            of.push(kind);
        }
        reseeds.push(Reseed { at, seed, of });
    }

    reseeds.sort_by_key(|reseed| reseed.at);
    Ok(reseeds)
}

impl ReseedTable {
    /// Remarks about its time.
    pub(super) fn remark(&self, times: &mut Times<'_>) {
        times.begins("reseed", &self.at);
    }

    pub(super) fn of(reseed: &Reseed, tick_s: f64) -> Self {
        let of = reseed.of.iter().map(|kind| unplaced(kind.to_string()));
        Self {
            at: unplaced(Time(reseed.at as f64 * tick_s)),
            seed: unplaced(reseed.seed),
            of: of.collect(),
        }
    }
}
