//! Shades the space between lanes where links that cross it are cut.

use std::collections::BTreeSet;

use protocol::Tick;
use timeline::{CutSpan, Period};

use crate::diagram::items::Items;
use crate::diagram::picture::{LabelPosition, Picture};
use crate::labels::width_px;
use crate::shapes::LABEL_PX;

/// Draws the cuts.
pub(crate) fn draw_cuts(picture: &mut Picture, items: &Items) {
    let mut crossing: Vec<Vec<&CutSpan>> = vec![Vec::new(); picture.lanes.all.len()];
    for cut in &items.cuts {
        if let Some(between) = picture.lanes.between(&cut.from, &cut.to) {
            for cuts in &mut crossing[between] {
                cuts.push(cut);
            }
        }
    }
    for (above, cuts) in crossing.iter().enumerate() {
        draw_below(picture, above, cuts);
    }
}

/// Draws the cuts of links that cross the space below a lane: an area for each time in which the same ones are cut.
fn draw_below(picture: &mut Picture, above: usize, cuts: &[&CutSpan]) {
    let mut changes: BTreeSet<Tick> = BTreeSet::new();
    for cut in cuts {
        let shown = picture.window.clip(cut.period);
        changes.extend(shown.into_iter().flat_map(|(begin, end)| [begin, end]));
    }

    let changes: Vec<Tick> = changes.into_iter().collect();
    for times in changes.windows(2) {
        let (begin, end) = (times[0], times[1]);
        let mut active = cuts.to_vec();
        active.retain(|cut| cut.period.begin <= begin && cut.period.lasts_to(end));
        if !active.is_empty() {
            let end = Some(end);
            draw_area(picture, above, Period { begin, end }, &active);
        }
    }
}

fn draw_area(picture: &mut Picture, above: usize, period: Period, cuts: &[&CutSpan]) {
    let Some((left, width)) = picture.extent(period) else {
        return;
    };
    let top = picture.lanes.all[above].bottom;
    let bottom = picture.lanes.all[above + 1].top;

    let title = picture.titles.cuts(cuts);
    picture.open("partition", period.begin, &title);
    picture.svg.rect("cut", (left, top), width, bottom - top);
    picture.close();

    let text = match cuts {
        [cut] => format!("{} → {} cut", cut.from, cut.to),
        [one, other] if one.from == other.to && one.to == other.from => {
            format!("{} ↔ {} cut", one.from, one.to)
        }
        _ => format!("{} links cut", cuts.len()),
    };
    if width_px(&text, LABEL_PX) + 8.0 <= width {
        let places =
            [top + 8.0, bottom - 8.0].map(|middle| LabelPosition::After(left + 4.0, middle));
        picture.label("reason", period.begin, text, &places);
    }
}
