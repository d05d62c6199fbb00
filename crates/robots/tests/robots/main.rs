//! Tests of the shipped robots on a stage, through the public interface.

#![expect(
    clippy::unwrap_used,
    reason = "test helpers may panic; clippy.toml only exempts `#[test]` functions"
)]

mod components;
mod deliberation;
mod documented;
mod interface;
mod levels;
mod new_robot;
mod parameters;
mod resume;
mod signals;
mod stage;
mod together;
