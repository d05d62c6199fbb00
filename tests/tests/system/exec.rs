//! Robots that are not written with the SDK: `cars exec` with real programs in a real run.

mod ending;
mod forging;
mod limits;
mod program;
mod rubbish;
mod silence;
mod skeletons;
mod stage;
