//! The report of one or several runs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use pictures::{BandRow, Cell, ChartPanel, Figure, Page, Table, Text};
use protocol::messages::{End, Variable};
use protocol::time::{self, tick_seconds, time_s};
use protocol::{RobotName, Tick};
use record::{EpochFiles, RunFolder, Summary};
use recording::RunDecisions;
use timeline::{LinkCounts, StateKind, StateOrder};

use super::course::{
    READ_DIAGRAM, course_figure, diagram_lines, run_panel, state_panel, states_in_words,
};
use super::decided::{decisions, write_decisions};
use super::facts::RunFacts;
use super::floor::occupancy;
use super::limits::panels;
use super::loss::LossByDistance;
use super::transitions::transitions;
use super::words::counted;
use experiments::shell;
use lab::LabError;
use lab::folder::{read_summary, recorded_epoch};

/// Most runs of a report.
pub const MAX_RUNS: usize = 64;
/// Runs of which the space-time diagram is drawn.
const MAX_DIAGRAMS: usize = 2;
/// Most rows of a table of disturbances or verdicts.
const MAX_ROWS: usize = 200;

/// A run with its facts.
struct ReportedRun {
    /// Name of its folder.
    name: String,
    /// How its folder is given on the command line.
    path: PathBuf,
    files: EpochFiles,
    facts: RunFacts,
    summary: Option<Summary>,
    scenario: String,
    /// What `cars why` found.
    decisions: RunDecisions,
}

/// Writes the report of runs, each in its folder, as HTML. Of a run with several epochs the last one is reported.
///
/// # Errors
/// If there is no run or there are too many, or one cannot be read.
pub fn of_runs(folders: &[RunFolder]) -> Result<Page, LabError> {
    if folders.len() > MAX_RUNS {
        return Err(LabError::refused(format!(
            "a report shows at most {MAX_RUNS} runs, and these are {}",
            folders.len()
        ))
        .with_help(
            "compare many runs by an experiment: `cars experiment run FILE`, then `cars report` with its folder",
        ));
    }
    let mut runs = Vec::new();
    for folder in folders {
        runs.push(ReportedRun::read(folder)?);
    }
    share_names(&mut runs);
    let Some(first) = runs.first() else {
        return Err(LabError::refused("there is no run to report"));
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
    write_measures(&mut page, &runs);
    if runs.len() == 1 {
        write_decisions(&mut page, &first.decisions);
        write_states(&mut page, &runs);
        write_summary(&mut page, &runs);
    } else {
        write_summary(&mut page, &runs);
        write_states(&mut page, &runs);
    }
    write_diagrams(&mut page, &runs);
    let facts: Vec<&RunFacts> = runs.iter().map(|run| &run.facts).collect();
    let transitions = transitions(&facts);
    if !transitions.is_empty() {
        page.section("Transitions");
    }
    for figure in transitions {
        page.figure(figure);
    }
    if let Some(figure) = occupancy(&facts) {
        page.section("Occupancy of the floor");
        page.figure(figure);
    }
    write_disturbances(&mut page, &runs);
    write_expectations(&mut page, &runs);
    write_reproduction(&mut page, &runs);
    Ok(page)
}

/// Gives an emotion or a behavior the same color in the pictures of all runs.
fn share_names(runs: &mut [ReportedRun]) {
    let mut names = StateOrder::default();
    for run in runs.iter() {
        names.add_all(&run.facts.names);
    }
    for run in runs {
        run.facts.names = names.clone();
    }
}

impl ReportedRun {
    fn read(folder: &RunFolder) -> Result<Self, LabError> {
        let files = recorded_epoch(folder, None)?;
        let facts = RunFacts::read(&files)?;
        let summary = read_summary(folder)?.filter(|summary| summary.digest == facts.digest);
        let scenario = std::fs::read_to_string(&files.scenario).unwrap_or_default();
        Ok(Self {
            name: folder.title(),
            path: folder.path().to_owned(),
            decisions: decisions(folder, &files)?,
            files,
            facts,
            summary,
            scenario,
        })
    }
}

fn write_lead(page: &mut Page, runs: &[ReportedRun]) {
    if let [run] = runs {
        let facts = &run.facts;
        let because = facts.end_because.as_ref();
        let because = because.map_or(String::new(), |because| format!(", because {because}"));
        page.lead(format!(
            "The run {} after {} s of simulated time ({} ticks of {} s){}, with seed {} and {}.",
            ending(facts.end).0,
            tick_seconds(facts.last_tick, facts.tick_s),
            facts.last_tick,
            facts.tick_s,
            because,
            facts.seed,
            counted(facts.robots.len(), "robot"),
        ));
        return;
    }

    let mut ends: BTreeMap<&str, usize> = BTreeMap::new();
    for run in runs {
        *ends.entry(ending(run.facts.end).0).or_insert(0) += 1;
    }
    let parts = ends.iter().map(|(end, count)| format!("{count} {end}"));
    let parts: Vec<String> = parts.collect();
    page.lead(format!("Of these runs {}.", parts.join(", ")));
}

/// How a run ended, in a sentence and in a table.
fn ending(end: Option<End>) -> (&'static str, &'static str) {
    match end {
        Some(End::Finished) => ("finished", "finished"),
        Some(End::Stopped) => ("was stopped", "stopped"),
        Some(End::Aborted) => ("was aborted", "aborted"),
        None => ("has no end, and is recorded", "none"),
    }
}

fn write_summary(page: &mut Page, runs: &[ReportedRun]) {
    page.section("Summary");
    if let [run] = runs {
        let caption = "The robots. Commands are counted where they were sent, arrived, and were lost on the way to the robot.";
        page.table(caption, &robots_table(run));
    } else {
        let caption = format!(
            "The {} runs. Commands and refused moves are those of all robots of a run together.",
            runs.len()
        );
        page.table(caption, &runs_table(runs));
    }

    let variables = variables_table(runs);
    if !variables.rows.is_empty() {
        let over = match runs {
            [_] => "",
            _ => ", over the runs that have a summary",
        };
        page.begin_details("State variables of the robots at the end");
        let caption = format!("The last state variables of the robots that are numbers{over}.");
        page.table(caption, &variables);
        page.end_details();
    }
    for run in runs {
        for note in &run.facts.notes {
            page.remark(match runs {
                [_] => note.clone(),
                _ => format!("{}: {note}", run.name),
            });
        }
    }
}

fn robots_table(run: &ReportedRun) -> Table {
    let mut table =
        Table::new("Robot | sent | arrived | lost | moves refused | ticks missed | returns");
    for (name, robot) in &run.facts.robots {
        let counts = &robot.counts;
        let mut row = vec![name.as_str().into()];
        row.extend(
            [
                counts.sent.values().sum(),
                counts.received,
                counts.dropped,
                counts.blocked,
                counts.missed,
                counts.returns,
            ]
            .map(Cell::Count),
        );
        table.row(row);
    }
    table
}

fn runs_table(runs: &[ReportedRun]) -> Table {
    let mut table =
        Table::new("Run | seed | end | time, s | sent | arrived | lost | moves refused | digest");
    for run in runs {
        let facts = &run.facts;
        let mut commands = LinkCounts::default();
        for link in facts.links.values() {
            commands.add(link);
        }
        let blocked: u64 = facts
            .robots
            .values()
            .map(|robot| robot.counts.blocked)
            .sum();
        table.row([
            run.name.as_str().into(),
            facts.seed.into(),
            ending(facts.end).1.into(),
            time_cell(facts.last_tick, facts.tick_s),
            commands.sent.into(),
            commands.delivered.into(),
            commands.lost().into(),
            blocked.into(),
            Cell::Code(facts.digest.chars().take(12).collect()),
        ]);
    }
    table
}

/// The last state variables that are numbers: of one run, or over several.
fn variables_table(runs: &[ReportedRun]) -> Table {
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
    let mut table = Table::new(if is_one {
        "Robot | variable | value"
    } else {
        "Robot | variable | n | least | median | mean | most"
    });
    for ((robot, name), mut values) in values {
        let is_whole = values.iter().all(|value| value.fract() == 0.0);
        let decimals = if is_whole { 0 } else { 3 };
        let number = |value| Cell::Number(value, decimals);
        let mut row = vec![robot.as_str().into(), name.into()];
        if is_one {
            row.push(number(values[0]));
        } else {
            values.sort_by(f64::total_cmp);
            let count = values.len();
            // The same one twice, or the two in the middle.
            let median = f64::midpoint(values[(count - 1) / 2], values[count / 2]);
            let mean = values.iter().sum::<f64>() / count as f64;
            row.extend([
                count.into(),
                number(values[0]),
                number(median),
                Cell::Number(mean, decimals.max(1)),
                number(values[count - 1]),
            ]);
        }
        table.row(row);
    }
    table
}

fn write_states(page: &mut Page, runs: &[ReportedRun]) {
    page.section(match runs {
        [_] => "Course",
        _ => "Emotions and behaviors",
    });

    let before = page.figures();
    for kind in [StateKind::Emotion, StateKind::Behavior] {
        let (row, (panels, sentence)) = match runs {
            [run] if kind == StateKind::Emotion => {
                if let Some(mut figure) = course_figure(&run.facts) {
                    let table = states_table(runs, kind);
                    figure.table = (!table.rows.is_empty()).then_some(table);
                    page.figure(figure);
                }
                continue;
            }
            [run] => {
                let panel = run_panel(&run.facts, kind);
                ("robot", (Vec::from_iter(panel), String::new()))
            }
            _ => ("run", state_panels(runs, kind)),
        };
        if panels.is_empty() {
            continue;
        }

        let caption = format!(
            "{} over time, a row for each {row}. The key has the share of the time in each. Time in which a robot took no part \
             is empty. n = {}.{sentence}",
            states_in_words(kind),
            counted(runs.len(), "run")
        );
        page.figure(Figure::new(panels, caption, Some(states_table(runs, kind))));
    }
    if page.figures() == before {
        page.remark("The robots report no emotions and no behaviors.");
    }
}

/// A panel for each robot of several runs, with a row for each run.
fn state_panels(runs: &[ReportedRun], kind: StateKind) -> (Vec<ChartPanel>, String) {
    let Some(names) = runs.first().map(|run| &run.facts.names) else {
        return (Vec::new(), String::new());
    };
    let times_s = runs.iter().map(|run| run.facts.time_s());
    let end_s = times_s.fold(0.0, f64::max);
    let mut robots = Vec::new();
    for name in all_robots(runs) {
        let mut rows = Vec::new();
        for run in runs {
            if let Some(robot) = run.facts.robots.get(name) {
                rows.push(BandRow {
                    label: format!("{}, seed {}", run.name, run.facts.seed),
                    bands: robot.bands(kind).clone(),
                });
            }
        }
        if rows.iter().any(|row| !row.bands.is_empty()) {
            robots.push((name, rows));
        }
    }
    panels("robots", robots, |(name, rows)| {
        state_panel(rows, kind, end_s, name.as_str(), names)
    })
}

fn all_robots(runs: &[ReportedRun]) -> BTreeSet<&RobotName> {
    let robots = runs.iter().flat_map(|run| run.facts.robots.keys());
    robots.collect()
}

/// Time in each state over all runs.
fn states_table(runs: &[ReportedRun], kind: StateKind) -> Table {
    let mut table = Table::new("Robot | state | time, s | share, % | times entered");
    for name in all_robots(runs) {
        let mut times: BTreeMap<String, (f64, u64)> = BTreeMap::new();
        let mut total_s = 0.0;
        for run in runs {
            let Some(robot) = run.facts.robots.get(name) else {
                continue;
            };
            // A share is one of the whole run, as in `runs.csv`: a robot that takes no part is in no state.
            total_s += run.facts.time_s();
            let states = robot.counts.states(kind);
            for (name, ticks) in &states.ticks {
                times.entry(name.clone()).or_default().0 += time_s(*ticks, run.facts.tick_s);
            }

            // A state that was entered in the last tick has lasted for no time.
            for (name, count) in &states.entered {
                times.entry(name.clone()).or_default().1 += count;
            }
        }

        for (of, (stayed_s, entered)) in times {
            table.row([
                name.as_str().into(),
                of.into(),
                Cell::Number(stayed_s, 1),
                Cell::Number(100.0 * stayed_s / total_s, 1),
                entered.into(),
            ]);
        }
    }
    table
}

fn write_diagrams(page: &mut Page, runs: &[ReportedRun]) {
    page.section("Space-time diagram");
    for run in runs.iter().take(MAX_DIAGRAMS) {
        let diagram = match diagram_lines(&run.name, &run.facts, &run.files) {
            Ok(diagram) => diagram,
            Err(error) => {
                page.remark(format!("{}: {error}.", run.name));
                continue;
            }
        };
        let name = &run.name;
        let mut caption = Text::from(format!("Space-time diagram of {name}, {READ_DIAGRAM}"));
        if diagram.last < run.facts.last_tick {
            let (next, last) = (diagram.last + 1, run.facts.last_tick);
            let path = shell::path(&run.path);
            caption = caption.text(format!(
                " Ticks {next} to {last} are left out; the picture of another part: "
            ));
            caption = caption.code(format!("cars diagram {path} --from {next}"));
        }
        page.figure(Figure::new(diagram.lines, caption, None));
    }

    if let Some(run) = runs.get(MAX_DIAGRAMS) {
        let text = Text::from(format!(
            "The diagrams of the other {} runs are left out. Draw one with ",
            runs.len() - MAX_DIAGRAMS
        ));
        let path = shell::path(&run.path);
        let text = text.code(format!("cars diagram {path} -o diagram.svg"));
        page.remark(text.text("."));
    }
}

fn write_disturbances(page: &mut Page, runs: &[ReportedRun]) {
    page.section("Faults and the network");
    let caption = format!(
        "Commands by sender and target. A doubled command arrives twice. n = {}.",
        counted(runs.len(), "run")
    );
    page.table(caption, &links_table(runs));
    if let Some(figure) = LossByDistance::figure(runs.iter().map(|run| &run.facts.loss)) {
        page.figure(figure);
    }

    let mut table = Table::new("Run | what | of | from, s | until, s");
    for run in runs {
        let tick_s = run.facts.tick_s;
        for one in &run.facts.disturbances {
            let end = one.end.map(|end| time_cell(end, tick_s));
            table.row([
                run.name.as_str().into(),
                one.what.as_str().into(),
                one.whom.as_str().into(),
                time_cell(one.begin, tick_s),
                end.unwrap_or("the end".into()),
            ]);
        }
    }
    if table.rows.is_empty() {
        page.paragraph("No process failed and no link was cut in these runs.");
        return;
    }
    let caption = "Faults of processes, absences, cuts of links and changes of the scenario.";
    write_first_rows(page, caption, table);
}

/// What the scenarios expect of the runs. Nothing is written if they expect nothing.
fn write_expectations(page: &mut Page, runs: &[ReportedRun]) {
    let mut table = Table::new("Run | expectation | verdict | decided at, s | because");
    for run in runs {
        for one in &run.facts.judged {
            table.row([
                run.name.as_str().into(),
                one.expectation.as_str().into(),
                one.verdict.to_string().into(),
                time_cell(one.tick, run.facts.tick_s),
                one.because.as_str().into(),
            ]);
        }
    }
    if table.rows.is_empty() {
        return;
    }

    page.section("Expectations");
    let caption = "Verdicts about what the scenario expects. Undecided: the run ended before it was certain. \
                   Not asked: what it is expected after did not happen.";
    write_first_rows(page, caption, table);
}

/// What the scenarios measure of the runs. Nothing is written if they measure nothing, or no run has a summary.
fn write_measures(page: &mut Page, runs: &[ReportedRun]) {
    let mut table = Table::new("Run | measure | number");
    for run in runs {
        let measures = run.summary.iter().flat_map(|summary| &summary.measures);
        for (name, measured) in measures {
            table.row([
                run.name.as_str().into(),
                name.as_str().into(),
                measured.to_string().into(),
            ]);
        }
    }
    if table.rows.is_empty() {
        return;
    }

    page.section("Measures");
    write_first_rows(
        page,
        "The measures of the scenario at the end of the run.",
        table,
    );
}

/// Writes the first rows of a table that can be long.
fn write_first_rows(page: &mut Page, caption: &str, mut table: Table) {
    let mut caption = caption.to_owned();
    let count = table.rows.len();
    if count > MAX_ROWS {
        caption += &format!(" The first {MAX_ROWS} of {count} are shown.");
        table.rows.truncate(MAX_ROWS);
    }
    page.table(caption, &table);
}

/// The time of a tick, with the decimals that it needs.
fn time_cell(tick: Tick, tick_s: f64) -> Cell {
    Cell::Number(time_s(tick, tick_s), time::decimals(tick_s))
}

fn links_table(runs: &[ReportedRun]) -> Table {
    let mut links: BTreeMap<_, LinkCounts> = BTreeMap::new();
    for (link, counts) in runs.iter().flat_map(|run| &run.facts.links) {
        links.entry(link).or_default().add(counts);
    }

    let mut table = Table::new("Link | sent | arrived | lost | held back | doubled | why lost");
    for ((from, to), counts) in links {
        let mut row = vec![format!("{from} → {to}").into()];
        let causes: Vec<String> = counts
            .dropped
            .iter()
            .map(|(because, count)| format!("{count} {because}"))
            .collect();
        let fates = [counts.sent, counts.delivered, counts.lost(), counts.delayed];
        row.extend(fates.map(Cell::Count));
        row.push(Cell::Count(counts.duplicated));
        // The last column is the one that wraps, so that the table is no wider than the page.
        row.push(causes.join(", ").into());
        table.row(row);
    }
    table
}

fn write_reproduction(page: &mut Page, runs: &[ReportedRun]) {
    page.section("Reproduction");
    page.paragraph(
        "This report, the check that a run is what its scenario and seed give, and its events and states as tables:",
    );
    let paths: Vec<String> = runs.iter().map(|run| shell::path(&run.path)).collect();
    let mut commands = vec![format!("cars report {} -o report.html", paths.join(" "))];
    if let Some(path) = paths.first() {
        commands.push(format!("cars verify {path}"));
        commands.push(format!("cars export {path} --csv -o tables"));
    }
    page.commands(&commands);

    let mut table = Table::new("Run | epoch | seed | version | commit | digest");
    for run in runs {
        let facts = &run.facts;
        let commit = facts.commit.clone().map(Cell::Code);
        table.row([
            run.name.as_str().into(),
            u64::from(run.files.epoch).into(),
            facts.seed.into(),
            facts.version.as_str().into(),
            commit.unwrap_or("unknown".into()),
            Cell::Code(facts.digest.clone()),
        ]);
    }
    page.table("What the runs were made with.", &table);

    let mut scenarios: BTreeMap<String, Vec<&ReportedRun>> = BTreeMap::new();
    for run in runs {
        let lines = run.scenario.lines();
        let without_seed: Vec<&str> = lines.filter(|line| !line.starts_with("seed = ")).collect();
        let same = scenarios.entry(without_seed.join("\n")).or_default();
        same.push(run);
    }
    for runs in scenarios.into_values() {
        let (first, others) = (runs[0], runs.len() - 1);
        let mut name = format!("Scenario of {}", first.name);
        if others > 0 {
            name += &format!("; that of {others} more differs by the seed only");
        }
        page.file(&name, &first.scenario);
    }
}
