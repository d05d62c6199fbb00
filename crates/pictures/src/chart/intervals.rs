//! Estimates with their intervals, a row for each arm: means of arms, or differences to a baseline (a forest plot).

use crate::axis::draw_below;
use crate::chart::{PANEL_PX, PlottedEstimate, begin, draw_estimate, draw_runs, end};
use crate::labels::{shortened, widest_px, width_px};
use crate::markup::Markup;
use crate::number::{decimals_for, typeset};
use crate::scale::Scale;
use crate::shapes::LABEL_PX;

/// Height of a row, pixels.
const ROW_PX: f64 = 22.0;
/// Most letters of a label.
const LABEL_LETTERS: usize = 20;

/// A row of the chart.
#[derive(Debug, Clone)]
pub struct IntervalRow {
    /// Name of the arm.
    pub label: String,
    /// Index of the arm, which has its color and marker.
    pub arm: usize,
    /// Its estimate; `None` if there is none.
    pub estimate: Option<PlottedEstimate>,
    /// The numbers of the runs that it is of, or of the pairs; they may be left out.
    pub runs: Vec<f64>,
}

/// A chart of estimates.
#[derive(Debug, Clone)]
pub struct Intervals {
    /// Name of the chart.
    pub title: String,
    /// Name and unit of the axis.
    pub axis: String,
    /// Ends of the axis, the same for charts that are compared.
    pub range: (f64, f64),
    /// A value that is marked by a vertical line, such as no difference.
    pub reference: Option<f64>,
    /// The rows, from top to bottom.
    pub rows: Vec<IntervalRow>,
}

impl Intervals {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let labels = self.rows.iter().map(|row| &row.label);
        let left = widest_px(labels, LABEL_LETTERS).max(30.0) + 18.0;
        let right = PANEL_PX - self.numbers_px() - 12.0;
        let top = 4.0;
        let bottom = top + self.rows.len().max(1) as f64 * ROW_PX;

        let titles: Vec<String> = self.rows.iter().map(|row| self.row_title(row)).collect();
        let description = format!("{}. {}", self.axis, titles.join("; "));
        let height = bottom + 36.0;
        let mut svg = begin("intervals", PANEL_PX, height, &self.title, &description);
        let scale = Scale::new(self.range.0, self.range.1, left, right);
        draw_below(&mut svg, &scale, top, bottom, &self.axis);
        if let Some(reference) = self.reference {
            let x = scale.at(reference);
            svg.line("zero", &[(x, top), (x, bottom)]);
        }
        for (index, row) in self.rows.iter().enumerate() {
            let middle = top + (index as f64 + 0.5) * ROW_PX;
            svg.group("row", &self.row_title(row));
            self.draw_row(&mut svg, &scale, row, middle);
            svg.close("g");
        }
        end(svg)
    }

    fn draw_row(&self, svg: &mut Markup, scale: &Scale, row: &IntervalRow, middle: f64) {
        let label = shortened(&row.label, LABEL_LETTERS);
        svg.text("", scale.begin_px() - 12.0, middle + 4.0, "end", &label);
        let run = |value, aside| (scale.at(value), middle + aside * (ROW_PX - 8.0));
        draw_runs(svg, row.arm, &row.runs, run);
        if let Some(estimate) = &row.estimate {
            let at = |value| (scale.at(value), middle);
            draw_estimate(svg, row.arm, estimate, at);
        }
        let numbers = self.numbers(row);
        svg.text("tick", PANEL_PX - 1.0, middle + 4.0, "end", &numbers);
    }

    fn decimals(&self) -> usize {
        decimals_for(self.range.1 - self.range.0)
    }

    fn numbers(&self, row: &IntervalRow) -> String {
        let estimate = row.estimate;
        estimate.map_or_else(|| "none".to_owned(), |one| one.words(self.decimals()))
    }

    fn row_title(&self, row: &IntervalRow) -> String {
        let n = row.estimate.map_or(0, |estimate| estimate.n);
        format!("{}: {}, n = {n}", row.label, self.numbers(row))
    }

    /// Width of the widest numbers that the axis allows, so that charts of one figure have their axes in one place.
    fn numbers_px(&self) -> f64 {
        let ends = [self.range.0, self.range.1].map(|end| typeset(end, self.decimals()));
        let possible = ends.map(|end| format!("{end} [{end}, {end}]"));
        let shown = self.rows.iter().map(|row| self.numbers(row));
        let widths = shown
            .chain(possible)
            .map(|numbers| width_px(&numbers, LABEL_PX));
        widths.fold(0.0, f64::max).min(150.0)
    }
}
