//! Episodes: the longest spans of ticks in which a robot is in one emotion state.

use std::collections::{BTreeMap, BTreeSet};

use protocol::messages::StateVariables;
use protocol::{RobotName, Tick};

use super::notes::note;

/// The variables by which a robot publishes how strongly it feels, and how its need compares with what can be done.
const INTENSITY: &str = "intensity";
const NEED_RATIO: &str = "need_ratio";

/// How a robot without emotions names its state.
const NEUTRAL: &str = "NEUTRAL";

/// What a robot showed of itself in a tick.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) name: RobotName,
    /// Whether its report is missing, so that the rest is older.
    pub(super) missed: bool,
    pub(super) emotion: String,
    pub(super) behavior: String,
    /// What it published; `None` where that is not known.
    pub(super) variables: Option<StateVariables>,
}

impl Seen {
    /// A number that it published, if it is one.
    fn number(&self, name: &str) -> Option<f64> {
        self.variables.as_ref()?.get(name)?.as_f64()
    }

    /// A text that it published, if it is one.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.variables.as_ref()?.get(name)?.as_str()
    }

    /// A flag that it published.
    pub(super) fn flag(&self, name: &str) -> bool {
        self.variables
            .as_ref()
            .and_then(|variables| variables.get(name)?.as_bool())
            .unwrap_or(false)
    }

    /// A number that it published, as people write it.
    pub(super) fn number_in_words(&self, name: &str) -> Option<String> {
        self.number(name).map(|number| number.to_string())
    }
}

/// A number for every tick of an episode, or nothing: a trace has no holes.
#[derive(Debug)]
pub(super) struct Trace(Option<Vec<f64>>);

impl Trace {
    fn push(&mut self, value: Option<f64>) {
        match (&mut self.0, value) {
            (Some(values), Some(value)) => values.push(value),
            _ => self.0 = None,
        }
    }

    /// Repeats the last number for ticks in which nothing was heard.
    fn hold(&mut self, ticks: u64) {
        if let Some(values) = &mut self.0 {
            let last = values.last().copied();
            (0..ticks).for_each(|_| values.extend(last));
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
    /// The robot in the first tick of it.
    pub(super) begun: Seen,
    /// The robot in the tick before: an emotion comes from what was done then.
    pub(super) before: Seen,
    /// First tick.
    pub(super) first: Tick,
    /// Last tick in which the robot was heard.
    pub(super) last: Tick,
    /// How strongly it was felt, 0 to 1.
    pub(super) intensity: Trace,
    /// How the robot's need compared with what could be done.
    pub(super) need_ratio: Trace,
}

impl Episode {
    fn begin(tick: Tick, before: Seen, begun: Seen) -> Self {
        let trace = || Trace(Some(Vec::new()));
        let mut episode = Self {
            begun,
            before,
            first: tick,
            last: tick,
            intensity: trace(),
            need_ratio: trace(),
        };
        let (intensity, need_ratio) = measures(&episode.begun);
        episode.intensity.push(intensity);
        episode.need_ratio.push(need_ratio);

        episode
    }

    fn go_on(&mut self, tick: Tick, seen: &Seen) {
        let unheard = tick.saturating_sub(self.last + 1);
        let (intensity, need_ratio) = measures(seen);

        for (trace, value) in [
            (&mut self.intensity, intensity),
            (&mut self.need_ratio, need_ratio),
        ] {
            trace.hold(unheard);
            trace.push(value);
        }

        self.last = tick;
    }
}

/// Intensity and need ratio. A number outside of its range means something else than it does here.
fn measures(seen: &Seen) -> (Option<f64>, Option<f64>) {
    let intensity = seen
        .number(INTENSITY)
        .filter(|value| (0.0..=1.0).contains(value));
    let need_ratio = seen.number(NEED_RATIO).filter(|value| *value >= 0.0);
    (intensity, need_ratio)
}

/// The episodes in progress.
#[derive(Debug, Default)]
pub(super) struct Episodes {
    robots: BTreeMap<RobotName, (Seen, Option<Episode>)>,
    /// Of whom something was said already.
    noted: BTreeSet<RobotName>,
}

impl Episodes {
    /// Takes in a robot of a tick; returns the episode that it ended.
    ///
    /// Ticks without a report belong to the episode if the next report still names the same emotion. If it does not, or
    /// none comes, nobody knows when the emotion ended, and the episode ends with the last report.
    pub(super) fn see(&mut self, tick: Tick, seen: Seen) -> Option<Episode> {
        if seen.missed {
            return None;
        }

        self.note_oddities(&seen);
        let feels = !seen.emotion.is_empty() && seen.emotion != NEUTRAL;
        let Some((before, episode)) = self.robots.get_mut(&seen.name) else {
            let episode = feels.then(|| Episode::begin(tick, seen.clone(), seen.clone()));
            self.robots.insert(seen.name.clone(), (seen, episode));
            return None;
        };

        let mut ended = None;
        match episode {
            Some(episode) if episode.begun.emotion == seen.emotion => episode.go_on(tick, &seen),
            episode => {
                let begun = feels.then(|| Episode::begin(tick, before.clone(), seen.clone()));
                ended = std::mem::replace(episode, begun);
            }
        }

        *before = seen;

        ended
    }

    /// The episodes that the end of the run ended, by robot.
    pub(super) fn end(self) -> impl Iterator<Item = Episode> {
        self.robots.into_values().filter_map(|(_, episode)| episode)
    }

    fn note_oddities(&mut self, seen: &Seen) {
        let is_without = seen.emotion.is_empty() || seen.emotion == NEUTRAL;
        let lacks_intensity = seen.variables.is_some() && measures(seen).0.is_none();
        if !(is_without || lacks_intensity) || !self.noted.insert(seen.name.clone()) {
            return;
        }

        let name = &seen.name;

        if is_without {
            note(&format!(
                "{name} has a state without emotion, {:?}, which is left out",
                seen.emotion
            ));
        } else {
            note(&format!(
                "{name} does not publish `{INTENSITY}` between 0 and 1 in every tick; its emotions have no intensity then"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(emotion: &str, intensity: f64) -> Seen {
        let variables = [(INTENSITY.to_owned(), intensity.into())].into();
        Seen {
            name: RobotName::new("Butler").unwrap(),
            missed: false,
            emotion: emotion.to_owned(),
            behavior: String::new(),
            variables: Some(variables),
        }
    }

    fn missed(emotion: &str) -> Seen {
        Seen {
            missed: true,
            ..seen(emotion, 0.0)
        }
    }

    /// Emotion, first and last tick, intensities.
    type Short = (String, Tick, Tick, Option<Vec<f64>>);

    fn episodes(ticks: Vec<Seen>) -> Vec<Short> {
        let mut episodes = Episodes::default();
        let mut all: Vec<Episode> = (0..)
            .zip(ticks)
            .filter_map(|(tick, seen)| episodes.see(tick, seen))
            .collect();
        all.extend(episodes.end());
        let short = |episode: Episode| {
            let intensity = episode.intensity.values().map(<[f64]>::to_vec);
            (
                episode.begun.emotion,
                episode.first,
                episode.last,
                intensity,
            )
        };

        all.into_iter().map(short).collect()
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
    fn what_was_not_heard_is_held_between_reports_and_not_made_up_after_the_last() {
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
    fn a_trace_has_no_holes_and_no_numbers_of_another_scale() {
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
