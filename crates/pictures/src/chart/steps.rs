//! Step functions of arms: survival curves with bands and numbers at risk, and empirical distribution functions.

use crate::axis::{draw_below, draw_left};
use crate::chart::{
    ArmName, NAME_LETTERS, PANEL_PX, arm_class, begin, draw_names, end, line_class,
};
use crate::labels::{shortened, widest_px};
use crate::markup::{Markup, number};
use crate::number::fixed;
use crate::scale::Scale;

/// Height of the plot, pixels.
const PLOT_PX: f64 = 190.0;
/// Height of a row of numbers at risk, pixels.
const ROW_PX: f64 = 15.0;
/// Steps closer than this are drawn as one, pixels.
const STEP_PX: f64 = 0.25;

/// A step of a curve: from `x` on it has the share `y`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveStep {
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
    pub steps: Vec<CurveStep>,
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
    /// Name of the svg.
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
        let labels = self.curves.iter().map(|curve| &curve.label);
        let labels_px = widest_px(labels, NAME_LETTERS).max(20.0);
        let (left, rows) = match self.at_risk {
            Some(_) => (labels_px + 14.0, self.curves.len() as f64 + 1.2),
            None => (34.0, 0.0),
        };
        let right = PANEL_PX - labels_px - 28.0;
        let top = 24.0;
        let bottom = top + PLOT_PX;
        let height = bottom + 38.0 + rows * ROW_PX;

        let description = self.description();
        let mut svg = begin("steps", PANEL_PX, height, &self.title, &description);
        svg.text("muted", 2.0, 12.0, "start", &self.y_axis);
        let x = Scale::new(self.range.0, self.range.1, left, right);
        let y = Scale::new(0.0, 1.0, bottom, top);
        draw_left(&mut svg, &y, left, right);
        draw_below(&mut svg, &x, top, bottom, &self.x_axis);
        for curve in &self.curves {
            draw_ribbon(&mut svg, curve, &x, &y);
        }
        for curve in &self.curves {
            draw_curve(&mut svg, curve, &x, &y);
        }
        let names: Vec<ArmName<'_>> = self.curves.iter().map(Curve::name).collect();
        draw_names(&mut svg, &names, &y, right);
        if let Some(times) = &self.at_risk {
            self.draw_at_risk(&mut svg, times, &x, bottom + 52.0);
        }
        end(svg)
    }

    fn draw_at_risk(&self, svg: &mut Markup, times: &[f64], x: &Scale, top: f64) {
        svg.text("muted", 2.0, top, "start", "at risk");
        for (index, curve) in self.curves.iter().enumerate() {
            let baseline = top + (index + 1) as f64 * ROW_PX;
            let name = shortened(&curve.label, NAME_LETTERS);
            svg.text("tick", x.begin_px() - 14.0, baseline, "end", &name);
            for (time, count) in times.iter().zip(&curve.at_risk) {
                svg.text("tick", x.at(*time), baseline, "middle", &count.to_string());
            }
        }
    }

    fn description(&self) -> String {
        let mut parts = Vec::new();
        for curve in &self.curves {
            let last = fixed(curve.last(), 3);
            let steps = curve.steps.len();
            parts.push(format!(
                "{} ends at {last} after {steps} steps",
                curve.label
            ));
        }
        format!("{} over {}. {}", self.y_axis, self.x_axis, parts.join("; "))
    }
}

impl Curve {
    /// Share at the end.
    fn last(&self) -> f64 {
        self.steps.last().map_or(self.begin, |step| step.y)
    }

    fn name(&self) -> ArmName<'_> {
        ArmName {
            label: &self.label,
            arm: self.arm,
            last: self.last(),
            has_marker: false,
        }
    }

    /// The last step before each place of the picture.
    fn visible(&self, x: &Scale) -> Vec<CurveStep> {
        let mut visible: Vec<CurveStep> = Vec::new();
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
    pub(crate) fn at(&self, place: f64) -> f64 {
        let next = self.steps.partition_point(|step| step.x <= place);
        match next.checked_sub(1) {
            Some(index) => self.steps[index].y,
            None => self.begin,
        }
    }
}

fn draw_curve(svg: &mut Markup, curve: &Curve, x: &Scale, y: &Scale) {
    let mut path = format!("M{} {}", number(x.begin_px()), number(y.at(curve.begin)));
    for step in curve.visible(x) {
        path += &format!("H{}V{}", number(x.at(step.x)), number(y.at(step.y)));
    }
    path += &format!("H{}", number(x.at(curve.end)));
    svg.group("curve-of", &curve.label);
    svg.path(&line_class(curve.arm), &path);

    let mut ticks = String::new();
    let mut last_px = f64::NEG_INFINITY;
    for place in &curve.censored {
        let at = x.at(*place);
        if at - last_px >= 1.0 {
            let middle = y.at(curve.at(*place));
            ticks += &format!("M{} {}v7", number(at), number(middle - 3.5));
            last_px = at;
        }
    }
    if !ticks.is_empty() {
        svg.path(
            &format!("curve solid thin {}", arm_class(curve.arm)),
            &ticks,
        );
    }
    svg.close("g");
}

fn draw_ribbon(svg: &mut Markup, curve: &Curve, x: &Scale, y: &Scale) {
    let steps = curve.visible(x);
    if steps.iter().all(|step| step.band.is_none()) {
        return;
    }

    let mut upper = format!("M{} {}", number(x.begin_px()), number(y.at(curve.begin)));
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
    path += &format!("V{}H{}z", number(y.at(curve.begin)), number(x.begin_px()));
    svg.path(&format!("ribbon {}", arm_class(curve.arm)), &path);
}
