//! The affect frame of a robot with the standard emotions, and how a frame is published.

use affect::akr::Appraisal;
use affect::frame::Value;
use affect::{AffectFrame, Caution, EmotionLabel, Episode, Schemata};
use robot::{Action, StateVariables, Variable};

use crate::emotion::SwitchableGenerator;

/// The frame of what a robot shows; `None` for one without emotions.
pub(crate) fn of<'a, M, B>(
    emotion: &SwitchableGenerator<M, B>,
    appraisal: Appraisal,
    episode: &'a Episode,
    caution: Caution,
) -> Option<AffectFrame<'a>> {
    let feeling = emotion.shown()?;
    let name = feeling.emotion.name();
    let frame = Schemata::standard().frame(name, feeling.urgency, appraisal)?;

    Some(
        frame
            .during(episode)
            .with_caution(caution)
            .with_mood(emotion.mood()),
    )
}

/// The action of a robot with this frame: its emotion, and the state variables of [`publish_variables`].
#[must_use]
pub fn publish(frame: Option<AffectFrame<'_>>, action: Action) -> Action {
    let mut action = match &frame {
        Some(frame) => action.emotion(frame.name()),
        None => action,
    };
    action.state_variables = publish_variables(frame, action.state_variables);
    action
}

/// The state variables of a robot, and those of its frame under the names of `affect::frame`, so that peers can query them and
/// `cars export --emotionml` finds them.
#[must_use]
pub fn publish_variables(
    frame: Option<AffectFrame<'_>>,
    variables: StateVariables,
) -> StateVariables {
    let Some(frame) = frame else {
        return variables;
    };

    let components = frame.components().map(|(name, value)| {
        let value = match value {
            Value::Number(number) => Variable::from(number),
            Value::Text(text) => Variable::from(text),
        };
        (name, value)
    });
    variables.with(components)
}
