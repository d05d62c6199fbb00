//! Incarnations: a process that takes over in the middle of an epoch, and one that has been replaced.

use std::time::Duration;

use protocol::messages::{Clock, News, PublicState};
use protocol::{Generation, Tick};

use crate::comparison::demand_same;
use crate::findings::Findings;
use crate::kit::Kit;
use crate::patience::PATIENCE;
use crate::report::Failure;
use crate::script::{Script, Straight, play, seated, step, usual};
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

/// A stage on which the robot has joined as a second incarnation, whose predecessor was gone after tick `last`.
fn returned(kit: &Kit, last: Tick) -> Result<Stage<'_>, Failure> {
    let mut stage = Stage::open_run(kit, Options::default())?;
    stage.prepare()?;
    stage.play_predecessor(last)?;
    bequeath(kit, &mut stage)?;
    stage.admit_first()?;
    Ok(stage)
}

/// Further welcomes are those of a second incarnation. Its predecessor has reported as usual, [`LAST`] being the last tick.
fn bequeath(kit: &Kit, stage: &mut Stage<'_>) -> Result<(), Failure> {
    let state =
        |tick| usual(kit).map(|usual| usual.iter().find(|entry| entry.tick == tick).map(state_of));

    stage.template.state_before = state(LAST - 1)?;
    stage.template.last_state = state(LAST)?;
    stage.template.stream = format!("robot/{}#{GENERATION}", stage.template.name);
    if let Some(last) = &stage.template.last_state {
        stage.template.location = last.location;
    }
    Ok(())
}

/// It waits for the news that name it, shows meanwhile what its predecessor reported, and reports as what it is.
pub(super) fn generation(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = returned(kit, LAST)?;
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
    demand_generation(&transcript)
}

fn demand_generation(transcript: &[Entry]) -> Result<(), Failure> {
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

/// The clock has gone on without it: it joins again as the process that it is, and then does what a new process does.
pub(super) fn rejoin(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let usual = Script::usual(kit);
    for _ in 0..=LAST {
        step(&mut stage, &usual, &mut Straight)?;
    }
    bequeath(kit, &mut stage)?;
    stage.miss()?;

    stage.keeps_requests = true;
    stage.open(&News::default())?;
    let expected = "another request to join when its news have its generation as `rejoin`";
    let joining = stage
        .next_join(PATIENCE)
        .map_err(|failure| Failure::new(expected, failure.came))?;
    stage.admit(&joining);
    stage.keeps_requests = false;
    let mut instances = Vec::new();
    for request in stage.seen.requests.iter().flatten() {
        instances.push(&request.instance);
    }
    instances.dedup();
    if instances.len() > 1 {
        let came = format!("{instances:?}");
        return Err(Failure::new("the same instance in all requests", came));
    }

    // Its turn is the next tick, whose news name it.
    let last = stage.next_tick() - 1;
    stage.settle(QUIET);
    let again = play(&mut stage, &Script::quiet(5), &mut Straight)?;
    demand_generation(&again)?;
    let anew = play(&mut returned(kit, last)?, &Script::quiet(5), &mut Straight)?;
    demand_same(kit, "to join again instead of a new process", &anew, &again)
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
