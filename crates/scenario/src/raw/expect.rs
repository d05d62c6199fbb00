//! The table `[[expect]]` as written in the file.

use config::{FileError, Source};
use observe::Expectation;
use observe::expect::check_all;
use protocol::RobotName;
use serde::Deserialize;
use toml::Spanned;

/// Checks the expectations of a scenario with these robots.
pub(super) fn check(
    raw: Vec<Spanned<Expectation>>,
    roster: &[RobotName],
    source: &Source,
) -> Result<Vec<Expectation>, FileError> {
    let mut expectations = Vec::new();
    let mut spans = Vec::new();
    for entry in raw {
        spans.push(entry.span());
        expectations.push(entry.into_inner());
    }

    check_all(&expectations, roster).map_err(|error| {
        let span = spans.get(error.index).cloned();
        FileError::at(source, span, &error.error.to_string())
    })?;
    Ok(expectations)
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
        roster: &[RobotName],
    ) -> Result<Vec<Expectation>, FileError> {
        check(self.entries, roster, source)
    }
}
