//! Charts.

pub(crate) mod bands;
pub(crate) mod floor;
pub(crate) mod intervals;
pub(crate) mod matrix;
pub(crate) mod steps;
pub(crate) mod trend;
