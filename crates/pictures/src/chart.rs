//! Charts, and what they have in common: the root element, and the looks of arms.

use crate::labels::{shortened, spread};
use crate::markup::{Markup, number};
use crate::number::typeset;
use crate::palette::ARMS;
use crate::scale::Scale;
use crate::shapes::{Pixel, polyline};

pub(crate) mod bands;
pub(crate) mod course;
pub(crate) mod floor;
pub(crate) mod intervals;
pub(crate) mod matrix;
pub(crate) mod outcome;
pub(crate) mod steps;
pub(crate) mod trend;

/// Width of a panel, of which two are beside each other on a desk and one on a phone, pixels.
pub(crate) const PANEL_PX: f64 = 348.0;
/// Width of a chart across the page, pixels.
pub(crate) const WIDE_PX: f64 = 720.0;
/// Most letters of a name beside the end of a line.
pub(crate) const NAME_LETTERS: usize = 16;

/// An estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlottedEstimate {
    /// The estimate.
    pub value: f64,
    /// Lower and upper end of its interval, if there is one.
    pub interval: Option<(f64, f64)>,
    /// Size of the sample.
    pub n: usize,
    /// Whether its marker is filled; otherwise it is hollow.
    pub is_filled: bool,
}

impl PlottedEstimate {
    /// The least and the most of the estimate and its interval.
    #[must_use]
    pub fn ends(&self) -> [f64; 2] {
        let (low, high) = self.interval.unwrap_or((self.value, self.value));
        [low.min(self.value), high.max(self.value)]
    }

    /// The number with its interval.
    fn words(&self, decimals: usize) -> String {
        let number = |value| typeset(value, decimals);
        let value = number(self.value);
        match self.interval {
            Some((low, high)) => format!("{value} [{}, {}]", number(low), number(high)),
            None => value,
        }
    }
}

/// Begins a chart. `title` and `description` are for those who cannot see it.
fn begin(kind: &str, width: f64, height: f64, title: &str, description: &str) -> Markup {
    let mut svg = Markup::default();
    svg.root(&format!("chart {kind}"), width, height).open();
    svg.title(title.trim_end());
    svg.tag("desc").content(description);
    svg
}

/// Ends a chart.
fn end(mut svg: Markup) -> String {
    svg.close("svg");
    svg.finish()
}

/// The class of the color of an arm.
fn arm_class(arm: usize) -> String {
    format!("a{}", arm % ARMS)
}

/// The class of the line of an arm: color and dashes. Arms after the first ones have the same colors and other dashes.
fn line_class(arm: usize) -> String {
    let dashes = (arm % ARMS + arm / ARMS) % 4;
    format!("curve {} d{dashes}", arm_class(arm))
}

/// Draws an arm's estimate with its interval. `at` is the place of a value.
fn draw_estimate(
    svg: &mut Markup,
    arm: usize,
    estimate: &PlottedEstimate,
    at: impl Fn(f64) -> Pixel,
) {
    if let Some((low, high)) = estimate.interval {
        let class = format!("curve solid {}", arm_class(arm));
        svg.line(&class, &[at(low), at(high)]);
    }
    draw_marker(svg, arm, at(estimate.value), estimate.is_filled);
}

/// Most runs that are drawn of an estimate.
const MAX_DOTS: usize = 100;
/// The part of 1 by which each dot is farther aside than the one before: the golden ratio, which spreads any number of them.
const ASIDE: f64 = 0.618_033_988_749_895;

/// Draws the numbers of the single runs that an estimate is of, spread aside so that they are seen beside each other. `at` is the place
/// of a value, and of how far it is aside, from -0.5 to 0.5. Of more than 100 runs as many are drawn, spread over their order.
fn draw_runs(svg: &mut Markup, arm: usize, runs: &[f64], at: impl Fn(f64, f64) -> Pixel) {
    let shown = runs.len().min(MAX_DOTS);
    if shown == 0 {
        return;
    }

    let mut sorted = runs.to_vec();
    if shown < runs.len() {
        sorted.sort_by(f64::total_cmp);
    }
    let mut dots = String::new();
    for index in 0..shown {
        let aside = (index as f64 * ASIDE).fract() - 0.5;
        let (x, y) = at(sorted[index * sorted.len() / shown], aside);
        dots += &format!("M{} {}h0", number(x), number(y));
    }
    svg.path(&format!("dots {}", arm_class(arm)), &dots);
}

/// Draws the marker of an arm around a point: a shape of its own.
fn draw_marker(svg: &mut Markup, arm: usize, point: Pixel, is_filled: bool) {
    let fill = if is_filled { "mark" } else { "mark hollow" };
    let class = format!("{fill} {}", arm_class(arm));
    svg.path(&class, &marker_shape(arm, point));
}

fn marker_shape(arm: usize, (x, y): Pixel) -> String {
    // Arms after the first ones have the same colors and other shapes.
    let shape = (arm % ARMS + arm / ARMS) % ARMS;
    let corners: &[Pixel] = match shape {
        0 => {
            let (x, y) = (number(x - 4.0), number(y));
            return format!("M{x} {y}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z");
        }
        1 => &[(-3.6, -3.6), (3.6, -3.6), (3.6, 3.6), (-3.6, 3.6)],
        2 => &[(0.0, -4.8), (4.6, 3.6), (-4.6, 3.6)],
        3 => &[(0.0, -5.2), (5.2, 0.0), (0.0, 5.2), (-5.2, 0.0)],
        4 => &[(0.0, 4.8), (4.6, -3.6), (-4.6, -3.6)],
        5 => {
            let (left, top) = (number(x - 1.6), number(y - 4.8));
            let (right, bottom) = ("h3.2v3.2h3.2v3.2h-3.2v3.2", "h-3.2v-3.2h-3.2v-3.2h3.2z");
            return format!("M{left} {top}{right}{bottom}");
        }
        6 => &[(-4.8, 0.0), (3.6, -4.6), (3.6, 4.6)],
        _ => &[(4.8, 0.0), (-3.6, -4.6), (-3.6, 4.6)],
    };
    let points: Vec<Pixel> = corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect();
    polyline(&points) + "z"
}

/// An arm at the right of a plot.
struct ArmName<'a> {
    label: &'a str,
    arm: usize,
    /// The value at the end of its line.
    last: f64,
    has_marker: bool,
}

/// Draws the names of arms beside the ends of their lines, none over another one.
fn draw_names(svg: &mut Markup, names: &[ArmName<'_>], y: &Scale, right: f64) {
    let wanted: Vec<f64> = names.iter().map(|name| y.at(name.last)).collect();
    let places = spread(&wanted, 14.0, (y.end_px(), y.begin_px()));
    for ((name, wanted), place) in names.iter().zip(wanted).zip(places) {
        svg.line("leader", &[(right, wanted), (right + 6.0, place)]);
        let sample = [(right + 6.0, place), (right + 24.0, place)];
        svg.line(&line_class(name.arm), &sample);
        if name.has_marker {
            draw_marker(svg, name.arm, (right + 15.0, place), true);
        }
        let label = shortened(name.label, NAME_LETTERS);
        svg.text("", right + 28.0, place + 4.0, "start", &label);
    }
}
