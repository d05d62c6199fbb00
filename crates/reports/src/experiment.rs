//! The report of an experiment.

use std::path::Path;

use observe::{Measure, Measured};
use pictures::{Cell, Figure, Page, Table, Text};
use protocol::RunName;
use record::{EpochFiles, RunFolder};
use timeline::StateOrder;

use super::answer::{answer, counts, sentences};
use super::course::{READ_DIAGRAM, course_figure, diagram_lines};
use super::facts::RunFacts;
use super::figures::{differences, distributions, estimates, heat_maps, survival, verdicts};
use super::floor::occupancy;
use super::quantity::Of;
use super::study::{Study, label, lines};
use super::transitions::transitions;
use super::words::{capitalized, counted, utc};
use experiments::shell;
use experiments::{Example, Launches, Provenance, Results, Robots, Shown, UnitOutcome};
use lab::LabError;
use lab::folder::recorded_epoch;
use lab::run::execute;

/// Units that are named one by one where there are more of them.
const MAX_NAMED: usize = 10;

/// No further measure is shown on a page with this many bytes.
const MAX_BYTES_OF_MEASURES: usize = 3_000_000;

/// No further figure of an example run is shown on a page with this many bytes.
const MAX_BYTES_OF_EXAMPLES: usize = 6_000_000;

/// What is shown of example runs.
const EXAMPLE_PARTS: [Shown; 3] = [Shown::Runs, Shown::Transitions, Shown::Floor];

/// Writes the report of the experiment in a folder, as HTML.
///
/// # Errors
/// If it is not the folder of an experiment, none of its units has been played, or a file cannot be read.
pub fn of_experiment(folder: &Path) -> Result<Page, LabError> {
    let results = Results::load(folder)?;
    if let (true, Some(first)) = (results.outcomes.is_empty(), results.failures.first()) {
        return Err(LabError::refused(format!(
            "every unit that was played has failed, the first one, {}: {}",
            first.unit, first.reason
        ))
        .with_help("the reasons of all: `cars experiment merge`"));
    }
    if results.outcomes.is_empty() {
        return Err(LabError::refused(format!(
            "no unit of the experiment in {} has been played",
            folder.display()
        ))
        .with_help("play it with `cars experiment run`"));
    }
    let provenance = Provenance::load(folder)?;
    let study = Study::of(&results);

    let mut page = Page::new("Experiment report", &results.plan.experiment.question);
    let first = first_measure(&study);
    if let Some(measure) = first {
        page.lead(answer(&study, measure));
    }
    write_answer(&mut page, &study, first);
    write_design(&mut page, &study);
    write_measures(&mut page, &study, first);
    if study.shows(Shown::Expectations)
        && let Some(figure) = verdicts(&study)
    {
        page.section("Expectations");
        page.figure(figure);
    }
    write_examples(&mut page, &study, folder);
    write_reproduction(&mut page, &study, folder, provenance.as_ref());
    Ok(page)
}

/// The measure of which the answer is: the first one that is shown and compared; without comparisons the first one that is shown.
fn first_measure<'a>(study: &Study<'a>) -> Option<&'a Measure> {
    let mut shown = study.shown_measures();
    shown.retain(|measure| !study.is_zero(measure));
    let mut compared = shown.iter().copied();
    let compared = compared.find(|measure| !study.contrasts_of(measure).is_empty());
    compared.or(shown.first().copied())
}

/// The figure of the answer: differences to the baseline, and the estimates beside them where there are lines over a factor.
fn answer_figure(study: &Study<'_>, measure: &Measure) -> (AnswerFigure, Figure) {
    let first = Of::all(study, measure)[0];
    let differences = lines(study)
        .is_empty()
        .then(|| differences(study, measure, first));
    match differences.flatten() {
        Some(figure) => (AnswerFigure::Differences, figure),
        None => (AnswerFigure::Estimates, estimates(study, measure)),
    }
}

/// Which figure of a measure is that of the answer.
#[derive(Clone, Copy, PartialEq, Eq)]
enum AnswerFigure {
    Estimates,
    Differences,
}

fn write_answer(page: &mut Page, study: &Study<'_>, first: Option<&Measure>) {
    page.section("Answer");
    let results = study.results;
    let all = results.plan.units();
    if !results.missing.is_empty() {
        page.remark(format!(
            "Only {} of {all} runs have been played: these results are preliminary.",
            results.outcomes.len()
        ));
    }
    if !results.failures.is_empty() {
        page.remark(format!(
            "{} could not be played to the end and have no numbers: the results are those of the others.",
            counted(results.failures.len(), "run")
        ));
    }

    if !results.conflicts.is_empty() {
        let units: Vec<String> = results.conflicts.iter().map(usize::to_string).collect();
        let named = units.len().min(MAX_NAMED);
        page.remark(format!(
            "{} gave different runs when they were played again, so the results are not reproducible: {}{}.",
            counted(units.len(), "unit"),
            units[..named].join(", "),
            if named < units.len() { " and more" } else { "" }
        ));
    }

    if let Some(measure) = first {
        page.figure(answer_figure(study, measure).1);
    }
    page.paragraph(counts(study));
    for measure in study.measures() {
        let sentences = sentences(study, measure);
        if !sentences.is_empty() {
            page.heading(&capitalized(label(measure)));
            page.list(&sentences);
        }
    }
}

fn write_design(page: &mut Page, study: &Study<'_>) {
    page.section("Design");
    let experiment = &study.results.plan.experiment;
    // A text in a file has line breaks where they are convenient there.
    let explained = experiment.explained();
    let explained = explained.split_whitespace().collect::<Vec<_>>().join(" ");
    if !explained.is_empty() {
        page.paragraph(explained);
    }
    let seeds = experiment.seeds.len();
    page.paragraph(format!(
        "{}: {} under {}, with {} each, of {} s of simulated time. Runs with the same seed begin alike and have the same chance in \
         every arm, so arms are compared in pairs.",
        counted(study.results.plan.units(), "run"),
        counted(study.arms.len(), "arm"),
        counted(study.conditions.len(), "condition"),
        counted(seeds, "seed"),
        experiment.duration_s
    ));

    let are_explained = study.arms.iter().any(|arm| !arm.what.is_empty());
    let mut arms = Table::new(match are_explained {
        true => "Arm | what it is",
        false => "Arm",
    });
    for arm in study.arms {
        let is_baseline = experiment.baseline.as_ref() == Some(&arm.name);
        let baseline = if is_baseline { " (baseline)" } else { "" };
        let mut row = vec![Cell::from(format!("{}{baseline}", arm.name))];
        if are_explained {
            row.push(arm.what.as_str().into());
        }
        arms.row(row);
    }
    let mut caption = "The arms.".to_owned();
    if study.arms.len() < experiment.arms.len() {
        let (shown, all) = (study.arms.len(), experiment.arms.len());
        caption += &format!(" The first {shown} of {all} are shown.");
    }
    page.table(caption, &arms);

    let mut conditions = Table::new("Condition | what it is");
    for condition in study.conditions {
        if !condition.what.is_empty() {
            let name = study.heading(condition);
            conditions.row([name.into(), condition.what.as_str().into()]);
        }
    }
    if !conditions.rows.is_empty() {
        page.table("The conditions.", &conditions);
    }
}

fn write_measures(page: &mut Page, study: &Study<'_>, first: Option<&Measure>) {
    let shown = study.shown_measures();
    let mut large = Vec::new();
    let mut zero = Vec::new();
    for measure in &shown {
        if study.is_zero(measure) {
            zero.push(label(measure));
            continue;
        }
        if page.size() > MAX_BYTES_OF_MEASURES {
            large.push(label(measure));
            continue;
        }
        let is_first = first.is_some_and(|first| first.name == measure.name);
        let before = is_first.then(|| answer_figure(study, measure).0);
        write_measure(page, study, measure, before);
    }
    if !zero.is_empty() {
        page.remark(format!(
            "Zero in every run, and therefore not shown: {}.",
            zero.join(", ")
        ));
    }

    if !large.is_empty() {
        page.remark(format!(
            "So that this page stays small, charts and tables of these measures are left out: {}.",
            large.join(", ")
        ));
    }
    let mut others = Vec::new();
    for measure in study.measures() {
        if !shown.iter().any(|one| one.name == measure.name) {
            others.push(label(measure));
        }
    }
    if !others.is_empty() {
        let text = Text::from(format!(
            "Also measured, and not shown by choice of the experiment file: {}. Their numbers are in ",
            others.join(", ")
        ));
        let text = text.code("runs.csv").text(" and ");
        page.remark(text.code("results.json").text("."));
    }
}

/// Writes the section of a measure. `before` is the figure of it that the answer has.
fn write_measure(
    page: &mut Page,
    study: &Study<'_>,
    measure: &Measure,
    before: Option<AnswerFigure>,
) {
    let mut figures = Vec::new();
    if study.shows(Shown::Estimates) && before != Some(AnswerFigure::Estimates) {
        figures.push(estimates(study, measure));
    }
    if study.shows(Shown::HeatMaps) {
        figures.extend(heat_maps(study, measure));
    }
    let is_time = measure.is_time();
    if is_time && study.shows(Shown::Survival) {
        figures.push(survival(study, measure));
    }
    if study.shows(Shown::Differences) {
        // That of the answer is the first one.
        let skipped = usize::from(before == Some(AnswerFigure::Differences));
        let all = Of::all(study, measure).iter().skip(skipped);
        figures.extend(all.filter_map(|of| differences(study, measure, *of)));
    }
    let has_distributions = !is_time && study.shows(Shown::Distributions);
    if figures.is_empty() && !has_distributions && before.is_none() {
        return;
    }

    page.section(&capitalized(label(measure)));
    if let Some(what) = &measure.what {
        page.paragraph(format!("{}.", capitalized(what)));
    }
    if before.is_some() {
        page.remark("Figure 1 is of this measure, too.");
    }
    for figure in figures {
        page.figure(figure);
    }
    if has_distributions {
        page.begin_details(&format!("Distributions, figure {}", page.figures() + 1));
        page.figure(distributions(study, measure));
        page.end_details();
    }
}

/// Single runs as examples, with what their robots felt.
fn write_examples(page: &mut Page, study: &Study<'_>, folder: &Path) {
    let shown = study.shown_measures();
    let first = shown.first().copied().or(study.measures().first());
    let runs = &study.results.plan.experiment.report.runs;
    let is_any_shown = EXAMPLE_PARTS.iter().any(|part| study.shows(*part));
    let Some(measure) = first.filter(|_| is_any_shown && !runs.is_empty()) else {
        return;
    };
    let found = typical_and_worst(study, measure);

    page.section("Example runs");
    let (label, baseline) = (label(measure), baseline_name(study));
    if runs.contains(&Example::Typical) {
        let text = Text::from("The typical run is that of the arm ").strong(baseline);
        page.paragraph(text.text(format!(
            " whose {label} is nearest to the median of all its runs."
        )));
    }
    if runs.contains(&Example::Worst) {
        page.paragraph(format!(
            "The worst run fails most expectations; where runs fail equally many, it is the one whose {label} is farthest from the \
             median of all runs of the arm {baseline}."
        ));
    }
    let mut names = StateOrder::default();
    for run in runs {
        let (name, outcome) = match run {
            Example::Typical => ("The typical run".to_owned(), found.map(|found| found.0)),
            Example::Worst => ("The worst run".to_owned(), found.map(|found| found.1)),
            Example::Unit(number) => {
                let mut outcomes = study.results.outcomes.iter();
                let outcome = outcomes.find(|outcome| outcome.unit == *number);
                (format!("Unit {number}"), outcome)
            }
        };
        page.heading(&name);
        match outcome {
            Some(outcome) => write_example(page, study, folder, (measure, outcome), &mut names),
            None => page.remark("There are no results of it."),
        }
    }
}

fn baseline_name<'a>(study: &Study<'a>) -> &'a str {
    let baseline = study.results.plan.experiment.baseline.as_deref();
    baseline.unwrap_or_else(|| study.arms.first().map_or("", |arm| &arm.name))
}

/// The typical and the worst run.
fn typical_and_worst<'a>(
    study: &Study<'a>,
    measure: &Measure,
) -> Option<(&'a UnitOutcome, &'a UnitOutcome)> {
    let value = |outcome: &UnitOutcome| {
        let measured = outcome.measures.get(&measure.name)?;
        measured
            .value()
            .or(measured.time().map(|(time_s, _)| time_s))
    };
    let baseline = baseline_name(study);
    let outcomes = &study.results.outcomes;
    let mut values: Vec<f64> = outcomes
        .iter()
        .filter(|outcome| outcome.arm == baseline)
        .filter_map(value)
        .collect();
    values.sort_by(f64::total_cmp);
    let median = *values.get(values.len() / 2)?;

    let valued = outcomes
        .iter()
        .filter_map(|outcome| Some((outcome, (value(outcome)? - median).abs())));
    let of_baseline = valued.clone().filter(|(one, _)| one.arm == baseline);
    let typical = of_baseline.min_by(|a, b| a.1.total_cmp(&b.1));
    let fails = |outcome: &UnitOutcome| {
        let verdicts = outcome.verdicts.values();
        verdicts.filter(|verdict| *verdict == "fail").count()
    };
    // The first one of several that are equally bad.
    let worst = valued.rev().max_by(|a, b| {
        let by_fails = fails(a.0).cmp(&fails(b.0));
        by_fails.then(a.1.total_cmp(&b.1))
    });
    Some((typical?.0, worst?.0))
}

fn write_example(
    page: &mut Page,
    study: &Study<'_>,
    folder: &Path,
    (measure, outcome): (&Measure, &UnitOutcome),
    names: &mut StateOrder,
) {
    let measured = outcome
        .measures
        .get(&measure.name)
        .map_or("missing".to_owned(), Measured::to_string);
    let unit = outcome.unit;
    let text = Text::from(format!("Unit {unit}: arm ")).strong(&outcome.arm);
    let text = text.text(format!(
        ", {}, seed {}; {} {measured}. To record it: ",
        study.heading_of(&outcome.condition),
        outcome.seed,
        label(measure),
    ));
    let folder = shell::path(folder);
    page.paragraph(text.code(format!("cars experiment replay {folder} {unit}")));

    if *study.results.plan.robots() != Robots::InProcess {
        page.remark(
            "Its robots are processes, which a report does not start: record it by the command above and report the run.",
        );
    } else if !study.results.plan.own_robots().is_empty() {
        page.remark(
            "Its robots are of a program of its own, which a report does not start: play the scenario of the run with them and report that run.",
        );
    } else if let Err(error) = write_course(page, study, outcome, names) {
        page.remark(format!("It cannot be shown: {error}."));
    }
}

/// Plays a unit again, recorded in a temporary folder, and shows its course. `names` are the emotions and behaviors of the runs
/// before it on the page, which keep their colors.
fn write_course(
    page: &mut Page,
    study: &Study<'_>,
    outcome: &UnitOutcome,
    names: &mut StateOrder,
) -> Result<(), LabError> {
    let plan = &study.results.plan;
    let unit = plan.unit(outcome.unit);
    let mut scenario = plan.scenario_of(&unit, &Launches::none())?;
    scenario.record.frames = study.shows(Shown::Floor) || study.shows(Shown::Runs);
    let place = tempfile::tempdir().map_err(LabError::failed)?;
    let run = RunName::unknown();
    let recorded = RunFolder::new(place.path(), &run);
    let lock = recorded.create(&scenario)?;
    let summary = execute(scenario, &run, &recorded, None)?;
    drop(lock);
    if summary.digest != outcome.digest {
        return Err(LabError::failed(
            "played again, it is another run than that of the results: the program is another one",
        ));
    }

    let files = recorded_epoch(&recorded, None)?;
    let mut facts = RunFacts::read(&files)?;
    names.add_all(&facts.names);
    facts.names = names.clone();
    let mut figures = Vec::new();
    if study.shows(Shown::Runs) {
        figures.extend(course_figure(&facts));
        figures.push(diagram_figure(outcome, &facts, &files)?);
    }
    if study.shows(Shown::Transitions) {
        figures.extend(transitions(&[&facts]));
    }
    if study.shows(Shown::Floor) {
        figures.extend(occupancy(&[&facts]));
    }

    let all = figures.len();
    for (index, figure) in figures.into_iter().enumerate() {
        if page.size() > MAX_BYTES_OF_EXAMPLES {
            page.remark(format!(
                "So that this page stays small, {} of this run are left out.",
                counted(all - index, "figure")
            ));
            break;
        }
        page.figure(figure);
    }
    Ok(())
}

/// The space-time diagram of a unit.
fn diagram_figure(
    outcome: &UnitOutcome,
    facts: &RunFacts,
    files: &EpochFiles,
) -> Result<Figure, LabError> {
    let diagram = diagram_lines(&format!("unit {}", outcome.unit), facts, files)?;
    let mut caption = format!("Space-time diagram, {READ_DIAGRAM}");
    let (last, of) = (diagram.last, facts.last_tick);
    if last < of {
        caption += &format!(" The diagram ends at tick {last} of {of}.");
    }

    Ok(Figure::new(diagram.lines, caption, None))
}

fn write_reproduction(
    page: &mut Page,
    study: &Study<'_>,
    folder: &Path,
    provenance: Option<&Provenance>,
) {
    let plan = &study.results.plan;
    let folder = shell::path(folder);
    page.section("Reproduction");
    page.paragraph(
        "The numbers, from the runs that were played; the numbers of every run as a table; one run, recorded; this page:",
    );
    page.commands(&[
        format!("cars experiment merge {folder}"),
        format!("cat {folder}/runs.csv"),
        format!("cars experiment replay {folder} UNIT"),
        format!("cars report {folder} -o report.html"),
    ]);

    let mut table = Table::new("What | ");
    let mut add = |name: &str, value: Cell| table.row([name.into(), value]);
    add("experiment", plan.name().into());
    add("program", format!("cars {}", plan.program()).into());
    if let Some(provenance) = provenance {
        let mut command = "cars".to_owned();
        for argument in &provenance.command {
            command += &format!(" {}", shell::word(argument));
        }
        add("command", Cell::Code(command));
        let machine = &provenance.machine;
        let host = machine.host.as_deref().unwrap_or("unknown host");
        let processor = machine.processor.as_deref().unwrap_or("unknown processor");
        let text = format!(
            "{host}: {} {}, {} × {processor}",
            machine.os, machine.architecture, machine.processors
        );
        add("machine", text.into());
        add("written", utc(provenance.written_unix_s).into());
    }
    page.table("Where the numbers come from.", &table);

    write_failures(page, study);
    let source = plan.experiment.source();
    page.file("Experiment file, whole", &source.text);
}

fn write_failures(page: &mut Page, study: &Study<'_>) {
    let failures = &study.results.failures;
    if failures.is_empty() {
        return;
    }

    let mut table = Table::new("Unit | condition | arm | seed | reason");
    for failure in failures.iter().take(MAX_NAMED) {
        table.row([
            failure.unit.into(),
            study.heading_of(&failure.condition).into(),
            failure.arm.as_str().into(),
            failure.seed.into(),
            failure.reason.as_str().into(),
        ]);
    }

    let caption = format!(
        "Runs that could not be played to their end: {} of {}.",
        table.rows.len(),
        failures.len()
    );
    page.table(caption, &table);
}
