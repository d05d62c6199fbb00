//! Layers of a scenario, checked: a number for each cell of a grid over the floor, which robots sense and change.

use protocol::messages::{Point, cell_center};
use world::Region;

/// A layer of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerSpec {
    /// Side of a cell, meters.
    pub cell_m: f64,
    /// Number of columns; the last one may reach over the edge of the field.
    pub columns: u32,
    /// Number of rows, in the same way.
    pub rows: u32,
    /// The number of each cell at the start, without the peaks.
    pub value: f64,
    /// Where there is more at the start.
    pub peaks: Vec<Peak>,
    /// Least number of a cell; one that would be less is this.
    pub min: f64,
    /// Greatest number of a cell.
    pub max: f64,
    /// Distance within which robots sense the layer and may change it, meters; without it none does.
    pub range_m: Option<f64>,
    /// The share of each number that disappears in a second.
    pub decay_per_s: f64,
    /// How fast differences between neighbors even out, m²/s.
    pub diffuse_m2ps: f64,
}

/// A place of a layer where there is more at the start: `height * (1 - (d / radius)²)²` at the distance `d` within the radius (the quartic
/// or biweight kernel).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Its center, meters.
    pub at: Point,
    /// Where the center is drawn, if it follows from the seed.
    pub drawn: Option<Region>,
    /// Distance at which it ends, meters.
    pub radius_m: f64,
    /// What it adds in its center.
    pub height: f64,
}

impl LayerSpec {
    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Whether there is no cell, which no checked layer is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The numbers at the start, row by row from below.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        let mut cells = Vec::with_capacity(self.len());
        for row in 0..self.rows {
            for column in 0..self.columns {
                let center = cell_center(column, row, self.cell_m);
                let more: f64 = self.peaks.iter().map(|peak| peak.height_at(center)).sum();
                cells.push(self.limit(self.value + more));
            }
        }
        cells
    }

    /// The nearest number that a cell can hold.
    #[must_use]
    pub fn limit(&self, number: f64) -> f64 {
        number.clamp(self.min, self.max)
    }
}

impl Peak {
    /// What it adds at a place.
    fn height_at(&self, place: Point) -> f64 {
        let (dx, dy) = (place.x - self.at.x, place.y - self.at.y);
        let share = (dx * dx + dy * dy) / (self.radius_m * self.radius_m);
        let rest = (1.0 - share).max(0.0);
        self.height * rest * rest
    }
}
