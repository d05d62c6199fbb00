//! The course of a run: its states over time and its space-time diagram.

use protocol::Tick;
use record::EpochFiles;
use pictures::{BandRow, Bands, Panel, State};

use super::facts::{RobotFacts, RunFacts, States};
use crate::diagram::{Options, Window, draw};
use crate::moment::Moment;

/// Ticks of one line of a space-time diagram, in which commands are told apart.
const LINE_TICKS: Tick = 150;
/// Most ticks of a line.
const MAX_LINE_TICKS: Tick = 600;
/// Most lines of a diagram.
const MAX_LINES: Tick = 12;
/// No further line is drawn after this many bytes.
const MAX_DIAGRAM_BYTES: usize = 400_000;
/// Width of a line without the names at its left, pixels.
const LINE_PX: f64 = 620.0;

/// The states of the robots of one run over time; `None` if they have none.
pub(super) fn run_panel(facts: &RunFacts, state: State, what: &str) -> Option<Panel> {
    let mut rows = Vec::new();
    for (name, robot) in &facts.robots {
        rows.push(BandRow {
            label: name.to_string(),
            bands: states_of(robot, state).bands.clone(),
        });
    }
    state_panel(rows, state, facts.time_s(), what, "")
}

/// Rows of states over time; `None` if there are no states.
pub(super) fn state_panel(
    rows: Vec<BandRow>,
    state: State,
    end_s: f64,
    what: &str,
    heading: &str,
) -> Option<Panel> {
    let bands = rows.iter().map(|row| row.bands.len()).sum::<usize>();
    let chart = Bands {
        title: format!("{what} over time {heading}").trim_end().to_owned(),
        state,
        end_s,
        rows,
    };

    (bands > 0).then(|| Panel {
        heading: heading.to_owned(),
        svg: chart.draw(),
        is_wide: true,
    })
}

/// The states of one kind.
pub(super) fn states_of(robot: &RobotFacts, state: State) -> &States {
    match state {
        State::Emotion => &robot.emotions,
        State::Behavior => &robot.behaviors,
    }
}

/// A space-time diagram in lines.
pub(super) struct DiagramLines {
    /// The lines, from top to bottom.
    pub(super) lines: Vec<Panel>,
    /// The last tick that they have.
    pub(super) last: Tick,
}

/// The diagram of a run in lines of the same number of ticks, one below the other.
pub(super) fn diagram_lines(
    name: &str,
    facts: &RunFacts,
    files: &EpochFiles,
) -> miette::Result<DiagramLines> {
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
        let options = Options {
            title: name.to_owned(),
            is_whole: true,
            has_style: false,
            has_legend: false,
            tick_px: Some(LINE_PX / length as f64),
            ..Options::default()
        };
        let svg = draw(files, window, options)?.svg;
        bytes += svg.len();
        lines.push(Panel {
            heading: String::new(),
            svg,
            is_wide: true,
        });
        next += length;
    }
    Ok(DiagramLines {
        lines,
        last: facts.last_tick.min(next - 1),
    })
}
