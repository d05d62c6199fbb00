//! The style sheets: light and dark on screens, light in print.
//!
//! Those of pictures have the class of their root element in each rule, so that they are put on any page. A diagram is a file of its
//! own, too: in its sheet light values come first and without variables, for programs that know neither variables nor media queries.

use std::fmt::Write;

use crate::palette::{ARM_SHADES, BEHAVIOR_SHADES, EMOTION_SHADES, HEAT_SHADES, NAMED, Shade, ink};

/// What all pictures have. `&` is the root element.
const PICTURE: &str = include_str!("style/picture.css");
/// What only diagrams have.
const DIAGRAM: &str = include_str!("style/diagram.css");
/// What only charts have.
const CHART: &str = include_str!("style/chart.css");
/// The page.
const PAGE: &str = include_str!("style/page.css");

/// Colors of one kind, and the letter with which their classes begin.
type Palette = (&'static str, &'static [Shade]);

/// Colors of emotions and behaviors.
const STATES: [Palette; 2] = [("e", &EMOTION_SHADES), ("b", &BEHAVIOR_SHADES)];
/// Colors of arms and quantities.
const AMOUNTS: [Palette; 2] = [("a", &ARM_SHADES), ("h", &HEAT_SHADES)];

/// The style sheet of diagrams, which a diagram contains unless [`crate::diagram::DiagramOptions::has_style`] is off. Its rules are for
/// elements of the class `cars-diagram` only.
#[must_use]
pub fn style() -> String {
    let rules = [PICTURE, DIAGRAM, &classes(&STATES)].concat();
    let rules = below(".cars-diagram", &rules);
    let mut dark = String::new();
    for rule in rules.lines().filter(|rule| rule.contains("var(")) {
        dark += rule;
        dark.push('\n');
    }

    let [light, dark] = [(rules, false), (dark, true)].map(|(rules, dark)| resolved(rules, dark));
    format!("{light}@media screen and (prefers-color-scheme:dark){{\n{dark}}}\n")
}

/// The style sheet of a page, with those of charts and diagrams.
pub(crate) fn sheet() -> String {
    let [light, dark] = [false, true].map(|is_dark| {
        let mut values = String::new();
        for (name, color) in variables(is_dark) {
            // Infallible: it is written to memory.
            let _ = write!(values, "--{name}:{color};");
        }
        values
    });
    format!(
        ":root{{{light}color-scheme:light dark}}\n\
         @media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n\
         @media print{{:root{{color-scheme:light}}}}\n{PAGE}{}{}",
        below(".chart", &chart_rules()),
        style()
    )
}

/// What charts have.
fn chart_rules() -> String {
    let mut charts = [PICTURE, CHART, &classes(&STATES), &classes(&AMOUNTS)].concat();
    for index in 0..ARM_SHADES.len() {
        let color = format!("var(--a{index})");
        let _ = writeln!(charts, ".curve.a{index}{{fill:none;stroke:{color}}}");
        let _ = writeln!(charts, ".dots.a{index}{{fill:none;stroke:{color}}}");
        let _ = writeln!(charts, ".mark.a{index}{{stroke:{color}}}");
        let _ = writeln!(charts, ".mark.hollow.a{index}{{fill:var(--paper)}}");
    }
    charts
}

/// The sheet of printed charts and diagrams: light, without variables.
pub(crate) fn printed_sheet() -> String {
    let diagrams = [PICTURE, DIAGRAM, &classes(&STATES)].concat();
    let rules = below(".chart", &chart_rules()) + &below(".cars-diagram", &diagrams);
    resolved(rules, false)
}

/// Rules with the values of their variables.
fn resolved(mut rules: String, is_dark: bool) -> String {
    for (name, color) in variables(is_dark) {
        rules = rules.replace(&format!("var(--{name})"), color);
    }
    rules
}

/// Names of all colors with their values.
fn variables(is_dark: bool) -> Vec<(String, &'static str)> {
    let value = |shade: Shade| if is_dark { shade.dark } else { shade.light };
    let mut variables = Vec::new();
    for (name, shade) in NAMED {
        variables.push((name.to_owned(), value(shade)));
    }
    for (prefix, shades) in STATES.into_iter().chain(AMOUNTS) {
        for (index, shade) in shades.iter().enumerate() {
            let color = value(*shade);
            variables.push((format!("{prefix}{index}"), color));
            variables.push((format!("on-{prefix}{index}"), ink(color)));
        }
    }
    variables
}

/// Classes of areas in these colors, and of text on them.
fn classes(palettes: &[Palette]) -> String {
    let mut rules = String::new();
    for (prefix, shades) in palettes {
        for index in 0..shades.len() {
            for name in [format!("{prefix}{index}"), format!("on-{prefix}{index}")] {
                // Infallible: it is written to memory.
                let _ = writeln!(rules, ".{name}{{fill:var(--{name})}}");
            }
        }
    }
    rules
}

/// Rules, one a line, for what is in an element.
fn below(root: &str, rules: &str) -> String {
    let mut all = String::new();
    for rule in rules.lines() {
        let (selectors, values) = rule.split_once('{').unwrap_or((rule, ""));
        let selectors = selectors.split(',').map(|selector| match selector {
            "&" => root.to_owned(),
            _ => format!("{root} {selector}"),
        });
        let selectors: Vec<String> = selectors.collect();
        // Infallible: it is written to memory.
        let _ = writeln!(all, "{}{{{values}", selectors.join(","));
    }
    all
}
