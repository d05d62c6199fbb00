//! How often one state of a robot followed another.

use std::collections::{BTreeMap, BTreeSet};

use protocol::RobotName;
use pictures::{Cell, Column, Figure, Matrix, MatrixCell, MatrixLabel, Panel, Part, State, Table};

use super::course::states_of;
use super::facts::RunFacts;
use super::limits::{MAX_PANELS, limited};
use super::words::counted;

/// How often a state, the first one, was followed by another one.
type Counts = BTreeMap<(String, String), u64>;

/// The transitions between emotions and those between behaviors, over these runs: a matrix for each robot. What has no
/// transition has no figure.
pub(super) fn transitions(runs: &[&RunFacts]) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (state, what) in [(State::Emotion, "emotions"), (State::Behavior, "behaviors")] {
        let mut panels = Vec::new();
        let mut table = Table::new(vec![
            Column::text("Robot"),
            Column::text("from"),
            Column::text("to"),
            Column::number("count"),
            Column::number("share of the row, %"),
        ]);
        let counts = counts(runs, state);
        let all = counts.len();
        for (name, counts) in counts.into_iter().take(MAX_PANELS) {
            let chart = matrix(name, state, what, &counts);
            panels.push(Panel {
                heading: name.to_string(),
                svg: chart.draw(),
                is_wide: chart.is_wide(),
            });
            add_rows(&mut table, name, &counts);
        }
        if panels.is_empty() {
            continue;
        }

        let (panels, sentence) = limited(panels, all, "robots");
        let caption = format!(
            "Transitions between {what}: how often the state of the row was followed by that of the column, and below it the share \
             of all transitions from the row. Darker is a larger share. n = {}.{sentence}",
            counted(runs.len(), "run")
        );
        figures.push(Figure {
            panels,
            caption: vec![Part::text(caption)],
            table: Some(table),
        });
    }
    figures
}

/// The transitions of each robot that has some.
fn counts<'a>(runs: &[&'a RunFacts], state: State) -> BTreeMap<&'a RobotName, Counts> {
    let mut counts: BTreeMap<&RobotName, Counts> = BTreeMap::new();
    for (name, robot) in runs.iter().flat_map(|run| &run.robots) {
        for (transition, count) in &states_of(robot, state).transitions {
            let of_robot = counts.entry(name).or_default();
            *of_robot.entry(transition.clone()).or_insert(0) += count;
        }
    }
    counts
}

/// Transitions from each state.
fn row_sums(counts: &Counts) -> BTreeMap<&str, u64> {
    let mut sums = BTreeMap::new();
    for ((from, _), count) in counts {
        *sums.entry(from.as_str()).or_insert(0) += count;
    }
    sums
}

fn matrix(name: &RobotName, state: State, what: &str, counts: &Counts) -> Matrix {
    let sums = row_sums(counts);
    let mut states = BTreeSet::new();
    for (from, to) in counts.keys() {
        states.insert(from.as_str());
        states.insert(to.as_str());
    }

    let mut labels = Vec::new();
    let mut cells = Vec::new();
    for from in &states {
        labels.push(MatrixLabel {
            text: (*from).to_owned(),
            color: Some(state.class(from)),
        });
        let mut row = Vec::new();
        for to in &states {
            let key = ((*from).to_owned(), (*to).to_owned());
            row.push(counts.get(&key).map(|count| {
                let share = *count as f64 / sums[from] as f64;
                MatrixCell {
                    share,
                    text: count.to_string(),
                    remark: format!("{:.0} %", 100.0 * share),
                }
            }));
        }
        cells.push(row);
    }
    Matrix {
        title: format!("Transitions between {what} of {name}"),
        rows_title: "from".to_owned(),
        columns_title: "to".to_owned(),
        rows: labels.clone(),
        columns: labels,
        cells,
    }
}

fn add_rows(table: &mut Table, name: &RobotName, counts: &Counts) {
    let sums = row_sums(counts);
    for ((from, to), count) in counts {
        let share = *count as f64 / sums[from.as_str()] as f64;
        table.rows.push(vec![
            Cell::text(name.as_str()),
            Cell::text(from),
            Cell::text(to),
            Cell::Count(*count),
            Cell::Number(100.0 * share, 1),
        ]);
    }
}
