//! What is drawn of a measure for each arm under each condition: its estimates, or its differences to the baseline.

use std::collections::BTreeMap;

use observe::Measure;
use pictures::{
    Chart, ChartPanel, IntervalRow, Intervals, PlottedEstimate, Trend, TrendLine, TrendPoint,
    round_range,
};

use super::study::{CellPlace, FactorLine, Study, axis, drawn, is_shown, label};
use super::words::capitalized;
use experiments::{ArmDifference, Contrast};

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
    /// The differences in a measure; the first one is that of its estimates.
    pub(super) fn all(study: &Study<'_>, measure: &Measure) -> &'static [Self] {
        if study.is_always_reached(measure) {
            &[Self::Time]
        } else if measure.is_time() {
            &[Self::Share, Self::Time]
        } else {
            &[Self::Mean]
        }
    }

    /// How the intervals of such differences are made.
    pub(super) fn interval(self) -> &'static str {
        match self {
            Self::Mean => "Student's t",
            Self::Share => "Tango's score interval",
            Self::Time => "Student's t, and Hall's transformation where pairs are skewed",
        }
    }
}

/// The numbers of the arms under the conditions.
pub(super) struct Quantity {
    /// Name of its charts.
    title: String,
    /// Name and unit of its axis.
    axis: String,
    /// What differences are called; estimates have no name.
    name: Option<String>,
    /// Ends of the axis: of all intervals and runs.
    pub(super) range: (f64, f64),
    /// A value that is marked.
    reference: Option<f64>,
    /// The number of each arm that is shown; `None` if there is no finite one.
    cells: BTreeMap<CellPlace, QuantityCell>,
}

/// The number of an arm under a condition.
#[derive(Default)]
struct QuantityCell {
    /// `None` if there is no finite one.
    estimate: Option<PlottedEstimate>,
    /// Numbers of the single runs or pairs that it is of.
    runs: Vec<f64>,
}

impl Quantity {
    /// The estimates of a measure.
    pub(super) fn estimates(study: &Study<'_>, measure: &Measure) -> Self {
        let is_share = Of::all(study, measure)[0] == Of::Share;
        let mut cells = BTreeMap::new();
        for place in study.places() {
            let mut runs = Vec::new();
            if !is_share {
                runs = study.numbers(measure, place);
                runs.retain(|number| number.is_finite());
            }
            let estimate = study.estimate(measure, place);
            let cell = QuantityCell { estimate, runs };
            cells.insert(place, cell);
        }
        let range = match is_share {
            true => (0.0, 100.0),
            false => widened(&ends(&cells), true),
        };
        Self {
            title: axis(study, measure),
            axis: axis(study, measure),
            name: None,
            range,
            reference: None,
            cells,
        }
    }

    /// The differences of the arms to the baseline; `None` if there are none.
    pub(super) fn differences(study: &Study<'_>, measure: &Measure, of: Of) -> Option<Self> {
        let mut cells = BTreeMap::new();
        let is_of_runs = of == Of::all(study, measure)[0] && of != Of::Share;
        for place in study.places() {
            if let Some(contrast) = study.contrast(measure, place) {
                let estimate = difference(contrast, of).map(|estimate| PlottedEstimate {
                    is_filled: is_shown(contrast),
                    ..drawn(&estimate)
                });
                let runs = match is_of_runs {
                    true => study.paired_numbers(measure, place),
                    false => Vec::new(),
                };
                cells.insert(place, QuantityCell { estimate, runs });
            }
        }
        let baseline = &study.contrasts_of(measure).first()?.baseline;
        let axis = match of {
            Of::Mean => format!("{} minus {baseline}", axis(study, measure)),
            Of::Share => format!("{}, points, minus {baseline}", label(measure)),
            Of::Time => format!("mean time to {}, s, minus {baseline}", label(measure)),
        };
        Some(Self {
            title: format!("Differences in {}", label(measure)),
            axis,
            name: Some(format!("differences to {baseline}")),
            range: widened(&ends(&cells), false),
            reference: Some(0.0),
            cells,
        })
    }

    /// The number of an arm under a condition.
    pub(super) fn estimate(&self, place: CellPlace) -> Option<PlottedEstimate> {
        self.cells.get(&place)?.estimate
    }

    /// A chart for each condition, with a row for each arm.
    pub(super) fn intervals(
        &self,
        study: &Study<'_>,
        measure: &Measure,
    ) -> (Vec<ChartPanel>, String) {
        let row = |place: CellPlace| {
            let cell = self.cells.get(&place)?;
            let (label, arm) = study.arm(place);
            Some(IntervalRow {
                label,
                arm,
                estimate: cell.estimate,
                runs: cell.runs.clone(),
            })
        };
        study.panels(measure, row, |heading, rows| {
            let chart = Intervals {
                title: format!("{} {heading}", self.title),
                axis: self.axis.clone(),
                range: self.range,
                reference: self.reference,
                rows,
            };
            Chart::Intervals(chart)
        })
    }

    /// A chart over the values of a factor, with a line for each arm, and its heading; `None` if there is nothing to draw.
    pub(super) fn trend(
        &self,
        study: &Study<'_>,
        line: &FactorLine<'_>,
    ) -> Option<(String, Trend)> {
        let mut lines = Vec::new();
        for arm in 0..study.arms.len() {
            let mut points = Vec::new();
            for level in &line.levels {
                let cell = self.cells.get(&(level.condition, arm));
                if let Some(cell) = cell
                    && let Some(estimate) = cell.estimate
                {
                    points.push(TrendPoint {
                        x: level.x,
                        estimate,
                        runs: cell.runs.clone(),
                    });
                }
            }
            if !points.is_empty() || self.name.is_none() {
                let (label, arm) = study.arm((0, arm));
                lines.push(TrendLine { label, arm, points });
            }
        }
        if lines.is_empty() {
            return None;
        }

        let (factor, others) = (line.factor, &line.others);
        let heading = match (others.is_empty(), &self.name) {
            (true, None) => "Arms".to_owned(),
            (true, Some(name)) => capitalized(name),
            (false, None) => others.clone(),
            (false, Some(name)) => format!("{others}: {name}"),
        };
        let levels = line.levels.iter();
        let chart = Trend {
            title: format!("{} over {factor} {others}", self.title),
            x_axis: factor.to_owned(),
            y_axis: self.axis.clone(),
            levels: levels
                .map(|level| (level.x, level.name.to_owned()))
                .collect(),
            range: self.range,
            reference: self.reference,
            lines,
        };
        Some((heading, chart))
    }
}

/// The difference of a contrast, shares in percentage points; `None` if there is none.
pub(super) fn difference(contrast: &Contrast, of: Of) -> Option<statistics::Estimate> {
    match &contrast.difference {
        ArmDifference::Number { mean, .. } => Some(*mean),
        ArmDifference::Time { share, .. } if of == Of::Share => Some(share.scaled(100.0)),
        ArmDifference::Time {
            restricted_mean_s, ..
        } => Some(*restricted_mean_s),
        ArmDifference::NoPair | ArmDifference::NotFinite => None,
    }
}

/// The ends of all intervals, and all runs.
fn ends(cells: &BTreeMap<CellPlace, QuantityCell>) -> Vec<f64> {
    let estimates = cells.values().filter_map(|cell| cell.estimate);
    let mut ends: Vec<f64> = estimates.flat_map(|estimate| estimate.ends()).collect();
    ends.extend(cells.values().flat_map(|cell| &cell.runs));
    ends
}

/// A range with round ends around values. If it would begin not far above zero it begins there; one that is not of amounts has
/// zero in it.
pub(super) fn widened(values: &[f64], is_of_amounts: bool) -> (f64, f64) {
    let mut from = values.iter().copied().fold(f64::INFINITY, f64::min);
    let mut to = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !from.is_finite() || !to.is_finite() {
        return (0.0, 1.0);
    }

    if !is_of_amounts || (from >= 0.0 && from < 0.6 * to) {
        from = from.min(0.0);
        to = to.max(0.0);
    }
    round_range(from, to, 6)
}
