//! The robots by the names of their classes.

use std::process::ExitCode;

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

/// The program of the robots of a class; their name is that of the class if the command line has none.
///
/// # Panics
///
/// If there is no such class.
#[must_use]
pub fn main(class: &str) -> ExitCode {
    // Here and not in each program, so that the code of a class is compiled once.
    robot::main(class, |_| {
        make(class).unwrap_or_else(|| unreachable!("{class} is a class of this crate"))
    })
}
