//! Tests of pictures: what is drawn, and where.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod charts;
mod diagram;
mod print;
