//! What a robot answers when it is queried: its last two reported states.

use protocol::{Epoch, Tick};

/// A query for a robot's state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct StateQuery {
    /// During which tick the asking robot asks; the answer is the state of the tick before. Without it, the newest state.
    pub tick: Option<Tick>,
    /// In which epoch; without it, the present one.
    pub epoch: Option<Epoch>,
}

/// Why there is no state to answer with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NoState {
    /// It does not exist yet; ask again.
    NotYet,
    /// It is not kept any more.
    Over,
    /// It is neither the tick under way nor one near it.
    OutOfRange,
}

impl std::fmt::Display for NoState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NotYet => "that tick has not been reported yet: ask again",
            Self::Over => "that tick is over",
            Self::OutOfRange => "that tick is out of range",
        })
    }
}

/// The last two states of a robot, newest last. During a tick the other robots must see the state of the tick before,
/// however far this robot already is.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct RecentStates<S> {
    kept: Vec<(Epoch, Tick, S)>,
}

impl<S> Default for RecentStates<S> {
    fn default() -> Self {
        Self { kept: Vec::new() }
    }
}

impl<S: Clone> RecentStates<S> {
    /// Adds the state of a tick; states may arrive in any order. The first one of a tick counts.
    pub fn add(&mut self, epoch: Epoch, tick: Tick, state: S) {
        let newest_epoch = self.kept.last().map_or(epoch, |(newest, _, _)| *newest);
        // A message of an epoch that is over, which has come late.
        if epoch < newest_epoch {
            return;
        }
        // The first state of a new epoch takes the place of all of the one before: their ticks count
        // from 0, too.
        self.kept.retain(|(of_epoch, _, _)| *of_epoch == epoch);
        if self.kept.iter().any(|(_, of_tick, _)| *of_tick == tick) {
            return;
        }

        self.kept.push((epoch, tick, state));
        self.kept.sort_by_key(|(_, of_tick, _)| *of_tick);
        // Two are enough: no tick ends before the robot that asks in it has reported, so no other robot
        // is more than one tick ahead of it.
        if self.kept.len() > 2 {
            self.kept.remove(0);
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.kept.clear();
    }

    /// Answers a query.
    ///
    /// # Errors
    /// [`NoState`] if the state that it asks for is not one of the last two.
    pub fn answer(&self, query: StateQuery) -> Result<S, NoState> {
        let (newest_epoch, newest_tick, newest) = self.kept.last().ok_or(NoState::NotYet)?;
        match query.epoch {
            Some(epoch) if epoch < *newest_epoch => return Err(NoState::Over),
            Some(epoch) if epoch > *newest_epoch => return Err(NoState::NotYet),
            _ => {}
        }

        let Some(tick) = query.tick else {
            return Ok(newest.clone());
        };
        let wanted = tick.checked_sub(1).ok_or(NoState::OutOfRange)?;
        let found = self.kept.iter().find(|(_, of_tick, _)| *of_tick == wanted);
        match (found, wanted.checked_sub(*newest_tick)) {
            (Some((_, _, state)), _) => Ok(state.clone()),
            // The robot is still at the tick whose state is asked for: the query is repeated.
            (None, Some(1)) => Err(NoState::NotYet),
            (None, Some(_)) => Err(NoState::OutOfRange),
            (None, None) => Err(NoState::Over),
        }
    }
}
