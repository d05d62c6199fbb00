//! Butler's emotion and behavior, as tables.
//!
//! One tick is: state variables, then emotion (from them), then behavior (from them and the emotion), then the next
//! motion. Guards see the state as it was before the rows of this tick: a need that is raised in a tick is seen by
//! Butler in the next one, as it is by the refiller, who receives what he publishes.

use affect::behavior::{
    Row,
    Then::{Go, Stay},
};
use affect::{Belief, ProgressEvent, StepInput, Stimulus};
use serde::{Deserialize, Serialize};

use crate::policy::Urge;

/// Butler's behaviors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum ButlerBehavior {
    /// Wanders around and offers treats \[D\].
    Serve,
    /// Drives straight to the refiller \[D\].
    Intercept,
    /// Takes over treats from the refiller \[D\].
    Exchange,
    /// Returns to where he started \[D\].
    GoBack,
}

use ButlerBehavior::{Exchange, GoBack, Intercept, Serve};

impl ButlerBehavior {
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
pub enum ButlerAct {
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
    /// Counts an INTERCEPT that came to nothing, and leaves the refiller alone for a while.
    GiveUp,
    /// Tells a joke.
    Joke,
}

/// What the guard of a row sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ButlerContext {
    /// How far he goes to be refilled.
    pub urge: Urge,
    /// Whether he is HAPPY.
    pub is_happy: bool,
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
    /// Whether she has something else to do first: to go home.
    pub refiller_is_busy: bool,
    /// Whether he intercepts her even at the table.
    pub intercept_any: bool,
    /// Whether he has intercepted for a while and comes no nearer.
    pub is_stuck: bool,
    /// Whether he gave up not long ago.
    pub rests: bool,
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

impl ButlerContext {
    /// Whether there is a point in driving to the refiller.
    pub(super) fn may_intercept(&self) -> bool {
        !self.refiller_is_busy && !self.rests && (self.intercept_any || self.refiller_comes)
    }
}

/// The behaviors in which he can call and meet the refiller.
const AFOOT: &[ButlerBehavior] = &[Serve, Intercept, GoBack];

/// The behavior state generator: the waiter's column of the paper's Table 2 and its experiment section as rows.
#[rustfmt::skip]
pub const TABLE: &[Row<ButlerBehavior, ButlerContext, ButlerAct>] = &[
    Row { from: AFOOT, when: |c| c.urge >= Urge::Call && !c.need, act: &[ButlerAct::RaiseNeed], then: Stay },
    Row { from: AFOOT, when: |c| c.need && c.refiller_is_ready_here, act: &[], then: Go(Exchange) },
    // "hurry" calls as well: an emotion that has no CONFIDENT below it (akr4) begins with it.
    Row { from: AFOOT, when: |c| c.urge == Urge::Call && !c.called, act: &[ButlerAct::CallRefill], then: Stay },
    Row { from: AFOOT, when: |c| c.urge >= Urge::Hurry && !c.hurried, act: &[ButlerAct::CallHurry], then: Stay },
    Row { from: AFOOT, when: |c| c.repeats_call && c.urge >= Urge::Hurry, act: &[ButlerAct::CallHurry], then: Stay },
    Row { from: AFOOT, when: |c| c.repeats_call && c.urge < Urge::Hurry, act: &[ButlerAct::CallRefill], then: Stay },
    Row { from: AFOOT, when: |c| c.repeats_go_home, act: &[ButlerAct::SendHome], then: Stay },
    Row { from: &[Serve], when: |c| c.urge >= Urge::Intercept && c.may_intercept(), act: &[], then: Go(Intercept) },
    Row { from: &[Serve], when: |c| c.is_happy && c.has_joke, act: &[ButlerAct::Joke], then: Stay },
    // He serves again when what made him leave has ended [D], when she has to go home first, or when he comes no nearer [I].
    Row { from: &[Intercept], when: |c| c.urge < Urge::Intercept || c.refiller_is_busy, act: &[], then: Go(Serve) },
    Row { from: &[Intercept], when: |c| c.is_stuck, act: &[ButlerAct::GiveUp], then: Go(Serve) },
    Row { from: &[Exchange], when: |c| c.exchange_is_over, act: &[ButlerAct::Replenish, ButlerAct::SendHome], then: Go(GoBack) },
    Row { from: &[GoBack], when: |c| c.is_at_start, act: &[], then: Go(Serve) },
];

/// The progress measures, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ButlerMeasures {
    /// Estimated rate at which treats are taken, 1/s.
    pub rate_per_s: f64,
    /// Time until the tray is empty, s.
    pub time_to_empty_s: f64,
    /// Time until the refiller can be here, s; not less than the time for which she has come no nearer.
    pub time_to_refill_s: f64,
    /// The ratio of the two: above 1 she comes too late.
    pub need_ratio: f64,
    /// Whether an exchange has just been completed.
    pub exchange_is_over: bool,
    /// What else happened: the input of his emotion besides the need.
    pub event: Option<ProgressEvent>,
    /// What he believes of himself; `None` if he does not deliberate.
    pub belief: Option<Belief>,
}

/// Appraises the measures for the emotion state generator. While an exchange is under way what he feels stays: nothing is
/// achieved yet. That it is completed is the most important positive input, which leads from FRUSTRATED to HAPPY \[D\].
pub fn appraise(measures: &ButlerMeasures, behavior: &ButlerBehavior) -> Stimulus {
    let drive = if *behavior == Exchange {
        StepInput::Hold
    } else {
        StepInput::Need(measures.need_ratio)
    };

    // He blames the refiller for an empty tray [D: FRUSTRATED at the assistant].
    let stimulus = Stimulus::new(drive)
        .with_event(measures.event)
        .with_blame(true);
    Stimulus {
        belief: measures.belief,
        ..stimulus
    }
}
