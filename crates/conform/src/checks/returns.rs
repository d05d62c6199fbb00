//! Incarnations: a process that takes over in the middle of an epoch, and one that has been replaced.

use std::time::Duration;

use protocol::messages::{Clock, News, PublicState};
use protocol::{Generation, Tick};

use crate::findings::Findings;
use crate::kit::Kit;
use crate::patience::PATIENCE;
use crate::report::Failure;
use crate::script::{Script, Straight, play, seated, usual};
use crate::stage::{Options, Stage};
use crate::transcript::Entry;

/// The last tick of the predecessor.
const LAST: Tick = 8;
const GENERATION: Generation = 2;
/// No report comes within this time where it is not the robot's turn.
const QUIET: Duration = Duration::from_millis(300);

/// What the robot reported for a tick when nothing disturbed it.
fn state_of(entry: &Entry) -> PublicState {
    let report = entry.report.clone();
    PublicState {
        epoch: report.epoch,
        tick: report.tick,
        location: entry.location,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        state_variables: report.state_variables,
        emotion_state: report.emotion_state,
        behavior_state: report.behavior_state,
    }
}

/// A stage on which the robot has joined as a second incarnation.
fn returned(kit: &Kit) -> Result<Stage<'_>, Failure> {
    let mut stage = Stage::open_run(kit, Options::default())?;
    stage.prepare()?;
    stage.play_predecessor(LAST)?;
    let state =
        |tick| usual(kit).map(|usual| usual.iter().find(|entry| entry.tick == tick).map(state_of));

    stage.template.state_before = state(LAST - 1)?;
    stage.template.last_state = state(LAST)?;
    stage.template.stream = format!("robot/{}#{GENERATION}", stage.template.name);
    if let Some(last) = &stage.template.last_state {
        stage.template.location = last.location;
    }
    stage.admit_first()?;
    Ok(stage)
}

/// It waits for the news that name it, shows meanwhile what its predecessor reported, and reports as what it is.
pub(super) fn generation(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = returned(kit)?;
    // The last tick was its predecessor's; the next one may go on without it.
    stage.repeat();
    stage.put_clock(&Clock {
        epoch: 1,
        tick: LAST + 1,
        ..Clock::default()
    })?;
    stage.settle(QUIET);
    if let Some(answer) = stage.seen.answers.first() {
        let came = format!("a report for tick {}", answer.reading.report.tick);
        return Err(Failure::new(
            "no report before its news name its generation",
            came,
        ));
    }

    let states = [
        stage.template.state_before.clone(),
        stage.template.last_state.clone(),
    ];
    for state in states.into_iter().flatten() {
        let expected = format!(
            "queried before its first report, the state of tick {} of its welcome",
            state.tick
        );
        let came = super::queries::state(stage.state_in(1, state.tick + 1)?, &expected)?;
        if came != state {
            return Err(Failure::new(
                expected,
                format!("the state of tick {}", came.tick),
            ));
        }
    }

    let transcript = play(&mut stage, &Script::quiet(5), &mut Straight)?;
    match transcript
        .iter()
        .find(|entry| entry.report.generation != GENERATION)
    {
        None => Ok(()),
        Some(entry) => {
            let came = format!("generation {}", entry.report.generation);
            Err(Failure::new(
                format!("reports of generation {GENERATION}"),
                came,
            ))
        }
    }
}

/// News that name a later incarnation: this one ends.
pub(super) fn replaced(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    play(&mut stage, &Script::quiet(3), &mut Straight)?;
    let tick = stage.next_tick();
    stage.play_successor();
    stage.open(&News::default())?;
    let expected = "its process ends, with an exit status other than 0, when its news name a later incarnation";
    let status = stage.until_ended(expected, PATIENCE)?;
    if status.success() {
        return Err(Failure::new(expected, format!("{status}")));
    }
    stage.until_gone()?;

    let has_answered = stage
        .seen
        .answers
        .iter()
        .any(|answer| answer.reading.report.tick == tick);
    if has_answered {
        return Err(Failure::new(
            "no report for a tick whose news name a later incarnation",
            format!("one for tick {tick}"),
        ));
    }
    Ok(())
}
