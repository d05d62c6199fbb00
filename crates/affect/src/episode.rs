//! Episodes: an emotion from its beginning to its end, and what a robot remembers to appraise it.

use crate::akr::Agency;
use crate::causal::{self, Circumstances};
use crate::schema::Schemata;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// What an episode of an emotion is about, who is responsible, and the beliefs and goals behind it. It is decided when the
/// episode begins, and kept until it ends \[I\].
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpisodeCause {
    /// The agent responsible [D: S].
    pub agency: Agency,
    /// What the emotion is about, as it is published: the kind and the name, as in `event: the delay`.
    pub focality: String,
    /// The causal chain in its published form.
    pub causal_chain: String,
}

impl EpisodeCause {
    /// The causal chain as a sentence; empty without one.
    pub fn spoken(&self) -> String {
        causal::spoken(&self.causal_chain)
    }
}

impl Schemata {
    /// The cause of an emotion that is about `name`, as in "the delay": what kind of thing that is, and the causal chain, follow
    /// from its schema. Without a schema the chain is empty.
    pub fn cause(
        &self,
        emotion: &str,
        agency: Agency,
        name: &str,
        circumstances: &Circumstances<'_>,
    ) -> EpisodeCause {
        let Some(schema) = self.get(emotion) else {
            return EpisodeCause {
                agency,
                focality: name.to_owned(),
                causal_chain: String::new(),
            };
        };

        EpisodeCause {
            agency,
            focality: format!("{}: {name}", schema.focality.name()),
            causal_chain: schema.causal_chain.filled(circumstances).to_string(),
        }
    }
}

/// A time without a break in one emotion.
///
/// ```
/// use affect::akr::Agency;
/// use affect::{Circumstances, Episode, Schemata};
/// let words = Circumstances::default();
/// let cause = |agency| Schemata::standard().cause("CONCERNED", agency, "the delay", &words);
/// let mut episode = Episode::default();
/// episode.update("CONCERNED", 0.5, |_| cause(Agency::Other("Leguin".to_owned())));
/// episode.update("CONCERNED", 0.5, |_| cause(Agency::Oneself));
/// assert_eq!(episode.lasted_s(), 0.5);
/// assert_eq!(episode.cause().agency.name(), "Leguin");
/// assert_eq!(episode.cause().focality, "event: the delay");
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Episode {
    emotion: String,
    lasted_s: f64,
    cause: EpisodeCause,
}

impl Episode {
    /// Advances by `dt_s` seconds. If the emotion is another one than before, an episode begins, with the cause that `begin`
    /// finds; its argument is the episode before.
    pub fn update(&mut self, emotion: &str, dt_s: f64, begin: impl FnOnce(&Self) -> EpisodeCause) {
        if self.emotion == emotion {
            self.lasted_s += dt_s;
            return;
        }

        self.cause = begin(self);
        emotion.clone_into(&mut self.emotion);
        self.lasted_s = 0.0;
    }

    /// The emotion; empty before the first one.
    pub fn emotion(&self) -> &str {
        &self.emotion
    }

    /// Time since the episode began, seconds.
    pub fn lasted_s(&self) -> f64 {
        self.lasted_s
    }

    /// The cause of the episode.
    pub fn cause(&self) -> &EpisodeCause {
        &self.cause
    }
}

/// Most ticks that a memory goes back.
const MAX_TICKS: usize = 10_000;

/// How many ticks are in a time: at least one, and not more than memories go back.
fn ticks_in(time_s: f64, dt_s: f64) -> usize {
    ((time_s / dt_s).round() as usize).clamp(1, MAX_TICKS)
}

/// How new the value of a measure is: how far it is from what its trend predicted \[I\].
///
/// That novelty is a component is documented [D: S]; its values were not readable. The prediction for now was made one
/// horizon ago, and continues the change over the horizon before. Values are in `[0, 1]`, and so are predictions.
///
/// ```
/// let mut measure = affect::Prediction::default();
/// for value in [0.1, 0.2, 0.3, 0.4, 0.5] {
///     measure.observe(value, 2.0, 1.0);
/// }
/// assert!(measure.novelty() < 1e-9, "it rises as before");
/// measure.observe(0.0, 2.0, 1.0);
/// assert!((measure.novelty() - 0.6).abs() < 1e-9, "0.6 was predicted");
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prediction {
    /// The values of the last two horizons, oldest first.
    values: VecDeque<f64>,
    novelty: f64,
}

impl Prediction {
    /// Adds the value of a tick of `dt_s` seconds.
    pub fn observe(&mut self, value: f64, horizon_s: f64, dt_s: f64) {
        let ticks = ticks_in(horizon_s, dt_s);
        self.values.push_back(value);
        while self.values.len() > 2 * ticks + 1 {
            self.values.pop_front();
        }

        // Nothing was predicted before the first horizon is over.
        let last = self.values.len() - 1;
        let Some(base) = last.checked_sub(ticks) else {
            self.novelty = 0.0;
            return;
        };
        let trend = match base.min(ticks) {
            0 => 0.0,
            known => (self.values[base] - self.values[base - known]) / known as f64 * ticks as f64,
        };
        let predicted = (self.values[base] + trend).clamp(0.0, 1.0);
        self.novelty = (value - predicted).abs();
    }

    /// How far the last value is from its prediction, 0 to 1; 0 if there was none.
    pub fn novelty(&self) -> f64 {
        self.novelty
    }
}

/// The share of what was good among all that happened in recent ticks.
///
/// ```
/// let mut asked = affect::RecentShare::default();
/// assert_eq!(asked.share(), 1.0);
/// asked.add(3, 4, 60.0, 0.5);
/// asked.add(0, 0, 60.0, 0.5);
/// assert_eq!(asked.share(), 0.75);
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecentShare {
    /// Good and all of each tick, oldest first.
    ticks: VecDeque<(u32, u32)>,
    /// Sums of both.
    good: u64,
    all: u64,
}

impl RecentShare {
    /// Adds a tick of `dt_s` seconds in which `good` of `all` were good, and forgets what is older than `recent_s`.
    pub fn add(&mut self, good: u32, all: u32, recent_s: f64, dt_s: f64) {
        self.ticks.push_back((good, all));
        self.good += u64::from(good);
        self.all += u64::from(all);

        while self.ticks.len() > ticks_in(recent_s, dt_s) {
            if let Some((good, all)) = self.ticks.pop_front() {
                self.good -= u64::from(good);
                self.all -= u64::from(all);
            }
        }
    }

    /// The share, 0 to 1; 1 if nothing happened.
    pub fn share(&self) -> f64 {
        if self.all == 0 {
            1.0
        } else {
            self.good as f64 / self.all as f64
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_kept_until_another_emotion_begins() {
        let mut episode = Episode::default();
        let by = |name: &str| EpisodeCause {
            agency: Agency::Other(name.to_owned()),
            ..EpisodeCause::default()
        };

        episode.update("CONCERNED", 0.5, |before| {
            assert_eq!(before.cause.agency, Agency::Oneself);
            by("Leguin")
        });
        assert_eq!(episode.lasted_s(), 0.0);
        for _ in 0..4 {
            episode.update("CONCERNED", 0.5, |_| by("the crowd"));
        }
        assert_eq!((episode.lasted_s(), episode.cause()), (2.0, &by("Leguin")));

        episode.update("FRUSTRATED", 0.5, |before| {
            assert_eq!(before.emotion(), "CONCERNED");
            assert_eq!(before.cause(), &by("Leguin"));
            by("the crowd")
        });
        assert_eq!(
            (episode.lasted_s(), episode.cause()),
            (0.0, &by("the crowd"))
        );
    }

    #[test]
    fn nothing_is_new_before_anything_was_predicted() {
        let mut measure = Prediction::default();
        for value in [0.0, 1.0] {
            measure.observe(value, 1.0, 0.5);
            assert_eq!(measure.novelty(), 0.0);
        }
        measure.observe(1.0, 1.0, 0.5);
        assert_eq!(
            measure.novelty(),
            1.0,
            "0 was predicted, as nothing was known of a trend"
        );
    }

    #[test]
    fn what_stays_and_what_goes_on_is_not_new_and_a_turn_is() {
        let mut measure = Prediction::default();
        for _ in 0..30 {
            measure.observe(0.3, 5.0, 0.5);
            assert_eq!(measure.novelty(), 0.0);
        }
        // It jumps, and after one horizon the jump is known, and taken for a trend.
        for _ in 0..10 {
            measure.observe(0.6, 5.0, 0.5);
            assert!((measure.novelty() - 0.3).abs() < 1e-9);
        }
        measure.observe(0.6, 5.0, 0.5);
        assert!((measure.novelty() - 0.3).abs() < 1e-9, "0.9 was predicted");
        for _ in 0..20 {
            measure.observe(0.6, 5.0, 0.5);
        }
        assert_eq!(measure.novelty(), 0.0);
    }

    #[test]
    fn a_share_forgets_what_is_not_recent() {
        let mut share = RecentShare::default();
        share.add(0, 1, 1.0, 0.5);
        assert_eq!(share.share(), 0.0);
        share.add(1, 1, 1.0, 0.5);
        assert_eq!(share.share(), 0.5);
        share.add(1, 1, 1.0, 0.5);
        assert_eq!(share.share(), 1.0);
        share.add(0, 0, 1.0, 0.5);
        share.add(0, 0, 1.0, 0.5);
        assert_eq!(share.share(), 1.0, "nothing happened");
    }
}
