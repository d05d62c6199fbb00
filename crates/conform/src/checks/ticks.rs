//! The usual ticks, undisturbed: what every robot does, all the time.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use protocol::PROTOCOL_VERSION;
use protocol::messages::{OTHERS, Performative, Report};
use protocol::name::OPERATOR;

use super::wire;
use harness::Joining;
use harness::findings::Findings;
use harness::kit::{CannotRun, Kit};
use harness::patience::START_PATIENCE;
use harness::report::{AnswerTimes, RuleFailure};
use harness::script::{PlayScript, Straight, play, with_robot};
use harness::seen::ReportedCommand;
use harness::transcript::{PlayedTick, Transcript};
use harness::{Harness, HarnessOptions};

/// The rules that the usual ticks show.
pub(super) const USUAL: [&str; 9] = [
    "tick.answer",
    "tick.velocity",
    "join.request",
    "command.sent",
    "number.angles",
    "number.finite",
    "number.integers",
    "wire.qos",
    "wire.keys",
];

/// What a robot put beside its reports has arrived after this time.
const ECHO: Duration = Duration::from_millis(200);
/// How far an angle may be from a multiple of 1e-6 rad, in such multiples: what binary fractions leave.
const ANGLE_TOLERANCE: f64 = 1e-3;
/// What is expected of integer fields.
const WHOLE: &str = "integers without a fraction";
/// Half a turn, rounded as angles are, in units of 1e-6 rad.
const HALF_TURN: f64 = 3_141_593.0;

/// Plays the usual ticks, and keeps them for comparison. Here the robot asks to join for the first time. Returns the rule
/// that keeps the robot from getting through them, if one does.
pub(super) fn usual(
    kit: &Kit,
    findings: &mut Findings,
) -> Result<(Option<&'static str>, Option<AnswerTimes>), CannotRun> {
    let mut harness = Harness::open_run(kit, HarnessOptions::default())
        .map_err(|failure| CannotRun::Robot(failure.came))?;
    // What fails until the robot takes part is no verdict on a rule: nothing could be checked.
    let joining = harness.next_join(START_PATIENCE).map_err(cannot_run)?;
    let request = joining.request.clone().map_err(CannotRun::Robot)?;
    // Everything else needs the name, which the robot itself says first.
    kit.learn(&request)?;
    findings.settle("join.request", check_request(&harness, &joining));
    harness.prepare().map_err(cannot_run)?;
    harness.admit(joining);
    harness.keeps_requests = false;
    harness.until_ready().map_err(cannot_run)?;

    let played = play(&mut harness, &PlayScript::usual(kit), &mut Straight);
    wire::check(&harness, findings);
    let transcript = match played {
        Ok(transcript) => transcript,
        Err(failure) => {
            let broken = if harness.incomplete().is_some() {
                "command.sent"
            } else {
                "tick.answer"
            };
            findings.close(&[&[broken], &USUAL[..]].concat(), Err(failure));
            return Ok((Some(broken), None));
        }
    };
    harness.settle(ECHO);
    findings.settle("tick.answer", check_answers(&harness, &transcript));
    findings.settle("tick.velocity", check_velocities(&harness, &transcript));
    check_commands(&harness, &transcript, findings);
    check_numbers(&harness, &transcript, findings);
    findings.close(&USUAL, Ok(()));

    let times = transcript
        .iter()
        .map(|entry| entry.took.as_secs_f64() * 1e3)
        .collect();
    if kit.usual().set(transcript).is_err() {
        unreachable!("the usual ticks are played once");
    }
    Ok((None, AnswerTimes::of(times)))
}

fn cannot_run(failure: RuleFailure) -> CannotRun {
    let RuleFailure { expected, came, .. } = failure;
    CannotRun::Robot(format!("{expected}: {came}"))
}

fn expect(holds: bool, expected: String, came: String) -> Result<(), RuleFailure> {
    if holds {
        return Ok(());
    }

    Err(RuleFailure::new(expected, came))
}

/// What a request to join must contain.
fn check_request(harness: &Harness<'_>, joining: &Joining) -> Result<(), RuleFailure> {
    let Ok(request) = &joining.request else {
        return Ok(());
    };
    let version = request.protocol;
    expect(
        version == PROTOCOL_VERSION,
        format!("protocol {PROTOCOL_VERSION}"),
        format!("protocol {version}"),
    )?;

    expect(
        request.run == harness.run,
        format!("run {}, the value of CARS_RUN", harness.run),
        format!("run {}", request.run),
    )?;
    expect(
        !request.instance.is_empty(),
        "an instance that no other process has".to_owned(),
        "an empty one".to_owned(),
    )?;

    let own = harness.keys.join_as(&request.name);
    expect(
        joining.key == own,
        format!("a request at {own}"),
        format!("one at {}", joining.key),
    )
}

/// One report for each clock, and no other.
fn check_answers(harness: &Harness<'_>, transcript: &Transcript) -> Result<(), RuleFailure> {
    if let Some(unreadable) = harness.seen.unreadable.first() {
        return Err(RuleFailure::new("reports that can be read", unreadable));
    }

    for (index, answer) in harness.seen.answers.iter().enumerate() {
        let report = &answer.reading.report;
        let epoch = report.epoch;
        let tick = report.tick;
        let came = format!(
            "epoch {epoch}, tick {tick}, generation {}",
            report.generation
        );
        let granted = transcript
            .iter()
            .find(|entry| (entry.epoch, entry.tick) == (epoch, tick));
        let own = harness.generation();
        let Some(entry) = granted.filter(|_| report.generation == own) else {
            let expected = format!("reports of generation {own} for ticks that were granted");
            return Err(RuleFailure::new(expected, came));
        };
        // A clock that was repeated while its report was awaited may have been answered twice.
        if entry.index != index && !harness.repeated.contains(&(epoch, tick)) {
            return Err(RuleFailure::new(
                format!("one report for tick {tick}"),
                "more than one",
            ));
        }
    }
    Ok(())
}

/// Robots that drive ask for a velocity, and no other one does.
fn check_velocities(harness: &Harness<'_>, transcript: &Transcript) -> Result<(), RuleFailure> {
    let drives = harness.template.drive.is_some();
    for entry in transcript {
        let Report {
            velocity, proposal, ..
        } = entry.report;
        let came = match velocity {
            Some(_) if !drives => "a velocity",
            None if drives && proposal != entry.location => "another location, and no velocity",
            _ => continue,
        };
        let expected = match drives {
            true => "a velocity, or none to brake: the robot has a `drive` in its welcome",
            false => "a location and no velocity: the robot has no `drive` in its welcome",
        };
        let came = format!("{came} in tick {}", entry.tick);
        return Err(RuleFailure::new(expected, came));
    }
    Ok(())
}

/// No clock, no report.
pub(super) fn unasked(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    harness.settle(ECHO);
    let present = (harness.epoch(), harness.generation());
    let mut reports = harness
        .seen
        .answers
        .iter()
        .map(|answer| &answer.reading.report);
    // What an earlier epoch or incarnation was asked for twice may come late.
    if let Some(report) = reports.find(|report| (report.epoch, report.generation) == present) {
        let came = format!("a report for tick {}", report.tick);
        return Err(RuleFailure::new("no report before the first clock", came));
    }
    let transcript = play(&mut harness, &PlayScript::quiet(2), &mut Straight)?;
    harness.settle(ECHO);
    check_answers(&harness, &transcript)
}

/// Commands and reports fit together.
fn check_commands(harness: &Harness<'_>, transcript: &Transcript, findings: &mut Findings) {
    let has_stated = transcript.iter().any(|entry| entry.report.commands > 0);
    if !has_stated && harness.seen.commands.is_empty() {
        return findings.skip(
            "command.sent",
            "the robot sent no command in the usual ticks",
        );
    }

    let checked = check_stamps(harness, transcript);
    let checked = checked.and_then(|()| {
        transcript
            .iter()
            .try_for_each(|entry| check_tick(harness, entry))
    });
    findings.settle("command.sent", checked);
}

/// Each command can be read, is of a tick that was granted, and goes to another robot of the roster.
fn check_stamps(harness: &Harness<'_>, transcript: &Transcript) -> Result<(), RuleFailure> {
    let subject = harness.kit.subject();
    for sent in &harness.seen.commands {
        let command = match &sent.command {
            Ok(command) => command,
            Err(error) => return Err(RuleFailure::new("commands that can be read", error)),
        };

        let is_granted = transcript
            .iter()
            .any(|entry| (entry.epoch, entry.tick) == (command.epoch, command.tick));
        let is_own = sent.from == subject.as_str();
        // That the operator is not commanded is a rule of its own.
        let is_known = [OPERATOR, OTHERS].contains(&sent.to.as_str())
            || harness
                .template
                .roster
                .iter()
                .any(|name| name.as_str() == sent.to);
        let own = harness.generation();
        let is_right = command.generation == own && command.performative == Performative::Achieve;

        if !(is_granted && is_own && is_known && is_right) {
            let expected = format!(
                "commands of generation {own} and of a tick that was granted, performative achieve, from {subject} to robots \
                 of the roster"
            );
            return Err(RuleFailure::new(expected, describe(sent)));
        }
    }
    Ok(())
}

/// The commands of a tick are numbered from 1, are as many as the report states, and were put before it.
pub(super) fn check_tick(harness: &Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
    let tick = entry.tick;
    let report = harness
        .seen
        .answers
        .get(entry.index)
        .map_or(usize::MAX, |answer| answer.order);
    let mut first: BTreeMap<u32, &ReportedCommand> = BTreeMap::new();
    for sent in &harness.seen.commands {
        let Ok(command) = &sent.command else { continue };
        if (command.epoch, command.tick) != (entry.epoch, tick) {
            continue;
        }
        // One that was repeated with its clock is the same to the byte.
        let known = *first.entry(command.number).or_insert(sent);
        if known.bytes != sent.bytes || known.to != sent.to {
            let expected = format!("one command with number {} in tick {tick}", command.number);
            return Err(RuleFailure::new(expected, describe(sent)));
        }
    }

    let stated = entry.report.commands;
    let wanted: BTreeSet<u32> = (1..=stated).collect();
    let numbers: BTreeSet<u32> = first.keys().copied().collect();
    if numbers != wanted {
        return Err(RuleFailure::new(
            format!("in tick {tick} the commands 1 to {stated}, since the report states {stated}"),
            format!("commands with the numbers {numbers:?}"),
        ));
    }
    match first.values().find(|sent| sent.order > report) {
        None => Ok(()),
        Some(sent) => Err(RuleFailure::new(
            format!("the commands of tick {tick} before its report"),
            format!("after it, {}", describe(sent)),
        )),
    }
}

fn describe(sent: &ReportedCommand) -> String {
    match &sent.command {
        Ok(command) => format!(
            "from {} to {}: number {} of tick {}, epoch {}, generation {}, {}: {:?}",
            sent.from,
            sent.to,
            command.number,
            command.tick,
            command.epoch,
            command.generation,
            command.performative,
            command.command
        ),
        Err(error) => error.clone(),
    }
}

/// Angles as they are published, and numbers that are finite and written as they should be.
pub(super) fn check_numbers(
    harness: &Harness<'_>,
    transcript: &Transcript,
    findings: &mut Findings,
) {
    for answer in &harness.seen.answers {
        let tick = answer.reading.report.tick;
        if let Some(field) = answer.reading.not_numbers.first() {
            let came = format!("{field} is not finite in tick {tick}");
            findings.fail(
                "number.finite",
                RuleFailure::new("finite numbers only", came),
            );
        }
        if let Some(field) = answer.reading.not_integers.first() {
            let came = format!("{field} of the report of tick {tick}");
            findings.fail("number.integers", RuleFailure::new(WHOLE, came));
        }
    }
    if let Some(field) = harness.seen.not_integers.first() {
        let came = format!("{field} of a command");
        findings.fail("number.integers", RuleFailure::new(WHOLE, came));
    }

    for entry in transcript {
        let direction_rad = entry.report.direction_rad;
        if !is_published_angle(direction_rad) {
            let expected = "direction_rad greater than -pi and at most pi, rounded to 1e-6 rad, 0 instead of -0";
            let came = format!("{direction_rad} in tick {}", entry.tick);
            findings.fail("number.angles", RuleFailure::new(expected, came));
        }
    }
}

/// Whether an angle is rounded and within half a turn.
fn is_published_angle(angle_rad: f64) -> bool {
    let micro_rad = angle_rad * 1e6;
    let is_rounded = (micro_rad - micro_rad.round()).abs() <= ANGLE_TOLERANCE;
    let is_minus_zero = micro_rad == 0.0 && micro_rad.is_sign_negative();

    // Greater than -pi: rounded, -3.141593 is less.
    let whole = micro_rad.round();
    is_rounded && !is_minus_zero && whole > -HALF_TURN && whole <= HALF_TURN
}
