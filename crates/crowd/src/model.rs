//! What a model of walking sees, and what it decides.

use crate::pedestrian::Pedestrian;
use crate::vector::Vector;

/// Another body: a person, a column or a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// From the person to the middle of the other body, m.
    pub offset: Vector,
    /// Length of `offset`, m; more than 0.
    pub distance_m: f64,
    /// Radius of the other body, m.
    pub radius_m: f64,
    /// Velocity of the other body, m/s.
    pub velocity: Vector,
}

/// A wall nearby.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearWall {
    /// From the person to the closest place of the wall, m.
    pub offset: Vector,
    /// Length of `offset`, m.
    pub distance_m: f64,
}

/// What a person sees at the beginning of a step.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// The person.
    pub person: &'a Pedestrian,
    /// Direction to where the person wants to go, of length 1; zero where they want to stand.
    pub toward: Vector,
    /// How fast the person wants to walk now, m/s: 0 before the end of their reaction time and at the end of their way.
    pub desired_mps: f64,
    /// Bodies within the reach of the model that no wall hides, in an order that depends on the state only.
    pub others: &'a [Neighbor],
    /// Walls within the reach of the model.
    pub walls: &'a [NearWall],
    /// Length of the step, s.
    pub step_s: f64,
}

/// A model of walking: the velocity of one person in the next step.
///
/// A model cannot lead a person through a wall, because [`crate::Pedestrians`] holds all of them at walls, but
/// [`crate::Pedestrians::through_walls`] counts how often it wanted to.
pub trait WalkingModel: Sync {
    /// How far people see others and walls, m.
    fn reach_m(&self) -> f64;

    /// Longest step for which the model is stable, s.
    fn longest_step_s(&self) -> f64;

    /// Radius of the bodies for which the model's parameters were chosen, m.
    fn body_radius_m(&self) -> f64;

    /// Velocity of a person in the next step, m/s.
    fn velocity(&self, seen: &Surroundings<'_>) -> Vector;
}
