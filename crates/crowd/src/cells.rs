//! The plane in cells, at least as wide as people see: who is near a person is in the same cell or one beside it.

use crate::premises::{Disc, WallLine};
use crate::vector::Vector;

/// Most cells: beyond it cells are wider.
const CELLS_MAX: f64 = 4_000_000.0;

/// Which cells there are.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    origin: Vector,
    per_m: Vector,
    columns: usize,
    rows: usize,
    /// Whether the last column is beside the first one.
    is_ring: bool,
}

/// Ranges of numbers, of cells or of what is in them. Those of one row are one range, or two at the end of a ring.
pub(crate) type Ranges = [(usize, usize); 6];

impl Cells {
    /// Cells of at least `reach_m` that cover a rectangle. What is outside counts as in the closest cell, so it need not be.
    pub(crate) fn covering(low: Vector, high: Vector, reach_m: f64, period_m: Option<f64>) -> Self {
        let size = high - low;
        let least_m = (size.x.max(1.0) * size.y.max(1.0) / CELLS_MAX).sqrt();
        let side_m = reach_m.max(least_m);
        let rows = ((size.y / side_m) as usize).max(1);
        let mut columns = ((size.x / side_m) as usize).max(1);
        let mut origin = low;
        let mut width = size.x.max(side_m);
        if let Some(period_m) = period_m {
            columns = ((period_m / side_m) as usize).max(1);
            if columns < 3 {
                // Neighbors on both sides would be the same cell.
                columns = 1;
            }
            origin.x = 0.0;
            width = period_m;
        }

        Self {
            origin,
            per_m: Vector::new(columns as f64 / width, rows as f64 / size.y.max(side_m)),
            columns,
            rows,
            is_ring: period_m.is_some(),
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// The number of the cell of a place. Numbers go by row.
    pub(crate) fn of(&self, place: Vector) -> usize {
        self.row(place.y) * self.columns + self.column(place.x)
    }

    fn column(&self, x: f64) -> usize {
        // What is negative becomes 0.
        (((x - self.origin.x) * self.per_m.x) as usize).min(self.columns - 1)
    }

    fn row(&self, y: f64) -> usize {
        (((y - self.origin.y) * self.per_m.y) as usize).min(self.rows - 1)
    }

    /// Ranges of the cells around a cell and of itself, from `begin` of the first to `begin` of the one after the last; unused
    /// ones are empty.
    pub(crate) fn around(&self, cell: usize, begin: &[u32]) -> Ranges {
        let column = cell % self.columns;
        let row = cell / self.columns;
        let mut ranges = [(0, 0); 6];
        let first_row = row.saturating_sub(1);
        let last_row = (row + 1).min(self.rows - 1);
        for (index, row) in (first_row..=last_row).enumerate() {
            let base = row * self.columns;
            let of = |first: usize, last: usize| {
                (
                    begin[base + first] as usize,
                    begin[base + last + 1] as usize,
                )
            };
            let last = self.columns - 1;
            let (main, rest) = if self.is_ring && last > 0 && column == 0 {
                (of(0, 1), of(last, last))
            } else if self.is_ring && last > 0 && column == last {
                (of(last - 1, last), of(0, 0))
            } else {
                (of(column.saturating_sub(1), (column + 1).min(last)), (0, 0))
            };
            ranges[2 * index] = main;
            ranges[2 * index + 1] = rest;
        }
        ranges
    }

    /// The corners of a cell, m.
    fn rectangle(&self, cell: usize) -> (Vector, Vector) {
        let column = (cell % self.columns) as f64;
        let row = (cell / self.columns) as f64;
        let low = Vector::new(
            self.origin.x + column / self.per_m.x,
            self.origin.y + row / self.per_m.y,
        );
        let high = low + Vector::new(1.0 / self.per_m.x, 1.0 / self.per_m.y);
        (low, high)
    }

    fn is_at_edge(&self, cell: usize) -> bool {
        let column = cell % self.columns;
        let row = cell / self.columns;
        column == 0 || row == 0 || column == self.columns - 1 || row == self.rows - 1
    }

    /// Cells of a rectangle, by number.
    fn within(&self, low: Vector, high: Vector) -> impl Iterator<Item = usize> + use<> {
        let columns = self.column(low.x)..=self.column(high.x);
        let width = self.columns;
        let rows = self.row(low.y)..=self.row(high.y);
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

/// For each cell what people in it may see: indices of walls, or of discs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lookup {
    begin: Vec<u32>,
    indices: Vec<u32>,
}

impl Lookup {
    /// The walls within `reach_m` of each cell.
    pub(crate) fn of_walls(cells: &Cells, walls: &[WallLine], reach_m: f64) -> Self {
        let margin = Vector::new(reach_m, reach_m);
        let mut pairs = Vec::new();
        for (index, wall) in walls.iter().enumerate() {
            let low = Vector::new(wall.from.x.min(wall.to.x), wall.from.y.min(wall.to.y));
            let high = Vector::new(wall.from.x.max(wall.to.x), wall.from.y.max(wall.to.y));
            for cell in cells.within(low - margin, high + margin) {
                let (low, high) = cells.rectangle(cell);
                let middle = (low + high) * 0.5;
                let half_diagonal_m = (high - middle).length();
                let distance_m = (wall.closest_to(middle) - middle).length();
                // Cells at the edge stand for what is outside, too.
                if distance_m <= half_diagonal_m + reach_m || cells.is_at_edge(cell) {
                    pairs.push((cell as u32, index as u32));
                }
            }
        }
        Self::of_pairs(cells.count(), pairs)
    }

    /// The discs whose edge is within `reach_m` of each cell.
    pub(crate) fn of_discs(cells: &Cells, discs: &[Disc], reach_m: f64) -> Self {
        let mut pairs = Vec::new();
        for (index, disc) in discs.iter().enumerate() {
            let margin_m = disc.radius_m + reach_m;
            let margin = Vector::new(margin_m, margin_m);
            for cell in cells.within(disc.center - margin, disc.center + margin) {
                pairs.push((cell as u32, index as u32));
            }
        }
        Self::of_pairs(cells.count(), pairs)
    }

    fn of_pairs(cells: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        if pairs.is_empty() {
            return Self::default();
        }
        pairs.sort_unstable();
        let mut begin = vec![0; cells + 1];
        for (cell, _) in &pairs {
            begin[*cell as usize + 1] += 1;
        }
        for cell in 0..cells {
            begin[cell + 1] += begin[cell];
        }
        let indices = pairs.into_iter().map(|(_, index)| index).collect();
        Self { begin, indices }
    }

    pub(crate) fn at(&self, cell: usize) -> &[u32] {
        match (self.begin.get(cell), self.begin.get(cell + 1)) {
            (Some(begin), Some(end)) => &self.indices[*begin as usize..*end as usize],
            _ => &[],
        }
    }
}
