//! Incarnations: a process that takes over in the middle of an epoch, and one that has been replaced.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use protocol::keys::STATE;
use protocol::messages::{Clock, Correction, PublicState, Refusal, TickUpdate, Welcome};
use protocol::{Generation, Tick, encode};
use serde_json::Value;

use super::waiting;
use harness::comparison::{demand_same, is_same};
use harness::findings::Findings;
use harness::kit::Kit;
use harness::patience::PATIENCE;
use harness::report::RuleFailure;
use harness::script::{
    ArrivingCommand, PlayScript, Straight, inherit, play, played, reseeds_at, usual, with_robot,
};
use harness::transcript::{PlayedTick, Transcript};
use harness::{Harness, HarnessOptions};

/// The last tick of the predecessor.
const LAST: Tick = 8;
const GENERATION: Generation = 2;
/// A generation that no two bytes hold: what they keep of it is [`GENERATION`].
const LARGE_GENERATION: Generation = (1 << 16) + GENERATION;
/// How many requests of a robot that joins again have no answer, at least.
const UNANSWERED: usize = 4;
/// Ticks that a further incarnation is played.
const TICKS: Tick = 5;
/// Ticks of an incarnation that is to leave nothing behind to the next one.
const BUSY: Tick = 20;
/// Streams of a further incarnation, of which a robot cannot know the names.
const STREAMS: [&str; 3] = ["one", "other", "further"];
/// By how much numbers of another welcome differ.
pub(super) const SHRUNK: f64 = 0.875;
/// No report comes within this time where it is not the robot's turn.
const QUIET: Duration = Duration::from_millis(300);

/// A harness on which the robot has joined in the place of incarnations that were gone after these ticks, of which the last one
/// has reported this. Its welcome may have changes.
fn returned<'k>(
    kit: &'k Kit,
    last_ticks: &[Tick],
    reported: &[PlayedTick],
    change: impl FnOnce(&mut Welcome),
) -> Result<Harness<'k>, RuleFailure> {
    returned_after(kit, last_ticks, 0, reported, change)
}

/// The same after so many more that no tick has named.
fn returned_after<'k>(
    kit: &'k Kit,
    last_ticks: &[Tick],
    unnamed: Generation,
    reported: &[PlayedTick],
    change: impl FnOnce(&mut Welcome),
) -> Result<Harness<'k>, RuleFailure> {
    let mut harness = Harness::open_run(kit, HarnessOptions::default())?;
    harness.prepare()?;
    for last in last_ticks {
        harness.play_predecessor(*last)?;
    }
    harness.pass_incarnations(unnamed);
    let generation = harness.generation() + 1;
    inherit(&mut harness, reported, generation);
    change(&mut harness.template);
    // What it does must not depend on the moment when it asks.
    harness.asks_early = true;
    harness.admit_first()?;
    Ok(harness)
}

/// What it reports in the first ticks of an incarnation whose welcome has changes.
fn played_returned(
    kit: &Kit,
    reported: &[PlayedTick],
    change: impl FnOnce(&mut Welcome),
) -> Result<Transcript, RuleFailure> {
    let mut harness = returned(kit, &[LAST], reported, change)?;
    play(&mut harness, &PlayScript::quiet(TICKS), &mut Straight)
}

/// A further incarnation that waits for the news that name it.
pub(super) fn returned_once(kit: &Kit) -> Result<Harness<'_>, RuleFailure> {
    let mut harness = returned(kit, &[LAST], first_ticks(kit)?, |_| ())?;
    harness.settle(QUIET);
    Ok(harness)
}

/// The usual ticks up to [`LAST`].
fn first_ticks(kit: &Kit) -> Result<&[PlayedTick], RuleFailure> {
    let usual = usual(kit)?;
    let last = usual.iter().position(|entry| entry.tick == LAST);
    Ok(&usual[..=last.unwrap_or_default()])
}

/// It waits for the news that name it, shows meanwhile what its predecessor reported, and reports as what it is.
pub(super) fn generation(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let first_ticks = first_ticks(kit)?;
    // Tick 0 is the turn of a first incarnation only.
    generation_after(kit, 0, &first_ticks[..1], GENERATION)?;
    generation_after(kit, LAST, first_ticks, LARGE_GENERATION)
}

/// The same of this generation, after the last tick of its predecessor, which has reported this.
fn generation_after(
    kit: &Kit,
    last: Tick,
    reported: &[PlayedTick],
    generation: Generation,
) -> Result<(), RuleFailure> {
    let unnamed = generation - GENERATION;
    let mut harness = returned_after(kit, &[last], unnamed, reported, |_| ())?;
    // The last tick was its predecessor's; the next one may go on without it.
    harness.repeat();
    harness.put_clock(&Clock {
        epoch: 1,
        tick: last + 1,
        ..Clock::default()
    })?;
    // Nor is it the turn of an incarnation that is placed and not named, or whose predecessor is named.
    for joined in [None, Some(generation - 1)] {
        harness.put_news(&TickUpdate {
            epoch: 1,
            tick: last + 1,
            joined,
            correction: Some(Correction {
                location: harness.template.location,
                blocked: false,
            }),
            ..TickUpdate::default()
        })?;
        harness.put_clock(&Clock {
            epoch: 1,
            tick: last + 1,
            news: harness.flag(),
            ..Clock::default()
        })?;
    }
    harness.settle(QUIET);
    if let Some(answer) = harness.seen.answers.first() {
        let came = format!("a report for tick {}", answer.reading.report.tick);
        return Err(RuleFailure::new(
            "no report before its news name its generation",
            came,
        ));
    }

    demand_inherited(&mut harness)?;

    let transcript = play(&mut harness, &PlayScript::quiet(5), &mut Straight)?;
    demand_generation(&transcript, generation)?;

    // That its predecessor was to join again does not concern it.
    let asked = harness.seen.requests.len();
    harness.put_news(&TickUpdate {
        epoch: 1,
        tick: harness.next_tick() - 1,
        rejoin: Some(generation - 1),
        ..TickUpdate::default()
    })?;
    harness.settle(QUIET);
    if harness.seen.requests.len() > asked {
        return Err(RuleFailure::new(
            "no request to join for news with the `rejoin` of its predecessor",
            "one more",
        ));
    }
    let transcript = play(&mut harness, &PlayScript::quiet(2), &mut Straight)?;
    demand_generation(&transcript, generation)
}

/// Until its first report it shows what its predecessor reported, and the last of it where no tick is named.
fn demand_inherited(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    let states = [
        harness.template.state_before.clone(),
        harness.template.last_state.clone(),
    ];
    for state in states.iter().flatten() {
        let parameters = format!("epoch={};tick={}", state.epoch, state.tick + 1);
        demand_shown(harness, &parameters, state)?;
    }
    match &states[1] {
        Some(last) => demand_shown(harness, "", last),
        None => Ok(()),
    }
}

/// It shows this state, queried in this way, once it has read its welcome.
fn demand_shown(
    harness: &mut Harness<'_>,
    parameters: &str,
    state: &PublicState,
) -> Result<(), RuleFailure> {
    let expected = format!(
        "queried with {parameters:?} before its first report, the state of tick {} of its welcome",
        state.tick
    );
    let mut came = RuleFailure::maybe_of_load(&expected, "no answer");
    let shown = harness.until(&expected, PATIENCE, |harness| {
        match harness
            .ask(STATE, parameters)
            .and_then(|answer| super::queries::state(answer, &expected))
        {
            Ok(shown) => Some(shown),
            Err(failure) => {
                came = failure;
                None
            }
        }
    });
    match shown {
        Err(_) => Err(came),
        Ok(shown) if shown == *state => Ok(()),
        Ok(shown) => {
            let came = format!("the state of tick {}", shown.tick);
            Err(RuleFailure::new(expected, came))
        }
    }
}

fn demand_generation(transcript: &[PlayedTick], generation: Generation) -> Result<(), RuleFailure> {
    match transcript
        .iter()
        .find(|entry| entry.report.generation != generation)
    {
        None => Ok(()),
        Some(entry) => {
            let came = format!("generation {}", entry.report.generation);
            Err(RuleFailure::new(
                format!("reports of generation {generation}"),
                came,
            ))
        }
    }
}

/// The clock has gone on without it: it joins again as the process that it is, and then does what a new process does. And once more.
pub(super) fn rejoin(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let mut reported = play(&mut harness, &PlayScript::busy(kit, LAST), &mut Straight)?;
    let mut last_ticks = Vec::new();
    // A robot may refuse such numbers, and end.
    let changed = played_returned(kit, &reported, change_parameters);
    let takes_change = changed.is_ok();
    if let Ok(changed) = changed {
        let alone = played_returned(kit, &reported, |welcome| {
            change_parameters(welcome);
            welcome.earlier_parameters.clear();
        })?;
        demand_same(
            kit,
            "`earlier_parameters` beside `parameters` that it takes",
            &alone,
            &changed,
        )?;
    }
    for generation in [harness.generation() + 1, harness.generation() + 2] {
        // The welcome of the further incarnation is set before the barrier asks for it.
        inherit(&mut harness, &reported, generation);
        let next = harness.next_tick();
        // What it draws before shows what is left of its random numbers.
        let seeds = [(next + TICKS, u64::from(generation))];
        harness.template.reseeds = reseeds_at(seeds);
        if takes_change {
            change_parameters(&mut harness.template);
        }
        join_again(&mut harness)?;
        last_ticks.push(harness.next_tick() - 1);
        // Its turn is the next tick, whose news name it.
        harness.settle(QUIET);
        demand_inherited(&mut harness)?;
        let script = PlayScript::quiet(BUSY).busy_until(kit, harness.next_tick() + BUSY);
        let again = play(&mut harness, &script, &mut Straight)?;
        demand_generation(&again, generation)?;
        harness.demand_token_kept("it joins again")?;

        // What a new process does in the same place is what it has to do.
        let mut anew = returned(kit, &last_ticks, &reported, |welcome| {
            let Welcome {
                stream,
                parameters,
                earlier_parameters,
                reseeds,
                ..
            } = &harness.template;
            welcome.stream.clone_from(stream);
            welcome.parameters.clone_from(parameters);
            welcome.earlier_parameters.clone_from(earlier_parameters);
            welcome.reseeds.clone_from(reseeds);
        })?;
        let anew = play(&mut anew, &script, &mut Straight)?;
        demand_same(kit, "to join again instead of a new process", &anew, &again)?;
        reported = again;
    }

    // It is lost again before it had its turn.
    join_again(&mut harness)?;
    let lost = harness.generation();
    // Its welcome is here before the news: they come on ways of their own.
    harness.settle(QUIET);
    join_again(&mut harness)?;
    let again = play(&mut harness, &PlayScript::quiet(1), &mut Straight)?;
    demand_generation(&again, harness.generation())?;
    let mut answers = harness.seen.answers.iter();
    match answers.find(|answer| answer.reading.report.generation == lost) {
        None => Ok(()),
        Some(answer) => Err(RuleFailure::new(
            "no report for news that name its generation as `joined` and as `rejoin`",
            format!("one for tick {}", answer.reading.report.tick),
        )),
    }
}

/// Changes its parameters in the middle of an epoch, as the scenario or a person may.
fn change_parameters(welcome: &mut Welcome) {
    let before = welcome.parameters.clone();
    welcome.earlier_parameters.insert(0, before);
    welcome.parameters.values_mut().for_each(shrink);
}

/// Makes all numbers with a fraction smaller; whole ones may be counts.
pub(super) fn shrink(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(shrink),
        Value::Object(fields) => fields.values_mut().for_each(shrink),
        Value::Number(number) => {
            if let Some(float) = number.as_f64().filter(|_| number.is_f64()) {
                *value = (float * SHRUNK).into();
            }
        }
        _ => {}
    }
}

/// The robot misses a tick, its news ask it to join again, and it does, as the process that it is, also where the first requests have
/// no answer.
fn join_again(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    lose(harness)?;
    // A first incarnation is kept waiting for longer than a robot that gives up would ask.
    let silence = match harness.generation() {
        1 => waiting::observation_time(harness.kit, Duration::ZERO),
        _ => Duration::ZERO,
    };
    let begun = Instant::now();
    let mut unanswered = 0;
    while unanswered < UNANSWERED || begun.elapsed() < silence {
        drop(harness.next_rejoin()?);
        unanswered += 1;
    }
    let joining = harness.next_rejoin()?;
    // That may become its own: only the answer decides whether it has been replaced.
    harness.put_news(&TickUpdate {
        epoch: harness.epoch(),
        tick: harness.next_tick(),
        joined: Some(harness.generation() + 1),
        correction: Some(harness.body.confirmed()),
        ..TickUpdate::default()
    })?;
    harness.settle(QUIET);
    harness.admit(joining);
    harness.keeps_requests = false;

    demand_same_process(harness)
}

/// It asked to join again as the process that it is, and for the same.
pub(super) fn demand_same_process(harness: &Harness<'_>) -> Result<(), RuleFailure> {
    let expected = "further requests to join like the first one, also with the same instance";
    let mut first = None;
    for request in &harness.seen.requests {
        let request = request.as_ref();
        let request = request.map_err(|error| RuleFailure::new(expected, error))?;
        let first = first.get_or_insert(request);
        if *first != request {
            let text = |request| String::from_utf8_lossy(&encode(request)).into_owned();
            let came = format!("{}, and before {}", text(request), text(first));
            return Err(RuleFailure::new(expected, came));
        }
    }
    Ok(())
}

/// The robot misses a tick, and its news ask it to join again. Its requests are queued.
fn lose(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    harness.keeps_requests = true;
    harness.miss()?;
    harness.open(&TickUpdate::default())
}

/// A robot that is to join again, and whose place is taken meanwhile, has been replaced.
fn demand_place_taken(kit: &Kit) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    lose(&mut harness)?;
    let joining = harness.next_rejoin()?;
    harness.refuse_join(joining, Refusal::NameTaken, "another process is this robot");
    let expected = "its process ends, with an exit status other than 0, when its place is taken as it joins again";
    let status = harness.until_ended(expected, PATIENCE)?;
    if status.success() {
        return Err(RuleFailure::new(expected, format!("{status}")));
    }
    harness.until_gone()
}

/// A further incarnation executes commands as the first one does, from the news on that name it.
pub(super) fn commanded(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    if kit.is_deterministic.get() == Some(&false) {
        return Ok(());
    }
    let reported = played(kit, &PlayScript::quiet(LAST))?;
    let script = |command: Option<(&str, Tick)>, ticks| {
        let arrivals = command.map(|(text, tick)| ArrivingCommand::new(&kit.sender(), text, tick));
        PlayScript::with(ticks, arrivals.into_iter().collect())
    };
    let first = |command| played(kit, &script(command, LAST + TICKS));
    let further = |command| {
        let mut harness = returned(kit, &[LAST], &reported, |_| ())?;
        play(&mut harness, &script(command, TICKS), &mut Straight)
    };

    let ticks = LAST + 1..=LAST + 3;
    for text in kit.pairs().iter().flatten() {
        if !is_same(&further(Some((text, LAST + 1)))?, &further(None)?) {
            return Ok(());
        }

        let silent = first(None)?;
        let mut executed = 0;
        for tick in ticks.clone() {
            executed += usize::from(!is_same(&first(Some((text, tick)))?, &silent));
        }
        // It does not leave it out because of what it does at that moment.
        if executed == ticks.clone().count() {
            return Err(RuleFailure::new(
                format!(
                    "{text:?} in the news that name its generation is executed as by a first incarnation"
                ),
                "it has no effect at all",
            ));
        }
    }
    Ok(())
}

/// Whether the moves of a third incarnation follow the stream that its welcome names. Of a robot that draws in each tick of an epoch.
pub(super) fn demand_streams(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let mut straight = with_robot(kit, HarnessOptions::default())?;
    let reported = play(&mut straight, &PlayScript::quiet(LAST + 2), &mut Straight)?;
    let mut turns = BTreeSet::new();
    for stream in STREAMS {
        let last_ticks = [LAST, LAST + 2];
        let mut harness = returned(kit, &last_ticks, &reported, |welcome| {
            stream.clone_into(&mut welcome.stream);
        })?;
        let played = play(&mut harness, &PlayScript::quiet(LAST), &mut Straight)?;
        let directions = played
            .iter()
            .map(|entry| entry.report.direction_rad.to_bits());
        let directions: Vec<u64> = directions.collect();
        if directions.windows(2).any(|pair| pair[0] == pair[1]) {
            return Ok(());
        }
        turns.insert(directions);
    }

    if turns.len() == 1 {
        let expected = format!(
            "{} streams of a third incarnation give different moves",
            STREAMS.len()
        );
        findings.fail("determinism.seed", RuleFailure::new(expected, "the same"));
    }
    Ok(())
}

/// News that name a later incarnation: this one ends.
pub(super) fn replaced(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    demand_place_taken(kit)?;
    demand_replaced(returned_once(kit)?, "before it was named itself")?;
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    demand_replaced(harness, "between two ticks")
}

/// It ends when its news name a later incarnation at this moment.
fn demand_replaced(mut harness: Harness<'_>, when: &str) -> Result<(), RuleFailure> {
    let tick = harness.next_tick();
    // The robot's own process runs on, as after a cut: it must end by itself.
    harness.play_successor();
    harness.open(&TickUpdate::default())?;
    let expected = format!(
        "its process ends, with an exit status other than 0, when its news name a later incarnation {when}"
    );
    let status = harness.until_ended(&expected, PATIENCE)?;
    if status.success() {
        return Err(RuleFailure::new(expected, format!("{status}")));
    }
    harness.until_gone()?;

    let has_answered = harness
        .seen
        .answers
        .iter()
        .any(|answer| answer.reading.report.tick == tick);
    if has_answered {
        return Err(RuleFailure::new(
            "no report for a tick whose news name a later incarnation",
            format!("one for tick {tick}"),
        ));
    }
    Ok(())
}
