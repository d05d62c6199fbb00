//! Queries of a robot that computes.
//!
//! The kit cannot know when a robot computes; it sees how long its ticks take. During each tick it queries the robot again
//! and again. A robot that answers between its ticks only answers after its report, and it does so in the same tick
//! whenever the same ticks are played. On a loaded machine an answer may be late as well; but not in the same tick in each
//! of several plays, and not while the kit's own queryable replies in time. A play in which the kit's own reply is late, too,
//! shows nothing of the tick, for or against the robot.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use protocol::Tick;

use harness::kit::Kit;
use harness::patience::PATIENCE;
use harness::report::RuleFailure;
use harness::script::{Disturbance, PlayScript, play, with_robot};
use harness::transcript::PlayedTick;
use harness::{Harness, HarnessOptions};

/// How often the robot is queried during a tick.
const EVERY: Duration = Duration::from_millis(20);
/// A robot that had so much time between a query and its report could have answered.
const ENOUGH: Duration = Duration::from_millis(60);
/// A reply to a query that was put earlier before the report may be of the time before the robot computed.
const RECENT: Duration = Duration::from_millis(120);
/// In how many plays of a tick an answer must be late to count.
const LATE_PLAYS: usize = 4;
/// How often the ticks are played at most, where a play shows nothing.
const MAX_PLAYS: usize = 12;
/// Most queries in a tick.
const MAX_PAIRS: usize = 500;

/// A query of the robot during a tick, and one of the kit's own queryable at the same moment.
struct Pair {
    robot: usize,
    control: usize,
    at: Instant,
    /// How long the robot's threads had waited for a processor until then.
    starved: Duration,
}

/// What the plays so far have shown of a tick.
#[derive(Default)]
struct PlayedQueries {
    /// In one of them it replied while the tick lasted, or was done so soon that no query waits.
    replies: bool,
    /// One of them shows nothing.
    is_unknown: bool,
    /// How long it had for replies that came after its report, one for each play.
    late: Vec<Duration>,
}

impl PlayedQueries {
    /// A play in which no reply was late without another cause: it shows that the robot replies, or nothing.
    fn note(&mut self, replies: bool) {
        self.replies |= replies;
        self.is_unknown |= !replies;
    }
}

/// Queries the robot in each tick as long as it takes.
#[derive(Default)]
struct QueriesDuringTicks {
    /// Of the tick that is open.
    pairs: Vec<Pair>,
    ticks: BTreeMap<Tick, PlayedQueries>,
}

impl Disturbance for QueriesDuringTicks {
    fn during(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
        self.pairs.clear();
        loop {
            harness.pass_while(EVERY, Harness::is_open);
            // At tick 0 there is nothing to answer. A robot that never reports is found by the wait for its report.
            let is_long = self.pairs.len() >= MAX_PAIRS;
            if !harness.is_open() || tick == 0 || is_long {
                return Ok(());
            }

            self.pairs.push(Pair {
                // At the same moment to both: what delays one of them for no fault of the robot delays
                // the other.
                robot: harness.begin_query(harness.epoch(), tick)?,
                control: harness.begin_control()?,
                at: Instant::now(),
                starved: harness.process.starved(),
            });
        }
    }

    fn after(&mut self, harness: &mut Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
        let played = self.ticks.entry(entry.tick).or_default();
        let expected = format!("queried during tick {}, a reply", entry.tick);
        let starved = harness.process.starved();
        // The last first: a robot that begins late replies until then, however long it computes afterwards.
        for pair in self.pairs.iter().rev() {
            for number in [pair.robot, pair.control] {
                harness.until(&expected, PATIENCE, |harness| {
                    harness.seen.replies.contains_key(&number).then_some(())
                })?;
            }

            let report = &harness.seen.answers[entry.index];
            let since = report.at.saturating_duration_since(pair.at);
            // By the order of arrival on one session, not by clocks.
            let is_late = |number| harness.seen.replies[&number].0 > report.order;
            if !is_late(pair.robot) {
                played.note(since < RECENT);
                return Ok(());
            }
            // What a loaded machine takes is not the robot's.
            let had = since.saturating_sub(starved.saturating_sub(pair.starved));
            if had >= ENOUGH && !is_late(pair.control) {
                played.late.push(had);
                return Ok(());
            }
        }

        played.note(entry.took < ENOUGH);
        Ok(())
    }
}

impl QueriesDuringTicks {
    /// How long the robot had in a tick in which it surely replies too late, with the tick.
    fn late(&self) -> Option<(Tick, Duration)> {
        let mut ticks = self.ticks.iter().filter(|(_, played)| !played.replies);
        // Only what is late in the same tick each time is the robot's doing.
        let (tick, played) = ticks.find(|(_, played)| played.late.len() >= LATE_PLAYS)?;
        Some((*tick, *played.late.last()?))
    }

    /// Whether another play could show what these have not.
    fn is_undecided(&self) -> bool {
        let mut undecided = self.ticks.values().filter(|played| !played.replies);
        undecided.any(|played| !played.late.is_empty() || played.is_unknown)
    }
}

/// The robot answers while it computes.
pub(super) fn check(kit: &Kit) -> Result<(), RuleFailure> {
    let mut queries = QueriesDuringTicks::default();
    for _ in 0..MAX_PLAYS {
        let mut harness = with_robot(kit, HarnessOptions::default())?;
        play(&mut harness, &PlayScript::usual(kit), &mut queries)?;

        if let Some((tick, had)) = queries.late() {
            let expected = format!("queried during tick {tick}, a reply at once");
            let came = format!(
                "in {LATE_PLAYS} plays one after its report, which came {} ms after the query",
                had.as_millis()
            );
            return Err(RuleFailure::new(expected, came));
        }
        if !queries.is_undecided() {
            break;
        }
    }
    Ok(())
}
