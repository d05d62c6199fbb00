//! Shadowing: losses by what stands around, which depend on the two places and last while nothing moves.

use crate::draw::{mix, normal, unit_of};

/// Log-normal shadowing that is correlated in space.
///
/// Its values are those of a random field over both places of a pair, so in four dimensions. The field has an independent normal
/// number at each corner of a grid of squares with the side `distance_m`; between the corners it is the sum of the 16 corners
/// around, weighted linearly in each coordinate, over the root of the sum of the squared weights. So its distribution is normal with
/// deviation `sigma_db` at every place. A robot that moves by a fraction f of a square, from a corner along a side, keeps a
/// correlation of (1 - f) / sqrt((1 - f)² + f²); values of places that are two squares or more apart are independent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shadowing {
    /// Standard deviation, dB.
    pub sigma_db: f64,
    /// Side of the squares, meters: the distance after which most of the correlation is lost.
    pub distance_m: f64,
}

impl Shadowing {
    /// The loss between two places, each x and y in meters, dB. `key` is drawn for the pair; the places are in an order that does
    /// not depend on who sends, so that both directions have the same loss.
    #[must_use]
    pub fn loss_db(&self, key: u64, places_m: [[f64; 2]; 2]) -> f64 {
        let [[one_x, one_y], [other_x, other_y]] = places_m;
        let coordinates = [one_x, one_y, other_x, other_y].map(|at_m| at_m / self.distance_m);
        let corner = coordinates.map(f64::floor);

        let mut sum = 0.0;
        let mut squares = 0.0;
        for index in 0..16_u32 {
            let mut weight = 1.0;
            let mut bits = key;
            for axis in 0..4 {
                let is_far = index >> axis & 1 == 1;
                let fraction = coordinates[axis] - corner[axis];
                weight *= if is_far { fraction } else { 1.0 - fraction };
                // Fields are finite, so their corners are small whole numbers.
                let at = corner[axis] as i64 + i64::from(is_far);
                bits = mix(bits ^ at.cast_unsigned());
            }
            if weight > 0.0 {
                sum += weight * normal(unit_of(bits), unit_of(mix(bits)));
                squares += weight * weight;
            }
        }
        self.sigma_db * sum / squares.sqrt()
    }
}
