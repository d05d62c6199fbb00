//! A crowd and its step.

use std::error::Error;
use std::fmt;
use std::sync::Mutex;

use crate::cells::{Cells, Lookup};
use crate::itinerary::{AtEnd, Itinerary, Waypoint};
use crate::model::{NearWall, Neighbor, Surroundings, WalkingModel};
use crate::pedestrian::{Pedestrian, RADIUS_MAX_M};
use crate::premises::{Disc, Premises, WallLine, permitted};
use crate::vector::Vector;

/// Most people of a crowd.
const PEOPLE_MAX: usize = 10_000_000;
/// Most itineraries, walls, columns and robots.
const PARTS_MAX: usize = 60_000;
/// Most people of one piece of work, and fewest: few enough to share evenly, and enough for a thread to be worth it.
const PIECE_MAX: usize = 2_048;
const PIECE_MIN: usize = 64;
/// People and columns that one person takes notice of at most, in the order of cells. \[I\]
const NEIGHBORS_MAX: usize = 256;
/// The cell of those who have left.
const LEFT: u32 = u32::MAX;
/// Place of people who have left.
const NOWHERE: u32 = u32::MAX;
/// Distance from each other that people at exactly the same place see, m.
const SAME_PLACE_M: f64 = 1e-6;
/// Walls are seen at least this far, m, so that the path of a step is inside; a step is at most this long less the radius.
const WALL_REACH_M: f64 = 1.0;
/// Why a crowd cannot be as asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrowdError {
    /// A coordinate is not a number, or a length is not above 0.
    NotFinite,
    /// More people, itineraries, walls or bodies than there may be.
    TooMany,
    /// The radius, desired speed or place of a person is out of its range.
    WrongPerson,
    /// There is no such itinerary.
    NoItinerary,
}

impl fmt::Display for CrowdError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => write!(
                f,
                "a coordinate or a length of the premises is not a number"
            ),
            Self::TooMany => write!(
                f,
                "more than {PEOPLE_MAX} people, or more than {PARTS_MAX} itineraries, walls or bodies"
            ),
            Self::WrongPerson => write!(
                f,
                "a person needs a place, a radius up to {RADIUS_MAX_M} m and a desired speed from 0 to 10 m/s"
            ),
            Self::NoItinerary => write!(f, "there is no such itinerary: add it first"),
        }
    }
}

impl Error for CrowdError {}

/// A crowd on its premises, who walk as a model decides.
#[derive(Clone, Debug)]
pub struct Pedestrians<M> {
    model: M,
    walls: Vec<WallLine>,
    /// Columns first, then robots.
    discs: Vec<Disc>,
    columns: usize,
    period_m: Option<f64>,
    cells: Cells,
    walls_of: Lookup,
    discs_of: Lookup,
    itineraries: Vec<Itinerary>,
    /// Sorted by cell and number at the beginning of each step.
    people: Vec<Pedestrian>,
    /// The cell of each of them, [`LEFT`] of those who left in the last step.
    cell_of: Vec<u32>,
    /// The buffer that a step writes.
    next: Vec<Pedestrian>,
    /// Where each of `people` is during a step: what is searched for neighbors lies close together.
    places: Vec<Vector>,
    /// First index of each cell in `people` during a step.
    begin: Vec<u32>,
    /// Buffers of each thread.
    buffers: Vec<StepBuffers>,
    /// Index in `people` by number.
    index_of: Vec<u32>,
    /// Lowest and highest coordinates that were added.
    bounds: (Vector, Vector),
    now_s: f64,
    present: usize,
    through_walls: u64,
}

impl<M: WalkingModel> Pedestrians<M> {
    /// An empty crowd.
    ///
    /// # Errors
    /// If premises have coordinates that are not numbers, or too many parts.
    pub fn new(model: M, premises: &Premises) -> Result<Self, CrowdError> {
        let are_walls_finite = premises
            .walls
            .iter()
            .all(|wall| wall.from.is_finite() && wall.to.is_finite());
        let is_period_positive = premises
            .period_m
            .is_none_or(|period_m| period_m.is_finite() && period_m > 0.0);
        if !are_walls_finite || !are_finite(&premises.columns) || !is_period_positive {
            return Err(CrowdError::NotFinite);
        }
        if premises.walls.len() > PARTS_MAX || premises.columns.len() > PARTS_MAX {
            return Err(CrowdError::TooMany);
        }

        let mut crowd = Self {
            walls: premises.walls.clone(),
            discs: premises.columns.clone(),
            columns: premises.columns.len(),
            period_m: premises.period_m,
            cells: Cells::covering(
                Vector::ZERO,
                Vector::ZERO,
                model.reach_m(),
                premises.period_m,
            ),
            model,
            walls_of: Lookup::default(),
            discs_of: Lookup::default(),
            itineraries: Vec::new(),
            people: Vec::new(),
            cell_of: Vec::new(),
            next: Vec::new(),
            places: Vec::new(),
            begin: Vec::new(),
            buffers: Vec::new(),
            index_of: Vec::new(),
            bounds: bounds_of(premises),
            now_s: 0.0,
            present: 0,
            through_walls: 0,
        };
        crowd.lay_cells();
        Ok(crowd)
    }

    /// Adds a way that people may take; returns its number.
    ///
    /// # Errors
    /// If it has coordinates that are not numbers, or there are too many.
    pub fn add_itinerary(&mut self, itinerary: Itinerary) -> Result<u16, CrowdError> {
        if !itinerary.waypoints.iter().all(Waypoint::is_finite) {
            return Err(CrowdError::NotFinite);
        }
        if self.itineraries.len() >= PARTS_MAX || itinerary.waypoints.len() >= PARTS_MAX {
            return Err(CrowdError::TooMany);
        }
        self.itineraries.push(itinerary);
        Ok((self.itineraries.len() - 1) as u16)
    }

    /// Adds a person; returns their number.
    ///
    /// # Errors
    /// If the person is none that can be, or there are too many.
    pub fn add(&mut self, person: Pedestrian) -> Result<u32, CrowdError> {
        if !person.is_valid() {
            return Err(CrowdError::WrongPerson);
        }
        if usize::from(person.itinerary) >= self.itineraries.len() {
            return Err(CrowdError::NoItinerary);
        }
        if self.index_of.len() >= PEOPLE_MAX {
            return Err(CrowdError::TooMany);
        }

        let id = self.index_of.len() as u32;
        let position = self.wrapped(person.position);
        self.index_of.push(self.people.len() as u32);
        self.people.push(Pedestrian {
            position,
            id,
            ..person
        });
        self.cell_of.push(self.cells.of(position) as u32);
        self.present += 1;
        let (low, high) = &mut self.bounds;
        let is_inside = position.x >= low.x
            && position.y >= low.y
            && position.x <= high.x
            && position.y <= high.y;
        if !is_inside {
            // Grows by parts of its size, so that cells are laid few times.
            let margin = (*high - *low) * 0.5 + Vector::new(10.0, 10.0);
            *low = Vector::new(
                low.x.min(position.x - margin.x),
                low.y.min(position.y - margin.y),
            );
            *high = Vector::new(
                high.x.max(position.x + margin.x),
                high.y.max(position.y + margin.y),
            );
            self.lay_cells();
        }
        Ok(id)
    }

    /// Changes a person: what they want, how fast, where they are. The number stays. Returns whether there is such a person.
    ///
    /// # Errors
    /// If the person is then none that can be; nothing is changed.
    pub fn change(
        &mut self,
        id: u32,
        change: impl FnOnce(&mut Pedestrian),
    ) -> Result<bool, CrowdError> {
        let Some(index) = self.index(id) else {
            return Ok(false);
        };
        let mut person = self.people[index];
        change(&mut person);
        if !person.is_valid() {
            return Err(CrowdError::WrongPerson);
        }
        if usize::from(person.itinerary) >= self.itineraries.len() {
            return Err(CrowdError::NoItinerary);
        }

        person.id = id;
        person.position = self.wrapped(person.position);
        self.people[index] = person;
        self.cell_of[index] = self.cells.of(person.position) as u32;
        Ok(true)
    }

    /// Removes a person. Returns whether there was such a person.
    pub fn remove(&mut self, id: u32) -> bool {
        let Some(index) = self.index(id) else {
            return false;
        };
        self.cell_of[index] = LEFT;
        self.present -= 1;
        true
    }

    /// Places robots for the next steps, instead of those before.
    ///
    /// # Errors
    /// If one has coordinates that are not numbers, or there are too many.
    pub fn set_robots(&mut self, robots: &[Disc]) -> Result<(), CrowdError> {
        if !are_finite(robots) {
            return Err(CrowdError::NotFinite);
        }
        if robots.len() > PARTS_MAX {
            return Err(CrowdError::TooMany);
        }
        self.discs.truncate(self.columns);
        self.discs.extend_from_slice(robots);
        self.discs_of = Lookup::of_discs(&self.cells, &self.discs, self.disc_reach_m());
        Ok(())
    }

    /// A person who is there, by number.
    #[must_use]
    pub fn get(&self, id: u32) -> Option<&Pedestrian> {
        self.index(id).map(|index| &self.people[index])
    }

    /// All who are there, in no order that means anything.
    pub fn iter(&self) -> impl Iterator<Item = &Pedestrian> {
        let people = self.people.iter().zip(&self.cell_of);
        people
            .filter(|(_, cell)| **cell != LEFT)
            .map(|(person, _)| person)
    }

    /// Number of those who are there.
    #[must_use]
    pub fn len(&self) -> usize {
        self.present
    }

    /// Whether no pedestrian is there.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.present == 0
    }

    /// Simulated time, s.
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// How many steps through a wall the model proposed. None of them was taken.
    #[must_use]
    pub fn through_walls(&self) -> u64 {
        self.through_walls
    }

    /// Whether a person has reached all waypoints.
    #[must_use]
    pub fn has_arrived(&self, id: u32) -> bool {
        self.get(id).is_none_or(|person| {
            let itinerary = &self.itineraries[usize::from(person.itinerary)];
            usize::from(person.reached) >= itinerary.waypoints.len()
        })
    }

    /// Advances by a span, in equal steps for which the model is stable. The state does not depend on `threads`.
    pub fn advance(&mut self, span_s: f64, threads: usize) {
        let steps = (span_s / self.model.longest_step_s() - 1e-9)
            .ceil()
            .max(1.0);
        let step_s = span_s / steps;
        for _ in 0..steps as u64 {
            self.step(step_s, threads);
        }
    }

    /// Advances by one step. The state does not depend on `threads`.
    pub fn step(&mut self, step_s: f64, threads: usize) {
        self.sort();

        let frozen = Frozen {
            model: &self.model,
            walls: &self.walls,
            discs: &self.discs,
            period_m: self.period_m,
            cells: &self.cells,
            walls_of: &self.walls_of,
            discs_of: &self.discs_of,
            itineraries: &self.itineraries,
            people: &self.people,
            places: &self.places,
            begin: &self.begin,
            now_s: self.now_s,
            step_s,
            wall_reach_m: wall_reach_m(&self.model),
        };
        // Four pieces for each thread, so that none waits long for another one.
        let piece = (self.people.len() / (4 * threads.max(1))).clamp(PIECE_MIN, PIECE_MAX);
        let pieces = self
            .people
            .chunks(piece)
            .zip(self.next.chunks_mut(piece))
            .zip(self.cell_of.chunks_mut(piece));
        let threads = threads.clamp(1, pieces.len().max(1));
        let pieces = Mutex::new(pieces);
        let work = |scratch: &mut StepBuffers| {
            let mut counts = StepCounts::default();
            loop {
                // The lock is poisoned only if another thread has panicked, which ends the step anyway.
                let piece = match pieces.lock() {
                    Ok(mut pieces) => pieces.next(),
                    Err(_) => None,
                };
                let Some(((people, next), cells)) = piece else {
                    return counts;
                };
                for ((person, next), cell) in people.iter().zip(next).zip(cells) {
                    frozen.walk(person, next, cell, scratch, &mut counts);
                }
            }
        };
        if self.buffers.len() < threads {
            self.buffers.resize_with(threads, StepBuffers::default);
        }
        let (own, others) = self.buffers.split_at_mut(1);
        let counts = std::thread::scope(|scope| {
            let mut running = Vec::new();
            for scratch in &mut others[..threads - 1] {
                running.push(scope.spawn(|| work(scratch)));
            }
            let mut counts = work(&mut own[0]);
            for thread in running {
                match thread.join() {
                    Ok(more) => counts.add(more),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            counts
        });

        std::mem::swap(&mut self.people, &mut self.next);
        self.present -= counts.left;
        self.through_walls += counts.through_walls as u64;
        self.now_s += step_s;
    }

    /// Sorts people by cell, and within a cell by number, so that sums do not depend on the steps before; drops those who left.
    fn sort(&mut self) {
        self.begin.clear();
        self.begin.resize(self.cells.count() + 1, 0);
        for cell in &self.cell_of {
            if *cell != LEFT {
                self.begin[*cell as usize] += 1;
            }
        }
        let mut sum = 0;
        for begin in &mut self.begin {
            let count = *begin;
            *begin = sum;
            sum += count;
        }

        // `begin` moves to the end of each cell, and back below.
        self.next.resize(self.present, Pedestrian::at(Vector::ZERO));
        for (person, cell) in self.people.iter().zip(&self.cell_of) {
            if *cell == LEFT {
                self.index_of[person.id as usize] = NOWHERE;
                continue;
            }
            let place = &mut self.begin[*cell as usize];
            self.next[*place as usize] = *person;
            *place += 1;
        }
        self.begin.rotate_right(1);
        self.begin[0] = 0;
        for cell in 0..self.cells.count() {
            let begin = self.begin[cell] as usize;
            let end = self.begin[cell + 1] as usize;
            let here = &mut self.next[begin..end];
            if !here.is_sorted_by_key(|person| person.id) {
                here.sort_unstable_by_key(|person| person.id);
            }
        }
        self.places.clear();
        for (index, person) in self.next.iter().enumerate() {
            self.index_of[person.id as usize] = index as u32;
            self.places.push(person.position);
        }

        std::mem::swap(&mut self.people, &mut self.next);
        self.next.resize(self.present, Pedestrian::at(Vector::ZERO));
        self.cell_of.resize(self.present, 0);
    }

    /// Lays cells over all that there is.
    fn lay_cells(&mut self) {
        let (low, high) = self.bounds;
        let reach_m = self.model.reach_m();
        self.cells = Cells::covering(low, high, reach_m, self.period_m);
        self.walls_of = Lookup::of_walls(&self.cells, &self.walls, wall_reach_m(&self.model));
        self.discs_of = Lookup::of_discs(&self.cells, &self.discs, self.disc_reach_m());
        for (cell, person) in self.cell_of.iter_mut().zip(&self.people) {
            if *cell != LEFT {
                *cell = self.cells.of(person.position) as u32;
            }
        }
    }

    fn disc_reach_m(&self) -> f64 {
        self.model.reach_m().max(WALL_REACH_M)
    }

    fn index(&self, id: u32) -> Option<usize> {
        let index = *self.index_of.get(id as usize)? as usize;
        let is_there = self.cell_of.get(index).is_some_and(|cell| *cell != LEFT);
        is_there.then_some(index)
    }

    fn wrapped(&self, place: Vector) -> Vector {
        match self.period_m {
            Some(period_m) => Vector::new(wrapped(place.x, period_m), place.y),
            None => place,
        }
    }
}

/// How far walls are seen, m.
fn wall_reach_m(model: &impl WalkingModel) -> f64 {
    model.reach_m().max(WALL_REACH_M)
}

/// A coordinate of a world that repeats itself, m.
fn wrapped(x: f64, period_m: f64) -> f64 {
    let rest = x - (x / period_m).floor() * period_m;
    // What is just below 0 rounds to the period.
    if rest >= period_m { 0.0 } else { rest }
}

fn are_finite(discs: &[Disc]) -> bool {
    discs.iter().all(|disc| {
        disc.center.is_finite()
            && disc.velocity.is_finite()
            && disc.radius_m.is_finite()
            && disc.radius_m > 0.0
    })
}

/// The rectangle of all walls and columns.
fn bounds_of(premises: &Premises) -> (Vector, Vector) {
    let mut places = Vec::new();
    for wall in &premises.walls {
        places.extend([wall.from, wall.to]);
    }
    for column in &premises.columns {
        places.push(column.center);
    }
    let Some(first) = places.first().copied() else {
        return (Vector::ZERO, Vector::ZERO);
    };
    let mut bounds = (first, first);
    for place in places {
        bounds.0 = Vector::new(bounds.0.x.min(place.x), bounds.0.y.min(place.y));
        bounds.1 = Vector::new(bounds.1.x.max(place.x), bounds.1.y.max(place.y));
    }
    bounds
}

/// What happened in a step.
#[derive(Clone, Copy, Debug, Default)]
struct StepCounts {
    left: usize,
    through_walls: usize,
}

impl StepCounts {
    fn add(&mut self, other: Self) {
        self.left += other.left;
        self.through_walls += other.through_walls;
    }
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
struct StepBuffers {
    /// Indices of people within reach.
    near: Vec<u32>,
    others: Vec<Neighbor>,
    walls: Vec<NearWall>,
    lines: Vec<WallLine>,
    discs: Vec<Disc>,
}

/// The state before a step, which all threads read.
struct Frozen<'a, M> {
    model: &'a M,
    walls: &'a [WallLine],
    discs: &'a [Disc],
    period_m: Option<f64>,
    cells: &'a Cells,
    walls_of: &'a Lookup,
    discs_of: &'a Lookup,
    itineraries: &'a [Itinerary],
    people: &'a [Pedestrian],
    places: &'a [Vector],
    begin: &'a [u32],
    now_s: f64,
    step_s: f64,
    wall_reach_m: f64,
}

impl<M: WalkingModel> Frozen<'_, M> {
    /// One person's step.
    fn walk(
        &self,
        person: &Pedestrian,
        next: &mut Pedestrian,
        next_cell: &mut u32,
        scratch: &mut StepBuffers,
        counts: &mut StepCounts,
    ) {
        let cell = self.cells.of(person.position);
        self.see_walls(person, cell, scratch);
        self.see_others(person, cell, scratch);

        let itinerary = &self.itineraries[usize::from(person.itinerary)];
        let waypoint = itinerary.waypoints.get(usize::from(person.reached));
        let is_walking = waypoint.is_some() && self.now_s >= person.starts_s;
        let toward = waypoint.map_or(Vector::ZERO, |waypoint| {
            waypoint.direction(person.position, person.radius_m)
        });
        let velocity = self.model.velocity(&Surroundings {
            person,
            toward,
            desired_mps: if is_walking { person.desired_mps } else { 0.0 },
            others: &scratch.others,
            walls: &scratch.walls,
            step_s: self.step_s,
        });

        let longest_m = self.wall_reach_m - person.radius_m;
        let step = (velocity * self.step_s).at_most(longest_m);
        let step = if step.is_finite() { step } else { Vector::ZERO };
        let mut position = person.position + step;
        *next = *person;
        next.velocity = step * (1.0 / self.step_s);
        if !scratch.lines.is_empty() || !scratch.discs.is_empty() {
            let (place, is_through_wall) = permitted(
                person.position,
                position,
                person.radius_m,
                scratch.lines.iter(),
                scratch.discs.iter(),
            );
            counts.through_walls += usize::from(is_through_wall);
            if place != position {
                next.velocity = (place - person.position) * (1.0 / self.step_s);
                position = place;
            }
        }

        if waypoint.is_some_and(|waypoint| waypoint.is_reached(person.position, position)) {
            next.reached += 1;
        }
        if let Some(period_m) = self.period_m {
            position.x = wrapped(position.x, period_m);
        }
        next.position = position;
        let is_at_end = usize::from(next.reached) >= itinerary.waypoints.len();
        *next_cell = if is_at_end && itinerary.at_end == AtEnd::Leave {
            counts.left += 1;
            LEFT
        } else {
            self.cells.of(position) as u32
        };
    }

    fn see_walls(&self, person: &Pedestrian, cell: usize, scratch: &mut StepBuffers) {
        scratch.walls.clear();
        scratch.lines.clear();
        for index in self.walls_of.at(cell) {
            let line = self.walls[*index as usize];
            let offset = line.closest_to(person.position) - person.position;
            let distance_m = offset.length();
            if distance_m <= self.wall_reach_m {
                scratch.walls.push(NearWall { offset, distance_m });
                scratch.lines.push(line);
            }
        }
    }

    fn see_others(&self, person: &Pedestrian, cell: usize, scratch: &mut StepBuffers) {
        scratch.others.clear();
        scratch.discs.clear();
        let mut near = std::mem::take(&mut scratch.near);
        self.find_near(person.position, cell, &mut near);
        for index in &near {
            let other = &self.people[*index as usize];
            if other.id == person.id {
                continue;
            }
            let offset = self.offset(person.position, other.position);
            self.see(
                person,
                Neighbor {
                    offset,
                    distance_m: offset.length(),
                    radius_m: other.radius_m,
                    velocity: other.velocity,
                },
                other.id,
                scratch,
            );
        }
        scratch.near = near;

        for index in self.discs_of.at(cell) {
            let disc = self.discs[*index as usize];
            let offset = disc.center - person.position;
            let distance_m = offset.length();
            if distance_m - disc.radius_m <= self.wall_reach_m {
                scratch.discs.push(disc);
                self.see(
                    person,
                    Neighbor {
                        offset,
                        distance_m,
                        radius_m: disc.radius_m,
                        velocity: disc.velocity,
                    },
                    u32::MAX,
                    scratch,
                );
            }
        }
    }

    /// Lists the indices of people within reach, the person included.
    ///
    /// Two of three who are looked at are too far, in no order that a processor could guess, so every index is written, and the next one over
    /// it where it is too far.
    fn find_near(&self, from: Vector, cell: usize, near: &mut Vec<u32>) {
        let reach_m = self.model.reach_m();
        let reach_squared = reach_m * reach_m;
        let mut count = 0;
        for (begin, end) in self.cells.around(cell, self.begin) {
            let places = &self.places[begin..end];
            if near.len() < count + places.len() {
                near.resize(count + places.len(), 0);
            }
            for (index, place) in places.iter().enumerate() {
                near[count] = (begin + index) as u32;
                count += usize::from(self.offset(from, *place).length_squared() <= reach_squared);
            }
        }
        near.truncate(count);
    }

    /// Takes notice of another body unless a wall hides it.
    fn see(&self, person: &Pedestrian, mut other: Neighbor, id: u32, scratch: &mut StepBuffers) {
        if scratch.others.len() >= NEIGHBORS_MAX {
            return;
        }
        let at = person.position;
        for (wall, line) in scratch.walls.iter().zip(&scratch.lines) {
            if wall.distance_m < other.distance_m && line.is_met(at, at + other.offset) {
                return;
            }
        }
        if other.distance_m < SAME_PLACE_M {
            // Each of two at the same place sees the other one on another side.
            let side = if id > person.id { 1.0 } else { -1.0 };
            other.offset = Vector::new(side * SAME_PLACE_M, 0.0);
            other.distance_m = SAME_PLACE_M;
        }
        scratch.others.push(other);
    }

    /// The displacement from one place to another, on the shorter way around.
    fn offset(&self, from: Vector, to: Vector) -> Vector {
        let mut offset = to - from;
        if let Some(period_m) = self.period_m {
            if offset.x > period_m / 2.0 {
                offset.x -= period_m;
            } else if offset.x < -period_m / 2.0 {
                offset.x += period_m;
            }
        }
        offset
    }
}
