//! Questions: in every tick everybody learns of the tick before.

use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use bus::Reply;
use protocol::keys::{QUERIES, STATE};
use protocol::messages::{Answer, Clock, Point, PublicState};
use protocol::{Epoch, Tick, decode};

use super::{Findings, seated, usual};
use crate::comparison::demand_same;
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Entry, Script, Straight, Twist, play};
use crate::stage::{Options, Stage};

/// A query has its answer within this time, or has none.
const QUESTION_PATIENCE: Duration = Duration::from_secs(3);
/// The last tick before the odd queries.
const LAST: Tick = 8;
/// One tick in so many is asked about at length: that costs time.
const ROUND: Tick = 10;
/// A state that is shown after the report is there after this time.
const LATE: Duration = Duration::from_millis(500);
const ASK_AGAIN: Duration = Duration::from_millis(10);

/// Asks after every tick, and follows as others do.
struct Asker {
    findings: Findings,
    /// The state of the tick before.
    before: Option<PublicState>,
    /// Where the robot stands.
    location: Point,
}

/// What a robot shows in every tick: the tick before, and where it stands.
pub(super) fn by_tick(kit: &Kit, findings: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(
        kit,
        Options {
            is_followed: true,
            ..Options::default()
        },
    )?;
    let welcome = stage.welcome();
    let mut asker = Asker {
        findings: Findings::default(),
        before: None,
        location: welcome.location,
    };
    let played = play(&mut stage, &welcome, &Script::usual(kit), &mut asker);
    findings.0.extend(asker.findings.0);
    if stage.seen.states.is_empty() {
        let came = "in none of the ticks, although somebody subscribes";
        findings.fail(
            "tick.state-first",
            Failure::new("its state is put for those who follow it", came),
        );
    }
    played.map(drop)
}

/// The state of a tick, if that is what the robot shows.
fn state_of(
    stage: &Stage<'_>,
    epoch: Epoch,
    tick: Tick,
    expected: &str,
) -> Result<Result<PublicState, Failure>, Failure> {
    Ok(
        state(stage.state_in(epoch, tick + 1)?, expected).and_then(|now| {
            if (now.epoch, now.tick) == (epoch, tick) {
                return Ok(now);
            }
            Err(Failure::new(
                expected,
                format!("the state of tick {} of epoch {}", now.tick, now.epoch),
            ))
        }),
    )
}

/// The same, for a robot that shows it after its report.
fn late_state_of(
    stage: &Stage<'_>,
    epoch: Epoch,
    tick: Tick,
    expected: &str,
) -> Result<Result<PublicState, Failure>, Failure> {
    let begun = Instant::now();
    loop {
        let came = state_of(stage, epoch, tick, expected)?;
        if came.is_ok() || begun.elapsed() > LATE {
            return Ok(came);
        }
        std::thread::sleep(ASK_AGAIN);
    }
}

/// What came as an answer, read as a state.
pub(super) fn state(answer: Option<Reply>, expected: &str) -> Result<PublicState, Failure> {
    match answer {
        None => Err(Failure::new(expected, "no answer")),
        Some(Reply {
            result: Err(reason),
            ..
        }) => Err(Failure::new(expected, format!("refused: {reason}"))),
        Some(Reply {
            result: Ok(bytes), ..
        }) => decode(STATE, "the robot", &bytes)
            .map_err(|error| Failure::new(expected, error.to_string())),
    }
}

impl Twist for Asker {
    fn after(&mut self, stage: &mut Stage<'_>, entry: &Entry) -> Result<(), Failure> {
        let (epoch, tick) = (entry.clock.epoch, entry.clock.tick);
        let expected = format!("asked with tick={}, the state of tick {tick}", tick + 1);
        // At once after the report: whoever comes with the next clock may ask.
        let mut came = state_of(stage, epoch, tick, &expected)?;
        if let Err(failure) = came {
            // Too late, or never?
            came = late_state_of(stage, epoch, tick, &expected)?;
            self.findings.fail(
                if came.is_ok() {
                    "tick.state-first"
                } else {
                    "query.tick"
                },
                failure,
            );
        }
        let Ok(now) = came else { return Ok(()) };
        self.findings
            .settle("tick.state-first", check_followed(stage, entry, &now));
        self.check_location(entry, &now);
        let matched = check_state(entry, &now)
            .and_then(|()| self.check_before(stage, epoch, tick))
            .and_then(|()| check_newest(stage, tick, &now))
            .and_then(|()| check_six(stage, epoch, tick, &now));
        self.findings.settle("query.tick", matched);
        self.before = Some(now);
        Ok(())
    }
}

impl Asker {
    /// It stands where it was put, and else where it proposed.
    fn check_location(&mut self, entry: &Entry, now: &PublicState) {
        let tick = entry.clock.tick;
        let came = format!("{:?} in tick {tick}", now.location);
        self.location = entry.location;
        if now.location == self.location {
            return;
        }
        if tick == 0 {
            let expected = format!("it stands where its welcome says, at {:?}", self.location);
            return self
                .findings
                .fail("tick.initial", Failure::new(expected, came));
        }
        let is_corrected = entry
            .clock
            .news
            .values()
            .any(|news| news.correction.is_some());
        let why = if is_corrected {
            "as the clock corrects it"
        } else {
            "as it proposed"
        };
        let expected = format!("it stands at {:?}, {why}", self.location);
        self.findings
            .fail("tick.correction", Failure::new(expected, came));
    }

    /// The tick before is still told to whoever asks late.
    fn check_before(&self, stage: &Stage<'_>, epoch: Epoch, tick: Tick) -> Result<(), Failure> {
        let Some(before) = &self.before else {
            return Ok(());
        };
        let expected = format!(
            "asked with tick={tick}, still the state of tick {}",
            before.tick
        );
        let came = state(stage.state_in(epoch, tick)?, &expected)?;
        if came == *before {
            Ok(())
        } else {
            Err(Failure::new(expected, format!("{came:?}")))
        }
    }
}

/// What followers are sent comes before the report, in every tick once the robot knows that somebody follows.
fn check_followed(stage: &Stage<'_>, entry: &Entry, now: &PublicState) -> Result<(), Failure> {
    let tick = entry.clock.tick;
    let report = stage
        .seen
        .answers
        .get(entry.index)
        .map_or(usize::MAX, |answer| answer.order);
    let mut before = stage
        .seen
        .states
        .iter()
        .filter(|(order, _)| *order < report);
    let Some((_, last)) = before.next_back() else {
        return Ok(());
    };
    let expected = format!("the state of tick {tick}, put before the report of tick {tick}");
    match last {
        Err(error) => Err(Failure::new(expected, error)),
        Ok(last) if last == now => Ok(()),
        Ok(last) => Err(Failure::new(
            expected,
            format!("before it, the state of tick {} was put last", last.tick),
        )),
    }
}

/// What it shows is what it reports.
fn check_state(entry: &Entry, now: &PublicState) -> Result<(), Failure> {
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
    Err(Failure::new(
        format!("the state shows what is reported: {shown:?}"),
        format!("{now:?}"),
    ))
}

/// Asked without an epoch, or without anything, it says the same.
fn check_newest(stage: &Stage<'_>, tick: Tick, now: &PublicState) -> Result<(), Failure> {
    if !tick.is_multiple_of(ROUND) {
        return Ok(());
    }
    for parameters in [String::new(), format!("tick={}", tick + 1)] {
        let expected =
            format!("asked with {parameters:?} after tick {tick}, the state of tick {tick}");
        let came = state(stage.ask(STATE, &parameters)?, &expected)?;
        if came != *now {
            return Err(Failure::new(expected, format!("{came:?}")));
        }
    }
    Ok(())
}

/// The six queries say the same, each its part.
fn check_six(
    stage: &Stage<'_>,
    epoch: Epoch,
    tick: Tick,
    now: &PublicState,
) -> Result<(), Failure> {
    if !tick.is_multiple_of(ROUND) {
        return Ok(());
    }
    for what in QUERIES {
        let expected = format!(
            "the answer to {what} for tick {tick}: {:?}",
            now.answer(what)
        );
        let came = match stage.ask(what, &format!("tick={};epoch={epoch}", tick + 1))? {
            Some(Reply {
                result: Ok(bytes), ..
            }) => decode::<Answer>(what, "the robot", &bytes)
                .map_err(|error| Failure::new(expected.clone(), error.to_string()))?,
            Some(Reply {
                result: Err(reason),
                ..
            }) => return Err(Failure::new(expected, reason)),
            None => return Err(Failure::new(expected, "no answer")),
        };
        let is_same = now.answer(what).is_some_and(|wanted| {
            (wanted.epoch, wanted.tick) == (came.epoch, came.tick)
                && same_value(&wanted.value, &came.value)
        });
        if !is_same {
            return Err(Failure::new(expected, format!("{came:?}")));
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
            let is_in = |(name, value): (&String, &serde_json::Value)| {
                two.get(name).is_some_and(|other| same_value(value, other))
            };
            one.len() == two.len() && one.iter().all(is_in)
        }
        _ => one == two,
    }
}

/// A query that has been asked: where its answer comes.
type Pending = Receiver<Option<Reply>>;

/// Asks for the state of the tick before `tick`, and goes on.
fn ask_early(stage: &Stage<'_>, epoch: Epoch, tick: &str) -> Result<Pending, Failure> {
    let (sender, answer) = channel();
    let key = stage.keys.query(&stage.kit.subject(), STATE);
    stage
        .kit
        .bus
        .get_then(&key, &format!("tick={tick};epoch={epoch}"), move |came| {
            // Nobody waits for it any more where this check is over.
            let _ = sender.send(came);
        })?;
    Ok(answer)
}

/// The answer to it; `None` if there is none.
fn answer_to(pending: &Pending) -> Option<Reply> {
    pending.recv_timeout(QUESTION_PATIENCE).ok().flatten()
}

/// Asked for the report that comes next it waits; asked for any other that it does not have it refuses.
pub(super) fn early(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    let pending = ask_early(&stage, 1, "1")?;
    let welcome = stage.welcome();
    play(&mut stage, &welcome, &Script::quiet(LAST), &mut Straight)?;
    demand_state(&stage, &pending, 0, "before tick 0")?;

    // Whether it is shown in time is another rule's matter.
    late_state_of(&stage, 1, LAST, "the state of the last tick")??;
    let pending = ask_early(&stage, 1, &(LAST + 2).to_string())?;
    stage.tick(&Clock {
        epoch: 1,
        tick: LAST + 1,
        ..Clock::default()
    })?;
    demand_state(&stage, &pending, LAST + 1, &format!("after tick {LAST}"))?;

    let now = LAST + 1;
    late_state_of(&stage, 1, now, "the state of the last tick")??;
    let never = [
        (1, 0),
        (1, now - 1),
        (1, 1),
        (1, now + 3),
        (1, now + 1000),
        (0, now + 1),
    ];
    let never = never.map(|(epoch, tick): (Epoch, Tick)| (epoch, tick.to_string()));
    for (epoch, tick) in never
        .into_iter()
        .chain([(1, "soon".to_owned()), (1, "-1".to_owned())])
    {
        let expected =
            format!("after tick {now}, an error reply in words to tick={tick};epoch={epoch}");
        match answer_to(&ask_early(&stage, epoch, &tick)?) {
            Some(Reply {
                result: Err(words), ..
            }) if !words.trim().is_empty() => {}
            Some(Reply { result: Err(_), .. }) => {
                return Err(Failure::new(expected, "one without words"));
            }
            Some(Reply {
                result: Ok(bytes), ..
            }) => {
                return Err(Failure::new(expected, String::from_utf8_lossy(&bytes)));
            }
            None => return Err(Failure::new(expected, "no reply")),
        }
    }
    stage
        .tick(&Clock {
            epoch: 1,
            tick: now + 1,
            ..Clock::default()
        })
        .map(drop)
}

/// A query that came early has its answer as soon as there is one.
fn demand_state(
    stage: &Stage<'_>,
    pending: &Pending,
    tick: Tick,
    asked: &str,
) -> Result<(), Failure> {
    // A robot that takes long for its tick answers when nobody waits for it any more.
    if stage.repeated.contains(&(1, tick)) {
        return Ok(());
    }
    let expected = format!(
        "asked with tick={} {asked}, the state of tick {tick} once it is there",
        tick + 1
    );
    let came = state(answer_to(pending), &expected)?;
    if (came.epoch, came.tick) == (1, tick) {
        return Ok(());
    }
    Err(Failure::new(
        expected,
        format!("the state of tick {} of epoch {}", came.tick, came.epoch),
    ))
}

/// Asked what nobody can answer, it gives no answer and goes on.
pub(super) fn unknown(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    struct Odd;
    impl Twist for Odd {
        fn after(&mut self, stage: &mut Stage<'_>, entry: &Entry) -> Result<(), Failure> {
            if !entry.clock.tick.is_multiple_of(8) {
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
                }) = stage.ask(what, parameters)?
                {
                    let expected = format!("no answer to {what}?{parameters}: refused, or none");
                    return Err(Failure::new(expected, String::from_utf8_lossy(&bytes)));
                }
            }
            Ok(())
        }
    }
    let mut stage = seated(kit, Options::default())?;
    let welcome = stage.welcome();
    let asked = play(&mut stage, &welcome, &Script::usual(kit), &mut Odd)?;
    demand_same(kit, "a query that nobody can answer", usual(kit)?, &asked)
}
