//! What decided the run, below the axis of time: a row for each answer of `cars why`, with the curve and its jumps.

use protocol::Tick;
use timeline::{DecisionPoint, ForkOutcomes, RunDecision};

use crate::chart::outcome::draw_curve;
use crate::diagram::picture::{LabelPosition, Picture, VisibleTicks};
use crate::labels::shortened;
use crate::scale::Scale;
use crate::shapes::SMALL_PX;

/// Height of a row with the space above it, pixels.
const ROW_PX: f64 = 66.0;
/// Height of the plot of a row, pixels.
const PLOT_PX: f64 = 40.0;
/// Most answers that are drawn.
const MAX_ROWS: usize = 4;
/// Most letters of the words above a curve.
const WORDS_LETTERS: usize = 110;
/// Classes of the interval, the curve and a jump. They are those of other things, so that the style sheet of a diagram without an
/// answer is the same.
const INTERVAL: &str = "b5";
const CURVE: &str = "line";
const JUMP: &str = "break";

/// Draws a row for each answer from `top` on. Returns where they end.
pub(crate) fn draw_decisions(picture: &mut Picture, decisions: &[RunDecision], top: f64) -> f64 {
    let mut top = top;
    for decision in decisions.iter().take(MAX_ROWS) {
        draw_row(picture, decision, top);
        top += ROW_PX;
    }
    top
}

fn draw_row(picture: &mut Picture, decision: &RunDecision, top: f64) {
    let (left, right) = (picture.scale.begin_px(), picture.scale.end_px());
    let (above, bottom) = (top + ROW_PX - PLOT_PX, top + ROW_PX);
    let (least, most) = decision.range();
    let y = Scale::new(least, most, bottom, above);

    let tag = picture.svg.tag("g").class("decision");
    tag.with("data-question", &decision.question.name).open();
    picture.svg.title(&decision.sentence);
    let words = if decision.is_share {
        format!("{}: {}", decision.axis(), decision.question.name)
    } else {
        decision.axis()
    };
    let words = shortened(&words, WORDS_LETTERS);
    picture
        .svg
        .text("muted", left, above - 8.0, "start", &words);
    for (value, at) in [(most, above + 4.0), (least, bottom)] {
        let amount = decision.number(value);
        picture
            .svg
            .text("small muted", left - 6.0, at, "end", &amount);
    }
    for at in [above, bottom] {
        picture.line("grid", &[(left, at), (right, at)]);
    }
    let points = shown(&decision.curve, picture.window);
    let scale = picture.scale.clone();
    let place = |point: &DecisionPoint| scale.at(point.tick as f64);
    draw_curve(&mut picture.svg, &points, (INTERVAL, CURVE), place, &y);
    picture.close();

    let window = picture.window;
    let jumps = decision.jumps.iter();
    for jump in jumps.filter(|jump| (window.from..=window.to).contains(&jump.tick)) {
        let at = picture.x(jump.tick);
        picture.open("jump", jump.tick, &decision.told(jump));
        picture.line(JUMP, &[(at, above - 3.0), (at, bottom)]);
        picture.close();
        let (before, after) = (decision.amount(&jump.before), decision.amount(&jump.after));
        let middle = above + SMALL_PX;
        let places = [
            LabelPosition::After(at + 4.0, middle),
            LabelPosition::Before(at - 4.0, middle),
            LabelPosition::After(at + 4.0, bottom - SMALL_PX),
            LabelPosition::Before(at - 4.0, bottom - SMALL_PX),
        ];
        picture.label("reason", jump.tick, format!("{before} → {after}"), &places);
    }
}

/// The points in a window, with those on the curve at its ends.
fn shown(curve: &[DecisionPoint], window: VisibleTicks) -> Vec<DecisionPoint> {
    let (from, to) = (window.from, window.end());
    let is_inside = |point: &&DecisionPoint| from < point.tick && point.tick < to;
    let mut points = Vec::from_iter(between(curve, from));
    points.extend(curve.iter().filter(is_inside));
    points.extend(between(curve, to));
    points
}

/// The point on the curve at a tick; `None` before its begin and after its end.
fn between(curve: &[DecisionPoint], tick: Tick) -> Option<DecisionPoint> {
    let index = curve.partition_point(|point| point.tick < tick);
    let after = curve.get(index)?;
    if after.tick == tick {
        return Some(*after);
    }
    let before = curve.get(index.checked_sub(1)?)?;

    let share = (tick - before.tick) as f64 / (after.tick - before.tick) as f64;
    let mix = |one: f64, other: f64| one + share * (other - one);
    let (low, high) = before.outcome.ends()?;
    let (next_low, next_high) = after.outcome.ends()?;
    Some(DecisionPoint {
        tick,
        outcome: ForkOutcomes {
            n: before.outcome.n.min(after.outcome.n),
            value: Some(mix(before.outcome.value?, after.outcome.value?)),
            low: Some(mix(low, next_low)),
            high: Some(mix(high, next_high)),
            failed: before.outcome.failed.max(after.outcome.failed),
        },
    })
}
