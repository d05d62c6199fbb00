//! The simulation itself: synchronous, without a network, a function of scenario, seed and reports.

use std::collections::BTreeMap;

use protocol::messages::{
    Clock, CommandId, Correction, Cut, End, News, Percept, Performative, Point, ProcessOrder,
    PublicState, Report, SensedBody, SensedKind, SensedRobot, StateVariables, Welcome,
};
use protocol::random::{Stream, stream};
use protocol::{Epoch, Event, Generation, Line, PROTOCOL_VERSION, RobotName, RunName, Seq, Tick};
use world::{Blocker, Body, HallError, Verdict, World};

use crate::digest::Digest;
use crate::medium::{Medium, Underway};
use crate::scenario::{Fault, FaultEnd, Scenario, to_wire};

/// More commands than one incarnation ever sends; as many incarnations as ever come fit below 2^53 with it.
const SEQS_OF_A_GENERATION: Seq = 1_000_000_000;

/// How a clock reaches the robots and their reports come back: over the bus, or by calling them.
pub trait Barrier {
    /// Why a tick was given up before it was complete.
    type Interrupt;

    /// Grants the tick to all robots, and returns when the tick is complete.
    ///
    /// # Errors
    /// The interrupt, if the tick is given up.
    fn exchange(
        &mut self,
        clock: Clock,
        simulation: &Simulation,
    ) -> Result<Exchange, Self::Interrupt>;
}

/// What came of a tick.
#[derive(Debug, Default)]
pub struct Exchange {
    /// The reports, by robot; one that is late or lost has none.
    pub reports: BTreeMap<RobotName, Report>,
    /// Who came and went.
    pub membership: Vec<Membership>,
}

/// A change of who takes part.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Membership {
    /// A further incarnation takes part from this tick on.
    Joined(RobotName, Generation),
    /// A robot takes part no more from this tick on.
    Lost(RobotName),
}

/// A complete tick.
#[derive(Debug)]
pub struct TickRecord {
    /// Which.
    pub tick: Tick,
    /// What happened in it, in a fixed order; the last one carries the digest.
    pub events: Vec<Event>,
}

impl TickRecord {
    /// The lines of `events.jsonl`.
    pub fn lines(&self) -> impl Iterator<Item = Line> + '_ {
        self.events.iter().map(|event| Line {
            tick: self.tick,
            event: event.clone(),
        })
    }
}

/// One epoch of a run.
pub struct Simulation {
    scenario: Scenario,
    epoch: Epoch,
    names: Vec<RobotName>,
    /// Last complete tick.
    tick: Tick,
    /// Tick as of which bodies stand where they do: the complete one or the one under way.
    now: Tick,
    world: World<Stream>,
    medium: Medium,
    /// Commands that the clock under way names, by target.
    arriving: BTreeMap<RobotName, Vec<CommandId>>,
    /// Whom each robot cannot ask during the tick under way.
    unreachable: BTreeMap<RobotName, Vec<RobotName>>,
    /// What each robot reported last.
    reports: BTreeMap<RobotName, Report>,
    /// Where each robot stood at the last complete tick, in the order of names.
    stood_at: Vec<Point>,
    /// Robots whose report of the last tick is missing: they propose nothing, and nobody can query them.
    silent: Vec<RobotName>,
    blocked: Vec<bool>,
    operator_seq: Seq,
    /// What happened between the last tick and the next.
    between: Vec<Event>,
    digest: Digest,
}

impl Simulation {
    /// The environment of a scenario before tick 0.
    ///
    /// # Errors
    /// [`HallError`] if its bodies cannot be placed.
    pub fn new(scenario: Scenario, epoch: Epoch) -> Result<Self, HallError> {
        let world = World::new(&scenario.hall(), stream(scenario.seed, "guests"))?;
        let names = scenario.roster();
        Ok(Self {
            epoch,
            blocked: vec![false; names.len()],
            tick: 0,
            now: 0,
            world,
            medium: Medium::new(
                scenario.seed,
                scenario.tick_s,
                scenario.network.clone(),
                names.clone(),
            ),
            names,
            arriving: BTreeMap::new(),
            unreachable: BTreeMap::new(),
            reports: BTreeMap::new(),
            stood_at: Vec::new(),
            silent: Vec::new(),
            operator_seq: 0,
            between: Vec::new(),
            digest: Digest::default(),
            scenario,
        })
    }

    /// Tick 0: everybody is told to initialize, and proposes where to go.
    ///
    /// # Errors
    /// The barrier's interrupt.
    pub fn init<B: Barrier>(&mut self, barrier: &mut B) -> Result<TickRecord, B::Interrupt> {
        let mut events = vec![Event::Init {
            seed: self.scenario.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            protocol: PROTOCOL_VERSION,
            tick_s: self.scenario.tick_s,
        }];
        for name in &self.names {
            let at = self.location(name).unwrap_or_default();
            events.push(Event::Joined {
                robot: name.clone(),
                generation: None,
                at,
            });
        }
        let clock = self.clock(0, &[]);
        let exchange = barrier.exchange(clock, self)?;
        Ok(self.record(0, events, exchange))
    }

    /// One tick (seed, Figure 5): move, medium, clock, barrier, record.
    ///
    /// # Errors
    /// The barrier's interrupt; the tick is then incomplete and the epoch is over.
    pub fn step<B: Barrier>(&mut self, barrier: &mut B) -> Result<TickRecord, B::Interrupt> {
        let tick = self.tick + 1;
        let mut events = std::mem::take(&mut self.between);

        self.now = tick;
        let verdicts = self.world.advance(&self.proposals());
        self.note_moves(&verdicts, &mut events);

        let decision = self.medium.decide(tick);
        events.extend(decision.events);
        self.arriving = decision.delivered;
        self.unreachable = self.join_silent(decision.unreachable);

        let clock = self.clock(tick, &verdicts);
        let exchange = barrier.exchange(clock, self)?;

        Ok(self.record(tick, events, exchange))
    }

    /// Where each robot wants to be; one that has not reported stays.
    fn proposals(&self) -> Vec<Option<world::Point>> {
        let proposal = |name: &RobotName| {
            let report = self
                .reports
                .get(name)
                .filter(|_| !self.silent.contains(name))?;
            Some(world::Point::new(report.proposal.x, report.proposal.y))
        };
        self.names.iter().map(proposal).collect()
    }

    fn note_moves(&mut self, verdicts: &[Verdict], events: &mut Vec<Event>) {
        for (index, verdict) in verdicts.iter().enumerate() {
            let by = self.blocker(*verdict);
            self.blocked[index] = by.is_some();
            if let Some(by) = by {
                let at = to_wire(self.world.robots()[index]);
                events.push(Event::Blocked {
                    robot: self.names[index].clone(),
                    by,
                    at,
                });
            }
        }
    }

    /// What refused a move, in a word; `None` if it was not refused.
    fn blocker(&self, verdict: Verdict) -> Option<String> {
        Some(match verdict {
            Verdict::Advanced | Verdict::Stayed => return None,
            Verdict::Blocked { by: Blocker::Edge } => "edge".to_owned(),
            Verdict::Blocked {
                by: Blocker::Body(Body::Obstacle(_)),
            } => "obstacle".to_owned(),
            Verdict::Blocked {
                by: Blocker::Body(Body::Guest(_)),
            } => "guest".to_owned(),
            Verdict::Blocked {
                by: Blocker::Body(Body::Robot(index)),
            } => self.names[index].to_string(),
            Verdict::TooFast | Verdict::NotFinite => "too_fast".to_owned(),
        })
    }

    /// The clock of a tick: exceptions only.
    fn clock(&self, tick: Tick, verdicts: &[Verdict]) -> Clock {
        let mut news = BTreeMap::new();
        for (index, name) in self.names.iter().enumerate() {
            let is_refused = verdicts
                .get(index)
                .is_some_and(|verdict| self.blocker(*verdict).is_some());
            let is_corrected = is_refused || self.silent.contains(name);
            let correction = is_corrected.then(|| Correction {
                location: to_wire(self.world.robots()[index]),
                blocked: is_refused,
            });
            let own = News {
                correction,
                commands: self.arriving.get(name).cloned().unwrap_or_default(),
                unreachable: self.unreachable.get(name).cloned().unwrap_or_default(),
                sensed: self.sensed_robots(index),
                joined: None,
            };
            if !own.is_empty() {
                news.insert(name.clone(), own);
            }
        }
        Clock {
            epoch: self.epoch,
            tick,
            news,
            end: None,
        }
    }

    /// Whom each robot cannot ask: those from whom the medium cuts it off, and those whose last report is missing.
    fn join_silent(
        &self,
        mut cut: BTreeMap<RobotName, Vec<RobotName>>,
    ) -> BTreeMap<RobotName, Vec<RobotName>> {
        for name in self.names.iter().filter(|_| !self.silent.is_empty()) {
            let others = cut.entry(name.clone()).or_default();
            others.extend(self.silent.iter().filter(|silent| *silent != name).cloned());
            others.sort();
            others.dedup();
        }
        cut
    }

    /// The end of a tick: what the robots did, and the digest.
    fn record(&mut self, tick: Tick, mut events: Vec<Event>, exchange: Exchange) -> TickRecord {
        let mut membership = exchange.membership;
        membership.sort();
        for change in membership {
            events.push(match change {
                Membership::Joined(robot, generation) => {
                    let at = self.location(&robot).unwrap_or_default();
                    Event::Joined {
                        robot,
                        generation: Some(generation),
                        at,
                    }
                }
                Membership::Lost(robot) => Event::Lost { robot },
            });
        }
        self.note_deliveries(&exchange.reports, &mut events);
        self.silent.clear();
        let mut reports = exchange.reports;
        for name in self.names.clone() {
            match reports.remove(&name) {
                Some(report) => self.note_report(&name, report, &mut events),
                None => {
                    events.push(Event::Missed {
                        robot: name.clone(),
                    });
                    self.silent.push(name);
                }
            }
        }
        self.tick = tick;
        self.stood_at = self.world.robots().iter().copied().map(to_wire).collect();
        self.close_digest();
        events.push(Event::Tick {
            digest: self.digest.to_string(),
        });
        TickRecord { tick, events }
    }

    /// A command that was named has arrived, unless its target says that it never came, or has missed the tick.
    fn note_deliveries(&mut self, reports: &BTreeMap<RobotName, Report>, events: &mut Vec<Event>) {
        for (to, ids) in std::mem::take(&mut self.arriving) {
            for id in ids {
                let (to, from, seq) = (to.clone(), id.from.clone(), id.seq);
                let has_arrived = reports
                    .get(&to)
                    .is_some_and(|report| !report.missing.contains(&id));
                events.push(if has_arrived {
                    Event::CommandDelivered { from, to, seq }
                } else {
                    Event::CommandMissing { from, to, seq }
                });
            }
        }
    }

    fn note_report(&mut self, robot: &RobotName, report: Report, events: &mut Vec<Event>) {
        let before = self.reports.get(robot);
        let change = |from: Option<&String>, to: &String| {
            (from != Some(to)).then(|| (from.cloned(), to.clone()))
        };
        if let Some((from, to)) = change(
            before.map(|report| &report.emotion_state),
            &report.emotion_state,
        ) {
            events.push(Event::Emotion {
                robot: robot.clone(),
                from,
                to,
            });
        }
        if let Some((from, to)) = change(
            before.map(|report| &report.behavior_state),
            &report.behavior_state,
        ) {
            events.push(Event::Behavior {
                robot: robot.clone(),
                from,
                to,
            });
        }
        for sent in &report.sent {
            let (from, to, seq) = (robot.clone(), sent.to.clone(), sent.seq);
            let (performative, command) = (sent.performative, sent.command.clone());
            events.push(Event::CommandSent {
                from,
                to,
                seq,
                performative,
                command,
            });
            self.medium.accept(Underway {
                to: sent.to.clone(),
                from: robot.clone(),
                seq,
            });
        }
        events.extend(report.log.iter().map(|text| Event::Say {
            robot: robot.clone(),
            text: text.clone(),
        }));
        self.reports.insert(robot.clone(), report);
    }

    fn close_digest(&mut self) {
        let mut tick = self.digest.tick(self.tick);
        for body in self.world.robots().iter().chain(self.world.guests()) {
            tick.place(body.x, body.y);
        }
        for name in &self.names {
            tick.report(
                name,
                self.reports
                    .get(name)
                    .filter(|_| !self.silent.contains(name)),
            );
        }
        self.digest.close(&tick);
    }

    /// What the launcher must do to processes before the next tick, in the order of the scenario.
    #[must_use]
    pub fn faults_due(&self) -> Vec<ProcessOrder> {
        let tick = self.tick + 1;
        let order = |fault: &Fault| {
            let (robot, kind) = (fault.robot.clone(), fault.kind);
            let for_s = if let FaultEnd::After(wall_s) = fault.end {
                Some(wall_s)
            } else {
                None
            };
            let begins = ProcessOrder {
                robot: robot.clone(),
                kind,
                begins: true,
                for_s,
            };
            let ends = ProcessOrder {
                robot,
                kind,
                begins: false,
                for_s: None,
            };
            let is_over = fault.end == FaultEnd::At(tick);
            [
                (fault.at == tick).then_some(begins),
                is_over.then_some(ends),
            ]
            .into_iter()
            .flatten()
        };
        self.scenario.faults.iter().flat_map(order).collect()
    }

    /// What was ordered before the next tick has been done; it is told with that tick.
    pub fn note_faults(&mut self, orders: &[ProcessOrder]) {
        let event = |order: &ProcessOrder| Event::Fault {
            robot: order.robot.clone(),
            kind: order.kind,
            begins: order.begins,
        };
        self.between.extend(orders.iter().map(event));
    }

    /// A command from outside the roster; it arrives at the next tick. Returns its number.
    pub fn command(&mut self, to: &RobotName, command: &str) -> Seq {
        self.operator_seq += 1;
        let (from, seq) = (RobotName::operator(), self.operator_seq);
        self.medium.accept(Underway {
            to: to.clone(),
            from: from.clone(),
            seq,
        });
        self.between.push(Event::CommandSent {
            from,
            to: to.clone(),
            seq,
            performative: Performative::Achieve,
            command: command.to_owned(),
        });
        seq
    }

    /// The last event of the run.
    #[must_use]
    pub fn end(&self, reason: End) -> TickRecord {
        TickRecord {
            tick: self.tick,
            events: vec![Event::End {
                reason,
                digest: self.digest.to_string(),
            }],
        }
    }

    /// What a robot is told when it joins.
    #[must_use]
    pub fn welcome(
        &self,
        run: &RunName,
        name: &RobotName,
        generation: Generation,
    ) -> Option<Welcome> {
        let spec = self.scenario.robots.get(name)?;
        let last = self.reports.get(name);
        let mut welcome = Welcome {
            protocol: PROTOCOL_VERSION,
            run: run.clone(),
            name: name.clone(),
            generation,
            epoch: self.epoch,
            tick: self.tick,
            seed: self.scenario.seed,
            stream: format!("robot/{name}"),
            tick_s: self.scenario.tick_s,
            field_m: self.scenario.field_m,
            body_m: self.scenario.body_m,
            sensing_range_m: self.scenario.sensing_range_m,
            location: self.location(name)?,
            roster: self.names.clone(),
            parameters: spec.parameters.clone(),
            last_state: last
                .zip(self.index(name))
                .and_then(|(report, index)| Some(public_state(report, *self.stood_at.get(index)?))),
            state_before: None,
            last_seq: 0,
            repeat_ticks: self.scenario.network.longest_delay(self.scenario.tick_s) + 2,
        };
        if last.is_some() {
            set_apart(&mut welcome);
        }
        Some(welcome)
    }

    /// What a robot senses around itself now.
    #[must_use]
    pub fn percept(&self, name: &RobotName) -> Percept {
        let Some(index) = self.index(name) else {
            return Percept::default();
        };
        let center = self.world.robots()[index];
        let others = self
            .world
            .near(center, self.scenario.sensing_range_m)
            .into_iter();
        let bodies = others
            .filter(|near| near.body != Body::Robot(index))
            .map(|near| SensedBody {
                kind: match near.body {
                    Body::Obstacle(_) => SensedKind::Obstacle,
                    Body::Guest(_) => SensedKind::Guest,
                    Body::Robot(_) => SensedKind::Robot,
                },
                location: to_wire(near.center),
            });
        Percept {
            epoch: self.epoch,
            tick: self.now,
            bodies: bodies.collect(),
        }
    }

    fn sensed_robots(&self, of: usize) -> Vec<SensedRobot> {
        let robots = self.world.robots();
        let is_near = |other: &usize| {
            *other != of && robots[of].distance_m(robots[*other]) <= self.scenario.sensing_range_m
        };
        let sensed = |other: usize| SensedRobot {
            name: self.names[other].clone(),
            location: to_wire(robots[other]),
        };
        (0..robots.len()).filter(is_near).map(sensed).collect()
    }

    fn index(&self, name: &RobotName) -> Option<usize> {
        self.names.binary_search(name).ok()
    }

    /// Where a robot stands.
    #[must_use]
    pub fn location(&self, name: &RobotName) -> Option<Point> {
        self.index(name)
            .map(|index| to_wire(self.world.robots()[index]))
    }

    /// Whether a robot's last move was refused.
    #[must_use]
    pub fn is_blocked(&self, name: &RobotName) -> bool {
        self.index(name).is_some_and(|index| self.blocked[index])
    }

    /// The last complete tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// The epoch.
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// What is simulated.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Simulated time of a tick, seconds.
    #[must_use]
    pub fn time_s(&self, tick: Tick) -> f64 {
        tick as f64 * self.scenario.tick_s
    }

    /// The robots, in the order of their names.
    #[must_use]
    pub fn names(&self) -> &[RobotName] {
        &self.names
    }

    /// The environment, for observers.
    #[must_use]
    pub fn world(&self) -> &World<Stream> {
        &self.world
    }

    /// What a robot reported last.
    #[must_use]
    pub fn report(&self, name: &RobotName) -> Option<&Report> {
        self.reports.get(name)
    }

    /// What a robot published of itself last.
    #[must_use]
    pub fn state_variables(&self, name: &RobotName) -> Option<&StateVariables> {
        self.report(name).map(|report| &report.state_variables)
    }

    /// Pairs of robots between which the medium lets nothing through now.
    #[must_use]
    pub fn cuts(&self) -> Vec<Cut> {
        self.medium.cuts()
    }

    /// Whom each robot could not ask in this tick.
    #[must_use]
    pub fn unreachable(&self) -> &BTreeMap<RobotName, Vec<RobotName>> {
        &self.unreachable
    }

    /// Digest of the run so far.
    #[must_use]
    pub fn digest(&self) -> String {
        self.digest.to_string()
    }
}

/// Tells a further incarnation apart from those that took part before it. Who is there from the beginning draws from a
/// stream of its name alone, whatever happened to it in an earlier epoch; a later incarnation must not draw the same
/// again. Nor may it use a number that a former one may have used: commands of that one which were never reported may
/// lie at their targets, or still be under way.
pub(crate) fn set_apart(welcome: &mut Welcome) {
    welcome.stream = format!("robot/{}#{}", welcome.name, welcome.generation);
    welcome.last_seq = SEQS_OF_A_GENERATION * Seq::from(welcome.generation.saturating_sub(1));
}

/// What the other robots may learn of one that reported this from there.
pub(crate) fn public_state(report: &Report, location: Point) -> PublicState {
    PublicState {
        epoch: report.epoch,
        tick: report.tick,
        location,
        speed_mps: report.speed_mps,
        direction_rad: report.direction_rad,
        state_variables: report.state_variables.clone(),
        emotion_state: report.emotion_state.clone(),
        behavior_state: report.behavior_state.clone(),
    }
}
