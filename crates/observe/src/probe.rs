//! Takes a measure of a run, one observation after the other.

use std::collections::BTreeMap;

use protocol::pattern::matches;
use protocol::pattern::path_parts;
use protocol::time::time_s;
use protocol::{Event, RobotName, Tick};
use serde_json::Value;
use timeline::{StateKind, Timeline};

use crate::combine::{By, truth};
use crate::condition::Evaluation;
use crate::counter;
use crate::expression::Expression;
use crate::measure::{
    Between, Count, Measure, MeasureSource, Measured, Number, OfDurations, Parts, When,
};
use crate::quantity::{
    OfRobot, OfValues, QuantityGauge, RunQuantity, StateNames, Undefined, number as number_of_state,
};
use crate::{Observation, RunSetting};

/// Tables of a robot's summary that have entries for what occurred.
const OCCURRED: [&str; 4] = ["emotions_s", "behaviors_s", "entered", "sent"];

/// A measure of one run.
#[derive(Debug, Clone)]
pub struct Probe {
    /// The last tick. A run begins with 0.
    now: Tick,
    tick_s: f64,
    /// The last tick that is planned.
    planned: Tick,
    /// Whether the run ended before it, because its question was answered.
    has_ended_early: bool,
    tally: Tally,
}

/// When a run ended.
#[derive(Debug, Clone, Copy)]
struct RunEnding {
    tick_s: f64,
    /// Its last tick.
    now: Tick,
    /// The tick up to which it is known that nothing more happens in it. In a run that `end_when` has ended that is its planned end:
    /// what it did not reach before will not happen in it. To take it as at risk of happening after the early end would be to
    /// suppose that runs that end early and others do not differ (Fine and Gray 1999).
    horizon: Tick,
}

#[derive(Debug, Clone)]
enum Tally {
    Summary(String),
    Count(CountTally),
    Time(TimeTally),
    Between(BetweenTally),
    Share(ShareTally),
    Number(Box<NumberTally>),
    Stalled(StalledTally),
    Ratio(RatioTally),
    Expression(Expression),
}

impl Probe {
    /// A measure of a run that has not begun. The condition of the run begins and ends at these times, simulated seconds.
    #[must_use]
    pub fn new(measure: &Measure, setting: &RunSetting, condition_s: (f64, f64)) -> Self {
        Self {
            now: 0,
            tick_s: 0.0,
            planned: setting.ticks,
            has_ended_early: false,
            tally: Tally::new(&measure.kind, setting, condition_s),
        }
    }

    /// Takes a tick, or the end of the run, into account.
    pub fn observe(&mut self, observation: &Observation<'_>) {
        self.now = observation.tick;
        self.tick_s = observation.tick_s;
        let is_early = |event: &Event| {
            matches!(
                event,
                Event::End {
                    because: Some(_),
                    ..
                }
            )
        };
        self.has_ended_early |= observation.events.last().is_some_and(is_early);
        self.tally.observe(observation);
    }

    /// What the measure gives at the end of the run, the summary of which is given as JSON, and what the measures before it in the
    /// file give, by their names.
    #[must_use]
    pub fn measured(&self, summary: &Value, earlier: &BTreeMap<String, Measured>) -> Measured {
        let horizon = if self.has_ended_early {
            self.planned.max(self.now)
        } else {
            self.now
        };
        let end = RunEnding {
            tick_s: self.tick_s,
            now: self.now,
            horizon,
        };
        self.tally.measured(summary, earlier, end)
    }
}

impl Tally {
    fn new(source: &MeasureSource, setting: &RunSetting, condition_s: (f64, f64)) -> Self {
        match source {
            MeasureSource::Summary(path) => Self::Summary(path.clone()),
            MeasureSource::OfScenario(name) => Self::Summary(format!("measures.{name}.value")),
            MeasureSource::Count(count) => Self::Count(CountTally {
                definition: count.clone(),
                condition_s,
                count: 0,
            }),
            MeasureSource::Time(time) => Self::Time(TimeTally {
                after: time
                    .after
                    .as_ref()
                    .map(|after| Evaluation::new(after, setting)),
                to: Evaluation::new(&time.to, setting),
                begun: time.after.is_none().then_some(0),
                reached: None,
            }),
            MeasureSource::Between(between) => Self::Between(BetweenTally {
                definition: between.clone(),
                open: None,
                durations: Durations::default(),
            }),
            MeasureSource::Share(quantity) => Self::Share(ShareTally::new(quantity, setting)),
            MeasureSource::Number(number) => Self::Number(Box::new(NumberTally {
                definition: number.clone(),
                gauge: QuantityGauge::new(&number.quantity, setting),
                values: None,
                undefined: None,
            })),
            MeasureSource::Stalled(stalled) => Self::Stalled(StalledTally {
                lasting_s: stalled.lasting_s,
                values: counter::each(&stalled.progress, &setting.roster)
                    .into_iter()
                    .map(|(robot, variable)| (robot, variable, None))
                    .collect(),
                progress: 0,
            }),
            MeasureSource::Ratio(ratio) => {
                let tallies = |parts: &Parts| {
                    let parts = parts.0.iter();
                    parts
                        .map(|part| Self::new(part, setting, condition_s))
                        .collect()
                };
                Self::Ratio(RatioTally {
                    of: tallies(&ratio.of),
                    by: tallies(&ratio.by),
                })
            }
            MeasureSource::Expression(expression) => Self::Expression(expression.clone()),
        }
    }

    fn observe(&mut self, observation: &Observation<'_>) {
        match self {
            Self::Summary(_) | Self::Expression(_) => {}
            Self::Count(tally) => tally.observe(observation),
            Self::Time(tally) => tally.observe(observation),
            Self::Between(tally) => tally.observe(observation),
            Self::Share(tally) => tally.observe(observation),
            Self::Number(tally) => tally.observe(observation),
            Self::Stalled(tally) => tally.observe(observation),
            Self::Ratio(tally) => {
                for part in tally.of.iter_mut().chain(&mut tally.by) {
                    part.observe(observation);
                }
            }
        }
    }

    fn measured(
        &self,
        summary: &Value,
        earlier: &BTreeMap<String, Measured>,
        end: RunEnding,
    ) -> Measured {
        match self {
            Self::Summary(path) => summary_number(summary, path),
            Self::Count(tally) => Measured::from(tally.count as f64),
            Self::Time(tally) => tally.measured(end),
            Self::Between(tally) => tally.measured(end.now, end.tick_s),
            Self::Share(tally) => tally.measured(end.now),
            Self::Number(tally) => tally.measured(end.now, end.tick_s),
            Self::Stalled(tally) => tally.measured(end),
            Self::Ratio(tally) => {
                let take = |part: &Tally| part.measured(summary, earlier, end);
                ratio(
                    tally.of.iter().map(take).collect(),
                    tally.by.iter().map(take).collect(),
                )
            }
            Self::Expression(expression) => {
                let value = expression.value(&|name| number_of_measure(earlier, name));
                value.map_or_else(|reason| Measured::Missing { reason }, Measured::from)
            }
        }
    }
}

/// The number of an earlier measure, or why there is none.
fn number_of_measure(earlier: &BTreeMap<String, Measured>, name: &str) -> Result<f64, String> {
    match earlier.get(name) {
        Some(measured) => measured
            .value()
            .ok_or_else(|| format!("`{name}` is {measured}")),
        None => Err(format!("`{name}` was not measured")),
    }
}

#[derive(Debug, Clone)]
struct RatioTally {
    of: Vec<Tally>,
    by: Vec<Tally>,
}

/// The sum of numbers over the sum of others, where there are all of them.
fn ratio(of: Vec<Measured>, by: Vec<Measured>) -> Measured {
    let missing = |reason: String| Measured::Missing { reason };
    match (total(of), total(by)) {
        (Err(none), _) => missing(format!("what is divided is {none}")),
        (_, Err(none)) => missing(format!("what it is divided by is {none}")),
        (_, Ok(0.0)) => missing("it would be divided by 0".to_owned()),
        (Ok(of), Ok(by)) => Measured::from(of / by),
    }
}

/// The sum of numbers, or the first that is not a number.
fn total(measured: Vec<Measured>) -> Result<f64, Measured> {
    let mut total = 0.0;
    for one in measured {
        total += one.value().ok_or(one)?;
    }
    Ok(total)
}

fn summary_number(summary: &Value, path: &str) -> Measured {
    match sum(summary, &path_parts(path)) {
        Some(number) => Measured::from(number),
        None => Measured::Missing {
            reason: format!("the summary of the run has no number `{path}`"),
        },
    }
}

fn no_variable(robot: &RobotName, variable: &str) -> Measured {
    Measured::Missing {
        reason: format!("{robot} has no number `{variable}` among its state variables"),
    }
}

/// The number at a path, or the sum over all entries that match where a part is a pattern.
fn sum(value: &Value, path: &[&str]) -> Option<f64> {
    let Some((first, rest)) = path.split_first() else {
        return value.as_f64();
    };

    let table = value.as_object()?;

    if let Some(next) = table.get(*first) {
        return match (next, rest) {
            // What did not occur has no entry.
            (Value::Object(occurred), [word]) if OCCURRED.contains(first) && *word != "*" => {
                occurred.get(*word).map_or(Some(0.0), Value::as_f64)
            }
            (next, rest) => sum(next, rest),
        };
    }
    if !first.contains(['*', '{']) {
        return None;
    }

    let mut total = 0.0;
    for (name, entry) in table {
        if matches(first, name) {
            total += sum(entry, rest)?;
        }
    }
    Some(total)
}

/// The last value of a robot's variable, if it is a number or a flag, which is 1 or 0.
fn number_of(observation: &Observation<'_>, robot: &RobotName, variable: &str) -> Option<f64> {
    number_of_state((observation.state)(robot)?, variable)
}

#[derive(Debug, Clone)]
struct CountTally {
    definition: Count,
    /// Begin and end of the condition, simulated seconds.
    condition_s: (f64, f64),
    count: u64,
}

impl CountTally {
    fn observe(&mut self, observation: &Observation<'_>) {
        let (from_s, until_s) = self.condition_s;
        let is_counting = match self.definition.when {
            None => true,
            Some(When::During) => (from_s..until_s).contains(&observation.time_s()),
            Some(When::After) => observation.time_s() >= until_s,
        };
        if !is_counting {
            return;
        }

        for event in observation.events {
            if self.definition.pattern.matches(event) {
                self.count += 1;
            }
        }
    }
}

#[derive(Debug, Clone)]
struct TimeTally {
    after: Option<Evaluation>,
    to: Evaluation,
    /// In which tick the time began, and in which it ended.
    begun: Option<Tick>,
    reached: Option<Tick>,
}

impl TimeTally {
    fn observe(&mut self, observation: &Observation<'_>) {
        if self.reached.is_some() {
            return;
        }

        // In every tick, also before the time begins: some conditions depend on the ticks before.
        let is_there = self.to.holds(observation).is_some();
        if let Some(after) = &mut self.after
            && self.begun.is_none()
            && after.holds(observation).is_some()
        {
            self.begun = Some(observation.tick);
        }
        if self.begun.is_some() && is_there {
            self.reached = Some(observation.tick);
        }
    }

    fn measured(&self, end: RunEnding) -> Measured {
        let unknown = match (self.begun, self.reached, &self.after) {
            (None, _, Some(after)) => after.unknown(),
            (_, None, _) => self.to.unknown(),
            _ => None,
        };
        if let Some(unknown) = unknown {
            let reason = unknown.to_owned();
            return Measured::Missing { reason };
        }
        match (self.begun, self.reached) {
            (None, _) => Measured::NotAtRisk,
            (Some(begun), Some(reached)) => Measured::Reached {
                time_s: time_s(reached - begun, end.tick_s),
            },
            (Some(begun), None) => Measured::NotReached {
                waited_s: time_s(end.horizon - begun, end.tick_s),
            },
        }
    }
}

#[derive(Debug, Clone)]
struct BetweenTally {
    definition: Between,
    /// In which tick the pair that is open began.
    open: Option<Tick>,
    durations: Durations,
}

/// How long pairs lasted, in ticks: sums of seconds would not be exact.
#[derive(Debug, Clone, Copy, Default)]
struct Durations {
    count: u64,
    sum: Tick,
    max: Tick,
}

impl Durations {
    fn add(&mut self, duration: Tick) {
        self.count += 1;
        self.sum += duration;
        self.max = self.max.max(duration);
    }

    /// A number of them; `None` if it does not exist.
    fn number(&self, number: OfDurations, tick_s: f64) -> Option<f64> {
        let has_any = self.count > 0;
        let sum_s = time_s(self.sum, tick_s);
        match number {
            OfDurations::Mean => has_any.then(|| sum_s / self.count as f64),
            OfDurations::Max => has_any.then(|| time_s(self.max, tick_s)),
            OfDurations::Sum => Some(sum_s),
            OfDurations::Count => Some(self.count as f64),
        }
    }
}

impl BetweenTally {
    fn observe(&mut self, observation: &Observation<'_>) {
        for event in observation.events {
            if let Some(begun) = self.open
                && self.definition.end.matches(event)
            {
                self.durations.add(observation.tick - begun);
                self.open = None;
            }
            if self.open.is_none() && self.definition.begin.matches(event) {
                self.open = Some(observation.tick);
            }
        }
    }

    fn measured(&self, now: Tick, tick_s: f64) -> Measured {
        let definition = &self.definition;
        let mut durations = self.durations;
        let mut is_finished = true;
        if let Some(begun) = self.open
            && (definition.until_end || definition.number != OfDurations::Count)
        {
            durations.add(now - begun);
            is_finished = definition.until_end;
        }

        match durations.number(definition.number, tick_s) {
            None => Measured::NoPair,
            Some(value) if is_finished => Measured::from(value),
            Some(at_least) => Measured::Unfinished { at_least },
        }
    }
}

/// Robots in one of some states: one that is lost is in none of them until it takes part again.
#[derive(Debug, Clone)]
struct ShareTally {
    kind: StateKind,
    names: Vec<String>,
    by: By,
    robots: Vec<RobotName>,
    timeline: Timeline,
    /// The number of the robots since this tick.
    value: f64,
    since: Tick,
    /// Its sum over the ticks before.
    sum: f64,
}

impl ShareTally {
    fn new(quantity: &RunQuantity, setting: &RunSetting) -> Self {
        let RunQuantity::Each {
            of: OfRobot::State(states),
            by,
            ..
        } = quantity
        else {
            unreachable!("a share is one of states");
        };
        let (kind, names) = match states {
            StateNames::Emotions(names) => (StateKind::Emotion, names),
            StateNames::Behaviors(names) => (StateKind::Behavior, names),
        };
        let robots = quantity.robots(setting);
        Self {
            kind,
            names: names.clone(),
            // Of one robot it is the same whichever way.
            by: by.unwrap_or(By::Mean),
            timeline: Timeline::new(&robots),
            robots,
            value: 0.0,
            since: 0,
            sum: 0.0,
        }
    }

    fn observe(&mut self, observation: &Observation<'_>) {
        if observation.events.is_empty() {
            return;
        }

        self.timeline.tick(observation.tick, observation.events);
        let values = self.robots.iter().map(|robot| truth(self.is_in(robot)));
        // A team without a robot is refused before the run.
        let value = self.by.combine(values).unwrap_or(0.0);
        if value.to_bits() != self.value.to_bits() {
            self.sum = self.sum_at(observation.tick);
            self.since = observation.tick;
            self.value = value;
        }
    }

    fn is_in(&self, robot: &RobotName) -> bool {
        let state = self.timeline.state(robot, self.kind);
        let is_named = state.is_some_and(|state| self.names.iter().any(|name| name == state));
        is_named && self.timeline.lost_since(robot).is_none()
    }

    fn sum_at(&self, now: Tick) -> f64 {
        self.sum + self.value * (now - self.since) as f64
    }

    fn measured(&self, now: Tick) -> Measured {
        if now == 0 {
            let reason = "a run that ends with tick 0 lasts for no time".to_owned();
            return Measured::Missing { reason };
        }
        Measured::from(self.sum_at(now) / now as f64)
    }
}

#[derive(Debug, Clone)]
struct NumberTally {
    definition: Number,
    gauge: QuantityGauge,
    /// `None` before the number has a value.
    values: Option<Values>,
    /// Why it has no value in the last tick.
    undefined: Option<Undefined>,
}

#[derive(Debug, Clone, Copy)]
struct Values {
    /// The tick in which the variable got its first value.
    begun: Tick,
    last: f64,
    /// The tick in which it got its last value.
    since: Tick,
    max: f64,
    min: f64,
    /// Sum over the ticks before `since`.
    sum: f64,
}

impl Values {
    fn sum(&self, now: Tick) -> f64 {
        self.sum + self.last * (now - self.since) as f64
    }
}

impl NumberTally {
    fn observe(&mut self, observation: &Observation<'_>) {
        let value = match self.gauge.value(observation) {
            Ok(value) => value,
            Err(undefined) => {
                self.undefined = Some(undefined);
                return;
            }
        };

        self.undefined = None;
        let now = observation.tick;
        let values = self.values.get_or_insert(Values {
            begun: now,
            last: value,
            since: now,
            max: value,
            min: value,
            sum: 0.0,
        });
        if value.to_bits() != values.last.to_bits() {
            values.sum = values.sum(now);
            values.last = value;
            values.since = now;
            values.max = values.max.max(value);
            values.min = values.min.min(value);
        }
    }

    fn measured(&self, now: Tick, tick_s: f64) -> Measured {
        let taken = self.definition.taken;
        let missing = |undefined: &Undefined| Measured::Missing {
            reason: undefined.to_string(),
        };
        // A variable keeps its value until the next report. A share of nothing has none.
        let undefined = self.undefined.as_ref();
        if let Some(undefined) = undefined.filter(|undefined| undefined.is_of_values())
            && taken == OfValues::End
        {
            return missing(undefined);
        }
        let Some(values) = self.values else {
            return missing(undefined.unwrap_or(&Undefined::NoRobot));
        };

        let ticks = now - values.begun;
        Measured::from(match taken {
            OfValues::Mean if ticks > 0 => values.sum(now) / ticks as f64,
            OfValues::End | OfValues::Mean => values.last,
            OfValues::Max => values.max,
            OfValues::Min => values.min,
            OfValues::Area => values.sum(now) * tick_s,
        })
    }
}

#[derive(Debug, Clone)]
struct StalledTally {
    /// Shortest time without progress that counts, seconds.
    lasting_s: f64,
    /// The variables of progress, each with its robot and its last value. A robot that is lost makes no progress.
    values: Vec<(RobotName, String, Option<f64>)>,
    /// The tick of the last progress.
    progress: Tick,
}

impl StalledTally {
    fn observe(&mut self, observation: &Observation<'_>) {
        for (robot, variable, before) in &mut self.values {
            let Some(now) = number_of(observation, robot, variable) else {
                continue;
            };
            if before.is_some_and(|before| now > before) {
                self.progress = observation.tick;
            }
            *before = Some(now);
        }
    }

    fn measured(&self, end: RunEnding) -> Measured {
        for (robot, variable, value) in &self.values {
            if value.is_none() {
                return no_variable(robot, variable);
            }
        }

        if time_s(end.now - self.progress, end.tick_s) < self.lasting_s {
            return Measured::NotReached {
                waited_s: time_s(end.horizon, end.tick_s),
            };
        }
        Measured::Reached {
            time_s: time_s(self.progress, end.tick_s),
        }
    }
}

#[cfg(test)]
mod tests;
