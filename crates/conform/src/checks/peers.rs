//! Others that are early, late or refuse, clocks that have gone on, and news that name the robot.

use std::time::Duration;

use protocol::Tick;
use protocol::messages::{Clock, Report, TickUpdate};

use super::{waiting, wire};
use harness::comparison::demand_same;
use harness::fake_peers::Unhelpful;
use harness::findings::Findings;
use harness::kit::Kit;
use harness::patience::PATIENCE;
use harness::report::RuleFailure;
use harness::script::{ArrivingCommand, Disturbance, PlayScript, Straight, play, with_robot};
use harness::transcript::PlayedTick;
use harness::{Harness, HarnessOptions};

/// What was put has arrived after this time, also at a robot that rests.
const ARRIVED: Duration = Duration::from_millis(100);
/// Ticks that follow one before which a robot has skipped some.
const FOLLOWING: Tick = 12;
/// One tick in so many is disturbed: a query that is made again takes half a second.
const ROUND: Tick = 9;
/// A robot that gives up does so after fewer refusals.
const REFUSALS: usize = 10;
const BRIEFLY: Duration = Duration::from_secs(1);
/// Ticks in which the answers of others are compared, fewer than the usual ones.
const TICKS: Tick = 30;

/// The usual commands in fewer ticks.
fn shorter(kit: &Kit) -> PlayScript {
    let usual = PlayScript::usual(kit);
    PlayScript {
        ticks: usual.ticks.min(TICKS),
        ..usual
    }
}

/// The clock has gone on twice: it answers the newest one, and never those before. What the news of those before list is lost.
pub(super) fn newest(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    if kit.is_deterministic.get() == Some(&false) {
        return after_skipped(&mut waiting::for_news(kit)?, &[]).map(drop);
    }

    for text in kit.texts() {
        // In the tick that is skipped last, in the newest one, and in that after it.
        let [none, skipped, newest, after] = [None, Some(0), Some(1), Some(2)].map(|behind| {
            let command = |behind| ArrivingCommand::new(&kit.sender(), &text, behind);
            after_skipped(&mut waiting::for_news(kit)?, behind.map(command).as_slice())
        });
        let none = none?;
        let skipped = skipped?;
        if skipped != none {
            return Err(RuleFailure::new(
                format!(
                    "the same after {text:?} in the news of skipped clocks, which is lost: {none:?}"
                ),
                format!("{skipped:?}"),
            ));
        }
        if newest? == none && after? != none {
            return Err(RuleFailure::new(
                format!(
                    "{text:?} in the news of the newest of three clocks has an effect, as in the tick after it"
                ),
                "none at all",
            ));
        }
    }
    Ok(())
}

/// What a robot that waits for its news reports for the newest of three clocks, of which the first is that of the open tick, and for
/// those after it. These commands arrive so many ticks after the last one that is skipped, or with 0 in those that are.
pub(super) fn after_skipped(
    harness: &mut Harness<'_>,
    commands: &[ArrivingCommand],
) -> Result<Vec<Report>, RuleFailure> {
    // Two clocks more, and only the last one has its news: which of them it answers does not depend on how fast it reads.
    let held = harness.next_tick() - 1;
    let newest = held + 2;
    // The others are in that tick, too.
    harness.fake_peers.begin(harness.epoch(), newest);
    let clock = Clock {
        epoch: harness.epoch(),
        news: harness.flag(),
        ..Clock::default()
    };
    let news = TickUpdate {
        epoch: harness.epoch(),
        correction: Some(harness.body.confirmed()),
        ..TickUpdate::default()
    };
    let put_news = |harness: &Harness<'_>, tick: Tick| {
        let behind = tick.saturating_sub(held + 1);
        let arriving = commands.iter().filter(|command| command.tick == behind);
        harness.put_news(&TickUpdate {
            tick,
            commands: arriving.map(ArrivingCommand::delivery).collect(),
            ..news.clone()
        })
    };
    let expected =
        format!("a report for tick {newest}, the newest of three clocks, when its news are here");
    let put_clocks = |harness: &Harness<'_>| {
        let mut skipped = [held + 1, newest].into_iter();
        skipped.try_for_each(|tick| harness.put_clock(&Clock { tick, ..clock }))
    };
    // A robot may receive clocks and news on threads of their own, of which either may be the first.
    put_clocks(harness)?;
    harness.settle(ARRIVED);
    harness.until_put(
        &expected,
        PATIENCE,
        |harness| {
            put_clocks(harness)?;
            // Those of the ticks before come late, before the newest and after them.
            put_news(harness, held)?;
            put_news(harness, newest)?;
            put_news(harness, held + 1)
        },
        |harness| harness.has_answered(newest).then_some(()),
    )?;
    harness.settle(ARRIVED);
    for tick in [held, held + 1] {
        if harness.has_answered(tick) {
            return Err(RuleFailure::new(
                format!(
                    "no report for tick {tick}, whose clock was followed by that of tick {newest}"
                ),
                "a report",
            ));
        }
    }

    let last = newest + FOLLOWING;
    for after in newest + 1..=last {
        harness.fake_peers.begin(harness.epoch(), after);
        let expected = format!("a report for tick {after}");
        harness.until_put(
            &expected,
            PATIENCE,
            |harness| {
                put_news(harness, after)?;
                harness.put_clock(&Clock {
                    tick: after,
                    ..clock
                })
            },
            |harness| harness.has_answered(after).then_some(()),
        )?;
    }
    let mut reports = Vec::new();
    for tick in newest..=last {
        let answers = harness.seen.answers.iter();
        let mut came = answers.map(|answer| &answer.reading.report);
        let report = came.find(|report| (report.epoch, report.tick) == (harness.epoch(), tick));
        reports.extend(report.cloned());
    }
    Ok(reports)
}

/// The states of others arrive before it decides, as they do where it is slower than they: those of the tick do not count.
pub(super) fn reply(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    /// The others are early, or play along and the news are the same.
    struct Peers {
        are_early: bool,
    }
    impl Disturbance for Peers {
        fn news(&mut self, harness: &Harness<'_>, news: &mut TickUpdate) {
            // It waits for news in each tick, so that what comes before them has come.
            news.correction = news.correction.or(Some(harness.body.confirmed()));
        }

        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            harness.withholds_news = self.are_early && tick > 0;
            if self.are_early && tick.is_multiple_of(ROUND) {
                harness.fake_peers.be_unhelpful(&[
                    Unhelpful::EarlierState,
                    Unhelpful::LaterState,
                    Unhelpful::EarlierEpoch,
                ]);
            }
            Ok(())
        }

        fn during(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            if !self.are_early || tick == 0 {
                return Ok(());
            }
            harness.put_early_states()?;
            harness.pass(ARRIVED);
            harness.release_news()
        }
    }

    let mut straight = with_robot(kit, HarnessOptions::default())?;
    let expected = play(
        &mut straight,
        &shorter(kit),
        &mut Peers { are_early: false },
    )?;
    if straight.fake_peers.asked().is_empty() && !follows(&straight)? {
        findings.skip("query.reply", "the robot queried no other one");
        return Ok(());
    }
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let played = play(&mut harness, &shorter(kit), &mut Peers { are_early: true })?;
    demand_same(
        kit,
        "a state of another tick than the one before",
        &expected,
        &played,
    )
}

/// Whether it subscribes to the state of another robot.
fn follows(harness: &Harness<'_>) -> Result<bool, RuleFailure> {
    for name in harness.fake_peers.names() {
        let key = harness.keys.query(name, protocol::keys::STATE);
        if harness.has_subscriber(&key)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// A query that is refused is made again, until it is answered.
pub(super) fn again(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    struct Refusing;
    impl Disturbance for Refusing {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            let replies = if tick % ROUND < 2 {
                &[Unhelpful::Refusal; 3][..]
            } else {
                &[]
            };
            harness.fake_peers.be_unhelpful(replies);
            Ok(())
        }

        fn after(
            &mut self,
            harness: &mut Harness<'_>,
            entry: &PlayedTick,
        ) -> Result<(), RuleFailure> {
            match harness.fake_peers.given_up() {
                None => Ok(()),
                Some(of) => Err(RuleFailure::new(
                    format!("queries of {of} in tick {} until it answers", entry.tick),
                    "the report, after a query that was refused",
                )),
            }
        }
    }

    let mut straight = waiting::of_queries(kit)?;
    let expected = play(&mut straight, &shorter(kit), &mut Straight)?;
    if straight.fake_peers.asked().is_empty() {
        findings.skip("query.again", "the robot queried no other one");
        return Ok(());
    }
    let mut harness = waiting::of_queries(kit)?;
    harness.hide_others();
    let played = play(&mut harness, &shorter(kit), &mut Refusing)?;
    let what = "that others refuse first, and that their tokens are gone";
    demand_same(kit, what, &expected, &played)
}

/// It goes on asking robots that do not answer for long, and whose tokens are gone: only a newer clock ends the tick.
pub(super) fn patient(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let (mut harness, is_asking) = waiting::for_another(kit)?;
    if !is_asking {
        findings.skip("query.again", "the robot queried no other one");
        return Ok(());
    }
    harness.hide_others();
    let silence = waiting::observation_time(kit, BRIEFLY);
    harness.pass_while(silence, Harness::is_open);
    if !harness.is_open() {
        let expected = format!(
            "it asks again for {} s, and puts no report without an answer",
            silence.as_secs()
        );
        return Err(RuleFailure::new(expected, "a report"));
    }
    // Which it asks next is answered late, and refused before.
    harness
        .fake_peers
        .be_unhelpful(&[Unhelpful::Refusal; REFUSALS]);
    harness.fake_peers.release();
    harness.complete()?;
    match harness.fake_peers.given_up() {
        None => Ok(()),
        Some(of) => Err(RuleFailure::new(
            format!("queries of {of} until it answers"),
            format!("the report, after fewer than {REFUSALS} refusals"),
        )),
    }
}

/// A newer clock comes while it waits for an answer: it finishes the tick without it, and goes on.
pub(super) fn newer(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let (mut harness, is_asking) = waiting::for_another(kit)?;
    if !is_asking {
        return Ok(());
    }
    let tick = harness.next_tick();
    let clock = Clock {
        epoch: harness.epoch(),
        tick,
        news: harness.flag(),
        ..Clock::default()
    };
    let news = TickUpdate {
        epoch: harness.epoch(),
        tick,
        correction: Some(harness.body.confirmed()),
        ..TickUpdate::default()
    };

    // What it asked for is never answered; what it asks for in the newer tick is.
    harness.fake_peers.hold_before(harness.epoch(), tick);
    harness.fake_peers.begin(harness.epoch(), tick);
    let expected = format!(
        "a report for tick {tick}, whose clock comes while it waits for an answer in the tick before"
    );
    harness.until_put(
        &expected,
        PATIENCE,
        |harness| {
            harness.put_news(&news)?;
            harness.put_clock(&clock)
        },
        |harness| harness.has_answered(tick).then_some(()),
    )?;
    if !harness.has_answered(tick - 1) {
        return Err(RuleFailure::new(
            format!(
                "a report for tick {}, which it finishes without the answer",
                tick - 1
            ),
            format!("only that for tick {tick}"),
        ));
    }
    Ok(())
}

/// It says for whom it waits, in the way that ticks need.
pub(super) fn waiting(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let (mut harness, is_asking) = waiting::for_another(kit)?;
    if !is_asking {
        findings.skip("query.waiting", "the robot queried no other one");
        return Ok(());
    }

    let tick = harness.next_tick() - 1;
    let asked = harness.fake_peers.asked();
    let expected = format!("`waiting` in tick {tick} on the robot that does not answer");
    harness.until(&expected, PATIENCE, |harness| {
        let mut waiting = harness.seen.waiting.iter();
        waiting
            .any(|waiting| {
                (waiting.epoch, waiting.tick) == (harness.epoch(), tick)
                    && asked.iter().any(|query| query.of == waiting.on)
            })
            .then_some(())
    })?;
    wire::check(&harness, findings);
    harness.fake_peers.release();
    harness.complete().map(drop)
}

/// Its news name its own generation again and again: nothing begins.
pub(super) fn own_joined(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    /// News that place the robot where it stands, and may name it.
    struct NamingNews {
        names_it: bool,
    }
    impl Disturbance for NamingNews {
        fn news(&mut self, harness: &Harness<'_>, news: &mut TickUpdate) {
            if harness.next_tick().is_multiple_of(3) {
                return;
            }
            news.joined = self.names_it.then_some(harness.generation());
            news.correction = news.correction.or(Some(harness.body.confirmed()));
        }
    }

    let play_named = |names_it| {
        let mut harness = with_robot(kit, HarnessOptions::default())?;
        play(&mut harness, &shorter(kit), &mut NamingNews { names_it })
    };
    let expected = play_named(false)?;
    let played = play_named(true)?;
    demand_same(kit, "its own generation as `joined`", &expected, &played)
}
