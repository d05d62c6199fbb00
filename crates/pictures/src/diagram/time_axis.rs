//! The axis of time. It is to scale, except in gaps where nothing happens.

use std::collections::BTreeSet;

use protocol::Tick;

use crate::diagram::picture::{CAPTION_PX, Picture};
use crate::diagram::words::seconds;
use crate::labels::width_px;
use crate::scale::Scale;
use crate::shapes::{LABEL_PX, Pixel};

/// Width of a gap, pixels.
const GAP_PX: f64 = 44.0;
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
/// Least distance of two labels, pixels.
const LABEL_STEP_PX: f64 = 64.0;

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

/// A scale for ticks from `begin` up to and excluding `end`. `busy` are the ticks in which something happens; none of them is in
/// a gap. Without it there are no gaps.
pub(crate) fn scale(
    (begin, end): (Tick, Tick),
    busy: Option<&BTreeSet<Tick>>,
    left_px: f64,
    width: Width,
) -> Scale {
    let most_px = width.most_px;
    let mut gaps = busy.map_or_else(Vec::new, |busy| find_gaps(begin, end, busy));
    // A picture that consists of gaps shows nothing.
    if gaps.len() as f64 * GAP_PX > most_px / 2.0 {
        gaps.clear();
    }

    let quiet: f64 = gaps.iter().map(|(begin, end)| end - begin).sum();
    let shown = ((end - begin) as f64 - quiet).max(1.0);
    let usual_px = (USUAL_PX / shown).clamp(TICK_PX, WIDEST_TICK_PX);
    let usual_px = usual_px.max(width.least_px / shown);
    let usual_px = width.tick_px.unwrap_or(usual_px);
    let tick_px = usual_px.min((most_px - gaps.len() as f64 * GAP_PX) / shown);
    Scale::with_gaps((begin as f64, end as f64), &gaps, left_px, tick_px, GAP_PX)
}

/// Quiet periods of a window that is wide.
fn find_gaps(begin: Tick, end: Tick, busy: &BTreeSet<Tick>) -> Vec<(f64, f64)> {
    let mut gaps = Vec::new();
    if end - begin <= WIDE_TICKS {
        return gaps;
    }

    let mut last = begin;
    for tick in busy.range(begin..end).copied().chain([end]) {
        if tick - last > QUIET_TICKS {
            gaps.push(((last + MARGIN_TICKS) as f64, (tick - MARGIN_TICKS) as f64));
        }
        last = tick;
    }
    gaps
}

/// Draws vertical lines at round ticks.
pub(crate) fn draw_grid(picture: &mut Picture) {
    let top = picture.lanes.top();
    let bottom = picture.lanes.bottom;
    for tick in picture.scale.whole_ticks(LABEL_STEP_PX) {
        let x = picture.scale.at(tick);
        picture.line("grid", &[(x, top), (x, bottom)]);
    }
}

/// Draws the axis below the lanes, and covers the gaps.
pub(crate) fn draw_axis(picture: &mut Picture) {
    let top = picture.lanes.top();
    let bottom = picture.lanes.bottom;
    let left = picture.scale.begin_px();
    let right = picture.scale.end_px();
    picture.line("axis", &[(left, bottom), (right, bottom)]);
    if picture.window.has_end {
        picture.open("end-of-run", picture.window.to, "the run ended");
        picture.line("end", &[(right, top), (right, bottom)]);
        picture.close();
    }

    let (tick_y, time_y) = (bottom + 15.0, bottom + 29.0);
    let mut free_from = left - CAPTION_PX;
    let svg = &mut picture.svg;
    svg.text("muted", free_from, tick_y, "end", "tick");
    svg.text("muted", free_from, time_y, "end", "time");
    for tick in picture.scale.whole_ticks(LABEL_STEP_PX) {
        let x = picture.scale.at(tick);
        let number = tick.to_string();
        let time = seconds(tick as Tick, picture.window.tick_s);
        let half_px = width_px(&number, LABEL_PX).max(width_px(&time, LABEL_PX)) / 2.0;
        if x - half_px < free_from {
            continue;
        }

        free_from = x + half_px + 8.0;
        svg.line("axis", &[(x, bottom), (x, bottom + 4.0)]);
        svg.text("", x, tick_y, "middle", &number);
        svg.text("muted", x, time_y, "middle", &time);
    }
    draw_gaps(picture);
}

/// Covers time in which nothing happens with a strip that has torn edges.
fn draw_gaps(picture: &mut Picture) {
    let top = picture.lanes.top() - 2.0;
    let bottom = picture.lanes.bottom + 6.0;

    for gap in picture.scale.gaps() {
        let (begin, end) = (gap.from as Tick, gap.to as Tick);
        let time = seconds(end - begin, picture.window.tick_s);
        let title = format!(
            "nothing happens for {time}, from tick {begin} to tick {end}: this part is not to scale"
        );
        picture.open("gap", begin + (end - begin) / 2, &title);

        let (left, right) = (gap.from_px + 8.0, gap.to_px - 8.0);
        let svg = &mut picture.svg;
        svg.rect("paper", (left, top), right - left, bottom - top);
        for x in [left, right] {
            svg.line("zigzag", &zigzag(x, top, bottom));
        }
        let center = f64::midpoint(left, right);
        svg.text("muted", center, top + 2.0, "middle", &format!("… {time} …"));
        picture.close();
    }
}

fn zigzag(x: f64, top: f64, bottom: f64) -> Vec<Pixel> {
    const TOOTH_PX: f64 = 6.0;
    let teeth = ((bottom - top) / TOOTH_PX) as u32;
    let point = |tooth: u32| {
        let aside = if tooth.is_multiple_of(2) { -2.5 } else { 2.5 };
        (x + aside, top + f64::from(tooth) * TOOTH_PX)
    };
    (0..=teeth).map(point).collect()
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
        let scale = scale((0, 600), Some(&busy), 100.0, most(4000.0));

        let gaps = scale.gaps();
        let gaps: Vec<_> = gaps.iter().map(|gap| (gap.from, gap.to)).collect();
        assert_eq!(gaps, [(24.0, 496.0), (514.0, 596.0)]);
        let px = (scale.at(20.0) - scale.at(10.0)) / 10.0;
        assert!((scale.at(510.0) - scale.at(500.0) - 10.0 * px).abs() < 1e-9);
        assert!((scale.at(500.0) - scale.at(20.0) - 8.0 * px - GAP_PX).abs() < 1e-9);
        assert_eq!(scale.at(0.0), 100.0);
        assert_eq!(scale.at(10_000.0), scale.end_px());
    }

    #[test]
    fn a_window_that_is_not_wide_has_no_gap() {
        let busy = BTreeSet::from([0, 150]);
        let scale = scale((0, 200), Some(&busy), 0.0, most(4000.0));
        assert!(scale.gaps().is_empty());
    }

    #[test]
    fn a_short_window_has_the_least_width_unless_the_width_of_a_tick_is_given() {
        for (tick_px, expected_px) in [(None, 300.0), (Some(7.0), 7.0)] {
            let width = Width {
                least_px: 300.0,
                tick_px,
                ..most(4000.0)
            };
            let scale = scale((5, 6), None, 50.0, width);
            assert_eq!(scale.end_px() - scale.begin_px(), expected_px);
        }
    }

    #[test]
    fn no_window_is_wider_than_the_most() {
        for ticks in [1, 10, 1000, 100_000, 10_000_000] {
            let busy: BTreeSet<Tick> = (0..ticks).step_by(100).collect();
            for busy in [Some(&busy), None] {
                let scale = scale((0, ticks), busy, 50.0, most(1500.0));
                let width_px = scale.end_px() - scale.begin_px();
                assert!(width_px <= 1500.1, "{ticks} ticks: {width_px} px");
            }
        }
    }
}
