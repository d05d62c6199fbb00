//! Queries of a robot that computes.
//!
//! The kit cannot know when a robot computes; it sees how long its ticks take. During each tick it queries the robot again
//! and again. A robot that answers between its ticks only answers after its report, and it does so in the same tick
//! whenever the same ticks are played. On a loaded machine an answer may be late as well; but not in the same tick in each
//! of several plays, and not while the kit's own queryable replies in time.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use protocol::Tick;

use crate::harness::{Harness, HarnessOptions};
use crate::kit::Kit;
use crate::patience::PATIENCE;
use crate::report::RuleFailure;
use crate::script::{Disturbance, PlayScript, play, with_robot};
use crate::transcript::PlayedTick;

/// How often the robot is queried during a tick.
const EVERY: Duration = Duration::from_millis(20);
/// A robot that had so much time between a query and its report could have answered.
const ENOUGH: Duration = Duration::from_millis(60);
/// How often the ticks are played before an answer counts as late.
const PLAYS: usize = 4;
/// Most queries in a tick.
const MAX_PAIRS: usize = 500;

/// A query of the robot during a tick, and one of the kit's own queryable at the same moment.
struct Pair {
    robot: usize,
    control: usize,
    at: Instant,
}

/// Queries the robot in each tick as long as it takes.
#[derive(Default)]
struct QueriesDuringTicks {
    pairs: Vec<Pair>,
    /// By tick, how long the robot had for an answer that came after its report.
    late: BTreeMap<Tick, Duration>,
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
            });
        }
    }

    fn after(&mut self, harness: &mut Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
        for pair in &self.pairs {
            let expected = format!("queried during tick {}, a reply", entry.tick);
            for number in [pair.robot, pair.control] {
                harness.until(&expected, PATIENCE, |harness| {
                    harness.seen.replies.contains_key(&number).then_some(())
                })?;
            }

            let report = &harness.seen.answers[entry.index];
            let had = report.at.saturating_duration_since(pair.at);
            // By the order of arrival on one session, not by clocks.
            let is_late = harness.seen.replies[&pair.robot].0 > report.order;
            let is_control_late = harness.seen.replies[&pair.control].0 > report.order;
            if !is_late {
                // Slow, perhaps, but it does answer in this tick.
                self.late.remove(&entry.tick);
                return Ok(());
            }
            if !is_control_late && had >= ENOUGH {
                self.late.entry(entry.tick).or_insert(had);
            }
        }
        Ok(())
    }
}

/// The robot answers while it computes.
pub(super) fn check(kit: &Kit) -> Result<(), RuleFailure> {
    let mut late = late_ticks(kit)?;
    for _ in 1..PLAYS {
        if late.is_empty() {
            return Ok(());
        }
        let again: BTreeSet<Tick> = late_ticks(kit)?.into_keys().collect();
        // Only what is late in the same tick each time is the robot's doing.
        late.retain(|tick, _| again.contains(tick));
    }

    match late.first_key_value() {
        None => Ok(()),
        Some((tick, had)) => Err(RuleFailure::new(
            format!("queried during tick {tick}, a reply at once"),
            format!(
                "in each of {PLAYS} plays one after its report, which came {} ms after the query",
                had.as_millis()
            ),
        )),
    }
}

/// Plays the usual ticks. The ticks in which an answer came after the report although there was time for it before.
fn late_ticks(kit: &Kit) -> Result<BTreeMap<Tick, Duration>, RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let mut queries = QueriesDuringTicks::default();
    play(&mut harness, &PlayScript::usual(kit), &mut queries)?;

    Ok(queries.late)
}
