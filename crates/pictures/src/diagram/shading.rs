//! Where links are cut: areas between lanes that a cut link crosses.

use std::collections::BTreeSet;

use protocol::Tick;

use crate::diagram::items::Cut;
use crate::diagram::lanes::Lanes;

/// The space between two lanes during a time in which the same links that cross it are cut.
#[derive(Debug)]
pub(crate) struct Shaded<'a> {
    /// Index of the lane above.
    pub(crate) above: usize,
    pub(crate) begin: Tick,
    /// The tick after the last one.
    pub(crate) end: Tick,
    pub(crate) cuts: Vec<&'a Cut>,
}

/// The areas in a window of ticks from `begin` up to and excluding `end`.
pub(crate) fn shaded<'a>(
    cuts: &'a [Cut],
    lanes: &Lanes,
    begin: Tick,
    end: Tick,
) -> Vec<Shaded<'a>> {
    let mut crossing: Vec<Vec<&Cut>> = vec![Vec::new(); lanes.all.len()];
    for cut in cuts {
        let from = lanes.index(&cut.from);
        let to = lanes.index(&cut.to);
        if let Some(from) = from
            && let Some(to) = to
        {
            for cuts in &mut crossing[from.min(to)..from.max(to)] {
                cuts.push(cut);
            }
        }
    }

    let mut areas = Vec::new();
    for (above, cuts) in crossing.iter().enumerate() {
        areas.extend(between(above, cuts, begin, end));
    }
    areas
}

/// The areas below one lane.
fn between<'a>(above: usize, cuts: &[&'a Cut], begin: Tick, end: Tick) -> Vec<Shaded<'a>> {
    let mut changes = BTreeSet::new();
    for cut in cuts {
        changes.insert(cut.period.begin.clamp(begin, end));
        changes.insert(cut.period.end.unwrap_or(end).clamp(begin, end));
    }

    let mut areas: Vec<Shaded<'a>> = Vec::new();
    let changes: Vec<Tick> = changes.into_iter().collect();
    for times in changes.windows(2) {
        let &[begin, end] = times else {
            continue;
        };
        let mut active = Vec::new();
        for cut in cuts {
            let period = cut.period;
            if period.begin <= begin && period.end.is_none_or(|over| over >= end) {
                active.push(*cut);
            }
        }
        if !active.is_empty() {
            areas.push(Shaded {
                above,
                begin,
                end,
                cuts: active,
            });
        }
    }
    areas
}
