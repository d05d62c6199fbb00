//! How often one state of a robot followed another.

use std::collections::{BTreeMap, BTreeSet};

use pictures::{
    Cell, Chart, ChartPanel, Figure, Matrix, MatrixCell, MatrixLabel, Table, state_look,
};
use protocol::RobotName;
use timeline::{StateKind, StateOrder};

use super::facts::RunFacts;
use super::limits::panels;
use super::words::counted;

/// How often a state, the first one, was followed by another one.
type Counts = BTreeMap<(String, String), u64>;

/// The transitions between emotions and those between behaviors, over these runs: a matrix for each robot. What has no
/// transition has no figure.
pub(super) fn transitions(runs: &[&RunFacts]) -> Vec<Figure> {
    let kinds = [
        (StateKind::Emotion, "emotions"),
        (StateKind::Behavior, "behaviors"),
    ];
    let figures = kinds.map(|(kind, what)| figure(runs, kind, what));
    figures.into_iter().flatten().collect()
}

fn figure(runs: &[&RunFacts], kind: StateKind, what: &str) -> Option<Figure> {
    let mut counts: BTreeMap<&RobotName, Counts> = BTreeMap::new();
    for (name, robot) in runs.iter().flat_map(|run| &run.robots) {
        for (transition, count) in &robot.counts.states(kind).transitions {
            let of_robot = counts.entry(name).or_default();
            *of_robot.entry(transition.clone()).or_insert(0) += count;
        }
    }
    let names = runs.first().map(|run| &run.names)?;
    if counts.is_empty() {
        return None;
    }

    let mut table = Table::new("Robot | from | to | count | share of the row, %");
    let counts = counts.into_iter().collect();
    let (panels, sentence) = panels("robots", counts, |(name, counts)| {
        let title = format!("Transitions between {what} of {name}");
        matrix(name, title, (kind, names), &counts, &mut table)
    });
    let caption = format!(
        "Transitions between {what}: how often the state of the row was followed by that of the column, and below it the share \
         of all transitions from the row. Darker is a larger share. n = {}.{sentence}",
        counted(runs.len(), "run")
    );
    Some(Figure::new(panels, caption, Some(table)))
}

/// The matrix of a robot, whose numbers are added to the table.
fn matrix(
    name: &RobotName,
    title: String,
    (kind, names): (StateKind, &StateOrder),
    counts: &Counts,
    table: &mut Table,
) -> ChartPanel {
    let mut sums: BTreeMap<&str, u64> = BTreeMap::new();
    for ((from, _), count) in counts {
        *sums.entry(from).or_default() += count;
    }
    let states = on_ladder(kind, names, counts);

    let label = |state: &&str| MatrixLabel {
        text: (*state).to_owned(),
        look: Some(state_look(kind, state, names)),
    };
    let labels: Vec<MatrixLabel> = states.iter().map(label).collect();
    let mut cells = vec![vec![None; states.len()]; states.len()];
    for ((from, to), count) in counts {
        let share = *count as f64 / sums[from.as_str()] as f64;
        let place = |state: &String| states.iter().position(|other| other == state);
        if let (Some(row), Some(column)) = (place(from), place(to)) {
            cells[row][column] = Some(MatrixCell {
                share,
                text: count.to_string(),
                remark: format!("{:.0} %", 100.0 * share),
            });
        }
        table.row([
            name.as_str().into(),
            from.as_str().into(),
            to.as_str().into(),
            (*count).into(),
            Cell::Number(100.0 * share, 1),
        ]);
    }

    let chart = Matrix {
        title,
        rows_title: "from".to_owned(),
        columns_title: "to".to_owned(),
        rows: labels.clone(),
        columns: labels,
        cells,
    };
    ChartPanel::new(name.as_str(), Chart::Matrix(chart))
}

/// The states of transitions: emotions of the paper from HAPPY up the ladder, others after them as they first occurred in the run.
fn on_ladder<'a>(kind: StateKind, names: &StateOrder, counts: &'a Counts) -> Vec<&'a str> {
    let mut states = BTreeSet::new();
    for (from, to) in counts.keys() {
        for state in [from, to] {
            states.insert((state_look(kind, state, names), state.as_str()));
        }
    }
    states.into_iter().map(|(_, state)| state).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emotions_are_in_the_order_of_the_ladder_and_others_as_they_occur() {
        let mut names = StateOrder::default();
        for name in ["ZEN", "BORED", "HAPPY"] {
            names.add(StateKind::Emotion, name);
        }
        // That of `affect::StandardEmotion`.
        let ladder = [
            "HAPPY",
            "CONFIDENT",
            "CONCERNED",
            "FRUSTRATED",
            "ANGRY",
            "DISCOURAGED",
            "HOPEFUL",
        ];
        let mut counts = Counts::new();
        for name in ["BORED", "ZEN"].into_iter().chain(ladder) {
            counts.insert((name.to_owned(), "HAPPY".to_owned()), 1);
        }

        let mut expected = ladder.to_vec();
        expected.extend(["ZEN", "BORED"]);
        assert_eq!(on_ladder(StateKind::Emotion, &names, &counts), expected);
    }
}
