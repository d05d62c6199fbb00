//! The quality of service of a put.

/// The quality of service of a put, as zenoh calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// Whether its congestion control is block; the other one, drop, loses messages.
    pub is_blocking: bool,
    /// Whether it is express: it may overtake what was put before.
    pub is_express: bool,
    /// Whether it has the default priority; messages of different priorities overtake each other.
    pub has_default_priority: bool,
}

impl Qos {
    /// What a message needs that takes part in a tick.
    pub const IN_ORDER: Self = Self {
        is_blocking: true,
        is_express: false,
        has_default_priority: true,
    };
}
