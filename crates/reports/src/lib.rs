//! Pictures for people: a report is one HTML file about runs ([`of_runs`]) or about an experiment ([`of_experiment`]), which
//! opens without a network and prints as a paper; a space-time diagram is one SVG file about a run ([`mod@diagram`]).

mod answer;
mod course;
mod decided;
pub mod diagram;
mod experiment;
mod facts;
mod figures;
mod floor;
mod limits;
mod loss;
mod quantity;
mod runs;
mod study;
mod transitions;
mod words;

pub use decided::decisions;
pub use experiment::of_experiment;
pub use pictures::{Page, WIDTHS_MM};
pub use runs::{MAX_RUNS, of_runs};
