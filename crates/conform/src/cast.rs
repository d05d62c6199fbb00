//! The other robots of the roster, played: they answer at once, for any tick, and stand where they are told to.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use bus::{Bus, BusError, Declared, Query};
use protocol::keys::{Keys, QUERIES, STATE};
use protocol::messages::{Percept, PublicState, SensedBody, SensedKind, SensedRobot};
use protocol::{Epoch, Message, RobotName, Tick, encode};
use serde_json::{Value, json};

use crate::setting::Role;

/// The others, and the tick that they are in.
#[derive(Debug, Clone)]
pub(crate) struct Cast {
    others: Arc<BTreeMap<RobotName, Role>>,
    now: Arc<Mutex<(Epoch, Tick)>>,
    /// Whether everything said carries fields that nobody knows.
    has_extras: bool,
}

impl Cast {
    pub(crate) fn new(others: BTreeMap<RobotName, Role>, has_extras: bool) -> Self {
        Self {
            others: Arc::new(others),
            now: Arc::default(),
            has_extras,
        }
    }

    /// Their names.
    pub(crate) fn names(&self) -> impl Iterator<Item = &RobotName> {
        self.others.keys()
    }

    /// Where the tick under way is told.
    pub(crate) fn begin(&self, epoch: Epoch, tick: Tick) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = (epoch, tick);
    }

    fn now(&self) -> (Epoch, Tick) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What `robot` reported for a tick.
    fn state(&self, robot: &RobotName, epoch: Epoch, tick: Tick) -> Option<PublicState> {
        let role = self.others.get(robot)?;
        let index = usize::try_from(tick)
            .unwrap_or(usize::MAX)
            .min(role.states.len().saturating_sub(1));
        let state = role.states.get(index).cloned();
        let state = state.unwrap_or_else(|| PublicState {
            epoch,
            tick,
            location: role.location,
            speed_mps: 0.0,
            direction_rad: 0.0,
            state_variables: [(
                "ticks".to_owned(),
                protocol::messages::Variable::Number(tick as f64),
            )]
            .into(),
            emotion_state: "CALM".to_owned(),
            behavior_state: "STAND".to_owned(),
        });
        Some(PublicState {
            epoch,
            tick,
            ..state
        })
    }

    /// The first of them, as it is sensed in a tick.
    pub(crate) fn sensed(&self, epoch: Epoch, tick: Tick) -> Option<SensedRobot> {
        let name = self.names().next()?.clone();
        let location = self.state(&name, epoch, tick)?.location;
        Some(SensedRobot { name, location })
    }

    fn percept(&self) -> Percept {
        let (epoch, tick) = self.now();
        let sensed = self.sensed(epoch, tick);
        let bodies = sensed
            .map(|robot| SensedBody {
                kind: SensedKind::Robot,
                location: robot.location,
            })
            .into_iter();
        Percept {
            epoch,
            tick,
            bodies: bodies.collect(),
        }
    }

    /// A message as it is put on the wire.
    pub(crate) fn dress<M: Message>(&self, message: &M) -> Vec<u8> {
        let bytes = encode(message);
        if !self.has_extras {
            return bytes;
        }
        let mut value = serde_json::from_slice(&bytes).unwrap_or(Value::Null);
        add_extras(&mut value);
        value.to_string().into_bytes()
    }

    /// Serves what others may ask them, and what `subject` may ask of its surroundings.
    pub(crate) fn serve(
        &self,
        bus: &Bus,
        keys: &Keys,
        subject: &RobotName,
    ) -> Result<Vec<Declared>, BusError> {
        let mut declared = Vec::new();
        for (name, what) in self
            .names()
            .flat_map(|name| QUERIES.iter().chain([&STATE]).map(move |what| (name, what)))
        {
            let (cast, name, key) = (self.clone(), name.clone(), keys.query(name, what));
            declared.push(bus.queryable(&key, move |query| cast.answer(&name, what, &query))?);
        }
        let cast = self.clone();
        declared.push(bus.queryable(&keys.percept(subject), move |query| {
            query.reply(query.key(), cast.dress(&cast.percept()));
        })?);
        for name in self.names() {
            declared.push(bus.token(&keys.alive_robot(name))?);
        }
        Ok(declared)
    }

    /// Asked during a tick, everybody answers with the state reported for the tick before.
    fn answer(&self, name: &RobotName, what: &str, query: &Query) {
        let number = |parameter: &str| query.parameter(parameter)?.parse::<Tick>().ok();
        let (epoch, now) = self.now();
        let tick = number("tick").unwrap_or(now);
        let Some(state) = tick
            .checked_sub(1)
            .and_then(|tick| self.state(name, epoch, tick))
        else {
            return query.reply_err("nothing is known before tick 1");
        };
        match state.answer(what) {
            Some(answer) => query.reply(query.key(), self.dress(&answer)),
            None => query.reply(query.key(), self.dress(&state)),
        }
    }

    /// Sends what followers have without asking, before the clock of the tick.
    pub(crate) fn tell_followers(
        &self,
        bus: &Bus,
        keys: &Keys,
        subject: &RobotName,
    ) -> Result<(), BusError> {
        let (epoch, tick) = self.now();
        for name in self.names() {
            if let Some(state) = tick
                .checked_sub(1)
                .and_then(|tick| self.state(name, epoch, tick))
            {
                bus.put(&keys.query(name, STATE), self.dress(&state))?;
            }
        }
        bus.put(&keys.percept(subject), self.dress(&self.percept()))
    }
}

/// Adds fields that nobody knows wherever a message has fields. Maps with names as keys have none.
fn add_extras(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(add_extras),
        Value::Object(fields) => {
            for (name, field) in fields.iter_mut() {
                match name.as_str() {
                    "parameters" | "state_variables" | "value" => {}
                    "news" => {
                        field
                            .as_object_mut()
                            .into_iter()
                            .flatten()
                            .for_each(|(_, news)| add_extras(news));
                    }
                    _ => add_extras(field),
                }
            }
            fields.insert(
                "added_later".to_owned(),
                json!({ "by": ["somebody", 1, null] }),
            );
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extras_are_added_to_messages_and_not_to_maps() {
        let mut clock = json!({
            "tick": 1,
            "news": { "A": { "correction": { "location": { "x": 1 } }, "commands": [{ "from": "B" }] } },
            "parameters": { "speed": { "mean": 1 } },
        });
        add_extras(&mut clock);
        for path in [
            "",
            "/news/A",
            "/news/A/correction/location",
            "/news/A/commands/0",
        ] {
            assert!(
                clock.pointer(path).unwrap().get("added_later").is_some(),
                "{path}"
            );
        }
        for path in ["/news", "/parameters", "/parameters/speed"] {
            assert!(
                clock.pointer(path).unwrap().get("added_later").is_none(),
                "{path}"
            );
        }
    }
}
