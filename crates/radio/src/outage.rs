//! Closed forms that hold for the models: what a simulation of them is compared with, and what files are checked with.

use std::f64::consts::SQRT_2;

use crate::gamma::regularized_gamma;
use crate::link::RadioModel;

/// The probability that Rayleigh fading leaves less than this share of the mean power: 1 - exp(-g/ĝ).
#[must_use]
pub fn rayleigh(share: f64) -> f64 {
    -libm::expm1(-share.max(0.0))
}

/// The probability that Nakagami fading with the shape `m` leaves less than this share of the mean power: P(m, m g/ĝ).
#[must_use]
pub fn nakagami(m: f64, share: f64) -> f64 {
    regularized_gamma(m, m * share)
}

/// The probability that shadowing alone loses a message whose power without it is `margin_db` above the sensitivity: Q(margin/σ).
#[must_use]
pub fn log_normal(margin_db: f64, sigma_db: f64) -> f64 {
    0.5 * libm::erfc(margin_db / sigma_db / SQRT_2)
}

/// The mean time that a message waits in the queue of a sender before it is sent, where messages of one length arrive at random (M/D/1):
/// ρ/(2μ(1-ρ)). `load` is the share ρ of the time in which the sender sends, below 1; `sending_s` the time that it sends one, 1/μ.
#[must_use]
pub fn waiting_s(load: f64, sending_s: f64) -> f64 {
    load * sending_s / (2.0 * (1.0 - load))
}

/// The probability that a message is not received at a distance, without walls and bodies, over all draws of shadowing and fading.
#[must_use]
pub fn at_distance(model: &RadioModel, distance_m: f64) -> f64 {
    let margin_db =
        model.transmit_dbm - model.path_loss.loss_db(distance_m) - model.sensitivity_dbm;
    let fading = |margin_db: f64| match model.fading.shape(distance_m) {
        None => f64::from(u8::from(margin_db < 0.0)),
        Some(1.0) => rayleigh(libm::pow(10.0, -margin_db / 10.0)),
        Some(m) => nakagami(m, libm::pow(10.0, -margin_db / 10.0)),
    };
    let sigma_db = model.shadowing.map_or(0.0, |shadowing| shadowing.sigma_db);
    if sigma_db == 0.0 {
        return fading(margin_db);
    }
    if model.fading.shape(distance_m).is_none() {
        return log_normal(margin_db, sigma_db);
    }

    // Over shadowing by the midpoint rule, to 8 deviations on both sides.
    const STEPS: u32 = 800;
    let mut sum = 0.0;
    let mut weights = 0.0;
    for step in 0..STEPS {
        let z = (f64::from(step) + 0.5) * (16.0 / f64::from(STEPS)) - 8.0;
        let weight = libm::exp(-0.5 * z * z);
        sum += weight * fading(margin_db - sigma_db * z);
        weights += weight;
    }
    sum / weights
}
