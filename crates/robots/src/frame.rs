//! The affect frame of a robot with the standard emotions, and how a frame is published.

use affect::akr::Appraisal;
use affect::{EmotionLabel, Feeling, Frame, Schemata, StandardEmotion};
use robot::StateVariables;

/// The frame of a feeling; `None` for a robot without emotions.
pub(crate) fn of(
    feeling: Option<Feeling<StandardEmotion>>,
    appraisal: &Appraisal,
) -> Option<Frame<'static>> {
    let feeling = feeling?;
    let name = feeling.emotion.name();

    Schemata::standard().frame(name, feeling.urgency, appraisal.clone())
}

/// Adds a frame to the state variables of a robot, under the names of `affect::frame`, so that peers can query it and
/// `cars emotionml` finds it.
pub fn publish(frame: &Frame<'_>, variables: &mut StateVariables) {
    for (name, number) in frame.numbers() {
        variables.insert(name.to_owned(), number.into());
    }
    for (name, text) in frame.texts() {
        variables.insert(name.to_owned(), text.into());
    }
}
