//! Shapes of SVG.

use crate::markup::{Markup, Tag, number};
use crate::palette::StateLook;

/// Font of labels, pixels.
pub(crate) const LABEL_PX: f64 = 10.5;
/// Font of labels with little space, pixels.
pub(crate) const SMALL_PX: f64 = 10.0;

/// A place in a picture, pixels from its left and upper edge.
pub(crate) type Pixel = (f64, f64);

impl Markup {
    /// Begins the start tag of a picture.
    pub(crate) fn root(&mut self, class: &str, width: f64, height: f64) -> Tag<'_> {
        let view = format!("0 0 {} {}", number(width), number(height));
        self.tag("svg")
            .with("xmlns", "http://www.w3.org/2000/svg")
            .class(class)
            .with("viewBox", &view)
            .at("width", width)
            .at("height", height)
            .with("role", "img")
    }

    /// Opens a group of shapes with a description under the pointer.
    pub(crate) fn group(&mut self, class: &str, title: &str) {
        self.tag("g").class(class).open();
        self.title(title);
    }

    /// A text; `anchor` is `start`, `middle` or `end`.
    pub(crate) fn text(&mut self, class: &str, x: f64, y: f64, anchor: &str, text: &str) {
        let tag = self.tag("text").class(class).at("x", x).at("y", y);
        tag.anchor(anchor).content(text);
    }

    /// A text that runs upward.
    pub(crate) fn upward(&mut self, class: &str, x: f64, y: f64, anchor: &str, text: &str) {
        let turned = format!("translate({} {}) rotate(-90)", number(x), number(y));
        let tag = self.tag("text").class(class).with("transform", &turned);
        tag.anchor(anchor).content(text);
    }

    /// A path.
    pub(crate) fn path(&mut self, class: &str, data: &str) {
        self.tag("path").class(class).with("d", data).empty();
    }

    /// Straight lines through these points.
    pub(crate) fn line(&mut self, class: &str, points: &[Pixel]) {
        self.path(class, &polyline(points));
    }

    /// A rectangle.
    pub(crate) fn rect(&mut self, class: &str, (x, y): Pixel, width: f64, height: f64) {
        self.tag("rect")
            .class(class)
            .at("x", x)
            .at("y", y)
            .at("width", width)
            .at("height", height)
            .empty();
    }

    /// A rectangle in the color of an emotion or a behavior. `class` is what else its class has.
    pub(crate) fn state(&mut self, look: &StateLook, class: &str, place: Pixel, size: Pixel) {
        let (width, height) = size;
        let class = format!("{class} {}", look.class());
        self.rect(class.trim_start(), place, width, height);
        if look.hatching > 0 {
            self.path("over", &hatching(look.hatching, place, size));
        }
    }

    /// A cross.
    pub(crate) fn cross(&mut self, class: &str, (x, y): Pixel) {
        let (left, top, bottom) = (number(x - 4.0), number(y - 4.0), number(y + 4.0));
        self.path(class, &format!("M{left} {top}l8 8M{left} {bottom}l8 -8"));
    }

    /// A filled triangle whose tip is at `tip`, in the direction from `base`.
    pub(crate) fn triangle(&mut self, class: &str, base: Pixel, tip: Pixel) {
        const LENGTH_PX: f64 = 7.0;
        const HALF_WIDTH_PX: f64 = 3.0;
        let dx = tip.0 - base.0;
        let dy = tip.1 - base.1;
        let length = (dx * dx + dy * dy).sqrt().max(0.1);
        // Of length 1, along the line.
        let along = (dx / length, dy / length);

        let foot = (tip.0 - LENGTH_PX * along.0, tip.1 - LENGTH_PX * along.1);
        let aside = (HALF_WIDTH_PX * along.1, HALF_WIDTH_PX * along.0);
        let one = (foot.0 - aside.0, foot.1 + aside.1);
        let other = (foot.0 + aside.0, foot.1 - aside.1);
        self.line(class, &[tip, one, other]);
    }
}

impl Tag<'_> {
    /// The alignment of a text; `start` is the usual one.
    pub(crate) fn anchor(self, anchor: &str) -> Self {
        if anchor == "start" {
            return self;
        }
        self.with("text-anchor", anchor)
    }
}

/// Lines over a rectangle, as the data of a path: 1 is rising, 2 upright, 3 falling.
pub(crate) fn hatching(kind: usize, (left, top): Pixel, (width, height): Pixel) -> String {
    const STEP_PX: f64 = 5.0;
    let (right, bottom) = (left + width, top + height);
    let mut data = String::new();
    // How far a line goes to the right on its way from the lower to the upper edge.
    let slant = [0.0, height, 0.0, -height][kind % 4];
    // Lines of areas beside each other continue each other.
    let mut x = ((left - height) / STEP_PX).ceil() * STEP_PX;
    while x <= right + height {
        let at = |way: f64| (x + slant * way, bottom - height * way);
        let ways = [left, right].map(|edge| (edge - x) / slant);
        let (begin, end) = if slant == 0.0 {
            (0.0, if x > left && x < right { 1.0 } else { 0.0 })
        } else {
            let [one, other] = ways.map(|way| way.clamp(0.0, 1.0));
            (one.min(other), one.max(other))
        };
        if end - begin > 0.01 {
            data += &polyline(&[at(begin), at(end)]);
        }
        x += STEP_PX;
    }
    data
}

/// Straight lines through these points, as the data of a path.
pub(crate) fn polyline(points: &[Pixel]) -> String {
    let mut data = String::new();
    for (index, (x, y)) in points.iter().enumerate() {
        let command = if index == 0 { 'M' } else { 'L' };
        data += &format!("{command}{} {}", number(*x), number(*y));
    }
    data
}
