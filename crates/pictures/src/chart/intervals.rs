//! Estimates with their intervals, a row for each arm: means of arms, or differences to a baseline (a forest plot).

use crate::diagram::{shortened, width_px};

use crate::axis::draw_below;
use crate::canvas::{Chart, LABEL_PX, PANEL_PX};
use crate::number::typeset;
use crate::palette::ARMS;
use crate::scale::Scale;

/// Height of a row, pixels.
const ROW_PX: f64 = 22.0;
/// Font of the numbers, pixels.
const NUMBERS_PX: f64 = 10.5;
/// Most letters of a label.
const LABEL_LETTERS: usize = 20;

/// An estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Lower and upper end of its interval, if there is one.
    pub interval: Option<(f64, f64)>,
    /// Size of the sample.
    pub n: usize,
}

/// A row of the chart.
#[derive(Debug, Clone)]
pub struct IntervalRow {
    /// Name of the arm.
    pub label: String,
    /// Index of the arm, which has its color and marker.
    pub arm: usize,
    /// Its estimate; `None` if there is none.
    pub estimate: Option<Estimate>,
    /// Whether the marker is filled; otherwise it is hollow.
    pub is_filled: bool,
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
    /// Decimals of the numbers.
    pub decimals: usize,
    /// A value that is marked by a vertical line, such as no difference.
    pub reference: Option<f64>,
    /// The rows, from top to bottom.
    pub rows: Vec<IntervalRow>,
}

impl Intervals {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let left = self.labels_px() + 18.0;
        let right = PANEL_PX - self.numbers_px() - 12.0;
        let top = 4.0;
        let bottom = top + self.rows.len().max(1) as f64 * ROW_PX;

        let description = self.description();
        let mut chart = Chart::begin(
            "intervals",
            PANEL_PX,
            bottom + 36.0,
            &self.title,
            &description,
        );
        let scale = Scale::new(self.range.0, self.range.1, left, right);
        draw_below(&mut chart, &scale, top, bottom, &self.axis);
        if let Some(reference) = self.reference {
            let x = scale.at(reference);
            chart.line("zero", (x, top), (x, bottom));
        }
        for (index, row) in self.rows.iter().enumerate() {
            let middle = top + (index as f64 + 0.5) * ROW_PX;
            self.draw_row(&mut chart, &scale, row, middle);
        }
        chart.finish()
    }

    fn draw_row(&self, chart: &mut Chart, scale: &Scale, row: &IntervalRow, middle: f64) {
        chart.group("row", &self.row_title(row));
        let label = shortened(&row.label, LABEL_LETTERS);
        chart.text("", scale.from_px - 12.0, middle + 4.0, "end", &label);

        if let Some(estimate) = row.estimate {
            if let Some((low, high)) = estimate.interval {
                let class = format!("curve solid a{}", row.arm % ARMS);
                chart.line(&class, (scale.at(low), middle), (scale.at(high), middle));
            }
            let place = (scale.at(estimate.value), middle);
            chart.marker(row.arm, place, row.is_filled);
        }

        chart.text(
            "tick",
            PANEL_PX - 1.0,
            middle + 4.0,
            "end",
            &self.numbers(row),
        );
        chart.close();
    }

    fn numbers(&self, row: &IntervalRow) -> String {
        let Some(estimate) = row.estimate else {
            return "none".to_owned();
        };
        let value = typeset(estimate.value, self.decimals);
        match estimate.interval {
            Some((low, high)) => {
                let low = typeset(low, self.decimals);
                let high = typeset(high, self.decimals);
                format!("{value} [{low}, {high}]")
            }
            None => value,
        }
    }

    fn row_title(&self, row: &IntervalRow) -> String {
        let n = row.estimate.map_or(0, |estimate| estimate.n);
        format!("{}: {}, n = {n}", row.label, self.numbers(row))
    }

    fn description(&self) -> String {
        let rows: Vec<String> = self.rows.iter().map(|row| self.row_title(row)).collect();
        format!("{}. {}", self.axis, rows.join("; "))
    }

    fn labels_px(&self) -> f64 {
        let mut widest: f64 = 30.0;
        for row in &self.rows {
            widest = widest.max(width_px(&shortened(&row.label, LABEL_LETTERS), LABEL_PX));
        }
        widest
    }

    /// Width of the widest numbers that the axis allows, so that charts of one figure have their axes in one place.
    fn numbers_px(&self) -> f64 {
        let (from, to) = self.range;
        let mut widest: f64 = 0.0;
        for end in [from, to] {
            let end = typeset(end, self.decimals);
            let numbers = format!("{end} [{end}, {end}]");
            widest = widest.max(width_px(&numbers, NUMBERS_PX));
        }
        for row in &self.rows {
            widest = widest.max(width_px(&self.numbers(row), NUMBERS_PX));
        }
        widest.min(150.0)
    }
}
