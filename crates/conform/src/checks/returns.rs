//! Incarnations: a process that takes over in the middle of an epoch, and one that has been replaced.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::messages::{Clock, News, PublicState, Welcome};
use protocol::{Generation, Seq, Tick};

use super::ticks::match_sent;
use super::{Findings, seated, usual};
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Entry, Script, Straight, play};
use crate::stage::{Options, PATIENCE, Stage};

/// The last tick of the predecessor.
const LAST: Tick = 8;
const GENERATION: Generation = 2;
/// Where the simulator has the second incarnation count from.
const LAST_SEQ: Seq = 1_000_000_000;
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
fn returned(kit: &Kit) -> Result<(Stage<'_>, Welcome), Failure> {
    let mut stage = Stage::open(kit, Options::default())?;
    let last = usual(kit)?.iter().find(|entry| entry.clock.tick == LAST).map(state_of);
    let welcome = stage.welcome();
    let welcome = Welcome {
        generation: GENERATION,
        tick: LAST,
        stream: format!("robot/{}#{GENERATION}", welcome.name),
        location: last.as_ref().map_or(welcome.location, |last| last.location),
        last_state: last,
        last_seq: LAST_SEQ,
        ..welcome
    };
    stage.cast.begin(1, LAST);
    stage.join(&welcome)?;
    Ok((stage, welcome))
}

/// It waits for the clock that names it, shows meanwhile what its predecessor reported, and reports as what it is.
pub(super) fn generation(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let (mut stage, welcome) = returned(kit)?;
    // The tick under way is its predecessor's, or goes on without it.
    stage.put_clock(&Clock { epoch: 1, tick: LAST + 1, ..Clock::default() })?;
    stage.settle(QUIET);
    if let Some(answer) = stage.seen.answers.first() {
        let came = format!("a report for tick {}", answer.reading.report.tick);
        return Err(Failure::new("no report before a clock names its generation", came));
    }
    if let Some(last) = &welcome.last_state {
        let expected = "asked before its first report, the state that its welcome carries";
        let came = super::queries::state(stage.state_in(1, LAST + 1)?, expected)?;
        if came != *last {
            return Err(Failure::new(expected, format!("the state of tick {}", came.tick)));
        }
    }
    let named = Welcome { tick: LAST + 1, ..welcome };
    let transcript = play(&mut stage, &named, &Script::quiet(5), &mut Straight)?;
    match transcript.iter().find(|entry| entry.report.generation != GENERATION) {
        None => Ok(()),
        Some(entry) => {
            let came = format!("generation {}", entry.report.generation);
            Err(Failure::new(format!("reports of generation {GENERATION}"), came))
        }
    }
}

/// Its commands are numbered after those of all its predecessors.
pub(super) fn numbers(kit: &Kit, findings: &mut Findings) -> Result<(), Failure> {
    let (mut stage, welcome) = returned(kit)?;
    let mut script = Script::usual(kit);
    for delivery in &mut script.deliveries {
        delivery.named += LAST + 1;
        delivery.sent = delivery.sent.map(|sent| sent + LAST + 1);
    }
    let transcript = play(&mut stage, &welcome, &script, &mut Straight)?;
    if transcript.iter().all(|entry| entry.report.sent.is_empty()) {
        findings.skip("return.numbers", "the robot sent no command after it came back");
        return Ok(());
    }
    stage.settle(QUIET);
    match_sent(&stage, &transcript, LAST_SEQ)
}

/// A clock that names a later incarnation: this one ends.
pub(super) fn replaced(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    play(&mut stage, &welcome, &Script::quiet(3), &mut Straight)?;
    let news = News { joined: Some(GENERATION), ..News::default() };
    let news = BTreeMap::from([(kit.subject(), news)]);
    stage.put_clock(&Clock { epoch: 1, tick: 4, news, end: None })?;
    stage.until_ended("its process ends when a clock names a later incarnation of it", PATIENCE)?;
    stage.until_gone()?;
    match stage.seen.answers.iter().find(|answer| answer.reading.report.tick == 4) {
        None => Ok(()),
        Some(_) => {
            Err(Failure::new("no report for a clock that names a later incarnation", "one for tick 4"))
        }
    }
}
