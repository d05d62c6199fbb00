//! The horizontal axis: ticks to pixels. To scale, except in gaps where nothing happens.

use std::collections::BTreeSet;
use std::fmt::Write;

use protocol::Tick;

/// Width of a gap, pixels.
pub(crate) const GAP_PX: f64 = 44.0;
/// Windows of at most this many ticks have no gaps.
const WIDE_TICKS: Tick = 200;
/// Time in which nothing happens is a gap if it is longer than this, ticks.
const QUIET_TICKS: Tick = 40;
/// Ticks before and after something that happens that are to scale.
const MARGIN_TICKS: Tick = 4;
/// Width of a tick in a window of many ticks, pixels.
const TICK_PX: f64 = 4.0;
/// Most width of a tick, unless the axis would be narrower than it has to be, pixels.
const WIDEST_TICK_PX: f64 = 16.0;
/// Width that short windows fill, pixels.
const USUAL_PX: f64 = 1000.0;

/// A piece of the axis, linear in itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    pub(crate) begin: Tick,
    /// The tick after the last one.
    pub(crate) end: Tick,
    pub(crate) left_px: f64,
    pub(crate) right_px: f64,
    pub(crate) is_gap: bool,
}

/// How wide an axis is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Width {
    /// At least, unless the width of a tick is given, pixels.
    pub(crate) least_px: f64,
    /// At most, pixels.
    pub(crate) most_px: f64,
    /// Of a tick, if that is given, pixels.
    pub(crate) tick_px: Option<f64>,
}

/// The horizontal axis of a window.
#[derive(Debug)]
pub(crate) struct Scale {
    pieces: Vec<Piece>,
    /// Pixels of a tick outside of gaps.
    pub(crate) tick_px: f64,
}

impl Scale {
    /// An axis for ticks from `begin` up to and excluding `end`. `busy` are the ticks in which something
    /// happens; none of them is in a gap.
    pub(crate) fn new(
        begin: Tick,
        end: Tick,
        busy: Option<&BTreeSet<Tick>>,
        left_px: f64,
        width: Width,
    ) -> Self {
        let most_px = width.most_px;
        let gaps = busy.map_or_else(Vec::new, |busy| find_gaps(begin, end, busy));
        let gaps_px = gaps.len() as f64 * GAP_PX;
        // A picture that consists of gaps shows nothing.
        let gaps = if gaps_px > most_px / 2.0 {
            Vec::new()
        } else {
            gaps
        };

        let quiet: Tick = gaps.iter().map(|(begin, end)| end - begin).sum();
        let shown = (end - begin - quiet).max(1) as f64;
        let usual_px = (USUAL_PX / shown).clamp(TICK_PX, WIDEST_TICK_PX);
        let usual_px = usual_px.max(width.least_px / shown);
        let usual_px = width.tick_px.unwrap_or(usual_px);
        let tick_px = usual_px.min((most_px - gaps.len() as f64 * GAP_PX) / shown);

        let mut scale = Self {
            pieces: Vec::new(),
            tick_px,
        };
        let mut next = begin;
        let mut at_px = left_px;
        for (gap_begin, gap_end) in gaps {
            at_px = scale.add(next, gap_begin, at_px, false);
            at_px = scale.add(gap_begin, gap_end, at_px, true);
            next = gap_end;
        }
        scale.add(next, end, at_px, false);
        scale
    }

    /// Adds a piece; returns where it ends.
    fn add(&mut self, begin: Tick, end: Tick, left_px: f64, is_gap: bool) -> f64 {
        let width_px = if is_gap {
            GAP_PX
        } else {
            (end - begin) as f64 * self.tick_px
        };
        let right_px = left_px + width_px;

        self.pieces.push(Piece {
            begin,
            end,
            left_px,
            right_px,
            is_gap,
        });

        right_px
    }

    /// The pieces, from left to right.
    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Where a tick begins. Ticks outside of the window are at its edges.
    pub(crate) fn x(&self, tick: Tick) -> f64 {
        let index = self.pieces.partition_point(|piece| piece.end <= tick);
        let Some(piece) = self.pieces.get(index) else {
            return self.right_px();
        };

        let ticks = tick.saturating_sub(piece.begin) as f64;
        let share = ticks / (piece.end - piece.begin).max(1) as f64;
        piece.left_px + share * (piece.right_px - piece.left_px)
    }

    /// The left edge of the window.
    pub(crate) fn left_px(&self) -> f64 {
        self.pieces.first().map_or(0.0, |piece| piece.left_px)
    }

    /// The right edge of the window.
    pub(crate) fn right_px(&self) -> f64 {
        self.pieces.last().map_or(0.0, |piece| piece.right_px)
    }

    /// Points of the piecewise linear function from pixels to ticks, `x tick` each, for programs that look for the tick at a
    /// place of the picture.
    pub(crate) fn knots(&self) -> String {
        let mut text = String::new();
        for piece in &self.pieces {
            // Infallible: it is written to memory.
            let _ = write!(text, "{:.1} {}, ", piece.left_px, piece.begin);
        }
        let end = self.pieces.last().map_or(0, |piece| piece.end);
        let _ = write!(text, "{:.1} {end}", self.right_px());
        text
    }
}

/// Quiet periods of a window that is wide.
fn find_gaps(begin: Tick, end: Tick, busy: &BTreeSet<Tick>) -> Vec<(Tick, Tick)> {
    let mut gaps = Vec::new();
    if end - begin <= WIDE_TICKS {
        return gaps;
    }

    let mut last = begin;
    for tick in busy.range(begin..end).copied().chain([end]) {
        if tick - last > QUIET_TICKS {
            gaps.push((last + MARGIN_TICKS, tick - MARGIN_TICKS));
        }
        last = tick;
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn most(most_px: f64) -> Width {
        Width {
            least_px: 0.0,
            most_px,
            tick_px: None,
        }
    }

    #[test]
    fn quiet_time_is_a_gap_and_all_other_time_is_to_scale() {
        // What is outside of the window does not count.
        let busy = BTreeSet::from([10, 20, 500, 510, 9000]);
        let scale = Scale::new(0, 600, Some(&busy), 100.0, most(4000.0));

        let gaps = scale.pieces().iter().filter(|piece| piece.is_gap);
        let gaps: Vec<_> = gaps.map(|piece| (piece.begin, piece.end)).collect();
        assert_eq!(gaps, [(24, 496), (514, 596)]);
        let px = scale.tick_px;
        assert_eq!(scale.x(20) - scale.x(10), 10.0 * px);
        assert_eq!(scale.x(510) - scale.x(500), 10.0 * px);
        assert!((scale.x(500) - scale.x(20) - 8.0 * px - GAP_PX).abs() < 1e-9);
        assert_eq!(scale.x(0), 100.0);
        assert_eq!(scale.x(10_000), scale.right_px());
    }

    #[test]
    fn a_window_that_is_not_wide_has_no_gap() {
        let scale = Scale::new(0, 200, Some(&BTreeSet::from([0, 150])), 0.0, most(4000.0));
        assert_eq!(scale.pieces().len(), 1);
    }

    #[test]
    fn a_short_window_has_the_least_width_unless_the_width_of_a_tick_is_given() {
        let width = Width {
            least_px: 300.0,
            ..most(4000.0)
        };
        let scale = Scale::new(5, 6, None, 50.0, width);
        assert_eq!(scale.right_px() - scale.left_px(), 300.0);

        let width = Width {
            tick_px: Some(7.0),
            ..width
        };
        let scale = Scale::new(5, 6, None, 50.0, width);
        assert_eq!(scale.right_px() - scale.left_px(), 7.0);
    }

    #[test]
    fn no_window_is_wider_than_the_most() {
        for ticks in [1, 10, 1000, 100_000, 10_000_000] {
            let busy: BTreeSet<Tick> = (0..ticks).step_by(100).collect();
            for busy in [Some(&busy), None] {
                let scale = Scale::new(0, ticks, busy, 50.0, most(1500.0));
                let width_px = scale.right_px() - scale.left_px();
                assert!(width_px <= 1500.1, "{ticks} ticks: {width_px} px");
            }
        }
    }
}
