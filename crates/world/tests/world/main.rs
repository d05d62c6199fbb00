//! Tests of the environment's rules through the public interface, against the simplest possible implementation.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod guests;
mod halls;
mod motion;
mod near;
mod placing;
mod reactions;
mod recorded;
mod shapes;
mod sight;
mod social;
mod wants;
mod wheels;
