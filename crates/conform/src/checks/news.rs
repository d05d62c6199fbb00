//! News and clocks: which news a robot waits for.

use std::time::Duration;

use protocol::messages::{Correction, Point, TickUpdate};
use protocol::{Generation, Tick};

use super::waiting;
use harness::findings::Findings;
use harness::kit::{Kit, KitRoster};
use harness::report::RuleFailure;
use harness::script::{
    Disturbance, PlayScript, Straight, demand_usual, play, played_among, with_robot,
};
use harness::{Harness, HarnessOptions};

/// A report that must not come has come after this time.
const QUIET: Duration = Duration::from_millis(150);
/// A generation after that of any robot of these ticks.
const LATER_GENERATION: Generation = 9;
/// Up to this tick, news come late.
const LATE_UP_TO: Tick = 14;

/// It waits for the news of exactly this epoch and tick where its flag is set, and for no news where it is not.
pub(super) fn wait(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    /// The news of the first ticks come after their clock, and after news of other ticks and epochs.
    struct LateNews;
    impl Disturbance for LateNews {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            harness.withholds_news = tick <= LATE_UP_TO;
            Ok(())
        }

        fn during(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            let news = harness.open_news();
            if tick > LATE_UP_TO || news.is_empty() {
                return Ok(());
            }

            put_stale(harness, tick)?;
            // Time for an answer that must not come.
            harness.settle(QUIET);
            let has_answered = harness.seen.answers.iter().any(|answer| {
                let report = &answer.reading.report;
                (report.epoch, report.tick) == (news.epoch, tick)
            });
            if has_answered {
                return Err(RuleFailure::new(
                    format!(
                        "no report for tick {tick}, whose clock has its flag, before the news of tick {tick} are here"
                    ),
                    "a report",
                ));
            }
            harness.release_news()
        }
    }
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let what = "that its news come after the clock";
    demand_usual(&mut harness, what, &mut LateNews)?;

    all_flags(kit)?;
    without_others(kit)?;
    others_flags(kit)
}

/// Its flag among those of all others is its flag, also the highest one. In a large roster several share a flag, so that there may be
/// nothing new in its news.
fn all_flags(kit: &Kit) -> Result<(), RuleFailure> {
    let options = HarnessOptions {
        roster: KitRoster::Crowd,
        ..HarnessOptions::default()
    };
    let mut harness = with_robot(kit, options)?;
    play(&mut harness, &PlayScript::quiet(2), &mut Straight)?;
    harness.more_flags = u32::MAX;
    harness.withholds_news = true;
    harness.open(&TickUpdate::default())?;
    harness.pass_while(waiting::observation_time(kit, QUIET), Harness::is_open);
    if harness.has_answered(harness.next_tick() - 1) {
        return Err(RuleFailure::new(
            "no report for a clock that has its flag and those of all others, before its news are here",
            "a report",
        ));
    }
    harness.release_news()?;
    harness.complete().map(drop)
}

/// It gets through a few ticks where there is no other robot.
fn without_others(kit: &Kit) -> Result<(), RuleFailure> {
    played_among(kit, KitRoster::Alone, &PlayScript::quiet(2)).map(drop)
}

/// News of the tick before and of the epoch before, which would move the robot.
fn put_stale(harness: &Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
    let elsewhere = Some(Correction {
        location: Point::new(1.0, 1.0),
        blocked: true,
    });

    // Where they come before the clock, a robot is still in the epoch before at tick 0.
    let of_other_epoch = (tick > 0).then_some((harness.epoch() - 1, tick));
    let of_other_tick = tick.checked_sub(1).map(|before| (harness.epoch(), before));
    for (epoch, tick) in of_other_tick.into_iter().chain(of_other_epoch) {
        // In another epoch the robot was another incarnation.
        let is_of_other_epoch = epoch != harness.epoch();
        harness.put_news(&TickUpdate {
            epoch,
            tick,
            joined: is_of_other_epoch.then_some(LATER_GENERATION),
            rejoin: is_of_other_epoch.then_some(1),
            correction: elsewhere,
            ..TickUpdate::default()
        })?;
    }
    Ok(())
}

/// Flags of other robots do not concern it.
fn others_flags(kit: &Kit) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(2), &mut Straight)?;
    if harness.has_steady_senses() {
        return Ok(());
    }

    harness.more_flags = !harness.flag();
    harness.open(&TickUpdate::default())?;
    harness.complete().map(drop).map_err(|failure| RuleFailure {
        expected: "a report for a clock that has the flags of other robots only, without any news"
            .to_owned(),
        ..failure
    })
}
