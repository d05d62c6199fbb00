//! Work with processes: launch files and their supervision ([`Launch`]), any program as a robot ([`exec`]), and certificates
//! for runs that other machines can reach ([`Certificates`]).

mod bar;
pub mod child;
mod compose;
mod ending;
pub mod endpoint;
mod error;
pub mod exec;
mod failure;
mod file;
mod launched;
mod launching;
mod leftovers;
mod lines;
mod link;
mod log;
mod observe;
mod options;
mod plan;
mod process;
mod program;
mod restart;
mod screen;
mod secure;
mod signals;
mod supervise;
mod tail;

pub use ending::code_of;
pub use error::LaunchError;
pub use failure::Failure;
pub use file::{LaunchFile, Process, is_launch_file, scenario_file};
pub use launching::{Launch, LaunchOptions, What};
pub use leftovers::guard;
pub use link::{LinkError, ProcessLink};
pub use options::{RunOptions, default_run_name};
pub use plan::{CommandLine, Part, Planned};
pub use program::{SIBLINGS, find_sibling};
pub use restart::Restart;
pub use secure::Certificates;
pub use supervise::LaunchOutcome;
