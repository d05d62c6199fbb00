//! Angles as they are published.

/// Rounds an angle to 1e-6 rad, so that languages whose arc tangents differ in the last bit publish the same number.
#[must_use]
pub fn published_angle(angle_rad: f64) -> f64 {
    let rounded = (angle_rad * 1e6 + 0.5).floor() / 1e6;
    // Minus zero is another text than zero.
    if rounded == 0.0 { 0.0 } else { rounded }
}
