//! Axes of charts.

use crate::markup::Markup;
use crate::number::typeset;
use crate::scale::Scale;

/// Draws an axis below a plot, with grid lines through it. `top` and `bottom` are the ends of the plot.
pub(crate) fn draw_below(svg: &mut Markup, scale: &Scale, top: f64, bottom: f64, title: &str) {
    let (left, right) = (scale.begin_px(), scale.end_px());
    let (ticks, decimals) = scale.ticks(distance(right - left, 50.0, 3.0));
    for value in ticks {
        let x = scale.at(value);
        svg.line("grid", &[(x, top), (x, bottom)]);
        let text = typeset(value, decimals);
        svg.text("tick", x, bottom + 14.0, "middle", &text);
    }

    svg.line("axis", &[(left, bottom), (right, bottom)]);
    let middle = f64::midpoint(left, right);
    svg.text("muted", middle, bottom + 29.0, "middle", title);
}

/// Draws an axis at the left of a plot, with grid lines through it. `scale` runs upward.
pub(crate) fn draw_left(svg: &mut Markup, scale: &Scale, left: f64, right: f64) {
    let (ticks, decimals) = scale.ticks(distance(scale.begin_px() - scale.end_px(), 40.0, 2.0));
    for value in ticks {
        let y = scale.at(value);
        svg.line("grid", &[(left, y), (right, y)]);
        let text = typeset(value, decimals);
        svg.text("tick", left - 6.0, y + 3.5, "end", &text);
    }
}

/// The distance of ticks on an axis: about `usual_px`, so that there are about `least` of them or more.
fn distance(length_px: f64, usual_px: f64, least: f64) -> f64 {
    length_px / (length_px / usual_px).round().max(least)
}
