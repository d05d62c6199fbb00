//! The robots of the paper's experiment: Butler, who serves a reception, Leguin, who refills his tray, and Vonda, who is
//! Leguin under another name. [`Bidder`] and [`Scout`] are of other fields, have no emotion, and share nothing with these.
//!
//! Each of the three is a set of parameters, an appraisal of its measures, a table for its behavior, and a panel. They share how they
//! move ([`drive`]), what they know of one another ([`peer`]), the random streams ([`chance`]), what counts as progress
//! ([`input`]), what they believe of themselves ([`belief`]), and the emotion that an experiment can switch off.
//!
//! An emotion acts at the three levels of `affect::levels`: sensory-motor (Leguin's speed), schematic (the behavior of
//! both) and conceptual (Butler's plans, off by default). Each level has a switch, and so has the emotion as a whole, for
//! experiments without. What a robot feels and why is published with its state ([`frame`]).
//!
//! Much of the original robots was never published in a readable form. As in `affect`, a number or a rule is
//! **\[D\]** documented in a readable source (the paper, unless another is named), or **\[I\]** inferred or chosen here;
//! every chosen number is a parameter.

pub mod belief;
mod bidder;
mod bounds;
pub mod butler;
pub mod chance;
pub mod checks;
mod classes;
pub mod closing;
mod commands;
pub mod drive;
mod emotion;
pub mod frame;
pub mod input;
mod jokes;
pub mod leguin;
mod panel;
pub mod peer;
pub mod policy;
mod published;
pub mod recruitment;
mod scout;
pub mod script;
pub mod switch;
mod units;

pub use bidder::Bidder;
pub use butler::Butler;
pub use classes::{AFFECTIVE, CLASSES, make, make_bidder, make_butler, make_leguin, make_scout};
pub use commands::{ACCEPT, GO_HOME, HELP, HURRY, OFFER, REFILL};
pub use leguin::Leguin;
pub use scout::Scout;
pub use units::FT_M;
