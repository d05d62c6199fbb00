//! Incarnations: a process that takes over in the middle of an epoch, and one that has been replaced.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::messages::{Clock, News, PublicState, Welcome};
use protocol::{Generation, Seq, Tick};

use super::ticks::check_seqs;
use super::{Findings, seated, usual};
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Entry, Script, Straight, Transcript, play};
use crate::stage::{Options, PATIENCE, Stage};

/// The last tick of the predecessor.
const LAST: Tick = 8;
const GENERATION: Generation = 2;
/// Where the simulator has the second incarnation count from.
const LAST_SEQ: Seq = 1_000_000_000;
/// So many streams and seeds are tried, for so many ticks each.
const DRAWS: u64 = 16;
const DRAWN: Tick = 12;
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
    let state = |tick| {
        usual(kit).map(|usual| {
            usual
                .iter()
                .find(|entry| entry.clock.tick == tick)
                .map(state_of)
        })
    };
    let (before, last) = (state(LAST - 1)?, state(LAST)?);
    let welcome = stage.welcome();
    let welcome = Welcome {
        generation: GENERATION,
        tick: LAST,
        stream: format!("robot/{}#{GENERATION}", welcome.name),
        location: last.as_ref().map_or(welcome.location, |last| last.location),
        last_state: last,
        state_before: before,
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
    stage.put_clock(&Clock {
        epoch: 1,
        tick: LAST + 1,
        ..Clock::default()
    })?;
    stage.settle(QUIET);
    if let Some(answer) = stage.seen.answers.first() {
        let came = format!("a report for tick {}", answer.reading.report.tick);
        return Err(Failure::new(
            "no report before a clock names its generation",
            came,
        ));
    }
    for state in welcome.state_before.iter().chain(&welcome.last_state) {
        let expected = format!(
            "asked before its first report, the state of tick {} of its welcome",
            state.tick
        );
        let came = super::queries::state(stage.state_in(1, state.tick + 1)?, &expected)?;
        if came != *state {
            return Err(Failure::new(
                expected,
                format!("the state of tick {}", came.tick),
            ));
        }
    }
    let named = Welcome {
        tick: LAST + 1,
        ..welcome
    };
    let transcript = play(&mut stage, &named, &Script::quiet(5), &mut Straight)?;
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

/// Its commands are numbered after those of all its predecessors.
pub(super) fn numbers(kit: &Kit, findings: &mut Findings) -> Result<(), Failure> {
    let (mut stage, welcome) = returned(kit)?;
    let mut script = Script::usual(kit);
    for delivery in &mut script.deliveries {
        delivery.named += LAST + 1;
        delivery.sent = delivery.sent.map(|sent| sent + LAST + 1);
    }
    let transcript = play(&mut stage, &welcome, &script, &mut Straight)?;
    check_seqs(&transcript, LAST_SEQ)?;
    let shows_chance = chance(kit)?;
    if !shows_chance && transcript.iter().all(|entry| entry.report.sent.is_empty()) {
        let reason =
            "the robot sent no command after it came back, and no chance is seen in how it moves";
        findings.skip("return.numbers", reason);
    }
    Ok(())
}

/// The stream that a welcome names decides, together with the seed, what is drawn. Returns whether the robot's moves show
/// any chance at all. Each welcome is that of a further epoch, so that one process does for all.
fn chance(kit: &Kit) -> Result<bool, Failure> {
    // Of a robot that does not repeat itself nothing can be compared.
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(false);
    }
    let mut stage = seated(kit, Options::default())?;
    let mut welcome = stage.welcome();
    let (seed, stream) = (welcome.seed, welcome.stream.clone());
    play(&mut stage, &welcome, &Script::quiet(DRAWN), &mut Straight)?;
    let mut moves = |seed, stream: String| {
        welcome = Welcome {
            epoch: welcome.epoch + 1,
            seed,
            stream,
            ..welcome.clone()
        };
        stage.rejoin = Some(welcome.clone());
        let asked = stage.seen.requests.len();
        let played = play(&mut stage, &welcome, &Script::quiet(DRAWN), &mut Straight);
        // A robot that does not start over shows nothing here; that is another rule's matter.
        let played = if stage.seen.requests.len() == asked {
            Transcript::new()
        } else {
            played?
        };
        let shown = |entry: &Entry| {
            (
                entry.report.proposal,
                entry.report.speed_mps,
                entry.report.direction_rad,
            )
        };
        Ok::<_, Failure>(played.iter().map(shown).collect::<Vec<_>>())
    };
    let (mut by_stream, mut by_seed) = (Vec::new(), Vec::new());
    for number in 1..=DRAWS {
        by_stream.push(moves(seed, format!("{stream}#{number}"))?);
        if by_stream.last().is_some_and(Vec::is_empty) {
            return Ok(false);
        }
        by_seed.push(moves(seed + number, stream.clone())?);
    }
    let is_one = |moves: &[Vec<_>]| moves.iter().all(|other| Some(other) == moves.first());
    // Only where no two are the same is it certain that chance would have shown in the others as well.
    let is_rich = |moves: &[Vec<_>]| (1..moves.len()).all(|at| !moves[..at].contains(&moves[at]));
    let expected = format!("{DRAWS} streams and {DRAWS} seeds give different moves");
    if is_rich(&by_seed) && is_one(&by_stream) {
        return Err(Failure::new(
            expected,
            "the name of the stream makes no difference, the seed does",
        ));
    }
    if is_rich(&by_stream) && is_one(&by_seed) {
        return Err(Failure::new(
            expected,
            "the seed makes no difference, the name of the stream does",
        ));
    }
    Ok(is_rich(&by_stream) && is_rich(&by_seed))
}

/// A clock that names a later incarnation: this one ends.
pub(super) fn replaced(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    play(&mut stage, &welcome, &Script::quiet(3), &mut Straight)?;
    let news = News {
        joined: Some(GENERATION),
        ..News::default()
    };
    let news = BTreeMap::from([(kit.subject(), news)]);
    stage.put_clock(&Clock {
        epoch: 1,
        tick: 4,
        news,
        end: None,
    })?;
    let expected = "its process ends, with an exit status other than 0, when a clock names a later incarnation of it";
    let status = stage.until_ended(expected, PATIENCE)?;
    if status.success() {
        return Err(Failure::new(expected, format!("{status}")));
    }
    stage.until_gone()?;
    match stage
        .seen
        .answers
        .iter()
        .find(|answer| answer.reading.report.tick == 4)
    {
        None => Ok(()),
        Some(_) => Err(Failure::new(
            "no report for a clock that names a later incarnation",
            "one for tick 4",
        )),
    }
}
