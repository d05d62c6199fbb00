//! The simulation: synchronous, without a network, a function of scenario, seed and reports.

mod changes;
mod faults;
mod motion;
mod news;
mod reports;
mod senses;
mod view;
mod welcome;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lockstep::{Exchange, Sent, TickOutcome};
use observe::{Evaluation, Measurements, Monitors, Observation};
use protocol::event::WaitedFor;
use protocol::messages::{CommandText, End, Point, Report, TickUpdate};
use protocol::random::{Stream, stream};
use protocol::{Epoch, Event, Generation, Line, PROTOCOL_VERSION, RobotName, Seq, Tick};
use scenario::{Change, GuestMotion, Scenario, to_wire};
use world::{HallError, World};

use crate::digest::Digest;
use crate::driving::Driving;
use crate::guests::GuestState;
use crate::layers::Layers;
use crate::medium::{Arrival, Medium};
use crate::sites::Sites;

/// Reports, commands and membership changes of a tick.
pub type Reports = TickOutcome<Arc<Report>, CommandText>;

/// Reports and commands by robot.
type ReportsByName = BTreeMap<RobotName, (Arc<Report>, Vec<Sent<CommandText>>)>;

/// A robot and its report of a tick.
type NamedReport = (RobotName, Arc<Report>);

/// A complete tick. Copies share its events.
#[derive(Debug, Clone)]
pub struct TickRecord {
    /// The tick.
    pub tick: Tick,
    /// Its events in a fixed order; the last one has the digest.
    pub events: Arc<Vec<Event>>,
}

impl TickRecord {
    /// Whether it is the end of the run, which belongs to the last tick.
    #[must_use]
    pub fn is_end(&self) -> bool {
        matches!(self.events.last(), Some(Event::End { .. }))
    }

    /// The lines of `events.jsonl`.
    pub fn lines(&self) -> impl Iterator<Item = Line> + '_ {
        self.events.iter().map(|event| Line {
            tick: self.tick,
            event: event.clone(),
        })
    }
}

/// One epoch of a run. A copy goes on as it does.
#[derive(Clone)]
pub struct Simulation {
    scenario: Scenario,
    epoch: Epoch,
    names: Vec<RobotName>,
    /// Last complete tick.
    tick: Tick,
    /// Tick of the bodies' locations: the last complete tick or the one in progress.
    now: Tick,
    world: World<Stream>,
    driving: Driving,
    guests: GuestState,
    sites: Sites,
    layers: Layers,
    medium: Medium,
    /// Robots with the bodies around them in their news.
    with_bodies: BTreeSet<RobotName>,
    /// Robots with the ranges of their rays in their news.
    with_ranges: BTreeSet<RobotName>,
    /// Commands that arrive in the tick in progress, by target.
    arriving: BTreeMap<RobotName, Vec<Arrival>>,
    /// Robots that each robot cannot query in the tick in progress.
    unreachable: BTreeMap<RobotName, Vec<RobotName>>,
    /// The robots that the radio of each reaches in this tick; `None` where distance does not matter.
    in_range: Option<BTreeMap<RobotName, Vec<RobotName>>>,
    /// News of the tick in progress; robots without any have no entry.
    news: BTreeMap<RobotName, Box<TickUpdate>>,
    /// Events of the tick in progress.
    events: Vec<Event>,
    /// The last report of each robot.
    reports: BTreeMap<RobotName, Arc<Report>>,
    /// Location of each robot at the last complete tick, in the order of names.
    stood_at: Vec<Point>,
    /// Robots without a report of the last tick: they propose nothing and cannot be queried.
    silent: Vec<RobotName>,
    /// Ticks that robots have done since their last report, too late for them to count.
    late: BTreeMap<RobotName, BTreeSet<Tick>>,
    /// Robots of which a new incarnation joined in the last tick. They cannot be queried: the previous incarnation may have
    /// published another state for that tick before it died, and followers of that state cannot tell the two apart.
    newcomers: Vec<RobotName>,
    /// Robots whose processes the scenario stops before the next tick. They cannot be queried: whether another robot has the
    /// state of the last tick already is a matter of real time.
    stopped: Vec<RobotName>,
    blocked: Vec<bool>,
    /// Moves that were refused because they were too fast, by robot.
    too_fast: BTreeMap<RobotName, u64>,
    /// Generation that has reported last for each robot in this epoch, and its incarnation, counted from 1 in the epoch. The
    /// record has incarnations, because generations also count processes that never reported: whether such a one asked to join
    /// before or after the next one is wall clock.
    incarnations: BTreeMap<RobotName, (Generation, u32)>,
    /// Number of commands of each sender in this epoch.
    sent: BTreeMap<RobotName, Seq>,
    /// Events between the last tick and the next.
    between: Vec<Event>,
    /// The changes of the scenario without what was done by hand, if anything was.
    planned: Option<Vec<Change>>,
    digest: Digest,
    /// What the scenario expects of the run.
    watches: Monitors,
    /// What is measured of the run.
    measurements: Measurements,
    /// What ends the run before its last tick, if the scenario says so.
    end_when: Option<Evaluation>,
    /// What of it holds in the last complete tick, in words.
    goal: Option<String>,
}

impl Simulation {
    /// The environment of a scenario before tick 0.
    ///
    /// # Errors
    /// [`HallError`] if its bodies cannot be placed.
    pub fn new(scenario: Scenario, epoch: Epoch) -> Result<Self, HallError> {
        let walk = scenario.guest_walk();
        let mut world =
            World::with_guests(&scenario.hall(), walk, stream(scenario.seed, "guests"))?;
        if let GuestMotion::Crowd(_) = scenario.guest_motion {
            world.set_threads(std::thread::available_parallelism().map_or(1, usize::from));
        }
        let names = scenario.roster();
        let mut medium = Medium::new(
            scenario.seed,
            scenario.tick_s,
            scenario.network.clone(),
            names.clone(),
        );
        // A change may name a command by its number in the run, so it is counted for from the
        // beginning.
        for change in &scenario.changes {
            medium.count_for(&change.network);
        }

        let setting = scenario.setting();
        Ok(Self {
            epoch,
            blocked: vec![false; names.len()],
            tick: 0,
            now: 0,
            guests: GuestState::new(scenario.guest_rules.clone(), world.guests().len()),
            sites: Sites::new(&scenario),
            layers: Layers::new(&scenario),
            world,
            driving: Driving::default(),
            medium,
            names,
            with_bodies: BTreeSet::new(),
            with_ranges: BTreeSet::new(),
            arriving: BTreeMap::new(),
            unreachable: BTreeMap::new(),
            in_range: None,
            news: BTreeMap::new(),
            events: Vec::new(),
            reports: BTreeMap::new(),
            stood_at: Vec::new(),
            silent: Vec::new(),
            late: BTreeMap::new(),
            newcomers: Vec::new(),
            stopped: Vec::new(),
            too_fast: BTreeMap::new(),
            incarnations: BTreeMap::new(),
            sent: BTreeMap::new(),
            between: Vec::new(),
            planned: None,
            digest: Digest::default(),
            watches: Monitors::new(&scenario.expectations, &setting),
            measurements: Measurements::new(&scenario.measures, &setting),
            end_when: scenario
                .end_when
                .as_ref()
                .map(|condition| Evaluation::new(condition, &setting)),
            goal: None,
            scenario,
        })
    }

    /// Runs tick 0, in which robots initialize and propose their first locations.
    ///
    /// # Errors
    /// If the exchange is given up.
    pub fn init<E>(&mut self, robots: &mut E) -> Result<TickRecord, E::Error>
    where
        E: Exchange<TickUpdate, Arc<Report>, CommandText>,
    {
        self.begin_init();
        let outcome = robots.exchange(0, self)?;

        Ok(self.end_tick(outcome))
    }

    /// Runs the next tick.
    ///
    /// # Errors
    /// If the exchange is given up. The tick is then incomplete and the epoch is over.
    pub fn step<E>(&mut self, robots: &mut E) -> Result<TickRecord, E::Error>
    where
        E: Exchange<TickUpdate, Arc<Report>, CommandText>,
    {
        let tick = self.begin_tick();
        let outcome = robots.exchange(tick, self)?;

        Ok(self.end_tick(outcome))
    }

    /// The first half of tick 0: the news before robots initialize.
    pub fn begin_init(&mut self) {
        self.events = vec![Event::Init {
            seed: self.scenario.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            protocol: PROTOCOL_VERSION,
            tick_s: self.scenario.tick_s,
        }];
        for name in &self.names {
            let at = self.location(name).unwrap_or_default();
            self.events.push(Event::Joined {
                robot: name.clone(),
                generation: None,
                at,
            });
        }

        self.note_passages();
        // No body has moved yet, so there are no verdicts.
        self.compose_news(&[]);
    }

    /// The first half of a tick (Figure 5 of the paper): bodies move, the medium decides, news are composed. Returns the
    /// tick.
    pub fn begin_tick(&mut self) -> Tick {
        // What is changed at this tick holds for all of it, so changes come before moves and messages.
        self.now = self.tick + 1;
        self.events = std::mem::take(&mut self.between);
        self.change_scenario();
        self.reseed_chance();

        // Robots move by what they proposed in the tick before, guests by their own stream, and by the faces of that tick.
        self.drive_robots();
        let reactions = self.reactions();
        let verdicts = self.world.advance_with(&self.proposals(), &reactions);
        self.note_moves(&verdicts);
        self.note_passages();
        self.layers.pass_tick();

        let places = self.world.robots().iter().copied().map(to_wire);
        let places = places.collect();
        let crossed = |one, other| self.world.crossed(one, other);
        let decision = self.medium.decide_among(self.now, places, &crossed);
        self.events.extend(decision.events);
        self.arriving = decision.delivered;
        self.in_range = decision.in_range;
        // Beside the network's decisions: robots that have no state of the last tick to answer with.
        self.unreachable = self.join_unanswering(decision.unreachable);
        self.stopped.clear();

        self.compose_news(&verdicts);
        self.now
    }

    /// The second half of a tick: reports become events and are added to the digest, and expectations are judged by them.
    pub fn end_tick(&mut self, outcome: Reports) -> TickRecord {
        // The order of the record: who takes part, what has arrived, what was reported. None of it
        // depends on when a message came.
        self.note_membership(outcome.membership);
        self.note_deliveries(&outcome.reports);

        // Where all bodies stand, then what each robot reported: what the run is compared by.
        let mut digest = self.digest.tick(self.now);
        for robot in self.world.robots() {
            digest.place(robot.x, robot.y);
        }
        // Who is on the field counts only where that can change, so that all other digests are as ever.
        let has_passages = self.world.has_passages();
        for (guest, at) in self.world.present_guests() {
            if has_passages {
                digest.guest(guest);
            }
            digest.place(at.x, at.y);
        }
        for index in 0..self.names.len() {
            if let Some(pose) = self.world.pose(index) {
                digest.pose(&pose);
            }
        }
        self.note_reports(outcome.reports, &mut digest);
        let acting = self.reports_of(self.now, |report| {
            !report.site_actions.is_empty() || !report.layer_actions.is_empty()
        });
        self.act_on_sites(&acting, &mut digest);
        self.act_on_layers(&acting, &mut digest);
        self.note_guests();

        self.tick = self.now;
        self.stood_at = self.world.robots().iter().copied().map(to_wire).collect();
        self.digest.close(&digest);
        // After the digest: verdicts are about the run and no part of what it is compared by.
        self.judge();
        self.check_end();
        self.events.push(Event::Tick {
            digest: self.digest.to_string(),
            seal: None,
        });
        let events = std::mem::take(&mut self.events);
        self.measure(&events);
        TickRecord {
            tick: self.tick,
            events: Arc::new(events),
        }
    }

    /// Shows the last tick with these events, which are its own or those of the end of the run.
    fn observed<T>(&self, events: &[Event], see: impl FnOnce(&Observation<'_>) -> T) -> T {
        see(&Observation {
            tick: self.tick,
            tick_s: self.scenario.tick_s,
            events,
            state: &|name| self.robot_state(name),
            site: &|name| self.site_state(name),
            layer: &|name| self.layers.cells(name),
        })
    }

    /// Takes the measures of a tick, or of the end of the run.
    fn measure(&mut self, events: &[Event]) {
        if self.measurements.is_empty() {
            return;
        }

        let mut measurements = std::mem::take(&mut self.measurements);
        self.observed(events, |seen| measurements.observe(seen));
        self.measurements = measurements;
    }

    /// Judges the expectations that are decided in the tick. The digest of the run does not depend on them.
    fn judge(&mut self) {
        if self.watches.is_empty() {
            return;
        }

        let mut watches = std::mem::take(&mut self.watches);
        let judged = self.observed(&self.events, |seen| watches.observe(seen));
        self.watches = watches;
        self.events.extend(judged);
    }

    /// Notes whether the run ends with this tick before its last one. Verdicts of the tick are known then.
    fn check_end(&mut self) {
        let Some(mut end_when) = self.end_when.take() else {
            return;
        };
        self.goal = self.observed(&self.events, |seen| end_when.holds(seen));
        self.end_when = Some(end_when);
    }

    /// Whether the run has no further tick.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.tick >= self.scenario.ticks || self.goal.is_some()
    }

    /// The record of the end of the run, in which the expectations that are open are judged.
    #[must_use]
    pub fn end(&mut self, reason: End) -> TickRecord {
        self.end_waiting(reason, Vec::new())
    }

    /// The record of the end of a run, as [`Self::end`]; `waited_for` are the robots for which the clock waited, if it was aborted.
    #[must_use]
    pub fn end_waiting(&mut self, reason: End, waited_for: Vec<WaitedFor>) -> TickRecord {
        let mut events = self.watches.end(reason);
        self.count_too_fast(&mut events);
        events.push(Event::End {
            reason,
            because: self.goal.clone().filter(|_| reason == End::Finished),
            waited_for,
            digest: self.digest.to_string(),
            seal: None,
        });
        self.measure(&events);
        TickRecord {
            tick: self.tick,
            events: Arc::new(events),
        }
    }
}
