//! What decided a run: the expected outcome over the time of the run, with its interval, and the ticks in which it jumps.

use protocol::time::time_s;
use timeline::{DecisionPoint, RunDecision};

use crate::axis::{draw_below, draw_left};
use crate::chart::{WIDE_PX, begin, end};
use crate::labels::{Area, Labels, width_px};
use crate::markup::Markup;
use crate::number::decimals_for;
use crate::scale::Scale;
use crate::shapes::{LABEL_PX, Pixel, polyline};

/// Height of the plot, pixels.
const PLOT_PX: f64 = 120.0;
/// Classes of the interval and of the curve: in one color.
const INTERVAL: &str = "ribbon a1";
const CURVE: &str = "curve solid a1";
/// Class of the line at a jump.
const JUMP: &str = "curve d2 a0";

/// A chart of the answer of `cars why`.
#[derive(Debug, Clone)]
pub struct OutcomeCurve(pub RunDecision);

impl OutcomeCurve {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let decision = &self.0;
        let (least, most) = decision.range();
        let title = format!("What decided: {}", decision.question.name);
        let (top, bottom) = (36.0, 36.0 + PLOT_PX);
        let mut svg = begin(
            "outcome",
            WIDE_PX,
            bottom + 36.0,
            &title,
            &decision.sentence,
        );
        svg.text("muted", 2.0, 12.0, "start", &decision.axis());

        let digits = format!("{:.*}", decimals_for(most - least), most);
        let left = width_px(&digits, LABEL_PX).max(30.0) + 14.0;
        let x = Scale::new(0.0, self.end_s(), left, WIDE_PX - 12.0);
        let y = Scale::new(least, most, bottom, top);
        draw_left(&mut svg, &y, left, x.end_px());
        draw_below(&mut svg, &x, top, bottom, "simulated time, s");
        let place = |point: &DecisionPoint| x.at(time_s(point.tick, decision.tick_s));
        draw_curve(&mut svg, &decision.curve, (INTERVAL, CURVE), place, &y);

        let mut labels = Labels::between(left, x.end_px());
        for jump in &decision.jumps {
            let at = x.at(time_s(jump.tick, decision.tick_s));
            svg.group("jump", &decision.told(jump));
            svg.line(JUMP, &[(at, top - 14.0), (at, bottom)]);
            let text = format!(
                "{} → {}",
                decision.amount(&jump.before),
                decision.amount(&jump.after)
            );
            let width = width_px(&text, LABEL_PX);
            let places = [
                Area::after(at + 4.0, top - 8.0, width),
                Area::before(at - 4.0, top - 8.0, width),
            ];
            if let Some(area) = labels.place(&places) {
                svg.text("", area.left, area.top + 10.0, "start", &text);
            }
            svg.close("g");
        }
        end(svg)
    }

    /// The last tick, simulated seconds.
    pub(crate) fn end_s(&self) -> f64 {
        time_s(self.0.last, self.0.tick_s)
    }
}

/// Draws the interval and the curve of points, in these classes. `place` is where a point is, from left to right.
pub(crate) fn draw_curve(
    svg: &mut Markup,
    points: &[DecisionPoint],
    (interval, curve): (&str, &str),
    place: impl Fn(&DecisionPoint) -> f64,
    y: &Scale,
) {
    let mut upper: Vec<Pixel> = Vec::new();
    let mut lower: Vec<Pixel> = Vec::new();
    let mut middle: Vec<Pixel> = Vec::new();
    for point in points {
        if let (Some(value), Some((low, high))) = (point.outcome.value, point.outcome.ends()) {
            let at = place(point);
            middle.push((at, y.at(value)));
            lower.push((at, y.at(low)));
            upper.push((at, y.at(high)));
        }
    }
    lower.reverse();
    upper.extend(lower);
    if middle.is_empty() {
        return;
    }
    svg.path(interval, &format!("{}z", polyline(&upper)));
    svg.line(curve, &middle);
}
