//! The end of a run, and of its simulator.

use std::time::Duration;

use nix::sys::signal::Signal;
use protocol::messages::{End, News};

use super::{Findings, seated};
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Script, Straight, play, step};
use crate::stage::{Options, PATIENCE, Stage};

/// A process that is told to end does so within this time. The page says 2 s; a busy machine may need more.
const END_PATIENCE: Duration = Duration::from_secs(5);
/// How long a wait lasts before the run ends during it.
const WAITING: Duration = Duration::from_millis(150);
/// Ticks within which a robot that queries others at all does so.
const TICKS: u64 = 24;
/// How long the robot is to wait for a simulator that is gone, seconds.
const GONE_S: u32 = 2;
/// A robot that waits is still there after this time.
const PATIENT: Duration = Duration::from_millis(1200);

/// However a run ends, and whatever the robot waits for: it ends, as it should.
pub(super) fn clock(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    play(&mut stage, &Script::quiet(3), &mut Straight)?;
    demand_end(&mut stage, End::Finished, "between two ticks")?;

    let mut stage = seated(kit, Options::default())?;
    play(&mut stage, &Script::quiet(3), &mut Straight)?;
    stage.withholds_news = true;
    stage.open(&News {
        sensed: stage.cast.sensed(1, 4).into_iter().collect(),
        ..News::default()
    })?;
    stage.settle(WAITING);
    demand_end(&mut stage, End::Stopped, "while it waits for its news")?;

    let mut stage = seated(
        kit,
        Options {
            puts_states: false,
            ..Options::default()
        },
    )?;
    stage.cast.hold();
    let is_asking = play_until_asking(&mut stage)?;
    let when = if is_asking {
        "while it waits for another robot's answer"
    } else {
        "between two ticks"
    };
    stage.settle(WAITING);
    demand_end(&mut stage, End::Aborted, when)
}

/// Plays ticks until the robot waits for an answer that the others hold back. Returns whether it does.
pub(super) fn play_until_asking(stage: &mut Stage<'_>) -> Result<bool, Failure> {
    for tick in 0..TICKS {
        stage.open(&News::default())?;
        let came = stage.until("a report or a query", PATIENCE, |stage| {
            (stage.cast.has_held() || !stage.is_open()).then_some(())
        });
        if stage.cast.has_held() {
            return Ok(true);
        }
        came?;
        let done = stage.complete()?;
        debug_assert_eq!(done.report.tick, tick);
    }
    Ok(false)
}

fn demand_end(stage: &mut Stage<'_>, end: End, when: &str) -> Result<(), Failure> {
    stage.put_end(end)?;
    let expected = format!("its process ends after a clock with end {end:?} {when}");
    let status = stage.until_ended(&expected, PATIENCE)?;
    if status.code() != Some(0) {
        return Err(Failure::new(
            format!("exit status 0 after a clock with end {end:?} {when}"),
            stage.process.fate(),
        ));
    }
    stage.until_gone()
}

/// It is told to end by a signal, in the middle of a run.
pub(super) fn sigterm(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    play(&mut stage, &Script::quiet(3), &mut Straight)?;
    stage.process.signal(Signal::SIGTERM);
    stage.until_ended("its process ends within 2 s of SIGTERM", END_PATIENCE)?;
    stage.until_gone()
}

/// The simulator's token goes: the robot waits for it, goes on if it comes back, and ends when its patience is over.
pub(super) fn gone(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(
        kit,
        Options {
            gone_patience_s: GONE_S,
            ..Options::default()
        },
    )?;
    let script = Script::quiet(3);
    play(&mut stage, &script, &mut Straight)?;

    let waits = format!("it waits {GONE_S} s (CARS_GONE_PATIENCE_S) for a simulator that is gone");
    stage.show_simulator(false)?;
    stage.settle(PATIENT);
    demand_running(&mut stage, &waits)?;
    stage.show_simulator(true)?;
    stage.settle(PATIENT);
    demand_running(&mut stage, "it goes on when the simulator is back in time")?;
    step(&mut stage, &script, &mut Straight)?;

    stage.show_simulator(false)?;
    stage.settle(PATIENT);
    demand_running(&mut stage, &waits)?;
    let expected = format!("its process ends when the simulator was gone for {GONE_S} s");
    let status = stage.until_ended(&expected, PATIENCE)?;
    if status.success() {
        let expected = "an exit status other than 0 when the simulator is gone";
        return Err(Failure::new(expected, format!("{status}")));
    }
    stage.until_gone()
}

fn demand_running(stage: &mut Stage<'_>, expected: &str) -> Result<(), Failure> {
    if stage.process.ended().is_none() {
        return Ok(());
    }

    Err(Failure::new(expected, stage.process.fate()))
}
