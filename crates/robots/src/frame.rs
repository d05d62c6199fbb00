//! The affect frame of a robot with the standard emotions, and how a frame is published.

use affect::akr::Appraisal;
use affect::frame::Value;
use affect::{AffectFrame, Caution, EmotionLabel, Episode, Feeling, Schemata, StandardEmotion};
use robot::{Action, StateVariables, Variable};

/// The frame of a feeling; `None` for a robot without emotions.
pub(crate) fn of<'a>(
    feeling: Option<Feeling<StandardEmotion>>,
    appraisal: Appraisal,
    episode: &'a Episode,
    caution: Caution,
) -> Option<AffectFrame<'a>> {
    let feeling = feeling?;
    let name = feeling.emotion.name();
    let frame = Schemata::standard().frame(name, feeling.urgency, appraisal)?;

    Some(frame.during(episode).with_caution(caution))
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
