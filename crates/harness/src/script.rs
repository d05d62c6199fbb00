//! The ticks that a robot is taken through: what happens to it is a function of the tick and of what it proposed, so that
//! the same robot meets the same again.

use std::cell::RefCell;
use std::ops::Deref;
use std::time::Duration;

use protocol::messages::{Delivery, Payload, Performative, PublicState, StreamReseed, TickUpdate};
use protocol::{Generation, RobotName, Tick};
use serde_json::Value;

use crate::body::{ROUND, RobotBody};
use crate::comparison::demand_same;
use crate::harness::{Harness, HarnessOptions};
use crate::kit::{Kit, KitRoster};
use crate::report::{KitPart, RuleFailure};
use crate::transcript::{PlayedTick, Transcript};

/// In a round of ticks: the robot senses another one.
const SENSES: Tick = 12;
/// In a round of ticks: it can query no other one, because none is reachable.
pub const CUT_OFF: Tick = 14;
/// The same, because none is in range.
pub const OUT_OF_RANGE: Tick = 8;
const FIRST_IN_RANGE: Tick = 6;
/// The same: no body is near, and the robot senses none.
const NOBODY: Tick = 11;
/// The first of the words that come in turn, and how far they are apart, ticks.
const FIRST_WORD: Tick = 5;
const WORD_EVERY: usize = 10;

/// Ticks of the epoch before the one in which a robot is checked.
const EARLIER: Tick = 9;
/// How long the simulator is away in it.
const AWAY: Duration = Duration::from_millis(50);

/// A command that arrives at the robot.
#[derive(Debug, Clone)]
pub struct ArrivingCommand {
    /// Its sender.
    pub from: RobotName,
    /// Its text.
    pub text: String,
    /// Its payload.
    pub payload: Option<Payload>,
    /// The tick in whose news it is.
    pub tick: Tick,
}

impl ArrivingCommand {
    /// The command `text` of `from`, in the news of a tick.
    pub fn new(from: &RobotName, text: &str, tick: Tick) -> Self {
        Self {
            from: from.clone(),
            text: text.to_owned(),
            payload: None,
            tick,
        }
    }

    /// The same with a payload.
    pub fn with_payload(self, payload: &Value) -> Self {
        Self {
            payload: Payload::new(payload.clone()),
            ..self
        }
    }

    /// As news list it.
    pub fn delivery(&self) -> Delivery {
        Delivery {
            from: self.from.clone(),
            performative: Performative::Achieve,
            command: self.text.clone(),
            payload: self.payload.clone(),
        }
    }
}

/// Ticks to play.
#[derive(Debug, Clone)]
pub struct PlayScript {
    /// How many after the first.
    pub ticks: Tick,
    /// Commands, in the order in which they count.
    pub arrivals: Vec<ArrivingCommand>,
}

/// What a check does between the ticks. None of it may make a difference to the robot.
pub trait Disturbance {
    /// Changes news in a way that makes no difference.
    fn news(&mut self, _stage: &Harness<'_>, _news: &mut TickUpdate) {}

    /// Before a tick is granted.
    fn before(&mut self, _stage: &mut Harness<'_>, _tick: Tick) -> Result<(), RuleFailure> {
        Ok(())
    }

    /// After news and clock of a tick are put.
    fn during(&mut self, _stage: &mut Harness<'_>, _tick: Tick) -> Result<(), RuleFailure> {
        Ok(())
    }

    /// After the tick is complete.
    fn after(&mut self, _stage: &mut Harness<'_>, _entry: &PlayedTick) -> Result<(), RuleFailure> {
        Ok(())
    }
}

/// No disturbance at all.
pub struct Straight;

impl Disturbance for Straight {}

impl PlayScript {
    /// The usual ticks: a few commands among them. Whichever of two words sends a robot to sleep, it is awake in some of the ticks in
    /// which it cannot query others, and asleep in some.
    pub fn usual(kit: &Kit) -> Self {
        let [one, two] = kit.texts();
        let from = kit.sender();

        Self {
            ticks: kit.setting.ticks,
            arrivals: vec![
                ArrivingCommand::new(&from, &one, 3),
                ArrivingCommand::new(&from, &one, 7),
                ArrivingCommand::new(&from, &two, 7),
                ArrivingCommand::new(&RobotName::operator(), &one, 10),
                ArrivingCommand::new(&from, &two, 11),
                ArrivingCommand::new(&from, &one, 20),
                ArrivingCommand::new(&from, &two, 32),
                ArrivingCommand::new(&from, &one, 60),
                ArrivingCommand::new(&from, &two, 61),
            ],
        }
    }

    /// Ticks in which both words arrive in turn, every ten ticks from each of these senders, to the end.
    pub fn in_turn(kit: &Kit, senders: &[RobotName], ticks: Tick) -> Self {
        let texts = kit.texts();
        let mut arrivals = Vec::new();
        for (tick, text) in (FIRST_WORD..=ticks)
            .step_by(WORD_EVERY)
            .zip(texts.iter().cycle())
        {
            for sender in senders {
                arrivals.push(ArrivingCommand::new(sender, text, tick));
            }
        }
        Self { ticks, arrivals }
    }

    /// So many of the usual ticks, which are to leave nothing behind.
    pub fn busy(kit: &Kit, ticks: Tick) -> Self {
        Self {
            ticks,
            ..Self::usual(kit).busy_until(kit, ticks)
        }
    }

    /// The same, and up to a tick each word is the last one in one of the last two ticks: a robot that puts an answer off has one left.
    #[must_use]
    pub fn busy_until(mut self, kit: &Kit, last: Tick) -> Self {
        let [one, two] = kit.texts();
        let from = kit.sender();
        self.arrivals.retain(|arrival| arrival.tick + 1 < last);
        for (text, tick) in [
            (&one, last - 1),
            (&two, last - 1),
            (&two, last),
            (&one, last),
        ] {
            self.arrivals.push(ArrivingCommand::new(&from, text, tick));
        }
        self
    }

    /// A few quiet ticks.
    pub fn quiet(ticks: Tick) -> Self {
        Self {
            ticks,
            arrivals: Vec::new(),
        }
    }

    /// A few ticks with these commands.
    pub fn with(ticks: Tick, arrivals: Vec<ArrivingCommand>) -> Self {
        Self { ticks, arrivals }
    }

    fn deliveries(&self, tick: Tick) -> Vec<Delivery> {
        let mut deliveries = Vec::new();
        for arrival in &self.arrivals {
            if arrival.tick == tick {
                deliveries.push(arrival.delivery());
            }
        }
        deliveries.sort_by(|one, other| one.from.cmp(&other.from));

        deliveries
    }
}

/// A robot that has joined a run of its own, ready for its first clock, or with what comes before in this part of the kit.
pub fn with_robot(kit: &Kit, options: HarnessOptions) -> Result<Harness<'_>, RuleFailure> {
    let mut harness = Harness::open_run(kit, options)?;
    harness.join()?;
    match kit.part() {
        KitPart::Alone | KitPart::InRun => return Ok(harness),
        KitPart::LaterEpoch => play_earlier_epoch(&mut harness)?,
        KitPart::Rejoined => rejoin(&mut harness)?,
    }
    // What is checked is what comes from here on.
    harness.seen.forget();
    harness.fake_peers.forget_asked();
    Ok(harness)
}

/// The epoch before the one in which a robot is checked: commands, a move that is refused, and a simulator that is away and back.
fn play_earlier_epoch(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    let script = PlayScript {
        ticks: EARLIER,
        ..PlayScript::usual(harness.kit)
    };
    play(harness, &script, &mut Straight)?;
    harness.show_simulator(false)?;
    harness.pass(AWAY);
    harness.show_simulator(true)?;
    harness.begin_epoch(harness.epoch() + 1);
    Ok(())
}

/// The first tick, and one that the robot misses, so that it joins again: all that is checked comes after the next one.
fn rejoin(harness: &mut Harness<'_>) -> Result<(), RuleFailure> {
    let welcome = harness.template.clone();
    let reported = play(harness, &PlayScript::quiet(0), &mut Straight)?;
    let generation = harness.generation();
    inherit(harness, &reported, generation + 1);
    harness.miss()?;
    harness.open(&TickUpdate::default())?;
    harness.until_rejoined(generation)?;
    play(harness, &PlayScript::quiet(0), &mut Straight)?;
    harness.template = welcome;
    Ok(())
}

/// Further welcomes are those of an incarnation whose predecessor has reported this.
pub fn inherit(harness: &mut Harness<'_>, reported: &[PlayedTick], generation: Generation) {
    let epoch = harness.epoch();
    let mut last_first = reported.iter().rev().map(|entry| PublicState {
        epoch,
        ..entry.state()
    });
    harness.template.last_state = last_first.next();
    harness.template.state_before = last_first.next();
    harness.template.stream = format!("robot/{}#{generation}", harness.template.name);
    if let Some(last) = &harness.template.last_state {
        harness.template.location = last.location;
    }
}

/// `reseeds` of a welcome: from these ticks on these seeds.
#[must_use]
pub fn reseeds_at<const COUNT: usize>(seeds: [(Tick, u64); COUNT]) -> Vec<StreamReseed> {
    seeds
        .map(|(tick, seed)| StreamReseed { tick, seed })
        .to_vec()
}

/// A process of its own, taken straight through a script.
pub fn played(kit: &Kit, script: &PlayScript) -> Result<Transcript, RuleFailure> {
    played_among(kit, KitRoster::Usual, script)
}

/// The same in a roster.
pub fn played_among(
    kit: &Kit,
    roster: KitRoster,
    script: &PlayScript,
) -> Result<Transcript, RuleFailure> {
    play(&mut with_robot_among(kit, roster)?, script, &mut Straight)
}

fn with_robot_among(kit: &Kit, roster: KitRoster) -> Result<Harness<'_>, RuleFailure> {
    let options = HarnessOptions {
        roster,
        ..HarnessOptions::default()
    };
    with_robot(kit, options)
}

/// Many plays that are compared with each other. One process goes through them, in an epoch for each: to start a program takes longer
/// than a play. One that has joined again is what it is in one epoch only, so there each play has a process of its own.
pub struct Plays<'k> {
    kit: &'k Kit,
    harnesses: RefCell<Vec<(KitRoster, Harness<'k>)>>,
}

impl Deref for Plays<'_> {
    type Target = Kit;

    fn deref(&self) -> &Kit {
        self.kit
    }
}

impl<'k> Plays<'k> {
    /// Before the first of them.
    pub fn new(kit: &'k Kit) -> Self {
        Self {
            kit,
            harnesses: RefCell::default(),
        }
    }

    /// The next of them, in the usual roster.
    pub fn play(&self, script: &PlayScript) -> Result<Transcript, RuleFailure> {
        self.play_among(KitRoster::Usual, script, &mut Straight)
    }

    /// The same in a roster, with a disturbance.
    pub fn play_among(
        &self,
        roster: KitRoster,
        script: &PlayScript,
        disturbance: &mut dyn Disturbance,
    ) -> Result<Transcript, RuleFailure> {
        let mut harnesses = self.harnesses.borrow_mut();
        let at = match harnesses.iter().position(|(of, _)| *of == roster) {
            Some(at) if self.kit.part() != KitPart::Rejoined => {
                let harness = &mut harnesses[at].1;
                harness.seen.forget();
                harness.begin_epoch(harness.epoch() + 1);
                at
            }
            _ => {
                harnesses.push((roster, with_robot_among(self.kit, roster)?));
                harnesses.len() - 1
            }
        };
        let played = play(&mut harnesses[at].1, script, disturbance);
        if self.kit.part() == KitPart::Rejoined {
            harnesses.clear();
        }
        played
    }
}

/// The usual ticks, as the robot went through them without any disturbance.
pub fn usual(kit: &Kit) -> Result<&Transcript, RuleFailure> {
    kit.usual()
        .get()
        .ok_or_else(|| RuleFailure::new("the usual ticks are played first", "they were not"))
}

/// Plays a script to a robot that has joined, from the next tick of its harness on.
pub fn play(
    harness: &mut Harness<'_>,
    script: &PlayScript,
    disturbance: &mut dyn Disturbance,
) -> Result<Transcript, RuleFailure> {
    let mut transcript = Transcript::new();
    for _ in 0..=script.ticks {
        transcript.push(step(harness, script, disturbance)?);
    }

    Ok(transcript)
}

/// Plays the usual ticks to a robot that has joined, and demands that it goes through them as without `disturbance`.
pub fn demand_usual(
    harness: &mut Harness<'_>,
    what: &str,
    disturbance: &mut dyn Disturbance,
) -> Result<(), RuleFailure> {
    let kit = harness.kit;
    let played = play(harness, &PlayScript::usual(kit), disturbance)?;
    demand_same(kit, what, usual(kit)?, &played)
}

/// Plays the next tick.
pub fn step(
    harness: &mut Harness<'_>,
    script: &PlayScript,
    disturbance: &mut dyn Disturbance,
) -> Result<PlayedTick, RuleFailure> {
    let epoch = harness.epoch();
    let tick = harness.next_tick();
    let mut news = news_of(harness, script, tick);
    disturbance.news(harness, &mut news);
    disturbance.before(harness, tick)?;
    harness.open(&news)?;
    disturbance.during(harness, tick)?;

    let done = harness.complete()?;
    harness.body.propose(&done.report, &harness.template);
    let entry = PlayedTick {
        epoch,
        tick,
        news,
        location: harness.body.stands,
        report: done.report,
        commands: done.commands,
        index: done.index,
        took: done.took,
    };
    disturbance.after(harness, &entry)?;

    Ok(entry)
}

/// Whether the robot can query another one in a tick, by the news of these ticks.
pub fn can_query(tick: Tick) -> bool {
    ![CUT_OFF, OUT_OF_RANGE].contains(&(tick % ROUND))
}

/// What is new for the robot in a tick.
fn news_of(harness: &mut Harness<'_>, script: &PlayScript, tick: Tick) -> TickUpdate {
    let epoch = harness.epoch();
    let mut news = TickUpdate {
        commands: script.deliveries(tick),
        ..TickUpdate::default()
    };
    if harness.kit.wants_bodies() && tick % ROUND != NOBODY {
        news.bodies = harness.fake_peers.bodies(epoch, tick);
    }

    let drives = harness.template.drive.is_some();
    let start = RobotBody::at(harness.template.location, harness.kit.heading_rad());
    if harness.takes_over() {
        harness.body = start;
        news.correction = Some(harness.body.confirmed());
    } else if tick == 0 {
        harness.body = start;
        // News that name an incarnation say where it stands.
        news.correction = (harness.generation() > 1).then(|| start.confirmed());
    } else {
        news.correction = harness.body.advance(tick, &harness.template);
        // What it proposed is not where it drove.
        if drives && news.correction.is_none() {
            news.correction = Some(harness.body.confirmed());
        }
        if tick % ROUND == SENSES {
            news.sensed = harness.fake_peers.sensed(epoch, tick);
        }
        if tick % ROUND == OUT_OF_RANGE {
            news.in_range = Some(Vec::new());
        }
        if tick % ROUND == FIRST_IN_RANGE {
            news.in_range = Some(harness.fake_peers.names().take(1).cloned().collect());
        }
        if tick % ROUND == CUT_OFF {
            news.unreachable = harness.fake_peers.names().cloned().collect();
        }
    }

    news
}
