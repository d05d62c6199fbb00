//! Fading: how the power of single messages varies around its mean, because signals arrive over many ways.

use crate::draw;

/// How the power of single messages varies around its mean.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Fading {
    /// Not at all.
    #[default]
    None,
    /// No way is stronger than the others: the power is exponential (Rayleigh fading).
    Rayleigh,
    /// The power has a gamma distribution (Nakagami fading), whose shape may depend on the distance. A shape of 1 is Rayleigh
    /// fading. Steps are ordered by distance, and the first one is at 0 m.
    Nakagami(Vec<NakagamiStep>),
}

/// The shape of Nakagami fading from a distance on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NakagamiStep {
    /// The least distance of a receiver for which it holds, meters.
    pub from_m: f64,
    /// The shape m, at least 0.5.
    pub m: f64,
}

impl Fading {
    /// The received power of one message over its mean, from numbers that are uniform from 0 up to but not including 1. Its mean is 1.
    pub fn gain(&self, distance_m: f64, mut unit: impl FnMut() -> f64) -> f64 {
        match self.shape(distance_m) {
            None => 1.0,
            Some(1.0) => draw::exponential(unit()),
            Some(m) => draw::gamma(m, &mut unit) / m,
        }
    }

    /// The shape m of the distribution of the power at a distance; 1 for Rayleigh fading, `None` without fading.
    #[must_use]
    pub fn shape(&self, distance_m: f64) -> Option<f64> {
        match self {
            Self::None => None,
            Self::Rayleigh => Some(1.0),
            Self::Nakagami(steps) => {
                let mut reached = steps.iter().rev().filter(|step| step.from_m <= distance_m);
                reached.next().or(steps.first()).map(|step| step.m)
            }
        }
    }
}
