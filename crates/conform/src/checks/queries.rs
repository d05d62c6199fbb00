//! Questions: in every tick everybody learns of the tick before.

use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use protocol::bus::AnswerOf;
use protocol::keys::{QUERIES, STATE};
use protocol::messages::{Answer, Point, PublicState};
use protocol::{Epoch, Tick, decode};

use super::{Findings, seated, usual};
use crate::comparison::demand_same;
use crate::kit::Kit;
use crate::report::Failure;
use crate::script::{Entry, Script, Straight, Twist, play};
use crate::stage::{Options, Stage};

/// A question has its answer within this time, or has none.
const QUESTION_PATIENCE: Duration = Duration::from_secs(3);
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
    let mut stage = seated(kit, Options { is_followed: true, ..Options::default() })?;
    let welcome = stage.welcome();
    let mut asker = Asker { findings: Findings::default(), before: None, location: welcome.location };
    let played = play(&mut stage, &welcome, &Script::usual(kit), &mut asker);
    findings.0.extend(asker.findings.0);
    played.map(drop)
}

/// The state of a tick, if that is what the robot shows.
fn state_of(
    stage: &Stage<'_>,
    epoch: Epoch,
    tick: Tick,
    expected: &str,
) -> Result<Result<PublicState, Failure>, Failure> {
    Ok(state(stage.state_in(epoch, tick + 1)?, expected).and_then(|now| {
        if (now.epoch, now.tick) == (epoch, tick) {
            return Ok(now);
        }
        Err(Failure::new(expected, format!("the state of tick {} of epoch {}", now.tick, now.epoch)))
    }))
}

/// What came as an answer, read as a state.
pub(super) fn state(answer: Option<AnswerOf>, expected: &str) -> Result<PublicState, Failure> {
    match answer {
        None => Err(Failure::new(expected, "no answer")),
        Some(AnswerOf { result: Err(reason), .. }) => {
            Err(Failure::new(expected, format!("refused: {reason}")))
        }
        Some(AnswerOf { result: Ok(bytes), .. }) => {
            decode(STATE, "the robot", &bytes).map_err(|error| Failure::new(expected, error.to_string()))
        }
    }
}

impl Twist for Asker {
    fn after(&mut self, stage: &mut Stage<'_>, entry: &Entry) -> Result<(), Failure> {
        let (epoch, tick) = (entry.clock.epoch, entry.clock.tick);
        let expected = format!("asked with tick={}, the state of tick {tick}", tick + 1);
        // At once after the report: whoever comes with the next clock may ask.
        let asked = Instant::now();
        let mut came = state_of(stage, epoch, tick, &expected)?;
        if let Err(failure) = &came {
            // Too late, or never?
            let failure = failure.clone();
            while came.is_err() && asked.elapsed() < LATE {
                std::thread::sleep(ASK_AGAIN);
                came = state_of(stage, epoch, tick, &expected)?;
            }
            let rule = if came.is_ok() { "tick.state-first" } else { "query.tick" };
            self.findings.fail(rule, failure);
        }
        let Ok(now) = came else { return Ok(()) };
        self.findings.settle("tick.state-first", check_followed(stage, entry));
        self.check_location(entry, &now);
        let matched = check_state(entry, &now)
            .and_then(|()| self.check_before(stage, epoch, tick))
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
            return self.findings.fail("tick.initial", Failure::new(expected, came));
        }
        let is_corrected = entry.clock.news.values().any(|news| news.correction.is_some());
        let why = if is_corrected { "as the clock corrects it" } else { "as it proposed" };
        let expected = format!("it stands at {:?}, {why}", self.location);
        self.findings.fail("tick.correction", Failure::new(expected, came));
    }

    /// The tick before is still told to whoever asks late.
    fn check_before(&self, stage: &Stage<'_>, epoch: Epoch, tick: Tick) -> Result<(), Failure> {
        let Some(before) = &self.before else { return Ok(()) };
        let expected = format!("asked with tick={tick}, still the state of tick {}", before.tick);
        let came = state(stage.state_in(epoch, tick)?, &expected)?;
        if came == *before { Ok(()) } else { Err(Failure::new(expected, format!("{came:?}"))) }
    }
}

/// What followers are sent comes before the report, if it is sent.
fn check_followed(stage: &Stage<'_>, entry: &Entry) -> Result<(), Failure> {
    let tick = entry.clock.tick;
    let report = stage.seen.answers.get(entry.index).map(|answer| answer.order);
    let is_meant = |state: &&(usize, Result<PublicState, String>)| {
        state.1.as_ref().is_ok_and(|state| state.tick == tick)
    };
    let shown = stage.seen.states.iter().find(is_meant).map(|(order, _)| *order);
    if shown.is_some_and(|shown| report.is_some_and(|report| shown > report)) {
        let expected = format!("the state of tick {tick} before the report");
        return Err(Failure::new(expected, "it came after the report"));
    }
    Ok(())
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
    Err(Failure::new(format!("the state shows what is reported: {shown:?}"), format!("{now:?}")))
}

/// The six queries say the same, each its part.
fn check_six(stage: &Stage<'_>, epoch: Epoch, tick: Tick, now: &PublicState) -> Result<(), Failure> {
    // One tick in so many: six questions cost time.
    if !tick.is_multiple_of(10) {
        return Ok(());
    }
    for what in QUERIES {
        let expected = format!("the answer to {what} for tick {tick}: {:?}", now.answer(what));
        let came = match stage.ask(what, &format!("tick={};epoch={epoch}", tick + 1))? {
            Some(AnswerOf { result: Ok(bytes), .. }) => decode::<Answer>(what, "the robot", &bytes)
                .map_err(|error| Failure::new(expected.clone(), error.to_string()))?,
            Some(AnswerOf { result: Err(reason), .. }) => return Err(Failure::new(expected, reason)),
            None => return Err(Failure::new(expected, "no answer")),
        };
        let is_same = now.answer(what).is_some_and(|wanted| {
            (wanted.epoch, wanted.tick) == (came.epoch, came.tick) && same_value(&wanted.value, &came.value)
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

/// Asked for a tick that is not done, long over or of another epoch, it may refuse, keep silent or wait; it never gives
/// the state of another tick for it.
pub(super) fn early(kit: &Kit, _: &mut Findings) -> Result<(), Failure> {
    let mut stage = seated(kit, Options::default())?;
    // Before its first tick there is nothing to tell.
    demand_no_wrong_state(&stage, &[(1, 1)])?;
    let welcome = stage.welcome();
    let ticks = 8;
    let transcript = play(&mut stage, &welcome, &Script::quiet(ticks), &mut Straight)?;
    let last = transcript.last().map_or(0, |entry| entry.clock.tick);
    let odd =
        [(1, last + 2), (1, last + 3), (1, last + 50), (1, last - 3), (1, 0), (9, last + 1), (0, last + 1)];
    demand_no_wrong_state(&stage, &odd)?;
    let next = protocol::messages::Clock { epoch: 1, tick: last + 1, ..Default::default() };
    stage.tick(&next).map(drop)
}

/// Asks for each epoch and tick at once. An answer is one for the tick before the one that was asked for.
fn demand_no_wrong_state(stage: &Stage<'_>, asked: &[(Epoch, Tick)]) -> Result<(), Failure> {
    let (sender, answers) = channel();
    let key = stage.keys.query(&stage.kit.subject(), STATE);
    for &(epoch, tick) in asked {
        let sender = sender.clone();
        stage.kit.bus.ask_then(&key, &format!("tick={tick};epoch={epoch}"), move |answer| {
            // Nobody waits for it any more where this check is over.
            let _ = sender.send((epoch, tick, answer));
        })?;
    }
    for _ in asked {
        let Ok((epoch, tick, answer)) = answers.recv_timeout(QUESTION_PATIENCE) else { break };
        let Some(AnswerOf { result: Ok(bytes), .. }) = answer else { continue };
        let expected = format!("no state for tick={tick};epoch={epoch}: refused, or no answer");
        let came: PublicState = decode(&key, "the robot", &bytes)
            .map_err(|error| Failure::new(expected.clone(), error.to_string()))?;
        if (came.epoch, came.tick.checked_add(1)) != (epoch, Some(tick)) {
            let came = format!("the state of tick {} of epoch {}", came.tick, came.epoch);
            return Err(Failure::new(expected, came));
        }
    }
    Ok(())
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
                if let Some(AnswerOf { result: Ok(bytes), .. }) = stage.ask(what, parameters)? {
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
    demand_same(kit, "a question that nobody can answer", usual(kit)?, &asked)
}
