//! The same clock again, and clocks that come too late.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::messages::{Clock, Correction, News, Point};
use protocol::{Epoch, Tick};

use super::{Findings, seated, usual};
use crate::comparison::demand_same;
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Entry, Script, Twist, play};
use crate::stage::{Answer, Options, PATIENCE, Sent, Stage};

/// One clock in so many comes again, and each whose tick had commands.
const EVERY: Tick = 3;
/// How long a robot may still send what belongs to the tick itself.
const BEFORE_REPEATING: Duration = Duration::from_millis(50);

/// A clock that comes again is answered as before, and a tick is done once.
pub(super) fn duplicate(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    struct Again;
    impl Twist for Again {
        fn after(&mut self, stage: &mut Stage<'_>, entry: &Entry) -> Result<(), Failure> {
            let tick = entry.tick;
            if !tick.is_multiple_of(EVERY) && entry.commands.is_empty() {
                return Ok(());
            }

            // A robot that reports twice by itself breaks another rule: what it still sends is not the repetition.
            stage.settle(BEFORE_REPEATING);
            let since = stage.seen.count;
            stage.repeat();
            let expected = format!("the report of tick {tick} again when its clock comes again");
            let again = stage.until(&expected, PATIENCE, |stage| {
                answers_of(stage, tick)
                    .find(|answer| answer.order >= since)
                    .map(|answer| (answer.order, answer.bytes.clone()))
            })?;
            let first = answers_of(stage, tick)
                .next()
                .map(|answer| answer.bytes.clone());
            demand_bytes("report", &first.unwrap_or_default(), &again.1)?;
            demand_commands(stage, entry, since, again.0)
        }
    }
    let mut stage = seated(kit, Options::default())?;
    let repeated = play(&mut stage, &Script::usual(kit), &mut Again)?;
    demand_same(kit, "a clock that comes again", usual(kit)?, &repeated)
}

fn answers_of<'s>(stage: &'s Stage<'_>, tick: Tick) -> impl Iterator<Item = &'s Answer> {
    stage
        .seen
        .answers
        .iter()
        .filter(move |answer| answer.reading.report.tick == tick)
}

/// The commands of the tick came again between two places among all that came: all of them, and the same bytes.
fn demand_commands(
    stage: &Stage<'_>,
    entry: &Entry,
    since: usize,
    report: usize,
) -> Result<(), Failure> {
    let tick = entry.tick;
    let mut again: BTreeMap<u32, &Sent> = BTreeMap::new();
    for sent in &stage.seen.commands {
        let Ok(command) = &sent.command else { continue };
        let is_between = sent.order >= since && sent.order < report;
        if command.tick == tick && is_between {
            again.insert(command.number, sent);
        }
    }

    for first in &entry.commands {
        let Ok(command) = &first.command else {
            continue;
        };
        let Some(repeated) = again.get(&command.number) else {
            let expected = format!(
                "command {} of tick {tick} again, before the report, when the clock of tick {tick} comes again",
                command.number
            );
            return Err(Failure::new(expected, "the report without it"));
        };
        demand_bytes("command", &first.bytes, &repeated.bytes)?;
    }
    Ok(())
}

fn demand_bytes(what: &str, first: &[u8], again: &[u8]) -> Result<(), Failure> {
    if first == again {
        return Ok(());
    }

    Err(Failure::new(
        format!("the same {what} again: {}", String::from_utf8_lossy(first)),
        String::from_utf8_lossy(again),
    ))
}

fn count_of(stage: &Stage<'_>, (epoch, tick): (Epoch, Tick)) -> usize {
    answers_of(stage, tick)
        .filter(|answer| answer.reading.report.epoch == epoch)
        .count()
}

/// Clocks of earlier ticks and epochs come too late to be answered.
pub(super) fn late(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    /// Reports that had come for the late clocks' epochs and ticks before they were put.
    struct Late(Vec<((Epoch, Tick), usize)>);
    impl Twist for Late {
        fn before(&mut self, stage: &mut Stage<'_>, tick: Tick) -> Result<(), Failure> {
            if tick < 6 || !tick.is_multiple_of(EVERY) {
                return Ok(());
            }

            let late = [(1, tick - 2), (1, tick - 5), (0, tick), (0, tick + 9)];
            self.0 = late.map(|of| (of, count_of(stage, of))).into();
            let flag = stage.flag();
            for (epoch, tick) in late {
                // If it took them for its own, it would stand elsewhere.
                stage.put_news(&News {
                    epoch,
                    tick,
                    correction: Some(Correction {
                        location: Point::new(1.0, 1.0),
                        blocked: true,
                    }),
                    ..News::default()
                })?;
                stage.put_clock(&Clock {
                    epoch,
                    tick,
                    news: flag,
                    end: None,
                })?;
            }
            Ok(())
        }

        fn after(&mut self, stage: &mut Stage<'_>, _: &Entry) -> Result<(), Failure> {
            // In order on one link: an answer to a late clock would have come before that to this one.
            let answered = self
                .0
                .iter()
                .find(|(of, before)| count_of(stage, *of) > *before);
            match answered {
                None => Ok(()),
                Some(((epoch, tick), _)) => {
                    let came = format!("a report for tick {tick} of epoch {epoch}");
                    Err(Failure::new("no answer to a clock that is over", came))
                }
            }
        }
    }
    let mut stage = seated(kit, Options::default())?;
    let played = play(&mut stage, &Script::usual(kit), &mut Late(Vec::new()))?;
    demand_same(
        kit,
        "a clock of an earlier tick or epoch",
        usual(kit)?,
        &played,
    )
}
