//! Guests who walk as recorded people did \[chosen here\].
//!
//! A recorded person does not see the robots of a run, so there is one rule for what the record does not know: a person who
//! would walk into a robot, an obstacle, a wall or the edge waits where it stands, and then goes straight to where the record has
//! it, at most at [`Recorded::catch_up_mps`], until it is there. Recorded people do not hinder each other: they walked like that.

use std::num::NonZeroU64;
use std::sync::Arc;

use crate::point::Point;
use crate::walk::{GuestFloor, GuestWalker};
use rand::Rng;

/// Where a person was at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackPoint {
    /// When, microseconds of the record: whole numbers, so that rounding decides nothing at the ends of a track.
    pub at_us: u64,
    /// Where, m.
    pub at: Point,
}

/// Where one person was, from the first point to the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track(Vec<TrackPoint>);

impl Track {
    /// The track through these points; `None` unless their times rise and all places are finite.
    #[must_use]
    pub fn new(points: Vec<TrackPoint>) -> Option<Self> {
        let rise = points.windows(2).all(|pair| pair[0].at_us < pair[1].at_us);
        let is_finite = points.iter().all(|point| point.at.is_finite());
        (rise && is_finite && !points.is_empty()).then_some(Self(points))
    }

    /// The points, in the order of time.
    #[must_use]
    pub fn points(&self) -> &[TrackPoint] {
        &self.0
    }

    /// Where the person was at a time, on a straight line between two points; `None` before the first and after the last one.
    #[must_use]
    pub fn at(&self, time_us: u64) -> Option<Point> {
        let after = self.0.partition_point(|point| point.at_us < time_us);
        let next = self.0.get(after)?;
        if next.at_us == time_us {
            return Some(next.at);
        }

        let last = self.0.get(after.checked_sub(1)?)?;
        let part = (time_us - last.at_us) as f64 / (next.at_us - last.at_us) as f64;
        Some(last.at + (next.at - last.at) * part)
    }
}

/// Recorded people, and how a run plays them.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Where each person was.
    pub tracks: Arc<Vec<Track>>,
    /// Time of the record at tick 0, microseconds; drawn if there is none, which needs a period.
    pub start_us: Option<u64>,
    /// The record begins again after so many microseconds; it is played once without it.
    pub period_us: Option<NonZeroU64>,
    /// How fast a person goes back to where the record has it, m/s.
    pub catch_up_mps: f64,
}

impl Recorded {
    /// How often the record has begun again, and its time then, microseconds.
    fn time_us(&self, tick: u64, tick_s: f64) -> (u64, u64) {
        let since_start_us = (tick as f64 * tick_s * 1e6).round() as u64;
        let time_us = self.start_us.unwrap_or(0).saturating_add(since_start_us);
        match self.period_us {
            Some(period_us) => (time_us / period_us, time_us % period_us),
            None => (0, time_us),
        }
    }
}

/// The recorded people of a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RecordedWalk {
    recorded: Recorded,
    tick: u64,
    round: u64,
    /// People that are not where the record has them, and go there.
    strayed: Vec<bool>,
}

impl RecordedWalk {
    pub(crate) fn new(recorded: Recorded) -> Self {
        let strayed = vec![false; recorded.tracks.len()];
        Self {
            recorded,
            tick: 0,
            round: 0,
            strayed,
        }
    }

    /// Moves a person that is on the field towards where the record has it. Returns whether it is there.
    fn move_on(&self, person: usize, recorded: Point, floor: &mut GuestFloor<'_>) -> bool {
        let most_m = self.recorded.catch_up_mps * floor.tick_s();
        let here = floor.guest(person);

        let to = if let Some(direction) = floor.direction(person) {
            here + direction * most_m
        } else if self.strayed[person] {
            toward(here, recorded, most_m)
        } else {
            recorded
        };
        if !floor.go(person, to) {
            floor.hold();
            return false;
        }
        to == recorded
    }

    /// Has every person be where the record has it at a tick, as far as nothing hinders it.
    fn follow(&mut self, floor: &mut GuestFloor<'_>) {
        let (round, time_us) = self.recorded.time_us(self.tick, floor.tick_s());
        let begins_again = round != self.round;
        self.round = round;

        let tracks = self.recorded.tracks.clone();
        for (person, track) in tracks.iter().enumerate() {
            // Nobody walks from the end of the record to its beginning.
            if begins_again && floor.is_present(person) {
                floor.leave(person);
            }

            let recorded = track.at(time_us).filter(|at| floor.field().contains(*at));
            match recorded {
                Some(at) if floor.is_present(person) => {
                    self.strayed[person] = !self.move_on(person, at, floor);
                }
                Some(at) => {
                    self.strayed[person] = false;
                    if !floor.enter(person, at) {
                        floor.hold();
                    }
                }
                None if floor.is_present(person) => floor.leave(person),
                None => {}
            }
        }
    }
}

impl GuestWalker for RecordedWalk {
    fn begin(&mut self, floor: &mut GuestFloor<'_>, rng: &mut dyn Rng) {
        if self.recorded.start_us.is_none() {
            let period_us = self.recorded.period_us.unwrap_or(NonZeroU64::MIN);
            self.recorded.start_us = Some(rng.next_u64() % period_us);
        }
        self.follow(floor);
    }

    fn advance(&mut self, floor: &mut GuestFloor<'_>, _rng: &mut dyn Rng) {
        self.tick += 1;
        self.follow(floor);
    }
}

/// The place on the straight line to another one that is at most so far.
fn toward(from: Point, to: Point, most_m: f64) -> Point {
    let distance_m = from.distance_m(to);
    if distance_m <= most_m {
        to
    } else {
        from + (to - from) * (most_m / distance_m)
    }
}
