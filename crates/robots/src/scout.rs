//! A robot that covers a field with others, and knows of them only what radios carry.
//!
//! Robots push each other apart like charges, and so do the edges of the field (Howard, Matarić and Sukhatme 2002). A robot that is
//! to keep neighbors is drawn to the nearest ones when they near the end of its radio's range (Poduri and Sukhatme 2004).
//!
//! The robot has no emotion. `sdk/python/examples/scout.py` is the same in Python, to the last bit.

use std::collections::BTreeMap;

use robot::{Action, BadParameters, Cars, Payload, Point, Robot, RobotName};
use serde::Deserialize;

/// Name of the commands with places.
const PLACE: &str = "place";
/// Share of the radio's range from which on a neighbor that is to be kept attracts the robot \[I\].
const ATTRACTS_FROM: f64 = 0.6;
/// Strength of that attraction at the end of the radio's range: twice the greatest repulsion \[I\].
const ATTRACTION: f64 = 2.0;
/// Force below which a robot stays where it is \[I\].
const MIN_FORCE: f64 = 0.05;
/// Distance below which two places count as one, meters \[I\].
const MIN_DISTANCE_M: f64 = 1e-6;

/// The parameters of a scout, as in the scenario.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ScoutParameters {
    /// Highest speed, m/s.
    speed: f64,
    /// Radius of the disc that it covers, meters.
    covers: f64,
    /// Range of its radio, meters.
    radio: f64,
    /// Number of neighbors that it keeps within the range of its radio.
    keeps: usize,
    /// Time between two messages, seconds.
    period: f64,
    /// Time after which a place that it has received counts no more, seconds.
    forgets_after: f64,
}

impl Default for ScoutParameters {
    fn default() -> Self {
        Self {
            speed: 0.5,
            covers: 2.5,
            radio: 5.0,
            keeps: 0,
            period: 1.0,
            forgets_after: 2.5,
        }
    }
}

/// A robot that covers a field.
#[derive(Debug, Clone, Default)]
pub struct Scout {
    parameters: ScoutParameters,
    /// Where others were when they were heard last, with that time, seconds.
    heard: BTreeMap<RobotName, (f64, Point)>,
    /// When it sends next, seconds.
    sends_s: f64,
}

impl Robot for Scout {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self {
            parameters: cars.parameters()?,
            ..Self::default()
        };
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.receive(cars);
        self.send(cars);

        let here = cars.location();
        let mut neighbors: Vec<Point> = self.heard.values().map(|(_, place)| *place).collect();
        neighbors.sort_by(|one, other| here.distance_m(*one).total_cmp(&here.distance_m(*other)));
        let force = self
            .parameters
            .force(here, &neighbors, cars.welcome().field_m);

        let strength = force.distance_m(Point::default()).min(1.0);
        let action = if strength < MIN_FORCE {
            Action::stay(cars).behavior("REST")
        } else {
            let goal = Point::new(here.x + force.x, here.y + force.y);
            Action::go(cars, goal, self.parameters.speed * strength).behavior("SPREAD")
        };
        action.variable("neighbors", neighbors.len() as f64)
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }

    fn is_quick(&self) -> bool {
        true
    }
}

impl Scout {
    /// Notes where others are, and forgets what is old.
    fn receive(&mut self, cars: &Cars<'_>) {
        let now_s = cars.time_s();
        for command in cars.commands() {
            let Some(payload) = command.payload.as_ref().filter(|_| command.text == PLACE) else {
                continue;
            };
            // An operator may send anything.
            let Ok(place) = payload.read() else {
                continue;
            };
            self.heard.insert(command.from.clone(), (now_s, place));
        }
        let oldest_s = now_s - self.parameters.forgets_after;
        self.heard.retain(|_, (heard_s, _)| *heard_s >= oldest_s);
    }

    /// Sends its place to all others, once a period.
    fn send(&mut self, cars: &mut Cars<'_>) {
        if cars.time_s() < self.sends_s {
            return;
        }
        self.sends_s = cars.time_s() + self.parameters.period;
        // A place always is JSON.
        let place = Payload::of(&cars.location()).unwrap_or_default();
        cars.broadcast(PLACE, place);
    }
}

impl ScoutParameters {
    /// The force on a robot, of which 1 stands for its highest speed. `neighbors` are sorted, the nearest one first.
    fn force(&self, here: Point, neighbors: &[Point], field_m: [f64; 2]) -> Point {
        let mut force = Point::default();
        let mut push = |x: f64, y: f64, strength: f64| {
            force = Point::new(force.x + x * strength, force.y + y * strength);
        };

        let apart_m = 2.0 * self.covers;
        let attracts_from_m = ATTRACTS_FROM * self.radio;
        for (rank, neighbor) in neighbors.iter().enumerate() {
            let distance_m = here.distance_m(*neighbor).max(MIN_DISTANCE_M);
            let x = (here.x - neighbor.x) / distance_m;
            let y = (here.y - neighbor.y) / distance_m;
            if distance_m < apart_m {
                push(x, y, (apart_m - distance_m) / apart_m);
            }
            if rank < self.keeps && distance_m > attracts_from_m {
                let excess = (distance_m - attracts_from_m) / (self.radio - attracts_from_m);
                push(x, y, -ATTRACTION * excess);
            }
        }

        // An edge pushes like a neighbor on its other side.
        let [width_m, height_m] = field_m;
        for (distance_m, x, y) in [
            (here.x, 1.0, 0.0),
            (width_m - here.x, -1.0, 0.0),
            (here.y, 0.0, 1.0),
            (height_m - here.y, 0.0, -1.0),
        ] {
            if distance_m < self.covers {
                push(x, y, (self.covers - distance_m) / self.covers);
            }
        }
        force
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(keeps: usize) -> ScoutParameters {
        ScoutParameters {
            covers: 2.0,
            radio: 10.0,
            keeps,
            ..ScoutParameters::default()
        }
    }

    #[test]
    fn a_neighbor_pushes_less_the_farther_it_is() {
        let here = Point::new(10.0, 10.0);
        for (x, expected) in [(9.0, 0.75), (12.0, -0.5), (14.0, 0.0)] {
            let force = parameters(0).force(here, &[Point::new(x, 10.0)], [20.0, 20.0]);
            assert_eq!(force, Point::new(expected, 0.0), "{x}");
        }
    }

    #[test]
    fn a_neighbor_that_is_kept_attracts_before_it_is_out_of_range() {
        let here = Point::new(10.0, 10.0);
        for (x, keeps, expected) in [(18.0, 0, 0.0), (16.0, 1, 0.0), (18.0, 1, 1.0)] {
            let force = parameters(keeps).force(here, &[Point::new(x, 10.0)], [40.0, 40.0]);
            assert_eq!(force, Point::new(expected, 0.0), "{x} {keeps}");
        }
    }

    #[test]
    fn edges_push_into_the_field() {
        let force = parameters(0).force(Point::new(1.0, 19.5), &[], [20.0, 20.0]);
        assert_eq!(force, Point::new(0.5, -0.75));
    }
}
