//! Angles as they are published.

/// Half a turn, rounded to 1e-6 rad: a little more than π.
const HALF_TURN_RAD: f64 = 3_141_593.0 / 1e6;

/// Rounds an angle to 1e-6 rad, so that languages whose arc tangents differ in the last bit publish the same number.
///
/// Of an angle from -π to π, as an arc tangent is, it makes one that is greater than -π, and at most π as this is rounded.
#[must_use]
pub fn published_angle(angle_rad: f64) -> f64 {
    let rounded = (angle_rad * 1e6 + 0.5).floor() / 1e6;
    // Rounded, what is next to -π is below it. It is the same direction as π, and has one number only: an arc tangent gives
    // either of both for half a turn, by the sign of a zero.
    if rounded == -HALF_TURN_RAD {
        return HALF_TURN_RAD;
    }
    // Minus zero is another text than zero.
    if rounded == 0.0 { 0.0 } else { rounded }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn angles_are_greater_than_minus_half_a_turn() {
        for (angle_rad, published_microrad) in [
            (-PI, 3_141_593.0),
            ((-PI).next_up(), 3_141_593.0),
            (-PI + 0.1e-6, 3_141_593.0),
            (-PI + 0.4e-6, -3_141_592.0),
            (-PI + 0.6e-6, -3_141_592.0),
            (-PI + 1.2e-6, -3_141_591.0),
            (PI, 3_141_593.0),
            (PI.next_down(), 3_141_593.0),
            (PI - 0.1e-6, 3_141_593.0),
            (PI - 0.4e-6, 3_141_592.0),
        ] {
            let published = published_microrad / 1e6;
            assert_eq!(published_angle(angle_rad), published, "{angle_rad:?}");
            assert_eq!(published_angle(published), published, "again");
        }
    }

    #[test]
    fn zero_has_no_sign() {
        for angle_rad in [0.0, -0.0, 0.4e-6, -0.4e-6] {
            assert!(
                published_angle(angle_rad).is_sign_positive(),
                "{angle_rad:?}"
            );
            assert_eq!(published_angle(angle_rad), 0.0);
        }
    }
}
