//! The summary of a run, from which the table at its end and all reports are made.

mod network;

use std::collections::BTreeMap;
use std::time::Instant;

use observe::Measured;
use protocol::event::WaitedFor;
use protocol::messages::{End, StateVariables, Verdict};
use protocol::time::time_s;
use protocol::{Event, RobotName, RunName, Tick};
use scenario::Scenario;
use serde::{Deserialize, Serialize};
use timeline::{Counts, Span, Timeline};

pub use network::{CutSummary, LinkSummary, NetworkSummary, QueryReach};

use crate::seal;

/// `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The run.
    pub run: RunName,
    /// Seed.
    pub seed: u64,
    /// Version of the simulator.
    pub version: String,
    /// How it ended; absent during the run.
    pub end: Option<End>,
    /// If it has finished before its last tick: what of the scenario's `end_when` held, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_because: Option<String>,
    /// If it was aborted, the robots for which the clock waited then.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub waited_for: Vec<WaitedFor>,
    /// Complete ticks after tick 0.
    pub ticks: Tick,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Number of guests.
    pub guests: usize,
    /// What guests did that enter and leave; left out where none does.
    #[serde(default, skip_serializing_if = "GuestPassages::is_empty")]
    pub guest_motion: GuestPassages,
    /// Digest of the run.
    pub digest: String,
    /// The robots.
    pub robots: BTreeMap<RobotName, RobotSummary>,
    /// Metrics of the network.
    #[serde(default)]
    pub network: NetworkSummary,
    /// The verdicts on what the scenario expects of the run, by the names of the expectations.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub expectations: BTreeMap<String, ExpectationVerdict>,
    /// The measures of the scenario, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub measures: BTreeMap<String, Measured>,
    /// Wall-clock times; they differ from run to run.
    pub wall: WallSummary,
    #[serde(skip)]
    begun: Option<Instant>,
    #[serde(skip)]
    timeline: Timeline,
    /// Times are counted in ticks: sums of seconds would not be exact.
    #[serde(skip)]
    counts: Counts,
}

/// A verdict on an expectation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExpectationVerdict {
    /// The verdict.
    pub verdict: Verdict,
    /// The tick in which it was decided.
    pub tick: Tick,
    /// Why, in words.
    pub because: String,
}

/// What guests did that enter and leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GuestPassages {
    /// How often a guest entered the field, those included that were there at the beginning.
    pub entered: u64,
    /// How often one left it.
    pub left: u64,
    /// Ticks in which a body kept a recorded person from where the record has it, summed over people.
    pub held_ticks: u64,
}

impl GuestPassages {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Metrics of one robot.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RobotSummary {
    /// Simulated seconds in each emotion, without those in which it took no part.
    pub emotions_s: BTreeMap<String, f64>,
    /// Simulated seconds in each behavior, without those in which it took no part.
    pub behaviors_s: BTreeMap<String, f64>,
    /// How often it entered each behavior, the first one included.
    pub entered: BTreeMap<String, u64>,
    /// Moves that were blocked.
    pub blocked: u64,
    /// Commands that it sent, by text.
    pub sent: BTreeMap<String, u64>,
    /// Commands that it received.
    pub received: u64,
    /// Commands to it that were lost.
    pub dropped: u64,
    /// Ticks that it missed.
    pub missed: u64,
    /// Incarnations after the first.
    pub returns: u64,
    /// Its last state variables.
    pub state_variables: StateVariables,
}

/// Wall-clock times and counts.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WallSummary {
    /// Duration of the run, seconds.
    pub elapsed_s: f64,
    /// Robots for which the clock was held long enough to be reported.
    pub held_up_by: BTreeMap<RobotName, HeldUp>,
    /// Messages that were ignored, by reason.
    pub ignored: BTreeMap<String, u64>,
    /// Seal of the whole summary, which has no other field that differs between runs that are the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seal: Option<String>,
}

/// How long the clock was held for a robot.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct HeldUp {
    /// Ticks in which the clock was held for it.
    pub ticks: u64,
    /// Total wait, seconds.
    pub waited_s: f64,
    /// Longest wait, seconds.
    pub longest_s: f64,
}

/// Paths of the numbers of a summary; `*` is any name or word.
const NUMBERS: [&str; 33] = [
    "seed",
    "ticks",
    "time_s",
    "guests",
    "guest_motion.entered",
    "guest_motion.left",
    "guest_motion.held_ticks",
    "robots.*.emotions_s.*",
    "robots.*.behaviors_s.*",
    "robots.*.entered.*",
    "robots.*.blocked",
    "robots.*.sent.*",
    "robots.*.received",
    "robots.*.dropped",
    "robots.*.missed",
    "robots.*.returns",
    "robots.*.state_variables.*",
    "network.links.*.sent",
    "network.links.*.delivered",
    "network.links.*.dropped.*",
    "network.links.*.delayed",
    "network.links.*.duplicated",
    "network.links.*.unreachable_ticks",
    "network.links.*.longest_stale_s",
    "expectations.*.tick",
    "measures.*.value",
    "measures.*.time_s",
    "measures.*.waited_s",
    "measures.*.at_least",
    "wall.elapsed_s",
    "wall.held_up_by.*.ticks",
    "wall.held_up_by.*.waited_s",
    "wall.held_up_by.*.longest_s",
];

impl Summary {
    /// Checks that the path of a number, whose parts are joined by `.`, can be one of a summary.
    ///
    /// # Errors
    /// What there is instead.
    pub fn check_path(path: &str) -> Result<(), String> {
        let is_of = |number: &str| {
            let wanted: Vec<&str> = number.split('.').collect();
            let given = protocol::pattern::path_parts(path);
            let mut parts = wanted.iter().zip(&given);
            wanted.len() == given.len()
                && parts.all(|(wanted, given)| *wanted == "*" || wanted == given)
        };
        if NUMBERS.iter().any(|number| is_of(number)) {
            return Ok(());
        }

        // Those that begin alike are the nearest ones.
        let top = path.split('.').next().unwrap_or_default();
        let near: Vec<&str> = NUMBERS
            .into_iter()
            .filter(|one| one.split('.').next() == Some(top))
            .collect();
        let known = if near.is_empty() {
            NUMBERS.to_vec()
        } else {
            near
        };
        Err(format!(
            "a summary has no number `{path}`; it has {}",
            known.join(", ")
        ))
    }

    /// The empty summary of an epoch.
    #[must_use]
    pub fn begin(run: &RunName, scenario: &Scenario) -> Self {
        let names = scenario.robots.keys().cloned();
        let robots = names.map(|name| (name, RobotSummary::default()));

        Self {
            run: run.clone(),
            seed: scenario.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            end: None,
            end_because: None,
            waited_for: Vec::new(),
            ticks: 0,
            time_s: 0.0,
            guests: scenario.guests.count,
            guest_motion: GuestPassages::default(),
            digest: String::new(),
            robots: robots.collect(),
            network: NetworkSummary::default(),
            expectations: BTreeMap::new(),
            measures: BTreeMap::new(),
            wall: WallSummary::default(),
            begun: None,
            timeline: Timeline::default(),
            counts: Counts::default(),
        }
    }

    /// Counts an event of a tick of this duration, in seconds, in which robots could query others as `reach` has it.
    pub fn count(&mut self, tick_s: f64, reach: QueryReach<'_>, tick: Tick, event: &Event) {
        self.network.count(tick_s, reach, tick, event);
        self.counts.add(event);
        // A span is counted when it ends, by the tick in which that happens.
        for span in self.timeline.apply(tick, event) {
            self.counts.add_span(&span, tick);
            if let Span::Judged(judged) = span {
                let verdict = ExpectationVerdict {
                    verdict: judged.verdict,
                    tick,
                    because: judged.because,
                };
                self.expectations.insert(judged.expectation, verdict);
            }
        }

        // The time in which robots join is not part of the epoch.
        if let Event::Init { .. } = event {
            self.begun = Some(Instant::now());
        }
        if let Event::End {
            reason,
            because,
            waited_for,
            digest,
            ..
        } = event
        {
            self.end = Some(*reason);
            self.end_because.clone_from(because);
            self.waited_for.clone_from(waited_for);
            self.digest.clone_from(digest);
        }
    }

    /// The verdict on the run: the worst of its expectations. A run of which nothing is expected passes.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let verdicts = self.expectations.values().map(|judged| judged.verdict);
        verdicts.max().unwrap_or(Verdict::Pass)
    }

    /// Seals the summary, and returns it as a file.
    ///
    /// # Errors
    /// If it cannot be JSON.
    pub fn seal(&mut self) -> Result<String, serde_json::Error> {
        self.wall.seal = None;
        let content = serde_json::to_value(&*self)?;
        self.wall.seal = Some(seal::of_json(&content));
        serde_json::to_string_pretty(self)
    }

    /// Whether the text from which the summary was read is as it was written; `None` if it has no seal.
    #[must_use]
    pub fn is_as_written(&self, text: &str) -> Option<bool> {
        let stated = self.wall.seal.as_ref()?;
        let mut value: serde_json::Value = serde_json::from_str(text).ok()?;
        value.get_mut("wall")?.as_object_mut()?.remove("seal");
        let is_right = *stated == seal::of_json(&value);
        let laid_out = serde_json::to_string_pretty(self).ok()?;
        Some(is_right && text.strip_suffix('\n') == Some(laid_out.as_str()))
    }

    /// Completes the summary at the end of the epoch, after so many ticks of this duration, in seconds.
    pub fn finish(
        &mut self,
        ticks: Tick,
        tick_s: f64,
        digest: String,
        state_variables: impl Fn(&RobotName) -> Option<StateVariables>,
    ) {
        self.ticks = ticks;
        self.time_s = time_s(ticks, tick_s);
        self.digest = digest;

        let mut counts = std::mem::take(&mut self.counts);
        for span in std::mem::take(&mut self.timeline).in_progress() {
            counts.add_span(&span, ticks);
        }
        let times_s = |ticks: BTreeMap<String, Tick>| {
            let states = ticks.into_iter();
            states
                .map(|(state, ticks)| (state, time_s(ticks, tick_s)))
                .collect()
        };
        self.guest_motion.entered = counts.guests_entered;
        self.guest_motion.left = counts.guests_left;
        for (name, counts) in counts.robots {
            let robot = self.robots.entry(name).or_default();
            robot.emotions_s = times_s(counts.emotions.ticks);
            robot.behaviors_s = times_s(counts.behaviors.ticks);
            robot.entered = counts.behaviors.entered;
            robot.blocked = counts.blocked;
            robot.sent = counts.sent;
            robot.received = counts.received;
            robot.dropped = counts.dropped;
            robot.missed = counts.missed;
            robot.returns = counts.returns;
        }
        self.network.add_counts(counts.links, tick_s);
        for (name, robot) in &mut self.robots {
            robot.state_variables = state_variables(name).unwrap_or_default();
        }

        let elapsed = self.begun.map(|begun| begun.elapsed());
        self.wall.elapsed_s = elapsed.unwrap_or_default().as_secs_f64();
    }
}
