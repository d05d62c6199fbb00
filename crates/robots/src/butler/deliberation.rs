//! How Butler deliberates, if an experiment switches it on: what he believes of himself, and what he plans while he is
//! FRUSTRATED.
//!
//! The paper documents both and gives no numbers: the belief "I can't do this" keeps an agent DISCOURAGED until it believes
//! that it can, and the conceptual level projects the outcomes of actions and compares anticipated emotions \[D\]. What
//! makes Butler believe, what he chooses from, and how he projects is chosen here \[I\]. The paper's hall runs without.

use std::collections::BTreeSet;

use affect::akr::{ActionTendency, Affect, Personality, Preference, Valence};
use affect::levels::{ActionOutcome, Candidate, Conceptual, ConceptualParameters, Memory};
use affect::progress::{need_ratio, time_to_empty_s};
use affect::{Caution, Feeling, StandardEmotion, Urgency};
use serde::{Deserialize, Serialize};

use crate::belief::{BeliefParameters, Beliefs};
use crate::bounds::positive;
use crate::policy::Urge;
use crate::switch::Switch;

/// What he deliberates about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Deliberation {
    /// Whether he has beliefs about himself. With `off` he is neither DISCOURAGED nor HOPEFUL. Default off \[I\].
    pub beliefs: Switch,
    /// After how many INTERCEPTs in a row that came to nothing he believes that he cannot be refilled. Default 2 \[I\].
    pub discouraged_after: u32,
    /// Whether he plans while he is FRUSTRATED: the conceptual level. With `off` he follows his action tendency and
    /// intercepts. Default off \[I\].
    pub conceptual: Switch,
    /// Time for which he follows a plan before he compares again, s; also how far he projects. Default 5 \[I\].
    pub plan_s: f64,
    /// Which anticipated affect counts in his plans. Default both \[D\].
    pub preferences: BTreeSet<Preference>,
    /// Constants of the conceptual level.
    pub level: ConceptualParameters,
}

impl Default for Deliberation {
    fn default() -> Self {
        Self {
            beliefs: BeliefParameters::default().beliefs,
            discouraged_after: BeliefParameters::default().discouraged_after,
            conceptual: Switch::Off,
            plan_s: 5.0,
            preferences: Personality::default().preferences,
            level: ConceptualParameters::default(),
        }
    }
}

impl Deliberation {
    /// Whether he has beliefs about himself, and how soon he despairs.
    pub(super) fn beliefs(&self) -> BeliefParameters {
        BeliefParameters {
            beliefs: self.beliefs,
            discouraged_after: self.discouraged_after,
        }
    }
}

/// What he can do while he is FRUSTRATED.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FrustratedPlan {
    /// To meet the refiller.
    Intercept,
    /// To serve what is left, wherever that leads him.
    ServeOn,
    /// To serve near his start, where he does not walk away from the refiller.
    WaitAtStart,
}

impl FrustratedPlan {
    /// The name under which it is published.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Intercept => "intercept",
            Self::ServeOn => "serve on",
            Self::WaitAtStart => "wait at start",
        }
    }
}

/// What he knows when he plans.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prospects {
    pub(super) treats: f64,
    pub(super) rate_per_s: f64,
    /// Time until the refiller can be here.
    pub(super) serve_on_s: f64,
    /// Time until she can be at his start.
    pub(super) wait_at_start_s: f64,
    /// Time until he can meet her on her way; `None` if he cannot drive to her now.
    pub(super) intercept_s: Option<f64>,
}

/// What he remembers from tick to tick of what he believes and plans.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mind {
    /// What he believes; he gives up INTERCEPTs.
    pub(super) beliefs: Beliefs,
    plan: Option<ActivePlan>,
    memory: Memory<StandardEmotion, FrustratedPlan>,
}

/// A plan that he follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ActivePlan {
    plan: FrustratedPlan,
    /// His emotion when he chose it.
    emotion: StandardEmotion,
    /// Time for which he has followed it.
    lasted_s: f64,
}

impl Mind {
    /// The plan that he follows, if any.
    pub(super) fn plan(&self) -> Option<FrustratedPlan> {
        self.plan.map(|planned| planned.plan)
    }
}

/// The rule by which he deliberates.
#[derive(Debug, Clone)]
pub(super) struct Deliberator {
    parameters: Deliberation,
    level: Conceptual,
    gain: f64,
    rho_max: f64,
}

impl Deliberator {
    /// `gain` and `rho_max` are those of his emotions: he anticipates what he would feel.
    ///
    /// # Errors
    /// What is wrong with the parameters.
    pub(super) fn new(
        parameters: Deliberation,
        caution: Caution,
        gain: f64,
        rho_max: f64,
    ) -> Result<Self, String> {
        positive("deliberation.plan_s", parameters.plan_s)?;
        parameters.beliefs().check()?;

        let personality = Personality {
            caution,
            preferences: parameters.preferences.clone(),
        };
        let level = Conceptual::new(parameters.level, &personality)
            .map_err(|error| format!("deliberation.level: {error}"))?;

        Ok(Self {
            parameters,
            level,
            gain,
            rho_max,
        })
    }

    /// Whether he plans at all.
    pub(super) fn plans(&self) -> bool {
        self.parameters.conceptual.is_on()
    }

    /// Chooses a plan when he is FRUSTRATED and has none or has followed it for long enough; learns from the one before.
    pub(super) fn plan(
        &self,
        mind: &mut Mind,
        feeling: Feeling<StandardEmotion>,
        prospects: &Prospects,
        dt_s: f64,
    ) {
        let is_frustrated = feeling.emotion == StandardEmotion::Frustrated;
        if let Some(planned) = &mut mind.plan {
            planned.lasted_s += dt_s;
            let is_possible =
                planned.plan != FrustratedPlan::Intercept || prospects.intercept_s.is_some();
            if is_frustrated && is_possible && planned.lasted_s < self.parameters.plan_s {
                return;
            }
        }

        if let Some(planned) = mind.plan.take() {
            mind.memory
                .remember(planned.emotion, &planned.plan, feeling.affect());
        }
        if is_frustrated {
            mind.plan = self.choose(&mind.memory, mind.beliefs.given_up(), feeling, prospects);
        }
    }

    fn choose(
        &self,
        memory: &Memory<StandardEmotion, FrustratedPlan>,
        given_up: u32,
        feeling: Feeling<StandardEmotion>,
        prospects: &Prospects,
    ) -> Option<ActivePlan> {
        let mut candidates = Vec::new();
        if let Some(intercept_s) = prospects.intercept_s {
            // Guests take no treats meanwhile. The more often he tried in vain, the less he expects of it.
            let met = self.anticipated(prospects.treats, intercept_s, prospects);
            let in_vain = feeling.affect();
            let probability = 1.0 / (1.0 + f64::from(given_up));
            let outcomes = vec![
                self.outcome(probability, met),
                self.outcome(1.0 - probability, in_vain),
            ];
            let tendency = Some(ActionTendency::ChangeCurrentStrategy);
            candidates.push(candidate(FrustratedPlan::Intercept, tendency, outcomes));
        }

        let taken = prospects.rate_per_s * self.parameters.plan_s;
        let treats = (prospects.treats - taken).max(0.0);
        let serving = [
            (FrustratedPlan::ServeOn, prospects.serve_on_s),
            (FrustratedPlan::WaitAtStart, prospects.wait_at_start_s),
        ];
        for (plan, arrival_s) in serving {
            let felt = self.anticipated(treats, arrival_s, prospects);
            candidates.push(candidate(plan, None, vec![self.outcome(1.0, felt)]));
        }

        let tendency = Some(ActionTendency::ChangeCurrentStrategy);
        let choice = self
            .level
            .deliberate(feeling, tendency, &candidates, memory)?;
        Some(ActivePlan {
            plan: choice.action,
            emotion: feeling.emotion,
            lasted_s: 0.0,
        })
    }

    fn outcome(&self, probability: f64, anticipated: Affect) -> ActionOutcome {
        ActionOutcome {
            probability,
            after_s: self.parameters.plan_s,
            anticipated,
        }
    }

    /// What he would feel with so many treats and the refiller still so far: the need of that moment, as he appraises it.
    /// Below half of the need that saturates his emotion it is pleasant.
    fn anticipated(&self, treats: f64, arrival_s: f64, prospects: &Prospects) -> Affect {
        let left_s = (arrival_s - self.parameters.plan_s).max(0.0);
        let empty_s = time_to_empty_s(treats, prospects.rate_per_s);
        let need = need_ratio(left_s, empty_s, prospects.rate_per_s);
        let urgency = Urgency::saturating(self.gain * need / self.rho_max);

        let valence = if urgency.value() < 0.5 {
            Valence::Positive
        } else {
            Valence::Negative
        };
        Affect::new(valence, urgency)
    }

    /// How far he goes to be refilled.
    ///
    /// A plan takes the place of the action tendency of FRUSTRATED. HOPEFUL inclines him to approach.
    pub(super) fn urge(&self, emotion: StandardEmotion, mind: &Mind, need: bool) -> Urge {
        match (emotion, mind.plan()) {
            (
                StandardEmotion::Frustrated,
                Some(FrustratedPlan::ServeOn | FrustratedPlan::WaitAtStart),
            ) => Urge::Hurry,
            (StandardEmotion::Hopeful, _) if need => Urge::Intercept,
            _ => Urge::of(emotion),
        }
    }
}

fn candidate(
    plan: FrustratedPlan,
    tendency: Option<ActionTendency>,
    outcomes: Vec<ActionOutcome>,
) -> Candidate<FrustratedPlan> {
    match Candidate::new(plan, tendency, outcomes) {
        Ok(candidate) => candidate,
        Err(error) => unreachable!("the probabilities of {plan:?} add up to 1: {error}"),
    }
}
