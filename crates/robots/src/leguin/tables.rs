//! Leguin's emotion and behavior: how she appraises her measures, and her behavior as a table.
//!
//! One tick is: state variables, then emotion (from them), then behavior (from them and the emotion), then the next
//! motion. So "hurry" on the way acts on the behavior table in the tick in which it arrives, and on emotion in the next.

use affect::behavior::{
    Row,
    Then::{Go, Stay},
};
use affect::{Belief, ProgressEvent, StepInput, Stimulus, Urgency};
use serde::{Deserialize, Serialize};

/// Leguin's behaviors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum LeguinBehavior {
    /// Stands at the table until she is called \[D\].
    Wait,
    /// Drives to the waiter \[D\].
    Refill,
    /// Hands over treats \[D\].
    Exchange,
    /// Stands until she is sent home \[D\].
    AwaitGoHome,
    /// Drives back to the table \[D\].
    GoHome,
}

use LeguinBehavior::{AwaitGoHome, Exchange, GoHome, Refill, Wait};

impl LeguinBehavior {
    /// Every behavior.
    pub const ALL: [Self; 5] = [Wait, Refill, Exchange, AwaitGoHome, GoHome];

    /// The name under which it is published.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Wait => "WAIT",
            Refill => "REFILL",
            Exchange => "EXCHANGE",
            AwaitGoHome => "AWAIT_GO_HOME",
            GoHome => "GO_HOME",
        }
    }
}

/// What she was commanded to do and has not begun yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Errand {
    /// "refill"
    Refill,
    /// "hurry"
    Hurry,
}

/// The progress measures.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeguinMeasures {
    /// Whether she was commanded to hurry.
    pub hurried: bool,
    /// The pressure of her errand itself, 0 to 1.
    pub errand: f64,
    /// Time without progress on the way, as a share of her patience with it, multiplied by her gain.
    pub blocked: f64,
    /// Time for which she has waited to be sent home, as a share of her patience with that, multiplied by her gain.
    pub waiting: f64,
    /// What else happened: the input of her emotion besides the pressure.
    pub event: Option<ProgressEvent>,
    /// What she believes of herself, if she has beliefs.
    pub belief: Option<Belief>,
    /// The share at which she is CONCERNED about the way.
    pub th_concerned: f64,
}

/// How pressing her errand is, 0 to 1 \[I\]: what is asked of her and how long her way is blocked; then how long she is kept
/// waiting. Nothing presses at the table, on the way there and while treats are handed over.
pub fn urgency(measures: &LeguinMeasures, behavior: &LeguinBehavior) -> Urgency {
    match behavior {
        Refill => Urgency::saturating(measures.errand.max(measures.blocked)),
        AwaitGoHome => Urgency::saturating(measures.waiting),
        Wait | Exchange | GoHome => Urgency::MIN,
    }
}

/// Appraises the measures for the emotion state generator. While an exchange is under way what she feels stays, as Butler's
/// does.
pub fn appraise(measures: &LeguinMeasures, behavior: &LeguinBehavior) -> Stimulus {
    let drive = match behavior {
        Exchange => StepInput::Hold,
        _ => StepInput::Pressure(urgency(measures, behavior)),
    };

    Stimulus {
        event: measures.event,
        belief: measures.belief,
        ..Stimulus::new(drive)
    }
}

/// What a row of the behavior table makes Leguin do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeguinAct {
    /// Begins the pending errand.
    TakeErrand,
    /// Hurries from now on.
    Hurry,
    /// Forgets the commands that led to the exchange.
    FinishErrand,
    /// Turns back.
    GiveUp,
    /// Is back at the table.
    ComeHome,
    /// Counts the trip and obeys "go home".
    TurnHome,
    /// Tells a joke.
    Joke,
}

/// What the guard of a row sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeguinContext {
    /// Whether what she goes by makes her turn back.
    pub gives_up: bool,
    /// Whether she is HAPPY.
    pub is_happy: bool,
    /// What she was commanded to do and has not begun.
    pub pending: Option<Errand>,
    /// Whether she believes that she cannot do it.
    pub despairs: bool,
    /// Whether the waiter needs her, as far as is known, and is within the exchange radius.
    pub waiter_is_needy_here: bool,
    /// Whether an exchange has lasted as long as it takes.
    pub exchange_is_over: bool,
    /// Whether she was commanded to go home after the exchange.
    pub sent_home: bool,
    /// Whether she is back at the table.
    pub is_home: bool,
    /// Whether the time for a joke has come.
    pub has_joke: bool,
}

/// The behavior state generator.
#[rustfmt::skip]
pub const TABLE: &[Row<LeguinBehavior, LeguinContext, LeguinAct>] = &[
    Row { from: &[Wait, Refill], when: |c| c.waiter_is_needy_here, act: &[LeguinAct::FinishErrand], then: Go(Exchange) },
    Row { from: &[Wait], when: |c| c.pending.is_some() && !c.despairs, act: &[LeguinAct::TakeErrand], then: Go(Refill) },
    Row { from: &[Refill], when: |c| c.pending == Some(Errand::Hurry), act: &[LeguinAct::Hurry], then: Stay },
    Row { from: &[Exchange], when: |c| c.exchange_is_over, act: &[], then: Go(AwaitGoHome) },
    Row { from: &[AwaitGoHome], when: |c| c.sent_home, act: &[LeguinAct::TurnHome], then: Go(GoHome) },
    Row { from: &[AwaitGoHome, Refill], when: |c| c.gives_up, act: &[LeguinAct::GiveUp], then: Go(GoHome) },
    Row { from: &[GoHome], when: |c| c.is_home, act: &[LeguinAct::ComeHome], then: Go(Wait) },
    Row { from: &[Wait, GoHome], when: |c| c.is_happy && c.has_joke, act: &[LeguinAct::Joke], then: Stay },
];
