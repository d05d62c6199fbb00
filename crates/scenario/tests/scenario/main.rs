//! Tests of scenario files: what is read, and what is refused at which place.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod files;
mod guests;
mod layers;
mod places;
mod radio;
mod setup;
mod sites;

use std::path::Path;

use scenario::Scenario;
use scenario::diagnostic::{FileError, Source};

/// A scenario file.
fn source(text: &str) -> Source {
    Source {
        name: "hall.toml".into(),
        text: text.into(),
    }
}

fn parse(text: &str) -> Result<Scenario, FileError> {
    Scenario::parse(&source(text), Path::new("."))
}

/// The error as people see it, without colors.
fn shown(error: &FileError) -> String {
    config::render_plain(error, None, 200)
}
