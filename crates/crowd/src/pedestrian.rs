//! One person of a crowd.

use crate::vector::Vector;

/// Largest radius of a body, m.
pub(crate) const RADIUS_MAX_M: f64 = 0.9;

/// A person of a crowd.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pedestrian {
    /// Where the person is, m.
    pub position: Vector,
    /// Velocity of the last step, m/s: what was walked, which a wall may have shortened.
    pub velocity: Vector,
    /// Radius of the body, m.
    pub radius_m: f64,
    /// Speed where nothing is in the way, m/s.
    pub desired_mps: f64,
    /// When the person begins to walk, s: their reaction time.
    pub starts_s: f64,
    /// Number of the person, which [`crate::Pedestrians::add`] gives: from 0 on.
    pub id: u32,
    /// The way of the person: what [`crate::Pedestrians::add_itinerary`] returned.
    pub itinerary: u16,
    /// Number of waypoints that the person has reached.
    pub reached: u16,
}

impl Pedestrian {
    /// A person who stands at a place: radius 0.18 m, desired speed 1.34 m/s (Weidmann 1993, cited from memory \[I\]), the first itinerary,
    /// no reaction time.
    #[must_use]
    pub const fn at(position: Vector) -> Self {
        Self {
            position,
            velocity: Vector::ZERO,
            radius_m: 0.18,
            desired_mps: 1.34,
            starts_s: 0.0,
            id: 0,
            itinerary: 0,
            reached: 0,
        }
    }

    pub(crate) fn is_valid(&self) -> bool {
        self.position.is_finite()
            && self.velocity.is_finite()
            && self.radius_m > 0.0
            && self.radius_m <= RADIUS_MAX_M
            && (0.0..=10.0).contains(&self.desired_mps)
            && !self.starts_s.is_nan()
    }
}
