//! The same clock again, and clocks that come too late.

use protocol::keys::STATE;
use protocol::messages::{Clock, Correction, News, Point, Report};
use protocol::{Epoch, Seq, Tick};

use super::{Findings, seated, usual};
use crate::comparison::demand_same;
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Entry, Script, Twist, play};
use crate::stage::{Options, PATIENCE, Stage};

/// One clock in so many comes again.
const EVERY: Tick = 3;

/// A clock that comes again is answered as before, and a tick is done once.
pub(super) fn duplicate(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    /// The commands of the last ticks: tick, seq.
    struct Again(Vec<(Tick, Seq)>);
    impl Twist for Again {
        fn after(&mut self, stage: &mut Stage<'_>, entry: &Entry) -> Result<(), Failure> {
            let tick = entry.clock.tick;
            self.0
                .retain(|(sent, _)| sent + stage.welcome().repeat_ticks > tick);
            self.0
                .extend(entry.report.sent.iter().map(|sent| (tick, sent.seq)));
            if !tick.is_multiple_of(EVERY) && self.0.is_empty() {
                return Ok(());
            }
            // Whatever was put before its answer has come before it, on one session.
            stage.ask(STATE, "")?;
            stage.drain();
            let before = count(stage, tick);
            let sent: Vec<usize> = self.0.iter().map(|sent| count_sent(stage, *sent)).collect();
            stage.put_clock(&entry.clock)?;
            let expected = format!("the report of tick {tick} again when its clock comes again");
            stage.until(&expected, PATIENCE, |stage| {
                (count(stage, tick) > before).then_some(())
            })?;
            // On one session, what was put before it has come before it.
            for (of, sent) in self.0.iter().zip(sent) {
                if count_sent(stage, *of) == sent {
                    let expected = format!(
                        "command {} of tick {} again, before the report, when the clock of tick {tick} comes again",
                        of.1, of.0
                    );
                    return Err(Failure::new(expected, "the report alone"));
                }
            }
            demand_same_bytes(stage, tick)
        }
    }
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let repeated = play(
        &mut stage,
        &welcome,
        &Script::usual(kit),
        &mut Again(Vec::new()),
    )?;
    demand_same(kit, "a clock that comes again", usual(kit)?, &repeated)
}

fn count_of(stage: &Stage<'_>, (epoch, tick): (Epoch, Tick)) -> usize {
    let is_of = |report: &Report| (report.epoch, report.tick) == (epoch, tick);
    stage
        .seen
        .answers
        .iter()
        .filter(|answer| is_of(&answer.reading.report))
        .count()
}

fn count(stage: &Stage<'_>, tick: Tick) -> usize {
    stage
        .seen
        .answers
        .iter()
        .filter(|answer| answer.reading.report.tick == tick)
        .count()
}

/// How often a command came so far.
fn count_sent(stage: &Stage<'_>, of: (Tick, Seq)) -> usize {
    let is_it = |sent: &&crate::stage::Sent| {
        sent.command
            .as_ref()
            .is_ok_and(|command| (command.tick, command.seq) == of)
    };
    stage.seen.commands.iter().filter(is_it).count()
}

fn demand_same_bytes(stage: &Stage<'_>, tick: Tick) -> Result<(), Failure> {
    let mut reports = stage
        .seen
        .answers
        .iter()
        .filter(|answer| answer.reading.report.tick == tick);
    let first = reports.next().map(|answer| &answer.bytes);
    match reports.find(|answer| Some(&answer.bytes) != first) {
        None => Ok(()),
        Some(other) => {
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            let expected = first.map(|bytes| text(bytes)).unwrap_or_default();
            Err(Failure::new(
                format!("the same report again: {expected}"),
                text(&other.bytes),
            ))
        }
    }
}

/// Clocks of earlier ticks and epochs come too late to be answered.
pub(super) fn late(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    /// Reports that had come for the late clocks' epochs and ticks before they were put.
    struct Late(Vec<((Epoch, Tick), usize)>);
    impl Twist for Late {
        fn before(&mut self, stage: &mut Stage<'_>, clock: &Clock) -> Result<(), Failure> {
            if clock.tick < 6 || !clock.tick.is_multiple_of(EVERY) {
                return Ok(());
            }
            // Would it heed them, it would stand elsewhere.
            let correction = Some(Correction {
                location: Point::new(1.0, 1.0),
                blocked: true,
            });
            let news = News {
                correction,
                ..News::default()
            };
            let news = std::collections::BTreeMap::from([(stage.kit.subject(), news)]);
            let late = [
                (1, clock.tick - 2),
                (1, clock.tick - 5),
                (0, clock.tick),
                (0, clock.tick + 9),
            ];
            self.0 = late.map(|of| (of, count_of(stage, of))).into();
            for (epoch, tick) in late {
                stage.put_clock(&Clock {
                    epoch,
                    tick,
                    news: news.clone(),
                    end: None,
                })?;
            }
            Ok(())
        }

        fn after(&mut self, stage: &mut Stage<'_>, _: &Entry) -> Result<(), Failure> {
            // In order on one link: an answer to a late clock would have come before that to this one.
            match self
                .0
                .iter()
                .find(|(of, before)| count_of(stage, *of) > *before)
            {
                None => Ok(()),
                Some(((epoch, tick), _)) => {
                    let came = format!("a report for tick {tick} of epoch {epoch}");
                    Err(Failure::new("no answer to a clock that is over", came))
                }
            }
        }
    }
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let played = play(
        &mut stage,
        &welcome,
        &Script::usual(kit),
        &mut Late(Vec::new()),
    )?;
    demand_same(
        kit,
        "a clock of an earlier tick or epoch",
        usual(kit)?,
        &played,
    )
}
