//! The style sheet of printed pictures: which rules an element of a picture of this crate matches.
//!
//! Sheets are text of this program, one rule a line, with selectors of tags, classes and attributes in elements that contain each other.

use roxmltree::Node;

/// A color, red, green and blue.
pub(crate) type Color = [u8; 3];

/// How a shape is drawn.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Paint {
    pub(crate) fill: Option<Color>,
    pub(crate) fill_opacity: f64,
    pub(crate) stroke: Option<Color>,
    pub(crate) stroke_opacity: f64,
    /// Width of a stroke, pixels.
    pub(crate) width: f64,
    /// Lengths of dashes and of the gaps between them, pixels; none if the line is solid.
    pub(crate) dashes: Vec<f64>,
    pub(crate) is_round: bool,
    /// Whether the ends of lines are round.
    pub(crate) has_round_ends: bool,
    /// Whether the stroke is behind the filling.
    pub(crate) is_stroke_behind: bool,
    pub(crate) font_px: f64,
    pub(crate) is_bold: bool,
}

impl Default for Paint {
    fn default() -> Self {
        Self {
            fill: Some([0, 0, 0]),
            fill_opacity: 1.0,
            stroke: None,
            stroke_opacity: 1.0,
            width: 1.0,
            dashes: Vec::new(),
            is_round: false,
            has_round_ends: false,
            is_stroke_behind: false,
            font_px: 10.5,
            is_bold: false,
        }
    }
}

impl Paint {
    /// Only filled.
    pub(crate) fn filled(color: Color) -> Self {
        Self {
            fill: Some(color),
            ..Self::default()
        }
    }

    fn set(&mut self, name: &str, value: &str) {
        match name {
            "fill" => self.fill = color(value),
            "fill-opacity" => self.fill_opacity = length(value),
            "stroke" => self.stroke = color(value),
            "stroke-opacity" => self.stroke_opacity = length(value),
            "stroke-width" => self.width = length(value),
            "stroke-dasharray" if value == "none" => self.dashes.clear(),
            "stroke-dasharray" => self.dashes = value.split(' ').map(length).collect(),
            "stroke-linejoin" => self.is_round = value == "round",
            "stroke-linecap" => self.has_round_ends = value == "round",
            "paint-order" => self.is_stroke_behind = value == "stroke",
            "font-size" => self.font_px = length(value),
            "font-weight" => self.is_bold = value == "600",
            _ => {}
        }
    }
}

/// A color of a style sheet; `None` for `none`.
pub(crate) fn color(value: &str) -> Option<Color> {
    let digits = value.strip_prefix('#')?;
    let channel = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    Some([channel(0)?, channel(2)?, channel(4)?])
}

fn length(value: &str) -> f64 {
    value.trim_end_matches("px").parse().unwrap_or(0.0)
}

/// A style sheet.
#[derive(Debug)]
pub(crate) struct Sheet {
    /// The rules, those that others outweigh first.
    rules: Vec<StyleRule>,
}

#[derive(Debug)]
struct StyleRule {
    /// From the outermost element to the one that is drawn.
    selector: Vec<Compound>,
    values: Vec<(String, String)>,
}

/// What one element has to be: `rect.band`, `[data-tick]`.
#[derive(Debug, Default)]
struct Compound {
    tag: String,
    classes: Vec<String>,
    attribute: String,
}

impl Sheet {
    /// Reads a sheet.
    pub(crate) fn new(text: &str) -> Self {
        let mut rules = Vec::new();
        for line in text.lines() {
            let Some((selectors, values)) = line.split_once('{') else {
                continue;
            };
            let values = values.trim_end_matches('}').split(';');
            let values = values.filter_map(|value| value.split_once(':'));
            let values: Vec<(String, String)> = values
                .map(|(name, value)| (name.to_owned(), value.to_owned()))
                .collect();
            for selector in selectors.split(',') {
                rules.push(StyleRule {
                    selector: selector.split(' ').map(Compound::new).collect(),
                    values: values.clone(),
                });
            }
        }
        // A stable sort: of equal rules the last one counts.
        rules.sort_by_key(StyleRule::weight);
        Self { rules }
    }

    /// How an element is drawn in one that is drawn so.
    pub(crate) fn paint(&self, element: Node<'_, '_>, parent: &Paint) -> Paint {
        let mut paint = parent.clone();
        for rule in &self.rules {
            if rule.matches(element) {
                for (name, value) in &rule.values {
                    paint.set(name, value);
                }
            }
        }
        paint
    }
}

impl StyleRule {
    fn weight(&self) -> (usize, usize) {
        let parts = self.selector.iter();
        let classes = parts
            .clone()
            .map(|part| part.classes.len() + usize::from(!part.attribute.is_empty()));
        let tags = parts.filter(|part| !part.tag.is_empty());
        (classes.sum(), tags.count())
    }

    fn matches(&self, element: Node<'_, '_>) -> bool {
        let mut parts = self.selector.iter().rev();
        if !parts.next().is_some_and(|part| part.matches(element)) {
            return false;
        }
        let mut around = element.ancestors().skip(1);
        parts.all(|part| around.any(|node| part.matches(node)))
    }
}

impl Compound {
    fn new(text: &str) -> Self {
        let (text, attribute) = text.split_once('[').unwrap_or((text, ""));
        let mut parts = text.split('.');
        Self {
            tag: parts.next().unwrap_or_default().to_owned(),
            classes: parts.map(str::to_owned).collect(),
            attribute: attribute.trim_end_matches(']').to_owned(),
        }
    }

    fn matches(&self, element: Node<'_, '_>) -> bool {
        let classes = element.attribute("class").unwrap_or_default();
        let has_class = |class: &String| classes.split(' ').any(|one| one == class);
        (self.tag.is_empty() || element.has_tag_name(self.tag.as_str()))
            && self.classes.iter().all(has_class)
            && (self.attribute.is_empty() || element.has_attribute(self.attribute.as_str()))
    }
}
