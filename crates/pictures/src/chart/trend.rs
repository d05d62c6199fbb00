//! Estimates over a factor that is a number: a line for each arm.

use crate::axis::draw_left;
use crate::chart::{
    ArmName, NAME_LETTERS, PANEL_PX, PlottedEstimate, begin, draw_estimate, draw_names, draw_runs,
    end, line_class,
};
use crate::labels::{widest_px, width_px};
use crate::markup::Markup;
use crate::number::{decimals_for, fixed};
use crate::scale::Scale;
use crate::shapes::{LABEL_PX, Pixel};

/// Height of the plot, pixels.
const PLOT_PX: f64 = 230.0;
/// Distance between the markers of two arms at the same value, pixels.
const DODGE_PX: f64 = 5.0;
/// Space between the ends of the plot and what is in it, pixels.
const MARGIN_PX: f64 = 16.0;

/// An estimate at a value of the factor.
#[derive(Debug, Clone)]
pub struct TrendPoint {
    /// The value of the factor.
    pub x: f64,
    /// The estimate.
    pub estimate: PlottedEstimate,
    /// The numbers of the runs that it is of, or of the pairs; they may be left out.
    pub runs: Vec<f64>,
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
    /// The values of the factor with their names, growing.
    pub levels: Vec<(f64, String)>,
    /// Ends of the axis of the measure.
    pub range: (f64, f64),
    /// A value that is marked by a horizontal line, such as no difference.
    pub reference: Option<f64>,
    /// The arms.
    pub lines: Vec<TrendLine>,
}

impl Trend {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let labels = self.lines.iter().map(|line| &line.label);
        let left = 44.0;
        let right = PANEL_PX - widest_px(labels, NAME_LETTERS).max(20.0) - 29.0;
        let top = 26.0;
        let bottom = top + PLOT_PX;

        let description = self.description();
        let mut svg = begin("trend", PANEL_PX, bottom + 36.0, &self.title, &description);
        svg.text("muted", 2.0, 12.0, "start", &self.y_axis);
        let y = Scale::new(self.range.0, self.range.1, bottom, top);
        draw_left(&mut svg, &y, left, right);
        if let Some(reference) = self.reference {
            let at = y.at(reference);
            svg.line("zero", &[(left, at), (right, at)]);
        }
        let first = self.levels.first().map_or(f64::NAN, |(x, _)| *x);
        let last = self.levels.last().map_or(f64::NAN, |(x, _)| *x);
        let x = Scale::new(first, last, left + MARGIN_PX, right - MARGIN_PX);
        self.draw_levels(&mut svg, &x, bottom);

        let count = self.lines.len() as f64;
        let dodge_px = self.dodge_px(&x);
        let aside_of = |index: usize| (index as f64 - (count - 1.0) / 2.0) * dodge_px;
        for (index, line) in self.lines.iter().enumerate() {
            for point in &line.points {
                let at = x.at(point.x) + aside_of(index);
                let run = |value, aside: f64| (at + aside * dodge_px, y.at(value));
                draw_runs(&mut svg, line.arm, &point.runs, run);
            }
        }
        for (index, line) in self.lines.iter().enumerate() {
            let aside = aside_of(index);
            self.draw_line(&mut svg, line, &x, &y, aside);
        }
        let name = |line| self.name(line);
        let names: Vec<ArmName<'_>> = self.lines.iter().map(name).collect();
        draw_names(&mut svg, &names, &y, right);
        end(svg)
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

    fn draw_levels(&self, svg: &mut Markup, x: &Scale, bottom: f64) {
        let (left, right) = (x.begin_px() - MARGIN_PX, x.end_px() + MARGIN_PX);
        svg.line("axis", &[(left, bottom), (right, bottom)]);

        let mut free_from = f64::NEG_INFINITY;
        for (value, name) in &self.levels {
            let at = x.at(*value);
            svg.line("axis", &[(at, bottom), (at, bottom + 4.0)]);

            let half_px = width_px(name, LABEL_PX) / 2.0;
            if at - half_px >= free_from {
                svg.text("tick", at, bottom + 16.0, "middle", name);
                free_from = at + half_px + 4.0;
            }
        }

        let middle = f64::midpoint(left, right);
        svg.text("muted", middle, bottom + 31.0, "middle", &self.x_axis);
    }

    fn draw_line(&self, svg: &mut Markup, line: &TrendLine, x: &Scale, y: &Scale, aside: f64) {
        let x_of = |level: f64| x.at(level) + aside;
        let points = line.points.iter();
        let points = points.map(|point| (x_of(point.x), y.at(point.estimate.value)));
        let points: Vec<Pixel> = points.collect();
        svg.line(&format!("{} thin", line_class(line.arm)), &points);

        for point in &line.points {
            let TrendPoint {
                x: level, estimate, ..
            } = point;
            svg.group("row", &self.point_title(line, *level, estimate));
            let at = |value| (x_of(*level), y.at(value));
            draw_estimate(svg, line.arm, estimate, at);
            svg.close("g");
        }
    }

    fn name<'a>(&self, line: &'a TrendLine) -> ArmName<'a> {
        let last = line.points.last();
        ArmName {
            label: &line.label,
            arm: line.arm,
            last: last.map_or(self.range.0, |point| point.estimate.value),
            has_marker: true,
        }
    }

    fn point_title(&self, line: &TrendLine, level: f64, estimate: &PlottedEstimate) -> String {
        let level = fixed(level, 4);
        let level = level.trim_end_matches('0').trim_end_matches('.');
        let numbers = estimate.words(decimals_for(self.range.1 - self.range.0));
        let (label, factor, n) = (&line.label, &self.x_axis, estimate.n);
        format!("{label}, {factor} {level}: {numbers}, n = {n}")
    }

    fn description(&self) -> String {
        let mut parts = Vec::new();
        for line in &self.lines {
            for point in &line.points {
                parts.push(self.point_title(line, point.x, &point.estimate));
            }
        }
        format!("{} over {}. {}", self.y_axis, self.x_axis, parts.join("; "))
    }
}
