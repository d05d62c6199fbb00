//! All robots in one process, without a network: for sweeps, tests and debugging. Same seats, same order of facts.

use std::collections::BTreeMap;
use std::sync::Arc;

use protocol::messages::{Clock, Command, CommandId, Percept, PublicState, Report, Welcome};
use protocol::{Epoch, RobotName, Tick};

use crate::cri::{Robot, RobotError};
use crate::held::Held;
use crate::seat::{Network, Seat, Undelivered};

/// Senses for a robot: the environment is not this crate's to know.
pub type Sense<'a> = dyn FnMut(&RobotName) -> Percept + 'a;

/// The robots of a run, all here.
pub struct LocalHost {
    seats: Vec<Seat>,
    known: Known,
}

/// What the robots of a local host can learn of one another.
#[derive(Default)]
struct Known {
    /// As reported for the last complete tick.
    states: BTreeMap<RobotName, Arc<PublicState>>,
    /// Commands under way, by target.
    commands: BTreeMap<RobotName, Held>,
}

struct LocalNetwork<'a, 'b> {
    known: &'a mut Known,
    sense: &'a mut Sense<'b>,
}

impl Network for LocalNetwork<'_, '_> {
    fn state_of(
        &mut self,
        target: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<Arc<PublicState>, Undelivered> {
        let state = self
            .known
            .states
            .get(target)
            .filter(|state| (state.epoch, state.tick) == (epoch, tick));
        state.cloned().ok_or(Undelivered::Lost)
    }

    fn percept(
        &mut self,
        robot: &RobotName,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<Percept, Undelivered> {
        Ok(Percept {
            epoch,
            tick,
            ..(self.sense)(robot)
        })
    }

    fn send(&mut self, from: &RobotName, to: &RobotName, command: &Command) {
        self.known
            .commands
            .entry(to.clone())
            .or_default()
            .hold(from.clone(), command.clone());
    }

    fn receive(&mut self, to: &RobotName, epoch: Epoch, id: &CommandId) -> Option<Command> {
        self.known.commands.get_mut(to)?.take(id, epoch)
    }
}

impl LocalHost {
    /// Seats robots with their welcomes; they act in the order given, which changes nothing.
    #[must_use]
    pub fn new(robots: Vec<(Box<dyn Robot>, Welcome)>) -> Self {
        let seats = robots
            .into_iter()
            .map(|(robot, welcome)| Seat::new(robot, welcome))
            .collect();
        Self {
            seats,
            known: Known::default(),
        }
    }

    /// A command from outside the roster.
    pub fn inject(&mut self, to: &RobotName, from: &RobotName, command: Command) {
        self.known
            .commands
            .entry(to.clone())
            .or_default()
            .hold(from.clone(), command);
    }

    /// Runs one tick of every robot. Everybody sees the others as they reported themselves for the tick before.
    ///
    /// # Errors
    /// [`RobotError`] if a robot refuses its parameters, or gives up.
    pub fn exchange(
        &mut self,
        clock: &Clock,
        sense: &mut Sense<'_>,
    ) -> Result<BTreeMap<RobotName, Report>, RobotError> {
        let (mut reports, mut states) = (BTreeMap::new(), BTreeMap::new());
        for seat in &mut self.seats {
            let mut network = LocalNetwork {
                known: &mut self.known,
                sense,
            };
            let (report, state) = match clock.tick {
                0 => seat.init(clock, &mut network)?,
                _ => seat.tick(clock, &mut network)?,
            };
            let name = seat.welcome().name.clone();
            reports.insert(name.clone(), report);
            states.insert(name, Arc::new(state));
        }
        self.known.states = states;
        Ok(reports)
    }
}
