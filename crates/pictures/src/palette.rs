//! Colors. An emotion or a behavior has the same color in every picture of a run: that of its name if the name is a known one,
//! otherwise the next free one, in the order in which the names first occurred.
//!
//! The emotions of the documented robots have colors of Okabe and Ito (2008). They and the colors of other names are told apart
//! with protanopia and deuteranopia, too.

use timeline::{StateKind, StateOrder};

/// A color in light and in dark surroundings, as `#rrggbb`. Prints are light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shade {
    pub(crate) light: &'static str,
    pub(crate) dark: &'static str,
}

/// Colors with a meaning, by their names in the style sheets.
pub(crate) const NAMED: [(&str, Shade); 16] = [
    ("paper", shade("#ffffff", "#1b1d20")),
    ("soft", shade("#f5f5f2", "#24272b")),
    ("ink", shade("#1f1f1c", "#e9e8e4")),
    ("muted", shade("#66665f", "#a2a5ab")),
    ("rule", shade("#d9d9d4", "#3a3d42")),
    ("grid", shade("#ebebe8", "#2c2f34")),
    ("axis", shade("#8d8d86", "#7b7f86")),
    ("link", shade("#0b5c8a", "#7cc0e8")),
    ("none", shade("#fbfbfa", "#1f2225")),
    ("obstacle", shade("#4a4a45", "#b9b8b2")),
    ("command", shade("#33332f", "#d9d8d4")),
    ("lost", shade("#b3261e", "#ff8a80")),
    ("cut", shade("#f4dcd5", "#47302b")),
    ("held", shade("#a86400", "#e6a94a")),
    ("slow", shade("#7a6a00", "#cdbb4a")),
    ("query", shade("#7c5aa6", "#b59add")),
];

/// The emotions that have a color of their own: those of the paper, then the other standard emotions.
pub(crate) const EMOTIONS: [&str; 7] = [
    "HAPPY",
    "CONFIDENT",
    "CONCERNED",
    "FRUSTRATED",
    "ANGRY",
    "DISCOURAGED",
    "HOPEFUL",
];
/// The behaviors that have a color of their own.
pub(crate) const BEHAVIORS: [&str; 8] = [
    "SERVE",
    "INTERCEPT",
    "EXCHANGE",
    "GO_BACK",
    "WAIT",
    "REFILL",
    "AWAIT_GO_HOME",
    "GO_HOME",
];

/// Colors of emotions: of [`EMOTIONS`], in their order, then those of other names. Any two have a distance of at least 0.07 in
/// OKLab, also with protanopia and deuteranopia.
pub(crate) const EMOTION_SHADES: [Shade; 15] = [
    shade("#009e73", "#1aa981"),
    shade("#56b4e9", "#56b4e9"),
    shade("#f0e442", "#dccf35"),
    shade("#d55e00", "#e0721f"),
    shade("#cc79a7", "#945888"),
    shade("#526a68", "#4592b7"),
    shade("#0072b2", "#5888f4"),
    shade("#3630a9", "#894ac0"),
    shade("#cfaa02", "#fff53a"),
    shade("#5a0f08", "#cb3523"),
    shade("#328cfe", "#20e1fe"),
    shade("#c8b4a0", "#daf7e3"),
    shade("#515503", "#f29600"),
    shade("#46055e", "#37ec97"),
    shade("#3e4869", "#19ccb1"),
];

/// Colors of behaviors: of [`BEHAVIORS`], in their order, then those of other names.
pub(crate) const BEHAVIOR_SHADES: [Shade; 14] = [
    shade("#dfe6ee", "#3a4450"),
    shade("#f0d9cf", "#57413a"),
    shade("#d5e6d0", "#37493a"),
    shade("#e7dff0", "#473d54"),
    shade("#ececea", "#3c3d40"),
    shade("#cfe3ea", "#2f4a55"),
    shade("#efe6c9", "#4e4629"),
    shade("#dcd6ea", "#433f5c"),
    shade("#e4d3d8", "#52393f"),
    shade("#d0e0da", "#30483f"),
    shade("#dcdcc8", "#47472f"),
    shade("#c9d3e3", "#36435a"),
    shade("#e6dfd3", "#4b4438"),
    shade("#d3d8dc", "#41484e"),
];

/// Number of arms with a look of their own: color, marker, and dashes of lines.
pub(crate) const ARMS: usize = 8;
/// Colors of arms: ink for the baseline, then colors that are told apart also with protanopia and deuteranopia (a distance of at
/// least 0.1 in OKLab), and from the colors of emotions.
pub(crate) const ARM_SHADES: [Shade; ARMS] = [
    shade("#1f1f1c", "#e9e8e4"),
    shade("#4b8efe", "#858ae9"),
    shade("#815c0a", "#c09910"),
    shade("#9c6496", "#eca5fc"),
    shade("#4b34cd", "#7e55f0"),
    shade("#b28b45", "#e6bc8b"),
    shade("#5d435a", "#b5a1ae"),
    shade("#280183", "#647d97"),
];

/// Number of steps from nothing to the most.
pub(crate) const LEVELS: usize = 10;
/// Colors of quantities, from nothing to the most: one hue, so that they differ in lightness.
pub(crate) const HEAT_SHADES: [Shade; LEVELS] = [
    shade("#f4f7f7", "#22282b"),
    shade("#e2ecef", "#27343b"),
    shade("#cbdee4", "#2b424d"),
    shade("#b1cfd9", "#2f505e"),
    shade("#95bdcc", "#356073"),
    shade("#79abbd", "#3e7288"),
    shade("#5d97ab", "#4c869d"),
    shade("#3f7c92", "#619bb2"),
    shade("#28657b", "#7eb4c8"),
    shade("#104c61", "#a3cedd"),
];

const fn shade(light: &'static str, dark: &'static str) -> Shade {
    Shade { light, dark }
}

/// Ways in which an area is hatched; the first one is not at all.
const HATCHINGS: usize = 4;

/// How areas of an emotion or a behavior look. Looks are ordered: those of known names as these are, which is the ladder of
/// emotions, then others as they first occurred.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct StateLook {
    prefix: &'static str,
    /// Which hatching is over the color, of names beyond the number of colors; 0 is none.
    pub(crate) hatching: usize,
    /// Index of its color.
    color: usize,
}

impl StateLook {
    /// The class of its color; text on it has this class after `on-`.
    #[must_use]
    pub fn class(&self) -> String {
        format!("{}{}", self.prefix, self.color)
    }

    /// Its color on paper, `#rrggbb`.
    pub(crate) fn light(&self) -> &'static str {
        match self.prefix {
            "e" => EMOTION_SHADES[self.color].light,
            _ => BEHAVIOR_SHADES[self.color].light,
        }
    }
}

/// How an emotion or a behavior looks in a run with these names. A name that is not among them looks like the next one.
#[must_use]
pub fn state_look(kind: StateKind, name: &str, names: &StateOrder) -> StateLook {
    let (prefix, known, shades): (_, &[&str], _) = match kind {
        StateKind::Emotion => ("e", &EMOTIONS, EMOTION_SHADES.len()),
        StateKind::Behavior => ("b", &BEHAVIORS, BEHAVIOR_SHADES.len()),
    };
    if let Some(color) = known.iter().position(|other| *other == name) {
        return StateLook {
            prefix,
            color,
            hatching: 0,
        };
    }

    let others = names.of(kind).iter();
    let others = others.filter(|other| !known.contains(&other.as_str()));
    let place = others.take_while(|other| *other != name).count();
    let colors = shades - known.len();
    // Names after the last look have that one.
    let place = place.min(colors * HATCHINGS - 1);
    StateLook {
        prefix,
        color: known.len() + place % colors,
        hatching: place / colors,
    }
}

/// The color of text on a color, `#rrggbb`: black or white.
pub(crate) fn ink(color: &str) -> &'static str {
    if luminance(color) > 0.19 {
        "#111111"
    } else {
        "#ffffff"
    }
}

/// Relative luminance of a color, 0 to 1; the square is close enough to the curve of sRGB.
fn luminance(color: &str) -> f64 {
    let channel = |at: usize| {
        let digits = color.get(at..at + 2).unwrap_or("00");
        let value = f64::from(u8::from_str_radix(digits, 16).unwrap_or(0)) / 255.0;
        value * value
    };
    0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
}

/// The step of a quantity between 0 and 1. What is not nothing is at least the first step.
pub(crate) fn level(share: f64) -> usize {
    if share.is_nan() || share <= 0.0 {
        return 0;
    }
    let step = (share * (LEVELS - 1) as f64).ceil();
    (step as usize).clamp(1, LEVELS - 1)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn names(kind: StateKind, all: &[&str]) -> StateOrder {
        let mut names = StateOrder::default();
        for name in all {
            names.add(kind, name);
        }
        names
    }

    #[test]
    fn known_names_have_colors_of_their_own() {
        let none = StateOrder::default();
        for (index, name) in EMOTIONS.iter().enumerate() {
            let look = state_look(StateKind::Emotion, name, &none);
            assert_eq!((look.class(), look.hatching), (format!("e{index}"), 0));
        }
    }

    /// The page of the console has the same rule, and its test the same values.
    #[test]
    fn other_names_have_the_next_free_color_in_the_order_in_which_they_occur() {
        let names = names(
            StateKind::Emotion,
            &["LONELY", "HAPPY", "CONTENT", "ärgerlich", "RESTLESS"],
        );
        let class = |name| state_look(StateKind::Emotion, name, &names).class();
        let classes = ["LONELY", "HAPPY", "CONTENT", "ärgerlich", "RESTLESS", "new"].map(class);
        assert_eq!(classes, ["e7", "e0", "e8", "e9", "e10", "e11"]);
        let dance = state_look(StateKind::Behavior, "DANCE", &names);
        assert_eq!(dance.class(), "b8");
    }

    #[test]
    fn more_names_than_colors_are_hatched() {
        let all: Vec<String> = (0..40).map(|index| format!("S{index}")).collect();
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        for (kind, looks) in [(StateKind::Emotion, 32), (StateKind::Behavior, 24)] {
            let names = names(kind, &all);
            let mut found = BTreeSet::new();
            for name in &all {
                found.insert(state_look(kind, name, &names));
            }
            assert_eq!(found.len(), looks);
        }
    }

    /// WCAG 2.2, 1.4.3 (AA).
    #[test]
    fn text_is_legible_on_every_color() {
        let shades = EMOTION_SHADES.iter().chain(&BEHAVIOR_SHADES);
        for color in shades.flat_map(|shade| [shade.light, shade.dark]) {
            let contrast = contrast(color, ink(color));
            assert!(contrast >= 4.5, "{color}: {contrast}");
        }
    }

    fn contrast(one: &str, other: &str) -> f64 {
        let [one, other] = [one, other].map(|color| {
            let [red, green, blue] = linear(color);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        });
        (one.max(other) + 0.05) / (one.min(other) + 0.05)
    }

    /// Linear RGB with protanopia and deuteranopia after Machado, Oliveira and Fernandes (2009).
    const EYES: [[[f64; 3]; 3]; 3] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
    ];
    /// Linear RGB to cones, and cones to OKLab (Ottosson 2020).
    const TO_CONES: [[f64; 3]; 3] = [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ];
    const TO_LAB: [[f64; 3]; 3] = [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ];

    fn times(matrix: &[[f64; 3]; 3], vector: [f64; 3]) -> [f64; 3] {
        matrix.map(|row| row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2])
    }

    /// Red, green and blue of a color as amounts of light.
    fn linear(color: &str) -> [f64; 3] {
        [1, 3, 5].map(|at| {
            let value = f64::from(u8::from_str_radix(&color[at..at + 2], 16).unwrap()) / 255.0;
            if value <= 0.04045 {
                value / 12.92
            } else {
                libm::pow((value + 0.055) / 1.055, 2.4)
            }
        })
    }

    fn seen(color: &str, eyes: &[[f64; 3]; 3]) -> [f64; 3] {
        let light = times(eyes, linear(color)).map(|value| value.clamp(0.0, 1.0));
        times(&TO_LAB, times(&TO_CONES, light).map(f64::cbrt))
    }

    fn distance(one: &str, other: &str, eyes: &[[f64; 3]; 3]) -> f64 {
        let one = seen(one, eyes);
        let other = seen(other, eyes);
        let mut squares = 0.0;
        for (a, b) in one.into_iter().zip(other) {
            squares += (a - b) * (a - b);
        }
        squares.sqrt()
    }

    /// The least distance of two colors, in light and in dark, with the usual eyes.
    fn least_distance(shades: &[Shade]) -> f64 {
        let mut least = f64::INFINITY;
        for (index, one) in shades.iter().enumerate() {
            for other in &shades[index + 1..] {
                for eyes in &EYES {
                    least = least.min(distance(one.light, other.light, eyes));
                    least = least.min(distance(one.dark, other.dark, eyes));
                }
            }
        }
        least
    }

    #[test]
    fn emotions_and_arms_are_told_apart_by_most_eyes() {
        let emotions = least_distance(&EMOTION_SHADES);
        assert!(emotions > 0.07, "{emotions}");
        let arms = least_distance(&ARM_SHADES);
        assert!(arms > 0.1, "{arms}");
    }

    /// WCAG 2.2, 1.4.11 (AA): lines and markers on the page.
    #[test]
    fn lines_of_arms_are_seen_on_the_page() {
        let (_, paper) = NAMED[0];
        for arm in ARM_SHADES {
            let light = contrast(arm.light, paper.light);
            let dark = contrast(arm.dark, paper.dark);
            assert!(light >= 3.0 && dark >= 3.0, "{arm:?}: {light}, {dark}");
        }
    }

    #[test]
    fn no_arm_has_the_color_of_an_emotion() {
        for arm in &ARM_SHADES {
            for emotion in &EMOTION_SHADES[..7] {
                let light = distance(arm.light, emotion.light, &EYES[0]);
                let dark = distance(arm.dark, emotion.dark, &EYES[0]);
                assert!(light > 0.08 && dark > 0.05, "{arm:?}");
            }
        }
    }

    #[test]
    fn what_is_not_nothing_is_seen() {
        let levels = [0.0, 1e-9, 0.5, 1.0, 2.0, f64::NAN].map(level);
        assert_eq!(levels, [0, 1, 5, 9, 9, 0]);
    }
}
