//! Widgets that the panels of the robots share.

use affect::akr::{FacialExpression, Valence};
use affect::{Circumstances, EmotionLabel, Feeling, Schemata, StandardEmotion};
use robot::{Face, Tone, Widget};

use crate::emotion::NEUTRAL;

/// Values in a panel's curve: two minutes of ticks of half a second.
pub(crate) const SPARKLINE_LEN: usize = 240;

/// Face, name and intensity of a feeling, and its cause in words.
pub(crate) fn feeling(
    feeling: Option<Feeling<StandardEmotion>>,
    label_cuts: &[f64; 4],
    circumstances: &Circumstances<'_>,
) -> Vec<Widget> {
    let Some(feeling) = feeling else {
        return vec![
            Widget::Face {
                face: Face::Neutral,
                intensity: 0.0,
            },
            emotion(NEUTRAL, Tone::Neutral),
        ];
    };
    let name = feeling.emotion.name();
    let intensity = feeling.intensity;
    let instance = Schemata::standard().emotion(name, intensity, circumstances);

    let mut widgets = Vec::new();
    if let Ok(instance) = &instance {
        widgets.push(Widget::Face {
            face: face(instance.components().facial_expression),
            intensity: intensity.value(),
        });
    }
    widgets.push(emotion(name, tone(feeling.emotion)));
    widgets.push(Widget::Bar {
        label: format!("intensity ({})", intensity.label_by(label_cuts).name()),
        value: intensity.value(),
        min: 0.0,
        max: 1.0,
    });
    if let Ok(instance) = &instance {
        widgets.push(Widget::Text {
            label: "why".to_owned(),
            text: instance.components().causal_chain.spoken(),
        });
    }
    widgets
}

/// The badge of a behavior.
pub(crate) fn behavior(name: &str) -> Widget {
    Widget::Badge {
        label: "behavior".to_owned(),
        text: name.to_owned(),
        tone: Tone::Neutral,
    }
}

fn emotion(name: &str, tone: Tone) -> Widget {
    Widget::Badge {
        label: "emotion".to_owned(),
        text: name.to_owned(),
        tone,
    }
}

/// A table of names and values.
pub(crate) fn table(rows: &[(&str, String)]) -> Widget {
    Widget::Table {
        rows: rows
            .iter()
            .map(|(name, value)| vec![(*name).to_owned(), value.clone()])
            .collect(),
    }
}

/// A duration, as text.
pub(crate) fn seconds(value_s: f64) -> String {
    format!("{value_s:.1} s")
}

/// A flag, as text.
pub(crate) fn yes(flag: bool) -> &'static str {
    if flag { "yes" } else { "no" }
}

fn tone(emotion: StandardEmotion) -> Tone {
    match (emotion.valence(), emotion) {
        (Valence::Positive, StandardEmotion::Happy) => Tone::Good,
        (Valence::Positive, _) => Tone::Neutral,
        (Valence::Negative, StandardEmotion::Concerned) => Tone::Warning,
        (Valence::Negative, _) => Tone::Bad,
    }
}

fn face(expression: FacialExpression) -> Face {
    match expression {
        FacialExpression::Happy => Face::Happy,
        FacialExpression::Sad => Face::Sad,
        FacialExpression::Surprised => Face::Surprised,
        FacialExpression::Disgusted => Face::Disgusted,
        FacialExpression::Angry => Face::Angry,
        FacialExpression::Fearful => Face::Fearful,
        FacialExpression::Neutral => Face::Neutral,
    }
}
