//! A uniform grid over the field that finds the bodies near a point.
//!
//! The grid keeps the cost of a tick linear in the number of bodies. Each cell holds a linked list of body
//! numbers, stored in two flat vectors, so that moving a body does not allocate. The order within a list depends
//! on the history of moves and must not affect results: callers take a minimum or sort.

use crate::point::Point;

/// Marks the end of a list.
const NONE: u32 = u32::MAX;

/// Maximum number of cells, 4 MB, unless [`CELLS_PER_BODY`] allows more.
///
/// A cell is normally as large as a body, so that a body can only touch bodies in its own cell and the eight
/// around it. Cells become larger on fields that would exceed this limit, such as a field of 600 m with bodies of
/// 2 ft.
const CELLS: u64 = 1 << 20;

/// Cells allowed for each body, which keeps memory linear in the number of bodies. With 16, two bodies rarely
/// share a cell.
const CELLS_PER_BODY: u64 = 16;

/// Cells around a body of the size of a cell.
const CELLS_AROUND: usize = 9;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    columns: usize,
    rows: usize,
    cells_per_m: (f64, f64),
    /// For each cell, row by row: the first body in its list.
    heads: Vec<u32>,
    /// For each body: the next one in the same cell.
    next: Vec<u32>,
    /// For each body: its cell; [`NONE`] while it is not on the field.
    cell: Vec<u32>,
}

impl Grid {
    /// An empty grid over a field of this size, for `bodies` bodies numbered from 0.
    pub(crate) fn new(size_m: (f64, f64), body_m: f64, bodies: usize) -> Self {
        let cells_max = CELLS.max(CELLS_PER_BODY * bodies as u64);
        let (columns, rows) = shape(size_m, body_m, cells_max);

        Self {
            columns,
            rows,
            cells_per_m: (columns as f64 / size_m.0, rows as f64 / size_m.1),
            heads: vec![NONE; columns * rows],
            next: Vec::with_capacity(bodies),
            cell: Vec::with_capacity(bodies),
        }
    }

    /// Adds the body with the next number.
    pub(crate) fn push(&mut self, center: Point) {
        let cell = self.cell_of(center);
        let id = self.next.len() as u32;

        self.next.push(self.heads[cell]);
        self.cell.push(cell as u32);
        self.heads[cell] = id;
    }

    /// Gives the next number to a body that is not on the field.
    pub(crate) fn push_absent(&mut self) {
        self.next.push(NONE);
        self.cell.push(NONE);
    }

    /// Whether a body is on the field.
    pub(crate) fn contains(&self, id: usize) -> bool {
        self.cell[id] != NONE
    }

    /// Puts a body on the field that is not there.
    pub(crate) fn insert(&mut self, id: usize, center: Point) {
        let cell = self.cell_of(center);

        self.next[id] = self.heads[cell];
        self.cell[id] = cell as u32;
        self.heads[cell] = id as u32;
    }

    /// Takes a body off the field.
    pub(crate) fn remove(&mut self, id: usize) {
        self.unlink(id);
        self.next[id] = NONE;
        self.cell[id] = NONE;
    }

    /// Removes the body with the highest number.
    pub(crate) fn pop(&mut self) {
        if !self.next.is_empty() {
            self.unlink(self.next.len() - 1);
            self.next.pop();
            self.cell.pop();
        }
    }

    /// Records that a body is now at `center`.
    pub(crate) fn relocate(&mut self, id: usize, center: Point) {
        let cell = self.cell_of(center);
        if cell as u32 == self.cell[id] {
            return;
        }

        self.unlink(id);
        self.insert(id, center);
    }

    /// Calls `visit` for every body whose center is within `reach_m` of `center` along both axes.
    ///
    /// It is also called for some bodies outside that window. The order is unspecified. It takes no more steps than there are cells in
    /// the window, or bodies on the field, whichever are fewer.
    pub(crate) fn visit_around(&self, center: Point, reach_m: f64, mut visit: impl FnMut(usize)) {
        // The cells of bodies and of the window's edges come from the same monotone function, rounding
        // included. A body inside the window is therefore never in a cell outside it.
        let left = self.column(center.x - reach_m);
        let right = self.column(center.x + reach_m);
        let bottom = self.row(center.y - reach_m);
        let top = self.row(center.y + reach_m);

        // Bodies much larger than a cell, or a large range.
        if (right - left + 1) * (top - bottom + 1) > self.next.len().max(CELLS_AROUND) {
            (0..self.next.len())
                .filter(|id| self.contains(*id))
                .for_each(visit);
            return;
        }

        for row in bottom..=top {
            let start = row * self.columns;
            for &head in &self.heads[start + left..=start + right] {
                self.visit_list(head, &mut visit);
            }
        }
    }

    fn visit_list(&self, head: u32, visit: &mut impl FnMut(usize)) {
        let mut id = head;
        while id != NONE {
            visit(id as usize);
            id = self.next[id as usize];
        }
    }

    fn unlink(&mut self, id: usize) {
        let after = self.next[id];
        let head = &mut self.heads[self.cell[id] as usize];

        if *head == id as u32 {
            *head = after;
            return;
        }

        let mut before = *head as usize;
        while self.next[before] != id as u32 {
            before = self.next[before] as usize;
        }
        self.next[before] = after;
    }

    fn cell_of(&self, center: Point) -> usize {
        self.row(center.y) * self.columns + self.column(center.x)
    }

    // The cast from f64 saturates, so anything left of the field falls into column 0. Casting to u32 first takes
    // fewer instructions than casting to usize.
    fn column(&self, x_m: f64) -> usize {
        ((x_m * self.cells_per_m.0) as u32 as usize).min(self.columns - 1)
    }

    fn row(&self, y_m: f64) -> usize {
        ((y_m * self.cells_per_m.1) as u32 as usize).min(self.rows - 1)
    }
}

/// Columns and rows of a grid of at most `cells_max` cells, each at least as large as a body.
fn shape(size_m: (f64, f64), body_m: f64, cells_max: u64) -> (usize, usize) {
    let mut columns = cells_along(size_m.0, body_m);
    let mut rows = cells_along(size_m.1, body_m);

    while columns * rows > cells_max {
        if columns >= rows {
            columns = columns.div_ceil(2);
        } else {
            rows = rows.div_ceil(2);
        }
    }

    (columns as usize, rows as usize)
}

fn cells_along(side_m: f64, body_m: f64) -> u64 {
    ((side_m / body_m) as u64).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(grid: &Grid, center: Point, reach_m: f64) -> Vec<usize> {
        let mut ids = Vec::new();
        grid.visit_around(center, reach_m, |id| ids.push(id));
        ids.sort_unstable();
        ids
    }

    #[test]
    fn finds_across_cells_and_edges() {
        let mut grid = Grid::new((10.0, 10.0), 1.0, 3);
        for center in [
            Point::new(0.5, 0.5),
            Point::new(1.5, 0.5),
            Point::new(9.5, 9.5),
        ] {
            grid.push(center);
        }

        assert_eq!(found(&grid, Point::new(1.0, 1.0), 0.6), [0, 1]);
        assert_eq!(found(&grid, Point::new(-100.0, -100.0), 1.0), [0]);
        assert_eq!(found(&grid, Point::new(5.0, 5.0), f64::INFINITY), [0, 1, 2]);

        grid.relocate(1, Point::new(8.5, 9.5));
        assert_eq!(found(&grid, Point::new(9.0, 9.0), 0.6), [1, 2]);

        grid.pop();
        assert_eq!(found(&grid, Point::new(9.0, 9.0), 0.6), [1]);
    }

    #[test]
    fn a_window_of_many_cells_takes_no_more_steps_than_there_are_bodies() {
        let mut grid = Grid::new((10.0, 10.0), 0.01, 20);
        for index in 0..20 {
            grid.push(Point::new(0.5 * f64::from(index), 5.0));
        }

        // A million windows of a million cells each would take minutes.
        for _ in 0..1_000_000 {
            let mut count = 0;
            grid.visit_around(Point::new(5.0, 5.0), 5.0, |_| count += 1);
            assert_eq!(count, 20);
        }
        assert_eq!(found(&grid, Point::new(2.0, 5.0), 0.001), [4]);
    }

    #[test]
    fn lists_survive_removal_in_any_order() {
        for order in [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ] {
            let mut grid = Grid::new((10.0, 10.0), 1.0, 3);
            for _ in 0..3 {
                grid.push(Point::new(2.5, 2.5));
            }

            for (moved, id) in order.into_iter().enumerate() {
                assert_eq!(found(&grid, Point::new(2.5, 2.5), 0.1).len(), 3 - moved);
                grid.relocate(id, Point::new(7.5, 7.5));
            }

            assert_eq!(found(&grid, Point::new(7.5, 7.5), 0.1), [0, 1, 2]);
        }
    }

    #[test]
    fn memory_is_bounded_for_every_field() {
        for size_m in [(1e6, 1e6), (1e6, 1e-3), (1e-3, 1e6), (3.0, 7e5)] {
            let (columns, rows) = shape(size_m, 1e-3, CELLS);

            assert!(
                columns >= 1 && rows >= 1 && (columns * rows) as u64 <= CELLS,
                "{columns} {rows}"
            );
        }

        assert_eq!(shape((50.0, 50.0), 2.0, CELLS), (25, 25));
    }
}
