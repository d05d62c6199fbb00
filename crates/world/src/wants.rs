//! What guests want beside walking about: a place, a way out, something that a robot brings \[chosen here\].
//!
//! A guest wants one thing after the other, goes to it, stays, and wants the next one. One that has not come to it in time gives it
//! up. What each guest wants, and for how long, follows from one number that it draws at the beginning, so that whatever happens to
//! the others draws nothing from its stream.

use crate::point::Point;
use crate::triangular::Triangular;
use crate::walk::GuestFloor;
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;

/// One of the things that guests want.
#[derive(Clone, Debug, PartialEq)]
pub struct Want {
    /// What it is.
    pub goal: WantTarget,
    /// How often it is wanted, in proportion to the others; above 0.
    pub weight: f64,
    /// How near a guest goes to it, m.
    pub within_m: f64,
    /// For how long a guest stays there, s; outside, for an exit. Who has no reason to leave an exit again does not come back.
    pub stay_s: Option<Triangular>,
    /// After so many ticks on its way a guest gives it up.
    pub give_up: u64,
}

/// What a guest wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WantTarget {
    /// To be at a place, m.
    Place(Point),
    /// To leave the field at a place, m.
    Exit(Point),
    /// Something that a robot gives it, by index: it goes where the robot is until [`crate::World::satisfy`].
    Robot(usize),
}

/// What a guest does in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum GuestStep {
    /// It goes to a place.
    Go(Point),
    /// It stands.
    Stand,
    /// It leaves the field.
    Leave,
    /// It comes back to the field at a place.
    Return(Point),
    /// It is not on the field.
    Away,
}

/// What all guests want.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wants {
    wants: Vec<Want>,
    tick_s: f64,
    guests: Vec<Wanting>,
}

/// What one guest wants.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wanting {
    /// All that it wants follows from this number.
    key: u64,
    /// How many things it has wanted.
    count: u64,
    /// Index of the want.
    want: usize,
    /// It gives up, or has stayed, after so many ticks.
    ticks_left: u64,
    progress: WantProgress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WantProgress {
    Going,
    Staying,
    Outside,
}

impl Wants {
    /// What so many guests want first; `None` if there is nothing to want.
    pub(crate) fn new(
        wants: Vec<Want>,
        guests: usize,
        tick_s: f64,
        rng: &mut dyn Rng,
    ) -> Option<Self> {
        if wants.is_empty() {
            return None;
        }
        let nothing = Wanting {
            key: 0,
            count: 0,
            want: 0,
            ticks_left: 0,
            progress: WantProgress::Going,
        };
        let mut all = Self {
            wants,
            tick_s,
            guests: vec![nothing; guests],
        };
        all.rekey(rng);
        for guest in 0..guests {
            all.want_next(guest);
        }
        Some(all)
    }

    /// Has each guest draw what it wants after what it wants now.
    pub(crate) fn rekey(&mut self, rng: &mut dyn Rng) {
        for guest in &mut self.guests {
            guest.key = rng.next_u64();
        }
    }

    pub(crate) fn has_exits(&self) -> bool {
        let mut wants = self.wants.iter();
        wants.any(|want| matches!(want.goal, WantTarget::Exit(_)))
    }

    /// A guest has got something from a robot: if it wanted that, it wants something else.
    pub(crate) fn satisfy(&mut self, guest: usize, robot: usize) {
        if self.wants[self.guests[guest].want].goal == WantTarget::Robot(robot) {
            self.want_next(guest);
        }
    }

    /// What a guest does in this tick.
    pub(crate) fn step(&mut self, guest: usize, floor: &GuestFloor<'_>) -> GuestStep {
        let wanting = &mut self.guests[guest];
        let want = &self.wants[wanting.want];
        let is_over = wanting.ticks_left == 0;
        wanting.ticks_left = wanting.ticks_left.saturating_sub(1);

        match (wanting.progress, want.goal) {
            (WantProgress::Outside, WantTarget::Exit(at)) if is_over => GuestStep::Return(at),
            (WantProgress::Outside, _) => GuestStep::Away,
            (WantProgress::Staying, _) if !is_over => GuestStep::Stand,
            (WantProgress::Staying, _) => self.next_step(guest, floor),
            (WantProgress::Going, goal) => {
                let at = goal.place(floor);
                let is_there = floor.guest(guest).distance_m(at) <= want.within_m;
                match goal {
                    WantTarget::Exit(_) if is_there => self.go_outside(guest),
                    WantTarget::Place(_) if is_there => self.stay(guest),
                    _ if is_over => self.next_step(guest, floor),
                    WantTarget::Robot(_) if is_there => GuestStep::Stand,
                    _ => GuestStep::Go(at),
                }
            }
        }
    }

    /// A guest is on the field again.
    pub(crate) fn has_returned(&mut self, guest: usize) {
        self.want_next(guest);
    }

    fn next_step(&mut self, guest: usize, floor: &GuestFloor<'_>) -> GuestStep {
        self.want_next(guest);
        GuestStep::Go(self.wants[self.guests[guest].want].goal.place(floor))
    }

    fn go_outside(&mut self, guest: usize) -> GuestStep {
        self.guests[guest].ticks_left = self.draw_stay(guest).unwrap_or(u64::MAX);
        self.guests[guest].progress = WantProgress::Outside;
        GuestStep::Leave
    }

    fn stay(&mut self, guest: usize) -> GuestStep {
        self.guests[guest].ticks_left = self.draw_stay(guest).unwrap_or(0);
        self.guests[guest].progress = WantProgress::Staying;
        GuestStep::Stand
    }

    fn want_next(&mut self, guest: usize) {
        self.guests[guest].count += 1;
        let total: f64 = self.wants.iter().map(|want| want.weight).sum();
        let mut rest = self.draws(guest).random::<f64>() * total;
        let mut chosen = self.wants.len() - 1;
        for (index, want) in self.wants.iter().enumerate() {
            rest -= want.weight;
            if rest < 0.0 {
                chosen = index;
                break;
            }
        }

        let wanting = &mut self.guests[guest];
        wanting.want = chosen;
        wanting.ticks_left = self.wants[chosen].give_up;
        wanting.progress = WantProgress::Going;
    }

    /// For how many ticks a guest stays, from a draw of its own.
    fn draw_stay(&self, guest: usize) -> Option<u64> {
        let stay_s = self.wants[self.guests[guest].want].stay_s?;
        let mut draws = self.draws(guest);
        // The first number of the stream has chosen the want.
        let _chosen = draws.next_u64();
        Some((stay_s.sample(&mut draws) / self.tick_s).round() as u64)
    }

    /// The stream of the thing that a guest wants.
    fn draws(&self, guest: usize) -> SplitMix64 {
        let Wanting { key, count, .. } = self.guests[guest];
        // The state of SplitMix64 counts up, so numbers side by side would give streams that overlap: a multiplier of Steele and
        // Vigna (2021) spreads them.
        SplitMix64::seed_from_u64(key ^ count.wrapping_mul(0xd134_2543_de82_ef95))
    }
}

impl WantTarget {
    fn place(self, floor: &GuestFloor<'_>) -> Point {
        match self {
            Self::Place(at) | Self::Exit(at) => at,
            Self::Robot(robot) => floor.robots()[robot],
        }
    }
}
