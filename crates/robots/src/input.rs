//! What brings a robot nearer to its goal or farther from it, by name: the inputs of its emotions that it publishes.

use affect::{DynamicsParameters, Progress, ProgressEvent, Urgency};
use robot::StateVariables;
use serde::{Deserialize, Serialize};

/// An input of the emotions \[I\]; that there are positive and negative ones \[D\].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// The pressure is above the urgency.
    FallsBehind,
    /// The other robot comes nearer, or the robot to it.
    ComesNearer,
    /// An exchange is over.
    ExchangeOver,
    /// The robot gives up what it tried.
    GivesUp,
    /// The robot believes again that it can achieve its goal.
    Encouraged,
    /// The refiller sets out on an errand.
    NewErrand,
    /// The refiller is told to hurry.
    Hurry,
    /// The refiller is sent home.
    SentHome,
    /// The refiller comes nearer to her place.
    NearerHome,
    /// The refiller is back at her place.
    Home,
}

impl Input {
    /// The name under which it is published.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::FallsBehind => "falls behind",
            Self::ComesNearer => "comes nearer",
            Self::ExchangeOver => "exchange over",
            Self::GivesUp => "gives up",
            Self::Encouraged => "encouraged",
            Self::NewErrand => "new errand",
            Self::Hurry => "hurry",
            Self::SentHome => "sent home",
            Self::NearerHome => "nearer home",
            Self::Home => "home",
        }
    }

    /// What it is for the dynamics; `None` if the drive already says it.
    #[must_use]
    pub fn event(self, dynamics: &DynamicsParameters) -> Option<ProgressEvent> {
        let low = Urgency::saturating(dynamics.low_importance);
        let high = Urgency::saturating(dynamics.high_importance);
        let setback = Urgency::saturating(dynamics.setback);
        match self {
            Self::FallsBehind => None,
            Self::ComesNearer => Some(ProgressEvent::Easing),
            Self::ExchangeOver => Some(ProgressEvent::GoalAchieved),
            Self::GivesUp | Self::Hurry => Some(ProgressEvent::Negative(setback)),
            Self::NearerHome => Some(ProgressEvent::Positive(low)),
            Self::Encouraged | Self::NewErrand | Self::SentHome | Self::Home => {
                Some(ProgressEvent::Positive(high))
            }
        }
    }
}

/// The inputs of a robot: what happened since its last emotion, and the last input that counted.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inputs {
    /// What its last behavior or command brought, for the next emotion.
    noted: Option<Input>,
    /// What the present emotion was shown.
    shown: Option<Input>,
    last: Option<(Input, f64)>,
}

impl Inputs {
    /// Notes an input for the next emotion; of several, the last one counts.
    pub fn note(&mut self, input: Input) {
        self.noted = Some(input);
    }

    /// Shows the emotion what was noted, or else what this tick's measures say. Returns it as an event.
    pub fn show(
        &mut self,
        measured: Option<Input>,
        dynamics: &DynamicsParameters,
    ) -> Option<ProgressEvent> {
        self.shown = self.noted.take().or(measured);
        self.shown?.event(dynamics)
    }

    /// Records what of it counted.
    pub fn record(&mut self, progress: Option<Progress>) {
        let Some(progress) = progress else {
            return;
        };
        let input = match self.shown {
            Some(input) if progress.is_event => input,
            _ => Input::FallsBehind,
        };
        self.last = Some((input, progress.signed));
    }

    /// Publishes the last input that counted: its importance with the sign of its class, -1 to 1, and its name.
    pub fn publish(&self, variables: &mut StateVariables) {
        if let Some((input, signed)) = self.last {
            variables.insert("progress", signed.into());
            variables.insert("progress_by", input.name().into());
        }
    }
}
