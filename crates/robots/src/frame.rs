//! The affect frame of a robot with the standard emotions, and how a frame is published.

use affect::akr::Appraisal;
use affect::{AffectFrame, EmotionLabel, Feeling, Schemata, StandardEmotion};
use robot::{Action, StateVariables};

/// The frame of a feeling; `None` for a robot without emotions.
pub(crate) fn of(
    feeling: Option<Feeling<StandardEmotion>>,
    appraisal: &Appraisal,
) -> Option<AffectFrame<'static>> {
    let feeling = feeling?;
    let name = feeling.emotion.name();

    Schemata::standard().frame(name, feeling.urgency, appraisal.clone())
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
    mut variables: StateVariables,
) -> StateVariables {
    let Some(frame) = frame else {
        return variables;
    };

    for (name, number) in frame.numbers() {
        variables.insert(name, number.into());
    }
    for (name, text) in frame.texts() {
        variables.insert(name, text.into());
    }
    variables
}
