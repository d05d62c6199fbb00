//! The affect frame: one emotion of one robot at one moment, with all of its components.

use crate::akr::{Affect, Appraisal};
use crate::causal::Circumstances;
use crate::scalar::{Intensity, Urgency};
use crate::schema::{Schema, Schemata};

/// State variable with the signed valence, -1 to 1.
pub const VALENCE: &str = "valence";
/// State variable with the felt intensity, 0 to 1.
pub const INTENSITY: &str = "intensity";
/// State variable with the urgency, 0 to 1.
pub const URGENCY: &str = "urgency";
/// State variable with the goal congruence, -1 to 1.
pub const GOAL_CONGRUENCE: &str = "goal_congruence";
/// State variable with the controllability, 0 to 1.
pub const CONTROLLABILITY: &str = "controllability";
/// State variable with the certainty, 0 to 1.
pub const CERTAINTY: &str = "certainty";
/// State variable with the agency: `self`, or the name of the other.
pub const AGENCY: &str = "agency";
/// State variable with the name of the action tendency.
pub const ACTION_TENDENCY: &str = "action_tendency";
/// State variable with the name of the facial expression.
pub const FACIAL_EXPRESSION: &str = "facial_expression";

/// An emotion with its components: what a robot feels, how it appraises its situation, what it is inclined to do, and
/// what it shows.
///
/// A robot builds it from its feeling and its appraisal, publishes it with its state, and shows it in its panel. Peers,
/// consoles and exports therefore see the same values. By convention, the state variables have the names of
/// [`AffectFrame::numbers`] and [`AffectFrame::texts`].
///
/// ```
/// use affect::akr::{Agency, Appraisal};
/// use affect::{Circumstances, Schemata, Urgency};
/// let appraisal = Appraisal::new(-0.6, 1.0 / 3.0, 1.0, Agency::Other("Leguin".to_owned()));
/// let schemata = Schemata::standard();
/// let concerned = schemata.frame("CONCERNED", Urgency::new(0.5)?, appraisal.clone()).ok_or("no schema")?;
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
        })
    }
}

impl AffectFrame<'_> {
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

    /// The cause of the emotion in words.
    pub fn why(&self, circumstances: &Circumstances<'_>) -> String {
        self.schema.causal_chain.filled(circumstances).spoken()
    }

    /// The state variables that are numbers.
    pub fn numbers(&self) -> [(&'static str, f64); 6] {
        [
            (VALENCE, self.valence()),
            (INTENSITY, self.intensity().value()),
            (URGENCY, self.urgency.value()),
            (GOAL_CONGRUENCE, self.appraisal.goal_congruence()),
            (CONTROLLABILITY, self.appraisal.controllability()),
            (CERTAINTY, self.appraisal.certainty()),
        ]
    }

    /// The state variables that are texts.
    pub fn texts(&self) -> [(&'static str, &str); 3] {
        [
            (AGENCY, self.appraisal.agency().name()),
            (ACTION_TENDENCY, self.schema.action_tendency.name()),
            (FACIAL_EXPRESSION, self.schema.facial_expression.name()),
        ]
    }
}
