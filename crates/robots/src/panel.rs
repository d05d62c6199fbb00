//! Widgets that the panels of the robots share.

use affect::akr::{FacialExpression, Valence};
use affect::{AffectFrame, Episode, EpisodeCause};
use robot::{Face, Tone, Widget};
use smol_str::{SmolStr, StrExt, format_smolstr};

use crate::emotion::NEUTRAL;

/// Values in a panel's curve: half a minute of ticks of half a second. A panel with them is recorded in each tick.
pub(crate) const SPARKLINE_LEN: usize = 60;

/// Face, name and intensity of an emotion, what it inclines the robot to do, and why; `None` without emotions. The other
/// components are state variables, which the console shows of every robot.
pub(crate) fn affect(frame: Option<&AffectFrame<'_>>, label_cuts: &[f64; 4]) -> Vec<Widget> {
    let Some(frame) = frame else {
        return vec![
            Widget::Face {
                face: Face::Neutral,
                intensity: 0.0,
            },
            emotion(NEUTRAL, Tone::Neutral),
        ];
    };

    let intensity = frame.intensity();
    let cause = frame.episode().map(Episode::cause);
    vec![
        Widget::Face {
            face: face(frame.schema().facial_expression),
            intensity: intensity.value(),
        },
        emotion(frame.name(), tone(frame)),
        Widget::Bar {
            label: format_smolstr!("intensity ({})", intensity.label(label_cuts).name()),
            value: intensity.value(),
            min: 0.0,
            max: 1.0,
        },
        Widget::Text {
            label: SmolStr::new_static("inclined to"),
            text: frame
                .schema()
                .action_tendency
                .name()
                .replace_smolstr("-", " "),
        },
        Widget::Text {
            label: SmolStr::new_static("why"),
            text: cause.map(EpisodeCause::spoken).unwrap_or_default().into(),
        },
    ]
}

/// The badge of a behavior.
pub(crate) fn behavior(name: &str) -> Widget {
    Widget::Badge {
        label: SmolStr::new_static("behavior"),
        text: name.into(),
        tone: Tone::Neutral,
    }
}

fn emotion(name: &str, tone: Tone) -> Widget {
    Widget::Badge {
        label: SmolStr::new_static("emotion"),
        text: name.into(),
        tone,
    }
}

/// A table of names and values.
pub(crate) fn table<const N: usize>(rows: [(&'static str, SmolStr); N]) -> Widget {
    let rows = rows.map(|(name, value)| vec![SmolStr::new_static(name), value]);
    Widget::Table { rows: rows.into() }
}

/// A number with so many decimals and its unit, as text.
pub(crate) fn number(value: f64, decimals: u8, unit: &str) -> SmolStr {
    let width = usize::from(decimals);
    let scale = 10_u64.pow(decimals.into());
    // Panels are made in every tick, and the standard library takes its slow way for numbers such as 0.5.
    let scaled = (value * scale as f64).round();
    if !(0.0..1e9).contains(&scaled) {
        return format_smolstr!("{value:.width$}{unit}");
    }
    let scaled = scaled as u64;
    format_smolstr!("{}.{:0width$}{unit}", scaled / scale, scaled % scale)
}

/// A flag, as text.
pub(crate) fn yes(flag: bool) -> &'static str {
    if flag { "yes" } else { "no" }
}

/// Color of the badge.
fn tone(frame: &AffectFrame<'_>) -> Tone {
    match (frame.affect().valence, frame.name()) {
        (Valence::Positive, "HAPPY") => Tone::Good,
        (Valence::Positive, _) => Tone::Neutral,
        (Valence::Negative, "CONCERNED") => Tone::Warning,
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
