//! The robots by the names of their classes.

use crate::butler::Butler;
use crate::leguin::Leguin;

/// The classes that a scenario may name.
pub const CLASSES: &[&str] = &["Butler", "Leguin", "Vonda"];

/// A robot of this class; `None` if there is no such class.
#[must_use]
pub fn make(class: &str) -> Option<Box<dyn robot::Robot>> {
    match class {
        "Butler" => Some(Box::new(Butler::default())),
        // Vonda is a clone of Leguin's code under another name [D].
        "Leguin" | "Vonda" => Some(Box::new(Leguin::default())),
        _ => None,
    }
}
