//! The figures of an experiment: estimates of arms, differences, curves, heat maps, verdicts.

use std::collections::{BTreeMap, BTreeSet};

use observe::Measure;
use pictures::{
    Cell, Chart, ChartPanel, Curve, CurveStep, Figure, Matrix, MatrixCell, MatrixLabel, Steps,
    Table, decimals_for, fixed,
};
use protocol::messages::Verdict;
use statistics::{Interval, ecdf};

use super::limits::panels;
use super::quantity::{Of, Quantity, difference, widened};
use super::study::{CellPlace, Study, axis, label, lines};
use super::words::{capitalized, counted};
use experiments::{ArmDifference, Contrast, Estimated};

/// Most rows of a table.
const MAX_ROWS: usize = 500;

/// Estimates of the arms under each condition.
pub(super) fn estimates(study: &Study<'_>, measure: &Measure) -> Figure {
    let estimates = Quantity::estimates(study, measure);
    let of = Of::all(study, measure)[0];
    let what = if of == Of::Share {
        format!(
            "Percentage of runs with {} by the end of the run, of those at risk, with 95 % intervals (score intervals);",
            label(measure)
        )
    } else {
        format!(
            "{}: means over the seeds with 95 % intervals (Student's t, and Hall's transformation where runs are skewed); small points \
             are runs;",
            capitalized(&axis(study, measure))
        )
    };
    let mut caption = format!("{what} {}.", sample_sizes(study, measure));

    let lines = lines(study);
    let (panels, sentence) = if lines.is_empty() {
        estimates.intervals(study, measure)
    } else {
        let differences = Quantity::differences(study, measure, of);
        let mut trends = Vec::new();
        for line in &lines {
            trends.extend(estimates.trend(study, line));
            let differences = differences.as_ref();
            trends.extend(differences.and_then(|of| of.trend(study, line)));
        }
        if trends.len() > lines.len() {
            caption += &differences_in_words(study, measure, of);
        }
        panels("charts", trends, |(heading, trend)| {
            ChartPanel::new(heading, Chart::Trend(trend))
        })
    };

    let caption = pictures::Text::from(format!("{caption}{sentence} Data: column "));
    Figure::new(
        panels,
        caption
            .code(&measure.name)
            .text(" of ")
            .code("runs.csv")
            .text("."),
        Some(estimates_table(study, measure)),
    )
}

/// What differences beside estimates are.
fn differences_in_words(study: &Study<'_>, measure: &Measure, of: Of) -> String {
    let contrasts = study.contrasts_of(measure);
    let baseline = contrasts.first().map_or("", |one| &one.baseline);
    let points = match of {
        Of::Share => ", in percentage points",
        Of::Mean | Of::Time => "",
    };
    format!(
        " Differences to {baseline} are paired by seed{points}, with 95 % intervals ({}), and filled where p < 0.05 after {}.",
        of.interval(),
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
    for place in study.places() {
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

fn estimates_table(study: &Study<'_>, measure: &Measure) -> Table {
    let mut table = Table::new(if Of::all(study, measure)[0] == Of::Share {
        "Condition | arm | n | with it | with it, % | 95 % from | to | median time, s | 95 % from | to | runs without a number"
    } else {
        "Condition | arm | n | mean | 95 % from | to | least | quartile | median | quartile | most | runs without a number"
    });
    for place in study.places().into_iter().take(MAX_ROWS) {
        let Some(cell) = study.cell(measure, place) else {
            continue;
        };
        let mut row = study.place_cells(place).to_vec();
        row.push(cell.estimate.n().into());
        match study.estimated(measure, place).as_ref() {
            Some(Estimated::Time { share, survival }) => {
                row.push(survival.events.into());
                row.extend(estimate_cells(&share.scaled(100.0)));
                let median_s = [
                    survival.median_s,
                    survival.median_low_s,
                    survival.median_high_s,
                ];
                row.extend(median_s.map(|time_s| match time_s {
                    Some(time_s) => Cell::Number(time_s, 1),
                    None if survival.n == 0 => Cell::Empty,
                    None => "not reached".into(),
                }));
            }
            Some(Estimated::Number { mean, quartiles }) => {
                let number = |value| Cell::Number(value, mean.decimals());
                let quartiles = quartiles.map(|quartiles| quartiles.map(number));
                row.extend(estimate_cells(mean));
                row.extend(quartiles.unwrap_or([const { Cell::Empty }; 5]));
            }
            None => {}
        }
        row.push(cell.excluded.to_string().into());
        table.row(row);
    }
    table
}

/// An estimate and its interval, or why there is none.
fn estimate_cells(estimate: &statistics::Estimate) -> [Cell; 3] {
    let number = |value| Cell::Number(value, estimate.decimals());
    let (value, why) = match estimate.interval {
        Interval::Ends { low, high } => {
            return [estimate.value, low, high].map(number);
        }
        Interval::AllEqual => (number(estimate.value), "all equal"),
        Interval::TooFew if estimate.n == 0 => (Cell::Empty, ""),
        Interval::TooFew => (number(estimate.value), "too few"),
        Interval::NotFinite => (Cell::Empty, "not finite"),
    };
    [value, why.into(), Cell::Empty]
}

/// Differences of the arms to the baseline under each condition; `None` if there are none.
pub(super) fn differences(study: &Study<'_>, measure: &Measure, of: Of) -> Option<Figure> {
    let contrasts = study.contrasts_of(measure);
    let first = contrasts.first()?;
    let (panels, sentence) = Quantity::differences(study, measure, of)?.intervals(study, measure);

    let what = match of {
        Of::Mean => axis(study, measure),
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
    let has_pairs = of == Of::all(study, measure)[0] && of != Of::Share;
    let points = match has_pairs {
        true => " Small points are pairs of runs.",
        false => "",
    };
    let caption = format!(
        "Differences to {} in {what}, paired by seed, with 95 % intervals ({}).{points} Filled markers: p < 0.05 after {}. n = {n}.{sentence}",
        first.baseline,
        of.interval(),
        correction(&contrasts)
    );
    Some(Figure::new(
        panels,
        caption,
        Some(differences_table(study, &contrasts, of)),
    ))
}

/// Up to which times the mean times of contrasts count: as far as both curves are known.
fn horizons(contrasts: &[&Contrast]) -> String {
    let mut least_s = f64::INFINITY;
    let mut most_s: f64 = 0.0;
    for contrast in contrasts {
        if let ArmDifference::Time { until_s, .. } = contrast.difference {
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

fn differences_table(study: &Study<'_>, contrasts: &[&Contrast], of: Of) -> Table {
    let mut table = Table::new(
        "Condition | arm | pairs | difference | 95 % from | to | effect size | p | p after Holm | \
         runs of the arm without a number | of the baseline",
    );
    for contrast in contrasts.iter().take(MAX_ROWS) {
        let mut row = vec![
            study.heading_of(&contrast.condition).into(),
            contrast.arm.as_str().into(),
            contrast.n.into(),
        ];
        row.extend(match difference(contrast, of) {
            Some(estimate) => estimate_cells(&estimate),
            None => {
                let why = contrast.no_difference().unwrap_or_default();
                [Cell::Empty, why.into(), Cell::Empty]
            }
        });
        row.push(match &contrast.difference {
            ArmDifference::Number { dominance, .. } => Cell::Number(*dominance, 2),
            _ => Cell::Empty,
        });
        for p in [contrast.difference.p(), contrast.p_holm] {
            row.push(p.map_or(Cell::Empty, |p| Cell::Number(p, 4)));
        }
        row.push(contrast.excluded.to_string().into());
        row.push(contrast.excluded_baseline.to_string().into());
        table.row(row);
    }

    table
}

/// Survival curves of the arms under each condition.
pub(super) fn survival(study: &Study<'_>, measure: &Measure) -> Figure {
    let label = label(measure);
    let duration_s = study.results.plan.experiment.duration_s;
    let times = [0.0, 1.0, 2.0, 3.0].map(|third| duration_s * third / 3.0);

    let curve = |place: CellPlace| {
        let cell = study.cell(measure, place)?;
        let Estimated::Time { survival, .. } = &cell.estimate else {
            return None;
        };
        let mut steps = Vec::new();
        let mut censored = Vec::new();
        for step in &survival.curve {
            if step.events > 0 {
                steps.push(CurveStep {
                    x: step.time_s,
                    y: step.share,
                    band: Some((step.low, step.high)),
                });
            }
            if step.censored > 0 {
                censored.push(step.time_s);
            }
        }

        let sample = study.times(measure, place);
        let at_risk =
            times.map(|time_s| sample.iter().filter(|time| time.time_s >= time_s).count());
        let (label, arm) = study.arm(place);
        (survival.n > 0).then(|| Curve {
            label,
            arm,
            begin: 1.0,
            steps,
            end: survival.until_s,
            censored,
            at_risk: at_risk.to_vec(),
        })
    };
    let caption = format!(
        "Share of the runs at risk without {label} over time (Kaplan-Meier) with 95 % bands (score intervals with Greenwood's \
         variance). Ticks on a curve are runs that ended without it. Below, the number of runs at risk. {}.",
        sample_sizes(study, measure)
    );
    curves(study, measure, caption, curve, |heading, curves| Steps {
        title: format!("Runs without {label} {heading}"),
        x_axis: format!("time to {label}, s"),
        y_axis: format!("share of runs without {label}"),
        range: (0.0, duration_s),
        at_risk: Some(times.to_vec()),
        curves,
    })
}

/// Distribution functions of the arms under each condition.
pub(super) fn distributions(study: &Study<'_>, measure: &Measure) -> Figure {
    let mut values = Vec::new();
    for place in study.places() {
        values.extend(study.numbers(measure, place));
    }
    let range = widened(&values, true);

    let curve = |place: CellPlace| {
        let steps = ecdf(&study.numbers(measure, place));
        let steps = steps.iter().map(|step| CurveStep {
            x: step.value,
            y: step.share,
            band: None,
        });
        let (label, arm) = study.arm(place);
        (steps.len() > 0).then(|| Curve {
            label,
            arm,
            begin: 0.0,
            steps: steps.collect(),
            end: range.1,
            censored: Vec::new(),
            at_risk: Vec::new(),
        })
    };
    let label = label(measure);
    let caption = format!(
        "Empirical distribution functions of {label}. {}.",
        sample_sizes(study, measure)
    );
    curves(study, measure, caption, curve, |heading, curves| Steps {
        title: format!("Distribution of {label} {heading}"),
        x_axis: axis(study, measure),
        y_axis: "share of runs with at most this".to_owned(),
        range,
        at_risk: None,
        curves,
    })
}

/// A chart of curves for each condition.
fn curves(
    study: &Study<'_>,
    measure: &Measure,
    caption: String,
    curve: impl Fn(CellPlace) -> Option<Curve>,
    chart: impl Fn(&str, Vec<Curve>) -> Steps,
) -> Figure {
    let (panels, sentence) = study.panels(measure, curve, |heading, curves| {
        Chart::Steps(chart(heading, curves))
    });
    Figure::new(panels, caption + &sentence, None)
}

/// A heat map for each arm over two factors; `None` if there are not two.
pub(super) fn heat_maps(study: &Study<'_>, measure: &Measure) -> Option<Figure> {
    let [_, _] = study.factors[..] else {
        return None;
    };
    let of_columns = study.named_axis().unwrap_or(1);
    let of_rows = 1 - of_columns;
    let [rows, columns] = [of_rows, of_columns].map(|factor| study.factors[factor]);
    let [row_levels, column_levels] = [of_rows, of_columns].map(|factor| levels(study, factor));
    if row_levels.len() < 2 || column_levels.len() < 2 {
        return None;
    }

    let estimates = Quantity::estimates(study, measure);
    let (from, to) = estimates.range;
    let labels = |levels: &[&str]| levels.iter().map(|level| (*level).into()).collect();
    let arms = study.arms.iter().enumerate().collect();
    let (panels, sentence) = panels("arms", arms, |(arm, of)| {
        let mut cells = vec![vec![None; column_levels.len()]; row_levels.len()];
        for (condition, place) in study.conditions.iter().enumerate() {
            let row = position(&row_levels, &place.levels[of_rows].1);
            let column = position(&column_levels, &place.levels[of_columns].1);
            let estimate = estimates.estimate((condition, arm));
            cells[row][column] = estimate.map(|estimate| MatrixCell {
                share: (estimate.value - from) / (to - from),
                text: fixed(estimate.value, decimals_for(to - from)),
                remark: String::new(),
            });
        }
        let chart = Matrix {
            title: format!("{} of {}", axis(study, measure), of.name),
            rows_title: rows.to_owned(),
            columns_title: columns.to_owned(),
            rows: labels(&row_levels),
            columns: labels(&column_levels),
            cells,
        };
        ChartPanel::new(&of.name, Chart::Matrix(chart))
    });
    let caption = format!(
        "{} by {rows} and {columns}, a map for each arm; darker is more. {}.{sentence}",
        capitalized(&axis(study, measure)),
        sample_sizes(study, measure)
    );
    Some(Figure::new(panels, caption, None))
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

/// How often an expectation held, by arm and condition; `None` without expectations.
pub(super) fn verdicts(study: &Study<'_>) -> Option<Figure> {
    let mut names = BTreeSet::new();
    for outcome in &study.results.outcomes {
        names.extend(outcome.verdicts.keys());
    }
    if names.is_empty() {
        return None;
    }

    let mut table = Table::new(
        "Expectation | condition | arm | pass | fail | undecided | not asked | unreached",
    );
    let columns_title = match study.factors[..] {
        [only] => only,
        _ => "condition",
    };
    let column = |condition: &experiments::Condition| match &condition.levels[..] {
        [(_, level)] => MatrixLabel::from(level.as_str()),
        _ => study.heading(condition).as_str().into(),
    };
    let mut all = Vec::new();
    for name in names {
        let mut cells = vec![vec![None; study.conditions.len()]; study.arms.len()];
        for place in study.places() {
            let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
            for verdict in study
                .runs(place)
                .iter()
                .filter_map(|run| run.verdicts.get(name))
            {
                *counts.entry(verdict.as_str()).or_insert(0) += 1;
            }
            if counts.is_empty() {
                continue;
            }
            let verdicts = [
                "pass",
                "fail",
                "undecided",
                Verdict::NotAsked.name(),
                Verdict::Unreached.name(),
            ];
            let counts = verdicts.map(|verdict| counts.get(verdict).copied().unwrap_or(0));
            let (condition, arm) = place;
            cells[arm][condition] = Some(verdict_cell(counts));
            if table.rows.len() < MAX_ROWS {
                let [condition, arm] = study.place_cells(place);
                let mut row = vec![name.as_str().into(), condition, arm];
                row.extend(counts.map(Cell::Count));
                table.row(row);
            }
        }
        all.push((name, cells));
    }
    let (panels, sentence) = panels("expectations", all, |(name, cells)| {
        let arms = study.arms.iter();
        let chart = Matrix {
            title: format!("Expectation {name}"),
            rows_title: "arm".to_owned(),
            columns_title: columns_title.to_owned(),
            rows: arms.map(|arm| arm.name.as_str().into()).collect(),
            columns: study.conditions.iter().map(column).collect(),
            cells,
        };
        ChartPanel::new(name, Chart::Matrix(chart))
    });
    let caption = format!(
        "Verdicts about the expectations: runs that pass of those in which it was asked, and how many fail or are undecided \
         (open), because the run ended first. It is not asked where what it is expected after did not happen, and \
         unreached where what some run should `reach` was not seen. Darker is a larger \
         share of runs that fail.{sentence}"
    );
    Some(Figure::new(panels, caption, Some(table)))
}

/// How many runs pass of those in which an expectation was asked.
fn verdict_cell([pass, fail, undecided, _, unreached]: [u64; 5]) -> MatrixCell {
    let asked = pass + fail + undecided + unreached;
    MatrixCell {
        share: fail as f64 / asked.max(1) as f64,
        text: match asked {
            0 => "not asked".to_owned(),
            _ => format!("{pass}/{asked}"),
        },
        remark: match (fail, undecided) {
            (0, 0) => String::new(),
            (0, undecided) => format!("{undecided} open"),
            (fails, _) => format!("{fails} fail"),
        },
    }
}
