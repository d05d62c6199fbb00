//! The robots by the names of their classes.

use robot::Robot;

use crate::bidder::Bidder;
use crate::butler::Butler;
use crate::leguin::Leguin;
use crate::scout::Scout;

/// The classes that a scenario may name.
pub const CLASSES: &[&str] = &["Butler", "Leguin", "Vonda", "Bidder", "Scout"];
/// Those of robots with emotions.
pub const AFFECTIVE: &[&str] = &["Butler", "Leguin", "Vonda"];

/// A robot of this class; `None` if there is no such class.
#[must_use]
pub fn make(class: &str) -> Option<Box<dyn Robot>> {
    match class {
        "Butler" => Some(make_butler()),
        // Vonda is a clone of Leguin's code under another name [D].
        "Leguin" | "Vonda" => Some(make_leguin()),
        "Bidder" => Some(make_bidder()),
        "Scout" => Some(make_scout()),
        _ => None,
    }
}

// A program that made its robot by itself would compile the robot's code once more.

/// A robot as [`Butler`].
#[must_use]
pub fn make_butler() -> Box<dyn Robot> {
    Box::new(Butler::default())
}

/// A robot as [`Leguin`].
#[must_use]
pub fn make_leguin() -> Box<dyn Robot> {
    Box::new(Leguin::default())
}

/// A robot as [`Bidder`].
#[must_use]
pub fn make_bidder() -> Box<dyn Robot> {
    Box::new(Bidder::default())
}

/// A robot as [`Scout`].
#[must_use]
pub fn make_scout() -> Box<dyn Robot> {
    Box::new(Scout::default())
}
