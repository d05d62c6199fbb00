//! Draws the axis of time and the gaps in it.

use protocol::Tick;

use crate::diagram::picture::{CAPTION_PX, LABEL_PX, Picture};
use crate::diagram::words::{seconds, width_px};

/// Least distance of two labels of the axis, pixels.
const LABEL_STEP_PX: f64 = 64.0;

/// Draws vertical lines at round ticks.
pub(crate) fn draw_grid(picture: &mut Picture) {
    let top = picture.lanes.top();
    let bottom = picture.lanes.bottom;
    for tick in round_ticks(picture) {
        let x = picture.scale.x(tick);
        picture.path("grid", &[(x, top), (x, bottom)]);
    }
}

/// Draws the axis below the lanes, and covers the gaps.
pub(crate) fn draw_axis(picture: &mut Picture) {
    let top = picture.lanes.top();
    let bottom = picture.lanes.bottom;
    let left = picture.scale.left_px();
    let right = picture.scale.right_px();
    picture.path("axis", &[(left, bottom), (right, bottom)]);
    if picture.window.has_end {
        picture.open("end-of-run", picture.window.to, "the run ended");
        picture.path("end", &[(right, top), (right, bottom)]);
        picture.close();
    }

    let tick_s = picture.window.tick_s;
    picture.text("muted", left - CAPTION_PX, bottom + 15.0, "end", "tick");
    picture.text("muted", left - CAPTION_PX, bottom + 29.0, "end", "time");
    let mut free_from = left - CAPTION_PX;
    for tick in round_ticks(picture) {
        let x = picture.scale.x(tick);
        let number = tick.to_string();
        let time = seconds(tick, tick_s);
        let half_px = width_px(&number, LABEL_PX).max(width_px(&time, LABEL_PX)) / 2.0;
        if x - half_px < free_from {
            continue;
        }

        free_from = x + half_px + 8.0;
        picture.path("axis", &[(x, bottom), (x, bottom + 4.0)]);
        picture.text("", x, bottom + 15.0, "middle", &number);
        picture.text("muted", x, bottom + 29.0, "middle", &time);
    }
    draw_gaps(picture);
}

/// Covers time in which nothing happens with a strip that has torn edges.
fn draw_gaps(picture: &mut Picture) {
    let top = picture.lanes.top() - 2.0;
    let bottom = picture.lanes.bottom;
    let pieces = picture.scale.pieces().to_vec();

    for gap in pieces.iter().filter(|piece| piece.is_gap) {
        let time = seconds(gap.end - gap.begin, picture.window.tick_s);
        let title = format!(
            "nothing happens for {time}, from tick {} to tick {}: this part is not to scale",
            gap.begin, gap.end
        );
        let middle = gap.begin + (gap.end - gap.begin) / 2;
        picture.open("gap", middle, &title);

        let left = gap.left_px + 8.0;
        let right = gap.right_px - 8.0;
        picture.rect("paper", left, top, right - left, bottom - top + 6.0);
        for x in [left, right] {
            picture.path("zigzag", &zigzag(x, top, bottom + 6.0));
        }

        let center = (left + right) / 2.0;
        picture.text("muted", center, top + 2.0, "middle", &format!("… {time} …"));
        picture.close();
    }
}

fn zigzag(x: f64, top: f64, bottom: f64) -> Vec<(f64, f64)> {
    const TOOTH_PX: f64 = 6.0;
    let mut points = Vec::new();
    let mut y = top;
    while y <= bottom {
        let aside = if points.len() % 2 == 0 { -2.5 } else { 2.5 };
        points.push((x + aside, y));
        y += TOOTH_PX;
    }
    points
}

/// Ticks that are multiples of a round number of ticks, outside of gaps.
fn round_ticks(picture: &Picture) -> Vec<Tick> {
    let mut step: Tick = 1;
    for factor in [2, 5, 10].iter().cycle().take(60) {
        if step as f64 * picture.scale.tick_px >= LABEL_STEP_PX {
            break;
        }
        let decade = Tick::pow(10, step.ilog10());
        step = decade.saturating_mul(*factor);
    }

    let mut ticks = Vec::new();
    for piece in picture.scale.pieces() {
        if piece.is_gap {
            continue;
        }
        let mut tick = piece.begin.div_ceil(step).saturating_mul(step);
        while tick < piece.end {
            ticks.push(tick);
            tick += step;
        }
    }
    ticks
}
