//! Texts in pictures: how wide they are, and where they are put so that none is over another one.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use crate::shapes::{LABEL_PX, Pixel};

/// Width of the columns by which places are found, pixels.
const COLUMN_PX: f64 = 64.0;
/// Least distance of two labels beside each other, pixels.
const GAP_PX: f64 = 5.0;
/// Height of a label, pixels.
const HEIGHT_PX: f64 = 13.0;

/// Approximate width of a letter in ems of a sans-serif font. Rather too wide, because fonts differ.
fn letter_em(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | ' ' | 'I' => 0.32,
        'f' | 'r' | 't' | '(' | ')' | '-' => 0.42,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.9,
        'A'..='Z' => 0.7,
        c if c.is_ascii() => 0.6,
        _ => 1.05,
    }
}

/// Approximate width of a text in a sans-serif font, pixels. Rather too wide, because fonts differ.
#[must_use]
pub fn width_px(text: &str, font_px: f64) -> f64 {
    text.chars().map(letter_em).sum::<f64>() * font_px
}

/// The width of the widest of these labels, each cut after so many letters, pixels.
pub(crate) fn widest_px<'a>(labels: impl IntoIterator<Item = &'a String>, letters: usize) -> f64 {
    let labels = labels.into_iter();
    let widths = labels.map(|label| width_px(&shortened(label, letters), LABEL_PX));
    widths.fold(0.0, f64::max)
}

/// The beginning of a text, with an ellipsis if letters are left out.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// Puts entries of these widths beside each other between two ends, in as many rows as they need. Returns for each its left end
/// and the index of its row.
pub(crate) fn in_rows(
    widths: impl IntoIterator<Item = f64>,
    left: f64,
    right: f64,
) -> Vec<(f64, usize)> {
    let mut places = Vec::new();
    let mut x = left;
    let mut row = 0;
    for width in widths {
        if x + width > right && x > left {
            x = left;
            row += 1;
        }
        places.push((x, row));
        x += width;
    }
    places
}

/// Places for labels near where they are wanted, at least `distance` apart and, if they fit, between two ends. The places are in
/// the order of the labels.
pub(crate) fn spread(wanted: &[f64], distance: f64, (first, last): (f64, f64)) -> Vec<f64> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|a, b| wanted[*a].total_cmp(&wanted[*b]));

    let mut places = vec![0.0; wanted.len()];
    let mut free_from = first;
    for index in &order {
        places[*index] = wanted[*index].max(free_from);
        free_from = places[*index] + distance;
    }
    let mut free_to = last;
    for index in order.iter().rev() {
        places[*index] = places[*index].min(free_to);
        free_to = places[*index] - distance;
    }
    places
}

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
    /// A rectangle between two corners.
    pub(crate) fn between(one: Pixel, other: Pixel) -> Self {
        Self {
            left: one.0.min(other.0),
            top: one.1.min(other.1),
            width: (one.0 - other.0).abs(),
            height: (one.1 - other.1).abs(),
            is_before: false,
        }
    }

    /// The area of a label whose left end is at `left` and whose middle is at `middle`.
    pub(crate) fn after(left: f64, middle: f64, width: f64) -> Self {
        let top = middle - HEIGHT_PX / 2.0;
        Self::between((left, top), (left + width, top + HEIGHT_PX))
    }

    /// The area of a label whose right end is at `right`.
    pub(crate) fn before(right: f64, middle: f64, width: f64) -> Self {
        Self {
            is_before: true,
            ..Self::after(right - width, middle, width)
        }
    }

    /// The area with a margin at each side.
    fn widened(self, x_px: f64, y_px: f64) -> Self {
        Self {
            left: self.left - x_px,
            top: self.top - y_px,
            width: self.width + 2.0 * x_px,
            height: self.height + 2.0 * y_px,
            ..self
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        let is_beside =
            self.left >= other.left + other.width || other.left >= self.left + self.width;
        let is_above = self.top >= other.top + other.height || other.top >= self.top + self.height;
        !is_beside && !is_above
    }

    fn columns(&self) -> RangeInclusive<i64> {
        let first = (self.left / COLUMN_PX).floor() as i64;
        let last = ((self.left + self.width) / COLUMN_PX).floor() as i64;
        first..=last
    }
}

/// Areas by the columns in which they are.
#[derive(Debug, Default)]
struct Areas(BTreeMap<i64, Vec<Area>>);

impl Areas {
    fn add(&mut self, area: Area) {
        for column in area.columns() {
            self.0.entry(column).or_default().push(area);
        }
    }

    fn overlap(&self, area: &Area) -> bool {
        let mut near = area.columns().filter_map(|column| self.0.get(&column));
        near.any(|areas| areas.iter().any(|other| other.overlaps(area)))
    }
}

/// The labels that have a place.
#[derive(Debug)]
pub(crate) struct Labels {
    /// What labels must not overlap.
    taken: Areas,
    /// What labels overlap only if they have no other place.
    avoided: Areas,
    left_px: f64,
    right_px: f64,
}

impl Labels {
    /// No labels yet; they are to be between two vertical lines.
    pub(crate) fn between(left_px: f64, right_px: f64) -> Self {
        Self {
            taken: Areas::default(),
            avoided: Areas::default(),
            left_px,
            right_px,
        }
    }

    /// Keeps an area free of labels.
    pub(crate) fn take(&mut self, area: Area) {
        self.taken.add(area);
    }

    /// Labels are to overlap this line only if they have no other place.
    pub(crate) fn avoid_line(&mut self, from: Pixel, to: Pixel) {
        const STEP_PX: f64 = 10.0;
        let dx = to.0 - from.0;
        let dy = to.1 - from.1;
        let steps = (dx.abs().max(dy.abs()) / STEP_PX).ceil().max(1.0);
        let at = |step: u32| {
            let share = f64::from(step) / steps;
            (from.0 + share * dx, from.1 + share * dy)
        };

        for step in 0..steps as u32 {
            let area = Area::between(at(step), at(step + 1));
            self.avoided.add(area.widened(1.0, 1.0));
        }
    }

    /// Finds a place among several; `None` if all of them are taken.
    pub(crate) fn place(&mut self, candidates: &[Area]) -> Option<Area> {
        let mut free = candidates.to_vec();
        free.retain(|area| {
            let is_inside = area.left >= self.left_px && area.left + area.width <= self.right_px;
            is_inside && !self.taken.overlap(area)
        });

        let best = free.iter().find(|area| !self.avoided.overlap(area));
        let area = *best.or(free.first())?;
        self.take(area.widened(GAP_PX, 0.0));
        Some(area)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_do_not_overlap_and_those_without_a_place_are_left_out() {
        let mut labels = Labels::between(0.0, 200.0);
        let first = Area::after(10.0, 50.0, 60.0);
        let close = Area::after(70.0, 50.0, 60.0);
        let beside = Area::after(75.0, 50.0, 60.0);

        assert_eq!(labels.place(&[first, beside]), Some(first));
        assert_eq!(labels.place(&[close]), None);
        assert_eq!(labels.place(&[first, beside]), Some(beside));
        assert_eq!(labels.place(&[first, beside]), None);
        let outside = Area::after(150.0, 50.0, 60.0);
        assert_eq!(labels.place(&[outside]), None);
    }

    #[test]
    fn a_line_is_avoided_where_that_is_possible() {
        let mut labels = Labels::between(0.0, 200.0);
        labels.avoid_line((0.0, 0.0), (100.0, 100.0));
        let on_line = Area::after(40.0, 50.0, 40.0);
        let off_line = Area::after(100.0, 20.0, 40.0);

        assert_eq!(labels.place(&[on_line, off_line]), Some(off_line));
        assert_eq!(labels.place(&[on_line, off_line]), Some(on_line));
    }

    #[test]
    fn no_label_is_over_another_one() {
        let places = spread(&[50.0, 50.0, 10.0, 99.0, 98.0], 10.0, (0.0, 100.0));
        assert_eq!(places, [50.0, 60.0, 10.0, 100.0, 90.0]);
    }

    #[test]
    fn long_texts_are_shortened_between_letters() {
        assert_eq!(shortened("äöü", 3), "äöü");
        assert_eq!(shortened("äöüß", 3), "äöü…");
    }

    #[test]
    fn entries_that_do_not_fit_are_in_the_next_row() {
        let places = in_rows([30.0, 60.0, 50.0, 200.0, 10.0], 5.0, 100.0);
        let expected = [(5.0, 0), (35.0, 0), (5.0, 1), (5.0, 2), (5.0, 3)];
        assert_eq!(places, expected);
    }
}
