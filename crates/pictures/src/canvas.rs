//! What all charts have in common: the root element, texts, lines, markers of arms.

use crate::markup::{Markup, number};

use crate::palette::ARMS;

/// Width of a panel, of which two are beside each other on a desk and one on a phone, pixels.
pub(crate) const PANEL_PX: f64 = 348.0;
/// Width of a chart across the page, pixels.
pub(crate) const WIDE_PX: f64 = 720.0;
/// Font of labels, pixels.
pub(crate) const LABEL_PX: f64 = 11.0;
/// Font of numbers in cells and of remarks, pixels.
pub(crate) const SMALL_PX: f64 = 9.5;

/// A chart that is being drawn.
pub(crate) struct Chart {
    pub(crate) svg: Markup,
}

impl Chart {
    /// Begins a chart. `title` and `description` are for those who cannot see it.
    pub(crate) fn begin(
        class: &str,
        width: f64,
        height: f64,
        title: &str,
        description: &str,
    ) -> Self {
        let mut svg = Markup::default();
        svg.tag("svg")
            .with("xmlns", "http://www.w3.org/2000/svg")
            .with("class", &format!("chart {class}"))
            .with(
                "viewBox",
                &format!("0 0 {} {}", number(width), number(height)),
            )
            .at("width", width)
            .at("height", height)
            .with("role", "img")
            .open();

        svg.title(title);
        svg.tag("desc").content(description);

        Self { svg }
    }

    /// The text of the chart.
    pub(crate) fn finish(mut self) -> String {
        self.svg.close("svg");
        self.svg.finish()
    }

    /// Opens a group with a description under the pointer.
    pub(crate) fn group(&mut self, class: &str, title: &str) {
        self.svg.tag("g").with("class", class).open();
        self.svg.title(title);
    }

    /// Closes a group.
    pub(crate) fn close(&mut self) {
        self.svg.close("g");
    }

    /// A text; `anchor` is `start`, `middle` or `end`.
    pub(crate) fn text(&mut self, class: &str, x: f64, y: f64, anchor: &str, text: &str) {
        let mut tag = self.svg.tag("text").at("x", x).at("y", y);
        if !class.is_empty() {
            tag = tag.with("class", class);
        }
        if anchor != "start" {
            tag = tag.with("text-anchor", anchor);
        }
        tag.content(text);
    }

    /// A text that runs upward and ends, or begins, at a point.
    pub(crate) fn upward(&mut self, class: &str, x: f64, y: f64, anchor: &str, text: &str) {
        self.svg
            .tag("text")
            .with("class", class)
            .with(
                "transform",
                &format!("translate({} {}) rotate(-90)", number(x), number(y)),
            )
            .with("text-anchor", anchor)
            .content(text);
    }

    /// A line from point to point.
    pub(crate) fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        self.path(class, &polyline(&[from, to]));
    }

    /// A path.
    pub(crate) fn path(&mut self, class: &str, data: &str) {
        self.svg
            .tag("path")
            .with("class", class)
            .with("d", data)
            .empty();
    }

    /// A rectangle.
    pub(crate) fn rect(&mut self, class: &str, x: f64, y: f64, width: f64, height: f64) {
        self.svg
            .tag("rect")
            .with("class", class)
            .at("x", x)
            .at("y", y)
            .at("width", width)
            .at("height", height)
            .empty();
    }

    /// The marker of an arm around a point: a shape of its own. It is hollow if it is not `is_filled`.
    pub(crate) fn marker(&mut self, arm: usize, (x, y): (f64, f64), is_filled: bool) {
        let fill = if is_filled { "mark" } else { "mark hollow" };
        let class = format!("{fill} {}", arm_class(arm));
        self.path(&class, &marker_shape(arm, x, y));
    }
}

/// The class of the color of an arm.
pub(crate) fn arm_class(arm: usize) -> String {
    format!("a{}", arm % ARMS)
}

/// The class of the line of an arm: color and dashes.
pub(crate) fn line_class(arm: usize) -> String {
    format!("curve {} d{}", arm_class(arm), dashes(arm))
}

/// Arms after the first ones have the same colors and other dashes.
fn dashes(arm: usize) -> usize {
    (arm % ARMS + arm / ARMS) % 4
}

/// The points of a line as path data.
pub(crate) fn polyline(points: &[(f64, f64)]) -> String {
    let mut data = String::new();
    for (index, (x, y)) in points.iter().enumerate() {
        let command = if index == 0 { "M" } else { "L" };
        data += &format!("{command}{} {}", number(*x), number(*y));
    }
    data
}

fn marker_shape(arm: usize, x: f64, y: f64) -> String {
    // Arms after the first ones have the same colors and other shapes.
    let shape = (arm % ARMS + arm / ARMS) % ARMS;
    let corners: &[(f64, f64)] = match shape {
        0 => {
            let x = number(x - 4.0);
            let y = number(y);
            return format!("M{x} {y}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z");
        }
        1 => &[(-3.6, -3.6), (3.6, -3.6), (3.6, 3.6), (-3.6, 3.6)],
        2 => &[(0.0, -4.8), (4.6, 3.6), (-4.6, 3.6)],
        3 => &[(0.0, -5.2), (5.2, 0.0), (0.0, 5.2), (-5.2, 0.0)],
        4 => &[(0.0, 4.8), (4.6, -3.6), (-4.6, -3.6)],
        5 => &[
            (-1.6, -4.8),
            (1.6, -4.8),
            (1.6, -1.6),
            (4.8, -1.6),
            (4.8, 1.6),
            (1.6, 1.6),
            (1.6, 4.8),
            (-1.6, 4.8),
            (-1.6, 1.6),
            (-4.8, 1.6),
            (-4.8, -1.6),
            (-1.6, -1.6),
        ],
        6 => &[(-4.8, 0.0), (3.6, -4.6), (3.6, 4.6)],
        _ => &[(4.8, 0.0), (-3.6, -4.6), (-3.6, 4.6)],
    };

    let points: Vec<(f64, f64)> = corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect();
    polyline(&points) + "z"
}
