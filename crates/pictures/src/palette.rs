//! Colors. A name of an emotion or a behavior has the same color in every picture, whatever else is in it.
//!
//! The emotions of the documented robots have colors of Okabe and Ito (2008), which are told apart by most eyes; they differ in
//! lightness, too, so that they are told apart in print without colors.

use timeline::StateKind;

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

/// Colors of emotions: of [`EMOTIONS`], in their order, then those of other names, after Tol (2021).
pub(crate) const EMOTION_SHADES: [Shade; 15] = [
    shade("#009e73", "#1aa981"),
    shade("#56b4e9", "#56b4e9"),
    shade("#f0e442", "#dccf35"),
    shade("#d55e00", "#e0721f"),
    shade("#cc79a7", "#d387b1"),
    shade("#8a8a8a", "#979797"),
    shade("#0072b2", "#3a93cc"),
    shade("#aa4499", "#bd62ae"),
    shade("#999933", "#a9a945"),
    shade("#882255", "#b04a80"),
    shade("#332288", "#8577d6"),
    shade("#44aa99", "#58b8a8"),
    shade("#ddcc77", "#cfbf6d"),
    shade("#b07a4a", "#bd8a5c"),
    shade("#7a8ca5", "#8c9db5"),
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

/// The class of areas in the color of an emotion or a behavior; text on them has this class after `on-`.
#[must_use]
pub fn state_class(kind: StateKind, name: &str) -> String {
    match kind {
        StateKind::Emotion => format!("e{}", index(name, &EMOTIONS, EMOTION_SHADES.len())),
        StateKind::Behavior => format!("b{}", index(name, &BEHAVIORS, BEHAVIOR_SHADES.len())),
    }
}

/// A name without a color of its own has one of the others, by its hash (FNV-1a, 32 bit, of its UTF-8).
fn index(name: &str, known: &[&str], shades: usize) -> usize {
    if let Some(index) = known.iter().position(|other| *other == name) {
        return index;
    }

    let others = shades - known.len();
    known.len() + fnv1a(name) as usize % others
}

fn fnv1a(text: &str) -> u32 {
    let mut hash: u32 = 0x811c_9dc5;
    for byte in text.bytes() {
        hash = (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
    }
    hash
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
    use super::*;

    #[test]
    fn the_color_of_a_name_is_fixed() {
        assert_eq!(fnv1a("a"), 0xe40c_292c);
        assert_eq!(state_class(StateKind::Emotion, "HAPPY"), "e0");
        assert_eq!(state_class(StateKind::Emotion, "HOPEFUL"), "e6");
        for name in ["CONFUSED", "", "BORED", "x"] {
            assert!((7..15).contains(&index(name, &EMOTIONS, 15)), "{name}");
            assert!((8..14).contains(&index(name, &BEHAVIORS, 14)), "{name}");
        }
    }

    /// The page of the console has the same hash, and its test the same values.
    #[test]
    fn names_without_a_color_of_their_own_have_that_of_their_hash() {
        for (name, class) in [("CONFUSED", "e13"), ("", "e12"), ("ärgerlich", "e13")] {
            assert_eq!(state_class(StateKind::Emotion, name), class);
        }
        assert_eq!(state_class(StateKind::Behavior, "DANCE"), "b8");
    }

    /// WCAG 2.2, 1.4.3 (AA).
    #[test]
    fn text_is_legible_on_every_color() {
        let luminance = |color: &str| {
            let [red, green, blue] = linear(color);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        let shades = EMOTION_SHADES.iter().chain(&BEHAVIOR_SHADES);
        for color in shades.flat_map(|shade| [shade.light, shade.dark]) {
            let one = luminance(color);
            let other = luminance(ink(color));
            let contrast = (one.max(other) + 0.05) / (one.min(other) + 0.05);
            assert!(contrast >= 4.5, "{color}: {contrast}");
        }
    }

    #[test]
    fn no_two_emotions_have_a_color() {
        for (index, one) in EMOTION_SHADES.iter().enumerate() {
            for other in &EMOTION_SHADES[index + 1..] {
                assert_ne!(one.light, other.light);
                assert_ne!(one.dark, other.dark);
            }
        }
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

    #[test]
    fn arms_are_told_apart_by_most_eyes() {
        for (index, one) in ARM_SHADES.iter().enumerate() {
            for other in &ARM_SHADES[index + 1..] {
                for eyes in &EYES {
                    let light = distance(one.light, other.light, eyes);
                    let dark = distance(one.dark, other.dark, eyes);
                    assert!(light > 0.1 && dark > 0.1, "{one:?} {other:?}");
                }
            }
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
