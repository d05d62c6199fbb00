//! Numbers of robots over time: a line for each robot, which keeps its value until the next one.

use crate::axis::{draw_below, draw_left};
use crate::chart::bands::labels_px;
use crate::chart::{NAME_LETTERS, WIDE_PX, begin, end, line_class};
use crate::labels::{in_rows, shortened, width_px};
use crate::markup::{Markup, number};
use crate::number::{decimals_for, fixed};
use crate::scale::Scale;
use crate::shapes::{LABEL_PX, Pixel};

/// Height of the plot, pixels.
const PLOT_PX: f64 = 96.0;
/// Height of a row of the key, pixels.
const KEY_ROW_PX: f64 = 14.0;
/// Width of the sample of a line in the key, with the space after it, pixels.
const SAMPLE_PX: f64 = 22.0;
/// Steps closer than this are drawn as one, pixels.
const STEP_PX: f64 = 0.5;

/// The values of a robot.
#[derive(Debug, Clone)]
pub struct CourseLine {
    /// Name of the robot.
    pub label: String,
    /// Its index, which has its color and dashes.
    pub arm: usize,
    /// Each value with the time from which on it holds, simulated seconds; `None` while there is none.
    pub values: Vec<(f64, Option<f64>)>,
}

/// A chart of values over time.
#[derive(Debug, Clone)]
pub struct TimeCourse {
    /// Name of the chart.
    pub title: String,
    /// Name and unit of the values.
    pub axis: String,
    /// End of the axis of time, simulated seconds.
    pub end_s: f64,
    /// Names of the rows above the chart, whose axis of time is in the same place.
    pub rows: Vec<String>,
    /// Ends of the axis of values.
    pub range: (f64, f64),
    /// The robots.
    pub lines: Vec<CourseLine>,
}

impl TimeCourse {
    /// The chart as SVG. Values that cannot be told apart are drawn as one.
    #[must_use]
    pub fn draw(&self) -> String {
        let left = labels_px(&self.rows);
        let right = WIDE_PX - 12.0;
        let title_px = width_px(&self.axis, LABEL_PX) + 16.0;
        let names = self.lines.iter();
        let names: Vec<String> = names
            .map(|line| shortened(&line.label, NAME_LETTERS))
            .collect();
        let widths = names
            .iter()
            .map(|name| SAMPLE_PX + width_px(name, LABEL_PX) + 14.0);
        let places = in_rows(widths, left.max(title_px), right);
        let rows = places.last().map_or(0, |(_, row)| *row) as f64;
        let top = 22.0 + rows * KEY_ROW_PX;
        let bottom = top + PLOT_PX;
        let height = bottom + 36.0;

        let description = self.description();
        let mut svg = begin("course", WIDE_PX, height, &self.title, &description);
        svg.text("muted", 2.0, 12.0, "start", &self.axis);
        let x = Scale::new(0.0, self.end_s, left, right);
        let y = Scale::new(self.range.0, self.range.1, bottom, top);
        draw_left(&mut svg, &y, left, right);
        draw_below(&mut svg, &x, top, bottom, "simulated time, s");
        for line in &self.lines {
            svg.group("curve-of", &line.label);
            svg.path(
                &format!("{} thin", line_class(line.arm)),
                &line.path(&x, &y),
            );
            svg.close("g");
        }
        for ((line, name), (left, row)) in self.lines.iter().zip(&names).zip(places) {
            let y = 12.0 + row as f64 * KEY_ROW_PX;
            draw_key(&mut svg, line.arm, name, (left, y));
        }
        end(svg)
    }

    fn description(&self) -> String {
        let decimals = decimals_for(self.range.1 - self.range.0);
        let mut parts = Vec::new();
        for line in &self.lines {
            let values = line.values.iter().filter_map(|(_, value)| *value);
            let least = values.clone().fold(f64::INFINITY, f64::min);
            let most = values.fold(f64::NEG_INFINITY, f64::max);
            if least <= most {
                let [least, most] = [least, most].map(|value| fixed(value, decimals));
                parts.push(format!("{} from {least} to {most}", line.label));
            }
        }
        format!("{} over simulated time. {}", self.axis, parts.join("; "))
    }
}

/// Draws the name of a robot after a sample of its line.
fn draw_key(svg: &mut Markup, arm: usize, name: &str, (left, y): Pixel) {
    let sample = [(left, y - 3.5), (left + SAMPLE_PX - 5.0, y - 3.5)];
    svg.line(&line_class(arm), &sample);
    svg.text("", left + SAMPLE_PX, y, "start", name);
}

impl CourseLine {
    fn path(&self, x: &Scale, y: &Scale) -> String {
        let mut path = String::new();
        // Where the line is, and whether it is one.
        let mut last: Option<f64> = None;
        let mut drawn_px = f64::NEG_INFINITY;
        for (index, (time_s, value)) in self.values.iter().enumerate() {
            let at = x.at(*time_s);
            let is_last = index + 1 == self.values.len();
            if at - drawn_px < STEP_PX && value.is_some() == last.is_some() && !is_last {
                continue;
            }

            let place = value.map(|value| y.at(value));
            path += &match (last, place) {
                (Some(_), Some(place)) => format!("H{}V{}", number(at), number(place)),
                (Some(_), None) => format!("H{}", number(at)),
                (None, Some(place)) => format!("M{} {}", number(at), number(place)),
                (None, None) => String::new(),
            };
            last = place;
            drawn_px = at;
        }
        if last.is_some() {
            path += &format!("H{}", number(x.end_px()));
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_a_gap_where_there_is_no_value() {
        let line = CourseLine {
            label: String::new(),
            arm: 0,
            values: vec![(0.0, Some(1.0)), (10.0, None), (20.0, Some(0.0))],
        };
        let x = Scale::new(0.0, 100.0, 0.0, 100.0);
        let y = Scale::new(0.0, 1.0, 50.0, 0.0);
        assert_eq!(line.path(&x, &y), "M0 0H10M20 50H100");
    }
}
