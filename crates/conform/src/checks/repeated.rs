//! The same clock again, and clocks that come too late.

use std::collections::BTreeSet;
use std::time::Duration;

use protocol::messages::{Clock, Correction, Point, TickUpdate};
use protocol::{Epoch, Tick};

use super::{queries, waiting};
use harness::findings::Findings;
use harness::kit::Kit;
use harness::patience::PATIENCE;
use harness::report::RuleFailure;
use harness::script::{Disturbance, demand_usual, with_robot};
use harness::seen::{ReceivedReport, ReportedCommand};
use harness::transcript::PlayedTick;
use harness::{Harness, HarnessOptions};

/// One clock in so many comes again, and each whose tick had commands.
const EVERY: Tick = 3;
/// One in so many comes so often.
const MORE_EVERY: Tick = 12;
const TIMES: usize = 3;
/// How long a robot may still send what belongs to the tick itself.
const BEFORE_REPEATING: Duration = Duration::from_millis(50);
/// How long the commands may take that should have come before the report that is there.
const COMMANDS_PATIENCE: Duration = Duration::from_secs(2);

/// A clock that comes again is answered as before, and a tick is done once.
pub(super) fn duplicate(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct Again;
    impl Disturbance for Again {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            harness.shows_panels = tick % 4 < 2;
            Ok(())
        }

        fn after(
            &mut self,
            harness: &mut Harness<'_>,
            entry: &PlayedTick,
        ) -> Result<(), RuleFailure> {
            if entry.tick.is_multiple_of(EVERY) || !entry.commands.is_empty() {
                // An observer may have come since, or be gone.
                harness.shows_panels = !harness.shows_panels;
                // It may come more than once.
                let times = if entry.tick.is_multiple_of(MORE_EVERY) {
                    TIMES
                } else {
                    1
                };
                for _ in 0..times {
                    repeat(harness, entry)?;
                }
                demand_last_two(harness, entry)?;
            }
            Ok(())
        }
    }
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    harness.doubles_news = true;
    demand_usual(&mut harness, "a clock that comes again", &mut Again)?;
    waiting::while_asking(
        kit,
        "a clock that comes again, with its news, while it waits for an answer",
        |harness| {
            harness.repeat();
            Ok(())
        },
    )
}

/// Its last two states are those of this tick and of the one before, for those who still query in this tick.
pub(super) fn demand_last_two(
    harness: &Harness<'_>,
    entry: &PlayedTick,
) -> Result<(), RuleFailure> {
    for tick in [entry.tick.checked_sub(1), Some(entry.tick)]
        .into_iter()
        .flatten()
    {
        let expected = format!(
            "asked with tick={}, still the state of tick {tick}",
            tick + 1
        );
        let came = queries::state(harness.state_in(entry.epoch, tick + 1)?, &expected)?;
        if came.tick != tick {
            return Err(RuleFailure::new(
                expected,
                format!("that of tick {}", came.tick),
            ));
        }
    }
    Ok(())
}

/// Repeats the clock of a tick, and waits for its report and its commands.
pub(super) fn repeat(harness: &mut Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
    // A robot that reports twice by itself breaks another rule: what it still sends is not the repetition.
    harness.pass(BEFORE_REPEATING);
    // What comes from here on follows the repetition.
    let since = harness.seen.count;
    harness.repeat();

    let tick = entry.tick;
    let expected = format!("the report of tick {tick} again when its clock comes again");
    harness.until(&expected, PATIENCE, |harness| {
        answers_of(harness, tick)
            .any(|answer| answer.order >= since)
            .then_some(())
    })?;
    let mut answers = answers_of(harness, tick);
    let first = answers.next().map(|answer| answer.bytes.clone());
    for again in answers {
        demand_bytes("report", first.as_deref().unwrap_or_default(), &again.bytes)?;
    }

    // A second report that the robot put by itself may have come before the one that follows the commands.
    let came = harness.until("", COMMANDS_PATIENCE, |harness| {
        let report = answers_of(harness, tick).last()?.order;
        missing(harness, entry, since, report)
            .is_none()
            .then_some(())
    });
    if came.is_err() {
        let report = answers_of(harness, tick).last();
        let report = report.map_or(usize::MAX, |answer| answer.order);
        let expected = format!(
            "command {} of tick {tick} again, before the report, when the clock of tick {tick} comes again",
            missing(harness, entry, since, report).unwrap_or_default()
        );
        return Err(RuleFailure::new(expected, "the report without it"));
    }

    for first in &entry.commands {
        for again in commands_since(harness, since) {
            if again.number() == first.number() && again.tick() == Some(tick) {
                demand_bytes("command", &first.bytes, &again.bytes)?;
            }
        }
    }
    Ok(())
}

fn answers_of<'s>(
    harness: &'s Harness<'_>,
    tick: Tick,
) -> impl Iterator<Item = &'s ReceivedReport> {
    harness
        .seen
        .answers
        .iter()
        .filter(move |answer| answer.reading.report.tick == tick)
}

/// Commands that came since a place among all that came.
fn commands_since<'s>(
    harness: &'s Harness<'_>,
    since: usize,
) -> impl Iterator<Item = &'s ReportedCommand> {
    harness
        .seen
        .commands
        .iter()
        .filter(move |sent| sent.order >= since)
}

/// The number of a command of the tick that did not come again between two places among all that came.
fn missing(harness: &Harness<'_>, entry: &PlayedTick, since: usize, report: usize) -> Option<u32> {
    let came: BTreeSet<Option<u32>> = commands_since(harness, since)
        .filter(|sent| sent.order < report && sent.tick() == Some(entry.tick))
        .map(ReportedCommand::number)
        .collect();

    entry
        .commands
        .iter()
        .map(ReportedCommand::number)
        .find(|number| !came.contains(number))
        .flatten()
}

fn demand_bytes(what: &str, first: &[u8], again: &[u8]) -> Result<(), RuleFailure> {
    if first == again {
        return Ok(());
    }

    Err(RuleFailure::new(
        format!("the same {what} again: {}", String::from_utf8_lossy(first)),
        String::from_utf8_lossy(again),
    ))
}

fn count_of(harness: &Harness<'_>, (epoch, tick): (Epoch, Tick)) -> usize {
    answers_of(harness, tick)
        .filter(|answer| answer.reading.report.epoch == epoch)
        .count()
}

/// Clocks of earlier ticks and epochs come too late to be answered.
pub(super) fn late(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    /// Reports that had come for the late clocks' epochs and ticks before they were put.
    struct Late(Vec<((Epoch, Tick), usize)>);
    impl Disturbance for Late {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            if tick < 6 || !tick.is_multiple_of(EVERY) {
                return Ok(());
            }

            let now = harness.epoch();
            let late = [
                (now, tick - 2),
                (now, tick - 5),
                (now - 1, tick),
                (now - 1, tick + 9),
            ];
            // Counted before: ticks of this epoch have been answered once already.
            self.0 = late.map(|of| (of, count_of(harness, of))).into();
            let flag = harness.flag();
            let generation = harness.generation();
            for (epoch, tick) in late {
                // In an earlier epoch the same generation may have been another incarnation.
                let is_earlier = epoch < now;
                // If it took them for its own, it would stand elsewhere.
                harness.put_news(&TickUpdate {
                    epoch,
                    tick,
                    joined: is_earlier.then_some(generation + 1),
                    rejoin: is_earlier.then_some(generation),
                    correction: Some(Correction {
                        location: Point::new(1.0, 1.0),
                        blocked: true,
                    }),
                    ..TickUpdate::default()
                })?;
                for news in [flag, 0] {
                    harness.put_clock(&Clock {
                        epoch,
                        tick,
                        news,
                        ..Clock::default()
                    })?;
                }
            }
            Ok(())
        }

        fn after(&mut self, harness: &mut Harness<'_>, _: &PlayedTick) -> Result<(), RuleFailure> {
            // In order on one link: an answer to a late clock would have come before that to this one.
            let answered = self
                .0
                .iter()
                .find(|(of, before)| count_of(harness, *of) > *before);
            match answered {
                None => Ok(()),
                Some(((epoch, tick), _)) => {
                    let came = format!("a report for tick {tick} of epoch {epoch}");
                    Err(RuleFailure::new("no answer to a clock that is over", came))
                }
            }
        }
    }
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let what = "a clock of an earlier tick or epoch";
    demand_usual(&mut harness, what, &mut Late(Vec::new()))
}
