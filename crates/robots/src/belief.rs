//! What a robot believes of itself: "I cannot do this" after it has failed too often, and "I can" when something encourages it.
//!
//! Both beliefs and the emotions that they lead to are documented \[D\]: DISCOURAGED for as long as the robot believes that it
//! cannot, HOPEFUL as soon as it believes that it can. What makes a robot believe is chosen here \[I\].

use affect::Belief;
use robot::StateVariables;
use serde::{Deserialize, Serialize};

use crate::published::text;
use crate::switch::Switch;

/// Beliefs, as they are published.
const CAN: &str = "can";
const CANNOT: &str = "cannot";
/// The state variables with the belief, and with what led to it.
const BELIEF: &str = "belief";
const BECAUSE: &str = "belief_because";

/// Whether a robot has beliefs about itself, and how soon it despairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BeliefParameters {
    /// Whether it has beliefs about itself. With `off` it is neither DISCOURAGED nor HOPEFUL. Default off \[I\].
    pub beliefs: Switch,
    /// How often in a row it gives up before it believes that it cannot. Default 2 \[I\].
    pub discouraged_after: u32,
}

impl Default for BeliefParameters {
    fn default() -> Self {
        Self {
            beliefs: Switch::Off,
            discouraged_after: 2,
        }
    }
}

impl BeliefParameters {
    /// # Errors
    /// It would despair before it has tried.
    pub(crate) fn check(self) -> Result<(), String> {
        if self.discouraged_after == 0 {
            return Err("deliberation.discouraged_after must be at least 1".to_owned());
        }
        Ok(())
    }
}

/// What the other robot does that encourages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encouragement {
    /// It is within sensing range.
    IsNear,
    /// It is on its way here.
    Comes,
}

impl Encouragement {
    /// What encourages of the two, the nearer one first.
    pub(crate) fn of(is_near: bool, comes: bool) -> Option<Self> {
        if is_near {
            Some(Self::IsNear)
        } else {
            comes.then_some(Self::Comes)
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::IsNear => "is near",
            Self::Comes => "comes",
        }
    }
}

/// What a robot believes, and why.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Beliefs {
    belief: Belief,
    because: String,
    /// How often in a row it gave up.
    given_up: u32,
    /// Whether something encouraged it in the last tick.
    was_encouraged: bool,
}

impl Beliefs {
    /// It gave up once more.
    pub(crate) fn give_up(&mut self) {
        self.given_up = self.given_up.saturating_add(1);
    }

    /// It achieved its goal. Returns whether that gave it back its confidence.
    pub(crate) fn succeed(&mut self) -> bool {
        self.given_up = 0;
        self.belief == Belief::Cannot && self.turn(Belief::Can, "an exchange".to_owned())
    }

    /// Whether it believes that it cannot achieve its goal.
    pub(crate) fn are_of_failure(&self) -> bool {
        self.belief == Belief::Cannot
    }

    /// How often in a row it gave up.
    pub(crate) fn given_up(&self) -> u32 {
        self.given_up
    }

    /// Updates what it believes. `attempt` is the name of what it gave up, and `encouragement` what the `other` robot does
    /// that encourages it in this tick. Returns whether that gave it back its confidence.
    ///
    /// Only a change encourages: one who did not succeed although the other was near is not encouraged by that.
    pub(crate) fn update(
        &mut self,
        parameters: BeliefParameters,
        attempt: &str,
        other: &str,
        encouragement: Option<Encouragement>,
    ) -> bool {
        if !parameters.beliefs.is_on() {
            return false;
        }

        let news = encouragement.filter(|_| !self.was_encouraged);
        self.was_encouraged = encouragement.is_some();
        match (self.belief, news) {
            (Belief::Cannot, Some(news)) => {
                self.given_up = 0;
                self.turn(Belief::Can, format!("{other} {}", news.words()))
            }
            (Belief::Can | Belief::Unstated, _)
                if self.given_up >= parameters.discouraged_after =>
            {
                let plural = if self.given_up == 1 { "" } else { "s" };
                let because = format!("{} {attempt}{plural} given up", self.given_up);
                self.turn(Belief::Cannot, because);
                false
            }
            _ => false,
        }
    }

    /// The belief for the dynamics; `None` for a robot without beliefs.
    pub(crate) fn stated(&self, parameters: BeliefParameters) -> Option<Belief> {
        parameters.beliefs.is_on().then_some(self.belief)
    }

    /// Publishes the belief and what led to it; nothing before one has been formed.
    pub(crate) fn publish(&self, variables: &mut StateVariables) {
        let belief = match self.belief {
            Belief::Unstated => return,
            Belief::Can => CAN,
            Belief::Cannot => CANNOT,
        };
        variables.insert(BELIEF, belief.into());
        variables.insert(BECAUSE, self.because.as_str().into());
    }

    /// Continues with what a lost incarnation published. What encourages must be news to this one, too.
    pub(crate) fn take_over(&mut self, last: &StateVariables, parameters: BeliefParameters) {
        self.was_encouraged = true;
        if !parameters.beliefs.is_on() {
            return;
        }
        self.because = text(last, BECAUSE).unwrap_or_default().to_owned();
        self.belief = match text(last, BELIEF) {
            Some(CAN) => Belief::Can,
            Some(CANNOT) => Belief::Cannot,
            _ => Belief::Unstated,
        };
    }

    fn turn(&mut self, belief: Belief, because: String) -> bool {
        self.belief = belief;
        self.because = because;
        true
    }
}
