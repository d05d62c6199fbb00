//! Robots that wait: for their news, or for another robot's answer.

use std::time::Duration;

use protocol::Tick;
use protocol::messages::{Correction, TickUpdate};

use harness::comparison::demand_same;
use harness::kit::{Kit, KitRoster};
use harness::report::{KitPart, RuleFailure};
use harness::script::{Disturbance, PlayScript, Straight, play, with_robot};
use harness::{Harness, HarnessOptions};

/// After this time, a robot that received a clock is in its tick.
const UNDER_WAY: Duration = Duration::from_millis(50);
/// Longer than the patience that a robot may have of its own, by mistake: libraries give up after 10 or 30 s.
pub(super) const LONG: Duration = Duration::from_secs(31);
/// Ticks within which a robot that queries others at all does so.
const TICKS: Tick = 24;

/// How long it is looked whether a robot goes on waiting: a patience of its own would be the same in all parts, so only one takes long.
pub(super) fn observation_time(kit: &Kit, brief: Duration) -> Duration {
    match kit.part() {
        KitPart::Alone => LONG,
        _ => brief,
    }
}

/// A harness on which the other robots put no states, so that a robot that wants to know them must query.
pub(super) fn of_queries(kit: &Kit) -> Result<Harness<'_>, RuleFailure> {
    of_queries_in(kit, KitRoster::Usual)
}

/// The same with this roster.
pub(super) fn of_queries_in(kit: &Kit, roster: KitRoster) -> Result<Harness<'_>, RuleFailure> {
    with_robot(
        kit,
        HarnessOptions {
            puts_states: false,
            roster,
            ..HarnessOptions::default()
        },
    )
}

/// What happens while a robot waits for the others' answers makes no difference. Nothing is found of one that queries no other one.
pub(super) fn while_asking(
    kit: &Kit,
    what: &str,
    happen: fn(&mut Harness<'_>) -> Result<(), RuleFailure>,
) -> Result<(), RuleFailure> {
    struct WhileHeld(fn(&mut Harness<'_>) -> Result<(), RuleFailure>);
    impl Disturbance for WhileHeld {
        fn before(&mut self, harness: &mut Harness<'_>, _: Tick) -> Result<(), RuleFailure> {
            harness.fake_peers.hold();
            Ok(())
        }

        fn during(&mut self, harness: &mut Harness<'_>, _: Tick) -> Result<(), RuleFailure> {
            harness.until_asking()?;
            if harness.is_open() {
                (self.0)(harness)?;
                harness.pass(UNDER_WAY);
            }
            harness.fake_peers.release();
            Ok(())
        }
    }

    let script = PlayScript {
        ticks: TICKS,
        ..PlayScript::usual(kit)
    };
    let mut straight = of_queries(kit)?;
    let expected = play(&mut straight, &script, &mut Straight)?;
    if straight.fake_peers.asked().is_empty() {
        return Ok(());
    }
    let mut harness = of_queries(kit)?;
    let played = play(&mut harness, &script, &mut WhileHeld(happen))?;
    demand_same(kit, what, &expected, &played)
}

/// A robot that waits for its news: the clock of the open tick has its flag, and its news are withheld.
pub(super) fn for_news(kit: &Kit) -> Result<Harness<'_>, RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    withhold_news(&mut harness)?;
    Ok(harness)
}

/// The next tick begins, and the robot waits for its news.
pub(super) fn withhold_news(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    // The clock says that there are news: without them the robot must not begin.
    harness.withholds_news = true;
    harness.open(&TickUpdate {
        correction: Some(Correction {
            location: harness.body.stands,
            blocked: true,
        }),
        ..TickUpdate::default()
    })?;
    harness.settle(UNDER_WAY);
    Ok(())
}

/// A robot that waits for an answer that the others hold back, if it queries others at all. With it, whether it does: the
/// last tick is then open.
pub(super) fn for_another(kit: &Kit) -> Result<(Harness<'_>, bool), RuleFailure> {
    let mut harness = of_queries(kit)?;
    // From here on no query is answered, so the robot waits in the first tick in which it asks.
    harness.fake_peers.hold();
    for _ in 0..TICKS {
        harness.open(&TickUpdate::default())?;
        let came = harness.until_asking();
        if harness.fake_peers.has_held() {
            harness.settle(UNDER_WAY);
            return Ok((harness, true));
        }
        came?;
        harness.complete()?;
    }

    Ok((harness, false))
}
