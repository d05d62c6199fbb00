//! The style sheet of a diagram. Light values come first and without variables, for programs that know neither variables nor
//! media queries; dark ones are for screens only, so prints are light.

use std::fmt::Write;

use crate::diagram::palette::{self, BEHAVIOR_SHADES, EMOTION_SHADES, Shade, ink};

/// Selector, property, light value, dark value.
const COLORS: [(&str, &str, &str, &str); 23] = [
    (".paper", "fill", "#ffffff", "#1b1d20"),
    ("text", "fill", "#1f1f1c", "#e9e8e4"),
    (".muted", "fill", "#66665f", "#a2a5ab"),
    (".label", "stroke", "#ffffff", "#1b1d20"),
    (".performative", "fill", "#66665f", "#a2a5ab"),
    (".grid", "stroke", "#ebebe8", "#2c2f34"),
    (".axis", "stroke", "#8d8d86", "#7b7f86"),
    ("rect.band", "stroke", "#ffffff", "#1b1d20"),
    (".line,.wait", "stroke", "#33332f", "#d9d8d4"),
    (
        ".head,.head-sign,.start,.back",
        "fill",
        "#33332f",
        "#d9d8d4",
    ),
    (".lost .line,.lost .wait", "stroke", "#b3261e", "#ff8a80"),
    (".lost .start", "fill", "#b3261e", "#ff8a80"),
    (".break,.break-sign", "stroke", "#b3261e", "#ff8a80"),
    (".reason", "fill", "#b3261e", "#ff8a80"),
    (".cut", "fill", "#f4dcd5", "#47302b"),
    (".gone", "stroke", "#b3261e", "#ff8a80"),
    (".crash", "fill", "#b3261e", "#ff8a80"),
    (".hang,.held", "fill", "#a86400", "#e6a94a"),
    (".slow", "fill", "#7a6a00", "#cdbb4a"),
    (".moment", "stroke", "#a86400", "#e6a94a"),
    (".turn", "stroke", "#33332f", "#d9d8d4"),
    (
        ".absent,.hatch,.zigzag,.end",
        "stroke",
        "#8d8d86",
        "#7b7f86",
    ),
    (".query", "stroke", "#7c5aa6", "#b59add"),
];

/// What does not depend on the surroundings.
const SHAPES: &str = "\
.cars-diagram{font-family:'Helvetica Neue',Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;font-size:10.5px}
.cars-diagram .heading{font-size:12px}
.cars-diagram .name{font-size:12px;font-weight:600}
.cars-diagram .small{font-size:9px}
.cars-diagram .label{paint-order:stroke;stroke-width:3px;stroke-linejoin:round}
.cars-diagram rect.band{stroke-width:0.6}
.cars-diagram .line,.cars-diagram .wait{fill:none;stroke-width:1.1}
.cars-diagram .wait{stroke-dasharray:4 2}
.cars-diagram .break,.cars-diagram .break-sign{fill:none;stroke-width:1.8}
.cars-diagram .cut{fill-opacity:0.75}
.cars-diagram .hatch,.cars-diagram .gone,.cars-diagram .absent,.cars-diagram .zigzag{fill:none}
.cars-diagram .absent{stroke-dasharray:3 3}
.cars-diagram .hatch{stroke-width:0.9}
.cars-diagram .gone{stroke-width:1.8}
.cars-diagram .moment{stroke-dasharray:1 3}
.cars-diagram .turn{stroke-dasharray:6 3}
.cars-diagram .query{fill:none;stroke-width:1.2;stroke-dasharray:2 1.5}
.cars-diagram [data-tick]{cursor:pointer}
";

/// The style sheet of diagrams, which a diagram contains unless [`crate::diagram::Options::has_style`] is off. Its rules are for elements
/// of the class `cars-diagram` only.
#[must_use]
pub fn style() -> String {
    let mut sheet = SHAPES.to_owned();
    sheet += &colors(|light, _| light);
    sheet += "@media screen and (prefers-color-scheme:dark){\n";
    sheet += &colors(|_, dark| dark);
    sheet += "}\n";
    sheet
}

/// The class of areas in the color of an emotion; text on them has this class after `on-`.
pub(crate) fn emotion_class(name: &str) -> String {
    format!("e{}", palette::emotion(name))
}

/// The class of areas in the color of a behavior; text on them has this class after `on-`.
pub(crate) fn behavior_class(name: &str) -> String {
    format!("b{}", palette::behavior(name))
}

/// The rules with colors, of which one of two is chosen.
fn colors(choose: impl Fn(&'static str, &'static str) -> &'static str) -> String {
    let mut rules = String::new();
    for (selectors, property, light, dark) in COLORS {
        let color = choose(light, dark);
        for selector in selectors.split(',') {
            rule(&mut rules, selector, property, color);
        }
    }

    let shades = [("e", &EMOTION_SHADES[..]), ("b", &BEHAVIOR_SHADES[..])];
    for (prefix, shades) in shades {
        for (index, Shade { light, dark }) in shades.iter().enumerate() {
            let color = choose(light, dark);
            rule(&mut rules, &format!(".{prefix}{index}"), "fill", color);
            rule(
                &mut rules,
                &format!(".on-{prefix}{index}"),
                "fill",
                ink(color),
            );
        }
    }
    rules
}

fn rule(rules: &mut String, selector: &str, property: &str, value: &str) {
    // Infallible: it is written to memory.
    let _ = writeln!(rules, ".cars-diagram {selector}{{{property}:{value}}}");
}
