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
