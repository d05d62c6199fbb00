//! The messages at the router as one robot's transcript: lines in an order that does not depend on the schedule.

use bus::Overheard;
use protocol::RobotName;
use protocol::keys::{Keys, STATE};
use protocol::messages::{Clock, JoinRequest, News, PublicState};

/// One line of a transcript; the fields are explained in section "Test vectors" of `docs/protocol.md`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line(String);

/// Where a line stands among those of its tick. Within a place lines keep the order of the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Join,
    Token,
    News,
    Clock,
    /// The same process joins the next epoch, because of its clock.
    JoinAgain,
    Ask,
    Sent,
    State,
    Report,
}

/// The story of one robot.
pub(super) struct Transcript {
    keys: Keys,
    robot: RobotName,
    /// What the others reported for the tick before: what they answer in the one under way.
    states: Vec<(String, Vec<u8>)>,
    /// The process that has joined last.
    instance: Option<String>,
    lines: Vec<Line>,
}

/// A message as it stands on the wire: JSON within JSON.
fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("messages are UTF-8")
}

fn put(way: &str, key: &str, message: &[u8]) -> Line {
    Line(format!(
        r#"{{"way":"{way}","key":"{key}","message":{}}}"#,
        text(message)
    ))
}

/// A query and what came back. `way` is `ask` where the robot asks and `asked` where it is asked.
fn query(
    way: &str,
    key: &str,
    parameters: &str,
    body: Option<&[u8]>,
    result: &Result<Vec<u8>, String>,
) -> Line {
    let mut line = format!(r#"{{"way":"{way}","key":"{key}""#);
    if !parameters.is_empty() {
        line += &format!(r#","parameters":"{parameters}""#);
    }
    if let Some(body) = body {
        line += &format!(r#","message":{}"#, text(body));
    }
    line += &match result {
        Ok(answer) => format!(r#","answer":{}}}"#, text(answer)),
        Err(reason) => format!(
            r#","refused":{}}}"#,
            serde_json::Value::from(reason.as_str())
        ),
    };
    Line(line)
}

impl Transcript {
    pub(super) fn new(keys: Keys, robot: RobotName, scenario: &str) -> Self {
        let start = format!(
            r#"{{"way":"start","robot":"{robot}","scenario":{}}}"#,
            serde_json::Value::from(scenario)
        );
        Self {
            keys,
            robot,
            states: Vec::new(),
            instance: None,
            lines: vec![Line(start)],
        }
    }

    /// The lines of a tick, or of what happened between two.
    pub(super) fn add(&mut self, heard: &[Overheard]) {
        let clock = heard.iter().find_map(|one| self.clock(one));
        let news = heard.iter().find_map(|one| self.news(one));
        let mut placed: Vec<(Place, Line)> = Vec::new();
        let mut states = Vec::new();
        for (at, one) in heard.iter().enumerate() {
            match one {
                Overheard::Put { key, message } => {
                    placed.extend(self.place(key, message));
                    if self.is_state_of_another(key) {
                        states.push((key.clone(), message.clone()));
                    }
                }
                Overheard::Asked {
                    query: number,
                    key,
                    body,
                    ..
                } if self.is_own_join(key) => {
                    let is_answer = |later: &&Overheard| matches!(later, Overheard::Answered { query, .. } if query == number);
                    if let Some(Overheard::Answered { result, .. }) =
                        heard[at..].iter().find(is_answer)
                    {
                        let place = self.place_of_join(body);
                        placed.push((place, query("ask", key, "", Some(body), result)));
                    }
                }
                Overheard::Token { key } if *key == self.keys.alive_robot(&self.robot) => {
                    placed.push((
                        Place::Token,
                        Line(format!(r#"{{"way":"token","key":"{key}"}}"#)),
                    ));
                }
                _ => {}
            }
        }
        placed.extend(self.answers(clock.as_ref(), news.as_ref()));
        if !states.is_empty() {
            self.states = states;
        }
        placed.sort_by_key(|(place, _)| *place);
        // On a slow machine the simulator repeats the end of the run.
        placed.dedup_by(|later, earlier| later == earlier && later.0 == Place::Clock);
        self.lines.extend(placed.into_iter().map(|(_, line)| line));
    }

    /// A query to the robot, and what it answered.
    pub(super) fn asked(&mut self, key: &str, parameters: &str, result: &Result<Vec<u8>, String>) {
        self.lines
            .push(query("asked", key, parameters, None, result));
    }

    pub(super) fn text(&self) -> String {
        self.lines
            .iter()
            .map(|line| line.0.clone() + "\n")
            .collect()
    }

    fn clock(&self, heard: &Overheard) -> Option<Clock> {
        match heard {
            Overheard::Put { key, message } if *key == self.keys.clock() => {
                Some(serde_json::from_slice(message).expect("a clock"))
            }
            _ => None,
        }
    }

    fn news(&self, heard: &Overheard) -> Option<News> {
        match heard {
            Overheard::Put { key, message } if *key == self.keys.news(&self.robot) => {
                Some(serde_json::from_slice(message).expect("news"))
            }
            _ => None,
        }
    }

    fn is_own_join(&self, key: &str) -> bool {
        key == self.keys.join_as(&self.robot)
    }

    fn place_of_join(&mut self, body: &[u8]) -> Place {
        let request: JoinRequest = serde_json::from_slice(body).expect("a request to join");
        let before = self.instance.replace(request.instance.clone());

        if before == Some(request.instance) {
            Place::JoinAgain
        } else {
            Place::Join
        }
    }

    fn is_state_of_another(&self, key: &str) -> bool {
        Keys::last_chunk(key) == STATE && Keys::robot_of(key) != Some(self.robot.as_str())
    }

    /// What concerns the robot among the messages that were put.
    fn place(&self, key: &str, message: &[u8]) -> Option<(Place, Line)> {
        let to = |place| Some((place, put("to", key, message)));
        let from = |place| Some((place, put("from", key, message)));
        let own = |of: fn(&Keys, &RobotName) -> String| key == of(&self.keys, &self.robot);

        if key == self.keys.clock() {
            return to(Place::Clock);
        }
        if own(Keys::report) {
            return from(Place::Report);
        }
        if own(Keys::news) {
            return to(Place::News);
        }
        if key == self.keys.query(&self.robot, STATE) {
            return from(Place::State);
        }

        let (before, sender) = key.rsplit_once('/')?;
        if before.ends_with("/command") && sender == self.robot.as_str() {
            return from(Place::Sent);
        }
        None
    }

    /// All queries that the robot can make in this tick, and their answers. They are the same whether it queries or
    /// subscribes, so the lines do not depend on that.
    fn answers(&self, clock: Option<&Clock>, news: Option<&News>) -> Vec<(Place, Line)> {
        let Some(clock) = clock.filter(|clock| clock.tick > 0 && clock.end.is_none()) else {
            return Vec::new();
        };
        let parameters = format!("tick={};epoch={}", clock.tick, clock.epoch);
        let unreachable = news.map(|news| news.unreachable.as_slice());
        let mut asks = Vec::new();
        for (key, state) in &self.states {
            let of = Keys::robot_of(key).unwrap_or_default();
            let reported: PublicState = serde_json::from_slice(state).expect("a state");
            let is_last = (reported.epoch, reported.tick + 1) == (clock.epoch, clock.tick);
            let is_cut = unreachable
                .unwrap_or_default()
                .iter()
                .any(|name| name.as_str() == of);
            if is_last && !is_cut {
                asks.push((
                    Place::Ask,
                    query("ask", key, &parameters, None, &Ok(state.clone())),
                ));
            }
        }
        asks
    }
}
