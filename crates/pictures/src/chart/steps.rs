//! Step functions of arms: survival curves with bands and numbers at risk, and empirical distribution functions.

use crate::markup::number;
use crate::diagram::{shortened, width_px};

use crate::axis::{draw_below, draw_left};
use crate::canvas::{Chart, LABEL_PX, PANEL_PX, line_class};
use crate::labels::spread;
use crate::number::fixed;
use crate::palette::ARMS;
use crate::scale::Scale;

/// Height of the plot, pixels.
const PLOT_PX: f64 = 190.0;
/// Most letters of a name.
const LABEL_LETTERS: usize = 16;
/// Height of a row of numbers at risk, pixels.
const ROW_PX: f64 = 15.0;
/// Steps closer than this are drawn as one, pixels.
const STEP_PX: f64 = 0.25;
/// Half the height of the mark of a censored time, pixels.
const TICK_PX: f64 = 3.5;

/// A step of a curve: from `x` on it has the share `y`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Where it is.
    pub x: f64,
    /// Share from there on, 0 to 1.
    pub y: f64,
    /// Ends of the band from there on, if there is one.
    pub band: Option<(f64, f64)>,
}

/// The curve of an arm.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Name of the arm.
    pub label: String,
    /// Index of the arm, which has its color and dashes.
    pub arm: usize,
    /// Share before the first step.
    pub begin: f64,
    /// The steps, with growing `x`.
    pub steps: Vec<Step>,
    /// Where the curve ends.
    pub end: f64,
    /// Where runs were censored.
    pub censored: Vec<f64>,
    /// Number of runs at risk at each time of the chart's table, if it has one.
    pub at_risk: Vec<usize>,
}

/// A chart of step functions.
#[derive(Debug, Clone)]
pub struct Steps {
    /// Name of the chart.
    pub title: String,
    /// Name and unit of the horizontal axis.
    pub x_axis: String,
    /// Name of the shares.
    pub y_axis: String,
    /// Ends of the horizontal axis.
    pub range: (f64, f64),
    /// Times below which a table has the numbers of runs at risk, if there is one.
    pub at_risk: Option<Vec<f64>>,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl Steps {
    /// The chart as SVG. Steps that cannot be told apart are drawn as one.
    #[must_use]
    pub fn draw(&self) -> String {
        let left = 34.0_f64.max(if self.at_risk.is_some() {
            self.labels_px() + 14.0
        } else {
            0.0
        });
        let right = PANEL_PX - self.labels_px() - 28.0;
        let top = 24.0;
        let bottom = top + PLOT_PX;
        let rows = self
            .at_risk
            .as_ref()
            .map_or(0.0, |_| self.curves.len() as f64 + 1.2);
        let height = bottom + 38.0 + rows * ROW_PX;

        let description = self.description();
        let mut chart = Chart::begin("steps", PANEL_PX, height, &self.title, &description);
        chart.text("muted", 2.0, 12.0, "start", &self.y_axis);
        let x = Scale::new(self.range.0, self.range.1, left, right);
        let y = Scale::new(0.0, 1.0, bottom, top);
        draw_left(&mut chart, &y, left, right);
        draw_below(&mut chart, &x, top, bottom, &self.x_axis);
        for curve in &self.curves {
            draw_ribbon(&mut chart, curve, &x, &y);
        }
        for curve in &self.curves {
            draw_curve(&mut chart, curve, &x, &y);
        }
        self.draw_names(&mut chart, &y, right, (top, bottom));
        if let Some(times) = &self.at_risk {
            self.draw_at_risk(&mut chart, times, &x, bottom + 52.0);
        }
        chart.finish()
    }

    fn draw_names(&self, chart: &mut Chart, y: &Scale, right: f64, ends: (f64, f64)) {
        let wanted: Vec<f64> = self.curves.iter().map(|curve| y.at(curve.last())).collect();
        let places = spread(&wanted, 13.0, ends);
        for ((curve, wanted), place) in self.curves.iter().zip(wanted).zip(places) {
            chart.line("leader", (right, wanted), (right + 6.0, place));
            let sample = ((right + 6.0, place), (right + 24.0, place));
            chart.line(&line_class(curve.arm), sample.0, sample.1);
            let name = shortened(&curve.label, LABEL_LETTERS);
            chart.text("", right + 28.0, place + 4.0, "start", &name);
        }
    }

    fn draw_at_risk(&self, chart: &mut Chart, times: &[f64], x: &Scale, top: f64) {
        chart.text("muted", 2.0, top, "start", "at risk");
        for (index, curve) in self.curves.iter().enumerate() {
            let baseline = top + (index + 1) as f64 * ROW_PX;
            let name = shortened(&curve.label, LABEL_LETTERS);
            chart.text("tick", x.from_px - 14.0, baseline, "end", &name);
            for (time, count) in times.iter().zip(&curve.at_risk) {
                chart.text("tick", x.at(*time), baseline, "middle", &count.to_string());
            }
        }
    }

    fn description(&self) -> String {
        let mut parts = Vec::new();
        for curve in &self.curves {
            parts.push(format!(
                "{} ends at {} after {} steps",
                curve.label,
                fixed(curve.last(), 3),
                curve.steps.len()
            ));
        }
        format!("{} over {}. {}", self.y_axis, self.x_axis, parts.join("; "))
    }

    fn labels_px(&self) -> f64 {
        let mut widest: f64 = 20.0;
        for curve in &self.curves {
            widest = widest.max(width_px(&shortened(&curve.label, LABEL_LETTERS), LABEL_PX));
        }
        widest
    }
}

impl Curve {
    /// Share at the end.
    fn last(&self) -> f64 {
        self.steps.last().map_or(self.begin, |step| step.y)
    }

    /// The last step before each place of the picture.
    fn visible(&self, x: &Scale) -> Vec<Step> {
        let mut visible: Vec<Step> = Vec::new();
        for step in &self.steps {
            let is_beside = visible
                .last()
                .is_some_and(|last| x.at(step.x) - x.at(last.x) < STEP_PX);
            match visible.last_mut() {
                Some(last) if is_beside => {
                    last.y = step.y;
                    last.band = step.band;
                }
                _ => visible.push(*step),
            }
        }

        visible
    }

    /// Share at a place.
    fn at(&self, place: f64) -> f64 {
        let next = self.steps.partition_point(|step| step.x <= place);
        match next.checked_sub(1) {
            Some(index) => self.steps[index].y,
            None => self.begin,
        }
    }
}

fn draw_curve(chart: &mut Chart, curve: &Curve, x: &Scale, y: &Scale) {
    let mut path = format!("M{} {}", number(x.from_px), number(y.at(curve.begin)));
    for step in curve.visible(x) {
        path += &format!("H{}V{}", number(x.at(step.x)), number(y.at(step.y)));
    }
    path += &format!("H{}", number(x.at(curve.end)));
    chart.group("curve-of", &curve.label);
    chart.path(&line_class(curve.arm), &path);

    let mut ticks = String::new();
    let mut last_px = f64::NEG_INFINITY;
    for place in &curve.censored {
        let at = x.at(*place);
        if at - last_px >= 1.0 {
            let middle = y.at(curve.at(*place));
            ticks += &format!(
                "M{} {}v{}",
                number(at),
                number(middle - TICK_PX),
                number(2.0 * TICK_PX)
            );
            last_px = at;
        }
    }
    if !ticks.is_empty() {
        chart.path(&format!("curve solid thin a{}", curve.arm % ARMS), &ticks);
    }
    chart.close();
}

fn draw_ribbon(chart: &mut Chart, curve: &Curve, x: &Scale, y: &Scale) {
    let steps = curve.visible(x);
    if steps.iter().all(|step| step.band.is_none()) {
        return;
    }

    let mut upper = format!("M{} {}", number(x.from_px), number(y.at(curve.begin)));
    let mut lower = Vec::new();
    for step in &steps {
        let band = step.band.unwrap_or((step.y, step.y));
        let at = number(x.at(step.x));
        upper += &format!("H{at}V{}", number(y.at(band.1)));
        lower.push(format!("V{}H{at}", number(y.at(band.0))));
    }
    upper += &format!("H{}", number(x.at(curve.end)));
    let mut path = upper;
    for part in lower.iter().rev() {
        path += part;
    }
    path += &format!("V{}H{}z", number(y.at(curve.begin)), number(x.from_px));
    chart.path(&format!("ribbon a{}", curve.arm % ARMS), &path);
}
