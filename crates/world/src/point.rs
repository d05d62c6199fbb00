//! Positions on the field, and displacements between them: in meters, with x to the right and y up (REP 103).

pub use crowd::Vector as Point;
