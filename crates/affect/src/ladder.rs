//! The order of emotions: which follows which, and at what intensity.
//!
//! Intensity alone does not say what is felt. A ladder does: rungs in ascending order, each with the
//! intensity that enters it, and beside it the two emotions that come from beliefs.

use crate::label::{EmotionLabel, StandardEmotion};
use crate::parameters::{DynamicsParameters, ParameterError, StateSet, ascending, not_negative};
use StandardEmotion::{Angry, Concerned, Confident, Discouraged, Frustrated, Happy, Hopeful};

/// One emotion on a ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rung<E> {
    /// The emotion.
    pub emotion: E,
    /// Intensity that enters it; without meaning for the lowest rung.
    pub enter: f64,
    /// How long, in seconds, intensity must stay above `enter` first; 0 for at once.
    pub hold_s: f64,
    /// Whether it is entered only while somebody else is to blame.
    pub needs_blame: bool,
}

impl<E> Rung<E> {
    /// A rung that is entered as soon as intensity reaches `enter`.
    pub fn new(emotion: E, enter: f64) -> Self {
        Self {
            emotion,
            enter,
            hold_s: 0.0,
            needs_blame: false,
        }
    }
}

/// The two emotions that follow beliefs and not intensity [D: S].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeliefEmotions<E> {
    /// Felt, and kept, while the robot believes that it cannot [D: S].
    pub discouraged: E,
    /// Follows as soon as it believes that it can [D: S].
    pub hopeful: E,
    /// The lowest rung from which "cannot" discourages \[I\].
    pub from: E,
}

/// A set of emotions in ascending order.
#[derive(Debug, Clone, PartialEq)]
pub struct Ladder<E> {
    rungs: Vec<Rung<E>>,
    beliefs: Option<BeliefEmotions<E>>,
}

/// Where an emotion stands with respect to a ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    Rung(usize),
    Discouraged,
    Hopeful,
    Elsewhere,
}

impl<E: EmotionLabel> Ladder<E> {
    /// Builds a ladder from rungs in ascending order, the first of which is where a robot starts.
    ///
    /// Refused are an empty ladder, thresholds that do not ascend within `(0, 1]` (the first rung has
    /// none), and an emotion that occurs twice.
    pub fn new(rungs: Vec<Rung<E>>) -> Result<Self, ParameterError> {
        let Some((_, above)) = rungs.split_first() else {
            return Err(ParameterError::NoRungs);
        };
        ascending(&above.iter().map(|rung| rung.enter).collect::<Vec<_>>())?;
        for rung in above {
            not_negative("hold_s", rung.hold_s)?;
        }
        let ladder = Self {
            rungs,
            beliefs: None,
        };
        ladder.distinct()?;
        Ok(ladder)
    }

    /// Adds the two emotions that follow beliefs.
    pub fn with_beliefs(mut self, beliefs: BeliefEmotions<E>) -> Result<Self, ParameterError> {
        if self.rungs.iter().all(|rung| rung.emotion != beliefs.from) {
            return Err(ParameterError::NotOnLadder(beliefs.from.name()));
        }
        self.beliefs = Some(beliefs);
        self.distinct()?;
        Ok(self)
    }

    /// The rungs, lowest first. There is at least one.
    pub fn rungs(&self) -> &[Rung<E>] {
        &self.rungs
    }

    /// The emotions that follow beliefs, if this ladder has them.
    pub fn beliefs(&self) -> Option<&BeliefEmotions<E>> {
        self.beliefs.as_ref()
    }

    /// The emotion in which a robot starts, and to which an achieved goal returns it.
    pub fn start(&self) -> E {
        self.rungs[0].emotion
    }

    /// The highest rung, not above rung `limit`, that `intensity` alone reaches.
    pub(crate) fn rung_for(&self, intensity: f64, limit: usize) -> usize {
        let is_reached =
            |rung: &&Rung<E>| intensity >= rung.enter && rung.hold_s == 0.0 && !rung.needs_blame;
        self.rungs
            .iter()
            .skip(1)
            .take_while(is_reached)
            .count()
            .min(limit)
    }

    pub(crate) fn place(&self, emotion: E) -> Place {
        if let Some(index) = self.rungs.iter().position(|rung| rung.emotion == emotion) {
            return Place::Rung(index);
        }
        match &self.beliefs {
            Some(beliefs) if beliefs.discouraged == emotion => Place::Discouraged,
            Some(beliefs) if beliefs.hopeful == emotion => Place::Hopeful,
            _ => Place::Elsewhere,
        }
    }

    /// Index of the rung from which "cannot" discourages; none without beliefs.
    pub(crate) fn discouraging_rung(&self) -> Option<usize> {
        let from = self.beliefs.as_ref()?.from;
        self.rungs.iter().position(|rung| rung.emotion == from)
    }

    fn distinct(&self) -> Result<(), ParameterError> {
        let mut seen: Vec<E> = self.rungs.iter().map(|rung| rung.emotion).collect();
        if let Some(beliefs) = &self.beliefs {
            seen.extend([beliefs.discouraged, beliefs.hopeful]);
        }
        for (index, emotion) in seen.iter().enumerate() {
            if seen[..index].contains(emotion) {
                return Err(ParameterError::Repeated(emotion.name()));
            }
        }
        Ok(())
    }
}

impl Ladder<StandardEmotion> {
    /// The ladder of the documented robots, in the state set that the parameters name.
    ///
    /// `murphy4` climbs in the order of the seed's Table 2 [D: S]. In `akr4` HAPPY takes the place of
    /// CONFIDENT, and ANGRY follows FRUSTRATED once intensity has been extreme for long and somebody else
    /// is to blame; the seed shows that state and not how it is entered \[I\].
    pub fn standard(parameters: &DynamicsParameters) -> Result<Self, ParameterError> {
        parameters.check()?;
        let happy = Rung::new(Happy, 0.0);
        let confident = Rung::new(Confident, parameters.th_confident);
        let concerned = Rung::new(Concerned, parameters.th_concerned);
        let frustrated = Rung::new(Frustrated, parameters.th_frustrated);
        let angry = Rung {
            emotion: Angry,
            enter: parameters.th_angry,
            hold_s: parameters.anger_s,
            needs_blame: true,
        };
        let rungs = match parameters.state_set {
            StateSet::Murphy4 => vec![happy, confident, concerned, frustrated],
            StateSet::Akr4 => vec![happy, concerned, frustrated, angry],
        };
        let beliefs = BeliefEmotions {
            discouraged: Discouraged,
            hopeful: Hopeful,
            from: Frustrated,
        };
        Self::new(rungs)?.with_beliefs(beliefs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_documented_sets_start_happy() {
        for (state_set, emotions) in [
            (StateSet::Murphy4, [Happy, Confident, Concerned, Frustrated]),
            (StateSet::Akr4, [Happy, Concerned, Frustrated, Angry]),
        ] {
            let parameters = DynamicsParameters {
                state_set,
                ..Default::default()
            };
            let ladder = Ladder::standard(&parameters).unwrap();
            assert_eq!(
                ladder
                    .rungs()
                    .iter()
                    .map(|rung| rung.emotion)
                    .collect::<Vec<_>>(),
                emotions
            );
            assert_eq!(ladder.start(), Happy);
        }
    }

    #[test]
    fn a_ladder_that_would_be_ambiguous_is_refused() {
        let refusal = |rungs| Ladder::new(rungs).unwrap_err();
        assert_eq!(refusal(vec![]), ParameterError::NoRungs);
        assert_eq!(
            refusal(vec![
                Rung::new(Happy, 0.0),
                Rung::new(Concerned, 0.5),
                Rung::new(Happy, 0.6)
            ]),
            ParameterError::Repeated("HAPPY")
        );
        assert!(matches!(
            refusal(vec![
                Rung::new(Happy, 0.0),
                Rung::new(Concerned, 0.5),
                Rung::new(Angry, 0.5)
            ]),
            ParameterError::NotAscending { .. }
        ));
        let beliefs = BeliefEmotions {
            discouraged: Discouraged,
            hopeful: Hopeful,
            from: Angry,
        };
        let ladder = Ladder::new(vec![Rung::new(Happy, 0.0)]).unwrap();
        assert_eq!(
            ladder.with_beliefs(beliefs),
            Err(ParameterError::NotOnLadder("ANGRY"))
        );
    }
}
