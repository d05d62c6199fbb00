//! The end of a run, and of its simulator.

use std::time::Duration;

use nix::sys::signal::Signal;
use protocol::messages::{Clock, End};

use super::{repeated, returns, waiting};
use harness::findings::Findings;
use harness::kit::Kit;
use harness::patience::{PATIENCE, in_each_attempt};
use harness::report::RuleFailure;
use harness::script::{Disturbance, PlayScript, Straight, demand_usual, play, step, with_robot};
use harness::transcript::PlayedTick;
use harness::{Harness, HarnessOptions};

/// A process ends within this time after SIGTERM. The page allows 2 s; signals and the kernel need some, too.
const END_PATIENCE: Duration = Duration::from_secs(5);
/// How long the robot is to wait for a simulator that is gone where it comes back, or where the wait is to end, seconds.
const GONE_S: u32 = 2;
/// The same where the wait is not to end.
const LONG_GONE_S: u32 = 60;
/// How long its token is away while the robot waits for an answer.
const BRIEFLY: Duration = Duration::from_millis(50);
/// The tick after which the simulator is gone.
const CUT_AFTER: u64 = 12;
/// How long the simulator's token is away: longer than any lease, as after a cut.
const CUT: Duration = Duration::from_secs(7);

/// However a run ends, and whatever the robot waits for: it ends, as it should.
pub(super) fn clock(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    for end in [End::Finished, End::Stopped, End::Aborted] {
        let mut harness = with_robot(kit, HarnessOptions::default())?;
        play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
        demand_end(&mut harness, end, "between two ticks")?;
    }

    // The robot may have missed that another epoch began, or be in one that has no clock yet.
    for when in [
        "of a later epoch",
        "of an earlier epoch",
        "of its last tick",
    ] {
        let mut harness = with_robot(kit, HarnessOptions::default())?;
        play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
        let (epoch, tick) = match when {
            "of a later epoch" => (harness.epoch() + 1, 0),
            "of an earlier epoch" => (harness.epoch() - 1, 0),
            _ => (harness.epoch(), harness.next_tick() - 1),
        };
        let clock = Clock {
            epoch,
            tick,
            end: Some(End::Stopped),
            ..Clock::default()
        };
        demand_ended(&mut harness, &clock, when)?;
    }

    // The end must also reach a robot that waits: nothing else would ever end its wait.
    let mut harness = waiting::for_news(kit)?;
    demand_end(&mut harness, End::Stopped, "while it waits for its news")?;

    let mut harness = returns::returned_once(kit)?;
    let when = "while it waits for the news that name it";
    demand_end(&mut harness, End::Stopped, when)?;

    let (mut harness, is_asking) = waiting::for_another(kit)?;
    if is_asking {
        let when = "while it waits for another robot's answer";
        demand_end(&mut harness, End::Aborted, when)?;
    }
    Ok(())
}

fn demand_end(harness: &mut Harness<'_>, end: End, when: &str) -> Result<(), RuleFailure> {
    let clock = harness.end(end);
    demand_ended(harness, &clock, when)
}

/// It ends after this clock.
fn demand_ended(harness: &mut Harness<'_>, clock: &Clock, when: &str) -> Result<(), RuleFailure> {
    let end = clock.end.unwrap_or(End::Stopped);
    let expected = format!("its process ends after a clock with end {end:?} {when}");
    let status = harness.until_ended_by(clock, &expected)?;
    if status.code() != Some(0) {
        return Err(RuleFailure::new(
            format!("exit status 0 after a clock with end {end:?} {when}"),
            harness.process.fate(),
        ));
    }
    harness.until_gone()
}

/// It is asked to end by a signal, in the middle of a run, whatever it waits for.
pub(super) fn sigterm(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    let (asking, _) = waiting::for_another(kit)?;

    for (mut harness, when) in [
        (harness, "between two ticks"),
        (waiting::for_news(kit)?, "while it waits for its news"),
        (
            asking,
            "while it waits for another robot's answer, if it queries any",
        ),
    ] {
        harness.process.signal(Signal::SIGTERM);
        let expected = format!("its process ends within 2 s of SIGTERM {when}");
        harness.until_ended(&expected, END_PATIENCE)?;
        harness.until_gone()?;
    }
    Ok(())
}

/// A robot that lost its simulator, and is to wait so long for it.
fn without_simulator(kit: &Kit, gone_patience_s: u32) -> Result<Harness<'_>, RuleFailure> {
    let options = HarnessOptions {
        gone_patience_s,
        ..HarnessOptions::default()
    };
    let mut harness = with_robot(kit, options)?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    harness.show_simulator(false)?;
    Ok(harness)
}

/// It does not end before its patience is over, and goes on where it was. There is so much patience that no machine uses it up
/// meanwhile.
pub(super) fn gone_for_a_while(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct SimulatorAway;
    impl Disturbance for SimulatorAway {
        fn after(
            &mut self,
            harness: &mut Harness<'_>,
            entry: &PlayedTick,
        ) -> Result<(), RuleFailure> {
            if entry.tick != CUT_AFTER {
                return Ok(());
            }
            harness.show_simulator(false)?;
            harness.pass(CUT);
            let expected = format!(
                "it waits {LONG_GONE_S} s (CARS_GONE_PATIENCE_S) for a simulator that is gone"
            );
            demand_running(harness, &expected)?;
            harness.show_simulator(true)?;
            repeated::demand_last_two(harness, entry)?;
            repeated::repeat(harness, entry)
        }
    }
    let options = HarnessOptions {
        gone_patience_s: LONG_GONE_S,
        ..HarnessOptions::default()
    };
    let mut harness = with_robot(kit, options)?;
    let what = format!("that the simulator was gone for {} s", CUT.as_secs());
    demand_usual(&mut harness, &what, &mut SimulatorAway)?;
    waiting::while_asking(
        kit,
        "that the simulator was gone while it waits for an answer",
        |harness| {
            harness.show_simulator(false)?;
            harness.pass(BRIEFLY);
            harness.show_simulator(true).map(drop)
        },
    )
}

/// The simulator is back before the robot's patience is over, and the time is over when its patience would have been.
pub(super) fn back_in_time(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    in_each_attempt(|scale| back_within(kit, GONE_S * scale))
}

fn back_within(kit: &Kit, gone_patience_s: u32) -> Result<(), RuleFailure> {
    let mut harness = without_simulator(kit, gone_patience_s)?;
    let patience = Duration::from_secs(gone_patience_s.into());
    harness.pass(patience / 4);
    harness.show_simulator(true)?;
    // Until after its patience would have been over.
    harness.pass(patience);
    demand_running(
        &mut harness,
        "it goes on when the simulator is back in time, and waits no longer",
    )?;
    // It has all of its patience again.
    harness.show_simulator(false)?;
    harness.pass(patience / 4);
    harness.show_simulator(true)?;
    demand_running(
        &mut harness,
        "it waits as long when the simulator is gone a second time",
    )?;
    step(&mut harness, &PlayScript::quiet(1), &mut Straight).map(drop)
}

/// The clock stands still, and the simulator is there: a person may have paused the run.
pub(super) fn paused(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct Pause;
    impl Disturbance for Pause {
        fn after(
            &mut self,
            harness: &mut Harness<'_>,
            entry: &PlayedTick,
        ) -> Result<(), RuleFailure> {
            if entry.tick == CUT_AFTER {
                harness.pass(waiting::LONG);
                demand_running(
                    harness,
                    "it waits for the next clock while the simulator is there",
                )?;
            }
            Ok(())
        }
    }
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let what = format!("that no clock comes for {} s", waiting::LONG.as_secs());
    demand_usual(&mut harness, &what, &mut Pause)
}

/// The simulator does not come back, also where the robot waits for its news.
pub(super) fn gone_forever(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = without_simulator(kit, GONE_S)?;
    // Tokens that are left now are the robot's: it has one.
    let left = harness.tokens_of_others()?;
    if let Some(key) = left.first() {
        let expected = "the robot's own token, and none of the simulator or of another robot";
        findings.fail("wire.keys", RuleFailure::new(expected, key));
    }
    demand_given_up(&mut harness)?;

    let options = HarnessOptions {
        gone_patience_s: GONE_S,
        ..HarnessOptions::default()
    };
    let mut harness = with_robot(kit, options)?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    waiting::withhold_news(&mut harness)?;
    harness.show_simulator(false)?;
    demand_given_up(&mut harness)
}

/// It ends when its patience with a simulator that is gone is over.
fn demand_given_up(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    let expected = format!("its process ends when the simulator was gone for {GONE_S} s");
    let patience = PATIENCE + Duration::from_secs(GONE_S.into());
    let status = harness.until_ended(&expected, patience)?;
    if status.success() {
        let expected = "an exit status other than 0 when the simulator is gone";
        return Err(RuleFailure::new(expected, format!("{status}")));
    }
    harness.until_gone()
}

fn demand_running(harness: &mut Harness<'_>, expected: &str) -> Result<(), RuleFailure> {
    if harness.process.ended().is_none() {
        return Ok(());
    }

    Err(RuleFailure::new(expected, harness.process.fate()))
}
