//! Colors of arms and of quantities. Those of emotions and behaviors are in `diagram::palette`.

use crate::diagram::palette::Shade;

/// Number of arms with a look of their own: color, marker, and dashes of lines.
pub const ARMS: usize = 8;
/// Colors of arms: ink for the baseline, then colors that are told apart also with protanopia and deuteranopia (a distance of at
/// least 0.1 in OKLab), and from the colors of emotions.
pub const ARM_SHADES: [Shade; ARMS] = [
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
pub const LEVELS: usize = 10;
/// Colors of quantities, from nothing to the most: one hue, so that they differ in lightness.
pub const HEAT_SHADES: [Shade; LEVELS] = [
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

/// The step of a quantity between 0 and 1. What is not nothing is at least the first step.
pub(crate) fn level(share: f64) -> usize {
    if share.is_nan() || share <= 0.0 {
        return 0;
    }
    let step = (share * (LEVELS - 1) as f64).ceil();
    (step as usize).clamp(1, LEVELS - 1)
}

const fn shade(light: &'static str, dark: &'static str) -> Shade {
    Shade { light, dark }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagram::palette::EMOTION_SHADES;

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

    fn linear(color: &str) -> [f64; 3] {
        [1, 3, 5].map(|at| {
            let byte = u8::from_str_radix(&color[at..at + 2], 16).unwrap();
            let value = f64::from(byte) / 255.0;
            // Close enough to the curve of sRGB for distances.
            value * value * (0.2 + 0.8 * value.sqrt())
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
                    assert!(
                        distance(one.light, other.light, eyes) > 0.1,
                        "{one:?} {other:?}"
                    );
                    assert!(
                        distance(one.dark, other.dark, eyes) > 0.1,
                        "{one:?} {other:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_arm_has_the_color_of_an_emotion() {
        for arm in &ARM_SHADES {
            for emotion in &EMOTION_SHADES[..7] {
                assert!(
                    distance(arm.light, emotion.light, &EYES[0]) > 0.08,
                    "{arm:?}"
                );
                assert!(distance(arm.dark, emotion.dark, &EYES[0]) > 0.05, "{arm:?}");
            }
        }
    }

    #[test]
    fn what_is_not_nothing_is_seen() {
        let levels = [0.0, 1e-9, 0.5, 1.0, 2.0, f64::NAN].map(level);
        assert_eq!(levels, [0, 1, 5, 9, 9, 0]);
    }
}
