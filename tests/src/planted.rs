//! Robots with defects that hunts must find: a copy of Leguin, and two that need two rare events.

use protocol::random::unit;
use robot::{Action, BadParameters, Cars, Panel, Robot, StateVariables, Tick};
use robots::Leguin;

/// Leguin, who stands still for ever after she has received a command twice in a tick for the second time.
#[derive(Clone, Default)]
struct Planted {
    leguin: Leguin,
    /// Number of ticks in which a command came twice.
    doubled: u32,
    last: Action,
}

/// Robots as those that ship with the project, but for Leguin, who has the defect, and those of the other defects.
#[must_use]
pub fn make(class: &str) -> Option<Box<dyn Robot>> {
    match class {
        "Leguin" => Some(Box::new(Planted::default())),
        "Gambler" => Some(Box::new(Gambler::default())),
        "Teller" => Some(Box::new(Teller)),
        "Hearer" => Some(Box::new(Hearer::default())),
        other => robots::make(other),
    }
}

impl Robot for Planted {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.leguin.init(cars)
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let mut pairs = cars.commands().windows(2);
        if pairs.any(|pair| pair[0] == pair[1]) {
            self.doubled += 1;
        }
        if self.doubled >= 2 {
            return Action {
                proposal: cars.location(),
                speed_mps: 0.0,
                ..self.last.clone()
            };
        }

        self.last = self.leguin.tick(cars);
        self.last.clone()
    }

    fn resume(&mut self, cars: &mut Cars<'_>, last: &StateVariables) {
        self.leguin.resume(cars, last);
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }

    fn reseed(&mut self, cars: &mut Cars<'_>) {
        self.leguin.reseed(cars);
    }

    fn senses_bodies(&self) -> bool {
        self.leguin.senses_bodies()
    }

    fn panel(&self) -> Panel {
        self.leguin.panel()
    }
}

/// The ticks of the two draws of a gambler that count.
const DRAWS: [Tick; 2] = [40, 80];
/// Probability of each of the two draws of a gambler.
const RARE: f64 = 1.0 / 300.0;

/// Breaks if two draws, in two certain ticks, are both rare. The first one is seen in a variable only.
#[derive(Clone, Default)]
struct Gambler {
    was_lucky: bool,
    is_broken: bool,
}

impl Robot for Gambler {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let is_rare = unit(cars.random()) < RARE;
        self.was_lucky |= cars.tick() == DRAWS[0] && is_rare;
        self.is_broken |= cars.tick() == DRAWS[1] && self.was_lucky && is_rare;
        let behavior = if self.is_broken { "BROKEN" } else { "WORK" };
        Action::stay(cars)
            .emotion("CALM")
            .behavior(behavior)
            .variable("was_lucky", self.was_lucky)
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

/// Number of the commands of a teller, one in each tick.
const TOLD: Tick = 600;
/// Those of them that a hearer does not bear to miss both.
const BOTH: [Tick; 2] = [200, 400];

/// Broadcasts a command in each tick.
#[derive(Clone)]
struct Teller;

impl Robot for Teller {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        if (1..=TOLD).contains(&cars.tick()) {
            cars.broadcast("news", None);
        }
        Action::stay(cars).emotion("CALM").behavior("WORK")
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}

/// Breaks if two certain commands are both lost. The first loss is seen in a variable only.
#[derive(Clone, Default)]
struct Hearer {
    has_missed: bool,
    is_broken: bool,
}

impl Robot for Hearer {
    fn init(&mut self, _: &mut Cars<'_>) -> Result<(), BadParameters> {
        *self = Self::default();
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        let misses = cars.commands().is_empty();
        self.has_missed |= misses && cars.tick() == BOTH[0] + 1;
        self.is_broken |= misses && cars.tick() == BOTH[1] + 1 && self.has_missed;
        let behavior = if self.is_broken { "BROKEN" } else { "WORK" };
        Action::stay(cars)
            .emotion("CALM")
            .behavior(behavior)
            .variable("has_missed", self.has_missed)
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }
}
