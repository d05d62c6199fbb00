//! What cases are built of: a run's people, the places where they stand at first, and flows.

use crate::draws::Draws;
use crate::itinerary::Itinerary;
use crate::model::WalkingModel;
use crate::pedestrian::Pedestrian;
use crate::pedestrians::Pedestrians;
use crate::premises::{Premises, WallLine};
use crate::vector::Vector;

/// Mean of desired speeds, m/s. Weidmann 1993, cited from memory \[I\].
const DESIRED_MPS: f64 = 1.34;
/// Their standard deviation, m/s. Weidmann 1993, cited from memory \[I\].
const DESIRED_DEVIATION_MPS: f64 = 0.26;

/// The chance of one run: who takes part, and where they stand.
#[derive(Debug)]
pub(crate) struct RunChance {
    /// Draws desired speeds. Runs of the same population have the same people.
    pub(crate) people: Draws,
    /// Draws where they stand.
    pub(crate) places: Draws,
}

impl RunChance {
    pub(crate) fn new(seed: u64, run: usize, populations: usize) -> Self {
        let population = (run % populations) as u64;
        // Seeds of both differ in their upper bits, whatever the seed of the check.
        Self {
            people: Draws::new(seed ^ (1 << 40) ^ population),
            places: Draws::new(seed ^ (1 << 41) ^ run as u64),
        }
    }

    /// The next person of the population, at a place, on a way.
    pub(crate) fn person(&mut self, place: Vector, radius_m: f64, way: u16) -> Pedestrian {
        Pedestrian {
            radius_m,
            desired_mps: self.people.normal(DESIRED_MPS, DESIRED_DEVIATION_MPS),
            itinerary: way,
            ..Pedestrian::at(place)
        }
    }

    /// Places in a rectangle, at random on a lattice that has room for all of them.
    pub(crate) fn places(
        &mut self,
        low: Vector,
        high: Vector,
        count: usize,
        radius_m: f64,
    ) -> Vec<Vector> {
        let low = low + Vector::new(radius_m, radius_m);
        let high = high - Vector::new(radius_m, radius_m);
        self.lattice(low, high, count)
    }

    /// Places of a corridor that repeats itself.
    pub(crate) fn ring_places(
        &mut self,
        length_m: f64,
        breadth_m: f64,
        count: usize,
        radius_m: f64,
    ) -> Vec<Vector> {
        let low = Vector::new(0.0, radius_m);
        let high = Vector::new(length_m, breadth_m - radius_m);
        self.lattice(low, high, count)
    }

    fn lattice(&mut self, low: Vector, high: Vector, count: usize) -> Vec<Vector> {
        let size = high - low;
        let spacing_m = (size.x * size.y / count.max(1) as f64).sqrt();
        // People stand on the edge of the rectangle, too.
        let rows = ((size.y / spacing_m).round() as usize + 1).max(1);
        let columns = count.div_ceil(rows).max(1);
        let step_x_m = size.x / columns as f64;
        let step_y_m = if rows > 1 {
            size.y / (rows - 1) as f64
        } else {
            0.0
        };

        let mut places = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                let shift = if row % 2 == 0 { 0.25 } else { 0.75 };
                places.push(Vector::new(
                    low.x + (column as f64 + shift) * step_x_m,
                    low.y + row as f64 * step_y_m,
                ));
            }
        }
        self.places.shuffle(&mut places);
        places.truncate(count);
        places
    }
}

/// A crowd for a case, whose parts are known to be valid.
pub(crate) fn crowd<M: WalkingModel + Clone>(model: &M, premises: &Premises) -> Pedestrians<M> {
    match Pedestrians::new(model.clone(), premises) {
        Ok(crowd) => crowd,
        Err(error) => unreachable!("premises of a case are valid: {error}"),
    }
}

/// Adds a way of a case; returns its number.
pub(crate) fn add_way<M: WalkingModel>(crowd: &mut Pedestrians<M>, itinerary: Itinerary) -> u16 {
    match crowd.add_itinerary(itinerary) {
        Ok(number) => number,
        Err(error) => unreachable!("ways of a case are valid: {error}"),
    }
}

/// Adds a person of a case; returns their number.
pub(crate) fn add<M: WalkingModel>(crowd: &mut Pedestrians<M>, person: Pedestrian) -> u32 {
    match crowd.add(person) {
        Ok(number) => number,
        Err(error) => unreachable!("people of a case are valid: {error}"),
    }
}

/// Walls through a list of corners.
pub(crate) fn walls(corners: &[(f64, f64)]) -> Vec<WallLine> {
    let mut walls = Vec::new();
    for pair in corners.windows(2) {
        walls.push(line(pair[0], pair[1]));
    }
    walls
}

/// The line between two places.
pub(crate) fn line(from: (f64, f64), to: (f64, f64)) -> WallLine {
    WallLine::new(Vector::new(from.0, from.1), Vector::new(to.0, to.1))
}

/// Flow over a line from the times of those who crossed it, 1/s: the first one begins it.
pub(crate) fn flow_per_s(times_s: &[f64]) -> f64 {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else {
        return 0.0;
    };
    if last > first {
        (times_s.len() - 1) as f64 / (last - first)
    } else {
        0.0
    }
}
