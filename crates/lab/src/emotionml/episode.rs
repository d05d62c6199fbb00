//! Episodes: the longest spans of ticks in which a robot is in one emotion state.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use affect::frame::{
    AGENCY, CERTAINTY, CONTROLLABILITY, GOAL_CONGRUENCE, INTENSITY, URGENCY, VALENCE,
};
use protocol::messages::StateVariables;
use protocol::{RobotName, Tick};

/// Names and ranges of the state variables that are exported as numbers: the convention of `affect::frame`. A number out
/// of its range has another meaning.
const NUMBERS: [(&str, RangeInclusive<f64>); 6] = [
    (INTENSITY, 0.0..=1.0),
    (VALENCE, -1.0..=1.0),
    (URGENCY, 0.0..=1.0),
    (GOAL_CONGRUENCE, -1.0..=1.0),
    (CONTROLLABILITY, 0.0..=1.0),
    (CERTAINTY, 0.0..=1.0),
];

/// The agency of a robot that holds itself responsible.
const ONESELF: &str = "self";

/// Emotion state of a robot without emotions.
const NEUTRAL: &str = "NEUTRAL";

/// What is known of a robot in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Presence {
    /// It has reported.
    Reported,
    /// Its report is missing: it is in the state that it reported last.
    Missed,
    /// It takes no part, and is in no state.
    Absent,
}

/// What a robot published in a tick, or last.
#[derive(Debug, Clone)]
pub(super) struct RobotState {
    pub(super) name: RobotName,
    /// If it has not reported in the tick, the other fields are older.
    pub(super) presence: Presence,
    pub(super) emotion: String,
    pub(super) behavior: String,
    /// Its state variables; `None` where the record has none.
    pub(super) variables: Option<StateVariables>,
}

impl RobotState {
    /// A state variable that is a number.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.variables.as_ref()?.get(name)?.as_f64()
    }

    /// A state variable that is a text.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.variables.as_ref()?.get(name)?.as_str()
    }

    /// A state variable of the affect frame, if it is within its range.
    fn published(&self, name: &str, range: &RangeInclusive<f64>) -> Option<f64> {
        self.number(name).filter(|value| range.contains(value))
    }

    /// The agent that is responsible for its emotion, as it publishes it: itself, or another one.
    fn agency(&self) -> Option<&str> {
        self.text(AGENCY).filter(|name| !name.is_empty())
    }

    /// The agent that is responsible, if it is not the robot itself.
    fn other(&self) -> Option<&str> {
        self.agency().filter(|name| *name != ONESELF)
    }

    fn has_emotion(&self) -> bool {
        !self.emotion.is_empty() && self.emotion != NEUTRAL
    }
}

/// A number for every tick of an episode, or none at all: EmotionML has no traces with gaps.
#[derive(Debug)]
pub(super) struct Trace(Option<Vec<f64>>);

impl Trace {
    fn begin(first: Option<f64>) -> Self {
        Self(first.map(|value| vec![value]))
    }

    fn push(&mut self, value: Option<f64>) {
        match (&mut self.0, value) {
            (Some(values), Some(value)) => values.push(value),
            _ => self.0 = None,
        }
    }

    /// Repeats the last number for a tick without a report.
    fn hold(&mut self) {
        if let Some(values) = &mut self.0
            && let Some(last) = values.last().copied()
        {
            values.push(last);
        }
    }

    /// The numbers, one a tick.
    pub(super) fn values(&self) -> Option<&[f64]> {
        self.0.as_deref()
    }
}

/// One emotion of one robot, from its beginning to its end.
#[derive(Debug)]
pub(super) struct Episode {
    /// The robot in the first tick.
    pub(super) begun: RobotState,
    /// First tick.
    pub(super) first: Tick,
    /// Last tick.
    pub(super) last: Tick,
    /// The tick in which it was over, or the last tick of the run.
    pub(super) end: Tick,
    /// The agent other than itself that the robot held responsible last.
    pub(super) other: Option<String>,
    /// The published numbers, in the order of [`NUMBERS`].
    numbers: [Trace; NUMBERS.len()],
    /// 1 for each tick in which the robot held itself responsible, 0 for others.
    own_doing: Trace,
}

impl Episode {
    fn begin(tick: Tick, begun: RobotState) -> Self {
        let numbers = NUMBERS.map(|(name, range)| Trace::begin(begun.published(name, &range)));
        let own_doing = Trace::begin(begun.agency().map(own_doing));
        Self {
            other: begun.other().map(str::to_owned),
            begun,
            first: tick,
            last: tick,
            end: tick + 1,
            numbers,
            own_doing,
        }
    }

    fn extend(&mut self, tick: Tick, robot: &RobotState) {
        for (trace, (name, range)) in self.numbers.iter_mut().zip(NUMBERS) {
            trace.push(robot.published(name, &range));
        }
        self.own_doing.push(robot.agency().map(own_doing));

        if let Some(other) = robot.other() {
            self.other = Some(other.to_owned());
        }
        self.last = tick;
        self.end = tick + 1;
    }

    /// The robot has not reported in a tick.
    fn hold(&mut self, tick: Tick) {
        for trace in &mut self.numbers {
            trace.hold();
        }
        self.own_doing.hold();
        self.last = tick;
        self.end = tick + 1;
    }

    /// Intensity, tick by tick, if it was published in every tick.
    pub(super) fn intensity(&self) -> Option<&[f64]> {
        self.values(INTENSITY)
    }

    /// Mean of a published number, if it was published in every tick.
    pub(super) fn mean(&self, name: &str) -> Option<f64> {
        self.values(name).map(mean)
    }

    /// Share of the episode in which the robot held itself responsible.
    pub(super) fn own_doing(&self) -> Option<f64> {
        self.own_doing.values().map(mean)
    }

    fn values(&self, name: &str) -> Option<&[f64]> {
        let index = NUMBERS.iter().position(|(own, _)| *own == name)?;
        self.numbers[index].values()
    }
}

fn own_doing(agency: &str) -> f64 {
    if agency == ONESELF { 1.0 } else { 0.0 }
}

/// Mean of the numbers of a trace, of which there is at least one.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The episodes in progress.
#[derive(Debug, Default)]
pub(super) struct Episodes {
    /// The episode in progress of each robot.
    robots: BTreeMap<RobotName, Option<Episode>>,
    /// Robots with a note; each has at most one.
    noted: BTreeSet<RobotName>,
    /// What the document cannot express, for people.
    pub(super) notes: Vec<String>,
}

impl Episodes {
    /// Adds the state of a robot in a tick. Returns the episode that it ends.
    ///
    /// Ticks without a report belong to the episode: the robot is in the state that it reported last. From the tick in which it
    /// is lost on it takes no part, and its episode is over.
    pub(super) fn add(&mut self, tick: Tick, robot: RobotState) -> Option<Episode> {
        if robot.presence == Presence::Reported {
            self.note(&robot);
        }

        let episode = self.robots.entry(robot.name.clone()).or_default();
        match robot.presence {
            Presence::Absent => return episode.take(),
            Presence::Missed => {
                if let Some(episode) = episode {
                    episode.hold(tick);
                }
                return None;
            }
            Presence::Reported => {}
        }
        match episode {
            Some(episode) if episode.begun.emotion == robot.emotion => {
                episode.extend(tick, &robot);
                None
            }
            episode => std::mem::replace(episode, begin(tick, robot)),
        }
    }

    /// The episodes in progress at the end of the run, by robot. The run ends with its last tick: of that there is no time.
    pub(super) fn end(self) -> impl Iterator<Item = Episode> {
        self.robots.into_values().flatten().map(|mut episode| {
            episode.end = episode.last;
            episode
        })
    }

    /// Notes what is missing of a robot, once.
    fn note(&mut self, robot: &RobotState) {
        let lacks_emotion = !robot.has_emotion();
        let lacks_intensity =
            robot.variables.is_some() && robot.published(INTENSITY, &(0.0..=1.0)).is_none();
        if !(lacks_emotion || lacks_intensity) || !self.noted.insert(robot.name.clone()) {
            return;
        }

        let name = &robot.name;
        let emotion = &robot.emotion;
        self.notes.push(if lacks_emotion {
            format!("{name} has a state without emotion, {emotion:?}, which is left out")
        } else {
            format!(
                "{name} does not publish `{INTENSITY}` between 0 and 1 in every tick; episodes with such ticks have no intensity"
            )
        });
    }
}

/// The episode that begins with a state, if the robot has an emotion.
fn begin(tick: Tick, robot: RobotState) -> Option<Episode> {
    let has_emotion = robot.has_emotion();
    has_emotion.then(|| Episode::begin(tick, robot))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(emotion: &str, intensity: f64) -> RobotState {
        let variables = [(INTENSITY.to_owned(), intensity.into())].into();
        RobotState {
            name: RobotName::new("Butler").unwrap(),
            presence: Presence::Reported,
            emotion: emotion.to_owned(),
            behavior: String::new(),
            variables: Some(variables),
        }
    }

    fn without_report(presence: Presence) -> RobotState {
        RobotState {
            presence,
            ..seen("A", 0.0)
        }
    }

    /// Emotion, first and last tick, intensities.
    type Short = (String, Tick, Tick, Option<Vec<f64>>);

    fn episodes(ticks: Vec<RobotState>) -> Vec<Short> {
        let mut episodes = Episodes::default();
        let mut all = Vec::new();
        for (tick, robot) in (0..).zip(ticks) {
            all.extend(episodes.add(tick, robot));
        }
        all.extend(episodes.end());

        all.into_iter().map(short).collect()
    }

    fn short(episode: Episode) -> Short {
        let intensity = episode.intensity().map(<[f64]>::to_vec);
        (
            episode.begun.emotion,
            episode.first,
            episode.last,
            intensity,
        )
    }

    #[test]
    fn an_episode_lasts_as_long_as_the_emotion() {
        let found = episodes(vec![
            seen("HAPPY", 0.0),
            seen("HAPPY", 0.1),
            seen("CONFIDENT", 0.3),
        ]);
        let expected = [
            ("HAPPY".to_owned(), 0, 1, Some(vec![0.0, 0.1])),
            ("CONFIDENT".to_owned(), 2, 2, Some(vec![0.3])),
        ];

        assert_eq!(found, expected);
    }

    #[test]
    fn missed_ticks_repeat_the_last_report_and_an_absence_ends_the_episode() {
        let missed = || without_report(Presence::Missed);
        let absent = || without_report(Presence::Absent);
        let found = episodes(vec![
            seen("A", 0.1),
            missed(),
            missed(),
            seen("A", 0.4),
            missed(),
            seen("B", 0.5),
        ]);
        assert_eq!(
            found,
            [
                ("A".to_owned(), 0, 4, Some(vec![0.1, 0.1, 0.1, 0.4, 0.4])),
                ("B".to_owned(), 5, 5, Some(vec![0.5]))
            ]
        );

        let found = episodes(vec![seen("A", 0.1), absent(), absent(), seen("A", 0.4)]);
        assert_eq!(
            found,
            [
                ("A".to_owned(), 0, 0, Some(vec![0.1])),
                ("A".to_owned(), 3, 3, Some(vec![0.4]))
            ]
        );
    }

    #[test]
    fn a_trace_has_no_gaps_and_no_numbers_of_another_scale() {
        let found = episodes(vec![
            seen("A", 0.1),
            seen("A", 70.0),
            seen("A", 0.2),
            seen("B", 1.0),
        ]);

        assert_eq!(
            found,
            [
                ("A".to_owned(), 0, 2, None),
                ("B".to_owned(), 3, 3, Some(vec![1.0]))
            ]
        );
    }

    #[test]
    fn a_robot_without_emotions_has_no_episodes() {
        assert_eq!(episodes(vec![seen("NEUTRAL", 0.0), seen("", 0.0)]), []);
    }
}
