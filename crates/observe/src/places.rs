//! Geometry of teams: regions, what was covered, and who is within range of whom.

use std::collections::BTreeMap;

use protocol::messages::Point;

/// Most cells of a field whose coverage is measured.
const MAX_CELLS: f64 = 1e6;

/// A part of the field. Its edge belongs to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FieldRegion {
    /// A rectangle between two corners.
    Rectangle {
        /// The lower left one, meters.
        least: Point,
        /// The upper right one, meters.
        most: Point,
    },
    /// A disc.
    Disc {
        /// Its center, meters.
        center: Point,
        /// Its radius, meters.
        radius_m: f64,
    },
}

impl FieldRegion {
    /// The rectangle between two opposite corners.
    #[must_use]
    pub fn rectangle(one: Point, other: Point) -> Self {
        Self::Rectangle {
            least: Point::new(one.x.min(other.x), one.y.min(other.y)),
            most: Point::new(one.x.max(other.x), one.y.max(other.y)),
        }
    }

    /// Whether a point is within it.
    #[must_use]
    pub fn contains(&self, at: Point) -> bool {
        match self {
            Self::Rectangle { least, most } => {
                (least.x..=most.x).contains(&at.x) && (least.y..=most.y).contains(&at.y)
            }
            Self::Disc { center, radius_m } => square_m2(*center, at) <= radius_m * radius_m,
        }
    }
}

fn square_m2(one: Point, other: Point) -> f64 {
    let x = one.x - other.x;
    let y = one.y - other.y;
    x * x + y * y
}

/// The cells of the field of which the center was within range of a robot.
#[derive(Debug, Clone)]
pub(crate) struct CoveredArea {
    cell_m: f64,
    radius_m: f64,
    columns: usize,
    /// Row by row from below.
    cells: Vec<bool>,
    covered: usize,
}

impl CoveredArea {
    /// Checks that a field has cells of this side, and not too many.
    pub(crate) fn check(field_m: [f64; 2], cell_m: f64) -> Result<(), String> {
        let [columns, rows] = field_m.map(|side_m| centers(side_m, cell_m));
        if columns < 1.0 || rows < 1.0 {
            return Err(format!(
                "no cell of {cell_m} m has its center in the field: make `cell` smaller"
            ));
        }
        if columns * rows > MAX_CELLS {
            return Err(format!(
                "the field has more than {MAX_CELLS} cells of {cell_m} m: make `cell` larger"
            ));
        }
        Ok(())
    }

    /// A field of which nothing was covered, and which passed the check.
    pub(crate) fn new(field_m: [f64; 2], cell_m: f64, radius_m: f64) -> Self {
        let [columns, rows] = field_m.map(|side_m| centers(side_m, cell_m) as usize);
        Self {
            cell_m,
            radius_m,
            columns,
            cells: vec![false; columns * rows],
            covered: 0,
        }
    }

    /// Begins anew, with nothing covered.
    pub(crate) fn clear(&mut self) {
        self.cells.fill(false);
        self.covered = 0;
    }

    /// Takes a robot at a place into account. Costs the cells of the square around it.
    pub(crate) fn cover(&mut self, at: Point) {
        let rows = self.cells.len() / self.columns.max(1);
        for row in self.indices(at.y, rows) {
            for column in self.indices(at.x, self.columns) {
                let center = Point::new(self.center_m(column), self.center_m(row));
                let cell = &mut self.cells[row * self.columns + column];
                if !*cell && square_m2(center, at) <= self.radius_m * self.radius_m {
                    *cell = true;
                    self.covered += 1;
                }
            }
        }
    }

    /// Share of the cells that were covered, 0 to 1.
    pub(crate) fn share(&self) -> f64 {
        self.covered as f64 / self.cells.len() as f64
    }

    fn center_m(&self, index: usize) -> f64 {
        (index as f64 + 0.5) * self.cell_m
    }

    /// The columns, or rows, of which the centers can be within range. One more at each end: the distance decides.
    fn indices(&self, at_m: f64, count: usize) -> std::ops::Range<usize> {
        let first = ((at_m - self.radius_m) / self.cell_m - 1.0)
            .floor()
            .max(0.0) as usize;
        let last = ((at_m + self.radius_m) / self.cell_m + 1.0).ceil().max(0.0) as usize;
        first.min(count)..last.min(count)
    }
}

/// How many cells along a side have their center in the field.
fn centers(side_m: f64, cell_m: f64) -> f64 {
    // Sides are read from decimal fractions.
    (side_m / cell_m + 0.5 + 1e-9).floor()
}

/// The least distance of all pairs, meters; `None` without a pair. Places that are sorted from left to right need no look at those
/// that are further away than the least distance up to then.
pub(crate) fn least_distance_m(places: &[Point]) -> Option<f64> {
    let mut sorted = places.to_vec();
    sorted.sort_by(|one, other| one.x.total_cmp(&other.x));

    let mut least: Option<f64> = None;
    for (index, one) in sorted.iter().enumerate() {
        for other in &sorted[index + 1..] {
            if least.is_some_and(|least| other.x - one.x > least) {
                break;
            }
            let distance_m = one.distance_m(*other);
            least = Some(least.map_or(distance_m, |least| least.min(distance_m)));
        }
    }
    least
}

/// The number of groups of places between which no step of at most `range_m` leads. Costs the pairs of neighboring cells of a
/// grid, not all pairs.
pub(crate) fn components(places: &[Point], range_m: f64) -> usize {
    let cell_of = |at: &Point| {
        let x = (at.x / range_m).floor() as i64;
        let y = (at.y / range_m).floor() as i64;
        (x, y)
    };
    let mut cells: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
    for (index, at) in places.iter().enumerate() {
        cells.entry(cell_of(at)).or_default().push(index);
    }

    let mut groups = Groups((0..places.len()).collect());
    let mut count = places.len();
    for (&(x, y), members) in &cells {
        // The other four neighbors of a cell look at it.
        for (right, up) in [(0, 0), (1, -1), (1, 0), (1, 1), (0, 1)] {
            let neighbor = (x.saturating_add(right), y.saturating_add(up));
            for &other in cells.get(&neighbor).into_iter().flatten() {
                for &one in members {
                    let is_near = square_m2(places[one], places[other]) <= range_m * range_m;
                    if is_near && groups.join(one, other) {
                        count -= 1;
                    }
                    // Where the range is long, most pairs say nothing more.
                    if count == 1 {
                        return count;
                    }
                }
            }
        }
    }
    count
}

/// The place in the group that each leads to; the head of a group leads to itself.
struct Groups(Vec<usize>);

impl Groups {
    fn head(&mut self, mut index: usize) -> usize {
        while self.0[index] != index {
            self.0[index] = self.0[self.0[index]];
            index = self.0[index];
        }
        index
    }

    /// Joins the groups of two. Returns whether they were two.
    fn join(&mut self, one: usize, other: usize) -> bool {
        let one = self.head(one);
        let other = self.head(other);
        self.0[one.max(other)] = one.min(other);
        one != other
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(x: f64, y: f64) -> Point {
        Point::new(x, y)
    }

    #[test]
    fn the_edge_of_a_region_belongs_to_it() {
        let rectangle = FieldRegion::rectangle(at(3.0, 1.0), at(1.0, 2.0));
        for (place, is_inside) in [
            (at(1.0, 1.0), true),
            (at(3.0, 2.0), true),
            (at(2.0, 2.1), false),
            (at(0.9, 1.5), false),
        ] {
            assert_eq!(rectangle.contains(place), is_inside, "{place:?}");
        }
        let disc = FieldRegion::Disc {
            center: at(1.0, 1.0),
            radius_m: 5.0,
        };
        assert!(disc.contains(at(4.0, 5.0)) && !disc.contains(at(4.1, 5.0)));
    }

    #[test]
    fn coverage_counts_cells_whose_centers_are_within_range() {
        // 4 × 2 cells with centers at 0.5, 1.5, 2.5, 3.5 and 0.5, 1.5.
        let mut field = CoveredArea::new([4.0, 2.0], 1.0, 1.0);
        assert_eq!(field.share(), 0.0);
        field.cover(at(0.5, 0.5));
        // Itself, right and above: 1 m is within 1 m, the diagonal is not.
        assert_eq!(field.share(), 3.0 / 8.0);
        field.cover(at(0.5, 0.5));
        assert_eq!(field.share(), 3.0 / 8.0);
        field.cover(at(3.5, 1.5));
        assert_eq!(field.share(), 6.0 / 8.0);
        field.cover(at(-50.0, 1e9));
        assert_eq!(field.share(), 6.0 / 8.0);
    }

    #[test]
    fn cells_are_bounded() {
        assert_eq!(CoveredArea::check([1000.0, 1000.0], 1.0), Ok(()));
        let error = CoveredArea::check([1000.0, 1001.0], 1.0).unwrap_err();
        assert!(error.contains("make `cell` larger"), "{error}");
        let error = CoveredArea::check([10.0, 10.0], 25.0).unwrap_err();
        assert!(error.contains("make `cell` smaller"), "{error}");
        // Tenths of a meter are no binary fractions.
        assert_eq!(centers(0.3, 0.1), 3.0);
        assert!(CoveredArea::check([10.0, 10.0], 1e-300).is_err());
    }

    #[test]
    fn components_are_counted() {
        let line = [at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0), at(4.0, 0.0)];
        assert_eq!(components(&line, 1.0), 2);
        assert_eq!(components(&line, 2.0), 1);
        assert_eq!(components(&line, 0.5), 4);
        assert_eq!(components(&[], 1.0), 0);
        assert_eq!(least_distance_m(&line), Some(1.0));
        assert_eq!(least_distance_m(&line[..1]), None);
    }

    /// By all pairs, again and again.
    fn components_slowly(places: &[Point], range_m: f64) -> usize {
        let mut group: Vec<usize> = (0..places.len()).collect();
        for _ in places {
            for one in 0..places.len() {
                for other in 0..places.len() {
                    if square_m2(places[one], places[other]) <= range_m * range_m {
                        group[one] = group[one].min(group[other]);
                    }
                }
            }
        }
        group.sort_unstable();
        group.dedup();
        group.len()
    }

    proptest! {
        #[test]
        fn components_and_least_distance_are_those_of_all_pairs(
            places in prop::collection::vec((-5.0..5.0, -5.0..5.0), 2..30),
            range_m in 0.1..5.0,
        ) {
            let places: Vec<Point> = places.into_iter().map(|(x, y)| at(x, y)).collect();
            prop_assert_eq!(components(&places, range_m), components_slowly(&places, range_m));

            let mut least = f64::INFINITY;
            for (index, one) in places.iter().enumerate() {
                for other in &places[index + 1..] {
                    least = least.min(one.distance_m(*other));
                }
            }
            prop_assert_eq!(least_distance_m(&places), Some(least));
        }
    }
}
