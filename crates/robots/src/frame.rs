//! The affect frame of a robot with the standard emotions, and how a frame is published.

use affect::akr::Appraisal;
use affect::{AffectFrame, EmotionLabel, Feeling, Schemata, StandardEmotion};
use robot::Action;

/// The frame of a feeling; `None` for a robot without emotions.
pub(crate) fn of(
    feeling: Option<Feeling<StandardEmotion>>,
    appraisal: &Appraisal,
) -> Option<AffectFrame<'static>> {
    let feeling = feeling?;
    let name = feeling.emotion.name();

    Schemata::standard().frame(name, feeling.urgency, appraisal.clone())
}

/// The action of a robot with this frame: its emotion, and state variables under the names of `affect::frame`, so that
/// peers can query them and `cars export --emotionml` finds them.
#[must_use]
pub fn publish(frame: Option<AffectFrame<'_>>, action: Action) -> Action {
    let Some(frame) = frame else {
        return action;
    };

    let mut action = action.emotion(frame.name());
    for (name, number) in frame.numbers() {
        action = action.variable(name, number);
    }
    for (name, text) in frame.texts() {
        action = action.variable(name, text);
    }
    action
}
