//! Estimates over a factor that is a number: a line for each arm.

use crate::diagram::{shortened, width_px};

use crate::axis::draw_left;
use crate::canvas::{Chart, LABEL_PX, PANEL_PX, line_class, polyline};
use crate::chart::intervals::Estimate;
use crate::labels::spread;
use crate::number::{fixed, typeset};
use crate::palette::ARMS;
use crate::scale::Scale;

/// Height of the plot, pixels.
const PLOT_PX: f64 = 230.0;
/// Most letters of a name.
const LABEL_LETTERS: usize = 16;
/// Distance between the markers of two arms at the same value, pixels.
const DODGE_PX: f64 = 5.0;

/// An estimate at a value of the factor.
#[derive(Debug, Clone)]
pub struct TrendPoint {
    /// Value of the factor.
    pub x: f64,
    /// The estimate.
    pub estimate: Estimate,
    /// Whether the marker is filled; otherwise it is hollow.
    pub is_filled: bool,
}

/// An arm.
#[derive(Debug, Clone)]
pub struct TrendLine {
    /// Its name.
    pub label: String,
    /// Its index, which has its color, marker and dashes.
    pub arm: usize,
    /// Its estimates, with growing values of the factor.
    pub points: Vec<TrendPoint>,
}

/// A chart of a measure over a factor.
#[derive(Debug, Clone)]
pub struct Trend {
    /// Name of the chart.
    pub title: String,
    /// Name of the factor.
    pub x_axis: String,
    /// Name and unit of the measure.
    pub y_axis: String,
    /// The values of the factor with their names.
    pub levels: Vec<(f64, String)>,
    /// Ends of the axis of the measure.
    pub range: (f64, f64),
    /// Decimals of the numbers.
    pub decimals: usize,
    /// A value that is marked by a horizontal line, such as no difference.
    pub reference: Option<f64>,
    /// The arms.
    pub lines: Vec<TrendLine>,
}

impl Trend {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let left = 44.0;
        let right = PANEL_PX - self.labels_px() - 22.0;
        let top = 26.0;
        let bottom = top + PLOT_PX;

        let description = self.description();
        let mut chart = Chart::begin("trend", PANEL_PX, bottom + 36.0, &self.title, &description);
        chart.text("muted", 2.0, 12.0, "start", &self.y_axis);
        let y = Scale::new(self.range.0, self.range.1, bottom, top);
        draw_left(&mut chart, &y, left, right);
        if let Some(reference) = self.reference {
            let at = y.at(reference);
            chart.line("zero", (left, at), (right, at));
        }
        let margin = 16.0;
        let (first, last) = self.ends();
        let x = Scale::new(first, last, left + margin, right - margin);
        self.draw_levels(&mut chart, &x, (left, right), bottom);

        let count = self.lines.len() as f64;
        let dodge_px = self.dodge_px(&x);
        for (index, line) in self.lines.iter().enumerate() {
            let aside = (index as f64 - (count - 1.0) / 2.0) * dodge_px;
            self.draw_line(&mut chart, line, &x, &y, aside);
        }
        self.draw_names(&mut chart, &y, right, (top, bottom));
        chart.finish()
    }

    fn ends(&self) -> (f64, f64) {
        let first = self
            .levels
            .iter()
            .map(|(x, _)| *x)
            .fold(f64::INFINITY, f64::min);
        let last = self
            .levels
            .iter()
            .map(|(x, _)| *x)
            .fold(f64::NEG_INFINITY, f64::max);
        (first, last)
    }

    /// Distance between the markers of two arms: all arms at a value are nearer to it than to the next one.
    fn dodge_px(&self, x: &Scale) -> f64 {
        let mut least_px = f64::INFINITY;
        for pair in self.levels.windows(2) {
            least_px = least_px.min((x.at(pair[1].0) - x.at(pair[0].0)).abs());
        }
        let gaps = (self.lines.len() as f64 - 1.0).max(1.0);
        DODGE_PX.min(24.0 / gaps).min(0.6 * least_px / gaps)
    }

    fn draw_levels(&self, chart: &mut Chart, x: &Scale, (left, right): (f64, f64), bottom: f64) {
        chart.line("axis", (left, bottom), (right, bottom));

        let mut free_from = f64::NEG_INFINITY;
        for (value, name) in &self.levels {
            let at = x.at(*value);
            chart.line("axis", (at, bottom), (at, bottom + 4.0));

            let half_px = width_px(name, LABEL_PX) / 2.0;
            if at - half_px >= free_from {
                chart.text("tick", at, bottom + 16.0, "middle", name);
                free_from = at + half_px + 4.0;
            }
        }

        let middle = f64::midpoint(left, right);
        chart.text("muted", middle, bottom + 31.0, "middle", &self.x_axis);
    }

    fn draw_line(&self, chart: &mut Chart, line: &TrendLine, x: &Scale, y: &Scale, aside: f64) {
        let mut points = Vec::new();
        for point in &line.points {
            points.push((x.at(point.x) + aside, y.at(point.estimate.value)));
        }
        chart.path(
            &format!("{} thin", line_class(line.arm)),
            &polyline(&points),
        );

        for (point, place) in line.points.iter().zip(points) {
            chart.group("row", &self.point_title(line, point));
            if let Some((low, high)) = point.estimate.interval {
                let class = format!("curve solid a{}", line.arm % ARMS);
                chart.line(&class, (place.0, y.at(low)), (place.0, y.at(high)));
            }
            chart.marker(line.arm, place, point.is_filled);
            chart.close();
        }
    }

    /// Names beside the ends of the lines, none over another one.
    fn draw_names(&self, chart: &mut Chart, y: &Scale, right: f64, ends: (f64, f64)) {
        let mut wanted = Vec::new();
        for line in &self.lines {
            let last = line.points.last();
            wanted.push(last.map_or(ends.1, |point| y.at(point.estimate.value)));
        }
        let places = spread(&wanted, 14.0, ends);
        for ((line, wanted), place) in self.lines.iter().zip(wanted).zip(places) {
            chart.line("leader", (right - 4.0, wanted), (right + 6.0, place));
            chart.marker(line.arm, (right + 13.0, place), true);
            let name = shortened(&line.label, LABEL_LETTERS);
            chart.text("", right + 21.0, place + 4.0, "start", &name);
        }
    }

    fn point_title(&self, line: &TrendLine, point: &TrendPoint) -> String {
        let estimate = point.estimate;
        let mut text = format!(
            "{}, {} {}: {}",
            line.label,
            self.x_axis,
            fixed_level(point.x),
            typeset(estimate.value, self.decimals)
        );
        if let Some((low, high)) = estimate.interval {
            let low = typeset(low, self.decimals);
            let high = typeset(high, self.decimals);
            text += &format!(" [{low}, {high}]");
        }

        text + &format!(", n = {}", estimate.n)
    }

    fn description(&self) -> String {
        let mut parts = Vec::new();
        for line in &self.lines {
            for point in &line.points {
                parts.push(self.point_title(line, point));
            }
        }
        format!("{} over {}. {}", self.y_axis, self.x_axis, parts.join("; "))
    }

    fn labels_px(&self) -> f64 {
        let mut widest: f64 = 20.0;
        for line in &self.lines {
            widest = widest.max(width_px(&shortened(&line.label, LABEL_LETTERS), LABEL_PX));
        }
        widest
    }
}

/// A value of a factor, as short as it can be.
fn fixed_level(value: f64) -> String {
    let text = fixed(value, 4);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
