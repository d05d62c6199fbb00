//! The results of an experiment as a report needs them: by condition, arm and measure.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use observe::{Measure, Measured};
use pictures::{Chart, ChartPanel, PlottedEstimate};
use statistics::CensoredTime;

use super::limits::panels;
use experiments::{
    Arm, ArmMeasure, Condition, Contrast, Estimated, Results, SHOWN_P, Shown, UnitOutcome,
};

/// Most arms that are shown.
const MAX_ARMS: usize = 24;

/// How many values a factor has of which lines are drawn.
const LINE_LEVELS: RangeInclusive<usize> = 3..=60;

/// The results of an experiment.
pub(super) struct Study<'a> {
    pub(super) results: &'a Results,
    pub(super) conditions: &'a [Condition],
    /// The arms that are shown.
    pub(super) arms: &'a [Arm],
    /// Names of the factors.
    pub(super) factors: Vec<&'a str>,
    /// The estimates, by measure, condition and arm.
    estimates: BTreeMap<[String; 3], ArmMeasure>,
    pub(super) contrasts: Vec<Contrast>,
    /// The runs of an arm under a condition, by their indices.
    cells: BTreeMap<(usize, usize), Vec<&'a UnitOutcome>>,
}

/// A cell of the design: indices of a condition and an arm.
pub(super) type CellPlace = (usize, usize);

impl<'a> Study<'a> {
    pub(super) fn of(results: &'a Results) -> Self {
        let experiment = &results.plan.experiment;
        let conditions = results.plan.conditions();
        let mut cells: BTreeMap<CellPlace, Vec<&UnitOutcome>> = BTreeMap::new();
        for outcome in &results.outcomes {
            let condition = conditions
                .iter()
                .position(|one| one.name == outcome.condition);
            let arm = experiment
                .arms
                .iter()
                .position(|one| one.name == outcome.arm);
            if let Some(condition) = condition
                && let Some(arm) = arm
            {
                cells.entry((condition, arm)).or_default().push(outcome);
            }
        }

        let mut estimates = BTreeMap::new();
        for cell in results.estimates() {
            let place = [
                cell.measure.clone(),
                cell.condition.clone(),
                cell.arm.clone(),
            ];
            estimates.insert(place, cell);
        }

        let first = conditions.first().map(|condition| &condition.levels);
        let factors = first.into_iter().flatten().map(|(name, _)| name.as_str());
        Self {
            results,
            conditions,
            arms: &experiment.arms[..experiment.arms.len().min(MAX_ARMS)],
            factors: factors.collect(),
            estimates,
            contrasts: results.contrasts(),
            cells,
        }
    }

    /// The measures of the experiment.
    pub(super) fn measures(&self) -> &'a [Measure] {
        &self.results.plan.experiment.measures
    }

    /// The measures that have a section, in their order.
    pub(super) fn shown_measures(&self) -> Vec<&'a Measure> {
        let experiment = &self.results.plan.experiment;
        let named = experiment.report.measures.iter();
        named
            .filter_map(|name| self.measures().iter().find(|one| one.name == *name))
            .collect()
    }

    /// Whether the report has a part.
    pub(super) fn shows(&self, part: Shown) -> bool {
        self.results.plan.experiment.report.shows(part)
    }

    /// The factor that its experiment file puts on the horizontal axis, by its place.
    pub(super) fn named_axis(&self) -> Option<usize> {
        let name = self.results.plan.experiment.report.x.as_ref()?;
        self.factors.iter().position(|factor| factor == name)
    }

    /// All cells of the design, arm by arm under each condition.
    pub(super) fn places(&self) -> Vec<CellPlace> {
        let conditions = 0..self.conditions.len();
        let under = |condition| (0..self.arms.len()).map(move |arm| (condition, arm));
        conditions.flat_map(under).collect()
    }

    /// A panel for each condition under which an arm has something to show, as many as are allowed, and a sentence about those
    /// that are left out. `of` is what an arm shows, and `draw` draws what those of a condition show.
    /// Conditions under which the measure is zero in all arms are left out, too.
    pub(super) fn panels<T>(
        &self,
        measure: &Measure,
        of: impl Fn(CellPlace) -> Option<T>,
        draw: impl Fn(&str, Vec<T>) -> Chart,
    ) -> (Vec<ChartPanel>, String) {
        let mut shown = Vec::new();
        let mut zero = Vec::new();
        for (condition, name) in self.conditions.iter().enumerate() {
            if self.is_zero_under(measure, condition) {
                zero.push(self.heading(name));
                continue;
            }
            let arms = 0..self.arms.len();
            let of_arms: Vec<T> = arms.filter_map(|arm| of((condition, arm))).collect();
            if !of_arms.is_empty() {
                shown.push((self.heading(name), of_arms));
            }
        }
        let (panels, mut sentence) = panels("conditions", shown, |(heading, of_arms)| {
            let chart = draw(&heading, of_arms);
            ChartPanel::new(heading, chart)
        });
        if !zero.is_empty() {
            let what = match measure.is_time() {
                true => format!("no run has {}", label(measure)),
                false => format!("{} is zero in every run", label(measure)),
            };
            sentence += &format!(" Where {what}, nothing is drawn: {}.", zero.join("; "));
        }
        (panels, sentence)
    }

    /// Whether a measure is zero in every run that has it, or no run has its event.
    pub(super) fn is_zero(&self, measure: &Measure) -> bool {
        let mut conditions = 0..self.conditions.len();
        conditions.all(|condition| self.is_zero_under(measure, condition))
    }

    /// Whether a measure is zero in every run under a condition that has it, in all arms.
    fn is_zero_under(&self, measure: &Measure, condition: usize) -> bool {
        let mut has_runs = false;
        for arm in 0..self.arms.len() {
            let place = (condition, arm);
            let (count, is_zero) = if measure.is_time() {
                let times = self.times(measure, place);
                (times.len(), times.iter().all(|time| !time.is_event))
            } else {
                let numbers = self.numbers(measure, place);
                (numbers.len(), numbers.iter().all(|value| *value == 0.0))
            };
            has_runs |= count > 0;
            if !is_zero {
                return false;
            }
        }
        has_runs
    }

    /// The differences of the runs of a cell to those of the baseline with the same seeds, in the order of the seeds.
    pub(super) fn paired_numbers(
        &self,
        measure: &Measure,
        (condition, arm): CellPlace,
    ) -> Vec<f64> {
        let baseline = self.results.plan.experiment.baseline.as_ref();
        let Some(baseline) = self.arms.iter().position(|arm| Some(&arm.name) == baseline) else {
            return Vec::new();
        };
        let by_seed = |arm| {
            let mut numbers = BTreeMap::new();
            for run in self.runs((condition, arm)) {
                let measured = run.measures.get(&measure.name);
                if let Some(value) = measured.and_then(Measured::value) {
                    numbers.insert(run.seed, value);
                }
            }
            numbers
        };

        let of_baseline = by_seed(baseline);
        let pairs = by_seed(arm).into_iter();
        pairs
            .filter_map(|(seed, value)| Some(value - of_baseline.get(&seed)?))
            .filter(|difference| difference.is_finite())
            .collect()
    }

    /// The name of the arm of a cell, and the index by which it has its color and marker: that of the baseline is the first one.
    pub(super) fn arm(&self, (_, arm): CellPlace) -> (String, usize) {
        let baseline = self.results.plan.experiment.baseline.as_ref();
        let mut arms = self.arms.iter();
        let look = match arms.position(|one| Some(&one.name) == baseline) {
            Some(baseline) if arm == baseline => 0,
            Some(baseline) if arm < baseline => arm + 1,
            _ => arm,
        };
        (self.arms[arm].name.clone(), look)
    }

    /// The condition and the arm of a cell, for a table.
    pub(super) fn place_cells(&self, (condition, arm): CellPlace) -> [pictures::Cell; 2] {
        let condition = self.heading(&self.conditions[condition]);
        [condition.into(), self.arms[arm].name.as_str().into()]
    }

    /// The runs of an arm under a condition.
    pub(super) fn runs(&self, place: CellPlace) -> &[&'a UnitOutcome] {
        self.cells.get(&place).map_or(&[], Vec::as_slice)
    }

    /// The numbers of the runs of a cell.
    pub(super) fn numbers(&self, measure: &Measure, place: CellPlace) -> Vec<f64> {
        let runs = self.runs(place).iter();
        runs.filter_map(|run| run.measures.get(&measure.name))
            .filter_map(Measured::value)
            .collect()
    }

    /// The times of the runs of a cell.
    pub(super) fn times(&self, measure: &Measure, place: CellPlace) -> Vec<CensoredTime> {
        let mut times = Vec::new();
        for run in self.runs(place) {
            let measured = run.measures.get(&measure.name);
            if let Some((time_s, is_event)) = measured.and_then(Measured::time) {
                times.push(CensoredTime { time_s, is_event });
            }
        }
        times
    }

    /// The estimate of a measure; `None` without runs.
    pub(super) fn cell(
        &self,
        measure: &Measure,
        (condition, arm): CellPlace,
    ) -> Option<&ArmMeasure> {
        let condition = self.conditions[condition].name.clone();
        let arm = self.arms[arm].name.clone();
        self.estimates.get(&[measure.name.clone(), condition, arm])
    }

    /// Whether a measure is a time that every run at risk has reached: then the times are numbers, and the percentage of runs with its
    /// event is 100 everywhere.
    pub(super) fn is_always_reached(&self, measure: &Measure) -> bool {
        let measured = self.results.outcomes.iter();
        let mut times = measured
            .filter_map(|outcome| outcome.measures.get(&measure.name)?.time())
            .peekable();
        measure.is_time() && times.peek().is_some() && times.all(|(_, is_event)| is_event)
    }

    /// What is estimated of a measure: that of numbers where every run has a time.
    pub(super) fn estimated(&self, measure: &Measure, place: CellPlace) -> Option<Estimated> {
        let cell = self.cell(measure, place)?;
        if self.is_always_reached(measure) {
            return Some(Estimated::of_numbers(&self.numbers(measure, place)));
        }
        Some(cell.estimate.clone())
    }

    /// The mean of a measure, or the percentage of runs at risk with its event by their end; `None` where there is no
    /// finite number.
    pub(super) fn estimate(&self, measure: &Measure, place: CellPlace) -> Option<PlottedEstimate> {
        let estimate = match self.estimated(measure, place)? {
            Estimated::Number { mean, .. } => mean,
            Estimated::Time { share, .. } => share.scaled(100.0),
        };
        estimate.value.is_finite().then(|| drawn(&estimate))
    }

    /// The contrast of an arm with the baseline.
    pub(super) fn contrast(
        &self,
        measure: &Measure,
        (condition, arm): CellPlace,
    ) -> Option<&Contrast> {
        self.contrasts.iter().find(|contrast| {
            contrast.measure == measure.name
                && contrast.condition == self.conditions[condition].name
                && contrast.arm == self.arms[arm].name
        })
    }

    /// The contrasts of a measure.
    pub(super) fn contrasts_of(&self, measure: &Measure) -> Vec<&Contrast> {
        let all = self.contrasts.iter();
        all.filter(|contrast| contrast.measure == measure.name)
            .collect()
    }

    /// The name of a condition with those of its factors; empty if there is only one condition without a name.
    pub(super) fn heading(&self, condition: &Condition) -> String {
        if condition.levels.is_empty() {
            return condition.name.clone();
        }
        named(&condition.levels)
    }

    /// The heading of the condition of this name.
    pub(super) fn heading_of(&self, name: &str) -> String {
        let condition = self
            .conditions
            .iter()
            .find(|condition| condition.name == name);
        condition.map_or_else(|| name.to_owned(), |condition| self.heading(condition))
    }
}

/// The conditions along a factor whose values are numbers.
pub(super) struct FactorLine<'a> {
    /// The factor.
    pub(super) factor: &'a str,
    /// The values of the other factors in words; empty if there are none.
    pub(super) others: String,
    /// The conditions, with growing values of the factor.
    pub(super) levels: Vec<Level<'a>>,
}

/// A value of a factor.
pub(super) struct Level<'a> {
    pub(super) x: f64,
    pub(super) name: &'a str,
    /// Index of the condition that has it.
    pub(super) condition: usize,
}

/// The conditions along the factor that the experiment file names, or the only factor if its values are numbers and enough for
/// a line: a line for each combination of the other factors. Otherwise there are none.
pub(super) fn lines<'a>(study: &Study<'a>) -> Vec<FactorLine<'a>> {
    let is_only = study.factors.len() == 1 && LINE_LEVELS.contains(&study.conditions.len());
    let Some(factor) = study.named_axis().or(is_only.then_some(0)) else {
        return Vec::new();
    };

    let mut lines: Vec<FactorLine<'_>> = Vec::new();
    for (index, condition) in study.conditions.iter().enumerate() {
        let mut others = condition.levels.clone();
        others.remove(factor);
        let others = named(&others);
        let (_, name) = &condition.levels[factor];
        let Some(x) = level_number(name) else {
            return Vec::new();
        };

        let level = Level {
            x,
            name,
            condition: index,
        };
        match lines.iter_mut().find(|line| line.others == others) {
            Some(line) => line.levels.push(level),
            None => lines.push(FactorLine {
                factor: study.factors[factor],
                others,
                levels: vec![level],
            }),
        }
    }
    for line in &mut lines {
        line.levels.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    lines
}

/// Names levels of factors. A named condition stands for itself.
fn named<'a>(levels: impl IntoIterator<Item = &'a (String, String)>) -> String {
    let mut parts = Vec::new();
    for (factor, level) in levels {
        if factor == "condition" {
            parts.push(level.clone());
        } else {
            parts.push(format!("{factor} {level}"));
        }
    }
    parts.join(", ")
}

/// An estimate as charts take it.
pub(super) fn drawn(estimate: &statistics::Estimate) -> PlottedEstimate {
    PlottedEstimate {
        value: estimate.value,
        interval: estimate.bounds(),
        n: estimate.n,
        is_filled: true,
    }
}

/// Whether a contrast is stated as a difference.
pub(super) fn is_shown(contrast: &Contrast) -> bool {
    contrast.p_holm.is_some_and(|p| p < SHOWN_P)
}

/// Name of a measure for people.
pub(super) fn label(measure: &Measure) -> &str {
    measure.column.as_deref().unwrap_or(&measure.name)
}

/// Name and unit of the axis of a measure.
pub(super) fn axis(study: &Study<'_>, measure: &Measure) -> String {
    if study.is_always_reached(measure) {
        return format!("time to {}, s", label(measure));
    }
    if measure.is_time() {
        return format!("runs with {}, %", label(measure));
    }
    match &measure.unit {
        Some(unit) => format!("{}, {unit}", label(measure)),
        None => label(measure).to_owned(),
    }
}

/// The number that the value of a factor begins with.
fn level_number(level: &str) -> Option<f64> {
    level.split_whitespace().next()?.parse().ok()
}
