//! A scale from values to pixels, with round ticks: linear, but for gaps, which are narrower.

use std::fmt::Write;

/// A piece of a scale, linear in itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) from_px: f64,
    pub(crate) to_px: f64,
    /// Whether it is not to scale.
    pub(crate) is_gap: bool,
}

/// From values to pixels.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    /// At least one, each from the end of the one before.
    pieces: Vec<Piece>,
    /// Pixels for each unit outside of gaps; negative if larger values have smaller places.
    px: f64,
}

impl Scale {
    /// A scale that begins and ends exactly with these values. An empty range becomes one around its value.
    pub(crate) fn new(from: f64, to: f64, from_px: f64, to_px: f64) -> Self {
        let is_range = from.is_finite() && to.is_finite() && to > from;
        let (from, to) = if is_range {
            (from, to)
        } else if from.is_finite() {
            (from - 0.5, from + 0.5)
        } else {
            (0.0, 1.0)
        };

        let px = (to_px - from_px) / (to - from);
        Self::with_gaps((from, to), &[], from_px, px, 0.0)
    }

    /// A scale with `px` pixels for each unit, except in gaps, which have `gap_px` pixels each.
    pub(crate) fn with_gaps(
        (from, to): (f64, f64),
        gaps: &[(f64, f64)],
        from_px: f64,
        px: f64,
        gap_px: f64,
    ) -> Self {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut add = |to: f64, is_gap: bool| {
            let last = pieces.last().map(|piece| (piece.to, piece.to_px));
            let (from, from_px) = last.unwrap_or((from, from_px));
            let width = if is_gap { gap_px } else { (to - from) * px };
            pieces.push(Piece {
                from,
                to,
                from_px,
                to_px: from_px + width,
                is_gap,
            });
        };
        for (begin, end) in gaps {
            add(*begin, false);
            add(*end, true);
        }
        add(to, false);
        Self { pieces, px }
    }

    /// The gaps, from left to right.
    pub(crate) fn gaps(&self) -> Vec<Piece> {
        let mut gaps = self.pieces.clone();
        gaps.retain(|piece| piece.is_gap);
        gaps
    }

    fn first(&self) -> Piece {
        self.pieces[0]
    }

    fn last(&self) -> Piece {
        self.pieces[self.pieces.len() - 1]
    }

    /// The least and the largest value.
    pub(crate) fn range(&self) -> (f64, f64) {
        (self.first().from, self.last().to)
    }

    /// Where the scale begins.
    pub(crate) fn begin_px(&self) -> f64 {
        self.first().from_px
    }

    /// Where the scale ends.
    pub(crate) fn end_px(&self) -> f64 {
        self.last().to_px
    }

    /// The place of a value. Values outside of the range are at its ends.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let index = self.pieces.partition_point(|piece| piece.to <= value);
        let piece = self.pieces.get(index).copied().unwrap_or(self.last());
        let share = (value - piece.from) / (piece.to - piece.from);
        let share = if share.is_nan() { 0.0 } else { share };
        piece.from_px + share.clamp(0.0, 1.0) * (piece.to_px - piece.from_px)
    }

    /// Round values outside of gaps, at least so many pixels apart, and the decimals with which they are written.
    pub(crate) fn ticks(&self, least_px: f64) -> (Vec<f64>, usize) {
        let step = round_step(least_px / self.px.abs());
        (self.multiples(step, 1e-9), step_decimals(step))
    }

    /// Round whole values outside of gaps, at least so many pixels apart. The end of a piece is not in it.
    pub(crate) fn whole_ticks(&self, least_px: f64) -> Vec<f64> {
        self.multiples(round_step(least_px / self.px.abs()).max(1.0), -1e-9)
    }

    /// The multiples of a step outside of gaps, up to so many steps after the end of each piece.
    fn multiples(&self, step: f64, after: f64) -> Vec<f64> {
        let mut multiples = Vec::new();
        for piece in self.pieces.iter().filter(|piece| !piece.is_gap) {
            // Not "-0".
            let mut number = (piece.from / step - 1e-9).ceil() + 0.0;
            while number <= piece.to / step + after && multiples.len() < 1000 {
                multiples.push(number * step);
                number += 1.0;
            }
        }
        multiples
    }

    /// Points of the piecewise linear function from pixels to values, `px value` each, for programs that look for the value at a
    /// place of the picture.
    pub(crate) fn knots(&self) -> String {
        let mut text = String::new();
        for piece in &self.pieces {
            // Infallible: it is written to memory.
            let _ = write!(text, "{:.1} {}, ", piece.from_px, piece.from);
        }
        let _ = write!(text, "{:.1} {}", self.end_px(), self.last().to);
        text
    }
}

/// Widens a range so that it begins and ends with round numbers.
#[must_use]
pub fn round_range(from: f64, to: f64, about: usize) -> (f64, f64) {
    let span = if to > from { to - from } else { 1.0 };
    let step = round_step(span / about.max(1) as f64);
    let begin = (from / step + 1e-9).floor() * step;
    let end = (to / step - 1e-9).ceil() * step;
    (begin, if end > begin { end } else { begin + step })
}

/// The least of 1, 2, 5, 10, … and their tenths, hundredths, … that is at least `least`.
fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }

    let mut decade = 1.0;
    while decade > least {
        decade /= 10.0;
    }
    while decade * 10.0 <= least {
        decade *= 10.0;
    }
    for factor in [1.0, 2.0, 5.0] {
        if decade * factor >= least * (1.0 - 1e-9) {
            return decade * factor;
        }
    }
    decade * 10.0
}

fn step_decimals(step: f64) -> usize {
    let mut decimals = 0;
    let mut scaled = step;
    while decimals < 6 && (scaled - scaled.round()).abs() > 1e-6 {
        scaled *= 10.0;
        decimals += 1;
    }
    decimals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let scale = Scale::new(0.0, 600.0, 0.0, 300.0);
        assert_eq!(scale.ticks(75.0), (vec![0.0, 200.0, 400.0, 600.0], 0));
        let scale = Scale::new(-0.03, 0.11, 0.0, 300.0);
        let (ticks, decimals) = scale.ticks(75.0);
        assert_eq!(decimals, 2);
        assert_eq!(ticks.len(), 3, "{ticks:?}");
    }

    #[test]
    fn any_range_has_a_scale() {
        let ranges = [
            (0.0, 0.0),
            (5.0, 5.0),
            (f64::NAN, 1.0),
            (1.0, f64::INFINITY),
            (3.0, 1.0),
        ];
        for (from, to) in ranges {
            let scale = Scale::new(from, to, 10.0, 20.0);
            assert!((10.0..=20.0).contains(&scale.at(from)), "{from} to {to}");
            assert!(!scale.ticks(2.0).0.is_empty());
        }
    }

    #[test]
    fn a_gap_has_its_own_width_and_no_ticks() {
        let scale = Scale::with_gaps((0.0, 100.0), &[(30.0, 90.0)], 10.0, 2.0, 20.0);
        let places = [0.0, 30.0, 60.0, 90.0, 100.0, 200.0].map(|value| scale.at(value));
        assert_eq!(places, [10.0, 70.0, 80.0, 90.0, 110.0, 110.0]);
        assert_eq!(scale.whole_ticks(20.0), [0.0, 10.0, 20.0, 90.0]);
        assert_eq!(scale.knots(), "10.0 0, 70.0 30, 90.0 90, 110.0 100");
    }

    #[test]
    fn a_range_is_widened_to_round_numbers() {
        assert_eq!(round_range(3.0, 97.0, 5), (0.0, 100.0));
        assert_eq!(round_range(-12.0, 4.0, 4), (-15.0, 5.0));
        assert_eq!(round_range(2.0, 2.0, 4), (2.0, 2.5));
    }
}
