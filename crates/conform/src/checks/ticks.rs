//! The usual ticks, undisturbed: what every robot does, all the time.

use std::time::Duration;

use nix::sys::signal::Signal;
use protocol::PROTOCOL_VERSION;
use protocol::messages::{Clock, End, JoinAnswer, Performative};

use super::{Findings, seated};
use crate::kit::{CannotRun, Kit};
use crate::report::{AnswerTimes, Failure};
use crate::script::{Script, Straight, Transcript, play};
use crate::stage::{Joining, Options, PATIENCE, START_PATIENCE, Stage};

/// The rules that the usual ticks show.
pub(super) const USUAL: [&str; 6] = [
    "tick.answer",
    "join.request",
    "command.sent",
    "number.angles",
    "number.finite",
    "end.clock",
];

/// A process that is told to end does so within this time. The page says 2 s; a busy machine may need more.
const END_PATIENCE: Duration = Duration::from_secs(5);
/// Whatever a robot said beside its reports has arrived after this time.
const ECHO: Duration = Duration::from_millis(200);
/// How far an angle may be from a multiple of 1e-6 rad, in such multiples: what binary fractions leave.
const ANGLE_TOLERANCE: f64 = 1e-3;
/// Half a turn, rounded as angles are, in units of 1e-6 rad.
const HALF_TURN: f64 = 3_141_593.0;

/// Plays the usual ticks, and keeps them for comparison. It is here that the robot is met for the first time.
pub(super) fn usual(
    kit: &Kit,
    findings: &mut Findings,
) -> Result<(Result<(), Failure>, Option<AnswerTimes>), CannotRun> {
    let cannot =
        |failure: Failure| CannotRun::Robot(format!("{}: {}", failure.expected, failure.came));
    let mut stage =
        Stage::open(kit, Options::default()).map_err(|failure| CannotRun::Robot(failure.came))?;
    let joining = stage.next_join(START_PATIENCE).map_err(cannot)?;
    let request = joining.request.clone().map_err(CannotRun::Robot)?;
    kit.learn(&request)?;
    findings.settle("join.request", check_request(&stage, &joining));
    stage.prepare().map_err(cannot)?;
    let welcome = stage.welcome();
    stage.answer_join(&joining, &JoinAnswer::Welcome(Box::new(welcome.clone())));
    stage.until_ready().map_err(cannot)?;

    let played = play(&mut stage, &welcome, &Script::usual(kit), &mut Straight);
    let transcript = match played {
        Ok(transcript) => transcript,
        Err(failure) => return Ok((Err(failure), None)),
    };
    let last = transcript
        .last()
        .map(|entry| entry.clock.clone())
        .unwrap_or_default();
    stage.settle(ECHO);
    findings.settle("end.clock", check_end(&mut stage, &last));
    findings.settle("tick.answer", check_answers(&stage, &transcript));
    check_sent(&stage, &transcript, findings);
    check_numbers(&stage, &transcript, findings);
    let times = transcript
        .iter()
        .map(|entry| entry.took.as_secs_f64() * 1e3)
        .collect();
    if kit.usual.set(transcript).is_err() {
        unreachable!("the usual ticks are played once");
    }
    Ok((Ok(()), AnswerTimes::of(times)))
}

/// What a request to join must say.
fn check_request(stage: &Stage<'_>, joining: &Joining) -> Result<(), Failure> {
    let Ok(request) = &joining.request else {
        return Ok(());
    };
    let expect = |holds: bool, expected: String, came: String| {
        if holds {
            Ok(())
        } else {
            Err(Failure::new(expected, came))
        }
    };
    let version = request.protocol;
    expect(
        version == PROTOCOL_VERSION,
        format!("protocol {PROTOCOL_VERSION}"),
        format!("protocol {version}"),
    )?;
    expect(
        request.run == stage.run,
        format!("run {}, as CARS_RUN says", stage.run),
        format!("run {}", request.run),
    )?;
    let instance = "an instance that tells this process from all others";
    expect(
        !request.instance.is_empty(),
        instance.to_owned(),
        "an empty one".to_owned(),
    )?;
    let own = stage.keys.join_as(&request.name);
    expect(
        joining.key == own,
        format!("a request at {own}"),
        format!("one at {}", joining.key),
    )
}

/// One report for each clock, and none else.
fn check_answers(stage: &Stage<'_>, transcript: &Transcript) -> Result<(), Failure> {
    if let Some(unreadable) = stage.seen.unreadable.first() {
        return Err(Failure::new("reports that can be read", unreadable));
    }
    let generation = stage.welcome().generation;
    for (index, answer) in stage.seen.answers.iter().enumerate() {
        let report = &answer.reading.report;
        let (epoch, tick) = (report.epoch, report.tick);
        let came = format!(
            "epoch {epoch}, tick {tick}, generation {}",
            report.generation
        );
        let Some(entry) = transcript.iter().find(|entry| entry.clock.tick == tick) else {
            return Err(Failure::new("reports for ticks that were granted", came));
        };
        let (wanted, tick) = (entry.clock.epoch, entry.clock.tick);
        if (epoch, report.generation) != (wanted, generation) {
            let expected = format!("epoch {wanted}, tick {tick}, generation {generation}");
            return Err(Failure::new(expected, came));
        }
        // A clock that was repeated while it was awaited may have been answered twice.
        if entry.index != index && !stage.repeated.contains(&(wanted, tick)) {
            return Err(Failure::new(
                format!("one report for tick {tick}"),
                "more than one",
            ));
        }
    }
    Ok(())
}

/// What it commands, its reports list.
fn check_sent(stage: &Stage<'_>, transcript: &Transcript, findings: &mut Findings) {
    let has_sent = transcript.iter().any(|entry| !entry.report.sent.is_empty());
    if !has_sent && stage.seen.commands.is_empty() {
        return findings.skip(
            "command.sent",
            "the robot sent no command in the usual ticks",
        );
    }
    findings.settle(
        "command.sent",
        check_seqs(transcript, 0).and_then(|()| match_sent(stage, transcript)),
    );
}

/// What reports list is numbered from `last_seq` on, without a gap.
pub(super) fn check_seqs(transcript: &Transcript, last_seq: u64) -> Result<(), Failure> {
    for (seq, Entry { tick, sent }) in (last_seq + 1..).zip(transcript.iter().flat_map(Entry::of)) {
        if sent.seq != seq || sent.performative != Performative::Achieve {
            let expected = format!("seq {seq}, performative achieve, in tick {tick}");
            let came = format!("seq {}, performative {}", sent.seq, sent.performative);
            return Err(Failure::new(expected, came));
        }
    }
    Ok(())
}

/// Each command that a report lists was put, and each that was put is listed.
fn match_sent(stage: &Stage<'_>, transcript: &Transcript) -> Result<(), Failure> {
    let mut listed = Vec::new();
    for Entry { tick, sent } in transcript.iter().flat_map(Entry::of) {
        let matches = |came: &&crate::stage::Sent| {
            came.command.as_ref().is_ok_and(|command| {
                came.to == sent.to.as_str()
                    && (command.seq, command.tick) == (sent.seq, tick)
                    && (command.performative, &command.command)
                        == (sent.performative, &sent.command)
            })
        };
        if stage.seen.commands.iter().find(matches).is_none() {
            let expected = format!(
                "command {} of tick {tick} on the key of {}, as the report lists it",
                sent.seq, sent.to
            );
            let came = stage
                .seen
                .commands
                .iter()
                .map(describe)
                .collect::<Vec<_>>()
                .join("; ");
            return Err(Failure::new(
                expected,
                if came.is_empty() {
                    "no command at all".into()
                } else {
                    came
                },
            ));
        }
        listed.push((sent.to.as_str(), sent.seq));
    }
    let is_unlisted = |came: &&crate::stage::Sent| {
        !came
            .command
            .as_ref()
            .is_ok_and(|command| listed.contains(&(came.to.as_str(), command.seq)))
    };
    match stage.seen.commands.iter().find(is_unlisted) {
        None => Ok(()),
        Some(came) => Err(Failure::new(
            "a report that lists each command",
            describe(came),
        )),
    }
}

/// A command in a report.
struct Entry<'t> {
    tick: u64,
    sent: &'t protocol::messages::SentCommand,
}

impl<'t> Entry<'t> {
    fn of(entry: &'t crate::script::Entry) -> impl Iterator<Item = Self> {
        entry.report.sent.iter().map(|sent| Self {
            tick: entry.clock.tick,
            sent,
        })
    }
}

fn describe(sent: &crate::stage::Sent) -> String {
    match &sent.command {
        Ok(command) => {
            format!(
                "to {}: seq {} of tick {}: {:?}",
                sent.to, command.seq, command.tick, command.command
            )
        }
        Err(error) => error.clone(),
    }
}

/// Angles as they are published, and numbers that are numbers.
fn check_numbers(stage: &Stage<'_>, transcript: &Transcript, findings: &mut Findings) {
    for answer in &stage.seen.answers {
        let tick = answer.reading.report.tick;
        if let Some(field) = answer.reading.not_numbers.first() {
            let came = format!("{field} is none in tick {tick}");
            findings.fail("number.finite", Failure::new("finite numbers only", came));
        }
    }
    for entry in transcript {
        let (micro, tick) = (entry.report.direction_rad * 1e6, entry.clock.tick);
        let is_rounded = (micro - micro.round()).abs() <= ANGLE_TOLERANCE;
        let is_minus_zero = micro == 0.0 && micro.is_sign_negative();
        if !is_rounded || is_minus_zero || micro.round().abs() > HALF_TURN {
            let expected = "direction_rad from -pi to pi, rounded to 1e-6 rad, 0 instead of -0";
            let came = format!("{} in tick {tick}", entry.report.direction_rad);
            findings.fail("number.angles", Failure::new(expected, came));
        }
    }
}

/// The end of the run: it goes, as it should.
fn check_end(stage: &mut Stage<'_>, last: &Clock) -> Result<(), Failure> {
    let end = Clock {
        end: Some(End::Finished),
        news: [].into(),
        ..last.clone()
    };
    stage.put_clock(&end)?;
    let status = stage.until_ended(
        "its process ends after the clock that ends the run",
        PATIENCE,
    )?;
    if status.code() != Some(0) {
        return Err(Failure::new(
            "exit status 0 after the clock that ends the run",
            stage.process.fate(),
        ));
    }
    stage.until_gone()
}

/// Told to end by a signal, in the middle of a run.
pub(super) fn sigterm(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    play(&mut stage, &welcome, &Script::quiet(3), &mut Straight)?;
    stage.process.signal(Signal::SIGTERM);
    stage.until_ended("its process ends within 2 s of SIGTERM", END_PATIENCE)?;
    stage.until_gone()
}
