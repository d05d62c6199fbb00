//! Where the robots were.

use std::collections::BTreeMap;

use pictures::{Cell, Chart, ChartPanel, Figure, Floor, Table};
use protocol::RobotName;

use super::facts::RunFacts;
use super::limits::panels;
use super::words::counted;

/// Where the robots of these runs were: a floor for each robot; `None` if no run has a recording.
pub(super) fn occupancy(runs: &[&RunFacts]) -> Option<Figure> {
    let mut floors: BTreeMap<&RobotName, Floor> = BTreeMap::new();
    let mut others = 0;
    for (name, floor) in runs.iter().flat_map(|run| &run.floors) {
        let sum = floors.entry(name).or_insert_with(|| Floor {
            title: format!("Where {name} was"),
            times_s: BTreeMap::new(),
            ..floor.clone()
        });
        // Fields of other sizes have other parts.
        if sum.field_m != floor.field_m {
            others += 1;
            continue;
        }
        for (part, time_s) in &floor.times_s {
            *sum.times_s.entry(*part).or_insert(0.0) += time_s;
        }
    }
    if floors.is_empty() {
        return None;
    }

    let mut table =
        Table::new("Robot | parts visited | time, s | longest in a part, s | at x, m | at y, m");
    let floors = floors.into_iter().collect();
    let (panels, sentence) = panels("robots", floors, |(name, floor)| {
        add_row(&mut table, name, &floor);
        ChartPanel::new(name.as_str(), Chart::Floor(floor))
    });
    let mut caption = format!(
        "Where the robots were, from above: the time that the center of a robot spent in each part of the floor. Darkness grows \
         with the square root of the time. Dark areas are obstacles, dark lines are walls. n = {}.{sentence}",
        counted(runs.len(), "run")
    );
    if others > 0 {
        caption += " Runs in a field of another size are left out.";
    }
    Some(Figure::new(panels, caption, Some(table)))
}

fn add_row(table: &mut Table, name: &RobotName, floor: &Floor) {
    let total_s = floor.times_s.values().sum();
    let mut longest_s = 0.0;
    let mut place = (0, 0);
    for (part, time_s) in &floor.times_s {
        if *time_s > longest_s {
            longest_s = *time_s;
            place = *part;
        }
    }

    let center_m = |part: u32| Cell::Number((f64::from(part) + 0.5) * floor.part_m, 2);
    table.row([
        name.as_str().into(),
        floor.times_s.len().into(),
        Cell::Number(total_s, 1),
        Cell::Number(longest_s, 1),
        center_m(place.0),
        center_m(place.1),
    ]);
}
