//! Draws of distributions from numbers that are uniform from 0 up to but not including 1.

use std::f64::consts::TAU;

/// A standard normal number (Box and Muller 1958).
pub(crate) fn normal(one: f64, other: f64) -> f64 {
    (-2.0 * libm::log(1.0 - one)).sqrt() * libm::cos(TAU * other)
}

/// An exponential number with mean 1, by inversion.
pub(crate) fn exponential(one: f64) -> f64 {
    -libm::log(1.0 - one)
}

/// A number of the gamma distribution with this shape and scale 1 (Marsaglia and Tsang 2000). How many numbers it draws varies.
pub(crate) fn gamma(shape: f64, unit: &mut impl FnMut() -> f64) -> f64 {
    // Their method needs a shape of at least 1: a smaller one is reached by a power of a uniform number.
    if shape < 1.0 {
        let boost = libm::pow(1.0 - unit(), 1.0 / shape);
        return gamma(shape + 1.0, unit) * boost;
    }

    let d = shape - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let x = normal(unit(), unit());
        let root = 1.0 + c * x;
        if root <= 0.0 {
            continue;
        }
        let v = root * root * root;
        let accepts = libm::log(1.0 - unit()) < 0.5 * x * x + d * (1.0 - v + libm::log(v));
        if accepts {
            return d * v;
        }
    }
}

/// The next number of `SplitMix64` (Steele, Lea and Flood 2014) after this state, spread over all 64 bits.
pub(crate) fn mix(state: u64) -> u64 {
    let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The upper 53 bits of a number over 2^53.
pub(crate) fn unit_of(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}
