//! The simulation: synchronous, without a network, a function of scenario, seed and reports.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lockstep::{Bulletin, Exchange, IncarnationNotice, Membership, Sent, TickOutcome};
use observe::{Evaluation, Measurements, Monitors, Observation, RobotState};
use protocol::codec::MAX_MESSAGE_BYTES;
use protocol::event::{Blocker, Cause, WaitedFor};
use protocol::messages::{
    CommandText, Correction, Cut, Delivery, DriveLimits, End, FaultKind, GuestMood, HeldProcess,
    Intervention, NEWS_FLAGS, OnLate, Parameters, ParametersOffer, Point, Pose, ProcessOrder,
    PublicState, Report, SensedBody, SensedKind, SensedRobot, SensedSite, Standing, StateVariables,
    Target, TickUpdate, Welcome, site_bytes,
};
use protocol::random::{Stream, stream};
use protocol::{
    Epoch, Event, Generation, Line, PROTOCOL_VERSION, RobotName, RunName, Seq, Tick, encode,
};
use world::{Body, HallError, MoveOutcome, Reaction, World};

use crate::digest::{Digest, TickDigest};
use crate::driving::{Driving, drive_limits, pose};
use crate::guests::GuestState;
use crate::layers::Layers;
use crate::medium::{Arrival, ForcedVerdict, Medium, SentCommand};
use crate::sensing::{Viewpoint, ranges_m};
use crate::sites::{SiteOrders, Sites};
use crate::static_world::guest_sample;
use scenario::{
    ChanceKind, Change, FaultEnd, GuestMotion, Lateness, Override, Reseed, Scenario, to_wire,
    to_world,
};

/// Most bodies in the news of a robot, so that the news fit into a message.
const MAX_BODIES: usize = 4096;

/// Most bytes of sites in the news of a robot, which also have commands and bodies.
const MAX_SITE_BYTES: usize = MAX_MESSAGE_BYTES / 16;

/// Most robots that are all compared with each other to find those within sensing range.
const MAX_COMPARED: usize = 64;

/// Most bytes of parameters of one kind of other times in a welcome, so that it fits into a message.
const MAX_OTHER_PARAMETERS: usize = MAX_MESSAGE_BYTES / 4;

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

    /// What the scenario or a person changes takes effect.
    fn change_scenario(&mut self) {
        let mut network = None;
        for change in self.scenario.changes_at(self.now) {
            // Each change has the whole network as it is from then on, so the last one counts.
            network = Some(change.network.clone());
            for set in &change.set {
                self.events.push(Event::Changed {
                    set: set.to_string(),
                    by_hand: change.is_by_hand,
                });
            }
        }

        if let Some(network) = network {
            self.medium.set_network(network);
        }
    }

    /// Chance becomes another one. Robots take their part of it by themselves ([`Welcome::reseeds`]), and sensing asks the scenario.
    fn reseed_chance(&mut self) {
        for reseed in &self.scenario.reseeds {
            if reseed.at != self.now {
                continue;
            }
            if let Some(seeds) = reseed.of_network() {
                self.medium.reseed(seeds);
            }
            if let Some(seed) = reseed.of_guests() {
                self.world.reseed(stream(seed, "guests"));
            }
            self.events.push(Event::Changed {
                set: reseed.to_string(),
                by_hand: false,
            });
        }
    }

    /// Has the network decide something in the next tick that has not begun, whatever it draws.
    pub fn force(&mut self, verdict: ForcedVerdict) {
        self.medium.force(verdict);
    }

    /// Has chance be another one from the next tick on that has not begun; without kinds all of it, also where the scenario would
    /// re-seed the run later. Robots of this process must be told by themselves: [`Scenario::stream_reseeds`].
    pub fn reseed(&mut self, seed: u64, of: &[ChanceKind]) {
        let reseeds = &mut self.scenario.reseeds;
        let later = reseeds.partition_point(|one| one.at <= self.now + 1);
        if of.is_empty() {
            reseeds.truncate(later);
        }
        let reseed = Reseed {
            at: self.now + 1,
            seed,
            of: of.to_vec(),
        };
        reseeds.insert(later, reseed);
    }

    /// Goes on from the last tick as a run of another scenario, which is the same up to then. Its robots must be told by themselves of
    /// streams that are drawn anew later: [`Scenario::stream_reseeds`].
    pub fn go_on_as(&mut self, scenario: Scenario) {
        self.medium
            .set_network(scenario.network_at(self.now).clone());
        self.scenario = scenario;
    }

    /// Has something done to the run from the next tick on that has not begun, as a person wants it.
    ///
    /// # Errors
    /// In words, if it cannot be done; nothing has changed then.
    pub fn intervene(&mut self, what: &Intervention) -> Result<(), String> {
        let set = self
            .scenario
            .words_of(what, self.now + 1, |counted| self.medium.count(counted))?;
        self.change_by_hand(&set)
    }

    /// Ends the fault of a robot before the next tick that the wall clock would end, and without which the clock has gone on.
    ///
    /// # Errors
    /// In words, if the last fault of the robot is not of that kind; nothing has changed then.
    pub fn end_fault_for_a_time(&mut self, robot: &RobotName) -> Result<(), String> {
        let words = self.scenario.words_of_early_end(robot, self.now + 1)?;
        self.change_by_hand(&[words])
    }

    /// Sets something in the scenario from the next tick on that has not begun, as a person wants it.
    ///
    /// # Errors
    /// In words, if it is nothing that can change while a run goes on; nothing has changed then.
    pub fn change_by_hand(&mut self, set: &[Override]) -> Result<(), String> {
        let changed = self.scenario.with_change_by_hand(self.now + 1, set);
        let changed = changed.map_err(|error| error.reason().to_owned())?;
        if !self
            .medium
            .has_counted_for(changed.network_at(self.now + 1))
        {
            return Err(
                "commands with a text are counted from the beginning of a run or not at all: leave `text` out"
                    .to_owned(),
            );
        }

        // At the first time only: later ones find changes by hand among those of the scenario.
        self.planned
            .get_or_insert_with(|| self.scenario.changes.clone());
        self.scenario = changed;
        Ok(())
    }

    /// What an intervention would change the parameters of robots to, from the next tick on: nothing if it is refused anyway.
    #[must_use]
    pub fn parameters_set_by(&self, what: &Intervention) -> Vec<(RobotName, Parameters)> {
        let at = self.now + 1;
        let words = self
            .scenario
            .words_of(what, at, |counted| self.medium.count(counted));
        let Ok(changed) = words.map(|set| self.scenario.with_change_by_hand(at, &set)) else {
            return Vec::new();
        };

        changed.map_or_else(|_| Vec::new(), |changed| changed.parameters_from(at))
    }

    /// Sets by hand what a record says was set by hand before the next tick.
    ///
    /// # Errors
    /// In words, if the record says something that cannot be set.
    pub fn repeat_changes(&mut self, changes: &[String]) -> Result<(), String> {
        if changes.is_empty() {
            return Ok(());
        }
        let set: Result<Vec<Override>, String> = changes.iter().map(|set| set.parse()).collect();
        self.change_by_hand(&set?)
    }

    /// The scenario without what was done by hand.
    #[must_use]
    pub fn planned(&self) -> Scenario {
        let mut scenario = self.scenario.clone();
        if let Some(changes) = &self.planned {
            scenario.changes.clone_from(changes);
        }
        scenario
    }

    /// The rules for late robots that a change makes before the next tick; `None` if there is no change.
    #[must_use]
    pub fn lateness_due(&self) -> Option<&Lateness> {
        let mut due = self.scenario.changes_at(self.tick + 1);
        due.next()?;
        Some(self.scenario.lateness_at(self.tick + 1))
    }

    /// The fault that may hold the process of a robot for which the open tick waits, until the wall clock ends it. A process
    /// that is told to stop may do another tick or two before it does.
    #[must_use]
    pub fn held_by_wall_clock(&self, robot: &RobotName) -> Option<FaultKind> {
        let faults = self.scenario.faults_at(self.now).iter();
        let mut begun = faults.filter(|fault| fault.robot == *robot && fault.at <= self.now);
        let last = begun.next_back()?;
        matches!(last.end, FaultEnd::After(_)).then_some(last.kind)
    }

    /// Robots whose processes a fault holds in the tick in progress, or in the last one; `late` are those for which the clock
    /// is held.
    #[must_use]
    pub fn held_processes(&self, late: &[RobotName]) -> Vec<HeldProcess> {
        let is_complete = self.now == self.tick;
        let mut held = Vec::new();

        for fault in self.scenario.faults_at(self.now) {
            if fault.holds(self.now, is_complete) {
                held.push(HeldProcess {
                    robot: fault.robot.clone(),
                    kind: fault.kind,
                });
            }
        }

        for robot in late {
            let is_told = held.iter().any(|held| held.robot == *robot);
            if let Some(kind) = self.held_by_wall_clock(robot).filter(|_| !is_told) {
                held.push(HeldProcess {
                    robot: robot.clone(),
                    kind,
                });
            }
        }

        held
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

    /// What a robot reported last, and where it stands; `None` before its first report.
    #[must_use]
    pub fn robot_state(&self, name: &RobotName) -> Option<RobotState<'_>> {
        let report = self.reports.get(name)?;
        Some(RobotState {
            location: *self.stood_at.get(self.index(name)?)?,
            state_variables: &report.state_variables,
            emotion_state: &report.emotion_state,
            behavior_state: &report.behavior_state,
        })
    }

    fn note_reports(&mut self, mut reports: ReportsByName, digest: &mut TickDigest) {
        self.silent.clear();

        // In the order of names, not in that of arrival.
        for name in self.names.clone() {
            if let Some((report, commands)) = reports.remove(&name) {
                let sent = self.number_commands(&name, commands);
                digest.report(&name, Some((&report, &sent)));
                self.note_done_late(&name);
                self.note_report(&name, &report, sent);
            } else {
                // That it has missed the tick is part of what the run is compared by.
                digest.report(&name, None);
                self.silent.push(name.clone());
                self.events.push(Event::Missed { robot: name });
            }
        }
    }

    /// Carries out what robots do to sites by their reports of the tick.
    fn act_on_sites(&mut self, reports: &[NamedReport], digest: &mut TickDigest) {
        let mut orders = Vec::new();
        for (robot, report) in reports {
            if !report.site_actions.is_empty() {
                orders.push(SiteOrders {
                    robot,
                    at: self.location(robot).unwrap_or_default(),
                    actions: &report.site_actions,
                });
            }
        }

        let events = self.sites.carry_out(&orders);
        digest.sites(&events);
        self.events.extend(events);
    }

    /// Carries out what robots do to layers by their reports of the tick.
    fn act_on_layers(&mut self, reports: &[NamedReport], digest: &mut TickDigest) {
        self.layers.begin_actions();
        // They are in the order of names.
        for (robot, report) in reports {
            if report.layer_actions.is_empty() {
                continue;
            }
            let at = self.location(robot).unwrap_or_default();
            let events = self.layers.carry_out(robot, at, &report.layer_actions);
            digest.layer_actions(&events);
            self.events.extend(events);
        }
        for (name, cells) in self.layers.digests() {
            digest.layer(name, cells);
        }
    }

    /// A robot has done a tick of which its report does not count, because the clock goes on without it.
    pub fn done_late(&mut self, robot: &RobotName, tick: Tick) {
        // A repetition of a report that has counted is not late.
        if tick <= self.now && self.has_not_reported_since(robot, tick) {
            self.late.entry(robot.clone()).or_default().insert(tick);
        }
    }

    /// Whether the last report of a robot is of an earlier tick.
    fn has_not_reported_since(&self, robot: &RobotName, tick: Tick) -> bool {
        let last = self.reports.get(robot);
        last.is_none_or(|report| report.tick < tick)
    }

    /// Records what a robot that takes part again has done of the ticks that it missed: its state depends on them.
    fn note_done_late(&mut self, robot: &RobotName) {
        let mut ticks = self.late.remove(robot).unwrap_or_default();
        // The report of the open tick is in time.
        ticks.remove(&self.now);
        if !ticks.is_empty() {
            self.events.push(Event::DoneLate {
                robot: robot.clone(),
                ticks: ticks.into_iter().collect(),
            });
        }
    }

    /// Robots with news of the tick in progress.
    #[must_use]
    pub fn robots_with_news(&self) -> BTreeSet<RobotName> {
        self.news.keys().cloned().collect()
    }

    /// The news of a robot for the tick in progress, with the incarnations that they name. Those of an incarnation that takes
    /// part from this tick on always contain its location.
    #[must_use]
    pub fn news(&self, name: &RobotName, notice: IncarnationNotice) -> TickUpdate {
        let mut news = match self.news.get(name) {
            Some(news) => TickUpdate::clone(news),
            None => TickUpdate {
                epoch: self.epoch,
                tick: self.now,
                ..TickUpdate::default()
            },
        };

        news.joined = notice.joined;
        news.rejoin = notice.rejoin;
        if notice.joined.is_some() {
            let location = self.location(name);
            news.correction = news.correction.or(location.map(|location| Correction {
                location,
                blocked: false,
            }));
        }
        news
    }

    /// Whether the news of a robot contain the bodies around it, from the next tick on.
    pub fn list_bodies(&mut self, name: &RobotName, is_wanted: bool) {
        if is_wanted {
            self.with_bodies.insert(name.clone());
        } else {
            self.with_bodies.remove(name);
        }
    }

    /// Whether the news of a robot contain the ranges of its rays, from the next tick on.
    pub fn list_ranges(&mut self, name: &RobotName, is_wanted: bool) {
        if is_wanted {
            self.with_ranges.insert(name.clone());
        } else {
            self.with_ranges.remove(name);
        }
    }

    /// The proposed location of each robot; `None` for a robot without a report of the last tick.
    fn proposals(&self) -> Vec<Option<world::Point>> {
        let mut proposals = Vec::with_capacity(self.names.len());
        for name in &self.names {
            // What it proposed before counts no more: it stays where it is.
            let is_silent = self.silent.contains(name);
            let report = self.reports.get(name).filter(|_| !is_silent);
            proposals.push(report.map(|report| to_world(report.proposal)));
        }
        proposals
    }

    /// Has the robots with wheels drive as they reported.
    fn drive_robots(&mut self) {
        for (index, name) in self.names.iter().enumerate() {
            let is_silent = self.silent.contains(name);
            let report = self.reports.get(name).filter(|_| !is_silent);
            let report = report.map(Arc::as_ref);
            let warning = self.driving.drive(&mut self.world, index, name, report);
            self.events.extend(warning);
        }
    }

    /// What guests do in the tick at the robots' faces, and at those that they asked.
    fn reactions(&self) -> Vec<Reaction> {
        let mut reactions = Vec::new();
        if !self.guests.sees_faces() {
            return self.guests.own_reactions(self.now);
        }

        for (index, name) in self.names.iter().enumerate() {
            // Who has not reported shows nothing.
            if let Some(report) = self
                .reports
                .get(name)
                .filter(|_| !self.silent.contains(name))
            {
                reactions.extend(self.guests.reaction(index, report));
            }
        }
        // At the same robot a face counts more.
        reactions.extend(self.guests.own_reactions(self.now));
        reactions
    }

    /// Guests get what they asked for, or wait for it.
    fn note_guests(&mut self) {
        let named = self.names.iter().enumerate();
        let reported = named.filter_map(|(index, name)| {
            let report = self
                .reports
                .get(name)
                .filter(|report| report.tick == self.now)?;
            Some((index, name, &**report))
        });
        let changes = self.guests.take(self.now, reported, &self.world);
        self.events.extend(changes);
        for &(guest, robot) in self.guests.served() {
            self.world.satisfy(guest, robot);
        }
    }

    /// Records who has entered the field and who has left it.
    fn note_passages(&mut self) {
        for passage in self.world.passages() {
            let guest = u32::try_from(passage.guest).unwrap_or(u32::MAX);
            let at = to_wire(passage.at);
            self.events.push(if passage.enters {
                Event::GuestEntered { guest, at }
            } else {
                Event::GuestLeft { guest, at }
            });
        }
    }

    fn note_moves(&mut self, verdicts: &[MoveOutcome]) {
        for (index, verdict) in verdicts.iter().enumerate() {
            let by = self.blocker(*verdict);
            self.blocked[index] = by.is_some();

            if let Some(by) = by {
                if by == Blocker::TooFast {
                    self.note_too_fast(index);
                }
                self.events.push(Event::Blocked {
                    robot: self.names[index].clone(),
                    by,
                    at: to_wire(self.world.robots()[index]),
                });
            }
        }
    }

    /// Warns of the first move of a robot that is too fast, and counts them.
    fn note_too_fast(&mut self, index: usize) {
        let robot = &self.names[index];
        let count = self.too_fast.entry(robot.clone()).or_default();
        *count += 1;
        if *count > 1 {
            return;
        }

        let at = to_wire(self.world.robots()[index]);
        let proposal = self.reports.get(robot).map_or(at, |report| report.proposal);
        let max_mps = self.scenario.max_speed_mps;
        self.events.push(Event::Warned {
            robot: robot.clone(),
            text: format!(
                "it proposed to move {:.3} m in a tick and stays: at most {max_mps} m/s, {:.3} m in {} s, is allowed \
                 (max_speed of the scenario)",
                at.distance_m(proposal),
                max_mps * self.scenario.tick_s,
                self.scenario.tick_s
            ),
        });
    }

    /// Says how often moves were too fast, where the first warning does not say all.
    fn count_too_fast(&self, events: &mut Vec<Event>) {
        for (robot, count) in &self.too_fast {
            if *count > 1 {
                events.push(Event::Warned {
                    robot: robot.clone(),
                    text: format!("{count} of its moves were refused because they were too fast"),
                });
            }
        }
    }

    /// What has blocked a move; `None` if it was not blocked.
    fn blocker(&self, verdict: MoveOutcome) -> Option<Blocker> {
        let by = match verdict {
            MoveOutcome::Advanced | MoveOutcome::Stayed => return None,
            MoveOutcome::TooFast | MoveOutcome::NotFinite => return Some(Blocker::TooFast),
            MoveOutcome::Blocked { by } => by,
        };

        Some(match by {
            world::Blocker::Edge => Blocker::Edge,
            world::Blocker::Wall(_) => Blocker::Wall,
            world::Blocker::Body(Body::Obstacle(_)) => Blocker::Obstacle,
            world::Blocker::Body(Body::Guest(_)) => Blocker::Guest,
            world::Blocker::Body(Body::Robot(index)) => Blocker::Robot(self.names[index].clone()),
        })
    }

    /// Composes the news of the tick in progress, which contain exceptions only.
    fn compose_news(&mut self, verdicts: &[MoveOutcome]) {
        let mut all = BTreeMap::new();
        for (index, name) in self.names.iter().enumerate() {
            let viewpoint = self.viewpoint(index);
            let is_refused = !verdicts.is_empty() && self.blocked[index];
            // What a robot proposed that has missed the last tick did not count. An incarnation that takes part from this tick
            // on is named: see `Self::news`.
            let is_corrected = is_refused || self.silent.contains(name);
            let news = TickUpdate {
                epoch: self.epoch,
                tick: self.now,
                joined: None,
                rejoin: None,
                correction: is_corrected.then(|| Correction {
                    location: to_wire(self.world.robots()[index]),
                    blocked: is_refused,
                }),
                pose: pose(&self.world, index),
                commands: self.deliveries(name),
                in_range: self.robots_in_range(name),
                unreachable: self.unreachable.get(name).cloned().unwrap_or_default(),
                sensed: self.sensed_robots(index, &viewpoint),
                bodies: self.sensed_bodies(index, &viewpoint),
                ranges: self.sensed_ranges(index),
                sites: self.sensed_sites(index, &viewpoint),
                site_results: self.sites.results(name).to_vec(),
                layers: self.layers.near(to_wire(self.world.robots()[index])),
                layer_results: self.layers.results(name).to_vec(),
            };
            // A robot without news gets none: silence says that all is as it expects.
            if !news.is_empty() {
                all.insert(name.clone(), Box::new(news));
            }
        }

        self.news = all;
    }

    fn robots_in_range(&self, of: &RobotName) -> Option<Vec<RobotName>> {
        let in_range = self.in_range.as_ref()?;
        Some(in_range.get(of).cloned().unwrap_or_default())
    }

    fn deliveries(&self, to: &RobotName) -> Vec<Delivery> {
        let arrivals = self.arriving.get(to).into_iter().flatten();
        arrivals.map(|arrival| arrival.delivery.clone()).collect()
    }

    /// Robots that each robot cannot query: those from which the medium cuts it off, those whose last report is missing, those
    /// of which a new incarnation has just joined, and those whose processes have just been stopped.
    fn join_unanswering(
        &self,
        mut cut: BTreeMap<RobotName, Vec<RobotName>>,
    ) -> BTreeMap<RobotName, Vec<RobotName>> {
        let mut unanswering = self.silent.clone();
        unanswering.extend_from_slice(&self.newcomers);
        unanswering.extend_from_slice(&self.stopped);
        if unanswering.is_empty() {
            return cut;
        }

        for name in &self.names {
            let others = cut.entry(name.clone()).or_default();
            for other in &unanswering {
                if other != name {
                    others.push(other.clone());
                }
            }
            // A robot may be out of reach for two reasons, and the order of names is that of the
            // record.
            others.sort();
            others.dedup();
        }
        cut
    }

    fn note_membership(&mut self, membership: Vec<Membership>) {
        self.newcomers.clear();

        for change in membership {
            match change {
                Membership::Joined(robot, generation) => self.note_joined(robot, generation),
                Membership::Lost(robot) => self.events.push(Event::Lost { robot }),
            }
        }
    }

    fn note_joined(&mut self, robot: RobotName, generation: Generation) {
        let incarnation = self.incarnation(&robot, generation, None);
        // What a predecessor did is of no consequence.
        if let Some(ticks) = self.late.get_mut(&robot) {
            *ticks = ticks.split_off(&self.now);
        }
        // At tick 0 every incarnation publishes the same state.
        if self.now > 0 {
            self.newcomers.push(robot.clone());
        }

        self.events.push(Event::Joined {
            at: self.location(&robot).unwrap_or_default(),
            robot,
            generation: Some(incarnation),
        });
    }

    /// The incarnation in this epoch that a generation has if it takes part next. `open` is what the robot has reported for the
    /// open tick, perhaps by an incarnation that takes part from that tick on.
    fn incarnation(&self, robot: &RobotName, generation: Generation, open: Option<&Report>) -> u32 {
        let mut last = self.incarnations.get(robot).copied();
        if let Some(report) = open {
            last = Some(follow(last, report.generation));
        }

        follow(last, generation).1
    }

    /// Records the commands that arrived in the tick. Those to a robot that did not take part are lost.
    fn note_deliveries(&mut self, reports: &ReportsByName) {
        for (target, arrivals) in std::mem::take(&mut self.arriving) {
            let has_arrived = reports.contains_key(&target);

            for Arrival { seq, delivery } in arrivals {
                let to = target.clone();
                let from = delivery.from;
                self.events.push(if has_arrived {
                    Event::CommandDelivered { from, to, seq }
                } else {
                    Event::CommandDropped {
                        from,
                        to,
                        seq,
                        because: Cause::Missed,
                    }
                });
            }
        }
    }

    /// Numbers the commands of a sender for the record.
    fn number_commands(
        &mut self,
        from: &RobotName,
        commands: Vec<Sent<CommandText>>,
    ) -> Vec<SentCommand> {
        // On the wire the numbers begin with 1 in every tick. Those of the record go on through the
        // epoch, whichever incarnation sends.
        let count = self.sent.entry(from.clone()).or_default();
        let mut numbered = Vec::with_capacity(commands.len());

        let mut number = |to: &RobotName, text: CommandText| {
            *count += 1;
            numbered.push(SentCommand {
                to: to.clone(),
                from: from.clone(),
                seq: *count,
                text,
            });
        };
        for Sent { to, command } in commands {
            match to {
                Target::Robot(to) => number(&to, command),
                // From here on nothing tells a broadcast from one command to each; a payload is shared.
                Target::Others => {
                    for to in self.names.iter().filter(|name| *name != from) {
                        number(to, command.clone());
                    }
                }
            }
        }

        numbered
    }

    fn note_report(&mut self, robot: &RobotName, report: &Arc<Report>, sent: Vec<SentCommand>) {
        let last = self.incarnations.get(robot).copied();
        self.incarnations
            .insert(robot.clone(), follow(last, report.generation));
        let before = self.reports.insert(robot.clone(), report.clone());

        // The record has changes only, and before its first report a robot has no state.
        let emotion_before = before.as_ref().map(|report| report.emotion_state.clone());
        let behavior_before = before.as_ref().map(|report| report.behavior_state.clone());

        if emotion_before.as_ref() != Some(&report.emotion_state) {
            self.events.push(Event::Emotion {
                robot: robot.clone(),
                from: emotion_before,
                to: report.emotion_state.clone(),
            });
        }
        if behavior_before.as_ref() != Some(&report.behavior_state) {
            self.events.push(Event::Behavior {
                robot: robot.clone(),
                from: behavior_before,
                to: report.behavior_state.clone(),
            });
        }
        self.events.extend(SentCommand::events(&sent));
        self.send(sent);
        for text in &report.log {
            self.events.push(Event::Say {
                robot: robot.clone(),
                text: text.clone(),
            });
        }
    }

    /// The medium decides about commands at the beginning of the next tick.
    fn send(&mut self, sent: Vec<SentCommand>) {
        for command in sent {
            self.medium.accept(command);
        }
    }

    /// The orders that the launcher must carry out before the next tick, in the order of the scenario.
    #[must_use]
    pub fn faults_due(&self) -> Vec<ProcessOrder> {
        let tick = self.tick + 1;
        let mut due = Vec::new();
        for fault in self.scenario.faults_at(tick) {
            if fault.at == tick && !fault.is_restart() {
                due.push(fault.begin_order());
            }
            if fault.end == FaultEnd::At(tick) {
                due.push(fault.end_order());
            }
        }
        due
    }

    /// Robots that start again before the next tick, as further incarnations.
    #[must_use]
    pub fn restarts_due(&self) -> BTreeSet<RobotName> {
        self.scenario.restarts_at(self.tick + 1)
    }

    /// The next tick that a robot that joins now runs.
    fn next_tick(&self) -> Tick {
        let has_begun = !self.stood_at.is_empty();
        if has_begun { self.tick + 1 } else { 0 }
    }

    /// Records orders that are carried out before the next tick, as part of it. A robot whose process they stop, and without
    /// which the clock goes on by its rule for late robots, cannot be queried in that tick.
    pub fn note_faults(&mut self, orders: &[ProcessOrder], on_late: impl Fn(&RobotName) -> OnLate) {
        let wanted = self.scenario.restarts_wanted_at(self.tick + 1);
        for robot in wanted.intersection(&self.restarts_due()) {
            for begins in [true, false] {
                self.between.push(Event::Fault {
                    robot: robot.clone(),
                    kind: FaultKind::Restart,
                    begins,
                });
            }
        }

        for order in orders {
            let is_stopped = matches!(order.lasting(), Some(FaultKind::Crash | FaultKind::Hang));
            if is_stopped && on_late(&order.robot) == OnLate::Continue {
                self.stop(&order.robot);
            }

            self.between.push(Event::Fault {
                robot: order.robot.clone(),
                kind: order.kind,
                begins: order.begins,
            });
        }
    }

    /// The scenario stops the process of a robot before the next tick, and the clock goes on without it.
    pub fn stop(&mut self, robot: &RobotName) {
        self.stopped.push(robot.clone());
    }

    /// Sends a command of the operator, which arrives in the next tick.
    pub fn command(&mut self, command: Sent<CommandText>) {
        let sent = self.number_commands(&RobotName::operator(), vec![command]);
        self.between.extend(SentCommand::events(&sent));
        self.send(sent);
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

    /// The measures of the scenario up to the last complete tick, or at the end of the run.
    #[must_use]
    pub fn measurements(&self) -> &Measurements {
        &self.measurements
    }

    /// How the expectations of the scenario stand.
    #[must_use]
    pub fn standings(&self) -> Vec<Standing> {
        self.watches.standings()
    }

    /// The welcome of a robot that joins; `None` if it is not in the roster. `open` is a report that an earlier incarnation
    /// has sent for the tick in progress.
    #[must_use]
    pub fn welcome(
        &self,
        run: &RunName,
        name: &RobotName,
        generation: Generation,
        open: Option<&Report>,
    ) -> Option<Welcome> {
        let next_tick = self.next_tick();
        let parameters = self.scenario.parameters_at(name, next_tick)?;
        let earlier = self.scenario.parameters_before(name, next_tick).into_iter();
        let later = self.scenario.parameters_after(name, next_tick);
        let index = self.index(name)?;
        let location = self.location(name)?;
        let open_state = open.map(|report| report.state(location));
        let last_state = self.last_state(name);

        Some(Welcome {
            protocol: PROTOCOL_VERSION,
            run: run.clone(),
            name: name.clone(),
            generation,
            epoch: self.epoch,
            tick: self.tick,
            seed: self.scenario.stream_seed(name, next_tick),
            stream: self.stream_of(name, generation, open),
            tick_s: self.scenario.tick_s,
            field_m: self.scenario.field_m,
            body_m: self.scenario.body_m,
            sensing_range_m: self.scenario.sensing.range_m,
            rays: self.scenario.sensing.rays,
            drive: self.drive_limits(name),
            location,
            roster: self.names.clone(),
            known_sites: self.sites.known(),
            parameters: parameters.clone(),
            earlier_parameters: within_message(earlier),
            later_parameters: within_message(later),
            reseeds: self.scenario.stream_reseeds(name, next_tick),
            news_flag: 1 << (index % NEWS_FLAGS),
            // With an answer to the open tick the newest state is that one, and others may still query
            // the one before.
            state_before: open_state.as_ref().and(last_state.clone()),
            last_state: open_state.or(last_state),
        })
    }

    /// The limits of a robot that drives like wheels; `None` for any other one.
    fn drive_limits(&self, name: &RobotName) -> Option<DriveLimits> {
        let wheels = self.scenario.robots.get(name)?.wheels?;
        Some(drive_limits(&wheels, self.scenario.max_speed_mps))
    }

    /// The state of a robot as of the last complete tick, if it has reported.
    #[must_use]
    pub fn last_state(&self, name: &RobotName) -> Option<PublicState> {
        let report = self.reports.get(name)?;
        let location = self.stood_at.get(self.index(name)?)?;
        Some(report.state(*location))
    }

    /// The name of a robot's random stream. The first incarnation in an epoch draws from the stream of its name; a later one
    /// must not draw the same numbers again.
    fn stream_of(&self, name: &RobotName, generation: Generation, open: Option<&Report>) -> String {
        match self.incarnation(name, generation, open) {
            1 => format!("robot/{name}"),
            incarnation => format!("robot/{name}#{incarnation}"),
        }
    }

    /// A robot as it looks around in the tick in progress.
    fn viewpoint(&self, of: usize) -> Viewpoint<'_> {
        let reach_m = self.scenario.sensing.range_m.max(self.sites.reach_m());
        Viewpoint::new(
            &self.scenario,
            &self.world,
            self.now,
            &self.names[of],
            self.world.robots()[of],
            self.heading_rad(of),
            reach_m,
        )
    }

    /// Where a robot looks, radians: its heading, or the direction of motion that it reported last if it does not drive.
    fn heading_rad(&self, of: usize) -> f64 {
        if let Some(pose) = pose(&self.world, of) {
            return pose.heading_rad;
        }
        let report = self.reports.get(&self.names[of]);
        report.map_or(0.0, |report| report.direction_rad)
    }

    /// The ranges of a robot's rays, if its news contain them.
    fn sensed_ranges(&self, of: usize) -> Vec<f64> {
        if !self.with_ranges.contains(&self.names[of]) {
            return Vec::new();
        }
        ranges_m(
            &self.scenario.sensing,
            &self.world,
            of,
            self.heading_rad(of),
        )
    }

    /// The sites that a robot senses, the first of them by name that fit into its news.
    fn sensed_sites(&self, of: usize, viewpoint: &Viewpoint<'_>) -> Vec<SensedSite> {
        let mut sensed = Vec::new();
        let mut bytes = 0;
        for site in self.sites.near(to_wire(self.world.robots()[of])) {
            let what = format_args!("site/{}", site.name);
            if let Some(at) = viewpoint.senses(what, to_world(site.location), None) {
                bytes += site_bytes(&site.name, &site.kind, &site.state);
                if bytes > MAX_SITE_BYTES {
                    break;
                }
                sensed.push(SensedSite {
                    location: to_wire(at),
                    ..site
                });
            }
        }
        sensed
    }

    /// All bodies within a robot's sensing range, if its news contain them.
    fn sensed_bodies(&self, of: usize, viewpoint: &Viewpoint<'_>) -> Vec<SensedBody> {
        if !self.with_bodies.contains(&self.names[of]) {
            return Vec::new();
        }

        let center = self.world.robots()[of];
        let near = self.world.near(center, self.scenario.sensing.range_m);
        let others = near.into_iter().filter(|near| near.body != Body::Robot(of));
        let mut sensed = Vec::new();
        for near in others.take(MAX_BODIES) {
            let at = near.center;
            let (kind, sensed_at) = match near.body {
                Body::Obstacle(index) => {
                    let what = format_args!("obstacle/{index}");
                    let at = viewpoint.senses(what, at, Some(index));
                    (SensedKind::Obstacle, at)
                }
                Body::Guest(index) => {
                    let at = viewpoint.senses(format_args!("guest/{index}"), at, None);
                    (SensedKind::Guest, at)
                }
                Body::Robot(index) => (SensedKind::Robot, self.senses_robot(viewpoint, index)),
            };
            if let Some(at) = sensed_at {
                sensed.push(SensedBody {
                    kind,
                    location: to_wire(at),
                });
            }
        }
        sensed
    }

    /// Where a robot senses another one that is within range.
    fn senses_robot(&self, viewpoint: &Viewpoint<'_>, other: usize) -> Option<world::Point> {
        let what = format_args!("robot/{}", self.names[other]);
        viewpoint.senses(what, self.world.robots()[other], None)
    }

    /// Robots among which are all that one senses, in the order of names. Of many robots these are those around it, so that a tick does
    /// not cost the square of their number.
    fn robots_around(&self, of: usize) -> Vec<usize> {
        let robots = self.world.robots();
        if robots.len() <= MAX_COMPARED {
            return (0..robots.len()).collect();
        }

        // A little more, because it measures distances with other roundings.
        let range_m = self.scenario.sensing.range_m * 1.001;
        let near = self.world.near(robots[of], range_m).into_iter();
        let robot = |near: world::Near| match near.body {
            Body::Robot(index) => Some(index),
            Body::Obstacle(_) | Body::Guest(_) => None,
        };
        near.filter_map(robot).collect()
    }

    fn sensed_robots(&self, of: usize, viewpoint: &Viewpoint<'_>) -> Vec<SensedRobot> {
        let robots = self.world.robots();
        let mut sensed = Vec::new();
        for other in self.robots_around(of) {
            let is_near = robots[of].distance_m(robots[other]) <= self.scenario.sensing.range_m;
            if other == of || !is_near {
                continue;
            }
            if let Some(at) = self.senses_robot(viewpoint, other) {
                sensed.push(SensedRobot {
                    name: self.names[other].clone(),
                    location: to_wire(at),
                });
            }
        }

        sensed
    }

    fn index(&self, name: &RobotName) -> Option<usize> {
        self.names.binary_search(name).ok()
    }

    /// Location of a robot; `None` if it is not in the roster.
    #[must_use]
    pub fn location(&self, name: &RobotName) -> Option<Point> {
        let index = self.index(name)?;
        Some(to_wire(self.world.robots()[index]))
    }

    /// The pose of a robot that drives like wheels; `None` for any other one.
    #[must_use]
    pub fn pose(&self, name: &RobotName) -> Option<Pose> {
        pose(&self.world, self.index(name)?)
    }

    /// The guests that frames have, their number and their center: all that are on the field, or every so manyth of very many.
    pub fn shown_guests(&self) -> impl Iterator<Item = (usize, world::Point)> + '_ {
        let step = guest_sample(self.world.guests().len()).unwrap_or(1) as usize;
        let present = self.world.present_guests();
        present.filter(move |(guest, _)| guest % step == 0)
    }

    /// The numbers of the guests that frames have, in their order; empty where all are on the field all the time.
    #[must_use]
    pub fn guest_numbers(&self) -> Vec<u32> {
        let are_counted = guest_sample(self.world.guests().len()).is_none();
        if are_counted && !self.world.has_passages() {
            return Vec::new();
        }
        self.shown_guests()
            .map(|(guest, _)| u32::try_from(guest).unwrap_or(u32::MAX))
            .collect()
    }

    /// Guests that are not content, by their index among those that frames have, by mood.
    #[must_use]
    pub fn guest_moods(&self) -> BTreeMap<GuestMood, Vec<u32>> {
        self.guests
            .moods(self.shown_guests().map(|(guest, _)| guest))
    }

    /// The sites.
    #[must_use]
    pub fn sites(&self) -> &Sites {
        &self.sites
    }

    /// The state of a site; `None` if the scenario has no such site.
    #[must_use]
    pub fn site_state(&self, name: &str) -> Option<&StateVariables> {
        self.sites.state(name)
    }

    /// The layers.
    #[must_use]
    pub fn layers(&self) -> &Layers {
        &self.layers
    }

    /// Whether a robot's last move was blocked.
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

    /// The scenario.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Simulated time of a tick, seconds.
    #[must_use]
    pub fn time_s(&self, tick: Tick) -> f64 {
        protocol::time::time_s(tick, self.scenario.tick_s)
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

    /// The last report of a robot.
    #[must_use]
    pub fn report(&self, name: &RobotName) -> Option<&Report> {
        self.reports.get(name).map(Arc::as_ref)
    }

    /// The reports for a tick that are wanted, of the robots that have not missed it.
    pub(crate) fn reports_of(
        &self,
        tick: Tick,
        wants: impl Fn(&Report) -> bool,
    ) -> Vec<NamedReport> {
        let mut reports = Vec::new();
        for (name, report) in &self.reports {
            if report.tick == tick && wants(report) {
                reports.push((name.clone(), report.clone()));
            }
        }
        reports
    }

    /// The last state variables of a robot.
    #[must_use]
    pub fn state_variables(&self, name: &RobotName) -> Option<&StateVariables> {
        self.report(name).map(|report| &report.state_variables)
    }

    /// Pairs of robots whose link is cut now.
    #[must_use]
    pub fn cuts(&self) -> Vec<Cut> {
        self.medium.cuts()
    }

    /// Robots that each robot cannot query in this tick, though its radio reaches them.
    #[must_use]
    pub fn unreachable(&self) -> &BTreeMap<RobotName, Vec<RobotName>> {
        &self.unreachable
    }

    /// The robots within the range of the radio of each robot in the tick in progress; `None` where distance does not matter.
    #[must_use]
    pub fn in_range(&self) -> Option<&BTreeMap<RobotName, Vec<RobotName>>> {
        self.in_range.as_ref()
    }

    /// Digest of the run so far.
    #[must_use]
    pub fn digest(&self) -> String {
        self.digest.to_string()
    }
}

impl Bulletin<TickUpdate> for Simulation {
    fn robots(&self) -> BTreeSet<RobotName> {
        self.robots_with_news()
    }

    fn compose(&self, robot: &RobotName, notice: IncarnationNotice) -> TickUpdate {
        self.news(robot, notice)
    }
}

/// The first of these parameters, as many as have a place in a welcome.
fn within_message<'a>(all: impl Iterator<Item = &'a Parameters>) -> Vec<Parameters> {
    let mut bytes = 0;
    let mut within = Vec::new();
    for parameters in all {
        bytes += encode(&ParametersOffer {
            parameters: parameters.clone(),
        })
        .len();

        // Without gaps: a robot goes through them in their order.
        if bytes > MAX_OTHER_PARAMETERS {
            break;
        }
        within.push(parameters.clone());
    }
    within
}

/// The incarnation that `generation` has after the last one.
fn follow(last: Option<(Generation, u32)>, generation: Generation) -> (Generation, u32) {
    let incarnation = match last {
        Some((same, incarnation)) if same == generation => incarnation,
        Some((_, incarnation)) => incarnation + 1,
        None => 1,
    };

    (generation, incarnation)
}
