//! The simulated network of a scenario, by itself.

use std::path::Path;

use environment::medium::Medium;
use scenario::Scenario;
use scenario::diagnostic::Source;

/// The network of a scenario file with this text.
pub(crate) fn medium_of(text: &str) -> Medium {
    let source = Source {
        name: "test".into(),
        text: text.into(),
    };
    let scenario = Scenario::parse(&source, Path::new("."))
        .unwrap_or_else(|error| panic!("{}", error.in_words()));
    let roster = scenario.roster();
    Medium::new(scenario.seed, scenario.tick_s, scenario.network, roster)
}
