//! Files of other programs, read into what a scenario has: drawings as obstacles and walls ([`floor_plan`]), recorded people as
//! tracks ([`tracks`]). The opposite is `export`.

pub mod floor_plan;
pub mod tracks;
