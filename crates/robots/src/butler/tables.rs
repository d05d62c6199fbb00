//! Butler's emotion and behavior, as tables.
//!
//! One tick is: state variables, then emotion (from them), then behavior (from them and the emotion), then the next
//! motion. Guards see the state as it was before the rows of this tick: a need that is raised in a tick is seen by
//! Butler in the next one, as it is by the refiller, who receives what he publishes.

use affect::StandardEmotion::{self, Concerned, Confident, Frustrated, Happy};
use affect::behavior::{
    Row,
    Then::{Go, Stay},
};
use affect::{ProgressEvent, Stimulus};
use serde::{Deserialize, Serialize};

/// Butler's behaviors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum Behavior {
    /// Wanders around and offers treats \[D\].
    Serve,
    /// Drives straight to the refiller \[D\].
    Intercept,
    /// Takes over treats from the refiller \[D\].
    Exchange,
    /// Returns to where he started \[D\].
    GoBack,
}

use Behavior::{Exchange, GoBack, Intercept, Serve};

impl Behavior {
    /// Every behavior.
    pub const ALL: [Self; 4] = [Serve, Intercept, Exchange, GoBack];

    /// The name under which it is published.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Serve => "SERVE",
            Intercept => "INTERCEPT",
            Exchange => "EXCHANGE",
            GoBack => "GO_BACK",
        }
    }
}

/// What a row of the behavior table makes Butler do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// Publishes that he needs the refiller.
    RaiseNeed,
    /// Sends "refill".
    CallRefill,
    /// Sends "hurry".
    CallHurry,
    /// Sends "go home".
    SendHome,
    /// Takes the new treats, and resets the need and the calls.
    Replenish,
    /// Tells a joke.
    Joke,
}

/// What the guard of a row sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Context {
    /// His emotion; `None` if it does not act on behavior.
    pub emotion: Option<StandardEmotion>,
    /// If emotion does not act on behavior: whether the need is as great as the one that would make him CONFIDENT.
    pub is_pressed: bool,
    /// Whether he needs the refiller.
    pub need: bool,
    /// Whether he has called her.
    pub called: bool,
    /// Whether he has asked her to hurry.
    pub hurried: bool,
    /// Whether she is within the exchange radius and ready for an exchange, as far as is known.
    pub refiller_is_ready_here: bool,
    /// Whether she is on her way to him.
    pub refiller_comes: bool,
    /// Whether he intercepts her even at the table.
    pub intercept_any: bool,
    /// Whether an exchange has lasted as long as it takes.
    pub exchange_is_over: bool,
    /// Whether he is back at the start.
    pub is_at_start: bool,
    /// Whether the timer repeats a call.
    pub repeats_call: bool,
    /// Whether the timer repeats "go home".
    pub repeats_go_home: bool,
    /// Whether the time for a joke has come.
    pub has_joke: bool,
}

impl Context {
    fn feels(&self, least: StandardEmotion) -> bool {
        self.emotion.is_some_and(|emotion| emotion.reaches(least))
    }

    /// CONFIDENT or worse; if emotion does not act on behavior, the same measure of progress \[I\].
    fn wants_refill(&self) -> bool {
        self.feels(Confident) || self.is_pressed
    }
}

/// The behaviors in which he can call and meet the refiller.
const AFOOT: &[Behavior] = &[Serve, Intercept, GoBack];

/// The behavior state generator: the waiter's column of the paper's Table 2 and its experiment section as rows.
#[rustfmt::skip]
pub const TABLE: &[Row<Behavior, Context, Act>] = &[
    Row { from: AFOOT, when: |c| c.wants_refill() && !c.need, act: &[Act::RaiseNeed], then: Stay },
    Row { from: AFOOT, when: |c| c.need && c.refiller_is_ready_here, act: &[], then: Go(Exchange) },
    // An emotion that has no CONFIDENT below it (akr4) asks to hurry at once, which calls as well.
    Row { from: AFOOT, when: |c| c.wants_refill() && !c.feels(Concerned) && !c.called, act: &[Act::CallRefill], then: Stay },
    Row { from: AFOOT, when: |c| c.feels(Concerned) && !c.hurried, act: &[Act::CallHurry], then: Stay },
    Row { from: AFOOT, when: |c| c.repeats_call && c.feels(Concerned), act: &[Act::CallHurry], then: Stay },
    Row { from: AFOOT, when: |c| c.repeats_call && !c.feels(Concerned), act: &[Act::CallRefill], then: Stay },
    Row { from: AFOOT, when: |c| c.repeats_go_home, act: &[Act::SendHome], then: Stay },
    Row { from: &[Serve], when: |c| c.feels(Frustrated) && (c.intercept_any || c.refiller_comes), act: &[], then: Go(Intercept) },
    Row { from: &[Serve], when: |c| c.emotion == Some(Happy) && c.has_joke, act: &[Act::Joke], then: Stay },
    // INTERCEPT has no row of its own: he goes on until he meets her, even if he calms down on the way [I].
    Row { from: &[Exchange], when: |c| c.exchange_is_over, act: &[Act::Replenish, Act::SendHome], then: Go(GoBack) },
    Row { from: &[GoBack], when: |c| c.is_at_start, act: &[], then: Go(Serve) },
];

/// The progress measures, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measures {
    /// Estimated rate at which treats are taken, 1/s.
    pub rate_per_s: f64,
    /// Time until the tray is empty, s.
    pub time_to_empty_s: f64,
    /// Time until the refiller can be here, s.
    pub time_to_refill_s: f64,
    /// The ratio of the two: above 1 she comes too late.
    pub need_ratio: f64,
    /// Whether an exchange has just been completed.
    pub exchange_is_over: bool,
}

/// Appraises the measures for the emotion state generator: the need counts, unless an exchange is under way; that one is
/// completed is the most important positive input.
pub fn appraise(measures: &Measures, behavior: &Behavior) -> Stimulus {
    let need = if *behavior == Exchange {
        0.0
    } else {
        measures.need_ratio
    };
    let event = measures
        .exchange_is_over
        .then_some(ProgressEvent::GoalAchieved);
    // He blames the refiller for an empty tray [D: FRUSTRATED at the assistant].
    Stimulus::need(need).with_event(event).with_blame(true)
}
