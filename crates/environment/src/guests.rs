//! What guests do at the faces of robots, and their moods by what robots give them, if the scenario has rules for it.
//!
//! The simulator does not know what a robot feels: it reads what the robot shows, its state variable `facial_expression`, and
//! what it counts, `served` and `missed`. No rule draws anything, so guests without rules walk as they always did.

use std::collections::BTreeMap;

use protocol::messages::{GuestMood, Report, StateVariables};
use protocol::{Event, RobotName, Tick};
use scenario::guests::{Faces, GuestRules};
use world::{Body, Reaction, Response, World};

/// The state variable with the face that a robot shows.
const FACE: &str = "facial_expression";
/// The face with which words cheer guests.
const CHEERFUL: &str = "happy";
/// The state variables that count what guests asked for and got, and what they asked for in vain.
const SERVED: &str = "served";
const MISSED: &str = "missed";

/// What all robots show and count, and the guests' moods.
#[derive(Debug, Clone)]
pub(crate) struct GuestState {
    rules: GuestRules,
    guests: Vec<Guest>,
    /// What each robot has counted up to its last report: served, missed.
    counted: BTreeMap<RobotName, [f64; 2]>,
    /// The guests that were served in the last tick, and the robots that did it, by index.
    served: Vec<(usize, usize)>,
}

#[derive(Debug, Clone, Copy)]
struct Guest {
    mood: GuestMood,
    /// The tick in which the mood began.
    since: Tick,
    /// The robot that it asked last, by index.
    robot: usize,
    /// It stops up to this tick, which is not part of it.
    stops_until: Tick,
}

impl GuestState {
    pub(crate) fn new(rules: GuestRules, count: usize) -> Self {
        let content = Guest {
            mood: GuestMood::Content,
            since: 0,
            robot: 0,
            stops_until: 0,
        };
        let count = if rules.requests.is_some() { count } else { 0 };
        Self {
            rules,
            guests: vec![content; count],
            counted: BTreeMap::new(),
            served: Vec::new(),
        }
    }

    /// The guests that were served in the last tick, and the robots that did it, by index.
    pub(crate) fn served(&self) -> &[(usize, usize)] {
        &self.served
    }

    /// Whether guests see faces at all.
    pub(crate) fn sees_faces(&self) -> bool {
        self.rules.faces.is_some()
    }

    /// What guests do in the next tick at a robot that has reported this; nothing if it shows no face that moves them.
    pub(crate) fn reaction(&self, robot: usize, report: &Report) -> Option<Reaction> {
        let faces = self.rules.faces.as_ref()?;
        let face = text(&report.state_variables, FACE)?;
        Some(Reaction {
            robot,
            range_m: faces.range_m,
            response: response(faces, face)?,
            guest: None,
        })
    }

    /// What single guests do in a tick at the robot that they asked last: those that got something stop, and those that wait come
    /// closer, if the scenario has it.
    pub(crate) fn own_reactions(&self, tick: Tick) -> Vec<Reaction> {
        // Most scenarios have neither, and a look at all guests is not free.
        let requests = self.rules.requests;
        let Some(requests) = requests.filter(|rules| rules.stop > 0 || rules.comes_closer) else {
            return Vec::new();
        };

        let mut reactions = Vec::new();
        for (index, guest) in self.guests.iter().enumerate() {
            let response = if guest.stops_until > tick {
                Response::Stay
            } else if requests.comes_closer && guest.mood == GuestMood::Waiting {
                Response::Approach
            } else {
                continue;
            };
            reactions.push(Reaction {
                robot: guest.robot,
                range_m: requests.range_m,
                response,
                guest: Some(index),
            });
        }
        reactions
    }

    /// Those of these guests that are not content, by their index among them, by mood.
    pub(crate) fn moods(
        &self,
        present: impl Iterator<Item = usize>,
    ) -> BTreeMap<GuestMood, Vec<u32>> {
        let mut moods: BTreeMap<GuestMood, Vec<u32>> = BTreeMap::new();
        if self.rules.requests.is_none() {
            return moods;
        }

        for (index, guest) in (0..).zip(present.map(|guest| &self.guests[guest])) {
            if guest.mood != GuestMood::Content {
                moods.entry(guest.mood).or_default().push(index);
            }
        }
        moods
    }

    /// Guests take what robots have reported in this tick. Returns the changes of mood, by guest.
    ///
    /// `reports` are those of this tick, with the robots' indices in the world.
    pub(crate) fn take<'a, R>(
        &mut self,
        tick: Tick,
        reports: impl Iterator<Item = (usize, &'a RobotName, &'a Report)>,
        world: &World<R>,
    ) -> Vec<Event> {
        let Some(requests) = self.rules.requests else {
            return Vec::new();
        };

        self.served.clear();
        let before: Vec<GuestMood> = self.guests.iter().map(|guest| guest.mood).collect();
        for (robot, name, report) in reports {
            let [served, missed] = self.count(name, &report.state_variables);
            let cheers =
                !report.log.is_empty() && text(&report.state_variables, FACE) == Some(CHEERFUL);
            if served == 0 && missed == 0 && !cheers {
                continue;
            }

            let near = nearest_first(world, robot, requests.range_m);
            self.ask(&near, [served, missed], tick, (robot, requests.stop));
            if cheers {
                self.cheer(&near, tick);
            }
        }

        for guest in &mut self.guests {
            if guest.mood == GuestMood::Waiting && tick - guest.since >= requests.patience {
                guest.set_mood(GuestMood::Annoyed, tick);
            }
        }

        let changed = before.into_iter().zip(&self.guests).enumerate();
        let changed = changed.filter(|(_, (before, guest))| *before != guest.mood);
        changed
            .map(|(index, (_, guest))| Event::Guest {
                guest: u32::try_from(index).unwrap_or(u32::MAX),
                mood: guest.mood,
            })
            .collect()
    }

    /// How much a robot's counters have risen. Counters that a new incarnation begins anew have not.
    fn count(&mut self, name: &RobotName, variables: &StateVariables) -> [u64; 2] {
        let now = [SERVED, MISSED].map(|counter| number(variables, counter));
        let before = self.counted.insert(name.clone(), now).unwrap_or(now);
        [0, 1].map(|counter| (now[counter] - before[counter]).max(0.0) as u64)
    }

    /// So many of the nearest guests get what they ask for, and so many ask in vain. Who has waited is served first.
    ///
    /// Those that are served stop for so many ticks from the next one on.
    fn ask(
        &mut self,
        near: &[usize],
        [served, missed]: [u64; 2],
        tick: Tick,
        (robot, stop): (usize, Tick),
    ) {
        let mut asking: Vec<usize> = near.to_vec();
        // The sort is stable: among the waiting, and among the content, the nearest is first.
        asking.sort_by_key(|guest| self.guests[*guest].mood == GuestMood::Content);

        let served = usize::try_from(served).unwrap_or(usize::MAX);
        let missed = usize::try_from(missed).unwrap_or(usize::MAX);
        let (lucky, others) = asking.split_at(served.min(asking.len()));
        for &guest in lucky {
            self.served.push((guest, robot));
            let guest = &mut self.guests[guest];
            guest.set_mood(GuestMood::Content, tick);
            guest.robot = robot;
            if stop > 0 {
                guest.stops_until = tick.saturating_add(1).saturating_add(stop);
            }
        }
        let content = others
            .iter()
            .filter(|guest| self.guests[**guest].mood == GuestMood::Content);
        for guest in content.copied().take(missed).collect::<Vec<_>>() {
            self.guests[guest].set_mood(GuestMood::Waiting, tick);
            self.guests[guest].robot = robot;
        }
    }

    /// Words of a happy robot: who is annoyed waits with new patience.
    fn cheer(&mut self, near: &[usize], tick: Tick) {
        for guest in near {
            if self.guests[*guest].mood == GuestMood::Annoyed {
                self.guests[*guest].set_mood(GuestMood::Waiting, tick);
            }
        }
    }
}

impl Guest {
    fn set_mood(&mut self, mood: GuestMood, tick: Tick) {
        if self.mood != mood {
            self.mood = mood;
            self.since = tick;
        }
    }
}

fn response(faces: &Faces, face: &str) -> Option<Response> {
    if faces.make_way.contains(face) {
        Some(Response::MakeWay)
    } else {
        faces.approach.contains(face).then_some(Response::Approach)
    }
}

/// The guests around a robot, the nearest first, and equally near ones by index.
fn nearest_first<R>(world: &World<R>, robot: usize, range_m: f64) -> Vec<usize> {
    let center = world.robots()[robot];
    let mut guests = Vec::new();
    for near in world.near(center, range_m) {
        if let Body::Guest(guest) = near.body {
            guests.push((near.center.distance_m(center), guest));
        }
    }
    guests.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    guests.into_iter().map(|(_, guest)| guest).collect()
}

fn text<'a>(variables: &'a StateVariables, name: &str) -> Option<&'a str> {
    variables.get(name)?.as_str()
}

/// A counter; 0 if the robot has none.
fn number(variables: &StateVariables, name: &str) -> f64 {
    variables
        .get(name)
        .and_then(protocol::messages::Variable::as_f64)
        .unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use protocol::messages::{Point, Variable};
    use protocol::random::{Stream, stream};
    use scenario::Scenario;

    use super::*;

    const RULES: &str = "[guests.requests]\nrange = \"100 m\"\npatience = \"2 s\"\n";

    /// A hall with three guests and one robot, and what guests do in it.
    fn hall(rules: &str) -> (World<Stream>, GuestState) {
        let text = format!(
            "[guests]\ncount = 3\n{rules}[[robot]]\nname = \"A\"\nat = [\"5 m\", \"5 m\"]\n"
        );
        let source = config::Source {
            name: "hall.toml".into(),
            text,
        };
        let scenario = Scenario::parse(&source, std::path::Path::new(".")).unwrap();
        let world = World::new(&scenario.hall(), stream(1, "guests")).unwrap();
        let guests = GuestState::new(scenario.guest_rules, scenario.guests.count);
        (world, guests)
    }

    fn report(face: &str, served: f64, missed: f64, log: &[&str]) -> Report {
        let variables = [
            (FACE, Variable::from(face)),
            (SERVED, served.into()),
            (MISSED, missed.into()),
        ];
        Report {
            epoch: 1,
            tick: 0,
            generation: 1,
            proposal: Point::default(),
            speed_mps: 0.0,
            direction_rad: 0.0,
            emotion_state: String::new(),
            behavior_state: String::new(),
            state_variables: variables
                .map(|(name, value)| (name.to_owned(), value))
                .into_iter()
                .collect(),
            commands: 0,
            log: log.iter().map(|line| (*line).to_owned()).collect(),
            site_actions: Vec::new(),
            layer_actions: Vec::new(),
            velocity: None,
        }
    }

    /// Guests take a report, and are in these moods after it, the nearest guest first.
    fn after(hall: &mut (World<Stream>, GuestState), tick: Tick, report: &Report) -> String {
        let name = RobotName::new("A").unwrap();
        let (world, guests) = hall;
        let before: Vec<GuestMood> = guests.guests.iter().map(|guest| guest.mood).collect();
        let events = guests.take(tick, [(0, &name, report)].into_iter(), world);

        // The events are the changes.
        for (index, guest) in guests.guests.iter().enumerate() {
            let told = events.iter().any(|event| {
                matches!(event, Event::Guest { guest: other, mood } if *other as usize == index && *mood == guest.mood)
            });
            assert_eq!(told, before[index] != guest.mood, "guest {index}");
        }
        let moods = nearest_first(world, 0, 100.0).into_iter();
        moods
            .map(|guest| match guests.guests[guest].mood {
                GuestMood::Content => 'c',
                GuestMood::Waiting => 'w',
                GuestMood::Annoyed => 'a',
            })
            .collect()
    }

    #[test]
    fn who_asks_in_vain_waits_then_is_annoyed_and_is_served_first() {
        let mut hall = hall(RULES);
        assert_eq!(
            after(&mut hall, 0, &report("neutral", 5.0, 7.0, &[])),
            "ccc"
        );
        assert_eq!(
            after(&mut hall, 1, &report("neutral", 5.0, 8.0, &[])),
            "wcc"
        );
        assert_eq!(
            after(&mut hall, 2, &report("neutral", 5.0, 9.0, &[])),
            "wwc"
        );
        // The patience of 2 s is over after 4 ticks: of the first in tick 5, of the second in tick 6.
        assert_eq!(
            after(&mut hall, 4, &report("neutral", 5.0, 9.0, &[])),
            "wwc"
        );
        assert_eq!(
            after(&mut hall, 5, &report("neutral", 5.0, 9.0, &[])),
            "awc"
        );
        // Two are served, those who have waited first; of those left nobody is content but the third.
        assert_eq!(
            after(&mut hall, 6, &report("neutral", 7.0, 9.0, &[])),
            "ccc"
        );
        assert_eq!(
            after(&mut hall, 7, &report("neutral", 8.0, 10.0, &[])),
            "cwc"
        );
        // More requests than guests.
        assert_eq!(
            after(&mut hall, 8, &report("neutral", 8.0, 1e9, &[])),
            "www"
        );
    }

    #[test]
    fn counters_that_begin_anew_ask_for_nothing() {
        let mut hall = hall(RULES);
        assert_eq!(
            after(&mut hall, 0, &report("neutral", 5.0, 7.0, &[])),
            "ccc"
        );
        assert_eq!(
            after(&mut hall, 1, &report("neutral", 0.0, 0.0, &[])),
            "ccc"
        );
        assert_eq!(
            after(&mut hall, 2, &report("neutral", 0.0, 1.0, &[])),
            "wcc"
        );
    }

    #[test]
    fn words_with_a_happy_face_cheer_the_annoyed_only() {
        let mut hall = hall(RULES);
        after(&mut hall, 0, &report("neutral", 0.0, 0.0, &[]));
        after(&mut hall, 1, &report("neutral", 0.0, 1.0, &[]));
        assert_eq!(
            after(&mut hall, 5, &report("neutral", 0.0, 1.0, &[])),
            "acc"
        );
        assert_eq!(after(&mut hall, 6, &report("happy", 0.0, 1.0, &[])), "acc");
        assert_eq!(
            after(&mut hall, 6, &report("sad", 0.0, 1.0, &["a joke"])),
            "acc"
        );
        assert_eq!(
            after(&mut hall, 7, &report("happy", 0.0, 1.0, &["a joke"])),
            "wcc"
        );
        // With new patience.
        assert_eq!(after(&mut hall, 10, &report("happy", 0.0, 1.0, &[])), "wcc");
        assert_eq!(after(&mut hall, 11, &report("happy", 0.0, 1.0, &[])), "acc");
    }

    #[test]
    fn guests_out_of_range_and_guests_without_rules_ask_for_nothing() {
        for rules in ["[guests.requests]\nrange = \"1 cm\"\n", ""] {
            let (world, mut guests) = hall(rules);
            let name = RobotName::new("A").unwrap();
            for (tick, count) in [(0, 0.0), (1, 3.0)] {
                let report = report("happy", count, count, &["hello"]);
                let events = guests.take(tick, [(0, &name, &report)].into_iter(), &world);
                assert_eq!(events, []);
            }
        }
    }

    #[test]
    fn who_is_served_stops_and_who_waits_comes_closer_if_the_rules_say_so() {
        let rules = format!("{RULES}stop = \"1 s\"\ncome_closer = true\n");
        let responses = |hall: &(World<Stream>, GuestState), tick| {
            let reactions = hall.1.own_reactions(tick).into_iter();
            let mut found: Vec<Response> = reactions.map(|reaction| reaction.response).collect();
            found.sort_by_key(|response| format!("{response:?}"));
            found
        };

        let mut hall = hall(&rules);
        after(&mut hall, 0, &report("neutral", 0.0, 0.0, &[]));
        after(&mut hall, 1, &report("neutral", 1.0, 1.0, &[]));
        // A stop of 1 s are ticks 2 and 3.
        for tick in [2, 3] {
            assert_eq!(responses(&hall, tick), [Response::Approach, Response::Stay]);
        }
        assert_eq!(responses(&hall, 4), [Response::Approach]);
        // Annoyed, it does not come.
        after(&mut hall, 5, &report("neutral", 1.0, 1.0, &[]));
        assert_eq!(responses(&hall, 6), []);

        let mut plain = self::hall(RULES);
        after(&mut plain, 0, &report("neutral", 0.0, 0.0, &[]));
        after(&mut plain, 1, &report("neutral", 1.0, 1.0, &[]));
        assert_eq!(responses(&plain, 2), []);

        // A stop that no run outlasts.
        let mut endless = self::hall(&format!("{RULES}stop = \"1e300 s\"\n"));
        after(&mut endless, 0, &report("neutral", 0.0, 0.0, &[]));
        after(&mut endless, 1, &report("neutral", 1.0, 1.0, &[]));
        assert_eq!(responses(&endless, Tick::MAX - 1), [Response::Stay]);
    }

    #[test]
    fn the_face_decides_what_guests_do() {
        let (_, guests) = hall("[guests.faces]\nmake_way = [\"angry\"]\napproach = [\"happy\"]\n");
        let response = |face| {
            guests
                .reaction(0, &report(face, 0.0, 0.0, &[]))
                .map(|reaction| reaction.response)
        };
        assert_eq!(response("angry"), Some(Response::MakeWay));
        assert_eq!(response("happy"), Some(Response::Approach));
        assert_eq!(response("neutral"), None);
    }
}
