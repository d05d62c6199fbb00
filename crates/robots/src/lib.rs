//! The robots of the seed's experiment: Butler, who serves a reception, Leguin, who refills his tray, and Vonda, who is
//! Leguin under another name.
//!
//! Each robot is a parameter struct, a table for what it feels, a table for what it does, and a panel. What they share
//! is how they move ([`drive`]), what they know of one another ([`peer`]) and their own chance ([`chance`]). They see
//! nothing of the world but what the SDK gives them.
//!
//! What they feel acts at two of the three levels of `affect::levels`: sensory-motor (Leguin's speed) and schematic (what
//! either of them does). Each has a switch, and so have all emotions of a robot, for experiments without.
//!
//! Much of the original robots was never published in a readable form. As in `affect`, a number or a rule is
//! **\[D\]** documented in a readable source (the seed, unless another is named), or **\[I\]** inferred or chosen here;
//! every chosen number is a parameter.

pub mod butler;
pub mod chance;
pub mod drive;
pub mod leguin;
mod panel;
pub mod peer;
pub mod switch;

pub use butler::Butler;
pub use leguin::Leguin;

/// Meters in a foot, exact by definition; the experiments are stated in feet \[D\].
pub const FT_M: f64 = 0.3048;

/// The command that sends the refiller out \[D\].
pub const REFILL: &str = "refill";
/// The command that makes her hurry; it also sends her out \[D\].
pub const HURRY: &str = "hurry";
/// The command that sends her home after an exchange \[D\].
pub const GO_HOME: &str = "go home";

/// The classes that a scenario may name.
pub const CLASSES: &[&str] = &["Butler", "Leguin", "Vonda"];

/// A robot of this class; `None` if there is none.
#[must_use]
pub fn make(class: &str) -> Option<Box<dyn robot::Robot>> {
    match class {
        "Butler" => Some(Box::new(Butler::default())),
        // Vonda is a clone of Leguin's code under another name [D].
        "Leguin" | "Vonda" => Some(Box::new(Leguin::default())),
        _ => None,
    }
}

/// Text from outside, short enough for a log line whatever it is.
fn shortened(text: &str) -> String {
    const MAX_CHARS: usize = 60;
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
