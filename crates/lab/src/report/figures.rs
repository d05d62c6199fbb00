//! The figures of an experiment: estimates of arms, differences, curves, heat maps, verdicts.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use observe::Measure;
use protocol::messages::Verdict;
use pictures::{
    Cell, Column, Curve, Estimate, Figure, IntervalRow, Intervals, Matrix, MatrixCell, MatrixLabel,
    Panel, Part, Step, Steps, Table, Trend, TrendLine, TrendPoint, decimals_for, fixed,
    round_range,
};
use statistics::{Interval, ecdf};

use super::limits::{MAX_PANELS, limited};
use super::study::{CellPlace, Study, axis, drawn, is_shown, label, level_number, named};
use super::words::{capitalized, counted};
use crate::experiment::{Contrast, Difference, Estimated};

/// Most rows of a table.
const MAX_ROWS: usize = 500;
/// How many values a factor has of which lines are drawn.
const LINE_LEVELS: RangeInclusive<usize> = 3..=60;

/// Of what a difference is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    /// Means.
    Mean,
    /// The percentages of runs with an event.
    Share,
    /// Mean times to an event.
    Time,
}

impl Of {
    /// How the intervals of such differences are made.
    fn interval(self) -> &'static str {
        match self {
            Self::Mean => "Student's t",
            Self::Share => "Tango's score interval",
            Self::Time => "Student's t, and Hall's transformation where pairs are skewed",
        }
    }
}

/// Estimates of the arms under each condition.
pub(super) fn estimates(study: &Study<'_>, measure: &Measure) -> Figure {
    let range = estimates_range(study, measure);
    let mut caption = vec![Part::text(format!(
        "{} {}.",
        estimated(measure),
        sample_sizes(study, measure)
    ))];
    let lines = lines(study);
    let (panels, sentence) = if lines.is_empty() {
        let all = interval_panels(study, measure, range);
        limited(all, study.conditions.len(), "conditions")
    } else {
        let mut panels = Vec::new();
        let mut all = 0;
        for line in &lines {
            let of = [
                Some(trend(study, measure, range, line)),
                trend_of_differences(study, measure, line),
            ];
            all += of.iter().flatten().count();
            panels.extend(of.into_iter().flatten());
        }
        if all > lines.len() {
            caption.push(Part::text(differences_in_words(study, measure)));
        }
        limited(panels, all, "charts")
    };

    caption.extend([
        Part::text(format!("{sentence} Data: column ")),
        Part::code(&measure.name),
        Part::text(" of "),
        Part::code("runs.csv"),
        Part::text("."),
    ]);
    Figure {
        panels,
        caption,
        table: Some(estimates_table(study, measure)),
    }
}

/// What the estimates of a measure are.
fn estimated(measure: &Measure) -> String {
    if measure.is_time() {
        format!(
            "Percentage of runs with {} by the end of the run, of those at risk, with 95 % intervals (score intervals);",
            label(measure)
        )
    } else {
        format!(
            "{}: means over the seeds with 95 % intervals (Student's t, and Hall's transformation where runs are skewed);",
            capitalized(&axis(measure))
        )
    }
}

/// What differences beside estimates are.
fn differences_in_words(study: &Study<'_>, measure: &Measure) -> String {
    let what = if measure.is_time() {
        Of::Share
    } else {
        Of::Mean
    };
    let contrasts = study.contrasts_of(measure);
    let baseline = contrasts.first().map_or("", |one| &one.baseline);

    format!(
        " Differences to {baseline} are paired by seed{}, with 95 % intervals ({}), and filled where p < 0.05 after {}.",
        if measure.is_time() {
            ", in percentage points"
        } else {
            ""
        },
        what.interval(),
        correction(&contrasts)
    )
}

/// How differences are tested.
fn correction(contrasts: &[&Contrast]) -> String {
    let comparisons = contrasts.first().map_or(0, |one| one.comparisons);
    format!(
        "Holm's correction over {} in this measure (sign-flip test of the pairs)",
        counted(comparisons, "comparison")
    )
}

/// How many runs of each arm under each condition have a number, and how many have none.
fn sample_sizes(study: &Study<'_>, measure: &Measure) -> String {
    let mut sizes = BTreeSet::new();
    let mut excluded = 0;
    for place in places(study) {
        let size = study
            .cell(measure, place)
            .map_or(0, |cell| cell.estimate.n());
        sizes.insert(size);
        excluded += study.runs(place).len() - size;
    }

    let text = match (sizes.first(), sizes.last()) {
        (Some(least), Some(most)) if least == most => format!("n = {least} runs each"),
        (Some(least), Some(most)) => format!("n = {least} to {most} runs"),
        _ => "n = 0".to_owned(),
    };
    if excluded == 0 {
        return text;
    }
    format!("{text}; {excluded} runs have no number, see the table")
}

/// All cells of the design.
pub(super) fn places(study: &Study<'_>) -> Vec<CellPlace> {
    let mut places = Vec::new();
    for condition in 0..study.conditions.len() {
        for arm in 0..study.arms.len() {
            places.push((condition, arm));
        }
    }
    places
}

/// The conditions along a factor whose values are numbers.
struct Line<'a> {
    /// The factor.
    factor: &'a str,
    /// The values of the other factors in words; empty if there are none.
    others: String,
    /// The conditions, with growing values of the factor.
    levels: Vec<Level<'a>>,
}

/// A value of a factor.
struct Level<'a> {
    x: f64,
    name: &'a str,
    /// Index of the condition that has it.
    condition: usize,
}

/// The conditions along the factor that the experiment file names, or the only factor if its values are numbers and enough for
/// a line: a line for each combination of the other factors. Otherwise there are none.
fn lines<'a>(study: &Study<'a>) -> Vec<Line<'a>> {
    let is_only = study.factors.len() == 1 && LINE_LEVELS.contains(&study.conditions.len());
    let Some(factor) = study.named_axis().or(is_only.then_some(0)) else {
        return Vec::new();
    };

    let mut lines: Vec<Line<'_>> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for (index, condition) in study.conditions.iter().enumerate() {
        let mut others = condition.levels.clone();
        others.remove(factor);
        let (_, name) = &condition.levels[factor];
        let Some(x) = level_number(name) else {
            return Vec::new();
        };

        let others = named(&others);
        let place = *places.entry(others.clone()).or_insert(lines.len());
        if place == lines.len() {
            lines.push(Line {
                factor: study.factors[factor],
                others,
                levels: Vec::new(),
            });
        }
        lines[place].levels.push(Level {
            x,
            name,
            condition: index,
        });
    }
    for line in &mut lines {
        line.levels.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    lines
}

/// Ends of the axis of a measure: of all its intervals.
fn estimates_range(study: &Study<'_>, measure: &Measure) -> (f64, f64) {
    if measure.is_time() {
        return (0.0, 100.0);
    }
    let mut values = Vec::new();
    for place in places(study) {
        values.extend(study.estimate(measure, place).into_iter().flat_map(ends));
    }
    widened(&values, true)
}

fn ends(estimate: Estimate) -> [f64; 2] {
    let (low, high) = estimate
        .interval
        .unwrap_or((estimate.value, estimate.value));
    [low.min(estimate.value), high.max(estimate.value)]
}

/// A range with round ends around values. If it would begin not far above zero it begins there.
fn widened(values: &[f64], is_of_amounts: bool) -> (f64, f64) {
    let mut from = values.iter().copied().fold(f64::INFINITY, f64::min);
    let mut to = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !from.is_finite() || !to.is_finite() {
        return (0.0, 1.0);
    }

    if is_of_amounts && from >= 0.0 && from < 0.6 * to {
        from = 0.0;
    }
    if !is_of_amounts {
        from = from.min(0.0);
        to = to.max(0.0);
    }

    round_range(from, to, 6)
}

fn decimals_of((from, to): (f64, f64)) -> usize {
    decimals_for(to - from)
}

fn trend(study: &Study<'_>, measure: &Measure, range: (f64, f64), line: &Line<'_>) -> Panel {
    let mut lines = Vec::new();
    for (arm, of) in study.arms.iter().enumerate() {
        let mut points = Vec::new();
        for level in &line.levels {
            if let Some(estimate) = study.estimate(measure, (level.condition, arm)) {
                points.push(TrendPoint {
                    x: level.x,
                    estimate,
                    is_filled: true,
                });
            }
        }
        lines.push(TrendLine {
            label: of.name.clone(),
            arm: look(study, arm),
            points,
        });
    }

    let factor = line.factor;
    let title = format!("{} over {factor} {}", axis(measure), line.others);
    let chart = Trend {
        title: title.trim_end().to_owned(),
        x_axis: factor.to_owned(),
        y_axis: axis(measure),
        levels: line.named_levels(),
        range,
        decimals: decimals_of(range),
        reference: None,
        lines,
    };
    let heading = if line.others.is_empty() {
        "Arms"
    } else {
        &line.others
    };
    Panel {
        heading: heading.to_owned(),
        svg: chart.draw(),
        is_wide: false,
    }
}

/// The differences to the baseline over the factor; `None` if there are none.
fn trend_of_differences(study: &Study<'_>, measure: &Measure, line: &Line<'_>) -> Option<Panel> {
    let what = if measure.is_time() {
        Of::Share
    } else {
        Of::Mean
    };
    let mut lines = Vec::new();
    for (arm, of) in study.arms.iter().enumerate() {
        let mut points = Vec::new();
        for level in &line.levels {
            let condition = &study.conditions[level.condition];
            if let Some(contrast) = study.contrast(measure, condition, of)
                && let Some(estimate) = difference(contrast, what)
            {
                points.push(TrendPoint {
                    x: level.x,
                    estimate: drawn(&estimate),
                    is_filled: is_shown(contrast),
                });
            }
        }
        if !points.is_empty() {
            lines.push(TrendLine {
                label: of.name.clone(),
                arm: look(study, arm),
                points,
            });
        }
    }
    let baseline = &study.contrasts_of(measure).first()?.baseline;
    if lines.is_empty() {
        return None;
    }

    let factor = line.factor;
    let title = format!(
        "Differences in {} over {factor} {}",
        label(measure),
        line.others
    );
    let range = differences_range(study, measure, what);
    let chart = Trend {
        title: title.trim_end().to_owned(),
        x_axis: factor.to_owned(),
        y_axis: difference_axis(measure, what, baseline),
        levels: line.named_levels(),
        range,
        decimals: decimals_of(range),
        reference: Some(0.0),
        lines,
    };
    let heading = if line.others.is_empty() {
        format!("Differences to {baseline}")
    } else {
        format!("{}: differences to {baseline}", line.others)
    };
    Some(Panel {
        heading,
        svg: chart.draw(),
        is_wide: false,
    })
}

/// Ends of the axis of the differences in a measure: of all their intervals.
fn differences_range(study: &Study<'_>, measure: &Measure, what: Of) -> (f64, f64) {
    let mut values = Vec::new();
    for contrast in study.contrasts_of(measure) {
        let estimate = difference(contrast, what);
        values.extend(estimate.iter().flat_map(|one| ends(drawn(one))));
    }
    widened(&values, false)
}

impl Line<'_> {
    /// The values of the factor with their names.
    fn named_levels(&self) -> Vec<(f64, String)> {
        let levels = self.levels.iter();
        levels
            .map(|level| (level.x, level.name.to_owned()))
            .collect()
    }
}

/// The index by which an arm has its color and marker: that of the baseline is the first one.
pub(super) fn look(study: &Study<'_>, arm: usize) -> usize {
    let baseline = study.results.plan.experiment.baseline.as_ref();
    let baseline = study
        .arms
        .iter()
        .position(|one| Some(&one.name) == baseline);
    match baseline {
        Some(baseline) if arm == baseline => 0,
        Some(baseline) if arm < baseline => arm + 1,
        _ => arm,
    }
}

fn interval_panels(study: &Study<'_>, measure: &Measure, range: (f64, f64)) -> Vec<Panel> {
    let mut panels = Vec::new();
    for (condition, of) in study.conditions.iter().enumerate().take(MAX_PANELS) {
        let mut rows = Vec::new();
        for (arm, of) in study.arms.iter().enumerate() {
            rows.push(IntervalRow {
                label: of.name.clone(),
                arm: look(study, arm),
                estimate: study.estimate(measure, (condition, arm)),
                is_filled: true,
            });
        }

        let heading = study.heading(of);
        let chart = Intervals {
            title: format!("{} {heading}", axis(measure)),
            axis: axis(measure),
            range,
            decimals: decimals_of(range),
            reference: None,
            rows,
        };
        panels.push(Panel {
            heading,
            svg: chart.draw(),
            is_wide: false,
        });
    }

    panels
}

fn estimates_table(study: &Study<'_>, measure: &Measure) -> Table {
    let mut columns = vec![
        Column::text("Condition"),
        Column::text("arm"),
        Column::number("n"),
    ];
    let names: &[&str] = if measure.is_time() {
        &[
            "with it",
            "with it, %",
            "95 % from",
            "to",
            "median time, s",
            "95 % from",
            "to",
        ]
    } else {
        &[
            "mean",
            "95 % from",
            "to",
            "least",
            "quartile",
            "median",
            "quartile",
            "most",
        ]
    };
    columns.extend(names.iter().map(|name| Column::number(name)));
    columns.push(Column::text("runs without a number"));
    let mut table = Table::new(columns);

    for (condition, arm) in places(study).into_iter().take(MAX_ROWS) {
        let Some(cell) = study.cell(measure, (condition, arm)) else {
            continue;
        };
        let mut row = vec![
            Cell::text(study.heading(&study.conditions[condition])),
            Cell::text(&study.arms[arm].name),
            Cell::Count(cell.estimate.n() as u64),
        ];
        match &cell.estimate {
            Estimated::Time { share, survival } => {
                row.push(Cell::Count(survival.events as u64));
                row.extend(estimate_cells(&share.scaled(100.0)));
                for time_s in [
                    survival.median_s,
                    survival.median_low_s,
                    survival.median_high_s,
                ] {
                    row.push(match time_s {
                        Some(time_s) => Cell::Number(time_s, 1),
                        None if survival.n == 0 => Cell::Empty,
                        None => Cell::text("not reached"),
                    });
                }
            }
            Estimated::Number { mean, quartiles } => {
                let decimals = mean.decimals();
                row.extend(estimate_cells(mean));
                match quartiles {
                    Some(quartiles) => {
                        row.extend(quartiles.map(|value| Cell::Number(value, decimals)));
                    }
                    None => row.extend([const { Cell::Empty }; 5]),
                }
            }
        }
        row.push(Cell::text(cell.excluded.to_string()));
        table.rows.push(row);
    }
    table
}

/// An estimate and its interval, or why there is none.
fn estimate_cells(estimate: &statistics::Estimate) -> [Cell; 3] {
    let decimals = estimate.decimals();
    let number = |value| Cell::Number(value, decimals);
    let (value, why) = match estimate.interval {
        Interval::Ends { low, high } => {
            return [number(estimate.value), number(low), number(high)];
        }
        Interval::AllEqual => (number(estimate.value), "all equal"),
        Interval::TooFew if estimate.n == 0 => (Cell::Empty, ""),
        Interval::TooFew => (number(estimate.value), "too few"),
        Interval::NotFinite => (Cell::Empty, "not finite"),
    };
    [value, Cell::text(why), Cell::Empty]
}

/// Differences of the arms to the baseline under each condition; `None` if there are none.
pub(super) fn differences(study: &Study<'_>, measure: &Measure, what: Of) -> Option<Figure> {
    let contrasts = study.contrasts_of(measure);
    let first = contrasts.first()?;
    let range = differences_range(study, measure, what);

    let compared: BTreeSet<&str> = contrasts.iter().map(|one| one.condition.as_str()).collect();
    let compared = compared.len();
    let mut panels = Vec::new();
    for condition in study.conditions.iter().take(MAX_PANELS) {
        let mut rows = Vec::new();
        for (arm, of) in study.arms.iter().enumerate() {
            if let Some(contrast) = study.contrast(measure, condition, of) {
                let estimate = difference(contrast, what);
                rows.push(IntervalRow {
                    label: of.name.clone(),
                    arm: look(study, arm),
                    estimate: estimate.as_ref().map(drawn),
                    is_filled: is_shown(contrast),
                });
            }
        }
        if rows.is_empty() {
            continue;
        }
        let heading = study.heading(condition);
        let chart = Intervals {
            title: format!("Differences in {} {heading}", label(measure)),
            axis: difference_axis(measure, what, &first.baseline),
            range,
            decimals: decimals_of(range),
            reference: Some(0.0),
            rows,
        };
        panels.push(Panel {
            heading,
            svg: chart.draw(),
            is_wide: false,
        });
    }

    let of = match what {
        Of::Mean => axis(measure),
        Of::Share => format!(
            "the percentage of runs with {} by the end of the run, in percentage points",
            label(measure)
        ),
        Of::Time => format!(
            "the mean time to {}, in seconds, where a longer time counts as {}",
            label(measure),
            horizons(&contrasts)
        ),
    };
    let pairs: BTreeSet<usize> = contrasts.iter().map(|contrast| contrast.n).collect();
    let n = match (pairs.first(), pairs.last()) {
        (Some(least), Some(most)) if least < most => format!("{least} to {most} pairs"),
        (_, most) => format!("{} pairs each", most.unwrap_or(&0)),
    };
    let mut caption = format!(
        "Differences to {} in {of}, paired by seed, with 95 % intervals ({}). Filled markers: p < 0.05 after {}. n = {n}.",
        first.baseline,
        what.interval(),
        correction(&contrasts)
    );
    let (panels, sentence) = limited(panels, compared, "conditions");
    caption += &sentence;
    Some(Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: Some(differences_table(study, &contrasts, what)),
    })
}

/// Up to which times the mean times of contrasts count: as far as both curves are known.
fn horizons(contrasts: &[&Contrast]) -> String {
    let mut least_s = f64::INFINITY;
    let mut most_s: f64 = 0.0;
    for contrast in contrasts {
        if let Difference::Time { until_s, .. } = contrast.difference {
            least_s = least_s.min(until_s);
            most_s = most_s.max(until_s);
        }
    }

    if least_s == most_s {
        format!("{most_s} s")
    } else {
        format!(
            "{least_s} s to {most_s} s, as far as both curves are known (`until_s` in results.json)"
        )
    }
}

fn difference_axis(measure: &Measure, what: Of, baseline: &str) -> String {
    match what {
        Of::Mean => format!("{} minus {baseline}", axis(measure)),
        Of::Share => format!("{}, points, minus {baseline}", label(measure)),
        Of::Time => format!("mean time to {}, s, minus {baseline}", label(measure)),
    }
}

/// The difference of a contrast, shares in percentage points; `None` if there is none.
fn difference(contrast: &Contrast, what: Of) -> Option<statistics::Estimate> {
    match &contrast.difference {
        Difference::Number { mean, .. } => Some(*mean),
        Difference::Time { share, .. } if what == Of::Share => Some(share.scaled(100.0)),
        Difference::Time {
            restricted_mean_s, ..
        } => Some(*restricted_mean_s),
        Difference::NoPair | Difference::NotFinite => None,
    }
}

fn differences_table(study: &Study<'_>, contrasts: &[&Contrast], what: Of) -> Table {
    let mut table = Table::new(vec![
        Column::text("Condition"),
        Column::text("arm"),
        Column::number("pairs"),
        Column::number("difference"),
        Column::number("95 % from"),
        Column::number("to"),
        Column::number("effect size"),
        Column::number("p"),
        Column::number("p after Holm"),
        Column::text("runs of the arm without a number"),
        Column::text("of the baseline"),
    ]);
    for contrast in contrasts.iter().take(MAX_ROWS) {
        let mut row = vec![
            Cell::text(study.heading_of(&contrast.condition)),
            Cell::text(&contrast.arm),
            Cell::Count(contrast.n as u64),
        ];
        match difference(contrast, what) {
            Some(estimate) => row.extend(estimate_cells(&estimate)),
            None => row.extend([
                Cell::Empty,
                Cell::text(contrast.no_difference().unwrap_or_default()),
                Cell::Empty,
            ]),
        }
        row.push(match &contrast.difference {
            Difference::Number { dominance, .. } => Cell::Number(*dominance, 2),
            _ => Cell::Empty,
        });
        for p in [contrast.difference.p(), contrast.p_holm] {
            row.push(p.map_or(Cell::Empty, |p| Cell::Number(p, 4)));
        }
        row.push(Cell::text(contrast.excluded.to_string()));
        row.push(Cell::text(contrast.excluded_baseline.to_string()));
        table.rows.push(row);
    }

    table
}

/// Survival curves of the arms under each condition.
pub(super) fn survival(study: &Study<'_>, measure: &Measure) -> Figure {
    let duration_s = study.results.plan.experiment.duration_s;
    let times: Vec<f64> = (0..4)
        .map(|third| duration_s * f64::from(third) / 3.0)
        .collect();

    let mut panels = Vec::new();
    for (condition, of) in study.conditions.iter().enumerate().take(MAX_PANELS) {
        let mut curves = Vec::new();
        for (arm, of) in study.arms.iter().enumerate() {
            let sample = study.times(measure, (condition, arm));
            let cell = study.cell(measure, (condition, arm));
            let Some(Estimated::Time { survival, .. }) = cell.map(|cell| &cell.estimate) else {
                continue;
            };
            if survival.n == 0 {
                continue;
            }
            let mut steps = Vec::new();
            let mut censored = Vec::new();
            for step in &survival.curve {
                if step.events > 0 {
                    steps.push(Step {
                        x: step.time_s,
                        y: step.share,
                        band: Some((step.low, step.high)),
                    });
                }
                if step.censored > 0 {
                    censored.push(step.time_s);
                }
            }

            let at_risk = times
                .iter()
                .map(|time_s| sample.iter().filter(|time| time.time_s >= *time_s).count());
            curves.push(Curve {
                label: of.name.clone(),
                arm: look(study, arm),
                begin: 1.0,
                steps,
                end: survival.until_s,
                censored,
                at_risk: at_risk.collect(),
            });
        }

        let heading = study.heading(of);
        let chart = Steps {
            title: format!("Runs without {} {heading}", label(measure)),
            x_axis: format!("time to {}, s", label(measure)),
            y_axis: format!("share of runs without {}", label(measure)),
            range: (0.0, duration_s),
            at_risk: Some(times.clone()),
            curves,
        };
        panels.push(Panel {
            heading,
            svg: chart.draw(),
            is_wide: false,
        });
    }

    let mut caption = format!(
        "Share of the runs at risk without {} over time (Kaplan-Meier) with 95 % bands (score intervals with Greenwood's variance). \
         Ticks on a curve are runs that ended without it. Below, the number of runs at risk. {}.",
        label(measure),
        sample_sizes(study, measure)
    );
    let (panels, sentence) = limited(panels, study.conditions.len(), "conditions");
    caption += &sentence;

    Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: None,
    }
}

/// Distribution functions of the arms under each condition.
pub(super) fn distributions(study: &Study<'_>, measure: &Measure) -> Figure {
    let mut values = Vec::new();
    for place in places(study) {
        values.extend(study.numbers(measure, place));
    }
    let range = widened(&values, true);

    let mut panels = Vec::new();
    for (condition, of) in study.conditions.iter().enumerate().take(MAX_PANELS) {
        let mut curves = Vec::new();
        for (arm, of) in study.arms.iter().enumerate() {
            let steps = ecdf(&study.numbers(measure, (condition, arm)));
            if steps.is_empty() {
                continue;
            }
            let steps = steps.iter().map(|step| Step {
                x: step.value,
                y: step.share,
                band: None,
            });
            curves.push(Curve {
                label: of.name.clone(),
                arm: look(study, arm),
                begin: 0.0,
                steps: steps.collect(),
                end: range.1,
                censored: Vec::new(),
                at_risk: Vec::new(),
            });
        }
        let heading = study.heading(of);
        let chart = Steps {
            title: format!("Distribution of {} {heading}", label(measure)),
            x_axis: axis(measure),
            y_axis: "share of runs with at most this".to_owned(),
            range,
            at_risk: None,
            curves,
        };
        panels.push(Panel {
            heading,
            svg: chart.draw(),
            is_wide: false,
        });
    }
    let mut caption = format!(
        "Empirical distribution functions of {}. {}.",
        label(measure),
        sample_sizes(study, measure)
    );
    let (panels, sentence) = limited(panels, study.conditions.len(), "conditions");
    caption += &sentence;
    Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: None,
    }
}

/// A heat map for each arm over two factors; `None` if there are not two.
pub(super) fn heat_maps(study: &Study<'_>, measure: &Measure) -> Option<Figure> {
    let [_, _] = study.factors[..] else {
        return None;
    };
    let of_columns = study.named_axis().unwrap_or(1);
    let of_rows = 1 - of_columns;
    let rows = study.factors[of_rows];
    let columns = study.factors[of_columns];
    let row_levels = levels(study, of_rows);
    let column_levels = levels(study, of_columns);
    if row_levels.len() < 2 || column_levels.len() < 2 {
        return None;
    }

    let range = estimates_range(study, measure);
    let mut panels = Vec::new();
    for (arm, of) in study.arms.iter().enumerate().take(MAX_PANELS) {
        let mut cells = vec![vec![None; column_levels.len()]; row_levels.len()];
        for (condition, place) in study.conditions.iter().enumerate() {
            let row = position(&row_levels, &place.levels[of_rows].1);
            let column = position(&column_levels, &place.levels[of_columns].1);
            cells[row][column] =
                study
                    .estimate(measure, (condition, arm))
                    .map(|estimate| MatrixCell {
                        share: (estimate.value - range.0) / (range.1 - range.0),
                        text: fixed(estimate.value, decimals_of(range)),
                        remark: String::new(),
                    });
        }
        let chart = Matrix {
            title: format!("{} of {}", axis(measure), of.name),
            rows_title: rows.to_owned(),
            columns_title: columns.to_owned(),
            rows: row_levels.iter().map(|level| plain_label(level)).collect(),
            columns: column_levels
                .iter()
                .map(|level| plain_label(level))
                .collect(),
            cells,
        };
        panels.push(Panel {
            heading: of.name.clone(),
            svg: chart.draw(),
            is_wide: chart.is_wide(),
        });
    }
    let (panels, sentence) = limited(panels, study.arms.len(), "arms");
    let caption = format!(
        "{} by {rows} and {columns}, a map for each arm; darker is more. {}.{sentence}",
        capitalized(&axis(measure)),
        sample_sizes(study, measure)
    );
    Some(Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: None,
    })
}

/// The values of a factor in their order.
fn levels<'a>(study: &Study<'a>, factor: usize) -> Vec<&'a str> {
    let mut levels = Vec::new();
    for condition in study.conditions {
        if let Some((_, level)) = condition.levels.get(factor)
            && !levels.contains(&level.as_str())
        {
            levels.push(level.as_str());
        }
    }
    levels
}

fn position(levels: &[&str], level: &str) -> usize {
    let found = levels.iter().position(|one| *one == level);
    found.unwrap_or_else(|| unreachable!("every condition has a level of each factor"))
}

fn plain_label(text: &str) -> MatrixLabel {
    MatrixLabel {
        text: text.to_owned(),
        color: None,
    }
}

/// How often an expectation held, by arm and condition; `None` without expectations.
pub(super) fn verdicts(study: &Study<'_>) -> Option<Figure> {
    let mut names = BTreeSet::new();
    for outcome in &study.results.outcomes {
        names.extend(outcome.verdicts.keys());
    }
    if names.is_empty() {
        return None;
    }

    let mut table = Table::new(vec![
        Column::text("Expectation"),
        Column::text("condition"),
        Column::text("arm"),
        Column::number("pass"),
        Column::number("fail"),
        Column::number("undecided"),
        Column::number("not asked"),
    ]);
    let columns_title = match study.factors[..] {
        [only] => only,
        _ => "condition",
    };
    let mut panels = Vec::new();
    for name in names {
        let mut cells = vec![vec![None; study.conditions.len()]; study.arms.len()];
        for (condition, arm) in places(study) {
            let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
            for run in study.runs((condition, arm)) {
                if let Some(verdict) = run.verdicts.get(name) {
                    *counts.entry(verdict.as_str()).or_insert(0) += 1;
                }
            }
            let count = |verdict: &str| counts.get(verdict).copied().unwrap_or(0);
            let not_asked = count(Verdict::NotAsked.name());
            let asked = counts.values().sum::<u64>() - not_asked;
            if asked + not_asked == 0 {
                continue;
            }
            cells[arm][condition] = Some(MatrixCell {
                share: count("fail") as f64 / asked.max(1) as f64,
                text: match asked {
                    0 => "not asked".to_owned(),
                    _ => format!("{}/{asked}", count("pass")),
                },
                remark: match (count("fail"), count("undecided")) {
                    (0, 0) => String::new(),
                    (0, undecided) => format!("{undecided} open"),
                    (fails, _) => format!("{fails} fail"),
                },
            });
            if table.rows.len() < MAX_ROWS {
                table.rows.push(vec![
                    Cell::text(name),
                    Cell::text(study.heading(&study.conditions[condition])),
                    Cell::text(&study.arms[arm].name),
                    Cell::Count(count("pass")),
                    Cell::Count(count("fail")),
                    Cell::Count(count("undecided")),
                    Cell::Count(not_asked),
                ]);
            }
        }
        if panels.len() < MAX_PANELS {
            let chart = Matrix {
                title: format!("Expectation {name}"),
                rows_title: "arm".to_owned(),
                columns_title: columns_title.to_owned(),
                rows: study
                    .arms
                    .iter()
                    .map(|arm| plain_label(&arm.name))
                    .collect(),
                columns: study
                    .conditions
                    .iter()
                    .map(|condition| match &condition.levels[..] {
                        [(_, level)] => plain_label(level),
                        _ => plain_label(&study.heading(condition)),
                    })
                    .collect(),
                cells,
            };
            panels.push(Panel {
                heading: name.clone(),
                svg: chart.draw(),
                is_wide: chart.is_wide(),
            });
        }
    }
    let caption = String::from(
        "Verdicts about the expectations: runs that pass of those in which it was asked, and how many fail or are undecided \
         (open), because the run ended first. It is not asked where what it is expected after did not happen. Darker is a larger \
         share of runs that fail.",
    );
    Some(Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: Some(table),
    })
}
