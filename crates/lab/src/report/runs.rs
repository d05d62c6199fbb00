//! The report of one or several runs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use miette::miette;
use protocol::messages::{End, Variable};
use protocol::time::{self, tick_seconds, time_s};
use protocol::{RobotName, Tick};
use record::{EpochFiles, RunFolder, Summary};
use pictures::{BandRow, Cell, Column, Figure, Page, Panel, Part, State, Table};

use super::course::{diagram_lines, run_panel, state_panel, states_of};
use super::facts::{Disturbance, RunFacts};
use super::floor::occupancy;
use super::limits::{MAX_PANELS, limited};
use super::transitions::transitions;
use super::words::counted;
use crate::folder::{read_summary, recorded_epoch};
use crate::shell;

/// Most runs of a report.
pub const MAX_RUNS: usize = 64;
/// Runs of which the space-time diagram is drawn.
const MAX_DIAGRAMS: usize = 2;
/// Most rows of a table of disturbances.
const MAX_DISTURBANCES: usize = 200;

/// Most rows of the table of verdicts.
const MAX_VERDICTS: usize = 200;

/// A run with its facts.
struct Run {
    /// Name of its folder.
    name: String,
    /// How its folder is given on the command line.
    path: PathBuf,
    files: EpochFiles,
    facts: RunFacts,
    summary: Option<Summary>,
    scenario: String,
}

/// Writes the report of runs, each in its folder, as HTML. Of a run with several epochs the last one is reported.
///
/// # Errors
/// If there is no run or there are too many, or one cannot be read.
pub fn of_runs(folders: &[RunFolder]) -> miette::Result<String> {
    Ok(page_of_runs(folders)?.finish())
}

/// The page of that report.
///
/// # Errors
/// As [`of_runs`].
pub fn page_of_runs(folders: &[RunFolder]) -> miette::Result<Page> {
    if folders.len() > MAX_RUNS {
        return Err(miette!(
            help = "compare many runs by an experiment: `cars experiment run FILE`, then `cars report` with its folder",
            "a report shows at most {MAX_RUNS} runs, and these are {}",
            folders.len()
        ));
    }
    let mut runs = Vec::new();
    for folder in folders {
        runs.push(Run::read(folder)?);
    }
    let Some(first) = runs.first() else {
        return Err(miette!("there is no run to report"));
    };

    let title = match runs.len() {
        1 => first.name.clone(),
        count => format!("{count} runs"),
    };
    let kind = if runs.len() == 1 {
        "Run report"
    } else {
        "Report of several runs"
    };
    let mut page = Page::new(kind, &title);
    write_lead(&mut page, &runs);
    write_summary(&mut page, &runs);
    write_states(&mut page, &runs);
    write_diagrams(&mut page, &runs);
    let facts: Vec<&RunFacts> = runs.iter().map(|run| &run.facts).collect();
    page.section("Transitions");
    for figure in transitions(&facts) {
        page.figure(&figure);
    }
    if let Some(figure) = occupancy(&facts) {
        page.section("Occupancy of the floor");
        page.figure(&figure);
    }
    write_disturbances(&mut page, &runs);
    write_expectations(&mut page, &runs);
    write_reproduction(&mut page, &runs);
    Ok(page)
}

impl Run {
    fn read(folder: &RunFolder) -> miette::Result<Self> {
        let files = recorded_epoch(folder, None)?;
        let facts = RunFacts::read(&files)?;
        let summary = read_summary(folder)?.filter(|summary| summary.digest == facts.digest);
        let scenario = std::fs::read_to_string(&files.scenario).unwrap_or_default();
        Ok(Self {
            name: folder.title(),
            path: folder.path().to_owned(),
            files,
            facts,
            summary,
            scenario,
        })
    }

    /// How the run is called where several are told apart.
    fn label(&self) -> String {
        format!("{}, seed {}", self.name, self.facts.seed)
    }
}

fn write_lead(page: &mut Page, runs: &[Run]) {
    if let [run] = runs {
        let facts = &run.facts;
        let text = format!(
            "The run {} after {} s of simulated time ({} ticks of {} s), with seed {} and {}.",
            ending(facts.end),
            tick_seconds(facts.last_tick, facts.tick_s),
            facts.last_tick,
            facts.tick_s,
            facts.seed,
            counted(facts.robots.len(), "robot"),
        );
        page.lead(&[Part::text(text)]);
    } else {
        let mut ends: BTreeMap<&str, usize> = BTreeMap::new();
        for run in runs {
            *ends.entry(ending(run.facts.end)).or_insert(0) += 1;
        }

        let mut parts = Vec::new();
        for (end, count) in ends {
            parts.push(format!("{count} {end}"));
        }

        let text = format!("Of these runs {}.", parts.join(", "));
        page.lead(&[Part::text(text)]);
    }
}

fn ending(end: Option<End>) -> &'static str {
    match end {
        Some(End::Finished) => "finished",
        Some(End::Stopped) => "was stopped",
        Some(End::Aborted) => "was aborted",
        None => "has no end, and is recorded",
    }
}

fn write_summary(page: &mut Page, runs: &[Run]) {
    page.section("Summary");
    if let [run] = runs {
        let caption = "The robots. Commands are counted where they were sent, arrived, and were lost on the way to the robot.";
        page.table(&[Part::text(caption)], &robots_table(run));
    } else {
        let caption = format!(
            "The {} runs. Commands and refused moves are those of all robots of a run together.",
            runs.len()
        );
        page.table(&[Part::text(caption)], &runs_table(runs));
    }

    let variables = variables_table(runs);
    if !variables.rows.is_empty() {
        page.begin_details("State variables of the robots at the end");
        let caption = match runs {
            [_] => "The last state variables of the robots that are numbers.".to_owned(),
            _ => "The last state variables of the robots that are numbers, over the runs that have a summary.".to_owned(),
        };
        page.table(&[Part::text(caption)], &variables);
        page.end_details();
    }
    for run in runs {
        for note in &run.facts.notes {
            let name = if runs.len() > 1 {
                format!("{}: ", run.name)
            } else {
                String::new()
            };
            page.remark(&[Part::text(format!("{name}{note}"))]);
        }
    }
}

fn robots_table(run: &Run) -> Table {
    let mut table = Table::new(vec![
        Column::text("Robot"),
        Column::number("sent"),
        Column::number("arrived"),
        Column::number("lost"),
        Column::number("moves refused"),
        Column::number("ticks missed"),
        Column::number("returns"),
    ]);
    for (name, robot) in &run.facts.robots {
        let mut sent = 0;
        let mut delivered = 0;
        let mut dropped = 0;
        for ((from, to), link) in &run.facts.links {
            if from == name {
                sent += link.sent;
            }
            if to == name {
                delivered += link.delivered;
                dropped += link.dropped;
            }
        }

        table.rows.push(vec![
            Cell::text(name.as_str()),
            Cell::Count(sent),
            Cell::Count(delivered),
            Cell::Count(dropped),
            Cell::Count(robot.blocked),
            Cell::Count(robot.missed),
            Cell::Count(robot.returns),
        ]);
    }

    table
}

fn runs_table(runs: &[Run]) -> Table {
    let mut table = Table::new(vec![
        Column::text("Run"),
        Column::number("seed"),
        Column::text("end"),
        Column::number("time, s"),
        Column::number("sent"),
        Column::number("arrived"),
        Column::number("lost"),
        Column::number("moves refused"),
        Column::text("digest"),
    ]);
    for run in runs {
        let facts = &run.facts;
        let commands = facts.commands();
        let blocked = facts.robots.values().map(|robot| robot.blocked).sum();
        let end = match facts.end {
            Some(End::Finished) => "finished",
            Some(End::Stopped) => "stopped",
            Some(End::Aborted) => "aborted",
            None => "none",
        };

        table.rows.push(vec![
            Cell::text(&run.name),
            Cell::Count(facts.seed),
            Cell::text(end),
            time_cell(facts.last_tick, facts.tick_s),
            Cell::Count(commands.sent),
            Cell::Count(commands.delivered),
            Cell::Count(commands.dropped),
            Cell::Count(blocked),
            Cell::Code(facts.digest.chars().take(12).collect()),
        ]);
    }

    table
}

/// The last state variables that are numbers: of one run, or over several.
fn variables_table(runs: &[Run]) -> Table {
    let mut values: BTreeMap<(&RobotName, &str), Vec<f64>> = BTreeMap::new();
    for summary in runs.iter().filter_map(|run| run.summary.as_ref()) {
        for (robot, of_robot) in &summary.robots {
            for (name, variable) in &of_robot.state_variables {
                if let Variable::Number(number) = variable {
                    values.entry((robot, name)).or_default().push(*number);
                }
            }
        }
    }

    let is_one = runs.len() == 1;
    let mut columns = vec![Column::text("Robot"), Column::text("variable")];
    if is_one {
        columns.push(Column::number("value"));
    } else {
        for name in ["n", "least", "median", "mean", "most"] {
            columns.push(Column::number(name));
        }
    }
    let mut table = Table::new(columns);
    for ((robot, name), mut values) in values {
        let mut row = vec![Cell::text(robot.as_str()), Cell::text(name)];
        if is_one {
            row.push(Cell::Number(values[0], decimals(&values)));
        } else {
            values.sort_by(f64::total_cmp);
            let count = values.len();
            let decimals = decimals(&values);
            let mean = values.iter().sum::<f64>() / count as f64;
            row.push(Cell::Count(count as u64));
            row.push(Cell::Number(values[0], decimals));
            row.push(Cell::Number(median(&values), decimals));
            row.push(Cell::Number(mean, decimals.max(1)));
            row.push(Cell::Number(values[count - 1], decimals));
        }
        table.rows.push(row);
    }
    table
}

/// The median of sorted values.
fn median(values: &[f64]) -> f64 {
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) {
        f64::midpoint(values[middle - 1], values[middle])
    } else {
        values[middle]
    }
}

/// Whole numbers have no decimals.
fn decimals(values: &[f64]) -> usize {
    if values.iter().all(|value| value.fract() == 0.0) {
        0
    } else {
        3
    }
}

fn write_states(page: &mut Page, runs: &[Run]) {
    page.section("Emotions and behaviors");

    for (state, what) in [(State::Emotion, "Emotions"), (State::Behavior, "Behaviors")] {
        let panels = state_panels(runs, state, what);
        if panels.is_empty() {
            continue;
        }

        let all = if runs.len() == 1 {
            1
        } else {
            all_robots(runs).len()
        };
        let (panels, sentence) = limited(panels, all, "robots");

        let rows = if runs.len() == 1 { "robot" } else { "run" };
        let caption = format!(
            "{what} over time, a row for each {rows}. The key has the share of the time in each. Time in which a robot took no part \
             is empty. n = {}.{sentence}",
            counted(runs.len(), "run")
        );
        page.figure(&Figure {
            panels,
            caption: vec![Part::text(caption)],
            table: Some(states_table(runs, state)),
        });
    }
}

/// One panel for one run, and one for each robot of several runs.
fn state_panels(runs: &[Run], state: State, what: &str) -> Vec<Panel> {
    let mut panels = Vec::new();
    if let [run] = runs {
        panels.extend(run_panel(&run.facts, state, what));
        return panels;
    }

    let end_s = runs
        .iter()
        .map(|run| run.facts.time_s())
        .fold(0.0, f64::max);
    for name in all_robots(runs).into_iter().take(MAX_PANELS) {
        let mut rows = Vec::new();
        for run in runs {
            if let Some(robot) = run.facts.robots.get(name) {
                rows.push(BandRow {
                    label: run.label(),
                    bands: states_of(robot, state).bands.clone(),
                });
            }
        }
        panels.extend(state_panel(rows, state, end_s, what, name.as_str()));
    }
    panels
}

fn all_robots(runs: &[Run]) -> BTreeSet<&RobotName> {
    runs.iter()
        .flat_map(|run| run.facts.robots.keys())
        .collect()
}

/// Time in each state over all runs.
fn states_table(runs: &[Run], state: State) -> Table {
    let mut table = Table::new(vec![
        Column::text("Robot"),
        Column::text("state"),
        Column::number("time, s"),
        Column::number("share, %"),
        Column::number("times entered"),
    ]);
    for name in all_robots(runs) {
        let mut times: BTreeMap<String, (f64, u64)> = BTreeMap::new();
        let mut total_s = 0.0;
        for run in runs {
            let Some(robot) = run.facts.robots.get(name) else {
                continue;
            };
            // A share is one of the whole run, as in `runs.csv`: a robot that takes no part is in no state.
            total_s += run.facts.time_s();
            let states = states_of(robot, state);
            for (name, time_s) in states.times_s() {
                times.entry(name).or_default().0 += time_s;
            }

            // A state that was entered in the last tick has lasted for no time.
            for (name, count) in &states.entered {
                times.entry(name.clone()).or_default().1 += count;
            }
        }

        for (of, (time_s, entered)) in times {
            table.rows.push(vec![
                Cell::text(name.as_str()),
                Cell::text(of),
                Cell::Number(time_s, 1),
                Cell::Number(100.0 * time_s / total_s, 1),
                Cell::Count(entered),
            ]);
        }
    }

    table
}

fn write_diagrams(page: &mut Page, runs: &[Run]) {
    page.section("Space-time diagram");
    for run in runs.iter().take(MAX_DIAGRAMS) {
        let lines = diagram_lines(&run.name, &run.facts, &run.files);
        let diagram = match lines {
            Ok(diagram) => diagram,
            Err(error) => {
                page.remark(&[Part::text(format!("{}: {error}.", run.name))]);
                continue;
            }
        };
        let shown = diagram.last;
        let mut caption = vec![Part::text(format!(
            "Space-time diagram of {}, to be read line by line: robots are lanes, with emotion above behavior; a slanted line is a \
             command, from the tick it was sent to the tick it arrived; a cross is where one was lost. n = 1 run.",
            run.name
        ))];
        if shown < run.facts.last_tick {
            caption.push(Part::text(format!(
                " Ticks {} to {} are left out; the picture of another part: ",
                shown + 1,
                run.facts.last_tick
            )));
            caption.push(Part::code(format!(
                "cars diagram {} --from {}",
                shell::path(&run.path),
                shown + 1
            )));
        }
        page.figure(&Figure {
            panels: diagram.lines,
            caption,
            table: None,
        });
    }

    if let Some(run) = runs.get(MAX_DIAGRAMS) {
        page.remark(&[
            Part::text(format!(
                "The diagrams of the other {} runs are left out. Draw one with ",
                runs.len() - MAX_DIAGRAMS
            )),
            Part::code(format!(
                "cars diagram {} -o diagram.svg",
                shell::path(&run.path)
            )),
            Part::text("."),
        ]);
    }
}

fn write_disturbances(page: &mut Page, runs: &[Run]) {
    page.section("Faults and the network");
    page.table(
        &[Part::text(format!(
            "Commands by sender and target. A doubled command arrives twice. n = {}.",
            counted(runs.len(), "run")
        ))],
        &links_table(runs),
    );

    let mut table = Table::new(vec![
        Column::text("Run"),
        Column::text("what"),
        Column::text("of"),
        Column::number("from, s"),
        Column::number("until, s"),
    ]);
    let mut count = 0;
    for run in runs {
        for one in &run.facts.disturbances {
            count += 1;
            if table.rows.len() < MAX_DISTURBANCES {
                table.rows.push(disturbance_row(run, one));
            }
        }
    }
    if table.rows.is_empty() {
        page.paragraph(&[Part::text(
            "No process failed and no link was cut in these runs.",
        )]);
        return;
    }
    let mut caption =
        "Faults of processes, absences, cuts of links and changes of the scenario.".to_owned();
    if count > table.rows.len() {
        caption += &format!(" The first {} of {count} are shown.", table.rows.len());
    }
    page.table(&[Part::text(caption)], &table);
}

/// What the scenarios expect of the runs. Nothing is written if they expect nothing.
fn write_expectations(page: &mut Page, runs: &[Run]) {
    let mut table = Table::new(vec![
        Column::text("Run"),
        Column::text("expectation"),
        Column::text("verdict"),
        Column::number("decided at, s"),
        Column::text("because"),
    ]);
    let mut count = 0;
    for run in runs {
        for one in &run.facts.judged {
            count += 1;
            if table.rows.len() < MAX_VERDICTS {
                table.rows.push(vec![
                    Cell::text(&run.name),
                    Cell::text(&one.expectation),
                    Cell::text(one.verdict.to_string()),
                    time_cell(one.tick, run.facts.tick_s),
                    Cell::text(&one.because),
                ]);
            }
        }
    }
    if count == 0 {
        return;
    }

    page.section("Expectations");
    let mut caption =
        "Verdicts about what the scenario expects. Undecided: the run ended before it was certain. \
         Not asked: what it is expected after did not happen."
            .to_owned();
    if count > table.rows.len() {
        caption += &format!(" The first {} of {count} are shown.", table.rows.len());
    }
    page.table(&[Part::text(caption)], &table);
}

/// The time of a tick, with the decimals that it needs.
fn time_cell(tick: Tick, tick_s: f64) -> Cell {
    Cell::Number(time_s(tick, tick_s), time::decimals(tick_s))
}

fn disturbance_row(run: &Run, one: &Disturbance) -> Vec<Cell> {
    let tick_s = run.facts.tick_s;
    let end = match one.end {
        Some(end) => time_cell(end, tick_s),
        None => Cell::text("the end"),
    };
    vec![
        Cell::text(&run.name),
        Cell::text(&one.what),
        Cell::text(&one.whom),
        time_cell(one.begin, tick_s),
        end,
    ]
}

fn links_table(runs: &[Run]) -> Table {
    let mut links = BTreeMap::new();
    for run in runs {
        for (link, facts) in &run.facts.links {
            let sum: &mut [u64; 5] = links.entry(link).or_default();
            let counts = [
                facts.sent,
                facts.delivered,
                facts.dropped,
                facts.delayed,
                facts.duplicated,
            ];
            for (sum, count) in sum.iter_mut().zip(counts) {
                *sum += count;
            }
        }
    }

    let mut table = Table::new(vec![
        Column::text("Link"),
        Column::number("sent"),
        Column::number("arrived"),
        Column::number("lost"),
        Column::number("held back"),
        Column::number("doubled"),
    ]);
    for ((from, to), counts) in links {
        let mut row = vec![Cell::text(format!("{from} → {to}"))];
        row.extend(counts.map(Cell::Count));
        table.rows.push(row);
    }
    table
}

fn write_reproduction(page: &mut Page, runs: &[Run]) {
    page.section("Reproduction");
    page.paragraph(&[Part::text(
        "This report, the check that a run is what its scenario and seed give, and its events and states as tables:",
    )]);
    let mut commands = vec!["cars report".to_owned()];
    for run in runs {
        commands[0] += &format!(" {}", shell::path(&run.path));
    }
    commands[0] += " -o report.html";
    if let Some(run) = runs.first() {
        commands.push(format!("cars verify {}", shell::path(&run.path)));
        commands.push(format!(
            "cars export {} --csv -o tables",
            shell::path(&run.path)
        ));
    }
    page.commands(&commands);

    let mut table = Table::new(vec![
        Column::text("Run"),
        Column::number("epoch"),
        Column::number("seed"),
        Column::text("version"),
        Column::text("commit"),
        Column::text("digest"),
    ]);
    for run in runs {
        let facts = &run.facts;
        let commit = match &facts.commit {
            Some(commit) => Cell::Code(commit.clone()),
            None => Cell::text("unknown"),
        };
        table.rows.push(vec![
            Cell::text(&run.name),
            Cell::Count(u64::from(run.files.epoch)),
            Cell::Count(facts.seed),
            Cell::text(&facts.version),
            commit,
            Cell::Code(facts.digest.clone()),
        ]);
    }
    page.table(&[Part::text("What the runs were made with.")], &table);

    let mut scenarios: BTreeMap<String, Vec<&Run>> = BTreeMap::new();
    for run in runs {
        scenarios
            .entry(without_seed(&run.scenario))
            .or_default()
            .push(run);
    }
    for runs in scenarios.into_values() {
        let [first, others @ ..] = &runs[..] else {
            continue;
        };
        let name = match others.len() {
            0 => format!("Scenario of {}", first.name),
            count => format!(
                "Scenario of {}; that of {count} more differs by the seed only",
                first.name
            ),
        };
        page.file(&name, &first.scenario);
    }
}

/// A scenario without the line of its seed.
fn without_seed(scenario: &str) -> String {
    let lines = scenario.lines().filter(|line| !line.starts_with("seed = "));
    lines.collect::<Vec<_>>().join("\n")
}
