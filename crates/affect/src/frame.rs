//! The affect frame: one emotion of one robot at one moment, with all of its components.

use crate::akr::{Affect, Appraisal};
use crate::episode::Episode;
use crate::scalar::{Caution, Intensity, IntensityLabel, Urgency};
use crate::schema::{Schema, Schemata};

/// State variable with the name of the action tendency.
pub const ACTION_TENDENCY: &str = "action_tendency";
/// State variable with the agency: `self`, or the name of the other.
pub const AGENCY: &str = "agency";
/// State variable with the causal chain: clauses with their kinds, [`CausalChain`](crate::CausalChain).
pub const CAUSAL_CHAIN: &str = "causal_chain";
/// State variable with the trait, 0 to 1.
pub const CAUTION: &str = "caution";
/// State variable with the certainty, 0 to 1.
pub const CERTAINTY: &str = "certainty";
/// State variable with the controllability, 0 to 1.
pub const CONTROLLABILITY: &str = "controllability";
/// State variable with the duration of such states: `minutes`.
pub const DURATION: &str = "duration";
/// State variable with the time since this episode began, seconds.
pub const DURATION_S: &str = "duration_s";
/// State variable with the compatibility with external norms, 0 to 1.
pub const EXTERNAL_NORMS: &str = "external_norms";
/// State variable with the name of the facial expression.
pub const FACIAL_EXPRESSION: &str = "facial_expression";
/// State variable with the focality: the kind and the name of what the emotion is about, such as `event: the delay`.
pub const FOCALITY: &str = "focality";
/// State variable with the goal congruence, -1 to 1.
pub const GOAL_CONGRUENCE: &str = "goal_congruence";
/// State variable with the felt intensity, 0 to 1.
pub const INTENSITY: &str = "intensity";
/// State variable with the compatibility with internal standards, 0 to 1.
pub const INTERNAL_STANDARDS: &str = "internal_standards";
/// State variable with the modifiability: 0, 0.5 or 1.
pub const MODIFIABILITY: &str = "modifiability";
/// State variable with the mood, -1 to 1.
pub const MOOD: &str = "mood";
/// State variable with the novelty, 0 to 1.
pub const NOVELTY: &str = "novelty";
/// State variable with the urgency, 0 to 1.
pub const URGENCY: &str = "urgency";
/// State variable with the signed valence, -1 to 1.
pub const VALENCE: &str = "valence";

/// The value of a component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value<'a> {
    /// On a scale, or in seconds.
    Number(f64),
    /// In words.
    Text(&'a str),
}

/// What a component means, for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Meaning {
    /// The state variable.
    pub variable: &'static str,
    /// What it says, in words that follow its value.
    pub meaning: &'static str,
}

/// What each component means, in the order in which people read them.
pub const MEANINGS: [Meaning; 19] = [
    meaning(VALENCE, "pleasant above 0, unpleasant below"),
    meaning(INTENSITY, "how strongly it is felt"),
    meaning(URGENCY, "how pressing the need behind it is"),
    meaning(FACIAL_EXPRESSION, "what the face shows"),
    meaning(ACTION_TENDENCY, "what it inclines the robot to do"),
    meaning(DURATION, "how long such a state usually lasts"),
    meaning(DURATION_S, "seconds since this episode began"),
    meaning(FOCALITY, "what it is about"),
    meaning(AGENCY, "who is responsible"),
    meaning(
        GOAL_CONGRUENCE,
        "1 nothing is in the way of the goal, -1 it is prevented",
    ),
    meaning(NOVELTY, "how far the situation is from what was predicted"),
    meaning(
        CONTROLLABILITY,
        "share of what the robot could do that it still can",
    ),
    meaning(
        MODIFIABILITY,
        "1 another agent acts on it, 0 none does, 0.5 unknown",
    ),
    meaning(CERTAINTY, "how recent what is known of it is"),
    meaning(EXTERNAL_NORMS, "how far the robot does what it owes others"),
    meaning(
        INTERNAL_STANDARDS,
        "how far it does what it expects of itself",
    ),
    meaning(CAUTION, "the trait: how fast urgency rises"),
    meaning(MOOD, "the slow mean of what is felt"),
    meaning(CAUSAL_CHAIN, "the beliefs and goals behind it"),
];

const fn meaning(variable: &'static str, meaning: &'static str) -> Meaning {
    Meaning { variable, meaning }
}

/// The word for a number on the scale of a component; `None` for one without a scale, such as a time.
///
/// The five labels are those of the intensity [D: S], at the same cuts \[I\]. On scales from -1 to 1 the words are positive and
/// negative.
pub fn word(variable: &str, value: f64, cuts: &[f64; 4]) -> Option<&'static str> {
    match variable {
        VALENCE | MOOD | GOAL_CONGRUENCE if value > 0.0 => Some("positive"),
        VALENCE | MOOD | GOAL_CONGRUENCE if value < 0.0 => Some("negative"),
        INTENSITY | URGENCY | NOVELTY | CONTROLLABILITY | MODIFIABILITY | CERTAINTY
        | EXTERNAL_NORMS | INTERNAL_STANDARDS | CAUTION => {
            let label: IntensityLabel = Intensity::saturating(value).label(cuts);
            Some(label.name())
        }
        _ => None,
    }
}

/// An emotion with its components: what a robot feels, how it appraises its situation, what it is inclined to do, and
/// what it shows.
///
/// A robot builds it from its feeling, its appraisal and its episode, publishes it with its state, and shows it in its panel.
/// Peers, consoles and exports therefore see the same values. By convention, the state variables have the names of
/// [`AffectFrame::components`].
///
/// ```
/// use affect::akr::Appraisal;
/// use affect::{Schemata, Urgency};
/// let appraisal = Appraisal::new(-0.6, 1.0 / 3.0, 1.0);
/// let schemata = Schemata::standard();
/// let concerned = schemata.frame("CONCERNED", Urgency::new(0.5)?, appraisal).ok_or("no schema")?;
/// let happy = schemata.frame("HAPPY", Urgency::new(0.1)?, appraisal).ok_or("no schema")?;
/// assert_eq!((happy.valence(), concerned.valence()), (0.9, -0.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct AffectFrame<'a> {
    name: &'a str,
    urgency: Urgency,
    appraisal: Appraisal,
    schema: &'a Schema,
    episode: Option<&'a Episode>,
    caution: Option<Caution>,
    mood: Option<f64>,
}

impl Schemata {
    /// The emotion with this name in the present situation; `None` if there is no schema for it.
    pub fn frame(
        &self,
        name: &str,
        urgency: Urgency,
        appraisal: Appraisal,
    ) -> Option<AffectFrame<'_>> {
        let (name, schema) = self.entry(name)?;

        Some(AffectFrame {
            name,
            urgency,
            appraisal,
            schema,
            episode: None,
            caution: None,
            mood: None,
        })
    }
}

impl<'a> AffectFrame<'a> {
    /// Adds the episode that the emotion is in: how long it has lasted, its agency, its focality and its causal chain.
    #[must_use]
    pub fn during(mut self, episode: &'a Episode) -> Self {
        self.episode = Some(episode);
        self
    }

    /// Adds the trait of the personality.
    #[must_use]
    pub fn with_caution(mut self, caution: Caution) -> Self {
        self.caution = Some(caution);
        self
    }

    /// Adds the mood: the slow mean of what is felt, -1 to 1.
    #[must_use]
    pub fn with_mood(mut self, mood: f64) -> Self {
        self.mood = Some(mood);
        self
    }

    /// Name of the emotion.
    pub fn name(&self) -> &str {
        self.name
    }

    /// The components that all instances of the emotion share.
    pub fn schema(&self) -> &Schema {
        self.schema
    }

    /// How pressing the need is.
    pub fn urgency(&self) -> Urgency {
        self.urgency
    }

    /// How the robot appraises its situation.
    pub fn appraisal(&self) -> &Appraisal {
        &self.appraisal
    }

    /// The episode, of a robot that keeps track of them.
    pub fn episode(&self) -> Option<&Episode> {
        self.episode
    }

    /// Valence and intensity.
    pub fn affect(&self) -> Affect {
        Affect::new(self.schema.valence, self.urgency)
    }

    /// How strongly the emotion is felt.
    pub fn intensity(&self) -> Intensity {
        self.affect().intensity
    }

    /// The felt intensity with the sign of the valence, -1 to 1.
    pub fn valence(&self) -> f64 {
        self.affect().signed()
    }

    /// The state variables, in alphabetical order, without those that are not known.
    pub fn components(&self) -> impl Iterator<Item = (&'static str, Value<'_>)> {
        let appraisal = &self.appraisal;
        let cause = self.episode.map(Episode::cause);
        let lasted_s = self.episode.map(Episode::lasted_s);
        let text = |value| Some(Value::Text(value));
        let number = |value| Some(Value::Number(value));

        let components = [
            (ACTION_TENDENCY, text(self.schema.action_tendency.name())),
            (AGENCY, cause.map(|cause| Value::Text(cause.agency.name()))),
            (
                CAUSAL_CHAIN,
                cause.map(|cause| Value::Text(&cause.causal_chain)),
            ),
            (
                CAUTION,
                self.caution.map(|caution| Value::Number(caution.value())),
            ),
            (CERTAINTY, number(appraisal.certainty())),
            (CONTROLLABILITY, number(appraisal.controllability())),
            (DURATION, text(self.schema.duration.name())),
            (DURATION_S, lasted_s.map(Value::Number)),
            (
                EXTERNAL_NORMS,
                appraisal.external_norms().map(Value::Number),
            ),
            (
                FACIAL_EXPRESSION,
                text(self.schema.facial_expression.name()),
            ),
            (FOCALITY, cause.map(|cause| Value::Text(&cause.focality))),
            (GOAL_CONGRUENCE, number(appraisal.goal_congruence())),
            (INTENSITY, number(self.intensity().value())),
            (
                INTERNAL_STANDARDS,
                appraisal.internal_standards().map(Value::Number),
            ),
            (MODIFIABILITY, appraisal.modifiability().map(Value::Number)),
            (MOOD, self.mood.map(Value::Number)),
            (NOVELTY, appraisal.novelty().map(Value::Number)),
            (URGENCY, number(self.urgency.value())),
            (VALENCE, number(self.valence())),
        ];
        components
            .into_iter()
            .filter_map(|(name, value)| Some((name, value?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_in_order_and_each_has_a_meaning() {
        let episode = Episode::default();
        let appraisal = Appraisal::new(0.5, 0.5, 0.5)
            .with_novelty(0.5)
            .with_modifiability(0.5)
            .with_standards(0.5, 0.5);
        let frame = Schemata::standard()
            .frame("HAPPY", Urgency::MIN, appraisal)
            .unwrap()
            .during(&episode)
            .with_caution(Caution::default())
            .with_mood(0.0);

        let names: Vec<&str> = frame.components().map(|(name, _)| name).collect();
        assert!(names.is_sorted());
        let mut meant: Vec<&str> = MEANINGS.iter().map(|one| one.variable).collect();
        meant.sort_unstable();
        assert_eq!(names, meant);
    }

    #[test]
    fn numbers_on_a_scale_have_words() {
        let cuts = &IntensityLabel::CUTS;
        assert_eq!(word(NOVELTY, 0.83, cuts), Some("very high"));
        assert_eq!(word(VALENCE, -0.1, cuts), Some("negative"));
        assert_eq!(word(MOOD, 0.0, cuts), None);
        assert_eq!(word(DURATION_S, 3.0, cuts), None);
        assert_eq!(word("treats", 3.0, cuts), None);
    }
}
