//! In which emotion and behavior each robot is, and whether it takes part: one fold over the events of a run, for all that
//! count, show or measure it.
//!
//! A robot is in a state from the tick of its first report with it. A tick that it misses changes nothing: it takes part, and is in
//! the state that it reported last. From the tick in which it is lost on it takes no part, and is in no state; when it joins
//! again it is in the state that it had before, unless it reports another one.

use std::collections::BTreeMap;

use protocol::{Event, RobotName, Tick};

/// What a state is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// What the robot feels.
    Emotion,
    /// What it does.
    Behavior,
}

/// A time without a break in which a robot was in one state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stay {
    /// The robot.
    pub robot: RobotName,
    /// What the state is about.
    pub kind: Kind,
    /// The state.
    pub state: String,
    /// The first tick.
    pub begin: Tick,
    /// The tick after the last one.
    pub end: Tick,
}

/// The states of the robots after an event of a run. Memory is bounded by the number of robots.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct States {
    robots: BTreeMap<RobotName, Robot>,
}

/// The states of a robot.
#[derive(Debug, Clone, PartialEq, Default)]
struct Robot {
    emotion: Option<Since>,
    behavior: Option<Since>,
    /// Since when it takes no part.
    lost: Option<Tick>,
}

/// A state, and the tick in which it began or the robot took part again.
#[derive(Debug, Clone, PartialEq)]
struct Since {
    state: String,
    begin: Tick,
}

impl States {
    /// Applies an event of a tick. Returns what is over with it.
    pub fn apply(&mut self, tick: Tick, event: &Event) -> Vec<Stay> {
        match event {
            Event::Emotion { robot, to, .. } => self.enter(robot, Kind::Emotion, to, tick),
            Event::Behavior { robot, to, .. } => self.enter(robot, Kind::Behavior, to, tick),
            Event::Lost { robot } => self.lose(robot, tick),
            Event::Joined { robot, .. } => {
                self.join(robot, tick);
                Vec::new()
            }
            Event::Init { .. }
            | Event::Missed { .. }
            | Event::DoneLate { .. }
            | Event::Blocked { .. }
            | Event::CommandSent { .. }
            | Event::CommandDelayed { .. }
            | Event::CommandDuplicated { .. }
            | Event::CommandDelivered { .. }
            | Event::CommandDropped { .. }
            | Event::QueryLost { .. }
            | Event::LinkCut { .. }
            | Event::LinkHealed { .. }
            | Event::Fault { .. }
            | Event::Changed { .. }
            | Event::Say { .. }
            | Event::Warned { .. }
            | Event::Judged { .. }
            | Event::Tick { .. }
            | Event::End { .. } => Vec::new(),
        }
    }

    /// What lasts, as if it were over in this tick.
    #[must_use]
    pub fn lasting(&self, tick: Tick) -> Vec<Stay> {
        let mut stays = Vec::new();
        for (name, robot) in &self.robots {
            if robot.lost.is_none() {
                stays.extend(robot.stays(name, tick));
            }
        }
        stays
    }

    /// Since when a robot takes no part; `None` if it does.
    #[must_use]
    pub fn lost_since(&self, robot: &RobotName) -> Option<Tick> {
        self.robots.get(robot)?.lost
    }

    fn enter(&mut self, name: &RobotName, kind: Kind, to: &str, tick: Tick) -> Vec<Stay> {
        let robot = self.robots.entry(name.clone()).or_default();
        let since = match kind {
            Kind::Emotion => &mut robot.emotion,
            Kind::Behavior => &mut robot.behavior,
        };
        let before = since.replace(Since {
            state: to.to_owned(),
            begin: tick,
        });

        let over = before.filter(|_| robot.lost.is_none());
        let stay = over.and_then(|before| before.until(name, kind, tick));
        stay.into_iter().collect()
    }

    fn lose(&mut self, name: &RobotName, tick: Tick) -> Vec<Stay> {
        let robot = self.robots.entry(name.clone()).or_default();
        if robot.lost.is_some() {
            return Vec::new();
        }

        robot.lost = Some(tick);
        robot.stays(name, tick)
    }

    fn join(&mut self, name: &RobotName, tick: Tick) {
        let robot = self.robots.entry(name.clone()).or_default();
        if robot.lost.take().is_none() {
            return;
        }

        let states = [&mut robot.emotion, &mut robot.behavior];
        for since in states.into_iter().flatten() {
            since.begin = tick;
        }
    }
}

impl Robot {
    fn stays(&self, name: &RobotName, end: Tick) -> Vec<Stay> {
        let mut stays = Vec::new();
        for (kind, since) in [
            (Kind::Emotion, &self.emotion),
            (Kind::Behavior, &self.behavior),
        ] {
            if let Some(since) = since {
                stays.extend(since.clone().until(name, kind, end));
            }
        }
        stays
    }
}

impl Since {
    /// The stay that ends in a tick; `None` if it has lasted for no tick.
    fn until(self, robot: &RobotName, kind: Kind, end: Tick) -> Option<Stay> {
        (self.begin < end).then(|| Stay {
            robot: robot.clone(),
            kind,
            state: self.state,
            begin: self.begin,
            end,
        })
    }
}

impl Stay {
    /// How many ticks it lasted.
    #[must_use]
    pub fn ticks(&self) -> Tick {
        self.end - self.begin
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> RobotName {
        RobotName::new("A").unwrap()
    }

    fn joined() -> Event {
        Event::Joined {
            robot: robot(),
            generation: None,
            at: Default::default(),
        }
    }

    fn feels(to: &str) -> Event {
        Event::Emotion {
            robot: robot(),
            from: None,
            to: to.to_owned(),
        }
    }

    fn does(to: &str) -> Event {
        Event::Behavior {
            robot: robot(),
            from: None,
            to: to.to_owned(),
        }
    }

    /// What the stays of a run that ends with the tick 20 are.
    fn stays(events: &[(Tick, Event)]) -> Vec<(Kind, String, Tick, Tick)> {
        let mut states = States::default();
        let mut stays = Vec::new();
        for (tick, event) in events {
            stays.extend(states.apply(*tick, event));
        }
        stays.extend(states.lasting(20));

        let stays = stays.into_iter();
        stays
            .map(|stay| (stay.kind, stay.state, stay.begin, stay.end))
            .collect()
    }

    #[test]
    fn a_state_lasts_until_another_one_and_until_the_robot_is_lost() {
        let found = stays(&[
            (0, joined()),
            (0, feels("X")),
            (0, does("SERVE")),
            (4, Event::Missed { robot: robot() }),
            (5, feels("Y")),
            (5, feels("Z")), // It was in Y for no tick.
            (8, Event::Lost { robot: robot() }),
            (8, Event::Missed { robot: robot() }),
            (9, Event::Lost { robot: robot() }),
            (12, joined()),
            (12, feels("X")),
        ]);
        assert_eq!(
            found,
            [
                (Kind::Emotion, "X".to_owned(), 0, 5),
                (Kind::Emotion, "Z".to_owned(), 5, 8),
                (Kind::Behavior, "SERVE".to_owned(), 0, 8),
                (Kind::Emotion, "X".to_owned(), 12, 20),
                (Kind::Behavior, "SERVE".to_owned(), 12, 20),
            ]
        );
    }

    #[test]
    fn a_robot_that_is_lost_at_the_end_is_in_no_state() {
        let lost = Event::Lost { robot: robot() };
        let mut events = vec![(0, joined()), (2, feels("X")), (7, lost)];
        assert_eq!(stays(&events), [(Kind::Emotion, "X".to_owned(), 2, 7)]);

        let mut states = States::default();
        for (tick, event) in &events {
            states.apply(*tick, event);
        }
        assert_eq!(states.lost_since(&robot()), Some(7));

        // An incarnation that is back before its predecessor was missed goes on.
        events.pop();
        events.push((7, joined()));
        assert_eq!(stays(&events), [(Kind::Emotion, "X".to_owned(), 2, 20)]);
    }
}
