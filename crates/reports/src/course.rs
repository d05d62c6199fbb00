//! The course of a run: its states over time and its space-time diagram.

use pictures::{BandRow, Bands, Chart, ChartPanel, CourseLine, Figure, TimeCourse, round_range};
use protocol::{RobotName, Tick};
use record::EpochFiles;
use timeline::{StateKind, StateOrder};

use super::facts::{COURSES, RobotFacts, RunFacts};
use super::words::capitalized;
use crate::diagram::{DiagramOptions, Window, read};
use lab::LabError;
use lab::moment::Moment;

/// How a space-time diagram is read.
pub(super) const READ_DIAGRAM: &str = "to be read line by line: robots are lanes, with emotion above behavior; a slanted line is a \
     command, from the tick it was sent to the tick it arrived; a cross is where one was lost. n = 1 run.";
/// Ticks of one line of a space-time diagram, in which commands are told apart.
const LINE_TICKS: Tick = 150;
/// Most ticks of a line.
const MAX_LINE_TICKS: Tick = 600;
/// Most lines of a diagram.
const MAX_LINES: Tick = 12;
/// Most robots whose lines are told apart.
const MAX_LINES_OF_COURSE: usize = 24;
/// No further line is drawn after this many bytes.
const MAX_DIAGRAM_BYTES: usize = 400_000;
/// Width of a line, pixels: that of the page.
const LINE_PX: f64 = 720.0;

/// The course of a run: its emotions, and how strongly they are felt and what the robots have over time; `None` if it has nothing of it.
pub(super) fn course_figure(facts: &RunFacts) -> Option<Figure> {
    let mut panels = Vec::from_iter(run_panel(facts, StateKind::Emotion));
    let mut shown = Vec::new();
    if !panels.is_empty() {
        shown.push("emotions, a row for each robot, with the share of the time in each");
    }
    for name in COURSES {
        if let Some(panel) = variable_panel(facts, name) {
            panels.push(panel);
            shown.push(match name {
                "intensity" => "their intensity, from 0 to 1",
                _ => "the treats that a robot has",
            });
        }
    }
    if panels.is_empty() {
        return None;
    }

    let what = capitalized(&shown.join("; "));
    let caption = format!(
        "The course of the run. {what}. Time in which a robot took no part is empty. n = 1 run."
    );
    Some(Figure::new(panels, caption, None))
}

/// A state variable of the robots over time; `None` if no robot publishes it.
fn variable_panel(facts: &RunFacts, name: &str) -> Option<ChartPanel> {
    let mut lines = Vec::new();
    let mut most: f64 = 0.0;
    let mut least: f64 = 0.0;
    for (arm, (robot, of_robot)) in facts.robots.iter().enumerate() {
        let Some(values) = of_robot
            .courses
            .get(name)
            .filter(|values| !values.is_empty())
        else {
            continue;
        };
        for value in values.iter().filter_map(|(_, value)| *value) {
            most = most.max(value);
            least = least.min(value);
        }
        lines.push(CourseLine {
            label: robot.to_string(),
            arm,
            values: values.clone(),
        });
    }
    if lines.is_empty() || lines.len() > MAX_LINES_OF_COURSE {
        return None;
    }

    let chart = TimeCourse {
        title: format!("{} over time", capitalized(name)),
        axis: name.to_owned(),
        end_s: facts.time_s(),
        rows: facts.robots.keys().map(RobotName::to_string).collect(),
        range: round_range(least, most, 3),
        lines,
    };
    Some(ChartPanel::new("", Chart::Course(chart)))
}

/// The states of the robots of one run over time; `None` if they have none.
pub(super) fn run_panel(facts: &RunFacts, kind: StateKind) -> Option<ChartPanel> {
    let row = |(name, robot): (&RobotName, &RobotFacts)| BandRow {
        label: name.to_string(),
        bands: robot.bands(kind).clone(),
    };
    let rows: Vec<BandRow> = facts.robots.iter().map(row).collect();
    let has_states = rows.iter().any(|row| !row.bands.is_empty());
    has_states.then(|| state_panel(rows, kind, facts.time_s(), "", &facts.names))
}

/// Rows of states over time.
pub(super) fn state_panel(
    rows: Vec<BandRow>,
    kind: StateKind,
    end_s: f64,
    heading: &str,
    names: &StateOrder,
) -> ChartPanel {
    let chart = Bands {
        title: format!("{} over time {heading}", states_in_words(kind)),
        kind,
        end_s,
        rows,
        names: names.clone(),
    };
    ChartPanel::new(heading, Chart::Bands(chart))
}

/// What the states are.
pub(super) fn states_in_words(kind: StateKind) -> &'static str {
    match kind {
        StateKind::Emotion => "Emotions",
        StateKind::Behavior => "Behaviors",
    }
}

/// A space-time diagram in lines.
pub(super) struct DiagramLines {
    /// The lines, from top to bottom.
    pub(super) lines: Vec<ChartPanel>,
    /// The last tick that they have.
    pub(super) last: Tick,
}

/// The diagram of a run in lines of the same number of ticks, one below the other.
pub(super) fn diagram_lines(
    name: &str,
    facts: &RunFacts,
    files: &EpochFiles,
) -> Result<DiagramLines, LabError> {
    let ticks = facts.last_tick + 1;
    // A short rest is not a line of its own.
    let count = ((ticks + LINE_TICKS / 2) / LINE_TICKS).clamp(1, MAX_LINES);
    let length = ticks.div_ceil(count).clamp(LINE_TICKS, MAX_LINE_TICKS);

    let mut lines = Vec::new();
    let mut bytes = 0;
    let mut next = 0;
    while next < ticks && next < MAX_LINES * length && bytes < MAX_DIAGRAM_BYTES {
        let window = Window {
            from: Some(Moment::Tick(next)),
            to: Some(Moment::Tick(next + length - 1)),
        };
        let options = DiagramOptions {
            title: name.to_owned(),
            is_whole: true,
            has_style: false,
            has_legend: false,
            names: facts.names.clone(),
            width: Some((LINE_PX, length)),
            ..DiagramOptions::default()
        };
        let (diagram, _) = read(files, window, options)?;
        bytes += diagram.to_svg().map_err(LabError::refused)?.len();
        lines.push(diagram);
        next += length;
    }
    Ok(DiagramLines {
        lines: ChartPanel::diagram(lines),
        last: facts.last_tick.min(next - 1),
    })
}
