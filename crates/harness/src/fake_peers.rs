//! The other robots of the roster, played: they answer at once, for any tick, and stand where their roles place them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bus::{Bus, BusError, Declared, Query};
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{Point, PublicState, SensedBody, SensedKind, SensedRobot, Variable};
use protocol::{Epoch, Message, RobotName, Tick, encode};
use serde_json::{Value, json};

use crate::setting::RosterRobot;

/// Below this, each whole number has a floating-point number of its own.
const MAX_WHOLE: f64 = 9_007_199_254_740_992.0;

/// How far from its place a robot is, or is shown where that must make no difference, meters.
const MISPLACED_M: f64 = 1.5;
/// How far apart the bodies are that a robot senses, meters.
const BESIDE_M: f64 = 0.75;
/// How far a robot without a script moves in a tick, meters, and after how many ticks it is back.
const PACE_M: f64 = 0.01;
const PACES: Tick = 50;
/// What it is then, and what it does.
const EMOTIONS: [&str; 3] = ["CALM", "GLAD", "TIRED"];
const BEHAVIORS: [&str; 2] = ["STAND", "PACE"];

/// A query that one of them received.
#[derive(Debug, Clone)]
pub struct ReceivedQuery {
    /// The robot that was asked.
    pub of: RobotName,
    /// Its parameters, as they came.
    pub tick: Option<String>,
    /// Its parameter `epoch`, as it came.
    pub epoch: Option<String>,
    /// The tick under way.
    pub now: (Epoch, Tick),
}

/// A reply that does not answer: the robot must query again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unhelpful {
    /// An error reply, as of a robot that has not reported yet.
    Refusal,
    /// The state of an earlier tick, which says so.
    EarlierState,
    /// The state of the tick under way, which says so.
    LaterState,
    /// The state of this tick in the epoch before, which says so.
    EarlierEpoch,
    /// No reply, as where the query was lost.
    Silence,
}

#[derive(Default)]
struct PeersState {
    now: (Epoch, Tick),
    asked: Vec<ReceivedQuery>,
    /// Queries for earlier ticks, and of earlier epochs, are held back.
    holds_before: Option<(Epoch, Tick)>,
    /// States that are put show the robots elsewhere than they are.
    misplaces: bool,
    /// They are elsewhere than the script has them.
    are_elsewhere: bool,
    /// How the next queries of each robot are replied to, instead of with its state.
    unhelpful: BTreeMap<RobotName, Vec<Unhelpful>>,
    held: Vec<(RobotName, String, Query)>,
}

/// The others, and the tick that they are in.
#[derive(Clone, Default)]
pub struct FakePeers {
    others: Arc<BTreeMap<RobotName, RosterRobot>>,
    state: Arc<Mutex<PeersState>>,
    /// Whether everything that is put carries unknown fields.
    has_extras: bool,
    /// Whether whole numbers are written without a fraction wherever a fraction is possible.
    writes_integers: bool,
}

impl FakePeers {
    /// These robots, with what differs in their messages.
    pub fn new(
        others: BTreeMap<RobotName, RosterRobot>,
        has_extras: bool,
        writes_integers: bool,
    ) -> Self {
        Self {
            others: Arc::new(others),
            state: Arc::default(),
            has_extras,
            writes_integers,
        }
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &RobotName> {
        self.others.keys()
    }

    fn state(&self) -> MutexGuard<'_, PeersState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A tick begins.
    pub fn begin(&self, epoch: Epoch, tick: Tick) {
        self.state().now = (epoch, tick);
    }

    /// The queries that they received so far.
    pub fn asked(&self) -> Vec<ReceivedQuery> {
        self.state().asked.clone()
    }

    /// Forgets these queries.
    pub fn forget_asked(&self) {
        self.state().asked.clear();
    }

    /// From now on they hold queries back.
    pub fn hold(&self) {
        self.hold_before(Epoch::MAX, Tick::MAX);
    }

    /// They hold back queries for ticks before this one, and answer all others.
    pub fn hold_before(&self, epoch: Epoch, tick: Tick) {
        self.state().holds_before = Some((epoch, tick));
    }

    /// States that are put show them elsewhere than they are, or no longer do.
    pub fn misplace(&self, misplaces: bool) {
        self.state().misplaces = misplaces;
    }

    /// They are elsewhere than usual from now on, or no longer are.
    pub fn displace(&self, are_elsewhere: bool) {
        self.state().are_elsewhere = are_elsewhere;
    }

    /// They reply in this order to the next queries of each robot, and then as usual.
    pub fn be_unhelpful(&self, replies: &[Unhelpful]) {
        let mut last_first = replies.to_vec();
        last_first.reverse();
        self.state().unhelpful = self
            .names()
            .map(|name| (name.clone(), last_first.clone()))
            .collect();
    }

    /// A robot that was queried, and has not been queried as often as [`Self::be_unhelpful`] demands.
    pub fn given_up(&self) -> Option<RobotName> {
        let state = self.state();
        let asked: Vec<&RobotName> = state
            .asked
            .iter()
            .filter(|query| query.now == state.now)
            .map(|query| &query.of)
            .collect();
        let left = |name: &RobotName| {
            state
                .unhelpful
                .get(name)
                .is_some_and(|left| !left.is_empty())
        };

        asked.into_iter().find(|name| left(name)).cloned()
    }

    /// Whether they hold a query back.
    pub fn has_held(&self) -> bool {
        !self.state().held.is_empty()
    }

    /// They answer what they held back, and everything from now on.
    pub fn release(&self) {
        // Answered without the lock, which `answer` takes itself.
        let held = {
            let mut state = self.state();
            state.holds_before = None;
            std::mem::take(&mut state.held)
        };

        for (name, what, query) in held {
            self.answer(&name, &what, &query);
        }
    }

    /// What `robot` reported for a tick.
    fn state_of(&self, robot: &RobotName, epoch: Epoch, tick: Tick) -> Option<PublicState> {
        let role = self.others.get(robot)?;
        let index = usize::try_from(tick)
            .unwrap_or(usize::MAX)
            .min(role.states.len().saturating_sub(1));
        let state = role.states.get(index).cloned();
        let state = state.unwrap_or_else(|| PublicState {
            epoch,
            tick,
            // Each tick has another one, so that a robot shows whose state it used.
            location: Point::new(
                role.location.x + PACE_M * (tick % PACES) as f64,
                role.location.y,
            ),
            speed_mps: (tick % 2) as f64,
            direction_rad: (tick % 3) as f64,
            state_variables: [("ticks".to_owned(), Variable::Number(tick as f64))].into(),
            emotion_state: EMOTIONS[tick as usize % EMOTIONS.len()].to_owned(),
            behavior_state: BEHAVIORS[tick as usize % BEHAVIORS.len()].to_owned(),
        });

        let mut location = state.location;
        if self.state().are_elsewhere {
            location.x += MISPLACED_M;
        }
        Some(PublicState {
            epoch,
            tick,
            location,
            ..state
        })
    }

    /// They, as they are sensed in a tick.
    pub fn sensed(&self, epoch: Epoch, tick: Tick) -> Vec<SensedRobot> {
        let mut sensed = Vec::new();
        for name in self.names() {
            sensed.extend(self.state_of(name, epoch, tick).map(|state| SensedRobot {
                name: name.clone(),
                location: state.location,
            }));
        }
        sensed
    }

    /// The same as bodies, and one of each other kind.
    pub fn bodies(&self, epoch: Epoch, tick: Tick) -> Vec<SensedBody> {
        let mut bodies = Vec::new();
        for robot in self.sensed(epoch, tick) {
            for kind in [SensedKind::Robot, SensedKind::Guest, SensedKind::Obstacle] {
                let aside_m = BESIDE_M * bodies.len() as f64;
                let location = Point::new(robot.location.x, robot.location.y + aside_m);
                bodies.push(SensedBody { kind, location });
            }
        }
        bodies
    }

    /// A message as it is put on the wire.
    pub fn dress<M: Message>(&self, message: &M) -> Vec<u8> {
        let bytes = encode(message);
        if !self.has_extras && !self.writes_integers {
            return bytes;
        }

        let mut value = serde_json::from_slice(&bytes).unwrap_or(Value::Null);
        if self.has_extras {
            add_extras(&mut value);
            let name = std::any::type_name::<M>().rsplit("::").next();
            add_defaults(name.unwrap_or_default(), &mut value);
        }
        if self.writes_integers {
            write_integers(&mut value);
        }
        value.to_string().into_bytes()
    }

    /// Declares their queryables.
    pub fn serve(&self, bus: &Bus, keys: &Keys) -> Result<Vec<Declared>, BusError> {
        let mut declared = Vec::new();
        for name in self.names() {
            for what in QUERIES.iter().chain([&STATE]) {
                let fake_peers = self.clone();
                let name = name.clone();
                let key = keys.query(&name, what);
                declared.push(
                    bus.queryable(&key, move |query| fake_peers.receive(&name, what, query))?,
                );
            }
        }
        Ok(declared)
    }

    /// Declares their tokens.
    pub fn show(&self, bus: &Bus, keys: &Keys) -> Result<Vec<Declared>, BusError> {
        self.names()
            .map(|name| bus.token(&keys.alive_robot(name)))
            .collect()
    }

    fn receive(&self, name: &RobotName, what: &str, query: Query) {
        let mut state = self.state();
        let now = state.now;
        state.asked.push(ReceivedQuery {
            of: name.clone(),
            tick: query.parameter("tick").map(str::to_owned),
            epoch: query.parameter("epoch").map(str::to_owned),
            now,
        });
        let epoch = query
            .parameter("epoch")
            .and_then(|epoch| epoch.parse().ok());
        let tick = query.parameter("tick").and_then(|tick| tick.parse().ok());
        if state.holds_before > Some((epoch.unwrap_or(now.0), tick.unwrap_or(now.1))) {
            state.held.push((name.clone(), what.to_owned(), query));
            return;
        }

        drop(state);
        self.answer(name, what, &query);
    }

    /// During a tick all of them answer with the state reported for the tick before.
    fn answer(&self, name: &RobotName, what: &str, query: &Query) {
        let (epoch, now) = self.state().now;
        let unhelpful = self
            .state()
            .unhelpful
            .get_mut(name)
            .and_then(std::vec::Vec::pop);
        if unhelpful == Some(Unhelpful::Refusal) {
            return query.reply_err("it is not reported yet");
        }
        // A query that is released without a reply ends the get.
        if unhelpful == Some(Unhelpful::Silence) {
            return;
        }
        let tick = query
            .parameter("tick")
            .and_then(|tick| tick.parse::<Tick>().ok())
            .unwrap_or(now);
        let (of_epoch, of_tick) = match unhelpful {
            Some(Unhelpful::EarlierState) => (epoch, tick.checked_sub(2)),
            Some(Unhelpful::LaterState) => (epoch, Some(tick)),
            Some(Unhelpful::EarlierEpoch) => (epoch.saturating_sub(1), tick.checked_sub(1)),
            _ => (epoch, tick.checked_sub(1)),
        };
        let state = of_tick.and_then(|tick| self.state_of(name, of_epoch, tick));
        let Some(mut state) = state else {
            return query.reply_err("nothing is known before tick 1");
        };

        // Who takes it for the one that was asked for shows it, whatever of it counts for that robot.
        if (state.epoch, state.tick + 1) != (epoch, tick) {
            stray(&mut state);
        }
        match state.answer(what) {
            Some(answer) => query.reply(query.key(), self.dress(&answer)),
            None => query.reply(query.key(), self.dress(&state)),
        }
    }

    /// Puts their states of the tick before, for robots that subscribe to them, before the clock of the tick.
    pub fn put_states(&self, bus: &Bus, keys: &Keys) -> Result<(), BusError> {
        let (_, tick) = self.state().now;
        match tick.checked_sub(1) {
            Some(before) => self.put_states_of(before, bus, keys),
            None => Ok(()),
        }
    }

    /// The same for a tick of the epoch under way.
    pub fn put_states_of(&self, before: Tick, bus: &Bus, keys: &Keys) -> Result<(), BusError> {
        let (epoch, _) = self.state().now;
        let misplaces = self.state().misplaces;
        for name in self.names() {
            if let Some(mut state) = self.state_of(name, epoch, before) {
                if misplaces {
                    stray(&mut state);
                }
                bus.put(&keys.query(name, STATE), self.dress(&state))?;
            }
        }

        Ok(())
    }
}

/// Changes all that a state says, but for its epoch and tick.
fn stray(state: &mut PublicState) {
    state.location.x += MISPLACED_M;
    state.speed_mps += 1.0;
    state.direction_rad = if state.direction_rad > 0.0 { -1.0 } else { 1.0 };
    state.emotion_state = "ASTRAY".to_owned();
    state.behavior_state = "STRAY".to_owned();
    let variables = &state.state_variables;
    state.state_variables = variables
        .into_iter()
        .map(|(name, value)| (name, other(value)))
        .collect();
}

fn other(value: &Variable) -> Variable {
    match value {
        Variable::Flag(flag) => Variable::Flag(!flag),
        Variable::Number(number) => Variable::Number(number + 1.0),
        Variable::Text(text) => Variable::Text(format!("{text} astray").into()),
    }
}

/// Fields that are left out where they have their default, by the type, list or object that they belong to.
const DEFAULTS: [(&str, &str, &str); 10] = [
    (
        "JoinAnswer",
        "known_sites earlier_parameters later_parameters reseeds",
        "[]",
    ),
    ("JoinAnswer", "rays drive last_state state_before", "null"),
    ("Clock", "end", "null"),
    (
        "TickUpdate",
        "joined rejoin correction pose in_range",
        "null",
    ),
    ("commands", "payload", "null"),
    ("Clock", "news", "0"),
    ("Clock", "panels", "false"),
    (
        "TickUpdate",
        "commands unreachable sensed bodies ranges sites site_results layers layer_results",
        "[]",
    ),
    ("correction", "blocked", "false"),
    ("commands", "performative", "\"achieve\""),
];

/// Writes out what a message leaves out because it is the default.
fn add_defaults(name: &str, value: &mut Value) {
    match value {
        Value::Array(values) => values
            .iter_mut()
            .for_each(|value| add_defaults(name, value)),
        Value::Object(fields) => {
            for (within, field) in fields.iter_mut() {
                add_defaults(within, field);
            }
            for (_, names, default) in DEFAULTS.iter().filter(|(within, ..)| *within == name) {
                for field in names.split(' ') {
                    let default = || serde_json::from_str(default).unwrap_or(Value::Null);
                    fields.entry(field).or_insert_with(default);
                }
            }
        }
        _ => {}
    }
}

/// Adds unknown fields wherever a message has fields. Maps with names as keys have none.
fn add_extras(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(add_extras),
        Value::Object(fields) => {
            for (name, field) in fields.iter_mut() {
                match name.as_str() {
                    "parameters" | "state_variables" | "value" => {}
                    _ => add_extras(field),
                }
            }

            fields.insert(
                "added_later".to_owned(),
                json!({ "by": ["a later version", 1, null] }),
            );
        }
        _ => {}
    }
}

/// Writes 7.0 as 7, wherever there is one.
fn write_integers(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(write_integers),
        Value::Object(fields) => fields.values_mut().for_each(write_integers),
        Value::Number(number) => {
            let float = number.as_f64().unwrap_or_default();
            let is_whole = float.fract() == 0.0 && float.abs() < MAX_WHOLE;
            let is_minus_zero = float == 0.0 && float.is_sign_negative();

            if number.is_f64() && is_whole && !is_minus_zero {
                *number = (float as i64).into();
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use protocol::decode;
    use protocol::messages::{Clock, TickUpdate};

    use super::*;

    #[test]
    fn extras_are_added_to_messages_and_not_to_maps() {
        let mut news = json!({
            "tick": 1,
            "correction": { "location": { "x": 1 } },
            "commands": [{ "from": "B" }],
            "parameters": { "speed": { "mean": 1 } },
        });
        add_extras(&mut news);

        for path in ["", "/correction/location", "/commands/0"] {
            assert!(
                news.pointer(path).unwrap().get("added_later").is_some(),
                "{path}"
            );
        }
        for path in ["/parameters", "/parameters/speed"] {
            assert!(
                news.pointer(path).unwrap().get("added_later").is_none(),
                "{path}"
            );
        }
    }

    #[test]
    fn defaults_that_are_written_out_are_those_of_the_messages() {
        let peers = FakePeers::new(BTreeMap::new(), true, false);
        let clock = Clock::default();
        let update = TickUpdate::default();

        let clock_bytes = peers.dress(&clock);
        assert_eq!(decode::<Clock>("", "", &clock_bytes).unwrap(), clock);
        let update_bytes = peers.dress(&update);
        assert_eq!(decode::<TickUpdate>("", "", &update_bytes).unwrap(), update);
        let written: Value = serde_json::from_slice(&update_bytes).unwrap();
        assert_eq!(written["layer_results"], json!([]));
    }

    #[test]
    fn whole_numbers_lose_their_fraction_and_others_keep_it() {
        let mut news =
            json!({ "tick": 1, "at": [{ "x": 5.0, "y": -3.0, "z": 0.5, "none": -0.0 }] });
        write_integers(&mut news);
        assert_eq!(
            news.to_string(),
            r#"{"at":[{"none":-0.0,"x":5,"y":-3,"z":0.5}],"tick":1}"#
        );
    }
}
