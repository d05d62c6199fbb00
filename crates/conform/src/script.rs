//! The ticks that a robot is taken through: what happens to it is a function of the tick and of what it proposed, so that
//! the same robot meets the same again.

use std::time::Duration;

use protocol::messages::{Correction, Delivery, News, Performative, Point, Report, Welcome};
use protocol::{Epoch, RobotName, Tick};

use crate::kit::Kit;
use crate::report::Failure;
use crate::stage::{Sent, Stage};

/// Every so many ticks the same happens to it again.
const ROUND: Tick = 16;
/// In a round: it is placed elsewhere, its move is refused, it senses another robot, it cannot query any other.
const PLACED: Tick = 5;
const REFUSED: Tick = 9;
const SENSES: Tick = 12;
const CUT_OFF: Tick = 14;
/// How far it is placed from where it stood, meters.
const SHIFT: (f64, f64) = (0.25, 0.125);

/// A command that arrives at the robot.
#[derive(Debug, Clone)]
pub(crate) struct Arrival {
    pub(crate) from: RobotName,
    pub(crate) text: String,
    /// The tick in whose news it is.
    pub(crate) tick: Tick,
}

/// Ticks to play.
#[derive(Debug, Clone)]
pub(crate) struct Script {
    /// How many after the first.
    pub(crate) ticks: Tick,
    /// Commands, in the order in which they count.
    pub(crate) arrivals: Vec<Arrival>,
}

/// A tick that was played.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) epoch: Epoch,
    pub(crate) tick: Tick,
    pub(crate) news: News,
    /// Where the robot stands in it.
    pub(crate) location: Point,
    pub(crate) report: Report,
    /// Its commands, by number.
    pub(crate) commands: Vec<Sent>,
    /// The place of its report in [`crate::stage::Seen::answers`].
    pub(crate) index: usize,
    pub(crate) took: Duration,
}

/// What was played.
pub(crate) type Transcript = Vec<Entry>;

/// What a check does between the ticks. None of it may make a difference to the robot.
pub(crate) trait Twist {
    /// Before a tick is granted.
    fn before(&mut self, _stage: &mut Stage<'_>, _tick: Tick) -> Result<(), Failure> {
        Ok(())
    }

    /// After news and clock of a tick are put.
    fn during(&mut self, _stage: &mut Stage<'_>, _tick: Tick) -> Result<(), Failure> {
        Ok(())
    }

    /// After the tick is complete.
    fn after(&mut self, _stage: &mut Stage<'_>, _entry: &Entry) -> Result<(), Failure> {
        Ok(())
    }
}

/// No twist at all.
pub(crate) struct Straight;

impl Twist for Straight {}

impl Script {
    /// The usual ticks: a few commands among them.
    pub(crate) fn usual(kit: &Kit) -> Self {
        let [one, two] = kit.texts();
        let from = kit.sender();
        let arrival = |from: &RobotName, text: &String, tick: Tick| Arrival {
            from: from.clone(),
            text: text.clone(),
            tick,
        };

        Self {
            ticks: kit.setting.ticks,
            arrivals: vec![
                arrival(&from, &one, 3),
                arrival(&from, &two, 7),
                arrival(&from, &one, 7),
                arrival(&RobotName::operator(), &one, 10),
                arrival(&from, &one, 20),
            ],
        }
    }

    /// A few quiet ticks.
    pub(crate) fn quiet(ticks: Tick) -> Self {
        Self {
            ticks,
            arrivals: Vec::new(),
        }
    }

    /// A few ticks with these commands.
    pub(crate) fn with(ticks: Tick, arrivals: Vec<Arrival>) -> Self {
        Self { ticks, arrivals }
    }

    fn deliveries(&self, tick: Tick) -> Vec<Delivery> {
        let mut deliveries = Vec::new();
        for arrival in &self.arrivals {
            if arrival.tick == tick {
                deliveries.push(Delivery {
                    from: arrival.from.clone(),
                    performative: Performative::Achieve,
                    command: arrival.text.clone(),
                });
            }
        }
        deliveries.sort_by(|one, other| one.from.cmp(&other.from));

        deliveries
    }
}

/// Where the robot stands, and where it wants to be.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Body {
    pub(crate) stands: Point,
    pub(crate) proposal: Point,
}

impl Body {
    pub(crate) fn at(location: Point) -> Self {
        Self {
            stands: location,
            proposal: location,
        }
    }

    /// Its move into a tick, and the correction if it does not stand where it proposed.
    fn advance(&mut self, tick: Tick, welcome: &Welcome) -> Option<Correction> {
        let half_m = welcome.body_m / 2.0;
        let is_free = |at: Point| {
            let within = |along: f64, size_m: f64| along >= half_m && along <= size_m - half_m;
            within(at.x, welcome.field_m[0]) && within(at.y, welcome.field_m[1])
        };
        if tick % ROUND == PLACED {
            let shifted = |sign: f64| {
                Point::new(
                    self.stands.x + sign * SHIFT.0,
                    self.stands.y + sign * SHIFT.1,
                )
            };
            self.stands = if is_free(shifted(1.0)) {
                shifted(1.0)
            } else {
                shifted(-1.0)
            };
            return Some(Correction {
                location: self.stands,
                blocked: false,
            });
        }
        if tick % ROUND == REFUSED || !is_free(self.proposal) {
            return Some(Correction {
                location: self.stands,
                blocked: true,
            });
        }

        self.stands = self.proposal;
        None
    }
}

/// Plays a script to a robot that has joined, from the next tick of its stage on.
pub(crate) fn play(
    stage: &mut Stage<'_>,
    script: &Script,
    twist: &mut dyn Twist,
) -> Result<Transcript, Failure> {
    let mut transcript = Transcript::new();
    for _ in 0..=script.ticks {
        transcript.push(step(stage, script, twist)?);
    }

    Ok(transcript)
}

/// Plays the next tick.
pub(crate) fn step(
    stage: &mut Stage<'_>,
    script: &Script,
    twist: &mut dyn Twist,
) -> Result<Entry, Failure> {
    let epoch = stage.epoch();
    let tick = stage.next_tick();
    let news = news_of(stage, script, tick);
    twist.before(stage, tick)?;
    stage.open(&news)?;
    twist.during(stage, tick)?;

    let done = stage.complete()?;
    stage.body.proposal = done.report.proposal;
    let entry = Entry {
        epoch,
        tick,
        news,
        location: stage.body.stands,
        report: done.report,
        commands: done.commands,
        index: done.index,
        took: done.took,
    };
    twist.after(stage, &entry)?;

    Ok(entry)
}

/// What is new for the robot in a tick.
fn news_of(stage: &mut Stage<'_>, script: &Script, tick: Tick) -> News {
    let epoch = stage.epoch();
    let mut news = News {
        commands: script.deliveries(tick),
        ..News::default()
    };
    if stage.kit.wants_bodies() {
        news.bodies = stage.cast.bodies(epoch, tick);
    }
    if stage.takes_over() {
        stage.body = Body::at(stage.template.location);
        news.correction = Some(Correction {
            location: stage.body.stands,
            blocked: false,
        });
    } else if tick == 0 {
        stage.body = Body::at(stage.template.location);
    } else {
        news.correction = stage.body.advance(tick, &stage.template);
        if tick % ROUND == SENSES {
            news.sensed = stage.cast.sensed(epoch, tick).into_iter().collect();
        }
        if tick % ROUND == CUT_OFF {
            news.unreachable = stage.cast.names().cloned().collect();
        }
    }

    news
}
