//! Tests of what a robot is told, may do and may send.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod joining;
mod limits;
mod parameters;
