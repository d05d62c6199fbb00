//! Recruitment: the waiter calls for help, idle refillers offer, and he assigns one of them (Gage and Murphy 2004; the facts and
//! the choices are in `docs/affect.md`).
//!
//! A call is the command "help" to every refiller \[D\]. An idle refiller answers "offer", whenever she is idle or when her
//! shame has grown enough ([`shame`]) \[D\]. The waiter picks the nearest offer, a first-price auction \[D\], or any, and assigns
//! its refiller with "refill" until she answers "accept" \[I\]. From then on she is on her errand as after any call.
//!
//! The rules are here, as state machines without I/O; Butler and Leguin send what they decide.

pub mod recruiter;
pub mod shame;

use serde::{Deserialize, Serialize};

/// How refillers are recruited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Recruitment {
    /// Not at all: the waiter commands one refiller by name.
    #[default]
    Off,
    /// A refiller offers when her shame at ignored calls reaches a threshold; the nearest offer is taken \[D\].
    Affective,
    /// Every idle refiller offers; the nearest offer is taken \[D\].
    Greedy,
    /// Every idle refiller offers; any offer is taken \[D\].
    Random,
}

impl Recruitment {
    /// Whether refillers are recruited.
    #[must_use]
    pub fn is_on(self) -> bool {
        self != Self::Off
    }
}
