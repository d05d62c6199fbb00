//! Queries: in every tick all robots get the states of the tick before.

use std::time::{Duration, Instant};

use bus::Reply;
use protocol::keys::{QUERIES, STATE};
use protocol::messages::{Answer, Point, PublicState, TickUpdate};
use protocol::{Epoch, Tick, decode, encode};

use super::{computing, waiting, wire};
use harness::fake_peers::ReceivedQuery;
use harness::findings::Findings;
use harness::kit::{Kit, KitRoster};
use harness::patience::{PATIENCE, in_each_attempt};
use harness::report::RuleFailure;
use harness::script::{
    Disturbance, PlayScript, Straight, can_query, demand_usual, play, with_robot,
};
use harness::transcript::{PlayedTick, Transcript};
use harness::{Harness, HarnessOptions};

/// The kit's own limit where it waits until all replies are in.
const ALL_REPLIES: Duration = Duration::from_secs(3);
/// One tick in so many is asked about at length: that costs time.
const ROUND: Tick = 10;
/// A state that is shown after the report is shown within this time.
const LATE: Duration = Duration::from_secs(5);
const ASK_AGAIN: Duration = Duration::from_millis(10);
/// How often a robot that waits is queried, and how far apart.
const TIMES: usize = 4;
const APART: Duration = Duration::from_millis(20);
/// A reply that takes so long, and comes after the report, was deferred until the tick was done.
const DEFERRED: Duration = Duration::from_secs(1);
/// How often a query of a robot that waits is repeated whose time was up.
const ATTEMPTS: usize = 4;

/// Queries the state after each tick, and compares it with what was put for subscribers.
struct StateQueries {
    findings: Findings,
    /// The state of the tick before.
    before: Option<PublicState>,
    /// Where the robot stands.
    location: Point,
}

/// What a robot shows in every tick: the tick before, and where it stands.
pub(super) fn by_tick(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(
        kit,
        HarnessOptions {
            is_followed: true,
            ..HarnessOptions::default()
        },
    )?;
    let mut queries = StateQueries {
        findings: Findings::default(),
        before: None,
        location: harness.template.location,
    };

    let played = play(&mut harness, &PlayScript::usual(kit), &mut queries);
    // Also after a play that broke off: what came until then is judged.
    wire::check(&harness, findings);
    findings.0.extend(queries.findings.0);
    if harness.seen.states.is_empty() {
        let came = "in none of the ticks, although there is a subscriber";
        findings.fail(
            "tick.state-first",
            RuleFailure::new("its state is put for its subscribers", came),
        );
    }
    played?;
    demand_refused(&mut harness, findings);
    Ok(())
}

/// The state of a tick, if that is what the robot shows.
fn state_of(
    harness: &Harness<'_>,
    epoch: Epoch,
    tick: Tick,
    expected: &str,
) -> Result<Result<PublicState, RuleFailure>, RuleFailure> {
    let reply = harness.state_in(epoch, tick + 1)?;
    let shown = state(reply, expected).and_then(|now| {
        if (now.epoch, now.tick) == (epoch, tick) {
            return Ok(now);
        }
        Err(RuleFailure::new(
            expected,
            format!("the state of tick {} of epoch {}", now.tick, now.epoch),
        ))
    });

    Ok(shown)
}

/// The same, for a robot that shows it after its report.
fn late_state_of(
    harness: &Harness<'_>,
    epoch: Epoch,
    tick: Tick,
    expected: &str,
) -> Result<Result<PublicState, RuleFailure>, RuleFailure> {
    // A state that is there a little later is a flaw of its own, and not a missing one.
    let begun = Instant::now();

    loop {
        let came = state_of(harness, epoch, tick, expected)?;
        if came.is_ok() || begun.elapsed() > LATE {
            return Ok(came);
        }
        std::thread::sleep(ASK_AGAIN);
    }
}

/// What came as an answer, read as a state.
pub(super) fn state(answer: Option<Reply>, expected: &str) -> Result<PublicState, RuleFailure> {
    match answer {
        None => Err(RuleFailure::maybe_of_load(expected, "no answer")),
        Some(Reply {
            result: Err(reason),
            ..
        }) => Err(RuleFailure::new(expected, format!("refused: {reason}"))),
        Some(Reply {
            result: Ok(bytes), ..
        }) => decode(STATE, "the robot", &bytes)
            .map_err(|error| RuleFailure::new(expected, error.to_string())),
    }
}

impl Disturbance for StateQueries {
    fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
        // Its state comes first also where it puts panels.
        harness.shows_panels = tick % 4 < 2;
        Ok(())
    }

    fn after(&mut self, harness: &mut Harness<'_>, entry: &PlayedTick) -> Result<(), RuleFailure> {
        let epoch = entry.epoch;
        let tick = entry.tick;
        let expected = format!("asked with tick={}, the state of tick {tick}", tick + 1);
        // At once after the report: a robot that runs the next tick may query it.
        let mut came = state_of(harness, epoch, tick, &expected)?;
        if let Err(failure) = came {
            // It takes time to find out that a state never comes: once is enough.
            if self.findings.has_failed("query.tick") {
                return Ok(());
            }
            came = late_state_of(harness, epoch, tick, &expected)?;
            let rule = if came.is_ok() {
                "tick.state-first"
            } else {
                "query.tick"
            };
            self.findings.fail(rule, failure);
        }
        let Ok(now) = came else { return Ok(()) };

        self.findings
            .settle("tick.state-first", check_followed(harness, entry, &now));
        self.check_location(entry, &now);
        let matched = check_state(entry, &now)
            .and_then(|()| self.check_before(harness, epoch, tick))
            .and_then(|()| check_newest(harness, tick, &now))
            .and_then(|()| match tick.is_multiple_of(ROUND) {
                true => check_six(harness, epoch, tick, &now),
                false => Ok(()),
            });
        self.findings.settle("query.tick", matched);

        self.before = Some(now);
        Ok(())
    }
}

impl StateQueries {
    /// It stands where it was put, and else where it proposed.
    fn check_location(&mut self, entry: &PlayedTick, now: &PublicState) {
        let tick = entry.tick;
        let came = format!("{:?} in tick {tick}", now.location);
        self.location = entry.location;
        if now.location == self.location {
            return;
        }

        if tick == 0 {
            let expected = format!(
                "it stands where its welcome places it, at {:?}",
                self.location
            );
            return self
                .findings
                .fail("tick.initial", RuleFailure::new(expected, came));
        }

        let why = if entry.news.correction.is_some() {
            "as its news correct it"
        } else {
            "as it proposed"
        };
        let expected = format!("it stands at {:?}, {why}", self.location);
        self.findings
            .fail("tick.correction", RuleFailure::new(expected, came));
    }

    /// The tick before can still be queried.
    fn check_before(
        &self,
        harness: &Harness<'_>,
        epoch: Epoch,
        tick: Tick,
    ) -> Result<(), RuleFailure> {
        let Some(before) = &self.before else {
            return Ok(());
        };
        let expected = format!(
            "asked with tick={tick}, still the state of tick {}",
            before.tick
        );
        let came = state(harness.state_in(epoch, tick)?, &expected)?;

        if came != *before {
            return Err(RuleFailure::new(expected, format!("{came:?}")));
        }
        if tick.is_multiple_of(ROUND) {
            check_six(harness, epoch, tick - 1, before)?;
            // That of the next tick is asked for too early, and has to be there nevertheless when it is.
            let _refused = harness.state_in(epoch, tick + 2)?;
        }
        Ok(())
    }
}

/// What is put for subscribers comes before the report, in every tick once the robot knows of a subscriber.
fn check_followed(
    harness: &Harness<'_>,
    entry: &PlayedTick,
    now: &PublicState,
) -> Result<(), RuleFailure> {
    let tick = entry.tick;
    let report = harness
        .seen
        .answers
        .get(entry.index)
        .map_or(usize::MAX, |answer| answer.order);

    let mut before = harness
        .seen
        .states
        .iter()
        .filter(|(order, _)| *order < report);
    // Until it knows of the subscriber, a robot puts none.
    let Some((_, last)) = before.next_back() else {
        return Ok(());
    };

    let expected = format!("the state of tick {tick}, put before the report of tick {tick}");
    match last {
        Err(error) => Err(RuleFailure::new(expected, error)),
        Ok(last) if last == now => Ok(()),
        Ok(last) => Err(RuleFailure::new(
            expected,
            format!("before it, the state of tick {} was put last", last.tick),
        )),
    }
}

/// What it shows is what it reports.
fn check_state(entry: &PlayedTick, now: &PublicState) -> Result<(), RuleFailure> {
    let report = &entry.report;
    let shown = PublicState {
        epoch: now.epoch,
        tick: now.tick,
        location: now.location,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        state_variables: report.state_variables.clone(),
        emotion_state: report.emotion_state.clone(),
        behavior_state: report.behavior_state.clone(),
    };

    if shown == *now {
        return Ok(());
    }

    Err(RuleFailure::new(
        format!("the state shows what is reported: {shown:?}"),
        format!("{now:?}"),
    ))
}

/// Queried without tick or epoch, or without both, it shows its newest state.
fn check_newest(harness: &Harness<'_>, tick: Tick, now: &PublicState) -> Result<(), RuleFailure> {
    if !tick.is_multiple_of(ROUND) {
        return Ok(());
    }

    let next = tick + 1;
    let epoch = now.epoch;
    for parameters in [
        String::new(),
        format!("epoch={epoch}"),
        format!("tick={next}"),
        format!("epoch={epoch};tick={next}"),
    ] {
        let expected =
            format!("asked with {parameters:?} after tick {tick}, the state of tick {tick}");
        let came = state(harness.ask(STATE, &parameters)?, &expected)?;
        if came != *now {
            return Err(RuleFailure::new(expected, format!("{came:?}")));
        }
    }
    Ok(())
}

/// The six queries have the same answers, each its part.
fn check_six(
    harness: &Harness<'_>,
    epoch: Epoch,
    tick: Tick,
    now: &PublicState,
) -> Result<(), RuleFailure> {
    for what in QUERIES {
        let text = |answer: &Answer| String::from_utf8_lossy(&encode(answer)).into_owned();
        let wanted = now.answer(what);
        let expected = format!(
            "the answer to {what} for tick {tick}: {}",
            wanted.as_ref().map_or_else(String::new, text)
        );
        let came = match harness.ask(what, &format!("tick={};epoch={epoch}", tick + 1))? {
            Some(Reply {
                result: Ok(bytes), ..
            }) => decode::<Answer>(what, "the robot", &bytes)
                .map_err(|error| RuleFailure::new(expected.clone(), error.to_string()))?,
            Some(Reply {
                result: Err(reason),
                ..
            }) => return Err(RuleFailure::new(expected, reason)),
            None => return Err(RuleFailure::maybe_of_load(expected, "no answer")),
        };
        let is_same = wanted.is_some_and(|wanted| {
            (wanted.epoch, wanted.tick) == (came.epoch, came.tick)
                && same_value(&wanted.value, &came.value)
        });
        if !is_same {
            return Err(RuleFailure::new(expected, text(&came)));
        }
    }
    Ok(())
}

/// Whether two values are the same; 7 and 7.0 are.
fn same_value(one: &serde_json::Value, two: &serde_json::Value) -> bool {
    use serde_json::Value::{Number, Object};
    match (one, two) {
        (Number(one), Number(two)) => one.as_f64() == two.as_f64(),
        (Object(one), Object(two)) => {
            one.len() == two.len()
                && one.iter().all(|(name, value)| {
                    two.get(name).is_some_and(|other| same_value(value, other))
                })
        }
        _ => one == two,
    }
}

/// Queried for what it does not have, it refuses at once, in words.
fn demand_refused(harness: &mut Harness<'_>, findings: &mut Findings) {
    let result = try_refused(harness);
    findings.settle("query.tick", result);
}

fn try_refused(harness: &Harness<'_>) -> Result<(), RuleFailure> {
    let now = harness.next_tick() - 1;
    let of = harness.epoch();
    let never = [
        (of, now + 2),
        (of + 1, 1),
        (of, 0),
        (of, now - 1),
        (of, 1),
        (of, now + 3),
        (of, now + 1000),
        (of - 1, now + 1),
    ];
    let mut parameters = never
        .map(|(epoch, tick)| format!("tick={tick};epoch={epoch}"))
        .to_vec();
    parameters.extend([of - 1, of + 1].map(|epoch| format!("epoch={epoch}")));

    for parameters in parameters {
        let expected = format!(
            "after tick {now} of epoch {of}, an error reply in words to {parameters}, at once"
        );
        match harness.ask(STATE, &parameters)? {
            Some(Reply {
                result: Err(words), ..
            }) if !words.trim().is_empty() => {}
            Some(Reply { result: Err(_), .. }) => {
                return Err(RuleFailure::new(expected, "one without words"));
            }
            Some(Reply {
                result: Ok(bytes), ..
            }) => {
                return Err(RuleFailure::new(expected, String::from_utf8_lossy(&bytes)));
            }
            None => return Err(RuleFailure::new(expected, "no reply")),
        }
    }
    Ok(())
}

/// It answers at once, also while it computes, waits for its news, or waits for another robot's answer.
pub(super) fn at_once(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    computing::check(kit)?;

    let mut harness = waiting::for_news(kit)?;
    demand_replies(&mut harness, "while it waits for its news")?;

    let (mut harness, is_asking) = waiting::for_another(kit)?;
    if !is_asking {
        let reason = "the robot answers while it waits for its news; it queried no other robot, so whether it does while \
                      it waits for an answer was not checked";
        findings.skip("query.at-once", reason);
        return Ok(());
    }
    demand_replies(&mut harness, "while it waits for another robot's answer")?;
    harness.fake_peers.release();
    harness.complete().map(drop)
}

/// The robot answers in the open tick. Its wait lasts until the kit ends it, so that no answer is late: it comes or not. A
/// robot that does not wait gives no occasion to see it.
fn demand_replies(harness: &mut Harness<'_>, when: &str) -> Result<(), RuleFailure> {
    let tick = harness.next_tick() - 1;
    let expected = format!(
        "queried in tick {tick} {when}, the state of tick {} at once",
        tick - 1
    );

    for _ in 0..TIMES {
        let begun = Instant::now();
        let reply = reply_in(harness, tick, &expected)?;
        if !harness.is_open() {
            if begun.elapsed() < DEFERRED {
                return Ok(());
            }
            return Err(RuleFailure::new(expected, "a report before the reply"));
        }

        let came = state(reply, &expected)?;
        if came.tick + 1 != tick {
            return Err(RuleFailure::new(
                expected,
                format!("the state of tick {}", came.tick),
            ));
        }
        check_six(harness, came.epoch, came.tick, &came)?;
        harness.pass(APART);
    }
    Ok(())
}

/// The robot's reply; `None` if the tick is over before there is one.
fn reply_in(
    harness: &mut Harness<'_>,
    tick: Tick,
    expected: &str,
) -> Result<Option<Reply>, RuleFailure> {
    for _ in 0..ATTEMPTS {
        let number = harness.begin_query(harness.epoch(), tick)?;
        let reply = harness.until(expected, PATIENCE, |harness| {
            let (_, reply) = harness.seen.replies.get(&number)?;
            Some(reply.clone())
        })?;
        // While the tick is open, a query that ended without a reply is repeated: its own time limit is
        // shorter than the wait.
        if reply.is_some() || !harness.is_open() {
            return Ok(reply);
        }
    }

    Ok(None)
}

/// What it asks others: with tick and epoch, not at tick 0, not those that it cannot reach.
pub(super) fn asking(kit: &Kit, findings: &mut Findings) -> Result<(), RuleFailure> {
    let ticks = kit.setting.ticks;
    // A robot that one of the words sends to sleep is awake where nothing is said, and one that a word wakes where it is.
    let spoken = PlayScript::in_turn(kit, &[kit.sender()], ticks);
    let mut has_asked = false;
    for script in [spoken, PlayScript::quiet(ticks)] {
        // Several others, of which none can be queried in some of the ticks.
        for roster in [KitRoster::Usual, KitRoster::InRun] {
            let mut harness = waiting::of_queries_in(kit, roster)?;
            let played = play(&mut harness, &script, &mut Straight)?;
            let asked = harness.fake_peers.asked();
            // Where news have no list, all others are in range.
            has_asked |= played.iter().any(|entry| {
                let is_listed = entry.news.in_range.is_some();
                !is_listed && asked.iter().any(|query| query.now.1 == entry.tick)
            });
            demand_allowed(asked, &played)?;
        }
    }

    if !has_asked {
        findings.skip("query.asking", "the robot queried no other one");
        return demand_none_in_range(kit);
    }
    Ok(())
}

/// Each query is one that the robot may make.
fn demand_allowed(asked: Vec<ReceivedQuery>, played: &Transcript) -> Result<(), RuleFailure> {
    for query in asked {
        let (epoch, tick) = query.now;
        let came = format!(
            "a query of {} in tick {tick} with tick={} and epoch={}",
            query.of,
            query.tick.as_deref().unwrap_or("nothing"),
            query.epoch.as_deref().unwrap_or("nothing"),
        );
        if tick == 0 {
            return Err(RuleFailure::new("no query at tick 0", came));
        }
        let is_stated = query.tick == Some(tick.to_string());
        if !is_stated || query.epoch != Some(epoch.to_string()) {
            let expected = format!("queries of tick {tick} with tick={tick};epoch={epoch}");
            return Err(RuleFailure::new(expected, came));
        }
        let entry = played.iter().find(|entry| entry.tick == tick);
        if entry.is_some_and(|entry| !entry.news.can_query(&query.of)) {
            let expected = format!(
                "no query of {} in tick {tick}: unreachable, or not in range",
                query.of
            );
            return Err(RuleFailure::new(expected, came));
        }
    }
    Ok(())
}

/// What robots that it cannot query put for subscribers makes no difference.
pub(super) fn unreachable(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct Misplaced;
    impl Disturbance for Misplaced {
        fn before(&mut self, harness: &mut Harness<'_>, tick: Tick) -> Result<(), RuleFailure> {
            harness.fake_peers.misplace(!can_query(tick));
            Ok(())
        }
    }

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    let what = "what robots put that are unreachable, or not in range";
    demand_usual(&mut harness, what, &mut Misplaced)
}

/// A robot that queries no other one does not do so only because its news list none: all are in range where they have no list.
fn demand_none_in_range(kit: &Kit) -> Result<(), RuleFailure> {
    struct AllInRange;
    impl Disturbance for AllInRange {
        fn news(&mut self, harness: &Harness<'_>, news: &mut TickUpdate) {
            let all = || harness.fake_peers.names().cloned().collect();
            news.in_range.get_or_insert_with(all);
        }
    }

    let mut harness = waiting::of_queries(kit)?;
    play(&mut harness, &PlayScript::usual(kit), &mut AllInRange)?;
    match harness.fake_peers.asked().first() {
        None => Ok(()),
        Some(query) => Err(RuleFailure::new(
            "the same queries where news list all others as `in_range` and where they have no list",
            format!(
                "a query of {} in tick {} where they do, and none where they do not",
                query.of, query.now.1
            ),
        )),
    }
}

/// Each query has exactly one reply, the query object is released, and the robot has no queryable of another key.
pub(super) fn once(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    let mut harness = with_robot(kit, HarnessOptions::default())?;
    play(&mut harness, &PlayScript::quiet(3), &mut Straight)?;
    for what in QUERIES.iter().chain([&STATE]) {
        in_each_attempt(|scale| demand_one_reply(&harness, what, ALL_REPLIES * scale))?;
        in_each_attempt(|scale| demand_own_key(&harness, what, ALL_REPLIES * scale))?;
    }

    let subject = kit.subject();
    for what in ["percept", "news", "report", "panel", "waiting"] {
        let key = harness.keys.query(&subject, what);
        let replies = kit.bus.get_all(&key, "", ALL_REPLIES)?;
        if !replies.is_empty() {
            let expected = format!("no queryable of {what}: a robot declares its seven keys");
            return Err(RuleFailure::new(expected, "a reply"));
        }
    }
    for other in harness.fake_peers.names() {
        let key = harness.keys.query(other, STATE);
        let replies = kit
            .bus
            .get_all(&key, &of_next_tick(&harness), ALL_REPLIES)?;
        if replies.len() > 1 {
            let expected = format!("no reply of its own to a query of {other}");
            return Err(RuleFailure::new(
                expected,
                format!("{} replies", replies.len()),
            ));
        }
    }
    Ok(())
}

/// The parameters of a query in the next tick.
fn of_next_tick(harness: &Harness<'_>) -> String {
    format!("tick={};epoch={}", harness.next_tick(), harness.epoch())
}

/// One reply, and the end of the query with it: a query that is not released takes all the time that the kit has.
fn demand_one_reply(
    harness: &Harness<'_>,
    what: &str,
    patience: Duration,
) -> Result<(), RuleFailure> {
    let key = harness.keys.query(&harness.kit.subject(), what);
    let begun = Instant::now();
    // It ends when the last queryable has released it, or with the patience: the time tells which.
    let replies = harness
        .kit
        .bus
        .get_all(&key, &of_next_tick(harness), patience)?;
    let took = begun.elapsed();

    if replies.len() != 1 {
        return Err(RuleFailure::new(
            format!("one reply to a query of {what}"),
            format!("{} replies", replies.len()),
        ));
    }
    if took >= patience {
        return Err(RuleFailure::new(
            format!("it releases a query of {what} when it has replied"),
            "a query that ends only because time is up",
        ));
    }
    Ok(())
}

/// Queried together with all other robots, it replies on its own key, by which the replies are told apart.
fn demand_own_key(
    harness: &Harness<'_>,
    what: &str,
    patience: Duration,
) -> Result<(), RuleFailure> {
    let own = harness.keys.query(&harness.kit.subject(), what);
    let asked = harness.keys.queries(what);
    let replies = harness
        .kit
        .bus
        .get_all(&asked, &of_next_tick(harness), patience)?;

    if replies.iter().filter(|reply| reply.key == own).count() == 1 {
        return Ok(());
    }
    let keys: Vec<&str> = replies.iter().map(|reply| reply.key.as_str()).collect();
    Err(RuleFailure::new(
        format!("one reply on {own} to a get on {asked}"),
        format!("replies on {}", keys.join(", ")),
    ))
}

/// Queried for what does not exist, it gives no answer and goes on.
pub(super) fn unknown(kit: &Kit, _: &mut Findings) -> Result<(), RuleFailure> {
    struct Odd;
    impl Disturbance for Odd {
        fn after(
            &mut self,
            harness: &mut Harness<'_>,
            entry: &PlayedTick,
        ) -> Result<(), RuleFailure> {
            if !entry.tick.is_multiple_of(8) {
                return Ok(());
            }
            for (what, parameters) in [
                ("favorite_color", ""),
                ("favorite_color/of/all", "tick=1"),
                (STATE, "tick=soon"),
                (STATE, "tick=-1;epoch=1"),
                ("location", "tick=1;epoch=x"),
            ] {
                if let Some(Reply {
                    result: Ok(bytes), ..
                }) = harness.ask(what, parameters)?
                {
                    let expected = format!("no answer to {what}?{parameters}: refused, or none");
                    return Err(RuleFailure::new(expected, String::from_utf8_lossy(&bytes)));
                }
            }
            Ok(())
        }
    }

    let mut harness = with_robot(kit, HarnessOptions::default())?;
    demand_usual(&mut harness, "a query for what does not exist", &mut Odd)
}
