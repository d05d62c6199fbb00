//! Radio models: what power a message arrives with, whether it is received, and when its sender has sent it.
//!
//! Everything here is a function of geometry and of numbers that the caller draws. This crate uses no clock, network, files or
//! random generator of its own, and transcendental functions of `libm` only, so the same inputs give the same bits on every machine.
//!
//! # The power of a message
//!
//! In decibels, in this order ([`RadioModel::reception`]):
//!
//! 1. the power of the transmitter, dBm;
//! 2. less the loss over the distance ([`PathLoss`]);
//! 3. less the attenuation by each wall that the straight line between the antennas crosses;
//! 4. less that by each body that it crosses;
//! 5. less shadowing ([`Shadowing`]), which depends on the two places and lasts while both robots stand still;
//! 6. plus the gain of fading ([`Fading`]), which is drawn for each message.
//!
//! A message is received if the result is at least the sensitivity of the receiver. If it is not, the cause is the term after which
//! the power stays below the sensitivity ([`LossTerm`]): of a message that distance weakens too much, shadowing lifts above the
//! sensitivity and fading puts below it again, the cause is fading.
//!
//! # The queue of a sender
//!
//! A radio sends one message after the other, at a bit rate ([`SendQueue`]). Messages of other senders delay nothing: the model has
//! no collisions and no carrier sensing.

mod draw;
mod fading;
mod gamma;
mod link;
pub mod outage;
mod path_loss;
mod queue;
mod shadowing;

pub use fading::{Fading, NakagamiStep};
pub use gamma::regularized_gamma;
pub use link::{LinkGeometry, LossTerm, RadioModel, Reception};
pub use path_loss::PathLoss;
pub use queue::{SendQueue, Transmitter};
pub use shadowing::Shadowing;
