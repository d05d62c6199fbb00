//! The taxonomy: personality, affect, and the components of an emotion.
//!
//! The names of the components are documented [D: S, F2]. Their values were not readable: how a robot computes them from what
//! it perceives is chosen here \[I\]. Duration and focality distinguish emotions, which last minutes and are about an event,
//! from moods, which last days and are about nothing in particular. The tree itself is data: [`Schemata`](crate::Schemata).

mod appraisal;
mod face;
mod level;
mod personality;
mod tendency;

pub use crate::affect::{Affect, Valence};
pub use appraisal::{Agency, Appraisal};
pub use face::FacialExpression;
pub use level::{AffectiveLevel, Duration, Focality};
pub use personality::{Personality, Preference};
pub use tendency::{ActionTendency, PrimaryTendency, TABLE_1, TABLE_2, TaskTendency};
