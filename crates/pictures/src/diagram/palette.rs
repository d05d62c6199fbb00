//! Colors of emotions and behaviors: a name has the same color in every picture, whatever else is in it.
//!
//! The emotions of the documented robots have colors of Okabe and Ito (2008), which are told apart by most eyes; they differ in
//! lightness, too, so that they are told apart in print without colors.

/// A color of a band, in light and in dark surroundings, as `#rrggbb`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shade {
    /// In light surroundings, and in print.
    pub light: &'static str,
    /// In dark surroundings.
    pub dark: &'static str,
}

/// The emotions that have a color of their own: those of the paper, then the other standard emotions.
pub const EMOTIONS: [&str; 7] = [
    "HAPPY",
    "CONFIDENT",
    "CONCERNED",
    "FRUSTRATED",
    "ANGRY",
    "DISCOURAGED",
    "HOPEFUL",
];
/// The behaviors that have a color of their own.
pub const BEHAVIORS: [&str; 8] = [
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
pub const EMOTION_SHADES: [Shade; 15] = [
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
pub const BEHAVIOR_SHADES: [Shade; 14] = [
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

const fn shade(light: &'static str, dark: &'static str) -> Shade {
    Shade { light, dark }
}

/// Index in [`EMOTION_SHADES`] of the color of an emotion.
#[must_use]
pub fn emotion(name: &str) -> usize {
    index(name, &EMOTIONS, EMOTION_SHADES.len())
}

/// Index in [`BEHAVIOR_SHADES`] of the color of a behavior.
#[must_use]
pub fn behavior(name: &str) -> usize {
    index(name, &BEHAVIORS, BEHAVIOR_SHADES.len())
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
#[must_use]
pub fn ink(color: &str) -> &'static str {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_color_of_a_name_is_fixed() {
        assert_eq!(emotion("HAPPY"), 0);
        assert_eq!(emotion("HOPEFUL"), 6);
        assert_eq!(fnv1a("a"), 0xe40c_292c);
        for name in ["CONFUSED", "", "BORED", "x"] {
            assert!((7..15).contains(&emotion(name)), "{name}");
            assert!((8..14).contains(&behavior(name)), "{name}");
        }
        assert_eq!(emotion("CONFUSED"), emotion("CONFUSED"));
    }

    /// The page of the console has the same hash, and its test the same values.
    #[test]
    fn names_without_a_color_of_their_own_have_that_of_their_hash() {
        assert_eq!(emotion("CONFUSED"), 13);
        assert_eq!(emotion(""), 12);
        assert_eq!(emotion("ärgerlich"), 13);
        assert_eq!(behavior("DANCE"), 8);
    }

    /// As WCAG 2.2 defines it.
    fn exact_luminance(color: &str) -> f64 {
        let channel = |at: usize| {
            let value = f64::from(u8::from_str_radix(&color[at..at + 2], 16).unwrap()) / 255.0;
            if value <= 0.04045 {
                value / 12.92
            } else {
                libm::pow((value + 0.055) / 1.055, 2.4)
            }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    /// WCAG 2.2, 1.4.3 (AA).
    #[test]
    fn text_is_legible_on_every_color() {
        let shades = EMOTION_SHADES.iter().chain(&BEHAVIOR_SHADES);
        for color in shades.flat_map(|shade| [shade.light, shade.dark]) {
            let one = exact_luminance(color);
            let other = exact_luminance(ink(color));
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
}
