//! The ticks that a robot is taken through: what befalls it is a function of the tick and of what it proposed, so that
//! the same robot meets the same again.

use std::collections::BTreeMap;
use std::time::Duration;

use protocol::messages::{Clock, CommandId, Correction, News, Point, Report, Welcome};
use protocol::{RobotName, Seq, Tick};

use crate::kit::Kit;
use crate::report::Failure;
use crate::stage::Stage;

/// Every so many ticks the same happens to it again.
const ROUND: Tick = 16;
/// In a round: it is placed elsewhere, its move is refused, it senses another robot, it cannot ask anybody.
const PLACED: Tick = 5;
const REFUSED: Tick = 9;
const SENSES: Tick = 12;
const CUT_OFF: Tick = 14;
/// How far it is placed from where it stood, meters.
const SHIFT: (f64, f64) = (0.25, 0.125);

/// A command for the robot.
#[derive(Debug, Clone)]
pub(crate) struct Delivery {
    pub(crate) from: RobotName,
    pub(crate) seq: Seq,
    pub(crate) text: String,
    /// It is put just before the clock of this tick; `None`: never.
    pub(crate) sent: Option<Tick>,
    /// The tick whose clock names it.
    pub(crate) named: Tick,
    /// How often it is named there.
    pub(crate) times: usize,
}

/// Ticks to play.
#[derive(Debug, Clone)]
pub(crate) struct Script {
    /// How many after the first.
    pub(crate) ticks: Tick,
    /// Commands, in the order in which they are put.
    pub(crate) deliveries: Vec<Delivery>,
}

/// A tick that was played.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) clock: Clock,
    /// Where the robot stands in it.
    pub(crate) location: Point,
    pub(crate) report: Report,
    /// Its place in [`crate::stage::Seen::answers`].
    pub(crate) index: usize,
    pub(crate) took: Duration,
}

/// What was played.
pub(crate) type Transcript = Vec<Entry>;

/// What a check does between the ticks. Nothing of it may make a difference to the robot.
pub(crate) trait Twist {
    /// Before a clock is put.
    fn before(&mut self, _stage: &mut Stage<'_>, _clock: &Clock) -> Result<(), Failure> {
        Ok(())
    }

    /// After its report has come.
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
        let ([one, two], from, operator) = (kit.texts(), kit.sender(), RobotName::operator());
        let sent = |from: &RobotName, seq, text: &String, named: Tick| {
            let (from, text) = (from.clone(), text.clone());
            Delivery {
                from,
                seq,
                text,
                sent: named.checked_sub(1),
                named,
                times: 1,
            }
        };
        let base = if from == operator { 10 } else { 0 };
        let deliveries = vec![
            sent(&from, 1, &one, 3),
            sent(&from, 2, &two, 7),
            sent(&operator, base + 1, &one, 7),
            sent(&from, 3, &one, 20),
        ];
        Self {
            ticks: kit.setting.ticks,
            deliveries,
        }
    }

    /// A few quiet ticks.
    pub(crate) fn quiet(ticks: Tick) -> Self {
        Self {
            ticks,
            deliveries: Vec::new(),
        }
    }

    /// A few ticks with these commands.
    pub(crate) fn with(ticks: Tick, deliveries: Vec<Delivery>) -> Self {
        Self { ticks, deliveries }
    }

    fn named(&self, tick: Tick) -> Vec<CommandId> {
        let due = self
            .deliveries
            .iter()
            .filter(|delivery| delivery.named == tick);
        let mut named: Vec<CommandId> = due
            .flat_map(|delivery| {
                let id = CommandId {
                    from: delivery.from.clone(),
                    seq: delivery.seq,
                };
                std::iter::repeat_n(id, delivery.times)
            })
            .collect();
        named.sort();
        named
    }
}

/// Where the robot stands, and where it wants to be.
struct Body {
    stands: Point,
    proposal: Point,
}

impl Body {
    /// Its move into a tick, and what the clock has to say about it.
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

/// Plays a script to a robot that has joined, from the tick after its welcome, or from tick 0 of an epoch on.
pub(crate) fn play(
    stage: &mut Stage<'_>,
    welcome: &Welcome,
    script: &Script,
    twist: &mut dyn Twist,
) -> Result<Transcript, Failure> {
    let mut transcript = Transcript::new();
    let is_newcomer = welcome.generation > 1;
    let first = if is_newcomer { welcome.tick + 1 } else { 0 };
    let mut body = Body {
        stands: welcome.location,
        proposal: welcome.location,
    };
    for tick in first..=first + script.ticks {
        let mut news = News {
            commands: script.named(tick),
            ..News::default()
        };
        if tick == first {
            news.joined = is_newcomer.then_some(welcome.generation);
            news.correction = is_newcomer.then_some(Correction {
                location: welcome.location,
                blocked: false,
            });
        } else {
            news.correction = body.advance(tick, welcome);
            surround(&mut news, stage, welcome, tick);
        }
        let is_quiet = news.is_empty();
        let named = BTreeMap::from([(welcome.name.clone(), news)]);
        let clock = Clock {
            epoch: welcome.epoch,
            tick,
            news: if is_quiet { BTreeMap::new() } else { named },
            end: None,
        };
        for due in script
            .deliveries
            .iter()
            .filter(|delivery| delivery.sent == Some(tick))
        {
            stage.put_command(
                &due.from,
                due.seq,
                (welcome.epoch, tick.saturating_sub(1)),
                &due.text,
            )?;
        }
        twist.before(stage, &clock)?;
        let (index, took) = stage.tick(&clock)?;
        let Some(answer) = stage.seen.answers.get(index) else {
            break;
        };
        let report = answer.reading.report.clone();
        body.proposal = report.proposal;
        let entry = Entry {
            clock,
            location: body.stands,
            report,
            index,
            took,
        };
        twist.after(stage, &entry)?;
        transcript.push(entry);
    }
    Ok(transcript)
}

/// What it senses, and whom it cannot ask.
fn surround(news: &mut News, stage: &Stage<'_>, welcome: &Welcome, tick: Tick) {
    if tick % ROUND == SENSES {
        news.sensed = stage.cast.sensed(welcome.epoch, tick).into_iter().collect();
    }
    if tick % ROUND == CUT_OFF {
        news.unreachable = stage.cast.names().cloned().collect();
    }
}
