//! The rules of the environment, tested from outside, against an implementation that is as simple as it can be.

#![expect(
    clippy::unwrap_used,
    reason = "helpers of tests fail as tests do; clippy.toml excepts only `#[test]`"
)]

mod guests;
mod halls;
mod motion;
mod near;
mod placing;
