//! Reports for people: one HTML file about runs ([`of_runs`]) or about an experiment ([`of_experiment`]), which opens without a
//! network and prints as a paper.

mod answer;
mod course;
mod experiment;
mod facts;
mod figures;
mod floor;
mod limits;
mod quantity;
mod runs;
mod study;
mod transitions;
mod words;

pub use experiment::of_experiment;
pub use runs::{MAX_RUNS, of_runs};
