//! Expectations while a run is observed.

use config::units::Time;
use protocol::messages::{End, Standing, Verdict};
use protocol::time::tick_seconds;
use protocol::{Event, Tick};

use super::rule::{Expectation, Rule};
use crate::condition::{Evaluation, first_event, place, shortened};
use crate::{Observation, RunSetting};

/// A verdict and its reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Judgment {
    /// The verdict.
    pub verdict: Verdict,
    /// Why, in words.
    pub because: String,
}

/// Longest reason, characters, so that it fits into a line of the log.
const MAX_REASON_CHARS: usize = 600;

impl Judgment {
    fn new(verdict: Verdict, because: String) -> Self {
        Self {
            verdict,
            because: shortened(because, MAX_REASON_CHARS),
        }
    }
}

/// One expectation while a run is observed.
#[derive(Debug, Clone)]
pub struct Monitor {
    rule: Rule,
    condition: Evaluation,
    tick_s: f64,
    /// The last tick that was observed.
    now: Tick,
    /// The earliest event after which the condition has not held yet, if it is waited for.
    pending: Option<OpenCheck>,
    /// What ends a watch, if there are watches.
    until: Option<Until>,
    /// How many waits events have begun.
    asked: u64,
    /// How many times the condition held after an event.
    met: u64,
    /// The longest wait, ticks.
    longest: Tick,
}

/// What ends a watch.
#[derive(Debug, Clone)]
struct Until {
    condition: Evaluation,
    /// The condition that must not hold and this one, as each watch begins with them.
    fresh: (Evaluation, Evaluation),
}

#[derive(Debug, Clone)]
struct OpenCheck {
    since: Tick,
    /// The event in words.
    event: String,
}

impl Monitor {
    /// Begins to watch a run.
    #[must_use]
    pub fn new(expectation: &Expectation, setting: &RunSetting) -> Self {
        let rule = expectation.rule.clone();
        let condition = match &rule {
            Rule::Never(condition) | Rule::Always(condition) | Rule::Reach(condition) => condition,
            Rule::Eventually { condition, .. }
            | Rule::After { condition, .. }
            | Rule::NeverUntil { condition, .. } => condition,
        };
        let condition = Evaluation::new(condition, setting);
        let until = match &rule {
            Rule::NeverUntil { until, .. } => {
                let until = Evaluation::new(until, setting);
                Some(Until {
                    fresh: (condition.clone(), until.clone()),
                    condition: until,
                })
            }
            _ => None,
        };

        Self {
            condition,
            until,
            rule,
            tick_s: setting.tick_s,
            now: 0,
            pending: None,
            asked: 0,
            met: 0,
            longest: 0,
        }
    }

    /// Observes a tick. Ticks come in their order, from tick 0 on. Returns the judgment in the tick in which the expectation is
    /// decided; it must not be called after that.
    pub fn observe(&mut self, seen: &Observation<'_>) -> Option<Judgment> {
        self.now = seen.tick;
        if let Rule::NeverUntil { trigger, .. } = &self.rule {
            let triggered = first_event(trigger, seen);
            return self.observe_until(triggered, seen);
        }

        // In every tick, whether it is asked for or not: some conditions depend on the ticks before.
        let held = self.condition.holds(seen);

        match &self.rule {
            Rule::Never(_) => {
                let reason = held?;
                let here = self.place(seen.tick);
                Some(Judgment::new(Verdict::Fail, format!("{here}: {reason}")))
            }
            Rule::Always(_) => self.observe_always(held.is_some()),
            Rule::Reach(_) => {
                let reason = held?;
                let here = self.place(seen.tick);
                Some(Judgment::new(Verdict::Pass, format!("{here}: {reason}")))
            }
            Rule::Eventually { within, .. } => {
                let within = *within;
                self.observe_eventually(held, within)
            }
            Rule::After {
                trigger,
                within,
                unless,
                ..
            } => {
                let triggered = first_event(trigger, seen);
                let is_over = first_event(unless, seen).is_some();
                let within = *within;
                self.observe_after(held.is_some(), triggered, is_over, within)
            }
            Rule::NeverUntil { .. } => None,
        }
    }

    /// The tick of the event itself does not count. Conditions are evaluated only during a watch, each from their beginning.
    fn observe_until(
        &mut self,
        triggered: Option<String>,
        seen: &Observation<'_>,
    ) -> Option<Judgment> {
        let until = self.until.as_mut()?;
        if let Some(open) = &self.pending {
            let held = self.condition.holds(seen);
            if until.condition.holds(seen).is_some() {
                self.pending = None;
                self.met += 1;
            } else if let Some(reason) = held {
                let because = format!(
                    "{}: {reason}, after {}: {}",
                    self.place(seen.tick),
                    self.place(open.since),
                    open.event
                );
                return Some(Judgment::new(Verdict::Fail, because));
            }
        }

        if let (None, Some(event)) = (&self.pending, triggered) {
            let since = seen.tick;
            self.pending = Some(OpenCheck { since, event });
            self.asked += 1;
            (self.condition, until.condition) = until.fresh.clone();
        }
        None
    }

    fn observe_always(&self, holds: bool) -> Option<Judgment> {
        if holds {
            return None;
        }
        // Before a robot has reported, nothing is known of it.
        if self.condition.unknown().is_some() {
            return None;
        }

        let here = self.place(self.now);
        let because = format!("{here}: it does not hold");
        Some(Judgment::new(Verdict::Fail, because))
    }

    fn observe_eventually(&self, held: Option<String>, within: Time) -> Option<Judgment> {
        let here = self.place(self.now);
        if let Some(reason) = held {
            return Some(Judgment::new(Verdict::Pass, format!("{here}: {reason}")));
        }
        if self.now < self.limit(within) {
            return None;
        }
        let because = format!("{here}: it has not happened within {} s", within.0);
        Some(Judgment::new(Verdict::Fail, self.with_unknown(because)))
    }

    /// A tick is one instant: the condition counts for an event of the same tick, and so does an event that ends the wait.
    fn observe_after(
        &mut self,
        holds: bool,
        triggered: Option<String>,
        is_over: bool,
        within: Time,
    ) -> Option<Judgment> {
        // Waits do not overlap: the earliest event has the earliest limit, and what fulfills it
        // fulfills all after it as well.
        if self.pending.is_none() {
            let since = self.now;
            self.pending = triggered.map(|event| OpenCheck { since, event });
            self.asked += u64::from(self.pending.is_some());
        }
        let pending = self.pending.as_ref()?;

        let waited = self.now - pending.since;
        if holds {
            self.met += 1;
            self.longest = self.longest.max(waited);
        }
        // Before the limit is looked at: in the last tick in which it is not too late, it may still
        // happen.
        if holds || is_over {
            self.pending = None;
            return None;
        }
        if waited < self.limit(within) {
            return None;
        }

        let because = format!(
            "{}: it has not happened within {} s after {}: {}",
            self.place(self.now),
            within.0,
            self.place(pending.since),
            pending.event
        );
        Some(Judgment::new(Verdict::Fail, self.with_unknown(because)))
    }

    /// Judges what is open at the end of the run. A run that did not go on to its end, or not long enough, leaves it undecided.
    #[must_use]
    pub fn end(&self, end: End) -> Judgment {
        let here = self.place(self.now);
        let is_watch = self.until.is_some();
        // What is open is looked at first: even in a run that was long enough, its time was not over.
        if let Some(pending) = self.pending.as_ref().filter(|_| !is_watch) {
            let because = format!(
                "the run ended at {here}, and it had not happened after {}: {}",
                self.place(pending.since),
                pending.event
            );
            return Judgment::new(Verdict::Undecided, because);
        }
        if let Rule::Reach(_) = self.rule {
            let because = self.with_unknown(format!("it was not reached until {here}"));
            return Judgment::new(Verdict::Unreached, because);
        }
        if let Rule::Eventually { .. } = self.rule {
            let because = format!("the run ended at {here}, and it had not happened");
            return Judgment::new(Verdict::Undecided, self.with_unknown(because));
        }
        if end != End::Finished {
            let because = format!("the run was ended at {here}, before its time");
            return Judgment::new(Verdict::Undecided, because);
        }
        if let Some(unknown) = self.condition.unknown()
            && !matches!(self.rule, Rule::After { .. } | Rule::NeverUntil { .. })
        {
            return Judgment::new(Verdict::Undecided, unknown.to_owned());
        }

        if let Rule::After { .. } | Rule::NeverUntil { .. } = self.rule
            && self.asked == 0
        {
            let because = format!("nothing that it is expected after happened until {here}");
            return Judgment::new(Verdict::NotAsked, because);
        }

        let because = match &self.rule {
            Rule::Never(_) => format!("it did not happen until {here}"),
            Rule::NeverUntil { .. } => format!(
                "it did not happen in any watch ({}) until {here}",
                self.asked
            ),
            Rule::Always(_) => format!("it held until {here}"),
            Rule::After { .. } if self.met == 0 => {
                format!(
                    "each wait for it ({}) was ended by `unless` until {here}",
                    self.asked
                )
            }
            Rule::After { .. } | Rule::Eventually { .. } | Rule::Reach(_) => format!(
                "it happened each time ({}) until {here}, at the latest after {} s",
                self.met,
                tick_seconds(self.longest, self.tick_s)
            ),
        };
        Judgment::new(Verdict::Pass, because)
    }

    /// The last tick in which it is not too late, counted from the one from which the time is.
    fn limit(&self, within: Time) -> Tick {
        // Times and lengths of ticks are read from decimal fractions: within 0.3 s are three ticks of 0.1 s.
        (within.0 / self.tick_s + 1e-6).floor().max(0.0) as Tick
    }

    fn place(&self, tick: Tick) -> String {
        place(tick, self.tick_s)
    }

    fn with_unknown(&self, because: String) -> String {
        match self.condition.unknown() {
            Some(unknown) => format!("{because}; {unknown}"),
            None => because,
        }
    }
}

/// All expectations of a run while it is observed.
#[derive(Debug, Clone, Default)]
pub struct Monitors(Vec<Monitored>);

/// An expectation of a run, and its judgment when it is decided.
#[derive(Debug, Clone)]
struct Monitored {
    name: String,
    watch: Monitor,
    judgment: Option<Judgment>,
}

impl Monitors {
    /// Begins to watch a run.
    #[must_use]
    pub fn new(expectations: &[Expectation], setting: &RunSetting) -> Self {
        let mut watches = Vec::new();
        for expectation in expectations {
            watches.push(Monitored {
                name: expectation.name.clone(),
                watch: Monitor::new(expectation, setting),
                judgment: None,
            });
        }

        Self(watches)
    }

    /// Whether there are no expectations.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Observes a tick. Returns an event for each expectation that is decided in it.
    pub fn observe(&mut self, seen: &Observation<'_>) -> Vec<Event> {
        let mut events = Vec::new();
        for watched in self.open() {
            watched.judgment = watched.watch.observe(seen);
            events.extend(watched.event());
        }
        events
    }

    /// Judges what is open at the end of the run. Returns an event for each.
    pub fn end(&mut self, end: End) -> Vec<Event> {
        let mut events = Vec::new();
        for watched in self.open() {
            watched.judgment = Some(watched.watch.end(end));
            events.extend(watched.event());
        }
        events
    }

    /// How each expectation stands, in the order of the file.
    #[must_use]
    pub fn standings(&self) -> Vec<Standing> {
        let mut standings = Vec::with_capacity(self.0.len());
        for watched in &self.0 {
            standings.push(Standing {
                expectation: watched.name.clone(),
                verdict: watched.judgment.as_ref().map(|judgment| judgment.verdict),
            });
        }
        standings
    }

    /// Those that are not decided.
    fn open(&mut self) -> impl Iterator<Item = &mut Monitored> {
        let watches = self.0.iter_mut();
        watches.filter(|watched| watched.judgment.is_none())
    }
}

impl Monitored {
    fn event(&self) -> Option<Event> {
        let judgment = self.judgment.as_ref()?;
        Some(Event::Judged {
            expectation: self.name.clone(),
            verdict: judgment.verdict,
            because: judgment.because.clone(),
        })
    }
}
