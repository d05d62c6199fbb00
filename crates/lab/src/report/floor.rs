//! Where the robots were.

use std::collections::BTreeMap;

use protocol::RobotName;
use pictures::{Cell, Column, Figure, Floor, Panel, Part, Table};

use super::facts::RunFacts;
use super::limits::{MAX_PANELS, limited};
use super::words::counted;

/// Where the robots of these runs were: a floor for each robot; `None` if no run has a recording.
pub(super) fn occupancy(runs: &[&RunFacts]) -> Option<Figure> {
    let mut floors: BTreeMap<&RobotName, Floor> = BTreeMap::new();
    let mut others = 0;
    for (name, floor) in runs.iter().flat_map(|run| &run.floors) {
        let sum = floors.entry(name).or_insert_with(|| Floor {
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

    let mut panels = Vec::new();
    let mut table = Table::new(vec![
        Column::text("Robot"),
        Column::number("parts visited"),
        Column::number("time, s"),
        Column::number("longest in a part, s"),
        Column::number("at x, m"),
        Column::number("at y, m"),
    ]);
    let all = floors.len();
    for (name, mut floor) in floors.into_iter().take(MAX_PANELS) {
        floor.title = format!("Where {name} was");
        add_row(&mut table, name, &floor);
        panels.push(Panel {
            heading: name.to_string(),
            svg: floor.draw(),
            is_wide: false,
        });
    }
    let (panels, sentence) = limited(panels, all, "robots");
    let mut caption = format!(
        "Where the robots were, from above: the time that the center of a robot spent in each part of the floor. Darkness grows \
         with the square root of the time. Dark squares are obstacles. n = {}.{sentence}",
        counted(runs.len(), "run")
    );
    if others > 0 {
        caption += " Runs in a field of another size are left out.";
    }
    Some(Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: Some(table),
    })
}

fn add_row(table: &mut Table, name: &RobotName, floor: &Floor) {
    let mut total_s = 0.0;
    let mut longest_s = 0.0;
    let mut place = (0, 0);
    for (part, time_s) in &floor.times_s {
        total_s += time_s;
        if *time_s > longest_s {
            longest_s = *time_s;
            place = *part;
        }
    }

    table.rows.push(vec![
        Cell::text(name.as_str()),
        Cell::Count(floor.times_s.len() as u64),
        Cell::Number(total_s, 1),
        Cell::Number(longest_s, 1),
        Cell::Number((f64::from(place.0) + 0.5) * floor.part_m, 2),
        Cell::Number((f64::from(place.1) + 0.5) * floor.part_m, 2),
    ]);
}
