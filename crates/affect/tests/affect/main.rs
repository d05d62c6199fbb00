//! Tests of affect through the public interface.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod dynamics;
mod golden;
mod levels;
mod taxonomy;
mod waiter;
