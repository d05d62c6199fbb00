//! The figures of an experiment: estimates of arms, differences, curves, heat maps, verdicts.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use observe::Measure;
use protocol::messages::Verdict;
use report::{
    Cell, Column, Curve, Estimate, Figure, IntervalRow, Intervals, Matrix, MatrixCell, MatrixLabel,
    Panel, Part, Step, Steps, Table, Trend, TrendLine, TrendPoint, decimals_for, fixed,
    round_range,
};
use statistics::{Bootstrapped, Survival, ecdf, quantile};

use super::limits::{MOST_PANELS, limited};
use super::study::{CellPlace, Study, axis, is_shown, label, level_number, named};
use super::words::capitalized;
use crate::experiment::{Contrast, Difference};

/// Most rows of a table.
const MOST_ROWS: usize = 500;
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

/// Estimates of the arms under each condition.
pub(super) fn estimates(study: &Study<'_>, measure: &Measure) -> Figure {
    let range = estimates_range(study, measure);
    let mut caption = vec![Part::text(format!(
        "{} {}.",
        estimated(measure),
        sample_sizes(study)
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
            "Percentage of runs with {} by the end of the run, from the survival curve, with 95 % intervals (Greenwood, log(-log));",
            label(measure)
        )
    } else {
        format!(
            "{}: means over the seeds with 95 % intervals (Student's t);",
            capitalized(&axis(measure))
        )
    }
}

/// What differences beside estimates are.
fn differences_in_words(study: &Study<'_>, measure: &Measure) -> String {
    let contrasts = study.contrasts_of(measure);
    let baseline = contrasts.first().map_or("", |one| &one.baseline);

    format!(
        " Differences to {baseline} are paired by seed{}, with 95 % intervals (BCa bootstrap), and filled where p < 0.05 after Holm's \
         correction of {} comparisons ({}).",
        if measure.is_time() {
            ", in percentage points"
        } else {
            ""
        },
        contrasts.len(),
        test_of(measure)
    )
}

/// How differences in a measure are tested.
fn test_of(measure: &Measure) -> &'static str {
    if measure.is_time() {
        "log-rank test"
    } else {
        "sign-flip test of the pairs"
    }
}

/// How many runs each arm has under each condition.
fn sample_sizes(study: &Study<'_>) -> String {
    let mut sizes = BTreeSet::new();
    for place in places(study) {
        sizes.insert(study.runs(place).len());
    }
    match (sizes.first(), sizes.last()) {
        (Some(least), Some(most)) if least == most => format!("n = {least} runs each"),
        (Some(least), Some(most)) => format!("n = {least} to {most} runs"),
        _ => "n = 0".to_owned(),
    }
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
            if let Some(contrast) = study.contrast(measure, condition, of) {
                points.push(TrendPoint {
                    x: level.x,
                    estimate: difference(contrast, what),
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
        values.extend(ends(difference(contrast, what)));
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
    for (condition, of) in study.conditions.iter().enumerate().take(MOST_PANELS) {
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
    let mut table = Table::new(columns);

    for (condition, arm) in places(study).into_iter().take(MOST_ROWS) {
        let place = (condition, arm);
        let Some(estimate) = study.estimate(measure, place) else {
            continue;
        };
        let mut row = vec![
            Cell::text(study.heading(&study.conditions[condition])),
            Cell::text(&study.arms[arm].name),
            Cell::Count(estimate.n as u64),
        ];
        if measure.is_time() {
            let survival = Survival::of(&study.times(measure, place));
            row.push(Cell::Count(survival.events as u64));
            row.push(Cell::Number(estimate.value, 1));
            row.extend(interval_cells(estimate.interval, 1));
            for time_s in [
                survival.median_s,
                survival.median_low_s,
                survival.median_high_s,
            ] {
                row.push(
                    time_s.map_or(Cell::text("not reached"), |time_s| Cell::Number(time_s, 1)),
                );
            }
        } else {
            let numbers = study.numbers(measure, place);
            row.push(Cell::Number(estimate.value, 2));
            row.extend(interval_cells(estimate.interval, 2));
            for quarter in 0..5 {
                let value = quantile(&numbers, f64::from(quarter) / 4.0);
                row.push(value.map_or(Cell::Empty, |value| Cell::Number(value, 2)));
            }
        }
        table.rows.push(row);
    }
    table
}

fn interval_cells(interval: Option<(f64, f64)>, decimals: usize) -> [Cell; 2] {
    match interval {
        Some((low, high)) => [Cell::Number(low, decimals), Cell::Number(high, decimals)],
        None => [Cell::Empty, Cell::Empty],
    }
}

/// Differences of the arms to the baseline under each condition; `None` if there are none.
pub(super) fn differences(study: &Study<'_>, measure: &Measure, what: Of) -> Option<Figure> {
    let contrasts = study.contrasts_of(measure);
    let first = contrasts.first()?;
    let range = differences_range(study, measure, what);

    let compared: BTreeSet<&str> = contrasts.iter().map(|one| one.condition.as_str()).collect();
    let compared = compared.len();
    let mut panels = Vec::new();
    for condition in study.conditions.iter().take(MOST_PANELS) {
        let mut rows = Vec::new();
        for (arm, of) in study.arms.iter().enumerate() {
            if let Some(contrast) = study.contrast(measure, condition, of) {
                rows.push(IntervalRow {
                    label: of.name.clone(),
                    arm: look(study, arm),
                    estimate: Some(difference(contrast, what)),
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
    let n = contrasts
        .iter()
        .map(|contrast| contrast.n)
        .max()
        .unwrap_or(0);
    let mut caption = format!(
        "Differences to {} in {of}, paired by seed, with 95 % intervals (BCa bootstrap). Filled markers: p < 0.05 after Holm's \
         correction of {} comparisons ({}). n = {n} pairs each.",
        first.baseline,
        contrasts.len(),
        test_of(measure)
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

fn difference(contrast: &Contrast, what: Of) -> Estimate {
    let factor = if what == Of::Share { 100.0 } else { 1.0 };
    let Bootstrapped { value, interval } = match &contrast.difference {
        Difference::Number { mean, .. } => mean,
        Difference::Time { share, .. } if what == Of::Share => share,
        Difference::Time {
            restricted_mean_s, ..
        } => restricted_mean_s,
    };

    let bounds = interval.bounds();
    Estimate {
        value: value * factor,
        interval: bounds.map(|(low, high)| (low * factor, high * factor)),
        n: contrast.n,
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
    ]);
    for contrast in contrasts.iter().take(MOST_ROWS) {
        let estimate = difference(contrast, what);
        let effect = match &contrast.difference {
            Difference::Number { dominance, .. } => Cell::Number(*dominance, 2),
            Difference::Time { .. } => Cell::Empty,
        };

        let mut row = vec![
            Cell::text(study.heading_of(&contrast.condition)),
            Cell::text(&contrast.arm),
            Cell::Count(contrast.n as u64),
            Cell::Number(estimate.value, 2),
        ];
        row.extend(interval_cells(estimate.interval, 2));
        row.push(effect);
        row.push(Cell::Number(contrast.difference.p(), 4));
        row.push(Cell::Number(contrast.p_holm, 4));
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
    for (condition, of) in study.conditions.iter().enumerate().take(MOST_PANELS) {
        let mut curves = Vec::new();
        for (arm, of) in study.arms.iter().enumerate() {
            let sample = study.times(measure, (condition, arm));
            if sample.is_empty() {
                continue;
            }

            let survival = Survival::of(&sample);
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
        "Share of runs without {} over time (Kaplan-Meier) with 95 % bands (Greenwood, log(-log)). Ticks on a curve are runs that \
         ended without it. Below, the number of runs at risk. {}.",
        label(measure),
        sample_sizes(study)
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
    for (condition, of) in study.conditions.iter().enumerate().take(MOST_PANELS) {
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
        sample_sizes(study)
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
    for (arm, of) in study.arms.iter().enumerate().take(MOST_PANELS) {
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
        sample_sizes(study)
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
            if table.rows.len() < MOST_ROWS {
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
        if panels.len() < MOST_PANELS {
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
    let caption = format!(
        "Verdicts about the expectations: runs that pass of those in which it was asked, and how many fail or are undecided \
         (open), because the run ended first. It is not asked where what it is expected after did not happen. Darker is a larger share of runs that fail. {}.",
        sample_sizes(study)
    );
    Some(Figure {
        panels,
        caption: vec![Part::text(caption)],
        table: Some(table),
    })
}
