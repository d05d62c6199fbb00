//! Places labels so that none overlaps another one; those without a place are left out.

use std::collections::BTreeMap;

/// Width of the columns by which places are found, pixels.
const COLUMN_PX: f64 = 64.0;
/// Least distance of two labels beside each other, pixels.
const GAP_PX: f64 = 5.0;
/// Height of a label, pixels.
pub(crate) const HEIGHT_PX: f64 = 13.0;

/// A rectangle, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Area {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
    /// Whether a text in it ends at its right edge; otherwise it begins at its left edge.
    pub(crate) is_before: bool,
}

impl Area {
    /// The area of a label whose left end is at `left` and whose middle is at `middle`.
    pub(crate) fn of_label(left: f64, middle: f64, width: f64) -> Self {
        Self {
            left,
            top: middle - HEIGHT_PX / 2.0,
            width,
            height: HEIGHT_PX,
            is_before: false,
        }
    }

    /// The area of a label whose right end is at `right`.
    pub(crate) fn of_label_before(right: f64, middle: f64, width: f64) -> Self {
        Self {
            is_before: true,
            ..Self::of_label(right - width, middle, width)
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        let is_beside =
            self.left >= other.left + other.width || other.left >= self.left + self.width;
        let is_above = self.top >= other.top + other.height || other.top >= self.top + self.height;
        !is_beside && !is_above
    }

    fn columns(&self) -> std::ops::RangeInclusive<i64> {
        let first = (self.left / COLUMN_PX).floor() as i64;
        let last = ((self.left + self.width) / COLUMN_PX).floor() as i64;
        first..=last
    }
}

/// The labels that have a place.
#[derive(Debug)]
pub(crate) struct Labels {
    /// What labels must not overlap, by column.
    taken: BTreeMap<i64, Vec<Area>>,
    /// What labels overlap only if they have no other place, by column.
    avoided: BTreeMap<i64, Vec<Area>>,
    left_px: f64,
    right_px: f64,
}

impl Labels {
    /// No labels yet; they are to be between two vertical lines.
    pub(crate) fn between(left_px: f64, right_px: f64) -> Self {
        Self {
            taken: BTreeMap::new(),
            avoided: BTreeMap::new(),
            left_px,
            right_px,
        }
    }

    /// Keeps an area free of labels.
    pub(crate) fn take(&mut self, area: Area) {
        add(&mut self.taken, area);
    }

    /// Labels are to overlap this line only if they have no other place.
    pub(crate) fn avoid_line(&mut self, from: (f64, f64), to: (f64, f64)) {
        const STEP_PX: f64 = 10.0;
        let dx = to.0 - from.0;
        let dy = to.1 - from.1;
        let steps = (dx.abs().max(dy.abs()) / STEP_PX).ceil().max(1.0);

        for step in 0..steps as u32 {
            let share = f64::from(step) / steps;
            let next = f64::from(step + 1) / steps;
            let x = [from.0 + share * dx, from.0 + next * dx];
            let y = [from.1 + share * dy, from.1 + next * dy];
            let left = x[0].min(x[1]);
            let top = y[0].min(y[1]);
            let area = Area {
                left: left - 1.0,
                top: top - 1.0,
                width: (x[0] - x[1]).abs() + 2.0,
                height: (y[0] - y[1]).abs() + 2.0,
                is_before: false,
            };
            add(&mut self.avoided, area);
        }
    }

    /// Finds a place among several; `None` if all of them are taken.
    pub(crate) fn place(&mut self, candidates: &[Area]) -> Option<Area> {
        let mut free = Vec::new();
        for area in candidates {
            let is_inside = area.left >= self.left_px && area.left + area.width <= self.right_px;
            if is_inside && !overlaps(&self.taken, area) {
                free.push(*area);
            }
        }

        let best = free.iter().find(|area| !overlaps(&self.avoided, area));
        let area = *best.or(free.first())?;
        self.take(Area {
            left: area.left - GAP_PX,
            width: area.width + 2.0 * GAP_PX,
            ..area
        });
        Some(area)
    }
}

fn add(columns: &mut BTreeMap<i64, Vec<Area>>, area: Area) {
    for column in area.columns() {
        columns.entry(column).or_default().push(area);
    }
}

fn overlaps(columns: &BTreeMap<i64, Vec<Area>>, area: &Area) -> bool {
    area.columns().any(|column| {
        let areas = columns.get(&column).map_or(&[][..], Vec::as_slice);
        areas.iter().any(|other| other.overlaps(area))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_do_not_overlap_and_those_without_a_place_are_left_out() {
        let mut labels = Labels::between(0.0, 200.0);
        let first = Area::of_label(10.0, 50.0, 60.0);
        let close = Area::of_label(70.0, 50.0, 60.0);
        let beside = Area::of_label(75.0, 50.0, 60.0);

        assert_eq!(labels.place(&[first, beside]), Some(first));
        assert_eq!(labels.place(&[close]), None);
        assert_eq!(labels.place(&[first, beside]), Some(beside));
        assert_eq!(labels.place(&[first, beside]), None);
        let outside = Area::of_label(150.0, 50.0, 60.0);
        assert_eq!(labels.place(&[outside]), None);
    }

    #[test]
    fn a_line_is_avoided_where_that_is_possible() {
        let mut labels = Labels::between(0.0, 200.0);
        labels.avoid_line((0.0, 0.0), (100.0, 100.0));
        let on_line = Area::of_label(40.0, 50.0, 40.0);
        let off_line = Area::of_label(100.0, 20.0, 40.0);

        assert_eq!(labels.place(&[on_line, off_line]), Some(off_line));
        assert_eq!(labels.place(&[on_line, off_line]), Some(on_line));
    }
}
