//! Axes of charts.

use crate::canvas::Chart;
use crate::number::typeset;
use crate::scale::Scale;

/// Draws an axis below a plot, with grid lines through it. `top` and `bottom` are the ends of the plot.
pub(crate) fn draw_below(chart: &mut Chart, scale: &Scale, top: f64, bottom: f64, title: &str) {
    let width_px = (scale.to_px - scale.from_px).abs();
    let (ticks, decimals) = scale.ticks((width_px / 50.0).round().max(3.0) as usize);

    for value in ticks {
        let x = scale.at(value);
        chart.line("grid", (x, top), (x, bottom));
        chart.text(
            "tick",
            x,
            bottom + 14.0,
            "middle",
            &typeset(value, decimals),
        );
    }

    chart.line("axis", (scale.from_px, bottom), (scale.to_px, bottom));
    if !title.is_empty() {
        let middle = f64::midpoint(scale.from_px, scale.to_px);
        chart.text("muted", middle, bottom + 29.0, "middle", title);
    }
}

/// Draws an axis at the left of a plot, with grid lines through it. `scale` runs upward.
pub(crate) fn draw_left(chart: &mut Chart, scale: &Scale, left: f64, right: f64) {
    let height_px = (scale.to_px - scale.from_px).abs();
    let (ticks, decimals) = scale.ticks((height_px / 40.0).round().max(2.0) as usize);

    for value in ticks {
        let y = scale.at(value);
        chart.line("grid", (left, y), (right, y));
        chart.text(
            "tick",
            left - 6.0,
            y + 3.5,
            "end",
            &typeset(value, decimals),
        );
    }
}
