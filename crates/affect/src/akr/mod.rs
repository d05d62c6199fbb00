//! The taxonomy: personality, affect, and the components of an emotion.
//!
//! The names of the components are documented [D: S, F2]. Of those that the paper names, this crate has what a robot can
//! perceive and act on: valence, intensity, agency, controllability, certainty, facial expression, action tendency and
//! causal chain. It does not have novelty, modifiability and the compatibility with norms and standards: their values
//! were not readable, and the robots perceive nothing from which they could be computed. Duration and focality
//! distinguish emotions from moods; the paper's robots have emotions only, which last minutes and are about an event.

mod appraisal;
mod face;
mod personality;
mod tendency;

pub use crate::affect::{Affect, Valence};
pub use appraisal::{Agency, Appraisal};
pub use face::FacialExpression;
pub use personality::{Personality, Preference};
pub use tendency::{ActionTendency, PrimaryTendency, TABLE_1, TABLE_2, TaskTendency};
