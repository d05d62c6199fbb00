//! The robots by the names of their classes.

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
pub fn make(class: &str) -> Option<Box<dyn robot::Robot>> {
    match class {
        "Butler" => Some(Box::new(Butler::default())),
        // Vonda is a clone of Leguin's code under another name [D].
        "Leguin" | "Vonda" => Some(Box::new(Leguin::default())),
        "Bidder" => Some(Box::new(Bidder::default())),
        "Scout" => Some(Box::new(Scout::default())),
        _ => None,
    }
}
