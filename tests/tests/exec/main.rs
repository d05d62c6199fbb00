//! Robots that are not written with the SDK: `cars exec` with real programs in a real run.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set up its subject fails"
)]

mod ending;
mod forging;
mod limits;
mod program;
mod rubbish;
mod skeletons;
mod stage;
