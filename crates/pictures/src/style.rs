//! The style sheet of a report: light and dark on screens, light in print.

use std::fmt::Write;

use crate::diagram::palette::{BEHAVIOR_SHADES, EMOTION_SHADES, Shade, ink};

use crate::palette::{ARM_SHADES, HEAT_SHADES};

/// Colors of the page: name, light, dark.
const COLORS: [(&str, &str, &str); 10] = [
    ("paper", "#ffffff", "#1b1d20"),
    ("soft", "#f5f5f2", "#24272b"),
    ("ink", "#1f1f1c", "#e9e8e4"),
    ("muted", "#66665f", "#a2a5ab"),
    ("rule", "#d9d9d4", "#3a3d42"),
    ("grid", "#ebebe8", "#2c2f34"),
    ("axis", "#8d8d86", "#7b7f86"),
    ("link", "#0b5c8a", "#7cc0e8"),
    ("none", "#fbfbfa", "#1f2225"),
    ("obstacle", "#4a4a45", "#b9b8b2"),
];

/// What does not depend on light and dark.
const SHAPES: &str = include_str!("page.css");

/// The style sheet of the page, with that of diagrams.
pub(crate) fn sheet() -> String {
    let mut sheet = String::new();
    sheet += ":root{";
    sheet += &variables(|_, light, _| light);
    sheet += "color-scheme:light dark}\n@media screen and (prefers-color-scheme:dark){:root{";
    sheet += &variables(|_, _, dark| dark);
    sheet += "}}\n@media print{:root{color-scheme:light}}\n";
    sheet += SHAPES;
    sheet += &classes();
    sheet += &crate::diagram::style();
    sheet
}

/// Sets of colors and the prefix of their classes.
fn palettes() -> [(&'static str, &'static [Shade]); 4] {
    [
        ("e", &EMOTION_SHADES),
        ("b", &BEHAVIOR_SHADES),
        ("a", &ARM_SHADES),
        ("h", &HEAT_SHADES),
    ]
}

/// The variables of one of light and dark.
fn variables(choose: impl Fn(&'static str, &'static str, &'static str) -> &'static str) -> String {
    let mut rules = String::new();
    for (name, light, dark) in COLORS {
        let color = choose(name, light, dark);
        // Infallible: it is written to memory.
        let _ = write!(rules, "--{name}:{color};");
    }

    for (prefix, shades) in palettes() {
        for (index, Shade { light, dark }) in shades.iter().enumerate() {
            let color = choose(prefix, light, dark);
            let ink = ink(color);
            let _ = write!(
                rules,
                "--{prefix}{index}:{color};--on-{prefix}{index}:{ink};"
            );
        }
    }

    rules
}

/// The classes of colors in charts.
fn classes() -> String {
    let mut rules = String::new();
    for (prefix, shades) in palettes() {
        for index in 0..shades.len() {
            let name = format!("{prefix}{index}");
            // Infallible: it is written to memory.
            let _ = writeln!(
                rules,
                ".chart .{name}{{fill:var(--{name})}}.chart .on-{name}{{fill:var(--on-{name})}}"
            );
        }
    }

    for index in 0..ARM_SHADES.len() {
        let color = format!("var(--a{index})");
        let _ = writeln!(
            rules,
            ".chart .curve.a{index}{{fill:none;stroke:{color}}}.chart .mark.a{index}{{stroke:{color}}}.chart .mark.hollow.a{index}{{fill:var(--paper)}}"
        );
    }

    rules
}
