//! What guests do beside walking, if a scenario says so: they see the faces that robots show, and ask robots for what
//! these serve. Not documented in the paper \[I\].

use std::collections::BTreeSet;

use protocol::Tick;

/// What guests do beside walking. By default nothing, as in the paper.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GuestRules {
    /// What they do at a robot's face.
    pub faces: Option<Faces>,
    /// What they ask of robots.
    pub requests: Option<Requests>,
}

/// What guests near a robot do at the face that it shows: its state variable `facial_expression`.
#[derive(Debug, Clone, PartialEq)]
pub struct Faces {
    /// How near, from center to center, meters.
    pub range_m: f64,
    /// Faces for which they make way.
    pub make_way: BTreeSet<String>,
    /// Faces to which they come.
    pub approach: BTreeSet<String>,
}

/// Guests ask a robot for something, as often as its state variables `served` and `missed` rise, and their mood is by what
/// they get.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requests {
    /// How near the guests are who ask, from center to center, meters.
    pub range_m: f64,
    /// After how many ticks in which a guest has waited in vain it is annoyed.
    pub patience: Tick,
}
