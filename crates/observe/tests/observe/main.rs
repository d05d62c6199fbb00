//! Tests of what observers make of a run: expectations and measures.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod expect;
mod layers;
mod sites;
mod teams;
mod written;
