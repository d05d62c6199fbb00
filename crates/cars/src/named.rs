//! Files that can be given by a name, because they come with the programs.

use std::path::PathBuf;

use clap::builder::{PathBufValueParser, TypedValueParser};
use config::shipped::{self, EXPERIMENTS, LAUNCHES, LINKS, PARAMETERS, SCENARIOS};

/// A launch file.
pub(crate) fn launch() -> impl TypedValueParser<Value = PathBuf> {
    parser(&[LAUNCHES])
}

/// A launch file or a scenario.
pub(crate) fn run() -> impl TypedValueParser<Value = PathBuf> {
    parser(&[LAUNCHES, SCENARIOS])
}

/// A file of any kind that `cars check` reads.
pub(crate) fn any() -> impl TypedValueParser<Value = PathBuf> {
    parser(&[LAUNCHES, SCENARIOS, EXPERIMENTS, LINKS, PARAMETERS])
}

/// A plan of faults of real links.
pub(crate) fn links() -> impl TypedValueParser<Value = PathBuf> {
    parser(&[LINKS])
}

fn parser(folders: &'static [&'static str]) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|given| shipped::find(&given, folders))
}
