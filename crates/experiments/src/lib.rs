//! Work with many runs. An experiment is one scenario in several arms under several conditions over many seeds: a file
//! ([`Experiment::load`]), of which some ship with the project. It is planned ([`Plan`]) into units, which are played on one
//! machine or on many ([`engine`], [`submit`]) and kept in a folder ([`Store`]), whose results are read from there
//! ([`Results`]). Commands that can be typed are written by [`shell`].

mod case;
mod condition;
mod contrast;
pub mod engine;
mod estimate;
mod file;
mod follow;
mod launches;
mod outcome;
mod own;
pub mod parallel;
mod plan;
mod presentation;
mod processes;
mod provenance;
mod results;
mod script;
mod setting;
pub mod shell;
mod store;
pub mod submit;
mod unheard;
mod unit;

pub use observe::Measure;

pub use condition::{Condition, ConditionError, Conditions, Factor, FactorValue};
pub use contrast::{ArmDifference, Contrast, SHOWN_P, least_p_holm};
pub use engine::is_of_experiment;
pub use estimate::{ArmMeasure, Estimated, Excluded};
pub use file::{Arm, Experiment, MAX_UNITS, is_experiment_file};
pub use follow::{EndedRun, Follow};
pub use launches::{LaunchUse, Launcher, Launches, TICK_PATIENCE};
pub use outcome::{FailedUnit, Measured, UnitOutcome};
pub use own::{ByClass, Maker, OwnRobots, RobotSource, RunRobots};
pub use plan::{Key, LaunchText, PLAN, Plan, ProgramVersion, Request, Robots, Unit};
pub use presentation::{Example, Presentation, Shown};
pub use processes::write_launch;
pub use provenance::{Machine, Provenance};
pub use results::{ExpectationResult, Results};
pub use setting::Setting;
pub use store::Store;
pub use unit::{Played, UnitResult};
