//! An open field in memory, for robots alone: no simulator, and no guests but those that a test places. Bodies that would
//! overlap stay; commands arrive at the next tick, unless the test drops them; queries are answered, unless the test cuts
//! them.

pub(crate) mod asker;
pub(crate) mod reborn;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lockstep::Exchange;
use protocol::PROTOCOL_VERSION;
use protocol::messages::{CommandText, Delivery, NEWS_FLAGS, Performative, Target};
use robot::{
    Correction, LocalHost, Parameters, Point, Report, Robot, RobotName, RunName, SensedBody,
    SensedKind, SensedRobot, TickUpdate, Variable, Welcome,
};

pub(crate) const FT_M: f64 = 0.3048;
pub(crate) const TICK_S: f64 = 0.5;
const BODY_M: f64 = 2.0 * FT_M;
const FIELD_M: f64 = 50.0 * FT_M;
const SENSING_M: f64 = 6.0 * FT_M;

pub(crate) fn name(text: &str) -> RobotName {
    RobotName::new(text).unwrap()
}

/// A place in feet.
pub(crate) fn feet(x: f64, y: f64) -> Point {
    Point::new(x * FT_M, y * FT_M)
}

/// Parameters from TOML text, numbers in SI units.
pub(crate) fn parameters(text: &str) -> Parameters {
    let table: toml::Table = toml::from_str(text).unwrap();
    table
        .into_iter()
        .map(|(key, value)| (key, serde_json::to_value(value).unwrap()))
        .collect()
}

/// One robot of the cast.
pub(crate) struct Role {
    pub(crate) name: &'static str,
    pub(crate) at: Point,
    pub(crate) robot: Box<dyn Robot>,
    pub(crate) parameters: Parameters,
}

impl Role {
    pub(crate) fn new(name: &'static str, class: &str, at: Point, text: &str) -> Self {
        Self::played_by(robots::make(class).unwrap(), name, at, text)
    }

    pub(crate) fn played_by(
        robot: Box<dyn Robot>,
        name: &'static str,
        at: Point,
        text: &str,
    ) -> Self {
        Self {
            name,
            at,
            robot,
            parameters: parameters(text),
        }
    }
}

/// A command as it was sent.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sent {
    pub(crate) tick: u64,
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) command: String,
}

/// A command as the robots' host hands it over.
type Command = lockstep::Sent<CommandText>;
type Drops = Box<dyn Fn(&Sent) -> bool>;
type Cuts = Box<dyn Fn(u64, &str, &str) -> bool>;

/// The field and the robots on it.
pub(crate) struct Stage {
    host: LocalHost,
    pub(crate) tick: u64,
    pub(crate) places: BTreeMap<RobotName, Point>,
    pub(crate) obstacles: Vec<Point>,
    /// Guests, who stand still.
    pub(crate) guests: Vec<Point>,
    pub(crate) reports: BTreeMap<RobotName, Arc<Report>>,
    /// Every command, also a lost one.
    pub(crate) sent: Vec<Sent>,
    /// Whether a command is lost.
    pub(crate) drops: Drops,
    /// Whether, at this tick, the first robot cannot query the second.
    pub(crate) cuts: Cuts,
    /// Robots whose news list the bodies around them.
    with_bodies: BTreeSet<RobotName>,
    underway: BTreeMap<RobotName, Vec<Delivery>>,
}

impl Stage {
    /// The field before tick 0.
    pub(crate) fn new(seed: u64, cast: Vec<Role>) -> Self {
        let mut roster: Vec<RobotName> = cast.iter().map(|role| name(role.name)).collect();
        roster.sort();
        let places = cast.iter().map(|role| (name(role.name), role.at)).collect();
        let with_bodies = cast
            .iter()
            .filter(|role| role.robot.senses_bodies())
            .map(|role| name(role.name))
            .collect();
        let runners = cast.into_iter().map(|role| {
            let welcome = welcome(role.name, role.at, seed, &roster, role.parameters);
            (role.robot, welcome)
        });

        Self {
            host: LocalHost::new(runners.collect()),
            tick: 0,
            places,
            obstacles: Vec::new(),
            guests: Vec::new(),
            reports: BTreeMap::new(),
            sent: Vec::new(),
            drops: Box::new(|_| false),
            cuts: Box::new(|_, _, _| false),
            with_bodies,
            underway: BTreeMap::new(),
        }
    }

    /// Butler in the middle and Leguin 30 ft away, with these parameters.
    pub(crate) fn pair(seed: u64, butler: &str, leguin: &str) -> Self {
        let mut stage = Self::new(
            seed,
            vec![
                Role::new("Butler", "Butler", feet(25.0, 25.0), butler),
                Role::new("Leguin", "Leguin", feet(4.0, 4.0), leguin),
            ],
        );
        stage.begin();
        stage
    }

    /// Leguin with these parameters behind a wall, called by a Butler with treats for ever.
    pub(crate) fn walled_in(leguin: &str) -> Self {
        let mut stage = Self::pair(1, "treat_mean_s = 1e9", leguin);
        stage.obstacles = (0..12)
            .flat_map(|i| {
                let along = 2.0 * f64::from(i) + 1.0;
                [feet(along, 9.0), feet(9.0, along)]
            })
            .collect();
        stage.command("Leguin", "refill");
        stage
    }

    /// Tick 0.
    pub(crate) fn begin(&mut self) {
        self.exchange(&BTreeMap::new());
    }

    /// One tick: moves in the order of names, then the robots.
    pub(crate) fn step(&mut self) {
        self.tick += 1;
        let blocked = self.advance();
        self.exchange(&blocked);
    }

    /// Steps until `is_over`; returns whether that came within `limit_s`.
    pub(crate) fn step_until(
        &mut self,
        limit_s: f64,
        mut is_over: impl FnMut(&Self) -> bool,
    ) -> bool {
        let last = self.tick + (limit_s / TICK_S) as u64;
        while self.tick < last {
            self.step();
            if is_over(self) {
                return true;
            }
        }
        false
    }

    /// A command from outside the roster; arrives at the next tick.
    pub(crate) fn command(&mut self, to: &str, command: &str) {
        let delivery = delivery(name("operator"), command);
        self.underway.entry(name(to)).or_default().push(delivery);
    }

    pub(crate) fn report(&self, robot: &str) -> &Report {
        &self.reports[&name(robot)]
    }

    pub(crate) fn emotion(&self, robot: &str) -> &str {
        &self.report(robot).emotion_state
    }

    pub(crate) fn behavior(&self, robot: &str) -> &str {
        &self.report(robot).behavior_state
    }

    pub(crate) fn number(&self, robot: &str, variable: &str) -> f64 {
        self.report(robot).state_variables[variable]
            .as_f64()
            .unwrap()
    }

    pub(crate) fn flag(&self, robot: &str, variable: &str) -> bool {
        self.report(robot).state_variables[variable] == Variable::Flag(true)
    }

    pub(crate) fn at(&self, robot: &str) -> Point {
        self.places[&name(robot)]
    }

    pub(crate) fn apart_ft(&self, a: &str, b: &str) -> f64 {
        self.at(a).distance_m(self.at(b)) / FT_M
    }

    /// The commands that a robot sent, in order.
    pub(crate) fn commands_of(&self, robot: &str) -> Vec<&str> {
        self.sent
            .iter()
            .filter(|sent| sent.from == robot)
            .map(|sent| sent.command.as_str())
            .collect()
    }

    fn advance(&mut self) -> BTreeMap<RobotName, bool> {
        let mut blocked = BTreeMap::new();
        for robot in self.places.keys().cloned().collect::<Vec<_>>() {
            let proposal = self.reports[&robot].proposal;
            let is_free = is_on_field(proposal)
                && self
                    .bodies_but(&robot)
                    .iter()
                    .all(|(_, body)| !overlap(*body, proposal));
            if is_free {
                self.places.insert(robot.clone(), proposal);
            }
            blocked.insert(robot, !is_free);
        }
        blocked
    }

    fn bodies_but(&self, robot: &RobotName) -> Vec<(SensedKind, Point)> {
        let others = self.places.iter().filter(|(other, _)| *other != robot);
        let robots = others.map(|(_, at)| (SensedKind::Robot, *at));
        let obstacles = self.obstacles.iter().map(|at| (SensedKind::Obstacle, *at));
        robots
            .chain(obstacles)
            .chain(self.guests.iter().map(|at| (SensedKind::Guest, *at)))
            .collect()
    }

    fn exchange(&mut self, blocked: &BTreeMap<RobotName, bool>) {
        let mut news = BTreeMap::new();
        for robot in self.places.keys() {
            let commands = self.underway.remove(robot).unwrap_or_default();
            let is_blocked = blocked.get(robot) == Some(&true);
            news.insert(robot.clone(), self.news(robot, is_blocked, commands));
        }

        let outcome = self.host.exchange(self.tick, &news).unwrap();
        self.reports.clear();
        for (robot, (report, commands)) in outcome.reports {
            self.reports.insert(robot.clone(), report);
            self.note_commands(&robot, commands);
        }
    }

    fn news(&self, robot: &RobotName, is_blocked: bool, commands: Vec<Delivery>) -> TickUpdate {
        let at = self.places[robot];
        let others = || self.places.iter().filter(|(other, _)| *other != robot);
        let sensed: Vec<SensedRobot> = others()
            .filter(|(_, place)| at.distance_m(**place) <= SENSING_M)
            .map(|(other, place)| SensedRobot {
                name: other.clone(),
                location: *place,
            })
            .collect();
        let unreachable: Vec<RobotName> = others()
            .map(|(other, _)| other.clone())
            .filter(|other| (self.cuts)(self.tick, robot.as_str(), other.as_str()))
            .collect();

        TickUpdate {
            epoch: 1,
            tick: self.tick,
            correction: Some(Correction {
                location: at,
                blocked: is_blocked,
            }),
            commands,
            unreachable,
            sensed,
            bodies: self.bodies(robot),
            ..TickUpdate::default()
        }
    }

    /// The bodies around a robot, if it asks for them.
    fn bodies(&self, robot: &RobotName) -> Vec<SensedBody> {
        if !self.with_bodies.contains(robot) {
            return Vec::new();
        }

        let at = self.places[robot];
        self.bodies_but(robot)
            .into_iter()
            .filter(|(_, place)| at.distance_m(*place) <= SENSING_M)
            .map(|(kind, location)| SensedBody { kind, location })
            .collect()
    }

    fn note_commands(&mut self, from: &RobotName, commands: Vec<Command>) {
        for sent in commands {
            let note = Sent {
                tick: self.tick,
                from: from.to_string(),
                to: sent.to.to_string(),
                command: sent.command.command,
            };
            if !(self.drops)(&note) {
                let delivery = delivery(from.clone(), &note.command);
                let Target::Robot(to) = sent.to else {
                    unreachable!("the paper's robots send no broadcasts");
                };
                self.underway.entry(to).or_default().push(delivery);
            }
            self.sent.push(note);
        }
    }
}

fn delivery(from: RobotName, command: &str) -> Delivery {
    Delivery {
        from,
        performative: Performative::Achieve,
        command: command.to_owned(),
        payload: None,
    }
}

pub(crate) fn welcome(
    robot: &str,
    at: Point,
    seed: u64,
    roster: &[RobotName],
    parameters: Parameters,
) -> Welcome {
    Welcome {
        protocol: PROTOCOL_VERSION,
        run: RunName::new("stage").unwrap(),
        name: name(robot),
        generation: 1,
        epoch: 1,
        tick: 0,
        seed,
        stream: format!("robot/{robot}"),
        tick_s: TICK_S,
        field_m: [FIELD_M, FIELD_M],
        body_m: BODY_M,
        sensing_range_m: SENSING_M,
        rays: None,
        drive: None,
        location: at,
        roster: roster.to_vec(),
        known_sites: Vec::new(),
        parameters,
        earlier_parameters: Vec::new(),
        reseeds: Vec::new(),
        later_parameters: Vec::new(),
        news_flag: news_flag(robot, roster),
        last_state: None,
        state_before: None,
    }
}

/// The flag of the robot in clocks.
fn news_flag(robot: &str, roster: &[RobotName]) -> u32 {
    let mut names: Vec<&str> = roster.iter().map(RobotName::as_str).collect();
    names.sort_unstable();
    let index = names.iter().position(|name| *name == robot);

    1 << (index.unwrap_or_default() % NEWS_FLAGS)
}

fn is_on_field(place: Point) -> bool {
    let inside = BODY_M / 2.0 - 1e-9..=FIELD_M - BODY_M / 2.0 + 1e-9;
    inside.contains(&place.x) && inside.contains(&place.y)
}

fn overlap(a: Point, b: Point) -> bool {
    (a.x - b.x).abs() < BODY_M - 1e-9 && (a.y - b.y).abs() < BODY_M - 1e-9
}
