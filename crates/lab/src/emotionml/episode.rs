//! Episodes: the longest spans of ticks in which a robot is in one emotion state.

use std::collections::{BTreeMap, BTreeSet};

use protocol::messages::StateVariables;
use protocol::{RobotName, Tick};

/// State variables with the intensity of a robot's emotion, and with the ratio of its need to what can be done.
const INTENSITY: &str = "intensity";
const NEED_RATIO: &str = "need_ratio";

/// Emotion state of a robot without emotions.
const NEUTRAL: &str = "NEUTRAL";

/// What a robot published in a tick.
#[derive(Debug, Clone)]
pub(super) struct RobotState {
    pub(super) name: RobotName,
    /// Whether its report is missing, so that the other fields are older than the tick.
    pub(super) missed: bool,
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

    /// A state variable that is `true`.
    pub(super) fn flag(&self, name: &str) -> bool {
        self.variables
            .as_ref()
            .and_then(|variables| variables.get(name)?.as_bool())
            .unwrap_or(false)
    }

    /// Intensity, if it is between 0 and 1; outside of this range the number has another meaning.
    fn intensity(&self) -> Option<f64> {
        self.number(INTENSITY)
            .filter(|value| (0.0..=1.0).contains(value))
    }

    /// Ratio of the need to what can be done, if it is not negative.
    fn need_ratio(&self) -> Option<f64> {
        self.number(NEED_RATIO).filter(|value| *value >= 0.0)
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

    /// Repeats the last number for ticks without a report.
    fn hold(&mut self, ticks: u64) {
        if let Some(values) = &mut self.0
            && let Some(last) = values.last().copied()
        {
            for _ in 0..ticks {
                values.push(last);
            }
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
    /// The robot in the tick before the first, in which the cause of the emotion lies.
    pub(super) before: RobotState,
    /// First tick.
    pub(super) first: Tick,
    /// Last tick with a report of the robot.
    pub(super) last: Tick,
    /// Intensity, 0 to 1.
    pub(super) intensity: Trace,
    /// Ratio of the robot's need to what could be done.
    pub(super) need_ratio: Trace,
}

impl Episode {
    fn begin(tick: Tick, before: RobotState, begun: RobotState) -> Self {
        let intensity = Trace::begin(begun.intensity());
        let need_ratio = Trace::begin(begun.need_ratio());
        Self {
            begun,
            before,
            first: tick,
            last: tick,
            intensity,
            need_ratio,
        }
    }

    fn extend(&mut self, tick: Tick, robot: &RobotState) {
        let missed = tick.saturating_sub(self.last + 1);
        self.intensity.hold(missed);
        self.need_ratio.hold(missed);

        self.intensity.push(robot.intensity());
        self.need_ratio.push(robot.need_ratio());
        self.last = tick;
    }
}

/// The episodes in progress.
#[derive(Debug, Default)]
pub(super) struct Episodes {
    /// Latest state and episode in progress of each robot.
    robots: BTreeMap<RobotName, (RobotState, Option<Episode>)>,
    /// Robots with a note; each has at most one.
    noted: BTreeSet<RobotName>,
    /// What the document cannot express, for people.
    pub(super) notes: Vec<String>,
}

impl Episodes {
    /// Adds the state of a robot in a tick. Returns the episode that it ends.
    ///
    /// Ticks without a report belong to the episode if the next report has the same emotion. Otherwise the end of the
    /// emotion is not known, and the episode ends with the last report.
    pub(super) fn add(&mut self, tick: Tick, robot: RobotState) -> Option<Episode> {
        if robot.missed {
            return None;
        }
        self.note(&robot);

        let Some((before, episode)) = self.robots.get_mut(&robot.name) else {
            let begun = begin(tick, &robot, &robot);
            self.robots.insert(robot.name.clone(), (robot, begun));
            return None;
        };

        let mut ended = None;
        match episode {
            Some(episode) if episode.begun.emotion == robot.emotion => {
                episode.extend(tick, &robot);
            }
            episode => ended = std::mem::replace(episode, begin(tick, before, &robot)),
        }
        *before = robot;
        ended
    }

    /// The episodes in progress at the end of the run, by robot.
    pub(super) fn end(self) -> impl Iterator<Item = Episode> {
        self.robots.into_values().filter_map(|(_, episode)| episode)
    }

    /// Notes what is missing of a robot, once.
    fn note(&mut self, robot: &RobotState) {
        let lacks_emotion = !robot.has_emotion();
        let lacks_intensity = robot.variables.is_some() && robot.intensity().is_none();
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
fn begin(tick: Tick, before: &RobotState, robot: &RobotState) -> Option<Episode> {
    let has_emotion = robot.has_emotion();
    has_emotion.then(|| Episode::begin(tick, before.clone(), robot.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(emotion: &str, intensity: f64) -> RobotState {
        let variables = [(INTENSITY.to_owned(), intensity.into())].into();
        RobotState {
            name: RobotName::new("Butler").unwrap(),
            missed: false,
            emotion: emotion.to_owned(),
            behavior: String::new(),
            variables: Some(variables),
        }
    }

    fn missed(emotion: &str) -> RobotState {
        RobotState {
            missed: true,
            ..seen(emotion, 0.0)
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
        let intensity = episode.intensity.values().map(<[f64]>::to_vec);
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
    fn missed_ticks_repeat_the_last_report_if_the_next_one_has_the_same_emotion() {
        let found = episodes(vec![
            seen("A", 0.1),
            missed("A"),
            missed("A"),
            seen("A", 0.4),
            missed("A"),
        ]);

        assert_eq!(
            found,
            [("A".to_owned(), 0, 3, Some(vec![0.1, 0.1, 0.1, 0.4]))]
        );

        let found = episodes(vec![seen("A", 0.1), missed("A"), seen("B", 0.4)]);
        assert_eq!(
            found,
            [
                ("A".to_owned(), 0, 0, Some(vec![0.1])),
                ("B".to_owned(), 2, 2, Some(vec![0.4]))
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
